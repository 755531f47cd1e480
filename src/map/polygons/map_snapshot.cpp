// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/map_snapshot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "situation_awareness/map/polygons/polygon_map.hpp"

namespace situation_awareness {
namespace {

/// rad. An azimuth is that of a beam, not wrapped.
constexpr float kMaxAzimuth_rad = 100.0F;
/// Of one scan.
constexpr std::size_t kMaxBeams = 200'000;
/// Hits of the elements of chains: as many as make a well-known one.
constexpr int kHitsOfChain = 100;

/// A place for the state of one element, whatever the types of its integers are.
class PackedState {
 public:
  struct Writer {
    PackedState& state;
    template <class Value, class... Limits>
    void operator()(const char* /*name*/, const Value& value, const Limits&... /*limits*/) {
      state.write(value);
    }
  };
  struct Reader {
    PackedState& state;
    template <class Value, class... Limits>
    void operator()(const char* /*name*/, Value& value, const Limits&... /*limits*/) {
      state.read(value);
    }
  };

 private:
  template <class Value>
  void write(const Value& value) {
    if constexpr (std::is_same_v<Value, Eigen::Vector2d>) {
      write(value.x());
      write(value.y());
    } else if constexpr (std::is_floating_point_v<Value>) {
      std::memcpy(&words_.at(written_++), &value, sizeof(double));
    } else {
      words_.at(written_++) = static_cast<std::uint64_t>(value);
    }
  }
  template <class Value>
  void read(Value& value) {
    if constexpr (std::is_same_v<Value, Eigen::Vector2d>) {
      read(value.x());
      read(value.y());
    } else if constexpr (std::is_floating_point_v<Value>) {
      std::memcpy(&value, &words_.at(read_++), sizeof(double));
    } else {
      value = static_cast<Value>(words_.at(read_++));
    }
  }

  std::array<std::uint64_t, 64> words_{};
  std::size_t written_ = 0, read_ = 0;
};

/// Copies the state between an element of the map and one of a snapshot.
template <class From, class To>
void copy_state(const From& from, To& to) {
  PackedState state;
  PolygonMapElement::state_fields(from, PackedState::Writer{state});
  PolygonMapElement::state_fields(to, PackedState::Reader{state});
}

bool are_azimuths(const std::vector<float>& azimuth_rad) {
  return std::is_sorted(azimuth_rad.begin(), azimuth_rad.end()) &&
         std::all_of(azimuth_rad.begin(), azimuth_rad.end(), [](float a) { return std::abs(a) < kMaxAzimuth_rad; });
}

void check_watch(const PolygonMapWatch& watch, const CheckFields& check) {
  const std::vector<float>& azimuth_rad = watch.azimuth_rad.values;
  const std::vector<float>& range_m = watch.range_m.values;
  if (range_m.size() > kMaxBeams) check.refuse("range_m", "has too many ranges");
  if (!are_azimuths(azimuth_rad)) check.refuse("azimuth_rad", "has an azimuth that is not a number or steps back");
  if (!is_free_space(azimuth_rad, range_m)) check.refuse("range_m", "has not one range >= 0 for each azimuth");
}

/// `on_map`: of each place, whether an element that is confirmed is there.
void check_chains(const PolygonMapSnapshot& snapshot, std::vector<bool> on_map, const CheckFields& check) {
  const auto is_on_map = [&](std::int32_t place) {
    return place >= 0 && static_cast<std::size_t>(place) < on_map.size() && on_map[static_cast<std::size_t>(place)];
  };
  const auto check_place = [&](const char* name, std::int32_t place) {
    if (!is_on_map(place)) {
      check.refuse(name, "has the place " + std::to_string(place) + " of no element on the map, or twice");
    }
  };
  for (const std::int32_t joint : snapshot.met_joints.values) {
    if (joint < 0 || static_cast<std::size_t>(joint) >= snapshot.joints.size()) {
      check.refuse("met_joints", "has " + std::to_string(joint) + " that is none of the joints");
    }
  }
  for (const std::int32_t place : snapshot.seldom_hit.values) check_place("seldom_hit", place);
  for (const std::int32_t place : snapshot.crossed.values) check_place("crossed", place);
  for (const std::int32_t place : snapshot.renamed.values) check_place("renamed", place);
  std::vector<bool> has_right(on_map.size()), has_left(on_map.size());
  const std::vector<std::int32_t>& lines = snapshot.lines.values;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    if (lines[k] == -1) continue;
    check_place("lines", lines[k]);
    if (k + 1 == lines.size()) check.refuse("lines", "does not end with -1");
    if (lines[k + 1] == -1) continue;
    check_place("lines", lines[k + 1]);
    const auto right = static_cast<std::size_t>(lines[k]), left = static_cast<std::size_t>(lines[k + 1]);
    if (has_left[right] || has_right[left]) check.refuse("lines", "has an element twice");
    has_left[right] = has_right[left] = true;
  }
  std::vector<std::uint64_t> ids;
  for (const ChainPlaces& chain : snapshot.chains.values) {
    if (chain.elements.size() < (chain.closed ? 3U : 1U)) check.refuse("chains", "has one of too few elements");
    if (chain.id >= snapshot.next_id) check.refuse("chains", "has an id that is not below next_id");
    if (chain.id != 0) ids.push_back(chain.id);
    for (const std::int32_t place : chain.elements) {
      check_place("chains", place);
      on_map[static_cast<std::size_t>(place)] = false;
    }
  }
  std::sort(ids.begin(), ids.end());
  if (std::adjacent_find(ids.begin(), ids.end()) != ids.end()) check.refuse("chains", "has an id twice");
}

}  // namespace

