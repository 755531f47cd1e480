// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// What the GeoJSON of all kinds of map has in common.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "situation_awareness/common/file.hpp"

namespace situation_awareness {

using GeoJson = nlohmann::ordered_json;

namespace geojson {

constexpr std::size_t kMaxBytes = std::size_t{256} << 20;
/// Of what nlohmann_json reads: it takes up to 50 bytes for each.
constexpr std::size_t kMaxValues = 10'000'000, kMaxDepth = 32;
constexpr std::size_t kMaxFeatures = 300'000;
constexpr std::size_t kMaxVertices = 400'000;  ///< of one feature
constexpr double kMaxPosition_m = 1e6;
constexpr double kMaxVertexSigma_m = 1e3;
constexpr std::uint64_t kMaxId = std::uint64_t{1} << 53;
constexpr double kLatest_s = 4'294'967'295.0;  ///< the end of ROS time
constexpr double kEarliest_s = -2'000'000'000.0;

inline double seconds_of(std::int64_t stamp_ns) { return 1e-9 * static_cast<double>(stamp_ns); }

[[noreturn]] inline void refuse_geojson(const std::string& place, const std::string& defect) {
  throw std::invalid_argument(place + defect);
}

inline const GeoJson& member_of(const GeoJson& object, const char* name, std::string_view place) {
  const auto found = object.find(name);
  if (found == object.end()) refuse_geojson(std::string(place), std::string(name) + " is missing");
  return *found;
}

inline double number_within(const GeoJson& value, double low, double high, const std::string& place, const char* name) {
  if (!value.is_number()) refuse_geojson(place, std::string(name) + " is no number");
  const auto number = value.get<double>();
  if (!(number >= low && number <= high)) refuse_geojson(place, std::string(name) + " is out of bounds");
  return number;
}

inline std::int64_t stamp_of(const GeoJson& object, const char* name, std::int64_t otherwise_ns,
                             const std::string& place) {
  const auto found = object.find(name);
  if (found == object.end()) return otherwise_ns;
  return std::llround(1e9 * number_within(*found, kEarliest_s, kLatest_s, place, name));
}

/// Gives ids to those that have none.
template <class Things>
void give_ids(Things& things) {
  std::set<std::uint64_t> ids;
  for (const auto& thing : things) {
    if (thing.id != 0 && !ids.insert(thing.id).second) {
      throw std::invalid_argument("id " + std::to_string(thing.id) + " is there twice");
    }
  }
  std::uint64_t next_id = ids.empty() ? 1 : *ids.rbegin() + 1;
  for (auto& thing : things) {
    if (thing.id == 0) thing.id = next_id++;
  }
}

/// The id of a feature, 0 if it has none.
inline std::uint64_t id_of(const GeoJson& properties, const std::string& place) {
  const auto found = properties.find("id");
  if (found == properties.end()) return 0;
  if (!found->is_number_unsigned() || found->get<std::uint64_t>() == 0 || found->get<std::uint64_t>() >= kMaxId) {
    refuse_geojson(place, "id is no whole number from 1 on");
  }
  return found->get<std::uint64_t>();
}

/// Throws std::invalid_argument if a text has too many values, or too deeply within each other, before memory is taken
/// for them.
inline void check_json_size(std::string_view text) {
  if (text.size() > kMaxBytes) throw std::invalid_argument("has more than " + std::to_string(kMaxBytes) + " bytes");
  std::size_t values = 0, depth = 0;
  bool is_text = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') is_text = !is_text;
    if (is_text) {
      if (c == '\\') ++i;
      continue;
    }
    const bool opens = c == '[' || c == '{';
    if (opens) ++depth;
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if (opens || c == ',') ++values;
    if (depth > kMaxDepth) throw std::invalid_argument("is nested too deeply");
    if (values > kMaxValues) throw std::invalid_argument("has more than " + std::to_string(kMaxValues) + " values");
  }
}

/// What a collection of the format begins with.
inline GeoJson new_collection(const char* format, const std::string& world_frame, std::int64_t stamp_ns) {
  return {
      {"type", "FeatureCollection"}, {"format", format}, {"world_frame", world_frame}, {"stamp", seconds_of(stamp_ns)}};
}

/// Files with a collection of the format, or of none of this package, such as plans drawn by hand.
inline FileKind geojson_kind(const std::string& format) {
  return {"GeoJSON of '" + format + "'", [format](std::string_view head) {
            const auto has = [head](const std::string& text) { return head.find(text) != std::string_view::npos; };
            return has("\"FeatureCollection\"") && (has(format) || !has("\"situation_awareness "));
          }};
}

/// Checks what a collection is, and its frame.
inline void check_collection(const GeoJson& collection, const char* format, const std::string& world_frame) {
  if (!collection.is_object() || collection.value("type", GeoJson()) != "FeatureCollection") {
    throw std::invalid_argument("is no FeatureCollection");
  }
  const GeoJson of_format = collection.value("format", GeoJson(format));
  if (of_format != format) {
    throw std::invalid_argument("format = " + of_format.dump() + " is not '" + std::string(format) + "'");
  }
  const GeoJson frame = collection.value("world_frame", GeoJson(world_frame));
  if (!frame.is_string()) throw std::invalid_argument("world_frame is no text");
  if (frame != world_frame) {
    throw std::invalid_argument("world_frame = " + frame.get<std::string>() + " is not the wanted one, " + world_frame);
  }
}

/// The collection's stamp, 0 if it has none.
inline std::int64_t collection_stamp(const GeoJson& collection) {
  const std::int64_t stamp_ns = stamp_of(collection, "stamp", 0, "");
  if (stamp_ns < 0) throw std::invalid_argument("stamp is out of bounds");
  return stamp_ns;
}

inline const GeoJson& features_of(const GeoJson& collection) {
  const GeoJson& features = member_of(collection, "features", "");
  if (!features.is_array() || features.size() > kMaxFeatures) {
    throw std::invalid_argument("features are no list, or too many");
  }
  return features;
}

/// Properties of a feature, none if there are none.
inline GeoJson properties_of(const GeoJson& feature, const std::string& place) {
  const auto found = feature.find("properties");
  GeoJson properties = found == feature.end() || found->is_null() ? GeoJson::object() : *found;
  if (!properties.is_object()) refuse_geojson(place, "properties are none");
  return properties;
}

/// Calls `add` with each coordinate pair, x and y in m.
template <class Add>
void read_positions(const GeoJson& positions, const std::string& place, const Add& add) {
  if (!positions.is_array() || positions.size() > kMaxVertices) {
    refuse_geojson(place, "coordinates are no list, or too long");
  }
  for (const GeoJson& position : positions) {
    if (!position.is_array() || position.size() < 2) refuse_geojson(place, "a position has not two coordinates");
    add(number_within(position[0], -kMaxPosition_m, kMaxPosition_m, place, "a coordinate"),
        number_within(position[1], -kMaxPosition_m, kMaxPosition_m, place, "a coordinate"));
  }
}

/// Reads first and last sight of what is on the map since.
template <class Thing>
void read_sights(const GeoJson& properties, std::int64_t stamp_ns, const std::string& place, Thing& thing) {
  thing.first_seen_ns = stamp_of(properties, "first_seen", stamp_ns, place);
  thing.last_seen_ns = stamp_of(properties, "last_seen", stamp_ns, place);
  if (thing.first_seen_ns > thing.last_seen_ns) refuse_geojson(place, "first_seen is after last_seen");
  if (thing.last_seen_ns > stamp_ns) refuse_geojson(place, "last_seen is after the collection's stamp");
}

/// Calls `read` with the parsed text; its exceptions name the source.
template <class Read>
auto parsed(const std::string& text, const std::string& source, const Read& read) {
  try {
    check_json_size(text);
    return read(GeoJson::parse(text));
  } catch (const nlohmann::json::exception& error) {
    throw std::invalid_argument(source + ": not valid GeoJSON: " + error.what());
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(source + ": " + error.what());
  }
}

}  // namespace geojson
}  // namespace situation_awareness
