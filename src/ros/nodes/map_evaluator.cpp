// SPDX-License-Identifier: BSD-3-Clause
// Compares `objects` with `truth` stamp by stamp, prints a table; the exit code tells whether the bounds were met.
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <ros/ros.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/bodies.hpp"
#include "situation_awareness/evaluation/map_evaluation.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

struct EvaluatorParams {
  std::string world;
  double duration_s = 0.0;
  double max_delay_s = 1.0;
  double max_false_s = 1.5;
  double max_center_rmse_m = 0.05;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world,
          "name of a world in models/worlds, or a path: what is on its fixtures is not false; empty: none has");
    visit("duration_s", self.duration_s, Bounds{0.0, 1e6}, "s",
          "simulated time from the first scan that is compared; 0: until shutdown");
    visit("max_delay_s", self.max_delay_s, Bounds{0.0, 1e6}, "s",
          "longest time from the first visible scan of an object until it is on the map");
    visit("max_false_s", self.max_false_s, Bounds{0.0, 1e6}, "s", "longest duration of a false ellipse");
    visit("max_center_rmse_m", self.max_center_rmse_m, Bounds{0.0, 1e3}, "m", "largest RMSE of the centres");
  }
};

class Evaluator {
 public:
  Evaluator(ros::NodeHandle node, const EvaluatorParams& params) : params_(params) {
    if (!params.world.empty()) fixtures_world_ = World(world_file(params.world)).fixtures();
    truth_subscriber_ = node.subscribe("truth", 200, &Evaluator::on_truth, this);
    map_subscriber_ = node.subscribe("objects", 200, &Evaluator::on_map, this);
  }

  /// Prints table and verdict; true if the bounds were met.
  bool report() const {
    const MapScore score = evaluation_ ? evaluation_->score() : MapScore{};
    std::printf("%s", format_table(score, names_).c_str());
    bool met = true;
    const auto judge = [&met](const char* what, double value, double bound, const char* unit) {
      const bool ok = value <= bound;  // false for NaN
      met = met && ok;
      std::printf("%-34s %8.3f %-2s (bound %.3f) %s\n", what, value, unit, bound, ok ? "met" : "NOT MET");
    };
    judge("longest delay of a visible object", score.max_delay_s, params_.max_delay_s, "s");
    judge("longest duration of a false ellipse", score.longest_false_s, params_.max_false_s, "s");
    judge("centre RMSE", score.center_rmse_m, params_.max_center_rmse_m, "m");
    if (score.scans == 0 || score.recall <= 0.0) {
      std::printf("nothing was compared: %d scans with map and truth\n", score.scans);
      met = false;
    }
    std::fflush(stdout);
    return met;
  }

 private:
  void on_truth(const MappedObjectArrayConstPtr& msg) {
    if (!evaluation_) begin(*msg);
    truths_[msg->header.stamp] = msg;
    compare();
  }

  /// The parts of a person are one object.
  void begin(const MappedObjectArray& truth) {
    std::vector<std::string> labels;
    for (const MappedObject& element : truth.objects) labels.push_back(element.label);
    const std::vector<Body> bodies = bodies_of(labels);
    for (const Body& body : bodies) names_[truth.objects.at(body.parts.front()).id] = body.name;
    evaluation_.emplace(MapEvaluationParams{}, bodies, fixtures_world_);
  }

  void on_map(const MappedObjectArrayConstPtr& msg) {
    maps_[msg->header.stamp] = msg;
    compare();
  }

  void compare() try {
    if (!ros::ok()) return;  // the run is over, later messages were still in transit
    for (auto map = maps_.begin(); map != maps_.end();) {
      const auto truth = truths_.find(map->first);
      if (truth == truths_.end()) {
        ++map;
        continue;
      }
      evaluation_->add(objects_from_msg(*truth->second), objects_from_msg(*map->second));
      if (first_.isZero()) first_ = map->first;
      if (params_.duration_s > 0.0 && (map->first - first_).toSec() >= params_.duration_s) return ros::shutdown();
      truths_.erase(truths_.begin(), std::next(truth));  // stamps increase: earlier ones are complete
      map = maps_.erase(maps_.begin(), std::next(map));
    }
    constexpr std::size_t kMaxWaiting = 1000;
    while (truths_.size() > kMaxWaiting) truths_.erase(truths_.begin());
    while (maps_.size() > kMaxWaiting) maps_.erase(maps_.begin());
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM_THROTTLE(5.0, "map_evaluator: " << error.what());
    maps_.clear();
  }

  EvaluatorParams params_;
  std::vector<Box> fixtures_world_;
  std::optional<MapEvaluation> evaluation_;
  std::map<ros::Time, MappedObjectArrayConstPtr> truths_, maps_;  ///< without their counterpart yet
  std::map<std::uint64_t, std::string> names_;
  ros::Time first_;
  ros::Subscriber truth_subscriber_, map_subscriber_;
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "map_evaluator");
  ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  const ros::NodeHandle private_node("~");
  try {
    situation_awareness::Evaluator evaluator(
        node, situation_awareness::ParamReader(private_node)
                  .read<situation_awareness::EvaluatorParams>(situation_awareness::refuse));
    ros::spin();
    return evaluator.report() ? 0 : 1;
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
}
