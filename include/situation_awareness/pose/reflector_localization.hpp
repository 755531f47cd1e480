// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/nis_monitor.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pose/odometry_track.hpp"
#include "situation_awareness/pose/reflector_map.hpp"
#include "situation_awareness/pose/reflector_models.hpp"
#include "situation_awareness/pose/reflector_search.hpp"
#include "situation_awareness/pose/reflectors.hpp"
#include "situation_awareness/pose/repeated_beams.hpp"
#include "situation_awareness/pose/standing_place.hpp"

namespace situation_awareness {

/// Parameters of localisation by reflectors.
struct ReflectorLocalizationParams {
  double max_sigma_m = 1.0;
  double max_sigma_rad = 0.5;
  WheelErrorParams wheels;
  OdometryTrackParams odometry;

  // Constants of the method, which are not read from YAML.
  /// A moved reflector is used where it stands now, after it has been seen standing there for so long.
  double moved_use_s = 10.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_sigma_m", self.max_sigma_m, Bounds{0.01, 1000.0}, "m",
          "the pose is unknown beyond this standard deviation of the position in its worst direction");
    visit("max_sigma_rad", self.max_sigma_rad, Bounds{0.01, 3.0}, "rad",
          "the pose is unknown beyond this standard deviation of the yaw");
    visit("wheels", self.wheels);
    visit("odometry", self.odometry);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// A sighting that was used.
struct ReflectorMatch {
  std::size_t sighting = 0;  ///< index in ReflectorSightings::sightings
  int reflector = 0;         ///< index in the map
  double nis = 0.0;          ///< normalised innovation squared against the prediction, chi-square of 2
};

/// A reflector that does not stand where the map says.
struct MovedReflector {
  int reflector = 0;
  Eigen::Vector2d center_world_m = Eigen::Vector2d::Zero();  ///< where it was seen instead
  bool is_used = false;  ///< in that place, which is estimated together with the pose
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< of the place while it is used
};

/// What an update did.
struct ReflectorUpdate {
  std::int64_t stamp_ns = 0;
  bool is_known = false;  ///< the pose is, at this stamp
  /// Why the pose is not known at this stamp: the scan was not used ("scan out of order", "scan of another time", "no
  /// odometry"), "no pose yet" (fewer than three scans), those of ReflectorPose, "lost" (contradicted until
  /// nothing was known). Empty if it is known.
  const char* reason = "";
  bool is_found = false;         ///< the pose was found by a search in this update
  bool is_contradicted = false;  ///< reflectors are not where the pose says, or sightings where it says there are none
  std::vector<ReflectorMatch> matches;
  std::vector<std::size_t> ambiguous;  ///< sightings that may be of several reflectors and were not used
  std::vector<std::size_t> unmatched;  ///< sightings of no reflector
  std::vector<int> missing;            ///< reflectors that should have been in view for long, and were not
  std::vector<MovedReflector> moved;   ///< not used in their places until they are seen there again
  double nis = 0.0;                    ///< sum over the matches
};

/// For how long reflectors did not suffice. The times are those between the stamps of scans.
struct ReflectorCoverage {
  /// Fewer matches do not say where the robot is: by one it may be anywhere on a circle.
  static constexpr std::size_t kNeeded = 2;

  double all_s = 0.0;            ///< with scans
  double too_few_s = 0.0;        ///< with fewer matches than needed, or no pose
  double too_few_now_s = 0.0;    ///< up to the latest scan
  double longest_s = 0.0;        ///< at a stretch
  double largest_sigma_m = 0.0;  ///< standard deviation of the position in its worst direction, while it was known
  double largest_sigma_rad = 0.0;
};

/// Pose with the two forms of its covariance.
struct LocalizedPose {
  std::int64_t stamp_ns = 0;
  Estimate<Pose2> T_world_base;  ///< P: of the error in the frame of the base (forward, left, yaw)
  Eigen::Matrix3d covariance_world = Eigen::Matrix3d::Zero();  ///< of x, y (m) in the world and yaw (rad)
};

/// Localises a robot by reflectors and wheel odometry. Time and memory per call are bounded; no allocation after
/// warm-up.
class ReflectorLocalization {
 public:
  /// Most sightings of a scan that are used: those with the most hits.
  static constexpr std::size_t kMaxSightings = 16;
  /// Most reflectors that are used where they have been moved to.
  static constexpr std::size_t kMaxMovedUsed = 4;

  /// Throws std::invalid_argument as check_reflectors and the params' validate() do.
  ReflectorLocalization(const ReflectorMap& map, const ReflectorLocalizationParams& params);

