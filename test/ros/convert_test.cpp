// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/detections.hpp"
#include "situation_awareness/ros/convert/hit_labels.hpp"
#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/convert/mission.hpp"
#include "situation_awareness/ros/convert/navigation_sensors.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/safety.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness::convert_test {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::int64_t kStamp_ns = 1'403'201'183'690'000'123;

sensor_msgs::LaserScan scan_msg(const std::vector<float>& ranges_m) {
  sensor_msgs::LaserScan msg;
  msg.header.frame_id = "laser";
  msg.header.stamp = to_ros_time(kStamp_ns);
  msg.angle_min = -1.0F;
  msg.angle_increment = 0.1F;
  msg.range_min = 0.1F;
  msg.range_max = 30.0F;
  msg.ranges = ranges_m;
  return msg;
}

Segments some_segments() {
  Segments segments;
  segments.stamp_ns = kStamp_ns;
  segments.T_world_level = {{1.1, -2.2}, 0.3};
  segments.height_world_m = 1.5;
  segments.resolution_rad = 0.00436;
  segments.range_sigma_m = 0.012;
  for (int i = 0; i < 7; ++i) {
    const double azimuth_rad = 0.1 * i;
    segments.points.push_back(
        {azimuth_rad, 2.0, {2.0 * std::cos(azimuth_rad), 2.0 * std::sin(azimuth_rad)}, i, BeamState::kHit});
  }
  segments.time_increment_s = 1.76e-5;
  segments.free_space = {{-0.5F, 0.0F, 0.0F, 3.25F}, {kInf, 2.0F, 0.0F, 29.5F}, true};
  segments.segments.push_back({0, 4, SegmentKind::kObject, SegmentEnd::kOccluded, SegmentEnd::kFree, 0.03125, 0.0});
  segments.segments.push_back({4, 3, SegmentKind::kStructure, SegmentEnd::kScanEdge, SegmentEnd::kOccluded, 1.5707, 0.1,
                               StructureReason::kFlat});
  segments.segments.push_back({2, 2, SegmentKind::kObject, SegmentEnd::kNoReturn, SegmentEnd::kNoReturn, 0.2, 0.3});
  segments.refused_runs.push_back({2, 5, RunRefusal::kOutside});
  StraightPiece piece;
  piece.segment = 1;
  piece.first = 5;
  piece.count = 2;
  piece.line_level = {{1.75, 0.9}, {std::cos(0.7), std::sin(0.7)}};
  piece.covariance << 1e-5, 2e-7, 2e-7, 3e-6;
  piece.rms_m = 0.0101;
  piece.right_level_m = {1.5, 0.8};
  piece.left_level_m = {1.25, 1.1};
  piece.right_end = SegmentEnd::kContinues;
  piece.left_end = SegmentEnd::kNoReturn;
  segments.straight_pieces.push_back(piece);
  return segments;
}

TEST(ConvertCloud, HasTheLayoutOfDrivers) {
  Cloud cloud;
  cloud.stamp_ns = kStamp_ns;
  cloud.rows = 2;
  cloud.columns = 3;
  cloud.points.resize(6);
  cloud.points[4] = {1.5F, -2.25F, 0.125F, 87.5F, 1, 0.03125F};
  const sensor_msgs::PointCloud2 msg = cloud_to_msg(cloud, "velodyne");
  EXPECT_EQ(msg.header.frame_id, "velodyne");
  EXPECT_EQ(to_nanoseconds(msg.header.stamp), kStamp_ns);
  EXPECT_EQ(msg.height, 2U);
  EXPECT_EQ(msg.width, 3U);
  EXPECT_EQ(msg.row_step, 3 * msg.point_step);
  EXPECT_EQ(msg.data.size(), 6 * msg.point_step);
  EXPECT_FALSE(msg.is_dense);
  const auto value = [&](const std::string& name, std::size_t point, auto sample) {
    for (const sensor_msgs::PointField& field : msg.fields) {
      if (field.name == name) std::memcpy(&sample, &msg.data[point * msg.point_step + field.offset], sizeof sample);
    }
    return sample;
  };
  EXPECT_EQ(value("x", 4, kNan), 1.5F);
  EXPECT_EQ(value("y", 4, kNan), -2.25F);
  EXPECT_EQ(value("z", 4, kNan), 0.125F);
  EXPECT_EQ(value("intensity", 4, kNan), 87.5F);
  EXPECT_EQ(value("ring", 4, std::uint16_t{9}), 1);
  EXPECT_EQ(value("time", 4, kNan), 0.03125F);
  EXPECT_TRUE(std::isnan(value("x", 3, 0.0F)));
  cloud.points.assign(6, cloud.points[4]);
  EXPECT_TRUE(cloud_to_msg(cloud, "velodyne").is_dense);
}

Cloud some_cloud() {
  Cloud cloud;
  cloud.stamp_ns = kStamp_ns;
  cloud.rows = 2;
  cloud.columns = 3;
  cloud.points.resize(6);
  for (std::size_t i = 0; i < 6; ++i) cloud.points[i].time_s = 0.015625F * static_cast<float>(i);
  cloud.points[1] = {0.5F, 1.25F, -0.25F, 12.0F, 0, cloud.points[1].time_s};
  cloud.points[4] = {1.5F, -2.25F, 0.125F, 87.5F, 1, cloud.points[4].time_s};
  return cloud;
}

TEST(ConvertCloud, ReadsWhatItWrites) {
  const Cloud cloud = some_cloud();
  const sensor_msgs::PointCloud2 msg = cloud_to_msg(cloud, "/velodyne");
  EXPECT_EQ(cloud_msg_defect(msg), "");
  const Cloud read = cloud_from_msg(msg);
  EXPECT_EQ(read.stamp_ns, cloud.stamp_ns);
  EXPECT_EQ(read.rows, cloud.rows);
  EXPECT_EQ(read.columns, cloud.columns);
  ASSERT_EQ(read.points.size(), cloud.points.size());
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    EXPECT_EQ(read.points[i].time_s, cloud.points[i].time_s);
    EXPECT_EQ(std::isnan(read.points[i].x_m), std::isnan(cloud.points[i].x_m));
    if (std::isnan(cloud.points[i].x_m)) continue;
    EXPECT_EQ(read.points[i].x_m, cloud.points[i].x_m);
    EXPECT_EQ(read.points[i].y_m, cloud.points[i].y_m);
    EXPECT_EQ(read.points[i].z_m, cloud.points[i].z_m);
    EXPECT_EQ(read.points[i].intensity, cloud.points[i].intensity);
  }
  const Taken when = taken(msg, true);
  EXPECT_EQ(when.frame, "velodyne");
  EXPECT_EQ(to_nanoseconds(when.first), kStamp_ns);
  EXPECT_EQ(to_nanoseconds(when.last), kStamp_ns + 78'125'000);
  EXPECT_EQ(taken(msg, false).last, when.first);
}

/// One point, 2 m ahead, with its time in the units of a driver behind x, y and z, where no double may lie.
template <class Number>
sensor_msgs::PointCloud2 timed_msg(const std::string& name, std::uint8_t datatype, Number value) {
  sensor_msgs::PointCloud2 msg;
  msg.header.frame_id = "lidar";
  msg.header.stamp = to_ros_time(kStamp_ns);
  msg.height = msg.width = 1;
  const auto field = [&](const std::string& of, std::uint32_t offset, std::uint8_t type) {
    sensor_msgs::PointField f;
    f.name = of;
    f.offset = offset;
    f.datatype = type;
    f.count = 1;
    msg.fields.push_back(f);
  };
  field("x", 0, sensor_msgs::PointField::FLOAT32);
  field("y", 4, sensor_msgs::PointField::FLOAT32);
  field("z", 8, sensor_msgs::PointField::FLOAT32);
  field(name, 13, datatype);
  msg.point_step = msg.row_step = 13 + sizeof value;
  msg.data.assign(msg.row_step, 0);
  const float x_m = 2.0F;
  std::memcpy(msg.data.data(), &x_m, sizeof x_m);
  std::memcpy(msg.data.data() + 13, &value, sizeof value);
  return msg;
}

