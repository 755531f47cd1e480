// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <utility>

#include <ros/node_handle.h>
#include <ros/transport_hints.h>
#include <tf2/buffer_core.h>
#include <tf2_ros/transform_listener.h>

#include "situation_awareness/ros/direct_queue.hpp"

namespace situation_awareness {

/// Receives TF into a buffer, also while the stage is busy, on the threads that deliver it: a
/// tf2_ros::TransformListener with a thread of its own wakes that 100 times a second.
class TransformInput {
 public:
  /// `transforms` must outlive this. `on_transforms` is called after each message, on the thread that delivers it.
  TransformInput(
      tf2::BufferCore& transforms, const ros::NodeHandle& node, std::function<void()> on_transforms = [] {})
      : queue_(std::move(on_transforms)),
        listener_(transforms, with_queue(node, queue_), /*spin_thread=*/false, ros::TransportHints().tcpNoDelay()) {}

 private:
  static ros::NodeHandle with_queue(ros::NodeHandle node, DirectQueue& queue) {
    node.setCallbackQueue(&queue);
    return node;
  }

  DirectQueue queue_;
  tf2_ros::TransformListener listener_;  ///< ends before its queue
};

}  // namespace situation_awareness
