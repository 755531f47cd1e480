// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/ellipse_posterior.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "importance_sampling.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// a, b    azimuths of the right and left tangent from the sensor, less that of the segment's middle   rad
// theta   (a + b) / 2                                                                                 rad
// w       (b - a) / 2, half the angle that the object fills                                           rad
// u_a     unit vector along a; u_b likewise
// alpha   t = alpha u_a + beta u_b is the centre; beta likewise                                       m
// A, B, E 1 / range = A x + B y + E sqrt(x y) along the unit vector x u_a + y u_b                     1/m
// Q       4 A B - E^2, positive for an ellipse                                                        1/m^2
// C       shape matrix in the frame whose x axis points along theta                                   m^2

/// Nearest distance of an ellipse from the sensor outside of it. With y the sensor in the ellipse's own frame, the
/// nearest point is r_i^2 y_i / (s + r_i^2), s the root of a falling convex function, which Newton's method from 0
/// reaches from below.
double nearest_distance(const Ellipse& ellipse) {
  const Eigen::Vector2d y = Eigen::Rotation2Dd(-ellipse.psi_rad) * -ellipse.center_m;
  const Eigen::Array2d r2(ellipse.rx_m * ellipse.rx_m, ellipse.ry_m * ellipse.ry_m);
  const Eigen::Array2d ry2 = r2 * y.array().square();
  constexpr int kMaxIterations = 50;
  double s = 0.0;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Array2d denominator = s + r2;
    const double f = (ry2 / denominator.square()).sum() - 1.0;
    const double slope = -2.0 * (ry2 / denominator.cube()).sum();
    const double step = -f / slope;
    s += step;
    if (std::abs(step) < 1e-12 * (s + r2.maxCoeff())) break;
  }
  return (y.array() * s / (s + r2)).matrix().norm();
}

/// Farthest distance of an ellipse from the sensor: the farthest point x has its normal along x. Going to the point
/// whose normal is along the last one only ever goes farther, since distance is convex.
double farthest_distance(const Ellipse& ellipse) {
  const Eigen::Matrix2d C = shape_matrix(ellipse);
  Eigen::Vector2d x = ellipse.center_m;
  double distance = x.norm();
  constexpr int kMaxIterations = 100;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Vector2d normal = x / distance;
    x = ellipse.center_m + C * normal / std::sqrt(normal.dot(C * normal));
    const double last = std::exchange(distance, x.norm());
    if (distance - last < 1e-9) break;
  }
  return distance;
}

bool is_within_range(const Ellipse& ellipse, const SegmentModel& model) {
  const double distance = ellipse.center_m.norm();
  const double radius = std::max(ellipse.rx_m, ellipse.ry_m);
  return (distance - radius > model.min_range_m || nearest_distance(ellipse) > model.min_range_m) &&
         (distance + radius < model.max_range_m || farthest_distance(ellipse) < model.max_range_m);
}

/// The distance of a circle's centre given its tangents: ranges are the distance times known numbers, so that it is
/// Gaussian but for the prior.
struct CircleDistance {
  double mean_m = 0.0;
  double sigma_m = 0.0;
  double log_height = 0.0;  ///< logarithm of the likelihood at the mean

  CircleDistance() = default;
  CircleDistance(const Hits& hits, double theta, double w, double range_sigma_m) {
    const Eigen::ArrayXd sin_from_center = std::cos(theta) * hits.sin - std::sin(theta) * hits.cos;
    const Eigen::ArrayXd range_per_distance = std::cos(theta) * hits.cos + std::sin(theta) * hits.sin -
                                              (std::pow(std::sin(w), 2) - sin_from_center.square()).max(0.0).sqrt();
    const double H = range_per_distance.square().sum();
    mean_m = (range_per_distance * hits.range_m).sum() / H;
    sigma_m = range_sigma_m / std::sqrt(H);
    log_height = -0.5 * (mean_m * range_per_distance - hits.range_m).square().sum() / std::pow(range_sigma_m, 2);
  }
};

