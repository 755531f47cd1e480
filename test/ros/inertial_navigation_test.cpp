// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/inertial_navigation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <tf2/buffer_core.h>

#include "pose/gps_ins_flight.hpp"
#include "situation_awareness/pose/inertial_motion.hpp"
#include "situation_awareness/pose/local_world.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "support/fault_cell.hpp"
#include "support/wrong_stamp.hpp"

namespace situation_awareness::inertial_navigation_test {
namespace {

ros::Time stamp_of(const FlightRun& run) {
  ros::Time stamp;
  stamp.fromNSec(static_cast<std::uint64_t>(1'000'000'000'000 + run.stamp_ns()));
  return stamp;
}

sensor_msgs::Imu imu_of(FlightRun& run) {
  const InertialSample sample = run.sample();
  sensor_msgs::Imu msg;
  msg.header.stamp = stamp_of(run);
  msg.header.frame_id = "base_link";
  msg.orientation_covariance[0] = -1.0;
  msg.linear_acceleration.x = sample.specific_force_m_s2.x();
  msg.linear_acceleration.y = sample.specific_force_m_s2.y();
  msg.linear_acceleration.z = sample.specific_force_m_s2.z();
  msg.angular_velocity.x = sample.angular_velocity_rad_s.x();
  msg.angular_velocity.y = sample.angular_velocity_rad_s.y();
  msg.angular_velocity.z = sample.angular_velocity_rad_s.z();
  return msg;
}

sensor_msgs::NavSatFix fix_of(FlightRun& run, const GeodeticPosition& origin) {
  const GeodeticPosition position = geodetic_position(origin, run.fix());
  sensor_msgs::NavSatFix msg;
  msg.header.stamp = stamp_of(run);
  msg.header.frame_id = "base_link";
  msg.status.status = sensor_msgs::NavSatStatus::STATUS_FIX;
  msg.latitude = position.latitude_deg;
  msg.longitude = position.longitude_deg;
  msg.altitude = position.altitude_m;
  Eigen::Map<Eigen::Matrix3d>(msg.position_covariance.data()) = run.fix_covariance();
  msg.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  return msg;
}

// A flight that begins in a turn: the tilt is not known from gravity then, nor well when the pose is just ready.
TEST(InertialNavigation, ChangesOfTheVelocityAreRightSoonAfterAStartInATurn) {
  const GeodeticPosition origin{47.0, 8.0, 400.0};
  tf2::BufferCore tf;
  SimulatedFlight flight;
  flight.legs = {{14.0, 0.75}, {6.0, 0.0}, {14.0, -0.75}, {20.0, 0.2}};
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    FlightRun run(flight, {}, seed);
    double odom_yaw_rad = 0.0;
    InertialNavigation navigation({}, tf,
                                  {[&](const geometry_msgs::TransformStamped& T_odom_base) {
                                     const auto& q = T_odom_base.transform.rotation;
                                     odom_yaw_rad = yaw_of(Eigen::Quaterniond(q.w, q.x, q.y, q.z));
                                   },
                                   [] {}});
    double ready_s = -1.0, most_m_s = 0.0;
    Eigen::Vector2d v_odom_m_s = Eigen::Vector2d::Zero(), v_m_s = Eigen::Vector2d::Zero();
    Eigen::Rotation2Dd R_odom_world(0.0);
    int windows = 0;
    for (; run.time_s() < 60.0; run.next()) {
      navigation.add_imu(imu_of(run));
      if (run.has_fix()) navigation.add_fix(fix_of(run, origin));
      if (!navigation.is_ready()) continue;
      if (ready_s < 0.0) ready_s = run.time_s();
      const long step = std::lround((run.time_s() - ready_s) * 200.0);
      if (step < 1000 || step % 400 != 0) continue;  // from 5 s on, each 2 s
      const auto stamp_ns = static_cast<std::int64_t>(stamp_of(run).toNSec());
      const Eigen::Isometry3d nowhere = Eigen::Isometry3d::Identity();
      const InertialPlacement placement = navigation.placement_at(stamp_ns, nowhere, nowhere);
      const Eigen::Vector2d v_now_m_s = flight.velocity(run.time_s()).head<2>();
      if (windows++ > 0) {
        const Eigen::Vector2d error_m_s = placement.v_odom_m_s - v_odom_m_s - R_odom_world * (v_now_m_s - v_m_s);
        most_m_s = std::max(most_m_s, error_m_s.norm());
      }
      v_odom_m_s = placement.v_odom_m_s;
      v_m_s = v_now_m_s;
      R_odom_world = Eigen::Rotation2Dd(odom_yaw_rad - flight.yaw(run.time_s()));
    }
    EXPECT_GT(windows, 8) << seed;
    EXPECT_LT(most_m_s, 1.3) << seed;  // what the filter's own tilt leaves; 6 m/s with that of the start
  }
}

// A straight flight, in which little tells the tilt, and then turns, in which the pose gets ready. A map of the scans
// until then tells the error of the acceleration, if that goes on as it is: what the fixes teach meanwhile is no jump.
TEST(InertialNavigation, TheErrorOfTheAccelerationDoesNotJumpWhereThePoseGetsReady) {
  const GeodeticPosition origin{47.0, 8.0, 400.0};
  tf2::BufferCore tf;
  SimulatedFlight flight;
  flight.legs = {{15.0, 0.0}, {25.0, 0.45}};
  constexpr double kWindow_s = 2.0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    FlightRun run(flight, {}, seed);
    const double begin_s = stamp_of(run).toSec() - run.time_s();
    std::vector<std::pair<std::int64_t, double>> odom_yaws;
    InertialNavigation navigation({}, tf,
                                  {[&](const geometry_msgs::TransformStamped& T_odom_base) {
                                     const auto& q = T_odom_base.transform.rotation;
                                     odom_yaws.emplace_back(to_nanoseconds(T_odom_base.header.stamp),
                                                            yaw_of(Eigen::Quaterniond(q.w, q.x, q.y, q.z)));
                                   },
                                   [] {}});
    for (; run.time_s() < 40.0; run.next()) {
      navigation.add_imu(imu_of(run));
      if (run.has_fix()) navigation.add_fix(fix_of(run, origin));
    }
    ASSERT_FALSE(odom_yaws.empty()) << seed;
    const std::int64_t first_ns = odom_yaws.front().first;
    EXPECT_FALSE(navigation.was_ready_at(first_ns + nanoseconds(10.0))) << seed;
    Eigen::Vector2d v_odom_m_s = Eigen::Vector2d::Zero(), error_world_m_s = Eigen::Vector2d::Zero();
    int windows = 0;
    double most_m_s = 0.0;
    std::int64_t next_ns = first_ns;
    for (const auto& [stamp_ns, odom_yaw_rad] : odom_yaws) {
      if (stamp_ns < next_ns) continue;
      next_ns += nanoseconds(kWindow_s);
      const Eigen::Isometry3d nowhere = Eigen::Isometry3d::Identity();
      const InertialPlacement placement = navigation.placement_at(stamp_ns, nowhere, nowhere);
      const double time_s = 1e-9 * static_cast<double>(stamp_ns) - begin_s;
      const Eigen::Rotation2Dd R_world_odom(flight.yaw(time_s) - odom_yaw_rad);
      const Eigen::Vector2d change_m_s = R_world_odom * (placement.v_odom_m_s - v_odom_m_s);
      const Eigen::Vector2d true_m_s = (flight.velocity(time_s) - flight.velocity(time_s - kWindow_s)).head<2>();
      if (windows > 1) most_m_s = std::max(most_m_s, (change_m_s - true_m_s - error_world_m_s).norm());
      if (windows > 0) error_world_m_s = change_m_s - true_m_s;
      v_odom_m_s = placement.v_odom_m_s;
      ++windows;
    }
    EXPECT_GT(windows, 12) << seed;
    EXPECT_LT(most_m_s, 0.3) << seed;
  }
}

