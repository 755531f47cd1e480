// SPDX-License-Identifier: BSD-3-Clause
// From a recorded drive to a file of reflectors, without a roscore.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>

#include "command_line.hpp"
#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/geometry/parse_pose2.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/pipeline/reflector_evidence.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/pose/reflector_survey.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/odometry.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "record_reflectors";
constexpr const char* kConfig = "polygons.yaml";
constexpr const char* kDescription =
    R"(Finds the reflectors along a recorded drive from laser scans with intensities, odometry and transforms, and writes
their places for localisation:
  reflectors:
    - {x: 1.5, y: -0.25, radius_m: 0.05}
in m, in the world whose origin the first pose is, or that --initial-pose is given in. All reflectors have the same
radius. What is not always bright, moves or has gone is left out, and listed. If the drive does not tell the places,
nothing is written, and the exit code is 1. The file is written atomically.
)";

struct Options {
  BagOptions bag;
  std::string scan_topic = "/scan";
  OdometryOptions odometry;
  std::string initial_pose = "0,0,0";
  std::string out;
  ReflectorSurveyParams survey;
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  text("--scan-topic", options.scan_topic, "TOPIC", "sensor_msgs/LaserScan");
  add_odometry_options(app, options.odometry);
  text("--initial-pose", options.initial_pose, "X,Y,YAW", "of the base at the first scan");
  app.add_option("--radius", options.survey.radius_m, "of the reflectors, in m")
      .type_name("M")
      .check(from_to(0.001, 1.0));
  app.add_option("--min-sightings", options.survey.min_sightings, "what was seen at fewer places is left out")
      .type_name("N")
      .check(from_to(2, 10000));
  app.add_option("--max-distance-sigma", options.survey.max_distance_sigma_m,
                 "greatest standard deviation of the distance of two reflectors, in m")
      .type_name("M")
      .check(from_to(0.001, 100.0));
  text("--out", options.out, "FILE", "the file of reflectors to write").required();
  app.callback([&options] { check_option([&] { parse_pose2(options.initial_pose, "--initial-pose"); }); });
}

void print_found(const ReflectorSurveyResult& result) {
  std::printf("%zu reflectors, seen along %.1f m:\n", result.reflectors.size(), result.way_m);
  for (std::size_t i = 0; i < result.reflectors.size(); ++i) {
    const SurveyedReflector& found = result.reflectors[i];
    const Eigen::Vector2d& p = found.reflector.center_world_m;
    std::printf("  [%zu] at (%.3f, %.3f), seen at %d places, bright in %.0f %% of the scans that hit it\n", i, p.x(),
                p.y(), found.sightings, 1e2 * found.bright_part);
  }
  for (const SurveyRefusal& refusal : result.refused) {
    std::printf("  left out: at (%.2f, %.2f), seen at %d places, %s\n", refusal.center_world_m.x(),
                refusal.center_world_m.y(), refusal.sightings, refusal.reason);
  }
  std::printf("greatest standard deviation of a distance between two: %.1f mm\n", 1e3 * result.distance_sigma_m);
  std::printf("odometry: distances are to be longer by %.2f %%, turns by %.2f %%\n", 1e2 * result.scale_error.x(),
              1e2 * result.scale_error.y());
}

int record_reflectors(const Options& options) {
  const std::string path = config_path(options.bag, kConfig);
  const auto params = params_from_yaml<PolygonPipelineParams>(read_text_file(path), path);
  const OdometryFrames frames = odometry_frames(options.bag, options.odometry);
  ReflectorDetectionParams reflectors = params.reflectors;
  reflectors.radius_m = options.survey.radius_m;
  reflectors.validate();
  ReflectorSurveyParams survey_params = options.survey;
  survey_params.wheels = params.localization.wheels;
  survey_params.odometry = params.localization.odometry;
  ReflectorSurvey survey(survey_params, parse_pose2(options.initial_pose, "--initial-pose"));

  BagPlayer player(options.bag, {frames.base, true});
  Counters refused;
  Points points;
  ReflectorSightings sightings;
  ReflectorEvidence evidence(reflectors);
  UseOdometry use;
  use.add = [&survey](std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns) {
    return survey.add_odometry(stamp_ns, T_odom_base, received_ns);
  };
  use.use = [&](const Scan& scan, const OdometryScan& placed) {
    player.timed([&] {
      points = project_horizontally(scan, placed.T_base_lidar, placed.T_base_lidar, std::move(points));
      sightings = detect_reflectors(points, reflectors, std::move(sightings));
      evidence.add(points, sightings);
      survey.add(sightings, points.T_world_level);
    });
  };
  subscribe_odometry_scans(player, options.odometry.topic, options.scan_topic, params.scan, frames, refused,
                           std::move(use));
  player.play();

  player.print_summary();
  const ReflectorSurveyResult result = survey.solve();
  for (const auto& [reason, count] : survey.counters()) refused[reason] += count;
  for (const auto& [reason, count] : refused) {
    std::printf("odometry: %llu %s\n", static_cast<unsigned long long>(count), reason.c_str());
  }
  player.check_mapped(evidence.why_none());
  print_found(result);
  if (!result.reason.empty()) throw std::runtime_error(recording_name(options.bag.bags) + ": " + result.reason);
  save_reflector_map(options.out, result.map);
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, record_reflectors);
}
