// SPDX-License-Identifier: BSD-3-Clause
// Transits under the policies of the safety areas, simulated: their times with boxes beside the way, and whether the
// vehicle touches someone who steps into it. Prints a JSON object.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "situation_awareness/evaluation/safety_transits.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;

constexpr SafetyPolicy kPolicies[] = {SafetyPolicy::kConservative, SafetyPolicy::kUpdated, SafetyPolicy::kIgnoreKnown};

Json of_boxes(SafetyPolicy policy, int seeds, double slow_speed_m_s) {
  TransitParams params;
  params.safety.slow_speed_m_s = slow_speed_m_s;
  params.safety.policy = policy;
  double sum_s = 0.0, least_s = 1e9, most_s = 0.0;
  int arrived = 0, hit = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto number = static_cast<std::uint64_t>(seed);
    const TransitOutcome outcome = simulate_transit(scene_with_boxes(number), params, number);
    arrived += outcome.arrived ? 1 : 0;
    hit += outcome.hit_box ? 1 : 0;
    sum_s += outcome.time_s;
    least_s = std::min(least_s, outcome.time_s);
    most_s = std::max(most_s, outcome.time_s);
  }
  return {{"runs", seeds},           {"arrived", arrived}, {"boxes_touched", hit},
          {"mean_s", sum_s / seeds}, {"least_s", least_s}, {"most_s", most_s}};
}

Json of_walkers(SafetyPolicy policy, int seeds, bool behind_a_box) {
  TransitParams params;
  params.safety.policy = policy;
  double sum_s = 0.0, least_m = 1e9, fastest_m_s = 0.0;
  int arrived = 0, touched = 0, stopped = 0;
  std::vector<int> touches;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto number = static_cast<std::uint64_t>(seed);
    const TransitScene scene = behind_a_box ? scene_with_walker_behind_a_box(number) : scene_with_walker(number);
    const TransitOutcome outcome = simulate_transit(scene, params, number);
    arrived += outcome.arrived ? 1 : 0;
    stopped += outcome.least_speed_m_s < 0.01 ? 1 : 0;
    sum_s += outcome.time_s;
    least_m = std::min(least_m, outcome.least_clearance_m);
    if (!outcome.touched) continue;
    ++touched;
    touches.push_back(seed);
    fastest_m_s = std::max(fastest_m_s, outcome.touch_speed_m_s);
  }
  return {{"runs", seeds},
          {"arrived", arrived},
          {"stopped", stopped},
          {"touched", touched},
          {"touch_seeds", touches},
          {"fastest_touch_m_s", fastest_m_s},
          {"least_clearance_m", least_m},
          {"mean_s", sum_s / seeds}};
}

void count(Json& entry, const char* key, bool is_so) { entry[key] = entry[key].get<int>() + (is_so ? 1 : 0); }

void keep_most(Json& entry, const char* key, double value) { entry[key] = std::max(entry[key].get<double>(), value); }

void keep_least(Json& entry, const char* key, double value) { entry[key] = std::min(entry[key].get<double>(), value); }

/// Returns what every table of runs counts, of no run yet.
Json no_runs() {
  return {
      {"runs", 0}, {"person_touched", 0}, {"thing_touched", 0}, {"least_clearance_m", 1e9}, {"seeds", Json::array()}};
}

bool is_contact(const TransitOutcome& outcome) { return outcome.touched || outcome.hit_box; }

/// Adds what every table counts.
void add_run(Json& entry, const TransitOutcome& outcome, std::uint64_t seed, bool is_late) {
  count(entry, "runs", true);
  count(entry, "person_touched", outcome.touched);
  count(entry, "thing_touched", outcome.hit_box);
  keep_least(entry, "least_clearance_m", outcome.least_clearance_m);
  if (is_contact(outcome) || is_late) entry["seeds"].push_back(seed);
}

/// The scenes of a seed that were drawn anew since someone steps out of hiding, under each policy.
void add_out_of_hiding(TransitWithFault run, std::uint64_t seed, Json& by_policy) {
  for (const SafetyPolicy policy : kPolicies) {
    Json& entry = by_policy[name_of(policy)];
    if (entry.is_null()) {
      entry = no_runs();
      entry.update({{"fastest_touch_m_s", 0.0}, {"longest_in_view_s", 0.0}});
    }
    run.params.safety.policy = policy;
    for (const TransitScene& scene : run.out_of_hiding) {
      const TransitOutcome outcome = simulate_transit(scene, run.params, seed);
      add_run(entry, outcome, seed, false);
      keep_most(entry, "fastest_touch_m_s", outcome.touch_speed_m_s);
      keep_most(entry, "longest_in_view_s", outcome.touch_in_view_s);
    }
  }
}

