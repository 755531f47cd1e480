// SPDX-License-Identifier: BSD-3-Clause
// A camera of the simulated world for display: renders the world at the stamps of the simulator's odometry. A separate
// process, so that rendering does not delay the simulation; late images are skipped.
#include <cmath>
#include <limits>

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_ros/transform_broadcaster.h>

#include "situation_awareness/ros/convert/images.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/camera_view.hpp"

namespace situation_awareness {
namespace {

struct CameraParams {
  std::string world = "demo";
  std::string camera = "overview";
  int width = 640;
  int height = 480;
  double rate_hz = 10.0;
  std::string world_frame = "world";
  std::string camera_frame = "camera";

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path");
    visit("camera", self.camera, "name of a camera of the world");
    visit("width", self.width, Bounds{16, 4096}, "px", "width of the images");
    visit("height", self.height, Bounds{16, 4096}, "px", "height of the images");
    visit("rate_hz", self.rate_hz, Bounds{0.1, 100.0}, "Hz", "images per simulated second, at most");
    visit("world_frame", self.world_frame, "parent frame of the camera in TF");
    visit("camera_frame", self.camera_frame, "frame of the images");
  }
};

class Camera {
 public:
  Camera(ros::NodeHandle node, const CameraParams& params)
      : params_(params), view_(world_file(params.world), params.camera, params.width, params.height) {
    image_ = node.advertise<sensor_msgs::Image>("camera/image", 2);
    info_ = node.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 2);
    odometry_ = node.subscribe("odometry", 1, &Camera::on_odometry, this, ros::TransportHints().tcpNoDelay());
  }

 private:
  void on_odometry(const nav_msgs::OdometryConstPtr& msg) try {
    const std::int64_t stamp_ns = to_nanoseconds(msg->header.stamp);
    const auto period_ns = static_cast<std::int64_t>(1e9 / params_.rate_hz);
    const std::int64_t picture = stamp_ns / period_ns;
    if (picture == last_picture_) return;
    if (image_.getNumSubscribers() == 0 && info_.getNumSubscribers() == 0) return;
    last_picture_ = picture;

    geometry_msgs::Transform pose;
    pose.translation.x = msg->pose.pose.position.x;
    pose.translation.y = msg->pose.pose.position.y;
    pose.translation.z = msg->pose.pose.position.z;
    pose.rotation = msg->pose.pose.orientation;
    const Picture drawn = view_.at(1e-9 * static_cast<double>(stamp_ns - kSimulationStart_ns), isometry_from_msg(pose));
    publish(drawn, stamp_ns);
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM_THROTTLE(5.0, ros::this_node::getName() << ": " << error.what());
  }

  void publish(const Picture& drawn, std::int64_t stamp_ns) {
    tf_.sendTransform(transform_to_msg(view_.T_world_camera(), stamp_ns, params_.world_frame, params_.camera_frame));
    info_.publish(
        camera_info_to_msg(drawn.width, drawn.height, view_.focal_length_px(), stamp_ns, params_.camera_frame));
    image_.publish(picture_to_msg(drawn, stamp_ns, params_.camera_frame));
  }

  CameraParams params_;
  CameraView view_;
  std::int64_t last_picture_ = std::numeric_limits<std::int64_t>::min();
  ros::Publisher image_, info_;
  ros::Subscriber odometry_;
  tf2_ros::TransformBroadcaster tf_;
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "camera");
  ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  const ros::NodeHandle private_node("~");
  try {
    const situation_awareness::Camera camera(node,
                                             situation_awareness::ParamReader(private_node)
                                                 .read<situation_awareness::CameraParams>(situation_awareness::refuse));
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
  return 0;
}
