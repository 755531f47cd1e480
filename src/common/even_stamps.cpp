// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/even_stamps.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// Stamps, and bunches of them, by which it is told whether they are bunched.
constexpr std::size_t kFewest = 40, kFewestBunches = 3;
/// A gap is one within a bunch below this share of the mean gap, and one between bunches above that; white jitter of a
/// fifth of the period makes one in 300 gaps so small.
constexpr double kWithinBunch = 0.25, kBetweenBunches = 1.0;
/// Share of the gaps that are within bunches: half of them in pairs, more in larger ones.
constexpr double kBunched = 0.35;
/// Stamps after which it is looked again, where nothing changes.
constexpr std::uint64_t kAgain = 128;
/// A line is one where the bunches are off it by less than so many periods, root mean square.
constexpr double kOffLine = 2.0;
/// s. Equal stamps may differ by the rounding of seconds in double precision.
constexpr double kRounding_s = 1e-6;
/// s. Receipts and stamps are of one clock where they differ by less; a stamp after its receipt by more is impossible.
constexpr double kSameClock_s = 5.0, kAfterReceipt_s = 0.002;

}  // namespace

std::int64_t EvenStamps::Line::at(std::uint64_t other) const {
  return begin_ns + nanoseconds(period_s * (static_cast<double>(other) - static_cast<double>(number)));
}

void EvenStamps::clear() {
  latest_.clear();
  is_bunched_ = false;
  line_.reset();
  given_ns_ = StampOrder::kNone;
}

std::int64_t EvenStamps::add(std::int64_t stamp_ns, std::int64_t received_ns) {
  const double gap_before_s = gap_s_;
  gap_s_ = latest_.empty() ? 0.0 : seconds_between(latest_.back().stamp_ns, stamp_ns);
  if (std::abs(gap_s_) > StampOrder::kResetTimeJump_s * 2.0) clear();
  if (latest_.size() == kMost) latest_.erase(latest_.begin(), latest_.begin() + kMost / 4);
  const std::uint64_t number = number_++;
  latest_.push_back({number, stamp_ns, received_ns});
  if (gap_s_ > 2.0 * gap_before_s || number - looked_ >= kAgain) {
    looked_ = number;
    look();
  }
  if (!line_) return stamp_ns;
  // The line moves a little with each bunch, but never back over a measurement.
  const std::int64_t least_ns = given_ns_ + nanoseconds(kWithinBunch * line_->period_s);
  const std::int64_t even_ns = line_->at(number);
  given_ns_ = given_ns_ == StampOrder::kNone ? even_ns : std::max(even_ns, least_ns);
  return given_ns_;
}

/// Whether the stamps up to now are bunched, and by which line they are spread.
void EvenStamps::look() {
  is_bunched_ = false;
  const std::optional<Line> before = line_;
  line_.reset();
  if (latest_.size() < kFewest) return;
  const double mean_s =
      seconds_between(latest_.front().stamp_ns, latest_.back().stamp_ns) / static_cast<double>(latest_.size() - 1);
  std::size_t within = 0, bunches = 0;
  for (std::size_t i = 1; i < latest_.size(); ++i) {
    const double gap_s = seconds_between(latest_[i - 1].stamp_ns, latest_[i].stamp_ns);
    if (gap_s < -kRounding_s) return;
    if (gap_s < kWithinBunch * mean_s) ++within;
    if (gap_s > kBetweenBunches * mean_s) ++bunches;
  }
  if (bunches < kFewestBunches) return;
  if (static_cast<double>(within) < kBunched * static_cast<double>(latest_.size() - 1)) return;
  is_bunched_ = true;
  line_ = through(true, mean_s);
  const std::optional<Line> by_first = through(false, mean_s);
  if (by_first && line_ && !is_after_receipts(*by_first)) line_ = by_first;
  if (!line_) given_ns_ = StampOrder::kNone;
  if (line_ && !before) given_ns_ = StampOrder::kNone;
}

/// By the last or the first stamps of the bunches that are whole.
std::optional<EvenStamps::Line> EvenStamps::through(bool lasts, double mean_s) const {
  const Stamp& origin = latest_.front();
  double count = 0.0, n = 0.0, t = 0.0, nn = 0.0, nt = 0.0, tt = 0.0;
  for (std::size_t i = 1; i < latest_.size(); ++i) {
    if (seconds_between(latest_[i - 1].stamp_ns, latest_[i].stamp_ns) <= kBetweenBunches * mean_s) continue;
    const Stamp& of = latest_[lasts ? i - 1 : i];
    const auto x = static_cast<double>(of.number - origin.number);
    const double y = seconds_between(origin.stamp_ns, of.stamp_ns);
    count += 1.0;
    n += x;
    t += y;
    nn += x * x;
    nt += x * y;
    tt += y * y;
  }
  const double variance = nn - n * n / count, covariance = nt - n * t / count;
  if (!(variance > 0.0)) return std::nullopt;
  const double period_s = covariance / variance;
  const double off_s2 = std::max(tt - t * t / count - period_s * covariance, 0.0) / count;
  if (!(period_s > 0.0) || std::sqrt(off_s2) > kOffLine * period_s) return std::nullopt;
  return Line{origin.number, origin.stamp_ns + nanoseconds((t - period_s * n) / count), period_s};
}

/// Whether measurements would have been received before they were made, or that is not known.
bool EvenStamps::is_after_receipts(const Line& line) const {
  for (const Stamp& stamp : latest_) {
    if (stamp.received_ns == StampOrder::kNone) return true;
    const double late_s = seconds_between(line.at(stamp.number), stamp.received_ns);
    if (late_s < -kAfterReceipt_s || late_s > kSameClock_s) return true;
  }
  return false;
}

}  // namespace situation_awareness
