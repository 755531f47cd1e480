// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/map_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <Eigen/Cholesky>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/evaluation/gospa.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kHeldProbability = 0.99;

template <int N>
bool is_held(const Eigen::Matrix<double, N, 1>& error, const Eigen::Matrix<double, N, N>& covariance) {
  static const double bound = chi_square_quantile(kHeldProbability, N);
  return error.dot(covariance.ldlt().solve(error)) <= bound;  // false for NaN
}

/// Add the square of an error to its sum, and keep the largest.
void tally_error(double error, double& sum_of_squares, double& max_absolute) {
  sum_of_squares += error * error;
  max_absolute = std::max(max_absolute, std::abs(error));
}

/// False for true objects that have not appeared yet, or have gone.
bool is_there(const Object& true_object) { return true_object.p_exists > 0.0; }

double ratio(double part, double whole) { return whole > 0.0 ? part / whole : 0.0; }

}  // namespace

std::vector<MapEvaluation::Target> MapEvaluation::targets_of(const Objects& truth) const {
  std::vector<Target> targets;
  if (bodies_.empty()) {
    for (const Object& object : truth.objects) targets.push_back({&object, {object.ellipse_world}, object.beams});
    return targets;
  }
  for (const Body& body : bodies_) {
    Target target;
    target.reference = &truth.objects.at(body.parts.front());
    for (const std::size_t part : body.parts) {
      target.parts.push_back(truth.objects.at(part).ellipse_world);
      target.beams += truth.objects[part].beams;
    }
    targets.push_back(std::move(target));
  }
  return targets;
}

std::vector<int> MapEvaluation::match(const std::vector<Target>& targets, const Objects& map) const {
  const double cost_alone_m = 2.0 * params_.max_match_distance_m;  // so that none is left unmatched for a nearer pair
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (!is_there(*targets[i].reference)) continue;
    for (std::size_t j = 0; j < map.objects.size(); ++j) {
      const Eigen::Vector2d& center_m = map.objects[j].ellipse_world.center_m;
      const double distance_m = (targets[i].reference->ellipse_world.center_m - center_m).norm();
      const bool is_extended = targets[i].parts.size() > 1 || targets[i].reference->shape == Shape::kBox;
      const bool on_body = is_extended && within_reach(targets[i].parts, center_m, params_.body_margin_m);
      if (distance_m <= params_.max_match_distance_m || on_body) {
        candidates.push_back({static_cast<int>(i), static_cast<int>(j),
                              std::min(distance_m, params_.max_match_distance_m) - cost_alone_m});
      }
    }
  }
  return assign(static_cast<int>(targets.size()), static_cast<int>(map.objects.size()), candidates);
}

void MapEvaluation::compare(ObjectTally& tally, const Object& truth, const Object& element) const {
  const Ellipse a = canonical(truth.ellipse_world);
  const Ellipse b = canonical(element.ellipse_world);
  EllipseErrors& squares = tally.sum_of_squares;
  EllipseErrors& largest = tally.max_absolute;
  const Eigen::Vector2d radii_error(b.rx_m - a.rx_m, b.ry_m - a.ry_m);
  const Eigen::Vector2d center_error = b.center_m - a.center_m;
  tally_error(radii_error.x(), squares.rx_m, largest.rx_m);
  tally_error(radii_error.y(), squares.ry_m, largest.ry_m);
  tally_error(center_error.x(), squares.tx_m, largest.tx_m);
  tally_error(center_error.y(), squares.ty_m, largest.ty_m);
  tally_error(wrap_to_half_pi(b.psi_rad - a.psi_rad), squares.psi_rad, largest.psi_rad);
  tally.radius_sae_m += 0.5 * radii_error.cwiseAbs().sum();

  using namespace object_error;
  const Eigen::Vector2d velocity_error = element.velocity_world_m_s - truth.velocity_world_m_s;
  tally.velocity_sse_m2_s2 += velocity_error.squaredNorm();
  tally.psi_variance_sum_rad2 += element.covariance(kOrientation, kOrientation);

  static_assert(kVelocity == kPosition + 2, "position and velocity are one block");
  Eigen::Vector4d position_velocity_error;
  position_velocity_error << center_error, velocity_error;
  tally.held_position += is_held<2>(center_error, element.covariance.block<2, 2>(kPosition, kPosition)) ? 1 : 0;
  tally.held_position_velocity +=
      is_held<4>(position_velocity_error, element.covariance.block<4, 4>(kPosition, kPosition)) ? 1 : 0;
  tally.held_radii += is_held<2>(radii_error, element.covariance.block<2, 2>(kRadii, kRadii)) ? 1 : 0;
}

