// SPDX-License-Identifier: BSD-3-Clause
#include "boundary_corners.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "circle_sums.hpp"
#include "directions.hpp"
#include "residual_bounds.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// A corner is one if its two sides meet the elements better than an arc by this in chi^2, and are themselves no worse
/// than the third in standard deviations of chi^2. Where a side is short, an arc meets a corner's elements to some
/// centimetres, too.
constexpr double kCornerGain = 25.0, kShortCornerGain = 9.0;
constexpr double kCornerMisfit = 3.0;
/// Lengths of the boundary to either side in which a corner is looked for, over the window: the first that fits, as
/// other corners may be near.
constexpr std::array<double, 3> kCornerWindows = {1.0, 0.5, 1.0 / 3.0};
/// Elements to either side of a corner, at least, with the window and with a part of it.
constexpr std::size_t kFewestOfSide = 4, kFewestOfShortSide = 3;
/// Turn of the lines through all elements of both sides, over the least break of a corner, below which there is none.
constexpr double kStraightPart = 0.8;
/// Part of a corner's turn that is within half the window.
constexpr double kCornerNearTurn = 0.75;

/// Whether a line surely turns by less than an angle to another one, each the way that the elements go; of the angle
/// the tangent is given. It takes a fraction of the time that the angle itself takes.
bool is_surely_less(const LineSums& from, const Eigen::Vector2d& from_way_m, const LineSums& to,
                    const Eigen::Vector2d& to_way_m, double tan_angle) {
  constexpr double kSure = 1e-9;  // far beyond rounding
  const Eigen::Vector2d a = from.along(), b = to.along();
  const double a_ahead = a.dot(from_way_m), b_ahead = b.dot(to_way_m);
  if (a_ahead * a_ahead <= kSure * a.squaredNorm() * from_way_m.squaredNorm() ||
      b_ahead * b_ahead <= kSure * b.squaredNorm() * to_way_m.squaredNorm()) {
    return false;
  }
  const double ahead = (a_ahead < 0.0) != (b_ahead < 0.0) ? -a.dot(b) : a.dot(b);
  return std::abs(left_of(a).dot(b)) < (1.0 - kSure) * tan_angle * ahead;
}

}  // namespace

/// What is on one side of a corner, up to an element.
struct CornerSearch::CornerSide {
  LineSums sums;
  std::size_t end = 0;
};

CornerSearch::CornerSearch(const BoundaryElements& elements)
    : elements_(elements), tan_of_straight_(std::tan(kStraightPart * BoundaryCorner::kAngle_rad)) {}

/// The corner between element `last` and the next, if there is one: in the largest window in which there is.
bool CornerSearch::corner_after(std::size_t last, BoundaryCorner& corner) const {
  const std::size_t n = elements_.points_m.size();
  const std::size_t start = last + 1 < n ? last + 1 : 0;
  std::array<double, kCornerWindows.size()> windows_m{};
  std::transform(kCornerWindows.begin(), kCornerWindows.end(), windows_m.begin(),
                 [&](double part) { return part * BoundaryCorner::kWindow_m; });
  if (elements_.way_m(last, start) > windows_m.front()) return false;
  const Eigen::Vector2d middle_m = elements_.points_m[last];
  // The sums of a window are a part of those of the next larger one.
  std::array<CornerSide, kCornerWindows.size()> left, right;
  const auto sum_up = [&](std::size_t from, bool ahead, auto& sides) {
    LineSums sums;
    std::size_t window = sides.size();  // the larger ones are first
    for (std::size_t i = from;;) {
      sums.add(elements_.points_m[i] - middle_m,
               misfit_weight(elements_.weights[i]) * misfit_weight(elements_.weights[i]));
      const std::size_t next = ahead ? (i + 1 < n ? i + 1 : 0) : (i > 0 ? i - 1 : n - 1);
      const bool is_last = next == from || (!elements_.closed && (ahead ? i + 1 == n : i == 0));
      const double next_m = is_last ? 0.0 : (ahead ? elements_.way_m(from, next) : elements_.way_m(next, from));
      for (; window > 0 && (is_last || next_m > windows_m[window - 1]); --window) sides[window - 1] = {sums, i};
      if (window == 0) return;
      i = next;
    }
  };
  sum_up(last, false, left);
  sum_up(start, true, right);
  for (std::size_t window = 0; window < windows_m.size(); ++window) {
    if (elements_.way_m(last, start) > windows_m[window]) return false;
    if (corner_between(last, windows_m[window], left[window], right[window], corner)) return true;
  }
  return false;
}

