// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/scouting.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Worth of a close-up, in targets that are found.
constexpr double kCloseUpGain = 0.3;
/// Targets that a way point is expected to find at least; for less the vehicle goes home.
constexpr double kLeastStopGain = 0.05;
/// s. What is found so much later is worth 1/e.
constexpr double kHaste_s = 100.0;
/// m. Edge of the cells in which targets are expected.
constexpr double kBeliefCell_m = 10.0;

constexpr double kLattice_m = 5.0;             ///< of the ways around obstacles
constexpr double kBeside_m = 40.0;             ///< that ways may lead beside the region
constexpr double kMostLattice = 300.0;         ///< nodes along an edge, of large regions
constexpr double kSample_s = 1.5;              ///< between the views of a way, in plans
constexpr double kThere_rad = 0.15;            ///< a yaw that is reached
constexpr double kHome_m = 2.0;                ///< of a place that is home
constexpr double kCloseUp_m = 2.5;             ///< of a place that is the close-up's
constexpr double kSameTarget_m = 4.0;          ///< targets that are so near are the same, and clusters that are one's
constexpr int kDue = 2;                        ///< steps in a row, at least, from which the way home is due
constexpr int kCandidates = 24;                ///< random views from which a route goes on with one
constexpr int kBearings = 16;                  ///< from which a target may be seen near by
constexpr int kMostTries = 2;                  ///< of a close-up
constexpr double kLate = 2.0, kLate_s = 15.0;  ///< a stop may take so much longer than planned
constexpr std::size_t kMostStops = 40;
constexpr double kCentre = 0.7;  ///< part of the image in which a target has to be for a close-up
constexpr double kNear = 1.3;    ///< and how much farther than planned it may be
constexpr double kGroundStep_m = 5.0;

}  // namespace

void ScoutRegion::validate() const {
  check_bounds(*this, "region");
  if (!(x_max_world_m > x_min_world_m)) {
    throw std::invalid_argument("region.x_max_world_m must be above region.x_min_world_m");
  }
  if (!(y_max_world_m > y_min_world_m)) {
    throw std::invalid_argument("region.y_max_world_m must be above region.y_min_world_m");
  }
}

void ScoutingParams::validate() const {
  check_bounds(*this, "scouting");
  region.validate();
  camera.validate();
  if (!(margin_s < budget_s)) throw std::invalid_argument("scouting.margin_s must be below scouting.budget_s");
  const double below_rad = std::atan2(close_up_height_m, close_up_m);
  if (!(below_rad < 0.5 * camera.vertical_field_of_view_rad - camera.pitch_rad) ||
      !(below_rad > -0.5 * camera.vertical_field_of_view_rad - camera.pitch_rad)) {
    throw std::invalid_argument(
        "scouting.close_up_height_m over scouting.close_up_m must be a slope within the camera's "
        "vertical_field_of_view_rad");
  }
  const double columns = (region.x_max_world_m - region.x_min_world_m) / kBeliefCell_m;
  const double rows = (region.y_max_world_m - region.y_min_world_m) / kBeliefCell_m;
  if (!(columns * rows <= 1e5))
    throw std::invalid_argument("scouting.region must not have more than 1e5 cells of 10 m by 10 m");
}

const char* name_of(ScoutingState state) {
  switch (state) {
    case ScoutingState::kScout:
      return "scout";
    case ScoutingState::kCloseUp:
      return "close_up";
    case ScoutingState::kHome:
      return "home";
    case ScoutingState::kDone:
      return "done";
    case ScoutingState::kHold:
      return "hold";
  }
  return "";
}

namespace {

Eigen::Vector2d low_of(const ScoutRegion& region) { return {region.x_min_world_m, region.y_min_world_m}; }
Eigen::Vector2d high_of(const ScoutRegion& region) { return {region.x_max_world_m, region.y_max_world_m}; }

FreeWays ways_of(const ScoutingParams& params, const Eigen::Vector2d& home_m) {
  const Eigen::Vector2d beside_m(kBeside_m, kBeside_m);
  const Eigen::Vector2d low_m = low_of(params.region).cwiseMin(home_m) - beside_m;
  const Eigen::Vector2d high_m = high_of(params.region).cwiseMax(home_m) + beside_m;
  return {low_m, high_m, std::max(kLattice_m, (high_m - low_m).maxCoeff() / kMostLattice)};
}

}  // namespace

