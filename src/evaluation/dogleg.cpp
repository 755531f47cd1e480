// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/dogleg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Geometry>
#include <Eigen/QR>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"

#include "fit_each.hpp"

namespace situation_awareness {
namespace {

// x            (t_x, t_y, psi, rx, ry) in the frame of the fit                             5
// f, J         residuals and their Jacobian                                                n, n x 5
// R            triangle of the QR decomposition of [J f]: |J s + f| = |R (s, 1)|           6 x 6
// g            gradient of the cost, J^T f                                                 5
// lower, upper bounds of x                                                                 5
// delta        half the side of the trust region, a cube around x

using Vector5i = Eigen::Matrix<int, 5, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Of the bounded variables: on its lower bound, free, on its upper bound.
constexpr int kLower = -1;
constexpr int kFree = 0;
constexpr int kUpper = +1;

/// The residuals of all points, and their linear model reduced to its triangular factor, whose size does not depend on
/// the number of points.
class Residuals {
 public:
  explicit Residuals(const std::vector<Eigen::Vector2d>& points_m)
      : points_m_(points_m), J_f_(std::max<Eigen::Index>(static_cast<Eigen::Index>(points_m.size()), 6), 6) {}

  /// Half the sum of squares at `x`.
  double cost(const Vector5d& x) const {
    const Frame frame(x);
    double sum = 0.0;
    for (const Eigen::Vector2d& point_m : points_m_) {
      const double f = frame.scaled(point_m).squaredNorm() - 1.0;
      sum += f * f;
    }
    return 0.5 * sum;
  }

  Matrix6d linearise(const Vector5d& x) {
    const Frame frame(x);
    J_f_.setZero();
    for (std::size_t i = 0; i < points_m_.size(); ++i) {
      const Eigen::Vector2d d = points_m_[i] - frame.t;
      const Eigen::Vector2d e = frame.scaled(points_m_[i]);
      const Eigen::Vector2d e_by_r(e.x() / frame.rx, e.y() / frame.ry);
      auto row = J_f_.row(static_cast<Eigen::Index>(i));
      row(0) = 2.0 * (-frame.c * e_by_r.x() + frame.s * e_by_r.y());
      row(1) = 2.0 * (-frame.s * e_by_r.x() - frame.c * e_by_r.y());
      row(2) =
          2.0 * (e_by_r.x() * (-frame.s * d.x() + frame.c * d.y()) - e_by_r.y() * (frame.c * d.x() + frame.s * d.y()));
      row(3) = -2.0 * e.x() * e_by_r.x();
      row(4) = -2.0 * e.y() * e_by_r.y();
      row(5) = e.squaredNorm() - 1.0;
    }
    const Eigen::HouseholderQR<Eigen::Ref<Rows>> qr(J_f_);
    return J_f_.topRows<6>().triangularView<Eigen::Upper>();
  }

 private:
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 6>;

  /// The frame along the ellipse's axes, in units of its radii: the curve is the unit circle there.
  struct Frame {
    explicit Frame(const Vector5d& x) : t(x.head<2>()), c(std::cos(x(2))), s(std::sin(x(2))), rx(x(3)), ry(x(4)) {}

    Eigen::Vector2d scaled(const Eigen::Vector2d& point_m) const {
      const Eigen::Vector2d d = point_m - t;
      return {(c * d.x() + s * d.y()) / rx, (-s * d.x() + c * d.y()) / ry};
    }

    Eigen::Vector2d t;
    double c;
    double s;
    double rx;
    double ry;
  };

  const std::vector<Eigen::Vector2d>& points_m_;
  Rows J_f_;
};

struct Limits {
  Vector5d lower;
  Vector5d upper;

