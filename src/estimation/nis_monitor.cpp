// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/nis_monitor.hpp"

#include <algorithm>

#include "situation_awareness/estimation/gating.hpp"

namespace situation_awareness {

NisMonitor::Summary NisMonitor::summarise() {
  Summary summary;
  summary.matches = matches_;
  if (matches_ > 0) {
    const double degrees = static_cast<double>(matches_) * degrees_of_freedom_;
    summary.mean = mahalanobis2_ / degrees;
    summary.low = chi_square_quantile(0.025, degrees) / degrees;
    summary.high = chi_square_quantile(0.975, degrees) / degrees;
    above_ = summary.mean > std::max(summary.high, kTooCertain) ? std::min(above_ + 1, kPersistent) : 0;
  }
  summary.too_certain = above_ == kPersistent;
  matches_ = 0;
  mahalanobis2_ = 0.0;
  return summary;
}

}  // namespace situation_awareness
