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
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/path/chain_view.hpp"
#include "situation_awareness/path/path.hpp"
#include "situation_awareness/path/scanner_watch.hpp"
#include "situation_awareness/path/seen_ground.hpp"
#include "situation_awareness/path/spline_path.hpp"
#include "situation_awareness/path/vehicle.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

// Safety areas (docs/math/path.md; polygons paper, Sects. 1 and 4).
//
//   symbol   meaning                                                                            unit
//   v        speed; v_f is the full one, the least of vehicle and path                          m/s
//   t_r      reaction time                                                                      s
//   a, b     usual deceleration, and the one that is sure                                       m/s^2
//   D(v)     way to stop in, v t_r + v^2 / 2 a, and a distance to what is ahead                  m
//   D_f(v)   the least one, v t_r + v^2 / 2 b                                                   m
//   T(v)     time to stop in, t_r + v / b                                                       s
//   m        margin about the footprint                                                         m
//
// An area is what the footprint sweeps on its way, with a margin. All grow with v:
//
//   hard floor         D_f(v), m_f         whatever is in it counts under every policy
//   protective area    D(v), m_p           where something in it counts the vehicle stops
//   warning area       D(v), m_p + v_m T(v)    v_m: speed of a mover; where something in it counts the vehicle slows
//   down

/// What counts (polygons paper, Sect. 1). Things that may move and unknown hits count under every policy, and so does
/// what is in the hard floor. No policy guesses who is hidden beside the way: past known chains that may hide somebody
/// the vehicle is slow under kConservative alone.
enum class SafetyPolicy : std::uint8_t {
  kConservative,  ///< whatever is in the areas
  kUpdated,       ///< the areas shrink beside the way so that known chains are outside, as far as the hard floor allows
  kIgnoreKnown,   ///< hits on known chains do not count
};

/// "conservative", "updated", "ignore_known".
const char* name_of(SafetyPolicy policy);
std::string yaml_text(SafetyPolicy policy);
/// Throws std::invalid_argument if there is no such policy.
void read_yaml_text(const std::string& yaml, SafetyPolicy& policy);

/// What the areas decide by, beside the scan and its pose.
enum class SafetyInput : std::uint8_t {
  kMap = 0,         ///< without it all hits are unknown; without its objects nobody knows who stands at a wall
  kCovariance = 2,  ///< of the pose
  kSpeed = 3,       ///< without it the vehicle counts as driving at its greatest speed
};

/// "map", "covariance of the pose", "speed".
const char* name_of(SafetyInput input);

/// Parameters of the safety areas.
struct SafetyParams {
  SafetyPolicy policy = SafetyPolicy::kUpdated;
  double margin_m = 0.12;
  double floor_margin_m = 0.05;
  double standoff_m = 0.15;
  double mover_speed_m_s = 2.0;
  double slow_speed_m_s = 0.15;
  double sigmas = 3.0;
  double max_sigma_m = 0.2;
  double max_sigma_rad = 0.2;
  double max_error_m = 1.0;
  double standing_s = 2.0;
  double max_map_age_s = 1.0;
  double max_pose_age_s = 0.5;
  double reliable_range_m = 8.0;
  bool must_see_ahead = false;