/// Runs with a fault, the policies in turn: contacts, and those that stood too late, by fault; apart from them the
/// scenes that were drawn anew, since someone steps out of hiding.
Json of_faults(int first, int runs) {
  std::map<std::string, Json> by_fault;
  Json out_of_hiding = Json::object();
  int contacts = 0, late = 0, found = 0;
  for (int seed = first; seed < first + runs; ++seed) {
    const auto number = static_cast<std::uint64_t>(seed);
    const TransitWithFault run = transit_with_fault(kPolicies[seed % 3], number);
    const TransitOutcome outcome = simulate_transit(run.scene, run.params, number);
    Json& entry = by_fault[name_of(run.params.fault)];
    if (entry.is_null()) {
      entry = no_runs();
      entry.update({{"stood_late", 0}, {"found_after_s", 0.0}, {"way_beyond_m", 0.0}});
    }
    const double beyond_m = outcome.way_to_stand_m - longest_way_to_stand_m(outcome, run.params);
    const bool has_found = outcome.found && has_to_stop(run.params.fault);
    const bool is_late = has_found && (!outcome.stands || beyond_m > 0.0);
    add_run(entry, outcome, number, is_late);
    count(entry, "stood_late", is_late);
    if (has_found) {
      keep_most(entry, "found_after_s", outcome.found_after_s);
      keep_most(entry, "way_beyond_m", beyond_m);
    }
    contacts += is_contact(outcome) ? 1 : 0;
    late += is_late ? 1 : 0;
    found += has_found ? 1 : 0;
    add_out_of_hiding(run, number, out_of_hiding);
  }
  return {{"first", first},     {"runs", runs},         {"contacts", contacts},          {"stops", found},
          {"stood_late", late}, {"by_fault", by_fault}, {"out_of_hiding", out_of_hiding}};
}

Json of_policies(int boxes, int walkers, int hidden, double slow_speed_m_s) {
  Json result;
  for (const SafetyPolicy policy : kPolicies) {
    result[name_of(policy)] = {{"boxes", of_boxes(policy, boxes, slow_speed_m_s)},
                               {"walkers", of_walkers(policy, walkers, false)},
                               {"walkers_behind_a_box", of_walkers(policy, hidden, true)}};
  }
  const double conservative_s = result["conservative"]["boxes"]["mean_s"];
  for (const SafetyPolicy policy : kPolicies) {
    Json& boxes_of = result[name_of(policy)]["boxes"];
    boxes_of["saved"] = 1.0 - boxes_of["mean_s"].get<double>() / conservative_s;
  }
  return result;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  CommandLine app("safety_transits",
                  "Simulates transits under the policies of the safety areas and prints a JSON object.");
  int boxes = 20, walkers = 1000, hidden = 200;
  app.add_option("--boxes", boxes, "transits with three boxes beside the way, per policy").check(in_range(1, 100000));
  app.add_option("--walkers", walkers, "transits with someone who steps into the way, per policy")
      .check(in_range(1, 1000000));
  app.add_option("--hidden", hidden, "those with someone who steps out from behind a box").check(in_range(1, 1000000));
  int faults = 0;
  app.add_option("--faults", faults, "of transits with someone who steps into the way and a fault at some time, alone")
      .check(in_range(1, 1000000));
  int first = 1;
  app.add_option("--first", first, "seed of those with a fault; the policies take turns").check(in_range(1, 1000000));
  double slow_speed_m_s = SafetyParams().slow_speed_m_s;
  app.add_option("--slow-speed", slow_speed_m_s, "beside standing things in the warning area, in m/s")
      .check(in_range(0.01, 0.5));
  return run_program(app, argc, argv, [&] {
    const Json result = faults > 0 ? of_faults(first, faults) : of_policies(boxes, walkers, hidden, slow_speed_m_s);
    std::printf("%s\n", result.dump(2).c_str());
    return std::fflush(stdout) == 0 ? 0 : 1;
  });
}
