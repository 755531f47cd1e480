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

/// Looks out for a master that was started anew. Such a master knows no node that was there before it, and no
/// parameter; the links between nodes go on. The parameters of this node are given back to it, and one warning is
/// logged. A master that is merely out of reach changes nothing. It never ends the process, which may be that of
/// others: only stage_manager, whose process it is, does so.
///
/// It asks the master for /run_id every kPeriod_s on a thread of its own, by the steady clock.
class MasterWatch {
 public:
  static constexpr double kPeriod_s = 2.0;

  /// `private_node`: whose parameters are kept.
  explicit MasterWatch(const ros::NodeHandle& private_node);
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;
  ~MasterWatch();

  /// Since this was made, a new master has been started. From any thread.
  bool at_new_master() const { return at_new_master_; }

  /// Warns on /diagnostics from then on.
  void report(diagnostic_updater::DiagnosticStatusWrapper& status) const;

 private:
  void watch();
  void give_parameters_back() const;

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
