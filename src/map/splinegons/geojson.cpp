// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/geojson.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "../geojson_members.hpp"
#include "situation_awareness/common/file.hpp"

namespace situation_awareness {
namespace {

using namespace geojson;

constexpr const char* kFormat = "situation_awareness splinegons";
/// Of boundaries that come without: a plan drawn by hand.
constexpr double kDrawnSigma_m = 0.02;
/// An arc is less than a circle.
constexpr double kMaxBulge = 1e3;

GeoJson feature_of(const Splinegon& splinegon) {
  GeoJson positions = GeoJson::array(), bulge = GeoJson::array(), sigma_m = GeoJson::array(), corner = GeoJson::array();
  for (const SplinegonVertex& vertex : splinegon.vertices) {
    positions.push_back({vertex.p_world_m.x(), vertex.p_world_m.y()});
    bulge.push_back(vertex.bulge);
    sigma_m.push_back(vertex.sigma_m);
    corner.push_back(vertex.corner);
  }
  if (splinegon.closed) positions.push_back(GeoJson(positions.front()));
  GeoJson geometry = {
      {"type", splinegon.closed ? "Polygon" : "LineString"},
      {"coordinates", splinegon.closed ? GeoJson::array({std::move(positions)}) : std::move(positions)}};
  GeoJson properties = {{"id", splinegon.id},
                        {"bulge", std::move(bulge)},
                        {"sigma_m", std::move(sigma_m)},
                        {"corner", std::move(corner)},
                        {"first_seen", seconds_of(splinegon.first_seen_ns)},
                        {"last_seen", seconds_of(splinegon.last_seen_ns)}};
  return {{"type", "Feature"}, {"geometry", std::move(geometry)}, {"properties", std::move(properties)}};
}

/// The property with one value for each vertex; null if it is missing.
GeoJson values_of(const GeoJson& properties, const char* name, std::size_t count, const std::string& place) {
  const auto found = properties.find(name);
  if (found == properties.end()) return GeoJson();
  if (!found->is_array() || found->size() != count) {
    refuse_geojson(place, std::string(name) + " has not one value for each vertex");
  }
  return *found;
}

/// Of a polygon: a joint in the middle of each edge.
void add_joints(Splinegon& splinegon) {
  std::vector<SplinegonVertex> vertices;
  for (std::size_t k = 0; k < splinegon.vertices.size(); ++k) {
    const bool last = k + 1 == splinegon.vertices.size();
    vertices.push_back(splinegon.vertices[k]);
    vertices.back().corner = splinegon.closed || (k > 0 && !last);
    if (last && !splinegon.closed) break;
    const SplinegonVertex& next = splinegon.vertices[last ? 0 : k + 1];
    SplinegonVertex joint;
    joint.p_world_m = 0.5 * (vertices.back().p_world_m + next.p_world_m);
    joint.sigma_m = 0.5 * (vertices.back().sigma_m + next.sigma_m);
    vertices.push_back(joint);
  }
  splinegon.vertices = std::move(vertices);
}

Splinegon splinegon_of(const GeoJson& feature, std::int64_t stamp_ns, const std::string& place) {
  if (!feature.is_object() || feature.value("type", GeoJson()) != "Feature") refuse_geojson(place, "is no Feature");
  const GeoJson& geometry = member_of(feature, "geometry", place);
  if (!geometry.is_object()) refuse_geojson(place, "geometry is none");
  const GeoJson& coordinates = member_of(geometry, "coordinates", place);
  const GeoJson& type = member_of(geometry, "type", place);
  Splinegon splinegon;
  splinegon.closed = type == "Polygon";
  if (!splinegon.closed && type != "LineString")
    refuse_geojson(place, "geometry is neither a LineString nor a Polygon");
  if (splinegon.closed && (!coordinates.is_array() || coordinates.size() != 1)) {
    refuse_geojson(place, "a Polygon has not one ring");
  }
  std::vector<SplinegonVertex>& vertices = splinegon.vertices;
  read_positions(splinegon.closed ? coordinates[0] : coordinates, place, [&](double x_m, double y_m) {
    vertices.push_back({{x_m, y_m}, 0.0, kDrawnSigma_m, false});
  });
  if (splinegon.closed) {
    if (vertices.size() < 4 || vertices.front().p_world_m != vertices.back().p_world_m) {
      refuse_geojson(place, "a ring has fewer than four positions, or does not end where it begins");
    }
    vertices.pop_back();
  } else if (vertices.size() < 2) {
    refuse_geojson(place, "a LineString has fewer than two positions");
  }
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    if (vertices[k].p_world_m == vertices[k + 1 < vertices.size() ? k + 1 : 0].p_world_m) {
      refuse_geojson(place, "neighbouring vertices are the same");
    }
  }

  const GeoJson properties = properties_of(feature, place);
  splinegon.id = id_of(properties, place);
  const GeoJson bulge = values_of(properties, "bulge", vertices.size(), place);
  const GeoJson sigma_m = values_of(properties, "sigma_m", vertices.size(), place);
  const GeoJson corner = values_of(properties, "corner", vertices.size(), place);
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    if (!bulge.is_null()) vertices[k].bulge = number_within(bulge[k], -kMaxBulge, kMaxBulge, place, "bulge");
    if (!sigma_m.is_null()) vertices[k].sigma_m = number_within(sigma_m[k], 0.0, kMaxVertexSigma_m, place, "sigma_m");
    if (corner.is_null()) continue;
    if (!corner[k].is_boolean()) refuse_geojson(place, "corner is neither true nor false");
    vertices[k].corner = corner[k].get<bool>();
  }
  if (bulge.is_null()) {
    add_joints(splinegon);
  } else if ((vertices.size() % 2 == 0) != splinegon.closed) {
    refuse_geojson(place, "main vertices and joints do not alternate");
  }
  if (splinegon.closed && area_m2(splinegon) <= 0.0) refuse_geojson(place, "a ring is not counter-clockwise");
  read_sights(properties, stamp_ns, place, splinegon);
  return splinegon;
}

}  // namespace

std::string splinegons_to_geojson(const Splinegons& splinegons, const std::string& world_frame) {
  GeoJson collection = new_collection(kFormat, world_frame, splinegons.stamp_ns);
  collection["features"] = GeoJson::array();
  for (const Splinegon& splinegon : splinegons.boundaries) collection["features"].push_back(feature_of(splinegon));
  return collection.dump(1) + '\n';
}

Splinegons splinegons_from_geojson(const std::string& text, const std::string& source, const std::string& world_frame) {
  return parsed(text, source, [&](const GeoJson& collection) {
    check_collection(collection, kFormat, world_frame);
    Splinegons splinegons;
    splinegons.stamp_ns = collection_stamp(collection);
    for (const GeoJson& feature : features_of(collection)) {
      const std::string place = "features[" + std::to_string(splinegons.boundaries.size()) + "]: ";
      splinegons.boundaries.push_back(splinegon_of(feature, splinegons.stamp_ns, place));
    }
    give_ids(splinegons.boundaries);
    return splinegons;
  });
}

void save_geojson(const std::string& path, const Splinegons& splinegons, const std::string& world_frame) {
  const std::string text = splinegons_to_geojson(splinegons, world_frame);
  splinegons_from_geojson(text, path, world_frame);  // what is written can be read
  replace_file(path, geojson_kind(kFormat), text);
}

Splinegons load_splinegons_geojson(const std::string& path, const std::string& world_frame) {
  return splinegons_from_geojson(read_file(path, kMaxBytes), path, world_frame);
}

}  // namespace situation_awareness
