// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <memory>
#include <optional>

#include <nodelet/nodelet.h>

#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/stage_context.hpp"
#include "situation_awareness/ros/stage_queue.hpp"

namespace situation_awareness {

/// The nodelet of a stage. It reads the parameters, constructs the stage, passes it one message at a time on a thread
/// of its own, and reports the results on /diagnostics. If parameters or stage throw, it refuses to start with one
/// message; its manager and the other nodelets keep running (stage_manager retries). A stage is a class with
///
///     using Context = StageContext<SegmentArray>;              // of the message that it takes
///     static constexpr const char* kInput = "segments";        // and its topic
///     static constexpr auto kReadParams = read_nodelet_params<Params>; // from a ParamReader; has `unknown` keys
///     Stage(Context& context, const Params& params);
///     bool process(const SegmentArray& msg); // true: output was published; false: the reason was counted
///
/// Exceptions of process() are counted as errors. The context outlives the stage, which is never copied nor moved.
template <class Stage>
class StageNodelet : public nodelet::Nodelet {
 public:
  ~StageNodelet() override { end(); }

 private:
  void onInit() final {
    try {
      const auto params = Stage::kReadParams(ParamReader(getPrivateNodeHandle()));
      ros::NodeHandle node = getNodeHandle(), private_node = getPrivateNodeHandle();
      node.setCallbackQueue(&queue_.emplace().callbacks());
      private_node.setCallbackQueue(&queue_->callbacks());
      context_.emplace(node, private_node, getName());
      stage_ = std::make_unique<Stage>(*context_, params);
      context_->diagnostics().unknown_parameters(params.unknown);
      context_->start(Stage::kInput, [this](const auto& msg) { return stage_->process(msg); });
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(getName() << " does not start: " << error.what());
      end();  // now: where onInit() throws, the manager destroys the callback queues before the nodelet
      throw;  // the manager drops this nodelet
    }
  }

  void end() {
    if (queue_) queue_->end();
    if (context_) context_->stop();
    stage_.reset();
    context_.reset();
  }

  std::optional<StageQueue> queue_;
  std::optional<typename Stage::Context> context_;
  std::unique_ptr<Stage> stage_;  // not optional: a stage, whose callbacks hold `this`, is never copied nor moved
};

}  // namespace situation_awareness
