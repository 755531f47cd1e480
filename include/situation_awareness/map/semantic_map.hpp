// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/free_space_memory.hpp"
#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/map/id_source.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// When a layer hands a thing over to another one.
struct HandOverParams {
  double parked_after_s = 10.0;

  // Constants of the method, which are not read from YAML.
  /// A chain that is so near to the outline of an object is of it, in addition to two standard deviations.
  double margin_m = 0.1;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("parked_after_s", self.parked_after_s, Bounds{0.0, 1e6}, "s",
          "an object that has stood for so long, and of which there is a chain, is that chain");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "hand_over"); }
};

/// What the chains of the map of polygons are like now: those that changed, and the ids of those that are gone.
struct PolygonChanges {
  std::vector<const Chain*> changed;  ///< by ascending id
  std::vector<std::uint64_t> gone;    ///< by ascending id
};

/// The boundaries of large obstacles as they are now: all of them, and which chains each was fitted to.
struct BoundaryChanges {
  const Splinegons* boundaries = nullptr;
  const std::vector<ChainOfBoundary>* chains = nullptr;  ///< by ascending chain
};

/// What a scan saw as free, by which it is told when a feature was not there yet.
struct SightOfScan {
  Pose2 T_world_level;
  const FreeSpace* free_space = nullptr;
};

/// The chain of its layer by which a feature of a saved map goes on, alone or as a boundary.
struct FeatureOfChain {
  FeatureId feature = 0;
  std::uint64_t chain = 0;
  bool is_boundary = false;
};

/// What the layers have after a scan or an image. A layer that is null has not changed.
struct LayerUpdates {
  std::int64_t stamp_ns = 0;
  std::optional<double> height_world_m;
  const Objects* objects = nullptr;
  const PolygonChanges* polygons = nullptr;
  const BoundaryChanges* boundaries = nullptr;  ///< of these chains
  const GridTargets* targets = nullptr;         ///< all of them, after an image
  std::optional<SightOfScan> sight;             ///< none: not known
};

/// One map of what the layers follow each on its own (docs/math/semantic_map.md): a thing is on it once, under one id,
/// in the kind that fits it, though several layers see it and one hands it over to another. The ids of the layers are
/// handles here.
class SemanticMap {
 public:
  /// Throws std::invalid_argument naming field and bound. `ids` lives longer than the map. Without `with_chains` chains
  /// are on the map where they are of a boundary of a large obstacle, and not else.
  SemanticMap(const HandOverParams& params, IdSource& ids, bool with_chains = true);

  /// What has changed, valid until the next call.
  const MapDelta& update(const LayerUpdates& layers);

  /// Another map, of which nothing is known yet: its layers begin anew, too. Its ids were not used before. The next
  /// update is full.
  void begin_anew();

  /// Continues from a map that was saved, as another map whose next update is full: its features keep their ids. Those
  /// with a chain are what that chain is once it is told; the others are on the map as they are until a layer has
  /// something where they are, or beams pass there. Features and chains are by ascending feature; no stamp of the saved
  /// map is after the next update.
  void resume(const Map& saved, const std::vector<FeatureOfChain>& chains);

  /// The whole map. `memory`: a result no longer needed, whose memory this one reuses.
  Map map(Map memory = {}) const;

  std::size_t size() const { return on_map_; }

  /// Whether there was an update since the map began.
  bool has_begun() const { return !is_new_; }

  /// The stamp of the latest update, the number of the map and its version, as MapDelta tells them.
  std::int64_t stamp_ns() const { return stamp_ns_; }
  std::uint64_t number() const { return maps_; }
  std::uint64_t version() const { return delta_.version; }

 private:
  using Handle = std::uint64_t;  ///< id of a layer's; 0: none
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();

