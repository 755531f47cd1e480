// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "reflector_survey_solution.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/pose/reflector_search.hpp"

// The adjustment of all poses and reflectors at the end.
namespace situation_awareness {
namespace {

/// Floor of the errors of odometry between keys, in m and rad: with none the adjustment is singular.
constexpr double kLeastOdometryError = 1e-5;
/// Sightings farther away than this many standard deviations count less (Huber, 1964).
constexpr double kHuber = 3.0;
constexpr int kMaxAdjustments = 30;
constexpr double kAdjusted = 1e-7;

/// Where the error of a pose begins; -1 of the first, which is given.
Eigen::Index pose_column(std::size_t key) { return key == 0 ? -1 : 3 * static_cast<Eigen::Index>(key - 1); }

}  // namespace

Eigen::Vector2d residual_of(const Eigen::Vector2d& z, const Pose2& T_world_base, const Pose2& T_base_lidar,
                            const Eigen::Vector2d& center_world_m) {
  Eigen::Vector2d nu = z - observed_reflector(T_world_base, T_base_lidar, center_world_m);
  nu(1) = wrap_to_pi(nu(1));
  return nu;
}

Eigen::Matrix2d place_by_center_jacobian(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                         const Eigen::Vector2d& center_world_m) {
  const Pose2 T_world_lidar = T_world_base * T_base_lidar;
  const Eigen::Vector2d p_lidar = place_of(T_world_lidar, center_world_m);
  const double range2_m2 = p_lidar.squaredNorm();
  Eigen::Matrix2d J_z_p;
  J_z_p << p_lidar.transpose() / std::sqrt(range2_m2), -p_lidar.y() / range2_m2, p_lidar.x() / range2_m2;
  return J_z_p * T_world_lidar.rotation().transpose();
}

/// A e = b for the error e of all poses but the first, of the scales and of the reflectors that are used.
struct ReflectorSurvey::NormalEquations {
  Eigen::Index size, scales;         ///< of e; where the scales begin in it
  std::vector<Eigen::Index> column;  ///< of found_: where they begin; -1: not used
  std::vector<Eigen::Triplet<double>> A;
  Eigen::VectorXd b;

  void clear() {
    A.clear();
    b.setZero(size);
  }

  /// Adds a residual r - J e with blocks of J at columns.
  void add(const Eigen::VectorXd& r, const Eigen::MatrixXd& information,
           const std::vector<std::pair<Eigen::Index, Eigen::MatrixXd>>& blocks) {
    for (const auto& [row, J_row] : blocks) {
      if (row < 0) continue;
      b.segment(row, J_row.cols()) += J_row.transpose() * information * r;
      for (const auto& [col, J_col] : blocks) {
        if (col < 0) continue;
        const Eigen::MatrixXd block = J_row.transpose() * information * J_col;
        for (Eigen::Index m = 0; m < block.rows(); ++m) {
          for (Eigen::Index n = 0; n < block.cols(); ++n) A.emplace_back(row + m, col + n, block(m, n));
        }
      }
    }
  }
};

// The odometry before a key.
void ReflectorSurvey::add_way(std::size_t i, Solution& solution, NormalEquations& equations) const {
  const Key& key = keys_[i];
  const ReflectorState before{solution.T_world_base[i - 1], solution.scale_error};
  const ReflectorState predicted = moved_by_odometry(before, key.u, key.u.yaw_rad);
  const Eigen::Vector3d r = Manifold<Pose2>::local_coordinates(predicted.T_world_base, solution.T_world_base[i]);
  const Eigen::Matrix<double, 3, 6> F = moved_by_odometry_jacobian(before, key.u, key.u.yaw_rad).topRows<3>();
  Eigen::Vector3d variance = odometry_noise(key.u, params_.wheels).diagonal().head<3>();
  const Eigen::Vector3d jump(params_.wheels.jump_sigma_m, params_.wheels.jump_sigma_m, params_.wheels.jump_sigma_rad);
  variance += key.jumps * jump.cwiseAbs2();
  variance = variance.cwiseMax(kLeastOdometryError * kLeastOdometryError);
  const Eigen::Matrix3d information = variance.cwiseInverse().asDiagonal();
  solution.odometry_nis += r.dot(information * r) / (3.0 * static_cast<double>(keys_.size() - 1));
  const Eigen::Index pose = pose_column(i), pose_before = pose_column(i - 1);
  equations.add(
      r, information,
      {{pose, -Eigen::Matrix3d::Identity()}, {pose_before, F.leftCols<3>()}, {equations.scales, F.middleCols<2>(3)}});
}

void ReflectorSurvey::add_sightings(std::size_t i, Solution& solution, NormalEquations& equations) const {
  for (const Sighting& sighting : keys_[i].sightings) {
    const std::size_t j = solution.same_as[sighting.reflector];
    if (equations.column[j] < 0) continue;
    const Pose2& T = solution.T_world_base[i];
    const Eigen::Vector2d nu = residual_of(sighting.z, T, sighting.T_base_lidar, solution.centers_m[j]);
    Eigen::Matrix2d information = sighting.R.inverse();
    const double nis = nu.dot(information * nu);
    solution.nis[j] += nis;
    ++solution.sightings[j];
    const double sigmas = std::sqrt(nis);
    if (sigmas > kHuber) information *= kHuber / sigmas;
    equations.add(nu, information,
                  {{pose_column(i), observed_reflector_jacobian(T, sighting.T_base_lidar, solution.centers_m[j])},
                   {equations.column[j], place_by_center_jacobian(T, sighting.T_base_lidar, solution.centers_m[j])}});
  }
}

// About a solution, whose sums over the residuals are found with them.
void ReflectorSurvey::linearise(Solution& solution, NormalEquations& equations) const {
  equations.clear();
  const Eigen::Vector2d scale_sigma(params_.wheels.distance_scale_sigma, params_.wheels.yaw_scale_sigma);
  const Eigen::Vector2d floored = scale_sigma.cwiseMax(kLeastOdometryError);
  equations.add(-solution.scale_error, floored.cwiseAbs2().cwiseInverse().asDiagonal().toDenseMatrix(),
                {{equations.scales, Eigen::Matrix2d::Identity()}});
  std::fill(solution.sightings.begin(), solution.sightings.end(), 0);
  std::fill(solution.nis.begin(), solution.nis.end(), 0.0);
  solution.odometry_nis = 0.0;
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    if (i > 0) add_way(i, solution, equations);
    add_sightings(i, solution, equations);
  }
  for (const std::size_t j : solution.used) {
    solution.nis[j] /= std::max(1, 2 * solution.sightings[j]);
    // A reflector of which no sighting is left must not make it singular.
    const Eigen::Index at = equations.column[j];
    for (Eigen::Index m = 0; m < 2; ++m) equations.A.emplace_back(at + m, at + m, 1e-9);
  }
}

