// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace situation_awareness {

/// A place along a boundary for a main vertex.
struct Station {
  static constexpr std::size_t kNoCorner = static_cast<std::size_t>(-1);

  double s_m;
  std::size_t corner;  ///< index of what is there, or kNoCorner
};

/// Shares of main vertices along a boundary.
class StationShares {
 public:
  /// Stations of `count` nodes from `from_s` to `to_s`, of a closed boundary the same place, between those that are
  /// set: the corners. Equal parts of `share`.
  void share_out(bool closed, std::size_t count, double from_s, double to_s, std::vector<Station>& stations);

  std::vector<double> cell_s_m;  ///< begins of cells, and the end of the last
  std::vector<double> share;     ///< density in each cell

 private:
  /// The boundary between corners.
  struct Piece {
    Station begin;
    double end_s_m, amount;
    std::size_t intervals;
  };

  std::vector<Piece> pieces_;
  std::vector<double> share_before_;  ///< of the cells before each, in sum
};

}  // namespace situation_awareness