  /// What an object is on the map as.
  enum class As : std::uint8_t {
    kItself,
    kOwnChain,     ///< the chain of its boundary
    kPartOfChain,  ///< of a larger thing
  };
  /// An object of its layer.
  struct ObjectEntry {
    Handle handle = 0;
    FeatureId id = 0;
    As as = As::kItself;
    Handle chain = 0;  ///< of kOwnChain and kPartOfChain
    std::int64_t stood_since_ns = kNever;
    bool has_moved = false;
    std::int64_t came_ns = kNever;       ///< to where it stands, or last stood; kNever: it always stood there
    bool is_id_of_chain = false;         ///< its id was one of a chain before
    double covered = 0.0;                ///< part of that chain that it covered, at most, before it moved
    std::vector<Handle> chains;          ///< that are its boundary
    std::uint64_t update = 0;            ///< number of the latest update that listed it
    std::int64_t missing_ns = kNever;    ///< since when its layer does not list it
    std::int64_t predicted_ns = kNever;  ///< to when `latest` is predicted
    Object latest;
    Object largest;  ///< the same with the greatest extent since it stands
  };
  /// A chain of its layer.
  struct ChainEntry {
    Handle handle = 0;
    FeatureId id = 0;
    Handle of_object = 0;               ///< whose boundary it is
    double length_of_object_m = 0.0;    ///< of the chain, when it began to be, or last was as a whole
    FeatureId trace_of = 0;             ///< what was there and has moved on
    FeatureId left_with = 0;            ///< the id that it had and with which an object drove off from it
    Handle beside = 0;                  ///< the chain that shows its surface, if it does not itself
    double begin_m = 0.0, end_m = 0.0;  ///< along it, what it shows
    bool is_saved = false;              ///< it is of a file, beside what else that has there
    Handle of_boundary = 0;             ///< of which it is a part, if that is on the map
    std::uint64_t boundary_update = 0;  ///< number of the latest update of boundaries that listed it
    double length_m = 0.0;
    Eigen::AlignedBox2d box_world_m;
    Chain latest;
  };
  /// How many steps along a chain another one, or a boundary, covers, that is the one to show them.
  struct Overlap {
    Handle chain = 0;  ///< of a boundary: the one whose id that has
    int steps = 0;
    bool is_before = false;
    const Chain* line = nullptr;
    double begin_m = 0.0, end_m = 0.0;  ///< along that, what covers
    double length_m = 0.0;              ///< of that
  };
  /// A boundary of a large obstacle of its layer.
  struct BoundaryEntry {
    Handle handle = 0;
    Handle main = 0;  ///< chain whose id it has
    bool is_boundary = false;
    std::int64_t explains_since_ns = kNever;
    std::size_t chains = 0;             ///< number of those that it consists of, if it is on the map
    std::size_t numbers_of_chains = 0;  ///< that the vertices of those are
    std::uint64_t update = 0;           ///< number of the latest one that listed it
    Splinegon latest;
    Chain outline;                    ///< the same as a chain, its free side to the left
    double length_m = 0.0;            ///< of that
    Eigen::AlignedBox2d box_world_m;  ///< around it
  };
  /// An object that is part of a larger thing, and that its layer does not follow any more: what drives off from there
  /// is it.
  struct Parked {
    FeatureId id = 0;
    Object object;
    std::int64_t came_ns = kNever;        ///< there
    std::int64_t bare_since_ns = kNever;  ///< when it was first on no chain any more
  };
  /// Where something was that has moved on: chains that were drawn of it there, and that no later hit is of, are none.
  struct Trace {
    FeatureId id = 0;
    Object object;
    std::int64_t from_ns = kNever, until_ns = kNever;  ///< of the hits that were of it
    bool is_parked = false;                            ///< it had parked there
  };
  /// A target of its layer.
  struct TargetEntry {
    Handle handle = 0;
    FeatureId id = 0;
    FeatureId candidate = 0;  ///< another feature that it may be one with
    int agreed = 0;           ///< images in turn that said so
    int contradicted = 0;     ///< images in turn after which it is not where the feature is that it is one with
    std::int64_t first_seen_ns = 0, last_seen_ns = 0;
    std::uint64_t update = 0;
    GridTarget latest;
  };
  /// A target beside a feature of vehicle size.
  struct Pair {
    double apart_m;
    Handle target;
    FeatureId feature;
  };
  /// What the layers have of the feature with an id, and what is told of it once it is not on the map any more.
  struct Owner {
    Handle object = 0, chain = 0, target = 0;
    bool is_on_map = false;
    bool is_leaving = false;                           ///< it is on the map for one more update, as what it was last
    GoneReason reason = GoneReason::kSeenThrough;      ///< if it is part of no other one
    FeatureId into = 0;                                ///< of which it is a part
    std::optional<std::int64_t> last_absent_ns;        ///< Feature
    ObjectClass object_class = ObjectClass::kUnknown;  ///< that a file says it is
    double p_class = 0.0;                              ///< of that
    bool is_fixed = false, has_moved = false;          ///< as a file says
  };
  /// A feature of a file that no layer has yet.
  struct Saved {
    Feature feature;
    std::optional<Object> body;  ///< the same as an object, if it is an ellipse or a box
  };
  /// How much of a chain is on an object.
  struct Cover {
    Handle chain = 0;
    double on_object_m = 0.0;
    bool is_of_object = false;
  };

