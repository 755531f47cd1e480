// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/feature_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <stdexcept>
#include <utility>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/bodies.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

constexpr double kFar_m = std::numeric_limits<double>::infinity();
constexpr double kMoved_m = 0.02;          ///< what moves by more does not stand
constexpr double kElsewhere_m = 0.3;       ///< what has moved by more is not where it was seen
constexpr double kBehindOutline_m = 0.15;  ///< a beam that ends so far behind an outline went through it
constexpr double kOnBodyPart = 0.5;        ///< of what is hit of a body, near an outline that is to have it
constexpr double kSettled_s = 1.0;         ///< what has stood for so long is in many scans

double ratio(double part, double whole) { return whole > 0.0 ? part / whole : 0.0; }

Eigen::AlignedBox2d grown(const Eigen::AlignedBox2d& box, double margin_m) {
  if (box.isEmpty()) return box;
  return {box.min() - Eigen::Vector2d::Constant(margin_m), box.max() + Eigen::Vector2d::Constant(margin_m)};
}

/// Distance of a point from a line; infinity if it has no edge.
double distance_m(const Eigen::Vector2d& p, const std::vector<Eigen::Vector2d>& vertices, bool closed) {
  double least_m = kFar_m;
  for (std::size_t i = closed ? 0 : 1; i < vertices.size(); ++i) {
    const Eigen::Vector2d& before = vertices[i > 0 ? i - 1 : vertices.size() - 1];
    least_m = std::min(least_m, distance_from_segment_m(p, before, vertices[i]));
  }
  return least_m;
}

/// Distance of a point from the nearest of several closed outlines; infinity if they have no edge.
double distance_m(const Eigen::Vector2d& p, const std::vector<std::vector<Eigen::Vector2d>>& outlines) {
  double least_m = kFar_m;
  for (const auto& outline : outlines) least_m = std::min(least_m, distance_m(p, outline, true));
  return least_m;
}

/// Where a ray from `origin` in the direction of the unit vector `n` leaves an outline; nothing where it misses it.
std::optional<double> leaves_at_m(const Eigen::Vector2d& origin, const Eigen::Vector2d& n,
                                  const std::vector<Eigen::Vector2d>& outline) {
  std::optional<double> last_m;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d a = outline[i] - origin, b = outline[(i + 1) % outline.size()] - origin;
    const double left_a = n.x() * a.y() - n.y() * a.x(), left_b = n.x() * b.y() - n.y() * b.x();
    if ((left_a > 0.0) == (left_b > 0.0)) continue;
    const double along_m = n.dot(a + left_a / (left_a - left_b) * (b - a));
    if (along_m > 0.0) last_m = std::max(along_m, last_m.value_or(0.0));
  }
  return last_m;
}

bool is_inside(const Eigen::Vector2d& p, const std::vector<Eigen::Vector2d>& outline) {
  bool inside = false;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d a = outline[i] - p, b = outline[(i + 1) % outline.size()] - p;
    if ((a.y() > 0.0) == (b.y() > 0.0)) continue;
    if (a.x() + a.y() / (a.y() - b.y()) * (b.x() - a.x()) > 0.0) inside = !inside;
  }
  return inside;
}

/// Calls `visit(part, length_m)` for each piece of an edge, none longer than `spacing_m`; `part` of the edge is its
/// middle.
template <class Visit>
void visit_pieces(double edge_m, double spacing_m, const Visit& visit) {
  const int pieces = std::max(1, static_cast<int>(std::ceil(edge_m / spacing_m)));
  for (int piece = 0; piece < pieces; ++piece) visit((piece + 0.5) / pieces, edge_m / pieces);
}

double furthest_m(const std::vector<std::vector<Eigen::Vector2d>>& a, const SceneThing& b) {
  double most_m = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < a[i].size(); ++k) {
      most_m = std::max(most_m, (a[i][k] - b.outlines[i].points_world_m[k]).norm());
    }
  }
  return most_m;
}

std::vector<std::vector<Eigen::Vector2d>> outlines_of(const SceneThing& thing) {
  std::vector<std::vector<Eigen::Vector2d>> outlines;
  for (const SceneOutline& outline : thing.outlines) outlines.push_back(outline.points_world_m);
  return outlines;
}

bool is_any_there(const SceneThing& thing) {
  return std::any_of(thing.outlines.begin(), thing.outlines.end(), [](const SceneOutline& o) { return o.is_there; });
}

bool is_as_before(const std::vector<std::string>& names, const Scene& truth) {
  return std::equal(names.begin(), names.end(), truth.things.begin(), truth.things.end(),
                    [](const std::string& name, const SceneThing& thing) { return name == thing.name; });
}

}  // namespace

