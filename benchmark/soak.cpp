// SPDX-License-Identifier: BSD-3-Clause
// Days of scans in sequence: the raw data of scripts/evaluate soak.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "measures.hpp"
#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "synthetic_scene.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDescription =
    R"(Maps scans of many hours as fast as possible, at 20 Hz of their stamps, invalid ones among them. Writes a line of JSON
per block (memory in use at its end, thread CPU time per scan), and at the end the outcomes of all scans. Blocks are
alternately of simulated and recorded scans; time is reset after 1, 2, 3 and 24 blocks in turn. The exit code is 1 if a
scan did not have the expected outcome of its kind.
)";

struct Options {
  std::string config, models, scans;
  double hours = 40.0, block_s = 600.0, bad_part = 0.002;
  std::uint64_t seed = 1;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("--config", options.config, "parameters of the map, such as cfg/objects.yaml")
      .required()
      .type_name("FILE");
  app.add_option("--models", options.models, "where a relative model is looked for").required().type_name("FOLDER");
  app.add_option("--scans", options.scans,
                 "recorded scans, as scripts/evaluation/soak.py writes them\n(default: simulated ones alone)")
      .type_name("FILE");
  app.add_option("--hours", options.hours, "of scans").type_name("H").check(from_to(0.001, 10000.0));
  app.add_option("--block-s", options.block_s, "of scans in a block").type_name("S").check(from_to(2.0, 3600.0));
  app.add_option("--bad-part", options.bad_part, "of the scans, for each kind of bad ones")
      .type_name("P")
      .check(from_to(0.0, 0.1));
  app.add_option("--seed", options.seed, "of scene and bad scans").type_name("N").check(from_to(0.0, 1e9));
}

// --- what is sent

enum Kind : std::size_t { kGood, kSomeNan, kAllNan, kNoBeams, kTilted, kRepeated, kBack, kAgain, kKinds };

/// Expected outcome of each kind; for exceptions the message up to the first number.
struct Fate {
  const char* kind;
  const char* outcome;
};

constexpr const char* kMapped = "mapped";
constexpr const char* kMappedBlind = "mapped, no hits";
constexpr const char* kNewMap = "mapped, new map";
constexpr std::array<Fate, kKinds> kFates = {{{"good", kMapped},
                                              {"every third range NaN", kMapped},
                                              {"every range NaN", kMappedBlind},
                                              {"no beams", "thrown: empty scan"},
                                              {"lidar tilted by 85 deg", "thrown: scan plane tilted by "},
                                              {"stamp of the scan before", "refused: stamp repeats"},
                                              {"stamp a little back", "refused: stamp goes back"},
                                              {"time is reset", kNewMap}}};

/// Scans of a file: per scan, native byte order, five float64 (angle_min and angle_increment in rad, time_increment in
/// s, range_min and range_max in m), a uint32 count and as many float32 ranges in m.
std::vector<SyntheticScan> read_scans(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::invalid_argument(path + ": cannot be read");
  std::vector<SyntheticScan> scans;
  std::array<double, 5> head{};
  const auto read = [&file](auto* values, std::size_t count) {
    file.read(reinterpret_cast<char*>(values), static_cast<std::streamsize>(count * sizeof(*values)));
    return static_cast<bool>(file);
  };
  while (read(head.data(), head.size())) {
    std::uint32_t count = 0;
    if (!read(&count, 1) || count > 100000) throw std::invalid_argument(path + ": not a file of scans");
    std::vector<float> ranges_m(count);
    if (!read(ranges_m.data(), count)) throw std::invalid_argument(path + ": ends within a scan");
    SyntheticScan recorded;
    recorded.scan.angle_min_rad = head[0];
    recorded.scan.angle_increment_rad = head[1];
    recorded.scan.time_increment_s = head[2];
    for (const float range_m : ranges_m) {
      recorded.scan.beams.push_back(beam_from_range(range_m, static_cast<float>(head[3]), static_cast<float>(head[4])));
    }
    scans.push_back(std::move(recorded));
  }
  if (scans.empty()) throw std::invalid_argument(path + ": no scans");
  return scans;
}

/// Makes the scans, one after the other, from loops of simulated and of recorded ones.
class Feed {
 public:
  explicit Feed(const Options& options)
      : block_scans_(std::lround(options.block_s * kRate_hz)),
        bad_part_(options.bad_part),
        max_back_s_(0.9 * StampOrder::kResetTimeJump_s),
        random_(options.seed + 1) {
    constexpr int kBeams = 1081, kObjects = 12, kNoises = 16;
    const SyntheticScene scene(kBeams, kObjects, options.seed);
    for (int i = 0; i < kNoises * SyntheticScene::kPeriodScans; ++i) simulated_.scans.push_back(scene.scan(i));
    if (!options.scans.empty()) recorded_.scans = read_scans(options.scans);
  }

