// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to one map of all that is around, without a roscore, as fast as possible.
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "situation_awareness/common/sha256.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/map/feature_json.hpp"
#include "situation_awareness/map/saved_map.hpp"
#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/path/vehicle.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/pipeline/localization_pipeline.hpp"
#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/images.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/line_file.hpp"
#include "situation_awareness/ros/bag/localization.hpp"
#include "situation_awareness/ros/bag/navigation.hpp"
#include "situation_awareness/ros/bag/odometry.hpp"
#include "situation_awareness/ros/bag/params_with_objects.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/inertial_navigation.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "map_bag";
constexpr const char* kConfig = "map.yaml";
constexpr const char* kConfigOutdoor = "map_outdoor.yaml";
constexpr const char* kDescription =
    R"(Reads laser scans, images and what the pose comes from out of a bag and writes one map of all that is around: one line
of JSON for each update, with what has changed:
  {"stamp": s, "map": UUID, "base", "version": int, "full": bool,
   "pose": {"x", "y", "yaw": number, "covariance": [9 numbers, row by row]},
   "changed": [FEATURE], "gone": [{"id": int, "reason": text, "into": int, if "merged"}]}
FEATURE: {"id": int, "kind": "ellipse", "box", "polyline", "boundary" or "target", "class": text,
   "p_class", "p_exists", "p_moving": number, "motion": "moving", "standing" or "fixed", "first_seen", "last_seen": s,
   "seen_by": [texts], "outline": [[x, y, bulge], ...], "closed": bool, "sigma_m": number, or one per vertex, "x", "y",
   and of an ellipse or box "psi", "rx", "ry", "vx", "vy", "wz", "covariance": [64 numbers, row by row], of a target
   "area_m2" and "z"}
in m, rad and s, in the world frame. An update changes the version `base` of a map into `version`; a full one, the first
and one each --full-every seconds, has all features. A bulge is tan(arc angle / 4) of the arc to the next point, and is
left out of straight outlines. The pose is that of the base, or of the scanner where no --base-frame is known. A bag that
begins anew makes another map. Invalid scans and images have no line and are counted by reason. Files are written
atomically.
)";

/// Of poses from /tf, which have no covariance: those of a good SLAM.
constexpr double kTfSigma_m = 0.02;
constexpr double kTfSigma_rad = 0.01;

struct Options {
  BagOptions bag;
  ScanTopics topics;
  std::string lidar_frame, pose = "tf", out, load_map, save_map;
  std::vector<std::string> kinds = {"objects", "polygons", "splinegons"};
  ReflectorOptions reflectors;
  NavigationOptions navigation;
  ImageOptions images;
  double full_every_s = 10.0;

  bool has(const std::string& kind) const { return std::find(kinds.begin(), kinds.end(), kind) != kinds.end(); }
  bool has_scans() const { return has("objects") || has("polygons") || has("splinegons"); }
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  text("--out", options.out, "FILE", "output file of the lines").required();
  text("--load-map", options.load_map, "FILE", "start from this map (docs/map_file.md)");
  text("--save-map", options.save_map, "FILE", "output file of the map after the last update");
  app.add_option("--kinds", options.kinds, "what is mapped; grid: the targets of a camera's images, with --dem")
      .type_name("KIND,...")
      .check(one_of({"objects", "polygons", "splinegons", "grid"}))
      .delimiter(',')
      .take_all();
  text("--pose", options.pose, "SOURCE", "tf, reflectors with odometry, or gps with an IMU")
      .check(one_of({"tf", "reflectors", "gps"}));
  add_scan_options(app, options.topics);
  text("--lidar-frame", options.lidar_frame, "FRAME", "of the scanner (default: that of its messages)");
  add_reflector_options(app, options.reflectors);
  add_navigation_options(app, options.navigation);
  add_image_options(app, options.images);
  add_dem_options(app, options.images.elevation);
  add_model_folder_option(app, options.images);
  app.add_option("--full-every", options.full_every_s, "time between lines with all features")
      .type_name("S")
      .check(in_range(0.0, 1e9));
  app.callback([&options] {
    check_reflector_options(options.reflectors, options.pose == "reflectors");
    check_origin(options.navigation);
    options.images.elevation.origin = options.navigation.origin;
    if (options.save_map == options.out) throw CommandLineError("--save-map and --out are the same file");
    if (options.has("grid") && options.images.elevation.dem.empty()) throw option_required("--dem");
    if (options.has("grid") && options.pose != "tf") {
      throw CommandLineError("images are mapped with --pose tf: their poses are those of /tf");
    }
    if (!options.topics.clouds.empty() && options.pose != "tf") {
      throw CommandLineError("clouds are mapped with --pose tf: scans alone have the other poses");
    }
  });
}

// --- lines ----------------------------------------------------------------------------------------------------------

