// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/transform_queue.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"

namespace situation_awareness::transform_queue_test {
namespace {

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;
constexpr std::int64_t kMillisecond_ns = 1'000'000;
constexpr std::int64_t kSweep_ms = 20;

ros::Time at_ms(std::int64_t time_ms) { return to_ros_time(kStart_ns + time_ms * kMillisecond_ns); }

/// A sensor that moves at 1 m/s along x; a measurement of it takes kSweep_ms and is named by its first millisecond.
class TransformQueueTest : public ::testing::Test {
 protected:
  using Queue = TransformQueue<std::int64_t>;

  static TransformQueueParams params(std::size_t max_waiting = 20) { return {"world", 0.5, max_waiting}; }

  StampOrder::Verdict measure(std::int64_t time_ms, std::int64_t now_ms) {
    return queue_.add(time_ms, {"lidar", at_ms(time_ms), at_ms(time_ms + kSweep_ms)}, now_ms * kMillisecond_ns);
  }

  void move(std::int64_t time_ms) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = 1e-3 * static_cast<double>(time_ms);
    transforms_.setTransform(transform_to_msg(T, kStart_ns + time_ms * kMillisecond_ns, "world", "lidar"), "test");
  }

  /// The measurements that are ready by then.
  std::vector<std::int64_t> release(std::int64_t now_ms) {
    std::vector<std::int64_t> released;
    while (const auto ready = queue_.next(now_ms * kMillisecond_ns)) {
      released.push_back(ready->item);
      // Poses are those of 1 ns before.
      EXPECT_NEAR(ready->T_world_sensor.translation().x(), 1e-3 * static_cast<double>(ready->item), 1.1e-9);
      EXPECT_NEAR(ready->T_world_sensor_end.translation().x(), 1e-3 * static_cast<double>(ready->item + kSweep_ms),
                  1.1e-9);
      waited_s_ = ready->waited_s;
    }
    return released;
  }

  using Released = std::vector<std::int64_t>;
  using Drops = std::map<std::string, int>;
  tf2::BufferCore transforms_;
  Drops dropped_;
  std::string detail_;
  double waited_s_ = 0.0;
  Queue queue_{transforms_, params(), [this](const char* reason, const std::string& detail) {
                 ++dropped_[reason];
                 detail_ = detail;
               }};
};

TEST_F(TransformQueueTest, WaitsForTheTransformAtTheLastInstant) {
  move(0);
  move(100);
  measure(90, 95);
  EXPECT_EQ(release(95), Released());
  move(109);
  EXPECT_EQ(release(200), Released());
  move(111);
  EXPECT_EQ(release(345), Released{90});
  EXPECT_NEAR(waited_s_, 0.25, 1e-12);
  EXPECT_EQ(queue_.waiting(), 0U);
  EXPECT_EQ(dropped_, Drops());
}

TEST_F(TransformQueueTest, ReleasesInOrderAllThatAreReady) {
  for (const std::int64_t time_ms : {0, 50, 100, 150}) measure(time_ms, time_ms);
  move(0);
  move(125);
  EXPECT_EQ(release(150), (Released{0, 50, 100}));
  EXPECT_EQ(queue_.waiting(), 1U);
}

TEST_F(TransformQueueTest, TheTimeoutIsByTheClockOfTheCaller) {
  measure(0, 1'000'000);
  EXPECT_EQ(release(1'000'499), Released());
  EXPECT_EQ(queue_.waiting(), 1U);
  EXPECT_EQ(release(1'000'500), Released());
  EXPECT_EQ(queue_.waiting(), 0U);
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kNoTransform, 1}}));
  EXPECT_NE(detail_.find("world"), std::string::npos);
  EXPECT_NE(detail_.find("lidar"), std::string::npos);
}

TEST_F(TransformQueueTest, AtTheEndOfTimeAllWaitsEnd) {
  measure(0, 0);
  EXPECT_FALSE(queue_.next(kEndOfTime_ns).has_value());
  EXPECT_EQ(queue_.waiting(), 0U);
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kNoTransform, 1}}));
}

TEST_F(TransformQueueTest, AMeasurementIsDroppedAfterALaterOneIsReady) {
  measure(0, 0);
  measure(50, 50);
  move(40);  // nothing before it
  move(80);
  EXPECT_EQ(release(51), Released{50});
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kNoTransform, 1}}));
}