  /// Puts the next scan into now() and kind().
  void advance() {
    const std::int64_t block = count_ / block_scans_;
    if (count_ % block_scans_ == 0) begin_block(block);
    Loop& loop = is_recorded(block) ? recorded_ : simulated_;
    now_ = loop.scans[loop.next];
    loop.next = (loop.next + 1) % loop.scans.size();

    kind_ = count_ == 0 ? kGood : slot_ == 0 ? kAgain : draw();
    now_.scan.stamp_ns = kBegin_ns + slot_ * SyntheticScene::kStep_ns;
    spoil();
    if (kFates[kind_].outcome[0] == kMapped[0]) mapped_ns_ = now_.scan.stamp_ns;
    ++sent_[kind_];
    ++count_;
    ++slot_;
  }

  const SyntheticScan& now() const { return now_; }
  Kind kind() const { return kind_; }
  const std::array<std::int64_t, kKinds>& sent() const { return sent_; }
  std::int64_t block_scans() const { return block_scans_; }
  bool is_recorded(std::int64_t block) const { return block % 2 == 1 && !recorded_.scans.empty(); }
  const SyntheticScan& any() const { return simulated_.scans.front(); }

  static constexpr double kRate_hz = static_cast<double>(kNanosecondsPerSecond) / SyntheticScene::kStep_ns;

 private:
  static constexpr std::int64_t kBegin_ns = 1'700'000'000 * kNanosecondsPerSecond;

  struct Loop {
    std::vector<SyntheticScan> scans;
    std::size_t next = 0;
  };

  void begin_block(std::int64_t block) {
    static constexpr std::array<std::int64_t, 4> kStretches = {1, 2, 3, 24};
    if (block != stretch_end_) return;
    slot_ = 0;
    stretch_end_ += kStretches[stretch_++ % kStretches.size()];
  }

  Kind draw() {
    const double drawn = random_.uniform() / std::max(bad_part_, 1e-12);
    return drawn < kAgain - kSomeNan ? static_cast<Kind>(kSomeNan + static_cast<std::size_t>(drawn)) : kGood;
  }

  void spoil() {
    std::vector<Beam>& beams = now_.scan.beams;
    const Beam nan = beam_from_range(std::numeric_limits<float>::quiet_NaN(), 0.0F, 1.0F);
    switch (kind_) {
      case kSomeNan:
        for (std::size_t i = 0; i < beams.size(); i += 3) beams[i] = nan;
        break;
      case kAllNan:
        std::fill(beams.begin(), beams.end(), nan);
        break;
      case kNoBeams:
        beams.clear();
        break;
      case kTilted:
        now_.T_world_lidar.rotate(Eigen::AngleAxisd(radians(85.0), Eigen::Vector3d::UnitX()));
        now_.T_world_lidar_end = now_.T_world_lidar;
        break;
      case kRepeated:
        now_.scan.stamp_ns = mapped_ns_;
        break;
      case kBack:
        now_.scan.stamp_ns = mapped_ns_ - nanoseconds(random_.uniform(0.01, 1.0) * max_back_s_);
        break;
      default:
        break;
    }
  }

  std::int64_t block_scans_;
  double bad_part_;
  double max_back_s_;
  Random random_;
  Loop simulated_, recorded_;
  std::int64_t count_ = 0;        ///< of scans
  std::int64_t slot_ = 0;         ///< scans since the reset of time
  std::int64_t stretch_end_ = 0;  ///< the block of the next reset of time
  std::size_t stretch_ = 0;
  std::int64_t mapped_ns_ = 0;  ///< stamp of the latest scan that must be mapped
  std::array<std::int64_t, kKinds> sent_{};
  Kind kind_ = kGood;
  SyntheticScan now_;
};

// --- running

class Soak {
 public:
  Soak(const Options& options, const ObjectPipelineParams& params)
      : scans_(std::lround(options.hours * 3600.0 * Feed::kRate_hz)),
        params_(params),
        pipeline_(params),
        feed_(options),
        times_(feed_.block_scans()),
        yardstick_(feed_.block_scans()) {
    pipeline_.map().trust_stamps();  // as nodelets and tools, whose input judges stamps by receipts
  }

  /// Whether every scan had the expected outcome of its kind.
  bool run() {
    for (std::int64_t i = 0; i < scans_; ++i) {
      feed_.advance();
      ++outcomes_[feed_.kind()][process(feed_.now())];
      constexpr std::int64_t kYardstickEvery = 20;
      if (i % kYardstickEvery == 0) measure_yardstick();
      if ((i + 1) % feed_.block_scans() == 0 || i + 1 == scans_) report_block(i);
    }
    return report_accounts();
  }

