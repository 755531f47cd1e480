// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/map_snapshot.hpp"

#include <set>
#include <string>
#include <utility>

namespace situation_awareness {
namespace {

/// Constraints between fields.
void check_element(const MapElement& element, const CheckFields& check) {
  using namespace object_state;
  if (element.state == TrackState::kDeleted) check.refuse("state", "= deleted is that of no element");
  for (const auto& [name, estimate] :
       {std::pair{"standing", &element.estimate.standing}, std::pair{"moving", &element.estimate.moving}}) {
    const double half_difference_m = estimate->x.segment<2>(kShape + 1).norm();
    if (!(estimate->x(kShape) > half_difference_m)) check.refuse(name, "has a radius that is not positive");
  }
}

}  // namespace

void MapSnapshot::validate() const {
  const CheckFields check;
  fields(*this, check);
  if (shape != "ellipse" && shape != "circle") check.refuse("shape", "= " + shape + " is neither ellipse nor circle");
  if (elements.size() > map_bounds::kMaxElements) {
    check.refuse("elements", "are more than " + std::to_string(map_bounds::kMaxElements));
  }
  std::set<std::uint64_t> ids;
  for (const MapElement& element : elements) ids.insert(element.id);
  std::uint64_t latest_id = 0;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const MapElement& element = elements[i];
    const std::string place = "elements[" + std::to_string(i) + "] (id " + std::to_string(element.id) + "): ";
    const CheckFields check_fields(place);
    MapElement::fields(element, check_fields);
    check_element(element, check_fields);
    if (element.id <= latest_id) check_fields.refuse("id", "does not grow from element to element");
    if (element.id >= next_id) check_fields.refuse("id", "is not below next_id");
    latest_id = element.id;
    for (const auto& [name, seen_ns] :
         {std::pair{"first_seen_ns", element.first_seen_ns}, std::pair{"last_seen_ns", element.last_seen_ns}}) {
      if (seen_ns > stamp_ns) check_fields.refuse(name, "is after stamp_ns");
      if (stamp_ns - seen_ns > map_bounds::kMaxAge_ns) check_fields.refuse(name, "is too long before stamp_ns");
    }
    if (element.body == element.id) check_fields.refuse("body", "is the element itself");
    if (element.body != 0 && ids.count(element.body) == 0) {
      check_fields.refuse("body", "= " + std::to_string(element.body) + " is not there");
    }
    if (shape == "circle") {
      for (const ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
        const bool round = estimate->x.tail<2>().isZero(0.0) && estimate->P.bottomRows<2>().isZero(0.0);
        if (!round) check_fields.refuse("standing or moving", "is not a circle");
      }
    }
  }
}

}  // namespace situation_awareness
