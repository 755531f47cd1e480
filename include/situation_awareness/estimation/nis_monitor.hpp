// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace situation_awareness {

/// Whether a filter's innovations are as large as it says: the normalised innovation squared, nu^T S^-1 nu, per degree
/// of freedom, is 1 on average if they are (Bar-Shalom, Li and Kirubarajan, 2001, Sect. 5.4).
class NisMonitor {
 public:
  struct Summary {
    std::uint64_t matches = 0;  ///< since the summary before; 0: nothing else below means anything
    double mean = 0.0;          ///< per degree of freedom
    double low = 0.0;           ///< a consistent filter's mean over so many independent matches lies in [low, high] ...
    double high = 0.0;          ///< ... with probability 0.95
    bool too_certain = false;   ///< the last kPersistent summaries with matches were all above both bounds
  };

  /// Only a mean above this as well as above `high` counts: successive innovations are not independent.
  static constexpr double kTooCertain = 1.5;
  static constexpr int kPersistent = 10;

  explicit NisMonitor(int degrees_of_freedom) : degrees_of_freedom_(degrees_of_freedom) {}

  /// `matches` more innovations, of which the squared Mahalanobis distances sum up to `mahalanobis2`.
  void add(std::uint64_t matches, double mahalanobis2) {
    matches_ += matches;
    mahalanobis2_ += mahalanobis2;
  }

  /// Of what was added since the summary before.
  Summary summarise();

 private:
  int degrees_of_freedom_;
  std::uint64_t matches_ = 0;
  double mahalanobis2_ = 0.0;
  int above_ = 0;  ///< summaries in a row
};

}  // namespace situation_awareness
