// SPDX-License-Identifier: BSD-3-Clause
// Any label images, of changing sizes and cameras, with any poses, into a semantic grid and its targets.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "input.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"

namespace situation_awareness::fuzz {
namespace {

std::shared_ptr<const Elevation> draw_elevation(Input& input) {
  const int width = input.integer(2, 12), height = input.integer(2, 12);
  std::vector<float> heights_m;
  for (int i = 0; i < width * height; ++i) {
    heights_m.push_back(input.integer(0, 9) == 0 ? std::numeric_limits<float>::quiet_NaN()
                                                 : static_cast<float>(input.uniform(-5.0, 5.0)));
  }
  const Eigen::Vector2d pixel_m(input.uniform(0.5, 6.0), input.uniform(0.5, 6.0));
  return std::make_shared<const Elevation>(width, height, Eigen::Vector2d(-20.0, 20.0), pixel_m, std::move(heights_m));
}

/// Mostly as a camera makes them.
SoftLabels draw_labels(Input& input) {
  const bool is_odd = input.integer(0, 7) == 0;
  const auto number = [&](double low, double high) { return is_odd ? input.any<double>() : input.uniform(low, high); };
  SoftLabels labels;
  labels.camera = {input.integer(is_odd ? -1 : 1, 9),
                   input.integer(is_odd ? -1 : 1, 9),
                   number(1.0, 20.0),
                   number(1.0, 20.0),
                   number(-2.0, 12.0),
                   number(-2.0, 12.0)};
  const int pixels = std::max(labels.camera.width, 0) * std::max(labels.camera.height, 0) - (is_odd ? 1 : 0);
  for (int i = 0; i < pixels; ++i) {
    labels.probability.push_back(input.integer(0, 7) == 0 ? input.any<float>()
                                                          : static_cast<float>(input.uniform(0.0, 1.0)));
  }
  return labels;
}

Eigen::Isometry3d draw_pose(Input& input) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const bool is_odd = input.integer(0, 15) == 0;
  for (int i = 0; i < 3; ++i) {
    T.translation()(i) = is_odd ? input.any<double>() : input.uniform(i == 2 ? -2.0 : -25.0, 25.0);
  }
  const Eigen::Vector3d axis(input.uniform(-1.0, 1.0), input.uniform(-1.0, 1.0), input.uniform(-1.0, 1.0));
  if (axis.norm() > 1e-3) {
    T.linear() = Eigen::AngleAxisd(input.uniform(-4.0, 4.0), axis.normalized()).toRotationMatrix();
  }
  return T;
}

void check_result(const GridPipeline& pipeline) {
  std::set<std::uint64_t> ids;
  for (const GridTarget& target : pipeline.targets().targets) {
    require(target.id != 0 && ids.insert(target.id).second, "ids are above 0 and different");
    require(target.p_world_m.head<2>().allFinite(), "a target is somewhere");
    require(target.covariance_m2.allFinite() && target.covariance_m2.determinant() >= 0.0 &&
                target.covariance_m2.trace() > 0.0,
            "and its covariance is one");
    require(target.probability >= 0.0 && target.probability <= 1.0 && target.area_m2 > 0.0, "a target has cells");
  }
  const SemanticGrid grid = pipeline.map().grid();
  for (std::size_t i = 0; i < grid.probability.size(); ++i) {
    const float probability = grid.probability[i];
    require(std::isnan(probability) || (probability >= 0.0F && probability <= 1.0F), "probabilities are in [0, 1]");
    require(std::isnan(probability) == (grid.images[i] == 0), "and are of cells that images show");
  }
}

void run(Input input) {
  GridPipelineParams params;
  params.grid.reach_m = 30.0;
  params.grid.cell_m = input.uniform(0.5, 2.0);
  params.keep_m = input.flag() ? 0.0 : input.uniform(5.0, 30.0);
  GridPipeline pipeline(params, draw_elevation(input));
  std::int64_t stamp_ns = 0;
  for (int image = 0; image < 6 && input.left(); ++image) {
    SoftLabels labels = draw_labels(input);
    labels.stamp_ns = stamp_ns += 500'000'000;
    drop_out_of_range(labels);
    std::optional<CameraPoseCovariance> covariance;
    if (input.flag()) covariance = std::pow(10.0, input.uniform(-6.0, 2.0)) * CameraPoseCovariance::Identity();
    try {
      pipeline.process(labels, draw_pose(input), covariance);
    } catch (const std::invalid_argument&) {  // of labels, camera or pose; nothing is changed
    }
    check_result(pipeline);
  }
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}
