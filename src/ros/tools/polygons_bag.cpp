// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to a map of polygons, without a roscore: the same stages as the nodelets', as fast as possible.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/parse_pose2.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/line_file.hpp"
#include "situation_awareness/ros/bag/localization.hpp"
#include "situation_awareness/ros/bag/odometry.hpp"
#include "situation_awareness/ros/bag/params_with_objects.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "polygons_bag";
constexpr const char* kConfig = "polygons.yaml";
constexpr const char* kDescription =
    R"(Reads laser scans, odometry and transforms from a bag and writes pose and map after each scan as one line of JSON:
  {"stamp": s, "pose": {"x", "y", "yaw": number, "covariance": [9 numbers, row by row]},
   "polylines": [{"id": int, "closed": bool, "points": [[x, y], ...], "sigma_m": [one per point],
    "first_seen", "last_seen": s, "p": number}]}
in m, rad and s, in the world frame: the pose is that of the odometry's child frame at the stamp, the polylines are all
standing things, walls included. With --changes a line has what the scan changed instead, so that lines do not grow with
the map: "changed": those of the polylines that are new or not as they were, and "gone": the ids of those that are not
there any more; the first line and one each --full-every seconds have all "polylines", too. Numbers of polylines are
then to 1e-6, as most of those in view change a little with each scan. Invalid scans have no line and are counted by
reason. Files are written atomically.
)";

/// Of poses from /tf, which have no covariance: those of a good SLAM.
constexpr double kTfSigma_m = 0.02;
constexpr double kTfSigma_rad = 0.01;

struct Options {
  BagOptions bag;
  ScanTopics topics;
  ReflectorOptions reflectors;
  std::string localization = "reflectors";
  std::string out, model_folder;
  bool objects = false;
  bool changes = false;
  double full_every_s = 10.0;
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  add_scan_options(app, options.topics);
  add_reflector_options(app, options.reflectors);
  text("--localization", options.localization, "KIND", "reflectors, or tf: the pose in the world is that of /tf")
      .check(one_of({"reflectors", "tf"}));
  text("--out", options.out, "FILE", "output file of the lines").required();
  app.add_flag("--objects", options.objects, "map what moves, too, and keep it off the polygons");
  const CommandLineOption changes =
      app.add_flag("--changes", options.changes, "write what each scan changed, not all polylines");
  app.add_option("--full-every", options.full_every_s, "time between lines with all polylines")
      .type_name("S")
      .check(in_range(0.0, 1e9))
      .needs(changes);
  text("--model-folder", options.model_folder, "DIR", "folder of relative models (default: models/ of this package)");
  app.callback([&options] {
    check_reflector_options(options.reflectors, options.localization == "reflectors");
    if (!options.topics.clouds.empty() && options.localization != "tf") {
      throw CommandLineError("clouds are mapped with --localization tf: reflectors are seen in scans");
    }
  });
}

/// A polyline's numbers are written as they are, or rounded to six decimals.
enum class Digits { kAll, kSix };

void add_polyline(Json& list, const Chain& chain, Digits digits) {
  const auto number = [digits](double value) { return digits == Digits::kAll ? value : std::round(1e6 * value) / 1e6; };
  Json& element = add_object(list, 7);
  element["id"] = chain.id;
  element["closed"] = chain.closed;
  Json& points = element["points"] = Json::array();
  Json& sigma = element["sigma_m"] = Json::array();
  for (const ChainVertex& vertex : chain.vertices) {
    points.push_back(list_of(2, [&](int i) { return number(vertex.p_world_m(i)); }));
    sigma.push_back(finite(number(vertex.sigma_m)));
  }
  element["first_seen"] = number(1e-9 * static_cast<double>(chain.first_seen_ns));
  element["last_seen"] = number(1e-9 * static_cast<double>(chain.last_seen_ns));
  element["p"] = finite(number(chain.p_exists));
}

/// What the program writes and counts.
class Output {
 public:
  explicit Output(const Options& options) : options_(options), file_(options.out) {}

  void write(const Scan& scan, const Pose2& T_world_base, const Eigen::Matrix3d& covariance,
             PolygonPipeline& pipeline) {
    states_.add(pipeline.points());
    Json line;
    Json& pose = line["pose"] = Json::object();
    pose["x"] = finite(T_world_base.translation_m.x());
    pose["y"] = finite(T_world_base.translation_m.y());
    pose["yaw"] = finite(std::remainder(T_world_base.yaw_rad, 2.0 * M_PI));
    pose["covariance"] = list_of(9, [&](int i) { return covariance(i / 3, i % 3); });
    PolygonMap& map = pipeline.map();
    const Digits digits = options_.changes ? Digits::kSix : Digits::kAll;
    const ChainChanges& changes = map.update_due_chains();
    if (options_.changes) {
      Json& changed = line["changed"] = Json::array();
      for (const std::uint64_t id : changes.changed) add_polyline(changed, *map.chain(id), digits);
      line["gone"] = changes.gone;
    }
    if (!options_.changes || is_full_due(scan.stamp_ns)) {
      polygons_ = map.latest_polygons(std::move(polygons_));
      Json& list = line["polylines"] = Json::array();
      for (const Chain& chain : polygons_.chains) add_polyline(list, chain, digits);
    }
    file_.write(json_line(scan.stamp_ns, line));
  }
  void finish() { file_.finish(); }
  const PointStates& states() const { return states_; }

