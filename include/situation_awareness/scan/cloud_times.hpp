// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "situation_awareness/scan/cloud_slice.hpp"

namespace situation_awareness {

/// What a driver's numbers for the times of a cloud's points mean.
struct CloudTimeScale {
  double unit_s = 0.0;             ///< of a number
  double at_stamp_s = 0.0;         ///< what the number would be at the cloud's stamp, in s
  double first = 0.0, last = 0.0;  ///< numbers beyond are no times
  std::size_t bad_points = 0;      ///< with a return, whose numbers are none

  CloudTimes times() const { return {unit_s * first - at_stamp_s, unit_s * last - at_stamp_s}; }

  /// After the stamp; NaN where the number is no time.
  double time_s(double number) const {
    return number >= first && number <= last ? unit_s * number - at_stamp_s : std::numeric_limits<double>::quiet_NaN();
  }
};

/// Finds out what the numbers mean, from those of each cloud, its stamp, and the stamps before.
///
/// The unit is that of s, ms, us and ns by which they last about as long as it is from cloud to cloud; numbers from 0
/// to 1 that would last longer are parts of this period. They count from the stamp or from the beginning of the clock,
/// or else from another time, such as the boot of the sensor: then the first point is taken for that of the stamp.
/// Numbers without such a unit are s, or whole ones ns.
class CloudTimeReader {
 public:
  /// `numbers`: of all points; `has_return` says of which the number counts where not all can be times; up to a tenth
  /// of these may be bad. None: they are no times.
  std::optional<CloudTimeScale> read(const std::vector<double>& numbers,
                                     const std::function<bool(std::size_t)>& has_return, bool are_whole,
                                     std::int64_t stamp_ns);

 private:
  struct Range;
  std::optional<double> period_s() const;
  double most_s(double periods) const;
  std::optional<double> unit_of(const Range& range, double most_periods) const;
  bool are_parts(const Range& range) const;
  std::optional<CloudTimeScale> near_scale(const Range& range, double unit_s) const;
  std::optional<CloudTimeScale> scale_of(const Range& range, double most_periods);
  std::optional<CloudTimeScale> read_returns(std::vector<double> numbers);

  std::optional<std::int64_t> stamp_ns_;
  std::deque<double> periods_s_;  ///< between the latest clouds
  double unit_s_ = 0.0;           ///< of the cloud before, or by the type of the numbers
  bool is_unit_known_ = false;    ///< else by the type
  bool are_whole_ = false;
};

}  // namespace situation_awareness