TEST(ConvertCloud, KnowsTheTimesOfDrivers) {
  using sensor_msgs::PointField;
  const double stamp_s = 1e-9 * static_cast<double>(kStamp_ns);
  for (const sensor_msgs::PointCloud2& msg :
       {timed_msg("time", PointField::FLOAT32, 0.0625F), timed_msg("t", PointField::UINT32, std::uint32_t{62'500'000}),
        timed_msg("timestamp", PointField::FLOAT64, stamp_s + 0.0625),
        timed_msg("timestamp", PointField::FLOAT64, static_cast<double>(kStamp_ns + 62'500'000)),
        timed_msg("timestamp", PointField::FLOAT64, 0.0625),
        timed_msg("offset_time", PointField::UINT32, std::uint32_t{62'500'000}),
        timed_msg("time_offset_ns", PointField::INT32, std::int32_t{62'500'000}),
        timed_msg("pointTime", PointField::FLOAT32, 0.0625F)}) {
    EXPECT_EQ(cloud_msg_defect(msg), "");
    const Cloud cloud = cloud_from_msg(msg);
    EXPECT_EQ(cloud.points.at(0).x_m, 2.0F);
    EXPECT_TRUE(std::isnan(cloud.points[0].intensity));
    EXPECT_NEAR(cloud.points[0].time_s, 0.0625, 1e-6) << msg.fields[3].name;
    EXPECT_NEAR((taken(msg, true).first - msg.header.stamp).toSec(), 0.0625, 1e-6);
  }
  EXPECT_EQ(cloud_from_msg(timed_msg("height", PointField::FLOAT32, 0.5F)).points[0].time_s, 0.0F);
  EXPECT_FALSE(times_of(cloud_from_msg(timed_msg("time", PointField::FLOAT32, 1e3F))));
  EXPECT_EQ(taken(timed_msg("time", PointField::FLOAT32, 1e3F), true).last, to_ros_time(kStamp_ns));
}

// Nothing is read beyond the data, whatever the fields say.
TEST(ConvertCloud, SaysWhyACloudCannotBeUsed) {
  const sensor_msgs::PointCloud2 good = cloud_to_msg(some_cloud(), "velodyne");
  const auto defect_of = [&](auto change) {
    sensor_msgs::PointCloud2 msg = good;
    change(msg);
    return cloud_msg_defect(msg);
  };
  EXPECT_EQ(defect_of([](auto&) {}), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.header.frame_id.clear(); }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.header.stamp = ros::Time(); }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.height = 0; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.height = 3; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.height = msg.width = msg.row_step = 0xFFFFFFFF; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.point_step = 0; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.row_step -= 1; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.fields.clear(); }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.fields[1].name = "Y"; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.fields[1].offset = 0xFFFFFFFF; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.fields[0].datatype = sensor_msgs::PointField::FLOAT64; }), "");
  EXPECT_NE(defect_of([](auto& msg) { msg.is_bigendian = 1; }), "");
}

TEST(ConvertScan, DistinguishesTheThreeCasesOfRep117) {
  const Scan scan = scan_from_msg(scan_msg({2.0F, kInf, -kInf, kNan, -1.0F, 0.0F, 31.0F}));
  ASSERT_EQ(scan.beams.size(), 7U);
  EXPECT_EQ(scan.stamp_ns, kStamp_ns);
  EXPECT_EQ(scan.beams[0].state, BeamState::kHit);
  EXPECT_EQ(scan.beams[0].range_m, 2.0F);
  EXPECT_EQ(scan.beams[1].state, BeamState::kFree);
  EXPECT_EQ(scan.beams[2].state, BeamState::kTooClose);
  EXPECT_EQ(scan.beams[3].state, BeamState::kInvalid);
  EXPECT_EQ(scan.beams[4].state, BeamState::kInvalid);
  EXPECT_EQ(scan.beams[5].state, BeamState::kInvalid);
  EXPECT_EQ(scan.beams[6].state, BeamState::kFree);
}

/// By the letters h, f, i of hit, free and invalid.
std::string states_of(const Scan& scan) {
  std::string states;
  for (const Beam& beam : scan.beams) {
    states += beam.state == BeamState::kHit ? "h" : beam.state == BeamState::kFree ? "f" : "i";
  }
  return states;
}

TEST(ConvertScan, TakesForNothingWhatTheDriverSendsForIt) {
  const auto msg = boost::make_shared<sensor_msgs::LaserScan>(scan_msg({kInf, 31.0F, 30.0F, 0.0F, kNan, 2.0F}));
  const auto states = [&msg](const char* no_return) {
    ScannerParams scanner;
    scanner.no_return = no_return;
    return states_of(scan_from_msg(*conventional(msg, scanner)));
  };
  EXPECT_EQ(states("inf"), "ffhiih");
  EXPECT_EQ(states("range_max"), "fffiih");
  EXPECT_EQ(states("zero"), "ffffih");
  EXPECT_EQ(states("nan"), "fffifh");
}

TEST(ConvertScan, TakesNoiseBesideRangeMaxForNothing) {
  EXPECT_EQ(states_of(scan_from_msg(scan_msg({30.0F, 29.97F, 29.99F, 30.0F, 12.0F, 29.98F}))), "ffffhf");
  EXPECT_EQ(states_of(scan_from_msg(scan_msg({30.0F, 29.9F, 29.8F}))), "fhh");  // a wall
  EXPECT_EQ(states_of(scan_from_msg(scan_msg({kInf, 29.97F, 31.0F, 29.99F}))), "fhfh");
  EXPECT_EQ(states_of(scan_from_msg(scan_msg({30.0F, 1.0F, 1.0F, 1.0F, 1.0F, 1.0F, 29.99F}))), "fhhhhhh");
}

TEST(ConvertScan, PutsBeamsInTheOrderOfTheirTimes) {
  auto driver = scan_msg({1.0F, 2.0F, 3.0F, 4.0F, 5.0F});
  driver.intensities = {10.0F, 20.0F, 30.0F, 40.0F, 50.0F};
  driver.time_increment = 0.125F;  // exact in binary
  const auto msg = boost::make_shared<sensor_msgs::LaserScan>(driver);
  ScannerParams scanner;
  EXPECT_EQ(conventional(msg, scanner), msg);
  scanner.beam_order = "backward";
  const Scan before = scan_from_msg(*msg), scan = scan_from_msg(*conventional(msg, scanner));
  EXPECT_EQ(scan.time_increment_s, 0.125);
  EXPECT_EQ(scan.stamp_ns, kStamp_ns);
  for (std::size_t i = 0; i < 5; ++i) {
    const std::size_t k = 4 - i;
    EXPECT_EQ(scan.beams[i].range_m, before.beams[k].range_m);
    EXPECT_EQ(scan.beams[i].intensity, before.beams[k].intensity);
    EXPECT_NEAR(scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad,
                before.angle_min_rad + static_cast<double>(k) * before.angle_increment_rad, 1e-6);
  }
}

TEST(ConvertScan, StampsTheFirstBeam) {
  auto driver = scan_msg({1.0F, 2.0F, 3.0F, 4.0F, 5.0F});
  driver.time_increment = 0.125F;
  for (const auto& [stamp_at, before_ns] : {std::pair("first", 0), {"middle", 250'000'000}, {"last", 500'000'000}}) {
    ScannerParams scanner;
    scanner.stamp_at = stamp_at;
    const auto msg = conventional(boost::make_shared<sensor_msgs::LaserScan>(driver), scanner);
    EXPECT_EQ(scan_from_msg(*msg).stamp_ns, kStamp_ns - before_ns) << stamp_at;
    EXPECT_EQ(to_nanoseconds(time_of_last_beam(*msg)), kStamp_ns - before_ns + 500'000'000) << stamp_at;
    driver.header.stamp = ros::Time();
    EXPECT_TRUE(conventional(boost::make_shared<sensor_msgs::LaserScan>(driver), scanner)->header.stamp.isZero());
    driver.header.stamp = to_ros_time(kStamp_ns);
  }
}

