// SPDX-License-Identifier: BSD-3-Clause
// Cost of a scan from scan to map, in time and in allocations: the raw data of scripts/evaluate speed.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <memory>
#include <numeric>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "allocations.hpp"
#include "command_line.hpp"
#include "situation_awareness/detections/network.hpp"
#include "situation_awareness/detections/onnx_model.hpp"
#include "situation_awareness/detections/paper_networks.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "staged_pipeline.hpp"
#include "synthetic_scene.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr const char* kDescription =
    R"(Maps synthetic scans in sequence and writes the cost as one line of JSON: in us and allocations per scan. 'whole' is ObjectPipeline::process, 'stages' are the same scans stage by stage.
)";

struct Options {
  std::string config, models;
  int beams = 1081, objects = 12, elements = 0, threads = 1, scans = 600, warm_up = 1200, rate_hz = 0, seed = 1;
  bool networks = false;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("--config", options.config, "parameters of the map, such as cfg/objects.yaml")
      .required()
      .type_name("FILE");
  app.add_option("--models", options.models, "where a relative model is looked for").required().type_name("FOLDER");
  const auto number = [&app](const char* name, int& value, int low, const char* what) {
    app.add_option(name, value, what).type_name("N").check(from_to(low, 1e8));
  };
  number("--beams", options.beams, 2, "of the scanner, over 270 degrees");
  number("--objects", options.objects, 1, "in a ring around it");
  number("--elements", options.elements, 0, "that the map remembers besides, from other rooms, about");
  number("--threads", options.threads, 1, "as many pipelines at once, each with its own scans");
  number("--scans", options.scans, 1, "that count");
  number("--warm-up", options.warm_up, 0, "before these");
  number("--rate-hz", options.rate_hz, 0, "of the scans: pause between them as a scanner does;\n0: no pause");
  number("--seed", options.seed, 0, "of the scene");
  app.add_flag("--networks", options.networks,
               "time per segment beside that of a full forward of the\npaper's VGG-Net");
}

double cpu_now_us(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

// --- what is counted

/// Quantile of the numbers.
double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1) + 0.5)];
}

/// Costs of one stage, scan by scan.
struct Costs {
  std::vector<double> times_us;
  std::vector<double> cpu_us;  ///< without the time of other programs, which is in the times
  Allocations allocations;

  void reserve(std::size_t scans) {
    times_us.reserve(scans);
    cpu_us.reserve(scans);
  }

  /// Runs what() and records its cost; returns its result, references as such.
  template <class What>
  decltype(auto) operator()(What&& what) {
    const double cpu_before_us = cpu_now_us(CLOCK_THREAD_CPUTIME_ID);
    const Allocations before = situation_awareness::allocations();
    const Clock::time_point begin = Clock::now();
    decltype(auto) result = what();
    const std::chrono::duration<double, std::micro> time = Clock::now() - begin;
    const Allocations during = situation_awareness::allocations() - before;
    cpu_us.push_back(cpu_now_us(CLOCK_THREAD_CPUTIME_ID) - cpu_before_us);
    times_us.push_back(time.count());
    allocations.count += during.count;
    allocations.bytes += during.bytes;
    return result;
  }

  void add(const Costs& other) {
    times_us.insert(times_us.end(), other.times_us.begin(), other.times_us.end());
    cpu_us.insert(cpu_us.end(), other.cpu_us.begin(), other.cpu_us.end());
    allocations.count += other.allocations.count;
    allocations.bytes += other.allocations.bytes;
  }

  Json json() const {
    const double n = static_cast<double>(std::max<std::size_t>(times_us.size(), 1));
    return {{"p50_us", quantile(times_us, 0.5)},
            {"p99_us", quantile(times_us, 0.99)},
            {"max_us", quantile(times_us, 1.0)},
            {"cpu_us", std::accumulate(cpu_us.begin(), cpu_us.end(), 0.0) / n},
            {"cpu_p50_us", quantile(cpu_us, 0.5)},
            {"cpu_p99_us", quantile(cpu_us, 0.99)},
            {"cpu_max_us", quantile(cpu_us, 1.0)},
            {"allocations", static_cast<double>(allocations.count) / n},
            {"bytes", static_cast<double>(allocations.bytes) / n}};
  }
};

/// Costs of the stages, in the order of their first run.
class StageCosts {
 public:
  explicit StageCosts(std::size_t scans) : scans_(scans) {}

