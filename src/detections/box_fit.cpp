// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/box_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "situation_awareness/detections/outline_errors.hpp"
#include "situation_awareness/estimation/cholesky.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// x        (t_x, t_y, psi, a, b): centre, orientation, half lengths along e1 and e2      5
// e1, e2   axes of the box
// A, b     J^T J and J^T r of the whitened residuals

constexpr double kMinHalf_m = 0.02;
/// For a known box: so wide that what was not seen does not count.
constexpr double kKnownSigma_m = 3.0;
constexpr double kKnownSigma_rad = 1.0;
/// m. Hits that spread less along an axis of the box do not show that side.
constexpr double kMinSpread_m = 0.1;
/// Standard deviations that a hit may be beyond the end of its face: farther out the face is longer.
constexpr double kBeyond = 2.0;
/// m. A half length that is longer is of none of the things that the prior is of.
constexpr double kLargeHalf_m = box_prior::kMeanHalf_m + 2.0 * box_prior::kHalfSigma_m;
/// Standard deviations of what was not seen of a larger thing, and of its centre, in parts of the half that was.
constexpr double kLargeSigma = 0.9, kLargeCenterSigma = 2.0;
// What edges of real things are early: the last hit on a rounded corner is before the corner of the box, and beams at
// an edge are lost. On the recordings of a car its edges are 13 mm early where a face is seen square on, 31 mm at a
// corner, with beams 11 mm apart (docs/math/boxes.md).

/// Radius of a corner, in parts of the smaller half length: uniform up to twice as much. With 0 and 0.4 the sides of
/// the car are 10 mm shorter and 6 mm longer.
constexpr double kRoundness = 0.25;
/// m. The most of that: the sides of larger things are as straight as those of a sharp box (car_tracks_test: up to
/// 0.1).
constexpr double kMostRadius_m = 0.05;
/// Beams that are lost at an edge in a scan whose surfaces lose returns. With 0 the sides of the car are 15 mm shorter.
constexpr double kLostBeams = 1.0;
/// Standard deviation of what the edges of one thing are early, in parts of what is expected: that of the uniform
/// radius.
constexpr double kEarlySigma = 0.58;
/// Scans in which that is the same, about a second of a view. With 1 and 60 the sides of the car differ by up to 30 mm.
constexpr double kRepeatedScans = 20.0;
constexpr double kCoarseStep_rad = kPi / 36.0;
constexpr int kRefitSteps = 4;
/// Of the prediction, to find which side is seen.
constexpr double kTurnSigma_rad = 0.5;
constexpr double kSideSigma_m = 0.03;
/// A known box that turned by more is linearised where it was found.
constexpr double kMaxTurn_rad = 0.35;
/// m^2. The orientation of a square has no effect on (p, q).
constexpr double kLeastVariance_m2 = 1e-6;

struct Prior {
  Vector5d mean;
  Vector5d sigma;
};

class BoxProblem {
 public:
  /// `repeats`: for how many scans what is not known of the edges stays the same; 0: edges are taken for exact.
  BoxProblem(const Segments& segments, const Segment& segment, const EllipseFitParams& params, double repeats = 0.0)
      : points_(&segments.points[segment.first]),
        count_(segment.count),
        resolution_rad_(segments.resolution_rad),
        segment_(segment),
        early_variance_(repeats * kEarlySigma * kEarlySigma),
        params_(params) {}

