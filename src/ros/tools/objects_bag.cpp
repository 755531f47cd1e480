// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to a map of objects, without a roscore: the same stages as the nodelets', as fast as possible.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/pipeline/hit_labels.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/unmapped_segments.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/pose/pose_offset.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/line_file.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/package.hpp"
#include "situation_awareness/ros/pose_offset_report.hpp"

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
The points' lines tell what became of each hit, in columns, and count the compact segments that are on no map:
  {"stamp": s, "compact": int, "on_no_map": int, "on_no_map_s": s, "x", "y": [numbers], "segment": [int or null],
   "fate": ["object", "refused", "structure" or "no segment"], "reason": [texts], "id": [int or null]}
with the id of the object on the map that the hit is on (docs/ros.md).
Invalid scans have no line and are counted by reason. Files are written atomically.
)";

struct Options {
  BagOptions bag;
  ScanTopics topics;
  std::string out, detections, points, load_objects, save_objects, detector, model_folder;
  std::optional<double> scan_pose_offset_s;
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  add_scan_options(app, options.topics);
  text("--out", options.out, "FILE", "output file of the map's lines");
  text("--detections", options.detections, "FILE", "output file of the detections' lines");
  text("--points", options.points, "FILE", "output file of the lines of what became of each hit");
  text("--load-objects", options.load_objects, "FILE", "start from this map (docs/map_file.md)");
  text("--save-objects", options.save_objects, "FILE", "output file of the map after the last scan");
  text("--detector", options.detector, "NAME", "in place of the configured one, with its own model");
  app.add_option("--scan-pose-offset", options.scan_pose_offset_s, "scan_pose_offset_s in place of the configured one")
      .type_name("S")
      .check(from_to(-1.0, 1.0));
  text("--model-folder", options.model_folder, "DIR", "folder of relative models (default: models/ of this package)");
  app.callback([&options] {
    std::vector<std::string> files;
    for (const std::string* file : {&options.out, &options.detections, &options.points, &options.save_objects}) {
      if (!file->empty()) files.push_back(*file);
    }
    const std::string outputs = "--out, --detections, --points or --save-objects";
    if (files.empty()) throw option_required(outputs);
    std::sort(files.begin(), files.end());
    const auto same = std::adjacent_find(files.begin(), files.end());
    if (same != files.end()) throw CommandLineError(*same + " is given for two of " + outputs);
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

/// What became of the hits of a scan.
Json json_of_points(const ObjectPipelineResult& result, const std::vector<HitLabel>& labels, MappedAreas& areas) {
  const Segments& segments = result.segments;
  areas.set(result.objects);
  Json line;
  line["compact"] = result.unmapped.compact;
  line["on_no_map"] = result.unmapped.on_no_map;
  line["on_no_map_s"] = finite(result.unmapped.for_s);
  for (const char* column : {"x", "y", "segment", "fate", "reason", "id"}) line[column] = Json::array();
  Json &x = line["x"], &y = line["y"], &segment = line["segment"];
  Json &fate = line["fate"], &reason = line["reason"], &id = line["id"];
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const HitLabel& label = labels[i];
    const Eigen::Vector2d p_world_m = segments.T_world_level * segments.points[i].p_level_m;
    const std::size_t object = areas.object_at(p_world_m);
    x.push_back(finite(p_world_m.x()));
    y.push_back(finite(p_world_m.y()));
    segment.push_back(label.segment == HitLabel::kNoSegmentIndex ? Json() : Json(label.segment));
    fate.push_back(name_of(label.fate));
    reason.push_back(hit_reasons()[label.reason]);
    id.push_back(object == MappedAreas::kNone ? Json() : Json(result.objects.objects[object].id));
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
  if (options.scan_pose_offset_s) params.scan_pose_offset_s = *options.scan_pose_offset_s;
  return params;
}

int objects_bag(const Options& options) {
  const std::string world_frame = tf2_frame(options.bag.world_frame);
  const ObjectPipelineParams params = load_params(options);
  BagPlayer player(options.bag, {{}, false, params.scan_pose_offset_s});
  LineFile out(options.out), detections_out(options.detections), points_out(options.points);
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
  pipeline.map().trust_stamps();  // the player has judged them
  player.on_restart([&] {
    pipeline.map().reset();
    published = {};
  });
  std::size_t detections = 0;
  double log_likelihood = 0.0;
  std::size_t compact = 0, on_no_map = 0;
  double longest_s = 0.0;
  PointStates states;
  std::vector<HitLabel> labels;
  MappedAreas areas;
  const auto use = [&](const Scan& scan, const auto& T_world_lidar, const auto& T_end) {
    const ObjectPipelineResult& result =
        player.timed([&]() -> decltype(auto) { return pipeline.process(scan, T_world_lidar, T_end, published); });
    states.add(result.points);
    if (points_out) {
      labels = label_hits(result.segments, result.detections, published, std::move(labels));
      points_out.write(json_line(scan.stamp_ns, json_of_points(result, labels, areas)));
    }
    publish(result.objects);
    if (out) out.write(json_line(scan.stamp_ns, json_of(result.objects)));
    if (detections_out) detections_out.write(json_line(scan.stamp_ns, json_of(result.detections)));
    detections += result.update.updated.size() + result.update.created.size();
    log_likelihood += result.update.log_likelihood;
    compact += static_cast<std::size_t>(result.unmapped.compact);
    on_no_map += static_cast<std::size_t>(result.unmapped.on_no_map);
    longest_s = result.unmapped.longest_s;
  };
  const auto check = subscribe_scans_or_clouds(player, options.topics, params.scan, params.cloud, use);
  player.play();
  player.print_summary();
  player.check_mapped(states.why_no_hit());

  if (!options.save_objects.empty()) {
    MapSnapshot snapshot = pipeline.map().snapshot();
    snapshot.world_frame = world_frame;
    save_map(options.save_objects, snapshot);
  }
  out.finish();
  detections_out.finish();
  points_out.finish();
  std::printf("%zu detections, log-likelihood %.3f each given the map before\n", detections,
              log_likelihood / static_cast<double>(std::max<std::size_t>(detections, 1)));
  std::printf("%zu of %zu compact segments on no map, a place for at most %.3f s\n", on_no_map, compact, longest_s);
  const PoseOffsetEstimator& pose_offset = check->pose_offset();
  const std::string advice = check->is_out_of_step() ? pose_offset_advice(pose_offset) : "";
  std::printf("scan_pose_offset_s: %s%s%s\n", pose_offset_text(pose_offset.estimate()).c_str(),
              advice.empty() ? "" : "; ", advice.c_str());
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, objects_bag);
}
