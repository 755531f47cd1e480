// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Probability that the place of a reflector is inside the gate of the reflector that it is.
constexpr double kPlaceGateProbability = 0.999;
/// Least number of reflectors that a pose is found by: two have a mirror image.
constexpr int kMinMatches = 3;
/// m. Least distance of the pairs of reflectors that a search begins with.
constexpr double kMinDistance_m = 0.3;
/// A pose is ambiguous if another one has a cost, the sum of squared Mahalanobis distances, with 27.6 for each place
/// left unmatched, that is not higher by this.
constexpr double kPoseAdvantage = 20.0;

/// Most Gauss-Newton steps; three or four are taken.
constexpr int kMaxSteps = 20;
constexpr double kConverged = 1e-13;
/// Poses that are kept; others have higher costs. If so many explain as much, the result is ambiguous anyway.
constexpr std::size_t kMaxHypotheses = 32;
/// Poses nearer to each other than this, in m and rad, are the same found by other pairs.
constexpr double kSamePose_m = 0.3;
constexpr double kSameYaw_rad = 0.1;
/// A true place is beyond this gate of its reflector once in a million: what a place costs that is not matched. With
/// that of the matches, once in a thousand, a true match that is left out would too often tell for a wrong pose.
constexpr double kFarProbability = 0.999999;
/// Most pairs of reflectors, by memory: all of 4,000 reflectors, otherwise the shortest.
constexpr std::size_t kMaxPairs = 8'000'000;
constexpr int kDistanceBins = 100'000;
/// Of a call, in cells looked at: 20 to 36 ms on a core of a busy AMD EPYC.
constexpr std::int64_t kStepsOfCall = 2'000'000;
/// Steps of what is more than to look at a cell: a pair of reflectors, one that is fitted.
constexpr std::int64_t kStepsOfPair = 4, kStepsOfFit = 400;
/// Matches of which so many are expected by chance are none. Those found are a third of them at most: what c, the cost
/// of three matches, leaves is 4/3 pi c^1.5 of (2 pi)^1.5 exp(c / 2), and of more matches it is less.
constexpr double kMostByChance = 3e-3;
/// So many tries that went on so far tell how likely another place is matched by chance, in circles in which there are
/// fewer reflectors on average than this: in larger ones there is one anyway.
constexpr std::int64_t kTellingTries = 50;
constexpr double kTellingCircle = 0.1;

bool is_same(const Pose2& a, const Pose2& b) {
  const Pose2 between = inverse(a) * b;
  return between.translation_m.norm() < kSamePose_m && std::abs(wrap_to_pi(between.yaw_rad)) < kSameYaw_rad;
}

/// Variance of the distance of two places.
double distance_variance(const ReflectorPlace& a, const ReflectorPlace& b) {
  const Eigen::Vector2d along = (a.center_m - b.center_m).normalized();
  return along.dot((a.covariance + b.covariance) * along);
}

double larger_variance(const ReflectorPlace& place) {
  const Eigen::Matrix2d& P = place.covariance;
  return 0.5 * (P(0, 0) + P(1, 1)) + std::hypot(0.5 * (P(0, 0) - P(1, 1)), P(0, 1));
}

}  // namespace

Eigen::Vector2d place_of(const Pose2& T_world_frame, const Eigen::Vector2d& center_world_m) {
  return T_world_frame.rotation().transpose() * (center_world_m - T_world_frame.translation_m);
}

Eigen::Matrix<double, 2, 3> place_jacobian(const Eigen::Vector2d& center_frame_m) {
  Eigen::Matrix<double, 2, 3> J;
  J << -1.0, 0.0, center_frame_m.y(), 0.0, -1.0, -center_frame_m.x();
  return J;
}