  /// Cost at `x`, and A, of which the upper triangle is not complete, and b. Robust: outlying hits have less weight.
  double evaluate(const Vector5d& x, const Prior* prior, Matrix5d* A, Vector5d* b) const {
    if (A != nullptr) {
      A->setZero();
      b->setZero();
    }
    double cost = 0.0;
    // The derivative by one half length is zero. Of A the lower triangle is used.
    const auto add_hit = [&](double residual, const std::array<double, 4>& j, int half) {
      cost += huber(residual);
      if (A == nullptr) return;
      const double weight = huber_weight(residual);
      const std::array<int, 4> at{0, 1, 2, half};
      for (std::size_t r = 0; r < j.size(); ++r) {
        const double weighted = weight * j[r];
        for (std::size_t c = 0; c <= r; ++c) (*A)(at[r], at[c]) += weighted * j[c];
        (*b)(at[r]) += weight * residual * j[r];
      }
    };

    const Faces faces = faces_of(x);
    for (std::size_t i = 0; i < count_; ++i) {
      Slope slope;
      Eigen::Vector2d normal;
      const OnFaces on = faces.place_of(points_[i].p_level_m);
      const double d = faces.offset_m(on, &slope, &normal);
      const double sigma = hit_sigma(points_[i], normal);
      add_hit(d / sigma, {slope.d[0] / sigma, slope.d[1] / sigma, slope.d[2] / sigma, -1.0 / sigma}, slope.half);
      const double beyond_m = faces.beyond_m(on, &slope, &normal);
      if (beyond_m <= 0.0) continue;
      const double beyond = beyond_m / hit_sigma(points_[i], normal);
      if (beyond <= kBeyond) continue;
      const double scale = beyond / beyond_m;
      add_hit(beyond - kBeyond, {slope.d[0] * scale, slope.d[1] * scale, slope.d[2] * scale, -scale}, slope.half);
    }

    const std::array<EndOfBox, 2> ends{
        end_of(x, faces, points_[0], -1.0, segment_.right_end, segment_.right_hidden_rad),
        end_of(x, faces, points_[count_ - 1], +1.0, segment_.left_end, segment_.left_hidden_rad)};
    const double early = early_variance_ > 0.0 ? early_factor(ends) : 0.0;
    for (const EndOfBox& end : ends) {
      if (end.sigma_m == 0.0) continue;
      cost += huber((end.beyond_m - early * end.early_m) / end.sigma_m);
    }
    if (early_variance_ > 0.0) cost += (early - 1.0) * (early - 1.0) / early_variance_;
    if (A != nullptr) add_ends(ends, early, A, b);

    if (prior != nullptr) {
      for (int k = 0; k < 5; ++k) {
        const double residual = (x(k) - prior->mean(k)) / prior->sigma(k);
        cost += residual * residual;
        if (A == nullptr) continue;
        (*A)(k, k) += 1.0 / (prior->sigma(k) * prior->sigma(k));
        (*b)(k) += residual / prior->sigma(k);
      }
    }
    return cost;
  }

