// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/object_shapes.hpp"

#include <cmath>

#include <Eigen/Eigenvalues>

namespace situation_awareness {
namespace {

constexpr double kChiSquare95 = 5.991464547107979;  ///< 95 % quantile, two degrees of freedom

}  // namespace

bool moves(const Object& object) {
  using namespace object_error;
  const Eigen::Matrix2d covariance = object.covariance.block<2, 2>(kVelocity, kVelocity);
  const double variance = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues().maxCoeff();
  const double speed_m_s = object.velocity_world_m_s.norm();
  return speed_m_s > kMinDrawnSpeed_m_s && speed_m_s * speed_m_s > kChiSquare95 * variance;
}

Ellipse position_uncertainty(const Object& object) {
  using namespace object_error;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(object.covariance.block<2, 2>(kPosition, kPosition));
  const Eigen::Vector2d radii_m = (kChiSquare95 * solver.eigenvalues().cwiseMax(0.0)).cwiseSqrt();
  const Eigen::Vector2d major = solver.eigenvectors().col(1);  // eigenvalues grow
  return {object.ellipse_world.center_m, std::atan2(major.y(), major.x()), radii_m.y(), radii_m.x()};
}

std::string class_text(const Object& object) {
  if (object.object_class == ObjectClass::kUnknown) return "";
  return std::string(" ") + name_of(object.object_class) + ' ' + std::to_string(std::lround(100.0 * object.p_class)) +
         " %";
}

}  // namespace situation_awareness
