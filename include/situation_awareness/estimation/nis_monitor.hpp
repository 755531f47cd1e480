// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace situation_awareness {

/// Checks the consistency of a filter: its normalised innovation squared, nu^T S^-1 nu, per degree of freedom, is 1 on
/// average (Bar-Shalom, Li and Kirubarajan, 2001, Sect. 5.4).
class NisMonitor {
 public:
  struct Summary {
    std::uint64_t matches = 0;  ///< since the previous summary; 0: the other fields are invalid
    double mean = 0.0;          ///< per degree of freedom
    double low = 0.0;   ///< the mean of a consistent filter over this many independent matches lies in [low, high] ...
    double high = 0.0;  ///< ... with probability 0.95
    bool too_certain = false;  ///< the last kPersistent summaries with matches were all above both bounds
  };

  /// The mean must exceed this as well as `high`, since successive innovations are not independent.
  static constexpr double kTooCertain = 1.5;
  static constexpr int kPersistent = 10;

  explicit NisMonitor(int degrees_of_freedom) : degrees_of_freedom_(degrees_of_freedom) {}

  /// Add `matches` innovations whose squared Mahalanobis distances sum up to `mahalanobis2`.
  void add(std::uint64_t matches, double mahalanobis2) {
    matches_ += matches;
    mahalanobis2_ += mahalanobis2;
  }

  /// Summary of the innovations added since the previous one.
  Summary summarise();

 private:
  int degrees_of_freedom_;
  std::uint64_t matches_ = 0;
  double mahalanobis2_ = 0.0;
  int above_ = 0;  ///< summaries in a row
};

}  // namespace situation_awareness