/// Ellipses between two given tangents.
class EllipsesBetween {
 public:
  EllipsesBetween(const Hits& hits, const SegmentModel& model)
      : hits_(hits), model_(model), design_(hits.range_m.size(), 3), inverse_(hits.range_m.size()) {
    const double inverse_range = 1.0 / hits.range_m.mean();
    const double scale = inverse_range * inverse_range;
    // Weak pseudo-measurements of the prior's depth, which guide the proposal only where the hits do not.
    constexpr double kSlopeSigmaM = 1.0;
    constexpr double kThicknessM = 0.3;
    constexpr double kThicknessSigmaM = 0.5;
    const Eigen::RowVector3d slope = Eigen::RowVector3d(1.0, -1.0, 0.0) / (kSlopeSigmaM * scale);
    const Eigen::RowVector3d thickness = Eigen::RowVector3d(0.0, 0.0, 1.0) / (kThicknessSigmaM * scale);
    guide_H_ = slope.transpose() * slope + thickness.transpose() * thickness;
    guide_b_ = thickness.transpose() * (kThicknessM / kThicknessSigmaM);
  }

  /// False if no ellipse has such tangents.
  bool set_tangents(double a, double b) {
    theta_ = 0.5 * (a + b);
    w_ = 0.5 * (b - a);
    if (w_ <= 0.0 || w_ >= 0.5 * kPi) return false;
    sin_2w_ = std::sin(2.0 * w_);
    design_.col(0) = (std::sin(b) * hits_.cos - std::cos(b) * hits_.sin) / sin_2w_;
    design_.col(1) = (std::cos(a) * hits_.sin - std::sin(a) * hits_.cos) / sin_2w_;
    design_.col(2) = (design_.col(0) * design_.col(1)).max(0.0).sqrt();
    circle_ = CircleDistance(hits_, theta_, w_, model_.range_sigma_m);
    return fit();
  }

  Draw draw(Random& random) const {
    Draw result;
    const Eigen::Vector3d x = propose(random);
    const double A = x(0);
    const double B = x(1);
    const double E = x(2);
    const double Q = 4.0 * A * B - E * E;
    if (A <= 0.0 || B <= 0.0 || E <= 0.0 || Q <= 0.0) return result;

    const double alpha = 2.0 * B / Q;
    const double beta = 2.0 * A / Q;
    const double depth2 = 4.0 * E * E / (Q * Q);
    const double cos_w = std::cos(w_);
    const double sin_w = std::sin(w_);
    const double C_11 = cos_w * cos_w * ((alpha - beta) * (alpha - beta) + depth2);
    const double C_22 = sin_w * sin_w * ((alpha + beta) * (alpha + beta) - depth2);
    const double C_12 = cos_w * sin_w * (beta - alpha) * (beta + alpha);
    const double deviator = std::hypot(0.5 * (C_11 - C_22), C_12);
    const double rx = std::sqrt(0.5 * (C_11 + C_22) + deviator);
    const double ry = 2.0 * sin_2w_ * E / (Q * std::sqrt(Q) * rx);
    if (ry <= model_.min_radius_m || rx >= model_.max_radius_m) return result;
    const Eigen::Vector2d center((alpha + beta) * cos_w, (beta - alpha) * sin_w);
    result.ellipse = {Eigen::Rotation2Dd(theta_) * center, theta_ + 0.5 * std::atan2(2.0 * C_12, C_11 - C_22), rx, ry};
    if (!is_within_range(result.ellipse, model_)) return result;

    // Prior, 1 / (rx - rmin) in (t, psi, rx, ry), times the Jacobian of docs/math/floor.md.
    const double log_prior = -std::log((rx - model_.min_radius_m) * rx * ry * deviator) - 6.0 * std::log(Q) +
                             std::log(E) + 2.0 * std::log(sin_2w_);
    const double chi2 =
        ((design_.matrix() * x).array().inverse() - hits_.range_m).square().sum() / square(model_.range_sigma_m);
    result.log_weight = log_prior - 0.5 * chi2 - log_proposal(x);
    return result;
  }

 private:
  static double square(double x) { return x * x; }

  // In these coordinates the prior has a pole 1 / d at the circles, d = (rx^2 - ry^2) / 2, so part of the proposal has
  // one too. The circles between two tangents are the ray A = B = s, E = 2 s sin w, s = 1 / (distance cos w), and to
  // first order C_12 = X sin w / (s^2 cos^3 w) and (C_11 - C_22) / 2 = Y sin^2 w / (s^2 cos^4 w) where
  // A, B = s (1 +- X) and E = 2 s sin w (1 + Y).
  static constexpr double kCircleShare = 0.2;