double fit_pose(const std::vector<ReflectorPlace>& places, const std::vector<int>& reflectors, const ReflectorMap& map,
                Pose2& T_world_frame, Eigen::Matrix3d& P) {
  double cost = 0.0;
  for (int step = 0; step < kMaxSteps; ++step) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    cost = 0.0;
    int matched = 0;
    for (std::size_t i = 0; i < places.size() && i < reflectors.size(); ++i) {
      if (reflectors[i] < 0) continue;
      const Eigen::Vector2d p =
          place_of(T_world_frame, map.reflectors[static_cast<std::size_t>(reflectors[i])].center_world_m);
      const Eigen::Vector2d nu = places[i].center_m - p;
      const Eigen::Matrix<double, 2, 3> H = place_jacobian(p);
      const Eigen::Matrix2d W = places[i].covariance.inverse();
      A += H.transpose() * W * H;
      b += H.transpose() * W * nu;
      cost += nu.dot(W * nu);
      ++matched;
    }
    if (matched < 2) return -1.0;
    const Eigen::LLT<Eigen::Matrix3d> llt(A);
    if (llt.info() != Eigen::Success) return -1.0;
    const Eigen::Vector3d e = llt.solve(b);
    if (!e.allFinite()) return -1.0;
    T_world_frame = T_world_frame * exp_se2(e);
    P = llt.solve(Eigen::Matrix3d::Identity());
    if (e.norm() < kConverged) break;
  }
  T_world_frame.yaw_rad = wrap_to_pi(T_world_frame.yaw_rad);
  P = 0.5 * (P + P.transpose()).eval();
  return cost;
}

ReflectorSearch::ReflectorSearch(const ReflectorMap& map) : map_(map), gate_(0.0), far_gate_(0.0) {
  check_reflectors(map_, "reflector map");
  gate_ = chi_square_quantile(kPlaceGateProbability, 2);
  far_gate_ = chi_square_quantile(std::max(kFarProbability, kPlaceGateProbability), 2);
  list_pairs();
  sort_into_cells();
  places_.reserve(kMaxPlaces);
  order_.reserve(kMaxPlaces);
  others_.reserve(kMaxPlaces);
  hypotheses_.resize(kMaxHypotheses);
  for (Hypothesis& hypothesis : hypotheses_) hypothesis.reflectors.reserve(kMaxPlaces);
  next_.reflectors.reserve(kMaxPlaces);
  result_.reflectors.reserve(kMaxPlaces);
}

// --- of the map ------------------------------------------------------------------------------------------------------

void ReflectorSearch::list_pairs() {
  const auto count = static_cast<std::int32_t>(map_.reflectors.size());
  const auto distance_m = [&](std::int32_t a, std::int32_t b) {
    return static_cast<float>((map_.reflectors[static_cast<std::size_t>(a)].center_world_m -
                               map_.reflectors[static_cast<std::size_t>(b)].center_world_m)
                                  .norm());
  };
  const auto for_each_pair = [&](const auto& act) {
    for (std::int32_t a = 0; a < count; ++a) {
      for (std::int32_t b = a + 1; b < count; ++b) act(a, b, distance_m(a, b));
    }
  };
  float most_m = std::numeric_limits<float>::infinity();
  const std::size_t all = map_.reflectors.size() * (map_.reflectors.size() - 1) / 2;
  if (all > kMaxPairs) {
    float longest_m = 0.0F;
    for_each_pair([&](std::int32_t, std::int32_t, float d_m) { longest_m = std::max(longest_m, d_m); });
    std::vector<std::size_t> bins(kDistanceBins + 1);
    const float bin_m = longest_m / kDistanceBins;
    for_each_pair([&](std::int32_t, std::int32_t, float d_m) { ++bins[static_cast<std::size_t>(d_m / bin_m)]; });
    std::size_t below = 0, bin = 0;
    while (bin < bins.size() && below + bins[bin] <= kMaxPairs) below += bins[bin++];
    most_m = static_cast<float>(bin) * bin_m;
  }
  pairs_.reserve(std::min(all, kMaxPairs));
  for_each_pair([&](std::int32_t a, std::int32_t b, float d_m) {
    if (d_m < most_m) pairs_.push_back({d_m, a, b});
  });
  std::sort(pairs_.begin(), pairs_.end(), [](const Pair& x, const Pair& y) {
    return std::tie(x.distance_m, x.a, x.b) < std::tie(y.distance_m, y.a, y.b);
  });
}

