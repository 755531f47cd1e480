// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/cloud_times.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kUnits_s[] = {1.0, 1e-3, 1e-6, 1e-9};
constexpr double kMaxTime_s = 1.0;  ///< from the stamp
/// How long a sweep lasts, in periods: one, or of two sensors on a topic several; or of few returns a part.
constexpr double kLeastPeriods = 0.1, kMostPeriods[] = {1.3, 3.0};
/// The same of the first cloud, whose period is not known.
constexpr double kLeastSweep_s = 0.02, kMostSweep_s = 0.25;
constexpr double kLeastPart = 0.5;  ///< of a revolution
constexpr double kPartError = 1e-3;
constexpr double kMostBad = 0.1;  ///< of the points with a return
constexpr double kMaxPeriod_s = 2.0;
constexpr std::size_t kPeriods = 9;

}  // namespace

struct CloudTimeReader::Range {
  double first = std::numeric_limits<double>::infinity(), last = -first;

  double length() const { return last - first; }
};

std::optional<double> CloudTimeReader::period_s() const {
  if (periods_s_.empty()) return std::nullopt;
  std::vector<double> sorted(periods_s_.begin(), periods_s_.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

/// The longest sweep.
double CloudTimeReader::most_s(double periods) const {
  const std::optional<double> period = period_s();
  return period ? periods * *period : kMostSweep_s;
}

/// By which the numbers last about a period.
std::optional<double> CloudTimeReader::unit_of(const Range& range, double most_periods) const {
  const std::optional<double> period = period_s();
  const double least_s = period ? kLeastPeriods * *period : kLeastSweep_s;
  for (const double unit_s : kUnits_s) {
    if (are_whole_ && unit_s == 1.0) continue;
    if (unit_s * range.length() >= least_s && unit_s * range.length() <= most_s(most_periods)) return unit_s;
  }
  return std::nullopt;
}

bool CloudTimeReader::are_parts(const Range& range) const {
  return !are_whole_ && range.length() >= kLeastPart && range.first >= -kPartError && range.last <= 1.0 + kPartError;
}

/// From the stamp or the beginning of its clock; none if they are not near the stamp.
std::optional<CloudTimeScale> CloudTimeReader::near_scale(const Range& range, double unit_s) const {
  // As ros::Time::toSec().
  const double stamp_s =
      static_cast<double>(*stamp_ns_ / 1'000'000'000) + 1e-9 * static_cast<double>(*stamp_ns_ % 1'000'000'000);
  for (const double at_stamp_s : {0.0, stamp_s}) {
    const CloudTimeScale scale{unit_s, at_stamp_s, range.first, range.last};
    if (std::abs(scale.times().first_s) <= kMaxTime_s && std::abs(scale.times().last_s) <= kMaxTime_s) return scale;
  }
  return std::nullopt;
}

std::optional<CloudTimeScale> CloudTimeReader::scale_of(const Range& range, double most_periods) {
  const auto known = [this](double unit_s, std::optional<CloudTimeScale> scale) {
    if (scale) unit_s_ = unit_s;
    is_unit_known_ = is_unit_known_ || scale;
    return scale;
  };
  for (const double unit_s : kUnits_s) {  // of the clock: no other unit comes so near to the stamp
    const std::optional<CloudTimeScale> near = near_scale(range, unit_s);
    if (near && near->at_stamp_s != 0.0 && unit_s * range.length() <= most_s(most_periods)) return known(unit_s, near);
  }
  const std::optional<double> unit_s = unit_of(range, most_periods), period = period_s();
  const bool is_short = unit_s_ * range.length() <= most_s(most_periods);
  const std::optional<CloudTimeScale> as_before = is_short ? near_scale(range, unit_s_) : std::nullopt;
  if (is_unit_known_ && as_before) return as_before;
  if (unit_s) {
    const std::optional<CloudTimeScale> near = near_scale(range, *unit_s);
    return known(*unit_s, near ? *near : CloudTimeScale{*unit_s, *unit_s * range.first, range.first, range.last});
  }
  if (as_before) return as_before;
  if (are_parts(range)) {
    return period ? known(*period, near_scale(range, *period)) : std::nullopt;  // or of a slow sensor: the next tells
  }
  return period ? std::nullopt : near_scale(range, unit_s_);
}

/// By the most that can be of one sweep.
std::optional<CloudTimeScale> CloudTimeReader::read_returns(std::vector<double> numbers) {
  const std::size_t all = numbers.size();
  numbers.erase(std::remove_if(numbers.begin(), numbers.end(), [](double n) { return !std::isfinite(n); }),
                numbers.end());
  std::sort(numbers.begin(), numbers.end());
  const auto least = static_cast<std::size_t>(std::ceil((1.0 - kMostBad) * static_cast<double>(all)));
  std::vector<double> lengths;  // that sweeps may have, in the driver's numbers
  for (const double periods : kMostPeriods) {
    for (const double unit_s : kUnits_s) lengths.push_back(most_s(periods) / unit_s);
  }
  if (!are_whole_) lengths.push_back(1.0 + kPartError);
  std::sort(lengths.begin(), lengths.end());
  if (is_unit_known_) lengths.insert(lengths.begin(), most_s(kMostPeriods[0]) / unit_s_);
  for (const double length : lengths) {
    std::size_t begin = 0, best_begin = 0, most = 0;
    for (std::size_t end = 0; end < numbers.size(); ++end) {
      while (numbers[end] - numbers[begin] > length) ++begin;
      if (end + 1 - begin <= most) continue;
      most = end + 1 - begin;
      best_begin = begin;
    }
    if (most < least || most == 0) continue;
    const Range range{numbers[best_begin], numbers[best_begin + most - 1]};
    std::optional<CloudTimeScale> scale = scale_of(range, kMostPeriods[0]);
    if (!scale) scale = scale_of(range, kMostPeriods[1]);
    if (!scale) continue;
    scale->bad_points = all - most;
    return scale;
  }
  return std::nullopt;
}

std::optional<CloudTimeScale> CloudTimeReader::read(const std::vector<double>& numbers,
                                                    const std::function<bool(std::size_t)>& has_return, bool are_whole,
                                                    std::int64_t stamp_ns) {
  if (unit_s_ == 0.0 || are_whole != are_whole_) {
    unit_s_ = are_whole ? 1e-9 : 1.0;
    is_unit_known_ = false;
  }
  are_whole_ = are_whole;
  if (stamp_ns_) {
    const double period_s = seconds_between(*stamp_ns_, stamp_ns);
    if (period_s > 0.0 && period_s <= kMaxPeriod_s) periods_s_.push_back(period_s);
    if (periods_s_.size() > kPeriods) periods_s_.pop_front();
  }
  stamp_ns_ = stamp_ns;

  Range range;
  bool are_finite = true;
  for (const double number : numbers) {
    are_finite = are_finite && std::isfinite(number);
    range.first = std::min(range.first, number);
    range.last = std::max(range.last, number);
  }
  if (are_finite && range.first <= range.last) {
    const bool may_be_one = unit_of(range, kMostPeriods[0]) || unit_s_ * range.length() <= most_s(kMostPeriods[0]);
    if (may_be_one) {
      if (const std::optional<CloudTimeScale> scale = scale_of(range, kMostPeriods[0])) return scale;
    }
  }
  std::vector<double> of_returns;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (has_return(i)) of_returns.push_back(numbers[i]);
  }
  return read_returns(std::move(of_returns));
}

}  // namespace situation_awareness