  double circle_x(double s) const { return std::sin(w_) / (s * s * std::pow(std::cos(w_), 3)); }
  double circle_y(double s) const { return circle_x(s) * std::tan(w_); }
  double deviator_scale() const { return model_.range_sigma_m * circle_.mean_m * std::sin(w_); }

  Eigen::Vector3d propose(Random& random) const {
    if (random.uniform() >= kCircleShare) return mean_ + llt_.matrixU().solve(StudentT<3>::draw(random));
    const double distance = circle_.mean_m + circle_.sigma_m * StudentT<1>::draw(random)(0);
    const double s = 1.0 / (distance * std::cos(w_));
    const double deviator = -deviator_scale() * std::log1p(-random.uniform());
    const double direction = random.uniform(0.0, 2.0 * kPi);
    const double X = deviator * std::sin(direction) / circle_x(s);
    const double Y = deviator * std::cos(direction) / circle_y(s);
    return {s * (1.0 + X), s * (1.0 - X), 2.0 * s * std::sin(w_) * (1.0 + Y)};
  }

  double log_proposal(const Eigen::Vector3d& x) const {
    const double log_around_fit = StudentT<3>::log_density(llt_.matrixU() * (x - mean_)) + log_scale_;
    const double s = 0.5 * (x(0) + x(1));
    const double distance = 1.0 / (s * std::cos(w_));
    const double X = 0.5 * (x(0) - x(1)) / s;
    const double Y = 0.5 * x(2) / (s * std::sin(w_)) - 1.0;
    const double deviator = std::max(std::hypot(circle_x(s) * X, circle_y(s) * Y), 1e-15);
    const StudentT<1>::Vector epsilon((distance - circle_.mean_m) / circle_.sigma_m);
    const double log_around_circle =
        StudentT<1>::log_density(epsilon) - deviator / deviator_scale() +
        std::log(distance * circle_x(s) * circle_y(s) /
                 (circle_.sigma_m * deviator_scale() * 2.0 * kPi * deviator * 4.0 * s * s * s * std::sin(w_)));
    return log_of_sum(std::log(1.0 - kCircleShare) + log_around_fit, std::log(kCircleShare) + log_around_circle);
  }

  /// Gauss-Newton for (A, B, E). Its first step is linear in the inverse ranges themselves.
  bool fit() {
    constexpr int kIterations = 3;
    inverse_ = hits_.range_m.max(0.5 * model_.range_sigma_m).inverse();
    for (int i = 0; i < kIterations; ++i) {
      // range = 1 / z, so a step dx of x changes it by -range^2 (row dx), and z + dz is the target of the row.
      const Eigen::ArrayXd range2 = inverse_.square().inverse();
      const Eigen::ArrayXd target = inverse_ - (hits_.range_m - inverse_.inverse()) / range2;
      const Eigen::ArrayXd weight = (range2 / model_.range_sigma_m).square();
      const Eigen::Matrix3d H =
          guide_H_ + design_.matrix().transpose() * weight.matrix().asDiagonal() * design_.matrix();
      llt_.compute(H);
      if (llt_.info() != Eigen::Success) return false;
      mean_ = llt_.solve(guide_b_ + design_.matrix().transpose() * (weight * target).matrix());
      const Eigen::ArrayXd next = (design_.matrix() * mean_).array();
      // Where the hits contradict the tangents the fit may put some behind the sensor: keep the linear one.
      if ((next <= 0.3 * inverse_).any()) break;
      inverse_ = next;
    }
    log_scale_ = std::log(llt_.matrixL().toDenseMatrix().diagonal().prod());
    return true;
  }

  const Hits& hits_;
  const SegmentModel& model_;
  double theta_ = 0.0;
  double w_ = 0.0;
  double sin_2w_ = 0.0;
  Eigen::Array<double, Eigen::Dynamic, 3> design_;  ///< x, y, sqrt(x y) of each beam
  Eigen::ArrayXd inverse_;
  Eigen::Matrix3d guide_H_;
  Eigen::Vector3d guide_b_;
  CircleDistance circle_;
  Eigen::Vector3d mean_;
  Eigen::LLT<Eigen::Matrix3d> llt_;
  double log_scale_ = 0.0;
};

/// Circles between two given tangents.
class CirclesBetween {
 public:
  CirclesBetween(const Hits& hits, const SegmentModel& model) : hits_(hits), model_(model) {}

