// SPDX-License-Identifier: BSD-3-Clause
// Flies a robot through a simulated world, maps its scans and compares the map with the truth: the raw data of
// scripts/evaluate map.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/bodies.hpp"
#include "situation_awareness/evaluation/map_evaluation.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/scanner_presets.hpp"
#include "situation_awareness/sim/truth.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDescription =
    R"(Flies a world once per seed and writes the evaluation of its map as one line of JSON each, in m, rad (deg where the name
has it) and s. All times are on the clock of the flight, which starts at 0.
)";

struct Options {
  std::string world, config, models, set, scanner, trace;
  std::string seeds = "1";
  double duration_s = 60.0;
  double pose_sigma_m = 0.0, pose_sigma_rad = 0.0;
  SimulatedScannerParams lidar;
  bool trace_points = false;
};

struct Seeds {
  std::uint64_t first = 1, last = 1;
};

std::optional<Seeds> seeds_of(const std::string& text) {
  const std::size_t dash = text.find('-');
  const std::string last_text = dash == std::string::npos ? text : text.substr(dash + 1);
  const std::optional<std::uint64_t> first = whole_number(text.substr(0, dash));
  const std::optional<std::uint64_t> last = whole_number(last_text);
  if (!first || !last || *last < *first) return std::nullopt;
  return Seeds{*first, *last};
}

void add_options(CommandLine& app, Options& options) {
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  const auto number = [&app](const char* name, double& value, const char* what) {
    app.add_option(name, value, what).type_name("S").check(from_to(0.0, 1e6));
  };
  text("--world", options.world, "FILE", "the world (models/worlds/README.md)").required();
  text("--config", options.config, "FILE", "parameters of the map, such as cfg/objects.yaml").required();
  text("--models", options.models, "FOLDER", "where a relative model is looked for").required();
  text("--set", options.set, "FILE", "YAML whose keys override those of the configuration");
  text("--seeds", options.seeds, "A-B", "or one number").check(Check([](const std::string& seeds) {
    return seeds_of(seeds) ? "" : "needs a whole number, or two as A-B with A not above B, not " + seeds;
  }));
  number("--duration", options.duration_s, "length of a flight");
  number("--pose-sigma-m", options.pose_sigma_m, "white noise of the position given to the map, x and y each");
  number("--pose-sigma-rad", options.pose_sigma_rad, "the same of its yaw");
  text("--scanner", options.scanner, "NAME|FILE",
       "a preset in the folder scanners of --models, such as utm_30lx,\nor a YAML file; the next two have precedence");
  number("--range-sigma-m", options.lidar.range_sigma_m, "noise of the ranges");
  number("--sweep-s", options.lidar.sweep_s, "time from the first beam of a scan to the last;\n0: all at one instant");
  text("--trace", options.trace, "FILE", "one line of JSON per scan of the first seed");
  app.add_flag("--trace-points", options.trace_points, "in which the hits are, too");
  app.callback([&app, &options] {
    if (options.scanner.empty()) return;
    const SimulatedScannerParams given = options.lidar;
    options.lidar = load_scanner_preset(scanner_preset_file(options.scanner, options.models + "/scanners"));
    if (app.count("--range-sigma-m") > 0) options.lidar.range_sigma_m = given.range_sigma_m;
    if (app.count("--sweep-s") > 0) options.lidar.sweep_s = given.sweep_s;
  });
}

/// `base` with the keys of `over` put in their place, map by map.
YAML::Node merged(const YAML::Node& base, const YAML::Node& over) {
  if (!base.IsMap() || !over.IsMap()) return over;
  YAML::Node result = YAML::Clone(base);
  for (const auto& item : over) {
    const auto key = item.first.as<std::string>();
    const YAML::Node before = base[key];
    result[key] = before.IsDefined() ? merged(before, item.second) : item.second;
  }
  return result;
}

YAML::Node yaml_of(const std::string& path) try { return YAML::LoadFile(path); } catch (const YAML::Exception& error) {
  throw std::invalid_argument(path + ": " + error.what());
}

ObjectPipelineParams pipeline_params(const Options& options) {
  if (options.set.empty()) return load_object_pipeline_params(options.config, options.models);
  YAML::Node over = yaml_of(options.set);
  if (over.IsNull()) return load_object_pipeline_params(options.config, options.models);
  std::ostringstream text;
  text << merged(yaml_of(options.config), over);
  return parse_object_pipeline_params(text.str(), options.config + " with " + options.set, options.models);
}

/// An error of the map's pose input, constant over a scan.
class PoseNoise {
 public:
  PoseNoise(double sigma_m, double sigma_rad, std::uint64_t seed)
      : sigma_m_(sigma_m), sigma_rad_(sigma_rad), random_(seed) {}

