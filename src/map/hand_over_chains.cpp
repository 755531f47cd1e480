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
constexpr double kCoverStep_m = 0.025;
/// m. A shorter run of what is beside none is no end that is shown: two chains that meet at a corner are apart there.
constexpr double kShortRun_m = 0.06;
/// m. Of a shorter chain, from its ends that are shown: what is beside these are its own to leave out.
constexpr double kMiddle_m = 0.05;
/// m. A covered end that is shorter is shown, and so is all of what would be left of a chain.
constexpr double kLeastEnd_m = 0.02;
/// m. A chain that is at most so long, and all of which is so near to one that is so many times as long, is noise of
/// that, whichever way it faces.
constexpr double kPiece_m = 0.35, kPieceBeside_m = 0.15, kStaysPieceBeside_m = 0.2, kLongerThanPiece = 2.0;

}  // namespace

/// Whether the first of two chains of one surface is the one that shows it: what a boundary is drawn of is shown by
/// that.
bool SemanticMap::is_before(const ChainEntry& a, const ChainEntry& b) const {
  if ((a.of_boundary != 0) != (b.of_boundary != 0)) return a.of_boundary != 0;
  const double bonus_a = b.beside == a.handle ? kLonger : 1.0, bonus_b = a.beside == b.handle ? kLonger : 1.0;
  const double length_a_m = bonus_a * a.length_m, length_b_m = bonus_b * b.length_m;
  return length_a_m != length_b_m ? length_a_m > length_b_m : a.handle < b.handle;
}

/// The rule of surfaces: where noise or drift drew one twice, the longer chain shows it. A shorter one that is beside
/// it almost everywhere is a part of it; else its ends that are beside it are left out, and so are the ends of the
/// longer one that are beside the middle of the shorter one. To be called for those chains (unsettled_) that changed,
/// or beside which one changed.
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

/// The longer chain of which a short one is a piece that noise drew in another direction, or 0.
SemanticMap::Handle SemanticMap::whole_of(const ChainEntry& chain) const {
  if (chain.length_m > kPiece_m) return 0;
  const double most_m = chain.beside != 0 ? kStaysPieceBeside_m : kPieceBeside_m;
  for (const Overlap& other : others_) {
    if (!other.is_before || other.length_m < kLongerThanPiece * chain.length_m) continue;
    if (is_all_beside(chain.latest, *other.line, most_m)) return other.chain;
  }
  return 0;
}

void SemanticMap::settle(ChainEntry& chain) {
  find_near(chain.latest);
  others_.clear();
  // A boundary may be drawn farther than its chains go now.
  for (const BoundaryEntry& boundary : boundaries_) {
    if (!boundary.is_boundary || boundary.main == 0 || chain.of_boundary == boundary.handle) continue;
    if (!boundary.box_world_m.intersects(chain.box_world_m)) continue;
    others_.push_back({boundary.main, 0, true, &boundary.outline, 0.0, boundary.length_m, boundary.length_m});
  }
  for (const bool before : {true, false}) {
    for (const Handle handle : near_) {
      const ChainEntry& other = *find_chain(handle);
      if (handle == chain.handle || other.beside != 0 || other.trace_of != 0 || is_before(other, chain) != before)
        continue;
      const double begin_m = before ? 0.0 : other.begin_m + kMiddle_m;
      const double end_m = before ? other.length_m : other.end_m - kMiddle_m;
      others_.push_back({handle, 0, before, &other.latest, begin_m, end_m, other.length_m});
    }
  }
  // What it shows ends with the last run of steps that is beside none.
  double covered_m = 0.0, at_m = 0.0, begin_m = 0.0, end_m = 0.0, run_m = 0.0;
  bool is_at_begin = true;
  for_each_step(chain.latest, kCoverStep_m,
                [&](const Eigen::Vector2d& p_m, const Eigen::Vector2d& along, double step_m) {
                  at_m += step_m;
                  const auto other = std::find_if(others_.begin(), others_.end(), [&](const Overlap& candidate) {
                    return is_beside(p_m, along, *candidate.line, candidate.begin_m, candidate.end_m);
                  });
                  if (other == others_.end()) {
                    run_m += step_m;
                    if (run_m <= kShortRun_m) return;
                    is_at_begin = false;
                    end_m = at_m;
                    return;
                  }
                  run_m = 0.0;
                  if (other->is_before) {
                    ++other->steps;
                    covered_m += step_m;
                  }
                  if (is_at_begin) begin_m = at_m;
                });
  const bool was_beside = chain.beside != 0;
  const auto most = std::max_element(others_.begin(), others_.end(),
                                     [](const Overlap& a, const Overlap& b) { return a.steps < b.steps; });
  const double least = was_beside ? kStaysDoubled : kDoubled;
  const double bare_m = chain.length_m - covered_m;
  const bool is_covered = covered_m >= least * chain.length_m && bare_m <= (was_beside ? kStaysBare_m : kBare_m);
  Handle beside = most != others_.end() && is_covered ? most->chain : 0;
  if (beside == 0) beside = whole_of(chain);
  const bool is_whole = beside != 0 || chain.latest.closed || end_m - begin_m < kLeastEnd_m;
  if (is_whole || begin_m < kLeastEnd_m) begin_m = 0.0;
  if (is_whole || chain.length_m - end_m < kLeastEnd_m) end_m = chain.length_m;
  const bool is_same = beside == chain.beside && begin_m == chain.begin_m && end_m == chain.end_m;
  chain.beside = beside;
  chain.begin_m = begin_m;
  chain.end_m = end_m;
  if (is_same) return;
  unsettle_near(chain.latest);
  touched_.push_back(chain.id);
  if (beside == 0) {
    new_.push_back(chain.handle);
  } else {
    joined_.push_back(chain.handle);
  }
}

}  // namespace situation_awareness
