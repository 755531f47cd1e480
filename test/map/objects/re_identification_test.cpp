// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/re_identification.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/gating.hpp"

namespace situation_awareness::re_identification_test {
namespace {

using namespace object_state;

constexpr std::int64_t kNow_ns = 100'000'000'000;
const double kGate = chi_square_quantile(0.999, kMeasurementSize);

/// An element that moves with the velocity zero, with sigmas of `sigma_m` in position and 1 cm in shape.
MapElement element_of(std::uint64_t id, const Eigen::Vector2d& center_m, double sigma_m, double mean_radius_m,
                      double half_difference_m = 0.0) {
  MapElement element;
  element.id = id;
  for (ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
    estimate->x.segment<2>(kPosition) = center_m;
    estimate->x.segment<3>(kShape) << mean_radius_m, half_difference_m, 0.0;
    estimate->P.diagonal().segment<2>(kPosition).setConstant(sigma_m * sigma_m);
    estimate->P.diagonal().segment<3>(kShape).setConstant(1e-4);
  }
  element.estimate.p_moving = 0.9;
  element.mobile = true;
  element.state = TrackState::kConfirmed;
  element.log_odds = 1.5;
  element.first_seen_ns = 0;
  element.last_seen_ns = kNow_ns;
  element.observations = 3;
  return element;
}

MapElement lost(MapElement element) {
  element.state = TrackState::kLost;
  element.last_seen_ns = kNow_ns - nanoseconds(5.0);
  element.log_odds = -1.0;
  element.observations = 40;
  return element;
}

std::vector<MapElement> re_identified(std::vector<MapElement> elements, const std::vector<char>& common_shape = {}) {
  re_identify({elements.size() - 1}, common_shape, kGate, kNow_ns, elements);
  return elements;
}

TEST(ReIdentification, AConfirmedElementWithinReachOfALostOneGetsItsId) {
  MapElement found = element_of(7, {4.0, 1.0}, 0.02, 0.2);
  found.beams = 12;
  const auto elements = re_identified({lost(element_of(3, {3.5, 0.5}, 0.5, 0.2)), found});
  EXPECT_EQ(elements[0].id, 3U);
  EXPECT_EQ(elements[0].state, TrackState::kConfirmed);
  EXPECT_EQ(elements[0].estimate.moving.x, found.estimate.moving.x);
  EXPECT_EQ(elements[0].log_odds, found.log_odds);
  EXPECT_EQ(elements[0].last_seen_ns, kNow_ns);
  EXPECT_EQ(elements[0].beams, 12);
  EXPECT_EQ(elements[0].observations, 43);
  EXPECT_EQ(elements[1].state, TrackState::kDeleted);
}

TEST(ReIdentification, AnotherShapeOrAPositionOutOfReachIsAnotherElement) {
  for (const MapElement& other :
       {lost(element_of(3, {3.5, 0.5}, 0.5, 0.3)), lost(element_of(3, {3.5, 0.5}, 0.5, 0.2, 0.1)),
        lost(element_of(3, {0.0, 0.5}, 0.5, 0.2)), lost(element_of(3, {3.5, 0.5}, 1000.0, 0.2))}) {
    const auto elements = re_identified({other, element_of(7, {4.0, 1.0}, 0.02, 0.2)});
    EXPECT_EQ(elements[0].state, TrackState::kLost);
    EXPECT_EQ(elements[1].state, TrackState::kConfirmed);
  }
}

TEST(ReIdentification, ABoxIsNotIdentifiedAsAnEllipseUnlessOneOfThemIsUnsure) {
  for (const double lost_log_odds : {-5.0, -1.0, 1.0, 5.0}) {
    for (const double found_log_odds : {-5.0, -1.0, 1.0, 5.0}) {
      MapElement other = lost(element_of(3, {3.5, 0.5}, 0.5, 0.2));
      MapElement found = element_of(7, {4.0, 1.0}, 0.02, 0.2);
      other.box_log_odds = lost_log_odds;
      found.box_log_odds = found_log_odds;
      const bool differ = lost_log_odds * found_log_odds == -25.0;
      EXPECT_EQ(re_identified({other, found})[1].state, differ ? TrackState::kConfirmed : TrackState::kDeleted);
    }
  }
}

TEST(ReIdentification, ChoosesTheMostProbable) {
  const auto elements =
      re_identified({lost(element_of(2, {3.0, 0.5}, 0.5, 0.2)), lost(element_of(3, {3.9, 0.9}, 0.5, 0.2)),
                     lost(element_of(4, {4.5, 2.0}, 0.5, 0.2)), element_of(7, {4.0, 1.0}, 0.02, 0.2)});
  EXPECT_EQ(elements[0].state, TrackState::kLost);
  EXPECT_EQ(elements[1].state, TrackState::kConfirmed);
  EXPECT_EQ(elements[2].state, TrackState::kLost);
  EXPECT_EQ(elements[3].state, TrackState::kDeleted);
}

TEST(ReIdentification, NotOfElementsInSightTentativeOnesPartsOrThoseThatStoodElsewhere) {
  const MapElement there = element_of(3, {3.5, 0.5}, 0.5, 0.2);
  MapElement tentative = lost(there);
  tentative.state = TrackState::kTentative;
  MapElement part = lost(there);
  part.is_part = true;
  MapElement stood = lost(there);
  stood.mobile = false;
  stood.estimate.p_moving = 0.1;
  stood.estimate.standing.P.diagonal().segment<2>(kPosition).setConstant(1e-4);
  for (const MapElement& other : {there, tentative, part, stood}) {
    EXPECT_EQ(re_identified({other, element_of(7, {4.0, 1.0}, 0.02, 0.2)})[1].state, TrackState::kConfirmed);
  }
}

TEST(ReIdentification, EachLostElementOnlyOnce) {
  std::vector<MapElement> elements{lost(element_of(3, {3.5, 0.5}, 0.5, 0.2)), element_of(7, {4.0, 1.0}, 0.02, 0.2),
                                   element_of(8, {3.4, 0.4}, 0.02, 0.2)};
  re_identify({1, 2}, {}, kGate, kNow_ns, elements);
  EXPECT_EQ(elements[0].estimate.moving.x, element_of(7, {4.0, 1.0}, 0.02, 0.2).estimate.moving.x);
  EXPECT_EQ(elements[1].state, TrackState::kDeleted);
  EXPECT_EQ(elements[2].state, TrackState::kConfirmed);
}

TEST(ReIdentification, ACommonShapeDoesNotIdentifyAnUncertainElement) {
  for (const double sigma_m : {1.0, 1.4}) {
    const std::vector<MapElement> elements{lost(element_of(3, {3.5, 0.5}, sigma_m, 0.2)),
                                           element_of(7, {4.0, 1.0}, 0.02, 0.2)};
    EXPECT_EQ(re_identified(elements)[0].state, TrackState::kConfirmed) << sigma_m;
    EXPECT_EQ(re_identified(elements, {1})[0].state, sigma_m < 1.2 ? TrackState::kConfirmed : TrackState::kLost)
        << sigma_m;
  }
}

TEST(CommonShapes, AreThoseThatThreeOthersHaveWithinACentimetre) {
  CommonShapes common_shapes;
  const auto with_radii = [](const std::vector<double>& radii_m) {
    std::vector<MapElement> elements;
    for (const double radius_m : radii_m)
      elements.push_back(element_of(elements.size() + 1, {0.0, 0.0}, 0.1, radius_m));
    return elements;
  };
  EXPECT_EQ(common_shapes.find(with_radii({0.2, 0.5, 0.209, 0.195, 0.205})), (std::vector<char>{1, 0, 0, 0, 1}));
  EXPECT_EQ(common_shapes.find(with_radii({0.2, 0.2, 0.2})), (std::vector<char>{0, 0, 0}));
  std::vector<MapElement> elements = with_radii({0.2, 0.2, 0.2, 0.2, 0.2});
  EXPECT_EQ(common_shapes.find(elements), (std::vector<char>{1, 1, 1, 1, 1}));
  elements[1] = element_of(2, {0.0, 0.0}, 0.1, 0.2, 0.05);  // as large, but no circle
  EXPECT_EQ(common_shapes.find(elements), (std::vector<char>{1, 0, 1, 1, 1}));
  elements[0].state = TrackState::kTentative;
  EXPECT_EQ(common_shapes.find(elements), (std::vector<char>{0, 0, 0, 0, 0}));
}

}  // namespace
}  // namespace situation_awareness::re_identification_test
