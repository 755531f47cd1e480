// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to a map, without a roscore: the same stages as the nodelets', as fast as they go.
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/params/package.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kUsage =
    "usage: objects_bag IN.bag [--out OUT.jsonl] [--detections OUT.jsonl] [options]\n"
    "\n"
    "Reads laser scans and transforms from a bag and writes the map of ellipses after each scan as one line of JSON:\n"
    "  {\"stamp\": s, \"objects\": [{\"id\": int, \"x\", \"y\", \"psi\", \"rx\", \"ry\", \"vx\", \"vy\", \"wz\": "
    "number,\n"
    "   \"sigma\": [8 standard deviations, order x y vx vy psi wz rx ry], \"beams\": int}]}\n"
    "in m, rad and s, in the world frame; or what was detected in each scan, before it came to the map:\n"
    "  {\"stamp\": s, \"detections\": [{\"x\", \"y\", \"psi\", \"rx\", \"ry\": number,\n"
    "   \"covariance\": [25 numbers, row by row, of x y m p q], \"p_ellipse\": number, \"beams\": int}]}\n"
    "in the sensor's level frame, with m = (rx + ry) / 2 and (p, q) = (rx - ry) / 2 (cos 2 psi, sin 2 psi).\n"
    "A scan that cannot be used has no line; such scans are counted by reason.\n"
    "\n"
    "  --out FILE          where the map's lines go; replaced only when all went well\n"
    "  --detections FILE   where the detections' lines go, likewise\n"
    "  --load-map FILE     go on with this map (docs/map_file.md) instead of an empty one\n"
    "  --save-map FILE     where the map after the last scan goes, for --load-map or the nodelets\n"
    "  --detector NAME     instead of the configuration's detector, with the model that is its own\n"
    "  --scan-topic TOPIC  sensor_msgs/LaserScan (default /scan)\n"
    "  --world-frame NAME  frame of the map, found in /tf and /tf_static (default world)\n"
    "  --static-sensor     the lidar is the world: for bags without transforms\n"
    "  --config FILE       parameters (default: cfg/objects.yaml of this package)\n"
    "  --model-folder DIR  where a relative model is looked for (default: models/ of this package)\n"
    "  --help              this text\n";

struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Arguments {
  std::string bag, out, detections, load_map, save_map, detector, config, model_folder;
  std::string scan_topic = "/scan";
  std::string world_frame = "world";
  bool static_sensor = false;
  bool help = false;
};

Arguments parse_arguments(int argc, char** argv) {
  Arguments arguments;
  const std::map<std::string, std::string*> texts = {{"--out", &arguments.out},
                                                     {"--detections", &arguments.detections},
                                                     {"--load-map", &arguments.load_map},
                                                     {"--save-map", &arguments.save_map},
                                                     {"--detector", &arguments.detector},
                                                     {"--scan-topic", &arguments.scan_topic},
                                                     {"--world-frame", &arguments.world_frame},
                                                     {"--config", &arguments.config},
                                                     {"--model-folder", &arguments.model_folder}};
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    if (argument == "--help" || argument == "-h") {
      arguments.help = true;
      return arguments;
    }
    if (argument == "--static-sensor") {
      arguments.static_sensor = true;
    } else if (const auto text = texts.find(name); text != texts.end()) {
      if (equals == std::string::npos && i + 1 >= argc) throw UsageError(name + " needs a value");
      *text->second = equals == std::string::npos ? argv[++i] : argument.substr(equals + 1);
      if (text->second->empty()) throw UsageError(name + " needs a value");
    } else if (argument.size() > 1 && argument.front() == '-') {
      throw UsageError("unknown option " + argument);
    } else if (arguments.bag.empty()) {
      arguments.bag = argument;
    } else {
      throw UsageError("one bag at a time: " + argument + " is one too many");
    }
  }
  if (arguments.bag.empty()) throw UsageError("which bag? IN.bag is missing");
  if (arguments.out.empty() && arguments.detections.empty() && arguments.save_map.empty()) {
    throw UsageError("where to? --out OUT.jsonl, --detections OUT.jsonl or --save-map FILE is missing");
  }
  if (!arguments.out.empty() && arguments.out == arguments.detections)
    throw UsageError("--out and --detections are the same file");
  arguments.world_frame = tf2_frame(arguments.world_frame);
  return arguments;
}

