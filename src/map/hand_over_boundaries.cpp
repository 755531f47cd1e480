// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "chain_cover.hpp"
#include "semantic_map_parts.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// Numbers of a boundary of arcs over those of its chains' vertices, at most: then arcs are what explains it.
constexpr double kFewerNumbers = 0.75;
/// m. Between the points of its outline along arcs.
constexpr double kSampled_m = 0.25;
/// For so long (s) before it is a boundary.
constexpr double kExplains_s = 1.0;

/// Number of the parameters that describe a splinegon: x, y and the tangent of a main vertex, or two tangents where it
/// breaks; x and y of a corner between straight parts.
std::size_t numbers_of(const Splinegon& splinegon) {
  std::size_t numbers = 0;
  const std::size_t n = splinegon.vertices.size();
  for (std::size_t k = 0; k < n; k += 2) {
    const SplinegonVertex& vertex = splinegon.vertices[k];
    const double bulge_before = k > 0 || splinegon.closed ? splinegon.vertices[(k + n - 1) % n].bulge : 0.0;
    const bool is_straight = vertex.bulge == 0.0 && bulge_before == 0.0;
    numbers += is_straight ? 2 : vertex.corner ? 4 : 3;
  }
  return numbers;
}

bool is_same(const Splinegon& a, const Splinegon& b) {
  return a.closed == b.closed && a.last_seen_ns == b.last_seen_ns &&
         std::equal(a.vertices.begin(), a.vertices.end(), b.vertices.begin(), b.vertices.end(),
                    [](const SplinegonVertex& v, const SplinegonVertex& w) {
                      return v.p_world_m == w.p_world_m && v.bulge == w.bulge && v.sigma_m == w.sigma_m;
                    });
}

}  // namespace

/// The rule of large obstacles: chains of a boundary that arcs explain with fewer numbers than their vertices are that
/// boundary, under the oldest of their ids, until its layer has none there any more.
void SemanticMap::take_boundaries(const BoundaryChanges& changes) {
  for (const Splinegon& splinegon : changes.boundaries->boundaries) {
    BoundaryEntry* boundary = find_boundary(splinegon.id);
    if (boundary == nullptr) boundary = &add_at_handle(boundaries_, splinegon.id);
    boundary->update = updates_;
    boundary->numbers_of_chains = 0;
    if (is_same(splinegon, boundary->latest)) continue;
    boundary->latest = splinegon;
    if (boundary->is_boundary) draw(*boundary);
    if (const ChainEntry* const main = find_chain(boundary->main)) touched_.push_back(main->id);
  }
  const auto current = [this](Handle handle) {
    BoundaryEntry* const boundary = find_boundary(handle);
    return boundary != nullptr && boundary->update == updates_ ? boundary : nullptr;
  };
  for (const ChainOfBoundary& of : *changes.chains) {
    const ChainEntry* const chain = find_chain(of.chain);
    BoundaryEntry* const boundary = current(of.boundary);
    if (chain != nullptr && boundary != nullptr) boundary->numbers_of_chains += 2 * chain->latest.vertices.size();
  }
  for (const ChainOfBoundary& of : *changes.chains) {
    const bool was_one =
        std::find(saved_boundaries_.begin(), saved_boundaries_.end(), of.chain) != saved_boundaries_.end();
    BoundaryEntry* const boundary = was_one ? current(of.boundary) : nullptr;
    if (boundary == nullptr) continue;
    boundary->is_boundary = true;
    draw(*boundary);
  }
  saved_boundaries_.clear();
  for (BoundaryEntry& boundary : boundaries_) {
    if (boundary.update == updates_) judge(boundary);
  }
  for (const ChainOfBoundary& of : *changes.chains) {
    ChainEntry* const chain = find_chain(of.chain);
    if (chain == nullptr) continue;
    const BoundaryEntry* const boundary = current(of.boundary);
    const Handle handle = boundary != nullptr && boundary->is_boundary ? boundary->handle : 0;
    chain->boundary_update = updates_;
    if (chain->of_boundary == handle) continue;
    leave_boundary(*chain);
    if (handle != 0) enter_boundary(*chain, handle);
  }
  for (ChainEntry& chain : chains_) {
    if (chain.boundary_update != updates_) leave_boundary(chain);
  }
  for (const BoundaryEntry& boundary : boundaries_) {
    if (boundary.update != updates_) unsettle_near(boundary.outline);
  }
  boundaries_.erase(std::remove_if(boundaries_.begin(), boundaries_.end(),
                                   [this](const BoundaryEntry& boundary) { return boundary.update != updates_; }),
                    boundaries_.end());
}

