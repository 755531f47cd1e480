// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/map_snapshot.hpp"

#include <cmath>
#include <set>
#include <sstream>
#include <stdexcept>

#include <Eigen/Eigenvalues>

namespace situation_awareness {
namespace {

using namespace object_state;

/// Part of the product of two standard deviations by which rounding may spoil symmetry and definiteness.
constexpr double kRounding = 1e-6;

[[noreturn]] void refuse(const std::string& place, const std::string& name, const std::string& defect) {
  throw std::invalid_argument(place + name + " " + defect);
}

template <class Number>
void check_range(const std::string& place, const std::string& name, Number value, Number low, Number high) {
  if (value >= low && value <= high) return;  // false for NaN
  std::ostringstream defect;
  defect << "= " << value << " is outside [" << low << ", " << high << "]";
  refuse(place, name, defect.str());
}

/// Why no covariance can be so; empty if one can. What is known for sure has a variance of zero: the velocities of what
/// stands, the axis of a circle.
std::string covariance_defect(const Matrix8d& P) {
  Vector8d to_unit;
  for (int i = 0; i < 8; ++i) {
    to_unit(i) = P(i, i) > 0.0 ? 1.0 / std::sqrt(P(i, i)) : 0.0;
    for (int j = 0; j < 8; ++j) {
      if (P(i, i) == 0.0 && (P(i, j) != 0.0 || P(j, i) != 0.0)) return "has a variance of zero with a covariance";
      if (std::abs(P(i, j) - P(j, i)) > kRounding * std::sqrt(P(i, i)) * std::sqrt(P(j, j))) return "is not symmetric";
    }
  }
  const Matrix8d correlation = to_unit.asDiagonal() * P * to_unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix8d> solver(correlation, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() >= -kRounding ? "" : "is not positive semidefinite";
}

/// Checks one field after the other against its own bounds.
class CheckFields {
 public:
  explicit CheckFields(std::string place) : place_(std::move(place)) {}

  void operator()(const char* /*name*/, const std::string& /*value*/) const {}
  void operator()(const char* /*name*/, bool /*value*/) const {}
  void operator()(const char* name, int value) const {
    if (value < 0) refuse(place_, name, "= " + std::to_string(value) + " is negative");
  }
  void operator()(const char* name, TrackState value) const {
    if (value == TrackState::kDeleted)
      refuse(place_, name, std::string("= ") + name_of(value) + " is that of no element");
  }
  void operator()(const char* name, std::uint64_t value, std::uint64_t low, std::uint64_t high) const {
    check_range(place_, name, value, low, high);
  }
  void operator()(const char* name, std::int64_t value, std::int64_t low, std::int64_t high) const {
    check_range(place_, name, value, low, high);
  }
  void operator()(const char* name, double value, Bounds bounds) const {
    check_range(place_, name, value, bounds.low, bounds.high);
  }
  void operator()(const char* name, const Eigen::Vector2d& value, Bounds bounds) const {
    for (const double number : value) check_range(place_, name, number, bounds.low, bounds.high);
  }
  void operator()(const char* name, const Pose2& value, Bounds bounds) const {
    (*this)(name, value.translation_m, bounds);
    check_range(place_, name, value.yaw_rad, bounds.low, bounds.high);
  }
  void operator()(const char* name, const Vector8d& value, Bounds bounds) const {
    for (const double number : value) check_range(place_, name, number, bounds.low, bounds.high);
    const double half_difference_m = value.segment<2>(kShape + 1).norm();
    if (!(value(kShape) > half_difference_m)) refuse(place_, name, "has a radius that is not positive");
  }
  void operator()(const char* name, const Matrix8d& value, Bounds variance) const {
    for (int i = 0; i < 64; ++i) {
      const double low = i % 9 == 0 ? variance.low : -variance.high;  // on the diagonal, or not
      check_range(place_, name, value(i / 8, i % 8), low, variance.high);
    }
    const std::string defect = covariance_defect(value);
    if (!defect.empty()) refuse(place_, name, defect);
  }

 private:
  std::string place_;
};

}  // namespace

void MapSnapshot::validate() const {
  fields(*this, CheckFields(""));
  if (shape != "ellipse" && shape != "circle") refuse("", "shape", "= " + shape + " is neither ellipse nor circle");
  if (elements.size() > map_bounds::kMaxElements) {
    refuse("", "elements", "are more than " + std::to_string(map_bounds::kMaxElements));
  }
  std::set<std::uint64_t> ids;
  for (const MapElement& element : elements) ids.insert(element.id);
  std::uint64_t latest_id = 0;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const MapElement& element = elements[i];
    const std::string place = "elements[" + std::to_string(i) + "] (id " + std::to_string(element.id) + "): ";
    MapElement::fields(element, CheckFields(place));
    if (element.id <= latest_id) refuse(place, "id", "does not grow from element to element");
    if (element.id >= next_id) refuse(place, "id", "is not below next_id");
    latest_id = element.id;
    for (const auto& [name, seen_ns] :
         {std::pair{"first_seen_ns", element.first_seen_ns}, std::pair{"last_seen_ns", element.last_seen_ns}}) {
      if (seen_ns > stamp_ns) refuse(place, name, "is after stamp_ns");
      if (stamp_ns - seen_ns > map_bounds::kMaxAge_ns) refuse(place, name, "is too long before stamp_ns");
    }
    if (element.body == element.id) refuse(place, "body", "is the element itself");
    if (element.body != 0 && ids.count(element.body) == 0) {
      refuse(place, "body", "= " + std::to_string(element.body) + " is not there");
    }
    if (shape == "circle") {
      for (const ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
        const bool round = estimate->x.tail<2>().isZero(0.0) && estimate->P.bottomRows<2>().isZero(0.0);
        if (!round) refuse(place, "standing or moving", "is not a circle");
      }
    }
  }
}

}  // namespace situation_awareness
