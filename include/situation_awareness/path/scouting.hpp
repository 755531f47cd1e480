// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/path/free_ways.hpp"
#include "situation_awareness/path/mission_clock.hpp"
#include "situation_awareness/path/scout_belief.hpp"

namespace situation_awareness {

// Scouting (docs/math/scouting.md; ScoutNet paper, Sect. VII-C): a multirotor with a camera finds all targets in a
// region, goes near each, and is home before a budget ends. All in the world, lengths in m.

/// The rectangle in which targets are looked for.
struct ScoutRegion {
  double x_min_world_m = -100.0, x_max_world_m = 100.0;
  double y_min_world_m = -100.0, y_max_world_m = 100.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("x_min_world_m", self.x_min_world_m, Bounds{-1e6, 1e6}, "m", "its western edge");
    visit("x_max_world_m", self.x_max_world_m, Bounds{-1e6, 1e6}, "m", "its eastern edge");
    visit("y_min_world_m", self.y_min_world_m, Bounds{-1e6, 1e6}, "m", "its southern edge");
    visit("y_max_world_m", self.y_max_world_m, Bounds{-1e6, 1e6}, "m", "its northern edge");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

struct ScoutingParams {
  ScoutRegion region;
  ScoutCameraParams camera;
  double budget_s = 600.0;
  double margin_s = 20.0;
  double speed_m_s = 6.0;
  double acceleration_m_s2 = 2.0;
  double yaw_rate_rad_s = 0.6;
  double image_rate_hz = 2.0;
  double height_m = 25.0;
  double arrival_m = 5.0;
  double close_up_m = 18.0;
  double close_up_height_m = 12.0;
  double expected_targets = 12.0;
  double clearance_m = 5.0;
  int routes = 12;
  int changes = 150;

  // Constants of the method, which are not read from YAML.
  /// The seed of the random numbers: the same one gives the same mission.
  int seed = 1;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("region", self.region);
    visit("camera", self.camera);
    visit("budget_s", self.budget_s, Bounds{1.0, 1e5}, "s", "from the first step until it has to be home");
    visit("margin_s", self.margin_s, Bounds{0.0, 1e4}, "s", "that is left then at least");
    visit("speed_m_s", self.speed_m_s, Bounds{0.1, 50.0}, "m/s", "that the vehicle flies at");
    visit("acceleration_m_s2", self.acceleration_m_s2, Bounds{0.1, 20.0}, "m/s^2", "with which it starts and brakes");
    visit("yaw_rate_rad_s", self.yaw_rate_rad_s, Bounds{0.01, 10.0}, "rad/s", "with which it turns");
    visit("image_rate_hz", self.image_rate_hz, Bounds{0.01, 100.0}, "1/s", "of images that are mapped");
    visit("height_m", self.height_m, Bounds{1.0, 1000.0}, "m", "above the ground, of scouting");
    visit("arrival_m", self.arrival_m, Bounds{0.1, 100.0}, "m", "so near to a way point it is reached");
    visit("close_up_m", self.close_up_m, Bounds{0.5, 1000.0}, "m", "over the ground, of a close-up from its target");
    visit("close_up_height_m", self.close_up_height_m, Bounds{0.5, 1000.0}, "m", "above the ground, of a close-up");
    visit("expected_targets", self.expected_targets, Bounds{0.01, 1e5}, "", "in the region");
    visit("clearance_m", self.clearance_m, Bounds{0.0, 1000.0}, "m", "least distance of ways from obstacles");
    visit("routes", self.routes, Bounds{1, 10000}, "", "random ones from which a plan begins");
    visit("changes", self.changes, Bounds{0, 1000000}, "", "random ones of the best of these");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

enum class ScoutingState : std::uint8_t { kScout, kCloseUp, kHome, kDone, kHold };
const char* name_of(ScoutingState state);  ///< "scout", "close_up", "home", "done", "hold"

/// A place of a route from which the camera looks.
struct ScoutStop {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  double yaw_rad = 0.0;
  double height_m = 0.0;     ///< above the ground
  std::uint64_t target = 0;  ///< of a close-up; 0: none
};

/// What is known now. Pointers may be null: then that is as it was.
struct ScoutingInput {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d p_world_m = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;
  const GridTargets* targets = nullptr;
  const SemanticGrid* grid = nullptr;
  const Obstacles* obstacles = nullptr;  ///< to be given when they have changed
  bool sees = true;                      ///< images are mapped; else the vehicle holds, until the way home is due
};

struct ScoutingStep {
  ScoutingState state = ScoutingState::kHold;
  std::string reason;                                       ///< in one sentence
  Eigen::Vector3d go_to_world_m = Eigen::Vector3d::Zero();  ///< with all on the straight way there free
  double yaw_rad = 0.0;
  std::uint64_t target = 0;    ///< of a close-up; 0: none
  double elapsed_s = 0.0;      ///< since the first step, as MissionClock says
  double left_s = 0.0;         ///< of the budget
  double home_s = 0.0;         ///< that the way home takes from here; infinite if there is none
  std::size_t targets = 0;     ///< in the region
  std::size_t close_ups = 0;   ///< done
  std::size_t given_up = 0;    ///< targets without a way to a close-up
  double expected_left = 0.0;  ///< targets that are not found yet
  std::uint64_t plan = 0;      ///< number of the route, which changes with it
};

/// Budgeted orienteering over the grid's belief: the route of views that is expected to find most targets soonest, with
/// a close-up of each that was found, such that the way home fits into the budget from each of its stops. A plan is the
/// best of some random greedy routes, improved by random changes; a new one is made at each stop and when something was
/// found.
class Scouting {
 public:
  /// `home_world_m`: where it ends, at that height. `ground_world_m`: its height; not known: NaN; empty: it is at
  /// home's height less that of scouting. `spent_s` of the budget: by a mission that goes on. Throws
  /// std::invalid_argument naming field and bound.
  Scouting(const ScoutingParams& params, const Eigen::Vector3d& home_world_m,
           std::function<double(double x_world_m, double y_world_m)> ground_world_m = {}, double spent_s = 0.0);

