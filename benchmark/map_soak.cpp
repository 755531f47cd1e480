// SPDX-License-Identifier: BSD-3-Clause
// A day of data through a map of one kind, which never begins anew: the raw data of scripts/evaluate soak.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "measures.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDescription =
    R"(Maps many hours of data as fast as possible, in a scene that stays as it is but for what moves. Writes a line of JSON
per block: memory in use at its end, thread CPU time per scan or image, and what is on the map.
)";

struct Options {
  std::string kind, config, models;
  double hours = 24.0, block_s = 600.0;
  std::uint64_t seed = 1;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("--kind", options.kind, "of the map")
      .required()
      .check(one_of({"objects", "polygons", "splinegons", "grid"}));
  app.add_option("--config", options.config, "parameters of the map, such as cfg/objects.yaml")
      .required()
      .type_name("FILE");
  app.add_option("--models", options.models, "where a relative model is looked for").required().type_name("FOLDER");
  app.add_option("--hours", options.hours, "of data").type_name("H").check(from_to(0.001, 10000.0));
  app.add_option("--block-s", options.block_s, "of data in a block").type_name("S").check(from_to(2.0, 3600.0));
  app.add_option("--seed", options.seed, "of noise").type_name("N").check(from_to(0.0, 1e9));
}

// --- scenes

/// Walls as segments, and discs that go around in circles.
struct Walls {
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> segments;
  struct Disc {
    Eigen::Vector2d middle_m;
    double way_m, radius_m, period_s;
  };
  std::vector<Disc> discs;

  void add_box(const Eigen::Vector2d& middle_m, const Eigen::Vector2d& half_m) {
    const std::vector<Eigen::Vector2d> corners = {
        middle_m + Eigen::Vector2d(half_m.x(), half_m.y()), middle_m + Eigen::Vector2d(-half_m.x(), half_m.y()),
        middle_m + Eigen::Vector2d(-half_m.x(), -half_m.y()), middle_m + Eigen::Vector2d(half_m.x(), -half_m.y())};
    for (std::size_t i = 0; i < 4; ++i) segments.emplace_back(corners[i], corners[(i + 1) % 4]);
  }

  /// Infinite where nothing is.
  double range_m(const Eigen::Vector2d& origin_m, const Eigen::Vector2d& direction, double time_s) const {
    double range_m = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : segments) {
      const Eigen::Vector2d way = b - a, to = a - origin_m;
      const double det = direction.x() * way.y() - direction.y() * way.x();
      if (std::abs(det) < 1e-12) continue;
      const double along_m = (to.x() * way.y() - to.y() * way.x()) / det;
      const double part = (to.x() * direction.y() - to.y() * direction.x()) / det;
      if (along_m > 0.0 && part >= 0.0 && part <= 1.0) range_m = std::min(range_m, along_m);
    }
    for (const Disc& disc : discs) {
      const double angle = 2.0 * kPi * time_s / disc.period_s;
      const Eigen::Vector2d to =
          disc.middle_m + disc.way_m * Eigen::Vector2d(std::cos(angle), std::sin(angle)) - origin_m;
      const double along_m = direction.dot(to),
                   half2_m2 = disc.radius_m * disc.radius_m - (to.squaredNorm() - along_m * along_m);
      if (half2_m2 > 0.0 && along_m > 0.0) range_m = std::min(range_m, along_m - std::sqrt(half2_m2));
    }
    return range_m;
  }
};

/// A scanner on a vehicle that goes round and round in the walls.
class Rounds {
 public:
  static constexpr double kRate_hz = 5.0;

  Rounds(Walls walls, const Eigen::Vector2d& half_m, double period_s, double max_range_m, std::uint64_t seed)
      : walls_(std::move(walls)), half_m_(half_m), period_s_(period_s), max_range_m_(max_range_m), random_(seed) {}