void FeatureEvaluation::begin(const Scene& truth) {
  std::vector<Body> bodies;
  std::size_t parts = 0;
  for (const SceneThing& thing : truth.things) {
    names_.push_back(thing.name);
    body_ids_.push_back(thing.parts.empty() ? 0 : thing.parts.front().id);
    is_box_.push_back(!thing.parts.empty() && thing.parts.front().shape == Shape::kBox);
    if (!thing.parts.empty()) bodies.push_back({thing.name, {}});
    for (std::size_t i = 0; i < thing.parts.size(); ++i) bodies.back().parts.push_back(parts++);
    Thing& own = things_.emplace_back();
    own.hits_of_outline.resize(thing.outlines.size());
    for (std::size_t i = 0; i < thing.outlines.size(); ++i) {
      const std::vector<Eigen::Vector2d>& points = thing.outlines[i].points_world_m;
      for (std::size_t k = 0; k < points.size(); ++k) {
        const double edge_m = (points[(k + 1) % points.size()] - points[k]).norm();
        visit_pieces(edge_m, params_.spacing_m, [&](double part, double length_m) {
          own.places.push_back({i, k, part, length_m});
        });
      }
    }
  }
  bodies_.emplace(params_.bodies, std::move(bodies));
}

void FeatureEvaluation::move_things(const Scene& truth) {
  for (std::size_t i = 0; i < things_.size(); ++i) {
    Thing& thing = things_[i];
    const SceneThing& now = truth.things[i];
    const bool was_there = thing.is_there;
    thing.is_there = is_any_there(now);
    std::fill(thing.hits_of_outline.begin(), thing.hits_of_outline.end(), 0);
    thing.hits = 0;
    if (thing.stood.empty() || !was_there || furthest_m(thing.stood, now) > kMoved_m) {
      thing.stood = outlines_of(now);
      thing.stands_since_ns = stamp_ns_;
      for (Place& place : thing.places) place.hits = 0;
    }
    thing.box.setEmpty();
    for (const SceneOutline& outline : now.outlines) {
      if (!outline.is_there) continue;
      for (const Eigen::Vector2d& p : outline.points_world_m) thing.box.extend(p);
    }
    for (Place& place : thing.places) {
      const std::vector<Eigen::Vector2d>& points = now.outlines[place.outline].points_world_m;
      const Eigen::Vector2d& from = points[place.edge];
      place.p_world_m = from + place.part * (points[(place.edge + 1) % points.size()] - from);
      place.is_hit = false;
      if (!now.outlines[place.outline].is_there) place.hits = 0;
    }
    thing.is_elsewhere =
        !thing.last_seen.empty() && (!thing.is_there || furthest_m(thing.last_seen, now) > kElsewhere_m);
  }
}

void FeatureEvaluation::add_hits(const Points& points) {
  for (const Point& point : points.points) {
    if (point.state != BeamState::kHit) continue;
    const Eigen::Vector2d p_world_m = points.T_world_level * point.p_level_m;
    Thing* of_thing = nullptr;
    Place* nearest = nullptr;
    double least_m = params_.on_m;
    for (Thing& thing : things_) {
      if (!thing.is_there || !grown(thing.box, params_.on_m).contains(p_world_m)) continue;
      for (Place& place : thing.places) {
        const double apart_m = (place.p_world_m - p_world_m).norm();
        if (apart_m > least_m) continue;
        least_m = apart_m;
        of_thing = &thing;
        nearest = &place;
      }
    }
    if (nearest == nullptr) continue;
    nearest->is_hit = true;
    ++nearest->hits;
    ++of_thing->hits;
    ++of_thing->hits_of_outline[nearest->outline];
  }
}