  /// The rectangle whose two faces towards the sensor are nearest to the hits, over all orientations (after Zhang et
  /// al., 2017), its unseen half lengths those of the prior.
  Vector5d start() const {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < count_; ++i) mean += points_[i].p_level_m;
    mean /= static_cast<double>(count_);
    Vector5d best = Vector5d::Zero();
    double least = std::numeric_limits<double>::infinity();
    for (double psi_rad = 0.0; psi_rad < 0.5 * kPi - 1e-9; psi_rad += kCoarseStep_rad) {
      const Eigen::Vector2d e1(std::cos(psi_rad), std::sin(psi_rad));
      const Eigen::Vector2d e2(-e1.y(), e1.x());
      const double side1 = e1.dot(mean) < 0.0 ? 1.0 : -1.0;  // towards the sensor
      const double side2 = e2.dot(mean) < 0.0 ? 1.0 : -1.0;
      double low1 = std::numeric_limits<double>::infinity(), high1 = -low1, low2 = low1, high2 = -low1;
      for (std::size_t i = 0; i < count_; ++i) {
        const double c1 = side1 * e1.dot(points_[i].p_level_m);
        const double c2 = side2 * e2.dot(points_[i].p_level_m);
        low1 = std::min(low1, c1);
        high1 = std::max(high1, c1);
        low2 = std::min(low2, c2);
        high2 = std::max(high2, c2);
      }
      double sum = 0.0;
      for (std::size_t i = 0; i < count_; ++i) {
        const double d1 = high1 - side1 * e1.dot(points_[i].p_level_m);
        const double d2 = high2 - side2 * e2.dot(points_[i].p_level_m);
        const double d = std::min(d1, d2);
        sum += d * d;
      }
      if (sum >= least) continue;
      least = sum;
      const auto half = [](double extent_m) {
        return extent_m > kMinSpread_m ? 0.5 * extent_m : box_prior::kMeanHalf_m;
      };
      const double a = half(high1 - low1);
      const double b = half(high2 - low2);
      const Eigen::Vector2d t = side1 * (high1 - a) * e1 + side2 * (high2 - b) * e2;
      best << t, psi_rad, a, b;
    }
    return best;
  }

  double residual_rms_m(const Vector5d& x) const {
    const Faces faces = faces_of(x);
    double sum = 0.0;
    for (std::size_t i = 0; i < count_; ++i) sum += std::pow(faces.offset_m(points_[i].p_level_m), 2);
    return std::sqrt(sum / static_cast<double>(count_));
  }

  double mean_offset_m(const Vector5d& x) const {
    const Faces faces = faces_of(x);
    double sum = 0.0;
    for (std::size_t i = 0; i < count_; ++i) sum += std::abs(faces.offset_m(points_[i].p_level_m));
    return sum / static_cast<double>(count_);
  }

 private:
  /// Derivative of a distance by (t_x, t_y, psi) and by the half length at `half` in x, which is -1.
  struct Slope {
    std::array<double, 3> d{};
    int half = 3;
  };

  /// A hit along the axes of the box, from its centre, and its distances from the planes of the faces.
  struct OnFaces {
    double p1, p2, d1, d2;
  };

  /// The faces towards the sensor, at the origin: one or two.
  struct Faces {
    Eigen::Vector2d t, e1, e2;
    double a, b;
    double side1, side2;  ///< 0: not towards the sensor

    OnFaces place_of(const Eigen::Vector2d& y) const {
      OnFaces on{e1.dot(y - t), e2.dot(y - t), 0.0, 0.0};
      on.d1 = depth1(on.p1);
      on.d2 = depth2(on.p2);
      return on;
    }

    /// Distance from the nearest of the planes of the faces, positive outside, and its derivative by x.
    double offset_m(const Eigen::Vector2d& y) const {
      const OnFaces on = place_of(y);
      return std::max(on.d1, on.d2);
    }
    double offset_m(const OnFaces& on, Slope* slope, Eigen::Vector2d* normal) const {
      if (on.d1 >= on.d2) {
        *normal = side1 * e1;
        *slope = {{-normal->x(), -normal->y(), side1 * on.p2}, 3};
      } else {
        *normal = side2 * e2;
        *slope = {{-normal->x(), -normal->y(), -side2 * on.p1}, 4};
      }
      return std::max(on.d1, on.d2);
    }

    /// Distance beyond the far end of the face in whose plane it is nearest, negative before it, the derivative by x,
    /// and the direction in which it counts. Beyond the near end it is outside of the other face.
    double beyond_m(const OnFaces& on, Slope* slope, Eigen::Vector2d* along) const {
      if (on.d1 >= on.d2) {
        const double s = side2 == 0.0 ? std::copysign(1.0, on.p2) : -side2;
        *along = s * e2;
        *slope = {{-along->x(), -along->y(), -s * on.p1}, 4};
        return s * on.p2 - b;
      }
      const double s = side1 == 0.0 ? std::copysign(1.0, on.p1) : -side1;
      *along = s * e1;
      *slope = {{-along->x(), -along->y(), s * on.p2}, 3};
      return s * on.p1 - a;
    }

    /// Distance from the plane of a face, positive outside.
    double depth1(double p1) const { return side1 == 0.0 ? -std::numeric_limits<double>::infinity() : side1 * p1 - a; }
    double depth2(double p2) const { return side2 == 0.0 ? -std::numeric_limits<double>::infinity() : side2 * p2 - b; }
  };

  static Faces faces_of(const Vector5d& x) {
    Faces faces;
    faces.t = x.head<2>();
    faces.e1 = {std::cos(x(2)), std::sin(x(2))};
    faces.e2 = {-faces.e1.y(), faces.e1.x()};
    faces.a = x(3);
    faces.b = x(4);
    const double s1 = -faces.e1.dot(faces.t);
    const double s2 = -faces.e2.dot(faces.t);
    faces.side1 = std::abs(s1) > x(3) ? std::copysign(1.0, s1) : 0.0;
    faces.side2 = std::abs(s2) > x(4) ? std::copysign(1.0, s2) : 0.0;
    if (faces.side1 == 0.0 && faces.side2 == 0.0) faces.side1 = std::copysign(1.0, s1);  // the sensor is in the box
    return faces;
  }

  double hit_sigma(const Point& point, const Eigen::Vector2d& normal) const {
    const Eigen::Vector2d u = point.p_level_m / point.range_m;
    const Eigen::Vector2d across(-u.y(), u.x());
    const double along_sigma = normal.dot(u) * params_.range_sigma_m;
    const double across_sigma = normal.dot(across) * point.range_m * resolution_rad_ / std::sqrt(12.0);
    return std::hypot(along_sigma, across_sigma, std::max(kRoughness_m, params_.shape_sigma_m));
  }

  /// An end of the segment as an edge of the box.
  struct EndOfBox {
    double beyond_m = 0.0;  ///< how far the box extends beyond it
    double early_m = 0.0;   ///< how much earlier than the box it is expected to be
    double sigma_m = 0.0;   ///< 0: it tells nothing
    Vector5d slope = Vector5d::Zero();
  };

  EndOfBox end_of(const Vector5d& x, const Faces& faces, const Point& end, double side, SegmentEnd kind,
                  double hidden_rad) const {
    EndOfBox result;
    const bool silhouette = is_silhouette(kind);
    const double azimuth_rad = end.azimuth_rad + (silhouette ? side * 0.5 * resolution_rad_ : 0.0);
    const Eigen::Vector2d n(-std::sin(azimuth_rad), std::cos(azimuth_rad));
    const double n1 = n.dot(faces.e1);
    const double n2 = n.dot(faces.e2);
    const double half_width = x(3) * std::abs(n1) + x(4) * std::abs(n2);
    result.beyond_m = side * n.dot(x.head<2>()) + half_width;
    if (!silhouette && result.beyond_m >= 0.0) return result;  // it may extend behind what hides it
    if (silhouette && early_variance_ > 0.0) {
      result.early_m =
          std::min(kRoundness * std::min(x(3), x(4)), kMostRadius_m) * std::max(0.0, std::abs(n1) + std::abs(n2) - 1.0);
      if (kind == SegmentEnd::kNoReturn) result.early_m += kLostBeams * end.range_m * resolution_rad_;
    }
    result.sigma_m = end_sigma_m(end, kind, hidden_rad, result.beyond_m > result.early_m, resolution_rad_);
    result.slope.head<2>() = side * n;
    result.slope(2) = x(3) * std::copysign(n2, n1 * n2) - x(4) * std::copysign(n1, n1 * n2);
    result.slope(3) = std::abs(n1);
    result.slope(4) = std::abs(n2);
    return result;
  }

  /// The likeliest factor on what both ends are early, which is 1 on average.
  double early_factor(const std::array<EndOfBox, 2>& ends) const {
    double weights = 1.0 / early_variance_;
    double sum = weights;
    for (const EndOfBox& end : ends) {
      if (end.sigma_m == 0.0) continue;
      const double weight = huber_weight((end.beyond_m - end.early_m) / end.sigma_m) / (end.sigma_m * end.sigma_m);
      weights += weight * end.early_m * end.early_m;
      sum += weight * end.early_m * end.beyond_m;
    }
    return sum / weights;
  }

  /// Adds both ends to the normal equations, of which that factor is eliminated.
  void add_ends(const std::array<EndOfBox, 2>& ends, double early, Matrix5d* A, Vector5d* b) const {
    Vector5d by_factor = Vector5d::Zero();
    double of_factor = early_variance_ > 0.0 ? 1.0 / early_variance_ : 1.0;
    for (const EndOfBox& end : ends) {
      if (end.sigma_m == 0.0) continue;
      const double residual_m = end.beyond_m - early * end.early_m;
      const double weight = huber_weight(residual_m / end.sigma_m) / (end.sigma_m * end.sigma_m);
      A->noalias() += weight * end.slope * end.slope.transpose();
      b->noalias() += weight * residual_m * end.slope;
      by_factor += weight * end.early_m * end.slope;
      of_factor += weight * end.early_m * end.early_m;
    }
    A->noalias() -= by_factor * by_factor.transpose() / of_factor;
  }

  const Point* points_;
  std::size_t count_;
  double resolution_rad_;
  Segment segment_;
  double early_variance_;
  const EllipseFitParams& params_;
};

