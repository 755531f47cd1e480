// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/polylines/polylines.hpp"
#include "situation_awareness/registration/loop_search.hpp"
#include "situation_awareness/registration/map_place.hpp"
#include "situation_awareness/registration/pose_graph.hpp"

namespace situation_awareness {

struct MapAlignmentParams {
  double hit_sigma_m = 0.03;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("hit_sigma_m", self.hit_sigma_m, Bounds{0.001, 10.0}, "m",
          "standard deviation of a hit's distance from the boundary, in addition to those of both");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "alignment"); }
};

/// A scan by inertial navigation, which goes on without jumps, and what GPS and INS say of the world.
struct InertialPlacement {
  Pose2 T_world_odom;                                         ///< as it is known now
  Eigen::Matrix3d pose_covariance = Eigen::Matrix3d::Zero();  ///< of x, y (m) and yaw (rad) of the base in the world
  Eigen::Vector2d v_odom_m_s = Eigen::Vector2d::Zero();       ///< of the scanner, whose changes are accelerations
  Eigen::Vector2d v_world_m_s = Eigen::Vector2d::Zero();      ///< the same by GPS and INS
  double velocity_sigma_m_s = 0.0;                            ///< of that seen from the base, in any direction
  /// Since the scan before, in order, with the antenna in odom. Without any ever, the poses place the map.
  std::vector<PlacedFix> fixes;
};

/// Keeps the scans of a map together while what is known of the world wanders: the map has a frame of its own, in which
/// each scan is placed by the boundaries that are there already, as far as they say where it is, and by inertial
/// navigation since the scan before otherwise. The map's place in the world is that of MapPlace, by the fixes.
///
///   symbol          meaning                                                              size
///   odom            the frame of inertial navigation by gyroscopes and accelerations:    SE(2)
///                   it drifts, and does not jump
///   T_map_level     the scanner in the map                                               SE(2)
///   v               its velocity in the map (m/s)                                        2
///   a               what corrects the acceleration for the tilt, in the map (m/s^2)       2
///   b, w            the same for its bias, in the scanner's level axes (m/s^2), and for   2, 1
///                   that of the rate of turn (rad/s)
///   j               the same for those of the rates of roll and pitch: a' = R j (m/s^3)   2
///   P               covariance of the errors of x, y (m), yaw (rad), v, a, b, w, j        12x12
///
/// The map's boundaries say nothing of the world, so nothing goes back to the pose, whose covariance stays honest.
class MapAlignment {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit MapAlignment(const MapAlignmentParams& params)
      : params_((params.validate(), params)), loops_(params.hit_sigma_m) {}

  /// Places a scan in the map, whose T_world_level is T_odom_level, and sets that to T_map_level. Returns the
  /// covariance of the scan's place in the map.
  /// Where the scan meets what was mapped long before, and it is elsewhere, the map was drawn by drifting poses: once
  /// some scans in turn agree on the difference, what was mapped is moved as PoseGraph says.
  Eigen::Matrix3d align(PolygonMap& map, const InertialPlacement& placement, Polylines& polylines);

  /// The velocity at the first scan as it is known now (m/s, axes of the map), and where to begin with another one than
  /// that by GPS and INS.
  Eigen::Vector2d first_velocity_m_s() const { return v_map_m_s_ - v_changes_m_s_; }
  void begin_with(const Eigen::Vector2d& v_map_m_s, double sigma_m_s);
  bool has_begun() const { return has_begun_; }
  /// Standard deviation of the velocity in the map, in the worse direction of the two axes (m/s).
  double velocity_sigma_m_s() const;
  /// What is to be added to odom's velocity at the next scan (m/s, axes of odom).
  Eigen::Vector2d velocity_correction_m_s(const InertialPlacement& placement) const;

  /// Number of ends of faces, and of poses, that are remembered: both are bounded.
  std::size_t face_ends() const { return ends_.size(); }
  std::size_t poses() const { return graph_.size(); }

  /// Stamp of the latest scan that closed a loop, after which what was mapped before is elsewhere in the map, or
  /// StampOrder::kNone.
  std::int64_t loop_closed_ns() const { return loop_closed_ns_; }
  /// By which what was drawn at a time will move in the map where a loop was found that is not closed yet.
  Pose2 motion_of(std::int64_t drawn_ns) const { return loops_.motion_of(drawn_ns); }

