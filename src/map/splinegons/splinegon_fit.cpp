// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "situation_awareness/geometry/biarc.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. Least mean distance of main vertices of an open boundary: a short one has fewer.
constexpr double kLeastSpacing_m = 0.8;
/// Largest distance of main vertices along the boundary, over their mean distance.
constexpr double kSpacingRatio = 2.5;
/// rad. Least break of the tangent that is a corner.
constexpr double kCornerAngle_rad = 0.75;
/// m. Length of the boundary to either side in which a corner's sides are compared with an arc.
constexpr double kCornerWindow_m = 1.2;
/// Standard deviations beyond which an element's distance counts linearly (Huber).
constexpr double kHuberSigmas = 2.0;

/// Elements and length in m of a boundary, at least.
constexpr std::size_t kFewestElements = 6;
constexpr double kShortest_m = 0.2;
/// Elements that a main vertex needs, which has a place across the boundary and a heading.
constexpr std::size_t kElementsOfVertex = 3;
constexpr std::size_t kFewestOfClosed = 4;
/// Part of a biarc's length by which a main vertex may move along the boundary in a step. What the elements say of it
/// is of the same order, so half or twice as much changes nothing but the number of steps.
constexpr double kAlongStep = 0.1;
/// m. Effect on the boundary of a jump of the curvature that is expected anywhere.
constexpr double kLeastJumpEffect_m = 0.001;
/// Largest distance of a biarc from a curve with linear curvature and the same ends, over jump * length^2:
/// docs/math/splinegons.md.
constexpr double kJumpEffect = 1.0 / 216.0;
/// Root mean square of the same where the ends are fitted too; with ends on the curve it would be 1 / 328.
constexpr double kJumpRms = 1.0 / 500.0;
/// A corner is one if its two sides meet the elements better than an arc by this in chi^2, and are themselves no worse
/// than the second in standard deviations of chi^2.
/// Of a side that is short, an arc meets a corner's elements to some centimetres, too.
constexpr double kCornerGain = 25.0, kShortCornerGain = 9.0;
constexpr double kCornerMisfit = 3.0;
/// Square of an expected jump over that of the fit, which is in part noise: from 0.2 to 1 errors change by a tenth.
constexpr double kJumpShare = 0.3;
/// Largest share of an element in chi^2 when fits are compared.
constexpr double kMostChi2 = 9.0;
/// Standard deviations of chi^2 by which one arc may be worse than many.
constexpr double kOneArcSigmas = 2.0;
/// Standard deviations, beyond the elements' spacing, by which an element is off its neighbours' lines that is left
/// out.
constexpr double kOutlierSigmas = 6.0;
/// Median of the absolute value of a standard normal variable.
constexpr double kMedianSigmas = 0.6745;
/// m, and spacings of the elements. Boundary without elements that is a gap, where no main vertices are.
constexpr double kGap_m = 0.8;
constexpr double kGapSpacings = 4.0;
/// Density of main vertices in gaps.
constexpr double kGapShare = 1e-3;
/// Standard deviation in the middle of a gap, over mean curvature * length^2: a curve with twice the mean curvature is
/// as far from the chord.
constexpr double kGapSigma = 1.0 / 16.0;
/// The same of a corner that may be in the gap, over length * tan(turn / 2): a quarter of its distance from the chord.
constexpr double kGapCorner = 1.0 / 8.0;
/// Lengths of the boundary to either side in which a corner is looked for, over the window: the first that fits, as
/// other corners may be near; and the least distance of two, over the window.
constexpr double kCornersApart = 0.3;
constexpr std::array<double, 3> kCornerWindows = {1.0, 0.5, 1.0 / 3.0};
/// Elements to either side of a corner, at least, with the window and with a part of it.
constexpr std::size_t kFewestOfSide = 4, kFewestOfShortSide = 3;
/// Turn of the lines through all elements of both sides, over the least break of a corner, below which there is none.
constexpr double kStraightPart = 0.8;
/// Least break of the tangent of a corner that stays one, over that of a new one.
constexpr double kLeastBreak = 0.7;
/// Part of a corner's turn that is within half the window.
constexpr double kCornerNearTurn = 0.75;
/// Largest correlation of the residuals of neighbouring elements that is believed.
constexpr double kMostCorrelation = 0.7;
/// m. Least length of an arc.
constexpr double kShortestArc_m = 1e-6;
/// Part of the chord of a biarc that is left in a step, at least.
constexpr double kLeastOfChord = 0.1;
/// m. Least length of an edge of a polygon.
constexpr double kShortestEdge_m = 1e-4;
/// Of the factorization of normal equations, whose entries are of 1 / m^2 and 1 / rad^2.
constexpr double kLeastPivot = 1e-6;
/// m. A step that moves no main vertex further is the last.
constexpr double kNoChange_m = 2e-4;
/// Where arcs do not follow the boundary, residuals of neighbours are alike. That is so where the sum of their products
/// is more than so many of its standard deviations, and what they have in common is at least this (m).
constexpr double kMisfitSigmas = 4.0;
constexpr double kLeastMisfit_m = 0.01;
/// Two neighbours that are off by so many standard deviations, and so far, are not followed either: the tip of a slim
/// column has few others. One alone is an outlier.
constexpr double kPairSigmas = 4.0, kLeastPair_m = 0.03;
/// A residual counts up to so many standard deviations there.
constexpr double kMostSigmas = 3.0;
/// Rounds in which biarcs that do not follow the boundary are parted, each into so many at most.
constexpr int kMostRounds = 6;
constexpr double kMostParts = 4.0;
/// m^-2, rad^-2. Keeps main vertices and tangents where hardly any elements are.
constexpr double kHoldAcross = 10.0, kHoldYaw = 1.0;
/// m. By how much a biarc at a corner is off its chord which hardly any element tells.
constexpr double kStraight_m = 0.01;
/// Elements that tell the curvature of a biarc at a corner, at least; and how far (m) a corner is from where it was
/// found.
constexpr std::size_t kElementsOfArc = 6;
constexpr double kCorner_m = 0.1;
/// Of the distance from one element to the next, and of what they are off, the place on an earlier fit is looked for
/// near that of the element before; otherwise everywhere, for so many elements.
constexpr double kNear_m = 0.3;
constexpr std::size_t kNearArcs = 4, kMostSearches = 16;
/// Least offset (m) of an element from the polygon that is taken for its neighbours, where arcs do not follow them.
constexpr double kPolygonOffset_m = 0.02;
/// A biarc goes astray if it is longer than the polygon by this factor, or one of its arcs turns by this (rad).
constexpr double kMostWay = 1.3, kMostTurn_rad = 2.5;
/// So does a corner that is farther from one of the elements beside it than these are from each other, by this factor.
constexpr double kMostCornerWay = 1.5;

Eigen::Vector2d unit(double yaw_rad) { return {std::cos(yaw_rad), std::sin(yaw_rad)}; }

double yaw_of(const Eigen::Vector2d& v) { return std::atan2(v.y(), v.x()); }

double sinc(double x) { return std::abs(x) < 1e-4 ? 1.0 - x * x / 6.0 : std::sin(x) / x; }

Eigen::Vector2d point_on(const Eigen::Vector2d& begin_m, double yaw_rad, double curvature_1pm, double s_m) {
  const double half_rad = 0.5 * curvature_1pm * s_m;
  return begin_m + s_m * sinc(half_rad) * unit(yaw_rad + half_rad);
}

/// The weight of an element in a search for misfits. It is bounded, so that an element that is known better does not
/// hide a misfit.
double misfit_weight(double weight) { return std::min(weight, 1.0 / kLeastMisfit_m); }

/// What residuals have in common, from a sum of elements'.
bool have_misfit_in_common(double products, double elements, double weights) {
  if (products < kMisfitSigmas * std::sqrt(elements)) return false;
  const double sigma_m = elements / std::max(weights, 1e-12);
  return std::sqrt(products / elements) * sigma_m > kLeastMisfit_m;
}

}  // namespace

/// A weighted total least squares line.
struct SplinegonFit::LineSums {
  double w = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  std::size_t n = 0;

  void add(const Eigen::Vector2d& p, double weight) {
    w += weight;
    x += weight * p.x();
    y += weight * p.y();
    xx += weight * p.x() * p.x();
    xy += weight * p.x() * p.y();
    yy += weight * p.y() * p.y();
    ++n;
  }

  struct Line {
    Eigen::Vector2d mean, along;
    double chi2, turn_variance;
  };

  struct Squares {
    double xx, xy, yy;
  };

  /// About the mean.
  Squares squares(const Eigen::Vector2d& mean) const {
    return {xx - w * mean.x() * mean.x(), xy - w * mean.x() * mean.y(), yy - w * mean.y() * mean.y()};
  }

  /// Along the line, of any length: zero where there is none.
  Eigen::Vector2d along() const {
    const Squares s = squares({x / w, y / w});
    const double by_cos = s.xx - s.yy, by_sin = 2.0 * s.xy, both = std::sqrt(by_cos * by_cos + by_sin * by_sin);
    if (by_cos > 0.0) return {both + by_cos, by_sin};
    return {std::abs(by_sin), std::copysign(both - by_cos, by_sin)};
  }

  Line line() const {
    const Eigen::Vector2d mean(x / w, y / w);
    const auto [sxx, sxy, syy] = squares(mean);
    const Eigen::Vector2d along = unit(0.5 * std::atan2(2.0 * sxy, sxx - syy));
    const Eigen::Vector2d normal = left_of(along);
    const double chi2 =
        normal.x() * normal.x() * sxx + 2.0 * normal.x() * normal.y() * sxy + normal.y() * normal.y() * syy;
    return {mean, along, std::max(chi2, 0.0), 1.0 / std::max(sxx + syy - chi2, 1e-9)};
  }
};

/// What is on one side of a corner, up to an element.
struct SplinegonFit::CornerSide {
  LineSums sums;
  std::size_t end = 0;
};

