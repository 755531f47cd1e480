// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include <sensor_msgs/LaserScan.h>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/pipeline/scanner_check.hpp"
#include "situation_awareness/ros/check/topic_check.hpp"

namespace situation_awareness {

/// Beams, missing returns, intensities and times of the scans of a topic.
class ScanTopicCheck : public MessageCheck<sensor_msgs::LaserScan> {
 public:
  using MessageCheck::MessageCheck;

  /// Number of scans that can be used.
  std::size_t good() const { return good_; }

 protected:
  void look(const sensor_msgs::LaserScan& msg) override;
  void add_to(TopicReport& report) const override;

 private:
  void add_times(TopicReport& report) const;

  Counters defects_;
  ScannerCheck convention_{ScannerParams{}, 0.0};
  sensor_msgs::LaserScan first_;  ///< that can be used
  std::size_t good_ = 0, fewest_beams_ = 0, most_beams_ = 0;
  std::size_t beams_ = 0, hits_ = 0, infinite_ = 0, too_close_ = 0, at_max_ = 0, beyond_max_ = 0, nan_ = 0, zero_ = 0;
  double largest_m_ = 0.0;  ///< of the finite ranges
  std::size_t intensities_ = 0;
  float dimmest_ = 0.0F, brightest_ = 0.0F;
};

}  // namespace situation_awareness
