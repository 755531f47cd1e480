// SPDX-License-Identifier: BSD-3-Clause
// The error-state filter on SE(2): a small localisation problem with odometry, and range and bearing to landmarks at
// known positions.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "support/consistency.hpp"
#include "support/covariance.hpp"
#include "support/manifold_jacobian.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::planar_localisation_test {
namespace {

using Matrix23d = Eigen::Matrix<double, 2, 3>;

// f(x) = x u, u the odometry: the motion between two poses, in the frame of the first. Its noise is an error of the
// second pose, so that Q is its covariance, and F = Ad(u^-1) does not depend on the state.
Pose2 moved(const Pose2& T_world_robot, const Pose2& odometry) { return T_world_robot * odometry; }
Eigen::Matrix3d move_jacobian(const Pose2& odometry) { return adjoint_se2(inverse(odometry)); }

// h(x): range and bearing of a landmark.
Eigen::Vector2d observe(const Pose2& T_world_robot, const Eigen::Vector2d& landmark_world_m) {
  const Eigen::Vector2d p_robot = inverse(T_world_robot) * landmark_world_m;
  return {p_robot.norm(), std::atan2(p_robot.y(), p_robot.x())};
}

Matrix23d observe_jacobian(const Pose2& T_world_robot, const Eigen::Vector2d& landmark_world_m) {
  const Eigen::Vector2d p = inverse(T_world_robot) * landmark_world_m;
  const double range_m = p.norm();
  Eigen::Matrix2d J_z_p;
  J_z_p << p.transpose() / range_m, -p.y() / (range_m * range_m), p.x() / (range_m * range_m);
  Matrix23d J_p_e;  // exp(-e) p = p - rho - theta (-p_y, p_x) to first order
  J_p_e << -1.0, 0.0, p.y(), 0.0, -1.0, -p.x();
  return J_z_p * J_p_e;
}

Pose2 random_pose(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-kPi, kPi)};
}

/// A run whose truth, odometry and observations are drawn from the filter's own models.
struct LocalisationRun {
  explicit LocalisationRun(std::uint64_t seed, const Pose2& T_world_room = {}) : random(seed) {
    for (Eigen::Vector2d& landmark : landmarks_world_m) landmark = T_world_room * landmark;
    center_world_m = T_world_room * center_world_m;
    estimate.x = T_world_room * Pose2{{3.0, 0.0}, 0.3};
    estimate.P = Eigen::Vector3d(0.1, 0.1, 0.05).cwiseAbs2().asDiagonal();
    truth = Manifold<Pose2>::retract(estimate.x, draw(estimate.P, random));
    Q = Eigen::Vector3d(0.005, 0.003, 0.005).cwiseAbs2().asDiagonal();
    R = Eigen::Vector2d(0.03, 0.01).cwiseAbs2().asDiagonal();
  }

  /// In arcs, and back towards the middle of the room when far from it.
  void move() {
    time_s += 0.1;
    const Eigen::Vector2d way_back_m = inverse(truth) * center_world_m;
    const double back_rad = std::atan2(way_back_m.y(), way_back_m.x());
    const double yaw_rate_rad_s =
        way_back_m.norm() > 3.0 ? std::clamp(back_rad, -0.5, 0.5) : 0.2 + 0.3 * std::sin(0.3 * time_s);
    const Pose2 odometry = exp_se2(0.1 * Eigen::Vector3d(0.8, 0.0, yaw_rate_rad_s));
    truth = moved(truth, odometry) * exp_se2(draw(Q, random));
    predict(estimate, moved(estimate.x, odometry), move_jacobian(odometry), Q);
  }

  /// Each landmark in reach, those outside of `gate` left out; `outlier_share` of them are outliers.
  void look(double gate = 1e9, double outlier_share = 0.0) {
    nis = {};
    for (const Eigen::Vector2d& landmark_world_m : landmarks_world_m) {
      Eigen::Vector2d z = observe(truth, landmark_world_m);
      if (z(0) > 7.0) continue;
      z += draw(R, random);
      const bool outlier = outlier_share > 0.0 && random.uniform() < outlier_share;
      if (outlier) z(0) -= 1.0;
      const Matrix23d H = observe_jacobian(estimate.x, landmark_world_m);
      Eigen::Vector2d nu = z - observe(estimate.x, landmark_world_m);
      nu(1) = wrap_to_pi(nu(1));
      const Innovation<2> compared = innovation(estimate, nu, H, R);
      const bool inside = inside_gate(compared, gate);
      (outlier ? outliers : inliers) += 1;
      if (outlier) outliers_let_in += inside ? 1 : 0;
      if (!outlier) inliers_let_in += inside ? 1 : 0;
      if (!inside) continue;
      nis.add(compared.mahalanobis2, 2);
      update(estimate, compared, H, R);
    }
  }

  Random random;
  std::vector<Eigen::Vector2d> landmarks_world_m = {{0.0, 0.0}, {8.0, 1.0}, {7.0, 7.0}, {-1.0, 5.0}};
  Eigen::Vector2d center_world_m = {3.5, 3.0};
  Pose2 truth;
  Estimate<Pose2> estimate;
  Eigen::Matrix3d Q;
  Eigen::Matrix2d R;
  ChiSquareSum nis;  ///< of the last look
  double time_s = 0.0;
  int inliers = 0, inliers_let_in = 0, outliers = 0, outliers_let_in = 0;
};

