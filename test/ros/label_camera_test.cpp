// SPDX-License-Identifier: BSD-3-Clause
// Label cameras as simulate_bag records them: what is where by CameraInfo and TF has its label there.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "situation_awareness/ros/convert/images.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/sensors.hpp"

namespace situation_awareness::label_camera_test {
namespace {

const std::string kTestFolder = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/test/ros/";
constexpr int kSeconds = 10;

/// A recording of the world by simulate_bag; a scan, and so a pose in TF, each 0.1 s.
class Recording {
 public:
  explicit Recording(const std::string& world) {
    path_ = (std::filesystem::path(testing::TempDir()) / (world + "_label_camera_test.bag")).string();
    const std::string command = std::string(SIMULATE_BAG) + " --world " + kTestFolder + world + ".xml --out " + path_ +
                                " --duration " + std::to_string(kSeconds) + " --rate 10 --resolution-deg 5";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    bag_ = std::make_unique<rosbag::Bag>(path_);
  }
  ~Recording() {
    bag_.reset();
    std::filesystem::remove(path_);
  }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  std::set<std::string> topics() const {
    std::set<std::string> names;
    rosbag::View view(*bag_);
    for (const rosbag::ConnectionInfo* connection : view.getConnections()) names.insert(connection->topic);
    return names;
  }

  template <class Message>
  std::vector<Message> messages_of(const std::string& topic) const {
    std::vector<Message> messages;
    rosbag::View view(*bag_, rosbag::TopicQuery(topic));
    for (const rosbag::MessageInstance& instance : view) messages.push_back(*instance.instantiate<Message>());
    return messages;
  }

 private:
  std::string path_;
  std::unique_ptr<rosbag::Bag> bag_;
};

/// Made once: to draw its images takes most of the time of this test.
const Recording& recording_of_two_cameras() {
  static const Recording recording("label_camera");
  return recording;
}

int label_at(const sensor_msgs::Image& image, int column, int row) {
  const std::size_t place = static_cast<std::size_t>(row) * image.step + 2 * static_cast<std::size_t>(column);
  return image.data.at(place) + 256 * image.data.at(place + 1);
}

/// Poses, images and their geometry from messages alone.
class RecordedCamera {
 public:
  RecordedCamera(const Recording& recording, const std::string& topic)
      : objects(recording.messages_of<sensor_msgs::Image>(topic + "/objects")),
        classes(recording.messages_of<sensor_msgs::Image>(topic + "/classes")),
        infos(recording.messages_of<sensor_msgs::CameraInfo>(topic + "/camera_info")),
        transforms_(ros::Duration(2 * kSeconds)) {
    for (const auto& msg : recording.messages_of<tf2_msgs::TFMessage>("/tf_static")) {
      for (const auto& transform : msg.transforms) transforms_.setTransform(transform, "bag", true);
    }
    for (const auto& msg : recording.messages_of<tf2_msgs::TFMessage>("/tf")) {
      for (const auto& transform : msg.transforms) transforms_.setTransform(transform, "bag");
    }
  }

  /// The pixel that shows the point in image i, as column and row; outside the image where it does not.
  Eigen::Vector2i pixel_of(const Eigen::Vector3d& p_world, std::size_t i) const {
    const sensor_msgs::CameraInfo& info = infos.at(i);
    const Eigen::Isometry3d T_camera_world =
        isometry_from_msg(transforms_.lookupTransform(info.header.frame_id, "world", info.header.stamp).transform);
    const Eigen::Vector3d p_camera = T_camera_world * p_world;
    if (p_camera.z() <= 0.0) return {-1, -1};
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> K(info.K.data());
    return (K * p_camera).hnormalized().array().round().cast<int>();
  }

  bool has(const Eigen::Vector2i& pixel, std::size_t i) const {
    return (pixel.array() >= 0).all() && pixel.x() < static_cast<int>(infos.at(i).width) &&
           pixel.y() < static_cast<int>(infos.at(i).height);
  }

  std::vector<sensor_msgs::Image> objects, classes;
  std::vector<sensor_msgs::CameraInfo> infos;