/// Whether a line surely turns by less than an angle to another one, each the way that the elements go; of the angle
/// the tangent is given. It takes a fraction of the time that the angle itself takes.
bool SplinegonFit::is_surely_less(const LineSums& from, const Eigen::Vector2d& from_way_m, const LineSums& to,
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

/// Returns the number of entries.
Eigen::Index SplinegonFit::BandMatrix::resize(Eigen::Index size, Eigen::Index below) {
  size_ = size;
  below_ = below;
  const Eigen::Index entries = (below + 1) * size;
  if (entries_.size() < entries) entries_.resize(2 * entries);
  return entries;
}

void SplinegonFit::BandMatrix::reset(Eigen::Index size, Eigen::Index below) {
  entries_.head(resize(size, below)).setZero();
}

SplinegonFit::BandMatrix& SplinegonFit::BandMatrix::operator=(const BandMatrix& other) {
  const Eigen::Index entries = resize(other.size_, other.below_);
  entries_.head(entries) = other.entries_.head(entries);
  return *this;
}

void SplinegonFit::BandMatrix::swap(BandMatrix& other) {
  std::swap(size_, other.size_);
  std::swap(below_, other.below_);
  entries_.swap(other.entries_);
}

void SplinegonFit::BandMatrix::scale_diagonal(double factor) {
  for (Eigen::Index j = 0; j < size_; ++j) (*this)(j, j) *= factor;
}

void SplinegonFit::BandMatrix::factorize() {
  for (Eigen::Index j = 0; j < size_; ++j) {
    const Eigen::Index rows = std::min(below_, size_ - 1 - j);
    double* const column = &(*this)(j, j);
    const double root = std::sqrt(std::max(column[0], kLeastPivot));
    column[0] = root;
    for (Eigen::Index r = 1; r <= rows; ++r) column[r] /= root;
    for (Eigen::Index c = 1; c <= rows; ++c) {
      Eigen::Map<Eigen::VectorXd> other(&(*this)(j + c, j + c), rows - c + 1);
      other.noalias() -= column[c] * Eigen::Map<const Eigen::VectorXd>(column + c, rows - c + 1);
    }
  }
}

void SplinegonFit::BandMatrix::solve(Eigen::VectorXd& b) const {
  for (Eigen::Index j = 0; j < size_; ++j) {
    const double* const column = &(*this)(j, j);
    b(j) /= column[0];
    for (Eigen::Index r = 1; r <= std::min(below_, size_ - 1 - j); ++r) b(j + r) -= column[r] * b(j);
  }
  for (Eigen::Index j = size_ - 1; j >= 0; --j) {
    const double* const column = &(*this)(j, j);
    for (Eigen::Index r = 1; r <= std::min(below_, size_ - 1 - j); ++r) b(j) -= column[r] * b(j + r);
    b(j) /= column[0];
  }
}

void SplinegonFit::BandMatrix::invert(BandMatrix& inverse) const {
  inverse.reset(size_, below_);
  for (Eigen::Index j = size_ - 1; j >= 0; --j) {
    const double* const column = &(*this)(j, j);
    const Eigen::Index rows = std::min(below_, size_ - 1 - j);
    // The sums of all rows at once, as none of them waits for another then: each over k in order.
    double* const sums = &inverse(j, j);
    for (Eigen::Index k = 1; k <= rows; ++k) {
      for (Eigen::Index r = 1; r < k; ++r) sums[r] -= column[k] * inverse(j + k, j + r);
      const double* const other = &inverse(j + k, j + k);
      for (Eigen::Index r = k; r <= rows; ++r) sums[r] -= column[k] * other[r - k];
    }
    for (Eigen::Index r = 1; r <= rows; ++r) sums[r] /= column[0];
    double sum = 1.0 / column[0];
    for (Eigen::Index k = 1; k <= rows; ++k) sum -= column[k] * sums[k];
    sums[0] = sum / column[0];
  }
}

void SplinegonFitParams::validate() const { check_bounds(*this, "splinegon_fit"); }

SplinegonFit::SplinegonFit(const SplinegonFitParams& params)
    : params_((params.validate(), params)), tan_of_straight_(std::tan(kStraightPart * kCornerAngle_rad)) {}

SplinegonFitQuality SplinegonFit::fit(const std::vector<SplinegonElement>& elements, bool closed,
                                      double common_variance_m2, std::vector<SplinegonVertex>& vertices,
                                      bool follow_tips) {
  SplinegonFitQuality quality;
  closed_ = closed;
  follow_tips_ = follow_tips;
  if (!take(elements)) {
    vertices.clear();
    return quality;
  }
  find_corners();
  quality.warm = place_on_earlier(vertices);
  if (quality.warm) {
    expect_jumps(false);
    quality.iterations += iterate(4);
    if (chi2_per_freedom() > 2.0) quality.warm = false;
  }
  if (!quality.warm) {
    place_on_elements();
    expect_jumps(true);
    quality.iterations += iterate(4);
    for (int round = 0; round < 2; ++round) {
      place_again();
      expect_jumps(false);
      quality.iterations += iterate(4);
      if (nodes_.size() > wanted_nodes()) break;  // they stay where arcs end
    }
  }
  place_again();
  expect_jumps(false);
  quality.iterations += iterate(6);
  for (int round = 0; round < kMostRounds && part_misfits(); ++round) {
    expect_jumps(false);
    quality.iterations += iterate(6);
  }
  const double chi2 = chi2_per_freedom();
  quality.chi2_per_freedom = chi2 * raised_ * raised_;
  write(common_variance_m2, std::max(1.0, chi2) * correlation_factor(), vertices);
  remove_if_degenerate(vertices);
  quality.as_polygon = static_cast<int>(std::count(is_polygon_.begin(), is_polygon_.end(), true));
  return quality;
}

void SplinegonFit::fit_polygon(const std::vector<SplinegonElement>& elements, bool closed, double common_variance_m2,
                               std::vector<SplinegonVertex>& vertices) {
  closed_ = closed;
  vertices.clear();
  corners_m_.clear();
  if (take(elements)) {
    for (std::size_t i = 0; i < points_m_.size(); ++i) corners_m_.push_back({points_m_[i], 1.0 / weights_[i]});
  } else {
    for (const SplinegonElement& element : elements) {
      origin_m_ = elements[0].p_world_m;
      corners_m_.push_back({element.p_world_m - origin_m_, std::sqrt(element.variance_m2)});
    }
  }
  append_corners(!closed, closed, common_variance_m2, vertices);
  remove_if_degenerate(vertices);
}

/// Elements that go to and fro may have no chain of arcs.
void SplinegonFit::remove_if_degenerate(std::vector<SplinegonVertex>& vertices) const {
  bool is_sound = vertices.size() >= (closed_ ? 4U : 3U);
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    const SplinegonVertex& vertex = vertices[k];
    const SplinegonVertex& next = vertices[k + 1 < vertices.size() ? k + 1 : 0];
    is_sound &= std::isfinite(vertex.sigma_m) && std::isfinite(vertex.bulge) &&
                (next.p_world_m - vertex.p_world_m).norm() > kShortestArc_m;
  }
  if (!is_sound) vertices.clear();
}

/// Takes the elements over, without those far from their neighbours. The variances are raised to what the elements
/// show.
bool SplinegonFit::take(const std::vector<SplinegonElement>& elements) {
  const std::size_t n = elements.size();
  if (n < kFewestElements) return false;
  origin_m_ = elements[0].p_world_m;
  const auto median = [&] {
    const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
    std::nth_element(scratch_.begin(), middle, scratch_.end());
    return *middle;
  };
  scratch_.clear();
  for (std::size_t i = 1; i < n; ++i) {
    scratch_.push_back((elements[i].p_world_m - elements[i - 1].p_world_m).norm());
  }
  const double spacing_m = median();
  points_m_.clear();
  normals_.clear();
  weights_.clear();
  scratch_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    // An element is an outlier if it is far from at least two thirds of the lines through one of three neighbours
    // before and one of three after it. At a corner, all lines are about a spacing away.
    const double sigma_m = std::sqrt(elements[i].variance_m2);
    const double most_m = kOutlierSigmas * sigma_m + spacing_m;
    const std::size_t most_before = closed_ ? 3 : std::min<std::size_t>(i, 3);
    const std::size_t most_after = closed_ ? 3 : std::min<std::size_t>(n - 1 - i, 3);
    const std::size_t lines = most_before * most_after;
    std::size_t near = 0;
    for (std::size_t before = 1; before <= most_before; ++before) {
      const Eigen::Vector2d& from = elements[i >= before ? i - before : i + n - before].p_world_m;
      for (std::size_t after = 1; after <= most_after && near <= lines / 3; ++after) {
        const Eigen::Vector2d line = elements[i + after < n ? i + after : i + after - n].p_world_m - from;
        const double across_m = std::abs(left_of(line).dot(elements[i].p_world_m - from)) / std::max(line.norm(), 1e-9);
        if (before == 1 && after == 1) scratch_.push_back(across_m / sigma_m);
        if (!(across_m > most_m)) ++near;
      }
    }
    if (lines > 0 && near <= lines / 3) continue;
    points_m_.push_back(elements[i].p_world_m - origin_m_);
    normals_.push_back(elements[i].normal_world);
    weights_.push_back(1.0 / sigma_m);
  }
  if (points_m_.size() < kFewestElements) return false;
  // The distance from the line through both neighbours has 1.5 times the variance of an element.
  raised_ = std::max(1.0, scratch_.empty() ? 1.0 : median() / (kMedianSigmas * std::sqrt(1.5)));
  for (double& weight : weights_) weight /= raised_;
  s_m_.clear();
  gaps_.clear();
  double s_m = 0.0;
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    if (i > 0) s_m += (points_m_[i] - points_m_[i - 1]).norm();
    s_m_.push_back(s_m);
    const std::size_t next = i + 1 < points_m_.size() ? i + 1 : 0;
    const double edge_m = (points_m_[next] - points_m_[i]).norm();
    if ((closed_ || next > 0) && edge_m > std::max(kGap_m, kGapSpacings * spacing_m)) gaps_.push_back({i, next});
  }
  perimeter_m_ = s_m + (closed_ ? (points_m_.front() - points_m_.back()).norm() : 0.0);
  return perimeter_m_ > kShortest_m;
}

/// As many as a boundary has that no misfit asks for more of.
std::size_t SplinegonFit::wanted_nodes() const {
  const auto most = static_cast<std::size_t>(params_.vertices);
  const std::size_t determined = points_m_.size() / kElementsOfVertex;
  if (closed_) return std::clamp<std::size_t>(determined, kFewestOfClosed, most);
  const auto fitting = static_cast<std::size_t>(std::lround(perimeter_m_ / kLeastSpacing_m)) + 1;
  return std::clamp<std::size_t>(std::min(fitting, determined), 2, most);
}

/// Along the polygon of the elements, from one to another that is after it.
double SplinegonFit::way_m(std::size_t from, std::size_t to) const {
  return to >= from ? s_m_[to] - s_m_[from] : s_m_[to] + perimeter_m_ - s_m_[from];
}

/// The corner between element `last` and the next, if there is one: in the largest window in which there is.
bool SplinegonFit::corner_after(std::size_t last, Corner& corner) const {
  const std::size_t n = points_m_.size();
  const std::size_t start = last + 1 < n ? last + 1 : 0;
  std::array<double, kCornerWindows.size()> windows_m{};
  std::transform(kCornerWindows.begin(), kCornerWindows.end(), windows_m.begin(),
                 [&](double part) { return part * kCornerWindow_m; });
  if (way_m(last, start) > windows_m.front()) return false;
  const Eigen::Vector2d middle_m = points_m_[last];
  // The sums of a window are a part of those of the next larger one.
  std::array<CornerSide, kCornerWindows.size()> left, right;
  const auto sum_up = [&](std::size_t from, bool ahead, auto& sides) {
    LineSums sums;
    std::size_t window = sides.size();  // the larger ones are first
    for (std::size_t i = from;;) {
      sums.add(points_m_[i] - middle_m, misfit_weight(weights_[i]) * misfit_weight(weights_[i]));
      const std::size_t next = ahead ? (i + 1 < n ? i + 1 : 0) : (i > 0 ? i - 1 : n - 1);
      const bool is_last = next == from || (!closed_ && (ahead ? i + 1 == n : i == 0));
      const double next_m = is_last ? 0.0 : (ahead ? way_m(from, next) : way_m(next, from));
      for (; window > 0 && (is_last || next_m > windows_m[window - 1]); --window) sides[window - 1] = {sums, i};
      if (window == 0) return;
      i = next;
    }
  };
  sum_up(last, false, left);
  sum_up(start, true, right);
  for (std::size_t window = 0; window < windows_m.size(); ++window) {
    if (way_m(last, start) > windows_m[window]) return false;
    if (corner_between(last, windows_m[window], left[window], right[window], corner)) return true;
  }
  return false;
}

