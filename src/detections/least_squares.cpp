// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/least_squares.hpp"

#include "situation_awareness/detections/outline_errors.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "situation_awareness/detections/detect_each.hpp"
#include "situation_awareness/estimation/cholesky.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// x      (t_x, t_y, m, p, q), the smooth parameters               5
// C      shape matrix, C(m, p, q)                                 2x2
// M      C^-1                                                    2x2
// F      sqrt((y - t)^T M (y - t)) - 1, zero on the curve         1
// J, r   whitened Jacobian and residuals of all terms
// A, b   J^T J and J^T r

/// Shape matrix and its derivatives: rx, ry = m +- |(p, q)| give C = (m^2 + p^2 + q^2) I + 2 m [p q; q -p].
struct EllipseShape {
  Eigen::Matrix2d C;
  Eigen::Matrix2d dC_dm;
  Eigen::Matrix2d dC_dp;
  Eigen::Matrix2d dC_dq;
};

EllipseShape shape_of(const Vector5d& x) {
  const double m = x(2);
  const double p = x(3);
  const double q = x(4);
  Eigen::Matrix2d deviator;
  deviator << p, q, q, -p;
  Eigen::Matrix2d along_p;
  along_p << 1.0, 0.0, 0.0, -1.0;
  Eigen::Matrix2d along_q;
  along_q << 0.0, 1.0, 1.0, 0.0;
  const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
  return {(m * m + p * p + q * q) * I + 2.0 * m * deviator, 2.0 * m * I + 2.0 * deviator,
          2.0 * p * I + 2.0 * m * along_p, 2.0 * q * I + 2.0 * m * along_q};
}

/// Distance of one hit from the curve to first order, D = F / |grad F| (Sampson, 1982), positive outside.
class Curve {
 public:
  Curve(const Point& point, const Eigen::Vector2d& t, const Eigen::Matrix2d& M)
      : M_(M),
        w_(M * (point.p_level_m - t)),
        a_(std::max((point.p_level_m - t).dot(w_), 1e-12)),
        g_(std::sqrt(a_)),
        b_(w_.norm()) {}

  double distance() const { return (a_ - g_) / b_; }
  Eigen::Vector2d normal() const { return w_ / b_; }

  /// Derivative of the distance by t along one axis: d = y - t changes by its negative.
  double by_center(int axis) const { return derivative(-2.0 * w_(axis), -w_.dot(M_.col(axis))); }

  /// Derivative of the distance where C changes by `dC`.
  double by_shape(const Eigen::Matrix2d& dC) const {
    const Eigen::Vector2d v = dC * w_;
    return derivative(-w_.dot(v), -w_.dot(M_ * v));
  }

 private:
  /// Where a changes by `da`, and w by what has the product `w_dw` with it.
  double derivative(double da, double w_dw) const {
    const double dg = 0.5 * da / g_;
    const double db = w_dw / b_;
    return (da - dg) / b_ - (a_ - g_) / (b_ * b_) * db;
  }

  const Eigen::Matrix2d& M_;
  Eigen::Vector2d w_;  ///< M d
  double a_;           ///< d^T M d
  double g_;           ///< its root, F + 1
  double b_;           ///< |M d|
};

/// Distances of hits from the curve, along its normal.
double residual_rms_m(const Point* points, std::size_t count, const Vector5d& x) {
  const Eigen::Matrix2d M = shape_of(x).C.inverse();
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += std::pow(Curve(points[i], x.head<2>(), M).distance(), 2);
  return std::sqrt(sum / static_cast<double>(count));
}

/// The cost of a fit is about one per hit; above that by more than this it has not converged.
constexpr double kGoodCostMargin = 10.0;

/// The prior of an object.
struct Expectation {
  Eigen::Vector3d shape;          ///< m, p, q
  double silhouette_slack_beams;  ///< a tangent off the middle between hit and miss by up to this has no residual
};

/// The sensor model of one segment as a nonlinear least-squares problem.
class Problem {
 public:
  Problem(const Segments& segments, const Segment& segment, const EllipseFitParams& params,
          const Expectation& expectation)
      : points_(&segments.points[segment.first]),
        count_(segment.count),
        resolution_rad_(segments.resolution_rad),
        segment_(segment),
        params_(params),
        expectation_(expectation) {}