TEST(ConvertScan, SurvivesTheRoundTrip) {
  const Scan scan = scan_from_msg(scan_msg({2.0F, kInf, -kInf, kNan, 29.5F}));
  const sensor_msgs::LaserScan msg = scan_to_msg(scan, "lidar", 0.1, 30.0, 0.05);
  EXPECT_EQ(msg.header.frame_id, "lidar");
  EXPECT_TRUE(std::isinf(msg.ranges[1]) && msg.ranges[1] > 0.0F);
  EXPECT_TRUE(std::isinf(msg.ranges[2]) && msg.ranges[2] < 0.0F);
  EXPECT_TRUE(std::isnan(msg.ranges[3]));
  EXPECT_NEAR(msg.angle_max, -1.0 + 4 * 0.1, 1e-6);
  const Scan back = scan_from_msg(msg);
  EXPECT_EQ(back.stamp_ns, scan.stamp_ns);
  EXPECT_EQ(back.angle_min_rad, scan.angle_min_rad);
  EXPECT_EQ(back.angle_increment_rad, scan.angle_increment_rad);
  ASSERT_EQ(back.beams.size(), scan.beams.size());
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    EXPECT_EQ(back.beams[i].state, scan.beams[i].state);
    EXPECT_EQ(back.beams[i].range_m, scan.beams[i].range_m);
  }
}

TEST(ConvertScan, CarriesIntensitiesWhereThereAreAny) {
  auto msg = scan_msg({2.0F, kInf, -kInf, kNan, 29.5F});
  for (const Beam& beam : scan_from_msg(msg).beams) EXPECT_TRUE(std::isnan(beam.intensity));
  EXPECT_TRUE(scan_to_msg(scan_from_msg(msg), "lidar", 0.1, 30.0, 0.05).intensities.empty());

  msg.intensities = {100.0F, 0.0F, -1.0F, 3.5F, 4095.0F};
  const Scan scan = scan_from_msg(msg);
  for (std::size_t i = 0; i < scan.beams.size(); ++i) EXPECT_EQ(scan.beams[i].intensity, msg.intensities[i]);
  EXPECT_EQ(scan_to_msg(scan, "lidar", 0.1, 30.0, 0.05).intensities, msg.intensities);

  for (const std::size_t count : {1U, 4U, 6U}) {
    msg.intensities.resize(count);
    for (const Beam& beam : scan_from_msg(msg).beams) EXPECT_TRUE(std::isnan(beam.intensity)) << count;
  }
}

TEST(ConvertScan, UsesOnlyAValidTimeIncrement) {
  auto msg = scan_msg({1.0F, 2.0F, 3.0F, 4.0F, 5.0F});
  msg.time_increment = 0.125F;  // exact in binary
  EXPECT_EQ(scan_from_msg(msg).time_increment_s, 0.125);
  EXPECT_EQ(to_nanoseconds(time_of_last_beam(msg)), kStamp_ns + 500'000'000);
  EXPECT_EQ(scan_from_msg(scan_to_msg(scan_from_msg(msg), "lidar", 0.1, 30.0, 0.05)).time_increment_s, 0.125);
  msg.time_increment = 0.25F;  // a second for all five beams
  EXPECT_EQ(usable_time_increment_s(msg), 0.25);
  for (const float nonsense : {0.2501F, -0.001F, kNan, kInf, -kInf}) {
    msg.time_increment = nonsense;
    EXPECT_EQ(usable_time_increment_s(msg), 0.0);
    EXPECT_EQ(scan_from_msg(msg).time_increment_s, 0.0);
    EXPECT_EQ(time_of_last_beam(msg), msg.header.stamp);
  }
  msg.time_increment = 0.125F;
  msg.header.stamp = ros::TIME_MAX;
  EXPECT_EQ(time_of_last_beam(msg), ros::TIME_MAX);
  msg = scan_msg({});
  msg.time_increment = 0.125F;
  EXPECT_EQ(time_of_last_beam(msg), msg.header.stamp);
}

TEST(ScanCheck, NamesTheDefectOfAScan) {
  EXPECT_EQ(scan_msg_defect(scan_msg({1.0F, 2.0F, 3.0F})), "");
  EXPECT_EQ(scan_msg_defect(scan_msg({kNan, kInf, -kInf})), "");  // no hit is no defect
  EXPECT_NE(scan_msg_defect(scan_msg({})), "");
  EXPECT_NE(scan_msg_defect(scan_msg({1.0F})), "");
  auto msg = scan_msg({1.0F, 2.0F});
  msg.header.stamp = ros::Time();
  EXPECT_EQ(scan_msg_defect(msg), "bad scan: stamp is zero");
  msg = scan_msg({1.0F, 2.0F});
  msg.header.frame_id.clear();
  EXPECT_EQ(scan_msg_defect(msg), "bad scan: no frame_id");
  msg = scan_msg({1.0F, 2.0F});
  msg.range_max = kNan;
  EXPECT_NE(scan_msg_defect(msg), "");
  msg = scan_msg({1.0F, 2.0F});
  msg.angle_increment = kNan;
  EXPECT_NE(scan_msg_defect(msg), "");
  msg.angle_increment = 0.0F;
  EXPECT_NE(scan_msg_defect(msg), "");
}

TEST(ScanCheck, AcceptsAnIntensityPerRangeOrNone) {
  auto msg = scan_msg({1.0F, 2.0F, 3.0F});
  msg.intensities = {1.0F, kNan, 0.0F};
  EXPECT_EQ(scan_msg_defect(msg), "");
  for (const std::size_t count : {1U, 2U, 4U}) {
    msg.intensities.resize(count);
    EXPECT_EQ(scan_msg_defect(msg), "bad scan: intensities are not one per range") << count;
  }
}

TEST(ConvertSegments, SurvivesTheRoundTripExactly) {
  const Segments segments = some_segments();
  const SegmentArray msg = segments_to_msg(segments, "world");
  EXPECT_EQ(msg.header.frame_id, "world");
  const Segments back = segments_from_msg(msg);
  EXPECT_EQ(back.stamp_ns, segments.stamp_ns);
  EXPECT_EQ(back.T_world_level.translation_m, segments.T_world_level.translation_m);
  EXPECT_EQ(back.T_world_level.yaw_rad, segments.T_world_level.yaw_rad);
  EXPECT_EQ(back.height_world_m, segments.height_world_m);
  EXPECT_EQ(back.resolution_rad, segments.resolution_rad);
  EXPECT_EQ(back.range_sigma_m, segments.range_sigma_m);
  EXPECT_EQ(back.time_increment_s, segments.time_increment_s);
  EXPECT_EQ(back.free_space.azimuth_rad, segments.free_space.azimuth_rad);
  EXPECT_EQ(back.free_space.range_m, segments.free_space.range_m);
  EXPECT_TRUE(back.free_space.full_circle);
  EXPECT_TRUE(segments_from_msg(segments_to_msg({0, {}, 0.0, 0.01, 0.0, 0.0, {}, {}, {}, {}, {}, {}}, "world"))
                  .free_space.range_m.empty());
  ASSERT_EQ(back.points.size(), segments.points.size());
  for (std::size_t i = 0; i < back.points.size(); ++i) {
    EXPECT_EQ(back.points[i].azimuth_rad, segments.points[i].azimuth_rad);
    EXPECT_EQ(back.points[i].range_m, segments.points[i].range_m);
    EXPECT_EQ(back.points[i].p_level_m, segments.points[i].p_level_m);
    EXPECT_EQ(back.points[i].beam, segments.points[i].beam);
    EXPECT_EQ(back.points[i].state, BeamState::kHit);
  }
  ASSERT_EQ(back.segments.size(), segments.segments.size());
  for (std::size_t i = 0; i < back.segments.size(); ++i) {
    EXPECT_EQ(back.segments[i].first, segments.segments[i].first);
    EXPECT_EQ(back.segments[i].count, segments.segments[i].count);
    EXPECT_EQ(back.segments[i].kind, segments.segments[i].kind);
    EXPECT_EQ(back.segments[i].right_end, segments.segments[i].right_end);
    EXPECT_EQ(back.segments[i].left_end, segments.segments[i].left_end);
    EXPECT_EQ(back.segments[i].right_hidden_rad, segments.segments[i].right_hidden_rad);
    EXPECT_EQ(back.segments[i].left_hidden_rad, segments.segments[i].left_hidden_rad);
    EXPECT_EQ(back.segments[i].structure, segments.segments[i].structure);
  }
  ASSERT_EQ(back.refused_runs.size(), 1U);
  EXPECT_EQ(back.refused_runs[0].first, segments.refused_runs[0].first);
  EXPECT_EQ(back.refused_runs[0].count, segments.refused_runs[0].count);
  EXPECT_EQ(back.refused_runs[0].why, segments.refused_runs[0].why);
  ASSERT_EQ(back.straight_pieces.size(), 1U);
  const StraightPiece& piece = segments.straight_pieces[0];
  const StraightPiece& back_piece = back.straight_pieces[0];
  EXPECT_EQ(back_piece.segment, piece.segment);
  EXPECT_EQ(back_piece.first, piece.first);
  EXPECT_EQ(back_piece.count, piece.count);
  EXPECT_EQ(back_piece.line_level.through_m, piece.line_level.through_m);
  EXPECT_EQ(back_piece.line_level.normal, piece.line_level.normal);
  EXPECT_EQ(back_piece.covariance, piece.covariance);
  EXPECT_EQ(back_piece.rms_m, piece.rms_m);
  EXPECT_EQ(back_piece.right_level_m, piece.right_level_m);
  EXPECT_EQ(back_piece.left_level_m, piece.left_level_m);
  EXPECT_EQ(back_piece.right_end, piece.right_end);
  EXPECT_EQ(back_piece.left_end, piece.left_end);
}

