// SPDX-License-Identifier: BSD-3-Clause
// Any text as the file of reflectors, and any reflectors as a file.
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "input.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"
#include "situation_awareness/pose/reflector_map.hpp"
#include "situation_awareness/pose/reflector_search.hpp"

namespace situation_awareness::fuzz {
namespace {

/// More are not searched, which takes their square.
constexpr std::size_t kMostSearched = 12;

std::optional<ReflectorMap> read(const std::string& yaml) {
  try {
    return read_reflector_map(yaml, "fuzz.yaml");
  } catch (const std::invalid_argument& error) {
    const std::string sentence = error.what();
    require(sentence.rfind("fuzz.yaml: ", 0) == 0 && sentence.size() > 11, "a refusal names the file and the reason");
    return std::nullopt;
  }
}

/// A map that was accepted can be written, is read back exactly, and can be used.
void check_map(Input& input, const ReflectorMap& map) {
  require(!map.reflectors.empty(), "a map has a reflector");
  const std::string yaml = yaml_text(map);
  const std::optional<ReflectorMap> again = read(yaml);
  require(again.has_value(), "what is written is read");
  require(again->reflectors.size() == map.reflectors.size(), "as many are read as were written");
  for (std::size_t i = 0; i < map.reflectors.size(); ++i) {
    const Reflector &a = map.reflectors[i], &b = again->reflectors[i];
    require(a.center_world_m.allFinite() && a.radius_m > 0.0, "a reflector is finite, with a radius above 0");
    require(a.center_world_m == b.center_world_m && a.radius_m == b.radius_m, "what is read is what was written");
  }
  if (map.reflectors.size() > kMostSearched) return;

  // Seen from a pose in the open, all of them.
  const Pose2 T_world_frame = input.pose2();
  std::vector<ReflectorPlace> places;
  for (const Reflector& reflector : map.reflectors) {
    places.push_back({place_of(T_world_frame, reflector.center_world_m), 1e-4 * Eigen::Matrix2d::Identity()});
  }
  ReflectorSearch search(map);
  const ReflectorPose& found = search.find(places);
  require(found.is_known == (*found.reason == '\0'), "a pose is known, or there is a reason");
  if (found.is_known) {
    require(found.T_world_frame.translation_m.allFinite() && found.P.allFinite(), "a pose is finite");
  }
  ReflectorLocalization localization(map, {});
  localization.add_odometry(1'000'000'000, {});
  ReflectorSightings sightings;
  sightings.stamp_ns = 1'000'000'000;
  sightings.resolution_rad = 0.01;
  require(!localization.update(sightings, {}).is_known, "nothing is known by no sighting");
}

void run(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  if (input.flag()) {
    const double x = input.coordinate(10.0, 1e7), y = input.coordinate(10.0, 1e7);
    ReflectorMap map;
    for (std::size_t i = input.count(6); i > 0; --i) {
      const bool is_any = input.integer(0, 15) == 0;
      map.reflectors.push_back({{is_any ? input.any<double>() : x + input.uniform(-5.0, 5.0),
                                 is_any ? input.any<double>() : y + input.uniform(-5.0, 5.0)},
                                is_any ? input.any<double>() : input.by_magnitude(1e-4, 2.0)});
    }
    try {
      check_reflectors(map, "drawn");
    } catch (const std::invalid_argument& error) {
      require(std::string(error.what()).rfind("drawn: ", 0) == 0, "a refusal names the source");
      return;
    }
    check_map(input, map);
    return;
  }
  const std::optional<ReflectorMap> map = read(input.rest());
  Input none(nullptr, 0);
  if (map) check_map(none, *map);
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run(data, size);
  return 0;
}