  /// The problem of a new object, with the general prior.
  Problem(const Segments& segments, const Segment& segment, const EllipseFitParams& params)
      : Problem(segments, segment, params, {{params.mean_radius_m, 0.0, 0.0}, 0.0}) {}

  /// Cost at `x`, and A and b, with the hits weighted as at `weights_at`.
  double evaluate(const Vector5d& x, const Vector5d& weights_at, Matrix5d* A, Vector5d* b) const {
    if (A != nullptr) {
      A->setZero();
      b->setZero();
    }
    double cost = 0.0;
    const auto add = [&](double residual, const Vector5d& jacobian) {
      cost += residual * residual;
      if (A == nullptr) return;
      A->noalias() += jacobian * jacobian.transpose();
      b->noalias() += jacobian * residual;
    };

    const EllipseShape shape = shape_of(x);
    const Eigen::Matrix2d M = shape.C.inverse();
    const bool weights_here = &weights_at == &x;
    const Eigen::Matrix2d M_weights = weights_here ? M : Eigen::Matrix2d(shape_of(weights_at).C.inverse());
    for (std::size_t i = 0; i < count_; ++i) {
      const Curve curve(points_[i], x.head<2>(), M);
      const Eigen::Vector2d normal =
          weights_here ? curve.normal() : Curve(points_[i], weights_at.head<2>(), M_weights).normal();
      const double sigma = hit_sigma(points_[i], normal);
      Vector5d jacobian = Vector5d::Zero();
      if (A != nullptr) {
        jacobian << curve.by_center(0), curve.by_center(1), curve.by_shape(shape.dC_dm), curve.by_shape(shape.dC_dp),
            curve.by_shape(shape.dC_dq);
        jacobian /= sigma;
      }
      add(curve.distance() / sigma, jacobian);
    }

    // The tangent from the sensor lies between the last hit and the first miss beside it.
    const auto add_silhouette = [&](const Point& end, double side) {
      const double azimuth_rad = end.azimuth_rad + side * 0.5 * resolution_rad_;
      const Eigen::Vector2d n(-std::sin(azimuth_rad), std::cos(azimuth_rad));
      const double half_width = std::sqrt(n.dot(shape.C * n));
      const double sigma = std::hypot(end.range_m * resolution_rad_ / std::sqrt(12.0), params_.shape_sigma_m) + 1e-6;
      Vector5d jacobian;
      jacobian.head<2>() = n;
      jacobian(2) = side * 0.5 * n.dot(shape.dC_dm * n) / half_width;
      jacobian(3) = side * 0.5 * n.dot(shape.dC_dp * n) / half_width;
      jacobian(4) = side * 0.5 * n.dot(shape.dC_dq * n) / half_width;
      const double off_m = n.dot(x.head<2>()) + side * half_width;
      const double slack_m = expectation_.silhouette_slack_beams * end.range_m * resolution_rad_;
      add(std::copysign(std::max(0.0, std::abs(off_m) - slack_m), off_m) / sigma, jacobian / sigma);
    };
    if (is_silhouette(segment_.right_end)) add_silhouette(points_[0], -1.0);
    if (is_silhouette(segment_.left_end)) add_silhouette(points_[count_ - 1], +1.0);

    const Eigen::Vector3d sigma(params_.mean_radius_sigma_m, params_.radius_difference_sigma_m,
                                params_.radius_difference_sigma_m);
    for (int k = 0; k < 3; ++k) {
      add((x(2 + k) - expectation_.shape(k)) / sigma(k), Vector5d::Unit(2 + k) / sigma(k));
    }
    return cost;
  }