/// The name of the n-th map of a recording: the same each time that it is played.
std::string uuid_of(std::int64_t first_stamp_ns, std::uint64_t n) {
  std::string digits = sha256("map " + std::to_string(first_stamp_ns) + " " + std::to_string(n)).substr(0, 32);
  digits[12] = '8';  // a UUID of a form of one's own (RFC 9562)
  digits[16] = '8';
  return digits.substr(0, 8) + "-" + digits.substr(8, 4) + "-" + digits.substr(12, 4) + "-" + digits.substr(16, 4) +
         "-" + digits.substr(20);
}

struct Pose {
  Pose2 T_world_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// What the program writes.
class Output {
 public:
  explicit Output(const Options& options) : full_every_s_(options.full_every_s), file_(options.out) {}

  void write(const MapDelta& update, const Pose& pose, const MapPipeline& pipeline) {
    if (!map_ || *map_ != update.map) {
      map_ = update.map;
      full_ns_.reset();
      name_ = uuid_of(update.stamp_ns, update.map);
    }
    const bool is_due = !full_ns_ || seconds_between(*full_ns_, update.stamp_ns) >= full_every_s_;
    // Updates while the pose was not known are not written.
    const bool is_full = update.full || is_due || update.base != version_;
    if (is_full) full_ns_ = update.stamp_ns;
    version_ = update.version;
    Json line;
    line["map"] = name_;
    line["base"] = update.base;
    line["version"] = update.version;
    line["full"] = is_full;
    const Pose2& T = pose.T_world_base;
    line["pose"] = {{"x", finite(T.translation_m.x())}, {"y", finite(T.translation_m.y())}, {"yaw", finite(T.yaw_rad)}};
    line["pose"]["covariance"] = list_of(9, [&](int i) { return pose.covariance(i / 3, i % 3); });
    Json& changed = line["changed"] = Json::array();
    if (is_full) all_ = pipeline.map(std::move(all_));
    for (const Feature& feature : is_full ? all_.features : update.changed) add_feature(changed, feature);
    Json& list = line["gone"] = Json::array();
    for (const Gone& gone : update.gone) {
      Json& element = add_object(list, 3);
      element["id"] = gone.id;
      element["reason"] = name_of(gone.reason);
      if (gone.into) element["into"] = *gone.into;
    }
    file_.write(json_line(update.stamp_ns, line));
  }
  void finish() { file_.finish(); }

 private:
  double full_every_s_;
  LineFile file_;
  std::optional<std::uint64_t> map_;     ///< number of the map of the latest line
  std::string name_;                     ///< of that map
  std::optional<std::int64_t> full_ns_;  ///< stamp of its latest full line
  std::uint64_t version_ = 0;            ///< of that line
  Map all_;
};

// --- from the bag to the map ----------------------------------------------------------------------------------------

/// The file may have the parameters of all kinds and sources of the pose, and of a vehicle that drives by the map; each
/// program uses its own.
struct BagParams {
  MapPipelineParams map;
  ReflectorDetectionParams reflectors;
  ReflectorLocalizationParams localization;
  GpsInsParams gps_ins;
  GridPipelineParams grid;
  VehicleParams vehicle;
  SafetyParams safety;
  PathFollowingParams path;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    MapPipelineParams::fields(self.map, visit);
    visit("reflectors", self.reflectors);
    visit("localization", self.localization);
    visit("gps_ins", self.gps_ins);
    visit("grid", self.grid);
    visit("vehicle", self.vehicle);
    visit("safety", self.safety);
    visit("path", self.path);
  }
};

struct Params {
  BagParams bag;
  ObjectPipelineParams objects;
};

/// Boundaries of large obstacles alone need no detail, and a pose by GPS has none to give.
std::string config_of(const Options& options) {
  const bool is_coarse = options.pose == "gps" || (options.has("splinegons") && !options.has("polygons"));
  return config_path(options.bag, is_coarse ? kConfigOutdoor : kConfig);
}

Params read_params(const Options& options) {
  Params params;
  params.bag = params_with_objects<BagParams>(config_of(options), options.images.model_folder, options.has("objects"),
                                              params.objects);
  return params;
}

/// The map of a run: that of a file at first, and in a file in the end.
class BagMap {
 public:
  BagMap(const Options& options, const Params& params)
      : options_(options),
        pipeline_(params.bag.map, params.objects,
                  {options.has("objects"), options.has("polygons"), options.has("splinegons")}) {
    if (!options.load_map.empty()) pipeline_.resume(load_features(options.load_map, options.bag.world_frame));
  }

  MapPipeline& pipeline() { return pipeline_; }

  void save() const {
    if (options_.save_map.empty()) return;
    SavedMap saved = pipeline_.saved();
    saved.world_frame = options_.bag.world_frame;
    save_features(options_.save_map, saved);
  }

 private:
  const Options& options_;
  MapPipeline pipeline_;
};

