// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include <ros/node_handle.h>

namespace situation_awareness {

/// Brings a nodelet back to a master that was started anew. Such a master knows no node that was there before it, and
/// no parameter. Live links go on, and as long as work comes over them nothing is ended: a flight is worth more than
/// being found. When work has stopped, because what feeds the nodelet was started anew as well, the process ends, and
/// whatever started it (`respawn` in launch/objects.launch) brings it back at the new master, with the parameters that
/// it had. A master that is merely out of reach changes nothing.
///
/// It asks the master for /run_id every kPeriod_s on a thread of its own, in wall time. Stages of one manager watch
/// each for itself: every one gives its parameters back at once, and no one ends the process before the others have
/// done so.
class MasterWatch {
 public:
  static constexpr double kPeriod_s = 2.0;
  static constexpr double kIdle_s = 5.0;  ///< without work: that of more than two periods

  /// `private_node`: whose parameters are kept.
  explicit MasterWatch(const ros::NodeHandle& private_node);
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;
  ~MasterWatch();

  /// A message was worked through. From any thread.
  void worked() { worked_at_ns_ = now_ns(); }

 private:
  static std::int64_t now_ns();
  void watch();
  void give_parameters_back() const;

  ros::NodeHandle private_node_;
  XmlRpc::XmlRpcValue parameters_;
  std::string run_id_;
  bool simulated_time_;
  std::atomic<std::int64_t> worked_at_ns_;
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace situation_awareness
