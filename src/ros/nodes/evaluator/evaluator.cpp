// SPDX-License-Identifier: BSD-3-Clause
// Compares what is estimated in a simulated world with its truth and prints a table; the exit code tells whether the
// bounds were met. The robot of the world decides what is compared: of a vehicle that drives its transits, of one that
// flies on the boundaries of large obstacles, of a multirotor that is led the targets of its camera, and else all
// features of the one map.
#include <memory>
#include <stdexcept>
#include <string>

#include <ros/ros.h>

#include "situation_awareness/ros/simulation.hpp"

#include "../simulated_robot.hpp"
#include "evaluation.hpp"

namespace situation_awareness {
namespace {

std::unique_ptr<Evaluation> evaluate(VehicleKind kind, const EvaluationInputs& inputs) {
  switch (kind) {
    case VehicleKind::kUnicycle:
      return evaluate_transits(inputs);
    case VehicleKind::kFixedWing:
      return evaluate_boundaries(inputs);
    case VehicleKind::kMultirotor:
      return evaluate_targets(inputs);
    case VehicleKind::kPath:
      break;
  }
  return evaluate_features(inputs);
}

bool run(const ros::NodeHandle& node, const ros::NodeHandle& private_node) {
  const auto name = private_node.param<std::string>("world", kDefaultWorld);
  World world(world_file(name));
  const VehicleKind kind = kind_of(world);
  const std::unique_ptr<Evaluation> evaluation =
      evaluate(kind, {node, ParamReader(private_node), refuse_for_robot(name, kind), world});
  ros::spin();
  Verdict verdict;
  evaluation->report(verdict);
  std::fflush(stdout);
  return verdict.is_met();
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "evaluator");
  const ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  try {
    return situation_awareness::run(node, ros::NodeHandle("~")) ? 0 : 1;
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
}
