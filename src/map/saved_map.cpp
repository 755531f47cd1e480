// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/saved_map.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <utility>

#include "json_members.hpp"
#include "situation_awareness/common/file.hpp"
#include "situation_awareness/map/feature_json.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kFormat = "situation_awareness features";
constexpr int kVersion = 1;
constexpr std::size_t kMaxFeatures = 300'000;

/// Gives ids to those that have none, and orders all by them.
void give_ids(SavedMap& saved) {
  for (const Feature& feature : saved.map.features) saved.next_id = std::max(saved.next_id, feature.id + 1);
  std::map<FeatureId, Feature> by_id;
  for (Feature& feature : saved.map.features) {
    if (feature.id == 0) feature.id = saved.next_id++;
    const FeatureId id = feature.id;
    if (!by_id.emplace(id, std::move(feature)).second) {
      throw std::invalid_argument("id " + std::to_string(id) + " is there twice");
    }
  }
  saved.map.features.clear();
  for (auto& [id, feature] : by_id) saved.map.features.push_back(std::move(feature));
}

SavedMap saved_map_of(const Json& object, const std::string& world_frame) {
  const JsonMembers members(object, "");
  if (members.at("format") != kFormat) {
    members.refuse("format", "is not '" + std::string(kFormat) + "': no map");
  }
  const Json& version = members.at("version");
  if (version != kVersion) {
    members.refuse("version", "= " + version.dump() + " is unknown, known is " + std::to_string(kVersion));
  }
  SavedMap saved;
  const Json& frame = members.at("world_frame");
  if (!frame.is_string()) members.refuse("world_frame", "is no text");
  saved.world_frame = frame.get<std::string>();
  if (!world_frame.empty() && saved.world_frame != world_frame) {
    members.refuse("world_frame", "= " + saved.world_frame + " is not the wanted one, " + world_frame);
  }
  saved.map.stamp_ns = members.stamp_ns("stamp");
  if (saved.map.stamp_ns < 0) members.refuse("stamp", "is out of bounds");
  saved.map.height_world_m = members.number("height", {-1e6, 1e6});
  saved.next_id = static_cast<FeatureId>(members.number("next_id", {1.0, 9.0e15}));
  const Json& features = members.at("features");
  if (!features.is_array() || features.size() > kMaxFeatures) {
    members.refuse("features", "are no list, or too many");
  }
  for (std::size_t i = 0; i < features.size(); ++i) {
    const std::string place = "features[" + std::to_string(i) + "]: ";
    saved.map.features.push_back(feature_from_json(features[i], saved.map.stamp_ns, place));
    // A microsecond is lost by writing seconds.
    if (saved.map.features.back().last_seen_ns > saved.map.stamp_ns + 1000) {
      throw std::invalid_argument(place + "last_seen is after the map's stamp");
    }
  }
  give_ids(saved);
  return saved;
}

}  // namespace

std::string map_to_json(const SavedMap& saved) {
  Json head;
  head["format"] = kFormat;
  head["version"] = kVersion;
  head["world_frame"] = saved.world_frame;
  head["stamp"] = 1e-9 * static_cast<double>(saved.map.stamp_ns);
  head["height"] = finite(saved.map.height_world_m);
  head["next_id"] = saved.next_id;
  std::string text = head.dump();
  text.pop_back();
  text += ",\"features\":[";
  const char* separator = "\n";
  for (const Feature& feature : saved.map.features) {
    Json list = Json::array();
    add_feature(list, feature);
    text += separator + list[0].dump();
    separator = ",\n";
  }
  return text += "\n]}\n";
}

SavedMap map_from_json(const std::string& text, const std::string& source, const std::string& world_frame) {
  try {
    check_json_size(text);
    return saved_map_of(Json::parse(text), world_frame);
  } catch (const nlohmann::json::exception& error) {
    throw std::invalid_argument(source + ": not valid JSON: " + error.what());
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(source + ": " + error.what());
  }
}

void save_features(const std::string& path, const SavedMap& saved) {
  replace_file(path, kind_with_mark("a map of features", kFormat), map_to_json(saved));
}

SavedMap load_features(const std::string& path, const std::string& world_frame) {
  return map_from_json(read_file(path, kMaxJsonBytes), path, world_frame);
}

}  // namespace situation_awareness
