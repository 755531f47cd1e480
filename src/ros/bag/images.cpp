// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/images.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <nav_msgs/Odometry.h>
#include <ros/message_traits.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include "command_line.hpp"
#include "situation_awareness/pipeline/image_labelling.hpp"
#include "situation_awareness/ros/bag/messages.hpp"
#include "situation_awareness/ros/convert/camera.hpp"
#include "situation_awareness/ros/convert/compressed_image.hpp"
#include "situation_awareness/ros/convert/labels.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/odometry_covariances.hpp"
#include "situation_awareness/ros/params/package.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {
namespace {

/// The cameras of a bag, read before its images: a message may come after the image that it is of.
class CameraInfos {
 public:
  CameraInfos(const BagOptions& bag, const std::string& topic) {
    for_each_message<sensor_msgs::CameraInfo>(bag, topic, [this](const auto& info) {
      infos_[to_nanoseconds(info->header.stamp)] = info;
      return true;
    });
  }

  /// That of the image's stamp; else the latest before it, or the first after it, of its size; else null.
  sensor_msgs::CameraInfoConstPtr of(const sensor_msgs::Image& image) const {
    const auto after = infos_.upper_bound(to_nanoseconds(image.header.stamp));
    sensor_msgs::CameraInfoConstPtr other;
    for (auto it = after; it != infos_.begin();) {
      --it;
      if (it->second->header.stamp == image.header.stamp || is_size_of(*it->second, image)) return it->second;
      other = it->second;
    }
    for (auto it = after; it != infos_.end(); ++it) {
      if (is_size_of(*it->second, image)) return it->second;
      other = it->second;
    }
    return other;
  }

 private:
  std::map<std::int64_t, sensor_msgs::CameraInfoConstPtr> infos_;
};

const std::string& topic_of(const ImageOptions& options) {
  return options.image_topic.empty() ? options.labels_topic : options.image_topic;
}

/// The topic where it has compressed images or, as by image_transport, where the one beside it has them; else empty.
std::string compressed_topic(const BagOptions& bag, const std::string& topic) {
  const std::string bare = tf2_frame(topic), beside = bare + kCompressedTransport;
  const std::string type = ros::message_traits::datatype<sensor_msgs::CompressedImage>();
  std::string compressed;
  for (const auto& [name, datatype] : Recording(bag.bags).topics()) {
    const std::string here = tf2_frame(name);
    if (here == bare && datatype != type) return "";
    if (here == bare || (here == beside && datatype == type)) compressed = here;
  }
  return compressed;
}

void warn(const std::string& program, const std::string& what) {
  std::fprintf(stderr, "%s: warning: %s\n", program.c_str(), what.c_str());
}

/// Empty where the bag has labels.
std::optional<ImageLabelling> labelling_of(const ImageOptions& options, const GridPipelineParams& params) {
  if (options.image_topic.empty()) return std::nullopt;
  const std::string folder = options.model_folder.empty() ? package_folder() + "/models" : options.model_folder;
  return std::optional<ImageLabelling>(std::in_place, params.labelling, folder);
}

}  // namespace

void add_image_options(CommandLine& app, ImageOptions& options) {
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  const CommandLineOption labels = text("--labels-topic", options.labels_topic, "TOPIC", "sensor_msgs/Image, 32FC1");
  text("--image-topic", options.image_topic, "TOPIC",
       "instead: sensor_msgs/Image or CompressedImage, rectified, to be labelled by a network")
      .excludes(labels);
  text("--camera-info-topic", options.camera_info_topic, "TOPIC", "sensor_msgs/CameraInfo of these images");
  text("--image-kind", options.image_kind, "KIND",
       "what the images or labels are: rectified, with P of camera_info, or raw, with K and D;\nauto: what the topic's "
       "name says (image_rect*, image_raw), else rectified where there is distortion")
      .check(one_of({"auto", "rectified", "raw"}));
}

void add_model_folder_option(CommandLine& app, ImageOptions& options) {
  app.add_option("--model-folder", options.model_folder, "folder of relative models (default: models/ of this package)")
      .type_name("DIR");
}

CommandLineOption add_dem_options(CommandLine& app, ElevationParams& elevation) {
  app.add_option("--dem-vertical", elevation.dem_vertical,
                 "what its heights are above: the sea, the ellipsoid or the world's zero (default: what its CRS says)")
      .check(one_of({"egm96", "egm2008", "ellipsoid", "local"}));
  app.add_option("--dem-geoid-m", elevation.dem_geoid_m,
                 "height of the sea above the ellipsoid, instead of that of a grid (default: by the grid)")
      .type_name("M")
      .check(in_range(-120.0, 120.0));
  return app.add_option("--dem", elevation.dem, "elevation, such as a GeoTIFF: with a CRS, or in the world's metres")
      .type_name("FILE");
}

