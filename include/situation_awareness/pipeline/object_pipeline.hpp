// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/cloud/cloud.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/probable_detector.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/pipeline/arrivals.hpp"
#include "situation_awareness/pipeline/unmapped_segments.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/scan/cloud_slice.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

/// The detector and its parameters; `detector_names()` lists all detectors.
struct DetectionParams {
  std::string detector = "network";
  std::string model;         ///< ONNX file instead of the detector's own, absolute or in model_folder; empty: its own
  std::string model_folder;  ///< folder of models with relative paths
  double min_p_ellipse = 0.9;
  bool boxes = true;
  EllipseFitParams fit;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("detector", self.detector, "name of the detector");
    visit("model", self.model, "ONNX file instead of the detector's own, absolute or relative to model_folder");
    visit("min_p_ellipse", self.min_p_ellipse, Bounds{0.0, 1.0}, "",
          "minimum probability that a segment is one ellipse; a segment with less is rejected", kLive);
    visit("boxes", self.boxes,
          "detect what is not surely an ellipse as a box; min_p_ellipse is not used then (docs/math/boxes.md)");
    visit("fit", self.fit);
  }

  /// Throws std::invalid_argument naming field and bound, or the known detectors.
  void validate() const;
};

/// The names that DetectionParams::detector may have, sorted.
std::vector<std::string> detector_names();

/// Path of the network's file; empty for a detector without one.
std::string model_path(const DetectionParams& params);

/// All parameters of the pipeline from scan to map; cfg/objects.yaml mirrors it. `scan_pose_offset_s` is for those who
/// look up the poses of scans.
struct ObjectPipelineParams {
  double scan_pose_offset_s = 0.0;
  CloudSliceParams cloud;
  RangeLimiterParams scan;
  SegmentationParams segments;
  DetectionParams detections;
  ObjectMapParams objects;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("scan_pose_offset_s", self.scan_pose_offset_s, Bounds{-1.0, 1.0}, "s",
          "added to the stamp of a scan or cloud, it is the time of the pose that belongs to it: positive where poses "
          "are "
          "late, negative where scans are");
    visit("cloud", self.cloud);
    visit("scan", self.scan);
    visit("segments", self.segments);
    visit("detections", self.detections);
    visit("objects", self.objects);
  }
};

/// Read parameters from YAML text, as params_from_yaml does. Relative models are read from `model_folder`.
ObjectPipelineParams parse_object_pipeline_params(const std::string& yaml, const std::string& source,
                                                  const std::string& model_folder,
                                                  const OnUnknownKey& on_unknown_key = print_warning);

/// Same, from a file.
ObjectPipelineParams load_object_pipeline_params(const std::string& path, const std::string& model_folder,
                                                 const OnUnknownKey& on_unknown_key = print_warning);

/// The detector of the parameters. It refuses detections below min_p_ellipse as "not one ellipse". Throws
/// std::invalid_argument as DetectionParams::validate, and std::runtime_error naming an invalid model.
std::unique_ptr<ProbableDetector> make_detector(const DetectionParams& params);

/// The results of all stages for one scan.
struct ObjectPipelineResult {
  Points points;
  Segments segments;
  Detections detections;
  ObjectMapUpdate update;
  Objects objects;    ///< the map after its latest update
  Unmapped unmapped;  ///< compact segments that are not on it
};

/// From scan to map in one thread, without ROS: the same stages as the nodelets, for tests and offline use.
class ObjectPipeline {
 public:
  /// Throws std::invalid_argument or std::runtime_error naming the cause.
  explicit ObjectPipeline(const ObjectPipelineParams& params);

  /// Throws std::invalid_argument if the scan or the pose cannot be used; the map is then unchanged. The result is
  /// valid until the next call, which reuses its memory: no allocation after warm-up.
  const ObjectPipelineResult& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar);

  /// The same for a lidar that moves between its first beam, at the stamp, and its last.
  const ObjectPipelineResult& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                      const Eigen::Isometry3d& T_world_lidar_end);

  /// The same with expected outlines from `known` in place of the current map: a copy from messages, or an older map.
  const ObjectPipelineResult& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                      const Eigen::Isometry3d& T_world_lidar_end, const Objects& known);

  /// From the slice of a cloud (slice_cloud); T_world_sensor at its first measurement, T_world_sensor_end at its last.
  const ObjectPipelineResult& process(const Cloud& cloud, const Eigen::Isometry3d& T_world_sensor,
                                      const Eigen::Isometry3d& T_world_sensor_end);

  const ObjectMap& map() const { return map_; }
  /// To change the map between two scans; a reference is to be got again after each scan.
  ObjectMap& map() {
    map_may_have_changed_ = true;
    return map_;
  }

 private:
  ObjectPipelineParams params_;
  std::unique_ptr<ProbableDetector> detector_;
  ObjectMap map_;
  CloudSlice slice_;
  Scan limited_;
  bool map_may_have_changed_ = true;  ///< since result_.objects
  std::vector<ExpectedOutline> known_level_;
  Arrivals arrivals_;
  UnmappedSegments unmapped_;
  ObjectPipelineResult result_;
};

}  // namespace situation_awareness