  bool contains(const Vector5d& x) const { return (x.array() >= lower.array() && x.array() <= upper.array()).all(); }
};

/// Distance from a point of the box along `direction` to its border, and the sides of the border there.
struct Way {
  double length = std::numeric_limits<double>::infinity();
  Vector5i stopped = Vector5i::Constant(kFree);
};

Way distance_to_bound(const Vector5d& from, const Vector5d& direction, const Limits& box) {
  Vector5d lengths = Vector5d::Constant(std::numeric_limits<double>::infinity());
  for (int k = 0; k < 5; ++k) {
    if (direction(k) == 0.0) continue;
    lengths(k) = ((direction(k) < 0.0 ? box.lower : box.upper)(k)-from(k)) / direction(k);
  }
  Way way;
  way.length = lengths.minCoeff();
  for (int k = 0; k < 5; ++k) {
    if (direction(k) != 0.0 && lengths(k) == way.length) way.stopped(k) = direction(k) < 0.0 ? kLower : kUpper;
  }
  return way;
}

struct Step {
  Vector5d s = Vector5d::Zero();
  Vector5i on_bound = Vector5i::Constant(kFree);  ///< bounds of x that the step ends on
  bool on_trust_region = false;
};

/// Along the path from the best point down the gradient to the Gauss-Newton point, as far as the trust region and the
/// bounds of x allow.
Step dogleg_step(const Vector5d& x, const Vector5d& newton, const Vector5d& g, const Matrix6d& R, double delta,
                 const Limits& bounds) {
  const Limits to_bounds{bounds.lower - x, bounds.upper - x};
  const Limits box{to_bounds.lower.cwiseMax(-delta), to_bounds.upper.cwiseMin(delta)};
  Step step;
  if (box.contains(newton)) {
    step.s = newton;
    return step;
  }
  const double slope = g.squaredNorm();
  const double curvature = (R.leftCols<5>() * g).squaredNorm();
  const double to_side = distance_to_bound(Vector5d::Zero(), -g, box).length;
  const Vector5d cauchy = -(slope < curvature * to_side ? slope / curvature : to_side) * g;
  const Vector5d onwards = newton - cauchy;
  const Way way = distance_to_bound(cauchy, onwards, box);
  step.s = cauchy + std::min(way.length, 1.0) * onwards;
  for (int k = 0; k < 5; ++k) {
    if (way.stopped(k) == kFree) continue;
    const double side = (way.stopped(k) == kLower ? box.lower : box.upper)(k);
    if (side == (way.stopped(k) == kLower ? to_bounds.lower : to_bounds.upper)(k)) step.on_bound(k) = way.stopped(k);
    if (std::abs(side) == delta) step.on_trust_region = true;
  }
  return step;
}

Vector5i bounds_met(const Vector5d& x, const Limits& bounds) {
  Vector5i on_bound;
  for (int k = 0; k < 5; ++k) on_bound(k) = x(k) == bounds.lower(k) ? kLower : x(k) == bounds.upper(k) ? kUpper : kFree;
  return on_bound;
}

/// Moves `x` to the minimum; returns the number of evaluations.
int minimise(Residuals& residuals, Vector5d& x, const Limits& bounds, const DoglegParams& params) {
  double cost = residuals.cost(x);
  int evaluations = 1;
  double delta = x.lpNorm<Eigen::Infinity>();
  if (delta == 0.0) delta = 1.0;
  Vector5i on_bound = bounds_met(x, bounds);
  bool converged = false;
  while (!converged && evaluations < params.max_evaluations) {
    Matrix6d R = residuals.linearise(x);
    Vector5d g = R.leftCols<5>().transpose() * R.col(5);
    // A variable at a bound with the gradient pointing outwards is fixed and leaves the model.
    const Eigen::Array<bool, 5, 1> active = on_bound.cast<double>().cwiseProduct(g).array() < 0.0;
    for (int k = 0; k < 5; ++k) {
      if (!active(k)) continue;
      g(k) = 0.0;
      R.col(k).setZero();
    }
    if (g.lpNorm<Eigen::Infinity>() < params.tolerance) break;
    Vector5d newton = R.leftCols<5>().completeOrthogonalDecomposition().solve(-R.col(5));
    newton = active.select(0.0, newton);

    double reduction = -1.0;
    while (!converged && !(reduction > 0.0) && evaluations < params.max_evaluations) {
      const Step step = dogleg_step(x, newton, g, R, delta, bounds);
      const double predicted = -0.5 * (R.leftCols<5>() * step.s).squaredNorm() - g.dot(step.s);
      const Vector5d candidate = (x + step.s).cwiseMax(bounds.lower).cwiseMin(bounds.upper);
      const double candidate_cost = residuals.cost(candidate);
      ++evaluations;
      reduction = cost - candidate_cost;

      const double ratio = predicted > 0.0 ? reduction / predicted : 0.0;
      if (ratio < 0.25) {
        delta = 0.25 * step.s.lpNorm<Eigen::Infinity>();
      } else if (ratio > 0.75 && step.on_trust_region) {
        delta *= 2.0;
      }
      converged = (reduction < params.tolerance * cost && ratio > 0.25) ||
                  step.s.norm() < params.tolerance * (params.tolerance + x.norm());
      if (!(reduction > 0.0)) continue;
      x = candidate;
      cost = candidate_cost;
      for (int k = 0; k < 5; ++k) {
        if (active(k)) continue;
        on_bound(k) = step.on_bound(k);
        if (on_bound(k) != kFree) x(k) = (on_bound(k) == kLower ? bounds.lower : bounds.upper)(k);
      }
    }
  }
  return evaluations;
}

}  // namespace

void DoglegParams::validate() const {
  check_bounds(*this, "dogleg");
  if (!(min_radius_m < max_radius_m)) {
    throw std::invalid_argument("dogleg.min_radius_m must be less than dogleg.max_radius_m");
  }
}

DoglegFit fit_dogleg(const std::vector<Eigen::Vector2d>& points_level_m, const DoglegParams& params) {
  Eigen::Vector2d mean_level_m = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point_m : points_level_m) mean_level_m += point_m;
  mean_level_m /= static_cast<double>(points_level_m.size());
  const Pose2 T_level_fit{Eigen::Vector2d::Zero(), std::atan2(mean_level_m.y(), mean_level_m.x())};
  const Eigen::Rotation2Dd R_fit_level(-T_level_fit.yaw_rad);
  std::vector<Eigen::Vector2d> points_m;
  points_m.reserve(points_level_m.size());
  Eigen::AlignedBox2d extent_m;
  for (const Eigen::Vector2d& point_m : points_level_m) {
    points_m.push_back(R_fit_level * point_m);
    extent_m.extend(points_m.back());
  }

