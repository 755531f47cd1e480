// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/services.hpp"
#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// Services of the nodelet that keeps a map of any kind (docs/ros.md, "Services"): reset, pause, get_KIND, save_KIND
/// and load_KIND. All calls are on the callback queue of its stage, without a lock; `context` and `map` must outlive
/// it. A kind of map is a struct such as ObjectKind with
///
///     using Map = ObjectMap;              // kNoStamp, stamp_ns(), size(), at(), reset(), snapshot(), resume()
///     using Value = Objects;              // the map at one time
///     using Message = MappedObjectArray;  // and as a message
///     using Get = GetObjects;             // types of the services
///     using Save = SaveObjects;
///     using Load = LoadObjects;
///     static constexpr const char* kName = "objects";
///     static Message to_msg(const Value& value, const std::string& world_frame);
///     static Message& map_of(Get::Response& response);
///     static void save(const std::string& file, const Snapshot& snapshot);
///     static Snapshot load(const std::string& file, const std::string& world_frame);
template <class Kind>
class MapServices {
 public:
  using Map = typename Kind::Map;

  /// Publishes the changed map at once.
  using Publish = std::function<void(const typename Kind::Value&)>;

  MapServices(StageContextBase& context, const std::string& world_frame, Map& map, Publish publish)
      : context_(context), world_frame_(world_frame), map_(map), publish_(std::move(publish)), services_(context) {
    context_.when_made([this] { advertise(); });
  }
  MapServices(const MapServices&) = delete;
  MapServices& operator=(const MapServices&) = delete;

  /// True while the map is paused: the input is skipped, and counted.
  bool passes_over() {
    if (paused_) context_.diagnostics().counted({{"passed over while paused", 1}});
    return paused_;
  }

 private:
  void advertise() {
    const std::string kind = Kind::kName;
    services_.add<std_srvs::Trigger>(context_.private_node(), "reset",
                                     [this](const auto& /*request*/, auto& response) { response.message = reset(); });
    services_.add<std_srvs::SetBool>(context_.private_node(), "pause", [this](const auto& request, auto& response) {
      response.message = pause(request.data != 0);
    });
    services_.add<typename Kind::Get>(context_.node(), "get_" + kind, [this](const auto& request, auto& response) {
      Kind::map_of(response) = map_at(request.stamp);
    });
    services_.add<typename Kind::Save>(
        context_.private_node(), "save_" + kind,
        [this](const auto& request, auto& response) { response.message = save(request.file); });
    services_.add<typename Kind::Load>(
        context_.private_node(), "load_" + kind,
        [this](const auto& request, auto& response) { response.message = load(request.file); });
  }

  std::string reset();
  std::string pause(bool paused);
  typename Kind::Message map_at(const ros::Time& stamp) const;
  std::string save(const std::string& file);
  std::string load(const std::string& file);

  StageContextBase& context_;
  std::string world_frame_;
  Map& map_;
  Publish publish_;
  bool paused_ = false;
  Services services_;
};

// --- implementation -------------------------------------------------------------------------------------------------

namespace detail {

/// Throws std::runtime_error if a map of `latest_ns` cannot be predicted to that time.
void check_predictable(std::int64_t latest_ns, std::int64_t stamp_ns);

}  // namespace detail

template <class Kind>
std::string MapServices<Kind>::reset() {
  const std::int64_t latest_ns = map_.stamp_ns();
  const std::size_t elements = map_.size();
  map_.reset();
  // The other stages and all displays must clear theirs, too.
  if (latest_ns != Map::kNoStamp) publish_(map_.at(latest_ns));
  return "the map was reset: " + count_of(elements, "element") + " forgotten";
}

template <class Kind>
std::string MapServices<Kind>::pause(bool paused) {
  paused_ = paused;
  context_.diagnostics().pause(paused);
  return paused ? "the map is paused" : "the map goes on";
}

template <class Kind>
typename Kind::Message MapServices<Kind>::map_at(const ros::Time& stamp) const {
  const std::int64_t latest_ns = map_.stamp_ns();
  if (latest_ns == Map::kNoStamp) throw std::runtime_error("there is no map yet");
  if (stamp.isZero()) return Kind::to_msg(map_.at(latest_ns), world_frame_);
  const std::int64_t stamp_ns = to_nanoseconds(stamp);
  detail::check_predictable(latest_ns, stamp_ns);
  return Kind::to_msg(map_.at(stamp_ns), world_frame_);
}

template <class Kind>
std::string MapServices<Kind>::save(const std::string& file) {
  check_absolute(file);
  if (map_.stamp_ns() == Map::kNoStamp) throw std::runtime_error("there is no map yet");
  auto snapshot = map_.snapshot();
  snapshot.world_frame = world_frame_;
  Kind::save(file, snapshot);
  return count_of(snapshot.elements.size(), "element") + " saved in " + file;
}

template <class Kind>
std::string MapServices<Kind>::load(const std::string& file) {
  check_absolute(file);
  const auto snapshot = Kind::load(file, world_frame_);
  try {
    map_.resume(snapshot);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(file + ": " + error.what());
  }
  publish_(map_.at(map_.stamp_ns()));
  return count_of(snapshot.elements.size(), "element") + " loaded from " + file;
}

}  // namespace situation_awareness