TEST(ConvertSegments, RefusesIndicesBeyondThePoints) {
  const SegmentArray good = segments_to_msg(some_segments(), "world");
  SegmentArray msg = good;
  msg.segments[1].count = 4;
  EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  msg = good;
  msg.segments[1].first = 4'294'967'295U;
  EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  msg = good;
  msg.segments[0].count = 0;
  EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  for (const int end : {+LaserSegment::CONTINUES, LaserSegment::NO_RETURN + 1}) {
    msg = good;
    msg.segments[0].left_end = static_cast<std::uint8_t>(end);
    EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  }
  msg = good;
  msg.segments[0].structure = LaserSegment::FLAT;  // an object
  EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  msg = good;
  msg.segments[1].structure = LaserSegment::NONE;  // a structure
  EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  for (const double hidden : {-0.001, std::numeric_limits<double>::infinity(), std::nan("")}) {
    msg = good;
    msg.segments[0].right_hidden = hidden;
    EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
    msg = good;
    msg.segments[1].left_hidden = hidden;
    EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  }
  msg = good;
  msg.points[0].range = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  msg = good;
  msg.level.yaw = std::numeric_limits<double>::infinity();
  EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
}

TEST(ConvertSegments, RefusesInvalidRefusedRuns) {
  const SegmentArray good = segments_to_msg(some_segments(), "world");
  for (const auto& [first, count, why] :
       {std::tuple{2U, 6U, 0U}, {4'294'967'295U, 1U, 0U}, {2U, 0U, 0U}, {2U, 1U, 2U}}) {
    SegmentArray msg = good;
    msg.refused_runs[0].first = first;
    msg.refused_runs[0].count = count;
    msg.refused_runs[0].why = static_cast<std::uint8_t>(why);
    EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  }
}

TEST(ConvertSegments, RefusesInvalidStraightPieces) {
  const SegmentArray good = segments_to_msg(some_segments(), "world");
  const auto refused = [&](auto&& spoil) {
    SegmentArray msg = good;
    spoil(msg.straight_pieces[0]);
    EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  };
  refused([](LaserStraightPiece& piece) { piece.segment = 3; });
  refused([](LaserStraightPiece& piece) { piece.segment = 0; });  // an object
  refused([](LaserStraightPiece& piece) { piece.first = 3; });
  refused([](LaserStraightPiece& piece) { piece.count = 3; });
  refused([](LaserStraightPiece& piece) { piece.count = 0; });
  refused([](LaserStraightPiece& piece) { piece.count = 4'294'967'295U; });
  refused([](LaserStraightPiece& piece) { piece.right_end = LaserSegment::NO_RETURN + 1; });
  refused([](LaserStraightPiece& piece) { piece.normal_x = 0.0; });
  refused([](LaserStraightPiece& piece) { piece.covariance[3] = std::nan(""); });
  refused([](LaserStraightPiece& piece) { piece.left_x = std::numeric_limits<double>::infinity(); });
}

/// What both messages with free space must refuse.
template <class Message, class FromMsg>
void check_refused_free_space(const Message& good, FromMsg&& from_msg) {
  EXPECT_NO_THROW(from_msg(good));
  Message msg = good;
  msg.free_range.pop_back();
  EXPECT_THROW(from_msg(msg), std::invalid_argument);
  for (const float azimuth_rad : {kNan, kInf, -9.0F}) {
    msg = good;
    msg.free_azimuth[1] = azimuth_rad;
    EXPECT_THROW(from_msg(msg), std::invalid_argument);
  }
  for (const float range_m : {kNan, -kInf, -0.1F}) {
    msg = good;
    msg.free_range[1] = range_m;
    EXPECT_THROW(from_msg(msg), std::invalid_argument);
  }
}

TEST(ConvertSegments, RefusesInvalidTimesAndFreeSpace) {
  const SegmentArray good = segments_to_msg(some_segments(), "world");
  check_refused_free_space(good, segments_from_msg);
  for (const double increment_s : {-1e-6, std::numeric_limits<double>::infinity(), std::nan("")}) {
    SegmentArray msg = good;
    msg.time_increment = increment_s;
    EXPECT_THROW(segments_from_msg(msg), std::invalid_argument);
  }
}

TEST(ConvertHitLabels, CloudHoldsEveryHitInTheWorld) {
  const Segments segments = some_segments();
  std::vector<HitLabel> labels(segments.points.size());
  for (std::size_t i = 0; i < 4; ++i) labels[i] = {HitFate::kObject, 0, 7, 0};
  labels[3].object_id = 0;
  labels[4] = {HitFate::kStructure, hit_reason_index("structure: flat"), 0, 1};
  labels[5] = {HitFate::kNoSegment, hit_reason_index("segment refused: too few points")};
  labels[6] = {HitFate::kRefused, hit_reason_index("not one ellipse"), 0, 1};
  const Color colors[] = {color_of(std::uint64_t{7}),
                          color_of(std::uint64_t{7}),
                          color_of(std::uint64_t{7}),
                          kNoIdColor,
                          kStructureColor,
                          kNoSegmentColor,
                          kRefusedColor};
  const sensor_msgs::PointCloud2 cloud = hit_labels_to_cloud(segments, labels, "world");
  ASSERT_EQ(cloud.width * cloud.height, segments.points.size());
  ASSERT_EQ(cloud.data.size(), segments.points.size() * cloud.point_step);
  EXPECT_EQ(cloud.header.frame_id, "world");
  EXPECT_EQ(to_nanoseconds(cloud.header.stamp), kStamp_ns);  // to the nanosecond

  using Float = sensor_msgs::PointCloud2ConstIterator<float>;
  using Number = sensor_msgs::PointCloud2ConstIterator<std::uint32_t>;
  using Byte = sensor_msgs::PointCloud2ConstIterator<std::uint8_t>;
  Float x(cloud, "x"), y(cloud, "y"), z(cloud, "z");
  Number object(cloud, "object"), segment(cloud, "segment");
  Byte fate(cloud, "fate"), reason(cloud, "reason"), r(cloud, "r"), g(cloud, "g"), b(cloud, "b");
  for (std::size_t i = 0; i < labels.size(); ++i, ++x, ++y, ++z, ++fate, ++reason, ++object, ++segment, ++r, ++g, ++b) {
    const Eigen::Vector2d p_world_m = segments.T_world_level * segments.points[i].p_level_m;
    EXPECT_NEAR(*x, p_world_m.x(), 1e-6);
    EXPECT_NEAR(*y, p_world_m.y(), 1e-6);
    EXPECT_NEAR(*z, 1.5, 1e-6);
    EXPECT_EQ(static_cast<HitFate>(*fate), labels[i].fate);
    EXPECT_EQ(*reason, labels[i].reason);
    EXPECT_EQ(*object, labels[i].object_id);
    EXPECT_EQ(*segment, static_cast<std::uint32_t>(labels[i].segment));
    EXPECT_NEAR(*r, 255.0F * colors[i].r, 0.51F);
    EXPECT_NEAR(*g, 255.0F * colors[i].g, 0.51F);
    EXPECT_NEAR(*b, 255.0F * colors[i].b, 0.51F);
  }
  EXPECT_EQ(hit_labels_to_cloud({}, {}, "world").width, 0U);
  labels.pop_back();
  EXPECT_THROW(hit_labels_to_cloud(segments, labels, "world"), std::invalid_argument);
}

TEST(ConvertDetections, SurvivesTheRoundTripExactly) {
  Detections detections;
  detections.stamp_ns = kStamp_ns;
  detections.T_world_level = {{1.0, 2.0}, -0.7};
  detections.height_world_m = 0.4;
  Detection detection;
  detection.ellipse_level = {{3.0, -1.0}, 0.5, 0.3, 0.2};
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) detection.covariance(i, j) = i == j ? 0.01 * (1 + i) : 1e-4 * (1 + i + j);
  }
  detection.p_ellipse = 0.75;
  detection.residual_rms_m = 0.004;
  detection.beams = 42;
  detection.middle_level_m = {2.4, -0.7};
  detection.segment = 7;
  detection.time_offset_s = 0.0123;
  detection.hidden_end = detection.has_arrived = true;
  detections.detections.push_back(detection);
  detections.small_segments.push_back({{2.0, -0.5}, 0.11, 0.034, 3});
  detections.free_space = {{-0.5F, 0.0F, 3.25F}, {kInf, 0.0F, 29.5F}, true};
  const Detections back = detections_from_msg(detections_to_msg(detections, "world"));
  EXPECT_EQ(back.stamp_ns, detections.stamp_ns);
  EXPECT_EQ(back.T_world_level.translation_m, detections.T_world_level.translation_m);
  EXPECT_EQ(back.T_world_level.yaw_rad, detections.T_world_level.yaw_rad);
  EXPECT_EQ(back.height_world_m, detections.height_world_m);
  ASSERT_EQ(back.detections.size(), 1U);
  EXPECT_EQ(back.detections[0].ellipse_level.center_m, detection.ellipse_level.center_m);
  EXPECT_EQ(back.detections[0].ellipse_level.psi_rad, detection.ellipse_level.psi_rad);
  EXPECT_EQ(back.detections[0].ellipse_level.rx_m, detection.ellipse_level.rx_m);
  EXPECT_EQ(back.detections[0].ellipse_level.ry_m, detection.ellipse_level.ry_m);
  EXPECT_EQ(back.detections[0].covariance, detection.covariance);
  EXPECT_EQ(back.detections[0].p_ellipse, 0.75);
  EXPECT_EQ(back.detections[0].residual_rms_m, detection.residual_rms_m);
  EXPECT_EQ(back.detections[0].beams, 42);
  EXPECT_EQ(back.detections[0].middle_level_m, detection.middle_level_m);
  EXPECT_EQ(back.detections[0].segment, 7U);
  EXPECT_EQ(back.detections[0].time_offset_s, 0.0123);
  EXPECT_TRUE(back.detections[0].hidden_end);
  EXPECT_TRUE(back.detections[0].has_arrived);
  ASSERT_EQ(back.small_segments.size(), 1U);
  EXPECT_EQ(back.small_segments[0].center_level_m, detections.small_segments[0].center_level_m);
  EXPECT_EQ(back.small_segments[0].width_m, 0.11);
  EXPECT_EQ(back.small_segments[0].time_offset_s, 0.034);
  EXPECT_EQ(back.small_segments[0].beams, 3);
  EXPECT_EQ(back.free_space.azimuth_rad, detections.free_space.azimuth_rad);
  EXPECT_EQ(back.free_space.range_m, detections.free_space.range_m);
  EXPECT_TRUE(back.free_space.full_circle);
  EXPECT_EQ(back.detections[0].shape, Shape::kEllipse);
  EXPECT_EQ(back.detections[0].log_box_ratio, kSurelyEllipse);
  Detections of_box = detections;
  of_box.detections[0].shape = Shape::kBox;
  of_box.detections[0].box_level = {{3.0, -1.0}, 0.6, 0.25, 0.125};
  of_box.detections[0].log_box_ratio = 1.75;
  const Detections box_back = detections_from_msg(detections_to_msg(of_box, "world"));
  const Detection& box = box_back.detections[0];
  EXPECT_EQ(box.shape, Shape::kBox);
  EXPECT_EQ(box.log_box_ratio, 1.75);
  EXPECT_EQ(box.box_level.center_m, Eigen::Vector2d(3.0, -1.0));
  EXPECT_EQ(box.box_level.psi_rad, 0.6);
  EXPECT_EQ(box.box_level.half_length_m, 0.25);
  EXPECT_EQ(box.box_level.half_width_m, 0.125);
  const Detections without = detections_from_msg(detections_to_msg(Detections{}, "world"));
  EXPECT_TRUE(without.free_space.azimuth_rad.empty());

  DetectionArray msg = detections_to_msg(detections, "world");
  msg.detections[0].ry = 0.0;
  EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  msg = detections_to_msg(detections, "world");
  msg.detections[0].covariance[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  msg = detections_to_msg(detections, "world");
  msg.small_segments[0].y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  msg = detections_to_msg(detections, "world");
  msg.detections[0].covariance[0] = -1.0;
  EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  for (const double p : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    msg = detections_to_msg(detections, "world");
    msg.detections[0].p_ellipse = p;
    EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  }
  msg = detections_to_msg(detections, "world");
  msg.detections[0].shape = 2;
  EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  msg = detections_to_msg(of_box, "world");
  msg.detections[0].box_length = std::numeric_limits<double>::infinity();
  EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  msg = detections_to_msg(detections, "world");
  msg.detections[0].time_offset = std::nan("");
  EXPECT_THROW(detections_from_msg(msg), std::invalid_argument);
  check_refused_free_space(detections_to_msg(detections, "world"), detections_from_msg);
}

TEST(ConvertObjects, SurvivesTheRoundTrip) {
  Objects objects;
  objects.stamp_ns = kStamp_ns;
  objects.height_world_m = 1.25;
  Object object;
  object.id = 18'000'000'000'000'000'000ULL;
  object.ellipse_world = {{-3.0, 4.0}, -1.2, 0.5, 0.25};
  object.velocity_world_m_s = {0.5, -0.25};
  object.angular_velocity_rad_s = 0.125;
  for (int i = 0; i < 64; ++i) object.covariance.data()[i] = 0.01 * i;
  object.first_seen_ns = kStamp_ns - 5;
  object.last_seen_ns = kStamp_ns;
  object.observations = 12;
  object.p_moving = 0.25;
  object.p_exists = 0.75;
  object.beams = 34;
  objects.objects.push_back(object);
  const MappedObjectArray msg = objects_to_msg(objects, "odom", {"pillar"});
  EXPECT_EQ(msg.header.frame_id, "odom");
  EXPECT_EQ(msg.objects[0].label, "pillar");
  EXPECT_EQ(msg.objects[0].covariance[1], object.covariance(0, 1)) << "row-major";
  EXPECT_EQ(msg.objects[0].pose.position.z, 1.25);
  const Objects back = objects_from_msg(msg);
  EXPECT_EQ(back.stamp_ns, objects.stamp_ns);
  EXPECT_EQ(back.height_world_m, objects.height_world_m);
  ASSERT_EQ(back.objects.size(), 1U);
  EXPECT_EQ(back.objects[0].id, object.id);
  EXPECT_EQ(back.objects[0].ellipse_world.center_m, object.ellipse_world.center_m);
  EXPECT_NEAR(back.objects[0].ellipse_world.psi_rad, object.ellipse_world.psi_rad, 1e-15);
  EXPECT_EQ(back.objects[0].ellipse_world.rx_m, object.ellipse_world.rx_m);
  EXPECT_EQ(back.objects[0].ellipse_world.ry_m, object.ellipse_world.ry_m);
  EXPECT_EQ(back.objects[0].velocity_world_m_s, object.velocity_world_m_s);
  EXPECT_EQ(back.objects[0].angular_velocity_rad_s, object.angular_velocity_rad_s);
  EXPECT_EQ(back.objects[0].covariance, object.covariance);
  EXPECT_EQ(back.objects[0].first_seen_ns, object.first_seen_ns);
  EXPECT_EQ(back.objects[0].last_seen_ns, object.last_seen_ns);
  EXPECT_EQ(back.objects[0].observations, 12);
  EXPECT_EQ(back.objects[0].p_moving, 0.25);
  EXPECT_EQ(back.objects[0].p_exists, 0.75);
  EXPECT_EQ(back.objects[0].beams, 34);
}

Object an_object() {
  Object object;
  object.ellipse_world = {{-3.0, 4.0}, -1.2, 0.5, 0.25};
  return object;
}

Objects map_of(const Object& object) {
  Objects objects;
  objects.stamp_ns = kStamp_ns;
  objects.objects = {object};
  return objects;
}

TEST(ConvertObjects, ShapeAndClassSurviveTheRoundTrip) {
  for (const Shape shape : {Shape::kEllipse, Shape::kBox, Shape::kCompact}) {
    for (const ObjectClass object_class :
         {ObjectClass::kUnknown, ObjectClass::kPerson, ObjectClass::kVehicle, ObjectClass::kPole}) {
      Object object = an_object();
      object.shape = shape;
      object.p_shape = 0.7;
      object.object_class = object_class;
      object.p_class = 0.6;
      object.box_world = {{-3.0, 4.0}, 4.5, 0.3, 0.1};
      const MappedObjectArray msg = objects_to_msg(map_of(object), "odom");
      const Object back = objects_from_msg(msg).objects.at(0);
      EXPECT_EQ(back.shape, shape);
      EXPECT_EQ(back.p_shape, 0.7);
      EXPECT_EQ(back.object_class, object_class);
      EXPECT_EQ(back.p_class, 0.6);
      if (shape == Shape::kBox) {
        EXPECT_EQ(msg.objects[0].box_length, 0.6);
        EXPECT_EQ(msg.objects[0].box_width, 0.2);
        EXPECT_EQ(back.box_world.center_m, object.box_world.center_m);
        EXPECT_EQ(back.box_world.psi_rad, 4.5);
        EXPECT_EQ(back.box_world.half_length_m, 0.3);
        EXPECT_EQ(back.box_world.half_width_m, 0.1);
      } else {
        EXPECT_EQ(msg.objects[0].box_length, 0.0) << "no box";
      }
    }
  }
}

TEST(ConvertObjects, RefusesUnknownShapesAndBoxesWithoutArea) {
  Object object = an_object();
  object.shape = Shape::kBox;
  object.box_world = {{-3.0, 4.0}, 4.5, 0.3, 0.1};
  const MappedObjectArray good = objects_to_msg(map_of(object), "odom");
  EXPECT_NO_THROW(objects_from_msg(good));
  const double nan = std::nan("");
  const std::vector<std::function<void(MappedObject&)>> faults{
      [](MappedObject& e) { e.shape = 3; },        [](MappedObject& e) { e.object_class = 4; },
      [&](MappedObject& e) { e.p_shape = nan; },   [&](MappedObject& e) { e.p_class = nan; },
      [&](MappedObject& e) { e.box.x = nan; },     [&](MappedObject& e) { e.box.theta = nan; },
      [](MappedObject& e) { e.box_width = 0.0; },  [](MappedObject& e) { e.box_length = -0.1; },
      [&](MappedObject& e) { e.box_length = nan; }};
  for (const auto& spoil : faults) {
    MappedObjectArray msg = good;
    spoil(msg.objects[0]);
    EXPECT_THROW(objects_from_msg(msg), std::invalid_argument);
  }
}

TEST(ConvertObjects, TimesBeforeTheClocksZeroAreZero) {
  Objects objects;
  objects.stamp_ns = 5;
  objects.objects.emplace_back().first_seen_ns = -3'600'000'000'000;
  objects.objects[0].last_seen_ns = -1;
  const MappedObjectArray msg = objects_to_msg(objects, "odom");
  EXPECT_TRUE(msg.objects[0].first_seen.isZero());
  EXPECT_TRUE(msg.objects[0].last_seen.isZero());
}

std::vector<SplinegonVertex> some_arcs() {
  return {{{-3.0, 4.0}, 0.125, 0.011, true},
          {{-4.0, -1.1}, -0.3, 0.02, false},
          {{1.1, -4.125}, 0.0, 0.0, false},
          {{1.2, -0.5}, 0.4, 0.02, true}};
}

BodyState some_body() {
  BodyState body;
  body.velocity_world_m_s = {0.3, -1.25};
  body.angular_velocity_rad_s = 0.7;
  for (int i = 0; i < 64; ++i) body.covariance(i / 8, i % 8) = 1e-3 * i;
  return body;
}

/// A feature of each kind.
MapDelta some_delta() {
  MapDelta delta;
  delta.stamp_ns = kStamp_ns;
  delta.objects_stamp_ns = kStamp_ns - 3;
  delta.map = 3;
  delta.base = 41;
  delta.version = 42;
  delta.height_world_m = 0.25;
  const std::vector<FeatureShape> shapes{
      EllipseShape{{{1.1, -2.2}, 0.3, 0.5, 0.25}, some_body()}, BoxShape{{{7.0, 2.5}, -1.2, 2.25, 0.9}, some_body()},
      PolylineShape{{{{0.1, 0.2}, 0.01}, {{3.3, 0.4}, 0.02}}, false}, ArcShape{some_arcs(), true},
      FootprintShape{{12.5, -3.25, 408.125}, (Eigen::Matrix2d() << 0.04, 0.01, 0.01, 0.09).finished(), 7.5}};
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    Feature& feature = delta.changed.emplace_back();
    feature.id = (FeatureId{5} << IdSource::kCounterBits) + i;
    feature.object_class = ObjectClass::kVehicle;
    feature.p_class = 0.9;
    feature.p_exists = 0.75;
    feature.p_moving = 0.125;
    feature.motion = static_cast<Motion>(i % 3);
    feature.first_seen_ns = kStamp_ns - 9;
    feature.last_seen_ns = kStamp_ns - 2;
    if (i == 1) feature.last_absent_ns = kStamp_ns - 20;
    if (i == 2) feature.first_absent_ns = kStamp_ns - 1;
    feature.seen_by = {i != 4, i == 0, i == 4, i == 1, i == 2};
    feature.shape = shapes[i];
  }
  delta.gone = {{2, GoneReason::kLeft, {}}, {3, GoneReason::kMerged, FeatureId{7}}};
  return delta;
}

TEST(ConvertMap, UpdatesSurviveTheRoundTripExactly) {
  const MapDelta delta = some_delta();
  const MapUpdate msg = map_delta_to_msg(delta, "9b2c", "map");
  EXPECT_EQ(msg.header.frame_id, "map");
  EXPECT_EQ(msg.changed[2].outline[0].z, 0.25);
  const MapDelta back = map_delta_from_msg(msg);
  EXPECT_EQ(back.stamp_ns, kStamp_ns);
  EXPECT_EQ(back.objects_stamp_ns, kStamp_ns - 3);
  EXPECT_EQ(map_delta_from_msg(map_delta_to_msg({}, "9b2c", "map")).objects_stamp_ns, 0);
  EXPECT_EQ(back.base, 41U);
  EXPECT_EQ(back.version, 42U);
  EXPECT_FALSE(back.full);
  EXPECT_EQ(back.height_world_m, 0.25);
  EXPECT_EQ(back.map, map_delta_from_msg(map_delta_to_msg({}, "9b2c", "map")).map);
  EXPECT_NE(back.map, map_delta_from_msg(map_delta_to_msg({}, "9b2d", "map")).map);
  ASSERT_EQ(back.changed.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    const Feature &feature = back.changed[i], &before = delta.changed[i];
    EXPECT_EQ(feature.id, before.id);
    EXPECT_EQ(feature.object_class, ObjectClass::kVehicle);
    EXPECT_EQ(std::tie(feature.p_class, feature.p_exists, feature.p_moving),
              std::tie(before.p_class, before.p_exists, before.p_moving));
    EXPECT_EQ(feature.motion, before.motion);
    EXPECT_EQ(std::tie(feature.first_seen_ns, feature.last_seen_ns, feature.last_absent_ns, feature.first_absent_ns),
              std::tie(before.first_seen_ns, before.last_seen_ns, before.last_absent_ns, before.first_absent_ns));
    const Sensors &by = feature.seen_by, &by_before = before.seen_by;
    EXPECT_EQ(std::tie(by.scan, by.cloud, by.camera, by.robot, by.file),
              std::tie(by_before.scan, by_before.cloud, by_before.camera, by_before.robot, by_before.file));
    EXPECT_STREQ(kind_of(feature.shape), kind_of(before.shape));
  }
  // What the message of the copy has, that of the original has: no number is lost in between.
  const MapUpdate again = map_delta_to_msg(back, "9b2c", "map");
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(again.changed[i], msg.changed[i]) << i;
  EXPECT_EQ(std::get<BoxShape>(back.changed[1].shape).box_world.half_length_m, 2.25);
  EXPECT_EQ(std::get<EllipseShape>(back.changed[0].shape).body.covariance, some_body().covariance);
  EXPECT_EQ(std::get<ArcShape>(back.changed[3].shape).vertices[1].bulge, -0.3);
  EXPECT_EQ(std::get<FootprintShape>(back.changed[4].shape).covariance_m2(1, 1), 0.09);
  ASSERT_EQ(back.gone.size(), 2U);
  EXPECT_EQ(back.gone[0].reason, GoneReason::kLeft);
  EXPECT_FALSE(back.gone[0].into);
  EXPECT_EQ(back.gone[1].into, FeatureId{7});
}

TEST(ConvertMap, RefusesWhatIsNoFeature) {
  const MapUpdate good = map_delta_to_msg(some_delta(), "9b2c", "map");
  EXPECT_NO_THROW(map_delta_from_msg(good));
  const double nan = std::nan("");
  const std::vector<std::function<void(MapUpdate&)>> faults{
      [](MapUpdate& m) { m.map.clear(); },
      [&](MapUpdate& m) { m.height = nan; },
      [](MapUpdate& m) { m.changed[0].id = 0; },
      [](MapUpdate& m) { std::swap(m.changed[0], m.changed[1]); },
      [](MapUpdate& m) { m.changed[1].id = m.changed[0].id; },
      [](MapUpdate& m) { m.changed[0].kind = 5; },
      [](MapUpdate& m) { m.changed[0].object_class = 4; },
      [](MapUpdate& m) { m.changed[0].motion = 3; },
      [](MapUpdate& m) { m.changed[0].p_exists = 1.01; },
      [&](MapUpdate& m) { m.changed[0].p_moving = nan; },
      [](MapUpdate& m) { m.changed[0].rx = 0.0; },
      [&](MapUpdate& m) { m.changed[1].ry = nan; },
      [&](MapUpdate& m) { m.changed[1].center.y = nan; },
      [&](MapUpdate& m) { m.changed[1].twist.z = nan; },
      [](MapUpdate& m) { m.changed[1].covariance.pop_back(); },
      [&](MapUpdate& m) { m.changed[1].covariance[63] = nan; },
      [](MapUpdate& m) { m.changed[2].outline.resize(1), m.changed[2].sigma.resize(1); },
      [](MapUpdate& m) { m.changed[2].sigma.pop_back(); },
      [](MapUpdate& m) { m.changed[2].sigma[0] = -0.1; },
      [&](MapUpdate& m) { m.changed[2].outline[1].x = nan; },
      [](MapUpdate& m) { m.changed[3].bulge.pop_back(); },
      [](MapUpdate& m) { m.changed[3].corner.pop_back(); },
      [&](MapUpdate& m) { m.changed[3].bulge[0] = nan; },
      [&](MapUpdate& m) { m.changed[4].center.z = nan; },
      [](MapUpdate& m) { m.changed[4].area = -1.0; },
      [](MapUpdate& m) { m.changed[4].covariance.clear(); },
      [](MapUpdate& m) { m.gone[0].id = 0; },
      [](MapUpdate& m) { m.gone[0].reason = 4; },
      [](MapUpdate& m) { m.gone[0].into = 9; },
      [](MapUpdate& m) { m.gone[1].into = 0; },
      [](MapUpdate& m) { std::swap(m.gone[0], m.gone[1]); }};
  for (std::size_t i = 0; i < faults.size(); ++i) {
    MapUpdate msg = good;
    faults[i](msg);
    EXPECT_THROW(map_delta_from_msg(msg), std::invalid_argument) << i;
  }
}

TEST(ConvertPoses, IsometriesSurviveAndInvalidOnesAreRefused) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitX()))
                   .toRotationMatrix();
  T.translation() = Eigen::Vector3d(1.0, -2.0, 3.0);
  EXPECT_TRUE(isometry_from_msg(isometry_to_msg(T)).isApprox(T, 1e-12));
  geometry_msgs::Transform msg;  // all zeros: no rotation
  EXPECT_THROW(isometry_from_msg(msg), std::invalid_argument);
  msg = isometry_to_msg(T);
  msg.translation.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(isometry_from_msg(msg), std::invalid_argument);
}

