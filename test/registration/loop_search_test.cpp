// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/loop_search.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::loop_search_test {
namespace {

using Walls = std::vector<LevelScene::Wall>;
using PoseAt = std::function<Pose2(double t_s)>;

constexpr double kPeriod_s = 0.04, kSigma_m = 0.03;

/// Of the elements as cfg/splinegons.yaml has them.
PolygonMapParams params() {
  PolygonMapParams params;
  params.spacing_m = 0.15;
  params.gate_m = 0.3;
  params.max_gap_m = 1.0;
  params.pass_margin_m = 0.2;
  params.confirmation_probability = 0.87;
  params.tolerance_m = 0.03;
  params.max_pose_sigma_m = 10.0;
  return params;
}

/// A facade along x, its free side towards -y.
Walls facade() { return {{{-12.0, 0.0}, {12.0, 0.0}}}; }

/// The same with a wing that ends it.
Walls facade_with_wing() { return {{{-12.0, 0.0}, {2.0, 0.0}}, {{2.0, 0.0}, {2.0, -4.0}}}; }

/// A scanner whose pose as the map knows it drifts from the true one.
class Drifting {
 public:
  explicit Drifting(std::uint64_t seed) : random_(seed), map_(params()) {}

  /// Sees walls from a true pose while it is taken to be at `drift` times that. Whether a loop is to be closed; it ends
  /// then.
  bool see(const Walls& walls, double from_s, double to_s, const PoseAt& pose_at, const Pose2& drift = {}) {
    for (double t_s = from_s; t_s < to_s; t_s += kPeriod_s) {
      const Pose2 T_level_world = inverse(pose_at(t_s));
      LevelScene scene;
      scene.angle_min_rad = -kPi;
      scene.beams = 720;
      scene.angle_increment_rad = 2.0 * kPi / scene.beams;
      for (const auto& wall : walls) scene.walls.push_back({T_level_world * wall.from, T_level_world * wall.to});
      Scan scan = scene.scan(&random_, kSigma_m);
      scan.stamp_ns = nanoseconds(1000.0 + t_s);
      Points points = project_horizontally(scan, Eigen::Isometry3d::Identity());
      points.T_world_level = drift * pose_at(t_s);
      polylines_ = extract_polylines(segment(points, {}), {}, std::move(polylines_));
      const Eigen::Matrix3d covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();
      found_ = loops_.see(map_, polylines_, points.T_world_level, covariance);
      if (found_) return true;
      update_ = map_.update(polylines_, covariance, std::move(update_));
    }
    return false;
  }

  double now_s() const { return seconds_between(nanoseconds(1000.0), polylines_.stamp_ns); }
  Pose2 foreseen_motion_of(double drawn_s) const { return loops_.motion_of(nanoseconds(1000.0 + drawn_s)); }
  double drawn_s() const { return seconds_between(nanoseconds(1000.0), found_->drawn_ns); }
  /// Of the loop that is to be closed: what is drawn now has drifted, by so much in a standard deviation.
  Pose2 motion() const {
    const Eigen::Matrix3d drift = Eigen::Vector3d(0.6, 0.6, 0.06).cwiseAbs2().cwiseInverse().asDiagonal();
    return motion_about(found_->center_m, (found_->A + drift).ldlt().solve(found_->b));
  }

 private:
  Random random_;
  PolygonMap map_;
  LoopSearch loops_{kSigma_m};
  std::optional<FoundLoop> found_;
  Polylines polylines_;
  PolygonMapUpdate update_;
};

/// Along the facade at 8 m, 3 m/s, again and again for 2 s.
Pose2 along_facade(double t_s) { return {{-6.0 + 3.0 * std::fmod(t_s, 20.0), -8.0}, 0.1}; }

TEST(LoopSearch, FindsNoneWhereWhatIsOldIsMet) {
  Drifting drifting(1);
  EXPECT_FALSE(drifting.see(facade_with_wing(), 0.0, 2.0, along_facade));
  EXPECT_FALSE(drifting.see(facade_with_wing(), 40.0, 42.0, along_facade));
}

TEST(LoopSearch, MovesWhatDriftedBack) {
  for (const double sign : {-1.0, 1.0}) {
    Drifting drifting(2);
    const Pose2 drift = {{sign * 0.2, sign * 0.4}, sign * 0.02};
    ASSERT_FALSE(drifting.see(facade_with_wing(), 0.0, 2.0, along_facade));
    ASSERT_TRUE(drifting.see(facade_with_wing(), 40.0, 42.0, along_facade, drift));
    EXPECT_LT(drifting.now_s(), 41.5);
    // Where the scanner is.
    const Eigen::Vector2d at_m = along_facade(drifting.now_s()).translation_m;
    const Pose2 back = drifting.motion() * drift;
    EXPECT_LT((back * at_m - at_m).norm(), 0.15);
    EXPECT_NEAR(back.yaw_rad, 0.0, 0.01);
  }
}

// Across the boundary the motion is known, whatever scans say of the way along it.
TEST(LoopSearch, MovesWhatDriftedAcrossAFaceThatLeavesTheWayAlongItOpen) {
  for (const double across_m : {-0.3, 0.3}) {
    Drifting drifting(3);
    const Pose2 drift = {{0.0, across_m}, 0.0};
    ASSERT_FALSE(drifting.see(facade(), 0.0, 2.0, along_facade));
    // As soon as it is known well, or the face is out of sight.
    ASSERT_TRUE(drifting.see(facade(), 40.0, 42.0, along_facade, drift) ||
                drifting.see({}, 42.0, 43.0, along_facade, drift));
    for (const double x_m : {-6.0, 0.0, 6.0}) {
      const Eigen::Vector2d on_facade_m(x_m, 0.0);
      const Eigen::Vector2d back_m = drifting.motion() * (drift * on_facade_m);
      EXPECT_NEAR(back_m.y(), 0.0, 0.05) << x_m;
      EXPECT_NEAR(back_m.x(), x_m, 0.2) << x_m;
    }
  }
}

// Until it is closed, for what is seen now.
TEST(LoopSearch, ForeseesMoreOfTheMotionForWhatWasDrawnLater) {
  Drifting drifting(4);
  const Pose2 drift = {{0.0, 0.5}, 0.0};
  ASSERT_FALSE(drifting.see(facade_with_wing(), 0.0, 2.0, along_facade));
  EXPECT_EQ(drifting.foreseen_motion_of(1.0).translation_m, Eigen::Vector2d::Zero());
  ASSERT_FALSE(drifting.see(facade_with_wing(), 40.0, 40.15, along_facade, drift));
  EXPECT_NEAR(drifting.foreseen_motion_of(0.0).translation_m.norm(), 0.0, 1e-12);
  double before_m = 0.0;
  for (double t_s = 5.0; t_s <= 40.0; t_s += 5.0) {
    const double moved_m = -drifting.foreseen_motion_of(t_s).translation_m.y();
    EXPECT_GT(moved_m, before_m);
    EXPECT_NEAR(moved_m, 0.5 * t_s / 40.0, 0.06);
    before_m = moved_m;
  }
  ASSERT_TRUE(drifting.see(facade_with_wing(), 40.16, 42.0, along_facade, drift));
  EXPECT_EQ(drifting.foreseen_motion_of(40.0).translation_m, Eigen::Vector2d::Zero());
  EXPECT_NEAR(drifting.drawn_s(), 0.5, 0.5);
}

}  // namespace
}  // namespace situation_awareness::loop_search_test
