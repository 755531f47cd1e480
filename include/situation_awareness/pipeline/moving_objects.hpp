// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/polygons/movers.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// Parameters of what is kept off the map of polygons because the map of objects follows it.
struct MoverParams {
  double parked_after_s = 10.0;
  double margin_m = 0.08;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("parked_after_s", self.parked_after_s, Bounds{0.0, 1e6}, "s",
          "what has moved is kept off the map of polygons until it has stood for so long");
    visit("margin_m", self.margin_m, Bounds{0.0, 1.0}, "m",
          "hits so far beside the outline of a mover are of it, in addition to two standard deviations");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "movers"); }
};

/// Tells from the maps of objects, one per scan, what moves and what has parked (docs/math/polygons.md, "Movers"). An
/// element begins to move when it is surely faster than `min_speed_m_s`, was seen to travel and is not hit any more
/// where it was; it is a mover until it has stood for `parked_after_s`. Who takes the place of a mover under another id
/// is one, too.
class MovingObjects {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit MovingObjects(const MoverParams& params);

  /// The map of objects after the next scan, and what that scan saw to be free: what seems to travel has not set off
  /// while beams still end where it was. A stamp that goes back begins anew.
  void add(const Objects& objects, const FreeSpace& free_space, const Pose2& T_world_level);
  /// The same without a scan.
  void add(const Objects& objects) { add(objects, {}, {}); }

  /// The movers at a time from the latest map on, predicted by their velocities; none long after it. The result is
  /// valid until the next call, which reuses its memory.
  const Movers& at(std::int64_t stamp_ns);

  /// Number of movers in the latest map.
  std::size_t count() const;
  /// How many things that stood have set off.
  std::size_t set_off() const { return set_off_; }

  void reset();

 private:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();
  static constexpr std::size_t kPlaces = 10;

  /// An element of the map of objects, and where it was.
  struct Followed {
    std::uint64_t id = 0;
    std::int64_t first_seen_ns = 0;
    std::int64_t listed_ns = kNever;  ///< in the latest map that it was in
    MoverOutline outline;             ///< then
    MoverOutline trace;               ///< when it was seen, without what is not known of it
    bool is_person = false;
    Eigen::Vector2d velocity_world_m_s = Eigen::Vector2d::Zero();
    bool moves = false;                                       ///< maybe not far enough to be a mover
    Eigen::Vector2d began_world_m = Eigen::Vector2d::Zero();  ///< where that began
    double began_variance_m2 = 0.0;                           ///< of that place
    MoverOutline began;                                       ///< its outline there
    std::int64_t moved_ns = kNever;                           ///< when it was last seen to, as a mover
    std::int64_t set_off_ns = kNever;                         ///< when it became one
    std::int64_t stands_since_ns = kNever;
    MoverTrace stood;  ///< its place while it stood
    std::array<MoverTrace, kPlaces> places;
    std::size_t next_place = 0, places_known = 0;
    std::int64_t place_ns = kNever;  ///< of the latest one
  };

  bool is_mover(const Followed& followed) const;
  bool is_fast(const Object& object) const;
  MoverOutline outline_of(const Object& object) const;
  MoverOutline trace_of(const Object& object) const;
  Followed& find_or_add(const Object& object);
  void begin_way(Followed& followed, const Object& object) const;
  void forget_way(Followed& followed, const Object& object) const;
  static bool is_still_there(const Followed& followed, const FreeSpace& free_space, const Pose2& T_world_level);
  void follow(Followed& followed, const Object& object, const FreeSpace& free_space, const Pose2& T_world_level);
  void remember_place(Followed& followed) const;

  MoverParams params_;
  std::int64_t stamp_ns_ = kNever;  ///< of the latest map
  std::vector<Followed> followed_;  ///< by ascending id
  std::size_t set_off_ = 0;
  Movers movers_;
};

}  // namespace situation_awareness
