// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to the boundaries of large obstacles, without a roscore, as fast as possible.
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>

#include "command_line.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/line_file.hpp"
#include "situation_awareness/ros/bag/navigation.hpp"
#include "situation_awareness/ros/bag/params_with_objects.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/inertial_navigation.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "splinegons_bag";
constexpr const char* kConfig = "splinegons.yaml";
constexpr const char* kDescription =
    R"(Reads laser scans, an IMU, fixes of a GPS receiver and transforms from a bag and writes pose and boundaries of large
obstacles after each scan as one line of JSON:
  {"stamp": s, "pose": {"x", "y", "z", "roll", "pitch", "yaw": number, "covariance": [36 numbers, row by row]},
   "boundaries": [{"id": int, "closed": bool, "vertices": [[x, y, bulge], ...], "sigma_m": [one per vertex]}]}
in m, rad and s, in the local east, north and up of the origin. The pose is that of the base at the stamp, its covariance
that of x, y, z and of the attitude's error in the base. Boundaries run counter-clockwise around the obstacle; a vertex's
bulge is tan(arc angle / 4) of the arc to the next one. Invalid scans have no line and are counted by reason. Files are
written atomically.
)";

/// Of poses from /tf, which have no covariance.
constexpr double kTfSigma_m = 0.01;
constexpr double kTfSigma_rad = 0.002;

struct Options {
  BagOptions bag;
  ScanTopics topics;
  NavigationOptions navigation;
  std::string localization = "gps", lidar_frame, base_frame = "base_link", out;
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  add_scan_options(app, options.topics);
  add_navigation_options(app, options.navigation);
  text("--lidar-frame", options.lidar_frame, "FRAME", "of the scanner (default: that of its messages)");
  text("--base-frame", options.base_frame, "FRAME", "whose pose is estimated");
  text("--localization", options.localization, "KIND", "gps, with the IMU, or tf: the pose in the world is that of /tf")
      .check(one_of({"gps", "tf"}));
  text("--out", options.out, "FILE", "output file of the lines").required();
  app.callback([&options] {
    check_origin(options.navigation);
    if (!options.topics.clouds.empty() && options.localization != "tf") {
      throw CommandLineError("clouds are mapped with --localization tf: scans alone have the pose by GPS");
    }
  });
}

/// R = Rz(yaw) Ry(pitch) Rx(roll).
Json json_of(const WorldPose& known, const Splinegons& splinegons) {
  const Eigen::Isometry3d& T_world_base = known.T_world_base;
  Json line;
  Json& pose = line["pose"] = Json::object();
  const Eigen::Matrix3d& R = T_world_base.linear();
  pose["x"] = finite(T_world_base.translation().x());
  pose["y"] = finite(T_world_base.translation().y());
  pose["z"] = finite(T_world_base.translation().z());
  pose["roll"] = finite(std::atan2(R(2, 1), R(2, 2)));
  pose["pitch"] = finite(std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2))));
  pose["yaw"] = finite(std::atan2(R(1, 0), R(0, 0)));
  pose["covariance"] = list_of(36, [&](int i) { return known.covariance(i / 6, i % 6); });
  Json& list = line["boundaries"] = Json::array();
  for (const Splinegon& splinegon : splinegons.boundaries) {
    Json& element = add_object(list, 4);
    element["id"] = splinegon.id;
    element["closed"] = splinegon.closed;
    Json& vertices = element["vertices"] = Json::array();
    Json& sigma = element["sigma_m"] = Json::array();
    for (const SplinegonVertex& vertex : splinegon.vertices) {
      vertices.push_back(list_of(3, [&](int i) { return i < 2 ? vertex.p_world_m(i) : vertex.bulge; }));
      sigma.push_back(finite(vertex.sigma_m));
    }
  }
  return line;
}

struct BagParams {
  SplinegonPipelineParams pipeline;
  GpsInsParams gps_ins;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    SplinegonPipelineParams::fields(self.pipeline, visit);
    visit("gps_ins", self.gps_ins);
  }
};

struct Params {
  BagParams bag;
  ObjectPipelineParams objects;
};

void map_by_tf(const Options& options, const Params& params) {
  BagPlayer player(options.bag, {options.base_frame, false, params.objects.scan_pose_offset_s});
  LineFile out(options.out);
  SplinegonPipeline pipeline(params.bag.pipeline);
  player.on_restart([&pipeline] { pipeline.reset(); });
  PointStates states;
  WorldPose pose;
  pose.covariance.diagonal().head<3>().setConstant(kTfSigma_m * kTfSigma_m);
  pose.covariance.diagonal().tail<3>().setConstant(kTfSigma_rad * kTfSigma_rad);
  // Of x, y and yaw: that of the attitude is the same about all axes. As live, to the last digit.
  const Eigen::Matrix3d planar =
      Eigen::Vector3d(kTfSigma_m * kTfSigma_m, kTfSigma_m * kTfSigma_m, kTfSigma_rad * kTfSigma_rad).asDiagonal();
  subscribe_scans_or_clouds(
      player, options.topics, params.bag.pipeline.scan, params.objects.cloud,
      [&](const Scan& scan, const auto& T_world_lidar, const auto& T_world_lidar_end) {
        pose.T_world_base = player.T_world_base_of_scan(scan.stamp_ns);
        player.timed([&] { pipeline.process(scan, T_world_lidar, T_world_lidar_end, planar); });
        states.add(pipeline.points());
        out.write(json_line(scan.stamp_ns, json_of(pose, pipeline.splinegons())));
      },
      options.lidar_frame);
  player.play();
  player.print_summary();
  player.check_mapped(states.why_no_hit());
  out.finish();
}

void map_by_gps(const Options& options, const Params& params) {
  BagPlayer player(with_backlog(options.bag), {options.base_frame, true, params.objects.scan_pose_offset_s});
  LineFile out(options.out);
  SplinegonPipeline pipeline(params.bag.pipeline);
  player.on_restart([&pipeline] { pipeline.reset(); });
  BagNavigation bag_navigation(kName, player, options.bag, options.navigation, options.base_frame, params.bag.gps_ins);
  PointStates states;
  bag_navigation.subscribe_scans(
      options.topics.scans, params.bag.pipeline.scan, options.lidar_frame,
      [&](const Scan& scan, const auto& T_odom_lidar, const auto& T_odom_lidar_end,
          const InertialPlacement& placement) -> const MapAlignment& {
        pipeline.process(scan, T_odom_lidar, T_odom_lidar_end, placement);
        states.add(pipeline.points());
        return pipeline.alignment();
      },
      [&](const Scan& scan, const WorldPose& pose) {
        out.write(json_line(scan.stamp_ns, json_of(pose, pipeline.splinegons())));
      });
  player.play();
  player.print_summary();
  bag_navigation.print_summary();
  player.check_mapped(bag_navigation.why_nothing(states.why_no_hit()));
  out.finish();
}

int splinegons_bag(const Options& options) {
  const std::string path = config_path(options.bag, kConfig);
  Params params;
  params.bag = params_with_objects<BagParams>(path, "", false, params.objects);
  if (options.localization == "tf") {
    map_by_tf(options, params);
  } else {
    map_by_gps(options, params);
  }
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, splinegons_bag);
}
