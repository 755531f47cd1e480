// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"
#include "situation_awareness/path/avoidance.hpp"
#include "situation_awareness/path/dubins_following.hpp"
#include "situation_awareness/path/hit_memory.hpp"
#include "situation_awareness/path/mission_clock.hpp"
#include "situation_awareness/path/obstacles.hpp"
#include "situation_awareness/path/seen_area.hpp"
#include "situation_awareness/path/segment_path.hpp"
#include "situation_awareness/path/standoff_orbit.hpp"

namespace situation_awareness {

// A mission around unknown large obstacles (docs/math/circumnavigation.md; splinegon paper, Sects. I and II).

struct CircumnavigationParams {
  AvoidanceParams avoidance;
  DubinsFollowingParams following;
  double standoff_m = 8.0;
  double min_extent_m = 2.5;
  double max_sigma_m = 0.3;
  double max_laps = 2.0;
  double arrive_m = 6.0;
  double start_free_m = 20.0;
  double max_map_age_s = 2.0;
  double max_scan_age_s = 1.0;

  // Constants of the method, which are not read from YAML.
  /// What cannot be approached is given up after holding for so long; after a third it is tried the other way around.
  double patience_s = 60.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("avoidance", self.avoidance);
    visit("following", self.following);
    visit("standoff_m", self.standoff_m, Bounds{0.1, 1000.0}, "m",
          "distance from an obstacle at which it is gone around: more than the clearance, avoidance.turn_radius_m at "
          "least");
    visit("min_extent_m", self.min_extent_m, Bounds{0.1, 1000.0}, "m",
          "an outline of lines is that of a large obstacle from this diagonal of the box around it on");
    visit("max_sigma_m", self.max_sigma_m, Bounds{0.001, 100.0}, "m",
          "a closed boundary whose standard deviation is at most this everywhere is done");
    visit("max_laps", self.max_laps, Bounds{1.0, 100.0}, "",
          "an obstacle whose boundary is not done after so many laps is given up");
    visit("arrive_m", self.arrive_m, Bounds{0.1, 1000.0}, "m", "a place of the search is reached from there on");
    visit("start_free_m", self.start_free_m, Bounds{0.0, 10000.0}, "m",
          "radius around the first pose that is known to be free: the vehicle turns there");
    visit("max_map_age_s", self.max_map_age_s, Bounds{0.1, 100.0}, "s", "the vehicle holds where the map is older");
    visit("max_scan_age_s", self.max_scan_age_s, Bounds{0.1, 100.0}, "s", "the vehicle holds where scans are older");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// What a step of the mission knows. All of about the same time, in the world. What is null is not there.
struct MissionInput {
  std::int64_t stamp_ns = 0;
  /// False: there was no odometry since the step before. Then pose, heading, covariance and speed are not looked at,
  /// and the sight is in the frame of the vehicle's body.
  bool has_pose = true;
  Pose2 T_world_base;                                             ///< its yaw: the course over ground
  double heading_rad = std::numeric_limits<double>::quiet_NaN();  ///< of its body; NaN: the course
  Eigen::Matrix3d covariance_world = Eigen::Matrix3d::Zero();     ///< of x, y (m) and yaw (rad)
  double speed_m_s = 0.0;                                         ///< over ground, >= 0
  const Map* map = nullptr;
  /// What a scan since the last step saw. Hits that are not on the map are obstacles, as HitMemory says: the map may be
  /// old, or elsewhere.
  const FreeBeams* sight = nullptr;
};

/// The places of a search, in order.
struct SearchPlaces {
  std::vector<DubinsEnd> places;
};

/// As YAML text, [[x, y], [x, y, yaw], ...] in m and rad, that is read back exactly; without a yaw any heading will do.
std::string yaml_text(const SearchPlaces& search);
/// Throws std::invalid_argument if the text is not such a list.
void read_yaml_text(const std::string& yaml, SearchPlaces& search);

enum class MissionState : std::uint8_t {
  kSearch,  ///< on the way to a place from which to look for obstacles
  kAround,  ///< on the way around an obstacle, or to it
  kHold,    ///< on a circle, for want of a safe path
  kDone,    ///< on a circle, nothing is left
};

const char* name_of(MissionState state);  ///< "search", "around", "hold", "done"

/// What a step of the mission says. Valid until the next step.
struct MissionStep {
  MissionState state = MissionState::kHold;
  std::string reason;             ///< in one sentence
  double curvature_1_m = 0.0;     ///< to turn with, left positive; of the path's follower
  double speed_m_s = 0.0;         ///< over ground, of the input; without a pose as by dead reckoning
  double way_m = 0.0;             ///< along the path
  std::uint64_t path_number = 0;  ///< another one for another path
  std::uint64_t target = 0;       ///< id of the boundary that is gone around; 0: none
  double laps = 0.0;              ///< around it
  std::size_t done = 0;           ///< boundaries that are closed and certain
  std::size_t given_up = 0;       ///< boundaries and places of the search
};

/// Goes to each place of a search, in order; around each large obstacle that it finds, at the stand-off, until its
/// boundary is closed and certain; and holds when nothing is left. Of what is known only, step by step; the same input
/// gives the same output.
///
/// A path is followed only as long as this holds: as far as the vehicle goes until it could turn off, and around on a
/// circle from there, nothing is nearer than the clearance and the standard deviations, and all of it was seen.
/// Otherwise the vehicle turns on the circle for which this held in the step before. So nothing that is unknown is
/// nearer than that way, and a path's end is never without a way out. Every path has the curvature of
/// avoidance.turn_radius_m at most.
///
/// It also turns there while what it needs is missing: odometry, or odometry that moves as it says; the map; scans.
/// Without a pose it goes on by dead reckoning, with the wind that it had before, and
/// keeps away from what the scans hit beside it: more a vehicle that cannot stop cannot do.
class Circumnavigation {
 public:
  /// `search`: the radii are those of the parameters. `start_world_m`: around which it is known to be free; if not
  /// given, the first pose. Throws std::invalid_argument naming field and bound.
  Circumnavigation(const CircumnavigationParams& params, const std::vector<DubinsEnd>& search,
                   const std::optional<Eigen::Vector2d>& start_world_m = {});

