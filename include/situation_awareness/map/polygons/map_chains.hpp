// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/map/polygons/chain_fit.hpp"
#include "situation_awareness/map/polygons/chain_links.hpp"
#include "situation_awareness/map/polygons/chain_names.hpp"
#include "situation_awareness/map/polygons/joints.hpp"
#include "situation_awareness/map/polygons/near_elements.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/map/polygons/seldom_hit.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// Which chains an update changed, by their ids, each list in ascending order.
struct ChainChanges {
  std::vector<std::uint64_t> changed;  ///< new ones, and those of which anything is not as it was
  std::vector<std::uint64_t> gone;
};

/// The chains of a map's elements (docs/math/polygons.md, "Chains"), kept from scan to scan: only those beside an
/// element that changed are linked, named and fitted again, each of them as a whole, so that the cost of a scan does
/// not depend on how large the map is. No allocation after warm-up.
class MapChains {
 public:
  using Index = Surfels::Index;

  /// In m: of the elements along the boundary, between those that are joined at most, and as ChainFit::fit.
  MapChains(double spacing_m, double max_gap_m, double tolerance_m);

  /// Length of the tiles of the elements' list that these chains need.
  static double tile_m(double spacing_m, double max_gap_m);

  /// Tells that an element was added, hit, moved or has another existence.
  void touch(Index index);
  /// Tells that an element is about to be removed.
  void remove(const Surfels& surfels, Index index);
  /// Tells that any element may be another one.
  void touch_all();

  /// The chains at the time of a scan, by its stamp and view; its step since the scan before counts once. The elements
  /// get the names of their chains, and what chains tell of them.
  const ChainChanges& update(Surfels& surfels, std::int64_t stamp_ns, const ChainLinks::View& view);

  /// Whether what update() makes may differ from the chains of the latest one by more than elements have moved since
  /// then, or chains got longer, at the time of a scan: an element of a chain went or is passed by beams, one came that
  /// is on no chain's surface, or the scan hit a chain that was not hit for a while.
  bool are_due(const Surfels& surfels, std::int64_t stamp_ns) const;
  /// Instead of update(): the chains stay as they are, and nothing has changed.
  const ChainChanges& no_changes();

  /// A chain of the latest update; null if there is none of this id.
  const Chain* find(std::uint64_t id) const;
  /// All of them, in the order of their first elements. `memory`: as for limit_range.
  std::vector<Chain> list(std::vector<Chain> memory);
  /// The elements of one of the latest list(), from right to left. `elements` is overwritten.
  void elements_of(const Surfels& surfels, std::size_t place, std::vector<BoundaryElement>& elements) const;

  /// Goes on with other elements: the next update makes all chains, and tells which are not as they were before. Ids
  /// that were used before, or are less than `next_id`, are not used again.
  void begin_anew(std::uint64_t next_id);
  /// Greater than all ids that were used.
  std::uint64_t next_id() const { return names_.next_id(); }

 private:
  using Slot = std::int32_t;  ///< place in kept_
  static constexpr Index kNone = Surfels::kNone;

  /// What is kept of each element.
  struct Member {
    Slot slot = kNone;                            ///< of its chain
    Index before = kNone, after = kNone;          ///< in its chain, from right to left
    Index line_right = kNone, line_left = kNone;  ///< as of ChainLinks
    NearElements::Index place = 0;                ///< in link_elements_
    std::int64_t due_ns = SeldomHit::kNever;      ///< of its entry in due_
    bool is_touched = false;
    bool is_in_window = false;
    bool is_known = false;                      ///< it was in a window
    bool is_shown = false, is_crossed = false;  ///< as of LinkElement
  };

  /// A chain, or what is linked as one and is not shown.
  struct Kept {
    Index first = kNone;
    std::size_t elements = 0;
    std::pair<bool, Index> rank;  ///< as of ChainLinks::Run
    bool closed = false;          ///< as linked
    bool is_alive = false;
    bool is_in_window = false, is_touched = false;
    Chain chain;  ///< its id is 0 if it is not shown
  };

  /// An element is judged again at this stamp, though nothing beside it changes: it has got older.
  struct Due {
    std::int64_t at_ns;
    Index index;
  };
  struct Holder {
    std::uint64_t id;
    Slot slot;
  };
  struct HasLessId {
    bool operator()(const Holder& a, const Holder& b) const { return a.id < b.id; }
  };
  /// How the elements of a tile are linked along their lines: as before; as before, but those beside them need them;
  /// anew; anew, and compared with those beside them.
  enum class Mark : std::uint8_t { kNone, kContext, kBeside, kJudged };

