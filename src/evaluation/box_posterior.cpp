// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/box_posterior.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "importance_sampling.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"

namespace situation_awareness {
namespace {

// a, b      azimuths of the right and left end of the box, less that of the segment's middle           rad
// nu        azimuth of the normal of the first face, away from the sensor                              rad
// c         azimuth of the corner between the first face, on its left, and the second                  rad
// d_1, d_2  distances of the two faces' lines from the sensor, d_2 = d_1 tan(c - nu)                   m
// s_1, s_2  sides along the normals of the first and the second face                                   m
// g         ranges over d_1, known given nu and c
// (docs/math/floor.md, "Boxes")

struct Interval {
  double low = 0.0;
  double high = 0.0;

  double length() const { return high - low; }
  double draw(Random& random) const { return random.uniform(low, high); }
};

/// Given the corner, or with one face: the distance is Gaussian given nu, and nu is drawn about the best one or by a
/// histogram of its likelihood, which is right where it is broad or has several peaks.
class FaceProposal {
 public:
  FaceProposal(const Hits& hits, double range_sigma_m)
      : hits_(hits), sigma_m_(range_sigma_m), square_sum_(hits.range_m.square().sum()), g_(hits.range_m.size()) {}

  /// The first `right` hits are on the second face, the others on the first; `corner_rad` matters where both are seen.
  /// False if no nu is possible.
  bool set(Interval nus, Eigen::Index right, double corner_rad) {
    nus_ = nus;
    right_ = right;
    corner_rad_ = corner_rad;
    if (nus_.length() <= 0.0) return false;
    const double bin = nus_.length() / kBins;
    std::array<double, kBins> costs{};
    std::size_t best = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      costs[i] = at(nus_.low + (static_cast<double>(i) + 0.5) * bin).cost;
      if (costs[i] < costs[best]) best = i;
    }
    double sum = 0.0;
    for (std::size_t i = 0; i < kBins; ++i) sum += bins_[i] = std::exp(costs[best] - costs[i]);
    for (double& share : bins_) share = (1.0 - kUniformShare) * share / sum + kUniformShare / kBins;
    find_peak(nus_.low + (static_cast<double>(best) + 0.5) * bin, bin, costs[best]);
    return true;
  }

  struct Face {
    double nu = 0.0;
    double distance_m = 0.0;
    double log_weight = kImpossible;  ///< of the likelihood over the proposal
  };

  Face draw(Random& random) const {
    Face face;
    if (random.uniform() < kPeakShare) {
      face.nu = peak_ + spread_ * StudentT<1>::draw(random)(0);
    } else {
      double left = random.uniform();
      std::size_t i = 0;
      while (i + 1 < kBins && left >= bins_[i]) left -= bins_[i++];
      face.nu = nus_.low + (static_cast<double>(i) + random.uniform()) * nus_.length() / kBins;
    }
    const double normal = random.normal();
    if (face.nu <= nus_.low || face.nu >= nus_.high) return face;
    const Fit fit = at(face.nu);
    face.distance_m = fit.distance_m + fit.sigma_m * normal;
    // The proposal's Gaussian of the distance is the likelihood's, up to the height in `cost`.
    face.log_weight = -fit.cost - log_density(face.nu);
    return face;
  }

 private:
  static constexpr std::size_t kBins = 48;
  static constexpr double kUniformShare = 0.1;
  static constexpr double kPeakShare = 0.6;

  /// The best distance given nu, and the negative logarithm of the likelihood, integrated over the distance.
  struct Fit {
    double distance_m = 0.0;
    double sigma_m = 0.0;
    double cost = 0.0;
  };

  Fit at(double nu) const {
    const double cos_nu = std::cos(nu);
    const double sin_nu = std::sin(nu);
    const Eigen::Index left = g_.size() - right_;
    g_.tail(left) = (hits_.cos.tail(left) * cos_nu + hits_.sin.tail(left) * sin_nu).inverse();
    if (right_ > 0) {
      g_.head(right_) =
          std::tan(corner_rad_ - nu) / (hits_.sin.head(right_) * cos_nu - hits_.cos.head(right_) * sin_nu);
    }
    const double gg = g_.square().sum();
    const double gr = (g_ * hits_.range_m).sum();
    Fit fit;
    fit.distance_m = gr / gg;
    fit.sigma_m = sigma_m_ / std::sqrt(gg);
    fit.cost = 0.5 * std::max(0.0, square_sum_ - gr * gr / gg) / (sigma_m_ * sigma_m_) - std::log(fit.sigma_m);
    return fit;
  }

