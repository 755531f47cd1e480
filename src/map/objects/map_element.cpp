// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/map_element.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Eigenvalues>

namespace situation_awareness {

const char* name_of(TrackState state) {
  switch (state) {
    case TrackState::kTentative:
      return "tentative";
    case TrackState::kConfirmed:
      return "confirmed";
    case TrackState::kLost:
      return "lost";
    case TrackState::kDeleted:
      return "deleted";
  }
  return "";
}

std::string yaml_text(TrackState state) { return name_of(state); }

void read_yaml_text(const std::string& text, TrackState& state) {
  for (const TrackState known : {TrackState::kTentative, TrackState::kConfirmed, TrackState::kLost}) {
    if (text != name_of(known)) continue;
    state = known;
    return;
  }
  throw std::invalid_argument("must be tentative, confirmed or lost");
}

std::string yaml_text(ObjectClass object_class) { return name_of(object_class); }

void read_yaml_text(const std::string& text, ObjectClass& object_class) {
  for (const ObjectClass known :
       {ObjectClass::kUnknown, ObjectClass::kPerson, ObjectClass::kVehicle, ObjectClass::kPole}) {
    if (text != name_of(known)) continue;
    object_class = known;
    return;
  }
  throw std::invalid_argument("must be unknown, person, vehicle or pole");
}

void take_over_id(std::size_t element, std::size_t heir, std::vector<MapElement>& elements,
                  std::vector<char>& dropped) {
  std::swap(elements[element].id, elements[heir].id);
  std::swap(elements[element].first_seen_ns, elements[heir].first_seen_ns);
  std::swap(elements[element], elements[heir]);
  dropped[element] = 0;
  dropped[heir] = 1;
}

double largest_sigma_m(const Eigen::Matrix2d& covariance_m2) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(covariance_m2, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

double position_sigma_m(const ObjectEstimate& estimate) {
  return largest_sigma_m(estimate.P.block<2, 2>(object_state::kPosition, object_state::kPosition));
}

const MapElement* find_element(std::uint64_t id, const std::vector<MapElement>& elements) {
  const auto place =
      std::lower_bound(elements.begin(), elements.end(), id,
                       [](const MapElement& element, std::uint64_t wanted) { return element.id < wanted; });
  return place != elements.end() && place->id == id ? &*place : nullptr;
}

}  // namespace situation_awareness