void FeatureEvaluation::see_through(const Points& points) {
  const Eigen::Vector2d& origin = points.T_world_level.translation_m;
  const Eigen::Matrix2d R = points.T_world_level.rotation();
  for (Thing& thing : things_) {
    if (!thing.is_elsewhere) continue;
    for (const auto& outline : thing.last_seen) {
      int passing = 0;
      for (const Point& point : points.points) {
        if (point.state != BeamState::kHit && point.state != BeamState::kFree) continue;
        const Eigen::Vector2d n = R * Eigen::Vector2d(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
        const std::optional<double> through_m = leaves_at_m(origin, n, outline);
        if (through_m && point.range_m > *through_m + kBehindOutline_m) ++passing;
      }
      if (passing < params_.passing_beams) continue;
      thing.last_seen.clear();
      thing.is_elsewhere = false;
      break;
    }
  }
}

bool FeatureEvaluation::is_seen(const Thing& thing, const Place& place) const {
  const bool is_settled = seconds_between(thing.stands_since_ns, stamp_ns_) >= kSettled_s;
  return place.hits >= (is_settled ? params_.seen_hits : 1);
}

std::vector<FeatureEvaluation::Line> FeatureEvaluation::lines_of(const MapLayers& layers, double spacing_m) {
  std::vector<Line> lines;
  const auto add = [&lines](FeatureId id, bool is_body, bool closed, std::vector<Eigen::Vector2d> vertices) {
    if (vertices.size() < 2) return;
    Line line{id, is_body, closed, std::move(vertices), {}};
    for (const Eigen::Vector2d& p : line.vertices_world_m) line.box.extend(p);
    lines.push_back(std::move(line));
  };
  const auto add_chain = [&add](FeatureId id, bool closed, const std::vector<ChainVertex>& vertices) {
    std::vector<Eigen::Vector2d> points;
    points.reserve(vertices.size());
    for (const ChainVertex& vertex : vertices) points.push_back(vertex.p_world_m);
    add(id, false, closed, std::move(points));
  };
  for (const Object& object : layers.objects.objects) add(object.id, true, true, outline_world(object));
  for (const Chain& chain : layers.polygons.chains) add_chain(chain.id, chain.closed, chain.vertices);
  for (const Splinegon& boundary : layers.boundaries.boundaries) {
    add_chain(boundary.id, boundary.closed, lines_along(boundary, spacing_m));
  }
  return lines;
}

void FeatureEvaluation::compare_outline(Thing& thing, const std::vector<Line>& lines) const {
  std::vector<const Line*> near;
  for (const Line& line : lines) {
    if (grown(thing.box, params_.explained_m).intersects(line.box)) near.push_back(&line);
  }
  double seen_m = 0.0;
  for (const Place& place : thing.places) {
    if (!is_seen(thing, place)) continue;
    double least_m = kFar_m;
    for (const Line* const line : near) {
      if (grown(line->box, params_.explained_m).contains(place.p_world_m)) {
        least_m = std::min(least_m, distance_m(place.p_world_m, line->vertices_world_m, line->closed));
      }
    }
    seen_m += place.length_m;
    if (least_m <= params_.on_m) thing.on_map_m += place.length_m;
    if (least_m > params_.explained_m) continue;
    thing.near_m += place.length_m;
    thing.square_m3 += place.length_m * least_m * least_m;
  }
  if (seen_m == 0.0) return;
  thing.seen_m += seen_m;
  ++thing.comparisons;
}

std::vector<bool> FeatureEvaluation::on_fixtures(const Scene& truth, const Objects& map) const {
  const double margin_m = params_.bodies.body_margin_m;
  std::vector<bool> on(map.objects.size());
  for (std::size_t j = 0; j < on.size(); ++j) {
    const Eigen::Vector2d& p = map.objects[j].ellipse_world.center_m;
    for (std::size_t i = 0; i < things_.size() && !on[j]; ++i) {
      if (body_ids_[i] != 0 || !grown(things_[i].box, margin_m).contains(p)) continue;
      const auto& outlines = truth.things[i].outlines;
      on[j] = std::any_of(outlines.begin(), outlines.end(), [&](const SceneOutline& outline) {
        const auto& points = outline.points_world_m;
        return outline.is_there && (is_inside(p, points) || distance_m(p, points, true) <= margin_m);
      });
    }
  }
  return on;
}

OutlineOnBody FeatureEvaluation::outline_on(const Thing& thing, const std::vector<Line>& lines) const {
  double hit_m = 0.0, most_m = 0.0;
  for (const Place& place : thing.places) hit_m += place.is_hit ? place.length_m : 0.0;
  OutlineOnBody best;
  for (const Line& line : lines) {
    if (line.is_body || !grown(thing.box, params_.on_m).intersects(line.box)) continue;
    double on_m = 0.0, square_m3 = 0.0;
    for (const Place& place : thing.places) {
      if (!place.is_hit) continue;
      const double apart_m = distance_m(place.p_world_m, line.vertices_world_m, line.closed);
      if (apart_m > params_.on_m) continue;
      on_m += place.length_m;
      square_m3 += place.length_m * apart_m * apart_m;
    }
    if (on_m <= most_m || on_m < kOnBodyPart * hit_m) continue;
    most_m = on_m;
    best = {line.id, std::sqrt(square_m3 / on_m)};
  }
  return best;
}

std::optional<std::size_t> FeatureEvaluation::nearest_thing(const Eigen::Vector2d& p,
                                                            const std::vector<Outlines>& outlines) const {
  std::optional<std::size_t> nearest;
  double least_m = params_.explained_m;
  for (std::size_t k = 0; k < things_.size(); ++k) {
    if (!things_[k].is_there || !grown(things_[k].box, least_m).contains(p)) continue;
    const double apart_m = distance_m(p, outlines[k]);
    if (apart_m <= least_m) least_m = apart_m, nearest = k;
  }
  return nearest;
}

bool FeatureEvaluation::is_past_place(const Eigen::Vector2d& p) const {
  return std::any_of(things_.begin(), things_.end(), [&](const Thing& thing) {
    return thing.is_elsewhere && distance_m(p, thing.last_seen) <= params_.explained_m;
  });
}

void FeatureEvaluation::assign(const Scene& truth, const std::vector<Line>& lines) {
  std::vector<bool> is_expected(things_.size());
  for (std::size_t i = 0; i < things_.size(); ++i) {
    const Thing& thing = things_[i];
    is_expected[i] = std::any_of(thing.places.begin(), thing.places.end(),
                                 [&](const Place& place) { return is_seen(thing, place); });
    if (is_expected[i]) ++expected_;
  }
  std::vector<Outlines> outlines;
  for (const SceneThing& thing : truth.things) {
    outlines.emplace_back();
    for (const SceneOutline& outline : thing.outlines) {
      if (outline.is_there) outlines.back().push_back(outline.points_world_m);
    }
  }
  for (const Line& line : lines) {
    std::map<std::size_t, double> length_of;
    double length_m = 0.0, unexplained_m = 0.0;
    for (std::size_t i = line.closed ? 0 : 1; i < line.vertices_world_m.size(); ++i) {
      const Eigen::Vector2d& a = line.vertices_world_m[i > 0 ? i - 1 : line.vertices_world_m.size() - 1];
      const Eigen::Vector2d& b = line.vertices_world_m[i];
      visit_pieces((b - a).norm(), params_.spacing_m, [&](double part, double piece_m) {
        const Eigen::Vector2d p = a + part * (b - a);
        length_m += piece_m;
        if (const std::optional<std::size_t> nearest = nearest_thing(p, outlines)) {
          length_of[*nearest] += piece_m;
        } else if (!is_past_place(p)) {
          unexplained_m += piece_m;
        }
      });
    }
    features_m_ += length_m;
    unexplained_m_ += unexplained_m;
    const auto owner = std::max_element(length_of.begin(), length_of.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; });
    if (owner == length_of.end() || 2.0 * unexplained_m > length_m || !is_expected[owner->first]) continue;
    ++things_[owner->first].features;
    ++owned_;
  }
}

