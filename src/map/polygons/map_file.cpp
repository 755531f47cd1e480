// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/map_file.hpp"

#include <array>
#include <cstdint>
#include <cstdio>

#include "situation_awareness/map/map_file.hpp"

namespace situation_awareness {
namespace {

struct PolygonMapFormat {
  using Snapshot = PolygonMapSnapshot;
  static constexpr std::size_t kMaxElements = polygon_bounds::kMaxElements;

  static MapFileHeader header() {
    const std::uint64_t version = 2, oldest_version = 1;
    return {"State of a map of polygons after an update; docs/map_file.md describes the fields.",
            "situation_awareness polygons", version, oldest_version};
  }

  static std::string comment_on(const PolygonMapElement& element) {
    std::array<char, 128> text;
    std::snprintf(text.data(), text.size(), "of chain %llu at (%.2f, %.2f) m",
                  static_cast<unsigned long long>(element.chain), element.p_world_m.x(), element.p_world_m.y());
    return text.data();
  }

  static void read(PolygonMapSnapshot& snapshot, ReadFields& fields, std::uint64_t version) {
    if (version == 1) {  // without chains: they are linked anew
      for (const char* row : {"met_joints", "chains", "seldom_hit", "crossed", "renamed", "lines"}) fields.add(row, "");
    }
    PolygonMapSnapshot::fields(snapshot, fields);
  }

  static void read(PolygonMapElement& element, ReadFields& fields, std::uint64_t /*version*/,
                   const PolygonMapSnapshot& /*snapshot*/) {
    PolygonMapElement::fields(element, fields);
  }
};

using PolygonMapFile = MapFile<PolygonMapFormat>;

}  // namespace

std::string polygon_map_to_yaml(const PolygonMapSnapshot& snapshot) { return PolygonMapFile::to_yaml(snapshot); }

PolygonMapSnapshot polygon_map_from_yaml(const std::string& yaml, const std::string& source) {
  return PolygonMapFile::from_yaml(yaml, source);
}

void save_polygon_map(const std::string& path, const PolygonMapSnapshot& snapshot) {
  PolygonMapFile::save(path, snapshot);
}

PolygonMapSnapshot load_polygon_map(const std::string& path) { return PolygonMapFile::load(path); }

PolygonMapSnapshot load_polygon_map(const std::string& path, const std::string& world_frame) {
  return PolygonMapFile::load(path, world_frame);
}

}  // namespace situation_awareness