 private:
  /// Also where a recording begins anew at an earlier time.
  bool is_full_due(std::int64_t stamp_ns) {
    const bool is_due =
        !full_ns_ || stamp_ns < *full_ns_ || seconds_between(*full_ns_, stamp_ns) >= options_.full_every_s;
    if (is_due) full_ns_ = stamp_ns;
    return is_due;
  }

  const Options& options_;
  LineFile file_;
  std::optional<std::int64_t> full_ns_;  ///< stamp of the latest line with all polylines
  Polygons polygons_;
  PointStates states_;
};

struct Params {
  PolygonPipelineParams polygons;
  std::optional<ObjectPipelineParams> objects;
  CloudSliceParams cloud;
  double scan_pose_offset_s = 0.0;
};

Params read_params(const Options& options) {
  Params params;
  ObjectPipelineParams objects;
  params.polygons = params_with_objects<PolygonPipelineParams>(config_path(options.bag, kConfig), options.model_folder,
                                                               options.objects, objects);
  params.cloud = objects.cloud;
  params.scan_pose_offset_s = objects.scan_pose_offset_s;
  if (options.objects) params.objects = objects;
  return params;
}

/// What the map of objects made of the drive.
void print_movers(const PolygonPipeline& pipeline) {
  if (pipeline.objects() == nullptr) return;
  std::printf("objects: %zu set off\n", pipeline.movers().set_off());
}

void map_by_tf(const Options& options, const Params& params) {
  const std::string base_frame = base_frame_by_tf(options.bag, options.reflectors.odometry);
  BagPlayer player(options.bag, {base_frame, false, params.scan_pose_offset_s});
  Output out(options);
  PolygonPipeline pipeline(params.polygons, params.objects);
  const Eigen::Matrix3d covariance =
      Eigen::Vector3d(kTfSigma_m * kTfSigma_m, kTfSigma_m * kTfSigma_m, kTfSigma_rad * kTfSigma_rad).asDiagonal();
  player.on_restart([&pipeline] { pipeline.begin_anew(); });
  const auto use = [&](const Scan& scan, const auto& T_world_lidar, const auto& T_end) {
    player.timed([&] { pipeline.process(scan, T_world_lidar, T_end, covariance); });
    const Eigen::Isometry3d T_world_base =
        base_frame.empty() ? Eigen::Isometry3d(T_world_lidar) : player.T_world_base_of_scan(scan.stamp_ns);
    out.write(scan, pose2_of(T_world_base), covariance, pipeline);
  };
  subscribe_scans_or_clouds(player, options.topics, params.polygons.scan, params.cloud, use);
  player.play();
  player.print_summary();
  print_movers(pipeline);
  player.check_mapped(out.states().why_no_hit());
  out.finish();
}

void map_by_reflectors(const Options& options, const Params& params) {
  const OdometryFrames frames = odometry_frames(options.bag, options.reflectors.odometry);
  ReflectorPolygonPipeline pipeline(load_reflector_map(options.reflectors.reflectors), params.polygons, params.objects);
  BagPlayer player = player_by_odometry(options.bag, frames, params.scan_pose_offset_s);
  Output out(options);
  player.on_restart([&pipeline] { pipeline.pipeline().begin_anew(); });
  BagLocalization localization(player, options.reflectors, frames, options.topics.scans, params.polygons.scan,
                               pipeline.localization_pipeline(), [&](const Scan& scan, const OdometryScan& placed) {
                                 if (!player.timed([&] { return pipeline.process(scan, placed); })) return false;
                                 const LocalizedPose pose = pipeline.localization().pose();
                                 out.write(scan, pose.T_world_base.x, pose.covariance_world, pipeline.pipeline());
                                 return true;
                               });
  player.play();
  player.print_summary();
  print_movers(pipeline.pipeline());
  localization.print_summary();
  const std::string why_unknown = localization.why_unknown();
  player.check_mapped(why_unknown.empty() ? out.states().why_no_hit() : why_unknown);
  out.finish();
}

int polygons_bag(const Options& options) {
  const Params params = read_params(options);
  if (options.localization == "tf") {
    map_by_tf(options, params);
  } else {
    map_by_reflectors(options, params);
  }
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, polygons_bag);
}