  bool set_tangents(double a, double b) {
    theta_ = 0.5 * (a + b);
    w_ = 0.5 * (b - a);
    if (w_ <= 0.0 || w_ >= 0.5 * kPi) return false;
    distance_ = CircleDistance(hits_, theta_, w_, model_.range_sigma_m);
    return true;
  }

  Draw draw(Random& random) const {
    Draw result;
    const StudentT<1>::Vector epsilon = StudentT<1>::draw(random);
    const double distance = distance_.mean_m + distance_.sigma_m * epsilon(0);
    const double radius = distance * std::sin(w_);
    if (radius <= model_.min_radius_m || radius >= model_.max_radius_m) return result;
    result.ellipse = {distance * Eigen::Vector2d(std::cos(theta_), std::sin(theta_)), 0.0, radius, radius};
    if (!is_within_range(result.ellipse, model_)) return result;
    const double log_prior = std::log(distance * distance * std::cos(w_));
    const double log_likelihood = distance_.log_height - 0.5 * epsilon.squaredNorm();
    result.log_weight = log_prior + log_likelihood - StudentT<1>::log_density(epsilon) + std::log(distance_.sigma_m);
    return result;
  }

 private:
  const Hits& hits_;
  const SegmentModel& model_;
  double theta_ = 0.0;
  double w_ = 0.0;
  CircleDistance distance_;
};

/// The interval between two beams that contains a tangent, in beams from the segment's middle, and the probability of
/// the observation without the ranges for a tangent there.
struct Gap {
  double low = 0.0;
  double probability = 1.0;
};

struct Gaps {
  std::vector<Gap> right;
  std::vector<Gap> left;
};

/// Possible intervals of the tangents. At a silhouette, between the last hit and the free beam beside it. At a hidden
/// end, h beams further, for each h that the model allows: the occluder's h was one of `choices` with the same
/// probability.
Gaps gaps_of(const SegmentObservation& observation, const SegmentModel& model) {
  const int visible = static_cast<int>(observation.ranges_m.size());
  const double half = 0.5 * (visible - 1);
  const int room_right = observation.first_beam;
  const int room_left = model.beams - (observation.first_beam + visible);
  Gaps gaps;
  if (room_right >= 1) gaps.right = {{-half - 1.0, 1.0}};
  if (room_left >= 1) gaps.left = {{half, 1.0}};
  if (observation.hidden_end == HiddenEnd::kNone) return gaps;

  std::vector<Gap> hidden_gaps;
  const bool right = observation.hidden_end == HiddenEnd::kRight;
  const int room = right ? room_right : room_left;
  const int least = std::max(0, observation.blocked_beams - model.max_beyond_beams);
  for (int hidden = least; hidden <= observation.blocked_beams && hidden + 1 <= room; ++hidden) {
    const int n = visible + hidden;
    const int fewest = static_cast<int>(std::ceil(model.min_hidden_share * n));
    const int most = std::min(static_cast<int>(std::floor(model.max_hidden_share * n)), n - model.min_hits);
    if (hidden < fewest || hidden > most) continue;
    const int choices = most - fewest + 1;
    hidden_gaps.push_back({right ? -half - 1.0 - hidden : half + hidden, 1.0 / choices});
  }
  (right ? gaps.right : gaps.left) = hidden_gaps;
  return gaps;
}

/// A rectangle of tangents, in beams.
struct Cell {
  double right_low = 0.0;
  double left_low = 0.0;
  double size_right = 0.0;
  double size_left = 0.0;
  double log_density = 0.0;  ///< of the observation without the ranges
};

/// Gaps are divided according to the variation of posteriors within them.
std::vector<Cell> cells_of(const Gaps& gaps) {
  constexpr int kCutsOfSilhouette = 6;
  constexpr int kCutsOfHiddenEnd = 3;
  const int cuts_right = gaps.right.size() > 1 ? kCutsOfHiddenEnd : kCutsOfSilhouette;
  const int cuts_left = gaps.left.size() > 1 ? kCutsOfHiddenEnd : kCutsOfSilhouette;
  std::vector<Cell> cells;
  for (const Gap& right : gaps.right) {
    for (const Gap& left : gaps.left) {
      for (int i = 0; i < cuts_right; ++i) {
        for (int j = 0; j < cuts_left; ++j) {
          Cell cell;
          cell.size_right = 1.0 / cuts_right;
          cell.size_left = 1.0 / cuts_left;
          cell.right_low = right.low + i * cell.size_right;
          cell.left_low = left.low + j * cell.size_left;
          cell.log_density = std::log(right.probability * left.probability);
          cells.push_back(cell);
        }
      }
    }
  }
  return cells;
}

