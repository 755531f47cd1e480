// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>

#include <ros/callback_queue_interface.h>

namespace situation_awareness {

/// Calls callbacks at once, one at a time, on the thread that delivers their messages: of the publisher in the same
/// process, or of the connection. No thread is woken. For short callbacks that only store what has come; they must
/// neither subscribe nor unsubscribe.
class DirectQueue : public ros::CallbackQueueInterface {
 public:
  /// `after` is called after each callback, on its thread.
  explicit DirectQueue(std::function<void()> after = [] {}) : after_(std::move(after)) {}

  void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t /*owner_id*/ = 0) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    callback->call();
    after_();
  }

  /// None waits. roscpp's lock on the subscription lets it end only between callbacks.
  void removeByID(std::uint64_t /*owner_id*/) override {}

 private:
  std::mutex mutex_;
  std::function<void()> after_;
};

}  // namespace situation_awareness
