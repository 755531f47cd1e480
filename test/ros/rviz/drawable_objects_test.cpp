// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/drawable_objects.hpp"

#include <functional>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "support/refusal.hpp"

namespace situation_awareness::drawable_objects_test {
namespace {

MappedObjectArray good_map() {
  MappedObjectArray msg;
  msg.header.frame_id = "world";
  msg.objects.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    MappedObject& element = msg.objects[i];
    element.id = i + 1;
    element.rx = 0.4;
    element.ry = 0.2;
    element.pose.orientation.w = 1.0;
  }
  msg.objects[1].shape = MappedObject::BOX;
  msg.objects[1].box_length = 0.7;
  msg.objects[1].box_width = 0.35;
  return msg;
}

TEST(DrawableObjects, IsTheMap) {
  MappedObjectArray msg = good_map();
  msg.objects[1].label = "pillar\n\xc3\xa4";
  const DrawableObjects map = drawable_objects(msg);
  EXPECT_EQ(map.objects.objects.size(), 2U);
  EXPECT_EQ(map.names, (std::vector<std::string>{"1", "2 pillar???"}));
  EXPECT_EQ(map.objects.objects[1].shape, Shape::kBox);
}

TEST(DrawableObjects, NamesTheClass) {
  MappedObjectArray msg = good_map();
  msg.objects[0].object_class = MappedObject::PERSON;
  msg.objects[0].p_class = 0.9;
  EXPECT_EQ(drawable_objects(msg).names, (std::vector<std::string>{"1 person 90 %", "2"}));
}

TEST(DrawableObjects, RefusesMapsThatCannotBeDrawnWithTheReason) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<std::string, std::function<void(MappedObject&)>>> faults{
      {"position", [&](MappedObject& e) { e.pose.position.x = nan; }},
      {"position", [&](MappedObject& e) { e.pose.position.z = inf; }},
      {"100 km", [](MappedObject& e) { e.pose.position.y = 1e30; }},
      {"orientation", [](MappedObject& e) { e.pose.orientation.w = 0.0; }},
      {"orientation", [&](MappedObject& e) { e.pose.orientation.z = nan; }},
      {"orientation", [](MappedObject& e) { e.pose.orientation.x = e.pose.orientation.w = std::sqrt(0.5); }},
      {"radius", [](MappedObject& e) { e.rx = 1e9; }},
      {"radius", [](MappedObject& e) { e.ry = 0.0; }},
      {"radius", [&](MappedObject& e) { e.ry = nan; }},
      {"velocity", [&](MappedObject& e) { e.twist.linear.y = nan; }},
      {"faster", [](MappedObject& e) { e.twist.linear.x = 1e200; }},
      {"covariance", [&](MappedObject& e) { e.covariance[9] = nan; }},
      {"covariance", [](MappedObject& e) { e.covariance[0] = 1e300; }},
      {"probability", [&](MappedObject& e) { e.p_moving = nan; }},
      {"probability", [](MappedObject& e) { e.p_exists = 1.5; }},
      {"probability", [](MappedObject& e) { e.p_shape = -0.5; }},
      {"probability", [&](MappedObject& e) { e.p_class = nan; }},
      {"shape", [](MappedObject& e) { e.shape = 3; }},
      {"class", [](MappedObject& e) { e.object_class = 4; }},
      {"box", [&](MappedObject& e) { e.box.theta = nan; }},
      {"100 km", [](MappedObject& e) { e.box.y = 1e30; }},
      {"side", [](MappedObject& e) { e.box_width = 0.0; }},
      {"side", [](MappedObject& e) { e.box_length = 1e9; }},
      {"twice", [](MappedObject& e) { e.id = 1; }}};
  for (const auto& [part, spoil] : faults) {
    MappedObjectArray msg = good_map();
    spoil(msg.objects[1]);
    EXPECT_TRUE(names(refusal_of([&] { drawable_objects(msg); }), {part, std::to_string(msg.objects[1].id)}));
  }
}

}  // namespace
}  // namespace situation_awareness::drawable_objects_test