/// A message of a flight, when it comes.
struct Arriving {
  std::int64_t at_ns;
  std::optional<sensor_msgs::Imu> imu;
  std::optional<sensor_msgs::NavSatFix> fix;
};

/// Of a flight that begins in a turn: samples come at once, fixes 50 ms after their stamps.
std::vector<Arriving> short_flight(const WrongStamp& wrong = {}) {
  const GeodeticPosition origin{47.0, 8.0, 400.0};
  SimulatedFlight flight;
  flight.legs = {{14.0, 0.75}, {6.0, 0.0}, {20.0, -0.4}};
  FlightSensors sensors;
  sensors.imu_rate_hz = 100.0;
  FlightRun run(flight, sensors, 3);
  std::vector<Arriving> messages;
  int samples = 0, fixes = 0;
  for (; run.time_s() < 36.0; run.next()) {
    const auto at_ns = static_cast<std::int64_t>(stamp_of(run).toNSec());
    const auto stamped = [&](auto msg, const char* stream, int i) {
      msg.header.stamp = to_ros_time(std::max(wrong(stream, i, at_ns), std::int64_t{1}));
      return msg;
    };
    const sensor_msgs::Imu imu = imu_of(run);
    if (!wrong.leaves_out("imu", samples)) messages.push_back({at_ns, stamped(imu, "imu", samples), {}});
    ++samples;
    if (!run.has_fix()) continue;
    const sensor_msgs::NavSatFix fix = fix_of(run, origin);
    if (!wrong.leaves_out("fix", fixes)) messages.push_back({at_ns + 50'000'000, {}, stamped(fix, "fix", fixes)});
    ++fixes;
  }
  return messages;
}