/// Two lines against an arc, for the elements within the window before and after the middle of elements `last` and the
/// next.
bool SplinegonFit::corner_between(std::size_t last, double window_m, const CornerSide& left_side,
                                  const CornerSide& right_side, Corner& corner) const {
  const std::size_t n = points_m_.size();
  const auto next = [&](std::size_t i) { return i + 1 < n ? i + 1 : 0; };
  const std::size_t start = next(last), first = left_side.end, end = right_side.end;
  const LineSums &left = left_side.sums, &right = right_side.sums;
  const Eigen::Vector2d middle_m = points_m_[last];
  const double near_m = 0.5 * window_m;
  const std::size_t fewest = window_m < kCornerWindow_m ? kFewestOfShortSide : kFewestOfSide;
  if (left.n < fewest || right.n < fewest || way_m(first, last) < 0.5 * window_m ||
      way_m(start, end) < 0.5 * window_m) {
    return false;
  }
  const Eigen::Vector2d left_way_m = points_m_[last] - points_m_[first],
                        right_way_m = points_m_[end] - points_m_[start];
  if (is_surely_less(left, left_way_m, right, right_way_m, tan_of_straight_)) return false;
  LineSums::Line a = left.line(), b = right.line();
  if (a.along.dot(left_way_m) < 0.0) a.along = -a.along;
  if (b.along.dot(right_way_m) < 0.0) b.along = -b.along;
  const auto turn_of = [](const LineSums::Line& from, const LineSums::Line& to) {
    return std::atan2(left_of(from.along).dot(to.along), from.along.dot(to.along));
  };
  if (std::abs(turn_of(a, b)) < kStraightPart * kCornerAngle_rad) return false;
  // Both lines again, without what is far from them.
  const auto again = [&](LineSums::Line& line, LineSums& near, std::size_t from, std::size_t to) {
    for (int round = 0; round < 2; ++round) {
      LineSums sums;
      for (std::size_t i = from;; i = next(i)) {
        const Eigen::Vector2d v = points_m_[i] - middle_m;
        const double sigmas = std::abs(left_of(line.along).dot(v - line.mean)) * misfit_weight(weights_[i]);
        const double weight = misfit_weight(weights_[i]) * misfit_weight(weights_[i]) *
                              std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
        sums.add(v, weight);
        if (round > 0 && (to == last ? way_m(i, last) : way_m(start, i)) < near_m) near.add(v, weight);
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
      const double sigmas = left_of(line.along).dot(points_m_[i] - middle_m - line.mean) * misfit_weight(weights_[i]);
      chi2 += std::min(sigmas * sigmas, kMostChi2);
      if (i == to) break;
    }
    return chi2;
  };
  LineSums near_left, near_right;
  again(a, near_left, first, last);
  again(b, near_right, start, end);
  const double turn_rad = turn_of(a, b);
  if (std::abs(turn_rad) < kCornerAngle_rad) return false;
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
  // The arc y = c0 + c1 x + c2 (x^2 + y^2), x along the chord, which is exact for circles.
  const Eigen::Vector2d x_axis = (points_m_[end] - points_m_[first]).normalized();
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  const auto local = [&](std::size_t i) -> Eigen::Vector2d {
    const Eigen::Vector2d v = points_m_[i] - middle_m;
    return {x_axis.dot(v), left_of(x_axis).dot(v)};
  };
  for (std::size_t i = first;; i = next(i)) {
    const Eigen::Vector2d p = local(i);
    const Eigen::Vector3d row(1.0, p.x(), p.squaredNorm());
    const double w = misfit_weight(weights_[i]) * misfit_weight(weights_[i]);
    A += w * row * row.transpose();
    rhs += w * p.y() * row;
    if (i == end) break;
  }
  const Eigen::Vector3d c = A.ldlt().solve(rhs);
  double arc_chi2 = 0.0;
  for (std::size_t i = first;; i = next(i)) {
    const Eigen::Vector2d p = local(i);
    const double e = p.y() - c(0) - c(1) * p.x() - c(2) * p.squaredNorm();
    const Eigen::Vector2d gradient(c(1) + 2.0 * c(2) * p.x(), 1.0 - 2.0 * c(2) * p.y());
    arc_chi2 += std::min(
        misfit_weight(weights_[i]) * misfit_weight(weights_[i]) * e * e / std::max(gradient.squaredNorm(), 0.04),
        kMostChi2);
    if (i == end) break;
  }
  const double gain = window_m < kCornerWindow_m ? kShortCornerGain : kCornerGain;
  if (arc_chi2 < lines_chi2 + gain || arc_chi2 < 1.5 * lines_chi2) return false;
  // Where the lines meet.
  const double along_m = left_of(b.along).dot(b.mean - a.mean) / left_of(b.along).dot(a.along);
  const Eigen::Vector2d crossing_m = a.mean + along_m * a.along;
  const double reach_m = way_m(last, start) + 0.25 * window_m;
  if (crossing_m.norm() > reach_m) return false;
  corner = {s_m_[last] + 0.5 * way_m(last, start),
            middle_m + crossing_m,
            yaw_of(a.along),
            yaw_of(b.along),
            arc_chi2 - lines_chi2,
            window_m};
  return true;
}

void SplinegonFit::find_corners() {
  corners_.clear();
  candidates_.clear();
  for (std::size_t i = 0; i + (closed_ ? 0 : 1) < points_m_.size(); ++i) {
    Corner corner;
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
        if (std::abs(closed_ ? std::remainder(d_m, perimeter_m_) : d_m) >= kCornerWindow_m) break;
        const double apart_m = (candidates_[i].p_m - candidates_[best].p_m).norm();
        if (apart_m < kCornersApart * kCornerWindow_m) candidates_[i].score = 0.0;
      }
    };
    forget_near(1);
    forget_near(count - 1);
  }
  std::sort(corners_.begin(), corners_.end(), [](const Corner& a, const Corner& b) { return a.s_m < b.s_m; });
}

/// Whether one arc meets the elements from one to before another, which may be beyond the last.
bool SplinegonFit::is_arc(std::size_t begin, std::size_t end) const {
  const std::size_t n = points_m_.size();
  const Eigen::Vector2d from_m = points_m_[begin % n], way_m = points_m_[(end - 1) % n] - from_m;
  const double chord_m = way_m.norm();
  if (chord_m < 1e-9) return false;
  const Eigen::Vector2d axis = way_m / chord_m;
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  const auto distance_m = [&](const Eigen::Vector2d& p) {  // y = c0 + c1 x + c2 (x^2 + y^2)
    const Eigen::Vector2d gradient(c(1) + 2.0 * c(2) * p.x(), 1.0 - 2.0 * c(2) * p.y());
    return (p.y() - c(0) - c(1) * p.x() - c(2) * p.squaredNorm()) / std::max(gradient.norm(), 0.3);
  };
  const auto local = [&](std::size_t i) -> Eigen::Vector2d {
    const Eigen::Vector2d v = points_m_[i % n] - from_m;
    return {axis.dot(v), left_of(axis).dot(v)};
  };
  for (int round = 0; round < 2; ++round) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d p = local(i);
      double weight = weights_[i % n] * weights_[i % n];
      if (round > 0) {
        const double sigmas = std::abs(distance_m(p)) * weights_[i % n];
        weight *= std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
      }
      const Eigen::Vector3d row(1.0, p.x(), p.squaredNorm());
      A += weight * row * row.transpose();
      rhs += weight * p.y() * row;
    }
    c = A.ldlt().solve(rhs);
    if (!c.allFinite()) return false;
  }
  double products = 0.0, weights = 0.0, before = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    const double weight = misfit_weight(weights_[i % n]);
    const double sigmas = std::clamp(distance_m(local(i)) * weight, -kMostSigmas, kMostSigmas);
    products += sigmas * before;
    weights += weight;
    before = sigmas;
  }
  return !have_misfit_in_common(products, static_cast<double>(end - begin), weights);
}

/// Corners, and between them the places at which one arc meets the elements no longer, along the polygon of the
/// elements.
void SplinegonFit::find_arcs() {
  const std::size_t n = points_m_.size();
  arc_ends_.clear();
  const auto add_piece = [&](std::size_t begin, std::size_t end) {
    for (std::size_t from = begin; from < end;) {
      std::size_t sure = std::min(from + kElementsOfVertex, end), wrong = end + 1;
      for (std::size_t step = kElementsOfVertex; sure < end && wrong > end; step *= 2) {
        const std::size_t next = std::min(sure + step, end);
        (is_arc(from, next) ? sure : wrong) = next;
      }
      while (wrong <= end && wrong - sure > 1) {
        const std::size_t middle = sure + (wrong - sure) / 2;
        (is_arc(from, middle) ? sure : wrong) = middle;
      }
      from = sure;
      if (end - from < kElementsOfVertex) break;  // too few for one of their own
      const double s_m = 0.5 * (s_m_[(from + n - 1) % n] + (from % n > 0 ? s_m_[from % n] : perimeter_m_));
      arc_ends_.push_back({s_m, kNoCorner});
    }
  };
  const auto first_at = [&](double s_m) {
    return static_cast<std::size_t>(std::lower_bound(s_m_.begin(), s_m_.end(), s_m) - s_m_.begin());
  };
  if (corners_.empty()) {
    if (closed_) arc_ends_.push_back({0.0, kNoCorner});
    add_piece(0, n);
    return;
  }
  if (!closed_) add_piece(0, first_at(corners_.front().s_m));
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    arc_ends_.push_back({corners_[c].s_m, c});
    const bool is_last = c + 1 == corners_.size();
    if (is_last && !closed_) {
      add_piece(first_at(corners_[c].s_m), n);
    } else {
      add_piece(first_at(corners_[c].s_m),
                is_last ? n + first_at(corners_.front().s_m) : first_at(corners_[c + 1].s_m));
    }
  }
  std::sort(arc_ends_.begin(), arc_ends_.end(), [](const Station& a, const Station& b) { return a.s_m < b.s_m; });
}