void bound_halves(Vector5d& x) {
  x(3) = std::max(x(3), kMinHalf_m);
  x(4) = std::max(x(4), kMinHalf_m);
}

Vector5d minimise(const BoxProblem& problem, const Prior& prior, Vector5d x, int max_iterations) {
  bound_halves(x);
  double damping = 1e-3;
  Matrix5d A, A_candidate;
  Vector5d b, b_candidate;
  double cost = max_iterations > 0 ? problem.evaluate(x, &prior, &A, &b) : 0.0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    bool improved = false;
    double change = 0.0;
    const bool is_last = iteration + 1 == max_iterations;
    for (int attempt = 0; attempt < 6 && !improved; ++attempt) {
      Matrix5d damped = A;
      damped.diagonal() *= 1.0 + damping;
      Vector5d candidate = x - damped.llt().solve(b);
      bound_halves(candidate);
      // Most first attempts improve: then these are the next iteration's.
      const bool for_next = attempt == 0 && !is_last;
      const double candidate_cost =
          problem.evaluate(candidate, &prior, for_next ? &A_candidate : nullptr, for_next ? &b_candidate : nullptr);
      improved = candidate_cost < cost;
      if (improved) {
        change = (candidate - x).norm();
        x = candidate;
        if (for_next) {
          cost = candidate_cost;
          A = A_candidate;
          b = b_candidate;
        } else if (!is_last && change >= 1e-5) {
          cost = problem.evaluate(x, &prior, &A, &b);
        }
        damping = std::max(damping * 0.2, 1e-9);
      } else {
        damping *= 10.0;
      }
    }
    if (!improved || change < 1e-5) break;
  }
  return x;
}