/// Cells of tangents: these are uniform in a cell, the rest is by `Between` given those.
template <class Between>
class TangentProposal {
 public:
  TangentProposal(const SegmentObservation& observation, const SegmentModel& model)
      : model_(model),
        hits_(observation, model),
        between_(hits_, model),
        cells_(cells_of(gaps_of(observation, model))) {
    if (cells_.empty()) throw std::invalid_argument("observation: the model cannot hide or see these beams");
  }

  std::size_t cells() const { return cells_.size(); }

  /// With the same tangents, since the fit for new ones costs as much as several draws.
  void draw_group(std::size_t index, double share, Random& random, std::vector<Draw>& draws) {
    constexpr int kDrawsPerGroup = 4;
    const Cell& cell = cells_[index];
    const double a = (cell.right_low + cell.size_right * random.uniform()) * model_.resolution_rad;
    const double b = (cell.left_low + cell.size_left * random.uniform()) * model_.resolution_rad;
    const bool possible = between_.set_tangents(a, b);
    const double log_cell = cell.log_density + std::log(cell.size_right * cell.size_left / share);
    for (int i = 0; i < kDrawsPerGroup; ++i) {
      draws.push_back(possible ? between_.draw(random) : Draw{});
      draws.back().log_weight += log_cell;
    }
  }

 private:
  const SegmentModel& model_;
  Hits hits_;
  Between between_;
  std::vector<Cell> cells_;
};

/// The posterior as a density over y = (near_m, across_m, psi, rx, v), where the prior is flat: the ellipse's nearest
/// distance along the middle beam and its centre's offset across it, and ry = rmin + v (rx - rmin). Seen from the
/// segment's middle. Independent of the tangents' coordinates, so that the two check each other.
class FlatPosterior {
 public:
  static constexpr int kPsi = 2;

  FlatPosterior(const SegmentObservation& observation, const SegmentModel& model)
      : model_(model), hits_(observation, model), gaps_(gaps_of(observation, model)) {}

  Vector5d from_ellipse(const Ellipse& ellipse) const {
    const Eigen::Matrix2d C = shape_matrix(ellipse);
    Vector5d y;
    y << ellipse.center_m.x() - std::sqrt(C(0, 0)), ellipse.center_m.y(), ellipse.psi_rad, ellipse.rx_m,
        (ellipse.ry_m - model_.min_radius_m) / (ellipse.rx_m - model_.min_radius_m);
    return y;
  }

  Ellipse to_ellipse(const Vector5d& y) const {
    Ellipse ellipse{Eigen::Vector2d::Zero(), y(kPsi), y(3), model_.min_radius_m + y(4) * (y(3) - model_.min_radius_m)};
    ellipse.center_m << y(0) + std::sqrt(shape_matrix(ellipse)(0, 0)), y(1);
    return ellipse;
  }

  double log_density(const Vector5d& y) const {
    if (y(3) <= model_.min_radius_m || y(3) >= model_.max_radius_m || y(4) < 0.0 || y(4) > 1.0) return kImpossible;
    const Ellipse ellipse = to_ellipse(y);
    const Eigen::Vector2d& t = ellipse.center_m;
    const Eigen::Matrix2d C = shape_matrix(ellipse);
    const double gap = gap_probability(C - t * t.transpose(), t);
    if (gap <= 0.0 || !is_within_range(ellipse, model_)) return kImpossible;
    // (range e - t)^T C^-1 (range e - t) = 1 along the unit vector e of each beam, times det C.
    Eigen::Matrix2d adjoint;
    adjoint << C(1, 1), -C(0, 1), -C(0, 1), C(0, 0);
    const Eigen::Vector2d adjoint_t = adjoint * t;
    const Eigen::ArrayXd square = adjoint(0, 0) * hits_.cos.square() + 2.0 * adjoint(0, 1) * hits_.cos * hits_.sin +
                                  adjoint(1, 1) * hits_.sin.square();
    const Eigen::ArrayXd linear = adjoint_t.x() * hits_.cos + adjoint_t.y() * hits_.sin;
    const double constant = t.dot(adjoint_t) - C.determinant();
    const Eigen::ArrayXd range_m = (linear - (linear.square() - square * constant).max(0.0).sqrt()) / square;
    return std::log(gap) - 0.5 * (range_m - hits_.range_m).square().sum() / std::pow(model_.range_sigma_m, 2);
  }

