// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/local_maps.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>
#include <variant>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/file.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/yaml_defect.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

constexpr double kReachStep_m = 0.1;   // between the places of a segment whose distance counts
constexpr double kArcSpacing_m = 0.1;  // of the lines that a boundary is cut into
// Less certain outlines are doubted, and what is larger is a wall, as the states of the map of polygons have it.
constexpr double kDoubted_p = 0.75, kWallExtent_m = 1.6;
constexpr double kMostPlace_m = 1e6;
constexpr double kMostSigma_m = 100.0;
constexpr std::size_t kMostVertices = 1'000'000;  // of all maps, which YAML may repeat by aliases
constexpr std::array<std::pair<ChainState, const char*>, 4> kStates = {{{ChainState::kWall, "wall"},
                                                                        {ChainState::kKnown, "known"},
                                                                        {ChainState::kNew, "new"},
                                                                        {ChainState::kDoubted, "doubted"}}};

[[noreturn]] void refuse_local_maps(const std::string& source, const std::string& reason) {
  throw std::invalid_argument(source + ": " + reason);
}

std::string chain_place(std::size_t map, std::size_t chain) {
  return "local_maps[" + std::to_string(map) + "].chains[" + std::to_string(chain) + ']';
}

double chain_distance_m(const Chain& chain, const Eigen::Vector2d& p_m) {
  double nearest_m = std::numeric_limits<double>::infinity();
  const std::size_t count = chain.vertices.size();
  for (std::size_t i = 0; i + 1 < count + (chain.closed ? 1 : 0); ++i) {
    nearest_m = std::min(nearest_m, distance_from_segment_m(p_m, chain.vertices[i].p_world_m,
                                                            chain.vertices[(i + 1) % count].p_world_m));
  }
  return nearest_m;
}

Chain chain_by(Chain chain, const Pose2& T) {
  for (ChainVertex& vertex : chain.vertices) vertex.p_world_m = T * vertex.p_world_m;
  return chain;
}

/// The lines of what stands; without vertices of what has none.
Chain chain_of_feature(const Feature& feature) {
  Chain chain;
  if (const auto* const lines = std::get_if<PolylineShape>(&feature.shape)) {
    chain.closed = lines->closed;
    chain.vertices = lines->vertices;
  } else if (const auto* const arcs = std::get_if<ArcShape>(&feature.shape)) {
    chain.closed = arcs->closed;
    chain.vertices = lines_along(splinegon_of(*arcs), kArcSpacing_m);
  }
  chain.id = feature.id;
  chain.first_seen_ns = feature.first_seen_ns;
  chain.last_seen_ns = feature.last_seen_ns;
  chain.p_exists = feature.p_exists;
  const bool is_large = box_around(feature.shape).diagonal().norm() > kWallExtent_m;
  chain.state = feature.p_exists < kDoubted_p      ? ChainState::kDoubted
                : feature.motion != Motion::kFixed ? ChainState::kNew
                : is_large                         ? ChainState::kWall
                                                   : ChainState::kKnown;
  return chain;
}

/// The keys of a map are these, each once.
void check_local_map_keys(const YAML::Node& node, const std::set<std::string>& keys, const std::string& place,
                          const std::string& source) {
  if (!node.IsMap()) refuse_local_maps(source, place + " must be a map");
  std::set<std::string> given;
  for (const auto& item : node) {
    const std::string key = item.first.IsScalar() ? item.first.Scalar() : "";
    if (keys.count(key) == 0) refuse_local_maps(source, place + " has the unknown key " + yaml_text(key));
    if (!given.insert(key).second) refuse_local_maps(source, place + '.' + key + " is given twice");
  }
  for (const std::string& key : keys) {
    if (given.count(key) == 0) refuse_local_maps(source, place + '.' + key + " is missing");
  }
}

template <class Value>
Value local_map_value(const YAML::Node& node, const char* key, const std::string& place, const std::string& source) {
  Value value{};
  if (!node[key].IsScalar() || !YAML::convert<Value>::decode(node[key], value)) {
    refuse_local_maps(source, place + '.' + key + " is not of its type");
  }
  return value;
}

