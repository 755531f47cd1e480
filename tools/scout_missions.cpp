// SPDX-License-Identifier: BSD-3-Clause
// Scouting missions of a simulated multirotor over cars and trees, against a lawnmower with the same speed, camera and
// height. Prints a table, and a JSON object into a file.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "situation_awareness/evaluation/scout_missions.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::uint32_t first_seed = 1, seeds = 20;
  int label_px = 112;
  bool hills = false, lawnmower = true, ways = false;
  double lane_m = 40.0, budget_s = ScoutingParams().budget_s;
  std::string json;
};

Json json_of(const ScoutMissionOutcome& outcome, double budget_s, bool ways) {
  Json json{{"cars", outcome.cars},
            {"found", outcome.found},
            {"wrong", outcome.wrong},
            {"worst_centroid_m", outcome.worst_centroid_m},
            {"last_found_s", outcome.last_found_s},
            {"budget_s", budget_s},
            {"home_s", outcome.home_s},
            {"home_in_time", outcome.home_in_time},
            {"close_ups", outcome.close_ups},
            {"way_m", outcome.way_m}};
  if (ways) {
    for (const Eigen::Vector3d& p_m : outcome.flown_m) json["flown"].push_back({p_m.x(), p_m.y(), p_m.z()});
  }
  return json;
}

void print(const char* name, std::uint64_t seed, const ScoutMissionOutcome& outcome) {
  std::printf(
      "%-9s %4llu  found %2d of %d  wrong %d  centroid %.2f m  last %5.1f s  home %5.1f s%s  close-ups %2d  %4.0f m"
      "  step %.0f ms\n",
      name, static_cast<unsigned long long>(seed), outcome.found, outcome.cars, outcome.wrong, outcome.worst_centroid_m,
      outcome.last_found_s, outcome.home_s, outcome.home_in_time ? "" : " LATE", outcome.close_ups, outcome.way_m,
      1e3 * outcome.longest_step_s);
  std::fflush(stdout);
}

/// Over all seeds.
struct Summary {
  int runs = 0, all_found = 0, home = 0, all_closed_up = 0, wrong = 0;
  double last_sum_s = 0.0, worst_centroid_m = 0.0, home_sum_s = 0.0;

  void add(const ScoutMissionOutcome& outcome) {
    ++runs;
    all_found += outcome.found == outcome.cars ? 1 : 0;
    home += outcome.home_in_time ? 1 : 0;
    all_closed_up += outcome.close_ups >= outcome.cars ? 1 : 0;
    wrong += outcome.wrong;
    last_sum_s += outcome.last_found_s;
    home_sum_s += outcome.home_s;
    worst_centroid_m = std::max(worst_centroid_m, outcome.worst_centroid_m);
  }
  Json json() const {
    return {{"runs", runs},
            {"all_found", all_found},
            {"home_in_time", home},
            {"all_close_ups", all_closed_up},
            {"wrong", wrong},
            {"mean_last_found_s", last_sum_s / runs},
            {"mean_home_s", home_sum_s / runs},
            {"worst_centroid_m", worst_centroid_m}};
  }
};

void run(const Options& options) {
  Json all;
  Summary scouting, lawnmower;
  for (std::uint32_t i = 0; i < options.seeds; ++i) {
    const std::uint64_t seed = options.first_seed + i;
    ScoutMission mission = random_scout_mission(seed, options.hills);
    mission.label_px = options.label_px;
    mission.params.budget_s = options.budget_s;
    mission.params.seed = static_cast<int>(seed);
    const ScoutMissionOutcome flown = fly_scouting(mission, seed);
    print("scouting", seed, flown);
    scouting.add(flown);
    Json one{{"seed", seed}, {"scouting", json_of(flown, options.budget_s, options.ways)}};
    if (options.ways) {
      for (const SceneCar& car : mission.scene.cars) {
        one["car_places"].push_back({car.T_world_car.translation_m.x(), car.T_world_car.translation_m.y()});
      }
      for (const SceneTree& tree : mission.scene.trees)
        one["tree_places"].push_back({tree.p_world_m.x(), tree.p_world_m.y()});
    }
    if (options.lawnmower) {
      const ScoutMissionOutcome mown = fly_lawnmower(mission, options.lane_m, seed);
      print("lawnmower", seed, mown);
      lawnmower.add(mown);
      one["lawnmower"] = json_of(mown, options.budget_s, options.ways);
    }
    all["missions"].push_back(one);
  }
  all["scouting"] = scouting.json();
  std::printf(
      "scouting:  all found in %d of %d, home in time in %d, mean last %.1f s, worst centroid %.2f m, wrong %d, "
      "all close-ups in %d\n",
      scouting.all_found, scouting.runs, scouting.home, scouting.last_sum_s / scouting.runs, scouting.worst_centroid_m,
      scouting.wrong, scouting.all_closed_up);
  if (options.lawnmower) {
    all["lawnmower"] = lawnmower.json();
    all["time_to_last"] = scouting.last_sum_s / lawnmower.last_sum_s;
    std::printf("lawnmower: all found in %d of %d, home in time in %d, mean last %.1f s, worst centroid %.2f m\n",
                lawnmower.all_found, lawnmower.runs, lawnmower.home, lawnmower.last_sum_s / lawnmower.runs,
                lawnmower.worst_centroid_m);
    std::printf("time to the last car: %.2f of the lawnmower's\n", scouting.last_sum_s / lawnmower.last_sum_s);
  }
  if (options.json.empty()) return;
  std::ofstream file(options.json);
  file << all.dump(1) << '\n';
  if (!file) throw std::runtime_error(options.json + ": cannot be written");
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("scout_missions", "Scouting missions of a simulated multirotor, against a lawnmower");
  app.add_option("--first-seed", options.first_seed, "the first seed");
  app.add_option("--seeds", options.seeds, "number of seeds").check(in_range(1, 100000));
  app.add_option("--label-px", options.label_px, "along the edge of the label images").check(in_range(16, 1024));
  app.add_flag("--hills", options.hills, "gentle hills, and an elevation with errors");
  app.add_flag("!--no-lawnmower", options.lawnmower, "fly only the scouting");
  app.add_flag("--ways", options.ways, "with places and the ways flown in the JSON object");
  app.add_option("--lane", options.lane_m, "between the lawnmower's lanes, in m").check(in_range(1.0, 1000.0));
  app.add_option("--budget", options.budget_s, "in s").check(in_range(30.0, 1e5));
  app.add_option("--json", options.json, "write a JSON object into this file");
  return run_program(app, argc, argv, [&options] {
    run(options);
    return 0;
  });
}