/// Stations of `count` nodes from `from_s` to `to_s`, of a closed boundary the same place, between those that are set
/// in stations_m_: the corners. Equal parts of share_, which is one density for each cell_s_m_.
void SplinegonFit::share_out(std::size_t count, double from_s, double to_s) {
  // Share of the boundary up to a place: of the cells before that where it is, which is the last one that begins before
  // it, and of a part of that one.
  const auto begin_of = [&](std::size_t c) { return c == 0 && !closed_ ? -1e9 : cell_s_m_[c]; };
  const auto share_of = [&](std::size_t c, double s) {
    const double end = c + 1 == share_.size() && !closed_ ? 1e9 : cell_s_m_[c + 1];
    return share_[c] * (std::min(s, end) - std::max(begin_of(c), cell_s_m_[0]));
  };
  share_before_.assign(1, 0.0);
  for (std::size_t c = 0; c + 1 < share_.size(); ++c) {
    share_before_.push_back(share_before_.back() + share_of(c, cell_s_m_[c + 1]));
  }
  const auto amount = [&](double s) {
    const auto last = cell_s_m_.begin() + static_cast<std::ptrdiff_t>(share_.size());
    const auto after = static_cast<std::size_t>(std::lower_bound(cell_s_m_.begin(), last, s) - cell_s_m_.begin());
    const std::size_t c = after > 0 ? after - 1 : 0;
    return share_before_[c] + share_of(c, s);
  };
  const double whole = closed_ ? amount(to_s) : 0.0;
  const auto amount_wrapped = [&](double s) { return closed_ && s > to_s ? whole + amount(s - to_s) : amount(s); };
  const auto place_of = [&](double wanted, double low, double high) {
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (amount_wrapped(middle) < wanted ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  pieces_.clear();
  if (closed_) {
    if (stations_.empty()) stations_.push_back({from_s, kNoCorner});
    for (std::size_t i = 0; i < stations_.size(); ++i) {
      const double end = i + 1 < stations_.size() ? stations_[i + 1].s_m : stations_[0].s_m + (to_s - from_s);
      pieces_.push_back({stations_[i], end, 0.0, 1});
    }
  } else {
    Station at{from_s, kNoCorner};
    for (const Station& station : stations_) {
      pieces_.push_back({at, station.s_m, 0.0, 1});
      at = station;
    }
    pieces_.push_back({at, to_s, 0.0, 1});
  }
  const std::size_t intervals = closed_ ? count : count - 1;
  for (Piece& piece : pieces_) piece.amount = amount_wrapped(piece.end_s_m) - amount_wrapped(piece.begin.s_m);
  for (std::size_t used = pieces_.size(); used < intervals; ++used) {
    const auto coarser = [](const Piece& a, const Piece& b) {
      return a.amount * static_cast<double>(b.intervals) < b.amount * static_cast<double>(a.intervals);
    };
    ++std::max_element(pieces_.begin(), pieces_.end(), coarser)->intervals;
  }
  stations_.clear();
  for (const Piece& piece : pieces_) {
    stations_.push_back(piece.begin);
    const double begin = amount_wrapped(piece.begin.s_m);
    for (std::size_t i = 1; i < piece.intervals; ++i) {
      const double wanted = begin + piece.amount * static_cast<double>(i) / static_cast<double>(piece.intervals);
      stations_.push_back({place_of(wanted, piece.begin.s_m, piece.end_s_m), kNoCorner});
    }
  }
  if (!closed_) stations_.push_back({to_s, kNoCorner});
}

/// The first placing: nodes evenly along the polygon of the elements, or, where those are too few, where arcs end.
void SplinegonFit::place_on_elements() {
  const std::size_t n = points_m_.size();
  const std::size_t count = wanted_nodes();
  find_arcs();
  stations_.clear();
  if (arc_ends_.size() + (closed_ ? 0 : 2) > count) {
    if (!closed_) stations_.push_back({0.0, kNoCorner});
    stations_.insert(stations_.end(), arc_ends_.begin(), arc_ends_.end());
    if (!closed_) stations_.push_back({perimeter_m_, kNoCorner});
  } else {
    cell_s_m_.assign(1, 0.0);
    share_.clear();
    const auto add_cell = [&](double end_m, double share) {
      if (end_m <= cell_s_m_.back()) return;
      cell_s_m_.push_back(end_m);
      share_.push_back(share);
    };
    for (const Gap& gap : gaps_) {
      add_cell(s_m_[gap.last], 1.0);
      add_cell(gap.next > 0 ? s_m_[gap.next] : perimeter_m_, kGapShare);
    }
    add_cell(perimeter_m_, 1.0);
    for (std::size_t c = 0; c < corners_.size(); ++c) stations_.push_back({corners_[c].s_m, c});
    share_out(count, 0.0, perimeter_m_);
  }
  nodes_.clear();
  for (std::size_t at = 0; at < stations_.size(); ++at) {
    const Station& station = stations_[at];
    if (station.corner != kNoCorner) {
      const Corner& corner = corners_[station.corner];
      nodes_.push_back({corner.p_m, corner.yaw_in_rad, corner.yaw_out_rad, true, corner.p_m});
      continue;
    }
    const double s_m = closed_ ? std::fmod(station.s_m, perimeter_m_) : station.s_m;
    const auto upper = static_cast<std::size_t>(std::upper_bound(s_m_.begin(), s_m_.end(), s_m) - s_m_.begin());
    const std::size_t below = upper > 0 ? upper - 1 : 0;
    const std::size_t above = upper < n ? upper : (closed_ ? 0 : n - 1);
    const auto away_m = [&](std::size_t i) {  // along the boundary, signed
      const double d_m = s_m_[i] - s_m;
      return closed_ ? std::remainder(d_m, perimeter_m_) : d_m;
    };
    double low_m = -1.0, high_m = 1.0;  // a third of the way to the next ones
    const auto way_to_m = [&](std::size_t other) {
      const double d_m = stations_[other].s_m - station.s_m;
      return closed_ ? std::remainder(d_m, perimeter_m_) : d_m;
    };
    if (at > 0 || closed_)
      low_m = std::max(low_m, -0.3 * std::abs(way_to_m((at + stations_.size() - 1) % stations_.size())));
    if (at + 1 < stations_.size() || closed_)
      high_m = std::min(high_m, 0.3 * std::abs(way_to_m((at + 1) % stations_.size())));
    low_m = std::min(low_m, -0.05);
    high_m = std::max(high_m, 0.05);
    LineSums sums;
    std::size_t first = below, last = below;
    for (std::size_t k = 0, i = below; k<n / 2; ++k, i = i> 0 ? i - 1 : n - 1) {
      if (away_m(i) < low_m || away_m(i) > high_m) break;
      sums.add(points_m_[i], weights_[i] * weights_[i]);
      first = i;
      if (!closed_ && i == 0) break;
    }
    for (std::size_t k = 0, i = above; k < n / 2 && i != below; ++k, i = i + 1 < n ? i + 1 : 0) {
      if (away_m(i) < low_m || away_m(i) > high_m) break;
      sums.add(points_m_[i], weights_[i] * weights_[i]);
      last = i;
      if (!closed_ && i + 1 == n) break;
    }
    Node node{};
    if (sums.n >= 3 && (points_m_[last] - points_m_[first]).norm() > 0.25 * (high_m - low_m)) {
      LineSums::Line line = sums.line();
      if (line.along.dot(points_m_[last] - points_m_[first]) < 0.0) line.along = -line.along;
      const Eigen::Vector2d at_m =
          points_m_[below] +
          (above == below ? 0.0
                          : std::clamp(-away_m(below) / std::max(away_m(above) - away_m(below), 1e-9), 0.0, 1.0)) *
              (points_m_[above] - points_m_[below]);
      node.p_m = line.mean + line.along * line.along.dot(at_m - line.mean);
      node.yaw_in_rad = yaw_of(line.along);
    } else {  // in a gap
      const std::size_t from = below == above ? (below > 0 ? below - 1 : below) : below;
      const std::size_t to = below == above && below == 0 ? 1 : above;
      const double edge_m = std::max((points_m_[to] - points_m_[from]).norm(), 1e-9);
      node.p_m = points_m_[from] + (points_m_[to] - points_m_[from]) * std::clamp(-away_m(from) / edge_m, 0.0, 1.0);
      node.yaw_in_rad = yaw_of(points_m_[to] - points_m_[from]);
    }
    node.yaw_out_rad = node.yaw_in_rad;
    node.found_m = node.p_m;
    nodes_.push_back(node);
  }
  compute_arcs();
  // Elements are of the half biarc that they are in.
  arc_of_.resize(n);
  assign_by_stations(s_m_, perimeter_m_);
}

/// `at_m`: place of each element along the boundary, where the nodes have their stations.
void SplinegonFit::assign_by_stations(const std::vector<double>& at_m, double whole_m) {
  for (std::size_t i = 0; i < at_m.size(); ++i) {
    double s_m = at_m[i];
    if (closed_ && s_m < stations_[0].s_m) s_m += whole_m;
    const auto after = std::upper_bound(stations_.begin(), stations_.end(), s_m,
                                        [](double s, const Station& station) { return s < station.s_m; });
    const auto upper = static_cast<std::size_t>(after - stations_.begin());
    const std::size_t k = std::min(upper > 0 ? upper - 1 : 0, biarcs() - 1);
    const double end_m = k + 1 < stations_.size() ? stations_[k + 1].s_m : stations_[0].s_m + whole_m;
    arc_of_[i] = 2 * k + (s_m > 0.5 * (stations_[k].s_m + end_m) ? 1 : 0);
  }
}

/// Begins with an earlier fit; false if it is not of this boundary as it is now.
bool SplinegonFit::place_on_earlier(const std::vector<SplinegonVertex>& vertices) {
  if (vertices.size() < 3 || (vertices.size() % 2 == 0) != closed_) return false;
  const std::size_t count = (vertices.size() + 1) / 2;
  if (count < wanted_nodes() || count > std::max(points_m_.size() / kElementsOfVertex, kFewestOfClosed)) return false;
  nodes_.clear();
  for (std::size_t k = 0; k < count; ++k) {
    const SplinegonVertex& vertex = vertices[2 * k];
    const auto yaw_rad = [&](std::size_t arc, double sign) {  // at the begin or the end of an arc
      const Eigen::Vector2d chord =
          vertices[arc + 1 < vertices.size() ? arc + 1 : 0].p_world_m - vertices[arc].p_world_m;
      return yaw_of(chord) + sign * 2.0 * std::atan(vertices[arc].bulge);
    };
    Node node{vertex.p_world_m - origin_m_, 0.0, 0.0, vertex.corner, vertex.p_world_m - origin_m_};
    const bool has_out = closed_ || k + 1 < count, has_in = closed_ || k > 0;
    if (has_out) node.yaw_out_rad = yaw_rad(2 * k, -1.0);
    node.yaw_in_rad = has_in ? yaw_rad(k > 0 ? 2 * k - 1 : vertices.size() - 1, 1.0) : node.yaw_out_rad;
    if (!has_out || !node.corner) node.yaw_out_rad = node.yaw_in_rad;
    // The corners of a polygon may be beside each other where there is one.
    Node* const before = nodes_.empty() ? nullptr : &nodes_.back();
    if (before != nullptr && before->corner && node.corner &&
        (node.p_m - before->p_m).norm() < kCornersApart * kCornerWindow_m) {
      before->yaw_out_rad = node.yaw_out_rad;
      continue;
    }
    nodes_.push_back(node);
  }
  if (nodes_.size() < wanted_nodes()) return false;
  compute_arcs();
  if (!assign_nearest()) return false;
  missing_.clear();
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    const std::size_t biarc = arc_of_[element_after(corners_[c])] / 2;
    const auto is_here = [&](std::size_t k) {
      return nodes_[k].corner && (corners_[c].p_m - nodes_[k].p_m).norm() < 0.5 * kCornerWindow_m;
    };
    if (!is_here(biarc) && !is_here(next_node(biarc))) missing_.push_back(c);
  }
  const auto corners = static_cast<std::size_t>(
      std::count_if(nodes_.begin(), nodes_.end(), [](const Node& node) { return node.corner; }));
  if (nodes_.size() == wanted_nodes() ? !missing_.empty() || corners > corners_.size()
                                      : 4 * missing_.size() > corners_.size()) {
    return false;
  }
  if (!closed_) {
    // It must reach about as far as the elements.
    const double mean_m = perimeter_m_ / static_cast<double>(nodes_.size());
    if ((points_m_.front() - nodes_.front().p_m).norm() > mean_m ||
        (points_m_.back() - nodes_.back().p_m).norm() > mean_m) {
      return false;
    }
  }
  add_missing_corners();
  return true;
}

std::size_t SplinegonFit::element_after(const Corner& corner) const {
  const auto after = std::lower_bound(s_m_.begin(), s_m_.end(), corner.s_m) - s_m_.begin();
  return std::min(static_cast<std::size_t>(after), s_m_.size() - 1);
}

void SplinegonFit::add_missing_corners() {
  if (missing_.empty()) return;
  measure();
  keep_stations();
  for (const std::size_t c : missing_) {
    const Corner& corner = corners_[c];
    const double s_m = element_s_m_[element_after(corner)];
    const auto at = std::upper_bound(stations_.begin(), stations_.end(), s_m,
                                     [](double s, const Station& station) { return s < station.s_m; });
    stations_.insert(at, {s_m, nodes_.size()});
    nodes_.push_back({corner.p_m, corner.yaw_in_rad, corner.yaw_out_rad, true, corner.p_m});
  }
  place_at_stations();
}

/// Places the nodes anew on the fitted curve, each biarc with the same share of the third root of the curvature's
/// slope: its distance from a curve is proportional to slope and length^3.
void SplinegonFit::place_again() {
  measure();
  if (nodes_.size() > wanted_nodes()) {
    keep_stations();
  } else {
    share_out_again();
  }
  place_at_stations();
}

/// Along an arc from its begin to the point of its circle that is nearest to a place.
double SplinegonFit::way_to_foot_m(const Eigen::Vector2d& p_m, std::size_t index) const {
  const ArcOfNode& arc = arcs_[index];
  const Eigen::Vector2d v = p_m - arc.begin_m;
  const Eigen::Vector2d& along = index % 2 == 0 ? arc.along : arc.begin_along;  // of the arc at its begin
  const double a = along.dot(v), b = left_of(along).dot(v), kappa = arc.curvature_1pm;
  return std::abs(kappa) < 1e-9 ? a : std::atan2(kappa * a, 1.0 - kappa * b) / kappa;
}

/// Stations of the arcs, and of the elements.
void SplinegonFit::measure() {
  const std::size_t count = arcs_.size();
  const std::size_t n = points_m_.size();
  cell_s_m_.assign(1, 0.0);
  for (const ArcOfNode& arc : arcs_) cell_s_m_.push_back(cell_s_m_.back() + arc.length_m);
  element_s_m_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const ArcOfNode& arc = arcs_[arc_of_[i]];
    const double foot_m = way_to_foot_m(points_m_[i], arc_of_[i]);
    const double low_m = !closed_ && arc_of_[i] == 0 ? -1e9 : 0.0;
    const double high_m = !closed_ && arc_of_[i] + 1 == count ? 1e9 : arc.length_m;
    element_s_m_[i] = cell_s_m_[arc_of_[i]] + std::clamp(foot_m, low_m, high_m);
  }
}

/// All nodes where they are, but that the ends of an open boundary are those of the elements.
void SplinegonFit::keep_stations() {
  stations_.clear();
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const double break_rad = std::abs(wrap_to_pi(nodes_[k].yaw_out_rad - nodes_[k].yaw_in_rad));
    const bool is_corner = nodes_[k].corner && break_rad > kLeastBreak * kCornerAngle_rad;
    stations_.push_back({k < biarcs() ? cell_s_m_[2 * k] : cell_s_m_.back(), is_corner ? k : kNoCorner});
  }
  if (closed_) return;
  stations_.front() = {*std::min_element(element_s_m_.begin(), element_s_m_.end()), kNoCorner};
  stations_.back() = {*std::max_element(element_s_m_.begin(), element_s_m_.end()), kNoCorner};
  const auto is_beyond = [&](const Station& station) {
    return &station != &stations_.front() && &station != &stations_.back() &&
           (station.s_m <= stations_.front().s_m || station.s_m >= stations_.back().s_m);
  };
  stations_.erase(std::remove_if(stations_.begin(), stations_.end(), is_beyond), stations_.end());
}