  /// Of the pose that the map is given.
  static Eigen::Matrix3d covariance() {
    return Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad).asDiagonal();
  }

  /// The next scan; its pose has the noise of the covariance.
  void advance() {
    constexpr int kBeams = 361;
    const double time_s = static_cast<double>(count_) / kRate_hz;
    const double turn = 2.0 * kPi * time_s / period_s_;
    const Eigen::Vector2d p_m(half_m_.x() * std::cos(turn), half_m_.y() * std::sin(turn));
    const double yaw_rad = std::atan2(half_m_.y() * std::cos(turn), -half_m_.x() * std::sin(turn));
    scan_.stamp_ns = kBegin_ns + std::llround(1e9 * time_s);
    scan_.angle_min_rad = -kPi;
    scan_.angle_increment_rad = 2.0 * kPi / kBeams;
    scan_.time_increment_s = 0.0;
    scan_.beams.clear();
    for (int i = 0; i < kBeams; ++i) {
      const double azimuth_rad = yaw_rad + scan_.angle_min_rad + i * scan_.angle_increment_rad;
      const double range_m =
          walls_.range_m(p_m, {std::cos(azimuth_rad), std::sin(azimuth_rad)}, time_s) + kRange_m * random_.normal();
      scan_.beams.push_back(beam_from_range(static_cast<float>(range_m), 0.1F, static_cast<float>(max_range_m_)));
    }
    T_world_lidar_ = Eigen::Isometry3d::Identity();
    T_world_lidar_.translation() << p_m.x() + kSigma_m * random_.normal(), p_m.y() + kSigma_m * random_.normal(), 1.0;
    T_world_lidar_.rotate(Eigen::AngleAxisd(yaw_rad + kSigma_rad * random_.normal(), Eigen::Vector3d::UnitZ()));
    ++count_;
  }

  const Scan& scan() const { return scan_; }
  const Eigen::Isometry3d& T_world_lidar() const { return T_world_lidar_; }

 private:
  static constexpr std::int64_t kBegin_ns = 1'700'000'000 * kNanosecondsPerSecond;
  static constexpr double kSigma_m = 0.003, kSigma_rad = 0.0005, kRange_m = 0.01;

  Walls walls_;
  Eigen::Vector2d half_m_;
  double period_s_, max_range_m_;
  Random random_;
  std::int64_t count_ = 0;
  Scan scan_;
  Eigen::Isometry3d T_world_lidar_ = Eigen::Isometry3d::Identity();
};

/// A hall of 24 m x 16 m with boxes and posts, and three that walk.
Rounds hall(std::uint64_t seed) {
  Walls walls;
  walls.add_box({0.0, 0.0}, {12.0, 8.0});
  walls.add_box({0.0, 0.0}, {1.5, 1.0});
  walls.add_box({8.5, 4.5}, {0.6, 0.4});
  walls.add_box({-9.0, -5.0}, {0.4, 0.4});
  walls.add_box({-6.0, 6.5}, {1.0, 0.3});
  for (const Eigen::Vector2d& post : {Eigen::Vector2d(3.0, 7.0), {-3.0, -7.0}, {10.0, -6.0}, {-10.5, 3.0}}) {
    walls.discs.push_back({post, 0.0, 0.15, 1.0});
  }
  walls.discs.push_back({{4.0, 0.0}, 1.5, 0.25, 13.7});
  walls.discs.push_back({{-5.0, 1.5}, 1.2, 0.25, 11.3});
  walls.discs.push_back({{0.0, -6.5}, 0.8, 0.25, 9.1});
  return {std::move(walls), {9.0, 5.5}, 60.0, 12.0, seed};
}

/// Two buildings, flown around at 12 m/s.
Rounds buildings(std::uint64_t seed) {
  Walls walls;
  walls.add_box({-6.0, 0.0}, {6.0, 4.0});
  walls.add_box({9.0, 3.0}, {3.0, 5.0});
  walls.discs.push_back({{2.0, -14.0}, 2.0, 1.0, 17.3});
  return {std::move(walls), {25.0, 20.0}, 12.0, 30.0, seed};
}

// --- maps