void map_by_tf(const Options& options, const Params& params) {
  const std::string base_frame = base_frame_by_tf(options.bag, options.reflectors.odometry);
  BagPlayer player(options.bag, {base_frame, false, params.objects.scan_pose_offset_s});
  Output out(options);
  BagMap map(options, params);
  MapPipeline& pipeline = map.pipeline();
  PointStates states;
  Pose pose;
  pose.covariance.diagonal() << kTfSigma_m * kTfSigma_m, kTfSigma_m * kTfSigma_m, kTfSigma_rad * kTfSigma_rad;
  player.on_restart([&pipeline] { pipeline.begin_anew(); });
  if (options.has_scans()) {
    subscribe_scans_or_clouds(
        player, options.topics, params.bag.map.layers.scan, params.objects.cloud,
        [&](const Scan& scan, const auto& T_world_lidar, const auto& T_end) {
          const MapDelta& update = player.timed(
              [&]() -> const MapDelta& { return pipeline.process(scan, T_world_lidar, T_end, pose.covariance); });
          states.add(pipeline.points());
          const bool has_base = !base_frame.empty();
          pose.T_world_base =
              pose2_of(has_base ? player.T_world_base_of_scan(scan.stamp_ns) : Eigen::Isometry3d(T_world_lidar));
          out.write(update, pose, pipeline);
        },
        options.lidar_frame);
  }
  std::optional<BagImages> images;
  if (options.has("grid")) {
    images.emplace(player, options.bag, options.images, params.bag.grid, [&](const GridTargets& targets) {
      if (!base_frame.empty()) pose.T_world_base = pose2_of(player.T_world_base_at(targets.stamp_ns));
      out.write(pipeline.take(targets), pose, pipeline);
    });
  }
  player.play();
  player.print_summary();
  if (images) images->print_summary(kName);
  if (images && options.has_scans()) images->warn_of_nothing(kName);
  player.check_mapped(options.has_scans() ? states.why_no_hit() : images->pipeline().why_nothing());
  out.finish();
  map.save();
}

void map_by_reflectors(const Options& options, const Params& params) {
  const OdometryFrames frames = odometry_frames(options.bag, options.reflectors.odometry);
  LocalizationPipeline localization(load_reflector_map(options.reflectors.reflectors), params.bag.reflectors,
                                    params.bag.localization);
  BagMap map(options, params);
  MapPipeline& pipeline = map.pipeline();
  BagPlayer player = player_by_odometry(options.bag, frames, params.objects.scan_pose_offset_s);
  Output out(options);
  PointStates states;
  player.on_restart([&pipeline] { pipeline.begin_anew(); });
  BagLocalization bag_localization(player, options.reflectors, frames, options.topics.scans, params.bag.map.layers.scan,
                                   localization, [&](const Scan& scan, const OdometryScan& placed) {
                                     const MapDelta* const update = player.timed([&]() -> const MapDelta* {
                                       const std::optional<PlacedScan> in_world = localization.place(scan, placed);
                                       if (!in_world) return nullptr;
                                       return &pipeline.process(scan, in_world->T_world_lidar,
                                                                in_world->T_world_lidar_end, in_world->covariance);
                                     });
                                     if (update == nullptr) return false;
                                     const LocalizedPose pose = localization.localization().pose();
                                     states.add(pipeline.points());
                                     out.write(*update, {pose.T_world_base.x, pose.covariance_world}, pipeline);
                                     return true;
                                   });
  player.play();
  player.print_summary();
  bag_localization.print_summary();
  const std::string why_unknown = bag_localization.why_unknown();
  player.check_mapped(why_unknown.empty() ? states.why_no_hit() : why_unknown);
  out.finish();
  map.save();
}

void map_by_gps(const Options& options, const Params& params) {
  const std::string base_frame =
      options.reflectors.odometry.frames.base.empty() ? "base_link" : options.reflectors.odometry.frames.base;
  BagPlayer player(with_backlog(options.bag), {base_frame, true, params.objects.scan_pose_offset_s});
  Output out(options);
  BagMap map(options, params);
  MapPipeline& pipeline = map.pipeline();
  player.on_restart([&pipeline] { pipeline.begin_anew(); });
  BagNavigation bag_navigation(kName, player, options.bag, options.navigation, base_frame, params.bag.gps_ins);
  PointStates states;
  const MapDelta* update = nullptr;
  bag_navigation.subscribe_scans(
      options.topics.scans, params.bag.map.layers.scan, options.lidar_frame,
      [&](const Scan& scan, const auto& T_odom_lidar, const auto& T_odom_lidar_end,
          const InertialPlacement& placement) -> const MapAlignment& {
        update = &pipeline.process(scan, T_odom_lidar, T_odom_lidar_end, placement);
        states.add(pipeline.points());
        return pipeline.layers().alignment();
      },
      [&](const Scan& /*scan*/, const WorldPose& pose) {
        out.write(*update, {pose2_of(pose.T_world_base), planar_covariance(pose)}, pipeline);
      });
  player.play();
  player.print_summary();
  bag_navigation.print_summary();
  player.check_mapped(bag_navigation.why_nothing(states.why_no_hit()));
  out.finish();
  map.save();
}

int map_bag(const Options& options) {
  const Params params = read_params(options);
  if (options.pose == "tf") {
    map_by_tf(options, params);
  } else if (options.pose == "reflectors") {
    map_by_reflectors(options, params);
  } else {
    map_by_gps(options, params);
  }
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, map_bag);
}