void SplinegonFit::share_out_again() {
  const std::size_t count = arcs_.size();
  const double whole_m = cell_s_m_.back();
  arc_s_m_ = cell_s_m_;
  // Slope of the curvature at the begin of each arc.
  slope_.assign(count + 1, -1.0);
  for (std::size_t j = 0; j < count; ++j) {
    if (!is_smooth(j)) continue;
    const ArcOfNode& before = arcs_[j > 0 ? j - 1 : count - 1];
    slope_[j] = std::cbrt(2.0 * std::abs(arcs_[j].curvature_1pm - before.curvature_1pm) /
                          (arcs_[j].length_m + before.length_m));
  }
  slope_[count] = closed_ ? slope_[0] : -1.0;
  share_.assign(count, 0.0);
  double mean = 0.0;
  for (std::size_t j = 0; j < count; ++j) {
    const double at_begin = slope_[j], at_end = slope_[j + 1];
    share_[j] = at_begin < 0.0 ? std::max(at_end, 0.0) : at_end < 0.0 ? at_begin : 0.5 * (at_begin + at_end);
    mean += share_[j] * arcs_[j].length_m / whole_m;
  }
  const double least = std::max(mean, 1e-6) / (kSpacingRatio - 1.0);
  for (double& share : share_) share += least;
  thin_out_gaps();
  double from_m = 0.0, to_m = whole_m;
  if (!closed_) {
    from_m = *std::min_element(element_s_m_.begin(), element_s_m_.end());
    to_m = *std::max_element(element_s_m_.begin(), element_s_m_.end());
  }
  stations_.clear();
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    // Where the fit hardly breaks there is no corner.
    const Node& node = nodes_[k];
    const double break_rad = wrap_to_pi(node.yaw_out_rad - node.yaw_in_rad);
    if (node.corner && std::abs(break_rad) > kLeastBreak * kCornerAngle_rad) {
      stations_.push_back({cell_s_m_[2 * k], k});
    }
  }
  share_out(nodes_.size(), from_m, to_m);
  cell_s_m_ = arc_s_m_;
}

/// Nodes at the stations, on the fitted curve.
void SplinegonFit::place_at_stations() {
  const std::size_t count = arcs_.size();
  const double whole_m = cell_s_m_.back();
  std::swap(nodes_, nodes_before_);
  nodes_.clear();
  for (const Station& station : stations_) {
    if (station.corner != kNoCorner) {
      nodes_.push_back(nodes_before_[station.corner]);
      continue;
    }
    const double s_m = closed_ && station.s_m >= whole_m ? station.s_m - whole_m : station.s_m;
    const auto after =
        static_cast<std::size_t>(std::upper_bound(cell_s_m_.begin(), cell_s_m_.end(), s_m) - cell_s_m_.begin());
    const std::size_t j = std::min(after > 0 ? after - 1 : 0, count - 1);
    const double on_m = s_m - cell_s_m_[j];
    const ArcOfNode& arc = arcs_[j];
    const double yaw_rad = arc.begin_yaw_rad + arc.curvature_1pm * on_m;
    const Eigen::Vector2d p_m = point_on(arc.begin_m, arc.begin_yaw_rad, arc.curvature_1pm, on_m);
    nodes_.push_back({p_m, yaw_rad, yaw_rad, false, p_m});
  }
  assign_by_stations(element_s_m_, whole_m);
  compute_arcs();
}

/// Products of neighbours' residuals of each biarc.
void SplinegonFit::sum_residuals() {
  residuals_.assign(biarcs(), {});
  double before = 0.0, before_m = 0.0;
  std::size_t biarc_before = biarcs();
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    const std::size_t biarc = arc_of_[i] / 2;
    const double distance_m = of_elements_[i].distance_m;
    const double sigmas = std::clamp(distance_m * misfit_weight(weights_[i]), -kMostSigmas, kMostSigmas);
    Residuals& sums = residuals_[biarc];
    if (biarc == biarc_before) sums.products += sigmas * before;
    const double pair_m = std::min(std::abs(distance_m), before_m);
    if (follow_tips_ && i > 0 && pair_m * weights_[i] > kPairSigmas) {
      for (const std::size_t of : {biarc, biarc_before}) {
        residuals_[of].pair_m = std::max(residuals_[of].pair_m, pair_m);
      }
    }
    sums.elements += 1.0;
    sums.weights += misfit_weight(weights_[i]);
    sums.squares_m2 += distance_m * distance_m;
    if (sums.elements == 1.0) sums.first = i;
    sums.last = i;
    before = sigmas;
    before_m = std::abs(distance_m);
    biarc_before = biarc;
  }
}

bool SplinegonFit::is_misfit(const Residuals& sums) {
  return sums.pair_m > kLeastPair_m || have_misfit_in_common(sums.products, sums.elements, sums.weights);
}

/// Parts the biarcs that do not follow the boundary and have elements for it; whether there are any.
bool SplinegonFit::part_misfits() {
  sum_residuals();
  if (std::none_of(residuals_.begin(), residuals_.end(), is_misfit)) return false;
  measure();
  const double whole_m = cell_s_m_.back();
  keep_stations();
  const std::size_t biarcs_before = biarcs();
  std::swap(stations_, arc_ends_);
  stations_.clear();
  bool parted = false;
  const bool is_whole = arc_ends_.size() == nodes_.size();  // else an end was cut off
  for (std::size_t at = 0; at < arc_ends_.size(); ++at) {
    stations_.push_back(arc_ends_[at]);
    if (!is_whole || at == biarcs_before) continue;
    const Residuals& sums = residuals_[at];
    if (!is_misfit(sums)) continue;
    const double from_m = arc_ends_[at].s_m;
    const double to_m = at + 1 < arc_ends_.size() ? arc_ends_[at + 1].s_m : whole_m;
    const double common = std::sqrt(std::max(sums.products, 0.0) / sums.elements);
    const double most = std::min(kMostParts, std::floor(sums.elements / static_cast<double>(kElementsOfVertex)));
    const double parts = std::min(std::max(std::ceil(std::cbrt(2.0 * common)), 2.0), most);
    for (double part = 1.0; part < parts; part += 1.0) {
      stations_.push_back({from_m + part / parts * (to_m - from_m), kNoCorner});
    }
    parted |= parts >= 2.0;
  }
  if (is_whole && !parted) return false;
  place_at_stations();
  return true;
}

/// Lowers the density of main vertices where there are no elements.
void SplinegonFit::thin_out_gaps() {
  const double whole_m = cell_s_m_.back();
  const auto thin_out = [&](double from_m, double to_m) {
    for (const double at_m : {from_m, to_m}) {  // cells end there
      const auto upper = std::upper_bound(cell_s_m_.begin(), cell_s_m_.end(), at_m);
      if (upper == cell_s_m_.begin() || upper == cell_s_m_.end() || *(upper - 1) == at_m) continue;
      const auto cell = upper - cell_s_m_.begin() - 1;
      share_.insert(share_.begin() + cell, share_[static_cast<std::size_t>(cell)]);
      cell_s_m_.insert(upper, at_m);
    }
    for (std::size_t c = 0; c < share_.size(); ++c) {
      if (cell_s_m_[c] >= from_m && cell_s_m_[c + 1] <= to_m) share_[c] = kGapShare;
    }
  };
  for (const Gap& gap : gaps_) {
    const double from_m = element_s_m_[gap.last], to_m = element_s_m_[gap.next];
    if (from_m < to_m) {
      thin_out(from_m, to_m);
    } else if (closed_ && from_m > to_m + 0.5 * whole_m) {
      thin_out(from_m, whole_m);
      thin_out(0.0, to_m);
    }
  }
}

/// Whether the arc's begin has one tangent and an arc before it.
bool SplinegonFit::is_smooth(std::size_t arc) const {
  return arc % 2 == 1 || ((closed_ || arc > 0) && !nodes_[arc / 2].corner);
}

void SplinegonFit::compute_arcs() {
  arcs_.resize(2 * biarcs());
  Eigen::Vector2d along_out = unit(nodes_[0].yaw_out_rad);
  for (std::size_t k = 0; k < biarcs(); ++k) {
    const Node& from = nodes_[k];
    const Node& to = nodes_[next_node(k)];
    const Biarc biarc = equal_chord_biarc({from.p_m, from.yaw_out_rad}, {to.p_m, to.yaw_in_rad});
    const Eigen::Vector2d chord_m = to.p_m - from.p_m;
    const double c_m = chord_m.norm();
    const Eigen::Vector2d u = chord_m / c_m, n = left_of(u);
    // kappa0 = 4 sin(A) cos(D) / c, kappa1 = 4 sin(B) cos(D) / c with half sweeps A = -(3 theta0 + theta1) / 4,
    // B = (theta0 + 3 theta1) / 4, and D = (theta1 - theta0) / 4.
    const double A = 0.5 * biarc.sweep0_rad, B = 0.5 * biarc.sweep1_rad;
    const double D = 0.5 * (A + B);
    const double cos_D = std::cos(D), sin_D = std::sin(D);
    const auto fill = [&](ArcOfNode& arc, double half_rad, double by_theta0, double by_theta1) {
      const double cos_h = std::cos(half_rad), sin_h = std::sin(half_rad);
      const double kappa = 4.0 * sin_h * cos_D / c_m;
      const double k0 = 4.0 / c_m * (by_theta0 * cos_h * cos_D + 0.25 * sin_h * sin_D);
      const double k1 = 4.0 / c_m * (by_theta1 * cos_h * cos_D - 0.25 * sin_h * sin_D);
      const Eigen::Vector2d by_to = -(k0 + k1) / c_m * n - kappa / c_m * u;
      arc.curvature_1pm = kappa;
      arc.curvature_slope << -by_to, k0, by_to, k1;
      arc.length_m = biarc.chord_m / sinc(half_rad);
    };
    ArcOfNode& first = arcs_[2 * k];
    ArcOfNode& second = arcs_[2 * k + 1];
    fill(first, A, -0.75, -0.25);
    fill(second, B, 0.25, 0.75);
    first.p_m = first.begin_m = from.p_m;
    first.begin_yaw_rad = from.yaw_out_rad;
    first.along = along_out;
    second.p_m = to.p_m;
    second.along = unit(to.yaw_in_rad);
    second.begin_m = biarc.joint.translation_m;
    second.begin_yaw_rad = biarc.joint.yaw_rad;
    first.begin_along = from.yaw_in_rad == from.yaw_out_rad
                            ? first.along
                            : unit(0.5 * wrap_to_pi(from.yaw_in_rad - from.yaw_out_rad) + from.yaw_out_rad);
    second.begin_along = unit(biarc.joint.yaw_rad);
    along_out = to.yaw_in_rad == to.yaw_out_rad ? second.along : unit(to.yaw_out_rad);
  }
}

/// For the first time: the arc with the nearest chord that has the element's free side, of those near that of the
/// element before if that is near enough. False if hardly any is.
bool SplinegonFit::assign_nearest() {
  const std::size_t count = arcs_.size();
  arc_of_.resize(points_m_.size());
  std::size_t at = 0, searches = 0;
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    double least_m2 = std::numeric_limits<double>::infinity();
    const auto look_at = [&](std::size_t j) {
      const Eigen::Vector2d begin_m = arcs_[j].begin_m;
      const Eigen::Vector2d chord_m = (j % 2 == 0 ? arcs_[j + 1].begin_m : nodes_[next_node(j / 2)].p_m) - begin_m;
      const Eigen::Vector2d v = points_m_[i] - begin_m;
      const double part = std::clamp(v.dot(chord_m) / std::max(chord_m.squaredNorm(), 1e-12), 0.0, 1.0);
      const bool other_side = left_of(chord_m).dot(normals_[i]) > 0.0;
      const double distance_m2 = (v - part * chord_m).squaredNorm() + (other_side ? 1.0 : 0.0);
      if (distance_m2 < least_m2) {
        least_m2 = distance_m2;
        arc_of_[i] = j;
      }
    };
    if (i > 0) {
      for (std::size_t k = 0; k <= 2 * kNearArcs; ++k) {
        const std::size_t j = at + count + k;
        const bool is_there = j >= count + kNearArcs && j < 2 * count + kNearArcs;
        if (is_there) {
          look_at(j - count - kNearArcs);
        } else if (closed_) {
          look_at((j - kNearArcs) % count);
        }
      }
    }
    if (least_m2 > kNear_m * kNear_m) {
      if (++searches > kMostSearches) return false;
      for (std::size_t j = 0; j < count; ++j) look_at(j);
    }
    at = arc_of_[i];
  }
  return true;
}

/// From the arc where an element was to a neighbour, if it lies beyond the normal at its end.
void SplinegonFit::assign_stepwise() {
  const std::size_t count = arcs_.size();
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    for (int k = 0; k < 2; ++k) {
      const std::size_t j = arc_of_[i];
      const bool has_before = closed_ || j > 0, has_after = closed_ || j + 1 < count;
      const std::size_t after = j + 1 < count ? j + 1 : 0;
      if (has_before && arcs_[j].begin_along.dot(points_m_[i] - arcs_[j].begin_m) < 0.0) {
        arc_of_[i] = j > 0 ? j - 1 : count - 1;
      } else if (has_after && arcs_[after].begin_along.dot(points_m_[i] - arcs_[after].begin_m) >= 0.0) {
        arc_of_[i] = after;
      } else {
        break;
      }
    }
  }
}

