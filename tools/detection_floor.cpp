// SPDX-License-Identifier: BSD-3-Clause
// The floor: the lowest expected loss of any detector on synthetic segments (docs/math/floor.md).
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "command_line.hpp"
#include "situation_awareness/evaluation/box_posterior.hpp"
#include "situation_awareness/evaluation/ellipse_posterior.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/box.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kDescription =
    R"(For each synthetic segment: the estimate of least expected error given the posterior of the model that made the
segment, its expected error, and its error against the truth. One line of CSV per segment.
)";

struct Options {
  SegmentCase segment_case = SegmentCase::kEllipse;
  std::string out;
  std::uint64_t samples = 2000;
  std::uint64_t first_seed = 1;
  std::uint64_t threads = 1;
  std::uint64_t effective_samples = 4000;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option_function(
         "--case", [&options](const std::string& name) { options.segment_case = segment_case(name); },
         "ellipse, circle, occluded, boxes or faces")
      .required()
      .type_name("NAME")
      .check(one_of({"ellipse", "circle", "occluded", "boxes", "faces"}));
  app.add_option("--out", options.out, "where the lines go").required().type_name("FILE.csv");
  const auto number = [&app](const char* name, std::uint64_t& value, double low, const char* what) {
    app.add_option(name, value, what).type_name("N").check(from_to(low, 1e9));
  };
  number("--samples", options.samples, 1.0, "segments");
  number("--first-seed", options.first_seed, 0.0, "segment k is drawn with the seed N + k");
  number("--threads", options.threads, 1.0, "the output does not depend on it");
  number("--effective-samples", options.effective_samples, 1.0, "of each posterior");
}

/// A segment with its ground truth and its observation.
struct Sample {
  SegmentModel model;
  std::optional<BoxPrior> boxes;
  SegmentObservation observation;
  Ellipse truth;
};

Sample draw_sample(SegmentCase which, std::uint64_t seed) {
  Random random(seed);
  const SyntheticSegment drawn = draw_segment(which, random);
  const Segments& segments = drawn.segments;
  const Segment& segment = segments.segments.at(0);
  Sample sample;
  sample.truth = drawn.box_level ? canonical(moment_equal_ellipse(*drawn.box_level)) : drawn.ellipse_level.value();
  if (drawn.box_level) sample.boxes = BoxPrior{};
  if (which == SegmentCase::kFaces) sample.boxes->one_face = true;
  sample.model.range_sigma_m = drawn.range_sigma_m;
  if (which == SegmentCase::kCircle) {
    sample.model.shape = ObjectShape::kCircle;
    sample.model.min_hits = 4;
  }
  SegmentObservation& observation = sample.observation;
  observation.first_beam = segments.points.at(segment.first).beam;
  for (std::size_t i = 0; i < segment.count; ++i) {
    observation.ranges_m.push_back(segments.points.at(segment.first + i).range_m);
  }
  const auto beams = [&](double angle_rad) {
    return static_cast<int>(std::lround(angle_rad / segments.resolution_rad));
  };
  if (!is_silhouette(segment.right_end)) {
    observation.hidden_end = HiddenEnd::kRight;
    observation.blocked_beams = beams(segment.right_hidden_rad);
  } else if (!is_silhouette(segment.left_end)) {
    observation.hidden_end = HiddenEnd::kLeft;
    observation.blocked_beams = beams(segment.left_hidden_rad);
  }
  return sample;
}

EllipsePosterior posterior_of(const Sample& sample, double effective_samples, Random& random) {
  constexpr std::size_t kDraws = 8192;
  if (!sample.boxes) return sample_posterior(sample.observation, sample.model, effective_samples, kDraws, random);
  return sample_box_posterior(sample.observation, sample.model, *sample.boxes, effective_samples, kDraws, random);
}

int beams_that_meet(const Ellipse& ellipse, const SegmentModel& model) {
  int count = 0;
  for (int beam = 0; beam < model.beams; ++beam) {
    const double azimuth_rad = model.first_azimuth_rad + beam * model.resolution_rad;
    const Eigen::Vector2d direction(std::cos(azimuth_rad), std::sin(azimuth_rad));
    count += intersect_ray(ellipse, Eigen::Vector2d::Zero(), direction) ? 1 : 0;
  }
  return count;
}

struct Floor {
  std::size_t hits = 0;
  double distance_m = 0.0;
  double hidden_share = 0.0;       ///< of the beams that would hit
  double symmetric_psi_rad = 0.0;  ///< of the estimate by the symmetric loss
  std::vector<double> expected;    ///< by loss
  std::vector<double> achieved;
  double effective_samples = 0.0;
};

std::vector<DetectionLoss> losses_of(SegmentCase which) {
  if (which == SegmentCase::kCircle) return {DetectionLoss::kCircleSquared, DetectionLoss::kCircle};
  return {DetectionLoss::kOrdered, DetectionLoss::kSymmetric};
}