Vector5d state_of(const Box& box) {
  Vector5d x;
  x << box.center_m, box.psi_rad, box.half_length_m, box.half_width_m;
  return x;
}

/// The detection of the box x with the covariance P, which is linearised at `at`.
Detection detection_of(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                       const BoxProblem& problem, const Vector5d& x, const Vector5d& at, const Matrix5d& P) {
  const Box box{x.head<2>(), x(2), x(3), x(4)};
  Detection detection = unassessed_detection(segments, segment, params, smooth_parameters(moment_equal_ellipse(box)));
  detection.shape = Shape::kBox;
  detection.box_level = box;
  detection.residual_rms_m = problem.residual_rms_m(x);
  const double c = std::cos(2.0 * at(2));
  const double s = std::sin(2.0 * at(2));
  const double half = 1.0 / std::sqrt(3.0);  // m = (a + b) / sqrt(3), |(p, q)| = |a - b| / sqrt(3)
  const double difference = half * (at(3) - at(4));
  Matrix5d J = Matrix5d::Zero();  // of (t, m, p, q) by x
  J.topLeftCorner<2, 2>().setIdentity();
  J.row(2) << 0.0, 0.0, 0.0, half, half;
  J.row(3) << 0.0, 0.0, -2.0 * difference * s, half * c, -half * c;
  J.row(4) << 0.0, 0.0, 2.0 * difference * c, half * s, -half * s;
  const Matrix5d covariance = J * P * J.transpose();
  detection.covariance = 0.5 * (covariance + covariance.transpose());
  detection.covariance.diagonal().array() += kLeastVariance_m2;
  return detection;
}

}  // namespace