  // Constants of the method, which are not read from YAML.
  /// An outline is known from this probability of existence on, and from 0.75 on; an object counts from it on.
  double min_p_exists = 0.8;
  /// An unknown hit counts, outside the hard floor, with so many unknown ones near it, itself included.
  int min_hits = 2;
  /// The vehicle turns on the spot where all that its footprint may sweep was seen free within this time.
  double turn_memory_s = 10.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit(
        "policy", self.policy,
        "what counts: conservative (whatever is in the areas), updated (the areas shrink so that known chains are "
        "outside) or ignore_known; what may move and what is unknown always counts; who steps out from behind a known "
        "chain is allowed for, by slow_speed_m_s, under conservative alone");
    visit("margin_m", self.margin_m, Bounds{0.0, 10.0}, "m", "margin of the protective area about the footprint");
    visit("floor_margin_m", self.floor_margin_m, Bounds{0.0, 10.0}, "m",
          "that of the hard floor, at most margin_m: nothing nearer is ever ignored");
    visit("standoff_m", self.standoff_m, Bounds{0.0, 10.0}, "m",
          "distance ahead, beyond the margin, that the vehicle keeps from what is on its way");
    visit("mover_speed_m_s", self.mover_speed_m_s, Bounds{0.1, 20.0}, "m/s",
          "greatest speed of what may move: the vehicle stands before something so fast gets to it");
    visit("slow_speed_m_s", self.slow_speed_m_s, Bounds{0.0, 20.0}, "m/s",
          "speed beside standing things in the warning area");
    visit("sigmas", self.sigmas, Bounds{0.0, 10.0}, "",
          "standard deviations of the pose that are added to the margins");
    visit("max_sigma_m", self.max_sigma_m, Bounds{0.001, 10.0}, "m",
          "the vehicle stops where the standard deviation of its position is greater");
    visit("max_sigma_rad", self.max_sigma_rad, Bounds{0.001, 3.0}, "rad", "the same of its yaw");
    visit("max_error_m", self.max_error_m, Bounds{0.05, 100.0}, "m",
          "the vehicle stops where it is farther from its path");
    visit("standing_s", self.standing_s, Bounds{0.0, 1000.0}, "s",
          "what is on a map for so long and does not move is a standing thing, which the vehicle may pass slowly");
    visit("max_map_age_s", self.max_map_age_s, Bounds{0.05, 10.0}, "s",
          "a map that is older than this, or as far ahead of the scan, or whose objects are, is none: the policy is "
          "conservative; an outline that was last seen before that explains no hit");
    visit("max_pose_age_s", self.max_pose_age_s, Bounds{0.05, 10.0}, "s",
          "a covariance of the pose that is older than this, or as far ahead of the scan, is none: the vehicle stops");
    visit("reliable_range_m", self.reliable_range_m, Bounds{0.5, 100.0}, "m",
          "so far the scanner is sure to see a known chain: the vehicle stops where it sees through most of them");
    visit(
        "must_see_ahead", self.must_see_ahead,
        "the vehicle stands until beams of the quarter ahead had a return, since a scanner that is covered there from "
        "the beginning is like one in an open place; not where nothing may be within its range");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// A vehicle when a scan began.
struct VehicleState {
  Pose2 T_world_base;
  /// Of the error in x, y (m) and yaw (rad). One that is no covariance, as of NaN, says that there is none: a stop.
  Eigen::Matrix3d covariance_world = Eigen::Matrix3d::Zero();
  double speed_m_s = 0.0;                      ///< measured; NaN: not
  std::optional<std::int64_t> speed_stamp_ns;  ///< when; none: with the scan
};

/// What the areas say of a scan.
struct SafetyDecision {
  enum class Verdict : std::uint8_t { kFullSpeed, kSlow, kStop };
  enum class Kind : std::uint8_t {
    kNone,
    kUnknownHit,
    kChain,   ///< an outline of the map: a polyline or a boundary
    kObject,  ///< an ellipse or a box, or what may move whatever its shape, or a target
    kHidden,
    kPose,
    kContradiction,  ///< the scan sees through what is on the map or was seen just before, or no scan saw anything yet
    kFrozenScan,     ///< the scanner's driver repeats itself
  };

  std::int64_t stamp_ns = 0;
  Verdict verdict = Verdict::kStop;
  Kind kind = Kind::kPose;  ///< of what decides
  FeatureId id = 0;         ///< of the feature that does
  Eigen::Vector2d place_world_m = Eigen::Vector2d::Zero();
  double distance_m = std::numeric_limits<double>::infinity();  ///< along the way
  double allowed_speed_m_s = 0.0;
  bool may_turn = false;  ///< on the spot; never by a scan of which half the beams or more say nothing
  SafetyPolicy policy = SafetyPolicy::kUpdated;  ///< of this scan
  std::vector<SafetyInput> missing;              ///< each once: never there, too old, or not to be used
  std::size_t segment = 0;                       ///< of the path as its file has it
  std::size_t counted = 0;                       ///< hits in the areas that count, and
  std::size_t ignored = 0;                       ///< those on known chains that do not
  /// The areas, as polygons: the warning area of the full speed, the protective area of the present one. Empty without
  /// a pose on the path.
  std::vector<Eigen::Vector2d> warning_world_m, protective_world_m;
};

const char* name_of(SafetyDecision::Verdict verdict);  ///< "full speed", "slow", "stop"
/// Whether what decides is at a place.
bool has_place(SafetyDecision::Kind kind);

const char* name_of(SafetyDecision::Kind kind);  ///< "none", "unknown hit", "chain", "object", "hidden", "pose",
                                                 ///< "contradiction", "frozen scan"

/// Decides how fast a vehicle may drive along its path: the greatest speed at which nothing that counts is in the
/// areas.
///
/// - Hits are unknown, unless a feature of the map explains them. What is unknown, what moves and persons may move at
///   mover_speed_m_s to wherever they like; the vehicle stands before they get to it, if it brakes.
/// - Polylines that are fixed, certain, no person's and seen by no camera, which sees things that drive off, are known
///   chains.
/// - Standing things (other polylines and boundaries, which may lead over gaps that no scan saw, objects that do not
///   move, and known chains where they count) are passed at slow_speed_m_s in the warning area; the vehicle stops
///   before the protective area reaches them. Targets of images are such things, and explain no hit.
/// - A hidden place is not free: the vehicle can stop before the first place of its way that the scan does not see.
///   What may step out of a hidden place beside the way is not guessed: someone who runs out from behind a known chain
///   may be touched if the scan sees them for less time than the vehicle needs to stand. What counted and got out of
///   view still counts, for memory_s.
/// - What is missing is not taken for "nothing there": without a map as fresh as the scan, objects included, the policy
///   is conservative, whatever the parameter says. An outline explains hits if the map saw it with the latest scans,
///   and the scan at hand does not see through it nearby. One that explains nothing, of a stale map or a file, is still
///   in the way of the footprint where the scanner does not look.
/// - A pose that stands still while the measured speed says that the vehicle moves is none, until it moves.
/// - A scan that contradicts the map or the scan before, or repeats it, is a stop, as are all scans before the first
///   that shows that the scanner sees (path/scanner_watch.hpp).
///
/// No allocation after warm-up. The cost is in proportion to the hits and to the vertices of the map, and to the
/// product of those alone that are within the areas.
class SafetyAreas {
 public:
  /// Throws std::invalid_argument naming `source`, or field and bound.
  SafetyAreas(const Path& path, const VehicleParams& vehicle, const SafetyParams& params,
              const std::string& source = "path");