/// Makes the outline anew; chains beside it may show something else now.
void SemanticMap::draw(BoundaryEntry& boundary) {
  unsettle_near(boundary.outline);
  boundary.outline.closed = boundary.latest.closed;
  boundary.outline.vertices = lines_along(boundary.latest, kSampled_m);
  std::reverse(boundary.outline.vertices.begin(), boundary.outline.vertices.end());
  boundary.box_world_m.setEmpty();
  for (const ChainVertex& vertex : boundary.outline.vertices) boundary.box_world_m.extend(vertex.p_world_m);
  boundary.length_m = length_of(boundary.outline);
  unsettle_near(boundary.outline);
}

void SemanticMap::judge(BoundaryEntry& boundary) {
  if (boundary.is_boundary) return;
  const auto most = kFewerNumbers * static_cast<double>(boundary.numbers_of_chains);
  if (!with_chains_) {
    boundary.is_boundary = true;
  } else if (static_cast<double>(numbers_of(boundary.latest)) > most) {
    boundary.explains_since_ns = kNever;
  } else if (boundary.explains_since_ns == kNever) {
    boundary.explains_since_ns = stamp_ns_;
  } else {
    boundary.is_boundary = seconds_between(boundary.explains_since_ns, stamp_ns_) >= kExplains_s;
  }
  if (boundary.is_boundary) draw(boundary);
}

void SemanticMap::enter_boundary(ChainEntry& chain, Handle handle) {
  BoundaryEntry& boundary = *find_boundary(handle);
  chain.of_boundary = handle;
  unsettle_near(chain.latest);
  ++boundary.chains;
  touched_.push_back(chain.id);
  ChainEntry* const main = find_chain(boundary.main);
  if (main == nullptr) {
    boundary.main = chain.handle;
    new_.push_back(chain.handle);
  } else if (chain.id != 0 && (main->id == 0 || chain.id < main->id)) {
    boundary.main = chain.handle;
    merge(main->id, chain.id);
  } else {
    merge(chain.id, main->id);
  }
  touch_boundary(handle);
}

/// The largest chain, of that which leaves and those that stay, keeps the id.
void SemanticMap::leave_boundary(ChainEntry& chain) {
  if (chain.of_boundary == 0) return;
  BoundaryEntry& boundary = *find_boundary(chain.of_boundary);
  chain.of_boundary = 0;
  unsettle_near(chain.latest);
  --boundary.chains;
  touched_.push_back(chain.id);
  new_.push_back(chain.handle);
  touch_boundary(boundary.handle);
  if (boundary.main != chain.handle) return;
  lead(boundary);
  ChainEntry* const main = find_chain(boundary.main);
  if (main != nullptr && chain.id != 0 && main->length_m > chain.length_m) own(*main, chain.id);
}

/// What it is on the map as has changed: how certain its chains are, or which.
void SemanticMap::touch_boundary(Handle handle) {
  const BoundaryEntry* const boundary = find_boundary(handle);
  const ChainEntry* const main = boundary != nullptr ? find_chain(boundary->main) : nullptr;
  if (main != nullptr) touched_.push_back(main->id);
}

/// Gives a boundary the id of its longest chain.
void SemanticMap::lead(BoundaryEntry& boundary) {
  const ChainEntry* const longest = longest_of(boundary.handle, 0);
  boundary.main = longest != nullptr ? longest->handle : 0;
  if (longest == nullptr) return;
  new_.push_back(longest->handle);
  touched_.push_back(longest->id);
}

}  // namespace situation_awareness
