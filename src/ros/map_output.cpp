// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/map_output.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <visualization_msgs/MarkerArray.h>
#include <boost/make_shared.hpp>
#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>

#include "situation_awareness/LoadMap.h"
#include "situation_awareness/SaveMap.h"
#include "situation_awareness/map/saved_map.hpp"
#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kWhole_hz = 1.0;
/// Of whole maps among the updates, for who missed one.
constexpr double kRepair_hz = 0.5;

std::string new_uuid() { return to_string(boost::uuids::random_generator()()); }

}  // namespace

MapOutput::MapOutput(StageContextBase& context, const NodeletParams& params, MapPipeline& pipeline, Publish publish,
                     Forget forget)
    : context_(context),
      world_frame_(params.world_frame),
      pipeline_(pipeline),
      publish_(std::move(publish)),
      forget_(std::move(forget)),
      uuid_(new_uuid()),
      whole_limit_(kWhole_hz),
      repair_limit_(kRepair_hz),
      downlink_limit_(params.downlink_rate_hz),
      downlink_repair_limit_(kRepair_hz),
      whole_publisher_(context.node().advertise<MapUpdate>("semantic_map", 1, true)),
      // Who comes later begins with the whole map.
      updates_publisher_(context.node().advertise<MapUpdate>("semantic_map/updates", 20,
                                                             [this](const ros::SingleSubscriberPublisher& subscriber) {
                                                               if (pipeline_.has_map()) subscriber.publish(whole());
                                                             })),
      // Without a queue: what a broken link has delayed is outdated.
      downlink_publisher_(context.node().advertise<MapUpdate>("downlink/semantic_map", 1)),
      markers_publisher_(context.node().advertise<visualization_msgs::MarkerArray>("semantic_map_markers", 5)),
      services_(context) {
  count({});
  context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
  context.when_made([this] { advertise(); });
}

void MapOutput::advertise() {
  ros::NodeHandle& node = context_.node();
  services_.add<std_srvs::Trigger>(node, "semantic_map/reset",
                                   [this](const auto& /*request*/, auto& response) { response.message = reset(); });
  services_.add<std_srvs::SetBool>(node, "semantic_map/pause", [this](const auto& request, auto& response) {
    response.message = pause(request.data != 0);
  });
  services_.add<SaveMap>(node, "semantic_map/save_map",
                         [this](const auto& request, auto& response) { response.message = save(request.file); });
  services_.add<LoadMap>(node, "semantic_map/load_map",
                         [this](const auto& request, auto& response) { response.message = load(request.file); });
}

std::string MapOutput::reset() {
  forget_();
  const std::string forgotten = count_of(pipeline_.size(), "feature");
  begin_anew();
  return "the map begins anew: " + forgotten + " forgotten";
}

std::string MapOutput::pause(bool paused) {
  paused_ = paused;
  context_.diagnostics().pause(paused);
  return paused ? "the map is paused" : "the map goes on";
}

std::string MapOutput::save(const std::string& file) const {
  check_absolute(file);
  if (!pipeline_.has_map()) throw std::runtime_error("there is no map yet");
  SavedMap saved = pipeline_.saved();
  saved.world_frame = world_frame_;
  save_features(file, saved);
  return count_of(saved.map.features.size(), "feature") + " saved in " + file;
}

std::string MapOutput::load(const std::string& file) {
  check_absolute(file);
  const SavedMap saved = load_features(file, world_frame_);
  const MapDelta& delta = pipeline_.resume(saved);
  uuid_ = new_uuid();
  const std::size_t loaded = delta.changed.size();
  publish(delta);
  return count_of(loaded, "feature") + " loaded from " + file;
}

bool MapOutput::passes_over() {
  if (paused_) context_.diagnostics().counted({{"passed over while paused", 1}});
  return paused_;
}

bool MapOutput::is_next(StampOrder::Verdict verdict) {
  if (verdict == StampOrder::Verdict::kRefused) return context_.drop(drop_reason::kStamp);
  if (verdict == StampOrder::Verdict::kRestart) {
    begin_anew();
    context_.diagnostics().counted({{"time jumped back: new map", 1}});
  }
  return true;
}

void MapOutput::publish(const MapDelta& delta) {
  const std::int64_t now_ns = steady_now_ns();
  std::optional<MapUpdate> all;  // made once, for all to whom it is due
  const auto whole_once = [&]() -> const MapUpdate& { return all ? *all : all.emplace(whole()); };
  // A whole map says what is gone by leaving it out, and why, as the changes do.
  const auto publish_changes = [&](const ros::Publisher& publisher, const MapDelta& changes, bool is_repair) {
    MapUpdate update = is_repair ? whole_once() : map_delta_to_msg(changes, uuid_, world_frame_);
    if (is_repair) update.gone = gone_to_msg(changes.gone);
    publish_(publisher, std::move(update));
  };
  if (whole_limit_.passes(now_ns) || delta.full) publish_(whole_publisher_, whole_once());
  if (updates_publisher_.getNumSubscribers() > 0) {
    publish_changes(updates_publisher_, delta, repair_limit_.passes(now_ns));
  }
  if (downlink_publisher_.getNumSubscribers() == 0) {
    pending_.clear();
  } else {
    pending_.add(delta);
    if (downlink_limit_.passes(now_ns)) {
      publish_changes(downlink_publisher_, pending_.take(), downlink_repair_limit_.passes(now_ns));
    }
  }
  if (markers_publisher_.getNumSubscribers() > 0) {
    markers_publisher_.publish(
        boost::make_shared<const visualization_msgs::MarkerArray>(markers_.update(pipeline_.map(), world_frame_)));
  }
}

/// Another map with another UUID.
void MapOutput::begin_anew() {
  pipeline_.begin_anew();
  uuid_ = new_uuid();
}

MapUpdate MapOutput::whole() {
  const MapDelta map = pipeline_.whole();
  count(map.changed);
  return map_delta_to_msg(map, uuid_, world_frame_);
}

void MapOutput::count(const std::vector<Feature>& features) {
  counts_ = {{"moving", 0}, {"ellipse", 0}, {"box", 0}, {"polyline", 0}, {"boundary", 0}, {"target", 0}};
  for (const Feature& feature : features) {
    ++counts_[kind_of(feature.shape)];
    if (feature.motion == Motion::kMoving) ++counts_["moving"];
  }
}

void MapOutput::report(StageDiagnostics::Status& status) const {
  status.add("features", pipeline_.size());
  for (const auto& [what, number] : counts_) status.add(what, number);
}

}  // namespace situation_awareness