Scouting::Scouting(const ScoutingParams& params, const Eigen::Vector3d& home_world_m,
                   std::function<double(double, double)> ground_world_m, double spent_s)
    : params_((params.validate(), params)),
      home_m_(home_world_m),
      ground_(std::move(ground_world_m)),
      belief_(params.camera, low_of(params.region), high_of(params.region), kBeliefCell_m, params.expected_targets),
      ways_((home_world_m.allFinite() ? void() : throw std::invalid_argument("home is not finite"),
             ways_of(params, home_world_m.head<2>()))),
      random_(static_cast<std::uint64_t>(params.seed)),
      spent_s_(spent_s) {}

double Scouting::ground_m(const Eigen::Vector2d& p_m) const {
  const double known_m = ground_ ? ground_(p_m.x(), p_m.y()) : std::numeric_limits<double>::quiet_NaN();
  return std::isfinite(known_m) ? known_m : home_m_.z() - params_.height_m;
}

double Scouting::highest_ground_m(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) const {
  const int steps = std::max(1, static_cast<int>(std::min((to_m - from_m).norm() / kGroundStep_m, 1000.0)));
  double highest_m = ground_m(from_m);
  for (int i = 1; i <= steps; ++i) highest_m = std::max(highest_m, ground_m(from_m + (to_m - from_m) * i / steps));
  return highest_m;
}

/// From rest to rest.
double Scouting::fly_s(double way_m, double climb_m) const {
  return std::hypot(way_m, climb_m) / params_.speed_m_s + params_.speed_m_s / params_.acceleration_m_s2;
}

double Scouting::home_s(const Eigen::Vector2d& p_m, double height_m) {
  return fly_s(ways_.length_m(p_m, home_m_.head<2>()), std::abs(params_.height_m - height_m)) +
         std::abs(home_m_.z() - ground_m(home_m_.head<2>()) - params_.height_m) / params_.speed_m_s;
}

bool Scouting::is_in_region(const Eigen::Vector2d& p_m, double around_m) const {
  const Eigen::Vector2d around(around_m, around_m);
  return ((p_m - low_of(params_.region) + around).array() >= 0.0).all() &&
         ((high_of(params_.region) - p_m + around).array() >= 0.0).all();
}

/// What was closed up is known by its place: a map that begins anew gives other ids to the same things, and may give
/// the same ids to others.
void Scouting::take_targets(const GridTargets& targets) {
  const auto is_on_map = [&](const Known& known) {
    return std::any_of(targets.targets.begin(), targets.targets.end(),
                       [&](const GridTarget& target) { return target.id == known.target.id; });
  };
  const auto distance_to = [](const Known& known, const GridTarget& target) {
    return (known.target.p_world_m - target.p_world_m).head<2>().norm();
  };
  for (const GridTarget& target : targets.targets) {
    const auto same =
        std::find_if(known_.begin(), known_.end(), [&](const Known& known) { return known.target.id == target.id; });
    if (same != known_.end()) {
      if (distance_to(*same, target) < kSameTarget_m) {
        same->target = target;
        continue;
      }
      same->target.id = 0;
    }
    if (!is_in_region(target.p_world_m.head<2>(), kSameTarget_m)) continue;
    Known* twin = nullptr;
    for (Known& known : known_) {
      const double away_m = distance_to(known, target);
      if (away_m < kSameTarget_m && (twin == nullptr || away_m < distance_to(*twin, target))) twin = &known;
    }
    must_plan_ = true;
    if (twin != nullptr && !is_on_map(*twin)) {
      twin->target = target;
    } else {
      known_.push_back({target, twin != nullptr && twin->is_closed_up, false, 0});
    }
  }
  // What is no target any more needs no close-up.
  const auto is_gone = [&](const Known& known) { return !known.is_closed_up && !is_on_map(known); };
  must_plan_ = must_plan_ || std::any_of(known_.begin(), known_.end(), is_gone);
  known_.erase(std::remove_if(known_.begin(), known_.end(), is_gone), known_.end());
}