/// Takes the next data of one kind of map.
class Day {
 public:
  virtual ~Day() = default;
  virtual double rate_hz() const = 0;
  /// Makes the data; not part of the time.
  virtual void advance() = 0;
  /// Maps them.
  virtual void map() = 0;
  /// Things on the map, and elements that it keeps.
  virtual std::pair<std::size_t, std::size_t> size() const = 0;
};

class ObjectDay : public Day {
 public:
  explicit ObjectDay(const Options& options)
      : rounds_(hall(options.seed)),
        pipeline_(parse_object_pipeline_params(read_text_file(options.config), options.config, options.models)) {}
  double rate_hz() const override { return Rounds::kRate_hz; }
  void advance() override { rounds_.advance(); }
  void map() override {
    pipeline_.process(rounds_.scan(), rounds_.T_world_lidar(), rounds_.T_world_lidar());
    objects_ = pipeline_.map().at(rounds_.scan().stamp_ns, std::move(objects_));
  }
  std::pair<std::size_t, std::size_t> size() const override {
    return {objects_.objects.size(), pipeline_.map().size()};
  }

 private:
  Rounds rounds_;
  ObjectPipeline pipeline_;
  Objects objects_;
};

class PolygonDay : public Day {
 public:
  explicit PolygonDay(const Options& options)
      : rounds_(hall(options.seed)),
        pipeline_(params_from_yaml<PolygonPipelineParams>(read_text_file(options.config), options.config,
                                                          [](const UnknownKey&) {}),
                  parse_object_pipeline_params(read_text_file(options.config), options.config, options.models,
                                               [](const UnknownKey&) {})) {}
  double rate_hz() const override { return Rounds::kRate_hz; }
  void advance() override { rounds_.advance(); }
  void map() override {
    pipeline_.process(rounds_.scan(), rounds_.T_world_lidar(), rounds_.T_world_lidar(), Rounds::covariance());
    pipeline_.map().update_due_chains();
    polygons_ = pipeline_.map().latest_polygons(std::move(polygons_));
    elements_ = pipeline_.map().elements();
  }
  std::pair<std::size_t, std::size_t> size() const override { return {polygons_.chains.size(), elements_}; }

 private:
  Rounds rounds_;
  PolygonPipeline pipeline_;
  Polygons polygons_;
  std::size_t elements_ = 0;
};

class SplinegonDay : public Day {
 public:
  explicit SplinegonDay(const Options& options)
      : rounds_(buildings(options.seed)),
        pipeline_(params_from_yaml<SplinegonPipelineParams>(read_text_file(options.config), options.config,
                                                            [](const UnknownKey&) {})) {}
  double rate_hz() const override { return Rounds::kRate_hz; }
  void advance() override { rounds_.advance(); }
  void map() override {
    splinegons_ =
        &pipeline_.process(rounds_.scan(), rounds_.T_world_lidar(), rounds_.T_world_lidar(), Rounds::covariance());
  }
  std::pair<std::size_t, std::size_t> size() const override {
    std::size_t vertices = 0;
    for (const Splinegon& splinegon : splinegons_->boundaries) vertices += splinegon.vertices.size();
    return {splinegons_->boundaries.size(), vertices};
  }

 private:
  Rounds rounds_;
  SplinegonPipeline pipeline_;
  const Splinegons* splinegons_ = nullptr;
};