  const SafetyParams& params() const { return params_; }

  /// Whether a scan has shown that the scanner sees.
  bool scanner_has_seen() const { return blind_.has_seen(); }

  /// Whether one has shown it of the quarter ahead: a twentieth of the beams there had a return.
  bool scanner_has_seen_ahead() const { return blind_.has_seen_ahead(); }

  /// Areas of the scan `points`, by the latest map, which is fresh or not by its stamps; 0: there is none. The result
  /// is valid until the next call. `ranges_m`: of the beams as the driver gave them, by which it is found if it repeats
  /// itself; empty: this is not looked for.
  const SafetyDecision& update(const Points& points, const VehicleState& vehicle, const Map& map,
                               const std::vector<float>& ranges_m = {});

  /// Forgets the hits of earlier scans, what they saw free, and where on the path the vehicle was; not that the scanner
  /// was found to be blind.
  void reset();

 private:
  static constexpr double kNoLimit = std::numeric_limits<double>::infinity();
  static constexpr double kStep_m = 0.05;          ///< between the poses on the way; contacts are interpolated
  static constexpr std::size_t kMostPasses = 512;  ///< of beams through chains that are remembered

  /// How much something counts.
  enum class Weight : std::uint8_t {
    kMayMove,
    kStands,
    kKnown,
    kFloorAlone,
    kUnseen,  ///< a place of a chain that the scan does not see: it counts in the floor, where the vehicle gets nearer
  };

  /// Something in or near the areas.
  struct Thing {
    Eigen::Vector2d p_world_m;
    Weight weight = Weight::kMayMove;
    SafetyDecision::Kind kind = SafetyDecision::Kind::kUnknownHit;
    FeatureId id = 0;
    int point = -1;  ///< index of the hit in the scan; -1: none
  };

  /// What stands, as a line: a polyline of the map, or a boundary.
  struct Outline {
    const Feature* feature;
    const ChainVertex* vertices;  ///< null, until all are found: those of a boundary
    std::size_t first, count;     ///< of these in lines_
    bool closed;
    bool may_move;  ///< a person's
  };

  struct Edge {
    Eigen::Vector2d from_m, to_m;
    double reach_m;  ///< a hit on it is so near
    Weight weight;
    FeatureId id;
    bool explains;
    bool may_move;
  };

  struct SeenThrough {
    Eigen::Vector2d p_world_m;
    FeatureId id;
  };

  struct Mover {
    Ellipse ellipse;
    Weight weight;
    FeatureId id;
  };

  struct Remembered {
    Eigen::Vector2d p_world_m;
    std::int64_t stamp_ns;
  };

  /// A pose on the way, with its rotation, which is needed for each hit.
  struct Step {
    Step(const Pose2& T_world_base) : pose(T_world_base), R_world_base(T_world_base.rotation()) {}  // NOLINT

