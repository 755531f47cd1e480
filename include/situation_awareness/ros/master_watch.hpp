// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/node_handle.h>

namespace situation_awareness {

/// Detects a restarted master. Such a master does not know the nodes and parameters of the old one; existing
/// connections go on. This node's parameters are written to it, and one warning is logged. A master that is only
/// unreachable has no effect. It never ends the process, which may be another package's manager: only stage_manager
/// does so.
///
/// It polls /run_id every kPeriod_s on its own thread, by the steady clock.
class MasterWatch {
 public:
  static constexpr double kPeriod_s = 2.0;

  /// `private_node`: its parameters are restored.
  explicit MasterWatch(const ros::NodeHandle& private_node);
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;
  ~MasterWatch();

  /// True if the master was restarted since construction. From any thread.
  bool at_new_master() const { return at_new_master_; }

  /// Warns on /diagnostics from then on.
  void report(diagnostic_updater::DiagnosticStatusWrapper& status) const;

 private:
  void watch();
  void restore_parameters() const;

  ros::NodeHandle private_node_;
  XmlRpc::XmlRpcValue parameters_;
  std::string run_id_;
  bool simulated_time_;
  std::atomic<bool> at_new_master_{false};
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace situation_awareness