/// The topic as the bag names it, with or without its leading slash; its type is checked.
std::string find_scan_topic(const rosbag::Bag& bag, const std::string& path, const std::string& wanted) {
  rosbag::View view(bag);
  std::set<std::string> scan_topics;
  std::string other_type;
  const std::string bare = tf2_frame(wanted);
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    const bool is_scan = connection->datatype == ros::message_traits::datatype<sensor_msgs::LaserScan>();
    if (is_scan) scan_topics.insert(connection->topic);
    if (!is_scan && tf2_frame(connection->topic) == bare) other_type = connection->datatype;
  }
  for (const std::string& topic : scan_topics) {
    if (tf2_frame(topic) == bare) return topic;
  }
  std::string sentence = path + ": topic " + wanted;
  sentence += other_type.empty() ? " is not in the bag" : " is of type " + other_type + ", not sensor_msgs/LaserScan";
  if (scan_topics.empty()) throw std::runtime_error(sentence + ", nor is any other laser scan");
  sentence += "; laser scans are on";
  for (const std::string& topic : scan_topics) sentence += " " + topic;
  throw std::runtime_error(sentence);
}

/// The shortest text that reads back as the same number.
void append(std::string& line, double value) {
  if (!std::isfinite(value)) throw std::runtime_error("a number to be written is not finite");
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  if (error != std::errc()) throw std::runtime_error("a number has no text");
  line.append(text, end);
}

/// The start of a line, up to the first element of its list.
std::string json_start(std::int64_t stamp_ns, const char* list) {
  char stamp[40];
  std::snprintf(stamp, sizeof stamp, "%lld.%09lld", static_cast<long long>(stamp_ns / kNanosecondsPerSecond),
                static_cast<long long>(stamp_ns % kNanosecondsPerSecond));
  return std::string("{\"stamp\": ") + stamp + ", \"" + list + "\": [";
}

/// Named numbers, with commas between them.
void append(std::string& line, std::initializer_list<std::pair<const char*, double>> numbers) {
  const char* separator = "\"";
  for (const auto& [name, value] : numbers) {
    line += separator + std::string(name) + "\": ";
    append(line, value);
    separator = ", \"";
  }
}

std::string json_line(const Detections& detections) {
  std::string line = json_start(detections.stamp_ns, "detections");
  for (const Detection& detection : detections.detections) {
    line += line.back() == '}' ? ", {" : "{";
    append(line, {{"x", detection.ellipse_level.center_m.x()},
                  {"y", detection.ellipse_level.center_m.y()},
                  {"psi", detection.ellipse_level.psi_rad},
                  {"rx", detection.ellipse_level.rx_m},
                  {"ry", detection.ellipse_level.ry_m}});
    line += ", \"covariance\": [";
    for (int i = 0; i < 25; ++i) {
      if (i > 0) line += ", ";
      append(line, detection.covariance(i / 5, i % 5));
    }
    line += "], ";
    append(line, {{"p_ellipse", detection.p_ellipse}});
    line += ", \"beams\": " + std::to_string(detection.beams) + "}";
  }
  return line + "]}\n";
}

std::string json_line(const Objects& objects) {
  std::string line = json_start(objects.stamp_ns, "objects");
  for (const Object& object : objects.objects) {
    line += line.back() == '}' ? ", {" : "{";
    line += "\"id\": " + std::to_string(object.id) + ", ";
    append(line, {{"x", object.ellipse_world.center_m.x()},
                  {"y", object.ellipse_world.center_m.y()},
                  {"psi", object.ellipse_world.psi_rad},
                  {"rx", object.ellipse_world.rx_m},
                  {"ry", object.ellipse_world.ry_m},
                  {"vx", object.velocity_world_m_s.x()},
                  {"vy", object.velocity_world_m_s.y()},
                  {"wz", object.angular_velocity_rad_s}});
    line += ", \"sigma\": [";
    for (int i = 0; i < 8; ++i) {
      if (i > 0) line += ", ";
      append(line, std::sqrt(std::max(object.covariance(i, i), 0.0)));
    }
    line += "], \"beams\": " + std::to_string(object.beams) + "}";
  }
  return line + "]}\n";
}

