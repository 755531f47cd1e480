// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/params/elevation_params.hpp"

namespace situation_awareness {

class CommandLineOption;

/// Where the images of a camera are, and what they are mapped over.
struct ImageOptions {
  std::string labels_topic = "/camera/labels";
  std::string image_topic;  ///< of images that a network labels, instead of labels
  std::string camera_info_topic = "/camera/camera_info";
  std::string image_kind = "auto";  ///< as image_kind of ros/convert/camera.hpp has it
  std::string odom_topic;           ///< whose covariance is that of the pose; empty: that of the parameters
  ElevationParams elevation;
  std::size_t one_of = 1;    ///< of so many images one is mapped
  std::string model_folder;  ///< empty: models/ of this package
};

/// The topics of images.
void add_image_options(CommandLine& app, ImageOptions& options);
void add_model_folder_option(CommandLine& app, ImageOptions& options);
/// --dem, which is returned, and what its numbers are.
CommandLineOption add_dem_options(CommandLine& app, ElevationParams& elevation);

/// Maps the images of a bag while it is played; those that cannot be used are counted by reason.
class BagImages {
 public:
  /// `use` gets the targets after each image. Throws as BagPlayer::subscribe, and std::runtime_error naming the cause.
  BagImages(BagPlayer& player, const BagOptions& bag, const ImageOptions& options, const GridPipelineParams& params,
            std::function<void(const GridTargets& targets)> use);
  BagImages(const BagImages&) = delete;
  BagImages& operator=(const BagImages&) = delete;
  ~BagImages();

  GridPipeline& pipeline();

  /// Prints what the map says of the ground, and on stderr what was assumed of it, after the program's name.
  void print_summary(const std::string& program) const;
  /// Prints on stderr, after the program's name, why there is nothing (GridPipeline::why_nothing), where other
  /// measurements were mapped.
  void warn_of_nothing(const std::string& program) const;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace situation_awareness