  /// Adds a pose by odometry, as OdometryTrack::add. `counters` has what was wrong with it; after a restart of its time
  /// no pose is known.
  OdometryTrack::Verdict add_odometry(std::int64_t stamp_ns, const Pose2& T_odom_base,
                                      std::int64_t received_ns = StampOrder::kNone);

  /// As StampOrder::trust, where another has judged the stamps of the scans.
  void trust_scan_stamps() { scans_.trust(); }

  /// Sets the pose at a stamp, with its standard deviations.
  void initial_pose(std::int64_t stamp_ns, const Pose2& T_world_base, double sigma_m, double sigma_rad);

  /// Forgets the pose: the next scans find it without a guess.
  void relocate();

  /// Predicts the pose to the stamp of the scan and corrects it, or searches for it while it is not known.
  /// `T_base_lidar`: of the level frame of the scan. The result is overwritten by the next call.
  const ReflectorUpdate& update(const ReflectorSightings& sightings, const Pose2& T_base_lidar);

  bool is_known() const { return is_known_; }
  /// The pose at the stamp of the latest scan. Only while it is known.
  LocalizedPose pose() const;
  /// The state at the last sighting that was used, with what has been learned of the wheels.
  const Estimate<ReflectorState>& state() const { return estimate_; }

  const ReflectorMap& map() const { return map_; }
  /// Of the innovations; its summary takes what was added since the one before.
  NisMonitor& nis_monitor() { return nis_monitor_; }
  /// Since the construction.
  const ReflectorCoverage& coverage() const { return coverage_; }
  /// Since the construction: what was wrong with odometry and scans, searches by their result, poses lost and found.
  Counters counters() const;

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Matrix26 = Eigen::Matrix<double, 2, 6>;
  static constexpr int kMovedSize = 2 * static_cast<int>(kMaxMovedUsed);
  using Assignment = std::array<int, kMaxSightings>;  ///< reflector of each sighting, or -1

  /// A sighting as a reflector.
  struct Possible {
    int reflector;
    Eigen::Vector2d z;
    Eigen::Matrix2d R;       ///< of one scan
    Eigen::Matrix2d white;   ///< the part of R that is new with every scan
    Eigen::Matrix2d R_gate;  ///< R, and the errors of odometry since the stamp, and of the place of a moved reflector
  };

  struct SightingFit {
    double radius_m = -1.0;  ///< none yet
    ReflectorFit fit;
  };

  /// A sighting of the scan that is treated.
  struct Seen {
    std::size_t sighting;
    OdometryTrack::Entry at;   ///< odometry at its time
    Pose2 T_base_lidar;        ///< at its time, from the base at the stamp
    Matrix6 Q;                 ///< error of odometry from the stamp on
    std::size_t first, count;  ///< in possible_
  };

  /// What has been seen of a reflector lately.
  struct Watched {
    RepeatedBeams beams;
    int missing = 0;
    bool is_missing = false;
    int elsewhere = 0;
    Eigen::Vector2d elsewhere_world_m = Eigen::Vector2d::Zero();
    bool is_moved = false;
    int back = 0;
    int left = 0;          ///< scans with beams through the place elsewhere, less those that saw it there
    StandingPlace stands;  ///< elsewhere
    int used = -1;         ///< in which of moved_, or -1
  };

  /// The places in the world that moved reflectors are used at, and their errors: part of the state of the filter,
  /// whose size is fixed (EKF SLAM: Smith, Self and Cheeseman, 1990). What is not in use is zero.
  struct MovedPlaces {
    std::array<bool, kMaxMovedUsed> is_used{};
    Eigen::Matrix<double, kMovedSize, 1> l = Eigen::Matrix<double, kMovedSize, 1>::Zero();
    Eigen::Matrix<double, kMovedSize, kMovedSize> P = Eigen::Matrix<double, kMovedSize, kMovedSize>::Zero();
    Eigen::Matrix<double, 6, kMovedSize> P_state = Eigen::Matrix<double, 6, kMovedSize>::Zero();  ///< with the state

    bool any() const;
    Eigen::Vector2d at(int i) const { return l.segment<2>(2 * i); }
    Eigen::Matrix2d covariance_at(int i) const { return P.block<2, 2>(2 * i, 2 * i); }
  };

  /// What shines and is none of the reflectors in their places.
  struct Stranger {
    Eigen::Vector2d p_world_m;
    int scans;  ///< that saw it while others were matched
  };