  /// Steps are no more than 0.3 s apart; by the stamps, as MissionClock takes them. Throws std::invalid_argument if
  /// pose, speed or covariance are not finite; the mission is then unchanged.
  const MissionStep& step(const MissionInput& input);

  const SegmentPath& path() const { return path_; }
  const SegmentPath& way_out() const { return way_out_; }  ///< that is followed if the path's next part is not safe
  const SegmentPath& orbit() const { return orbit_; }      ///< around the target; empty without one
  const Obstacles& obstacles() const { return obstacles_; }
  const std::vector<Splinegon>& boundaries() const { return boundaries_; }  ///< of the large obstacles on the map

 private:
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();
  static constexpr std::size_t kUsualPieces = 2048;  ///< of all obstacles, for which there is memory

  /// When something that comes now and then was made, by the mission's clock.
  struct Made {
    std::int64_t stamp_ns = StampOrder::kNone, made_ns = StampOrder::kNone;
  };

  MissionInput with_pose(const MissionInput& input, double since_s);
  void reckon(const MissionInput& input, double since_s);
  void check_motion(const MissionInput& input, double since_s);
  void note(Made& made, std::int64_t stamp_ns, double max_age_s, const MissionInput& input) const;
  bool is_old(const Made& made, double max_age_s) const;
  bool is_trusted(const FreeBeams& sight);
  void find_missing(const MissionInput& input);
  void gather(const MissionInput& input);
  void take_sight(const MissionInput& input);
  void choose_task(const MissionInput& input);
  void begin_task(std::uint64_t target);
  void follow_target(const MissionInput& input);
  void look_for_places(const MissionInput& input);
  void lose_patience();
  bool is_done(const Splinegon& boundary) const;
  void watch_boundaries();
  bool is_given_up(std::uint64_t id) const;
  bool is_known_already(const Splinegon& boundary) const;
  bool is_left(const Splinegon& boundary);
  bool is_together(std::uint64_t id) const;
  void count_turn(double turn_rad);
  bool is_occupied(const Eigen::Vector2d& p_world_m) const;
  bool is_free(const SegmentPath& path) const;