 private:
  /// Log-density of the tangents' gaps. Their normals n have n^T S n = 0, S = C - t t^T; so the eigenvector of its
  /// negative eigenvalue points between them, and the eigenvalues give the angle.
  double gap_probability(const Eigen::Matrix2d& S, const Eigen::Vector2d& t) const {
    const double mean = 0.5 * (S(0, 0) + S(1, 1));
    const double deviator = std::hypot(0.5 * (S(0, 0) - S(1, 1)), S(0, 1));
    if (mean + deviator <= 0.0 || mean - deviator >= 0.0) return 0.0;
    double theta = 0.5 * std::atan2(-2.0 * S(0, 1), S(1, 1) - S(0, 0));
    if (std::cos(theta) * t.x() + std::sin(theta) * t.y() < 0.0) theta += theta > 0.0 ? -kPi : kPi;
    const double w = std::atan(std::sqrt((mean + deviator) / (deviator - mean)));
    return probability(gaps_.right, (theta - w) / model_.resolution_rad) *
           probability(gaps_.left, (theta + w) / model_.resolution_rad);
  }

  static double probability(const std::vector<Gap>& gaps, double beam) {
    for (const Gap& gap : gaps) {
      if (beam >= gap.low && beam < gap.low + 1.0) return gap.probability;
    }
    return 0.0;
  }

  const SegmentModel& model_;
  Hits hits_;
  Gaps gaps_;
};

/// Chains that start from draws of a few effective samples and mix them: each half of them moves along differences of
/// pairs of the other half (differential evolution, ter Braak, 2006), which fits any scale and correlation.
class Ensemble {
 public:
  Ensemble(const FlatPosterior& posterior, const std::vector<Ellipse>& draws) : posterior_(posterior) {
    for (const Ellipse& draw : draws) {
      places_.push_back(posterior.from_ellipse(draw));
      log_densities_.push_back(posterior.log_density(places_.back()));
    }
  }

  void move(int steps, Random& random) {
    const std::size_t half = places_.size() / 2;
    for (int i = 0; i < steps; ++i) {
      move_half(0, half, half, places_.size(), random);
      move_half(half, places_.size(), 0, half, random);
    }
  }

  std::vector<Ellipse> draws() const {
    std::vector<Ellipse> result;
    for (const Vector5d& y : places_) result.push_back(posterior_.to_ellipse(y));
    return result;
  }

 private:
  /// Moves the chains [begin, end) along differences of the chains [other_begin, other_end).
  void move_half(std::size_t begin, std::size_t end, std::size_t other_begin, std::size_t other_end, Random& random) {
    constexpr double kMinFactor = 0.1;
    constexpr double kMaxFactor = 1.0;
    constexpr double kNoise = 0.03;  // of the chains' spread: few different chains do not span the space
    const Vector5d noise = kNoise * spread(other_begin, other_end);
    const auto any_other = [&]() -> const Vector5d& {
      const auto count = static_cast<double>(other_end - other_begin);
      return places_[other_begin + static_cast<std::size_t>(count * random.uniform())];
    };
    for (std::size_t i = begin; i < end; ++i) {
      Vector5d difference = any_other() - any_other();
      difference(FlatPosterior::kPsi) = wrap_to_half_pi(difference(FlatPosterior::kPsi));
      const double factor = random.uniform(kMinFactor, kMaxFactor);
      Vector5d next = places_[i] + factor * difference;
      for (int k = 0; k < next.size(); ++k) next(k) += noise(k) * random.normal();
      const double log_density = posterior_.log_density(next);
      const bool accepted = std::log1p(-random.uniform()) < log_density - log_densities_[i];  // false for NaN
      if (!accepted) continue;
      places_[i] = next;
      log_densities_[i] = log_density;
    }
  }

  Vector5d spread(std::size_t begin, std::size_t end) const {
    Vector5d mean = Vector5d::Zero();
    for (std::size_t i = begin; i < end; ++i) mean += places_[i];
    mean /= static_cast<double>(end - begin);  // last, so that constants have exactly no spread
    Vector5d variance = Vector5d::Zero();
    for (std::size_t i = begin; i < end; ++i) {
      Vector5d difference = places_[i] - mean;
      difference(FlatPosterior::kPsi) = wrap_to_half_pi(difference(FlatPosterior::kPsi));
      variance += difference.cwiseAbs2() / static_cast<double>(end - begin);
    }
    return variance.cwiseSqrt();
  }

