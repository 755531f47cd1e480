// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/map_services.hpp"

#include <cstdio>
#include <exception>
#include <stdexcept>
#include <utility>

#include <ros/console.h>
#include <boost/function.hpp>

#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

/// Predictions say little long before that.
constexpr double kMaxPrediction_s = 60.0;

/// A callback that answers with what `act` makes of the request, or why it did not, and lets nothing escape.
template <class Service, class Act>
boost::function<bool(typename Service::Request&, typename Service::Response&)> answering(const std::string& name,
                                                                                         Act act) {
  return [name, act](typename Service::Request& request, typename Service::Response& response) {
    try {
      act(request, response);
      response.success = true;
      if (!response.message.empty()) ROS_INFO_STREAM(name << ": " << response.message);
    } catch (const std::exception& error) {
      response = {};
      response.message = error.what();
      ROS_WARN_STREAM(name << ": refused: " << response.message);
    }
    return true;
  };
}

std::string count_of(std::size_t elements) {
  return std::to_string(elements) + (elements == 1 ? " element" : " elements");
}

void check_absolute(const std::string& file) {
  if (file.empty() || file.front() != '/') throw std::invalid_argument("'" + file + "' is no absolute path");
}

std::string seconds_text(double seconds) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f s", seconds);
  return text;
}

}  // namespace

MapServices::MapServices(StageContextBase& context, const std::string& world_frame, ObjectMap& map, Publish publish)
    : context_(context), world_frame_(world_frame), map_(map), publish_(std::move(publish)) {
  context_.when_made([this] { advertise(); });
}

void MapServices::advertise() {
  using std_srvs::SetBool;
  using std_srvs::Trigger;
  const std::string& name = context_.name();
  servers_.push_back(context_.private_node().advertiseService<Trigger::Request, Trigger::Response>(
      "reset", answering<Trigger>(name, [this](const auto&, auto& response) { response.message = reset(); })));
  servers_.push_back(context_.private_node().advertiseService<SetBool::Request, SetBool::Response>(
      "pause", answering<SetBool>(name, [this](const auto& request, auto& response) {
        response.message = pause(request.data != 0);
      })));
  servers_.push_back(context_.node().advertiseService<GetObjects::Request, GetObjects::Response>(
      "get_objects", answering<GetObjects>(name, [this](const auto& request, auto& response) {
        response.objects = map_at(request.stamp);
      })));
  servers_.push_back(context_.private_node().advertiseService<SaveObjects::Request, SaveObjects::Response>(
      "save_objects", answering<SaveObjects>(name, [this](const auto& request, auto& response) {
        response.message = save(request.file);
      })));
  servers_.push_back(context_.private_node().advertiseService<LoadObjects::Request, LoadObjects::Response>(
      "load_objects", answering<LoadObjects>(name, [this](const auto& request, auto& response) {
        response.message = load(request.file);
      })));
}

std::string MapServices::reset() {
  const std::int64_t latest_ns = map_.stamp_ns();
  const std::size_t elements = map_.size();
  map_.reset();
  // The other stages and whoever draws the map are to forget too.
  if (latest_ns != ObjectMap::kNoStamp) publish_(map_.at(latest_ns));
  return "the map was reset: " + count_of(elements) + " forgotten";
}

std::string MapServices::pause(bool paused) {
  paused_ = paused;
  context_.diagnostics().pause(paused);
  return paused ? "the map is paused" : "the map goes on";
}

EllipseMap MapServices::map_at(const ros::Time& stamp) const {
  const std::int64_t latest_ns = map_.stamp_ns();
  if (latest_ns == ObjectMap::kNoStamp) throw std::runtime_error("there is no map yet");
  if (stamp.isZero()) return objects_to_msg(map_.at(latest_ns), world_frame_);
  const std::int64_t stamp_ns = to_nanoseconds(stamp);
  const double later_s = seconds_between(latest_ns, stamp_ns);
  if (later_s < 0.0) {
    throw std::runtime_error("the stamp is " + seconds_text(-later_s) + " before the map's latest update");
  }
  if (later_s > kMaxPrediction_s) {
    throw std::runtime_error("the stamp is " + seconds_text(later_s) + " after the map's latest update, more than " +
                             seconds_text(kMaxPrediction_s));
  }
  return objects_to_msg(map_.at(stamp_ns), world_frame_);
}

std::string MapServices::save(const std::string& file) const {
  check_absolute(file);
  if (map_.stamp_ns() == ObjectMap::kNoStamp) throw std::runtime_error("there is no map yet");
  MapSnapshot snapshot = map_.snapshot();
  snapshot.world_frame = world_frame_;
  save_map(file, snapshot);
  return count_of(snapshot.elements.size()) + " saved in " + file;
}

std::string MapServices::load(const std::string& file) {
  check_absolute(file);
  const MapSnapshot snapshot = load_map(file, world_frame_);
  try {
    map_.resume(snapshot);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(file + ": " + error.what());
  }
  publish_(map_.at(map_.stamp_ns()));
  return count_of(snapshot.elements.size()) + " loaded from " + file;
}

}  // namespace situation_awareness