void Scouting::take_grid(const SemanticGrid& grid) {
  belief_.take_unobserved(grid);
  std::vector<GridCluster> clusters;
  find_clusters(grid, clusters);
  clusters.erase(std::remove_if(clusters.begin(), clusters.end(),
                                [&](const GridCluster& cluster) {
                                  return !is_in_region(cluster.p_world_m, kSameTarget_m) ||
                                         std::any_of(known_.begin(), known_.end(), [&](const Known& known) {
                                           return (known.target.p_world_m.head<2>() - cluster.p_world_m).norm() <
                                                  kSameTarget_m;
                                         });
                                }),
                 clusters.end());
  belief_.set_tentative(clusters);
}

void Scouting::add_image(const Eigen::Vector3d& p_world_m, double yaw_rad) {
  if (!p_world_m.allFinite() || !std::isfinite(yaw_rad)) return;
  const Eigen::Vector2d p_m = p_world_m.head<2>();
  belief_.look({p_m, p_world_m.z() - ground_m(p_m), yaw_rad}, 1.0);
  ScoutCameraParams centre = params_.camera;
  centre.field_of_view_rad *= kCentre;
  const double far_m = kNear * std::hypot(params_.close_up_m, params_.close_up_height_m);
  for (Known& known : known_) {
    if (known.is_closed_up) continue;
    const Eigen::Vector3d to_m = known.target.p_world_m - p_world_m;
    if (to_m.norm() > far_m || !is_in_view(centre, {p_m, -to_m.z(), yaw_rad}, known.target.p_world_m.head<2>())) {
      continue;
    }
    known.is_closed_up = true;
    must_plan_ = true;
  }
}

/// What images on the way and at its end add to the belief, and how long the way takes: straight in the plan, with the
/// yaw of its end from the begin on.
double Scouting::look_along(ScoutBelief& belief, const From& from, const ScoutStop& to, double way_m,
                            double* time_s) const {
  const double turn_rad = wrap_to_pi(to.yaw_rad - from.yaw_rad);
  const double move_s = way_m < 0.1 ? 0.0 : fly_s(way_m, to.height_m - from.height_m);
  const double turn_s = std::abs(turn_rad) / params_.yaw_rate_rad_s;
  const double dwell_s = 1.0 / params_.image_rate_hz;
  *time_s = std::max(move_s, turn_s) + dwell_s;
  const int samples = std::max(1, static_cast<int>(std::lround(*time_s / kSample_s)));
  double gain = 0.0;
  for (int i = 1; i <= samples; ++i) {
    const double t_s = *time_s * i / samples;
    const double moved = move_s > 0.0 ? std::min(1.0, t_s / move_s) : 1.0;
    const double turned = turn_s > 0.0 ? std::min(1.0, t_s / turn_s) : 1.0;
    gain += belief.look({from.p_m + moved * (to.p_world_m - from.p_m),
                         from.height_m + moved * (to.height_m - from.height_m), from.yaw_rad + turned * turn_rad},
                        *time_s / samples * params_.image_rate_hz);
  }
  return gain;
}

/// Cuts the plan off at the first stop from which the way home is too long; false if nothing is left.
bool Scouting::evaluate(Plan& plan, const From& from, double left_s) {
  ScoutBelief belief = belief_;
  From at = from;
  double t_s = 0.0;
  plan.worth = 0.0;
  for (std::size_t i = 0; i < plan.stops.size(); ++i) {
    const ScoutStop& stop = plan.stops[i];
    const double way_m = ways_.length_m(at.p_m, stop.p_world_m);
    double leg_s = 0.0, gain = 0.0;
    if (std::isfinite(way_m)) gain = look_along(belief, at, stop, way_m, &leg_s);
    if (!std::isfinite(way_m) || t_s + leg_s + home_s(stop.p_world_m, stop.height_m) + params_.margin_s > left_s) {
      plan.stops.resize(i);
      break;
    }
    t_s += leg_s;
    if (stop.target != 0) gain += kCloseUpGain;
    plan.worth += gain * std::exp(-t_s / kHaste_s);
    at = {stop.p_world_m, stop.yaw_rad, stop.height_m};
  }
  return !plan.stops.empty();
}