TEST_F(TransformQueueTest, BeyondTheBoundTheNewestReplacesThePreviousOne) {
  Queue queue(transforms_, params(3),
              [this](const char* reason, const std::string& /*detail*/) { ++dropped_[reason]; });
  for (const std::int64_t time_ms : {0, 50, 100, 150, 200}) {
    queue.add(time_ms, {"lidar", at_ms(time_ms), at_ms(time_ms)}, 0);
    EXPECT_FALSE(queue.next(0).has_value());
    EXPECT_LE(queue.waiting(), 3U);
  }
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kQueueFull, 2}}));
  move(0);
  move(300);
  Released released;
  while (const auto ready = queue.next(0)) released.push_back(ready->item);
  EXPECT_EQ(released, (Released{0, 50, 200}));
}

TEST_F(TransformQueueTest, StampsThatRepeatOrGoBackALittleAreRefused) {
  EXPECT_EQ(measure(2000, 0), StampOrder::Verdict::kNext);
  EXPECT_EQ(measure(2000, 1), StampOrder::Verdict::kRefused);
  EXPECT_EQ(measure(1500, 2), StampOrder::Verdict::kRefused);
  EXPECT_EQ(queue_.waiting(), 1U);
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kStamp, 2}}));
}

TEST_F(TransformQueueTest, StampsThatGoFarBackAreARestartWithoutTheOldTransforms) {
  move(5000);
  measure(5000, 0);
  measure(5050, 1);
  EXPECT_EQ(measure(100, 2), StampOrder::Verdict::kRefused);
  EXPECT_EQ(measure(150, 52), StampOrder::Verdict::kRefused);
  EXPECT_EQ(dropped_, Drops()) << "they are held";
  EXPECT_EQ(measure(200, 102), StampOrder::Verdict::kRestart);
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kRestart, 2}}));
  move(100);  // tf2 would refuse it beside those of later times
  move(300);
  EXPECT_EQ(release(103), (Released{100, 150, 200}));
}

TEST_F(TransformQueueTest, OneStampFarFromThoseAroundItIsAsIfItHadNotCome) {
  move(0);
  for (int i = 0; i < 10; ++i) measure(50 * i, 50 * i);
  EXPECT_EQ(measure(5'500, 500), StampOrder::Verdict::kRefused);
  EXPECT_EQ(dropped_, Drops());
  EXPECT_EQ(measure(550, 550), StampOrder::Verdict::kNext);
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kAnotherTime, 1}}));
  move(1000);
  EXPECT_EQ(release(551).size(), 11U);
  EXPECT_EQ(measure(-1'000'000, 600), StampOrder::Verdict::kRefused);
  EXPECT_FALSE(queue_.next(kEndOfTime_ns).has_value());
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kAnotherTime, 2}})) << "none agreed with it";
}

TEST_F(TransformQueueTest, ASilenceLosesNothing) {
  move(-10);
  move(30);
  for (int i = 0; i < 10; ++i) measure(50 * i, 50 * i);
  EXPECT_EQ(release(451).size(), 1U);
  EXPECT_EQ(measure(30'000, 30'010), StampOrder::Verdict::kNext) << "the clock explains it";
  EXPECT_EQ(measure(60'000, 30'060), StampOrder::Verdict::kRefused) << "it does not";
  EXPECT_EQ(measure(60'050, 30'110), StampOrder::Verdict::kRefused);
  EXPECT_EQ(measure(60'100, 30'160), StampOrder::Verdict::kNext);
  EXPECT_EQ(queue_.waiting(), 13U);
}

TEST_F(TransformQueueTest, AnInvalidTransformIsCounted) {
  geometry_msgs::TransformStamped bad = transform_to_msg(Eigen::Isometry3d::Identity(), 0, "world", "lidar");
  bad.transform.translation.x = 1e300;
  bad.transform.translation.y = 1e300;
  transforms_.setTransform(bad, "test", true);
  bad.header.frame_id = "lidar";
  bad.child_frame_id = "arm";
  bad.transform.translation.x = 1.7e308;
  bad.transform.translation.y = 1.7e308;
  bad.transform.rotation.z = bad.transform.rotation.w = std::sqrt(0.5);
  transforms_.setTransform(bad, "test", true);
  bad.child_frame_id = "hand";
  bad.header.frame_id = "arm";
  transforms_.setTransform(bad, "test", true);
  queue_.add(0, {"hand", at_ms(0), at_ms(0)}, 0);
  EXPECT_EQ(release(0), Released());
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kBadTransform, 1}}));
}