/// Two lines against an arc, for the elements within the window before and after the middle of elements `last` and the
/// next.
bool CornerSearch::corner_between(std::size_t last, double window_m, const CornerSide& left_side,
                                  const CornerSide& right_side, BoundaryCorner& corner) const {
  const std::size_t n = elements_.points_m.size();
  const auto next = [&](std::size_t i) { return i + 1 < n ? i + 1 : 0; };
  const std::size_t start = next(last), first = left_side.end, end = right_side.end;
  const LineSums &left = left_side.sums, &right = right_side.sums;
  const Eigen::Vector2d middle_m = elements_.points_m[last];
  const double near_m = 0.5 * window_m;
  const std::size_t fewest = window_m < BoundaryCorner::kWindow_m ? kFewestOfShortSide : kFewestOfSide;
  if (left.n < fewest || right.n < fewest || elements_.way_m(first, last) < 0.5 * window_m ||
      elements_.way_m(start, end) < 0.5 * window_m) {
    return false;
  }
  const Eigen::Vector2d left_way_m = elements_.points_m[last] - elements_.points_m[first],
                        right_way_m = elements_.points_m[end] - elements_.points_m[start];
  if (is_surely_less(left, left_way_m, right, right_way_m, tan_of_straight_)) return false;
  LineSums::Line a = left.line(), b = right.line();
  if (a.along.dot(left_way_m) < 0.0) a.along = -a.along;
  if (b.along.dot(right_way_m) < 0.0) b.along = -b.along;
  const auto turn_of = [](const LineSums::Line& from, const LineSums::Line& to) {
    return std::atan2(left_of(from.along).dot(to.along), from.along.dot(to.along));
  };
  if (std::abs(turn_of(a, b)) < kStraightPart * BoundaryCorner::kAngle_rad) return false;
  // Both lines again, without what is far from them.
  const auto again = [&](LineSums::Line& line, LineSums& near, std::size_t from, std::size_t to) {
    for (int round = 0; round < 2; ++round) {
      LineSums sums;
      for (std::size_t i = from;; i = next(i)) {
        const Eigen::Vector2d v = elements_.points_m[i] - middle_m;
        const double sigmas = std::abs(left_of(line.along).dot(v - line.mean)) * misfit_weight(elements_.weights[i]);
        const double weight = misfit_weight(elements_.weights[i]) * misfit_weight(elements_.weights[i]) *
                              std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
        sums.add(v, weight);
        if (round > 0 && (to == last ? elements_.way_m(i, last) : elements_.way_m(start, i)) < near_m) {
          near.add(v, weight);
        }
        if (i == to) break;
      }
      const Eigen::Vector2d along = line.along;
      line = sums.line();
      if (line.along.dot(along) < 0.0) line.along = -line.along;
    }
  };
  const auto chi2_of = [&](const LineSums::Line& line, std::size_t from, std::size_t to) {
    double chi2 = 0.0;
    for (std::size_t i = from;; i = next(i)) {
      const double sigmas =
          left_of(line.along).dot(elements_.points_m[i] - middle_m - line.mean) * misfit_weight(elements_.weights[i]);
      chi2 += std::min(sigmas * sigmas, kMostChi2);
      if (i == to) break;
    }
    return chi2;
  };
  LineSums near_left, near_right;
  again(a, near_left, first, last);
  again(b, near_right, start, end);
  const double turn_rad = turn_of(a, b);
  if (std::abs(turn_rad) < BoundaryCorner::kAngle_rad) return false;
  // A bend turns half as much in half the window.
  if (near_left.n >= 3 && near_right.n >= 3) {
    LineSums::Line near_a = near_left.line(), near_b = near_right.line();
    if (near_a.along.dot(a.along) < 0.0) near_a.along = -near_a.along;
    if (near_b.along.dot(b.along) < 0.0) near_b.along = -near_b.along;
    const double sigma_rad = std::sqrt(near_a.turn_variance + near_b.turn_variance);
    if (std::abs(turn_of(near_a, near_b)) + 2.0 * sigma_rad < kCornerNearTurn * std::abs(turn_rad)) return false;
  }
  const double lines_chi2 = chi2_of(a, first, last) + chi2_of(b, start, end);
  const auto freedom = static_cast<double>(left.n + right.n) - 4.0;
  if (lines_chi2 > freedom + kCornerMisfit * std::sqrt(2.0 * freedom)) return false;
  const Eigen::Vector2d x_axis = (elements_.points_m[end] - elements_.points_m[first]).normalized();
  CircleSums sums;
  const auto local = [&](std::size_t i) -> Eigen::Vector2d {
    const Eigen::Vector2d v = elements_.points_m[i] - middle_m;
    return {x_axis.dot(v), left_of(x_axis).dot(v)};
  };
  for (std::size_t i = first;; i = next(i)) {
    sums.add(local(i), misfit_weight(elements_.weights[i]) * misfit_weight(elements_.weights[i]));
    if (i == end) break;
  }
  const Eigen::Vector3d c = sums.solve();
  double arc_chi2 = 0.0;
  for (std::size_t i = first;; i = next(i)) {
    const Eigen::Vector2d p = local(i);
    const double e = circle_offset(c, p);
    const Eigen::Vector2d gradient = circle_gradient(c, p);
    arc_chi2 += std::min(misfit_weight(elements_.weights[i]) * misfit_weight(elements_.weights[i]) * e * e /
                             std::max(gradient.squaredNorm(), 0.04),
                         kMostChi2);
    if (i == end) break;
  }
  const double gain = window_m < BoundaryCorner::kWindow_m ? kShortCornerGain : kCornerGain;
  if (arc_chi2 < lines_chi2 + gain || arc_chi2 < 1.5 * lines_chi2) return false;
  // Where the lines meet.
  const double along_m = left_of(b.along).dot(b.mean - a.mean) / left_of(b.along).dot(a.along);
  const Eigen::Vector2d crossing_m = a.mean + along_m * a.along;
  const double reach_m = elements_.way_m(last, start) + 0.25 * window_m;
  if (crossing_m.norm() > reach_m) return false;
  corner = {elements_.s_m[last] + 0.5 * elements_.way_m(last, start), middle_m + crossing_m, yaw_of(a.along),
            yaw_of(b.along), arc_chi2 - lines_chi2};
  return true;
}