  bool plan(const MissionInput& input);
  bool plan_to_orbit(const Pose2& from);
  bool plan_to(const Pose2& from, const DubinsEnd& end);
  bool plan_along_orbit(const Pose2& from, const DubinsEnd& end, std::size_t obstacle);
  double join(const Pose2& from, const SegmentPath& orbit, SegmentPath& path, double& way_m) const;
  bool trace(std::size_t obstacle, double side, const Pose2& from, SegmentPath& orbit);
  bool is_safe(const SegmentPath& path, double way_m, double speed_m_s);
  void hold();
  void turn_on(const MissionInput& input);
  double free_on_circle_m(const SegmentPath& path, double way_m) const;
  bool escape(const MissionInput& input, double least_m);
  void report(const MissionInput& input);

  CircumnavigationParams params_;
  std::vector<DubinsEnd> search_;
  std::optional<Eigen::Vector2d> start_m_;
  std::size_t place_ = 0;  ///< index in the search
  /// What is known of a boundary beside its outline. It stays when the boundary has become a part of another one.
  struct Watched {
    std::uint64_t id = 0;
    Eigen::Vector2d place_m = Eigen::Vector2d::Zero();  ///< on it, when it last was there
    double length_m = 0.0;                              ///< of its outline, when it last was closed and certain
    std::int64_t since_ns = 0;                          ///< it is so
    bool present = true, certain = false, done = false, given_up = false;
    double around_rad = 0.0;                       ///< gone around it, alone or with others
    std::int64_t compared_ns = StampOrder::kNone;  ///< with other boundaries;
    bool twice = false;                            ///< it then was along one that is done or given up
  };
  Watched* watched(std::uint64_t id);
  std::vector<Watched> watched_;
  std::vector<std::uint64_t> together_;  ///< boundaries that are gone around on the present orbit
  std::size_t places_given_up_ = 0;

  std::vector<Splinegon> boundaries_;  ///< of the large obstacles
  Obstacles obstacles_;
  SeenArea seen_;
  HitMemory hits_, known_hits_;  ///< and those from before the pose was lost
  double pose_sigma_m_ = 0.0;

  MissionClock clock_;
  Made map_made_, scan_made_;
  std::vector<double> free_before_m_;  ///< of the scan before
  int same_scans_ = 0;                 ///< in a row, that say exactly the same
  std::string missing_;                ///< what is, in a few words; empty: nothing
  /// By dead reckoning.
  Eigen::Vector2d reckoned_m_ = Eigen::Vector2d::Zero(), velocity_m_s_ = Eigen::Vector2d::Zero(),
                  wind_m_s_ = Eigen::Vector2d::Zero();
  double heading_rad_ = 0.0, turn_1_m_ = 0.0;
  bool is_lost_ = false;  ///< there is no pose
  double lost_s_ = 0.0;   ///< for so long
  Eigen::Vector2d anchor_m_ = Eigen::Vector2d::Zero(), flown_m_ = Eigen::Vector2d::Zero();
  bool is_frozen_ = false;  ///< odometry did not move as it says, when that was last looked at
  FreeBeams sight_;         ///< the input's, placed
  StandoffOrbit orbits_{kUsualPieces};

  bool has_target_ = false, is_finished_ = false;
  std::uint64_t target_ = 0;         ///< id of a boundary
  std::size_t target_obstacle_ = 0;  ///< its index
  double target_sigma_m_ = 0.0;      ///< its greatest
  bool target_is_closed_ = false;
  Eigen::Vector2d target_place_m_ = Eigen::Vector2d::Zero();  ///< on it, nearest to the vehicle
  double side_ = 1.0;                                         ///< +1: counter-clockwise around it
  bool chose_side_ = false, tried_other_side_ = false;
  double around_m_ = 0.0;  ///< the way since it is the target
  double held_s_ = 0.0;    ///< for the present task

  bool started_ = false, holds_ = false, needs_plan_ = true, task_is_new_ = true;
  std::int64_t now_ns_ = 0, planned_ns_ = 0;            ///< of the mission's clock
  Eigen::Vector2d before_m_ = Eigen::Vector2d::Zero();  ///< where the vehicle was in the step before
  SegmentPath path_, orbit_, way_out_, candidate_, tried_, approach_, other_orbit_;
  mutable SegmentPath joined_;
  double way_m_ = 0.0;
  MissionStep step_;
};

}  // namespace situation_awareness
