// SPDX-License-Identifier: BSD-3-Clause
// Cost of each stage between scan and map, in time and in allocations, and its growth with the beams at 12 objects and
// with the objects at 3600 beams, which is linear.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "allocations.hpp"
#include "situation_awareness/pipeline/hit_labels.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "staged_pipeline.hpp"
#include "synthetic_scene.hpp"

namespace situation_awareness {
namespace {

constexpr int kPeriod = SyntheticScene::kPeriodScans;

const ObjectPipelineParams& shipped_params() {
  static const ObjectPipelineParams params = load_object_pipeline_params(
      SITUATION_AWARENESS_SOURCE_DIR "/cfg/objects.yaml", SITUATION_AWARENESS_SOURCE_DIR "/models");
  return params;
}

/// One period of a scene, and the values between the stages when everything was on the map.
struct Recording {
  Recording(int beams, int objects) : pipeline(shipped_params()) {
    const SyntheticScene scene(beams, objects, 1);
    const auto untimed = [](const char* /*name*/, auto&& what) { return what(); };
    for (int i = 0; i < 2 * kPeriod; ++i) {
      const SyntheticScan scan = scene.scan(i);
      StageValues values = pipeline.process(scan.scan, scan.T_world_lidar, scan.T_world_lidar_end, untimed);
      if (i < kPeriod) continue;
      scans.push_back(scan);
      stages.push_back(std::move(values));
    }
  }

