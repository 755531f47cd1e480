// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/evaluation/bodies.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// Criteria of a match, of visible and of hidden objects in the evaluation of a map.
struct MapEvaluationParams {
  double max_match_distance_m = 0.5;  ///< centres farther apart are not the same object; also GOSPA's cut-off
  int visible_beams = 5;              ///< a true object hit by at least this many beams is visible
  double body_margin_m = 0.1;         ///< an element within this distance of the hull of a body's parts is on the body
  double body_settling_s = 1.0;       ///< time after its first detection from which a body should be one element
  double min_hidden_s = 0.5;          ///< a shorter time without a beam is not counted as hidden
  double recognition_s = 1.0;         ///< an object that is visible again should be on the map within this time
};

/// A period without a beam on an object that had been on the map.
struct HiddenTime {
  double from_s = 0.0;  ///< first scan without a beam on it, on the clock of the stamps
  double to_s = 0.0;    ///< first scan with a beam on it again, or the last scan of the run
  /// Whether the first element on it, within recognition_s after it is visible again, has the previous id; nothing if
  /// the run ended before.
  std::optional<bool> same_id;
  std::optional<double> deleted_after_s;  ///< time from from_s until its element left the map, if it did while hidden
};

/// Errors of the five parameters of an ellipse in the world, rx >= ry, psi modulo pi.
struct EllipseErrors {
  double rx_m = 0.0, ry_m = 0.0, tx_m = 0.0, ty_m = 0.0, psi_rad = 0.0;
};

/// What has a body on a map where that is no element but an outline: a polyline or a boundary.
struct OutlineOnBody {
  std::uint64_t id = 0;  ///< 0: nothing
  double rms_m = 0.0;    ///< distance from the body's outline
};

/// The outlines of a map beside its elements.
struct MapOutlines {
  std::vector<std::uint64_t> ids;        ///< of all
  std::vector<OutlineOnBody> of_bodies;  ///< one for each object, or body of several; empty: none
  std::vector<bool> on_fixtures;  ///< for each element of the map, whether it is on what is a fixture; empty: none is
};

/// Result for one true object, or a body of several. A body's centre, velocity and shape are its first part's.
struct ObjectScore {
  std::uint64_t truth_id = 0;  ///< of a body: its first part's
  bool moves = false;          ///< its velocity was not zero in some scan
  int visible_scans = 0;       ///< scans in which it was visible
  int mapped_scans = 0;        ///< of those, with an element of the map on it
  int outline_scans = 0;       ///< of those, without an element but with an outline on it
  double max_delay_s = 0.0;    ///< longest time visible without being on the map
  double center_rmse_m = 0.0;  ///< over mapped_scans, as all errors
  double velocity_rmse_m_s = 0.0;
  double radius_mae_m = 0.0;       ///< both radii, each sorted
  double outline_rms_m = 0.0;      ///< over outline_scans
  EllipseErrors mean_square;       ///< of each error; m^2, rad^2
  EllipseErrors max_absolute;      ///< of each error
  double psi_sigma_rms_rad = 0.0;  ///< root mean square of the map's own standard deviation of psi
  int id_switches = 0;             ///< changes of its element, or outline, after any time
  std::vector<HiddenTime> hidden;
};

/// Errors over a class of objects: the visible, mapped ones and their scans.
struct ClassScore {
  int scans = 0;
  double center_rmse_m = 0.0;
  double velocity_rmse_m_s = 0.0;
  double semi_axis_mae_m = 0.0;  ///< without bodies of several parts, whose one ellipse has no true axes
};

/// Fractions of the visible, mapped objects and their scans with the truth inside the map's 99 % region: of objects
/// that are one ellipse, not of bodies of several parts.
struct Held99 {
  double position = 0.0;           ///< 2 degrees of freedom
  double position_velocity = 0.0;  ///< 4
  double radii = 0.0;              ///< 2
};

/// Result for a body of several parts while its parts were separate segments.
struct BodyScore {
  std::string name;
  int scans_apart = 0;  ///< scans with two or more separate parts, once the body had been seen for body_settling_s
  int scans_one = 0;    ///< of those, with exactly one element on the body
};

/// How a map compares with the truth over a run.
struct MapScore {
  std::vector<ObjectScore> objects;
  std::vector<BodyScore> bodies;
  double center_rmse_m = 0.0;  ///< over all visible, mapped objects and scans
  double velocity_rmse_m_s = 0.0;
  ClassScore standing, moving;
  Held99 held_99;
  double max_delay_s = 0.0;
  double longest_false_s = 0.0;  ///< longest duration of a false element
  double false_per_scan = 0.0;
  double on_fixtures_per_scan = 0.0;
  double recall = 0.0;
  double gospa_m = 0.0;  ///< mean over the scans
  int id_switches = 0;
  int scans = 0;
};

