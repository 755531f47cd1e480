// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <ros/message_traits.h>
#include <ros/time.h>
#include <rosbag/message_instance.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>
#include <Eigen/Geometry>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/recording.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {

/// Plays a recording as fast as the program processes it, message by message in its order. Measurements of
/// one sensor wait for the poses of its frame as in the nodelets, by the time of the recording. The poses are those of
/// TF, as PosedInput has them, or those that the program gives of the sensor's base, as in ScansOnBase: then TF says
/// only where the sensors are on the base.
class BagPlayer {
 public:
  /// Processes a measurement of a sensor at these poses; returns an empty text if it was used, else the reason of the
  /// drop, for counters.
  using Use =
      std::function<std::string(const Eigen::Isometry3d& T_world_sensor, const Eigen::Isometry3d& T_world_sensor_end)>;
  template <class Message>
  using Take = std::function<void(const boost::shared_ptr<const Message>& msg, const ros::Time& recorded)>;

  /// Where the poses of measurements come from.
  struct Poses {
    std::string base_frame = {};  ///< of the vehicle; by TF and not empty: measurements wait for its pose, too
    bool are_given = false;       ///< by add_pose, not by TF
    double scan_offset_s = 0.0;   ///< the pose of a scan or cloud is so much later; by TF alone
  };

  /// Opens the bags; stamps that go back by more than StampOrder::kResetTimeJump_s are a restart (StampOrder). An
  /// offset of scans from poses that are given is not used, and print_summary() warns of it. Throws std::runtime_error.
  BagPlayer(const BagOptions& options, const Poses& poses);

  /// `take` gets the messages of a topic, with or without its leading slash. Throws std::runtime_error if it is not in
  /// the bag or of another type, naming the topics of this type.
  template <class Message>
  void subscribe(const std::string& topic, Take<Message> take) {
    using ros::message_traits::datatype;
    subscriptions_[find_topic(topic, datatype<Message>())] = [take = std::move(take)](const auto& instance) {
      take(read<Message>(instance), instance.getTime());
    };
  }

  /// `take` gets the messages of a topic as `subscribe` says, of which each is a measurement of the program: it must
  /// call `use_when_posed`, `drop` or `pass_over` for each. `noun`: their name, such as "scans".
  template <class Message>
  void subscribe_measurements(const std::string& topic, const std::string& noun, Take<Message> take) {
    subscribe<Message>(topic, [this, take = std::move(take)](const auto& msg, const ros::Time& recorded) {
      ++measurements_;
      take(msg, recorded);
    });
    noun_ += (noun_.empty() ? "" : " and ") + noun;
    measured_topic_ = find_topic(topic, ros::message_traits::datatype<Message>());
  }

  /// `act` is called before the first measurement after a restart is used: what was mapped is of another time.
  void on_restart(std::function<void()> act) { restart_ = std::move(act); }

  /// print_summary() warns of the sentences that `warnings` returns then.
  void on_summary(std::function<std::vector<std::string>()> warnings) { warnings_.push_back(std::move(warnings)); }

  /// These sentences, now.
  std::vector<std::string> warnings() const;

  /// The measurement that was taken is not counted, and neither used nor dropped.
  void pass_over() { --measurements_; }

  /// The pose of a scan or cloud is so much later.
  double scan_offset_s() const { return source_.scan_offset_s; }

  /// At the time of `taken` in the recording. Measurements of one frame have their poses equally late.
  void use_when_posed(const Taken& taken, const ros::Time& recorded, Use use, double pose_offset_s = 0.0);

  /// Adds a pose of the base in the world; its names of frames do not matter.
  void add_pose(geometry_msgs::TransformStamped T_world_base);

  /// Forgets the poses: those that come next may be of earlier stamps, or of another world.
  void forget_poses();

  /// These return the pose of the base at the stamp of a measurement, and at that of a scan or cloud, while it is used.
  Eigen::Isometry3d T_world_base_at(std::int64_t stamp_ns) const;
  Eigen::Isometry3d T_world_base_of_scan(std::int64_t stamp_ns) const;

  /// The transforms of the bag until now.
  const tf2::BufferCore& tf() const { return tf_; }

  void drop(const std::string& reason) { ++dropped_[reason]; }

  /// Returns the result of `work`; its duration is part of the summary.
  template <class Work>
  decltype(auto) timed(const Work& work) {
    const Timer timer(durations_ms_);
    return work();
  }

  /// From the first message to the last. Throws as Recording::read.
  void play();

  /// Prints the number of measurements used, the drops by reason, and the time, and warnings to stderr.
  void print_summary() const;

  /// Throws std::runtime_error if nothing was mapped: `why_not`, the program's own reason, is not empty, or no
  /// measurement could be used. Then its one sentence has the reason, or those of all drops and the bag's frames.
  void check_mapped(const std::string& why_not = "") const;

 private:
  struct Timer {
    explicit Timer(std::vector<double>& durations) : durations_ms(durations) {}
    ~Timer() {
      const std::chrono::duration<double, std::milli> duration = std::chrono::steady_clock::now() - start;
      durations_ms.push_back(duration.count());
    }
    std::vector<double>& durations_ms;
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  };

  /// The measurements of one sensor: those of another one may be earlier, and come later.
  struct SensorQueue {
    std::string frame;
    TransformQueue<Use> queue;
    std::size_t restarts = 0;
  };

  template <class Message>
  static boost::shared_ptr<const Message> read(const rosbag::MessageInstance& instance) {
    const boost::shared_ptr<const Message> msg = instance.instantiate<Message>();
    if (!msg) other_version(instance.getTopic());
    return msg;
  }
  [[noreturn]] static void other_version(const std::string& topic);

  std::string find_topic(const std::string& wanted, const std::string& datatype) const;
  void add_transforms(const tf2_msgs::TFMessage& msg, bool is_static);
  void mount();
  void dropped(const std::string& reason, const std::string& detail);
  std::string transforms_hint() const;
  void play_all();
  void release(std::int64_t now_ns);
  void release(SensorQueue& of, std::int64_t now_ns);
  std::unique_ptr<SensorQueue> make_queue(const std::string& frame, double pose_offset_s);
  TransformQueue<Use>& queue_of(const std::string& frame, double pose_offset_s);

  BagOptions options_;
  Recording recording_;
  std::map<std::string, std::function<void(const rosbag::MessageInstance&)>> subscriptions_;  ///< by topic
  std::string noun_, measured_topic_;
  std::set<std::string> frames_;  ///< of all transforms
  std::string sensor_frame_;      ///< of the latest measurement
  Poses source_;
  tf2::BufferCore tf_;
  tf2::BufferCore given_;    ///< world -> base -> sensor by names of its own, where poses are given
  bool is_mounted_ = false;  ///< where the sensor is on the base is in `given_`
  std::string why_not_mounted_;
  std::string why_no_transform_;      ///< of the latest measurement without one
  ros::Time first_pose_, last_pose_;  ///< given
  std::vector<std::unique_ptr<SensorQueue>> queues_;
  std::size_t restarts_ = 0;  ///< of the queue with most
  std::function<void()> restart_ = [] {};
  std::vector<std::function<std::vector<std::string>()>> warnings_;
  std::size_t measurements_ = 0, used_ = 0;
  Counters dropped_;
  std::vector<double> durations_ms_;
  double recorded_s_ = 0.0, wall_s_ = 0.0;
};

}  // namespace situation_awareness
