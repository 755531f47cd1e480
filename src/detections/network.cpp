// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include <openssl/evp.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/dnn.hpp>

#include "situation_awareness/detections/detect_each.hpp"

namespace situation_awareness {
namespace {

constexpr int kMiddle = EllipseNetwork::kBeams / 2;
constexpr int kOutputs = 5;
constexpr double kRangeScale = 0.1;         // docs/math/detections.md, eq. 2
constexpr double kDeviationGain = 4.0;      // the same
constexpr double kMinRadiusM = 0.01;        // the network's answer is not bounded
constexpr double kGoldenToleranceM = 1e-4;  // processors differ by 1e-6, damaged weights by more than this
constexpr int kManifestVersion = 1;

struct Golden {
  int first = 0;  ///< index of its first input that is not 0
  std::vector<float> input;
  std::vector<float> output;
};

struct Manifest {
  std::string sha256;
  Golden golden;
};

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!std::filesystem::is_regular_file(path) || !file) throw std::runtime_error(path + ": cannot be read");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::string sha256(const std::string& content) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  if (EVP_Digest(content.data(), content.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1) {
    throw std::runtime_error("SHA-256 is not available from OpenSSL");
  }
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    std::array<char, 3> byte{};
    std::snprintf(byte.data(), byte.size(), "%02x", digest[i]);
    text += byte.data();
  }
  return text;
}

std::string manifest_path(const std::string& onnx_path) {
  const std::string extension = ".onnx";
  const bool has_extension = onnx_path.size() > extension.size() &&
                             onnx_path.compare(onnx_path.size() - extension.size(), extension.size(), extension) == 0;
  if (!has_extension) throw std::runtime_error(onnx_path + ": not the name of an .onnx file");
  return onnx_path.substr(0, onnx_path.size() - extension.size()) + ".manifest.yaml";
}

Manifest read_manifest(const std::string& path) {
  const std::string text = read_file(path);
  Manifest manifest;
  try {
    const YAML::Node root = YAML::Load(text);
    const int version = root["version"].as<int>();
    if (version != kManifestVersion) throw std::runtime_error("unknown version " + std::to_string(version));
    manifest.sha256 = root["sha256"].as<std::string>();
    manifest.golden.first = root["golden"]["first"].as<int>();
    manifest.golden.input = root["golden"]["input"].as<std::vector<float>>();
    manifest.golden.output = root["golden"]["output"].as<std::vector<float>>();
  } catch (const std::exception& error) {
    throw std::runtime_error(path + ": not a manifest of an ellipse network (" + error.what() + ")");
  }
  const Golden& golden = manifest.golden;
  const auto last = static_cast<long>(golden.first) + static_cast<long>(golden.input.size());
  if (golden.first < 0 || last > EllipseNetwork::kBeams || golden.output.size() != kOutputs) {
    throw std::runtime_error(path + ": its golden vector does not have the network's shape");
  }
  return manifest;
}

/// Hits of one segment on the network's grid: ranges at the indices first ... first + ranges.size() - 1.
struct Resampled {
  int first = 0;
  std::vector<double> ranges_m;
  double mean_range_m = 0.0;
};

/// Docs/math/detections.md, eq. 1. The middle point lies exactly on the grid, so there is always a hit.
Resampled resample(const Segments& segments, const Segment& segment) {
  const Point* const points = &segments.points[segment.first];
  const std::size_t count = segment.count;
  const double middle_rad = points[count / 2].azimuth_rad;
  const auto in_beams = [&](double azimuth_rad) { return (azimuth_rad - middle_rad) / EllipseNetwork::kResolutionRad; };

  // A beam exactly half a beam beyond the outermost hit is no hit: it belongs as much to the miss beside it. The
  // tolerance is that of single-precision angles over a scan.
  const double reach_beams = 0.5 * segments.resolution_rad / EllipseNetwork::kResolutionRad - 1e-3;
  const double low = std::ceil(in_beams(points[0].azimuth_rad) - reach_beams);
  const double high = std::floor(in_beams(points[count - 1].azimuth_rad) + reach_beams);
  const int first = static_cast<int>(std::clamp(low, static_cast<double>(-kMiddle), 0.0));
  const int last = static_cast<int>(std::clamp(high, 0.0, static_cast<double>(kMiddle)));

  Resampled resampled;
  resampled.first = kMiddle + first;
  std::size_t right = 0;  // the last point at or before the beam
  double sum = 0.0;
  for (int k = first; k <= last; ++k) {
    const double beam = k;
    while (right + 1 < count && in_beams(points[right + 1].azimuth_rad) <= beam) ++right;
    double range_m = points[right].range_m;
    const double from = in_beams(points[right].azimuth_rad);
    if (right + 1 < count && beam > from) {
      const double to = in_beams(points[right + 1].azimuth_rad);
      range_m += (beam - from) / (to - from) * (points[right + 1].range_m - range_m);
    }
    resampled.ranges_m.push_back(range_m);
    sum += range_m;
  }
  resampled.mean_range_m = sum / static_cast<double>(resampled.ranges_m.size());
  return resampled;
}

/// The network's answer (docs/math/detections.md, eq. 3) as an ellipse in the level frame.
Ellipse to_level(const float* answer, double mean_range_m, double middle_rad) {
  const double m = answer[2];
  const double p = answer[3];
  const double q = answer[4];
  const double half_difference = std::hypot(p, q);
  Ellipse ellipse_segment;
  ellipse_segment.center_m = {mean_range_m + answer[0], static_cast<double>(answer[1])};
  ellipse_segment.psi_rad = 0.5 * std::atan2(q, p);
  ellipse_segment.rx_m = std::max(m + half_difference, kMinRadiusM);
  ellipse_segment.ry_m = std::max(m - half_difference, kMinRadiusM);
  const Pose2 T_level_segment{Eigen::Vector2d::Zero(), middle_rad};
  return canonical(T_level_segment * ellipse_segment);
}

}  // namespace