/// The expected jumps of the curvature: those of the fit, smoothed along the boundary, and a small one that does not
/// matter; before there is a fit, such as may be anywhere. A piece between corners whose elements one arc meets as well
/// has none.
void SplinegonFit::expect_jumps(bool first) {
  const std::size_t count = arcs_.size();
  jump_sigma_.resize(count);
  const auto before = [&](std::size_t j) { return j > 0 ? j - 1 : count - 1; };
  const auto least = [&](std::size_t j) {
    const double length_m = arcs_[j].length_m + arcs_[before(j)].length_m;
    return kLeastJumpEffect_m / (kJumpEffect * length_m * length_m);
  };
  for (std::size_t j = 0; j < count; ++j) {
    if (first) {
      jump_sigma_[j] = 2.0 / (arcs_[j].length_m + arcs_[before(j)].length_m);
      continue;
    }
    double sum = 0.0, number = 0.0;
    for (const std::size_t other : {before(j), j, j + 1 < count ? j + 1 : 0}) {
      if (!is_smooth(other)) continue;
      const double jump = arcs_[other].curvature_1pm - arcs_[before(other)].curvature_1pm;
      sum += jump * jump;
      number += 1.0;
    }
    jump_sigma_[j] = std::sqrt(kJumpShare * sum / std::max(number, 1.0) + least(j) * least(j));
  }
  compute_residuals();
  if (first) return;
  first_of_.assign(count, points_m_.size());
  last_of_.assign(count, 0);
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    first_of_[arc_of_[i]] = std::min(first_of_[arc_of_[i]], i);
    last_of_[arc_of_[i]] = i;
  }
  parameters_ = closed_ ? 0.0 : 2.0;
  for (const Node& node : nodes_) parameters_ += node.corner ? 2.0 : 0.0;
  // Pieces begin at corners, else at the first arc.
  std::size_t start = 0;
  while (start < count && is_smooth(start)) ++start;
  if (start == count) start = 0;
  for (std::size_t done = 0; done < count;) {
    const std::size_t begin = (start + done) % count;
    std::size_t arcs = 1;
    while (done + arcs < count && is_smooth((begin + arcs) % count)) ++arcs;
    if (is_one_arc(begin, arcs)) {
      parameters_ += start == begin && arcs == count && is_smooth(begin) ? 3.0 : 1.0;
      for (std::size_t a = 0; a < arcs; ++a) jump_sigma_[(begin + a) % count] = 0.01 * least((begin + a) % count);
    } else {
      parameters_ += static_cast<double>(arcs);
    }
    done += arcs;
  }
}

/// Whether one arc meets the elements of a number of arcs, which is a piece between corners or ends or all of a closed
/// boundary, as well as the fit does, but for what its more parameters take from noise.
bool SplinegonFit::is_one_arc(std::size_t begin, std::size_t arcs) const {
  const std::size_t count = arcs_.size();
  const bool ring = closed_ && arcs == count && is_smooth(begin);
  const auto is_in = [&](std::size_t i) {
    return (arc_of_[i] >= begin ? arc_of_[i] - begin : arc_of_[i] + count - begin) < arcs;
  };
  // y = c0 + c1 x + c2 (x^2 + y^2), x along the piece; of a ring x^2 + y^2 = c0 + c1 x + c2 y. Both are circles.
  const Node& from = nodes_[begin / 2];
  const Eigen::Vector2d way_m = nodes_[(begin + arcs) / 2 % nodes_.size()].p_m - from.p_m;
  const Eigen::Vector2d axis = ring || way_m.norm() < 1e-6 ? Eigen::Vector2d(1.0, 0.0) : way_m.normalized();
  const auto local = [&](std::size_t i) -> Eigen::Vector2d {
    const Eigen::Vector2d v = points_m_[i] - from.p_m;
    return {axis.dot(v), left_of(axis).dot(v)};
  };
  std::size_t first = points_m_.size(), last = 0;
  for (std::size_t a = 0; a < arcs; ++a) {
    first = std::min(first, first_of_[(begin + a) % count]);
    last = std::max(last, last_of_[(begin + a) % count]);
  }
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  std::size_t elements = 0;
  double fit_chi2 = 0.0;
  for (std::size_t i = first; i <= last && i < points_m_.size(); ++i) {
    if (!is_in(i)) continue;
    const Eigen::Vector2d p = local(i);
    const double sigmas = std::abs(of_elements_[i].distance_m) * weights_[i];
    const double weight = weights_[i] * weights_[i] * std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
    const Eigen::Vector3d row =
        ring ? Eigen::Vector3d(1.0, p.x(), p.y()) : Eigen::Vector3d(1.0, p.x(), p.squaredNorm());
    A += weight * row * row.transpose();
    rhs += weight * (ring ? p.squaredNorm() : p.y()) * row;
    fit_chi2 += std::min(sigmas * sigmas, kMostChi2);
    ++elements;
  }
  if (elements < 4) return false;
  const Eigen::Vector3d c = A.ldlt().solve(rhs);
  double arc_chi2 = 0.0;
  for (std::size_t i = first; i <= last; ++i) {
    if (!is_in(i)) continue;
    const Eigen::Vector2d p = local(i);
    const double e = ring ? p.squaredNorm() - c(0) - c(1) * p.x() - c(2) * p.y()
                          : p.y() - c(0) - c(1) * p.x() - c(2) * p.squaredNorm();
    const Eigen::Vector2d gradient = ring ? Eigen::Vector2d(2.0 * p.x() - c(1), 2.0 * p.y() - c(2))
                                          : Eigen::Vector2d(c(1) + 2.0 * c(2) * p.x(), 1.0 - 2.0 * c(2) * p.y());
    arc_chi2 += std::min(weights_[i] * weights_[i] * e * e / std::max(gradient.squaredNorm(), 0.01), kMostChi2);
  }
  const double parameters = std::min(static_cast<double>(arcs) + (ring ? 0.0 : 2.0), static_cast<double>(elements));
  const double more = std::max(parameters - 3.0, 1.0);
  return arc_chi2 < fit_chi2 + more + kOneArcSigmas * std::sqrt(2.0 * more);
}

/// Signed distance to the arc's circle, positive to the left: d = (1 - S) / kappa with S^2 = 1 - 2 kappa b + kappa^2
/// (a^2 + b^2), where (a, b) is the point in the node's frame.
SplinegonFit::Residual SplinegonFit::residual_of(const Eigen::Vector2d& p_m, std::size_t index) const {
  const ArcOfNode& arc = arcs_[index];
  const Eigen::Vector2d v = p_m - arc.p_m, normal = left_of(arc.along);
  const double a = arc.along.dot(v), b = normal.dot(v), kappa = arc.curvature_1pm, squares = a * a + b * b;
  const double S = std::sqrt(std::max(1.0 - 2.0 * kappa * b + kappa * kappa * squares, 1e-6));
  const double d = (2.0 * b - kappa * squares) / (1.0 + S);
  Residual residual{d, (-0.5 * (squares - d * d) / S) * arc.curvature_slope};
  const Eigen::Vector2d normal_at_foot = (normal - kappa * v) / S;
  const Eigen::Index of_node = index % 2 == 0 ? 0 : 3;
  residual.slope.segment<2>(of_node) -= normal_at_foot;
  residual.slope(of_node + 2) -= a / S;
  return residual;
}

/// The residuals of all elements are set to those of the present arcs, each element at the arc that it is assigned to.
void SplinegonFit::compute_residuals() {
  of_elements_.resize(points_m_.size());
  for (std::size_t i = 0; i < points_m_.size(); ++i) of_elements_[i] = residual_of(points_m_[i], arc_of_[i]);
}

/// Adds what a slope by the places and yaws of a biarc's nodes is by the unknowns.
void SplinegonFit::add_to_row(const Vector6d& slope, std::size_t biarc) {
  const std::size_t next = next_node(biarc);
  const Unknowns& from = unknowns_of_[biarc];
  const Unknowns& to = unknowns_of_[next];
  row_(from.first) += from.along.dot(slope.segment<2>(0));
  row_(from.first + 1) += left_of(from.along).dot(slope.segment<2>(0));
  row_(from.first + (nodes_[biarc].corner ? 3 : 2)) += slope(2);
  row_(to.first) += to.along.dot(slope.segment<2>(3));
  row_(to.first + 1) += left_of(to.along).dot(slope.segment<2>(3));
  row_(to.first + 2) += slope(5);
}

/// Normal equations at the nodes, after compute_residuals(); returns the cost.
double SplinegonFit::build() {
  unknowns_of_.resize(nodes_.size());
  unknowns_ = 0;
  // Of a closed boundary in the order 0, n - 1, 1, n - 2 and so on: then what is near is near along both ways.
  const auto node_at = [&](std::size_t at) {
    return !closed_ ? at : at % 2 == 0 ? at / 2 : nodes_.size() - 1 - at / 2;
  };
  for (std::size_t at = 0; at < nodes_.size(); ++at) {
    const std::size_t k = node_at(at);
    const Node& node = nodes_[k];
    const bool has_one_tangent = node.yaw_in_rad == node.yaw_out_rad;
    unknowns_of_[k] = {unknowns_, has_one_tangent
                                      ? (k < biarcs() ? arcs_[2 * k] : arcs_[2 * k - 1]).along
                                      : unit(0.5 * wrap_to_pi(node.yaw_out_rad - node.yaw_in_rad) + node.yaw_in_rad)};
    unknowns_ += node.corner ? 4 : 3;
  }
  Eigen::Index below = 0;  // a node has to do with those beside it, and with those beside them
  for (std::size_t at = 0; at < nodes_.size(); ++at) {
    const std::size_t k = node_at(at), last = node_at(std::min(at + (closed_ ? 4 : 2), nodes_.size() - 1));
    below = std::max(below, unknowns_of_[last].first + unknowns_at(last) - 1 - unknowns_of_[k].first);
  }
  H_.reset(unknowns_, below);
  if (g_.size() < unknowns_ + 4) g_.resize(2 * unknowns_ + 4);
  if (row_.size() < unknowns_ + 4) {
    delta_.resize(2 * unknowns_ + 4);
    row_.setZero(2 * unknowns_ + 4);
  }
  g_.head(unknowns_).setZero();
  double cost = 0.0;
  // The elements' sums by places and yaws of the nodes, for each biarc.
  sums_.assign(biarcs(), {Matrix6d::Zero(), Vector6d::Zero(), 0});
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    const Residual& residual = of_elements_[i];
    const double sigmas = std::abs(residual.distance_m) * weights_[i];
    const double huber = std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
    cost += huber < 1.0 ? kHuberSigmas * (2.0 * sigmas - kHuberSigmas) : sigmas * sigmas;
    const Vector6d weighted = huber * weights_[i] * weights_[i] * residual.slope;
    Sums& sums = sums_[arc_of_[i] / 2];
    sums.H.noalias() += weighted * residual.slope.transpose();
    sums.g += residual.distance_m * weighted;
    ++sums.elements;
  }
  for (std::size_t k = 0; k < biarcs(); ++k) {
    add_sums(k);
    if (sums_[k].elements < kElementsOfArc && (nodes_[k].corner || nodes_[next_node(k)].corner)) cost += straighten(k);
  }
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    if (!nodes_[k].corner) continue;
    const Unknowns& of = unknowns_of_[k];
    const Eigen::Vector2d moved_m = nodes_[k].p_m - nodes_[k].found_m;
    constexpr double kWeight = 1.0 / (kCorner_m * kCorner_m);
    for (Eigen::Index i = 0; i < 2; ++i) {
      H_(of.first + i, of.first + i) += kWeight;
      g_(of.first + i) += kWeight * (i == 0 ? of.along : left_of(of.along)).dot(moved_m);
    }
    cost += kWeight * moved_m.squaredNorm();
  }
  for (std::size_t j = 0; j < arcs_.size(); ++j) {
    if (!is_smooth(j)) continue;
    const std::size_t before = j > 0 ? j - 1 : arcs_.size() - 1;
    const double jump = arcs_[j].curvature_1pm - arcs_[before].curvature_1pm;
    const double weight = 1.0 / (jump_sigma_[j] * jump_sigma_[j]);
    add_jump(before, j, jump, weight);
    cost += weight * jump * jump;
  }
  return cost;
}