/// Measurements and transforms in any order, some of them missing: each measurement has one outcome, in order.
TEST_F(TransformQueueTest, EachMeasurementHasOneOutcome) {
  Random random(7);
  int measured = 0;
  Released released;
  std::int64_t now_ms = 0, last_measured_ms = -1, last_moved_ms = -1;
  for (int i = 0; i < 20000; ++i) {
    now_ms += 1 + static_cast<std::int64_t>(10.0 * random.uniform());
    if (random.uniform() < 0.3 && last_measured_ms < now_ms) {
      last_measured_ms = now_ms;
      measure(now_ms, now_ms);
      ++measured;
    } else if (random.uniform() < 0.5) {
      // late by up to 400 ms, and now and then not at all for a second
      const std::int64_t moved_ms = now_ms - static_cast<std::int64_t>(400.0 * random.uniform());
      if (moved_ms > last_moved_ms && moved_ms > 0 && (now_ms / 1000) % 7 != 0) move(last_moved_ms = moved_ms);
    }
    for (const std::int64_t time_ms : release(now_ms)) released.push_back(time_ms);
  }
  for (const std::int64_t time_ms : release(kEndOfTime_ns / kMillisecond_ns)) released.push_back(time_ms);
  int dropped = 0;
  for (const auto& [reason, count] : dropped_) dropped += count;
  EXPECT_EQ(static_cast<int>(released.size()) + dropped, measured);
  EXPECT_TRUE(std::is_sorted(released.begin(), released.end()));
  EXPECT_GT(released.size(), 3000U);
  EXPECT_GT(dropped_[drop_reason::kNoTransform], 100);
}

// To the last digit: of a sensor that turns, whose transform may come alone, or with the next one.
TEST(TransformQueue, PosesDoNotDependOnWhatComesAfter) {
  Random random(4);
  tf2::BufferCore before, after;
  const auto set = [](tf2::BufferCore& buffer, std::int64_t time_ms, const Eigen::Isometry3d& T) {
    buffer.setTransform(transform_to_msg(T, kStart_ns + time_ms * kMillisecond_ns, "world", "lidar"), "test");
  };
  std::vector<Eigen::Isometry3d> poses;
  for (int i = 0; i < 200; ++i) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() << random.uniform(), random.uniform(), random.uniform();
    T.rotate(Eigen::AngleAxisd(3.0 * random.uniform(), Eigen::Vector3d(random.uniform(), 1.0, 0.3).normalized()));
    poses.push_back(T);
    set(after, 20 * i, T);
  }
  for (int i = 0; i < 199; ++i) {
    set(before, 20 * i, poses[static_cast<std::size_t>(i)]);
    const Eigen::Isometry3d first = transform_at(before, "world", "lidar", at_ms(20 * i));
    EXPECT_EQ(first.matrix(), transform_at(after, "world", "lidar", at_ms(20 * i)).matrix()) << i;
    EXPECT_LT((first.matrix() - poses[static_cast<std::size_t>(i)].matrix()).norm(), 1e-6);
  }
}

TEST(TransformQueue, TakesAScanFromItsFirstBeamToItsLast) {
  sensor_msgs::LaserScan msg;
  msg.header.frame_id = "/lidar";
  msg.header.stamp = at_ms(0);
  msg.ranges.resize(101);
  msg.time_increment = 1e-4F;
  EXPECT_EQ(taken(msg).frame, "lidar");
  EXPECT_EQ(taken(msg).first, at_ms(0));
  EXPECT_EQ(taken(msg).last, time_of_last_beam(msg));
  EXPECT_NEAR((taken(msg).last - at_ms(0)).toSec(), 0.01, 1e-8);
  const bool deskew = false;
  EXPECT_EQ(taken(msg, deskew).last, at_ms(0));
}