TEST(ConvertNavigationSensors, FixesOfUnknownCovarianceHaveNone) {
  sensor_msgs::NavSatFix msg;
  msg.header.stamp = to_ros_time(kStamp_ns);
  msg.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  msg.latitude = 48.1;
  msg.longitude = 11.5;
  msg.altitude = 520.0;
  for (std::size_t i = 0; i < 9; ++i) msg.position_covariance[i] = static_cast<double>(i);
  GeodeticFix fix = fix_from_msg(msg);
  EXPECT_EQ(fix.stamp_ns, kStamp_ns);
  EXPECT_FALSE(fix.is_fix);
  EXPECT_EQ(fix.covariance_m2, Eigen::Matrix3d::Zero());
  msg.status.status = sensor_msgs::NavSatStatus::STATUS_GBAS_FIX;
  msg.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  fix = fix_from_msg(msg);
  EXPECT_TRUE(fix.is_fix);
  EXPECT_EQ(fix.covariance_m2(1, 2), 5.0);  // row by row
  EXPECT_EQ(fix.covariance_m2(2, 1), 7.0);
}

// The attitude's error is a rotation in the axes of the base in the core, and in those of the world in messages.
TEST(ConvertNavigationSensors, OdometryHasItsCovarianceInTheAxesOfRos) {
  GpsInsPose pose;
  pose.stamp_ns = kStamp_ns;
  pose.T_world_base.translate(Eigen::Vector3d(1.0, 2.0, 3.0)).rotate(exp_so3({0.4, -1.2, 0.7}));
  Eigen::Matrix<double, 6, 6> A;
  for (int i = 0; i < 36; ++i) A(i / 6, i % 6) = std::sin(1.0 + 7.0 * i);
  pose.covariance = A * A.transpose();
  pose.twist_covariance = A.transpose() * A;
  pose.velocity_base_m_s = {4.0, 5.0, 6.0};
  pose.angular_velocity_base_rad_s = {0.1, 0.2, 0.3};
  const nav_msgs::Odometry msg = odometry_to_msg(pose, "field", "rover");
  EXPECT_EQ(msg.header.stamp, to_ros_time(kStamp_ns));
  EXPECT_EQ(msg.header.frame_id, "field");
  EXPECT_EQ(msg.child_frame_id, "rover");
  const Eigen::Quaterniond q(msg.pose.pose.orientation.w, msg.pose.pose.orientation.x, msg.pose.pose.orientation.y,
                             msg.pose.pose.orientation.z);
  EXPECT_LT((q.toRotationMatrix() - pose.T_world_base.linear()).norm(), 1e-12);
  EXPECT_EQ(msg.pose.pose.position.z, 3.0);
  EXPECT_EQ(msg.twist.twist.linear.y, 5.0);
  EXPECT_EQ(msg.twist.twist.angular.z, 0.3);
  EXPECT_EQ(msg.twist.covariance[6 * 1 + 3], pose.twist_covariance(1, 3));

  // Of errors that have this covariance, columns of A: what rotates the estimate to the truth in the world.
  Eigen::Matrix<double, 6, 6> expected = Eigen::Matrix<double, 6, 6>::Zero();
  constexpr double kSmall = 1e-5;
  for (int k = 0; k < 6; ++k) {
    const Eigen::Matrix3d& R = pose.T_world_base.linear();
    const Eigen::Matrix3d truth = R * exp_so3(kSmall * A.block<3, 1>(3, k)).toRotationMatrix();
    Eigen::Matrix<double, 6, 1> e;
    e << A.block<3, 1>(0, k), log_so3(Eigen::Quaterniond(truth * R.transpose())) / kSmall;
    expected += e * e.transpose();
  }
  for (int i = 0; i < 36; ++i) {
    EXPECT_NEAR(msg.pose.covariance[static_cast<std::size_t>(i)], expected(i / 6, i % 6), 1e-6) << i;
  }
}

