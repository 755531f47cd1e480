// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/chain_fit.hpp"
#include "situation_awareness/map/polygons/map_chains.hpp"
#include "situation_awareness/map/polygons/movers.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/map/polygons/scan_view.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"
#include "situation_awareness/polylines/polylines.hpp"

namespace situation_awareness {

/// Parameters of the map of polygons.
struct PolygonMapParams {
  double spacing_m = 0.04;
  double gate_m = 0.12;
  double max_gap_m = 0.25;
  double pass_margin_m = 0.06;
  double max_pose_sigma_m = 0.05;
  double max_pose_sigma_rad = 0.1;
  double confirmation_probability = 0.94;
  double park_s = 10.0;
  double removal_s = 0.8;
  double tolerance_m = 0.012;

  // Constants of the method, which are not read from YAML.
  /// Chains are made anew after so long, and at once where something comes beside them, goes, or is doubted; 0: with
  /// each scan. Less than the safety areas' `max_map_age_s`.
  double refresh_s = 0.2;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("spacing_m", self.spacing_m, Bounds{0.005, 1.0}, "m", "distance of the boundary's elements along it");
    visit("gate_m", self.gate_m, Bounds{0.01, 1.0}, "m",
          "a hit is of a known boundary up to this distance across it, or 4 standard deviations if that is less");
    visit("max_gap_m", self.max_gap_m, Bounds{0.01, 10.0}, "m", "elements farther apart are not joined");
    visit("pass_margin_m", self.pass_margin_m, Bounds{0.01, 1.0}, "m",
          "a beam has passed a boundary if it ends so far behind it");
    visit("max_pose_sigma_m", self.max_pose_sigma_m, Bounds{0.0, 100.0}, "m",
          "with a pose less certain than this the map stays as it is");
    visit("max_pose_sigma_rad", self.max_pose_sigma_rad, Bounds{0.0, 3.0}, "rad", "the same of its yaw");
    visit("confirmation_probability", self.confirmation_probability, Bounds{0.5, 0.997}, "",
          "probability that an element exists, from which on it is on the map: .94 after hits for .3 s, or in three "
          "scans at least");
    visit("park_s", self.park_s, Bounds{0.0, 1e6}, "s",
          "time for which what came while its place was watched has to be hit, too: it moves, or it was parked");
    visit("removal_s", self.removal_s, Bounds{0.01, 1e4}, "s",
          "time for which beams pass a well-known element until it is removed");
    visit("tolerance_m", self.tolerance_m, Bounds{0.001, 1.0}, "m",
          "maximum distance of the elements from the chain's edges, in addition to twice their standard deviations");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "polygons"); }
};

/// Places farther from the world's origin than this along an axis are on no map of polygons.
constexpr double kFarthestFromOrigin_m = 1e6;

/// Whether all numbers are finite and of a place within kFarthestFromOrigin_m.
bool can_be_mapped(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance);

/// What an update did.
struct PolygonMapUpdate {
  int fused = 0;    ///< hits on known elements
  int created = 0;  ///< elements
  int removed = 0;
  int on_movers = 0;  ///< hits that were not used
  Counters reasons;   ///< why a scan was not used, and elements were removed
};

/// An element on the map, without its extent, when it was hit last, and when it was drawn: in the middle of the time
/// for which it was hit.
struct MappedElement {
  BoundaryElement element;
  std::int64_t seen_ns = 0;
  std::int64_t drawn_ns = 0;
};

/// The semi-static map of polygons (docs/math/polygons.md): the boundaries of all that stands.
///
/// It consists of oriented surface elements (surfels), fused from the hits of the scans' polylines (point-based fusion;
/// Keller et al., 2013). Where the paper merges a scan's chain
/// vertex by vertex with one of the map, which needs a chain-to-chain association that the order around the viewpoint
/// does not give (polygon paper, Sects. 3.3 and 3.4), here each hit is associated with the element at its place that
/// faces it, and chains are what links make of the elements. So nothing is doubled that is seen again, whatever
/// part of it, errors average out as 1 / n, and things go piece by piece.
class PolygonMap {
 public:
  static constexpr std::size_t kMaxElements = 300'000;  ///< no more are made; of 4 cm: 12 km of boundary, 140 MB

  /// Throws std::invalid_argument naming field and bound.
  explicit PolygonMap(const PolygonMapParams& params);