HiddenTime MapEvaluation::hidden_time(const Hiding& hiding, std::int64_t end_ns, std::optional<bool> same_id) const {
  HiddenTime time;
  time.from_s = seconds_between(0, hiding.from_ns);
  time.to_s = seconds_between(0, hiding.to_ns != kNever ? hiding.to_ns : end_ns);
  time.same_id = same_id;
  time.deleted_after_s = hiding.deleted_after_s;
  return time;
}

void MapEvaluation::update_hidden_time(ObjectTally& tally, const Target& target, std::uint64_t id, const Objects& map,
                                       const MapOutlines& outlines) const {
  if (target.beams == 0) {
    if (!tally.hiding && tally.element_id != 0) tally.hiding = Hiding{stamp_ns_, kNever, kNever, std::nullopt};
    if (!tally.hiding) return;
    tally.hiding->to_ns = tally.hiding->visible_again_ns = kNever;  // a glimpse does not end it
    const bool on_map = std::any_of(map.objects.begin(), map.objects.end(),
                                    [&](const Object& object) { return object.id == tally.element_id; }) ||
                        std::count(outlines.ids.begin(), outlines.ids.end(), tally.element_id) > 0;
    if (!on_map && !tally.hiding->deleted_after_s) {
      tally.hiding->deleted_after_s = seconds_between(tally.hiding->from_ns, stamp_ns_);
    }
    return;
  }
  if (!tally.hiding) return;
  Hiding& hiding = *tally.hiding;
  if (hiding.to_ns == kNever) hiding.to_ns = stamp_ns_;
  if (seconds_between(hiding.from_ns, hiding.to_ns) < params_.min_hidden_s) {
    tally.hiding.reset();
    return;
  }
  if (target.beams < params_.visible_beams) return;
  if (hiding.visible_again_ns == kNever) hiding.visible_again_ns = stamp_ns_;
  const bool in_time = seconds_between(hiding.visible_again_ns, stamp_ns_) <= params_.recognition_s;
  if (in_time && id == 0) return;
  tally.hidden.push_back(hidden_time(hiding, stamp_ns_, in_time && id == tally.element_id));
  tally.hiding.reset();
}

void MapEvaluation::evaluate_bodies(const std::vector<Target>& targets, const Objects& map,
                                    const std::vector<int>& separate_parts) {
  body_tallies_.resize(bodies_.size());
  for (std::size_t i = 0; i < separate_parts.size(); ++i) {
    BodyTally& tally = body_tallies_.at(i);
    const Target& target = targets[i];
    if (target.parts.size() < 2) continue;
    if (tally.first_visible_ns == kNever && target.beams >= params_.visible_beams) tally.first_visible_ns = stamp_ns_;
    if (tally.first_visible_ns == kNever || separate_parts[i] < 2) continue;
    if (seconds_between(tally.first_visible_ns, stamp_ns_) < params_.body_settling_s) continue;
    ++tally.scans_apart;
    const auto on_body = std::count_if(map.objects.begin(), map.objects.end(), [&](const Object& element) {
      return within_reach(target.parts, element.ellipse_world.center_m, params_.body_margin_m);
    });
    if (on_body == 1) ++tally.scans_one;
  }
}

bool MapEvaluation::is_on_fixture(const Object& element) const {
  return std::any_of(fixtures_world_.begin(), fixtures_world_.end(), [&](const Box& fixture) {
    return offset_m(fixture, element.ellipse_world.center_m) <= params_.body_margin_m;
  });
}