TEST(PlanarLocalisation, JacobiansEqualNumericalOnes) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Pose2 T = random_pose(random);
    const Pose2 odometry = random_pose(random);
    const auto F = manifold_jacobian<Pose2>([&](const Pose2& at) { return moved(at, odometry); }, T);
    EXPECT_LT((F - move_jacobian(odometry)).cwiseAbs().maxCoeff(), 1e-8);

    const Eigen::Vector2d landmark = T * Eigen::Vector2d(random.uniform(0.5, 5.0), random.uniform(-5.0, 5.0));
    const auto H = manifold_jacobian<Eigen::Vector2d>([&](const Pose2& at) { return observe(at, landmark); }, T);
    EXPECT_LT((H - observe_jacobian(T, landmark)).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(PlanarLocalisationStatistics, NeesAndNisOfSeededRunsAreInsideTheirBands) {
  for (const int steps : {1, 20, 200}) {
    ChiSquareSum nees_sum;
    ChiSquareSum nis_sum;
    for (int k = 0; k < 200; ++k) {
      LocalisationRun run(static_cast<std::uint64_t>(1000 * steps + k));
      for (int i = 0; i < steps; ++i) {
        run.move();
        run.look();
      }
      nees_sum.add(nees(run.estimate, run.truth), 3);
      nis_sum.add(run.nis.sum, run.nis.degrees_of_freedom);
    }
    EXPECT_TRUE(nees_sum.is_consistent()) << "NEES, " << steps << " steps";
    EXPECT_TRUE(nis_sum.is_consistent()) << "NIS, " << steps << " steps";
    EXPECT_GT(nis_sum.degrees_of_freedom, 400) << steps << " steps";
  }
}

// Without landmarks the covariance grows and stays consistent, although the positions scatter along an arc.
TEST(PlanarLocalisation, DeadReckoningStaysConsistent) {
  ChiSquareSum nees_sum;
  double yaw_sigma_rad = 0.0;
  for (int k = 0; k < 200; ++k) {
    LocalisationRun run(static_cast<std::uint64_t>(k));
    for (int i = 0; i < 1000; ++i) run.move();
    nees_sum.add(nees(run.estimate, run.truth), 3);
    yaw_sigma_rad = std::sqrt(run.estimate.P(2, 2));
  }
  EXPECT_TRUE(nees_sum.is_consistent());
  EXPECT_GT(yaw_sigma_rad, 0.15);  // required for a meaningful test
}

// Left-invariance: the world may be moved, and neither covariance nor innovations change.
TEST(PlanarLocalisation, RigidMotionOfTheWorldMovesTheStateAndLeavesItsCovariance) {
  Random random(2);
  for (std::uint64_t k = 0; k < 10; ++k) {
    const Pose2 motion = random_pose(random);
    LocalisationRun here(k);
    LocalisationRun there(k, motion);
    for (int i = 0; i < 100; ++i) {
      here.move();
      there.move();
      here.look();
      there.look();
      EXPECT_NEAR(here.nis.sum, there.nis.sum, 1e-7);
    }
    EXPECT_LT(Manifold<Pose2>::local_coordinates(motion * here.estimate.x, there.estimate.x).norm(), 1e-9);
    EXPECT_LT((here.estimate.P - there.estimate.P).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// One of five ranges is an outlier, short by a metre.
TEST(PlanarLocalisation, TheGateKeepsOutliersOut) {
  const double gate = chi_square_quantile(0.999, 2);
  ChiSquareSum gated;
  ChiSquareSum ungated;
  int inliers = 0, inliers_let_in = 0, outliers = 0, outliers_let_in = 0;
  for (int k = 0; k < 100; ++k) {
    LocalisationRun run(static_cast<std::uint64_t>(k));
    LocalisationRun careless(static_cast<std::uint64_t>(k));
    for (int i = 0; i < 100; ++i) {
      run.move();
      run.look(gate, i < 10 ? 0.0 : 0.2);  // once it has converged
      careless.move();
      careless.look(1e9, i < 10 ? 0.0 : 0.2);
    }
    gated.add(nees(run.estimate, run.truth), 3);
    ungated.add(nees(careless.estimate, careless.truth), 3);
    inliers += run.inliers;
    inliers_let_in += run.inliers_let_in;
    outliers += run.outliers;
    outliers_let_in += run.outliers_let_in;
  }
  EXPECT_GT(outliers, 1000);
  EXPECT_EQ(outliers_let_in, 0);
  EXPECT_GT(inliers_let_in, 0.998 * inliers);
  EXPECT_TRUE(gated.is_consistent());
  EXPECT_GT(ungated.sum, 10.0 * gated.sum);
}

TEST(PlanarLocalisationStatistics, CovarianceStaysSymmetricPositiveDefiniteOverAHundredThousandSteps) {
  LocalisationRun run(42);
  double least = 1e9;
  for (int i = 0; i < 100000; ++i) {
    run.move();
    run.look();
    const Eigen::Matrix3d& P = run.estimate.P;
    ASSERT_EQ(P, P.transpose()) << "step " << i;
    least = std::min(least, smallest_eigenvalue(P));
  }
  EXPECT_GT(least, 0.0);
  EXPECT_LT(nees(run.estimate, run.truth), chi_square_quantile(0.9999, 3));
}

}  // namespace
}  // namespace situation_awareness::planar_localisation_test