/// The nearest free place for a close-up from somewhere.
std::optional<ScoutStop> Scouting::close_up_stop(const Known& known, const Eigen::Vector2d& from_m) {
  const Eigen::Vector2d target_m = known.target.p_world_m.head<2>();
  const Eigen::Vector2d to_from_m = from_m - target_m;
  const double bearing_rad = to_from_m.norm() > 0.1 ? std::atan2(to_from_m.y(), to_from_m.x()) : 0.0;
  for (int i = 0; i <= kBearings; ++i) {  // to both sides alternately
    const double off_rad = (i % 2 == 0 ? 1 : -1) * ((i + 1) / 2) * 2.0 * kPi / kBearings;
    const double angle_rad = bearing_rad + off_rad;
    const Eigen::Vector2d out(std::cos(angle_rad), std::sin(angle_rad));
    const Eigen::Vector2d p_m = target_m + params_.close_up_m * out;
    if (!ways_.is_free(p_m) || !std::isfinite(ways_.length_m(from_m, p_m))) continue;
    return ScoutStop{p_m, wrap_to_pi(angle_rad + kPi), params_.close_up_height_m, known.target.id};
  }
  return {};
}

std::optional<ScoutStop> Scouting::random_stop(const Eigen::Vector2d& near_m, double near_yaw_rad) {
  ScoutStop stop;
  stop.height_m = params_.height_m;
  const double kind = random_.uniform();
  stop.yaw_rad = random_.uniform(-kPi, kPi);
  if (kind < 0.15) {  // a turn on the spot
    stop.p_world_m = near_m;
    stop.yaw_rad = wrap_to_pi(near_yaw_rad + (random_.uniform() < 0.5 ? 1.0 : -1.0) * random_.uniform(0.5, kPi));
  } else {
    const Eigen::Vector2d low_m = low_of(params_.region), high_m = high_of(params_.region);
    stop.p_world_m = {random_.uniform(low_m.x(), high_m.x()), random_.uniform(low_m.y(), high_m.y())};
    if (kind < 0.6) {  // near by
      stop.p_world_m = (near_m + 0.4 * (stop.p_world_m - near_m)).cwiseMax(low_m).cwiseMin(high_m);
    }
  }
  if (!ways_.is_free(stop.p_world_m)) return {};
  return stop;
}

/// Greedy: from each stop on to the best of some random ones, by what is gained per time.
Scouting::Plan Scouting::random_plan(const From& from, double left_s) {
  Plan plan;
  ScoutBelief belief = belief_;
  From at = from;
  double t_s = 0.0;
  std::vector<const Known*> pending;
  for (const Known& known : known_) {
    if (!known.is_closed_up && !known.is_given_up) pending.push_back(&known);
  }
  while (plan.stops.size() < kMostStops) {
    ScoutStop best;
    double best_rate = 0.0, best_s = 0.0;
    const auto consider = [&](const ScoutStop& stop, double extra) {
      const double way_m = ways_.length_m(at.p_m, stop.p_world_m);
      if (!std::isfinite(way_m)) return;
      ScoutBelief trial = belief;
      double leg_s = 0.0;
      const double gain = look_along(trial, at, stop, way_m, &leg_s) + extra;
      if (gain < kLeastStopGain || gain / leg_s <= best_rate) return;
      if (t_s + leg_s + home_s(stop.p_world_m, stop.height_m) + params_.margin_s > left_s) return;
      best = stop;
      best_rate = gain / leg_s;
      best_s = leg_s;
    };
    for (const Known* known : pending) {
      const std::optional<ScoutStop> stop = close_up_stop(*known, at.p_m);
      if (stop) consider(*stop, kCloseUpGain);
    }
    for (int i = 0; i < kCandidates; ++i) {
      const std::optional<ScoutStop> stop = random_stop(at.p_m, at.yaw_rad);
      if (stop) consider(*stop, 0.0);
    }
    if (best_rate <= 0.0) break;
    double leg_s = 0.0;
    look_along(belief, at, best, ways_.length_m(at.p_m, best.p_world_m), &leg_s);
    t_s += best_s;
    at = {best.p_world_m, best.yaw_rad, best.height_m};
    plan.stops.push_back(best);
    pending.erase(std::remove_if(pending.begin(), pending.end(),
                                 [&](const Known* known) { return known->target.id == best.target; }),
                  pending.end());
  }
  evaluate(plan, from, left_s);
  return plan;
}

