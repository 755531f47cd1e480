// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/geojson.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "../geojson_members.hpp"
#include "situation_awareness/common/file.hpp"
#include "situation_awareness/map/polygons/map_snapshot.hpp"

namespace situation_awareness {
namespace {

using namespace geojson;

constexpr const char* kFormat = "situation_awareness polygons";
/// Of chains that come without: a plan drawn by hand.
constexpr double kDrawnSigma_m = 0.02;
constexpr double kDrawnP = 0.9975;

const char* name_of_state(ChainState state) {
  switch (state) {
    case ChainState::kWall:
      return "wall";
    case ChainState::kKnown:
      return "known";
    case ChainState::kNew:
      return "new";
    case ChainState::kDoubted:
      return "doubted";
  }
  return "";
}

/// Twice the area, positive if the vertices are counter-clockwise. Relative to the first: far from the origin it would
/// be lost in rounding.
double doubled_area_m2(const std::vector<ChainVertex>& vertices) {
  double area = 0.0;
  for (std::size_t i = 1; i + 1 < vertices.size(); ++i) {
    const Eigen::Vector2d a = vertices[i].p_world_m - vertices[0].p_world_m;
    const Eigen::Vector2d b = vertices[i + 1].p_world_m - vertices[0].p_world_m;
    area += a.x() * b.y() - a.y() * b.x();
  }
  return area;
}

/// The same ring in the other direction, from the same vertex.
void turn_back(std::vector<ChainVertex>& vertices) { std::reverse(vertices.begin() + 1, vertices.end()); }

GeoJson feature_of(const Chain& chain) {
  std::vector<ChainVertex> vertices = chain.vertices;
  // A ring of RFC 7946 has four positions at least, the first and the last being the same.
  const bool is_ring = chain.closed && vertices.size() >= 3;
  const bool is_inside = doubled_area_m2(vertices) > 0.0;
  if (is_ring && !is_inside) turn_back(vertices);
  GeoJson positions = GeoJson::array();
  GeoJson sigma_m = GeoJson::array();
  for (const ChainVertex& vertex : vertices) {
    positions.push_back({vertex.p_world_m.x(), vertex.p_world_m.y()});
    sigma_m.push_back(vertex.sigma_m);
  }
  if (is_ring) positions.push_back(GeoJson(positions.front()));
  GeoJson properties = {{"id", chain.id},
                        {"closed", chain.closed},
                        {"sigma_m", std::move(sigma_m)},
                        {"first_seen", seconds_of(chain.first_seen_ns)},
                        {"last_seen", seconds_of(chain.last_seen_ns)},
                        {"p", chain.p_exists},
                        {"state", name_of_state(chain.state)}};
  if (is_ring) properties["free_side"] = is_inside ? "inside" : "outside";
  GeoJson geometry = {{"type", is_ring ? "Polygon" : "LineString"},
                      {"coordinates", is_ring ? GeoJson::array({std::move(positions)}) : std::move(positions)}};
  return {{"type", "Feature"}, {"geometry", std::move(geometry)}, {"properties", std::move(properties)}};
}

void read_vertices(const GeoJson& positions, std::vector<ChainVertex>& vertices, const std::string& place) {
  read_positions(positions, place, [&](double x_m, double y_m) { vertices.push_back({{x_m, y_m}, kDrawnSigma_m}); });
}

Chain chain_of(const GeoJson& feature, std::int64_t stamp_ns, const std::string& place) {
  if (!feature.is_object() || feature.value("type", GeoJson()) != "Feature") refuse_geojson(place, "is no Feature");
  const GeoJson& geometry = member_of(feature, "geometry", place);
  if (!geometry.is_object()) refuse_geojson(place, "geometry is none");
  const GeoJson& coordinates = member_of(geometry, "coordinates", place);
  const GeoJson& type = member_of(geometry, "type", place);
  Chain chain;
  const bool is_ring = type == "Polygon";
  if (is_ring) {
    if (!coordinates.is_array() || coordinates.size() != 1) refuse_geojson(place, "a Polygon has not one ring");
    read_vertices(coordinates[0], chain.vertices, place);
    if (chain.vertices.size() < 4 || chain.vertices.front().p_world_m != chain.vertices.back().p_world_m) {
      refuse_geojson(place, "a ring has fewer than four positions, or does not end where it begins");
    }
    chain.vertices.pop_back();
  } else if (type == "LineString") {
    read_vertices(coordinates, chain.vertices, place);
    if (chain.vertices.size() < 2) refuse_geojson(place, "a LineString has fewer than two positions");
  } else {
    refuse_geojson(place, "geometry is neither a LineString nor a Polygon");
  }

  const GeoJson properties = properties_of(feature, place);
  chain.id = id_of(properties, place);
  chain.closed = is_ring;
  if (properties.contains("closed")) {
    if (!properties["closed"].is_boolean()) refuse_geojson(place, "closed is neither true nor false");
    chain.closed |= properties["closed"].get<bool>();
  }
  if (properties.contains("sigma_m")) {
    const GeoJson& sigma_m = properties["sigma_m"];
    if (!sigma_m.is_array() || sigma_m.size() != chain.vertices.size()) {
      refuse_geojson(place, "sigma_m has not one number for each vertex");
    }
    for (std::size_t i = 0; i < sigma_m.size(); ++i) {
      chain.vertices[i].sigma_m = number_within(sigma_m[i], 1e-6, kMaxVertexSigma_m, place, "sigma_m");
    }
  }
  if (is_ring) {
    const GeoJson free_side = properties.value("free_side", GeoJson("outside"));
    if (free_side != "outside" && free_side != "inside") {
      refuse_geojson(place, "free_side is neither outside nor inside");
    }
    // Seen from its free side, a chain goes from right to left.
    if ((free_side == "inside") != (doubled_area_m2(chain.vertices) > 0.0)) turn_back(chain.vertices);
  }
  read_sights(properties, stamp_ns, place, chain);
  chain.p_exists = properties.contains("p") ? number_within(properties["p"], 0.0, 1.0, place, "p") : kDrawnP;
  return chain;
}

Polygons read_geojson(const GeoJson& collection, const std::string& world_frame) {
  check_collection(collection, kFormat, world_frame);
  Polygons polygons;
  polygons.stamp_ns = collection_stamp(collection);
  if (collection.contains("height_m")) {
    polygons.height_world_m = number_within(collection["height_m"], polygon_bounds::kPosition_m.low,
                                            polygon_bounds::kPosition_m.high, "", "height_m");
  }
  for (const GeoJson& feature : features_of(collection)) {
    const std::string place = "features[" + std::to_string(polygons.chains.size()) + "]: ";
    polygons.chains.push_back(chain_of(feature, polygons.stamp_ns, place));
  }
  give_ids(polygons.chains);
  return polygons;
}

}  // namespace

std::string polygons_to_geojson(const Polygons& polygons, const std::string& world_frame) {
  GeoJson collection = new_collection(kFormat, world_frame, polygons.stamp_ns);
  collection["height_m"] = polygons.height_world_m;
  collection["features"] = GeoJson::array();
  for (const Chain& chain : polygons.chains) collection["features"].push_back(feature_of(chain));
  return collection.dump(1) + '\n';
}

Polygons polygons_from_geojson(const std::string& text, const std::string& source, const std::string& world_frame) {
  return parsed(text, source, [&](const GeoJson& collection) { return read_geojson(collection, world_frame); });
}

void save_geojson(const std::string& path, const Polygons& polygons, const std::string& world_frame) {
  const std::string text = polygons_to_geojson(polygons, world_frame);
  polygons_from_geojson(text, path, world_frame);  // what is written can be read
  replace_file(path, geojson_kind(kFormat), text);
}

Polygons load_geojson(const std::string& path, const std::string& world_frame) {
  return polygons_from_geojson(read_file(path, kMaxBytes), path, world_frame);
}

}  // namespace situation_awareness