void ReflectorSearch::sort_into_cells() {
  const auto count = static_cast<std::int32_t>(map_.reflectors.size());
  Eigen::Vector2d high_m = map_.reflectors.front().center_world_m;
  low_m_ = high_m;
  for (const Reflector& reflector : map_.reflectors) {
    low_m_ = low_m_.cwiseMin(reflector.center_world_m);
    high_m = high_m.cwiseMax(reflector.center_world_m);
  }
  size_m_ = high_m - low_m_;
  // About one for each reflector, also where they are in a row.
  cell_m_ = std::max({1e-3, std::sqrt(size_m_.x() * size_m_.y() / count), size_m_.maxCoeff() / count});
  columns_ = static_cast<int>(size_m_.x() / cell_m_) + 1;
  rows_ = static_cast<int>(size_m_.y() / cell_m_) + 1;
  const auto cell_of = [&](std::int32_t k) {
    const Eigen::Vector2d p_m = map_.reflectors[static_cast<std::size_t>(k)].center_world_m - low_m_;
    const int column = std::min(static_cast<int>(p_m.x() / cell_m_), columns_ - 1);
    const int row = std::min(static_cast<int>(p_m.y() / cell_m_), rows_ - 1);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  };
  cell_begins_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
  for (std::int32_t k = 0; k < count; ++k) ++cell_begins_[cell_of(k) + 1];
  std::partial_sum(cell_begins_.begin(), cell_begins_.end(), cell_begins_.begin());
  std::vector<std::int32_t> next(cell_begins_.begin(), cell_begins_.end() - 1);
  in_cells_.resize(map_.reflectors.size());
  for (std::int32_t k = 0; k < count; ++k) in_cells_[static_cast<std::size_t>(next[cell_of(k)]++)] = k;
}

/// act(index, reflector) for those in the circle that are not excluded, until it returns false.
template <class Act>
void ReflectorSearch::for_each_within(const Eigen::Vector2d& p_world_m, double radius_m, const Act& act) {
  const Eigen::Vector2d p_m = p_world_m - low_m_;
  const auto cell = [&](double m, int cells) {
    return static_cast<int>(std::clamp(std::floor(m / cell_m_), -1.0, static_cast<double>(cells)));
  };
  const int first_column = std::max(cell(p_m.x() - radius_m, columns_), 0);
  const int last_column = std::min(cell(p_m.x() + radius_m, columns_), columns_ - 1);
  const int first_row = std::max(cell(p_m.y() - radius_m, rows_), 0);
  const int last_row = std::min(cell(p_m.y() + radius_m, rows_), rows_ - 1);
  for (int row = first_row; row <= last_row; ++row) {
    const std::size_t begin = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
    const auto from = cell_begins_[begin + static_cast<std::size_t>(first_column)];
    const auto to = first_column > last_column ? from : cell_begins_[begin + static_cast<std::size_t>(last_column) + 1];
    steps_ += 1 + to - from;
    for (auto n = from; n < to; ++n) {
      const std::int32_t k = in_cells_[static_cast<std::size_t>(n)];
      const Eigen::Vector2d& center_m = map_.reflectors[static_cast<std::size_t>(k)].center_world_m;
      if ((center_m - p_world_m).squaredNorm() > radius_m * radius_m) continue;
      if (!act(k, center_m)) return;
    }
  }
}

// --- of the places ---------------------------------------------------------------------------------------------------