// Least squares over all poses, scales and reflectors, by Gauss-Newton steps: the matrix is sparse, since a key sees
// few reflectors and is tied to its neighbours alone.
ReflectorSurvey::Solution ReflectorSurvey::adjust(const Solution& from) const {
  Solution solution = from;
  solution.used.clear();
  NormalEquations equations;
  equations.column.assign(found_.size(), -1);
  equations.scales = pose_column(keys_.size());
  equations.size = equations.scales + 2;
  for (std::size_t j = 0; j < found_.size(); ++j) {
    if (solution.same_as[j] != j || solution.refused[j] != nullptr) continue;
    equations.column[j] = equations.size;
    equations.size += 2;
    solution.used.push_back(j);
  }
  const Eigen::Index size = equations.size, scales = equations.scales;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor;
  for (int step = 0; step < kMaxAdjustments; ++step) {
    linearise(solution, equations);
    Eigen::SparseMatrix<double> A(size, size);
    A.setFromTriplets(equations.A.begin(), equations.A.end());
    factor.compute(A);
    if (factor.info() != Eigen::Success) break;
    const Eigen::VectorXd e = factor.solve(equations.b);
    for (std::size_t i = 1; i < keys_.size(); ++i) {
      const Eigen::Vector3d of_pose = e.segment<3>(pose_column(i));
      solution.T_world_base[i] = Manifold<Pose2>::retract(solution.T_world_base[i], of_pose);
    }
    solution.scale_error += e.segment<2>(scales);
    for (const std::size_t j : solution.used) solution.centers_m[j] += e.segment<2>(equations.column[j]);
    if (e.cwiseAbs().maxCoeff() < kAdjusted) break;
  }
  const Eigen::Index n = size - scales - 2;
  solution.covariance = Eigen::MatrixXd::Zero(n, n);
  if (factor.info() == Eigen::Success) {
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(size, scales + 2 + k);
      solution.covariance.col(k) = factor.solve(unit).tail(n);
    }
  } else {
    solution.covariance.diagonal().setConstant(std::numeric_limits<double>::infinity());
  }
  return solution;
}

// The same reflector may have been begun twice, where the pose was not known well enough.
void ReflectorSurvey::merge(Solution& solution) const {
  for (std::size_t a = 0; a < solution.used.size(); ++a) {
    for (std::size_t b = a + 1; b < solution.used.size(); ++b) {
      const std::size_t j = solution.used[a], k = solution.used[b];
      if (solution.same_as[j] != j || solution.same_as[k] != k) continue;
      const Eigen::Vector2d off_m = solution.centers_m[j] - solution.centers_m[k];
      if (off_m.norm() > params_.radius_m + params_.min_separation_m) continue;
      const auto block = [&](std::size_t row, std::size_t col) -> Eigen::Matrix2d {
        return solution.covariance.block<2, 2>(2 * static_cast<Eigen::Index>(row), 2 * static_cast<Eigen::Index>(col));
      };
      const Eigen::Matrix2d S =
          block(a, a) + block(b, b) - block(a, b) - block(b, a) + 1e-6 * Eigen::Matrix2d::Identity();
      if (off_m.dot(S.llt().solve(off_m)) > far_gate_) continue;
      for (std::size_t& same : solution.same_as) {
        if (same == k) same = j;
      }
    }
  }
}

}  // namespace situation_awareness
