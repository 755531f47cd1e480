// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to a map of objects, without a roscore: the same stages as the nodelets', as fast as possible.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>

#include "command_line.hpp"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/bag/atomic_file.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "objects_bag";
constexpr const char* kConfig = "objects.yaml";
constexpr const char* kDescription =
    R"(Reads laser scans and transforms from a bag and writes the map after each scan as one line of JSON:
  {"stamp": s, "objects": [{"id": int, "x", "y", "psi", "rx", "ry", "vx", "vy", "wz": number,
   "sigma": [8 standard deviations, order x y vx vy psi wz rx ry], "beams": int,
   "shape": "ellipse", "box" or "compact", "p_shape": number,
   "class": "unknown", "person", "vehicle" or "pole", "p_class": number, "outline": [[x, y], ...]}]}
in m, rad and s, in the world frame: x to ry are the ellipse that stands for the object, whatever its shape, and the
outline is counter-clockwise, the corners of a box or points on the ellipse; or the detections of each scan:
  {"stamp": s, "detections": [{"x", "y", "psi", "rx", "ry": number,
   "covariance": [25 numbers, row by row, of x y m p q], "p_ellipse": number, "beams": int}]}
in the sensor's level frame, with m = (rx + ry) / 2 and (p, q) = (rx - ry) / 2 (cos 2 psi, sin 2 psi).
Invalid scans have no line and are counted by reason. Files are written atomically.
)";

struct Options {
  BagOptions bag;
  std::string scan_topic = "/scan";
  std::string out, detections, load_objects, save_objects, detector, model_folder;
};

void add_options(CLI::App& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    app.add_option(name, value, what)->type_name(type);
  };
  text("--scan-topic", options.scan_topic, "TOPIC", "sensor_msgs/LaserScan");
  text("--out", options.out, "FILE", "output file of the map's lines");
  text("--detections", options.detections, "FILE", "output file of the detections' lines");
  text("--load-objects", options.load_objects, "FILE", "start from this map (docs/map_file.md)");
  text("--save-objects", options.save_objects, "FILE", "output file of the map after the last scan");
  text("--detector", options.detector, "NAME", "in place of the configured one, with its own model");
  text("--model-folder", options.model_folder, "DIR", "folder of relative models (default: models/ of this package)");
  app.callback([&options] {
    if (options.out.empty() && options.detections.empty() && options.save_objects.empty()) {
      throw CLI::RequiredError("--out, --detections or --save-objects");
    }
    if (!options.out.empty() && options.out == options.detections) {
      throw CLI::ValidationError("--out and --detections are the same file");
    }
  });
}

// Members are assigned one by one: a list of them in braces is an array of arrays before it is an object, and slow.

Json json_of(const Detections& detections) {
  Json line;
  Json& list = line["detections"] = Json::array();
  for (const Detection& detection : detections.detections) {
    const Ellipse& ellipse = detection.ellipse_level;
    Json& element = add_object(list, 8);
    element["x"] = finite(ellipse.center_m.x());
    element["y"] = finite(ellipse.center_m.y());
    element["psi"] = finite(ellipse.psi_rad);
    element["rx"] = finite(ellipse.rx_m);
    element["ry"] = finite(ellipse.ry_m);
    element["covariance"] = list_of(25, [&](int i) { return detection.covariance(i / 5, i % 5); });
    element["p_ellipse"] = finite(detection.p_ellipse);
    element["beams"] = detection.beams;
  }
  return line;
}

Json json_of(const Objects& objects) {
  Json line;
  Json& list = line["objects"] = Json::array();
  for (const Object& object : objects.objects) {
    const Ellipse& ellipse = object.ellipse_world;
    Json& element = add_object(list, 16);
    element["id"] = object.id;
    element["x"] = finite(ellipse.center_m.x());
    element["y"] = finite(ellipse.center_m.y());
    element["psi"] = finite(ellipse.psi_rad);
    element["rx"] = finite(ellipse.rx_m);
    element["ry"] = finite(ellipse.ry_m);
    element["vx"] = finite(object.velocity_world_m_s.x());
    element["vy"] = finite(object.velocity_world_m_s.y());
    element["wz"] = finite(object.angular_velocity_rad_s);
    element["sigma"] = list_of(8, [&](int i) { return std::sqrt(std::max(object.covariance(i, i), 0.0)); });
    element["beams"] = object.beams;
    element["shape"] = name_of(object.shape);
    element["p_shape"] = finite(object.p_shape);
    element["class"] = name_of(object.object_class);
    element["p_class"] = finite(object.p_class);
    Json& outline = element["outline"] = Json::array();
    for (const Eigen::Vector2d& p_world_m : outline_world(object)) {
      outline.push_back(list_of(2, [&](int i) { return p_world_m(i); }));
    }
  }
  return line;
}

ObjectPipelineParams load_params(const Options& options) {
  const std::string folder = options.model_folder.empty() ? package_folder() + "/models" : options.model_folder;
  ObjectPipelineParams params = load_object_pipeline_params(config_path(options.bag, kConfig), folder);
  if (!options.detector.empty()) {
    params.detections.detector = options.detector;
    params.detections.model.clear();
  }
  return params;
}

int objects_bag(const Options& options) {
  const std::string world_frame = tf2_frame(options.bag.world_frame);
  const ObjectPipelineParams params = load_params(options);
  BagPlayer player(options.bag, params.objects.reset_time_jump_s);
  LineFile out(options.out), detections_out(options.detections);
  ObjectPipeline pipeline(params);

  // Segmentation and detection use the published map: the message has angles as quaternions, which changes their last
  // digit.
  Objects published;
  const auto publish = [&](const Objects& objects) {
    published = objects_from_msg(objects_to_msg(objects, world_frame));
  };
  if (!options.load_objects.empty()) {
    pipeline.map().resume(load_map(options.load_objects, world_frame));
    publish(pipeline.map().at(pipeline.map().stamp_ns()));
  }
  std::size_t detections = 0;
  double log_likelihood = 0.0;
  Objects objects;
  subscribe_scans(player, options.scan_topic, [&](const Scan& scan, const auto& T_world_lidar, const auto& T_end) {
    const ObjectPipelineResult& result =
        player.timed([&]() -> decltype(auto) { return pipeline.process(scan, T_world_lidar, T_end, published); });
    objects = pipeline.map().at(scan.stamp_ns, std::move(objects));
    publish(objects);
    if (out) out.write(json_line(scan.stamp_ns, json_of(objects)));
    if (detections_out) detections_out.write(json_line(scan.stamp_ns, json_of(result.detections)));
    detections += result.update.updated.size() + result.update.created.size();
    log_likelihood += result.update.log_likelihood;
  });
  player.play();

  if (!options.save_objects.empty()) {
    MapSnapshot snapshot = pipeline.map().snapshot();
    snapshot.world_frame = world_frame;
    save_map(options.save_objects, snapshot);
  }
  out.finish();
  detections_out.finish();
  player.print_summary();
  std::printf("%zu detections, log-likelihood %.3f each given the map before\n", detections,
              log_likelihood / static_cast<double>(std::max<std::size_t>(detections, 1)));
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app(kName, kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] { return objects_bag(options); });
}
