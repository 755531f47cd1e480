// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/stamp_order.hpp"

#include <algorithm>
#include <cmath>

namespace situation_awareness {
namespace {

/// Of the gaps that the mean is of: it follows a change of the rate within a second at 10 Hz, and one gap hardly moves
/// it.
constexpr double kShare = 0.1;
/// Receipts are in step with stamps where their gaps differ by no more than this; a stamp that is then ahead of its
/// receipt by the other is wrong, however long the period is.
constexpr double kInStep_s = 0.05, kOutOfStep_s = 0.15;

}  // namespace

void StampOrder::reset() {
  latest_ = first_doubted_ = latest_doubted_ = {};
  accepted_ = gaps_ = in_step_ = doubted_ = 0;
  period_s_ = 0.0;
  has_agreed_ = false;
}

/// Later than the latest stamp by more than the period and the receipts explain; of receipts that were in step with the
/// stamps before, by more than they explain.
bool StampOrder::is_ahead(const Stamp& stamp) const {
  const double gap_s = seconds_between(latest_.stamp_ns, stamp.stamp_ns);
  if (gap_s <= kLeast_s) return false;
  const bool has_receipts = stamp.received_ns != kNone && latest_.received_ns != kNone;
  if (!has_receipts) return gaps_ >= kUsual && gap_s > kPeriods * period_s_;
  const double off_s = gap_s - seconds_between(latest_.received_ns, stamp.received_ns);
  if (off_s <= kLeast_s) return false;
  if (in_step_ >= kSteady && off_s > kOutOfStep_s) return true;
  return gap_s > (gaps_ > 0 ? kPeriods * period_s_ : kResetTimeJump_s);
}

/// Whether it follows those that are doubted, within what they are off: two wrong ones rarely do.
bool StampOrder::agrees(const Stamp& stamp) const {
  if (doubted_ == 0 || stamp.stamp_ns <= latest_doubted_.stamp_ns) return false;
  const double off_s = std::abs(seconds_between(latest_.stamp_ns, first_doubted_.stamp_ns));
  const double gap_s = seconds_between(latest_doubted_.stamp_ns, stamp.stamp_ns);
  return gap_s <= std::max(off_s, kPeriods * period_s_);
}

void StampOrder::doubt(const Stamp& stamp) {
  if (agrees(stamp)) {
    ++doubted_;
  } else {
    doubted_ = 1;
    first_doubted_ = stamp;
  }
  latest_doubted_ = stamp;
}

void StampOrder::accept(const Stamp& stamp) {
  if (latest_.stamp_ns != kNone && stamp.stamp_ns > latest_.stamp_ns) {
    const double gap_s = seconds_between(latest_.stamp_ns, stamp.stamp_ns);
    // A silence is no period.
    const double usual_s = gaps_ < kUsual ? gap_s : std::min(gap_s, 2.0 * std::max(kPeriods * period_s_, kLeast_s));
    gaps_ = std::min(gaps_ + 1, kUsual);
    period_s_ += std::max(kShare, 1.0 / gaps_) * (usual_s - period_s_);
    const bool is_in_step = stamp.received_ns != kNone && latest_.received_ns != kNone &&
                            std::abs(seconds_between(latest_.received_ns, stamp.received_ns) - gap_s) <= kInStep_s;
    in_step_ = is_in_step ? std::min(in_step_ + 1, kSteady) : 0;
  }
  accepted_ = std::min(accepted_ + 1, kUsual);
  latest_ = stamp;
  doubted_ = 0;
}

/// Time goes on with those that are doubted, at their pace.
StampOrder::Verdict StampOrder::take_doubted() {
  // One stamp alone is outvoted, too, if it was the first.
  const bool restarts = latest_doubted_.stamp_ns <= latest_.stamp_ns || accepted_ == 1;
  const Stamp latest = latest_doubted_;
  const double pace_s = seconds_between(first_doubted_.stamp_ns, latest.stamp_ns) / std::max(doubted_ - 1, 1);
  if (doubted_ > 1) period_s_ = pace_s;
  in_step_ = 0;
  latest_ = {};
  accept(latest);
  accepted_ = kUsual;
  return restarts ? Verdict::kRestart : Verdict::kNext;
}

bool StampOrder::explains_doubted(std::int64_t received_ns) const {
  if (doubted_ == 0 || received_ns == kNone || latest_.received_ns == kNone) return false;
  if (first_doubted_.stamp_ns <= latest_.stamp_ns) return false;
  return seconds_between(latest_.stamp_ns, first_doubted_.stamp_ns) <=
         seconds_between(latest_.received_ns, received_ns);
}

void StampOrder::accept_doubted() {
  if (doubted_ > 0) take_doubted();
}

StampOrder::Verdict StampOrder::judge(std::int64_t stamp_ns, std::int64_t received_ns) {
  const Stamp stamp{stamp_ns, received_ns};
  has_agreed_ = false;
  const bool is_first = latest_.stamp_ns == kNone;
  if (is_first || (stamp_ns > latest_.stamp_ns && (trusts_ || !is_ahead(stamp)))) {
    accept(stamp);
    return Verdict::kNext;
  }
  if (stamp_ns <= latest_.stamp_ns) {
    if (seconds_between(stamp_ns, latest_.stamp_ns) <= kResetTimeJump_s) {
      doubted_ = 0;  // time goes on as before
      return Verdict::kRefused;
    }
    if (trusts_) {
      accept(stamp);
      return Verdict::kRestart;
    }
  }
  doubt(stamp);
  if (doubted_ < kAgreeing) return Verdict::kRefused;
  has_agreed_ = true;
  return take_doubted();
}

}  // namespace situation_awareness