  /// Draw the next scan's error.
  void next() {
    offset_m_.head<2>() << sigma_m_ * random_.normal(), sigma_m_ * random_.normal();
    yaw_rad_ = sigma_rad_ * random_.normal();
  }

  Eigen::Isometry3d operator()(const Eigen::Isometry3d& T_world_lidar) const {
    Eigen::Isometry3d noisy = T_world_lidar;
    noisy.linear() = Eigen::AngleAxisd(yaw_rad_, Eigen::Vector3d::UnitZ()) * T_world_lidar.linear();
    noisy.translation() += offset_m_;
    return noisy;
  }

 private:
  double sigma_m_, sigma_rad_;
  Random random_;
  Eigen::Vector3d offset_m_ = Eigen::Vector3d::Zero();
  double yaw_rad_ = 0.0;
};

double cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double yaw_of(const Eigen::Isometry3d& T) { return std::atan2(T(1, 0), T(0, 0)); }

/// The names of the bodies, by the id of the first part.
std::map<std::uint64_t, std::string> names_of(const std::vector<Body>& bodies, const Objects& truth) {
  std::map<std::uint64_t, std::string> names;
  for (const Body& body : bodies) names[truth.objects.at(body.parts.front()).id] = body.name;
  return names;
}

Json motion_json(const Object& object) {
  return {{"x", object.ellipse_world.center_m.x()}, {"y", object.ellipse_world.center_m.y()},
          {"psi", object.ellipse_world.psi_rad},    {"rx", object.ellipse_world.rx_m},
          {"ry", object.ellipse_world.ry_m},        {"vx", object.velocity_world_m_s.x()},
          {"vy", object.velocity_world_m_s.y()}};
}

/// To 0.1 mm: with all digits these would be most of the file.
Json points_json(const std::vector<Eigen::Vector2d>& points_m) {
  Json json = Json::array();
  for (const Eigen::Vector2d& p_m : points_m) {
    json.push_back({std::round(1e4 * p_m.x()) / 1e4, std::round(1e4 * p_m.y()) / 1e4});
  }
  return json;
}

/// Length and width along the thing's axes of what its parts cover.
Eigen::Vector2d extent_m(const TrueThing& thing, const std::vector<TrueObject>& objects) {
  const Pose2 T_thing_world = inverse(thing.T_world_thing);
  Eigen::AlignedBox2d box;
  for (const std::size_t part : thing.parts) {
    for (const Eigen::Vector2d& p_world_m : outline_of(objects[part])) box.extend(T_thing_world * p_world_m);
  }
  return box.sizes();
}

/// The things that are there at the stamp of the scan, with the places where its beams hit them within the truth's
/// range: without errors, and on a thing that moves the same spots of it at the stamp.
Json things_json(const World& world, const SimulatedScan& scan) {
  const double time_s = seconds_between(0, scan.scan.stamp_ns);
  const std::vector<TrueObject> objects = world.objects_at(time_s);
  std::vector<std::vector<Eigen::Vector2d>> hits_world_m(objects.size());
  for (const TrueHit& hit : scan.hits) {
    if (hit.object < 0 || hit.range_m > kTruthRange_m) continue;
    const auto object = static_cast<std::size_t>(hit.object);
    hits_world_m[object].push_back(objects[object].T_world_object * hit.p_object_m);
  }
  Json things = Json::array();
  for (const TrueThing& thing : world.things_at(time_s)) {
    if (!thing.is_there) continue;
    const Eigen::Vector2d size_m = extent_m(thing, objects);
    Json json = {{"name", thing.name},
                 {"kind", thing.kind},
                 {"x", thing.T_world_thing.translation_m.x()},
                 {"y", thing.T_world_thing.translation_m.y()},
                 {"yaw", thing.T_world_thing.yaw_rad},
                 {"length", size_m.x()},
                 {"width", size_m.y()},
                 {"vx", thing.velocity_world_m_s.x()},
                 {"vy", thing.velocity_world_m_s.y()},
                 {"wz", thing.angular_velocity_rad_s},
                 {"parts", Json::array()}};
    for (const std::size_t part : thing.parts) {
      json["parts"].push_back(
          {{"outline", points_json(outline_of(objects[part]))}, {"hits", points_json(hits_world_m[part])}});
    }
    things.push_back(std::move(json));
  }
  return things;
}

/// Writes truth and map, scan by scan.
class Trace {
 public:
  Trace(const std::string& path, bool with_points) : path_(path), with_points_(with_points), stream_(path) {
    if (!stream_) throw std::runtime_error(path_ + ": cannot be written");
  }

