// SPDX-License-Identifier: BSD-3-Clause
// Estimates of one detector on synthetic segments, and its times: the raw data of scripts/evaluate.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Cholesky>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/network.hpp"
#include "situation_awareness/detections/shape_network.hpp"
#include "situation_awareness/evaluation/dogleg.hpp"
#include "situation_awareness/evaluation/ransac.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kUsage =
    "usage: detection_evaluation answers MODEL_FOLDER DETECTOR CASE FIRST COUNT\n"
    "       detection_evaluation points CASE SEED\n"
    "       detection_evaluation times MODEL_FOLDER DETECTOR...\n"
    "\n"
    "answers: one row of 64-bit floats per sample on the standard output, samples with the seeds FIRST ... FIRST + "
    "COUNT - 1:\n"
    "  hits, mean range, one end hidden (0 or 1), truth (t_x t_y psi rx ry), answer (the same), p_ellipse, ordered "
    "and\n"
    "  symmetric characteristic distance, squared Mahalanobis distance of the truth in (t_x t_y m p q), p_box, kind (0 "
    "one\n"
    "  ellipse, 1 one box, 2 other); m and rad; NaN where there is no truth or no answer. The detector `shape` is the "
    "shape\n"
    "  network: truth and answer are the moment-equal ellipse of a box.\n"
    "points: x y of each hit of one sample, as text.\n"
    "times: microseconds of each detector per segment of the case `ellipse`, sixteen segments to a scan, on one "
    "thread;\n"
    "  median over rounds that take turns.\n";

constexpr std::size_t kScanSegments = 16;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

/// The estimate is evaluated, so only results that cannot be compared are refused, and none becomes a box.
DetectionParams detection_params(const std::string& detector, const std::string& model_folder) {
  DetectionParams params;
  params.detector = detector;
  params.model_folder = model_folder;
  params.min_p_ellipse = 0.0;
  params.boxes = false;
  params.fit.min_radius_m = 0.001;
  params.fit.max_radius_m = 100.0;
  params.fit.max_residual_m = 10.0;
  return params;
}

/// Any detector of a configuration, and the ellipse paper's baselines, which cannot be configured.
std::unique_ptr<Detector> make_any_detector(const DetectionParams& params) {
  if (params.detector == "dogleg") return std::make_unique<DoglegDetector>(DoglegParams{}, params.fit);
  if (params.detector == "ransac") return std::make_unique<RansacDetector>(RansacParams{}, DoglegParams{}, params.fit);
  return make_detector(params);
}

/// The segments of several samples as those of one scan. All have the resolution of the first.
Segments merge(const std::vector<SyntheticSegment>& samples) {
  Segments scan = samples.front().segments;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    Segment segment = samples[i].segments.segments.front();
    segment.first = scan.points.size();
    const std::vector<Point>& points = samples[i].segments.points;
    scan.points.insert(scan.points.end(), points.begin(), points.end());
    scan.segments.push_back(segment);
  }
  return scan;
}

struct Answer {
  bool given = false;
  Ellipse ellipse_level;
  Matrix5d covariance = Matrix5d::Identity();
  double p_ellipse = kNothing;
  double p_box = kNothing;
};

/// Runs any detector by its name.
class Asked {
 public:
  Asked(const std::string& detector, const std::string& model_folder) {
    const DetectionParams params = detection_params(detector, model_folder);
    if (detector == "network") {
      network_ = std::make_unique<EllipseNetwork>(model_path(params));
    } else if (detector == "shape") {
      shape_ = std::make_unique<ShapeNetwork>(model_folder + "/shape.onnx");
    } else {
      detector_ = make_any_detector(params);
    }
    fit_ = params.fit;
  }

  Answer answer(const SyntheticSegment& sample) {
    Answer result;
    if (network_) {  // with each sample's own noise
      const auto& estimate =
          network_->infer(sample.segments, {0}, sample.range_sigma_m, fit_.prior_max_radius_m).front();
      const Detection detection = make_detection(sample.segments, 0, fit_, estimate.smooth_level);
      return {true, detection.ellipse_level, estimate.covariance, estimate.p_ellipse, kNothing};
    }
    if (shape_) {
      const auto& estimate = shape_->infer(sample.segments, {0}, sample.range_sigma_m, fit_.prior_max_radius_m).front();
      const Detection detection = make_detection(sample.segments, 0, fit_, estimate.smooth_level);
      return {true, detection.ellipse_level, estimate.covariance, estimate.p_ellipse, estimate.p_box};
    }
    const Detections detections = detector_->detect(sample.segments);
    if (detections.detections.empty()) return result;
    const Detection& detection = detections.detections.front();
    return {true, detection.ellipse_level, detection.covariance, detection.p_ellipse, kNothing};
  }

