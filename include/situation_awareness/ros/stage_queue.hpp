// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <thread>

#include <ros/callback_queue.h>

namespace situation_awareness {

/// The callbacks of one stage, in order and one at a time, on a thread of its own. The queue of a nodelet hands each
/// callback from its manager's thread to a worker, which wakes two threads for each message.
class StageQueue {
 public:
  StageQueue() : thread_([this] { call_all(); }) {}
  StageQueue(const StageQueue&) = delete;
  StageQueue& operator=(const StageQueue&) = delete;
  ~StageQueue() { end(); }

  ros::CallbackQueueInterface& callbacks() { return queue_; }

  /// Waits for the callback that runs now. None runs later. Not to be called by a callback.
  void end() {
    queue_.disable();
    if (thread_.joinable()) thread_.join();
  }

 private:
  void call_all() {
    const ros::WallDuration most(10.0);  // a callback, or the end, ends the wait
    while (queue_.isEnabled()) queue_.callAvailable(most);
  }

  ros::CallbackQueue queue_;
  std::thread thread_;
};

}  // namespace situation_awareness