Chain read_local_chain(const YAML::Node& node, const std::string& place, const std::string& source,
                       std::size_t& vertices_read) {
  check_local_map_keys(node, {"id", "closed", "state", "p_exists", "first_seen_ns", "last_seen_ns", "vertices"}, place,
                       source);
  Chain chain;
  chain.id = local_map_value<std::uint64_t>(node, "id", place, source);
  chain.closed = local_map_value<bool>(node, "closed", place, source);
  chain.p_exists = local_map_value<double>(node, "p_exists", place, source);
  chain.first_seen_ns = local_map_value<std::int64_t>(node, "first_seen_ns", place, source);
  chain.last_seen_ns = local_map_value<std::int64_t>(node, "last_seen_ns", place, source);
  const auto name = local_map_value<std::string>(node, "state", place, source);
  const auto* const state =
      std::find_if(kStates.begin(), kStates.end(), [&](const auto& known) { return known.second == name; });
  if (state == kStates.end()) refuse_local_maps(source, place + ".state must be wall, known, new or doubted");
  chain.state = state->first;
  const YAML::Node vertices = node["vertices"];
  if (!vertices.IsSequence()) refuse_local_maps(source, place + ".vertices must be a list");
  vertices_read += vertices.size();
  if (vertices_read > kMostVertices) refuse_local_maps(source, place + ".vertices are too many");
  for (const YAML::Node& vertex : vertices) {
    std::array<double, 3> numbers{};
    bool is_good = vertex.IsSequence() && vertex.size() == numbers.size();
    for (std::size_t i = 0; i < numbers.size() && is_good; ++i) {
      is_good = vertex[i].IsScalar() && YAML::convert<double>::decode(vertex[i], numbers[i]);
    }
    if (!is_good) refuse_local_maps(source, place + ".vertices must be a list of [x, y, sigma_m]");
    chain.vertices.push_back({{numbers[0], numbers[1]}, numbers[2]});
  }
  return chain;
}

}  // namespace

std::vector<LocalMap> local_maps(const SplinePath& path, const Map& map, double reach_m) {
  std::vector<Chain> chains;
  for (const Feature& feature : map.features) {
    chains.push_back(chain_of_feature(feature));
    if (chains.back().vertices.empty()) chains.pop_back();
  }
  std::vector<LocalMap> maps;
  for (std::size_t i = 0; i < path.segments(); ++i) {
    const double begin_m = path.begin_m(i);
    const double end_m = i + 1 < path.segments() ? path.begin_m(i + 1) : path.length_m();
    const auto steps = std::max(1, static_cast<int>(std::ceil((end_m - begin_m) / kReachStep_m)));
    LocalMap local{i, {}};
    for (const Chain& chain : chains) {
      bool is_near = false;
      for (int k = 0; k <= steps && !is_near; ++k) {
        const double way_m = begin_m + (end_m - begin_m) * k / steps;
        is_near = chain_distance_m(chain, path.at(way_m).p_world_m) <= reach_m;
      }
      if (is_near) local.chains.push_back(chain_by(chain, inverse(path.at(begin_m).pose())));
    }
    maps.push_back(std::move(local));
  }
  return maps;
}

Map map_of(const std::vector<LocalMap>& maps, const SplinePath& path) {
  std::map<FeatureId, Chain> chains;
  for (const LocalMap& local : maps) {
    const Pose2 T_world_segment = path.at(path.begin_m(local.segment)).pose();
    for (const Chain& chain : local.chains) {
      if (chains.count(chain.id) == 0) chains.emplace(chain.id, chain_by(chain, T_world_segment));
    }
  }
  Map map;
  for (auto& [id, chain] : chains) {
    Feature& feature = map.features.emplace_back();
    feature.id = id;
    feature.p_exists = chain.p_exists;
    const bool is_fixed = chain.state == ChainState::kWall || chain.state == ChainState::kKnown;
    feature.motion = is_fixed ? Motion::kFixed : Motion::kStanding;
    feature.first_seen_ns = chain.first_seen_ns;
    feature.last_seen_ns = chain.last_seen_ns;
    feature.seen_by.file = true;
    feature.shape = PolylineShape{std::move(chain.vertices), chain.closed};
  }
  return map;
}

