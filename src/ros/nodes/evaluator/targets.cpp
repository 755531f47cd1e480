// SPDX-License-Identifier: BSD-3-Clause
// `targets` against the things of the world. A flight ends by `flight_done`, or after a set time.
#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <ros/ros.h>
#include <std_msgs/Empty.h>
#include <Eigen/LU>

#include "situation_awareness/TargetArray.h"
#include "situation_awareness/ros/convert/grid.hpp"
#include "situation_awareness/ros/convert/time.hpp"

#include "../simulated_robot.hpp"
#include "evaluation.hpp"

namespace situation_awareness {
namespace {

constexpr double kLastImage_s = 1.0;     ///< after the end of the flight: the targets of its last image have come
constexpr double kWatch_s = 0.05;        ///< period in which the end is looked for
constexpr double kChiSquare99 = 9.2103;  ///< its quantile with two degrees of freedom

struct TargetEvaluatorParams {
  std::string world = kDefaultWorld;
  std::string kind = "car";
  double half_region_m = 100.0;
  double duration_s = 0.0;
  double max_duration_s = 900.0;
  double near_m = 3.0;
  int max_missed = 0;
  int max_wrong = 0;
  double max_distance_m = 1.5;
  double min_in_region_part = 0.9;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path: its things are the truth");
    visit("kind", self.kind, "of these things: their name without a number at its end");
    visit("half_region_m", self.half_region_m, Bounds{1.0, 1e5}, "m", "half of the edge of the square that counts");
    visit("duration_s", self.duration_s, Bounds{0.0, 1e6}, "s",
          "simulated time after which the targets are judged; 0: when flight_done comes");
    visit("max_duration_s", self.max_duration_s, Bounds{1.0, 1e6}, "s", "a flight that takes longer has got lost");
    visit("near_m", self.near_m, Bounds{0.01, 100.0}, "m", "a thing and a target farther apart are not the same");
    visit("max_missed", self.max_missed, Bounds{0, 10000}, "", "most things without a target");
    visit("max_wrong", self.max_wrong, Bounds{0, 10000}, "", "most targets without a thing");
    visit("max_distance_m", self.max_distance_m, Bounds{0.0, 100.0}, "m", "largest distance of a centroid");
    visit("min_in_region_part", self.min_in_region_part, Bounds{0.0, 1.0}, "",
          "least part of the things in the 99 % regions of their targets");
  }
};

class TargetEvaluator : public Evaluation {
 public:
  explicit TargetEvaluator(const EvaluationInputs& inputs)
      : params_(inputs.params.read<TargetEvaluatorParams>(inputs.on_unknown_key)), world_(inputs.world) {
    ros::NodeHandle node = inputs.node;
    targets_ = node.subscribe<TargetArray>("targets", 50, [this](const TargetArrayConstPtr& msg) { take(*msg); });
    done_ = node.subscribe<std_msgs::Empty>("flight_done", 1, [this](const std_msgs::EmptyConstPtr&) {
      if (params_.duration_s == 0.0 && end_.isZero()) end_ = ros::Time::now() + ros::Duration(kLastImage_s);
    });
    watch_ = node.createTimer(ros::Duration(kWatch_s), [this](const ros::TimerEvent&) { watch(); });
  }

  void report(Verdict& verdict) const override {
    if (!finished_) verdict.fail("the flight did not come to its end");
    int missed = 0, inside = 0;
    double worst_m = 0.0;
    std::set<std::uint64_t> matched;
    std::size_t things = 0;
    std::printf("%-12s %8s %8s %8s %10s %8s %6s\n", "thing", "x m", "y m", "target", "distance m", "sigma m", "p");
    for (const TrueThing& thing : world_.things_at(0.0)) {
      const Eigen::Vector2d p_m = thing.T_world_thing.translation_m;
      if (thing.kind != params_.kind || p_m.cwiseAbs().maxCoeff() > params_.half_region_m) continue;
      ++things;
      const GridTarget* nearest = nullptr;
      double nearest_m = params_.near_m;
      for (const GridTarget& target : latest_.targets) {
        const double distance_m = (target.p_world_m.head<2>() - p_m).norm();
        if (distance_m > nearest_m || matched.count(target.id) > 0) continue;
        nearest = &target;
        nearest_m = distance_m;
      }
      std::printf("%-12s %8.1f %8.1f ", thing.name.c_str(), p_m.x(), p_m.y());
      if (nearest == nullptr) {
        ++missed;
        std::printf("%8s\n", "missed");
        continue;
      }
      matched.insert(nearest->id);
      worst_m = std::max(worst_m, nearest_m);
      const Eigen::Vector2d off_m = nearest->p_world_m.head<2>() - p_m;
      inside += off_m.dot(nearest->covariance_m2.inverse() * off_m) < kChiSquare99 ? 1 : 0;
      std::printf("%8llu %10.2f %8.2f %6.2f\n", static_cast<unsigned long long>(nearest->id), nearest_m,
                  std::sqrt(0.5 * nearest->covariance_m2.trace()), nearest->probability);
    }
    int wrong = 0;
    for (const GridTarget& target : latest_.targets) {
      if (matched.count(target.id) > 0 || target.p_world_m.head<2>().cwiseAbs().maxCoeff() > params_.half_region_m) {
        continue;
      }
      ++wrong;
      std::printf("%-12s %8.1f %8.1f %8llu\n", "wrong", target.p_world_m.x(), target.p_world_m.y(),
                  static_cast<unsigned long long>(target.id));
    }
    const std::size_t found = things - static_cast<std::size_t>(missed);
    if (things == 0) verdict.fail("the world has none of these things");
    verdict.at_most("things missed", missed, params_.max_missed);
    verdict.at_most("wrong targets", wrong, params_.max_wrong);
    verdict.at_most("largest distance of a centroid", worst_m, params_.max_distance_m, "m");
    const double part = found > 0 ? static_cast<double>(inside) / static_cast<double>(found) : 0.0;
    verdict.at_least("things in their 99 % regions", part, params_.min_in_region_part);
  }

 private:
  void take(const TargetArray& msg) {
    latest_ = grid_targets_from_msg(msg);
    if (begin_.isZero()) begin_ = ros::Time::now();
  }

  /// Ends at the end of the flight, or where that takes too long.
  void watch() {
    if (begin_.isZero()) return;
    const ros::Time now = ros::Time::now();
    const double flown_s = (now - begin_).toSec();
    finished_ = (params_.duration_s > 0.0 && flown_s >= params_.duration_s) || (!end_.isZero() && now >= end_);
    if (finished_ || flown_s > params_.max_duration_s) ros::shutdown();
  }

  TargetEvaluatorParams params_;
  const World& world_;
  GridTargets latest_;
  bool finished_ = false;
  ros::Time begin_, end_;
  ros::Subscriber targets_, done_;
  ros::Timer watch_;
};

}  // namespace

std::unique_ptr<Evaluation> evaluate_targets(const EvaluationInputs& inputs) {
  return std::make_unique<TargetEvaluator>(inputs);
}

}  // namespace situation_awareness