Objects FeatureEvaluation::true_objects(const Scene& truth) const {
  Objects objects;
  objects.stamp_ns = truth.stamp_ns;
  for (std::size_t i = 0; i < things_.size(); ++i) {
    const SceneThing& thing = truth.things[i];
    for (std::size_t k = 0; k < thing.parts.size(); ++k) {
      Object& object = objects.objects.emplace_back(thing.parts[k]);
      object.beams = things_[i].hits_of_outline[k];
      object.p_exists = thing.outlines[k].is_there ? 1.0 : 0.0;
    }
  }
  return objects;
}

void FeatureEvaluation::add(const Scene& truth, const Points& points, const Map& map) {
  if (things_.empty()) begin(truth);
  if (!is_as_before(names_, truth)) throw std::invalid_argument("the true things are others than before");
  stamp_ns_ = truth.stamp_ns;
  move_things(truth);
  add_hits(points);
  see_through(points);
  for (std::size_t i = 0; i < things_.size(); ++i) {
    if (things_[i].hits > 0) things_[i].last_seen = outlines_of(truth.things[i]);
  }

  const MapLayers layers = layers_of(map);
  const std::vector<Line> lines = lines_of(layers, params_.spacing_m);
  const bool is_due = compared_ns_ == kNever || seconds_between(compared_ns_, stamp_ns_) >= params_.every_s;
  MapOutlines outlines;
  for (const Line& line : lines) {
    if (!line.is_body) outlines.ids.push_back(line.id);
  }
  for (std::size_t i = 0; i < things_.size(); ++i) {
    if (is_due) compare_outline(things_[i], lines);
    if (body_ids_[i] != 0) outlines.of_bodies.push_back(outline_on(things_[i], lines));
  }
  outlines.on_fixtures = on_fixtures(truth, layers.objects);
  bodies_->add(true_objects(truth), layers.objects, {}, outlines);
  if (!is_due) return;
  assign(truth, lines);
  compared_ns_ = stamp_ns_;
}