  /// An image that was mapped was taken from there.
  void add_image(const Eigen::Vector3d& p_world_m, double yaw_rad);

  /// From now on there is only the way home.
  void go_home() { must_go_home_ = was_told_home_ = true; }

  /// A few times per second. Home and what was found stay whatever the stamps say. Throws std::invalid_argument if the
  /// pose is not finite.
  const ScoutingStep& step(const ScoutingInput& input);

  /// What is planned from the way point on; home is not in it.
  const std::vector<ScoutStop>& route() const { return route_; }
  /// The corners of the way to the first stop, or home.
  const std::vector<Eigen::Vector2d>& way() const { return way_; }
  const ScoutBelief& belief() const { return belief_; }
  const ScoutingParams& params() const { return params_; }

 private:
  /// A target of the map, or what was one when it was closed up: its id is 0 when another target has its id.
  struct Known {
    GridTarget target;
    bool is_closed_up = false, is_given_up = false;
    int tries = 0;
  };
  struct Plan {
    std::vector<ScoutStop> stops;
    double worth = 0.0;
  };
  struct From {
    Eigen::Vector2d p_m;
    double yaw_rad;
    double height_m;
  };

  double ground_m(const Eigen::Vector2d& p_m) const;
  double highest_ground_m(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) const;
  double fly_s(double way_m, double climb_m) const;
  double home_s(const Eigen::Vector2d& p_m, double height_m);
  void take_targets(const GridTargets& targets);
  void take_grid(const SemanticGrid& grid);
  bool is_in_region(const Eigen::Vector2d& p_m, double around_m) const;

  double look_along(ScoutBelief& belief, const From& from, const ScoutStop& to, double way_m, double* time_s) const;
  bool evaluate(Plan& plan, const From& from, double left_s);
  std::optional<ScoutStop> close_up_stop(const Known& known, const Eigen::Vector2d& from_m);
  std::optional<ScoutStop> random_stop(const Eigen::Vector2d& near_m, double near_yaw_rad);
  Plan random_plan(const From& from, double left_s);
  void change(Plan& plan, const From& from);
  void make_plan(const From& from, double left_s);
  bool is_route_free(const Eigen::Vector2d& p_m);
  bool lead_to(const Eigen::Vector2d& p_m, const Eigen::Vector2d& to_m);

  ScoutingParams params_;
  Eigen::Vector3d home_m_;
  std::function<double(double, double)> ground_;
  ScoutBelief belief_;
  FreeWays ways_;
  Random random_;
  std::vector<Known> known_;
  std::vector<ScoutStop> route_;
  std::vector<Eigen::Vector2d> way_;
  MissionClock clock_;
  double spent_s_;                         ///< before its first stamp
  std::optional<Eigen::Vector3d> held_m_;  ///< where it waits for images
  int due_ = 0;                            ///< steps in a row for which the way home was due
  double stop_due_s_ = 0.0;                ///< since the begin: a stop that is not reached until then is given up
  bool must_plan_ = true, must_go_home_ = false, was_told_home_ = false, is_short_of_time_ = false;
  ScoutingStep step_;
};

}  // namespace situation_awareness
