// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/map/splinegons/splinegon_map.hpp"
#include "situation_awareness/pipeline/moving_objects.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/obstacle_boundaries.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/registration/map_alignment.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

/// All parameters of the pipeline from scan to the boundaries of large obstacles; cfg/splinegons.yaml mirrors it.
struct SplinegonPipelineParams {
  RangeLimiterParams scan;
  SegmentationParams segments;
  PolylineParams polylines;
  PolygonMapParams polygons;
  MapAlignmentParams alignment;
  SplinegonMapParams boundaries;
  SplinegonFitParams splinegons;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("scan", self.scan);
    visit("segments", self.segments);
    visit("polylines", self.polylines);
    visit("polygons", self.polygons);
    visit("alignment", self.alignment);
    visit("boundaries", self.boundaries);
    visit("splinegons", self.splinegons);
  }
};

/// What a SplinegonPipeline makes besides objects.
enum class StandingThings : std::uint8_t {
  kNone,  ///< nothing; by inertial navigation chains nevertheless, which keep the scans together
  kChains,
  kBoundaries,  ///< of these chains
};

/// From scan to the boundaries of large obstacles in one thread, without ROS: chains of the map of polygons, with
/// elements as coarse as the scans are, whose extent is large, are fitted by splinegons. With `objects` to the map of
/// objects, too, and what that follows is kept off the chains.
class SplinegonPipeline {
 public:
  /// Throws std::invalid_argument naming field and bound, and as ObjectPipeline. With `objects`, their parameters hold
  /// for the scan and its segments where the pose is known well.
  explicit SplinegonPipeline(const SplinegonPipelineParams& params,
                             const std::optional<ObjectPipelineParams>& objects = std::nullopt,
                             const MoverParams& movers = {}, StandingThings standing = StandingThings::kBoundaries);

  /// With a pose that is known well. Throws std::invalid_argument if the scan or the pose cannot be used; the maps are
  /// then unchanged. `pose_covariance`: of the error of the pose in x, y (m) and yaw (rad), in the axes of the world.
  /// The result is valid until the next call, which reuses its memory.
  const Splinegons& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                            const Eigen::Isometry3d& T_world_lidar_end, const Eigen::Matrix3d& pose_covariance);

  /// With a pose by inertial navigation, of which GPS says where it is in the world. All calls are of one kind. The
  /// scans of the first two seconds that see something are mapped at their end: they tell how fast the vehicle is,
  /// which GPS and INS know badly then. If they do not, later ones are.
  const Splinegons& process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                            const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement);

  /// With a pose that is known well, of segments that another made, and of its map of objects after their scan, if
  /// there is one: for a pipeline without objects of its own. Throws std::invalid_argument if a number cannot be used;
  /// the maps are then unchanged.
  const Splinegons& process(const Segments& segments, const Objects* objects, const Eigen::Matrix3d& pose_covariance);

  /// How the scans are placed in the map and that in the world, of the second kind.
  const MapAlignment& alignment() const { return alignment_; }

  const Splinegons& splinegons() const { return splinegons_; }
  /// How the boundaries were fitted.
  const SplinegonMap& map() const { return boundaries_.map(); }

  /// The map of objects and what its latest scan was to it, in the frame of the map; null without one, and before the
  /// first.
  const ObjectPipelineResult* objects() const { return latest_; }
  const MovingObjects& movers() const { return movers_; }

  /// Which chains are not as they were at the scan before; a chain by its id, and how boundaries were fitted to them:
  /// in the frame of the map.
  const ChainChanges& chain_changes() const { return changes_; }
  const Chain* chain(std::uint64_t id) const { return chains_.chain(id); }
  const ObstacleBoundaries& boundaries() const { return boundaries_; }
  /// What the latest scan did to the chains, and why it was not used.
  const PolygonMapUpdate& chain_update() const { return update_; }
  /// Between the elements of chains.
  double chain_spacing_m() const { return params_.polygons.spacing_m; }
  /// Of a place of the map in the world, in any direction.
  double common_variance_m2() const { return common_variance_m2_; }

  /// The chains of boundaries, which have their ids, and of other things, and the polylines of the latest scan, both in
  /// the frame of the map; T_world_map() is where that is in the world.
  const Polygons& polygons() const { return polygons_; }
  const Polylines& polylines() const { return polylines_; }
  /// Of the latest scan that was projected, limited to what is of interest.
  const Points& points() const { return points_; }
  const Pose2& T_world_map() const { return alignment_.T_world_map(); }

  /// Forgets all boundaries. Their ids are not used again.
  void reset();

  /// Continues from these chains in the place of its own, and without what moves: elements are put on them. They are
  /// where they say in the world as it is known now: by GPS they may be off by its error then and now. Returns the id
  /// of the first; those of the others follow in their order. Throws std::invalid_argument if they are too many for a
  /// map.
  std::uint64_t resume(const Polygons& chains);

 private:
  void take_polylines(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                      const Eigen::Isometry3d& T_world_lidar_end);
  const Splinegons& map_polylines(const Eigen::Matrix3d& covariance, double common_variance_m2);
  void follow_objects(const Scan& scan, const Eigen::Isometry3d& T_map_lidar, const Eigen::Isometry3d& T_map_lidar_end);
  void tell_all_chains();
  void take_boundaries();
  const Splinegons& fit_boundaries(std::int64_t stamp_ns);
  const Splinegons& place_boundaries(std::int64_t stamp_ns);

  /// A scan of the begin.
  struct FirstScan {
    Scan scan;
    Eigen::Isometry3d T_odom_lidar, T_odom_lidar_end;
    InertialPlacement placement;
  };
  bool begin(FirstScan scan);

  SplinegonPipelineParams params_;
  std::vector<FirstScan> first_scans_;
  int begins_ = 0;                                                ///< that did not tell the velocity
  int passes_ = 0;                                                ///< over the first scans, one with each later scan
  Eigen::Vector2d first_velocity_m_s_ = Eigen::Vector2d::Zero();  ///< in the map, that the latest pass ended with
  PolygonMap chains_;
  std::unique_ptr<ObjectPipeline> objects_;
  const ObjectPipelineResult* latest_ = nullptr;
  MovingObjects movers_;
  StandingThings standing_;
  ChainChanges changes_;
  MapAlignment alignment_;
  ObstacleBoundaries boundaries_;  ///< in the map's frame, without the error of its place
  Scan limited_;
  Points points_;
  Segments segments_;
  Polylines polylines_;
  PolygonMapUpdate update_;
  double common_variance_m2_ = 0.0;
  Polygons polygons_;
  bool are_taken_ = true;  ///< boundaries, of all changes of the chains
  Splinegons splinegons_;
};

}  // namespace situation_awareness