/// Lines that appear under their own name only when all are written.
class Output {
 public:
  explicit Output(const std::string& path) : path_(path), partial_(path + ".part") {
    stream_.open(partial_, std::ios::binary | std::ios::trunc);
    if (!stream_) throw std::runtime_error(path_ + ": cannot be written");
  }
  ~Output() {
    if (done_) return;
    stream_.close();
    std::remove(partial_.c_str());
  }
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  void write(const std::string& line) { stream_ << line; }

  void finish() {
    stream_.close();
    if (!stream_ || std::rename(partial_.c_str(), path_.c_str()) != 0) {
      throw std::runtime_error(path_ + ": cannot be written");
    }
    done_ = true;
  }

 private:
  std::string path_, partial_;
  std::ofstream stream_;
  bool done_ = false;
};

/// On a terminal a line that grows, in a log one line per 10 %.
class Progress {
 public:
  explicit Progress(std::size_t total) : total_(std::max<std::size_t>(total, 1)), terminal_(isatty(STDERR_FILENO)) {}

  void at(std::size_t done) {
    const int percent = static_cast<int>(100 * done / total_);
    if (percent / step() == shown_ / step() && shown_ >= 0) return;
    shown_ = percent;
    std::fprintf(stderr, terminal_ ? "\r%3d %% of %zu scans" : "%3d %% of %zu scans\n", percent, total_);
    if (terminal_ && percent == 100) std::fputc('\n', stderr);
  }

 private:
  int step() const { return terminal_ ? 1 : 10; }

  std::size_t total_;
  bool terminal_;
  int shown_ = -1;
};

/// Maps the messages of a bag in the order they were recorded in. Scans wait for their transforms as in the nodelet,
/// but by the time of the recording: however fast the bag is read.
class BagMapper {
 public:
  /// Writes the map and the detections where the outputs are not null.
  BagMapper(const Arguments& arguments, const ObjectPipelineParams& params, Output* map_output,
            Output* detections_output)
      : world_frame_(arguments.world_frame),
        static_sensor_(arguments.static_sensor),
        queue_(transforms_, {world_frame_, kTimeout_s, kMaxWaiting, params.objects.reset_time_jump_s},
               [this](const char* reason, const std::string& /*detail*/) { ++dropped_[reason]; }),
        pipeline_(params),
        map_output_(map_output),
        detections_output_(detections_output) {}

  void add(const tf2_msgs::TFMessage& msg, bool is_static) {
    if (static_sensor_) return;
    for (geometry_msgs::TransformStamped transform : msg.transforms) {
      transform.header.frame_id = tf2_frame(transform.header.frame_id);
      transform.child_frame_id = tf2_frame(transform.child_frame_id);
      transforms_.setTransform(transform, kAuthority, is_static);
    }
  }

  void add(const sensor_msgs::LaserScanConstPtr& msg, const ros::Time& recorded) {
    ++scans_;
    const std::string defect = scan_msg_defect(*msg);
    if (!defect.empty()) {
      ++dropped_[defect];
      return;
    }
    const Taken when = taken(*msg);
    if (scan_frame_ != when.frame) {
      scan_frame_ = when.frame;
      if (static_sensor_) {
        transforms_.setTransform(transform_to_msg(Eigen::Isometry3d::Identity(), 0, world_frame_, scan_frame_),
                                 kAuthority, true);
      }
    }
    queue_.add(msg, when, to_nanoseconds(recorded));
  }

  /// Map what has its transforms, in order; drop what should have had them by `now_ns` of the recording.
  void work_off(std::int64_t now_ns) {
    while (const auto ready = queue_.next(now_ns)) {
      process(*ready->item, ready->T_world_sensor, ready->T_world_sensor_end);
    }
  }

  std::size_t scans() const { return scans_; }

