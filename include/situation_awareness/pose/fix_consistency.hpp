// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "situation_awareness/common/stamp_order.hpp"

namespace situation_awareness {

/// Compares the fixes of a receiver with what came along with them, without a filter: their stamps with those of the
/// IMU by when both were received, and their altitudes with one another. Time and memory are bounded.
class FixConsistency {
 public:
  FixConsistency();

  /// Stamps of a sample of the IMU and of a fix; `received_ns` of both by the same clock, whichever it is. Those
  /// without a receipt (StampOrder::kNone) tell nothing.
  void add_imu(std::int64_t stamp_ns, std::int64_t received_ns) { imu_.add(stamp_ns, received_ns); }
  void add_fix(std::int64_t stamp_ns, std::int64_t received_ns) { fixes_.add(stamp_ns, received_ns); }

  /// Altitude of a fix (m) with its standard deviation.
  void add_altitude(std::int64_t stamp_ns, double altitude_m, double sigma_m);

  /// By how much the stamps of the fixes are ahead of those of the IMU (s), with its standard deviation; none while it
  /// is not known.
  struct Lead {
    double lead_s, sigma_s;
  };
  std::optional<Lead> lead() const;

  /// One sentence if the stamps contradict their receipts, where fixes later than `most_late_s` are not used, or if
  /// altitudes jump by what no vehicle climbs; else empty.
  std::string contradiction(double most_late_s) const;

 private:
  /// The delays of the latest messages of a topic.
  class Delays {
   public:
    Delays(std::size_t most, double apart_s) : most_(most), apart_s_(apart_s) { seconds_.reserve(most); }
    void add(std::int64_t stamp_ns, std::int64_t received_ns);
    bool is_known() const { return seconds_.size() == most_; }
    /// Their median, and their standard deviation by their median deviation.
    Lead median() const;

   private:
    std::size_t most_, next_ = 0;
    double apart_s_;                                ///< what is received earlier after another is left out
    std::int64_t received_ns_ = StampOrder::kNone;  ///< of the latest
    std::vector<double> seconds_;                   ///< a ring
  };

  Delays imu_, fixes_;
  std::int64_t altitude_stamp_ns_ = StampOrder::kNone;
  double altitude_m_ = 0.0, altitude_sigma_m_ = 0.0;
  int off_ = 0;          ///< altitudes that are far from that
  double jump_m_ = 0.0;  ///< of the latest of them
  bool has_jumped_ = false;
};

}  // namespace situation_awareness
