// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// A thing of the world through which a vehicle drives, in one transit.
struct TransitThing {
  std::string name;
  bool is_there = true;
  bool can_move = false;                                       ///< a person: it has no place on the map
  bool is_optional = false;                                    ///< it may be on the map but need not: a reflector
  std::vector<std::vector<Eigen::Vector2d>> outlines_world_m;  ///< closed
};

/// What a transit says of pose, map and drive.
struct TransitScore {
  int transit = 0;
  double duration_s = 0.0;
  int stops = 0;  ///< before the last one, in the dock

  /// Of places all along the chains of the map, the distance from the nearest outline: of what stands, or has gone
  /// while no beam could tell. NaN without chains.
  double mean_distance_m = 0.0;
  double sigma_distance_m = 0.0;
  double max_distance_m = 0.0;
  double false_m = 0.0;  ///< length of the chains that is farther than `kFalse_m` from these

  double coverage = 0.0;                      ///< part of the outlines seen so far that has a chain within `kFalse_m`
  std::vector<std::string> in_sight, missed;  ///< things seen so far; of these not on the map
  std::vector<std::string> appeared, appeared_missed;  ///< of these, what was not there in the transit before
  std::vector<std::string> gone, gone_left;            ///< seen to have gone, so far; of these still on the map

  int poses = 0;
  double position_rms_m = 0.0, position_max_m = 0.0;  ///< position: of the plane, not by axis
  double yaw_rms_rad = 0.0;
  double nees = 0.0;  ///< mean of the normalised estimation error squared, of 3 degrees of freedom
};

/// Compares pose and map of polygons with the truth, transit by transit. What was seen of the outlines follows from the
/// scans and the true poses: each outline is divided into bins, which hits near them mark as seen, and beams that end
/// behind them as free once the thing has gone.
class TransitEvaluation {
 public:
  static constexpr double kFalse_m = 0.1;

  /// The things are the same, in the same order, in each transit. Throws std::invalid_argument where they are not.
  void begin(int transit, const std::vector<TransitThing>& things);

  /// `T_world_lidar_end`: at the last beam; in between the motion is even.
  void add_scan(const Scan& scan, const Pose2& T_world_lidar, const Pose2& T_world_lidar_end);

  /// The true pose, in order of time; for stops.
  void add_motion(std::int64_t stamp_ns, const Pose2& T_world_base);

  /// `covariance` of x, y and yaw in the world.
  void add_pose(const Pose2& estimate, const Eigen::Matrix3d& covariance, const Pose2& truth);

  /// `map` is that after the last scan, and `bodies` the outlines of what stands and is no chain on it: they say what
  /// was found, but their distances do not count, as their hidden sides are estimates.
  TransitScore end(double duration_s, const Polygons& map, const Polygons& bodies = {});

 private:
  struct Bin {
    Eigen::Vector2d p_world_m;
    double length_m;
    int thing;
    int hits = 0;    ///< since the thing has been there
    int passed = 0;  ///< beams since it has gone
    bool is_seen() const;
    bool is_free() const;
  };

  void make_bins(const std::vector<TransitThing>& things);
  static std::int64_t cell_of(const Eigen::Vector2d& p_m);
  /// The nearest bin of which `accepts`, or -1.
  template <class Accepts>
  int nearest(const Eigen::Vector2d& p_m, const Accepts& accepts) const;
  bool counts_as_truth(const Bin& bin) const;
  void score_distances(const Polygons& map, TransitScore& score) const;
  void find_bins(const Polygons& map, std::vector<double>& chain_m) const;
  void score_things(const std::vector<double>& chain_m, TransitScore& score) const;
  std::vector<double> distances_to(const std::vector<Eigen::Vector2d>& places_m) const;

  int transit_ = 0;
  std::vector<TransitThing> things_;
  std::vector<bool> was_there_;  ///< in the transit before
  std::vector<Bin> bins_;
  std::unordered_map<std::int64_t, std::vector<int>> cells_;  ///< bins by place

  int poses_ = 0;
  double position_sum_m2_ = 0.0, position_max_m_ = 0.0, yaw_sum_rad2_ = 0.0, nees_sum_ = 0.0;
  std::vector<std::pair<std::int64_t, Pose2>> recent_;  ///< true poses, for the speed
  bool moves_ = false;
  int stops_ = 0;
};

/// A table of the transits, and below it the names of what was missed.
std::string format_table(const std::vector<TransitScore>& scores);

}  // namespace situation_awareness