  template <class What>
  auto operator()(const char* name, What&& what) {
    return of(name)(std::forward<What>(what));
  }

  void add(const StageCosts& other) {
    for (const auto& [name, costs] : other.stages_) of(name).add(costs);
  }

  Json json() const {
    Json json = Json::object();
    for (const auto& [name, costs] : stages_) json[name] = costs.json();
    return json;
  }

 private:
  Costs& of(const std::string& name) {
    const auto stage =
        std::find_if(stages_.begin(), stages_.end(), [&](const auto& known) { return known.first == name; });
    if (stage != stages_.end()) return stage->second;
    stages_.emplace_back(name, Costs{});
    stages_.back().second.reserve(scans_);
    return stages_.back().second;
  }

  std::size_t scans_;
  std::vector<std::pair<std::string, Costs>> stages_;
};

// --- the networks, per segment

/// The package's detector and full forwards of the paper's VGG-Net, on the same segments, interleaved.
class NetworkComparison {
 public:
  NetworkComparison(const ObjectPipelineParams& params, const std::string& model_folder)
      : detector_(make_detector(params.detections)), vgg_(model_folder + "/paper_vgg.onnx") {
    DetectionParams vgg = params.detections;
    vgg.detector = "vgg";
    vgg.model.clear();
    vgg_detector_ = make_detector(vgg);
  }

  void add(const Segments& segments) {
    std::vector<std::size_t> asked;
    for (std::size_t i = 0; i < segments.segments.size(); ++i) {
      if (segments.segments[i].kind == SegmentKind::kObject) asked.push_back(i);
    }
    if (asked.empty()) return;
    const std::size_t n = asked.size();
    time(detector_us_, n, [&] { return detector_->detect(segments); });
    time(vgg_detector_us_, n, [&] { return vgg_detector_->detect(segments); });
    time(vgg_forward_us_, n, [&] {
      for (const std::size_t i : asked) forward(segments, {i});
      return 0;
    });
    time(vgg_batched_us_, n, [&] {
      forward(segments, asked);
      return 0;
    });
  }

  /// Medians of the CPU time, in us per segment, so that a busy machine does not affect the ratios. `whole_us`: of the
  /// whole pipeline from scan to map, likewise.
  Json json(double whole_us) const {
    const double detector_us = quantile(detector_us_, 0.5);
    const double vgg_us = quantile(vgg_forward_us_, 0.5);
    return {{"vgg_forward_us", vgg_us},
            {"vgg_batched_us", quantile(vgg_batched_us_, 0.5)},
            {"vgg_detector_us", quantile(vgg_detector_us_, 0.5)},
            {"detector_us", detector_us},
            {"whole_us", whole_us},
            {"vgg_forward_to_detector", vgg_us / detector_us},
            {"vgg_forward_to_whole", vgg_us / whole_us}};
  }

 private:
  template <class What>
  static void time(std::vector<double>& times_us, std::size_t segments, What&& what) {
    Costs costs;
    costs(what);
    times_us.push_back(costs.cpu_us.front() / static_cast<double>(segments));
  }

  /// The network's input is zero outside the segment (docs/math/paper_networks.md, eq. 2).
  void forward(const Segments& segments, const std::vector<std::size_t>& which) {
    float* input = vgg_.resize(static_cast<int>(which.size()));
    for (const std::size_t i : which) {
      const Segment& segment = segments.segments[i];
      for (std::size_t k = segment.first; k < segment.first + segment.count; ++k) {
        const Point& point = segments.points[k];
        const double beam = point.azimuth_rad / PaperNetwork::kResolutionRad + PaperNetwork::kBeams / 2;
        input[std::clamp(static_cast<int>(std::lround(beam)), 0, PaperNetwork::kBeams - 1)] =
            static_cast<float>(0.1 * point.range_m);
      }
      input += PaperNetwork::kBeams;
    }
    vgg_.forward();
  }

  std::unique_ptr<Detector> detector_;
  std::unique_ptr<Detector> vgg_detector_;
  OnnxModel vgg_;
  std::vector<double> detector_us_, vgg_detector_us_, vgg_forward_us_, vgg_batched_us_;
};

// --- running

/// Results of one thread.
struct Result {
  explicit Result(std::size_t scans) : stages(scans) { whole.reserve(scans); }

  Costs whole;
  StageCosts stages;
  std::size_t hit = 0, hits = 0, segments = 0, detections = 0;  ///< sums over the scans: objects with hits, hits, ...
  std::size_t elements = 0;                                     ///< on the map at last
  Json networks;
};