/// All poses in the order in which they come, and placements twice a second.
std::vector<double> flown(std::vector<Arriving> messages) {
  std::stable_sort(messages.begin(), messages.end(),
                   [](const Arriving& a, const Arriving& b) { return a.at_ns < b.at_ns; });
  std::vector<double> result;
  tf2::BufferCore tf;
  InertialNavigation navigation({}, tf,
                                {[&](const geometry_msgs::TransformStamped& T) {
                                   result.insert(result.end(), {T.header.stamp.toSec(), T.transform.translation.x,
                                                                T.transform.translation.y, T.transform.rotation.z});
                                 },
                                 [] {}});
  std::int64_t placed_ns = 0;
  for (const Arriving& message : messages) {
    if (message.fix) {
      navigation.add_fix(*message.fix, message.at_ns);
      continue;
    }
    navigation.add_imu(*message.imu, message.at_ns);
    if (!navigation.is_ready() || navigation.stamp_ns() < placed_ns + 500'000'000) continue;
    placed_ns = navigation.stamp_ns();
    const Eigen::Isometry3d nowhere = Eigen::Isometry3d::Identity();
    const InertialPlacement placement = navigation.placement_at(placed_ns - 20'000'000, nowhere, nowhere);
    result.insert(result.end(), placement.pose_covariance.data(), placement.pose_covariance.data() + 9);
    for (const PlacedFix& fix : placement.fixes) result.push_back(fix.fix_world_m.x());
  }
  return result;
}

// A receiver that is slower than 5 Hz may have been late: then the fix is used, 0.2 s late.
TEST(InertialNavigation, OneWrongStampIsAsIfItHadNotCome) {
  for (const auto& [stream, messages] :
       {std::make_pair("imu", std::vector<int>{7, 1200, 1999}), std::make_pair("fix", std::vector<int>{30, 60})}) {
    for (const double shift_s : kStampShifts_s) {
      const FaultCell cell("GPS/INS", stream, stamp_fault(shift_s), "refused and counted, as if it had not come");
      for (const int message : messages) {
        const std::vector<double> without = flown(short_flight({stream, message, 0.0, true}));
        EXPECT_GT(without.size(), 4000U);
        EXPECT_TRUE(flown(short_flight({stream, message, shift_s})) == without)
            << stream << ' ' << message << ", " << shift_s << " s";
      }
    }
  }
}

/// What a driver does otherwise, and the sentence about it, of which live diagnostics warn; none where it is made good.
struct DriverFault {
  std::function<void(Arriving&, int)> change;
  const char* sentence;
};