  StagedPipeline pipeline;
  std::vector<SyntheticScan> scans;
  std::vector<StageValues> stages;
};

/// Times only what(scan, values), period after period; prepare(i), untimed, comes before the i-th.
template <class Prepare, class What>
void measure(benchmark::State& state, const Recording& recording, Prepare&& prepare, What&& what) {
  std::size_t i = 0;
  std::int64_t allocated = 0;
  for (auto _ : state) {
    const std::size_t k = i % recording.scans.size();
    prepare(i++);
    const Allocations before = allocations();
    const auto begin = std::chrono::steady_clock::now();
    auto result = what(recording.scans[k], recording.stages[k]);
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
    allocated += (allocations() - before).count;
    benchmark::DoNotOptimize(result);
    state.SetIterationTime(time.count());
  }
  state.counters["allocations"] =
      benchmark::Counter(static_cast<double>(allocated), benchmark::Counter::kAvgIterations);
  std::size_t detections = 0;
  for (const StageValues& values : recording.stages) detections += values.detections.detections.size();
  state.counters["detections"] = static_cast<double>(detections) / static_cast<double>(recording.stages.size());
}

void nothing(std::size_t /*i*/) {}

/// The stamp of the i-th scan of periods that follow one another.
std::int64_t stamp_ns(std::size_t i) { return static_cast<std::int64_t>(i) * SyntheticScene::kStep_ns; }

void limit(benchmark::State& state, const Recording& recording) {
  measure(state, recording, nothing, [](const SyntheticScan& scan, const StageValues&) {
    return limit_range(scan.scan, scan.T_world_lidar, shipped_params().scan);
  });
}

void project(benchmark::State& state, const Recording& recording) {
  measure(state, recording, nothing, [](const SyntheticScan& scan, const StageValues& values) {
    return project_horizontally(values.limited, scan.T_world_lidar, scan.T_world_lidar_end);
  });
}

void expect(benchmark::State& state, const Recording& recording) {
  const ObjectMap& map = recording.pipeline.map();
  measure(state, recording, nothing, [&](const SyntheticScan&, const StageValues& values) {
    return outlines_at(map.stamp_ns() + SyntheticScene::kStep_ns, values.points.T_world_level, map.at(map.stamp_ns()));
  });
}

void segment(benchmark::State& state, const Recording& recording) {
  measure(state, recording, nothing, [](const SyntheticScan&, const StageValues& values) {
    return situation_awareness::segment(values.points, shipped_params().segments);
  });
}

void divide(benchmark::State& state, const Recording& recording) {
  Segments whole;
  measure(
      state, recording, [&](std::size_t i) { whole = recording.stages[i % recording.stages.size()].undivided; },
      [&](const SyntheticScan&, const StageValues& values) {
        return situation_awareness::divide(std::move(whole), values.known_level, shipped_params().segments);
      });
}

void detect(benchmark::State& state, const Recording& recording) {
  const std::unique_ptr<ProbableDetector> detector = make_detector(shipped_params().detections);
  measure(state, recording, nothing, [&](const SyntheticScan&, const StageValues& values) {
    return detector->detect(values.segments, values.known_level);
  });
}

void update(benchmark::State& state, const Recording& recording) {
  ObjectMap map(shipped_params().objects);
  Detections detections;
  const auto prepare = [&](std::size_t i) {
    detections = recording.stages[i % recording.stages.size()].detections;
    detections.stamp_ns = stamp_ns(kPeriod + i);
  };
  for (const StageValues& values : recording.stages) {
    detections = values.detections;
    detections.stamp_ns -= stamp_ns(kPeriod);
    map.update(detections);
  }
  measure(state, recording, prepare, [&](const SyntheticScan&, const StageValues&) { return map.update(detections); });
}

void publish(benchmark::State& state, const Recording& recording) {
  const ObjectMap& map = recording.pipeline.map();
  measure(state, recording, nothing, [&](const SyntheticScan&, const StageValues&) { return map.at(map.stamp_ns()); });
}

void label(benchmark::State& state, const Recording& recording) {
  std::vector<HitLabel> labels;
  measure(state, recording, nothing, [&](const SyntheticScan&, const StageValues& values) {
    labels = label_hits(values.segments, values.detections, values.map, std::move(labels));
    return labels.size();
  });
}

void whole(benchmark::State& state, const Recording& recording) {
  ObjectPipeline pipeline(shipped_params());
  Scan now;
  for (const SyntheticScan& scan : recording.scans) {
    now = scan.scan;
    now.stamp_ns -= stamp_ns(kPeriod);
    pipeline.process(now, scan.T_world_lidar, scan.T_world_lidar_end);
  }
  const auto prepare = [&](std::size_t i) {
    now = recording.scans[i % recording.scans.size()].scan;
    now.stamp_ns = stamp_ns(kPeriod + i);
  };
  measure(state, recording, prepare, [&](const SyntheticScan& scan, const StageValues&) {
    return pipeline.process(now, scan.T_world_lidar, scan.T_world_lidar_end);
  });
}

struct Stage {
  const char* name;
  void (*measure)(benchmark::State& state, const Recording& recording);
};

constexpr Stage kStages[] = {
    {"limit", limit},   {"project", project}, {"expect", expect},   {"segment", segment}, {"divide", divide},
    {"detect", detect}, {"update", update},   {"publish", publish}, {"label", label},     {"whole", whole},
};

benchmark::internal::Benchmark* add(const std::string& name, const std::function<void(benchmark::State&)>& run) {
  return benchmark::RegisterBenchmark(name.c_str(), run)
      ->UseManualTime()
      ->Unit(benchmark::kMicrosecond)
      ->Complexity(benchmark::oN);
}

void add_all() {
  for (const Stage& stage : kStages) {
    const auto run = [stage](benchmark::State& state, int beams, int objects) {
      stage.measure(state, Recording(beams, objects));
      state.SetComplexityN(state.range(0));
    };
    benchmark::internal::Benchmark* const by_beams =
        add(std::string(stage.name) + "/beams",
            [run](benchmark::State& state) { run(state, static_cast<int>(state.range(0)), 12); });
    for (const int beams : {181, 541, 1081, 3600}) by_beams->Arg(beams);
    benchmark::internal::Benchmark* const by_objects =
        add(std::string(stage.name) + "/objects",
            [run](benchmark::State& state) { run(state, 3600, static_cast<int>(state.range(0))); });
    for (const int objects : {1, 12, 60, 200}) by_objects->Arg(objects);
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  situation_awareness::add_all();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
