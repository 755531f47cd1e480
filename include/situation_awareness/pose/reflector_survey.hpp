// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pose/odometry_track.hpp"
#include "situation_awareness/pose/reflector_map.hpp"
#include "situation_awareness/pose/reflector_models.hpp"
#include "situation_awareness/pose/reflectors.hpp"
#include "situation_awareness/pose/repeated_beams.hpp"

namespace situation_awareness {

// Survey of reflectors from a drive (docs/math/reflectors.md, "Survey").
//
//   symbol  meaning                                                              space     size
//   T_i     T_world_base at key i; T_0 is given                                  SE(2)
//   s       scale errors of odometry, of distances and of turns                  R^2       2
//   l_j     centre of reflector j in the world                                   R^2       2
//   u_i     motion of the base by odometry from key i - 1 to key i               SE(2)
//   z_ij    range and azimuth of reflector j at key i                            R^2       2
//   xi, P   error of the filter: T = (R_xi T^, p_xi), l = R_xi l^ + xi_l         R^(5+2n)
//
// The filter's error is that of the whole scene, turned about the origin of the world (a right-invariant error: Barrau
// and Bonnabel, "An EKF-SLAM algorithm with consistency properties", 2015). With the error of each pose in its own
// frame the filter would learn its yaw from single reflectors, which say nothing of it.

/// Parameters of a survey.
struct ReflectorSurveyParams {
  double radius_m = 0.05;
  double key_distance_m = 0.1;
  double key_turn_rad = 0.05;
  double gate_probability = 0.999;
  double min_advantage = 6.0;
  double min_separation_m = 0.15;
  double model_sigma_m = 0.001;
  double max_view_m = 8.0;
  int min_sightings = 8;
  double min_bright_part = 0.75;
  double max_nis = 4.0;
  int gone_scans = 8;
  double max_distance_sigma_m = 0.03;
  WheelErrorParams wheels;
  OdometryTrackParams odometry;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("radius_m", self.radius_m, Bounds{0.001, 1.0}, "m", "of all reflectors");
    visit("key_distance_m", self.key_distance_m, Bounds{0.01, 10.0}, "m", "a scan is used after so much way");
    visit("key_turn_rad", self.key_turn_rad, Bounds{0.005, 1.0}, "rad", "a scan is used after so much turning");
    visit("gate_probability", self.gate_probability, Bounds{0.5, 0.999999}, "",
          "probability that a sighting is inside the gate of the reflector that it is of");
    visit("min_advantage", self.min_advantage, Bounds{0.0, 1000.0}, "",
          "a sighting is not used if a second reflector is as near, in squared Mahalanobis distance, but for this");
    visit("min_separation_m", self.min_separation_m, Bounds{0.01, 10.0}, "m",
          "least distance of a new reflector from all others");
    visit("model_sigma_m", self.model_sigma_m, Bounds{0.0, 0.2}, "m",
          "standard deviation of a reflector's place about that of its sighting, apart from the scanner's errors");
    visit("max_view_m", self.max_view_m, Bounds{0.1, 1000.0}, "m",
          "a reflector must be bright, and be there, only where it is nearer than this");
    visit("min_sightings", self.min_sightings, Bounds{2, 10000}, "", "what was seen in fewer scans is left out");
    visit("min_bright_part", self.min_bright_part, Bounds{0.0, 1.0}, "",
          "least part of the scans with beams that end on it in which it is bright; what is less often is left out (a "
          "glossy thing)");
    visit("max_nis", self.max_nis, Bounds{1.0, 1000.0}, "",
          "greatest mean squared Mahalanobis distance of its sightings, per degree of freedom; what has more does not "
          "stand, or is no cylinder of that radius, and is left out");
    visit("gone_scans", self.gone_scans, Bounds{1, 10000}, "",
          "what beams pass through in so many scans after it was last seen has gone, and is left out");
    visit("max_distance_sigma_m", self.max_distance_sigma_m, Bounds{0.001, 100.0}, "m",
          "the survey is refused if the distance of two reflectors has a greater standard deviation");
    visit("wheels", self.wheels);
    visit("odometry", self.odometry);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// A reflector that was found.
struct SurveyedReflector {
  Reflector reflector;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< of its centre in the world, where the first pose is exact
  int sightings = 0;
  double nis = 0.0;          ///< mean squared Mahalanobis distance of its sightings, per degree of freedom
  double bright_part = 0.0;  ///< of the scans with beams that end on it
};

/// What was seen bright and is no reflector to localise by.
struct SurveyRefusal {
  Eigen::Vector2d center_world_m = Eigen::Vector2d::Zero();
  int sightings = 0;
  /// "seen too seldom", "not always bright", "does not stand still", "gone".
  const char* reason = "";
};

/// The result of a survey.
struct ReflectorSurveyResult {
  /// Empty, or why there is no map: one sentence.
  std::string reason;
  ReflectorMap map;                           ///< in the order in which they were first seen
  std::vector<SurveyedReflector> reflectors;  ///< those of the map
  std::vector<SurveyRefusal> refused;         ///< without those that were seen less than three times
  std::vector<Pose2> T_world_base;            ///< of the keys
  Eigen::Vector2d scale_error = Eigen::Vector2d::Zero();
  double way_m = 0.0;             ///< by odometry
  double distance_sigma_m = 0.0;  ///< greatest standard deviation of the distance of two reflectors
};

/// Finds the places of unknown reflectors from a drive by odometry among them (SLAM with landmarks). On the way a
/// filter of pose and reflectors tells which sighting is of which reflector (EKF SLAM: Smith, Self and Cheeseman,
/// 1990); at the end all poses and reflectors are adjusted at once (Lu and Milios, 1997). Not for live use: memory
/// grows with the way.
class ReflectorSurvey {
 public:
  /// `T_world_base`: the pose at the first scan, which defines the world. Throws std::invalid_argument naming field and
  /// bound.
  ReflectorSurvey(const ReflectorSurveyParams& params, const Pose2& T_world_base);