  const Feature* find_saved(FeatureId id) const;
  FeatureId take_saved(std::vector<Saved>::const_iterator saved);
  FeatureId id_of_saved(const Object& object);
  FeatureId id_of_saved(const GridTarget& target);
  void take_saved_of(ChainEntry& chain);
  void look_through_saved();
  void take_chains(const PolygonChanges& changes);
  void drop_chain(Handle handle);
  ChainEntry* longest_of(Handle boundary, Handle but);
  FeatureId heir_on_map(FeatureId into) const;
  ChainEntry* heir_of(const ChainEntry& gone);
  void merge_chains(FeatureId id, ChainEntry& heir);
  void unsettle_near(const Chain& line);
  bool is_before(const ChainEntry& a, const ChainEntry& b) const;
  void settle_overlaps();
  Handle whole_of(const ChainEntry& chain) const;
  void settle(ChainEntry& chain);
  void take_boundaries(const BoundaryChanges& changes);
  void draw(BoundaryEntry& boundary);
  void judge(BoundaryEntry& boundary);
  void enter_boundary(ChainEntry& chain, Handle handle);
  void leave_boundary(ChainEntry& chain);
  void touch_boundary(Handle handle);
  void lead(BoundaryEntry& boundary);
  FeatureId id_on_map(const ChainEntry& chain) const;
  void take_targets(const GridTargets& targets);
  void find_pairs(const TargetEntry& target);
  bool is_one(const TargetEntry& target) const;
  void make_one(TargetEntry& target, FeatureId id);
  void part(TargetEntry& target);
  void take_objects(const Objects& objects);
  void miss_objects();
  void go_on(ObjectEntry& object);
  void hand_over(ObjectEntry& object);
  void find_chains_of(ObjectEntry& object);
  bool may_be_part_of(const ObjectEntry& object, const ChainEntry& chain) const;
  bool was_there_before(const ChainEntry& chain, const ObjectEntry& object) const;
  bool takes_id_along(const ObjectEntry& object) const;
  void leave_traces();
  void add_trace(const Trace& trace);
  void forget_trace(const ObjectEntry& object);
  void look_at_traces_near(const Object& object);
  void leave_parked(const ObjectEntry& object);
  void look_at_traces(ChainEntry& chain);
  void make_itself(ObjectEntry& object, Handle was_part_of);
  void make_part_of(ObjectEntry& object, ChainEntry& chain);
  void give_id(ObjectEntry& object, FeatureId id);
  void find_covers(const Object& object);
  As as_what(const ObjectEntry& object, Handle& chain) const;
  void watch_parked();
  void forget_parked(FeatureId id);
  FeatureId id_of_parked(const Object& object) const;
  FeatureId id_of_new(const Object& object);
  FeatureId id_of_lost(const Object& object);
  bool is_seen_through(const Object& object) const;
  void release(ObjectEntry& object);
  void own(ChainEntry& chain, FeatureId id);
  void merge(FeatureId id, FeatureId into);
  template <class Visit>
  void for_each_cell(const Eigen::AlignedBox2d& box_world_m, Visit&& visit) const;
  template <class Visit>
  void for_each_cell(const Chain& chain, double margin_m, Visit&& visit) const;
  void find_near(const Eigen::AlignedBox2d& box_world_m);
  void find_near(const Chain& chain);
  void add_near(std::uint64_t cell);
  void sort_near();
  void place(const ChainEntry& chain);
  void remove(const ChainEntry& chain);
  ObjectEntry* find_object(Handle handle);
  const ObjectEntry* find_object(Handle handle) const;
  ChainEntry* find_chain(Handle handle);
  const ChainEntry* find_chain(Handle handle) const;
  TargetEntry* find_target(Handle handle);
  const TargetEntry* find_target(Handle handle) const;
  BoundaryEntry* find_boundary(Handle handle);
  const BoundaryEntry* find_boundary(Handle handle) const;
  bool is_shown(const ChainEntry& chain) const;
  double least_p_exists(const ChainEntry& chain) const;
  bool feature_of(FeatureId id, const Owner& owner, Feature& feature) const;
  bool shape_of(FeatureId id, const Owner& owner, Feature& feature) const;
  void remember_last(FeatureId id);
  bool tell_absence(FeatureId id);
  void tell_absences();
  void tell();

