// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <cmath>

#include "chain_cover.hpp"
#include "semantic_map_parts.hpp"

namespace situation_awareness {
namespace {

/// Part of a chain that others cover from which on it is no feature of its own, and down to which it stays none.
constexpr double kDoubled = 0.6, kStaysDoubled = 0.45;
/// m. So much of it may be beside none.
constexpr double kBare_m = 0.3, kStaysBare_m = 0.5;
/// What is settled may unsettle what is beside it, so often at most.
constexpr int kMostRounds = 5;
/// A chain that was the longer one stays it until the other is so many times as long.
constexpr double kLonger = 1.25;
/// m. Steps in which it is found what is covered.
constexpr double kCoverStep_m = 0.05;
/// m. A covered end that is shorter is shown.
constexpr double kLeastEnd_m = 0.05;

}  // namespace

/// Whether the first of two chains of one surface is the one that shows it.
bool SemanticMap::is_before(const ChainEntry& a, const ChainEntry& b) const {
  const double bonus_a = b.beside == a.handle ? kLonger : 1.0, bonus_b = a.beside == b.handle ? kLonger : 1.0;
  const double length_a_m = bonus_a * a.length_m, length_b_m = bonus_b * b.length_m;
  return length_a_m != length_b_m ? length_a_m > length_b_m : a.handle < b.handle;
}

/// The rule of surfaces: where noise or drift drew one twice, the longer chain shows it. A shorter one that is beside
/// it almost everywhere is a part of it; else its ends that are beside it are left out. To be called for those chains
/// (unsettled_) that changed, or beside which one changed.
void SemanticMap::settle_overlaps() {
  for (int round = 0; round < kMostRounds && !unsettled_.empty(); ++round) {
    settling_.clear();
    settling_.swap(unsettled_);
    std::sort(settling_.begin(), settling_.end());
    settling_.erase(std::unique(settling_.begin(), settling_.end()), settling_.end());
    settling_.erase(std::remove_if(settling_.begin(), settling_.end(),
                                   [this](Handle handle) { return find_chain(handle) == nullptr; }),
                    settling_.end());
    std::sort(settling_.begin(), settling_.end(), [this](Handle a, Handle b) {
      const ChainEntry &chain_a = *find_chain(a), &chain_b = *find_chain(b);
      return chain_a.length_m != chain_b.length_m ? chain_a.length_m > chain_b.length_m : a < b;
    });
    for (const Handle handle : settling_) settle(*find_chain(handle));
  }
  unsettled_.clear();
}

void SemanticMap::settle(ChainEntry& chain) {
  find_near(chain.latest);
  others_.clear();
  for (const Handle handle : near_) {
    const ChainEntry& other = *find_chain(handle);
    if (handle == chain.handle || other.beside != 0 || !is_before(other, chain)) continue;
    others_.push_back({handle, 0});
  }
  double covered_m = 0.0, at_m = 0.0, begin_m = 0.0, end_m = chain.length_m;
  bool is_at_begin = true;
  for_each_step(chain.latest, kCoverStep_m,
                [&](const Eigen::Vector2d& p_m, const Eigen::Vector2d& along, double step_m) {
                  at_m += step_m;
                  const auto other = std::find_if(others_.begin(), others_.end(), [&](const Overlap& candidate) {
                    return is_beside(p_m, along, find_chain(candidate.chain)->latest);
                  });
                  if (other == others_.end()) {
                    is_at_begin = false;
                    end_m = at_m;
                    return;
                  }
                  ++other->steps;
                  covered_m += step_m;
                  if (is_at_begin) begin_m = at_m;
                });
  const bool was_beside = chain.beside != 0;
  const auto most = std::max_element(others_.begin(), others_.end(),
                                     [](const Overlap& a, const Overlap& b) { return a.steps < b.steps; });
  const double least = was_beside ? kStaysDoubled : kDoubled;
  const double bare_m = chain.length_m - covered_m;
  const bool is_covered = covered_m >= least * chain.length_m && bare_m <= (was_beside ? kStaysBare_m : kBare_m);
  const Handle beside = most != others_.end() && is_covered ? most->chain : 0;
  if (beside != 0 || chain.latest.closed || begin_m < kLeastEnd_m) begin_m = 0.0;
  if (beside != 0 || chain.latest.closed || chain.length_m - end_m < kLeastEnd_m) end_m = chain.length_m;
  const bool is_same = beside == chain.beside && begin_m == chain.begin_m && end_m == chain.end_m;
  chain.beside = beside;
  chain.begin_m = begin_m;
  chain.end_m = end_m;
  if (is_same) return;
  if (was_beside != (beside != 0)) unsettle_near(chain);
  touched_.push_back(chain.id);
  if (beside == 0) {
    new_.push_back(chain.handle);
  } else {
    joined_.push_back(chain.handle);
  }
}

}  // namespace situation_awareness
