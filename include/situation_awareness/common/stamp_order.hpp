// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

/// Checks the order of the stamps of one stream. They increase; one that repeats or goes back a little is refused. A
/// jump, ahead or far back, counts only when kAgreeing stamps in a row agree with it: they follow one another, and none
/// of the time before comes between them. Far back it is then a restart (a bag that loops, a simulation that is
/// restarted), ahead the stream was silent. A single one is doubted, and what comes next goes on as if it had not been.
///
/// A stamp is ahead where it is later than the latest by more than the usual period explains, unless the receipts of
/// both explain it: a stream that was silent for 30 s goes on at once. Receipts are by any clock that goes on as stamps
/// do; without them the period alone decides. A stamp that is late is none that is wrong: messages may be under way for
/// long.
class StampOrder {
 public:
  static constexpr std::int64_t kNone = std::numeric_limits<std::int64_t>::min();
  /// Stamps in a row that make a jump.
  static constexpr int kAgreeing = 3;
  /// Stamps in a row after which the period of a stream is known.
  static constexpr int kUsual = 5;
  /// Stamps in a row after which a stream is known to be in step with its receipts: by chance jitter of 0.2 s seems so
  /// once in 10 million stamps.
  static constexpr int kSteady = 20;
  /// A stamp is not ahead within so many usual periods, or so much time, after the latest. Two messages that are lost
  /// are more than the first; the second is less than the errors of stamps that do harm, and more than the jitter of
  /// receipts.
  static constexpr double kPeriods = 2.5;
  static constexpr double kLeast_s = 0.1;
  /// s. A stamp that goes back by more is of another time, as of a bag that loops; by less it is out of order. No
  /// source is recorded, and its sensitivity was not measured.
  static constexpr double kResetTimeJump_s = 1.0;

  enum class Verdict {
    kNext,
    kRestart,  ///< of time: what was known by earlier stamps is of another time
    kRefused   ///< repeats, goes back or is doubted
  };

  /// From now on stamps are those that another StampOrder has passed, of which some may be missing: each that is ahead
  /// is the next, and each far back a restart.
  void trust() { trusts_ = true; }

  /// As before the first stamp.
  void reset();

  /// `received_ns`: when the message came, kNone where it is not known.
  Verdict judge(std::int64_t stamp_ns, std::int64_t received_ns = kNone);

  /// The latest accepted stamp, kNone before the first.
  std::int64_t latest_ns() const { return latest_.stamp_ns; }

  /// How many stamps in a row are doubted, up to the latest; 0 if that repeats, goes back or was accepted.
  int doubted() const { return doubted_; }
  /// Whether the latest stamp was accepted since it agrees with those that were doubted before it.
  bool has_agreed() const { return has_agreed_; }
  /// Whether receipts explain the first of the stamps that are doubted, by a receipt at this time.
  bool explains_doubted(std::int64_t received_ns) const;
  /// Accepts those that are doubted, which are ahead.
  void accept_doubted();
  /// The usual period (s); 0 while it is not known.
  double period_s() const { return gaps_ < kUsual ? 0.0 : period_s_; }

 private:
  struct Stamp {
    std::int64_t stamp_ns = kNone, received_ns = kNone;
  };

  bool is_ahead(const Stamp& stamp) const;
  bool agrees(const Stamp& stamp) const;
  void doubt(const Stamp& stamp);
  void accept(const Stamp& stamp);
  Verdict take_doubted();

  bool trusts_ = false;
  Stamp latest_;
  int accepted_ = 0;       ///< in this stream, up to kUsual
  double period_s_ = 0.0;  ///< mean of the gaps lately
  int gaps_ = 0;           ///< in that mean, up to kUsual
  int in_step_ = 0;        ///< stamps in a row whose gap was that of their receipts, up to kSteady
  int doubted_ = 0;
  Stamp first_doubted_, latest_doubted_;
  bool has_agreed_ = false;
};

}  // namespace situation_awareness