  /// Something that has been seen standing, for the search.
  struct Stood {
    Eigen::Vector2d center_track_m;
    Eigen::Matrix2d covariance;
    int scans;
    std::int64_t stamp_ns;
    Eigen::Vector2d base_track_m;  ///< where the robot was then
  };

  struct Leaf {
    Assignment reflector_of;
    double cost;
  };

  void forget(const char* reason);
  void forget_reflectors();
  void set_pose(const OdometryTrack::Entry& at, const Estimate<Pose2>& T_world_base);
  void predict_to(const OdometryTrack::Entry& target);
  double turn_before(const OdometryTrack::Entry& from, const OdometryTrack::Entry& to) const;
  Matrix6 noise_of(const Pose2& u) const;
  void remember_errors();
  void look(const ReflectorSightings& sightings, const Pose2& T_base_lidar, const OdometryTrack::Entry& now);
  bool is_possible(const ReflectorSightings& sightings, const Seen& seen, const Eigen::Vector2d& center_m,
                   double radius_m, const Eigen::Matrix2d& P_l, SightingFit& fit, Possible& possible) const;
  void list_possible(const ReflectorSightings& sightings);
  Possible& possible_of(std::size_t k);
  Eigen::Vector2d center_of(std::size_t reflector) const;
  void associate();
  void try_sighting(std::size_t k, const Estimate<ReflectorState>& estimate, double cost);
  void weigh(double resolution_rad);
  void correct(const Pose2& T_base_lidar);
  template <int Moved>
  void correct_with(const Pose2& T_base_lidar);
  std::size_t count_strange(const ReflectorSightings& sightings);
  bool judge_reflector(const ReflectorSightings& sightings, const Pose2& T_base_lidar, std::size_t k, bool is_certain);
  void tell_displaced();
  void judge_pose(const ReflectorSightings& sightings, std::size_t seen_through);
  void judge_reflectors(const ReflectorSightings& sightings, const Pose2& T_base_lidar);
  bool is_seen_through(const ReflectorSightings& sightings, const Pose2& T_base_lidar,
                       const Reflector& reflector) const;
  void judge_elsewhere(const ReflectorSightings& sightings, const Pose2& T_base_lidar, std::size_t reflector,
                       bool is_gone);
  void use_moved(Watched& watched);
  void leave_moved(Watched& watched);
  void collect(const ReflectorSightings& sightings, const OdometryTrack::Entry& now);
  void search(const OdometryTrack::Entry& now);
  void cover(std::int64_t stamp_ns);

  ReflectorMap map_;
  ReflectorLocalizationParams params_;
  double gate_;
  double mean_radius_m_ = 0.0, radius_spread_m_ = 0.0;
  OdometryTrack track_;
  StampOrder scans_;
  ReflectorSearch search_;
  NisMonitor nis_monitor_{2};
  Counters counters_;

  bool is_known_ = false;
  bool has_scales_ = false;  ///< the wheels' errors of scale, since a first pose was known
  const char* reason_ = "no pose yet";
  Estimate<ReflectorState> estimate_;
  Eigen::Vector3d wheel_error_ = Eigen::Vector3d::Zero();  ///< the largest that the wheels have had lately, at least
  OdometryTrack::Entry at_;                                ///< the odometry of the estimate
  Estimate<Pose2> at_stamp_;  ///< of the latest scan; the estimate is at that of its last sighting
  std::int64_t stamp_ns_ = 0;
  std::int64_t confirmed_ns_ = 0;  ///< the latest scan with two matches or more
  bool has_initial_ = false;
  LocalizedPose initial_;
  int contradicted_ = 0;     ///< scans in a row
  bool was_unsure_ = false;  ///< of the pose, since enough reflectors were matched
  int doubtful_ = 0;         ///< scans with more sightings unmatched than matched, less the others

  std::vector<Watched> watched_;
  MovedPlaces moved_;
  std::vector<Seen> seen_;
  std::vector<Possible> possible_;
  Assignment reflector_of_{};  ///< of seen_
  std::vector<Leaf> leaves_;
  Assignment trial_{};
  std::vector<char> taken_;
  double best_cost_ = 0.0;
  int nodes_ = 0;
  std::vector<Stranger> strangers_;
  std::vector<Stood> stood_;
  std::vector<std::size_t> order_;
  std::vector<std::size_t> in_time_;  ///< matched ones of seen_
  std::vector<ReflectorPlace> places_;
  ReflectorCoverage coverage_;
  std::optional<std::int64_t> covered_ns_;  ///< up to here
  ReflectorUpdate update_;
};

}  // namespace situation_awareness