  Member& member(Index index) { return members_[static_cast<std::size_t>(index)]; }
  const Member& member(Index index) const { return members_[static_cast<std::size_t>(index)]; }
  Kept& kept(Slot slot) { return kept_[static_cast<std::size_t>(slot)]; }
  const Kept& kept(Slot slot) const { return kept_[static_cast<std::size_t>(slot)]; }
  void room_for(std::size_t members);
  void mark_tiles(const Surfels& surfels);
  void enter_window(Index index);
  void enter_window(Slot slot, bool is_touched);
  void enter_window_of_name(std::uint64_t name);
  void find_window(const Surfels& surfels);
  std::int64_t hidden_from_ns(const Surfels& surfels, Index index);
  void plan(Index index, std::int64_t at_ns);
  void plan_unjudged(const Surfels& surfels);
  void touch_due(const Surfels& surfels, std::int64_t stamp_ns);
  Mark mark_of(const Surfels& surfels, Index index) const {
    return marks_[static_cast<std::size_t>(surfels.tile_of(index))];
  }
  void keep_line(LinkElement& element);
  std::int64_t hit_since_ns(std::int64_t stamp_ns) const;
  void link(const Surfels& surfels, std::int64_t since_ns, std::int64_t stamp_ns, const ChainLinks::View& view);
  void measure(Surfels& surfels, std::int64_t since_ns) const;
  bool is_beside_larger(const Surfels& surfels, const ChainLinks::Run& run) const;
  Slot same_as_before(const ChainLinks::Run& run) const;
  Slot new_slot();
  std::vector<ChainVertex> take_room(std::size_t vertices);
  void give_room(std::vector<ChainVertex> vertices);
  void add_changes_by_beginning_anew();
  void keep(const ChainLinks::Run& run, Slot slot);
  const Chain& fitted(const Surfels& surfels, const Kept& kept);
  bool is_beside_chain(const Surfels& surfels, Index index) const;
  bool is_due(const Surfels& surfels, Index index, std::int64_t stamp_ns) const;
  void take_ids();
  void put(const Surfels& surfels, const ChainLinks::Run& run, Slot same, std::uint64_t id);
  void tell_gone();
  void replace(const Surfels& surfels, const std::vector<std::uint64_t>& ids);
  Holder* holder_of(std::uint64_t id);

  double spacing_m_, max_gap_m_, tolerance_m_;
  std::int64_t joined_at_ns_ = std::numeric_limits<std::int64_t>::min();  ///< latest scan that the joints saw
  Joints joints_;
  ChainNames names_;
  SeldomHit seldom_hit_;

  std::vector<Member> members_;  ///< by the elements' indices
  std::vector<Kept> kept_;
  std::vector<Slot> free_slots_;
  std::vector<std::vector<ChainVertex>> rooms_;  ///< of chains that are gone, for their memory
  std::vector<Holder> holders_;                  ///< of the ids of those shown, in ascending order
  std::vector<Due> due_;                         ///< a heap, the earliest first

  // Since the latest update.
  bool is_all_touched_ = false;
  std::vector<Index> touched_;
  std::vector<Eigen::Vector2d> removed_world_m_;
  std::vector<Index> ageing_;       ///< elements that the latest update judged and that age alone may hide
  std::vector<Chain> before_anew_;  ///< those of the update before, by their ids
  bool is_begun_anew_ = false;

  // Of an update.
  std::vector<Index> were_ageing_;  ///< ageing_ of the update before
  std::vector<Mark> marks_;         ///< of the tiles
  std::vector<Surfels::Tile> marked_;
  std::vector<Index> window_;               ///< elements that are linked again, in ascending order
  std::vector<Slot> window_slots_;          ///< chains that they were of
  std::vector<Index> context_;              ///< others beside them, in ascending order
  std::vector<Index> to_link_;              ///< of both
  std::vector<LinkElement> link_elements_;  ///< of to_link_
  std::vector<NearElements::Index> all_links_;
  NearElements near_;
  ChainLinks links_;
  std::vector<ChainLinks::Run> shown_, hidden_;
  std::vector<Slot> slots_;  ///< of shown_
  std::vector<Holder> was_;  ///< of the ids in the window, before
  ChainChanges changes_;
  std::vector<BoundaryElement> elements_;
  ChainFit chain_fit_;
  Chain fitted_;  ///< by the latest call of fitted()

  std::vector<Slot> listed_;  ///< of the latest list()
  std::vector<Chain> spare_;  ///< for their memory
};

}  // namespace situation_awareness