void check_local_maps(const std::vector<LocalMap>& maps, std::size_t segments, const std::string& source) {
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const LocalMap& map = maps[i];
    if (map.segment >= segments || (i > 0 && map.segment <= maps[i - 1].segment)) {
      refuse_local_maps(source, "local_maps[" + std::to_string(i) + "].segment = " + std::to_string(map.segment) +
                                    " must increase and be less than " + std::to_string(segments) +
                                    ", the segments of the path");
    }
    std::set<std::uint64_t> ids;
    for (std::size_t k = 0; k < map.chains.size(); ++k) {
      const Chain& chain = map.chains[k];
      const auto require = [&](bool truth, const char* bound) {
        if (!truth) refuse_local_maps(source, chain_place(i, k) + bound);
      };
      require(chain.id > 0 && ids.insert(chain.id).second, ".id must be > 0, and there once");
      require(chain.vertices.size() >= 2, ".vertices must be at least 2");
      require(chain.p_exists >= 0.0 && chain.p_exists <= 1.0, ".p_exists is outside [0, 1]");
      require(chain.first_seen_ns >= 0 && chain.last_seen_ns >= 0, ".first_seen_ns and last_seen_ns must be >= 0");
      for (const ChainVertex& vertex : chain.vertices) {
        require((vertex.p_world_m.array().abs() <= kMostPlace_m).all(), ".vertices has a place outside [-1e6, 1e6] m");
        require(vertex.sigma_m > 0.0 && vertex.sigma_m <= kMostSigma_m, ".vertices has a sigma_m outside (0, 100] m");
      }
    }
  }
}

std::string yaml_text(const std::vector<LocalMap>& maps) {
  std::string text = maps.empty() ? "local_maps: []\n" : "local_maps:\n";
  for (const LocalMap& map : maps) {
    text += "  - segment: " + std::to_string(map.segment) + "\n    chains:" + (map.chains.empty() ? " []\n" : "\n");
    for (const Chain& chain : map.chains) {
      text += "      - {id: " + std::to_string(chain.id) + ", closed: " + yaml_text(chain.closed) +
              ", state: " + kStates[static_cast<std::size_t>(chain.state)].second +
              ", p_exists: " + yaml_text(chain.p_exists) + ", first_seen_ns: " + std::to_string(chain.first_seen_ns) +
              ", last_seen_ns: " + std::to_string(chain.last_seen_ns) + ",\n         vertices: [";
      for (std::size_t i = 0; i < chain.vertices.size(); ++i) {
        const ChainVertex& vertex = chain.vertices[i];
        text += (i > 0 ? ", [" : "[") + yaml_text(vertex.p_world_m.x()) + ", " + yaml_text(vertex.p_world_m.y()) +
                ", " + yaml_text(vertex.sigma_m) + ']';
      }
      text += "]}\n";
    }
  }
  return text;
}

std::vector<LocalMap> read_local_maps(const std::string& yaml, std::size_t segments, const std::string& source) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    refuse_local_maps(source, yaml_defect(error));
  }
  check_local_map_keys(root, {"local_maps"}, "the file", source);
  if (!root["local_maps"].IsSequence()) refuse_local_maps(source, "local_maps must be a list");
  std::vector<LocalMap> maps;
  std::size_t vertices_read = 0;
  for (const YAML::Node& node : root["local_maps"]) {
    const std::string place = "local_maps[" + std::to_string(maps.size()) + ']';
    check_local_map_keys(node, {"segment", "chains"}, place, source);
    LocalMap map;
    map.segment = local_map_value<std::size_t>(node, "segment", place, source);
    if (!node["chains"].IsSequence()) refuse_local_maps(source, place + ".chains must be a list");
    for (const YAML::Node& chain : node["chains"]) {
      map.chains.push_back(read_local_chain(chain, chain_place(maps.size(), map.chains.size()), source, vertices_read));
    }
    maps.push_back(std::move(map));
  }
  check_local_maps(maps, segments, source);
  return maps;
}

std::vector<LocalMap> load_local_maps(const std::string& file, std::size_t segments) {
  return read_local_maps(read_text_file(file), segments, file);
}

void save_local_maps(const std::vector<LocalMap>& maps, const std::string& file) {
  const std::string text = yaml_text(maps);
  // What is written can be read.
  if (text.size() > kMaxTextBytes) refuse_local_maps(file, "local_maps would be more than 16 MiB");
  check_local_maps(maps, maps.empty() ? 0 : maps.back().segment + 1, file);
  replace_file(file, kind_with_mark("a file of local maps", "\nlocal_maps:"), text);
}

}  // namespace situation_awareness
