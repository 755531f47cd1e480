// SPDX-License-Identifier: BSD-3-Clause
// Compares `targets` with the things of a simulated world and prints a table; the exit code tells whether the bounds
// were met. A flight ends by `flight_done`, or after a set time.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <ros/ros.h>
#include <std_msgs/Empty.h>
#include <Eigen/LU>

#include "situation_awareness/TargetArray.h"
#include "situation_awareness/ros/convert/grid.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr double kLastImage_s = 1.0;     ///< after the end of the flight: the targets of its last image have come
constexpr double kChiSquare99 = 9.2103;  ///< its quantile with two degrees of freedom

struct TargetEvaluatorParams {
  std::string world = "carpark";
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

class TargetEvaluator {
 public:
  TargetEvaluator(const ros::NodeHandle& node, const TargetEvaluatorParams& params)
      : params_(params), node_(node), world_(world_file(params.world)) {
    targets_ = node_.subscribe<TargetArray>("targets", 50, [this](const TargetArrayConstPtr& msg) { take(*msg); });
    done_ = node_.subscribe<std_msgs::Empty>("flight_done", 1, [this](const std_msgs::EmptyConstPtr&) {
      if (params_.duration_s == 0.0 && end_.isZero()) end_ = ros::Time::now() + ros::Duration(kLastImage_s);
    });
  }

  /// Until the end of the flight; false where it did not come.
  bool wait() {
    ros::WallRate rate(20.0);
    while (ros::ok()) {
      ros::spinOnce();
      const ros::Time now = ros::Time::now();
      if (begin_.isZero() && !now.isZero() && received_ > 0) begin_ = now;
      if (!begin_.isZero()) {
        const double flown_s = (now - begin_).toSec();
        if (params_.duration_s > 0.0 && flown_s >= params_.duration_s) return true;
        if (!end_.isZero() && now >= end_) return true;
        if (flown_s > params_.max_duration_s) return false;
      }
      rate.sleep();
    }
    return false;
  }

  /// Prints table and verdict; true if the bounds were met.
  bool report() const {
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
    bool met = things > 0;
    const auto judge = [&met](const char* what, double value, double bound, bool is_met, const char* unit) {
      met = met && is_met;
      std::printf("%-36s %8.3f %-2s (bound %.3f) %s\n", what, value, unit, bound, is_met ? "met" : "NOT MET");
    };
    judge("things missed", missed, params_.max_missed, missed <= params_.max_missed, "");
    judge("wrong targets", wrong, params_.max_wrong, wrong <= params_.max_wrong, "");
    judge("largest distance of a centroid", worst_m, params_.max_distance_m, worst_m <= params_.max_distance_m, "m");
    const double part = found > 0 ? static_cast<double>(inside) / static_cast<double>(found) : 0.0;
    judge("things in their 99 % regions", part, params_.min_in_region_part, part >= params_.min_in_region_part, "");
    return met;
  }

 private:
  void take(const TargetArray& msg) {
    latest_ = grid_targets_from_msg(msg);
    ++received_;
  }

  TargetEvaluatorParams params_;
  ros::NodeHandle node_;
  World world_;
  ros::Subscriber targets_, done_;
  GridTargets latest_;
  std::size_t received_ = 0;
  ros::Time begin_, end_;
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "target_evaluator");
  const ros::NodeHandle node;
  try {
    situation_awareness::TargetEvaluator evaluator(
        node, situation_awareness::ParamReader(ros::NodeHandle("~"))
                  .read<situation_awareness::TargetEvaluatorParams>(situation_awareness::refuse));
    const bool has_ended = evaluator.wait();
    if (!has_ended) std::printf("the flight did not come to its end\n");
    return evaluator.report() && has_ended ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "target_evaluator: %s\n", error.what());
    return 1;
  }
}
