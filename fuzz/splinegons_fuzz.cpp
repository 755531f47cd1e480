// SPDX-License-Identifier: BSD-3-Clause
// Any text as boundaries in GeoJSON, any elements as those of a boundary, and any poses as ends of a Dubins path.
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "input.hpp"
#include "situation_awareness/map/splinegons/geojson.hpp"
#include "situation_awareness/map/splinegons/splinegon_map.hpp"
#include "situation_awareness/path/dubins.hpp"
#include "situation_awareness/path/obstacles.hpp"

namespace situation_awareness::fuzz {
namespace {

void check_boundary(const Splinegon& boundary) {
  require(boundary.vertices.size() >= (boundary.closed ? 4U : 3U), "a boundary has vertices");
  require((boundary.vertices.size() % 2 == 0) == boundary.closed, "main vertices and joints alternate");
  for (const SplinegonVertex& vertex : boundary.vertices) {
    require(vertex.p_world_m.allFinite() && std::isfinite(vertex.bulge), "vertices are finite");
    require(std::isfinite(vertex.sigma_m) && vertex.sigma_m >= 0.0, "so is their uncertainty");
  }
  require(boundary.closed || boundary.vertices.back().bulge == 0.0, "an open one ends");
  Obstacles obstacles;
  Feature feature;
  feature.shape = ArcShape{boundary.vertices, boundary.closed};
  obstacles.add(feature);
  const double away_m = distance_m(obstacles, boundary.vertices[0].p_world_m);
  require(!(away_m > 1e-6 * (1.0 + boundary.vertices[0].p_world_m.norm())), "a vertex is on its boundary");
}

std::optional<Splinegons> read(const std::string& text) {
  try {
    return splinegons_from_geojson(text, "fuzz", "world");
  } catch (const std::invalid_argument& error) {
    const std::string sentence = error.what();
    require(sentence.rfind("fuzz: ", 0) == 0 && sentence.size() > 6, "a refusal names the file and the reason");
    return std::nullopt;
  }
}

void check_geojson(const std::string& text) {
  const std::optional<Splinegons> splinegons = read(text);
  if (!splinegons) return;
  for (const Splinegon& boundary : splinegons->boundaries) check_boundary(boundary);
  const std::string written = splinegons_to_geojson(*splinegons, "world");
  const std::optional<Splinegons> again = read(written);
  require(again.has_value(), "boundaries that are written are read");
  require(again->boundaries.size() == splinegons->boundaries.size(), "all of them");
  for (std::size_t i = 0; i < again->boundaries.size(); ++i) {
    const Splinegon &a = splinegons->boundaries[i], &b = again->boundaries[i];
    require(a.id == b.id && a.closed == b.closed && a.vertices.size() == b.vertices.size(), "with what they are");
    for (std::size_t k = 0; k < a.vertices.size(); ++k) {
      require(a.vertices[k].p_world_m == b.vertices[k].p_world_m && a.vertices[k].bulge == b.vertices[k].bulge,
              "exactly");
    }
  }
}

/// A walk that turns, with jumps, and elements that are off it.
std::vector<SplinegonElement> draw_elements(Input& input) {
  std::vector<SplinegonElement> elements;
  Eigen::Vector2d p_m(input.coordinate(30.0, 1e5), input.coordinate(30.0, 1e5));
  double yaw_rad = input.uniform(-kPi, kPi), turn_rad = input.uniform(-0.2, 0.2);
  for (int count = input.integer(0, 150); count > 0 && input.left(); --count) {
    double step_m = 0.15;
    switch (input.integer(0, 15)) {
      case 0:
        yaw_rad += input.uniform(-kPi, kPi);
        break;
      case 1:
        step_m = input.by_magnitude(1e-9, 10.0);
        break;
      case 2:
        turn_rad = input.uniform(-0.5, 0.5);
        break;
      case 3:
        step_m = 0.0;
        break;
      default:
        break;
    }
    yaw_rad += turn_rad;
    p_m += step_m * Eigen::Vector2d(std::cos(yaw_rad), std::sin(yaw_rad));
    elements.push_back({p_m, {std::sin(yaw_rad), -std::cos(yaw_rad)}, 1e-3});
    if (input.integer(0, 15) == 0) elements.back().variance_m2 = input.by_magnitude(1e-10, 1e6);
    if (input.integer(0, 31) == 0) elements.back().normal_world *= -1.0;
  }
  return elements;
}

void check_boundaries(Input& input) {
  SplinegonMap map(draw_params<SplinegonMapParams>(input), draw_params<SplinegonFitParams>(input));
  ObstacleBoundary boundary;
  boundary.id = 1;
  std::int64_t stamp_ns = 0;
  for (int scan = input.integer(1, 4); scan > 0; --scan) {
    stamp_ns += 40'000'000;
    boundary.last_seen_ns = stamp_ns;
    boundary.closed = input.flag();
    boundary.elements = draw_elements(input);
    for (const Splinegon& splinegon : map.update(stamp_ns, {boundary}).boundaries) {
      check_boundary(splinegon);
      require(is_simple(splinegon), "a boundary does not cross itself");
      require(!splinegon.closed || area_m2(splinegon) > 0.0, "a closed one runs counter-clockwise");
    }
  }
}

DubinsEnd draw_end(Input& input, bool wild) {
  const auto number = [&](double usual, double most) {
    return wild && input.integer(0, 3) == 0 ? input.any<double>() : input.coordinate(usual, most);
  };
  DubinsEnd end;
  end.p_m.x() = number(30.0, 1e6);
  end.p_m.y() = number(30.0, 1e6);
  if (input.integer(0, 3) != 0) end.yaw_rad = number(kPi, 1e3);
  end.radius_m = wild && input.flag() ? input.any<double>() : input.by_magnitude(1e-3, 1e3);
  return end;
}

void check_dubins(Input& input) {
  const bool wild = input.flag();
  const DubinsEnd from = draw_end(input, wild), to = draw_end(input, wild);
  DubinsPath path;
  try {
    path = shortest_dubins_path(from, to);
  } catch (const std::invalid_argument& error) {
    const std::string sentence = error.what();
    require(wild, "a pose that is in bounds has a path");
    require(sentence.rfind("from", 0) == 0 || sentence.rfind("to", 0) == 0, "a refusal names the end");
    return;
  }
  const double size_m = from.p_m.norm() + to.p_m.norm() + from.radius_m + to.radius_m + 1.0;
  const double near_m = 1e-9 * size_m;
  require(std::isfinite(path.length_m), "a path has a length");
  require(path.length_m >= (to.p_m - from.p_m).norm() - near_m, "no shorter than the straight line");
  require((place_at(path, 0.0).pose.translation_m - from.p_m).norm() <= near_m, "it begins where it should");
  require((place_at(path, path.length_m).pose.translation_m - to.p_m).norm() <= near_m, "and ends");
}

void run(Input input) {
  switch (input.integer(0, 2)) {
    case 0:
      return check_geojson(input.rest());
    case 1:
      return check_boundaries(input);
    default:
      return check_dubins(input);
  }
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}
