// SPDX-License-Identifier: BSD-3-Clause
// The floor: the least error that any detector can expect on synthetic segments (docs/math/floor.md).
#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "situation_awareness/evaluation/ellipse_posterior.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kUsage =
    "usage: detection_floor --case ellipse|circle|occluded --out FILE.csv [options]\n"
    "\n"
    "For each synthetic segment: the estimate of least expected error given the posterior of the model that made the\n"
    "segment, its expected error, and its error against the truth. One line of CSV per segment.\n"
    "\n"
    "  --samples N             segments (default 2000)\n"
    "  --first-seed N          segment k is drawn with the seed N + k (default 1)\n"
    "  --threads N             (default 1); the output does not depend on it\n"
    "  --effective-samples N   of each posterior (default 4000)\n"
    "  --help                  this text\n";

struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Arguments {
  SegmentCase segment_case = SegmentCase::kEllipse;
  std::string out;
  std::uint64_t samples = 2000;
  std::uint64_t first_seed = 1;
  std::uint64_t threads = 1;
  std::uint64_t effective_samples = 4000;
  bool help = false;
};

std::uint64_t number(const std::string& option, const std::string& text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw UsageError(option + ": '" + text + "' is not a number");
  }
  return value;
}

Arguments parse(const std::vector<std::string>& words) {
  Arguments arguments;
  std::string which;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& option = words[i];
    if (option == "--help") {
      arguments.help = true;
      return arguments;
    }
    if (i + 1 == words.size()) throw UsageError(option + ": unknown, or without its value");
    const std::string& value = words[++i];
    if (option == "--case") {
      which = value;
    } else if (option == "--out") {
      arguments.out = value;
    } else if (option == "--samples") {
      arguments.samples = number(option, value);
    } else if (option == "--first-seed") {
      arguments.first_seed = number(option, value);
    } else if (option == "--threads") {
      arguments.threads = number(option, value);
    } else if (option == "--effective-samples") {
      arguments.effective_samples = number(option, value);
    } else {
      throw UsageError("unknown option " + option);
    }
  }
  if (which != "ellipse" && which != "circle" && which != "occluded") {
    throw UsageError("--case must be ellipse, circle or occluded");
  }
  arguments.segment_case = segment_case(which);
  if (arguments.out.empty()) throw UsageError("--out is missing");
  if (arguments.samples == 0 || arguments.threads == 0 || arguments.effective_samples == 0) {
    throw UsageError("--samples, --threads and --effective-samples must be positive");
  }
  return arguments;
}

/// A segment, what made it and what is seen of it.
struct Sample {
  SegmentModel model;
  SegmentObservation observation;
  Ellipse truth;
};

Sample draw_sample(SegmentCase which, std::uint64_t seed) {
  Random random(seed);
  const SyntheticSegment drawn = draw_segment(which, random);
  const Segments& segments = drawn.segments;
  const Segment& segment = segments.segments.at(0);
  Sample sample;
  sample.truth = drawn.ellipse_level.value();
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

/// The estimate is chosen by one posterior sample and judged by another, so that it does not profit from chance.
Floor floor_of(const Arguments& arguments, std::uint64_t seed) {
  constexpr std::uint64_t kSeedOfSampler = 0x9e3779b97f4a7c15;  // so that it does not repeat the segment's numbers
  constexpr std::size_t kDraws = 8192;
  const Sample sample = draw_sample(arguments.segment_case, seed);
  Random random(seed ^ kSeedOfSampler);
  const auto effective = static_cast<double>(arguments.effective_samples);
  const EllipsePosterior chooser = sample_posterior(sample.observation, sample.model, effective, kDraws, random);
  const EllipsePosterior judge = sample_posterior(sample.observation, sample.model, effective, kDraws, random);
  Floor floor;
  floor.hits = sample.observation.ranges_m.size();
  floor.distance_m = sample.truth.center_m.norm();
  floor.hidden_share = 1.0 - static_cast<double>(floor.hits) / beams_that_meet(sample.truth, sample.model);
  floor.effective_samples = std::min(chooser.effective_samples, judge.effective_samples);
  for (const DetectionLoss loss : losses_of(arguments.segment_case)) {
    const Ellipse estimate = bayes_estimate(loss, chooser.draws);
    floor.expected.push_back(expected_loss(loss, estimate, judge.draws));
    floor.achieved.push_back(loss_of(loss, estimate, sample.truth));
    if (loss == DetectionLoss::kSymmetric) floor.symmetric_psi_rad = estimate.psi_rad;
  }
  return floor;
}

/// All floors, in the order of their seeds.
std::vector<Floor> floors_of(const Arguments& arguments) {
  std::vector<Floor> floors(arguments.samples);
  std::atomic<std::uint64_t> next{0};
  std::atomic<std::uint64_t> done{0};
  std::exception_ptr failure;
  std::mutex mutex;
  const auto work = [&] {
    for (std::uint64_t k = next++; k < arguments.samples; k = next++) {
      try {
        floors[k] = floor_of(arguments, arguments.first_seed + k);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        failure = std::current_exception();
        next = arguments.samples;
        return;
      }
      const std::uint64_t count = ++done;
      if (count % 50 == 0 || count == arguments.samples) {
        const std::lock_guard<std::mutex> lock(mutex);
        std::fprintf(stderr, "\r%llu of %llu", static_cast<unsigned long long>(count),
                     static_cast<unsigned long long>(arguments.samples));
      }
    }
  };
  std::vector<std::thread> threads;
  for (std::uint64_t i = 0; i < arguments.threads; ++i) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::fputc('\n', stderr);
  if (failure) std::rethrow_exception(failure);
  return floors;
}

void write(const Arguments& arguments, const std::vector<Floor>& floors) {
  const bool circle = arguments.segment_case == SegmentCase::kCircle;
  std::ofstream file(arguments.out);
  file << "seed,hits,distance_m," << (circle ? "" : "hidden_share,symmetric_psi_rad,")
       << (circle ? "expected_squared_m2,achieved_squared_m2,expected_mean_m,achieved_mean_m,"
                  : "expected_ordered_m,achieved_ordered_m,expected_symmetric_m,achieved_symmetric_m,")
       << "effective_samples\n";
  file.precision(9);
  for (std::size_t k = 0; k < floors.size(); ++k) {
    const Floor& floor = floors[k];
    file << arguments.first_seed + k << ',' << floor.hits << ',' << floor.distance_m;
    if (!circle) file << ',' << floor.hidden_share << ',' << floor.symmetric_psi_rad;
    for (std::size_t i = 0; i < floor.expected.size(); ++i)
      file << ',' << floor.expected[i] << ',' << floor.achieved[i];
    file << ',' << floor.effective_samples << '\n';
  }
  file.close();
  if (!file) throw std::runtime_error("cannot write " + arguments.out);
}

/// Means over the segments with their standard errors.
void print_summary(const Arguments& arguments, const std::vector<Floor>& floors) {
  const bool circle = arguments.segment_case == SegmentCase::kCircle;
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

int run(const std::vector<std::string>& words) {
  try {
    const Arguments arguments = parse(words);
    if (arguments.help) {
      std::fputs(kUsage, stdout);
      return 0;
    }
    const std::vector<Floor> floors = floors_of(arguments);
    write(arguments, floors);
    print_summary(arguments, floors);
    return 0;
  } catch (const UsageError& error) {
    std::fprintf(stderr, "detection_floor: %s\n%s", error.what(), kUsage);
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "detection_floor: %s\n", error.what());
    return 1;
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) { return situation_awareness::run({argv + 1, argv + argc}); }
