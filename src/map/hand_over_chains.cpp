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
/// A chain that was the longer one stays it until the other is so many times as long.
constexpr double kLonger = 1.25;
/// m. Steps in which it is found what is covered.
constexpr double kCoverStep_m = 0.05;
/// m. Less than this of an end stays covered.
constexpr double kLeastEnd_m = 0.05;

}  // namespace

/// Of two chains of one surface, the one that shows it.
bool SemanticMap::is_before(const ChainEntry& a, const ChainEntry& b) const {
  const double bonus_a = b.beside == a.handle ? kLonger : 1.0, bonus_b = a.beside == b.handle ? kLonger : 1.0;
  const double length_a_m = bonus_a * a.length_m, length_b_m = bonus_b * b.length_m;
  return length_a_m != length_b_m ? length_a_m > length_b_m : a.handle < b.handle;
}

/// The rule of surfaces: where noise or drift drew one twice, the longer chain shows it. A shorter one that is beside
/// it almost everywhere is a part of it; else its ends that are beside it are left out. To be called for those chains
/// (unsettled_) that changed, or beside which one changed.
void SemanticMap::settle_doubles() {
  std::sort(unsettled_.begin(), unsettled_.end());
  unsettled_.erase(std::unique(unsettled_.begin(), unsettled_.end()), unsettled_.end());
  unsettled_.erase(std::remove_if(unsettled_.begin(), unsettled_.end(),
                                  [this](Handle handle) { return find_chain(handle) == nullptr; }),
                   unsettled_.end());
  std::sort(unsettled_.begin(), unsettled_.end(), [this](Handle a, Handle b) {
    const ChainEntry &line_a = *find_chain(a), &line_b = *find_chain(b);
    return line_a.length_m != line_b.length_m ? line_a.length_m > line_b.length_m : a < b;
  });
  for (const Handle handle : unsettled_) settle(*find_chain(handle));
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
                  const auto other = std::find_if(others_.begin(), others_.end(), [&](const Double& candidate) {
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
                                     [](const Double& a, const Double& b) { return a.steps < b.steps; });
  const double least = was_beside ? kStaysDoubled : kDoubled;
  const Handle beside = most != others_.end() && covered_m >= least * chain.length_m ? most->chain : 0;
  if (beside != 0 || chain.latest.closed || begin_m < kLeastEnd_m) begin_m = 0.0;
  if (beside != 0 || chain.latest.closed || chain.length_m - end_m < kLeastEnd_m) end_m = chain.length_m;
  const bool is_same = beside == chain.beside && begin_m == chain.begin_m && end_m == chain.end_m;
  chain.beside = beside;
  chain.begin_m = begin_m;
  chain.end_m = end_m;
  if (is_same) return;
  touched_.push_back(chain.id);
  if (beside == 0) {
    new_.push_back(chain.handle);
  } else if (chain.id != 0) {
    joined_.push_back(chain.handle);
  }
}

}  // namespace situation_awareness
