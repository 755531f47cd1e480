// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/map_file.hpp"

#include <array>
#include <cstdint>
#include <cstdio>

#include "situation_awareness/map/map_file.hpp"
#include "situation_awareness/map/objects/existence.hpp"

namespace situation_awareness {
namespace {

struct ObjectMapFormat {
  using Snapshot = MapSnapshot;
  static constexpr std::size_t kMaxElements = map_bounds::kMaxElements;

  static MapFileHeader header() {
    const std::uint64_t version = 3, oldest_version = 1;
    return {"State of an object map after an update; docs/map_file.md describes the fields.", "situation_awareness map",
            version, oldest_version};
  }

  static std::string comment_on(const MapElement& element) {
    const Ellipse ellipse = ellipse_world(combine(element.estimate).x);
    std::array<char, 160> text;
    std::snprintf(text.data(), text.size(), "at (%.2f, %.2f) m, radii %.2f m and %.2f m, turned by %.2f rad",
                  ellipse.center_m.x(), ellipse.center_m.y(), ellipse.rx_m, ellipse.ry_m, ellipse.psi_rad);
    return text.data();
  }

  static void read(MapSnapshot& snapshot, ReadFields& fields, std::uint64_t /*version*/) {
    MapSnapshot::fields(snapshot, fields);
  }

  static void read(MapElement& element, ReadFields& fields, std::uint64_t version, const MapSnapshot& snapshot) {
    if (version < 3) {
      fields.add("class", name_of(ObjectClass::kUnknown));
      fields.add("p_class", "0");
      fields.add("other_leg", "0");
      fields.add("other_leg_log_odds", "0");
      fields.add("leg_offset_x_m", "0");
      fields.add("leg_offset_y_m", "0");
      fields.add("leg_offset_variance_m2", "0");
      fields.add("box_log_odds", std::to_string(kSurelyEllipse));
      fields.add("box_psi", "0");
      bool moves = false;
      fields("moves", moves);
      fields.add("moving_scans", moves ? "1" : "0");
    }
    // Version 1 has `confirmed`; the time since the last detection then decides whether the element is lost.
    if (version == 1) {
      bool confirmed = false;
      fields("confirmed", confirmed);
      fields.add("state", name_of(confirmed ? TrackState::kConfirmed : TrackState::kTentative));
    }
    MapElement::fields(element, fields);
    if (version == 1) age(element, snapshot.stamp_ns);
  }
};

using ObjectMapFile = MapFile<ObjectMapFormat>;

}  // namespace

std::string map_to_yaml(const MapSnapshot& snapshot) { return ObjectMapFile::to_yaml(snapshot); }

MapSnapshot map_from_yaml(const std::string& yaml, const std::string& source) {
  return ObjectMapFile::from_yaml(yaml, source);
}

void save_map(const std::string& path, const MapSnapshot& snapshot) { ObjectMapFile::save(path, snapshot); }

MapSnapshot load_map(const std::string& path) { return ObjectMapFile::load(path); }

MapSnapshot load_map(const std::string& path, const std::string& world_frame) {
  return ObjectMapFile::load(path, world_frame);
}

}  // namespace situation_awareness