  void add(const World& world, const SimulatedScan& scan, const ObjectPipelineResult& result, const Objects& map,
           const ScanScore& score, int id_switches) {
    const Eigen::Vector3d robot = scan.robot.T_world_robot.translation();
    Json line = {{"t", seconds_between(0, scan.scan.stamp_ns)},
                 {"robot", {robot.x(), robot.y(), yaw_of(scan.robot.T_world_robot)}},
                 {"truth", Json::array()},
                 {"things", things_json(world, scan)},
                 {"map", Json::array()},
                 {"gospa_m", score.gospa_m},
                 {"missed", score.missed},
                 {"false", score.false_elements},
                 {"id_switches", id_switches}};
    for (std::size_t i = 0; i < scan.names.size(); ++i) {
      Json truth = {{"name", scan.names[i]}};
      truth.update(motion_json(scan.truth.objects[i]));
      truth["beams"] = scan.truth.objects[i].beams;
      line["truth"].push_back(std::move(truth));
    }
    for (const Object& object : map.objects) {
      Json element = {{"id", object.id}};
      element.update(motion_json(object));
      element["shape"] = name_of(object.shape);
      element["p_shape"] = object.p_shape;
      element["class"] = name_of(object.object_class);
      element["p_class"] = object.p_class;
      element["outline"] = points_json(outline_world(object));
      constexpr int k = object_error::kPosition;
      element["covariance_xy"] = {object.covariance(k, k), object.covariance(k, k + 1),
                                  object.covariance(k + 1, k + 1)};
      line["map"].push_back(std::move(element));
    }
    if (with_points_) {
      Json points = Json::array();
      for (const Point& point : result.points.points) {
        if (point.state != BeamState::kHit) continue;
        const Eigen::Vector2d p_world_m = result.points.T_world_level * point.p_level_m;
        points.push_back({p_world_m.x(), p_world_m.y()});
      }
      line["points"] = std::move(points);
    }
    stream_ << line.dump() << '\n';
  }

  void finish() {
    stream_.close();
    if (!stream_) throw std::runtime_error(path_ + ": cannot be written");
  }

 private:
  std::string path_;
  bool with_points_;
  std::ofstream stream_;
};

Json errors_json(const EllipseErrors& errors, const char* psi_name, double psi) {
  return {{"rx", errors.rx_m}, {"ry", errors.ry_m}, {"tx", errors.tx_m}, {"ty", errors.ty_m}, {psi_name, psi}};
}

Json class_json(const ClassScore& score) {
  return {{"center_rmse_m", score.center_rmse_m},
          {"velocity_rmse_m_s", score.velocity_rmse_m_s},
          {"semi_axis_mae_m", score.semi_axis_mae_m},
          {"scans", score.scans}};
}

Json hidden_json(const HiddenTime& hidden) {
  return {{"from_s", hidden.from_s},
          {"to_s", hidden.to_s},
          {"same_id", hidden.same_id ? Json(*hidden.same_id) : Json()},
          {"deleted", hidden.deleted_after_s.has_value()},
          {"deleted_after_s", hidden.deleted_after_s ? Json(*hidden.deleted_after_s) : Json()}};
}

Json object_json(const ObjectScore& object, const std::string& name) {
  const double degrees2 = degrees(1.0) * degrees(1.0);
  Json json = {{"name", name},
               {"moves", object.moves},
               {"visible_scans", object.visible_scans},
               {"mapped_scans", object.mapped_scans},
               {"id_switches", object.id_switches},
               {"max_delay_s", object.max_delay_s},
               {"mse", errors_json(object.mean_square, "psi_deg2", degrees2 * object.mean_square.psi_rad)},
               {"maae", errors_json(object.max_absolute, "psi_deg", degrees(object.max_absolute.psi_rad))},
               {"psi_sigma_deg", degrees(object.psi_sigma_rms_rad)},
               {"hidden", Json::array()}};
  for (const HiddenTime& hidden : object.hidden) json["hidden"].push_back(hidden_json(hidden));
  return json;
}

Json score_json(const MapScore& score, const std::map<std::uint64_t, std::string>& names) {
  Json json = {{"recall", score.recall},
               {"false_per_scan", score.false_per_scan},
               {"on_fixtures_per_scan", score.on_fixtures_per_scan},
               {"id_switches", score.id_switches},
               {"longest_false_s", score.longest_false_s},
               {"gospa_m", score.gospa_m},
               {"standing", class_json(score.standing)},
               {"moving", class_json(score.moving)},
               {"held_99",
                {{"position", score.held_99.position},
                 {"position_velocity", score.held_99.position_velocity},
                 {"radii", score.held_99.radii}}},
               {"objects", Json::array()},
               {"bodies", Json::array()}};
  for (const ObjectScore& object : score.objects) {
    json["objects"].push_back(object_json(object, names.at(object.truth_id)));
  }
  for (const BodyScore& body : score.bodies) {
    json["bodies"].push_back({{"name", body.name}, {"scans_apart", body.scans_apart}, {"scans_one", body.scans_one}});
  }
  return json;
}

