// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/ros/convert/grid.hpp"
#include "situation_awareness/ros/convert/labels.hpp"
#include "situation_awareness/ros/odometry_covariances.hpp"

namespace situation_awareness::grid_messages_test {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

TEST(GridMessages, GridsComeBack) {
  SemanticGrid grid;
  grid.stamp_ns = 1'500'000'000;
  grid.cell_m = 0.5;
  grid.first_column = -7;
  grid.first_row = 12;
  grid.width = 3;
  grid.height = 2;
  grid.probability = {0.0F, 0.25F, kUnknown, 1.0F, 0.5F, 0.777F};
  const SemanticGrid read = grid_from_msg(grid_to_msg(grid, "world"));
  EXPECT_EQ(read.stamp_ns, grid.stamp_ns);
  EXPECT_EQ(read.cell_m, grid.cell_m);
  EXPECT_EQ(read.first_column, grid.first_column);
  EXPECT_EQ(read.first_row, grid.first_row);
  ASSERT_EQ(read.probability.size(), grid.probability.size());
  for (std::size_t i = 0; i < read.probability.size(); ++i) {
    EXPECT_EQ(std::isnan(read.probability[i]), std::isnan(grid.probability[i]));
    if (!std::isnan(grid.probability[i])) {
      EXPECT_NEAR(read.probability[i], grid.probability[i], 0.00501F);
    }
  }
  std::vector<GridCluster> clusters;
  find_clusters(read, clusters);  // of the cells above a half
  ASSERT_EQ(clusters.size(), 2U);
  EXPECT_LT((clusters[0].p_world_m - grid.middle_world_m(0, 1)).norm(), 1e-9);
}

TEST(GridMessages, TargetsComeBackExactly) {
  GridTargets targets;
  targets.stamp_ns = 7;
  GridTarget target;
  target.id = 3;
  target.p_world_m = {1.1, -2.2, 3.3};
  target.covariance_m2 << 0.4, 0.1, 0.1, 0.2;
  target.area_m2 = 8.25;
  target.probability = 0.9;
  targets.targets = {target};
  const GridTargets read = grid_targets_from_msg(grid_targets_to_msg(targets, "world"));
  ASSERT_EQ(read.targets.size(), 1U);
  EXPECT_EQ(read.stamp_ns, 7);
  EXPECT_EQ(read.targets[0].id, target.id);
  EXPECT_EQ(read.targets[0].p_world_m, target.p_world_m);
  EXPECT_EQ(read.targets[0].covariance_m2, target.covariance_m2);
  EXPECT_EQ(read.targets[0].area_m2, target.area_m2);
  EXPECT_EQ(read.targets[0].probability, target.probability);
}

sensor_msgs::CameraInfo info_of(int width, int height) {
  return camera_to_msg({width, height, 11.0, 12.0, 0.5 * (width - 1), 0.5 * (height - 1)}, 5, "camera");
}

/// 2 x 2 pixels whose red, green and blue are 10, 20, 30; 11, 21, 31; ..., with rows that are longer than their pixels.
sensor_msgs::Image image_of(const std::string& encoding, const std::vector<int>& channels) {
  sensor_msgs::Image msg;
  msg.width = msg.height = 2;
  msg.encoding = encoding;
  msg.step = static_cast<std::uint32_t>(2 * channels.size() + 3);
  msg.data.assign(2 * msg.step, 0xEE);
  for (std::size_t pixel = 0; pixel < 4; ++pixel) {
    for (std::size_t i = 0; i < channels.size(); ++i) {
      msg.data[pixel / 2 * msg.step + pixel % 2 * channels.size() + i] =
          static_cast<std::uint8_t>(10 * (channels[i] + 1) + static_cast<int>(pixel));
    }
  }
  return msg;
}

TEST(ImageMessages, AllEncodingsAreTheSameImage) {
  const std::vector<std::uint8_t> rgb = {10, 20, 30, 11, 21, 31, 12, 22, 32, 13, 23, 33};
  for (const auto& [encoding, channels] : std::vector<std::pair<std::string, std::vector<int>>>{
           {"rgb8", {0, 1, 2}}, {"bgr8", {2, 1, 0}}, {"rgba8", {0, 1, 2, 3}}, {"bgra8", {2, 1, 0, 3}}}) {
    const sensor_msgs::Image msg = image_of(encoding, channels);
    EXPECT_EQ(image_msg_defect(msg), "") << encoding;
    EXPECT_EQ(image_from_msg(msg, info_of(2, 2)).rgb, rgb) << encoding;
  }
  const ColorImage grey = image_from_msg(image_of("mono8", {0}), info_of(2, 2));
  EXPECT_EQ(grey.rgb, (std::vector<std::uint8_t>{10, 10, 10, 11, 11, 11, 12, 12, 12, 13, 13, 13}));
  EXPECT_EQ(grey.camera.fx_px, 11.0);
  EXPECT_EQ(grey.camera.fy_px, 12.0);
}

TEST(ImageMessages, DefectsAreNamed) {
  sensor_msgs::Image msg = image_of("rgb8", {0, 1, 2});
  msg.encoding = "16UC1";
  EXPECT_EQ(image_msg_defect(msg), "image is not rgb8, bgr8, rgba8, bgra8 or mono8");
  EXPECT_EQ(labels_msg_defect(msg), "labels are not 32FC1");
  msg = image_of("rgb8", {0, 1, 2});
  msg.data.pop_back();
  EXPECT_EQ(image_msg_defect(msg), "image with too little data");
  msg.width = 0;
  EXPECT_EQ(image_msg_defect(msg), "image without pixels");
  msg.width = 9000;
  EXPECT_EQ(image_msg_defect(msg), "image of more than 8192 pixels across");
  sensor_msgs::CameraInfo info = info_of(2, 2);
  EXPECT_EQ(camera_info_msg_defect(info, image_of("rgb8", {0, 1, 2})), "");
  info.K[4] = 0.0;
  EXPECT_EQ(camera_info_msg_defect(info, image_of("rgb8", {0, 1, 2})), "camera_info without focal length");
}

TEST(LabelMessages, ComeBackExactlyInEitherByteOrder) {
  SoftLabels labels;
  labels.stamp_ns = 5;
  labels.camera = {3, 1, 11.0, 12.0, 1.0, 0.0};
  labels.probability = {0.125F, kUnknown, 1.0F};
  sensor_msgs::Image msg = labels_to_msg(labels, "camera");
  const sensor_msgs::CameraInfo info = camera_to_msg(labels.camera, 5, "camera");
  EXPECT_EQ(labels_msg_defect(msg), "");
  EXPECT_EQ(camera_info_msg_defect(info, msg), "");
  for (const bool is_bigendian : {false, true}) {
    if (is_bigendian) {
      for (std::size_t i = 0; i < msg.data.size(); i += 4) std::reverse(&msg.data[i], &msg.data[i] + 4);
      msg.is_bigendian = 1;
    }
    const SoftLabels read = labels_from_msg(msg, info);
    EXPECT_EQ(read.stamp_ns, labels.stamp_ns);
    EXPECT_EQ(read.camera.fy_px, 12.0);
    EXPECT_EQ(std::memcmp(read.probability.data(), labels.probability.data(), 12), 0);
  }
}

TEST(OdometryCovariances, AreNoneWhereTheMessageHasNone) {
  OdometryCovariances covariances;
  nav_msgs::Odometry msg;
  const auto add = [&](double xx, double xy, double yy, double rest) {
    msg.header.stamp += ros::Duration(0.01);
    msg.pose.covariance.fill(0.0);
    for (std::size_t i = 0; i < 6; ++i) msg.pose.covariance[7 * i] = rest;
    msg.pose.covariance[0] = xx;
    msg.pose.covariance[1] = msg.pose.covariance[6] = xy;
    msg.pose.covariance[7] = yy;
    covariances.add(msg);
  };
  add(0.0, 0.0, 0.0, 0.0);
  add(-1.0, 0.0, 1.0, 1.0);
  add(std::numeric_limits<double>::quiet_NaN(), 0.0, 1.0, 1.0);
  add(2.25, 3.0, 2.25, 1.0);  // of the variance -0.75 in a direction
  EXPECT_EQ(covariances.unknown(), 4U);
  EXPECT_FALSE(covariances.at(static_cast<std::int64_t>(msg.header.stamp.toNSec())));
  add(2.25, 2.0, 2.25, 1.0);
  const auto known = covariances.at(static_cast<std::int64_t>(msg.header.stamp.toNSec()));
  ASSERT_TRUE(known);
  EXPECT_EQ((*known)(0, 1), 2.0);
}

}  // namespace
}  // namespace situation_awareness::grid_messages_test