/// The orbit of docs/benchmarks/grid.md with noisy labels, over and over: each image has its labels, and noise of pose.
class GridDay : public Day {
 public:
  explicit GridDay(const Options& options)
      : case_(noisy_orbit()),
        random_(options.seed),
        pipeline_(params_from_yaml<GridPipelineParams>(read_text_file(options.config), options.config,
                                                       [](const UnknownKey&) {}),
                  std::make_shared<Elevation>(elevation_of(case_, 1.0, 1))) {
    PinholeCamera camera;
    camera.width = 112;
    camera.height = 84;
    camera.fx_px = camera.fy_px = 100.0;
    camera.cx_px = 55.5;
    camera.cy_px = 41.5;
    for (std::size_t i = 0; i < case_.T_world_camera.size(); ++i) images_.push_back(labels_of(case_, camera, i, 1));
  }
  double rate_hz() const override { return 0.5; }
  void advance() override {
    const std::size_t i = static_cast<std::size_t>(count_) % images_.size();
    labels_ = images_[i];
    labels_.stamp_ns = (1'700'000'000 + 2 * count_++) * kNanosecondsPerSecond;
    T_world_camera_ = case_.T_world_camera[i];
    for (int axis = 0; axis < 3; ++axis) T_world_camera_.translation()(axis) += 0.05 * random_.normal();
  }
  void map() override { pipeline_.process(labels_, T_world_camera_, {}); }
  std::pair<std::size_t, std::size_t> size() const override {
    return {pipeline_.targets().targets.size(), pipeline_.map().grid().probability.size()};
  }

 private:
  static GridCase noisy_orbit() {
    GridCase made = make_grid_case("labels", 1);
    made.blobs = 1;
    return made;
  }

  GridCase case_;
  Random random_;
  GridPipeline pipeline_;
  std::vector<SoftLabels> images_;
  SoftLabels labels_;
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();
  std::int64_t count_ = 0;
};

std::unique_ptr<Day> day_of(const Options& options) {
  if (options.kind == "objects") return std::make_unique<ObjectDay>(options);
  if (options.kind == "polygons") return std::make_unique<PolygonDay>(options);
  if (options.kind == "splinegons") return std::make_unique<SplinegonDay>(options);
  return std::make_unique<GridDay>(options);
}

// --- running

/// Constant work by stateless functions, which measures the momentary speed of the machine: the second time, since the
/// first one takes what it reads from the memory, as a scan of the map is mostly from the caches.
double yardstick_us(const Scan& scan) {
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  double begin_us = 0.0;
  for (int pass = 0; pass < 2; ++pass) {
    begin_us = thread_cpu_us();
    if (segment(project_horizontally(scan, T, T), SegmentationParams{}).segments.empty()) {
      throw std::logic_error("nothing in the simulated scan");
    }
  }
  return thread_cpu_us() - begin_us;
}

int soak(const Options& options) {
  Rounds still = hall(options.seed);
  still.advance();
  const std::unique_ptr<Day> day = day_of(options);
  const std::int64_t count = std::llround(3600.0 * options.hours * day->rate_hz());
  const std::int64_t of_block = std::max<std::int64_t>(1, std::llround(options.block_s * day->rate_hz()));
  Times times(of_block), yardstick(of_block);
  for (std::int64_t i = 0; i < count; ++i) {
    day->advance();
    const double begin_us = thread_cpu_us();
    day->map();
    times.add(thread_cpu_us() - begin_us);
    constexpr std::int64_t kYardstickEvery = 20;
    if (i % kYardstickEvery == 0) yardstick.add(yardstick_us(still.scan()));
    if ((i + 1) % of_block != 0 && i + 1 != count) continue;
    const auto [things, elements] = day->size();
    const Memory memory = situation_awareness::memory();
    const Json line = {{"kind", options.kind},
                       {"scans", i + 1},
                       {"of", count},
                       {"rate_hz", day->rate_hz()},
                       {"hours", static_cast<double>(i + 1) / day->rate_hz() / 3600.0},
                       {"resident_bytes", memory.resident_bytes},
                       {"heap_bytes", memory.heap_bytes},
                       {"p50_us", times.quantile(0.5)},
                       {"p99_us", times.quantile(0.99)},
                       {"max_us", times.quantile(1.0)},
                       {"yardstick_us", yardstick.quantile(0.5)},
                       {"things", things},
                       {"elements", elements}};
    std::printf("%s\n", line.dump().c_str());
    std::fflush(stdout);
    times.clear();
    yardstick.clear();
  }
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>("map_soak", kDescription, argc, argv, add_options, soak);
}
