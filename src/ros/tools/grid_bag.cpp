// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag of label images to a semantic grid, without a roscore, as fast as possible.
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "command_line.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/map/grid/geotiff.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/pipeline/image_labelling.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/line_file.hpp"
#include "situation_awareness/ros/bag/messages.hpp"
#include "situation_awareness/ros/convert/labels.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/odometry_covariances.hpp"
#include "situation_awareness/ros/params/package.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "grid_bag";
constexpr const char* kConfig = "grid.yaml";
constexpr const char* kDescription =
    R"(Reads label images of a camera, or images that a network labels, camera_info and transforms from a bag and maps a
class over an elevation model.
Writes the targets after each image as one line of JSON:
  {"stamp": s, "targets": [{"id": int, "x", "y", "z": m, "covariance": [xx, xy, yx, yy], "area_m2", "p": number}]}
and the grid at the end as a GeoTIFF: band 1 the probability, NaN where nothing was observed, band 2 the number of images
with evidence. Labels are the probability of the class per pixel (32FC1), NaN or exactly 0.5 where it is not known.
Images that cannot be used have no line and are counted by reason. Files are written atomically.
)";

constexpr double kResetTimeJump_s = 1.0;

struct Options {
  BagOptions bag;
  std::string labels_topic = "/camera/labels", image_topic, camera_info_topic = "/camera/camera_info", odom_topic, dem,
              out, grid_out, model_folder;
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what).type_name(type);
  };
  const CommandLineOption labels = text("--labels-topic", options.labels_topic, "TOPIC", "sensor_msgs/Image, 32FC1");
  text("--image-topic", options.image_topic, "TOPIC",
       "instead: sensor_msgs/Image, rectified, to be labelled by a network")
      .excludes(labels);
  text("--model-folder", options.model_folder, "DIR", "folder of relative models (default: models/ of this package)");
  text("--camera-info-topic", options.camera_info_topic, "TOPIC", "sensor_msgs/CameraInfo of these images");
  text("--odom-topic", options.odom_topic, "TOPIC",
       "nav_msgs/Odometry, whose covariance is that of the pose (default: that of the parameters)");
  text("--dem", options.dem, "FILE", "elevation in the world's metres, such as a GeoTIFF").required();
  text("--out", options.out, "FILE", "output file of the lines").required();
  text("--grid-out", options.grid_out, "FILE", "output file of the grid, a GeoTIFF");
}

Json json_of(const GridTargets& targets) {
  Json line;
  Json& list = line["targets"] = Json::array();
  for (const GridTarget& target : targets.targets) {
    Json& element = add_object(list, 7);
    element["id"] = target.id;
    element["x"] = finite(target.p_world_m.x());
    element["y"] = finite(target.p_world_m.y());
    element["z"] = finite(target.p_world_m.z());
    element["covariance"] = list_of(4, [&](int i) { return target.covariance_m2(i / 2, i % 2); });
    element["area_m2"] = finite(target.area_m2);
    element["p"] = finite(target.probability);
  }
  return line;
}

/// The cameras of a bag, read before its images: a message may come after the image that it is of.
class CameraInfos {
 public:
  CameraInfos(const std::string& bag_path, const std::string& topic) {
    for_each_message<sensor_msgs::CameraInfo>(bag_path, topic, [this](const auto& info) {
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
      if (it->second->header.stamp == image.header.stamp || is_of(*it->second, image)) return it->second;
      other = it->second;
    }
    for (auto it = after; it != infos_.end(); ++it) {
      if (is_of(*it->second, image)) return it->second;
      other = it->second;
    }
    return other;
  }

 private:
  static bool is_of(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image) {
    return info.width == image.width && info.height == image.height;
  }

  std::map<std::int64_t, sensor_msgs::CameraInfoConstPtr> infos_;
};

int grid_bag(const Options& options) {
  const std::string path = config_path(options.bag, kConfig);
  const auto params = params_from_yaml<GridPipelineParams>(read_text_file(path), path, print_warning);
  GridPipeline pipeline(params, std::make_shared<Elevation>(Elevation::load(options.dem)));
  pipeline.trust_stamps();  // the player has judged them
  BagPlayer player(options.bag, kResetTimeJump_s, {});
  LineFile out(options.out);
  const CameraInfos infos(options.bag.bag, options.camera_info_topic);
  const bool labels_images = !options.image_topic.empty();
  std::optional<ImageLabelling> labelling;
  if (labels_images) {
    labelling.emplace(params.labelling,
                      options.model_folder.empty() ? package_folder() + "/models" : options.model_folder);
  }
  OdometryCovariances covariances;
  std::size_t out_of_range = 0;
  player.subscribe<sensor_msgs::CameraInfo>(options.camera_info_topic,
                                            [](const auto& /*msg*/, const ros::Time& /*recorded*/) {});  // is it there?
  if (!options.odom_topic.empty()) {
    player.subscribe<nav_msgs::Odometry>(options.odom_topic, [&](const auto& msg, const ros::Time& recorded) {
      covariances.add(*msg, to_nanoseconds(recorded));
    });
  }
  player.subscribe_measurements<sensor_msgs::Image>(
      labels_images ? options.image_topic : options.labels_topic, "images",
      [&](const sensor_msgs::ImageConstPtr& msg, const ros::Time& recorded) {
        const std::string image_defect = labels_images ? image_msg_defect(*msg) : labels_msg_defect(*msg);
        if (!image_defect.empty()) return player.drop(image_defect);
        const Taken taken{tf2_frame(msg->header.frame_id), msg->header.stamp, msg->header.stamp};
        player.use_when_posed(
            taken, recorded,
            [&, msg](const Eigen::Isometry3d& T_world_camera, const Eigen::Isometry3d& /*end*/) -> std::string {
              const std::int64_t stamp_ns = to_nanoseconds(msg->header.stamp);
              const sensor_msgs::CameraInfoConstPtr info = infos.of(*msg);
              if (!info) return "no camera_info";
              const std::string defect = camera_info_msg_defect(*info, *msg);
              if (!defect.empty()) return defect;
              const GridTargets& targets = player.timed([&]() -> const GridTargets& {
                SoftLabels labels =
                    labels_images ? labelling->label(image_from_msg(*msg, *info)) : labels_from_msg(*msg, *info);
                out_of_range += drop_out_of_range(labels);
                return pipeline.process(labels, T_world_camera, covariances.at(stamp_ns));
              });
              if (!pipeline.is_pose_known()) return "pose not known well enough";
              out.write(json_line(stamp_ns, json_of(targets)));
              return "";
            });
      });
  player.play();
  player.print_summary();
  std::printf("the ground is %+.2f m off the elevation; %zu labels out of [0, 1] not used\n",
              pipeline.map().elevation_offset_m(), out_of_range);
  if (covariances.unknown() > 0) std::printf("%zu odometry messages without covariance\n", covariances.unknown());
  if (covariances.refused() > 0) std::printf("%zu odometry messages not in order\n", covariances.refused());
  player.check_mapped(pipeline.why_nothing());
  if (!options.grid_out.empty()) save_geotiff(options.grid_out, pipeline.map().grid());
  out.finish();
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, grid_bag);
}