ScanScore MapEvaluation::add(const Objects& truth, const Objects& map, const std::vector<int>& separate_parts,
                             const MapOutlines& outlines) {
  ++scans_;
  stamp_ns_ = truth.stamp_ns;
  const std::vector<Target> targets = targets_of(truth);
  const std::vector<int> element_of = match(targets, map);

  ScanScore scan;
  std::vector<Eigen::Vector2d> truths_m, estimates_m;  // input of GOSPA
  std::vector<bool> on_truth(map.objects.size(), false), on_hidden(map.objects.size(), false);
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const Object& object = *targets[i].reference;
    ObjectTally& tally = objects_[object.id];
    has_parts_[object.id] = targets[i].parts.size() > 1;
    if (!is_there(object)) {
      tally.hiding.reset();
      tally.unmapped_since_ns = kNever;
      tally.element_id = 0;
      continue;
    }
    tally.moves = tally.moves || !object.velocity_world_m_s.isZero(0.0);
    const Object* const element = element_of[i] >= 0 ? &map.objects[static_cast<std::size_t>(element_of[i])] : nullptr;
    if (element != nullptr) on_truth[static_cast<std::size_t>(element_of[i])] = true;
    const OutlineOnBody outline =
        element == nullptr && !outlines.of_bodies.empty() ? outlines.of_bodies.at(i) : OutlineOnBody{};
    const std::uint64_t id = element != nullptr ? element->id : outline.id;
    update_hidden_time(tally, targets[i], id, map, outlines);
    if (targets[i].beams < params_.visible_beams) {
      if (element != nullptr) on_hidden[static_cast<std::size_t>(element_of[i])] = true;
      tally.unmapped_since_ns = kNever;
      continue;
    }
    if (outline.id == 0) truths_m.push_back(object.ellipse_world.center_m);
    ++tally.visible_scans;
    if (tally.unmapped_since_ns != kNever) {
      tally.max_delay_s = std::max(tally.max_delay_s, seconds_between(tally.unmapped_since_ns, stamp_ns_));
    }
    if (id == 0) {
      ++scan.missed;
      if (tally.unmapped_since_ns == kNever) tally.unmapped_since_ns = stamp_ns_;
      continue;
    }
    tally.unmapped_since_ns = kNever;
    if (tally.element_id != 0 && tally.element_id != id) ++tally.id_switches;
    tally.element_id = id;
    if (element == nullptr) {
      ++tally.outline_scans;
      tally.outline_sse_m2 += outline.rms_m * outline.rms_m;
      continue;
    }
    ++tally.mapped_scans;
    compare(tally, object, *element);
  }

  std::map<std::uint64_t, std::int64_t> false_since;
  for (std::size_t j = 0; j < map.objects.size(); ++j) {
    const bool is_told = !outlines.on_fixtures.empty() && outlines.on_fixtures.at(j);
    if (!on_truth[j] && (is_told || is_on_fixture(map.objects[j]))) {
      ++on_fixtures_;
      continue;
    }
    if (!on_hidden[j]) estimates_m.push_back(map.objects[j].ellipse_world.center_m);
    if (on_truth[j]) continue;
    const std::uint64_t id = map.objects[j].id;
    const auto before = false_since_.find(id);
    const std::int64_t since_ns = before != false_since_.end() ? before->second : stamp_ns_;
    false_since[id] = since_ns;
    longest_false_s_ = std::max(longest_false_s_, seconds_between(since_ns, stamp_ns_));
    ++scan.false_elements;
  }
  false_since_ = std::move(false_since);
  false_elements_ += scan.false_elements;
  scan.gospa_m = gospa(truths_m, estimates_m, params_.max_match_distance_m).distance_m;
  gospa_sum_m_ += scan.gospa_m;
  evaluate_bodies(targets, map, separate_parts);
  return scan;
}

int MapEvaluation::id_switches() const {
  int sum = 0;
  for (const auto& [id, tally] : objects_) sum += tally.id_switches;
  return sum;
}