  Limits bounds;
  bounds.lower << -params.max_range_m, -params.max_range_m, -kPi / 2.0, params.min_radius_m, params.min_radius_m;
  bounds.upper << params.max_range_m, params.max_range_m, kPi / 2.0, params.max_radius_m, params.max_radius_m;
  const Eigen::Vector2d half_m = 0.5 * extent_m.sizes();
  Vector5d x;
  x << mean_level_m.norm() + params.start_behind * half_m.y(), 0.0, 0.0, half_m;
  x = x.cwiseMax(bounds.lower).cwiseMin(bounds.upper);

  Residuals residuals(points_m);
  DoglegFit fit;
  fit.evaluations = minimise(residuals, x, bounds, params);
  fit.cost = residuals.cost(x);
  fit.ellipse_level = canonical(T_level_fit * Ellipse{x.head<2>(), x(2), x(3), x(4)});
  return fit;
}

DoglegDetector::DoglegDetector(const DoglegParams& params, const EllipseFitParams& fit_params)
    : params_(params), fit_params_(fit_params) {
  params_.validate();
  fit_params_.validate();
}

void DoglegDetector::find(const Segments& segments, Detections& found) {
  const auto fit = [&](const std::vector<Eigen::Vector2d>& points_level_m) {
    return fit_dogleg(points_level_m, params_).ellipse_level;
  };
  fit_each(segments, fit_params_, fit, points_level_m_, found);
}

}  // namespace situation_awareness
