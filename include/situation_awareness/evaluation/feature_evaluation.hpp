// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/evaluation/map_evaluation.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// A closed outline in truth, without its first point again at the end.
struct SceneOutline {
  bool is_there = true;
  std::vector<Eigen::Vector2d> points_world_m;
};

/// A true thing at one time. Walls that touch are one thing of several outlines.
struct SceneThing {
  std::string name;
  std::vector<SceneOutline> outlines;  ///< at each time as many, of as many points
  /// A body, whose centre and velocity count beside its outlines, has for each outline an object: the ellipse, or the
  /// one of equal moments with Shape::kBox, the velocity and the id. All else, such as a building, has none.
  std::vector<Object> parts;
};

/// All that a scanner may hit at its height, in truth and at one time; always in the same order.
struct Scene {
  std::int64_t stamp_ns = 0;
  std::vector<SceneThing> things;
};

/// Criteria in the comparison of features with what is true.
struct FeatureEvaluationParams {
  double on_m = 0.1;         ///< a feature this near to a place of a true outline has it
  double explained_m = 0.3;  ///< a place of a feature farther from all that is true is of nothing
  double spacing_m = 0.1;    ///< of places along outlines
  double every_s = 1.0;      ///< so often what is no body is compared
  int seen_hits = 3;         ///< from which on a place of what stands is seen; one of what moves by one
  int passing_beams = 5;     ///< of a scan, after which it is known that a thing has left its place
  MapEvaluationParams bodies;
};

/// Result for one true thing.
struct ThingScore {
  std::string name;
  int comparisons = 0;         ///< in which something of it was seen
  double on_map_part = 0.0;    ///< of its outline that was seen, the part with a feature within on_m; mean by length
  double outline_rms_m = 0.0;  ///< distance of the nearest feature, of what has one within explained_m
  double features = 0.0;       ///< mean number of features that are its own
  std::optional<ObjectScore> body;
};

/// How a map compares with what is true.
struct FeatureScore {
  std::vector<ThingScore> things;
  MapScore bodies;
  double center_rmse_m =
      0.0;  ///< of bodies that are no boxes: where a box ends that is seen from one side, no beam tells
  double on_map_part = 0.0;         ///< over all things, as of each
  double outline_rms_m = 0.0;       ///< over all things, as of each
  double features_per_thing = 0.0;  ///< features that are of a thing, over the things that were seen
  double unexplained_part = 0.0;    ///< of the length of all features, that is of nothing
};

/// Compares all features of a map with what is true, scan by scan.
///
/// Bodies are compared as MapEvaluation does, with the hits on their outlines as beams; one that no ellipse or box is
/// on, but a polyline or boundary within on_m of half of what the scan hits of it, is on the map as well, and its error
/// is the distance of that. An element on what is no body, such as a wall, is neither correct nor false. Of all things
/// the outlines are compared: of a thing that moves what the scan hits, of one that stands all that was hit since it
/// stands. A feature is that of the thing that most of its length is nearest to. Where a thing was when it was seen
/// last, and is not any more, explains a feature until beams pass there: nobody can know.
class FeatureEvaluation {
 public:
  explicit FeatureEvaluation(const FeatureEvaluationParams& params = {}) : params_(params) {}

  /// Truth and map at the stamp of the scan that `points` are of; stamps increase. Throws std::invalid_argument if the
  /// things are others than before.
  void add(const Scene& truth, const Points& points, const Map& map);

  FeatureScore score() const;

 private:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();
  using Outlines = std::vector<std::vector<Eigen::Vector2d>>;

  /// A place along an outline, in the middle of a piece of it.
  struct Place {
    std::size_t outline = 0, edge = 0;
    double part = 0.0;  ///< of the edge
    double length_m = 0.0;
    int hits = 0;  ///< since the thing stands
    bool is_hit = false;
    Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  };
  /// The outline of a feature.
  struct Line {
    FeatureId id = 0;
    bool is_body = false, closed = false;
    std::vector<Eigen::Vector2d> vertices_world_m;
    Eigen::AlignedBox2d box;
  };
  struct Thing {
    std::vector<Place> places;
    std::vector<int> hits_of_outline;  ///< in this scan
    int hits = 0;
    bool is_there = false;
    Eigen::AlignedBox2d box;
    Outlines stood;  ///< outlines where it has stood since
    std::int64_t stands_since_ns = kNever;
    Outlines last_seen;         ///< where it was when last hit; empty: beams have passed there, or never
    bool is_elsewhere = false;  ///< last_seen is where it is not
    int comparisons = 0;
    double seen_m = 0.0, on_map_m = 0.0, near_m = 0.0, square_m3 = 0.0;
    long features = 0;
  };

  void begin(const Scene& truth);
  void move_things(const Scene& truth);
  void add_hits(const Points& points);
  void see_through(const Points& points);
  bool is_seen(const Thing& thing, const Place& place) const;
  void compare_outline(Thing& thing, const std::vector<Line>& lines) const;
  std::vector<bool> on_fixtures(const Scene& truth, const Objects& map) const;
  OutlineOnBody outline_on(const Thing& thing, const std::vector<Line>& lines) const;
  /// The thing whose outlines are nearest, within explained_m; `outlines` are those of all things that are there.
  std::optional<std::size_t> nearest_thing(const Eigen::Vector2d& p, const std::vector<Outlines>& outlines) const;
  /// Whether something was there when it was last seen, which is elsewhere meanwhile.
  bool is_past_place(const Eigen::Vector2d& p) const;
  void assign(const Scene& truth, const std::vector<Line>& lines);
  static std::vector<Line> lines_of(const MapLayers& layers, double spacing_m);
  Objects true_objects(const Scene& truth) const;

  FeatureEvaluationParams params_;
  std::optional<MapEvaluation> bodies_;
  std::vector<std::string> names_;
  std::vector<std::uint64_t> body_ids_;  ///< of each thing, of its first part; 0: it is none
  std::vector<bool> is_box_;             ///< of each thing
  std::vector<Thing> things_;
  std::int64_t stamp_ns_ = 0, compared_ns_ = kNever;
  long owned_ = 0, expected_ = 0;
  double features_m_ = 0.0, unexplained_m_ = 0.0;
};

/// The score as a text table, one line per thing, and two of all.
std::string format_table(const FeatureScore& score);

}  // namespace situation_awareness