/// A random one: a stop moved, left out or put in, or the order of a part turned round.
void Scouting::change(Plan& plan, const From& from) {
  const auto pick = [&](std::size_t n) {
    return std::min(n - 1, static_cast<std::size_t>(random_.uniform() * static_cast<double>(n)));
  };
  const double kind = random_.uniform();
  const std::size_t n = plan.stops.size();
  if (n == 0 || (kind < 0.3 && n < kMostStops)) {
    const std::size_t i = n == 0 ? 0 : pick(n + 1);
    const Eigen::Vector2d near_m = i == 0 ? from.p_m : plan.stops[i - 1].p_world_m;
    const std::optional<ScoutStop> stop = random_stop(near_m, i == 0 ? from.yaw_rad : plan.stops[i - 1].yaw_rad);
    if (stop) plan.stops.insert(plan.stops.begin() + static_cast<std::ptrdiff_t>(i), *stop);
    return;
  }
  const std::size_t i = pick(n);
  const auto at = plan.stops.begin() + static_cast<std::ptrdiff_t>(i);
  if (kind < 0.6 && at->target == 0) {
    ScoutStop moved = *at;
    const double scale_m = random_.uniform() < 0.5 ? 10.0 : 40.0;
    moved.p_world_m += scale_m * Eigen::Vector2d(random_.uniform(-1.0, 1.0), random_.uniform(-1.0, 1.0));
    moved.p_world_m = moved.p_world_m.cwiseMax(low_of(params_.region)).cwiseMin(high_of(params_.region));
    moved.yaw_rad = wrap_to_pi(moved.yaw_rad + random_.uniform(-1.0, 1.0));
    if (ways_.is_free(moved.p_world_m)) *at = moved;
  } else if (kind < 0.75) {
    plan.stops.erase(at);
  } else if (n > 1) {
    const std::size_t k = pick(n);
    std::reverse(plan.stops.begin() + static_cast<std::ptrdiff_t>(std::min(i, k)),
                 plan.stops.begin() + static_cast<std::ptrdiff_t>(std::max(i, k) + 1));
    // The nearest views of the targets are others now.
    for (std::size_t j = std::min(i, k); j < n; ++j) {
      if (plan.stops[j].target == 0) continue;
      const auto known = std::find_if(known_.begin(), known_.end(),
                                      [&](const Known& other) { return other.target.id == plan.stops[j].target; });
      if (known == known_.end()) continue;
      const auto stop = close_up_stop(*known, j == 0 ? from.p_m : plan.stops[j - 1].p_world_m);
      if (stop) plan.stops[j] = *stop;
    }
  }
}

