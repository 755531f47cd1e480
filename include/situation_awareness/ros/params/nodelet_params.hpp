// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/ros/params/param_reader.hpp"

namespace situation_awareness {

/// What is said of ~base_frame, which several nodelets read.
constexpr const char* kBaseFrameDoc =
    "frame of the vehicle: x ahead, y left, z up; midway between its driven wheels where it has such";

/// Parameters of the ROS boundary, for nodelets of any kind of map.
struct NodeletParams {
  std::string world_frame = "world";
  double tf_timeout_s = 0.5;
  double max_stamp_ahead_s = 600.0;
  bool deskew = true;
  int queue_size = 20;
  double downlink_rate_hz = 5.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world_frame", self.world_frame, "fixed frame of the map, which TF must connect with the frame of the scans");
    visit("tf_timeout_s", self.tf_timeout_s, Bounds{0.0, 60.0}, "s",
          "maximum time that a scan waits for its transform, in wall time");
    visit(
        "max_stamp_ahead_s", self.max_stamp_ahead_s, Bounds{0.1, 1e9}, "s",
        "a message of a sensor whose stamp is ahead of ROS time by more is refused; less is what the clock of a sensor "
        "may be off, or a recording that is played fast");
    visit("deskew", self.deskew,
          "transform each beam at its own time where the scan has a time_increment; a scan then also waits for the "
          "transform at its last beam, up to one period of TF longer");
    visit("queue_size", self.queue_size, Bounds{1, 1000}, "scans",
          "maximum number of scans that wait for their transforms; in a full queue a new scan replaces the newest one");
    visit("downlink_rate_hz", self.downlink_rate_hz, Bounds{0.1, 1000.0}, "Hz",
          "maximum rate of downlink/semantic_map, in wall time");
  }
};

/// The frame's name for tf2. Throws std::invalid_argument naming `source` if it is empty.
std::string checked_world_frame(const std::string& world_frame, const std::string& source);

/// Reads the parameters of a nodelet from the parameter server: a params struct with the members `NodeletParams
/// nodelet` and `std::vector<UnknownKey> unknown`, the keys that it does not have. Throws std::invalid_argument with
/// one sentence.
template <class Params>
Params read_nodelet_params(const ParamReader& reader) {
  std::vector<UnknownKey> unknown;
  auto params = reader.read<Params>([&unknown](const UnknownKey& key) {
    if (key.path != "live") unknown.push_back(key);  // that is the namespace of LiveParams
  });
  params.unknown = std::move(unknown);
  params.nodelet.world_frame = checked_world_frame(params.nodelet.world_frame, reader.source());
  return params;
}

}  // namespace situation_awareness
