// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <ros/publisher.h>
#include <ros/single_subscriber_publisher.h>

#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/common/rate_limit.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/map/pending_changes.hpp"
#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "situation_awareness/ros/markers/map_markers.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/services.hpp"
#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// The one map at the ROS boundary, of the nodelet that keeps it (docs/ros.md, "The one map"): the topics semantic_map
/// (whole, latched, once a second), semantic_map/updates (what has changed), downlink/semantic_map (the same at a
/// limited rate, for other hosts) and semantic_map_markers (for display), and the services semantic_map/reset, pause,
/// save_map and load_map. The map has a UUID of its own, and another one when it begins anew. All calls are on the
/// callback queue of its stage, without a lock; `context` and `pipeline` must outlive it.
class MapOutput {
 public:
  /// Publishes a message, with its latency.
  using Publish = std::function<void(const ros::Publisher&, MapUpdate)>;
  /// Makes other stages forget what they know of the map. Throws std::exception with a sentence if that is not
  /// possible.
  using Forget = std::function<void()>;

  /// `forget`: called when a user resets the map, before it begins anew.
  MapOutput(
      StageContextBase& context, const NodeletParams& params, MapPipeline& pipeline, Publish publish,
      Forget forget = [] {});
  MapOutput(const MapOutput&) = delete;
  MapOutput& operator=(const MapOutput&) = delete;

  /// True while the map is paused: the input is skipped, and counted.
  bool passes_over();

  /// Whether a scan comes next: one that does not is dropped, and a restart of time begins the map anew.
  bool is_next(StampOrder::Verdict verdict);

  /// What has changed with the latest update of the pipeline.
  void publish(const MapDelta& delta);

 private:
  void advertise();
  void begin_anew();
  std::string reset();
  std::string pause(bool paused);
  std::string save(const std::string& file) const;
  std::string load(const std::string& file);
  MapUpdate whole();
  void count(const std::vector<Feature>& features);
  void report(StageDiagnostics::Status& status) const;

  StageContextBase& context_;
  std::string world_frame_;
  MapPipeline& pipeline_;
  Publish publish_;
  Forget forget_;
  std::string uuid_;
  bool paused_ = false;
  std::map<std::string, std::size_t> counts_;  ///< of the features when the whole map was told last, by kind
  RateLimit whole_limit_, repair_limit_, downlink_limit_, downlink_repair_limit_;
  PendingChanges pending_;  ///< of the downlink
  MapMarkers markers_;
  ros::Publisher whole_publisher_, updates_publisher_, downlink_publisher_, markers_publisher_;
  Services services_;
};

}  // namespace situation_awareness
