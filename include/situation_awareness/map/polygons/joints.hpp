// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace situation_awareness {

/// Whether two chains meet (at a corner, or beyond a gap), by all scans that saw it: at a distance of a few cm, single
/// scans say now this, now that, and ids would go with it. No allocation after warm-up.
class Joints {
 public:
  /// Of two chains, by their ids.
  struct Joint {
    std::uint64_t low = 0, high = 0;    ///< ids, low < high
    double share = 0.0;                 ///< part of the time seen in which they met; the latest counts most
    double seen_s = 0.0;                ///< that time, as far as it counts
    bool joined = false;                ///< the decision
    bool met = false, is_seen = false;  ///< in the latest scan, until the decision
  };

  /// Whether chain `a` and chain `b` are joined; `meet`: what the elements say, of those that are not known.
  bool are_joined(std::uint64_t a, std::uint64_t b, bool meet) const;

  /// Whether they are, and were seen for long.
  bool is_firm(std::uint64_t a, std::uint64_t b) const;

  /// What this scan's elements say. Of several places at which two chains may meet, one is enough.
  void see(std::uint64_t a, std::uint64_t b, bool meet);

  /// Takes back what was seen since the latest decision of joints of which are_here(low, high) does not hold.
  template <class AreHere>
  void unsee_unless(const AreHere& are_here) {
    const auto end = std::remove_if(seen_.begin(), seen_.end(), [&](const auto& ids) {
      if (are_here(ids.first, ids.second)) return false;
      unsee(ids.first, ids.second);
      return true;
    });
    seen_.erase(end, seen_.end());
  }

  /// Decides, `step_s` after the scan before.
  void decide(double step_s);

  /// Forgets those of these chains; sorted.
  void forget(const std::vector<std::uint64_t>& ids);

 private:
  void unsee(std::uint64_t low, std::uint64_t high);

  std::vector<Joint> joints_;                                  ///< sorted by ids
  std::vector<std::pair<std::uint64_t, std::uint64_t>> seen_;  ///< ids of those seen in the latest scan
};

}  // namespace situation_awareness
