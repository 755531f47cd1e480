// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/bodies.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness::bodies_test {
namespace {

using namespace object_state;

constexpr std::int64_t kPeriod_ns = 50'000'000;

/// A confirmed, moving round element that was just seen.
MapElement element_of(std::uint64_t id, const Eigen::Vector2d& center_m, double radius_m, std::int64_t stamp_ns = 0) {
  MapElement element;
  element.id = id;
  for (ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
    estimate->x.segment<2>(kPosition) = center_m;
    estimate->x(kShape) = radius_m;
  }
  element.estimate.p_moving = 0.9;
  element.state = TrackState::kConfirmed;
  element.log_odds = 3.0;
  element.observations = 10;
  element.first_seen_ns = stamp_ns;
  element.last_seen_ns = stamp_ns;
  return element;
}

void move(MapElement& element, const Eigen::Vector2d& by_m) {
  for (ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
    estimate->x.segment<2>(kPosition) += by_m;
  }
}

/// Lets them travel by `by_m` in 20 scans, and joins parts in each.
void travel(const Eigen::Vector2d& by_m, std::vector<MapElement>& elements) {
  BodyJoiner joiner;
  for (int i = 0; i < 20; ++i) {
    const std::int64_t stamp_ns = elements[0].last_seen_ns + kPeriod_ns;
    for (MapElement& element : elements) {
      move(element, by_m / 20.0);
      element.last_seen_ns = stamp_ns;
    }
    joiner.join_parts(stamp_ns, elements);
  }
}

TEST(Bodies, ElementsThatTravelTogetherAreOneBody) {
  for (const double way_m : {0.3, 0.5}) {
    std::vector<MapElement> elements{element_of(1, {0.0, 0.0}, 0.2), element_of(2, {0.4, 0.0}, 0.05)};
    travel({0.0, way_m}, elements);
    EXPECT_EQ(elements[1].body, 1U) << way_m;
    EXPECT_EQ(elements[1].is_part, way_m > 0.4) << way_m;
    EXPECT_EQ(elements[0].has_parts, way_m > 0.4) << way_m;
    EXPECT_FALSE(elements[0].is_part);
  }
}

TEST(Bodies, NoElementJoinsThatIsFarOrLargeOrStanding) {
  const MapElement body = element_of(1, {0.0, 0.0}, 0.2);
  MapElement standing_body = body;
  standing_body.estimate.p_moving = 0.1;
  struct Case {
    MapElement body, part;
  };
  for (const Case& c : {Case{body, element_of(2, {0.6, 0.0}, 0.05)},  // a gap of 0.35 m
                        Case{body, element_of(2, {0.5, 0.0}, 0.16)},  // too large for a part
                        Case{standing_body, element_of(2, {0.4, 0.0}, 0.05)}}) {
    std::vector<MapElement> elements{c.body, c.part};
    travel({0.0, 1.0}, elements);
    EXPECT_FALSE(elements[1].is_part);
    EXPECT_EQ(elements[1].body, 0U);
  }
}

TEST(Bodies, AStandingElementBesideThePathIsNoPart) {
  BodyJoiner joiner;
  std::vector<MapElement> elements{element_of(1, {0.0, -0.3}, 0.2), element_of(2, {0.4, 0.0}, 0.05)};
  for (int i = 1; i <= 20; ++i) {
    move(elements[0], {0.0, 0.03});
    for (MapElement& element : elements) element.last_seen_ns = i * kPeriod_ns;
    joiner.join_parts(i * kPeriod_ns, elements);
    EXPECT_FALSE(elements[1].is_part) << i;
  }
}

TEST(Bodies, ABodyWithPartsJoinsANewElementAtOnceButNoStandingOne) {
  BodyJoiner joiner;
  std::vector<MapElement> elements{element_of(1, {0.0, 0.0}, 0.2), element_of(2, {0.4, 0.0}, 0.05)};
  elements[0].has_parts = true;
  joiner.join_parts(0, elements);
  EXPECT_FALSE(elements[1].is_part);
  elements[1].observations = 1;
  joiner.join_parts(0, elements);
  EXPECT_TRUE(elements[1].is_part);
  elements[1].is_part = false;
  elements[1].observations = 10;
  elements[1].mobile = true;
  joiner.join_parts(0, elements);
  EXPECT_TRUE(elements[1].is_part);
}

TEST(Bodies, APartIsReleasedAtTwiceTheGap) {
  BodyJoiner joiner;
  for (const double gap_m : {0.5, 0.7}) {
    std::vector<MapElement> elements{element_of(1, {0.0, 0.0}, 0.2), element_of(2, {0.25 + gap_m, 0.0}, 0.05)};
    elements[0].has_parts = true;
    elements[1].is_part = true;
    elements[1].body = 1;
    joiner.join_parts(0, elements);
    EXPECT_EQ(elements[1].is_part, gap_m < 0.6) << gap_m;
    EXPECT_EQ(elements[1].body, gap_m < 0.6 ? 1U : 0U) << gap_m;
  }
}

TEST(Bodies, AReIdentifiedElementIsNeitherBodyNorPart) {
  BodyJoiner joiner;
  // At the prediction of the lost one, with the same estimate.
  std::vector<MapElement> elements{element_of(1, {0.0, 0.0}, 0.2), element_of(2, {0.4, 0.0}, 0.05),
                                   element_of(3, {0.0, 0.0}, 0.2)};
  elements[2].state = TrackState::kDeleted;
  joiner.join_parts(0, elements);
  EXPECT_EQ(elements[1].body, 1U);
  elements[2] = element_of(3, {-0.4, 0.0}, 0.05);
  elements[2].state = TrackState::kDeleted;
  joiner.join_parts(0, elements);
  EXPECT_EQ(elements[2].body, 0U);
}

TEST(Bodies, PartsOfAPartGoToItsBody) {
  BodyJoiner joiner;
  std::vector<MapElement> elements{element_of(1, {0.0, 0.0}, 0.3), element_of(2, {0.5, 0.0}, 0.14),
                                   element_of(3, {0.8, 0.0}, 0.05)};
  elements[2].is_part = true;
  elements[2].body = 2;
  elements[0].has_parts = elements[1].has_parts = elements[1].mobile = true;
  joiner.join_parts(0, elements);
  EXPECT_TRUE(elements[1].is_part);
  EXPECT_EQ(elements[1].body, 1U);
  EXPECT_EQ(elements[2].body, 1U);
}

/// A body, 1, and two parts of it, 2 and 3, the latter the larger.
std::vector<MapElement> body_with_parts() {
  std::vector<MapElement> elements{element_of(1, {0.0, 0.0}, 0.3), element_of(2, {0.5, 0.0}, 0.05),
                                   element_of(3, {-0.5, 0.0}, 0.1)};
  elements[0].has_parts = true;
  for (const int i : {1, 2}) {
    elements[i].is_part = true;
    elements[i].body = 1;
    elements[i].first_seen_ns = i;
  }
  return elements;
}

TEST(Bodies, TheLargestPartTakesTheIdOfADeletedBody) {
  std::vector<MapElement> elements = body_with_parts();
  std::vector<char> dropped{1, 0, 0};
  EXPECT_EQ(transfer_body_ids(0, elements, dropped), 0U);
  EXPECT_EQ(dropped, (std::vector<char>{0, 0, 1}));
  EXPECT_EQ(elements[0].id, 1U);
  EXPECT_EQ(elements[0].first_seen_ns, 0);
  EXPECT_EQ(elements[0].estimate.moving.x(kShape), 0.1);
  EXPECT_FALSE(elements[0].is_part);
  EXPECT_TRUE(elements[0].has_parts);
  EXPECT_EQ(elements[1].body, 1U) << "the other part stays with it";
  EXPECT_EQ(elements[2].id, 3U);
}

TEST(Bodies, APartThatIsSeenTakesTheIdOfABodyOffTheMap) {
  std::vector<MapElement> elements = body_with_parts();
  elements[0].log_odds = -0.5;
  elements[1].last_seen_ns = kPeriod_ns;
  std::vector<char> dropped{0, 0, 0};
  EXPECT_EQ(transfer_body_ids(kPeriod_ns, elements, dropped), 1U);
  EXPECT_EQ(dropped, (std::vector<char>{0, 1, 0}));
  EXPECT_EQ(elements[0].id, 1U);
  EXPECT_EQ(elements[0].estimate.moving.x(kShape), 0.05) << "the larger one was not seen";
}

TEST(Bodies, WithoutPartsTheIdIsNotTransferred) {
  std::vector<MapElement> elements = body_with_parts();
  elements[1].body = elements[2].body = 9;
  std::vector<char> dropped{1, 0, 0};
  EXPECT_EQ(transfer_body_ids(0, elements, dropped), 0U);
  EXPECT_EQ(dropped, (std::vector<char>{1, 0, 0}));
  EXPECT_EQ(elements[0].estimate.moving.x(kShape), 0.3);
}

}  // namespace
}  // namespace situation_awareness::bodies_test