ReflectorSearch::Base ReflectorSearch::base_of(int i, int j) const {
  const ReflectorPlace &a = places_[static_cast<std::size_t>(i)], &b = places_[static_cast<std::size_t>(j)];
  const double distance_m = (a.center_m - b.center_m).norm();
  Base base;
  base.i = i;
  base.j = j;
  if (distance_m < kMinDistance_m) return base;
  base.difference_m = std::sqrt(gate_ * distance_variance(a, b) + 1e-12);
  const double rounding_m = 1e-6 * distance_m;  // of the list's
  const auto shorter = [](const Pair& pair, double d_m) { return static_cast<double>(pair.distance_m) < d_m; };
  const auto begin =
      std::lower_bound(pairs_.begin(), pairs_.end(), distance_m - base.difference_m - rounding_m, shorter);
  const auto end = std::lower_bound(begin, pairs_.end(), distance_m + base.difference_m + rounding_m, shorter);
  base.begin = static_cast<std::size_t>(begin - pairs_.begin());
  base.end = static_cast<std::size_t>(end - pairs_.begin());
  return base;
}

/// First those of which few pairs of reflectors can be seen, at a long distance. With so many of them as a pose leaves
/// out, and two more, it is found by a pair of them.
void ReflectorSearch::order_places() {
  const int n = static_cast<int>(places_.size());
  const auto effort = [&](int i, int j) {
    const Base base = base_of(i, j);
    const double d_m =
        (places_[static_cast<std::size_t>(i)].center_m - places_[static_cast<std::size_t>(j)].center_m).norm();
    const double blur_m2 =
        larger_variance(places_[static_cast<std::size_t>(i)]) + larger_variance(places_[static_cast<std::size_t>(j)]);
    if (base.difference_m == 0.0) return 1e18;
    return (1.0 + static_cast<double>(base.end - base.begin)) * (1.0 + 100.0 / (d_m * d_m)) * (blur_m2 + 1e-6);
  };
  order_.clear();
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) {
      const double here = effort(i, j);
      if (!(here < least)) continue;
      least = here;
      order_.assign({i, j});
    }
  }
  while (static_cast<int>(order_.size()) < n) {
    int best = -1;
    least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < n; ++i) {
      if (std::find(order_.begin(), order_.end(), i) != order_.end()) continue;
      double sum = 0.0;
      for (const int j : order_) sum += effort(i, j);
      if (best >= 0 && !(sum < least)) continue;
      least = sum;
      best = i;
    }
    order_.push_back(best);
  }
}

void ReflectorSearch::begin(const std::vector<ReflectorPlace>& places) {
  const std::size_t n = std::min<std::size_t>(places.size(), kMaxPlaces);
  places_.assign(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(n));
  used_ = 0;
  looked_for_.fill(0);
  there_.fill(0);
  telling_bases_.fill(0);
  order_places();
  // Something else may be anywhere on the map, and around it as far as what is seen.
  double spread_m = 0.0;
  for (const ReflectorPlace& a : places_) {
    for (const ReflectorPlace& b : places_) spread_m = std::max(spread_m, (a.center_m - b.center_m).norm());
  }
  density_1_m2_ = static_cast<double>(map_.reflectors.size()) / ((size_m_.x() + spread_m) * (size_m_.y() + spread_m));
  base_number_ = 0;
  begin_base();
  is_searching_ = true;
}

/// In turn each place with those before it.
void ReflectorSearch::begin_base() {
  std::size_t second = 1;
  while (second * (second + 1) / 2 <= base_number_) ++second;
  const std::size_t first = base_number_ - second * (second - 1) / 2;
  base_ = base_of(order_[first], order_[second]);
  next_pair_ = 2 * base_.begin;
  others_.clear();
  if (base_.begin == base_.end) return;
  const ReflectorPlace& a = places_[static_cast<std::size_t>(base_.i)];
  const ReflectorPlace& b = places_[static_cast<std::size_t>(base_.j)];
  const Eigen::Vector2d way_m = b.center_m - a.center_m, middle_m = 0.5 * (a.center_m + b.center_m);
  const double distance_m = way_m.norm();
  const Eigen::Vector2d along = way_m / distance_m, across(-along.y(), along.x());
  const double of_both_m2 = larger_variance(a) + larger_variance(b);
  for (int k = 0; k < static_cast<int>(places_.size()); ++k) {
    if (k == base_.i || k == base_.j) continue;
    const ReflectorPlace& place = places_[static_cast<std::size_t>(k)];
    const Eigen::Vector2d p_m = place.center_m - middle_m;
    // The error of the base's middle moves it anywhere, that of its yaw around the middle.
    const double turned = p_m.norm() / distance_m;
    const double variance_m2 = larger_variance(place) + of_both_m2 * (0.25 + turned * turned);
    others_.push_back({k, {along.dot(p_m), across.dot(p_m)}, std::sqrt(far_gate_ * variance_m2)});
  }
  std::sort(others_.begin(), others_.end(), [](const Other& x, const Other& y) {
    return std::tie(x.radius_m, x.place) < std::tie(y.radius_m, y.place);
  });
  pairs_of_base_ = 2.0 * static_cast<double>(base_.end - base_.begin) - 1.0;  // without the true one
  telling_ = 0;
  for (const Other& other : others_) {
    if (density_1_m2_ * kPi * other.radius_m * other.radius_m > kTellingCircle) break;
    ++telling_bases_[telling_++];
  }
}

