// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include <Eigen/Geometry>

#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

struct DetectionParams {
  std::string model;  ///< path of the ONNX file; empty: least squares without a model
  EllipseFitParams fit;
};

/// All parameters of the way from scan to map; cfg/objects.yaml mirrors it.
struct ObjectPipelineParams {
  RangeLimiterParams scan;
  SegmentationParams segments;
  DetectionParams detections;
  ObjectMapParams objects;
};

/// Read parameters from YAML text; what it leaves out keeps its default. A relative detections.model is taken relative
/// to `model_folder`. Throws std::invalid_argument with one sentence that names `source`, the field and its bound for
/// an unknown key, a wrong type and a value out of bounds.
ObjectPipelineParams parse_object_pipeline_params(const std::string& yaml, const std::string& source,
                                                  const std::string& model_folder);

/// Same, from a file; models are looked for in `model_folder`.
ObjectPipelineParams load_object_pipeline_params(const std::string& path, const std::string& model_folder);

/// The detector that the parameters ask for: the network, or least squares where no model is named.
std::unique_ptr<Detector> make_detector(const DetectionParams& params);

/// What each stage made of one scan.
struct ObjectPipelineResult {
  Points points;
  Segments segments;
  Detections detections;
  ObjectMapUpdate update;
};

/// From scan to map in one thread, without ROS: what the nodelets do between them, for tests and offline use.
class ObjectPipeline {
 public:
  /// Throws std::invalid_argument or std::runtime_error naming what is wrong.
  explicit ObjectPipeline(const ObjectPipelineParams& params);

  /// Throws std::invalid_argument if the scan or the pose cannot be used; the map is then unchanged.
  ObjectPipelineResult process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar);

  const ObjectMap& map() const { return map_; }

 private:
  ObjectPipelineParams params_;
  std::unique_ptr<Detector> detector_;
  ObjectMap map_;
};

}  // namespace situation_awareness
