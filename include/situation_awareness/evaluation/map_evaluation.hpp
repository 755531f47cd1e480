// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

struct MapEvaluationParams {
  double max_match_distance_m = 0.5;  ///< centres farther apart are not the same object
  int visible_beams = 5;              ///< a true object hit by at least this many beams is visible
};

/// How one true object was mapped.
struct ObjectScore {
  std::uint64_t truth_id = 0;
  int visible_scans = 0;       ///< scans in which it was visible
  int mapped_scans = 0;        ///< of those, with an element of the map on it
  double max_delay_s = 0.0;    ///< longest time it was visible without being on the map
  double center_rmse_m = 0.0;  ///< over mapped_scans
  double velocity_rmse_m_s = 0.0;
  double radius_mae_m = 0.0;  ///< both radii, each sorted
  int id_switches = 0;        ///< times another element took over
};

/// How a map compares with the truth over a run.
struct MapScore {
  std::vector<ObjectScore> objects;
  double center_rmse_m = 0.0;  ///< over all visible, mapped objects and scans
  double velocity_rmse_m_s = 0.0;
  double max_delay_s = 0.0;
  double longest_false_s = 0.0;  ///< longest life of an element on nothing
  double false_per_scan = 0.0;
  double recall = 0.0;
  int scans = 0;
};

/// Compares map and truth scan by scan: elements are matched one to one to true objects at the least total distance.
/// A visible object counts for recall, delay and errors; an element on a hidden object is neither right nor false.
class MapEvaluation {
 public:
  explicit MapEvaluation(const MapEvaluationParams& params = {}) : params_(params) {}

  /// Truth and map at the same stamp; stamps grow. `Object::beams` of the truth counts the beams that hit it.
  void add(const Objects& truth, const Objects& map);

  MapScore score() const;

 private:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();
  struct ObjectTally {
    int visible_scans = 0;
    int mapped_scans = 0;
    int id_switches = 0;
    std::uint64_t element_id = 0;
    std::int64_t unmapped_since_ns = kNever;
    double max_delay_s = 0.0;
    double center_sse_m2 = 0.0;
    double velocity_sse_m2_s2 = 0.0;
    double radius_sae_m = 0.0;
  };
  MapEvaluationParams params_;
  std::map<std::uint64_t, ObjectTally> objects_;       ///< by truth id
  std::map<std::uint64_t, std::int64_t> false_since_;  ///< by element id
  double longest_false_s_ = 0.0;
  long false_elements_ = 0;
  int scans_ = 0;
};

/// The score as a text table, one line per true object, named by `names` where it has the id.
std::string format_table(const MapScore& score, const std::map<std::uint64_t, std::string>& names);

}  // namespace situation_awareness