 private:
  /// Outcome of a scan. Its time is that up to the map that would be published.
  std::string process(const SyntheticScan& scan) {
    const std::int64_t before_ns = pipeline_.map().stamp_ns();
    std::string outcome;
    bool mapped = false;
    try {
      const double begin_us = thread_cpu_us();
      const ObjectPipelineResult& result = pipeline_.process(scan.scan, scan.T_world_lidar, scan.T_world_lidar_end);
      map_ = pipeline_.map().at(scan.scan.stamp_ns, std::move(map_));
      times_.add(thread_cpu_us() - begin_us);
      objects_ += map_.objects.size();
      detections_ += result.detections.detections.size();
      outcome = outcome_of(result);
      mapped = outcome[0] == kMapped[0];
    } catch (const std::invalid_argument& error) {
      outcome = std::string("thrown: ") + error.what();
      outcome = outcome.substr(0, outcome.find_first_of("0123456789"));
    }
    if (pipeline_.map().stamp_ns() != (mapped ? scan.scan.stamp_ns : before_ns)) outcome += ", but not by the map";
    return outcome;
  }

  static std::string outcome_of(const ObjectPipelineResult& result) {
    for (const char* reason : {"stamp repeats", "stamp goes back"}) {
      if (result.update.reasons.of(reason) != 0) return std::string("refused: ") + reason;
    }
    if (result.update.reasons.of("time jumped back: new map") != 0) return kNewMap;
    const bool hits = std::any_of(result.points.points.begin(), result.points.points.end(),
                                  [](const Point& point) { return is_hit(point.state); });
    return hits ? kMapped : kMappedBlind;
  }

  /// Constant work by stateless functions, which measures the momentary speed of the machine.
  void measure_yardstick() {
    const SyntheticScan& scan = feed_.any();
    const double begin_us = thread_cpu_us();
    const Segments segments =
        segment(project_horizontally(scan.scan, scan.T_world_lidar, scan.T_world_lidar_end), params_.segments);
    yardstick_.add(thread_cpu_us() - begin_us);
    if (segments.segments.empty()) throw std::logic_error("nothing in the simulated scans");
  }

  void report_block(std::int64_t i) {
    const Memory memory = situation_awareness::memory();
    const std::int64_t block = i / feed_.block_scans();
    const double scans = static_cast<double>(i + 1 - block * feed_.block_scans());
    const Json line = {{"scans", i + 1},
                       {"of", scans_},
                       {"hours", static_cast<double>(i + 1) / Feed::kRate_hz / 3600.0},
                       {"recorded", feed_.is_recorded(block)},
                       {"resident_bytes", memory.resident_bytes},
                       {"heap_bytes", memory.heap_bytes},
                       {"p50_us", times_.quantile(0.5)},
                       {"p99_us", times_.quantile(0.99)},
                       {"max_us", times_.quantile(1.0)},
                       {"yardstick_us", yardstick_.quantile(0.5)},
                       {"detections", static_cast<double>(detections_) / scans},
                       {"objects", static_cast<double>(objects_) / scans}};
    std::printf("%s\n", line.dump().c_str());
    std::fflush(stdout);
    times_.clear();
    yardstick_.clear();
    detections_ = objects_ = 0;
  }

  bool report_accounts() const {
    Json kinds = Json::array();
    std::uint64_t all = 0;
    bool accounted = true;
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      const Fate& fate = kFates[kind];
      Json outcomes = Json::object();
      std::uint64_t as_must_be = 0;
      for (const auto& [outcome, count] : outcomes_[kind]) {
        outcomes[outcome] = count;
        all += count;
        if (outcome == fate.outcome) as_must_be += count;
      }
      const std::int64_t sent = feed_.sent()[kind];
      accounted = accounted && static_cast<std::int64_t>(as_must_be) == sent && outcomes.size() <= 1;
      kinds.push_back({{"kind", fate.kind}, {"sent", sent}, {"must", fate.outcome}, {"outcomes", outcomes}});
    }
    accounted = accounted && static_cast<std::int64_t>(all) == scans_;
    const Json line = {{"sent", scans_}, {"accounted", accounted}, {"kinds", kinds}};
    std::printf("%s\n", line.dump().c_str());
    return accounted;
  }

  std::int64_t scans_;
  ObjectPipelineParams params_;
  ObjectPipeline pipeline_;
  Objects map_;  ///< the map that would be published
  Feed feed_;
  Times times_, yardstick_;
  std::array<Counters, kKinds> outcomes_;
  std::size_t detections_ = 0, objects_ = 0;  ///< sums over the block
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("soak", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    Soak soak(options, load_object_pipeline_params(options.config, options.models));
    return soak.run() ? 0 : 1;
  });
}
