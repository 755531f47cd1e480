// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/map_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/assignment.hpp"

namespace situation_awareness {

void MapEvaluation::add(const Objects& truth, const Objects& map) {
  ++scans_;
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < truth.objects.size(); ++i) {
    for (std::size_t j = 0; j < map.objects.size(); ++j) {
      const double distance_m =
          (truth.objects[i].ellipse_world.center_m - map.objects[j].ellipse_world.center_m).norm();
      if (distance_m <= params_.max_match_distance_m) {
        candidates.push_back({static_cast<int>(i), static_cast<int>(j), distance_m});
      }
    }
  }
  const std::vector<int> element_of =
      assign(static_cast<int>(truth.objects.size()), static_cast<int>(map.objects.size()), candidates,
             2.0 * params_.max_match_distance_m);

  std::vector<bool> on_truth(map.objects.size(), false);
  for (std::size_t i = 0; i < truth.objects.size(); ++i) {
    const Object& object = truth.objects[i];
    ObjectTally& tally = objects_[object.id];
    const bool mapped = element_of[i] >= 0;
    if (mapped) on_truth[static_cast<std::size_t>(element_of[i])] = true;
    if (object.beams < params_.visible_beams) {
      tally.unmapped_since_ns = kNever;
      continue;
    }
    ++tally.visible_scans;
    if (!mapped) {
      if (tally.unmapped_since_ns == kNever) tally.unmapped_since_ns = truth.stamp_ns;
      tally.max_delay_s = std::max(tally.max_delay_s, seconds_between(tally.unmapped_since_ns, truth.stamp_ns));
      continue;
    }
    if (tally.unmapped_since_ns != kNever) {
      tally.max_delay_s = std::max(tally.max_delay_s, seconds_between(tally.unmapped_since_ns, truth.stamp_ns));
      tally.unmapped_since_ns = kNever;
    }
    const Object& element = map.objects[static_cast<std::size_t>(element_of[i])];
    ++tally.mapped_scans;
    if (tally.element_id != 0 && tally.element_id != element.id) ++tally.id_switches;
    tally.element_id = element.id;
    tally.center_sse_m2 += (object.ellipse_world.center_m - element.ellipse_world.center_m).squaredNorm();
    tally.velocity_sse_m2_s2 += (object.velocity_world_m_s - element.velocity_world_m_s).squaredNorm();
    const Ellipse a = canonical(object.ellipse_world);
    const Ellipse b = canonical(element.ellipse_world);
    tally.radius_sae_m += 0.5 * (std::abs(a.rx_m - b.rx_m) + std::abs(a.ry_m - b.ry_m));
  }

  std::map<std::uint64_t, std::int64_t> false_since;
  for (std::size_t j = 0; j < map.objects.size(); ++j) {
    if (on_truth[j]) continue;
    const std::uint64_t id = map.objects[j].id;
    const auto before = false_since_.find(id);
    const std::int64_t since_ns = before != false_since_.end() ? before->second : truth.stamp_ns;
    false_since[id] = since_ns;
    longest_false_s_ = std::max(longest_false_s_, seconds_between(since_ns, truth.stamp_ns));
    ++false_elements_;
  }
  false_since_ = std::move(false_since);
}

MapScore MapEvaluation::score() const {
  MapScore score;
  score.scans = scans_;
  score.longest_false_s = longest_false_s_;
  score.false_per_scan = scans_ > 0 ? static_cast<double>(false_elements_) / scans_ : 0.0;
  long visible = 0;
  long mapped = 0;
  double center_sse_m2 = 0.0;
  double velocity_sse_m2_s2 = 0.0;
  for (const auto& [id, tally] : objects_) {
    ObjectScore object;
    object.truth_id = id;
    object.visible_scans = tally.visible_scans;
    object.mapped_scans = tally.mapped_scans;
    object.max_delay_s = tally.max_delay_s;
    object.id_switches = tally.id_switches;
    if (tally.mapped_scans > 0) {
      object.center_rmse_m = std::sqrt(tally.center_sse_m2 / tally.mapped_scans);
      object.velocity_rmse_m_s = std::sqrt(tally.velocity_sse_m2_s2 / tally.mapped_scans);
      object.radius_mae_m = tally.radius_sae_m / tally.mapped_scans;
    }
    score.max_delay_s = std::max(score.max_delay_s, tally.max_delay_s);
    visible += tally.visible_scans;
    mapped += tally.mapped_scans;
    center_sse_m2 += tally.center_sse_m2;
    velocity_sse_m2_s2 += tally.velocity_sse_m2_s2;
    score.objects.push_back(object);
  }
  if (visible > 0) score.recall = static_cast<double>(mapped) / static_cast<double>(visible);
  if (mapped > 0) {
    score.center_rmse_m = std::sqrt(center_sse_m2 / static_cast<double>(mapped));
    score.velocity_rmse_m_s = std::sqrt(velocity_sse_m2_s2 / static_cast<double>(mapped));
  }
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
