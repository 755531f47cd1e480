// SPDX-License-Identifier: BSD-3-Clause
#include "stations.hpp"

#include <algorithm>

namespace situation_awareness {

void StationShares::share_out(bool closed, std::size_t count, double from_s, double to_s,
                              std::vector<Station>& stations) {
  // Share of the boundary up to a place: of the cells before that where it is, which is the last one that begins before
  // it, and of a part of that one.
  const auto begin_of = [&](std::size_t c) { return c == 0 && !closed ? -1e9 : cell_s_m[c]; };
  const auto share_of = [&](std::size_t c, double s) {
    const double end = c + 1 == share.size() && !closed ? 1e9 : cell_s_m[c + 1];
    return share[c] * (std::min(s, end) - std::max(begin_of(c), cell_s_m[0]));
  };
  share_before_.assign(1, 0.0);
  for (std::size_t c = 0; c + 1 < share.size(); ++c) {
    share_before_.push_back(share_before_.back() + share_of(c, cell_s_m[c + 1]));
  }
  const auto amount = [&](double s) {
    const auto last = cell_s_m.begin() + static_cast<std::ptrdiff_t>(share.size());
    const auto after = static_cast<std::size_t>(std::lower_bound(cell_s_m.begin(), last, s) - cell_s_m.begin());
    const std::size_t c = after > 0 ? after - 1 : 0;
    return share_before_[c] + share_of(c, s);
  };
  const double whole = closed ? amount(to_s) : 0.0;
  const auto amount_wrapped = [&](double s) { return closed && s > to_s ? whole + amount(s - to_s) : amount(s); };
  const auto place_of = [&](double wanted, double low, double high) {
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (amount_wrapped(middle) < wanted ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  pieces_.clear();
  if (closed) {
    if (stations.empty()) stations.push_back({from_s, Station::kNoCorner});
    for (std::size_t i = 0; i < stations.size(); ++i) {
      const double end = i + 1 < stations.size() ? stations[i + 1].s_m : stations[0].s_m + (to_s - from_s);
      pieces_.push_back({stations[i], end, 0.0, 1});
    }
  } else {
    Station at{from_s, Station::kNoCorner};
    for (const Station& station : stations) {
      pieces_.push_back({at, station.s_m, 0.0, 1});
      at = station;
    }
    pieces_.push_back({at, to_s, 0.0, 1});
  }
  const std::size_t intervals = closed ? count : count - 1;
  for (Piece& piece : pieces_) piece.amount = amount_wrapped(piece.end_s_m) - amount_wrapped(piece.begin.s_m);
  for (std::size_t used = pieces_.size(); used < intervals; ++used) {
    const auto coarser = [](const Piece& a, const Piece& b) {
      return a.amount * static_cast<double>(b.intervals) < b.amount * static_cast<double>(a.intervals);
    };
    ++std::max_element(pieces_.begin(), pieces_.end(), coarser)->intervals;
  }
  stations.clear();
  for (const Piece& piece : pieces_) {
    stations.push_back(piece.begin);
    const double begin = amount_wrapped(piece.begin.s_m);
    for (std::size_t i = 1; i < piece.intervals; ++i) {
      const double wanted = begin + piece.amount * static_cast<double>(i) / static_cast<double>(piece.intervals);
      stations.push_back({place_of(wanted, piece.begin.s_m, piece.end_s_m), Station::kNoCorner});
    }
  }
  if (!closed) stations.push_back({to_s, Station::kNoCorner});
}

}  // namespace situation_awareness