void Scouting::make_plan(const From& from, double left_s) {
  Plan best;
  // What is left of the route before, with targets as they are now.
  for (const ScoutStop& stop : route_) {
    if (stop.target == 0) {
      best.stops.push_back(stop);
      continue;
    }
    const auto known = std::find_if(known_.begin(), known_.end(), [&](const Known& other) {
      return other.target.id == stop.target && !other.is_closed_up && !other.is_given_up;
    });
    if (known == known_.end()) continue;
    const auto again = close_up_stop(*known, best.stops.empty() ? from.p_m : best.stops.back().p_world_m);
    if (again) best.stops.push_back(*again);
  }
  evaluate(best, from, left_s);
  for (int i = 0; i < params_.routes; ++i) {
    Plan plan = random_plan(from, left_s);
    if (plan.worth > best.worth) best = std::move(plan);
  }
  for (int i = 0; i < params_.changes; ++i) {
    Plan plan = best;
    change(plan, from);
    evaluate(plan, from, left_s);
    if (plan.worth > best.worth) best = std::move(plan);
  }
  // Stops that are not worth their way.
  if (!best.stops.empty()) {
    ScoutBelief belief = belief_;
    double leg_s = 0.0;
    const ScoutStop& first = best.stops.front();
    const double gain = look_along(belief, from, first, ways_.length_m(from.p_m, first.p_world_m), &leg_s);
    if (first.target == 0 && gain < kLeastStopGain && best.worth < kLeastStopGain) best.stops.clear();
    stop_due_s_ = step_.elapsed_s + kLate * leg_s + kLate_s;
  }
  route_ = std::move(best.stops);
  is_short_of_time_ = route_.empty() && !random_plan(from, std::numeric_limits<double>::infinity()).stops.empty();
  ++step_.plan;
}

bool Scouting::is_route_free(const Eigen::Vector2d& p_m) {
  Eigen::Vector2d at_m = p_m;
  return std::all_of(route_.begin(), route_.end(), [&](const ScoutStop& stop) {
    const bool is_free = ways_.is_free(stop.p_world_m) && std::isfinite(ways_.length_m(at_m, stop.p_world_m));
    at_m = stop.p_world_m;
    return is_free;
  });
}

bool Scouting::lead_to(const Eigen::Vector2d& p_m, const Eigen::Vector2d& to_m) {
  // On along the corners that were found, while they are free.
  while (way_.size() > 1 && (way_.front() - p_m).norm() < kHome_m && ways_.is_free(p_m, way_[1])) {
    way_.erase(way_.begin());
  }
  if (way_.empty() || (way_.back() - to_m).norm() > 1e-9 || !ways_.is_free(p_m, way_.front())) {
    way_ = ways_.way(p_m, to_m);
  }
  return !way_.empty();
}

