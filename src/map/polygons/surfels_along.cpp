// SPDX-License-Identifier: BSD-3-Clause
#include "surfels_along.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"

namespace situation_awareness {
namespace {

constexpr Bounds kVariance_m2{1e-12, 1e9};
constexpr std::int64_t kMaxAge_ns = std::int64_t{1} << 61;  ///< 73 years
/// Hits of an element: as many as make a well-known one.
constexpr int kHits = 100;

void check(const Chain& chain, std::int64_t stamp_ns) {
  for (const std::int64_t seen_ns : {chain.first_seen_ns, chain.last_seen_ns}) {
    if (seen_ns > stamp_ns || seen_ns < -kMaxAge_ns || stamp_ns - seen_ns > kMaxAge_ns) {
      throw std::invalid_argument("a chain has a stamp after that of the map, or too long before it");
    }
  }
}

void check(const Surfel& surfel) {
  if (!(surfel.p_world_m.cwiseAbs().maxCoeff() <= kFarthestFromOrigin_m)) {
    throw std::invalid_argument("a chain is more than 1000 km from the world's origin");
  }
  if (!(surfel.variance_m2 >= kVariance_m2.low && surfel.variance_m2 <= kVariance_m2.high)) {
    throw std::invalid_argument("a chain has a vertex with a standard deviation that is no size");
  }
}

/// What the elements of a chain have in common.
Surfel surfel_of(const Chain& chain) {
  Surfel surfel;
  const double odds = chain.p_exists < 1.0 ? chain.p_exists / (1.0 - chain.p_exists) : 1e9;
  surfel.log_odds = odds > 0.0 ? std::min(std::log(odds), Surfel::kMostLogOdds) : 0.0;
  surfel.first_seen_ns = chain.first_seen_ns;
  surfel.last_seen_ns = chain.last_seen_ns;
  surfel.hits = kHits;
  surfel.chain = chain.id;
  surfel.oriented = surfel.confirmed = true;
  return surfel;
}

/// `surfel`: as by surfel_of(), of the chain of this edge.
void add_along(const ChainVertex& a, const ChainVertex& b, double spacing_m, Surfel surfel,
               std::vector<Surfel>& surfels) {
  const Eigen::Vector2d way_m = b.p_world_m - a.p_world_m;
  const double length_m = way_m.norm();
  if (!(length_m > 0.0)) return;
  const double wanted = std::max(1.0, std::round(length_m / spacing_m));
  if (!(wanted <= static_cast<double>(PolygonMap::kMaxElements - surfels.size()))) {
    throw std::invalid_argument("the chains are too long for a map: they would be more than " +
                                std::to_string(PolygonMap::kMaxElements) + " elements");
  }
  const auto pieces = static_cast<int>(wanted);
  surfel.normal_world = Eigen::Vector2d(-way_m.y(), way_m.x()) / length_m;
  surfel.high_m = 0.5 * length_m / pieces;
  surfel.low_m = -surfel.high_m;
  for (int piece = 0; piece < pieces; ++piece) {
    const double part = (piece + 0.5) / pieces;
    const double sigma_m = (1.0 - part) * a.sigma_m + part * b.sigma_m;
    surfel.p_world_m = a.p_world_m + part * way_m;
    surfel.variance_m2 = sigma_m * sigma_m;
    check(surfel);
    surfels.push_back(surfel);
  }
}

}  // namespace

std::vector<Surfel> surfels_along(const Polygons& polygons, double spacing_m) {
  std::vector<Surfel> result;
  for (const Chain& chain : polygons.chains) {
    check(chain, polygons.stamp_ns);
    const Surfel surfel = surfel_of(chain);
    const std::size_t edges = chain.closed ? chain.vertices.size() : chain.vertices.size() - 1;
    for (std::size_t k = 0; k < edges; ++k) {
      add_along(chain.vertices[k], chain.vertices[(k + 1) % chain.vertices.size()], spacing_m, surfel, result);
    }
  }
  return result;
}

}  // namespace situation_awareness