/// Unknowns of the places and yaws of a biarc's nodes, and the derivatives of the ones by the others.
std::array<Eigen::Index, 6> SplinegonFit::unknowns_of_biarc(std::size_t biarc, Matrix6d& J) const {
  std::array<Eigen::Index, 6> index{};
  J.setZero();
  for (Eigen::Index end = 0; end < 2; ++end) {
    const std::size_t k = end == 0 ? biarc : next_node(biarc);
    const Unknowns& of = unknowns_of_[k];
    J.block<2, 1>(3 * end, 3 * end) = of.along;
    J.block<2, 1>(3 * end, 3 * end + 1) = left_of(of.along);
    J(3 * end + 2, 3 * end + 2) = 1.0;
    const auto at = static_cast<std::size_t>(3 * end);
    index[at] = of.first;
    index[at + 1] = of.first + 1;
    index[at + 2] = of.first + (end == 0 && nodes_[k].corner ? 3 : 2);
  }
  return index;
}

/// Adds the sums of a biarc's elements to the normal equations.
void SplinegonFit::add_sums(std::size_t biarc) {
  Matrix6d J;
  const std::array<Eigen::Index, 6> index = unknowns_of_biarc(biarc, J);
  // J^T H J and J^T g: J has a rotation for each node's place, and 1 for its yaw.
  const Sums& sums = sums_[biarc];
  Matrix6d rows, H;
  Vector6d g;
  for (const Eigen::Index node : {0, 3}) {
    const Eigen::Matrix2d R = J.block<2, 2>(node, node);
    rows.middleRows<2>(node).noalias() = R.transpose() * sums.H.middleRows<2>(node);
    rows.row(node + 2) = sums.H.row(node + 2);
    g.segment<2>(node).noalias() = R.transpose() * sums.g.segment<2>(node);
    g(node + 2) = sums.g(node + 2);
  }
  for (const Eigen::Index node : {0, 3}) {
    H.middleCols<2>(node).noalias() = rows.middleCols<2>(node) * J.block<2, 2>(node, node);
    H.col(node + 2) = rows.col(node + 2);
  }
  for (std::size_t a = 0; a < 6; ++a) {
    g_(index[a]) += g(static_cast<Eigen::Index>(a));
    for (std::size_t b = 0; b < 6; ++b) {
      if (index[b] <= index[a]) {
        H_(index[a], index[b]) += H(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      }
    }
  }
}

/// Adds the expectation that a biarc is straight, which hardly any element tells; returns its cost.
double SplinegonFit::straighten(std::size_t biarc) {
  double cost = 0.0;
  for (std::size_t j = 2 * biarc; j < 2 * biarc + 2; ++j) {
    const double length_m = arcs_[2 * biarc].length_m + arcs_[2 * biarc + 1].length_m;
    const double weight = std::pow(length_m * length_m / (8.0 * kStraight_m), 2);
    sums_[biarc].H.noalias() = weight * arcs_[j].curvature_slope * arcs_[j].curvature_slope.transpose();
    sums_[biarc].g.noalias() = weight * arcs_[j].curvature_1pm * arcs_[j].curvature_slope;
    add_sums(biarc);
    cost += weight * arcs_[j].curvature_1pm * arcs_[j].curvature_1pm;
  }
  return cost;
}

/// Adds the expectation of a jump of the curvature between two arcs.
void SplinegonFit::add_jump(std::size_t before, std::size_t after, double jump, double weight) {
  const std::size_t first = before / 2, second = after / 2;
  const std::array<std::size_t, 3> nodes{first, second, next_node(second)};
  const auto begin = static_cast<std::size_t>(first == second ? 1 : 0);
  for (std::size_t n = begin; n < 3; ++n) row_.segment(unknowns_of_[nodes[n]].first, 4).setZero();
  add_to_row(arcs_[after].curvature_slope, second);
  add_to_row(-arcs_[before].curvature_slope, first);
  for (std::size_t n = begin; n < 3; ++n) {
    for (Eigen::Index i = 0; i < unknowns_at(nodes[n]); ++i) {
      const Eigen::Index row = unknowns_of_[nodes[n]].first + i;
      g_(row) += weight * jump * row_(row);
      for (std::size_t m = begin; m < 3; ++m) {
        for (Eigen::Index k = 0; k < unknowns_at(nodes[m]); ++k) {
          const Eigen::Index column = unknowns_of_[nodes[m]].first + k;
          if (column <= row) H_(row, column) += weight * row_(row) * row_(column);
        }
      }
    }
  }
}

/// By how much more the fit varies than with independent elements, if their errors are correlated as the residuals of
/// neighbours: (1 + r) / (1 - r) for a first-order process.
double SplinegonFit::correlation_factor() const {
  double products = 0.0, squares = 0.0, before = 0.0;
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    const double sigmas = of_elements_[i].distance_m * weights_[i];
    const double clipped = std::clamp(sigmas, -3.0, 3.0);
    products += clipped * before;
    squares += clipped * clipped;
    before = clipped;
  }
  const double r = std::clamp(products / std::max(squares, 1e-12), 0.0, kMostCorrelation);
  return (1.0 + r) / (1.0 - r);
}

/// Adds what keeps main vertices from sliding along the boundary, and from turning where no element says how.
void SplinegonFit::hold(BandMatrix& H) const {
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    double length_m = 0.0;
    if (closed_ || k + 1 < nodes_.size()) length_m += arcs_[2 * k].length_m;
    if (closed_ || k > 0) length_m += arcs_[k > 0 ? 2 * k - 1 : arcs_.size() - 1].length_m;
    const bool end = !closed_ && (k == 0 || k + 1 == nodes_.size());
    const double step_m = (end ? 1e-6 : kAlongStep) * length_m;
    const Eigen::Index first = unknowns_of_[k].first;
    H(first, first) += 1.0 / (step_m * step_m);
    H(first + 1, first + 1) += kHoldAcross;
    for (Eigen::Index i = 2; i < unknowns_at(k); ++i) H(first + i, first + i) += kHoldYaw;
  }
}

void SplinegonFit::swap_with_before() {
  H_.swap(H_before_);
  g_.swap(g_before_);
  unknowns_of_.swap(unknowns_of_before_);
  arcs_.swap(arcs_before_);
  of_elements_.swap(of_elements_before_);
}

/// Main vertices that would pass each other stay where they were before the step.
void SplinegonFit::keep_order() {
  for (std::size_t k = 0; k < biarcs(); ++k) {
    Node& from = nodes_[k];
    Node& to = nodes_[next_node(k)];
    const Eigen::Vector2d& from_before_m = nodes_before_[k].p_m;
    const Eigen::Vector2d& to_before_m = nodes_before_[next_node(k)].p_m;
    const Eigen::Vector2d chord_m = to_before_m - from_before_m;
    if (chord_m.dot(to.p_m - from.p_m) >= kLeastOfChord * chord_m.squaredNorm()) continue;
    from.p_m = from_before_m;
    to.p_m = to_before_m;
  }
}

/// Levenberg-Marquardt, after expect_jumps(); returns the number of steps.
int SplinegonFit::iterate(int most) {
  double damping = 1e-4;
  double cost = build();
  int steps = 0;
  while (steps < most) {
    H_factor_ = H_;
    hold(H_factor_);
    H_factor_.scale_diagonal(1.0 + damping);
    H_factor_.factorize();
    delta_.head(unknowns_) = -g_.head(unknowns_);
    H_factor_.solve(delta_);
    nodes_before_ = nodes_;
    arc_of_before_ = arc_of_;
    double largest_m = 0.0;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      Node& node = nodes_[k];
      const Unknowns& of = unknowns_of_[k];
      const double limit_m =
          0.5 * (closed_ || k > 0 ? arcs_[k > 0 ? 2 * k - 1 : arcs_.size() - 1].length_m : arcs_[2 * k].length_m);
      const double along_m = std::clamp(delta_(of.first), -limit_m, limit_m);
      const double across_m = std::clamp(delta_(of.first + 1), -limit_m, limit_m);
      node.p_m += along_m * of.along + across_m * left_of(of.along);
      node.yaw_in_rad += std::clamp(delta_(of.first + 2), -0.5, 0.5);
      node.yaw_out_rad = node.corner ? node.yaw_out_rad + std::clamp(delta_(of.first + 3), -0.5, 0.5) : node.yaw_in_rad;
      largest_m = std::max({largest_m, std::abs(across_m), 0.02 * std::abs(along_m)});
    }
    keep_order();
    ++steps;
    swap_with_before();
    compute_arcs();
    assign_stepwise();
    compute_residuals();
    const double new_cost = build();
    if (!(new_cost <= cost * (1.0 + 1e-3) + 1.0)) {
      nodes_.swap(nodes_before_);
      arc_of_.swap(arc_of_before_);
      swap_with_before();
      damping = std::max(10.0 * damping, 0.1);
      continue;
    }
    cost = new_cost;
    damping *= 0.2;
    if (largest_m < kNoChange_m) break;
  }
  return steps;
}

/// Lengths of the largest gaps that biarcs are in.
void SplinegonFit::measure_gaps() {
  gap_m_.assign(biarcs(), 0.0);
  for (const Gap& gap : gaps_) {
    const std::size_t first = arc_of_[gap.last] / 2, last = arc_of_[gap.next] / 2;
    const double length_m = (points_m_[gap.next] - points_m_[gap.last]).norm();
    if (!closed_ && last < first) continue;
    for (std::size_t k = first;; k = k + 1 < biarcs() ? k + 1 : 0) {
      gap_m_[k] = std::max(gap_m_[k], length_m);
      if (k == last) break;
    }
  }
}

double SplinegonFit::chi2_per_freedom() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    const double sigmas = of_elements_[i].distance_m * weights_[i];
    sum += std::min(sigmas * sigmas, kMostChi2);
  }
  const auto elements = static_cast<double>(points_m_.size());
  return sum / std::max(elements - parameters_, elements / 3.0);
}