// --- the search ------------------------------------------------------------------------------------------------------

/// What a pose costs at most that is the result, or makes it ambiguous, or would if one more place were matched by
/// chance.
double ReflectorSearch::cost_that_counts() const {
  const double of_fewest = far_gate_ * (static_cast<double>(places_.size()) - kMinMatches + 1.0);
  return used_ > 0 ? std::min(of_fewest, hypotheses_.front().cost + far_gate_ + kPoseAdvantage) : of_fewest;
}

/// Whether each pose that counts was found, by two of the places that it does not leave out. With one pair more than
/// that it does no harm if places of one are farther apart than their gate allows.
bool ReflectorSearch::is_settled() const {
  const auto left_out = static_cast<std::size_t>(std::max(0.0, cost_that_counts() / far_gate_));
  const std::size_t needed = std::min(left_out + 3, places_.size());
  return base_number_ >= needed * (needed - 1) / 2;
}

/// The base as these two reflectors, one way round. If enough others are where it says it is a hypothesis.
void ReflectorSearch::try_pair(std::int32_t a, std::int32_t b) {
  const Eigen::Vector2d& a_m = map_.reflectors[static_cast<std::size_t>(a)].center_world_m;
  const Eigen::Vector2d& b_m = map_.reflectors[static_cast<std::size_t>(b)].center_world_m;
  const Eigen::Vector2d way_m = b_m - a_m, middle_m = 0.5 * (a_m + b_m);
  const double distance_m = way_m.norm();
  const ReflectorPlace& place = places_[static_cast<std::size_t>(base_.i)];
  const Eigen::Vector2d seen_m = places_[static_cast<std::size_t>(base_.j)].center_m - place.center_m;
  if (std::abs(distance_m - seen_m.norm()) > base_.difference_m) return;
  const Eigen::Vector2d along = way_m / distance_m, across(-along.y(), along.x());
  double cost = 0.0;
  const double most = cost_that_counts();
  std::size_t run = 0;
  bool runs = true;
  for (const Other& other : others_) {
    bool is_there = false;
    for_each_within(middle_m + other.p_m.x() * along + other.p_m.y() * across, other.radius_m,
                    [&](std::int32_t k, const Eigen::Vector2d& /*center_m*/) {
                      is_there = k != a && k != b;
                      return !is_there;
                    });
    runs = runs && run < telling_;
    if (runs) {
      ++looked_for_[run];
      if (is_there) ++there_[run];
      runs = is_there;
      ++run;
    }
    if (!is_there) cost += far_gate_;
    if (cost >= most) return;
  }
  next_.reflectors.assign(places_.size(), -1);
  next_.reflectors[static_cast<std::size_t>(base_.i)] = a;
  next_.reflectors[static_cast<std::size_t>(base_.j)] = b;
  next_.T_world_frame.yaw_rad = std::atan2(way_m.y(), way_m.x()) - std::atan2(seen_m.y(), seen_m.x());
  next_.T_world_frame.translation_m = a_m - next_.T_world_frame.rotation() * place.center_m;
  steps_ += kStepsOfFit;
  if (complete(next_)) remember();
}