  /// Cost of hits and silhouettes alone, that of outliers bounded (Huber, 1964).
  double robust_cost(const Vector5d& x) const {
    const EllipseShape shape = shape_of(x);
    const Eigen::Matrix2d M = shape.C.inverse();
    double cost = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Curve curve(points_[i], x.head<2>(), M);
      cost += huber(curve.distance() / std::hypot(hit_sigma(points_[i], curve.normal()), kRoughness_m));
    }
    const auto add_end = [&](const Point& end, double side, SegmentEnd kind, double hidden_rad) {
      if (!is_silhouette(kind)) return;
      const double azimuth_rad = end.azimuth_rad + side * 0.5 * resolution_rad_;
      const Eigen::Vector2d n(-std::sin(azimuth_rad), std::cos(azimuth_rad));
      const double off_m = n.dot(x.head<2>()) + side * std::sqrt(n.dot(shape.C * n));
      cost += huber(off_m / end_sigma_m(end, kind, hidden_rad, side * off_m > 0.0, resolution_rad_));
    };
    add_end(points_[0], -1.0, segment_.right_end, segment_.right_hidden_rad);
    add_end(points_[count_ - 1], +1.0, segment_.left_end, segment_.left_hidden_rad);
    return cost;
  }

  /// As wide as the segment, touching its middle from behind: a circle, or an ellipse inclined by `lean_rad` to the
  /// line of sight.
  Vector5d start(double half_difference_ratio, double lean_rad) const {
    const double width_m = (points_[count_ - 1].p_level_m - points_[0].p_level_m).norm();
    const double m = std::clamp(0.5 * width_m, 2.0 * params_.min_radius_m, params_.max_radius_m);
    const Point& middle = points_[count_ / 2];
    Vector5d x = Vector5d::Zero();
    x.head<2>() = middle.p_level_m * (1.0 + m / middle.range_m);
    x(2) = m;
    const double psi_rad = middle.azimuth_rad + lean_rad;
    x.tail<2>() = half_difference_ratio * m * Eigen::Vector2d(std::cos(2.0 * psi_rad), std::sin(2.0 * psi_rad));
    return x;
  }

 private:
  /// Standard deviation of a hit's distance from the curve: range noise along the beam, the spacing of the beams across
  /// it, and the object's own roughness.
  double hit_sigma(const Point& point, const Eigen::Vector2d& normal) const {
    const Eigen::Vector2d u = point.p_level_m / point.range_m;
    const Eigen::Vector2d across(-u.y(), u.x());
    const double along_sigma = normal.dot(u) * params_.range_sigma_m;
    const double across_sigma = normal.dot(across) * point.range_m * resolution_rad_ / std::sqrt(12.0);
    return std::hypot(along_sigma, across_sigma, params_.shape_sigma_m) + 1e-6;
  }

  const Point* points_;
  std::size_t count_;
  double resolution_rad_;
  Segment segment_;
  const EllipseFitParams& params_;
  Expectation expectation_;
};

/// Bound both radii from below.
void bound_radii(Vector5d& x, double min_radius_m) {
  x(2) = std::max(x(2), min_radius_m);
  const double half_difference = x.tail<2>().norm();
  const double most = x(2) - min_radius_m;
  if (half_difference > most) x.tail<2>() *= half_difference > 0.0 ? most / half_difference : 0.0;
}

/// Levenberg-Marquardt, damped on the diagonal.
Vector5d minimise(const Problem& problem, Vector5d x, const EllipseFitParams& params) {
  bound_radii(x, params.min_radius_m);
  double damping = 1e-3;
  for (int iteration = 0; iteration < params.max_iterations; ++iteration) {
    Matrix5d A;
    Vector5d b;
    const double cost = problem.evaluate(x, x, &A, &b);
    bool improved = false;
    double change = 0.0;
    for (int attempt = 0; attempt < 8 && !improved; ++attempt) {
      Matrix5d damped = A;
      damped.diagonal() *= 1.0 + damping;
      Vector5d candidate = x - damped.llt().solve(b);
      bound_radii(candidate, params.min_radius_m);
      improved = problem.evaluate(candidate, x, nullptr, nullptr) < cost;
      if (improved) {
        change = (candidate - x).norm();
        x = candidate;
        damping = std::max(damping * 0.2, 1e-9);
      } else {
        damping *= 10.0;
      }
    }
    if (!improved || change < 1e-6) break;
  }
  return x;
}

/// For a known object, a tangent within the middle half between hit and miss has no residual: its error is the same in
/// every scan while the view is constant, and would otherwise bias the average to the middle.
constexpr double kSilhouetteSlack_beams = 0.25;

/// Covariance by the Hessian of the problem at its solution.
Matrix5d laplace_covariance(const Problem& problem, const Vector5d& x) {
  Matrix5d A;
  Vector5d b;
  problem.evaluate(x, x, &A, &b);
  return inverse_of_positive_definite(A);
}

}  // namespace