  /// Adds a scan, in the order of the stamps. `pose_covariance`: of the error of T_world_level in x, y (m) and yaw
  /// (rad), in the axes of the world.
  PolygonMapUpdate update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance,
                          PolygonMapUpdate memory = {}) {
    return update(polylines, pose_covariance, Movers{}, std::move(memory));
  }

  /// The same without what moves: hits on `movers` are not used, and where they have been is given up.
  PolygonMapUpdate update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance, const Movers& movers,
                          PolygonMapUpdate memory = {});

  /// Makes the chains at the time of the latest scan, and says which are not as they were at the call before. To be
  /// called after each update(), or update_due_chains() or polygons() instead: how large things are and which chains
  /// meet is seen then.
  const ChainChanges& update_chains();

  /// Makes the chains as update_chains() does, but only `refresh_s` after they were made, or where with this scan
  /// something came beside them, went, or is doubted: to make them is most of the cost of a scan whose surroundings are
  /// known. What the last scans of all changed shows with update_chains().
  const ChainChanges& update_due_chains();

  /// A chain as update_chains() or update_due_chains() left it, valid until the next such call; null without this id.
  const Chain* chain(std::uint64_t id) const { return chains_.find(id); }

  /// All chains, after update_chains(). `memory`: as for limit_range.
  Polygons polygons(Polygons memory = {});

  /// All chains as update_chains() or update_due_chains() left them, with the stamp of the latest scan.
  Polygons latest_polygons(Polygons memory = {});

  /// The elements that a chain of the latest polygons() was made of, by its place there, from right to left.
  /// `elements` is overwritten.
  void elements_of(std::size_t chain, std::vector<BoundaryElement>& elements) const;

  /// The element that is nearest to a place across it, within `reach_m` and less than a spacing beside it, and faces
  /// the same way as `normal_world`; none, if there is no such one.
  std::optional<MappedElement> find_facing(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world,
                                           double reach_m) const;
  /// The same among those that scans of `from_ns` to `to_ns`, and none later, hit last.
  std::optional<MappedElement> find_facing(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world,
                                           double reach_m, std::int64_t from_ns, std::int64_t to_ns) const;

  /// Moves each element by a motion in the world that depends on when it was drawn, where it turns out that poses have
  /// drifted.
  void deform(const std::function<Pose2(std::int64_t drawn_ns)>& motion);

  /// Makes one of elements that are beside each other by less than half a spacing, and by `across_m` at most across
  /// the boundary, and face the same way: the same boundary, drawn twice.
  void merge_doubles(double across_m);

  /// Gives up the elements that are behind a place on a boundary by `least_m` to `most_m`, less than a spacing beside
  /// it, face the same way, and were hit last before `before_ns`: the same boundary, where poses had drifted.
  void give_up_behind(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world, double least_m,
                      double most_m, std::int64_t before_ns);

  std::size_t elements() const { return surfels_.count(); }

  /// Greater than the ids of all chains so far.
  std::uint64_t next_id() const { return chains_.next_id(); }

  /// Forgets all. Ids that were used are not used again.
  void reset();

  /// Goes on from these chains, under their ids, in the place of its own: elements `spacing_m` apart along their edges
  /// are as certain as they are. Ids that were used, by this map before or by these chains, are not used again. Throws
  /// std::invalid_argument if they are more than kMaxElements or have numbers that no map has; the map is then
  /// unchanged.
  void restore(const Polygons& polygons);

 private:
  using Index = Surfels::Index;
  static constexpr Index kNone = Surfels::kNone;

  /// Elements beside a place on the boundary.
  struct Neighbours {
    Index right = kNone, left = kNone;
    double right_m = 0.0, left_m = 0.0;  ///< along, to them
  };

  void begin_anew(std::int64_t stamp_ns, std::uint64_t next_id);
  Index add(const Surfel& surfel);
  void remove(Index index);
  Index fuse(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world, double variance_m2, bool has_normal,
             bool may_create);
  Index of_line(const Neighbours& beside) const;
  bool is_full() const;
  Index create(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world, double variance_m2,
               bool has_normal, const Neighbours& beside);
  void correct(Index index, const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world, double variance_m2,
               bool has_normal);
  double looks() const;
  void count_look();
  void see(Surfel& surfel, bool of_surface) const;
  void merge_double(Index kept, Index other);
  bool was_watched(const Eigen::Vector2d& p_world_m) const;
  void see_through(PolygonMapUpdate& update);
  void fuse_hits(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance, const Movers& movers,
                 PolygonMapUpdate& report);
  void confirm_hit();
  void give_up(const MoverTrace& trace, PolygonMapUpdate& update);
  void remember();

  PolygonMapParams params_;
  double confirmation_log_odds_ = 0.0;  ///< of confirmation_probability
  std::int64_t stamp_ns_ = std::numeric_limits<std::int64_t>::min();
  double step_s_ = 0.0;                                              ///< since the scan before
  double waited_s_ = 0.0;                                            ///< of such steps, since the chains were made
  std::int64_t made_ns_ = std::numeric_limits<std::int64_t>::min();  ///< when they were
  Surfels surfels_;
  MapChains chains_;  ///< of those confirmed
  LatestScanView now_;
  std::vector<ScanView> watches_;  ///< that are remembered
  std::size_t next_watch_ = 0;
  /// When independent looks ended, the oldest one at `next_look_`. What was never confirmed is forgotten after so many
  /// without a hit: 25 s, or that many scans of a scanner slower than 4 Hz. With 40 a wall passed three times in 1000 s
  /// stays unknown (.79 of its hits on the map, .88 with 100).
  std::array<std::int64_t, 100> look_ns_{};
  std::size_t next_look_ = 0;
  double looks_ = 0.0;         ///< since the latest of these
  std::vector<Index> of_hit_;  ///< element of each hit of the scan
  std::vector<Index> given_up_, passed_;
  double most_extent_m_ = 0.0;    ///< of an element to either side, that any had
  std::vector<Index> unsettled_;  ///< those that may go wherever the sensor is
};

}  // namespace situation_awareness