    Eigen::Vector2d to_world(const Eigen::Vector2d& p_base_m) const {
      return R_world_base * p_base_m + pose.translation_m;
    }
    Eigen::Vector2d to_base(const Eigen::Vector2d& p_world_m) const {
      return R_world_base.transpose() * (p_world_m - pose.translation_m);
    }

    Pose2 pose;
    Eigen::Matrix2d R_world_base;
  };

  /// Margins of the present pose.
  struct Margins {
    double floor_m = 0.0, protective_m = 0.0;
  };

  struct Limits {
    double stop_m_s;   ///< the vehicle stops if it is faster
    double speed_m_s;  ///< it may drive as fast as this
    double distance_m;
  };

  bool is_fresh(std::int64_t stamp_ns, double max_age_s) const;
  bool is_fresh(const Map& map) const;
  bool is_known(const Outline& outline) const;
  double known_speed_m_s(const VehicleState& vehicle);
  bool pose_stands_still(const VehicleState& vehicle, bool speed_is_known);
  bool take_covariance(const Eigen::Matrix3d& covariance_world);
  bool place_on_path(const VehicleState& vehicle);
  void set_full_speed();
  void make_way(const VehicleState& vehicle);
  void find_outlines(const Map& map);
  void gather_edges(const Map& map);
  void gather_movers(const Map& map);
  void gather_mover(const Feature& feature, Ellipse ellipse, const BodyState& body, double age_s);
  void gather_target(const Feature& feature, const FootprintShape& target);
  void gather_rim(const Ellipse& ellipse, Weight weight, FeatureId id);
  void view_chains(const Points& points, const Map& map);
  void gather_things(const Points& points);
  void gather_unseen_chains(const Points& points);
  void explain(Thing& thing) const;
  bool is_seen_through(const Edge& edge, const Eigen::Vector2d& p_world_m) const;
  void count_neighbours();
  void recall(const Points& points);
  void remember(std::int64_t stamp_ns);
  Limits limits_of(const Thing& thing) const;
  void judge(double present_m_s);
  void look_along_the_way(const Points& points);
  void note_what_is_free(const Points& points);
  bool may_turn();
  double seen_range_m(const Points& points, const Eigen::Vector2d& p_level_m) const;
  bool is_near(const Eigen::Vector2d& p_world_m, double more_m = 0.0) const;

  double way_of_speed_m(double speed_m_s) const;  ///< D
  double speed_of_way_m_s(double way_m) const;    ///< the inverse of D
  double floor_speed_of_way_m_s(double way_m) const;
  double warning_margin_m(double speed_m_s) const;
  double speed_of_margin_m_s(double margin_m) const;

  void make_frames();
  void sweep(double way_m, double margin_m, std::vector<Eigen::Vector2d>& polygon_world_m);
  void shrink(std::vector<double>& widths_m, double side, const std::vector<double>& least_m) const;

  VehicleParams vehicle_;
  SafetyParams params_;
  std::vector<SplinePath> ways_;        ///< there and, of an open path, back
  std::vector<Eigen::Vector2d> rim_m_;  ///< places on the outline of the footprint
  double reach_m_ = 0.0;

  std::size_t direction_ = 0;
  bool on_path_ = false;
  double way_m_ = 0.0;
  double full_speed_m_s_ = 0.0;
  Margins margins_;
  double sigma_m_ = 0.0, sigma_rad_ = 0.0;
  // The way by the speed since a place that the pose had.
  double travel_m_ = 0.0;
  std::int64_t travel_ns_ = 0;
  Eigen::Vector2d travel_from_m_ = Eigen::Vector2d::Zero();
  bool stands_still_ = false;
  Pose2 T_world_base_;
  std::vector<Step> steps_;
  Eigen::Vector2d low_m_, high_m_;  ///< corners of a box about the warning area
  std::vector<Outline> outlines_;
  Splinegon boundary_;                  ///< for its memory, as
  std::vector<SplinegonPoint> points_;  ///< along it
  std::vector<ChainVertex> lines_;      ///< of all boundaries
  std::vector<Edge> edges_;
  std::vector<Mover> movers_;
  std::vector<Thing> things_;
  std::vector<Remembered> remembered_;
  ChainView view_;
  std::vector<SeenThrough> seen_through_;
  SeenGround ground_;
  RepeatedScans repeated_;
  BlindScanner blind_;
  // For the polygons: frames along the way, beyond its begin and end too, and the widths of an area at each.
  std::vector<Step> frames_;
  std::size_t first_frame_ = 0;  ///< that of the first step
  std::vector<double> left_m_, right_m_, wide_left_m_, wide_right_m_, floor_left_m_, floor_right_m_;
  SafetyDecision decision_;
};

}  // namespace situation_awareness