/// A sensor of which the pose is found at another time than the measurement's, and a measurement of 20 ms from 90 ms
/// on.
class OffsetTransformQueueTest : public TransformQueueTest {
 protected:
  /// The places at the measurement's first and last instant, once the pose of the last one is there; `now_ms`: by then.
  std::vector<double> places_m(double offset_s, std::int64_t last_pose_ms, std::int64_t now_ms) {
    TransformQueueParams with_offset = params();
    with_offset.pose_offset_s = offset_s;
    Queue queue(transforms_, with_offset, [this](const char* reason, const std::string&) { ++dropped_[reason]; });
    queue.add(90, {"lidar", at_ms(90), at_ms(90 + kSweep_ms)}, 0);
    for (std::int64_t time_ms = 0; time_ms <= last_pose_ms; time_ms += 30) move(time_ms);
    const auto ready = queue.next(now_ms * kMillisecond_ns);
    if (!ready) return {};
    return {ready->T_world_sensor.translation().x(), ready->T_world_sensor_end.translation().x()};
  }
};

TEST_F(OffsetTransformQueueTest, LooksUpPosesLaterOrEarlier) {
  const std::vector<double> later_m = places_m(0.13, 300, 0);
  ASSERT_EQ(later_m.size(), 2U);
  EXPECT_NEAR(later_m[0], 0.22, 1.1e-9);
  EXPECT_NEAR(later_m[1], 0.24, 1.1e-9);
  const std::vector<double> earlier_m = places_m(-0.05, 300, 0);
  ASSERT_EQ(earlier_m.size(), 2U);
  EXPECT_NEAR(earlier_m[0], 0.04, 1.1e-9);
  EXPECT_NEAR(earlier_m[1], 0.06, 1.1e-9);
}

TEST_F(OffsetTransformQueueTest, WaitsForLaterPosesSoMuchLonger) {
  EXPECT_TRUE(places_m(0.4, 480, 899).empty());
  EXPECT_EQ(dropped_, Drops()) << "0.5 s and the offset have not passed";
  EXPECT_TRUE(places_m(0.4, 480, 900).empty());
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kNoTransform, 1}}));
  EXPECT_FALSE(places_m(0.4, 510, 899).empty());
}

TEST_F(OffsetTransformQueueTest, PosesFromBeforeTheBeginningOfTimeAreMissing) {
  TransformQueueParams with_offset = params();
  with_offset.pose_offset_s = -1.0;
  Queue queue(transforms_, with_offset, [this](const char* reason, const std::string&) { ++dropped_[reason]; });
  const ros::Time soon(0, 5'000'000);
  transforms_.setTransform(transform_to_msg(Eigen::Isometry3d::Identity(), 5'000'000, "world", "lidar"), "test");
  queue.add(0, {"lidar", soon, soon}, 0);
  EXPECT_FALSE(queue.next(kEndOfTime_ns).has_value());
  EXPECT_EQ(dropped_, (Drops{{drop_reason::kNoTransform, 1}}));
}

TEST(TransformQueue, WaitsForATransformThatComesLastOfAChainUpToTheLongestTimeout) {
  constexpr double kTimeout_s = 60.0;
  tf2::BufferCore transforms(transform_cache_time(kTimeout_s));
  TransformQueue<int> queue(transforms, {"world", kTimeout_s, 20}, {});
  queue.add(0, {"lidar", at_ms(0), at_ms(0)}, 0);
  const auto set = [&](std::int64_t time_ms, const char* parent, const char* child) {
    transforms.setTransform(
        transform_to_msg(Eigen::Isometry3d::Identity(), kStart_ns + time_ms * kMillisecond_ns, parent, child), "test");
  };
  for (std::int64_t time_ms = 0; time_ms < 59'000; time_ms += 100) set(time_ms, "world", "base");
  EXPECT_FALSE(queue.next(59'000 * kMillisecond_ns));
  set(0, "base", "lidar");
  EXPECT_TRUE(queue.next(59'000 * kMillisecond_ns));
}

TEST(TransformQueue, RefusesInvalidParameters) {
  tf2::BufferCore transforms;
  const auto make = [&](const TransformQueueParams& params) { TransformQueue<int>(transforms, params, {}); };
  EXPECT_THROW(make({"", 0.5, 1}), std::invalid_argument);
  EXPECT_THROW(make({"world", -0.5, 1}), std::invalid_argument);
  EXPECT_THROW(make({"world", std::numeric_limits<double>::quiet_NaN(), 1}), std::invalid_argument);
  EXPECT_THROW(make({"world", 0.5, 0}), std::invalid_argument);
  EXPECT_THROW(make({"world", 0.5, 1, std::numeric_limits<double>::infinity()}), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::transform_queue_test