void EllipseFitParams::validate() const {
  check_bounds(*this, "detections.fit");
  if (!(min_radius_m < max_radius_m)) {
    throw std::invalid_argument("detections.fit.max_radius_m must be greater than " + yaml_text(min_radius_m));
  }
}

Detection fit_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params) {
  const Segment& piece = segments.segments[segment];
  const Problem problem(segments, piece, params);
  // The circle nearly always converges to the least cost; where it ends in a local minimum, an inclined ellipse does.
  Vector5d best = minimise(problem, problem.start(0.0, 0.0), params);
  double best_cost = problem.evaluate(best, best, nullptr, nullptr);
  for (const double lean_rad : {kPi / 4.0, -kPi / 4.0}) {
    if (best_cost < static_cast<double>(piece.count) + kGoodCostMargin) break;
    const Vector5d x = minimise(problem, problem.start(0.5, lean_rad), params);
    const double cost = problem.evaluate(x, x, nullptr, nullptr);
    if (!(cost < best_cost)) continue;
    best = x;
    best_cost = cost;
  }
  Detection detection = make_detection(segments, segment, params, best);
  detection.covariance = laplace_covariance(problem, best);
  return detection;
}

Detection refit_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                        const Ellipse& known_level) {
  Vector5d x = smooth_parameters(canonical(known_level));
  bound_radii(x, params.min_radius_m);
  const Problem problem(segments, segments.segments[segment], params, {x.tail<3>(), kSilhouetteSlack_beams});
  Matrix5d A;
  Vector5d b;
  problem.evaluate(x, x, &A, &b);
  const Eigen::LLT<Matrix5d> llt(A);
  Detection detection = make_detection(segments, segment, params, x - llt.solve(b));
  detection.covariance = llt.solve(Matrix5d::Identity());
  return detection;
}

Detection make_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const Vector5d& smooth_level) {
  const Segment& piece = segments.segments[segment];
  Vector5d x = smooth_level;
  bound_radii(x, params.min_radius_m);
  Detection detection = unassessed_detection(segments, segment, params, smooth_level);
  detection.residual_rms_m = residual_rms_m(&segments.points[piece.first], piece.count, x);
  return detection;
}

Detection unassessed_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                               const Vector5d& smooth_level) {
  const Segment& piece = segments.segments[segment];
  Vector5d x = smooth_level;
  bound_radii(x, params.min_radius_m);
  Detection detection;
  detection.ellipse_level = ellipse_from_smooth_parameters(x);
  detection.beams = static_cast<int>(piece.count);
  detection.middle_level_m = middle_level_m(segments, piece);
  detection.hidden_end = !is_silhouette(piece.right_end) || !is_silhouette(piece.left_end);
  detection.segment = segment;
  detection.time_offset_s = middle_s(segments, piece);
  return detection;
}

Detection assess_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const Ellipse& ellipse_level) {
  Vector5d x = smooth_parameters(canonical(ellipse_level));
  bound_radii(x, params.min_radius_m);
  const Problem problem(segments, segments.segments[segment], params);
  Detection detection = make_detection(segments, segment, params, x);
  detection.covariance = laplace_covariance(problem, x);
  return detection;
}

double ellipse_cost(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                    const Ellipse& ellipse_level) {
  return Problem(segments, segments.segments[segment], params).robust_cost(smooth_parameters(canonical(ellipse_level)));
}

const char* detection_defect(const Detection& detection, const EllipseFitParams& params) {
  const char* const defect = detection_defect(detection);
  if (*defect != '\0') return defect;
  if (detection.ellipse_level.rx_m > params.max_radius_m) return detection_refusal::kTooLarge;
  const bool is_box = detection.shape == Shape::kBox;  // the covariance of a box has its residual
  if (!is_box && detection.residual_rms_m > params.max_residual_m) return detection_refusal::kOffEllipse;
  if (contains(detection.ellipse_level, Eigen::Vector2d::Zero())) return detection_refusal::kAroundSensor;
  return "";
}

LeastSquaresDetector::LeastSquaresDetector(const EllipseFitParams& params) : params_(params) { params_.validate(); }

void LeastSquaresDetector::find(const Segments& segments, Detections& found) {
  detect_each(
      segments, params_, [&](std::size_t i) { return fit_ellipse(segments, i, params_); }, found);
}

}  // namespace situation_awareness
