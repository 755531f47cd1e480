// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <filesystem>
#include <stdexcept>

#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/network.hpp"
#include "situation_awareness/detections/paper_networks.hpp"
#include "situation_awareness/detections/probable_detector.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"

namespace situation_awareness {
namespace {

template <PaperNetwork::Kind kind>
std::unique_ptr<Detector> make_paper_network(const DetectionParams& params) {
  return std::make_unique<PaperNetworkDetector>(kind, model_path(params), params.fit);
}

std::unique_ptr<Detector> make_network(const DetectionParams& params) {
  return std::make_unique<NetworkDetector>(model_path(params), params.fit);
}

std::unique_ptr<Detector> make_least_squares(const DetectionParams& params) {
  return std::make_unique<LeastSquaresDetector>(params.fit);
}

constexpr const char* kShapeModel = "shape.onnx";

struct Entry {
  const char* name;
  const char* model;  ///< file of its network; empty: it has none
  std::unique_ptr<Detector> (*make)(const DetectionParams& params);
};

/// Every detector, by name.
constexpr std::array kDetectors = {
    Entry{"alex", "paper_alex.onnx", make_paper_network<PaperNetwork::Kind::kEllipse>},
    Entry{"circle", "paper_circle.onnx", make_paper_network<PaperNetwork::Kind::kCircle>},
    Entry{"least_squares", "", make_least_squares},
    Entry{"network", "ellipse.onnx", make_network},
    Entry{"vgg", "paper_vgg.onnx", make_paper_network<PaperNetwork::Kind::kEllipse>},
    Entry{"vgg_polar", "paper_vgg_polar.onnx", make_paper_network<PaperNetwork::Kind::kPolarEllipse>},
};

const Entry& entry_of(const std::string& name) {
  const auto entry = std::find_if(kDetectors.begin(), kDetectors.end(),
                                  [&](const Entry& candidate) { return candidate.name == name; });
  if (entry != kDetectors.end()) return *entry;
  std::string names;
  for (const std::string& known : detector_names()) names += (names.empty() ? "" : ", ") + known;
  throw std::invalid_argument("detections.detector = " + name + " is unknown, known are: " + names);
}

}  // namespace

void DetectionParams::validate() const {
  check_bounds(*this, "detections");
  fit.validate();
  const Entry& entry = entry_of(detector);
  if (*entry.model == '\0' && !model.empty()) {
    throw std::invalid_argument("detections.model = " + model + ", but detections.detector = " + detector +
                                " has no network");
  }
}

std::vector<std::string> detector_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kDetectors) names.emplace_back(entry.name);
  std::sort(names.begin(), names.end());
  return names;
}

std::string model_path(const DetectionParams& params) {
  const std::string file = params.model.empty() ? entry_of(params.detector).model : params.model;
  return file.empty() ? "" : (std::filesystem::path(params.model_folder) / file).string();
}

std::unique_ptr<ProbableDetector> make_detector(const DetectionParams& params) {
  params.validate();
  std::unique_ptr<Detector> detector = entry_of(params.detector).make(params);
  if (!params.boxes) return std::make_unique<ProbableDetector>(std::move(detector), params.min_p_ellipse, params.fit);
  const std::string shapes = (std::filesystem::path(params.model_folder) / kShapeModel).string();
  return std::make_unique<ProbableDetector>(std::move(detector), std::make_unique<ShapeNetwork>(shapes), params.fit);
}

}  // namespace situation_awareness