/// The base is matched: each other place to the reflector that is nearest, as the pose becomes known better. Then all
/// of them by least squares; false if they are none.
bool ReflectorSearch::complete(Hypothesis& hypothesis) {
  hypothesis.fit_cost = fit_pose(places_, hypothesis.reflectors, map_, hypothesis.T_world_frame, hypothesis.P);
  if (hypothesis.fit_cost < 0.0 || hypothesis.fit_cost > 2.0 * gate_) return false;
  Estimate<Pose2> estimate{hypothesis.T_world_frame, hypothesis.P};
  double left_out = 0.0;
  hypothesis.pairs = pairs_of_base_;
  for (const Other& other : others_) {
    const ReflectorPlace& place = places_[static_cast<std::size_t>(other.place)];
    int best = -1;
    Innovation<2> best_innovation;
    best_innovation.mahalanobis2 = far_gate_;
    Eigen::Matrix<double, 2, 3> best_H;
    for_each_within(estimate.x * place.center_m, other.radius_m, [&](std::int32_t k, const Eigen::Vector2d& center_m) {
      const auto& matched = hypothesis.reflectors;
      if (std::find(matched.begin(), matched.end(), k) != matched.end()) return true;
      const Eigen::Vector2d p = place_of(estimate.x, center_m);
      const Eigen::Matrix<double, 2, 3> H = place_jacobian(p);
      const Innovation<2> compared = innovation(estimate, Eigen::Vector2d(place.center_m - p), H, place.covariance);
      if (!(compared.mahalanobis2 < best_innovation.mahalanobis2)) return true;
      best = k;
      best_innovation = compared;
      best_H = H;
      return true;
    });
    if (best < 0 || !inside_gate(best_innovation, gate_)) {
      left_out += best_innovation.mahalanobis2;
      continue;
    }
    hypothesis.reflectors[static_cast<std::size_t>(other.place)] = best;
    update(estimate, best_innovation, best_H, place.covariance);
  }
  hypothesis.T_world_frame = estimate.x;
  hypothesis.fit_cost = fit_pose(places_, hypothesis.reflectors, map_, hypothesis.T_world_frame, hypothesis.P);
  hypothesis.cost = hypothesis.fit_cost + left_out;
  return hypothesis.fit_cost >= 0.0 && hypothesis.cost < cost_that_counts();
}

/// How many poses by which these places are at some reflectors, as well as by this one, are expected if the reflectors
/// are anywhere: how likely the places are then, relative to how likely they are if this is the pose, with any pose
/// before. Its logarithm.
double ReflectorSearch::log_expected(const Hypothesis& hypothesis) const {
  const double area_m2 = static_cast<double>(map_.reflectors.size()) / density_1_m2_;
  double sum =
      std::log(area_m2 / std::sqrt(2.0 * kPi)) - 0.5 * std::log(hypothesis.P.determinant()) + 0.5 * hypothesis.fit_cost;
  for (std::size_t k = 0; k < places_.size(); ++k) {
    if (hypothesis.reflectors[k] < 0) continue;
    sum += std::log(density_1_m2_ * 2.0 * kPi * std::sqrt(places_[k].covariance.determinant()));
  }
  return sum;
}

/// Keeps the hypothesis in its turn, unless the same pose is known at a lower cost.
void ReflectorSearch::remember() {
  const auto begin = hypotheses_.begin(), end = begin + static_cast<std::ptrdiff_t>(used_);
  auto place =
      std::find_if(begin, end, [&](const Hypothesis& h) { return is_same(h.T_world_frame, next_.T_world_frame); });
  if (place == end) {
    if (used_ == kMaxHypotheses && !(next_.cost < hypotheses_.back().cost)) return;
    if (used_ < kMaxHypotheses) ++used_;
    place = begin + static_cast<std::ptrdiff_t>(used_) - 1;
  } else if (!(next_.cost < place->cost)) {
    return;
  }
  std::swap(*place, next_);
  for (; place != begin && place->cost < std::prev(place)->cost; --place) std::swap(*place, *std::prev(place));
}