void CornerSearch::find() {
  corners_.clear();
  candidates_.clear();
  for (std::size_t i = 0; i + (elements_.closed ? 0 : 1) < elements_.points_m.size(); ++i) {
    BoundaryCorner corner;
    if (corner_after(i, corner)) candidates_.push_back(corner);
  }
  // The best one, and so on without those near it.
  by_score_.clear();
  for (std::size_t i = 0; i < candidates_.size(); ++i) by_score_.push_back(i);
  std::sort(by_score_.begin(), by_score_.end(), [&](std::size_t a, std::size_t b) {
    return candidates_[a].score != candidates_[b].score ? candidates_[a].score > candidates_[b].score : a < b;
  });
  const std::size_t count = candidates_.size();
  for (const std::size_t best : by_score_) {
    const double score = candidates_[best].score;
    if (score <= 0.0) continue;
    corners_.push_back(candidates_[best]);
    const auto forget_near = [&](std::size_t step) {
      for (std::size_t k = 1, i = best; k < count; ++k) {
        i = (i + step) % count;
        const double d_m = candidates_[i].s_m - candidates_[best].s_m;
        if (std::abs(elements_.closed ? std::remainder(d_m, elements_.perimeter_m) : d_m) >=
            BoundaryCorner::kWindow_m) {
          break;
        }
        const double apart_m = (candidates_[i].p_m - candidates_[best].p_m).norm();
        if (apart_m < BoundaryCorner::kApart * BoundaryCorner::kWindow_m) candidates_[i].score = 0.0;
      }
    };
    forget_near(1);
    forget_near(count - 1);
  }
  std::sort(corners_.begin(), corners_.end(),
            [](const BoundaryCorner& a, const BoundaryCorner& b) { return a.s_m < b.s_m; });
}

}  // namespace situation_awareness