  /// Throws std::runtime_error if no scan could be mapped: why not, and which frames there are.
  void check_mapped(const std::string& bag) const {
    if (!durations_ms_.empty()) return;
    std::string sentence = bag + ": nothing mapped of " + std::to_string(scans_) + " scans";
    for (const auto& [reason, count] : dropped_) {
      sentence += ", " + std::to_string(count) + " dropped: " + reason;
      if (reason == drop_reason::kNoTransform) sentence += " from " + world_frame_ + " to " + scan_frame_;
    }
    if (dropped_.of(drop_reason::kNoTransform) > 0) {
      std::vector<std::string> frames;
      transforms_._getFrameStrings(frames);
      std::sort(frames.begin(), frames.end());
      for (const std::string& frame : frames)
        sentence += (&frame == &frames[0] ? "; the bag has the frames " : ", ") + frame;
      if (frames.empty()) sentence += "; the bag has no transforms: --static-sensor does without";
    }
    throw std::runtime_error(sentence);
  }

  void load(const std::string& path) {
    pipeline_.map().resume(load_map(path, world_frame_));
    publish(pipeline_.map().at(pipeline_.map().stamp_ns()));
  }

  void save(const std::string& path) const {
    MapSnapshot snapshot = pipeline_.map().snapshot();
    snapshot.world_frame = world_frame_;
    save_map(path, snapshot);
  }

  void print_summary(double bag_s, double wall_s) {
    std::printf("%zu scans, %zu mapped", scans_, durations_ms_.size());
    for (const auto& [reason, count] : dropped_)
      std::printf(", %ld dropped: %s", static_cast<long>(count), reason.c_str());
    std::printf("\n");
    if (durations_ms_.empty()) return;
    std::sort(durations_ms_.begin(), durations_ms_.end());
    const auto quantile = [this](double part) {
      return durations_ms_[static_cast<std::size_t>(part * static_cast<double>(durations_ms_.size() - 1) + 0.5)];
    };
    std::printf("per scan: p50 %.3f ms, p99 %.3f ms, max %.3f ms\n", quantile(0.5), quantile(0.99), quantile(1.0));
    std::printf("%zu detections, log-likelihood %.3f each given the map before\n", detections_,
                log_likelihood_ / static_cast<double>(std::max<std::size_t>(detections_, 1)));
    std::printf("%.1f s of scans in %.1f s: %.0f times real time\n", bag_s, wall_s, bag_s / std::max(wall_s, 1e-9));
  }

 private:
  static constexpr double kTimeout_s = 10.0;
  static constexpr std::size_t kMaxWaiting = 10000;  // ten seconds of the fastest scanner
  static constexpr const char* kAuthority = "bag";

  /// To segmentation and detection of the next scan, as mapping does: the message has angles as quaternions, which
  /// costs their last digit.
  void publish(const Objects& objects) { published_ = objects_from_msg(objects_to_msg(objects, world_frame_)); }

  void process(const sensor_msgs::LaserScan& msg, const Eigen::Isometry3d& T_world_lidar,
               const Eigen::Isometry3d& T_world_lidar_end) {
    const Scan scan = scan_from_msg(msg);
    const std::string defect = projection_defect(scan, T_world_lidar, T_world_lidar_end);
    if (!defect.empty()) {
      ++dropped_[defect];
      return;
    }
    const auto before = std::chrono::steady_clock::now();
    const ObjectPipelineResult& result = pipeline_.process(scan, T_world_lidar, T_world_lidar_end, published_);
    const Objects objects = pipeline_.map().at(scan.stamp_ns);
    publish(objects);
    const std::chrono::duration<double, std::milli> duration = std::chrono::steady_clock::now() - before;
    durations_ms_.push_back(duration.count());
    if (map_output_ != nullptr) map_output_->write(json_line(objects));
    if (detections_output_ != nullptr) detections_output_->write(json_line(result.detections));
    log_likelihood_ += result.update.log_likelihood;
    detections_ += result.update.updated.size() + result.update.created.size();
  }

  std::string world_frame_;
  std::string scan_frame_;  ///< of the latest scan
  bool static_sensor_;
  tf2::BufferCore transforms_{ros::Duration(3.0 * kTimeout_s)};  ///< not longer: lookups cost its length
  TransformQueue<sensor_msgs::LaserScanConstPtr> queue_;
  ObjectPipeline pipeline_;
  Objects published_;  ///< after the scan before
  Output* map_output_;
  Output* detections_output_;
  std::size_t scans_ = 0;
  Counters dropped_;
  std::vector<double> durations_ms_;
  double log_likelihood_ = 0.0;
  std::size_t detections_ = 0;
};