  /// By parabolas through three points, ever closer as the curvature shows to be right.
  void find_peak(double nu, double bin, double cost) {
    constexpr int kIterations = 8;
    constexpr double kWider = 1.2;
    peak_ = nu;
    spread_ = bin;
    double step = 0.25 * bin;
    for (int i = 0; i < kIterations; ++i) {
      const double before = at(peak_ - step).cost;
      const double behind = at(peak_ + step).cost;
      const double curvature = (before - 2.0 * cost + behind) / (step * step);
      if (!(curvature > 0.0) || !std::isfinite(curvature)) break;  // at the ends of the interval ranges are infinite
      const double move = std::clamp(0.5 * (before - behind) / (curvature * step), -2.0 * step, 2.0 * step);
      const double next = std::clamp(peak_ + move, nus_.low, nus_.high);
      const double next_cost = at(next).cost;
      if (next_cost < cost) {
        peak_ = next;
        cost = next_cost;
      }
      spread_ = std::min(kWider / std::sqrt(curvature), bin);
      step = std::min(spread_, 0.5 * bin);
    }
  }

  double log_density(double nu) const {
    const StudentT<1>::Vector t((nu - peak_) / spread_);
    const auto bin = static_cast<std::size_t>((nu - nus_.low) / nus_.length() * kBins);
    const double histogram = bins_[std::min(bin, kBins - 1)] * kBins / nus_.length();
    return log_of_sum(std::log(kPeakShare) + StudentT<1>::log_density(t) - std::log(spread_),
                      std::log((1.0 - kPeakShare) * histogram));
  }

  const Hits& hits_;
  double sigma_m_;
  double square_sum_;
  mutable Eigen::ArrayXd g_;  ///< kept for its memory
  Interval nus_;
  Eigen::Index right_ = 0;
  double corner_rad_ = 0.0;
  std::array<double, kBins> bins_{};  ///< shares
  double peak_ = 0.0;
  double spread_ = 0.0;
};

/// Cells: one face seen; or two, with the corner in a part of the interval between two beams.
class BoxProposal {
 public:
  BoxProposal(const SegmentObservation& observation, const SegmentModel& model, const BoxPrior& prior)
      : model_(model), prior_(prior), hits_(observation, model), faces_(hits_, model.range_sigma_m) {
    const Eigen::Index n = hits_.range_m.size();
    const double step = model.resolution_rad;
    right_gap_ = {hits_.azimuth_rad(0) - step, hits_.azimuth_rad(0)};
    left_gap_ = {hits_.azimuth_rad(n - 1), hits_.azimuth_rad(n - 1) + step};
    cells_.push_back({true, 0, {}});
    if (prior.one_face) return;
    constexpr Eigen::Index kFewHits = 60;
    const int cuts = n <= kFewHits ? 4 : 2;  // nearer, the corner is less certain in terms of beams
    for (Eigen::Index right = 0; right <= n; ++right) {
      const double low = right_gap_.low + static_cast<double>(right) * step;
      for (int i = 0; i < cuts; ++i)
        cells_.push_back({false, right, {low + i * step / cuts, low + (i + 1) * step / cuts}});
    }
  }

  std::size_t cells() const { return cells_.size(); }

  void draw_group(std::size_t index, double share, Random& random, std::vector<Draw>& draws) {
    constexpr int kDrawsPerGroup = 4;
    const Cell& cell = cells_[index];
    const double c = cell.one_face ? 0.0 : cell.corners.draw(random);
    const bool possible = cell.one_face ? faces_.set({right_gap_.low, left_gap_.high}, 0, c) : set_corner(cell, c);
    const double log_cell = (cell.one_face ? 0.0 : std::log(cell.corners.length())) - std::log(share);
    for (int i = 0; i < kDrawsPerGroup; ++i) {
      draws.emplace_back();
      if (!possible) continue;
      draws.back() = cell.one_face ? draw_one_face(random) : draw_two_faces(c, random);
      draws.back().log_weight += log_cell;
    }
  }

 private:
  struct Cell {
    bool one_face = false;
    Eigen::Index right = 0;  ///< hits on the second face
    Interval corners;
  };

  /// All hits see the side of their face that is towards the sensor.
  bool set_corner(const Cell& cell, double c) {
    const Eigen::Index n = hits_.range_m.size();
    const double leftmost = cell.right < n ? hits_.azimuth_rad(n - 1) : c;
    const double rightmost = cell.right > 0 ? hits_.azimuth_rad(0) : c;
    return faces_.set({leftmost - 0.5 * kPi, rightmost}, cell.right, c);
  }