  HandOverParams params_;
  IdSource* ids_;
  bool with_chains_;
  bool is_new_ = true;
  std::uint64_t maps_ = 0;  ///< that were begun before
  std::uint64_t updates_ = 0;
  std::int64_t stamp_ns_ = kNever;
  std::int64_t objects_stamp_ns_ = 0;
  double height_world_m_ = 0.0;
  std::vector<ObjectEntry> objects_;       ///< by handle
  std::vector<ChainEntry> chains_;         ///< by handle
  std::vector<BoundaryEntry> boundaries_;  ///< by handle
  std::vector<TargetEntry> targets_;       ///< by handle
  std::vector<Pair> pairs_;
  std::vector<Parked> parked_;
  std::unordered_map<Handle, FeatureId> lost_;  ///< ids of objects that their layer does not list any more
  std::deque<Handle> lost_handles_;             ///< in the order in which they were lost
  std::unordered_map<std::uint64_t, std::vector<Handle>> chains_in_;  ///< cells of the world
  std::unordered_map<FeatureId, Owner> owners_;
  std::size_t on_map_ = 0;
  std::vector<FeatureId> touched_;
  std::vector<Handle> new_;  ///< chains
  std::vector<Handle> near_;
  std::vector<Handle> unsettled_;        ///< chains that changed, or beside which one changed
  std::vector<Handle> settling_;         ///< of these, those of a round
  Eigen::AlignedBox2d changed_world_m_;  ///< around the chains that changed with the latest scan, before and after
  std::vector<Handle> joined_;           ///< chains that have begun to be shown by another one
  std::vector<Overlap> others_;          ///< chains beside one, and how much of it each covers
  std::vector<Cover> covers_;
  std::vector<Trace> traces_;
  std::vector<Saved> saved_;                         ///< by ascending id
  std::size_t next_saved_ = 0;                       ///< of these, that is looked through next
  std::vector<FeatureId> touch_saved_;               ///< those that the next update tells
  std::unordered_map<Handle, FeatureId> saved_ids_;  ///< of chains that were not told yet
  std::vector<Handle> saved_boundaries_;             ///< chains whose boundary was one in the file
  FreeSpaceMemory sights_;
  std::vector<Feature> last_;  ///< of features that a layer may have lost with this update, and those that are leaving
  MapDelta delta_;
};

}  // namespace situation_awareness