  /// Where the map is in the world, and the variance of a place of it, so far from where most hits were, in any
  /// direction.
  const Pose2& T_world_map() const { return T_world_map_; }
  double variance_m2(double from_middle_m) const;
  /// From odom to the world by way of the map, and the covariance of the scanner's x, y (m) and yaw (rad) in the world;
  /// nothing where GPS and INS, of which the covariance is given, know it as well: the map is better where these have
  /// had no fix for long. Nothing either where what was hit lately leaves a direction open (Zhang, Kaess and Singh, On
  /// degeneracy of optimization-based state estimation problems, ICRA 2016): a map of something round turns with the
  /// scanner, one of a flat face slides along it, and neither knows.
  struct PlaceByMap {
    Pose2 T_world_odom;
    Eigen::Matrix3d covariance;
  };
  std::optional<PlaceByMap> better_place(const Eigen::Matrix3d& pose_covariance) const;

 private:
  struct Pair {
    Eigen::Vector2d p_level_m, q_map_m, normal_map;
    double variance_m2;
    std::int64_t drawn_ns;
  };
  /// Where a flat face ends.
  struct FaceEnd {
    Eigen::Vector2d p_m, outward;                ///< unit, along the face; in the level frame or in the map
    double variance_m2;                          ///< along the face
    double least_bearing_rad, most_bearing_rad;  ///< of the beams there, from the face's normal
    std::int64_t first_seen_ns, last_seen_ns;

    std::int64_t drawn_ns() const { return first_seen_ns + (last_seen_ns - first_seen_ns) / 2; }
  };
  void pair_up(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level, double reach_m);
  void find_face_ends(const Polylines& polylines);
  FaceEnd* known_end(const FaceEnd& end, const Pose2& T_map_level, double reach_m);
  void map_face_ends(const Pose2& T_map_level);
  double weight_of(const Pair& pair, double residual_m) const;
  void tie_poses(const PolygonMap& map, const Polylines& polylines);
  void close_loop(PolygonMap& map, const Polylines& polylines);
  void join_doubles(PolygonMap& map, const Polylines& polylines) const;
  void go_on(const Pose2& T_odom_level, const Eigen::Vector2d& v_odom_m_s, double dt_s);
  void correct(const PolygonMap& map, const Polylines& polylines, const InertialPlacement& placement, double dt_s);
  void place(const Polylines& polylines, const InertialPlacement& placement);
  void watch_shape(const Polylines& polylines);
  double least_told() const;
  Eigen::Matrix3d covariance_world() const;
  void average(const Polylines& polylines, const Pose2& T_map_level, const InertialPlacement& placement);

  MapAlignmentParams params_;
  bool has_begun_ = false;
  std::int64_t stamp_ns_ = 0;
  std::int64_t loop_closed_ns_ = StampOrder::kNone;
  LoopSearch loops_;
  PoseGraph graph_;
  Pose2 T_odom_level_, T_map_level_;  ///< of the latest scan
  Eigen::Vector2d v_odom_m_s_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d v_map_m_s_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d v_changes_m_s_ = Eigen::Vector2d::Zero();  ///< by accelerations since the first scan
  double first_velocity_sigma_m_s_ = 0.0;                    ///< of begin_with; 0 without
  Eigen::Vector2d a_map_m_s2_ = Eigen::Vector2d::Zero(), a_level_m_s2_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d j_level_m_s3_ = Eigen::Vector2d::Zero();
  double w_rad_s_ = 0.0;
  Eigen::Matrix<double, 12, 12> P_ = Eigen::Matrix<double, 12, 12>::Zero();
  std::vector<Pair> pairs_;
  std::vector<FaceEnd> seen_ends_;  ///< in the level frame of the latest scan
  std::vector<FaceEnd> ends_;       ///< in the map

  /// Where odom was in the map at the latest scans, which fixes are older than.
  struct OdomThen {
    std::int64_t stamp_ns;
    Pose2 T_map_odom;
  };
  std::deque<OdomThen> odom_;
  MapPlace place_;
  bool has_fixes_ = false;
  Pose2 T_world_map_;
  Eigen::Vector2d middle_map_m_ = Eigen::Vector2d::Zero();  ///< of hits
  Eigen::Vector2d middle_world_m_ = Eigen::Vector2d::Zero();
  /// The sums are of the hits lately, the later the more: of h h^T, where h says how far a hit goes along its normal by
  /// a step along x and y and by a turn about the map's origin; of their places; of the squares of these.
  struct Shape {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector2d sum_map_m = Eigen::Vector2d::Zero();
    double squares_m2 = 0.0, hits = 0.0;
  };
  Shape shape_;
  double yaw_rad_ = 0.0;
  double position_weight_ = 0.0, yaw_weight_ = 0.0, poses_ = 0.0;
  double position_variance_m2_ = 0.0, yaw_variance_rad2_ = 0.0;  ///< of the poses, harmonic means
};

}  // namespace situation_awareness