const ScoutingStep& Scouting::step(const ScoutingInput& input) {
  if (!input.p_world_m.allFinite() || !std::isfinite(input.yaw_rad)) {
    throw std::invalid_argument("the pose of a scouting step is not finite");
  }
  step_.elapsed_s = spent_s_ + seconds_between(0, clock_.advance(input.stamp_ns));
  step_.left_s = params_.budget_s - step_.elapsed_s;
  const Eigen::Vector2d p_m = input.p_world_m.head<2>();
  const double height_m = input.p_world_m.z() - ground_m(p_m);
  if (input.obstacles != nullptr) {
    AvoidanceParams avoidance;
    avoidance.clearance_m = params_.clearance_m;
    ways_.set(*input.obstacles, avoidance);
    way_.clear();
    // A route that is still free stays, so that maps that come often cost little; what was given up has another try.
    must_plan_ = must_plan_ || !is_route_free(p_m);
    for (Known& known : known_) {
      must_plan_ = must_plan_ || known.is_given_up;
      known.is_given_up = false;
    }
  }
  if (input.targets != nullptr) take_targets(*input.targets);
  if (input.grid != nullptr) take_grid(*input.grid);
  step_.home_s = home_s(p_m, height_m);
  const bool is_due = std::isfinite(step_.home_s) && step_.home_s + params_.margin_s >= step_.left_s;
  due_ = is_due ? due_ + 1 : 0;
  must_go_home_ = must_go_home_ || due_ >= kDue;

  const auto is_at = [&](const ScoutStop& stop) {
    const double near_m = stop.target != 0 ? kCloseUp_m : params_.arrival_m;
    return (stop.p_world_m - p_m).norm() < near_m &&
           (stop.target == 0 || std::abs(stop.height_m - height_m) < 2.0 * near_m) &&
           std::abs(wrap_to_pi(stop.yaw_rad - input.yaw_rad)) < kThere_rad;
  };
  const bool waits_for_images = !input.sees && !must_go_home_ && step_.state != ScoutingState::kDone;
  if (!waits_for_images) held_m_.reset();
  if (waits_for_images) {
    if (!held_m_) held_m_ = input.p_world_m;
    stop_due_s_ = step_.elapsed_s + kLate_s;
  } else if (!route_.empty() && !must_go_home_) {
    const ScoutStop stop = route_.front();
    const bool is_late = step_.elapsed_s > stop_due_s_;
    const auto known =
        std::find_if(known_.begin(), known_.end(), [&](const Known& other) { return other.target.id == stop.target; });
    // A close-up is done with its image.
    const bool waits = stop.target != 0 && known != known_.end() && !known->is_closed_up && !is_late;
    if (is_late && stop.target != 0 && known != known_.end() && ++known->tries >= kMostTries) {
      known->is_given_up = true;
    }
    if (is_late || (is_at(stop) && !waits)) {
      route_.erase(route_.begin());
      must_plan_ = true;
    }
  }
  if (must_go_home_) {
    route_.clear();
  } else if (must_plan_ && !waits_for_images) {
    make_plan({p_m, input.yaw_rad, height_m}, step_.left_s);
  }
  must_plan_ = must_plan_ && waits_for_images;

  const Eigen::Vector2d home_m = home_m_.head<2>();
  const bool leads = lead_to(p_m, route_.empty() ? home_m : route_.front().p_world_m);
  step_.target = 0;
  step_.yaw_rad = input.yaw_rad;
  if (waits_for_images) {
    step_.state = ScoutingState::kHold;
    step_.reason = "no image is mapped";
    step_.go_to_world_m = *held_m_;
  } else if (!leads) {
    step_.state = ScoutingState::kHold;
    step_.reason = route_.empty() ? "there is no free way home" : "there is no free way to the next stop";
    step_.go_to_world_m = input.p_world_m;
    must_plan_ = !must_go_home_;
  } else if (route_.empty()) {
    const bool is_home = (p_m - home_m).norm() < kHome_m;
    step_.state = is_home ? ScoutingState::kDone : ScoutingState::kHome;
    step_.reason = was_told_home_                       ? "told to go home"
                   : must_go_home_ || is_short_of_time_ ? "the budget is only enough for the way home"
                                                        : "no stop is worth its way any more";
    const Eigen::Vector2d way_m = way_.front() - p_m;
    if (way_m.norm() > kHome_m) step_.yaw_rad = std::atan2(way_m.y(), way_m.x());
    const bool is_last = way_.size() == 1;
    step_.go_to_world_m << way_.front(),
        is_last && (p_m - home_m).norm() < params_.height_m
            ? home_m_.z()
            : std::max(home_m_.z(), highest_ground_m(p_m, way_.front()) + params_.close_up_height_m);
  } else {
    const ScoutStop& stop = route_.front();
    step_.state = stop.target != 0 ? ScoutingState::kCloseUp : ScoutingState::kScout;
    step_.target = stop.target;
    step_.reason = stop.target != 0 ? "to a close-up of target " + std::to_string(stop.target)
                                    : "to the next view of what is not yet seen well enough";
    step_.yaw_rad = stop.yaw_rad;
    step_.go_to_world_m << way_.front(), highest_ground_m(p_m, way_.front()) + stop.height_m;
    if (stop.target != 0 && (p_m - stop.p_world_m).norm() < 2.0 * kCloseUp_m) {
      step_.go_to_world_m.z() = ground_m(stop.p_world_m) + stop.height_m;
    }
  }
  step_.targets = known_.size();
  step_.close_ups = static_cast<std::size_t>(
      std::count_if(known_.begin(), known_.end(), [](const Known& known) { return known.is_closed_up; }));
  step_.given_up = static_cast<std::size_t>(
      std::count_if(known_.begin(), known_.end(), [](const Known& known) { return known.is_given_up; }));
  step_.expected_left = belief_.left();
  return step_;
}

}  // namespace situation_awareness