void SplinegonFit::write(double common_variance_m2, double scale, std::vector<SplinegonVertex>& vertices) {
  H_factor_ = H_;
  hold(H_factor_);
  H_factor_.scale_diagonal(1.0 + 1e-9);
  H_factor_.factorize();
  H_factor_.invert(covariance_);
  assign_nearest();  // stepwise, elements are behind where a main vertex has moved far
  compute_residuals();
  measure_gaps();
  sum_residuals();
  double turn_rad = 0.0, length_m = 0.0;
  for (const ArcOfNode& arc : arcs_) {
    turn_rad += std::abs(arc.curvature_1pm) * arc.length_m;
    length_m += arc.length_m;
  }
  const double mean_curvature_1pm = turn_rad / length_m;
  // What arcs cannot follow, and what they did not.
  const auto model_m2 = [&](std::size_t biarc) {
    const ArcOfNode& first = arcs_[2 * biarc];
    const ArcOfNode& second = arcs_[2 * biarc + 1];
    const double both_m = first.length_m + second.length_m;
    const double arcs_m = kJumpRms * std::abs(second.curvature_1pm - first.curvature_1pm) * both_m * both_m;
    const Residuals& sums = residuals_[biarc];
    double misfit_m2 = 0.0;
    if (is_misfit(sums)) misfit_m2 = sums.squares_m2 / sums.elements;
    return std::max(arcs_m * arcs_m, misfit_m2);
  };
  const auto node_vertex = [&](std::size_t k) {
    const Node& node = nodes_[k];
    const bool has_out = closed_ || k + 1 < nodes_.size(), has_in = closed_ || k > 0;
    const double before_m2 = model_m2(has_in ? (k > 0 ? k - 1 : biarcs() - 1) : k);
    const double after_m2 = model_m2(has_out ? k : k - 1);
    const auto across = [&](double yaw_rad) {
      const Eigen::Index first = unknowns_of_[k].first;
      const Eigen::Vector2d normal = left_of(unit(yaw_rad));
      const Eigen::Vector2d row(unknowns_of_[k].along.dot(normal), left_of(unknowns_of_[k].along).dot(normal));
      return scale *
             (row.x() * row.x() * covariance_(first, first) + row.y() * row.y() * covariance_(first + 1, first + 1) +
              2.0 * row.x() * row.y() * covariance_(first + 1, first));
    };
    double of_fit_m2 = across(node.yaw_in_rad);
    if (node.corner) of_fit_m2 = std::max(of_fit_m2, across(node.yaw_out_rad));
    const double of_model_m2 = 0.5 * (before_m2 + after_m2);
    SplinegonVertex vertex;
    vertex.p_world_m = (has_out ? begin_of(k) : node.p_m) + origin_m_;
    vertex.sigma_m = std::sqrt(of_fit_m2 + of_model_m2 + common_variance_m2);
    vertex.corner = node.corner;
    if (has_out) vertex.bulge = std::tan(0.25 * arcs_[2 * k].curvature_1pm * (arcs_[2 * k].length_m - cut_m_[2 * k]));
    return vertex;
  };
  const auto joint_vertex = [&](std::size_t k) {
    const double after_m2 = model_m2(k);
    const ArcOfNode& second = arcs_[2 * k + 1];
    SplinegonVertex joint;
    joint.p_world_m = second.begin_m + origin_m_;
    joint.bulge = std::tan(0.25 * second.curvature_1pm * (second.length_m - cut_m_[2 * k + 1]));
    Matrix6d J;
    const std::array<Eigen::Index, 6> index = unknowns_of_biarc(k, J);
    const Vector6d row = J.transpose() * residual_of(second.begin_m, 2 * k).slope;
    double joint_m2 = 0.0;
    for (std::size_t a = 0; a < 6; ++a) {
      for (std::size_t b = 0; b < 6; ++b) {
        joint_m2 += scale * row(static_cast<Eigen::Index>(a)) * row(static_cast<Eigen::Index>(b)) *
                    covariance_(std::max(index[a], index[b]), std::min(index[a], index[b]));
      }
    }
    const double gap_m = gap_m_[k];
    const double turn_over_rad =
        std::abs(arcs_[2 * k].curvature_1pm * arcs_[2 * k].length_m + second.curvature_1pm * second.length_m);
    const double over_gap_m = gap_m * (kGapSigma * mean_curvature_1pm * gap_m +
                                       kGapCorner * std::tan(0.5 * std::min(turn_over_rad, 0.5 * kPi)));
    joint.sigma_m = std::sqrt(joint_m2 + after_m2 + over_gap_m * over_gap_m + common_variance_m2);
    return joint;
  };
  find_polygons();
  do {
    spread_polygons();
  } while (!cut_beside_polygons());
  const std::size_t count = biarcs();
  std::size_t start = 0;
  while (closed_ && start < count && is_polygon_[(start + count - 1) % count]) ++start;
  vertices.clear();
  if (start == count) return add_polygon(0, count, common_variance_m2, vertices);
  for (std::size_t done = 0; done < count;) {
    const std::size_t k = (start + done) % count;
    std::size_t run = 0;
    while (done + run < count && is_polygon_[(k + run) % count]) ++run;
    if (run > 0) {
      const SplinegonVertex begin = node_vertex(k);
      if (closed_ || done > 0) vertices.push_back(begin);
      add_polygon(k, run, common_variance_m2, vertices);
      done += run;
      continue;
    }
    vertices.push_back(node_vertex(k));
    vertices.back().corner |= (closed_ || k > 0) && is_polygon_[(k + count - 1) % count];
    vertices.push_back(joint_vertex(k));
    ++done;
  }
  if (!closed_ && !is_polygon_[count - 1]) vertices.push_back(node_vertex(count));
}

/// The biarcs that do not follow their elements, or go astray between them.
void SplinegonFit::find_polygons() {
  is_polygon_.assign(biarcs(), false);
  std::size_t before = points_m_.size() - 1;  // the last element so far
  for (std::size_t k = 0; k < biarcs(); ++k) {
    const Residuals& sums = residuals_[k];
    const ArcOfNode& first = arcs_[2 * k];
    const ArcOfNode& second = arcs_[2 * k + 1];
    // A corner is between the elements beside it.
    const std::size_t n = points_m_.size();
    const std::size_t after = residuals_[k].elements > 0.0 ? first_element(k) : (before + 1) % n;
    if (follow_tips_ && nodes_[k].corner && (closed_ || k > 0) && after != before) {
      const Eigen::Vector2d& from_m = points_m_[(after + n - 1) % n];
      const Eigen::Vector2d& to_m = points_m_[after];
      const double most_m = kMostCornerWay * (to_m - from_m).norm() + kPolygonOffset_m;
      if ((nodes_[k].p_m - from_m).norm() > most_m || (nodes_[k].p_m - to_m).norm() > most_m) {
        is_polygon_[k] = is_polygon_[(k + biarcs() - 1) % biarcs()] = true;
      }
    }
    // Along the elements, from that before to that after.
    double way_m = (nodes_[next_node(k)].p_m - nodes_[k].p_m).norm();
    const auto elements = static_cast<std::size_t>(sums.elements);
    const auto edge_m = [&](std::size_t at) { return (points_m_[(at + 1) % n] - points_m_[at]).norm(); };
    if (elements == 0 && (closed_ || before + 1 < n)) way_m = edge_m(before) + kNear_m;
    if (elements > 0 && elements < n) {
      const std::size_t from = first_element(k), to = (from + elements - 1) % n;
      before = to;
      way_m = (to >= from ? s_m_[to] - s_m_[from] : s_m_[to] + perimeter_m_ - s_m_[from]) + kNear_m;
      if (closed_ || from > 0) way_m += edge_m((from + n - 1) % n);
      if (closed_ || to + 1 < n) way_m += edge_m(to);
    }
    const auto turn_rad = [](const ArcOfNode& arc) { return std::abs(arc.curvature_1pm * arc.length_m); };
    const bool is_sound = first.length_m + second.length_m < kMostWay * way_m && turn_rad(first) < kMostTurn_rad &&
                          turn_rad(second) < kMostTurn_rad && first.length_m > kShortestArc_m &&
                          second.length_m > kShortestArc_m;
    is_polygon_[k] = is_polygon_[k] || !is_sound || is_misfit(sums);
  }
}

/// Beside a polygon a few elements are of it: a biarc of theirs has nothing else to hold it.
void SplinegonFit::spread_polygons() {
  for (std::size_t step = 0; follow_tips_ && step < 4 * biarcs(); ++step) {
    const std::size_t k = (step < 2 * biarcs() ? step : 4 * biarcs() - 1 - step) % biarcs();
    if (residuals_[k].elements >= static_cast<double>(kElementsOfArc)) continue;
    is_polygon_[k] = is_polygon_[k] || ((closed_ || k > 0) && is_polygon_[(k + biarcs() - 1) % biarcs()]) ||
                     ((closed_ || k + 1 < biarcs()) && is_polygon_[next_node(k)]);
  }
}

/// Index of a biarc's first element, whose others follow.
std::size_t SplinegonFit::first_element(std::size_t biarc) const {
  const Residuals& sums = residuals_[biarc];
  if (!closed_ || sums.first > 0 || static_cast<double>(sums.last + 1) <= sums.elements) return sums.first;
  std::size_t first = points_m_.size();
  while (first > 1 && arc_of_[first - 1] / 2 == biarc) --first;
  return first % points_m_.size();
}

/// The elements of some biarcs in a row.
SplinegonFit::Run SplinegonFit::elements_of(std::size_t biarc, std::size_t count) const {
  Run run;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t of = (biarc + k) % biarcs();
    if (residuals_[of].elements == 0.0) continue;
    if (run.elements == 0) run.first = first_element(of);
    run.elements += static_cast<std::size_t>(residuals_[of].elements);
  }
  return run;
}

/// Where a biarc begins and ends that is given as arcs.
Eigen::Vector2d SplinegonFit::begin_of(std::size_t biarc) const {
  const ArcOfNode& first = arcs_[2 * biarc];
  if (cut_m_[2 * biarc] == 0.0) return nodes_[biarc].p_m;
  return point_on(first.begin_m, first.begin_yaw_rad, first.curvature_1pm, cut_m_[2 * biarc]);
}
Eigen::Vector2d SplinegonFit::end_of(std::size_t biarc) const {
  const ArcOfNode& second = arcs_[2 * biarc + 1];
  if (cut_m_[2 * biarc + 1] == 0.0) return nodes_[next_node(biarc)].p_m;
  return point_on(second.begin_m, second.begin_yaw_rad, second.curvature_1pm, second.length_m - cut_m_[2 * biarc + 1]);
}

/// A biarc beside a polygon begins or ends where the polygon does: what lies beyond is cut off, else the boundary would
/// go there and back. False where all of an arc would be: then its biarc is of the polygon, and others may be.
bool SplinegonFit::cut_beside_polygons() {
  const std::size_t count = biarcs();
  cut_m_.assign(arcs_.size(), 0.0);
  bool is_done = true;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t before = (k + count - 1) % count;
    if (!is_polygon_[k] || ((closed_ || k > 0) && is_polygon_[before])) continue;  // no begin of a polygon
    std::size_t run = 1;
    while (run < count && (closed_ || k + run < count) && is_polygon_[(k + run) % count]) ++run;
    if (run == count) continue;
    const Run elements = elements_of(k, run);
    const std::size_t after = (k + run) % count, n = points_m_.size();
    const auto cut = [&](std::size_t arc, double beyond_m) {
      if (beyond_m <= 0.0) return;
      cut_m_[arc] = beyond_m;
      if (arcs_[arc].length_m - beyond_m > kShortestEdge_m) return;
      is_polygon_[arc / 2] = true;
      is_done = false;
    };
    if (closed_ || k > 0) {
      const std::size_t arc = 2 * before + 1;
      const Eigen::Vector2d& first_m = elements.elements > 0 ? points_m_[elements.first] : nodes_[after].p_m;
      cut(arc, arcs_[arc].length_m - way_to_foot_m(first_m, arc));
    }
    if (closed_ || k + run < count) {
      const Eigen::Vector2d& last_m =
          elements.elements > 0 ? points_m_[(elements.first + elements.elements - 1) % n] : nodes_[k].p_m;
      cut(2 * after, way_to_foot_m(last_m, 2 * after));
    }
  }
  return is_done;
}

/// Appends the polygon of the elements of some biarcs in a row but for its last vertex, which is the begin of what is
/// after them.
void SplinegonFit::add_polygon(std::size_t biarc, std::size_t count, double common_variance_m2,
                               std::vector<SplinegonVertex>& vertices) {
  corners_m_.clear();
  const bool is_begin = !closed_ && biarc == 0, is_end = !closed_ && biarc + count == biarcs();
  const bool is_whole = closed_ && count == biarcs();
  const auto add = [&](const Eigen::Vector2d& p_m, double sigma_m) {
    if (corners_m_.empty() || (p_m - corners_m_.back().p_m).norm() > kShortestEdge_m) {
      corners_m_.push_back({p_m, sigma_m});
    }
  };
  const double node_m = vertices.empty() ? kPolygonOffset_m : vertices.back().sigma_m;
  if (!is_begin && !is_whole) add(end_of((biarc + biarcs() - 1) % biarcs()), node_m);
  const Run run = elements_of(biarc, count);
  for (std::size_t i = 0; i < run.elements; ++i) {
    const std::size_t element = (run.first + i) % points_m_.size();
    add(points_m_[element], 1.0 / weights_[element]);
  }
  if (!is_end && !is_whole) {
    const Eigen::Vector2d end_m = begin_of((biarc + count) % biarcs());
    while (!corners_m_.empty() && (end_m - corners_m_.back().p_m).norm() <= kShortestEdge_m) corners_m_.pop_back();
    add(end_m, kPolygonOffset_m);
  }
  if (!is_begin && !is_whole) vertices.pop_back();
  append_corners(is_end, is_whole, common_variance_m2, vertices);
}

/// Appends corners_m_, simplified: with the last one as the end of an open boundary, around a closed one, or up to it.
void SplinegonFit::append_corners(bool is_end, bool is_whole, double common_variance_m2,
                                  std::vector<SplinegonVertex>& vertices) {
  if (corners_m_.size() < 2) return;
  kept_.assign(1, 0);
  simplification_.add(
      0, corners_m_.size() - 1, kPolygonOffset_m, [&](std::size_t i) { return corners_m_[i].p_m; },
      [&](std::size_t i) { return corners_m_[i].sigma_m; }, kept_);
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    const PolygonCorner& corner = corners_m_[kept_[k]];
    const bool is_last = k + 1 == kept_.size();
    if (is_last && !is_end && !is_whole) break;
    const double variance_m2 =
        corner.sigma_m * corner.sigma_m + kPolygonOffset_m * kPolygonOffset_m + common_variance_m2;
    vertices.push_back({corner.p_m + origin_m_, 0.0, std::sqrt(variance_m2), true});
    if (is_last && is_end) break;
    const Eigen::Vector2d to_m = corners_m_[kept_[is_last ? 0 : k + 1]].p_m;
    vertices.push_back({0.5 * (corner.p_m + to_m) + origin_m_, 0.0, std::sqrt(variance_m2), false});
  }
}

}  // namespace situation_awareness