TEST(InertialNavigation, WhatContradictsItselfIsNamedAndWhatDoesNotIsUsed) {
  const auto of_imu = [](auto change) {
    return [change](Arriving& message, int i) {
      if (message.imu) change(*message.imu, i);
    };
  };
  const auto of_fix = [](auto change) {
    return [change](Arriving& message, int i) {
      if (message.fix) change(*message.fix, i);
    };
  };
  const auto turn_by = [&](double factor) {
    return of_imu([factor](sensor_msgs::Imu& imu, int) {
      imu.angular_velocity.x *= factor;
      imu.angular_velocity.y *= factor;
      imu.angular_velocity.z *= factor;
    });
  };
  const auto raise = [&](double by_m) {
    return of_fix([by_m](sensor_msgs::NavSatFix& fix, int i) { fix.altitude += i > 80 ? by_m : 0.0; });
  };
  const auto stamp_later = [&](double seconds) {
    return of_fix([seconds](sensor_msgs::NavSatFix& fix, int) { fix.header.stamp += ros::Duration(seconds); });
  };
  const auto read_at_once = [&](int count) {
    return of_imu(
        [count](sensor_msgs::Imu& imu, int i) { imu.header.stamp += ros::Duration(0.01 * (count - 1 - i % count)); });
  };
  const auto without_altitude = of_fix([](sensor_msgs::NavSatFix& fix, int) { fix.altitude = std::nan(""); });
  const std::vector<DriverFault> faults = {
      {[](Arriving&, int) {}, ""},
      // By fixes of 1.5 m the course is not known in such turns, and so the cause is not.
      {turn_by(57.2958), "contradict each other"},
      {turn_by(-1.0), "contradict each other"},
      {stamp_later(18.0), "18 s ahead of those of the IMU"},
      {stamp_later(-18.0), "18 s behind those of the IMU"},
      {stamp_later(0.6), "ahead of those of the IMU"},
      {raise(-47.0), "the altitude of the fixes jumps by"},
      {raise(47.0), "the altitude of the fixes jumps by"},
      {without_altitude, ""},
      {read_at_once(4), ""},
      {read_at_once(10), ""},
      {read_at_once(25), ""},
  };
  for (std::size_t k = 0; k < faults.size(); ++k) {
    std::vector<Arriving> messages = short_flight();
    int samples = 0, fixes = 0;
    for (Arriving& message : messages) faults[k].change(message, message.imu ? samples++ : fixes++);
    tf2::BufferCore tf;
    InertialNavigation navigation({}, tf, {[](const geometry_msgs::TransformStamped&) {}, [] {}});
    std::string sentence;
    for (const Arriving& message : messages) {
      if (message.imu) navigation.add_imu(*message.imu, message.at_ns);
      if (message.fix) navigation.add_fix(*message.fix, message.at_ns);
      const std::string now = navigation.input().contradiction();  // one that names a cause may come later
      if (!now.empty() && (sentence.empty() || sentence == GpsIns::kContradicted)) sentence = now;
    }
    EXPECT_NE(sentence.find(faults[k].sentence), std::string::npos) << k << ": " << sentence;
    if (*faults[k].sentence == '\0') {
      EXPECT_EQ(sentence, "") << k;
      EXPECT_TRUE(navigation.is_ready()) << k;
    }
  }
}

TEST(InertialNavigation, TheOrderInWhichFixesComeAmongTheSamplesDoesNotMatter) {
  const std::vector<Arriving> messages = short_flight();
  const std::vector<double> in_order = flown(messages);
  ASSERT_GT(in_order.size(), 4000U);
  Random random(5);
  for (int order = 0; order < 10; ++order) {
    std::vector<Arriving> delayed = messages;
    std::int64_t latest_ns = 0;
    for (Arriving& message : delayed) {
      const double late_s = message.fix ? random.uniform(0.0, InertialNavigation::kPatience_s - 0.06) : 0.0;
      message.at_ns += nanoseconds(late_s);
      if (message.fix) message.at_ns = latest_ns = std::max(latest_ns, message.at_ns);
    }
    EXPECT_TRUE(flown(delayed) == in_order) << order;
  }
}

}  // namespace
}  // namespace situation_awareness::inertial_navigation_test