  /// As ReflectorLocalization::add_odometry; after a restart the survey is refused.
  OdometryTrack::Verdict add_odometry(std::int64_t stamp_ns, const Pose2& T_odom_base,
                                      std::int64_t received_ns = StampOrder::kNone);

  /// Adds a scan, in the order of the stamps; odometry up to its last beam has been added. `T_base_lidar`: of its level
  /// frame.
  void add(const ReflectorSightings& sightings, const Pose2& T_base_lidar);

  ReflectorSurveyResult solve() const;

  /// What was wrong with odometry and scans.
  const Counters& counters() const { return track_.counters(); }

 private:
  /// A sighting of a reflector at a key.
  struct Sighting {
    std::size_t reflector;  ///< index in found_
    Eigen::Vector2d z;
    Eigen::Matrix2d R;
    Pose2 T_base_lidar;  ///< at its time, from the base at the key
  };

  struct Key {
    Pose2 u;        ///< by odometry from the key before
    int jumps = 0;  ///< in between
    std::vector<Sighting> sightings;
    Pose2 T_base_lidar;
    FreeSpace free;      ///< of a scan; empty if the key is none
    Pose2 T_world_base;  ///< as the filter had it
  };

  /// What may be a reflector.
  struct Found {
    int sightings = 0;
    int first_key = 0, latest_key = 0;
    Eigen::Vector2d center_world_m = Eigen::Vector2d::Zero();  ///< as the filter had it
    int place = -1;                                            ///< in the filter; -1: it was given up
    RepeatedBeams beams;
  };

  struct Solution;
  struct NormalEquations;

  void begin_key(const OdometryTrack::Entry& at);
  Eigen::MatrixXd error_of_own(const Pose2& T_world_base) const;
  void predict(const Pose2& u, int jumps);
  void correct(std::size_t found, const Sighting& sighting);
  Eigen::Vector2d center_of(const Found& found) const;
  double distance2(const Found& found, const Sighting& sighting) const;
  void start(const Sighting& sighting);
  void give_up_rare();
  void add_way(std::size_t i, Solution& solution, NormalEquations& equations) const;
  void add_sightings(std::size_t i, Solution& solution, NormalEquations& equations) const;
  void linearise(Solution& solution, NormalEquations& equations) const;
  Solution adjust(const Solution& from) const;
  void merge(Solution& solution) const;
  void judge(Solution& solution) const;

  ReflectorSurveyParams params_;
  double gate_, far_gate_;
  OdometryTrack track_;
  bool was_restarted_ = false;
  bool has_key_ = false;
  OdometryTrack::Entry at_;  ///< of the latest key
  double way_m_ = 0.0;
  std::vector<Key> keys_;
  std::vector<Found> found_;
  // The filter: error of pose and scales, then of the reflectors, by `place`.
  ReflectorState x_;
  Eigen::VectorXd centers_m_;
  Eigen::MatrixXd P_;
};

}  // namespace situation_awareness