bool is_free_space(const std::vector<float>& azimuth_rad, const std::vector<float>& range_m) {
  return azimuth_rad.size() == range_m.size() && are_azimuths(azimuth_rad) &&
         std::all_of(range_m.begin(), range_m.end(), [](float r) { return r >= 0.0F; });
}

void PolygonMapSnapshot::validate() const {
  const CheckFields check;
  fields(*this, check);
  if (elements.size() > polygon_bounds::kMaxElements) {
    check.refuse("elements", "are more than " + std::to_string(polygon_bounds::kMaxElements));
  }
  for (std::size_t i = 0; i < watches.size(); ++i) {
    check_watch(watches[i], CheckFields(detail::item_place("", "watches", i)));
  }
  if (next_watch != 0 && next_watch >= static_cast<std::int64_t>(watches.size())) {
    check.refuse("next_watch", "= " + std::to_string(next_watch) + " is none of the watches");
  }
  if (joined_at_ns > stamp_ns) check.refuse("joined_at_ns", "is after stamp_ns");
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const Joints::Joint& joint = joints[i];
    const auto pair = [&](std::size_t k) { return std::pair(joints[k].low, joints[k].high); };
    if (joint.low >= joint.high || joint.high >= next_id || (i > 0 && pair(i - 1) >= pair(i))) {
      CheckFields(detail::item_place("", "joints", i))
          .refuse("low", "and high are not in ascending order below next_id");
    }
  }
  const auto places = static_cast<std::int64_t>(elements.size() + free_places.values.size());
  std::vector<bool> taken(static_cast<std::size_t>(places));
  for (const std::int32_t place : free_places.values) {
    if (place < 0 || place >= places || taken[static_cast<std::size_t>(place)]) {
      check.refuse("free_places", "has the place " + std::to_string(place) + " that is not there, or twice");
    }
    taken[static_cast<std::size_t>(place)] = true;
  }
  std::vector<bool> confirmed(static_cast<std::size_t>(places));
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const PolygonMapElement& element = elements[i];
    const CheckFields check_fields("elements[" + std::to_string(i) + "]: ");
    PolygonMapElement::fields(element, check_fields);
    if (element.place >= places || taken[static_cast<std::size_t>(element.place)]) {
      check_fields.refuse("place", "= " + std::to_string(element.place) + " is not there, or not free");
    }
    taken[static_cast<std::size_t>(element.place)] = true;
    if (std::abs(element.normal_world.norm() - 1.0) > 1e-6) check_fields.refuse("normal_world", "is no unit vector");
    if (element.chain >= next_id) check_fields.refuse("chain", "is not below next_id");
    if (!(element.low_m <= element.high_m)) check_fields.refuse("low_m", "is above high_m");
    if (element.confirmed) confirmed[static_cast<std::size_t>(element.place)] = true;
    for (const auto& [name, seen_ns] :
         {std::pair{"first_seen_ns", element.first_seen_ns}, std::pair{"last_seen_ns", element.last_seen_ns}}) {
      if (seen_ns > stamp_ns) check_fields.refuse(name, "is after stamp_ns");
      if (stamp_ns - seen_ns > polygon_bounds::kMaxAge_ns) check_fields.refuse(name, "is too long before stamp_ns");
    }
  }
  check_chains(*this, std::move(confirmed), check);
}

PolygonMapSnapshot PolygonMap::snapshot() const {
  PolygonMapSnapshot result;
  if (stamp_ns_ != std::numeric_limits<std::int64_t>::min()) result.stamp_ns = stamp_ns_;
  result.step_s = waited_s_;
  result.free_places.values = surfels_.free_places();
  result.next_watch = static_cast<std::int64_t>(next_watch_);
  for (const Watch& watch : watches_) {
    PolygonMapWatch& remembered = result.watches.emplace_back();
    if (watch.free_space.range_m.empty()) continue;
    remembered = {watch.stamp_ns,
                  watch.T_level_world,
                  {watch.free_space.azimuth_rad},
                  {watch.free_space.range_m},
                  watch.free_space.full_circle};
  }
  result.elements.reserve(elements());
  for (const Index i : surfels_.in_order()) {
    PolygonMapElement& element = result.elements.emplace_back();
    copy_state(surfels_[i], element);
    element.place = i;
  }
  chains_.save(surfels_, result);
  return result;
}