/// How a map compares with the truth at one time.
struct ScanScore {
  double gospa_m = 0.0;
  int missed = 0;  ///< visible objects without an element
  int false_elements = 0;
};

/// Compares map and truth scan by scan: elements are matched one to one with true objects at the least total distance.
/// A visible object counts for recall, delay and errors; an element on a hidden object, or on one hit by few beams, is
/// neither correct nor false, and GOSPA ignores both. The parts of a body are one object, on which an element may be
/// anywhere; a second one there is false. So is an element anywhere on a box of the truth. A fixture is a box of the
/// room, such as a cabinet: an element within body_margin_m of it is on something real that is no object of the truth,
/// and neither correct nor false. An object that has no element but an outline is on the map.
class MapEvaluation {
 public:
  /// `bodies`: objects that are one body, as indices of the truth's objects; without it each object is its own.
  explicit MapEvaluation(const MapEvaluationParams& params = {}, std::vector<Body> bodies = {},
                         std::vector<Box> fixtures_world = {})
      : params_(params), bodies_(std::move(bodies)), fixtures_world_(std::move(fixtures_world)) {}

  /// Truth and map at the same stamp; stamps increase, and the truth's objects keep their order. `Object::beams` of the
  /// truth counts the beams that hit it. `separate_parts`, one number per body, counts the parts that are separate
  /// segments in this scan (`separate_parts()`); without it bodies are not evaluated. Ids of elements and outlines are
  /// of one source.
  ScanScore add(const Objects& truth, const Objects& map, const std::vector<int>& separate_parts = {},
                const MapOutlines& outlines = {});

  MapScore score() const;

  /// Changes of an object's element, so far.
  int id_switches() const;

 private:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();
  /// A period without beams that has not ended, or after which there has been no element yet.
  struct Hiding {
    std::int64_t from_ns = kNever;
    std::int64_t to_ns = kNever;             ///< kNever while it lasts
    std::int64_t visible_again_ns = kNever;  ///< kNever while beams are few
    std::optional<double> deleted_after_s;
  };
  struct ObjectTally {
    bool moves = false;
    int visible_scans = 0;
    int mapped_scans = 0;
    int outline_scans = 0;
    double outline_sse_m2 = 0.0;
    int id_switches = 0;
    std::uint64_t element_id = 0;
    std::int64_t unmapped_since_ns = kNever;
    double max_delay_s = 0.0;
    double velocity_sse_m2_s2 = 0.0;
    EllipseErrors sum_of_squares, max_absolute;
    double radius_sae_m = 0.0;
    double psi_variance_sum_rad2 = 0.0;
    int held_position = 0, held_position_velocity = 0, held_radii = 0;
    std::optional<Hiding> hiding;
    std::vector<HiddenTime> hidden;
  };
  struct BodyTally {
    std::int64_t first_visible_ns = kNever;
    int scans_apart = 0;
    int scans_one = 0;
  };
  /// One object or body to be mapped, in one scan.
  struct Target {
    const Object* reference = nullptr;
    std::vector<Ellipse> parts;
    int beams = 0;
  };

  std::vector<Target> targets_of(const Objects& truth) const;
  bool is_on_fixture(const Object& element) const;
  std::vector<int> match(const std::vector<Target>& targets, const Objects& map) const;
  void compare(ObjectTally& tally, const Object& truth, const Object& element) const;
  /// `id`: of the element or outline on it, 0: none.
  void update_hidden_time(ObjectTally& tally, const Target& target, std::uint64_t id, const Objects& map,
                          const MapOutlines& outlines) const;
  HiddenTime hidden_time(const Hiding& hiding, std::int64_t end_ns, std::optional<bool> same_id) const;
  void evaluate_bodies(const std::vector<Target>& targets, const Objects& map, const std::vector<int>& separate_parts);

  MapEvaluationParams params_;
  std::vector<Body> bodies_;
  std::vector<Box> fixtures_world_;
  std::map<std::uint64_t, ObjectTally> objects_;       ///< by truth id
  std::vector<BodyTally> body_tallies_;                ///< as bodies_
  std::map<std::uint64_t, bool> has_parts_;            ///< by truth id: a body of several
  std::map<std::uint64_t, std::int64_t> false_since_;  ///< by element id
  double longest_false_s_ = 0.0;
  double gospa_sum_m_ = 0.0;
  long false_elements_ = 0;
  long on_fixtures_ = 0;
  int scans_ = 0;
  std::int64_t stamp_ns_ = 0;
};

/// The score as a text table, one line per true object, named by `names` where it has the id.
std::string format_table(const MapScore& score, const std::map<std::uint64_t, std::string>& names);

}  // namespace situation_awareness