Detection fit_box(const Segments& segments, std::size_t segment, const EllipseFitParams& params) {
  const BoxProblem problem(segments, segments.segments[segment], params);
  const Vector5d from = problem.start();
  Prior prior;
  prior.mean << from.head<3>(), box_prior::kMeanHalf_m, box_prior::kMeanHalf_m;
  prior.sigma << 1.0, 1.0, kKnownSigma_rad, box_prior::kHalfSigma_m, box_prior::kHalfSigma_m;
  if (const double seen_half_m = from.tail<2>().maxCoeff(); seen_half_m > kLargeHalf_m) {
    prior.mean.tail<2>().setConstant(seen_half_m);
    prior.sigma.head<2>().setConstant(kLargeCenterSigma * seen_half_m);
    prior.sigma.tail<2>().setConstant(kLargeSigma * seen_half_m);
  }
  const Vector5d x = minimise(problem, prior, from, params.max_iterations);
  Matrix5d A;
  Vector5d b;
  problem.evaluate(x, &prior, &A, &b);
  return detection_of(segments, segment, params, problem, x, x, inverse_of_positive_definite(A));
}

Detection refit_box(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                    const Box& known_level) {
  const BoxProblem problem(segments, segments.segments[segment], params, kRepeatedScans);
  Vector5d x = state_of(known_level);
  bound_halves(x);
  // Its sides tell which of them is seen: first with them, then without, so that they are not counted twice.
  Prior prior;
  prior.mean = x;
  prior.sigma << 1.0, 1.0, kTurnSigma_rad, kSideSigma_m, kSideSigma_m;
  x = minimise(problem, prior, x, kRefitSteps);
  prior.sigma << kKnownSigma_m, kKnownSigma_m, kKnownSigma_rad, kKnownSigma_m, kKnownSigma_m;
  x = minimise(problem, prior, x, 1);
  // The direction that a view does not show depends on the orientation. Taken at the fitted one, which scatters from
  // scan to scan, each scan would tell a bit of it; so it is taken at the predicted one (Huang et al., 2010).
  Vector5d at = x;
  if (std::abs(x(2) - prior.mean(2)) < kMaxTurn_rad) at(2) = prior.mean(2);
  Matrix5d A;
  Vector5d b;
  problem.evaluate(at, &prior, &A, &b);
  return detection_of(segments, segment, params, problem, x, at, inverse_of_positive_definite(A));
}

double box_cost(const Segments& segments, std::size_t segment, const EllipseFitParams& params, const Box& box_level) {
  return BoxProblem(segments, segments.segments[segment], params)
      .evaluate(state_of(box_level), nullptr, nullptr, nullptr);
}

double residual_rms_m(const Segments& segments, std::size_t segment, const Box& box_level) {
  return BoxProblem(segments, segments.segments[segment], {}).residual_rms_m(state_of(box_level));
}

double mean_offset_m(const Segments& segments, const Segment& segment, const Box& box_level) {
  return BoxProblem(segments, segment, {}).mean_offset_m(state_of(box_level));
}

}  // namespace situation_awareness