template <class Message>
boost::shared_ptr<Message> read(const rosbag::MessageInstance& instance) {
  const boost::shared_ptr<Message> msg = instance.instantiate<Message>();
  if (!msg) throw std::runtime_error("topic " + instance.getTopic() + " holds another version of its message type");
  return msg;
}

void objects_bag(const Arguments& arguments) {
  const std::string config = arguments.config.empty() ? package_folder() + "/cfg/objects.yaml" : arguments.config;
  const std::string model_folder =
      arguments.model_folder.empty() ? package_folder() + "/models" : arguments.model_folder;
  ObjectPipelineParams params = load_object_pipeline_params(config, model_folder);
  if (!arguments.detector.empty()) {
    params.detections.detector = arguments.detector;
    params.detections.model.clear();
  }

  if (!std::filesystem::is_regular_file(arguments.bag)) throw std::runtime_error(arguments.bag + ": no such bag");
  rosbag::Bag bag;
  bag.open(arguments.bag, rosbag::bagmode::Read);
  const std::string scan_topic = find_scan_topic(bag, arguments.bag, arguments.scan_topic);
  rosbag::View scans(bag, rosbag::TopicQuery(scan_topic));
  rosbag::View view(bag, rosbag::TopicQuery(std::vector<std::string>{scan_topic, "/tf", "tf"}));
  rosbag::View static_view(bag, rosbag::TopicQuery(std::vector<std::string>{"/tf_static", "tf_static"}));

  std::optional<Output> map_output;
  std::optional<Output> detections_output;
  if (!arguments.out.empty()) map_output.emplace(arguments.out);
  if (!arguments.detections.empty()) detections_output.emplace(arguments.detections);
  BagMapper mapper(arguments, params, map_output ? &*map_output : nullptr,
                   detections_output ? &*detections_output : nullptr);
  if (!arguments.load_map.empty()) mapper.load(arguments.load_map);
  Progress progress(scans.size());
  const auto start = std::chrono::steady_clock::now();
  for (const rosbag::MessageInstance& instance : static_view) mapper.add(*read<tf2_msgs::TFMessage>(instance), true);
  for (const rosbag::MessageInstance& instance : view) {
    if (instance.getTopic() == scan_topic) {
      progress.at(mapper.scans());
      mapper.add(read<sensor_msgs::LaserScan>(instance), instance.getTime());
    } else {
      mapper.add(*read<tf2_msgs::TFMessage>(instance), false);
    }
    mapper.work_off(to_nanoseconds(instance.getTime()));
  }
  mapper.work_off(kEndOfTime_ns);
  progress.at(mapper.scans());
  mapper.check_mapped(arguments.bag);
  if (!arguments.save_map.empty()) mapper.save(arguments.save_map);
  if (map_output) map_output->finish();
  if (detections_output) detections_output->finish();
  const double bag_s = scans.size() > 0 ? (scans.getEndTime() - scans.getBeginTime()).toSec() : 0.0;
  mapper.print_summary(bag_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Arguments arguments;
  try {
    arguments = parse_arguments(argc, argv);
  } catch (const UsageError& error) {
    std::fprintf(stderr, "objects_bag: %s (--help lists the options)\n", error.what());
    return 2;
  }
  if (arguments.help) {
    std::fputs(kUsage, stdout);
    return 0;
  }
  try {
    objects_bag(arguments);
  } catch (const rosbag::BagException& error) {
    std::fprintf(stderr, "objects_bag: %s: damaged, or no bag: %s\n", arguments.bag.c_str(), error.what());
    return 1;
  } catch (const ros::Exception& error) {  // a message that is shorter than its type says
    std::fprintf(stderr, "objects_bag: %s: damaged: %s\n", arguments.bag.c_str(), error.what());
    return 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "objects_bag: %s\n", error.what());
    return 1;
  }
  return 0;
}