  /// What it should have answered.
  std::optional<Ellipse> truth(const SyntheticSegment& sample) const {
    if (!shape_) return sample.ellipse_level;
    if (!sample.box_level) return std::nullopt;
    return canonical(moment_equal_ellipse(*sample.box_level));
  }

 private:
  std::unique_ptr<EllipseNetwork> network_;
  std::unique_ptr<ShapeNetwork> shape_;
  std::unique_ptr<Detector> detector_;
  EllipseFitParams fit_;
};

void append(std::vector<double>& row, const Ellipse& ellipse) {
  const Ellipse c = canonical(ellipse);
  row.insert(row.end(), {c.center_m.x(), c.center_m.y(), c.psi_rad, c.rx_m, c.ry_m});
}

void write_answers(Asked& asked, SegmentCase which, std::uint64_t first, std::uint64_t count) {
  std::vector<double> row;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    Random random(seed);
    const SyntheticSegment sample = draw_segment(which, random);
    const Segment& segment = sample.segments.segments.front();
    const Answer answer = asked.answer(sample);
    const std::optional<Ellipse> truth = asked.truth(sample);
    const auto& points = sample.segments.points;
    const double sum_m =
        std::accumulate(points.begin(), points.end(), 0.0, [](double sum, const Point& p) { return sum + p.range_m; });
    const bool hidden = !is_silhouette(segment.right_end) || !is_silhouette(segment.left_end);
    row = {static_cast<double>(segment.count), sum_m / static_cast<double>(points.size()), hidden ? 1.0 : 0.0};
    if (truth) {
      append(row, *truth);
    } else {
      row.insert(row.end(), 5, kNothing);
    }
    if (answer.given) {
      append(row, answer.ellipse_level);
    } else {
      row.insert(row.end(), 5, kNothing);
    }
    row.push_back(answer.p_ellipse);
    if (truth && answer.given) {
      const Vector5d error = smooth_parameters(answer.ellipse_level) - smooth_parameters(*truth);
      row.push_back(characteristic_distance(canonical(answer.ellipse_level), *truth));
      row.push_back(symmetric_characteristic_distance(answer.ellipse_level, *truth));
      row.push_back(error.dot(answer.covariance.llt().solve(error)));
    } else {
      row.insert(row.end(), 3, kNothing);
    }
    row.push_back(answer.p_box);
    row.push_back(sample.ellipse_level ? 0.0 : sample.box_level ? 1.0 : 2.0);
    if (std::fwrite(row.data(), sizeof(double), row.size(), stdout) != row.size()) {
      throw std::runtime_error("the standard output is closed");
    }
  }
}

void write_points(SegmentCase which, std::uint64_t seed) {
  Random random(seed);
  for (const Point& point : draw_segment(which, random).segments.points) {
    std::printf("%.6f %.6f\n", point.p_level_m.x(), point.p_level_m.y());
  }
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

void write_times(const std::string& model_folder, const std::vector<std::string>& names) {
  constexpr int kScans = 4;
  constexpr int kRounds = 15;
  std::vector<Segments> scans;
  Random random(1);
  for (int i = 0; i < kScans; ++i) {
    std::vector<SyntheticSegment> samples;
    for (std::size_t k = 0; k < kScanSegments; ++k) samples.push_back(draw_segment(SegmentCase::kEllipse, random));
    scans.push_back(merge(samples));
  }
  std::vector<std::unique_ptr<Detector>> detectors;
  for (const std::string& name : names) detectors.push_back(make_any_detector(detection_params(name, model_folder)));
  std::vector<std::vector<double>> times_us(names.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < detectors.size(); ++i) {
      const auto start = std::chrono::steady_clock::now();
      for (const Segments& scan : scans) detectors[i]->detect(scan);
      const std::chrono::duration<double, std::micro> spent = std::chrono::steady_clock::now() - start;
      if (round > 0) times_us[i].push_back(spent.count() / static_cast<double>(kScans * kScanSegments));
    }
  }
  for (std::size_t i = 0; i < names.size(); ++i) std::printf("%s %.3f\n", names[i].c_str(), median(times_us[i]));
}

int run(const std::vector<std::string>& arguments) {
  const auto number = [&](std::size_t i) { return static_cast<std::uint64_t>(std::stoull(arguments[i])); };
  if (arguments.size() == 6 && arguments[0] == "answers") {
    Asked asked(arguments[2], arguments[1]);
    write_answers(asked, segment_case(arguments[3]), number(4), number(5));
  } else if (arguments.size() == 3 && arguments[0] == "points") {
    write_points(segment_case(arguments[1]), number(2));
  } else if (arguments.size() >= 3 && arguments[0] == "times") {
    write_times(arguments[1], {arguments.begin() + 2, arguments.end()});
  } else {
    std::fputs(kUsage, stderr);
    return 2;
  }
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  try {
    return situation_awareness::run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "detection_evaluation: %s\n", error.what());
    return 1;
  }
}