  const FlatPosterior& posterior_;
  std::vector<Vector5d> places_;
  std::vector<double> log_densities_;
};

/// The largest correlation of a smooth parameter between the starts and the ends of chains.
double correlation(const std::vector<Ellipse>& starts, const std::vector<Ellipse>& ends) {
  using Array = Eigen::Array<double, 5, 1>;
  const auto n = static_cast<double>(starts.size());
  Array mean_start = Array::Zero();
  Array mean_end = Array::Zero();
  for (std::size_t i = 0; i < starts.size(); ++i) {
    mean_start += smooth_parameters(starts[i]).array() / n;
    mean_end += smooth_parameters(ends[i]).array() / n;
  }
  Array start_start = Array::Zero();
  Array end_end = Array::Zero();
  Array start_end = Array::Zero();
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const Array start = smooth_parameters(starts[i]).array() - mean_start;
    const Array end = smooth_parameters(ends[i]).array() - mean_end;
    start_start += start.square();
    end_end += end.square();
    start_end += start * end;
  }
  constexpr double kTiny = 1e-30;  // a circle's p and q do not vary
  return (start_end.abs() / (start_start * end_end).sqrt().max(kTiny)).maxCoeff();
}

/// Move draws with few effective samples until there are `effective_samples`, or up to a maximum of steps.
EllipsePosterior mix(const FlatPosterior& flat, const EllipsePosterior& start, double effective_samples,
                     Random& random) {
  constexpr int kSteps = 200;
  constexpr int kMaxRounds = 10;
  EllipsePosterior result;
  Ensemble ensemble(flat, start.draws);
  for (int i = 0; i < kMaxRounds && result.effective_samples < effective_samples; ++i) {
    ensemble.move(kSteps, random);
    result.draws = ensemble.draws();
    // The chains' correlation with their starts is the remaining effect of the starts' randomness on a mean.
    const double memory = correlation(start.draws, result.draws);
    result.effective_samples =
        1.0 / (1.0 / static_cast<double>(start.draws.size()) + memory * memory / start.effective_samples);
  }
  return result;
}

template <class Between>
EllipsePosterior sample_between(const SegmentObservation& observation, const SegmentModel& model,
                                double effective_samples, std::size_t count, Random& random) {
  TangentProposal<Between> proposal(observation, model);
  ImportanceSampler<TangentProposal<Between>> sampler(proposal);
  sampler.adapt(random);
  EllipsePosterior posterior = equally_weighted(sampler.sample(effective_samples, random), count, random);
  if (posterior.effective_samples < effective_samples) {
    posterior = mix(FlatPosterior(observation, model), posterior, effective_samples, random);
  }
  const Pose2 T_sensor_middle = middle_in_sensor(observation, model);
  for (Ellipse& draw : posterior.draws) {
    draw = canonical(T_sensor_middle * draw);
    if (model.shape == ObjectShape::kCircle) draw.psi_rad = 0.0;
  }
  return posterior;
}

}  // namespace

void SegmentModel::validate() const {
  check_bounds(*this, "model");
  if (max_radius_m <= min_radius_m) throw std::invalid_argument("model.max_radius_m must be above min_radius_m");
  if (max_range_m <= min_range_m) throw std::invalid_argument("model.max_range_m must be above min_range_m");
  if (max_hidden_share < min_hidden_share) {
    throw std::invalid_argument("model.max_hidden_share must not be below min_hidden_share");
  }
}

EllipsePosterior sample_posterior(const SegmentObservation& observation, const SegmentModel& model,
                                  double effective_samples, std::size_t count, Random& random) {
  model.validate();
  if (static_cast<int>(observation.ranges_m.size()) < model.min_hits) {
    throw std::invalid_argument("observation.ranges_m: fewer than the model's min_hits");
  }
  return model.shape == ObjectShape::kCircle
             ? sample_between<CirclesBetween>(observation, model, effective_samples, count, random)
             : sample_between<EllipsesBetween>(observation, model, effective_samples, count, random);
}

}  // namespace situation_awareness