class EllipseNetwork::Impl {
 public:
  explicit Impl(const std::string& onnx_path) {
    const std::string manifest_file = manifest_path(onnx_path);
    const std::string onnx = read_file(onnx_path);
    const Manifest manifest = read_manifest(manifest_file);
    // OpenCV's importer can be brought down by a damaged file, so it sees none (docs/math/detections.md).
    if (sha256(onnx) != manifest.sha256) {
      throw std::runtime_error(onnx_path + ": its SHA-256 is not the one in " + manifest_file +
                               ": damaged, or of another version");
    }
    try {
      net_ = cv::dnn::readNetFromONNX(onnx.data(), onnx.size());
      net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
      net_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
      check_golden(manifest.golden);
    } catch (const cv::Exception& error) {  // its what() is a page, its err the sentence
      throw std::runtime_error(onnx_path + ": not usable as the ellipse network (" + error.err + ")");
    } catch (const std::exception& error) {
      throw std::runtime_error(onnx_path + ": not usable as the ellipse network (" + error.what() + ")");
    }
  }

  /// One row of inputs per segment, all zero.
  void resize(int rows) {
    const std::array<int, 4> shape{rows, 1, 1, kBeams};
    input_.create(static_cast<int>(shape.size()), shape.data(), CV_32F);
    input_.setTo(0.0F);
  }

  float* input(int row) { return input_.ptr<float>(row); }

  /// One row of kOutputs answers per row of inputs.
  const cv::Mat& forward() {
    // OpenCV runs what is nested in one of its parallel loops on the calling thread, so a loop of one turn keeps this
    // forward from waking a thread per core beside the nodelet manager's own; cv::setNumThreads would say the same to
    // everyone else's OpenCV in the process.
    cv::parallel_for_(cv::Range(0, 1), [this](const cv::Range&) {
      net_.setInput(input_);
      net_.forward(output_);
    });
    if (output_.dims != 2 || output_.rows != input_.size[0] || output_.cols != kOutputs || output_.type() != CV_32F) {
      throw std::runtime_error("the network does not answer with 5 numbers per segment");
    }
    return output_;
  }

 private:
  void check_golden(const Golden& golden) {
    resize(1);
    std::copy(golden.input.begin(), golden.input.end(), input(0) + golden.first);
    const float* const answer = forward().ptr<float>(0);
    for (std::size_t i = 0; i < golden.output.size(); ++i) {
      if (std::abs(answer[i] - golden.output[i]) <= kGoldenToleranceM) continue;  // false for NaN
      throw std::runtime_error("its answer to the golden vector of its manifest is wrong");
    }
  }

  cv::dnn::Net net_;
  cv::Mat input_;
  cv::Mat output_;
};

EllipseNetwork::EllipseNetwork(const std::string& onnx_path) : impl_(std::make_unique<Impl>(onnx_path)) {}
EllipseNetwork::~EllipseNetwork() = default;
EllipseNetwork::EllipseNetwork(EllipseNetwork&&) noexcept = default;
EllipseNetwork& EllipseNetwork::operator=(EllipseNetwork&&) noexcept = default;

std::vector<Ellipse> EllipseNetwork::infer(const Segments& segments, const std::vector<std::size_t>& which) {
  std::vector<Ellipse> ellipses;
  if (which.empty()) return ellipses;

  impl_->resize(static_cast<int>(which.size()));
  std::vector<double> mean_ranges_m;
  for (std::size_t row = 0; row < which.size(); ++row) {
    const Resampled hits = resample(segments, segments.segments[which[row]]);
    float* const input = impl_->input(static_cast<int>(row)) + hits.first;
    std::transform(hits.ranges_m.begin(), hits.ranges_m.end(), input, [&](double range_m) {
      return static_cast<float>(kRangeScale * hits.mean_range_m + kDeviationGain * (range_m - hits.mean_range_m));
    });
    mean_ranges_m.push_back(hits.mean_range_m);
  }

  const cv::Mat& answers = impl_->forward();
  for (std::size_t row = 0; row < which.size(); ++row) {
    const Segment& segment = segments.segments[which[row]];
    const double middle_rad = segments.points[segment.first + segment.count / 2].azimuth_rad;
    ellipses.push_back(to_level(answers.ptr<float>(static_cast<int>(row)), mean_ranges_m[row], middle_rad));
  }
  return ellipses;
}

NetworkDetector::NetworkDetector(const std::string& onnx_path, const EllipseFitParams& params)
    : network_(onnx_path), params_(params) {
  params_.validate();
}

Detections NetworkDetector::detect(const Segments& segments) {
  whole_.clear();
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    const Segment& segment = segments.segments[i];
    if (segment.kind != SegmentKind::kObject) continue;
    if (is_silhouette(segment.right_end) && is_silhouette(segment.left_end)) whole_.push_back(i);
  }
  const std::vector<Ellipse> ellipses = network_.infer(segments, whole_);

  std::size_t next_whole = 0;
  return detect_each(segments, params_, [&](std::size_t i) {
    const bool whole = next_whole < whole_.size() && whole_[next_whole] == i;
    return whole ? assess_ellipse(segments, i, params_, ellipses[next_whole++]) : fit_ellipse(segments, i, params_);
  });
}

}  // namespace situation_awareness