/// Quantile of sorted numbers.
double quantile(const std::vector<double>& sorted, double part) {
  return sorted.empty() ? 0.0 : sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1) + 0.5)];
}

Json fly(const Options& options, const ObjectPipelineParams& params, std::uint64_t seed, Trace* trace) {
  constexpr std::uint64_t kPoseStream = 0x706F7365;  // so that the pose's noise is not that of the ranges
  ScanSimulation world(options.world, options.lidar, seed);
  ObjectPipeline pipeline(params);
  PoseNoise pose_noise(options.pose_sigma_m, options.pose_sigma_rad, seed ^ (kPoseStream << 32));
  std::optional<MapEvaluation> evaluation;
  std::vector<Body> bodies;
  std::map<std::uint64_t, std::string> names;

  const auto scans = static_cast<int>(std::lround(options.duration_s * options.lidar.rate_hz));
  std::vector<double> latencies_ms;
  double cpu_sum_ms = 0.0;
  double log_likelihood = 0.0;
  std::size_t detections = 0;
  int on_no_map = 0;
  double longest_on_no_map_s = 0.0;
  for (int i = 0; i < scans; ++i) {
    const SimulatedScan scan = world.next();
    if (!evaluation) {
      bodies = bodies_of(scan.names);
      names = names_of(bodies, scan.truth);
      evaluation.emplace(MapEvaluationParams{}, bodies, world.world().fixtures());
    }
    pose_noise.next();
    const Eigen::Isometry3d T_world_lidar = pose_noise(scan.T_world_lidar);
    const Eigen::Isometry3d T_world_lidar_end = pose_noise(scan.T_world_lidar_end);

    const double cpu_before_ms = cpu_ms();
    const auto before = std::chrono::steady_clock::now();
    const ObjectPipelineResult& result = pipeline.process(scan.scan, T_world_lidar, T_world_lidar_end);
    const std::chrono::duration<double, std::milli> latency = std::chrono::steady_clock::now() - before;
    cpu_sum_ms += cpu_ms() - cpu_before_ms;
    latencies_ms.push_back(latency.count());
    log_likelihood += result.update.log_likelihood;
    detections += result.update.updated.size() + result.update.created.size();

    const Objects& map = result.objects;
    on_no_map += result.unmapped.on_no_map;
    longest_on_no_map_s = result.unmapped.longest_s;
    std::vector<int> parts;
    for (const Body& body : bodies) {
      parts.push_back(separate_parts(body, result.segments, scan.object_of_beam, params.segments.min_points));
    }
    const ScanScore score = evaluation->add(scan.truth, map, parts);
    if (trace != nullptr) trace->add(world.world(), scan, result, map, score, evaluation->id_switches());
  }

  std::sort(latencies_ms.begin(), latencies_ms.end());
  Json json = {{"world", std::filesystem::path(options.world).filename().string()},
               {"seed", seed},
               {"scans", scans},
               {"log_likelihood", log_likelihood / static_cast<double>(std::max<std::size_t>(detections, 1))},
               {"on_no_map_per_scan", static_cast<double>(on_no_map) / std::max(scans, 1)},
               {"longest_on_no_map_s", longest_on_no_map_s},
               {"cpu_ms_per_scan", cpu_sum_ms / std::max(scans, 1)},
               {"latency_ms", {{"p50", quantile(latencies_ms, 0.5)}, {"p95", quantile(latencies_ms, 0.95)}}}};
  json.update(score_json(evaluation ? evaluation->score() : MapScore{}, names));
  return json;
}

void fly_all(const Options& options) {
  const ObjectPipelineParams params = pipeline_params(options);
  std::optional<Trace> trace;
  if (!options.trace.empty()) trace.emplace(options.trace, options.trace_points);
  const Seeds seeds = seeds_of(options.seeds).value();
  for (std::uint64_t seed = seeds.first; seed <= seeds.last; ++seed) {
    const bool is_traced = trace && seed == seeds.first;
    const std::string line = fly(options, params, seed, is_traced ? &*trace : nullptr).dump();
    if (is_traced) trace->finish();
    std::printf("%s\n", line.c_str());
    if (std::fflush(stdout) != 0) throw std::runtime_error("the standard output cannot be written");
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("map_flights", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    fly_all(options);
    return 0;
  });
}
