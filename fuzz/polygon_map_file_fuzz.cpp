// SPDX-License-Identifier: BSD-3-Clause
// Any text as the file of a map of polygons or as GeoJSON, and any map as a file.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "draw_polylines.hpp"
#include "input.hpp"
#include "situation_awareness/map/polygons/geojson.hpp"
#include "situation_awareness/map/polygons/map_file.hpp"
#include "situation_awareness/map/polygons/timed_polygon_map.hpp"

namespace situation_awareness::fuzz {
namespace {

/// What `act` returns, or none where it refuses with a sentence that names the file.
template <class Act>
auto unless_refused(const Act& act) -> std::optional<decltype(act())> {
  try {
    return act();
  } catch (const std::invalid_argument& error) {
    const std::string sentence = error.what();
    require(sentence.rfind("fuzz: ", 0) == 0 && sentence.size() > 6, "a refusal names the file and the reason");
    return std::nullopt;
  }
}

std::optional<PolygonMapSnapshot> read(const std::string& yaml) {
  return unless_refused([&] { return polygon_map_from_yaml(yaml, "fuzz"); });
}

/// A snapshot can be written, is read back exactly, and gives a map that continues as the one before.
void check_snapshot(Input& input, const PolygonMapSnapshot& snapshot) {
  const std::string yaml = polygon_map_to_yaml(snapshot);
  const std::optional<PolygonMapSnapshot> again = read(yaml);
  require(again.has_value(), "what is written is read");
  require(polygon_map_to_yaml(*again) == yaml, "written, read and written again is the same");
  if (!snapshot.watches.empty() &&
      snapshot.watches.size() != PolygonMap(PolygonMapParams{}).snapshot().watches.size()) {
    return;
  }
  PolygonMap map(PolygonMapParams{});
  map.restore(snapshot);
  TimedPolygonMap resumed(PolygonMapParams{}, {}, 1.0);
  resumed.resume(snapshot);
  check_polygons(map.polygons());
  check_polygons(resumed.polygons());
  const std::uint64_t next_id = map.snapshot().next_id;
  require(next_id >= snapshot.next_id, "ids are not used again");
  std::int64_t stamp_ns = std::max<std::int64_t>(snapshot.stamp_ns, 0);
  for (int scan = 0; scan < 3; ++scan) {
    stamp_ns += 40'000'000;
    Polylines polylines = draw_polylines(input);
    polylines.stamp_ns = stamp_ns;
    map.update(polylines, 1e-6 * Eigen::Matrix3d::Identity());
    resumed.update(polylines, 1e-6 * Eigen::Matrix3d::Identity());
    check_polygons(map.polygons());
    check_polygons(resumed.polygons());
  }
}

/// A map of some scans, with some numbers replaced by arbitrary ones.
PolygonMapSnapshot draw_snapshot(Input& input) {
  PolygonMap map(PolygonMapParams{});
  Polylines polylines = draw_polylines(input);
  polylines.stamp_ns = 1'000'000'000;
  for (int scan = input.integer(1, 12); scan > 0; --scan) {
    polylines.stamp_ns += 40'000'000;
    map.update(polylines, 1e-6 * Eigen::Matrix3d::Identity());
  }
  map.polygons();
  PolygonMapSnapshot snapshot = map.snapshot();
  snapshot.world_frame = "world";
  for (PolygonMapElement& element : snapshot.elements) {
    if (!input.left()) break;
    if (input.integer(0, 31) != 0) continue;
    switch (input.integer(0, 7)) {
      case 0:
        element.p_world_m.x() = input.any<double>();
        break;
      case 1: {
        const double angle_rad = input.uniform(-kPi, kPi);
        element.normal_world = {std::cos(angle_rad), std::sin(angle_rad)};
        break;
      }
      case 2:
        element.variance_m2 = input.by_magnitude(1e-13, 1e10);
        break;
      case 3:
        element.log_odds = input.any<double>();
        break;
      case 4:
        element.place = input.integer(-1, 100);
        break;
      case 5:
        element.chain = static_cast<std::uint64_t>(input.any_int64());
        break;
      case 6:
        element.first_seen_ns = input.any_int64();
        break;
      default:
        element.confirmed = input.flag();
        break;
    }
  }
  if (input.integer(0, 15) == 0) snapshot.next_id = static_cast<std::uint64_t>(input.any_int64());
  if (input.integer(0, 15) == 0) snapshot.stamp_ns = input.any_int64();
  if (input.integer(0, 15) == 0) snapshot.next_watch = input.integer(-1, 70);
  return snapshot;
}

void check_geojson(const std::string& text) {
  const auto polygons = unless_refused([&] { return polygons_from_geojson(text, "fuzz", "map"); });
  if (!polygons) return;
  for (const Chain& chain : polygons->chains) require(chain.vertices.size() >= 2, "a chain has two vertices at least");
  const std::string written = polygons_to_geojson(*polygons, "map");
  const auto again = unless_refused([&] { return polygons_from_geojson(written, "fuzz", "map"); });
  require(again.has_value(), "chains that are written are read");
  require(again->chains.size() == polygons->chains.size(), "all of them");
  for (std::size_t i = 0; i < again->chains.size(); ++i) {
    require(again->chains[i].id == polygons->chains[i].id, "with their ids");
    require(again->chains[i].closed == polygons->chains[i].closed, "closed or not");
    require(again->chains[i].vertices.size() == polygons->chains[i].vertices.size(), "with all vertices");
  }
  try {
    snapshot_of_chains(*polygons, 0.04).validate();
  } catch (const std::invalid_argument&) {
  }
}

void run(Input input) {
  switch (input.integer(0, 2)) {
    case 0: {
      const std::string text = input.rest();
      if (const auto snapshot = read(text)) check_snapshot(input, *snapshot);
      if (const auto snapshot = read(text + "\nsha256: edited\n")) check_snapshot(input, *snapshot);
      return;
    }
    case 1:
      return check_geojson(input.rest());
    default:
      break;
  }
  const PolygonMapSnapshot snapshot = draw_snapshot(input);
  std::string yaml;
  try {
    yaml = polygon_map_to_yaml(snapshot);
  } catch (const std::invalid_argument&) {
    return;
  }
  check_snapshot(input, snapshot);

  // Damage is detected at any position.
  const std::size_t place = input.count(yaml.size() - 1);
  std::string damaged = yaml;
  damaged[place] = static_cast<char>(damaged[place] ^ (1 << input.integer(0, 7)));
  require(!read(damaged), "a file with a wrong bit is refused");
  require(!read(yaml.substr(0, place)), "a file that was cut off is refused");
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}