 private:
  tf2::BufferCore transforms_;
};

TEST(LabelCameraTopics, SayWhatIsWhereItProjectsTo) {
  constexpr int kNoMaterial = 1, kGrass = 2, kWood = 3;  // materials in the order of the file, from 2 on
  const Recording& recording = recording_of_two_cameras();
  for (const std::string topic : {"/label_camera", "/second_eye/label_camera"}) {
    const RecordedCamera camera(recording, topic);
    std::map<int, int> seen;  // points of each object
    for (std::size_t i = 0; i < camera.infos.size(); ++i) {
      const double t = (camera.infos[i].header.stamp - to_ros_time(kSimulationStart_ns)).toSec();
      const auto expect = [&](const Eigen::Vector3d& p_world, int object, int label) {
        const Eigen::Vector2i pixel = camera.pixel_of(p_world, i);
        if (!camera.has(pixel, i)) return;
        ++seen[object];
        EXPECT_EQ(label_at(camera.objects[i], pixel.x(), pixel.y()), object) << topic << t << ' ' << pixel.transpose();
        EXPECT_EQ(label_at(camera.classes[i], pixel.x(), pixel.y()), label) << topic << t << ' ' << pixel.transpose();
      };
      // Points inside of shapes that nothing hides, by more than a pixel, and some of the floor, never behind a shape.
      for (const double z : {0.4, 1.0, 1.6}) expect({-3.5, 1.0, z}, 1, kWood);
      const Eigen::Vector3d crate(4.0 + 0.6 * std::cos(0.8 * t), -0.6 * std::sin(0.8 * t), 0.7);
      const Eigen::AngleAxisd turned(0.5 * t, Eigen::Vector3d::UnitZ());
      for (const double x : {-0.28, 0.0, 0.28}) {
        for (const double y : {-0.18, 0.18}) {
          for (const double z : {-0.57, 0.57}) expect(crate + turned * Eigen::Vector3d(x, y, z), 2, kNoMaterial);
        }
      }
      for (const double y : {-5.0, -3.5, 3.5, 5.0}) expect({0.0, y, 0.0}, 0, kGrass);
    }
    for (const int object : {0, 1, 2}) EXPECT_GT(seen[object], 10) << topic << object;
  }
}

TEST(LabelCameraTopics, ComeAtTheirRatesWithOneStampForAllOfAnImage) {
  const Recording& recording = recording_of_two_cameras();
  const auto expect_stamps = [](const auto& messages, const std::string& frame, std::int64_t rate_hz) {
    ASSERT_EQ(messages.size(), static_cast<std::size_t>(kSeconds * rate_hz)) << frame;
    for (std::size_t i = 0; i < messages.size(); ++i) {
      const auto after_ns = static_cast<std::int64_t>(i) * (kNanosecondsPerSecond / rate_hz);
      EXPECT_EQ(to_nanoseconds(messages[i].header.stamp), kSimulationStart_ns + after_ns) << frame;
      EXPECT_EQ(messages[i].header.frame_id, frame);
    }
  };
  const RecordedCamera eye(recording, "/label_camera"), second(recording, "/second_eye/label_camera");
  expect_stamps(eye.objects, "eye", 5);
  expect_stamps(eye.classes, "eye", 5);
  expect_stamps(eye.infos, "eye", 5);
  expect_stamps(second.objects, "second_eye", 2);
  expect_stamps(second.classes, "second_eye", 2);
  expect_stamps(second.infos, "second_eye", 2);
  expect_stamps(recording.messages_of<sensor_msgs::Image>("/second_eye/label_camera/image"), "second_eye", 2);
  EXPECT_EQ(recording.topics().count("/label_camera/image"), 0U) << "the file asks for no colours";
}

TEST(LabelCameraTopics, AreTheImagesOfTheCore) {
  const Recording& recording = recording_of_two_cameras();
  const World world(kTestFolder + "label_camera.xml");
  const auto mounted = sensors_of(world).label_cameras.at(1);
  SimulatedLabelCamera core(world, mounted.T_robot_sensor, mounted.params);
  const RecordedCamera second(recording, "/second_eye/label_camera");
  const auto pictures = recording.messages_of<sensor_msgs::Image>("/second_eye/label_camera/image");
  for (std::size_t i = 0; i < second.infos.size(); ++i) {
    const LabelImage image = core.next();
    EXPECT_EQ(pictures.at(i).data, image.rgb);
    for (const auto& [msg, labels] :
         {std::pair(&second.objects.at(i), &image.objects), std::pair(&second.classes.at(i), &image.classes)}) {
      EXPECT_EQ(msg->encoding, sensor_msgs::image_encodings::MONO16);
      EXPECT_EQ(msg->is_bigendian, 0);
      EXPECT_EQ(msg->width, 64U);
      EXPECT_EQ(msg->height, 48U);
      EXPECT_EQ(msg->step, 128U);
      ASSERT_EQ(msg->data.size(), 2U * labels->size());
      for (int row = 0; row < 48; ++row) {
        for (int column = 0; column < 64; ++column) {
          ASSERT_EQ(label_at(*msg, column, row), labels->at(static_cast<std::size_t>(64 * row + column)));
        }
      }
    }
  }
}

TEST(LabelImageMessage, HasLabelsOfTwoBytes) {
  LabelImage image;
  image.stamp_ns = 7;
  image.width = 2;
  image.height = 1;
  image.objects = {513, 65535};
  image.classes = {0, 2};
  const sensor_msgs::Image msg = objects_image_to_msg(image, "eye");
  EXPECT_EQ(msg.data, (std::vector<std::uint8_t>{1, 2, 255, 255}));
  EXPECT_EQ(to_nanoseconds(msg.header.stamp), 7);
  EXPECT_EQ(classes_image_to_msg(image, "eye").data, (std::vector<std::uint8_t>{0, 0, 2, 0}));
}

TEST(LabelCameraTopics, AreNoneWhereTheWorldAsksForNone) {
  for (const std::string& topic : Recording("motion").topics()) {
    EXPECT_EQ(topic.find("label_camera"), std::string::npos) << topic;
  }
}

}  // namespace
}  // namespace situation_awareness::label_camera_test