struct BagImages::Work {
  Work(const BagOptions& bag, const ImageOptions& options, const GridPipelineParams& params)
      : pipeline(params, ElevationFile(elevation_source(options.elevation, "--origin"))),
        infos(bag, options.camera_info_topic),
        camera(options.image_kind, topic_of(options)),
        labelling(labelling_of(options, params)) {
    pipeline.trust_stamps();  // the player has judged them
  }

  GridPipeline pipeline;
  CameraInfos infos;
  ImageCamera camera;
  std::optional<ImageLabelling> labelling;
  OdometryCovariances covariances;
  std::size_t images = 0, out_of_range = 0;

  /// Maps an image. Returns why it could not be, or an empty text.
  std::string map(BagPlayer& player, const sensor_msgs::Image& msg, const Eigen::Isometry3d& T_world_camera) {
    const sensor_msgs::CameraInfoConstPtr info = infos.of(msg);
    if (!info) return "no camera_info";
    const CameraModel& model = camera.take(*info, msg);
    if (!model.defect.empty()) return model.defect;
    const std::string defect = player.timed([&]() -> std::string {
      SoftLabels labels =
          labelling ? labelling->label(image_from_msg(msg, model.camera)) : labels_from_msg(msg, model.camera);
      std::string not_undistorted = camera.undistort(labels);
      if (!not_undistorted.empty()) return not_undistorted;
      out_of_range += drop_out_of_range(labels);
      pipeline.process(labels, T_world_camera, covariances.at(to_nanoseconds(msg.header.stamp)));
      return "";
    });
    if (!defect.empty()) return defect;
    return pipeline.is_pose_known() ? "" : "pose not known well enough";
  }
};

BagImages::BagImages(BagPlayer& player, const BagOptions& bag, const ImageOptions& options,
                     const GridPipelineParams& params, std::function<void(const GridTargets& targets)> use)
    : work_(std::make_unique<Work>(bag, options, params)) {
  player.subscribe<sensor_msgs::CameraInfo>(options.camera_info_topic,
                                            [](const auto& /*msg*/, const ros::Time& /*recorded*/) {});  // is it there?
  if (!options.odom_topic.empty()) {
    player.subscribe<nav_msgs::Odometry>(
        options.odom_topic, [&covariances = work_->covariances](const auto& msg, const ros::Time& recorded) {
          covariances.add(*msg, to_nanoseconds(recorded));
        });
  }
  const bool are_labels = options.image_topic.empty();
  const auto is_mapped = [&player, &work = *work_, one_of = options.one_of] {
    if (work.images++ % one_of == 0) return true;
    player.pass_over();
    return false;
  };
  const auto take = [&player, &work = *work_, are_labels, use = std::move(use)](const sensor_msgs::ImageConstPtr& msg,
                                                                                const ros::Time& recorded) {
    const std::string image_defect = are_labels ? labels_msg_defect(*msg) : image_msg_defect(*msg);
    if (!image_defect.empty()) return player.drop(image_defect);
    const Taken taken{tf2_frame(msg->header.frame_id), msg->header.stamp, msg->header.stamp};
    player.use_when_posed(
        taken, recorded,
        [&player, &work, msg, use](const Eigen::Isometry3d& T_world_camera, const Eigen::Isometry3d& /*end*/) {
          const std::string defect = work.map(player, *msg, T_world_camera);
          if (!defect.empty()) return defect;
          use(work.pipeline.targets());
          return work.pipeline.why_latest_tells_nothing();
        });
  };
  const std::string topic = topic_of(options), compressed = compressed_topic(bag, topic);
  if (compressed.empty()) {
    player.subscribe_measurements<sensor_msgs::Image>(topic, "images",
                                                      [take, is_mapped](const auto& msg, const ros::Time& recorded) {
                                                        if (is_mapped()) take(msg, recorded);
                                                      });
  } else {
    player.subscribe_measurements<sensor_msgs::CompressedImage>(
        compressed, "images", [take, is_mapped](const auto& msg, const ros::Time& recorded) {
          if (is_mapped()) take(decompressed(*msg), recorded);
        });
  }
}

BagImages::~BagImages() = default;

GridPipeline& BagImages::pipeline() { return work_->pipeline; }

void BagImages::warn_of_nothing(const std::string& program) const {
  const std::string why = work_->pipeline.why_nothing();
  if (!why.empty()) warn(program, why);
}

void BagImages::print_summary(const std::string& program) const {
  const CameraModel& model = work_->camera.model();
  if (!model.assumed.empty()) warn(program, model.assumed);
  for (const std::string& warning : work_->pipeline.elevation_warnings()) warn(program, warning);
  std::printf("the ground is %+.2f m off the elevation; %zu labels out of [0, 1] not used\n",
              work_->pipeline.map().elevation_offset_m(), work_->out_of_range);
  const OdometryCovariances& covariances = work_->covariances;
  if (covariances.unknown() > 0) std::printf("%zu odometry messages without covariance\n", covariances.unknown());
  if (covariances.refused() > 0) std::printf("%zu odometry messages not in order\n", covariances.refused());
}

}  // namespace situation_awareness
