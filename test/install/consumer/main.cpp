// SPDX-License-Identifier: BSD-3-Clause
// Core, conversions and messages of an installed situation_awareness: a round object before a scanner is mapped. Prints
// the number of elements.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>

#include <situation_awareness/MappedObjectArray.h>
#include <Eigen/Geometry>
#include <situation_awareness/pipeline/object_pipeline.hpp>
#include <situation_awareness/ros/convert/objects.hpp>
#include <situation_awareness/scan/scan.hpp>

int main() {
  using namespace situation_awareness;
  ObjectPipelineParams params;
  params.detections.detector = "least_squares";
  params.detections.boxes = false;  // neither of them needs a model
  ObjectPipeline pipeline(params);

  constexpr double kDistance_m = 3.0, kRadius_m = 0.25;
  Scan scan;
  scan.angle_min_rad = -1.0;
  scan.angle_increment_rad = 0.005;
  for (int i = 0; i < 401; ++i) {
    const double angle_rad = scan.angle_min_rad + i * scan.angle_increment_rad;
    const double aside_m = kDistance_m * std::sin(angle_rad);
    const double depth_m = std::sqrt(kRadius_m * kRadius_m - aside_m * aside_m);  // NaN beside the object
    const double range_m = kDistance_m * std::cos(angle_rad) - depth_m;
    scan.beams.push_back(beam_from_range(
        std::isfinite(range_m) ? static_cast<float>(range_m) : std::numeric_limits<float>::infinity(), 0.1F, 30.0F));
  }
  for (std::int64_t k = 1; k <= 40; ++k) {
    scan.stamp_ns = k * 50'000'000;
    pipeline.process(scan, Eigen::Isometry3d::Identity());
  }
  const MappedObjectArray map = objects_to_msg(pipeline.map().at(scan.stamp_ns), "world");
  std::printf("%zu\n", map.objects.size());
}