bool same(const Object& a, const Object& b) {
  return a.id == b.id && a.ellipse_world.center_m == b.ellipse_world.center_m &&
         a.ellipse_world.psi_rad == b.ellipse_world.psi_rad && a.ellipse_world.rx_m == b.ellipse_world.rx_m &&
         a.ellipse_world.ry_m == b.ellipse_world.ry_m && a.velocity_world_m_s == b.velocity_world_m_s &&
         a.angular_velocity_rad_s == b.angular_velocity_rad_s && a.covariance == b.covariance &&
         a.p_moving == b.p_moving && a.p_exists == b.p_exists && a.observations == b.observations;
}

void check_same(const Objects& whole, const Objects& staged) {
  if (whole.stamp_ns == staged.stamp_ns &&
      std::equal(whole.objects.begin(), whole.objects.end(), staged.objects.begin(), staged.objects.end(), same)) {
    return;
  }
  throw std::logic_error("ObjectPipeline and the stages that are timed here give different maps");
}

class Run {
 public:
  Run(const Options& options, const ObjectPipelineParams& params, int thread)
      : options_(options),
        pipeline_(params),
        staged_(params),
        result_(static_cast<std::size_t>(options.scans)),
        seed_(static_cast<std::uint64_t>(options.seed) + 1000 * static_cast<std::uint64_t>(thread)) {
    if (options.networks) networks_ = std::make_unique<NetworkComparison>(params, options.models);
    visit_other_rooms();
    const SyntheticScene scene(options.beams, options.objects, seed_);
    for (int i = 0; i < options.warm_up + options.scans; ++i) {
      scans_.push_back(scene.scan(next_scan_++));
      if (i < options.warm_up) warm_up(scans_.back());
    }
  }

  /// Without allocations of its own between the scans.
  void run() {
    constexpr std::size_t kNetworksEvery = 10;  // a full forward is slow
    const std::chrono::duration<double> step(options_.rate_hz > 0 ? 1.0 / options_.rate_hz : 0.0);
    Clock::time_point due = Clock::now();
    for (std::size_t i = static_cast<std::size_t>(options_.warm_up); i < scans_.size(); ++i) {
      const SyntheticScan& scan = scans_[i];
      const bool whole_first = i % 2 == 0;
      if (whole_first) process_whole(scan);
      wait(due, step);
      const StageValues& values = staged_.process(
          scan.scan, scan.T_world_lidar, scan.T_world_lidar_end,
          [&](const char* name, auto&& what) { return result_.stages(name, std::forward<decltype(what)>(what)); });
      wait(due, step);
      if (!whole_first) process_whole(scan);
      check_same(pipeline_.map().at(scan.scan.stamp_ns), values.map);
      if (networks_ && i % kNetworksEvery == 0) networks_->add(values.segments);

      result_.hit += static_cast<std::size_t>(
          std::count_if(scan.hits.begin(), scan.hits.end(), [](int hits) { return hits > 0; }));
      result_.hits += static_cast<std::size_t>(std::accumulate(scan.hits.begin(), scan.hits.end(), 0));
      result_.segments += static_cast<std::size_t>(
          std::count_if(values.segments.segments.begin(), values.segments.segments.end(),
                        [](const Segment& segment) { return segment.kind == SegmentKind::kObject; }));
      result_.detections += values.detections.detections.size();
      result_.elements = values.map.objects.size();
    }
    if (!networks_) return;
    const double segments = static_cast<double>(result_.segments) / options_.scans;
    result_.networks = networks_->json(quantile(result_.whole.cpu_us, 0.5) / segments);
  }

  const Result& result() const { return result_; }

 private:
  /// Adds elements that are out of sight: seen earlier, in other rooms.
  void visit_other_rooms() {
    constexpr int kObjectsOfRoom = 200, kBeams = 3600, kScansOfRoom = 60, kScansToNextRoom = 20;
    constexpr double kToNextRoom_m = 30.0;
    const int rooms = (options_.elements + kObjectsOfRoom - 1) / kObjectsOfRoom;
    for (int room = rooms; room > 0; --room) {
      const SyntheticScene scene(kBeams, std::min(kObjectsOfRoom, options_.elements - (room - 1) * kObjectsOfRoom),
                                 seed_ + 10 + static_cast<std::uint64_t>(room), SceneMotion::kNone,
                                 {kToNextRoom_m * room, 0.0});
      for (int i = 0; i < kScansOfRoom; ++i) warm_up(scene.scan(next_scan_++));
      next_scan_ += kScansToNextRoom;
    }
  }

