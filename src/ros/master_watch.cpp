// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/master_watch.hpp"

#include <chrono>
#include <exception>
#include <mutex>
#include <optional>
#include <string>

#include <ros/console.h>
#include <ros/master.h>
#include <ros/param.h>
#include <ros/this_node.h>
#include <ros/time.h>

namespace situation_awareness {
namespace {

constexpr const char* kSimulatedTime = "/use_sim_time";

/// The run id of the master, without waiting; empty if none responds. ros::param::get would wait for one.
std::string run_id() {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = "/run_id";
  const bool wait_for_master = false;
  if (!ros::master::execute("getParam", request, response, payload, wait_for_master)) return "";
  return payload.getType() == XmlRpc::XmlRpcValue::TypeString ? static_cast<std::string>(payload) : "";
}

/// The run of the master for all watches of this process, which ask it again only where the latest answer is older than
/// half their period.
std::string latest_run_id() {
  using Clock = std::chrono::steady_clock;
  static std::mutex mutex;
  static std::string latest;
  static std::optional<Clock::time_point> asked_at;
  const std::lock_guard<std::mutex> lock(mutex);
  const Clock::time_point now = Clock::now();
  if (!asked_at || now - *asked_at > std::chrono::duration<double>(0.5 * MasterWatch::kPeriod_s)) {
    latest = run_id();
    asked_at = now;
  }
  return latest;
}

}  // namespace

MasterWatch::MasterWatch(const ros::NodeHandle& private_node)
    : private_node_(private_node), run_id_(run_id()), simulated_time_(ros::Time::isSimTime()) {
  private_node_.getParam(private_node_.getNamespace(), parameters_);
  thread_ = std::thread([this] { watch(); });
}

MasterWatch::~MasterWatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopped_ = true;
  }
  stop_.notify_all();
  thread_.join();
}

void MasterWatch::report(diagnostic_updater::DiagnosticStatusWrapper& status) const {
  if (!at_new_master_) return;
  status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN,
                      "a new master was started, which does not know this node");
}

void MasterWatch::watch() {
  const auto period = std::chrono::duration<double>(kPeriod_s);
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stop_.wait_for(lock, period, [this] { return stopped_; })) {
    lock.unlock();
    try {
      const std::string id = latest_run_id();
      if (!id.empty() && run_id_.empty()) run_id_ = id;
      if (!id.empty() && id != run_id_) {
        restore_parameters();
        run_id_ = id;
        at_new_master_ = true;
        ROS_WARN_STREAM(private_node_.getNamespace() << ": a new master was started, which does not know this node; "
                                                        "existing connections go on");
      }
    } catch (const std::exception& error) {
      ROS_WARN_STREAM(private_node_.getNamespace() << ": " << error.what());
    }
    lock.lock();
  }
}

void MasterWatch::restore_parameters() const {
  const std::string& name = private_node_.getNamespace();
  if (parameters_.valid() && !ros::param::has(name)) ros::param::set(name, parameters_);
  if (simulated_time_ && !ros::param::has(kSimulatedTime)) ros::param::set(kSimulatedTime, true);
}

}  // namespace situation_awareness