TEST(ConvertSafety, VerdictsAllowWhatWasDecided) {
  SafetyDecision decision;
  decision.stamp_ns = kStamp_ns;
  decision.verdict = SafetyDecision::Verdict::kSlow;
  decision.kind = SafetyDecision::Kind::kChain;
  decision.id = 17;
  decision.place_world_m = {1.0, -2.0};
  decision.distance_m = 0.7;
  decision.allowed_speed_m_s = 0.25;
  decision.may_turn = true;
  decision.missing = {SafetyInput::kMap, SafetyInput::kSpeed};
  SafetyVerdict msg = safety_to_msg(decision, 0.3, "map");
  EXPECT_EQ(msg.missing, (std::vector<std::uint8_t>{SafetyVerdict::MAP, SafetyVerdict::SPEED}));
  EXPECT_EQ(msg.verdict, SafetyVerdict::SLOW);
  EXPECT_EQ(msg.kind, SafetyVerdict::CHAIN);
  EXPECT_EQ(msg.id, 17U);
  EXPECT_EQ(msg.place.z, 0.3);
  EXPECT_EQ(msg.header.frame_id, "map");
  EXPECT_EQ(to_nanoseconds(msg.header.stamp), kStamp_ns);
  EXPECT_EQ(allowed_motion_from_msg(msg).speed_m_s, 0.25);
  EXPECT_TRUE(allowed_motion_from_msg(msg).may_turn);
  for (const double wrong : {static_cast<double>(kNan), static_cast<double>(kInf), -0.1}) {
    msg.allowed_speed_m_s = wrong;
    EXPECT_THROW(allowed_motion_from_msg(msg), std::invalid_argument);
  }
  msg.allowed_speed_m_s = 0.25;
  for (const int wrong : {2, 3}) {  // STOP with a speed, and none that there is
    msg.verdict = static_cast<std::uint8_t>(wrong);
    EXPECT_THROW(allowed_motion_from_msg(msg), std::invalid_argument);
  }
}