/// How often another place was there by chance where so many were, or 0 if that was too rarely looked for. A true one
/// is tried once with each base.
double ReflectorSearch::share_there(std::size_t run) const {
  const std::int64_t tries = looked_for_[run] - telling_bases_[run];
  if (tries < kTellingTries) return 0.0;
  return static_cast<double>(std::max<std::int64_t>(there_[run] - telling_bases_[run], 0)) / static_cast<double>(tries);
}

/// How many poses with so many matches that fit as well would be found if none of the places were a reflector's: of
/// reflectors that are anywhere; or, in rows, by how many pairs are as far apart as those of a base, and how often
/// others were where they then have to be, where that is more.
double ReflectorSearch::expected_by_chance(int matches) const {
  const Hypothesis& best = hypotheses_.front();
  const int n = static_cast<int>(places_.size());
  const double log_anywhere = log_expected(best);
  // One of the poses that explain about as much, such as those of rows, has one match more by chance now and then.
  const double as_good = best.cost + far_gate_ + kPoseAdvantage;
  double of_rivals = 0.0;
  for (std::size_t i = 1; i < used_ && hypotheses_[i].cost < as_good; ++i) {
    of_rivals += (n - matches + 1) * std::exp(std::min(log_anywhere - log_expected(hypotheses_[i]), 0.0));
  }
  double expected = best.pairs;
  for (int i = 0; i < matches; ++i) expected *= static_cast<double>(n - i) / static_cast<double>(matches - i);
  const double anywhere = std::min(std::exp((log_anywhere - std::log(best.pairs)) / (matches - 2)), 1.0);
  double share = 0.0;
  for (std::size_t run = 0; run + 2 < static_cast<std::size_t>(matches); ++run) {
    if (const double here = share_there(run); here > 0.0) share = here;
    expected *= std::max(anywhere, share);
  }
  return std::max(expected, of_rivals);
}

const ReflectorPose& ReflectorSearch::find(const std::vector<ReflectorPlace>& places) {
  result_.is_known = false;
  result_.reflectors.clear();
  result_.reason = "too few places";
  if (!is_searching_) {
    if (places.size() < static_cast<std::size_t>(kMinMatches)) return result_;
    begin(places);
  }
  steps_ = 0;
  const std::size_t bases = places_.size() * (places_.size() - 1) / 2;
  while (!is_settled()) {
    for (; next_pair_ < 2 * base_.end; ++next_pair_) {
      if (steps_ >= kStepsOfCall) {
        result_.reason = "search not finished";
        return result_;
      }
      steps_ += kStepsOfPair;
      const Pair& pair = pairs_[next_pair_ / 2];
      if (next_pair_ % 2 == 0) {
        try_pair(pair.a, pair.b);
      } else {
        try_pair(pair.b, pair.a);
      }
    }
    if (++base_number_ < bases) begin_base();
  }
  is_searching_ = false;
  return conclude();
}

const ReflectorPose& ReflectorSearch::conclude() {
  result_.reason = "no match";
  if (used_ == 0) return result_;
  const Hypothesis& best = hypotheses_.front();
  const auto matches =
      static_cast<int>(std::count_if(best.reflectors.begin(), best.reflectors.end(), [](int r) { return r >= 0; }));
  if (matches < kMinMatches) return result_;
  result_.T_world_frame = best.T_world_frame;
  result_.P = best.P;
  result_.reflectors = best.reflectors;
  result_.cost = best.fit_cost;
  const bool is_ambiguous = used_ > 1 && hypotheses_[1].cost < best.cost + kPoseAdvantage;
  result_.is_known = !is_ambiguous && expected_by_chance(matches) < kMostByChance;
  result_.reason = result_.is_known ? "" : "ambiguous";
  return result_;
}

}  // namespace situation_awareness