  /// The ends are anywhere between the outermost hits and the free beams beside them, with the prior's density, which
  /// is uniform in their places along the face.
  Draw draw_one_face(Random& random) const {
    const FaceProposal::Face face = faces_.draw(random);
    if (face.log_weight == kImpossible || face.distance_m <= 0.0) return {};
    const auto place = [&](double azimuth) {
      const double angle = azimuth - face.nu;
      return std::abs(angle) < 0.5 * kPi ? face.distance_m * std::tan(angle) : std::copysign(kFarM, angle);
    };
    const Interval right{place(right_gap_.low), std::min(0.0, place(right_gap_.high))};
    const Interval left{std::max(0.0, place(left_gap_.low)), place(left_gap_.high)};
    const Interval depth{prior_.min_side_m, prior_.max_side_m};
    if (right.length() <= 0.0 || left.length() <= 0.0) return {};
    const double y_right = right.draw(random);
    const double y_left = left.draw(random);
    const double s_1 = depth.draw(random);
    const double s_2 = y_left - y_right;
    if (s_2 < prior_.min_side_m || s_2 > prior_.max_side_m) return {};
    return kept(face, y_right, s_1, s_2, std::log(right.length() * left.length() * depth.length()));
  }

  /// Given both faces' lines the sides are uniform where they end between the outermost hits and the free beams.
  Draw draw_two_faces(double c, Random& random) const {
    const FaceProposal::Face face = faces_.draw(random);
    if (face.log_weight == kImpossible || face.distance_m <= 0.0) return {};
    const double d_1 = face.distance_m;
    const double d_2 = d_1 * std::tan(c - face.nu);
    const auto first_side = [&](double azimuth) {
      const double angle = azimuth - face.nu;
      return angle > 0.0 ? d_2 / std::tan(angle) - d_1 : kFarM;
    };
    const auto second_side = [&](double azimuth) {
      const double angle = azimuth - face.nu;
      return angle < 0.5 * kPi ? d_1 * std::tan(angle) - d_2 : kFarM;
    };
    const Interval firsts = sides(first_side(std::min(right_gap_.high, c)), first_side(right_gap_.low));
    const Interval seconds = sides(second_side(std::max(left_gap_.low, c)), second_side(left_gap_.high));
    if (d_2 <= 0.0 || firsts.length() <= 0.0 || seconds.length() <= 0.0) return {};
    const double jacobian = d_1 / std::pow(std::cos(c - face.nu), 2);  // of d_2 by c
    return kept(face, d_2, firsts.draw(random), seconds.draw(random),
                std::log(jacobian * firsts.length() * seconds.length()));
  }

  Interval sides(double low, double high) const {
    return {std::max(low, prior_.min_side_m), std::min(high, prior_.max_side_m)};
  }

  /// The box with the first face at the distance along its normal, from `y` on along the second normal.
  Draw kept(const FaceProposal::Face& face, double y, double s_1, double s_2, double log_prior) const {
    const Pose2 T_middle_faces{Eigen::Vector2d::Zero(), face.nu};
    const Box box = T_middle_faces * Box{{face.distance_m + 0.5 * s_1, y + 0.5 * s_2}, 0.0, 0.5 * s_1, 0.5 * s_2};
    if (offset_m(box, Eigen::Vector2d::Zero()) < model_.min_range_m) return {};
    for (const Eigen::Vector2d& corner : corners(box)) {
      if (corner.norm() > model_.max_range_m) return {};
    }
    return {moment_equal_ellipse(box), face.log_weight + log_prior};
  }

  static constexpr double kFarM = 1e6;

  const SegmentModel& model_;
  const BoxPrior& prior_;
  Hits hits_;
  FaceProposal faces_;
  Interval right_gap_;
  Interval left_gap_;
  std::vector<Cell> cells_;
};

}  // namespace

void BoxPrior::validate() const {
  check_bounds(*this, "prior");
  if (max_side_m <= min_side_m) throw std::invalid_argument("prior.max_side_m must be above min_side_m");
}

EllipsePosterior sample_box_posterior(const SegmentObservation& observation, const SegmentModel& model,
                                      const BoxPrior& prior, double effective_samples, std::size_t count,
                                      Random& random) {
  model.validate();
  prior.validate();
  const int visible = static_cast<int>(observation.ranges_m.size());
  if (visible < model.min_hits) throw std::invalid_argument("observation.ranges_m: fewer than the model's min_hits");
  if (observation.hidden_end != HiddenEnd::kNone) throw std::invalid_argument("observation.hidden_end: not of boxes");
  if (observation.first_beam < 1 || observation.first_beam + visible >= model.beams) {
    throw std::invalid_argument("observation.first_beam: no free beam on both sides");
  }
  BoxProposal proposal(observation, model, prior);
  ImportanceSampler<BoxProposal> sampler(proposal);
  sampler.adapt(random);
  EllipsePosterior posterior = equally_weighted(sampler.sample(effective_samples, random), count, random);
  const Pose2 T_sensor_middle = middle_in_sensor(observation, model);
  for (Ellipse& draw : posterior.draws) draw = canonical(T_sensor_middle * draw);
  return posterior;
}

}  // namespace situation_awareness