TEST(ConvertPath, IsSampledFromEndToEnd) {
  const SplinePath path({false, {{{0.0, 0.0}, {}}, {{1.0, 1.0}, {}}}});
  const nav_msgs::Path msg = path_to_msg(path, kStamp_ns, "map");
  EXPECT_NEAR(msg.poses.back().pose.position.x, 1.0, 1e-9);
  EXPECT_NEAR(2.0 * std::atan2(msg.poses[3].pose.orientation.z, msg.poses[3].pose.orientation.w), 0.25 * M_PI, 1e-9);
  EXPECT_GT(msg.poses.size(), 28U);
}

TEST(ConvertTime, RefusesTimesOutsideRosTime) {
  EXPECT_EQ(to_nanoseconds(to_ros_time(kStamp_ns)), kStamp_ns);
  EXPECT_THROW(to_ros_time(-1), std::invalid_argument);
  EXPECT_THROW(to_ros_time(std::int64_t{5'000'000'000} * 1'000'000'000), std::invalid_argument);
}

TEST(ConvertPoses, FramesLoseTheirLeadingSlash) {
  EXPECT_EQ(tf2_frame("/laser"), "laser");
  EXPECT_EQ(tf2_frame("laser"), "laser");
  EXPECT_EQ(tf2_frame(""), "");
}

// The same beams by a scanner that is upside down, and by one that turns clockwise.
TEST(FreeBeams, AreTheSameHoweverTheScannerIsMounted) {
  const sensor_msgs::LaserScan upright = scan_msg({2.0F, kInf, kNan, 0.05F, 40.0F, 5.0F});
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << 3.0, -1.0, 15.0;
  T.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  FreeBeams expected, beams;
  ASSERT_TRUE(free_beams_from_msg(upright, T, expected));
  EXPECT_EQ(expected.free_m, (std::vector<double>{2.0, 30.0, 0.0, 0.0, 30.0, 5.0}));
  EXPECT_NEAR(expected.T_world_sensor.yaw_rad, 0.7, 1e-12);
  EXPECT_NEAR(expected.from_rad, -1.0, 1e-6);
  // Only the first and the last beam end at something.
  ASSERT_EQ(expected.hits_world_m.size(), 2U);
  EXPECT_NEAR((expected.hits_world_m[0] - T.translation().head<2>()).norm(), 2.0, 1e-6);
  EXPECT_NEAR((expected.hits_world_m[1] - T.translation().head<2>()).norm(), 5.0, 1e-6);
  const auto expect_hits = [&] {
    ASSERT_EQ(beams.hits_world_m.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_LT((beams.hits_world_m[i] - expected.hits_world_m[i]).norm(), 1e-5);
    }
  };

  sensor_msgs::LaserScan clockwise = upright;
  std::reverse(clockwise.ranges.begin(), clockwise.ranges.end());
  clockwise.angle_min = upright.angle_min + 5.0F * upright.angle_increment;
  clockwise.angle_increment = -upright.angle_increment;
  ASSERT_TRUE(free_beams_from_msg(clockwise, T, beams));
  EXPECT_EQ(beams.free_m, expected.free_m);
  EXPECT_NEAR(beams.from_rad, expected.from_rad, 1e-6);
  EXPECT_EQ(beams.step_rad, expected.step_rad);
  expect_hits();

  // Upside down, about the axis ahead, the angles of the same beams are the negative ones.
  sensor_msgs::LaserScan below = clockwise;
  below.angle_min = -clockwise.angle_min;
  below.angle_increment = -clockwise.angle_increment;
  const Eigen::Isometry3d T_below = T * Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX());
  ASSERT_TRUE(free_beams_from_msg(below, T_below, beams));
  EXPECT_EQ(beams.free_m, expected.free_m);
  EXPECT_NEAR(beams.from_rad, expected.from_rad, 1e-6);
  EXPECT_NEAR(beams.T_world_sensor.yaw_rad, 0.7, 1e-12);
  expect_hits();

  // Tilted they are as long as the steepest one is over the ground; on its side it shows nothing.
  ASSERT_TRUE(free_beams_from_msg(upright, T * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()), beams));
  EXPECT_NEAR(beams.free_m[0], 2.0 * std::cos(0.3), 1e-9);
  // A hit is where its own beam ends: here 1 rad aside of the axis of the tilt.
  EXPECT_NEAR((beams.hits_world_m[0] - T.translation().head<2>()).norm(),
              2.0 * std::hypot(std::cos(1.0), std::sin(1.0) * std::cos(0.3)), 1e-6);
  EXPECT_FALSE(free_beams_from_msg(upright, T * Eigen::AngleAxisd(1.4, Eigen::Vector3d::UnitX()), beams));
}

}  // namespace
}  // namespace situation_awareness::convert_test
