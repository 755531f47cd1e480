// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/map/polygons/chain_links.hpp"
#include "situation_awareness/map/polygons/joints.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// Which chain has which id. Each element has a name, Surfel::chain: the id of the chain that it was first of. No
/// allocation after warm-up.
class ChainNames {
 public:
  using Index = Surfels::Index;

  ChainNames();

  /// Goes on with other elements. Ids that were used before, or are less than `next_id`, are not used again.
  void begin_anew(std::uint64_t next_id);
  /// Greater than all ids that were used.
  std::uint64_t next_id() const { return next_id_; }

  /// Begins an update of a map with so many elements, those not alive included. `is_new_scan`: of another scan than the
  /// one before.
  void begin_update(std::size_t elements, bool is_new_scan);

  /// Elements that name() gave another name after the scan before: what they are linked with may depend on it.
  const std::vector<Index>& were_renamed() const { return were_renamed_; }

  /// act(index) for all elements of chains that have this name, where it is marked for the first time in this update.
  template <class Act>
  void mark(std::uint64_t name, const Act& act) {
    const auto own = place_of(name);
    if (own == names_.end() || own->name != name || own->update == update_) return;
    own->update = update_;
    for (Index i = own->first; i != kNone; i = member(i).next) act(i);
  }
  bool is_marked(std::uint64_t name) const;

  /// Gives each of these chains an id, in their order, and its elements names. Chains that met for long, by their
  /// joints, become one. The result is overwritten by the next call.
  const std::vector<std::uint64_t>& name(Surfels& surfels, const ChainLinks& links,
                                         const std::vector<ChainLinks::Run>& chains, Joints& joints);

  /// Puts an element of a chain among those of a name; 0: among none.
  void count(Index index, std::uint64_t name);
  /// Forgets names that no element of a chain has any more, and their joints.
  void forget_lost(Joints& joints);

 private:
  static constexpr Index kNone = Surfels::kNone;

  struct Member {
    std::uint64_t name = 0;  ///< of which it is among the elements; 0: of none
    Index next = kNone, before = kNone;
  };
  struct Named {
    std::uint64_t name = 0;
    Index first = kNone;       ///< of its elements; none: it is not used any more
    std::uint64_t update = 0;  ///< the latest in which it was marked
  };
  struct Claim {  ///< of an id by a chain
    std::size_t elements;
    std::uint64_t id;
    std::size_t chain;  ///< its place
  };

  Member& member(Index index) { return members_[static_cast<std::size_t>(index)]; }
  std::vector<Named>::iterator place_of(std::uint64_t name);
  bool is_used(std::uint64_t name);
  void claim_ids(const Surfels& surfels, const ChainLinks& links, const std::vector<ChainLinks::Run>& chains);
  void add_up_claims();
  void rename(Surfels& surfels, Index index, std::uint64_t name);
  void name_elements(Surfels& surfels, const ChainLinks& links, const ChainLinks::Run& run, std::uint64_t id,
                     bool is_new);
  void unite_names(Surfels& surfels, const ChainLinks& links, const ChainLinks::Run& run, std::uint64_t id,
                   Joints& joints);

  std::uint64_t next_id_ = 1;
  std::uint64_t update_ = 0;                   ///< its number
  std::vector<Member> members_;                ///< by the elements' indices
  std::vector<Named> names_;                   ///< of the elements of all chains, in ascending order
  std::vector<std::uint64_t> lost_;            ///< names that no element may have any more
  std::vector<Index> renamed_, were_renamed_;  ///< with the latest scan, and with the one before
  std::vector<Claim> claims_;
  std::vector<std::uint64_t> taken_;  ///< ids, in ascending order
  std::vector<std::uint64_t> ids_;    ///< of the chains
};

}  // namespace situation_awareness
