// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/map_fields.hpp"

#include <cmath>
#include <map>
#include <sstream>

#include <yaml-cpp/yaml.h>
#include <Eigen/Eigenvalues>

#include "situation_awareness/common/count.hpp"

namespace situation_awareness {
namespace {

/// Tolerance of symmetry and definiteness for rounding, relative to the product of two standard deviations.
constexpr double kRounding = 1e-6;

/// The defect of a number outside a closed interval; empty if it is inside.
template <class Number>
std::string range_defect(Number value, Number low, Number high) {
  if (value >= low && value <= high) return "";  // false for NaN
  std::ostringstream defect;
  defect << "= " << value << " is outside [" << low << ", " << high << "]";
  return defect.str();
}

/// Reason why a matrix is no covariance; empty if it is one. Variances may be zero: of the velocities of a standing
/// object, of the axis of a circle.
std::string covariance_defect(const Eigen::Ref<const Eigen::MatrixXd>& P) {
  Eigen::VectorXd to_unit(P.rows());
  for (Eigen::Index i = 0; i < P.rows(); ++i) {
    to_unit(i) = P(i, i) > 0.0 ? 1.0 / std::sqrt(P(i, i)) : 0.0;
    for (Eigen::Index j = 0; j < P.cols(); ++j) {
      if (P(i, i) == 0.0 && (P(i, j) != 0.0 || P(j, i) != 0.0)) return "has a variance of zero with a covariance";
      if (std::abs(P(i, j) - P(j, i)) > kRounding * std::sqrt(P(i, i)) * std::sqrt(P(j, j))) return "is not symmetric";
    }
  }
  const Eigen::MatrixXd correlation = to_unit.asDiagonal() * P * to_unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(correlation, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() >= -kRounding ? "" : "is not positive semidefinite";
}

}  // namespace

std::string detail::item_place(const std::string& place, const std::string& name, std::size_t item) {
  return place + name + '[' + std::to_string(item) + "]: ";
}

void WriteFields::line(const char* name, const std::string& value) {
  text_ += indent_ + name + (value.empty() ? ":" : ": ") + value + '\n';
}

void WriteFields::matrix(const char* name, const Eigen::Ref<const Eigen::MatrixXd>& value) {
  line(name, "");
  for (Eigen::Index i = 0; i < value.rows(); ++i) {
    text_ += indent_ + "  - [";
    for (Eigen::Index j = 0; j < value.cols(); ++j) text_ += (j == 0 ? "" : ", ") + detail::field_text(value(i, j));
    text_ += "]\n";
  }
}

struct ReadFields::Content {
  std::map<std::string, YAML::Node> fields;  ///< those that were not read yet
};

ReadFields::ReadFields(const YAML::Node& node, std::string place)
    : place_(std::move(place)), content_(std::make_shared<Content>()) {
  if (!node.IsMap()) throw std::invalid_argument(place_ + "is no map of names and values");
  for (const auto& item : node) {
    if (!item.first.IsScalar()) throw std::invalid_argument(place_ + "a name is no text");
    if (!content_->fields.emplace(item.first.Scalar(), item.second).second) {
      refuse(item.first.Scalar(), "is there twice");
    }
  }
}

void ReadFields::refuse(const std::string& name, const std::string& defect) const {
  throw std::invalid_argument(place_ + name + ' ' + defect);
}

YAML::Node ReadFields::take(const std::string& name) {
  const auto field = content_->fields.find(name);
  if (field == content_->fields.end()) refuse(name, "is missing");
  const YAML::Node node = field->second;
  content_->fields.erase(field);
  return node;
}

std::string ReadFields::text(const std::string& name) {
  const YAML::Node node = take(name);
  if (!node.IsScalar()) refuse(name, "is no single value");
  return node.Scalar();
}

ReadFields ReadFields::part(const std::string& name) { return {take(name), place_ + name + ": "}; }

std::vector<ReadFields> ReadFields::list(const char* name, std::size_t max_items) {
  const YAML::Node nodes = take(name);
  if (!nodes.IsSequence()) refuse(name, "is no list");
  if (nodes.size() > max_items) refuse(name, "are more than " + std::to_string(max_items));
  std::vector<ReadFields> items;
  for (const YAML::Node& node : nodes) items.emplace_back(node, detail::item_place(place_, name, items.size()));
  return items;
}

void ReadFields::matrix(const char* name, Eigen::Ref<Eigen::MatrixXd> value) {
  const YAML::Node rows = take(name);
  const auto is_list_of = [](const YAML::Node& node, Eigen::Index size) {
    return node.IsSequence() && node.size() == static_cast<std::size_t>(size);
  };
  if (!is_list_of(rows, value.rows())) refuse(name, "is no list of " + std::to_string(value.rows()) + " rows");
  for (Eigen::Index i = 0; i < value.rows(); ++i) {
    const YAML::Node row = rows[static_cast<std::size_t>(i)];
    if (!is_list_of(row, value.cols())) {
      refuse(name, "has a row that is no list of " + std::to_string(value.cols()) + " numbers");
    }
    for (Eigen::Index j = 0; j < value.cols(); ++j) {
      const YAML::Node number = row[static_cast<std::size_t>(j)];
      if (!number.IsScalar()) refuse(name, "has an element that is no single value");
      read(name, number.Scalar(), value(i, j));
    }
  }
}

void ReadFields::add(const char* name, const std::string& text) {
  if (!content_->fields.emplace(name, YAML::Node(text)).second) refuse(name, "is unknown");
}

void ReadFields::refuse_rest() const {
  if (!content_->fields.empty()) refuse(content_->fields.begin()->first, "is unknown");
}

void CheckFields::refuse(const std::string& name, const std::string& defect) const {
  throw std::invalid_argument(place_ + name + ' ' + defect);
}

void CheckFields::range(const char* name, std::uint64_t value, std::uint64_t low, std::uint64_t high) const {
  const std::string defect = range_defect(value, low, high);
  if (!defect.empty()) refuse(name, defect);
}

void CheckFields::range(const char* name, std::int64_t value, std::int64_t low, std::int64_t high) const {
  const std::string defect = range_defect(value, low, high);
  if (!defect.empty()) refuse(name, defect);
}

void CheckFields::range(const char* name, double value, Bounds bounds) const {
  const std::string defect = range_defect(value, bounds.low, bounds.high);
  if (!defect.empty()) refuse(name, defect);
}

void CheckFields::count(const char* name, int value) const {
  if (value < 0) refuse(name, "= " + std::to_string(value) + " is negative");
  if (value > kMaxCount) refuse(name, "= " + std::to_string(value) + " is above " + std::to_string(kMaxCount));
}

void CheckFields::size(const char* name, std::size_t items, std::size_t max_items) const {
  if (items > max_items) refuse(name, "are more than " + std::to_string(max_items));
}

void CheckFields::covariance(const char* name, const Eigen::Ref<const Eigen::MatrixXd>& P, Bounds variance) const {
  for (Eigen::Index i = 0; i < P.rows(); ++i) {
    for (Eigen::Index j = 0; j < P.cols(); ++j) {
      range(name, P(i, j), {i == j ? variance.low : -variance.high, variance.high});
    }
  }
  const std::string defect = covariance_defect(P);
  if (!defect.empty()) refuse(name, defect);
}

}  // namespace situation_awareness
