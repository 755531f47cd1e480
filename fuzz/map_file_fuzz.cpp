// SPDX-License-Identifier: BSD-3-Clause
// Any text as the file of a map, and any map as a file.
#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>

#include "draw_detections.hpp"
#include "input.hpp"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/map/objects/object_map.hpp"

namespace situation_awareness::fuzz {
namespace {

/// The snapshot of a text, or the reason of its refusal.
std::optional<MapSnapshot> read(const std::string& yaml) {
  try {
    return map_from_yaml(yaml, "fuzz.yaml");
  } catch (const std::invalid_argument& error) {
    const std::string sentence = error.what();
    require(sentence.rfind("fuzz.yaml: ", 0) == 0 && sentence.size() > 11, "a refusal names the file and the reason");
    return std::nullopt;
  }
}

/// A map continues from the snapshot: new ids are new.
void check_update(ObjectMap& map, const Detections& detections, std::uint64_t& next_id) {
  const ObjectMapUpdate update = map.update(detections);
  for (const std::uint64_t id : update.created) {
    require(id >= next_id, "a new element has a new id");
    next_id = id + 1;
  }
  check_objects(map.at(detections.stamp_ns), next_id - 1);
}

/// A snapshot can be written, is read back exactly, and gives a map that continues.
void check_snapshot(Input& input, const MapSnapshot& snapshot) {
  const std::string yaml = map_to_yaml(snapshot);
  const std::optional<MapSnapshot> again = read(yaml);
  require(again.has_value(), "what is written is read");
  require(map_to_yaml(*again) == yaml, "written, read and written again is the same");

  ObjectMapParams params;
  params.shape = snapshot.shape;
  ObjectMap map(params);
  map.restore(snapshot);
  MapSnapshot restored = map.snapshot();
  restored.world_frame = snapshot.world_frame;
  require(map_to_yaml(restored) == yaml, "a map that is restored knows what it knew");
  check_objects(map.at(map.stamp_ns()), snapshot.next_id - 1);
  ObjectMap resumed(params);
  resumed.resume(snapshot);

  Detections detections;
  detections.stamp_ns = snapshot.stamp_ns;
  std::uint64_t next_id = snapshot.next_id;
  std::uint64_t next_id_resumed = snapshot.next_id;
  for (int scan = 0; scan < 3; ++scan) {
    detections.stamp_ns += nanoseconds(0.05);
    detections.detections.clear();
    for (const MapElement& element : snapshot.elements) {
      if (detections.detections.size() >= 5) break;
      if (!input.flag()) continue;
      detections.detections.push_back(draw_detection(input, canonical(ellipse_world(element.estimate.standing.x))));
    }
    detections.free_space = draw_free_space(input);
    check_update(map, detections, next_id);
    check_update(resumed, detections, next_id_resumed);
  }
}

/// A map of some scans, with some numbers replaced by arbitrary ones.
MapSnapshot draw_snapshot(Input& input) {
  ObjectMapParams params;
  if (input.flag()) params.shape = "circle";
  ObjectMap map(params);
  std::vector<Ellipse> things;
  for (std::size_t i = input.count(3); i > 0; --i) things.push_back(input.ellipse());
  Detections detections;
  detections.stamp_ns = nanoseconds(input.by_magnitude(1.0, 4e9));
  for (int scan = input.integer(1, 6); scan > 0; --scan) {
    detections.stamp_ns += nanoseconds(0.05);
    detections.detections.clear();
    for (const Ellipse& thing : things) detections.detections.push_back(draw_detection(input, canonical(thing)));
    map.update(detections);
  }
  MapSnapshot snapshot = map.snapshot();
  snapshot.world_frame = "world";
  for (MapElement& element : snapshot.elements) {
    for (ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
      if (input.integer(0, 3) != 0) continue;
      const int i = input.integer(0, 7);
      estimate->x(i) = input.flag() ? input.any<double>() : input.signed_by_magnitude(1e6);
      const double sigma = input.by_magnitude(1e-6, 3e4);
      estimate->P.row(i) *= sigma;
      estimate->P.col(i) *= sigma;
    }
    if (input.integer(0, 7) == 0) element.log_odds = input.any<double>();
    if (input.integer(0, 7) == 0) element.estimate.p_moving = input.uniform(0.0, 1.0);
    if (input.integer(0, 7) == 0) element.id = static_cast<std::uint64_t>(input.any_int64());
    if (input.integer(0, 7) == 0) element.body = static_cast<std::uint64_t>(input.integer(0, 5));
    if (input.integer(0, 7) == 0) element.is_part = input.flag();
  }
  if (input.integer(0, 7) == 0) snapshot.noise = input.any<double>();
  if (input.integer(0, 7) == 0) snapshot.next_id = static_cast<std::uint64_t>(input.any_int64());
  return snapshot;
}

void run(Input input) {
  if (input.flag()) {
    const std::string text = input.rest();
    if (const auto snapshot = read(text)) check_snapshot(input, *snapshot);
    if (const auto snapshot = read(text + "\nsha256: edited\n")) check_snapshot(input, *snapshot);
    return;
  }
  const MapSnapshot snapshot = draw_snapshot(input);
  std::string yaml;
  try {
    yaml = map_to_yaml(snapshot);
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
