// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/stamp_statistics.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// A step is a gap if it is longer than so many periods, and than this.
constexpr double kGapPeriods = 3.0, kGap_s = 0.5;
/// Messages come in bursts where so much of them is received within this part of a period after the one before.
constexpr double kBurstPart = 0.5, kBurstPeriods = 0.2;

template <class Value>
Value median(std::vector<Value> values) {
  if (values.empty()) return {};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void StampStatistics::add(std::int64_t stamp_ns, std::int64_t received_ns) {
  if (!stamps_ns_.empty()) waits_s_.push_back(seconds_between(last_received_ns_, received_ns));
  last_received_ns_ = received_ns;
  stamps_ns_.push_back(stamp_ns);
  lags_ns_.push_back(received_ns - stamp_ns);
}

double StampStatistics::period_s() const {
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < stamps_ns_.size(); ++i) {
    if (stamps_ns_[i] > stamps_ns_[i - 1]) steps_s.push_back(seconds_between(stamps_ns_[i - 1], stamps_ns_[i]));
  }
  return median(std::move(steps_s));
}

double StampStatistics::lag_s() const { return 1e-9 * static_cast<double>(median(lags_ns_)); }

void StampStatistics::report(TopicReport& report) const {
  const double period_s = this->period_s();
  std::size_t repeated = 0, back = 0, gaps = 0;
  double longest_s = 0.0;
  for (std::size_t i = 1; i < stamps_ns_.size(); ++i) {
    const double step_s = seconds_between(stamps_ns_[i - 1], stamps_ns_[i]);
    if (step_s == 0.0) ++repeated;
    if (step_s < 0.0) ++back;
    if (step_s > std::max(kGapPeriods * period_s, kGap_s)) {
      ++gaps;
      longest_s = std::max(longest_s, step_s);
    }
  }
  std::string line = formatted("%zu messages", count());
  if (period_s > 0.0) line += formatted(", %.4g Hz", 1.0 / period_s);
  if (gaps > 0) line += formatted(", %zu gaps of up to %.1f s", gaps, longest_s);
  if (count() > 0) {
    const double lag_s = this->lag_s();
    line += formatted(", stamped %.3f s %s receipt", std::abs(lag_s), lag_s < 0.0 ? "after" : "before");
  }
  report.facts.push_back(line);
  if (count() == 0) return;

  if (std::all_of(stamps_ns_.begin(), stamps_ns_.end(), [](std::int64_t stamp_ns) { return stamp_ns == 0; })) {
    report.findings.push_back({"all stamps are zero", "let the driver stamp its messages"});
    return;
  }
  if (repeated > 0) {
    report.findings.push_back({formatted("%zu of %zu stamps are those of the message before", repeated, count()),
                               "such messages are not used: let the driver stamp each by its own time"});
  }
  if (back > 0) {
    report.findings.push_back({formatted("stamps go back %zu times", back),
                               "a jump back by more than 1 s begins a new map; else such messages are not used"});
  }
  const auto bursts = static_cast<double>(std::count_if(
      waits_s_.begin(), waits_s_.end(), [&](double wait_s) { return wait_s < kBurstPeriods * period_s; }));
  if (period_s > 0.0 && bursts > kBurstPart * static_cast<double>(waits_s_.size())) {
    report.facts.push_back(formatted("received in bursts: %.0f %% within %.1f ms of the one before",
                                     1e2 * bursts / static_cast<double>(waits_s_.size()),
                                     1e3 * kBurstPeriods * period_s));
  }
}

}  // namespace situation_awareness
