// SPDX-License-Identifier: BSD-3-Clause
// Transits under the policies of the safety areas, simulated: their times with boxes beside the way, and whether the
// vehicle touches someone who steps into it. Prints a JSON object.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

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
    const TransitOutcome outcome = simulate_transit(scene_with_walker(number, behind_a_box), params, number);
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

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  CLI::App app("Simulates transits under the policies of the safety areas and prints a JSON object.");
  int boxes = 20, walkers = 1000, hidden = 200;
  app.add_option("--boxes", boxes, "transits with three boxes beside the way, per policy")
      ->check(CLI::Range(1, 100000));
  app.add_option("--walkers", walkers, "transits with someone who steps into the way, per policy")
      ->check(CLI::Range(1, 1000000));
  app.add_option("--hidden", hidden, "those with someone who steps out from behind a box")
      ->check(CLI::Range(1, 1000000));
  double slow_speed_m_s = SafetyParams().slow_speed_m_s;
  app.add_option("--slow-speed", slow_speed_m_s, "beside standing things in the warning area, in m/s")
      ->check(CLI::Range(0.01, 0.5));
  CLI11_PARSE(app, argc, argv);
  try {
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
    std::printf("%s\n", result.dump(2).c_str());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "safety_transits: %s\n", error.what());
    return 1;
  }
  return std::fflush(stdout) == 0 ? 0 : 1;
}