void PolygonMap::restore(const PolygonMapSnapshot& snapshot) {
  snapshot.validate();
  if (!snapshot.watches.empty() && snapshot.watches.size() != watches_.size()) {
    throw std::invalid_argument("watches are not " + std::to_string(watches_.size()));
  }
  stamp_ns_ =
      snapshot.stamp_ns == PolygonMapSnapshot::kNoStamp ? std::numeric_limits<std::int64_t>::min() : snapshot.stamp_ns;
  waited_s_ = snapshot.joined_at_ns == snapshot.stamp_ns ? 0.0 : snapshot.step_s;
  made_ns_ = stamp_ns_;
  next_watch_ = static_cast<std::size_t>(snapshot.next_watch);
  for (std::size_t i = 0; i < watches_.size(); ++i) {
    Watch& watch = watches_[i];
    watch = Watch{};
    if (i >= snapshot.watches.size()) continue;
    const PolygonMapWatch& remembered = snapshot.watches[i];
    watch.stamp_ns = remembered.stamp_ns;
    watch.T_level_world = remembered.T_level_world;
    watch.free_space = {remembered.azimuth_rad.values, remembered.range_m.values, remembered.full_circle};
    watch.find_ends();
  }
  unsettled_.clear();
  surfels_.begin(snapshot.elements.size(), snapshot.free_places.values);
  for (const PolygonMapElement& element : snapshot.elements) {
    Surfel surfel;
    copy_state(element, surfel);
    surfels_.put(static_cast<Index>(element.place), surfel);
    most_extent_m_ = std::max({most_extent_m_, surfel.high_m, -surfel.low_m});
    if (!surfel.confirmed || surfel.log_odds < 0.0) unsettled_.push_back(static_cast<Index>(element.place));
  }
  chains_.restore(surfels_, snapshot);
}

PolygonMapSnapshot snapshot_of_chains(const Polygons& polygons, double spacing_m) {
  PolygonMapSnapshot result;
  result.stamp_ns = polygons.stamp_ns;
  result.height_world_m = polygons.height_world_m;
  for (const Chain& chain : polygons.chains) {
    result.next_id = std::max(result.next_id, chain.id + 1);
    const std::size_t edges = chain.closed ? chain.vertices.size() : chain.vertices.size() - 1;
    for (std::size_t k = 0; k < edges; ++k) {
      const ChainVertex& a = chain.vertices[k];
      const ChainVertex& b = chain.vertices[(k + 1) % chain.vertices.size()];
      const Eigen::Vector2d way_m = b.p_world_m - a.p_world_m;
      const double length_m = way_m.norm();
      if (!(length_m > 0.0)) continue;
      const double wanted = std::max(1.0, std::round(length_m / spacing_m));
      if (!(wanted <= static_cast<double>(polygon_bounds::kMaxElements - result.elements.size()))) {
        throw std::invalid_argument("the chains are too long for a map: they would be more than " +
                                    std::to_string(polygon_bounds::kMaxElements) + " elements");
      }
      const auto pieces = static_cast<int>(wanted);
      for (int piece = 0; piece < pieces; ++piece) {
        const double part = (piece + 0.5) / pieces;
        const double sigma_m = (1.0 - part) * a.sigma_m + part * b.sigma_m;
        PolygonMapElement& element = result.elements.emplace_back();
        element.place = static_cast<std::int64_t>(result.elements.size()) - 1;
        element.p_world_m = a.p_world_m + part * way_m;
        element.normal_world = Eigen::Vector2d(-way_m.y(), way_m.x()) / length_m;
        element.variance_m2 = sigma_m * sigma_m;
        element.high_m = 0.5 * length_m / pieces;
        element.low_m = -element.high_m;
        const double odds = chain.p_exists < 1.0 ? chain.p_exists / (1.0 - chain.p_exists) : 1e9;
        element.log_odds = odds > 0.0 ? std::min(std::log(odds), Surfel::kMostLogOdds) : 0.0;
        element.first_seen_ns = chain.first_seen_ns;
        element.last_seen_ns = chain.last_seen_ns;
        element.hits = kHitsOfChain;
        element.chain = chain.id;
        element.oriented = element.confirmed = true;
      }
    }
  }
  result.validate();
  return result;
}

}  // namespace situation_awareness
