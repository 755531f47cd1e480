// SPDX-License-Identifier: BSD-3-Clause
// Each stage with a state, of a recording in which the stamp of one message is wrong: what it knows at the end is what
// it knows without that message, bit for bit.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "map/polygons/guarded_map.hpp"
#include "map/polygons/room_polylines.hpp"
#include "pose/reflector_drive.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/feature_json.hpp"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "support/fault_cell.hpp"
#include "support/grid_ground.hpp"
#include "support/lively_scene.hpp"
#include "support/wrong_stamp.hpp"

namespace situation_awareness::wrong_stamp_test {
namespace {

constexpr std::int64_t kBegin_ns = 1'000'000'000'000'000;
/// Messages before the first wrong one: without receipts an order has to know its period.
constexpr int kKnown = StampOrder::kUsual + 2;

/// What a stage knows at the end, and how many messages it refused.
struct Outcome {
  std::string state;
  int refused = 0;
};

/// Hexadecimal: every bit of a number.
std::string exact(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%a ", value);
  return text.data();
}

Outcome objects(const WrongStamp& wrong) {
  static const std::vector<Detections> all = lively_scene(160, kBegin_ns, 3);
  ObjectMap map{ObjectMapParams{}};
  Outcome outcome;
  for (int i = 0; i < static_cast<int>(all.size()); ++i) {
    if (wrong.leaves_out("scan", i)) continue;
    Detections detections = all[static_cast<std::size_t>(i)];
    detections.stamp_ns = wrong("scan", i, detections.stamp_ns);
    map.update(detections);
    outcome.refused += map.stamp_ns() != detections.stamp_ns;
  }
  MapSnapshot snapshot = map.snapshot();
  snapshot.world_frame = "map";
  outcome.state = map_to_yaml(snapshot);
  return outcome;
}

Outcome polygons(const WrongStamp& wrong) {
  static const std::vector<Polylines> all = [] {
    RoomPolylines room(5, kBegin_ns);
    room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
    std::vector<Polylines> polylines;
    for (int i = 0; i < 120; ++i) polylines.push_back(room.next());
    return polylines;
  }();
  GuardedMap map(PolygonMapParams{});
  Outcome outcome;
  for (int i = 0; i < static_cast<int>(all.size()); ++i) {
    if (wrong.leaves_out("scan", i)) continue;
    Polylines polylines = all[static_cast<std::size_t>(i)];
    polylines.stamp_ns = wrong("scan", i, polylines.stamp_ns);
    outcome.refused += !map.update(polylines, Eigen::Vector3d(1e-6, 1e-6, 1e-7).asDiagonal());
  }
  std::ostringstream state;
  for (const Chain& chain : map.map().polygons().chains) {
    state << chain.id << ' ' << chain.closed << ' ' << chain.first_seen_ns << ' ' << chain.last_seen_ns << ' '
          << exact(chain.p_exists);
    for (const ChainVertex& vertex : chain.vertices) {
      state << exact(vertex.p_world_m.x()) << exact(vertex.p_world_m.y()) << exact(vertex.sigma_m);
    }
    state << '\n';
  }
  outcome.state = state.str();
  return outcome;
}

/// A vehicle flies around a round tower.
Outcome one_map(const WrongStamp& wrong) {
  constexpr double kTower_m = 6.0, kDistance_m = 14.0;
  MapPipelineParams map_params;
  SplinegonPipelineParams& params = map_params.layers;
  params.polylines.max_offset_m = 0.1;
  params.polygons.spacing_m = 0.15;
  params.polygons.gate_m = 0.3;
  params.polygons.max_gap_m = 1.0;
  params.polygons.pass_margin_m = 0.2;
  params.polygons.max_pose_sigma_m = 10.0;
  StampOrder order;
  MapPipeline map(map_params, {false, true, true, false});
  Outcome outcome;
  for (int i = 0; i < 100; ++i) {
    if (wrong.leaves_out("scan", i)) continue;
    const double at_rad = 0.5 * i / kDistance_m;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() << kDistance_m * std::cos(at_rad), kDistance_m * std::sin(at_rad), 10.0;
    T.linear() = Eigen::AngleAxisd(at_rad + 0.5 * kPi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    Scan scan;
    scan.stamp_ns = wrong("scan", i, kBegin_ns + std::int64_t{100'000'000} * i);
    scan.angle_min_rad = -kPi;
    scan.angle_increment_rad = 2.0 * kPi / 360;
    for (int k = 0; k < 360; ++k) {
      const double angle_rad = scan.angle_min_rad + k * scan.angle_increment_rad;
      const Eigen::Vector2d u = (T.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0)).head<2>();
      const double along_m = -T.translation().head<2>().dot(u);
      const double aside_2 = kDistance_m * kDistance_m - along_m * along_m;
      const bool hits = along_m > 0.0 && aside_2 < kTower_m * kTower_m;
      const double range_m = hits ? along_m - std::sqrt(kTower_m * kTower_m - aside_2) : INFINITY;
      scan.beams.push_back(beam_from_range(static_cast<float>(range_m), 0.1F, 30.0F));
    }
    const StampOrder::Verdict verdict = order.judge(scan.stamp_ns);
    outcome.refused += verdict == StampOrder::Verdict::kRefused;
    if (verdict == StampOrder::Verdict::kRefused) continue;
    if (verdict == StampOrder::Verdict::kRestart) map.begin_anew();
    map.process(scan, T, T, Eigen::Matrix3d(Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal()));
  }
  Json features = Json::array();
  for (const Feature& feature : map.map().features) add_feature(features, feature);
  outcome.state = features.dump();
  return outcome;
}

/// Images of an orbit.
Outcome grid(const WrongStamp& wrong) {
  static const GridCase given = make_grid_case("orbit", 1);
  const PinholeCamera camera = square_camera(56);
  GridPipeline pipeline({}, flat_ground());
  Outcome outcome;
  for (int i = 0; i < static_cast<int>(given.T_world_camera.size()); ++i) {
    if (wrong.leaves_out("image", i)) continue;
    SoftLabels labels = labels_of(given, camera, static_cast<std::size_t>(i), 1);
    // At 10 Hz: without receipts the period alone tells.
    labels.stamp_ns = wrong("image", i, kBegin_ns + std::int64_t{100'000'000} * i);
    pipeline.process(labels, given_pose(given, static_cast<std::size_t>(i), 1));
    outcome.refused += pipeline.verdict() == StampOrder::Verdict::kRefused;
  }
  std::ostringstream state;
  const SemanticGrid cells = pipeline.map().grid();
  state << cells.stamp_ns << ' ' << cells.first_column << ' ' << cells.first_row << '\n';
  for (const float probability : cells.probability) state << exact(static_cast<double>(probability));
  for (const GridTarget& target : pipeline.targets().targets) {
    state << target.id << ' ' << exact(target.p_world_m.x()) << exact(target.p_world_m.y())
          << exact(target.covariance_m2(0, 0));
  }
  outcome.state = state.str();
  return outcome;
}

Outcome reflector_localisation(const WrongStamp& wrong) {
  const ReflectorMap reflectors = map_of(5);
  ReflectorWorld world = room_with(reflectors);
  world.path = winding_path(0.5);
  Random random(8);
  DriftingWheels wheels(world.path, 9);
  ReflectorLocalization localization(reflectors, {});
  localization.initial_pose(kBegin_ns, world.path(0.0), 0.05, 0.02);
  Outcome outcome;
  int odometry = 0;
  ReflectorSightings sightings;
  for (int i = 0; i < 150; ++i) {
    const double time_s = 0.1 + 0.04 * i;
    while (wheels.next_time_s() < time_s + 0.045) {
      const auto [stamp_ns, T_odom_base] = wheels.next();
      const int k = odometry++;
      if (wrong.leaves_out("odometry", k)) continue;
      outcome.refused += localization.add_odometry(wrong("odometry", k, kBegin_ns + stamp_ns), T_odom_base) ==
                         OdometryTrack::Verdict::kRefused;
    }
    sightings = detect_reflectors(world.points(time_s, random), {}, std::move(sightings));
    if (wrong.leaves_out("scan", i)) continue;
    sightings.stamp_ns = wrong("scan", i, kBegin_ns + nanoseconds(time_s));
    const ReflectorUpdate& update = localization.update(sightings, world.T_base_lidar);
    const std::string reason = update.reason;
    outcome.refused += reason == "scan out of order" || reason == "scan of another time";
  }
  std::ostringstream state;
  state << localization.is_known();
  if (localization.is_known()) {
    const LocalizedPose pose = localization.pose();
    const Pose2& T = pose.T_world_base.x;
    state << pose.stamp_ns << ' ' << exact(T.translation_m.x()) << exact(T.translation_m.y()) << exact(T.yaw_rad);
    for (int k = 0; k < 9; ++k) state << exact(pose.covariance_world(k / 3, k % 3));
  }
  outcome.state = state.str();
  return outcome;
}

struct Case {
  const char* stage;
  const char* stream;
  int messages;
  Outcome (*run)(const WrongStamp&);
};

void PrintTo(const Case& of, std::ostream* out) { *out << of.stage << ", " << of.stream; }

class WrongStampTest : public ::testing::TestWithParam<Case> {};

TEST_P(WrongStampTest, OneIsAsIfItHadNotCome) {
  const Case& of = GetParam();
  Random random(11);
  std::map<int, Outcome> without;
  for (const double shift_s : kStampShifts_s) {
    const FaultCell cell(of.stage, of.stream, stamp_fault(shift_s), "refused and counted, as if it had not come");
    for (const double part : {0.0, random.uniform(), 1.0}) {
      const int message = kKnown + static_cast<int>(part * (of.messages - kKnown - 1));
      if (without.count(message) == 0) without[message] = of.run({of.stream, message, 0.0, true});
      const Outcome with = of.run({of.stream, message, shift_s});
      EXPECT_EQ(without[message].refused, 0);
      EXPECT_EQ(with.refused, 1) << shift_s << " s, message " << message;
      EXPECT_TRUE(with.state == without[message].state) << shift_s << " s, message " << message;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Stages, WrongStampTest,
                         ::testing::Values(Case{"objects", "scan", 160, objects},
                                           Case{"polygons", "scan", 120, polygons},
                                           Case{"one map", "scan", 100, one_map}, Case{"grid", "image", 40, grid},
                                           Case{"reflector localisation", "scan", 150, reflector_localisation},
                                           Case{"reflector localisation", "odometry", 300, reflector_localisation}));

}  // namespace
}  // namespace situation_awareness::wrong_stamp_test