  void warm_up(const SyntheticScan& scan) {
    pipeline_.process(scan.scan, scan.T_world_lidar, scan.T_world_lidar_end);
    staged_.process(scan.scan, scan.T_world_lidar, scan.T_world_lidar_end,
                    [](const char* /*name*/, auto&& what) { return what(); });
  }

  void process_whole(const SyntheticScan& scan) {
    result_.whole(
        [&]() -> decltype(auto) { return pipeline_.process(scan.scan, scan.T_world_lidar, scan.T_world_lidar_end); });
  }

  static void wait(Clock::time_point& due, std::chrono::duration<double> step) {
    if (step.count() == 0.0) return;
    due += std::chrono::duration_cast<Clock::duration>(0.5 * step);
    std::this_thread::sleep_until(due);
  }

  const Options& options_;
  ObjectPipeline pipeline_;
  StagedPipeline staged_;
  std::unique_ptr<NetworkComparison> networks_;
  Result result_;
  std::uint64_t seed_;
  int next_scan_ = 0;
  std::vector<SyntheticScan> scans_;
};

Json run_case(const Options& options) {
  ObjectPipelineParams params = load_object_pipeline_params(options.config, options.models);
  if (options.elements > 0) params.objects.max_unseen_s = 1e6;  // keeps all of them until the last scan
  // Each run is made, and so warmed up, on the thread that runs it: the stages keep memory per thread.
  const auto n = static_cast<std::size_t>(options.threads);
  std::vector<std::unique_ptr<Run>> runs(n);
  std::vector<std::exception_ptr> errors(n);
  std::vector<double> thread_cpu_us(n);
  std::vector<std::thread> threads;
  std::atomic<std::size_t> waiting{n};
  std::atomic<bool> started{false};
  for (std::size_t i = 0; i < n; ++i) {
    threads.emplace_back([&, i] {
      try {
        runs[i] = std::make_unique<Run>(options, params, static_cast<int>(i));
      } catch (...) {
        errors[i] = std::current_exception();
      }
      --waiting;
      while (!started) std::this_thread::yield();
      if (errors[i]) return;
      const double before_us = cpu_now_us(CLOCK_THREAD_CPUTIME_ID);
      try {
        runs[i]->run();
      } catch (...) {
        errors[i] = std::current_exception();
      }
      thread_cpu_us[i] = cpu_now_us(CLOCK_THREAD_CPUTIME_ID) - before_us;
    });
  }
  while (waiting > 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  const double cpu_before_us = cpu_now_us(CLOCK_PROCESS_CPUTIME_ID);
  started = true;
  for (std::thread& thread : threads) thread.join();
  const double cpu_of_all_us = cpu_now_us(CLOCK_PROCESS_CPUTIME_ID) - cpu_before_us;
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }

  Result all(0);
  for (const std::unique_ptr<Run>& run : runs) {
    all.whole.add(run->result().whole);
    all.stages.add(run->result().stages);
    all.hit += run->result().hit;
    all.hits += run->result().hits;
    all.segments += run->result().segments;
    all.detections += run->result().detections;
    all.elements += run->result().elements;
  }
  const double scans = static_cast<double>(options.scans) * options.threads;
  const double own_cpu_us = std::accumulate(thread_cpu_us.begin(), thread_cpu_us.end(), 0.0);
  Json json = {{"beams", options.beams},
               {"objects", options.objects},
               {"threads", options.threads},
               {"scans", options.scans},
               {"rate_hz", options.rate_hz},
               {"hit", static_cast<double>(all.hit) / scans},
               {"hits", static_cast<double>(all.hits) / scans},
               {"segments", static_cast<double>(all.segments) / scans},
               {"detections", static_cast<double>(all.detections) / scans},
               {"elements", static_cast<double>(all.elements) / options.threads},
               {"whole", all.whole.json()},
               {"stages", all.stages.json()},
               {"other_threads_cpu_part", (cpu_of_all_us - own_cpu_us) / cpu_of_all_us}};
  if (options.networks) json["networks"] = runs.front()->result().networks;
  return json;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("pipeline_speed", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    std::printf("%s\n", run_case(options).dump().c_str());
    return 0;
  });
}