MapScore MapEvaluation::score() const {
  /// Sums over the objects of a class.
  struct Sums {
    int scans = 0, scans_of_one_ellipse = 0;
    double center_sse_m2 = 0.0, velocity_sse_m2_s2 = 0.0, radius_sae_m = 0.0;

    ClassScore score() const {
      return {scans, std::sqrt(ratio(center_sse_m2, scans)), std::sqrt(ratio(velocity_sse_m2_s2, scans)),
              ratio(radius_sae_m, scans_of_one_ellipse)};
    }
  };

  MapScore score;
  score.scans = scans_;
  score.id_switches = id_switches();
  score.longest_false_s = longest_false_s_;
  score.false_per_scan = ratio(static_cast<double>(false_elements_), scans_);
  score.on_fixtures_per_scan = ratio(static_cast<double>(on_fixtures_), scans_);
  score.gospa_m = ratio(gospa_sum_m_, scans_);
  long visible = 0, outlines = 0;
  Sums all, standing, moving;
  for (const auto& [id, tally] : objects_) {
    ObjectScore object;
    object.truth_id = id;
    object.moves = tally.moves;
    object.visible_scans = tally.visible_scans;
    object.mapped_scans = tally.mapped_scans;
    object.outline_scans = tally.outline_scans;
    object.outline_rms_m = std::sqrt(ratio(tally.outline_sse_m2, tally.outline_scans));
    object.max_delay_s = tally.max_delay_s;
    object.id_switches = tally.id_switches;
    object.hidden = tally.hidden;
    if (tally.hiding) {
      const std::int64_t to_ns = tally.hiding->to_ns != kNever ? tally.hiding->to_ns : stamp_ns_;
      if (seconds_between(tally.hiding->from_ns, to_ns) >= params_.min_hidden_s) {
        object.hidden.push_back(hidden_time(*tally.hiding, stamp_ns_, std::nullopt));
      }
    }
    const EllipseErrors& squares = tally.sum_of_squares;
    const double n = tally.mapped_scans;
    const double center_sse_m2 = squares.tx_m + squares.ty_m;
    object.center_rmse_m = std::sqrt(ratio(center_sse_m2, n));
    object.velocity_rmse_m_s = std::sqrt(ratio(tally.velocity_sse_m2_s2, n));
    object.radius_mae_m = ratio(tally.radius_sae_m, n);
    object.mean_square = {ratio(squares.rx_m, n), ratio(squares.ry_m, n), ratio(squares.tx_m, n),
                          ratio(squares.ty_m, n), ratio(squares.psi_rad, n)};
    object.max_absolute = tally.max_absolute;
    object.psi_sigma_rms_rad = std::sqrt(ratio(tally.psi_variance_sum_rad2, n));

    score.max_delay_s = std::max(score.max_delay_s, tally.max_delay_s);
    visible += tally.visible_scans;
    outlines += tally.outline_scans;
    const bool is_one_ellipse = !has_parts_.at(id);
    for (Sums* const sums : {&all, tally.moves ? &moving : &standing}) {
      sums->scans += tally.mapped_scans;
      sums->center_sse_m2 += center_sse_m2;
      sums->velocity_sse_m2_s2 += tally.velocity_sse_m2_s2;
      if (!is_one_ellipse) continue;
      sums->scans_of_one_ellipse += tally.mapped_scans;
      sums->radius_sae_m += tally.radius_sae_m;
    }
    if (is_one_ellipse) {
      score.held_99.position += tally.held_position;
      score.held_99.position_velocity += tally.held_position_velocity;
      score.held_99.radii += tally.held_radii;
    }
    score.objects.push_back(std::move(object));
  }
  for (double* const held : {&score.held_99.position, &score.held_99.position_velocity, &score.held_99.radii}) {
    *held = ratio(*held, all.scans_of_one_ellipse);
  }
  for (std::size_t i = 0; i < body_tallies_.size(); ++i) {
    if (bodies_[i].parts.size() < 2) continue;
    score.bodies.push_back({bodies_[i].name, body_tallies_[i].scans_apart, body_tallies_[i].scans_one});
  }
  score.recall = ratio(static_cast<double>(all.scans + outlines), static_cast<double>(visible));
  score.standing = standing.score();
  score.moving = moving.score();
  score.center_rmse_m = all.score().center_rmse_m;
  score.velocity_rmse_m_s = all.score().velocity_rmse_m_s;
  return score;
}

std::string format_table(const MapScore& score, const std::map<std::uint64_t, std::string>& names) {
  std::string table;
  char line[160];
  const auto print = [&](const char* format, auto... values) {
    std::snprintf(line, sizeof line, format, values...);
    table += line;
  };
  print("%-20s %9s %9s %9s %11s %11s %9s %9s\n", "object", "visible", "mapped", "delay", "centre", "velocity", "radii",
        "switches");
  print("%-20s %9s %9s %9s %11s %11s %9s %9s\n", "", "scans", "scans", "max s", "RMSE m", "RMSE m/s", "MAE m", "of id");
  for (const ObjectScore& object : score.objects) {
    const auto name = names.find(object.truth_id);
    const std::string label = name != names.end() ? name->second : std::to_string(object.truth_id);
    print("%-20.20s %9d %9d %9.2f %11.3f %11.3f %9.3f %9d\n", label.c_str(), object.visible_scans, object.mapped_scans,
          object.max_delay_s, object.center_rmse_m, object.velocity_rmse_m_s, object.radius_mae_m, object.id_switches);
  }
  print("all: %d scans, recall %.3f, longest delay %.2f s, centre RMSE %.3f m, velocity RMSE %.3f m/s, ", score.scans,
        score.recall, score.max_delay_s, score.center_rmse_m, score.velocity_rmse_m_s);
  print("false elements %.3f per scan, longest %.2f s\n", score.false_per_scan, score.longest_false_s);
  return table;
}

}  // namespace situation_awareness