FeatureScore FeatureEvaluation::score() const {
  FeatureScore score;
  if (bodies_) score.bodies = bodies_->score();
  double seen_m = 0.0, on_map_m = 0.0, near_m = 0.0, square_m3 = 0.0, center_sse_m2 = 0.0;
  long scans = 0;
  for (std::size_t i = 0; i < things_.size(); ++i) {
    const Thing& thing = things_[i];
    ThingScore own;
    own.name = names_[i];
    own.comparisons = thing.comparisons;
    own.on_map_part = ratio(thing.on_map_m, thing.seen_m);
    own.outline_rms_m = std::sqrt(ratio(thing.square_m3, thing.near_m));
    own.features = ratio(static_cast<double>(thing.features), thing.comparisons);
    for (const ObjectScore& object : score.bodies.objects) {
      if (object.truth_id == body_ids_[i]) own.body = object;
    }
    if (own.body && !is_box_[i]) {
      scans += own.body->mapped_scans;
      center_sse_m2 += own.body->mapped_scans * own.body->center_rmse_m * own.body->center_rmse_m;
    }
    score.things.push_back(std::move(own));
    seen_m += thing.seen_m;
    on_map_m += thing.on_map_m;
    near_m += thing.near_m;
    square_m3 += thing.square_m3;
  }
  score.center_rmse_m = std::sqrt(ratio(center_sse_m2, static_cast<double>(scans)));
  score.on_map_part = ratio(on_map_m, seen_m);
  score.outline_rms_m = std::sqrt(ratio(square_m3, near_m));
  score.features_per_thing = ratio(static_cast<double>(owned_), static_cast<double>(expected_));
  score.unexplained_part = ratio(unexplained_m_, features_m_);
  return score;
}

std::string format_table(const FeatureScore& score) {
  std::string table;
  char line[200];
  const auto print = [&](const char* format, auto... values) {
    std::snprintf(line, sizeof line, format, values...);
    table += line;
  };
  print("%-20s %7s %7s %7s %6s %7s %8s %7s %9s %7s %8s\n", "thing", "visible", "on map", "as body", "delay", "centre",
        "velocity", "changes", "outline", "outline", "features");
  print("%-20s %7s %7s %7s %6s %7s %8s %7s %9s %7s %8s\n", "", "scans", "%", "%", "max s", "RMSE m", "RMSE m/s",
        "of id", "% on map", "RMS m", "");
  for (const ThingScore& thing : score.things) {
    print("%-20.20s ", thing.name.c_str());
    if (thing.body) {
      const ObjectScore& body = *thing.body;
      const double visible = body.visible_scans;
      print("%7d %7.1f %7.1f %6.2f ", body.visible_scans,
            100.0 * ratio(body.mapped_scans + body.outline_scans, visible), 100.0 * ratio(body.mapped_scans, visible),
            body.max_delay_s);
      if (body.mapped_scans > 0) {
        print("%7.3f %8.3f ", body.center_rmse_m, body.velocity_rmse_m_s);
      } else {
        print("%7s %8s ", "-", "-");
      }
      print("%7d ", body.id_switches);
    } else {
      print("%7s %7s %7s %6s %7s %8s %7s ", "-", "-", "-", "-", "-", "-", "-");
    }
    if (thing.comparisons > 0) {
      print("%9.1f %7.3f %8.2f\n", 100.0 * thing.on_map_part, thing.outline_rms_m, thing.features);
    } else {
      print("%9s %7s %8s\n", "not seen", "-", "-");
    }
  }
  const MapScore& bodies = score.bodies;
  print("bodies: %d scans, recall %.3f, longest delay %.2f s, centre RMSE %.3f m (without boxes), ", bodies.scans,
        bodies.recall, bodies.max_delay_s, score.center_rmse_m);
  print("velocity RMSE %.3f m/s, %d changes of id;\n", bodies.velocity_rmse_m_s, bodies.id_switches);
  print("        false ones %.3f per scan, longest %.2f s; on walls and buildings %.3f per scan\n",
        bodies.false_per_scan, bodies.longest_false_s, bodies.on_fixtures_per_scan);
  print("outlines: %.1f %% of what was seen is on the map, RMS %.3f m; %.2f features per thing; ",
        100.0 * score.on_map_part, score.outline_rms_m, score.features_per_thing);
  print("%.1f %% of the features' length is of nothing\n", 100.0 * score.unexplained_part);
  return table;
}

}  // namespace situation_awareness
