// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/recording.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <ros/exception.h>
#include <rosbag/exceptions.h>
#include <rosbag/query.h>
#include <rosbag/view.h>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {
namespace {

namespace fs = std::filesystem;

const std::string kStatic = "_static";

/// The command that makes an uncompressed bag of a recording of another kind. The script is where the sources are, or
/// is installed for rosrun.
std::string conversion_of(const std::string& path) {
  const std::string script = package_folder() + "/scripts/ros2_to_ros1";
  const std::string command = fs::exists(script) ? script : "rosrun situation_awareness ros2_to_ros1";
  return command + ' ' + path + " OUT.bag (docs/ros2_recordings.md)";
}

bool begins_with(const std::string& text, const std::string& begin) { return text.rfind(begin, 0) == 0; }

std::string first_bytes(const std::string& path, std::size_t count) {
  std::string bytes(count, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(bytes.data(), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

/// Of what a recording of ROS 2 is: "MCAP", "SQLite", ...; empty where it is none.
std::string kind_of_ros2(const fs::path& path) {
  const auto is_part = [](const fs::path& file) {
    return file.filename() == "metadata.yaml" || file.extension() == ".db3" || file.extension() == ".mcap";
  };
  if (fs::is_directory(path)) {
    const bool has_part = std::any_of(fs::directory_iterator(path), fs::directory_iterator(), is_part);
    return has_part ? "a folder" : "";
  }
  const std::string bytes = first_bytes(path, 32);
  if (begins_with(bytes, "\x89MCAP0\r\n")) return "MCAP";
  if (begins_with(bytes, "SQLite format 3")) return "SQLite";
  if (path.extension() == ".zstd" && is_part(path.stem())) return "compressed";
  return !begins_with(bytes, "#ROSBAG") && is_part(path) ? "damaged" : "";
}

/// Throws std::runtime_error for what cannot be a bag, or is one without the index that is written when it is closed.
void open(const std::string& path, rosbag::Bag& bag) {
  const auto refuse = [&path](const std::string& why) { throw std::runtime_error(path + ": " + why); };
  if (!fs::exists(path)) refuse("no such bag");
  const std::string kind = kind_of_ros2(path);
  if (!kind.empty()) refuse("a recording of ROS 2 (" + kind + "); this makes a bag of it: " + conversion_of(path));
  if (!fs::is_regular_file(path)) refuse("no bag: name the files of bags");
  try {
    bag.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& error) {
    if (!begins_with(first_bytes(path, 32), "#ROSBAG V2")) refuse(std::string("damaged, or no bag: ") + error.what());
    refuse(std::string("damaged: it was cut short, or is recorded still, and has no index (") + error.what() +
           "); rosbag reindex " + path + " makes one of the messages that are there");
  }
}

/// Whether the first chunk that lz4 has compressed begins with another frame descriptor than those of ROS, the only one
/// that ROS reads: independent blocks and a checksum of the content, without its size (LZ4 Frame Format 1.6.4, FLG).
bool has_other_lz4(const std::string& path) {
  constexpr std::size_t kBegin = 64 * 1024;
  constexpr char kFlagsOfRos = 0x64;
  const std::string magic = "\x04\x22\x4d\x18", begin = first_bytes(path, kBegin);
  const std::size_t header = begin.find("compression=lz4");
  const std::size_t frame = header == std::string::npos ? header : begin.find(magic, header);
  return frame != std::string::npos && frame + magic.size() < begin.size() &&
         begin[frame + magic.size()] != kFlagsOfRos;
}

}  // namespace

std::string recording_name(const std::vector<std::string>& bags) {
  return bags.size() == 1 ? bags.front() : bags.front() + " and " + std::to_string(bags.size() - 1) + " more";
}

std::string static_topic_of(const std::string& tf_topic) { return tf_topic + kStatic; }

Recording::Recording(const std::vector<std::string>& paths) : paths_(paths) {
  for (auto path = paths.begin(); path != paths.end(); ++path) {
    open(*path, bags_.emplace_back());
    for (auto other = paths.begin(); other != path; ++other) {
      if (fs::equivalent(*other, *path)) throw std::runtime_error(*path + ": the same bag as " + *other);
    }
  }
}

std::set<std::pair<std::string, std::string>> Recording::topics() const {
  std::set<std::pair<std::string, std::string>> topics;
  for (const rosbag::Bag& bag : bags_) {
    rosbag::View view(bag);
    for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
      topics.emplace(connection->topic, connection->datatype);
    }
  }
  return topics;
}

std::set<std::string> Recording::transform_topics() const {
  std::set<std::string> found;
  for (const auto& [topic, type] : topics()) {
    if (type != "tf2_msgs/TFMessage" && type != "tf/tfMessage") continue;
    const std::string bare = tf2_frame(topic);
    const bool is_static =
        bare.size() > kStatic.size() && bare.compare(bare.size() - kStatic.size(), kStatic.size(), kStatic) == 0;
    found.insert("/" + (is_static ? bare.substr(0, bare.size() - kStatic.size()) : bare));
  }
  return found;
}

Recording::Extent Recording::extent_of(const std::string& topic) const {
  rosbag::View view;
  for (const rosbag::Bag& bag : bags_) view.addQuery(bag, rosbag::TopicQuery(topic));
  if (view.size() == 0) return {};
  return {view.size(), (view.getEndTime() - view.getBeginTime()).toSec()};
}

void Recording::read(const std::vector<std::string>& topics,
                     const std::function<bool(const rosbag::MessageInstance& instance)>& look) const {
  try {
    rosbag::View view;
    for (const rosbag::Bag& bag : bags_) view.addQuery(bag, rosbag::TopicQuery(topics));
    for (const rosbag::MessageInstance& instance : view) {
      if (!look(instance)) return;
    }
  } catch (const rosbag::BagException& error) {
    throw std::runtime_error(defect_of(error));
  } catch (const ros::Exception& error) {  // a message that is shorter than its type
    throw std::runtime_error(recording_name(paths_) + ": damaged: " + error.what());
  }
}

std::string Recording::defect_of(const rosbag::BagException& error) const {
  const std::string what = error.what();
  for (const std::string& path : paths_) {
    if (!begins_with(what, "ROSLZ4") || !has_other_lz4(path)) continue;
    return path +
           ": unsupported compression: lz4 of another writer, in frames that ROS does not read (nor does rosbag "
           "decompress); this writes the bag without: " +
           conversion_of(path);
  }
  return recording_name(paths_) + ": damaged: " + what;
}

}  // namespace situation_awareness