/// The estimate is chosen by one posterior sample and evaluated by another, so that it has no bias by selection.
Floor floor_of(const Options& options, std::uint64_t seed) {
  constexpr std::uint64_t kSeedOfSampler = 0x9e3779b97f4a7c15;  // so that it does not repeat the segment's numbers
  const Sample sample = draw_sample(options.segment_case, seed);
  Random random(seed ^ kSeedOfSampler);
  const auto effective = static_cast<double>(options.effective_samples);
  const EllipsePosterior chooser = posterior_of(sample, effective, random);
  const EllipsePosterior judge = posterior_of(sample, effective, random);
  Floor floor;
  floor.hits = sample.observation.ranges_m.size();
  floor.distance_m = sample.truth.center_m.norm();
  if (!sample.boxes) {
    floor.hidden_share = 1.0 - static_cast<double>(floor.hits) / beams_that_meet(sample.truth, sample.model);
  }
  floor.effective_samples = std::min(chooser.effective_samples, judge.effective_samples);
  for (const DetectionLoss loss : losses_of(options.segment_case)) {
    const Ellipse estimate = bayes_estimate(loss, chooser.draws);
    floor.expected.push_back(expected_loss(loss, estimate, judge.draws));
    floor.achieved.push_back(loss_of(loss, estimate, sample.truth));
    if (loss == DetectionLoss::kSymmetric) floor.symmetric_psi_rad = estimate.psi_rad;
  }
  return floor;
}

/// All floors, in the order of their seeds.
std::vector<Floor> floors_of(const Options& options) {
  std::vector<Floor> floors(options.samples);
  std::atomic<std::uint64_t> next{0};
  std::atomic<std::uint64_t> done{0};
  std::exception_ptr failure;
  std::mutex mutex;
  const auto work = [&] {
    for (std::uint64_t k = next++; k < options.samples; k = next++) {
      try {
        floors[k] = floor_of(options, options.first_seed + k);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        failure = std::current_exception();
        next = options.samples;
        return;
      }
      const std::uint64_t count = ++done;
      if (count % 50 == 0 || count == options.samples) {
        const std::lock_guard<std::mutex> lock(mutex);
        std::fprintf(stderr, "\r%llu of %llu", static_cast<unsigned long long>(count),
                     static_cast<unsigned long long>(options.samples));
      }
    }
  };
  std::vector<std::thread> threads;
  for (std::uint64_t i = 0; i < options.threads; ++i) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::fputc('\n', stderr);
  if (failure) std::rethrow_exception(failure);
  return floors;
}

void write(const Options& options, const std::vector<Floor>& floors) {
  const bool circle = options.segment_case == SegmentCase::kCircle;
  std::ofstream file(options.out);
  file << "seed,hits,distance_m," << (circle ? "" : "hidden_share,symmetric_psi_rad,")
       << (circle ? "expected_squared_m2,achieved_squared_m2,expected_mean_m,achieved_mean_m,"
                  : "expected_ordered_m,achieved_ordered_m,expected_symmetric_m,achieved_symmetric_m,")
       << "effective_samples\n";
  file.precision(9);
  for (std::size_t k = 0; k < floors.size(); ++k) {
    const Floor& floor = floors[k];
    file << options.first_seed + k << ',' << floor.hits << ',' << floor.distance_m;
    if (!circle) file << ',' << floor.hidden_share << ',' << floor.symmetric_psi_rad;
    for (std::size_t i = 0; i < floor.expected.size(); ++i)
      file << ',' << floor.expected[i] << ',' << floor.achieved[i];
    file << ',' << floor.effective_samples << '\n';
  }
  file.close();
  if (!file) throw std::runtime_error("cannot write " + options.out);
}

/// Means over the segments with their standard errors.
void print_summary(const Options& options, const std::vector<Floor>& floors) {
  const bool circle = options.segment_case == SegmentCase::kCircle;
  const std::vector<std::string> names = circle ? std::vector<std::string>{"squared, m^2", "mean, m"}
                                                : std::vector<std::string>{"ordered, m", "symmetric, m"};
  const auto mean_and_error = [&](const auto& value_of) {
    double sum = 0.0;
    double sum_of_squares = 0.0;
    for (const Floor& floor : floors) {
      sum += value_of(floor);
      sum_of_squares += value_of(floor) * value_of(floor);
    }
    const auto n = static_cast<double>(floors.size());
    const double mean = sum / n;
    return std::make_pair(mean, std::sqrt(std::max(0.0, sum_of_squares / n - mean * mean) / n));
  };
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto [expected, expected_error] = mean_and_error([&](const Floor& f) { return f.expected[i]; });
    const auto [achieved, achieved_error] = mean_and_error([&](const Floor& f) { return f.achieved[i]; });
    const auto [excess, excess_error] = mean_and_error([&](const Floor& f) { return f.achieved[i] - f.expected[i]; });
    std::printf("%-12s expected %.4g +- %.2g, achieved %.4g +- %.2g, difference %+.2g +- %.2g\n", names[i].c_str(),
                expected, expected_error, achieved, achieved_error, excess, excess_error);
  }
  double least = floors.front().effective_samples;
  for (const Floor& floor : floors) least = std::min(least, floor.effective_samples);
  std::printf("least effective samples %.0f\n", least);
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("detection_floor", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    const std::vector<Floor> floors = floors_of(options);
    write(options, floors);
    print_summary(options, floors);
    return 0;
  });
}
