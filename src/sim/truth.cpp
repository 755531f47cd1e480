// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/truth.hpp"

#include <algorithm>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

std::vector<int> Sightings::add(std::int64_t stamp_ns, const std::vector<TrueHit>& hits, std::size_t columns) {
  for (Sighting& sighting : of_object_) sighting.beams = 0;
  std::vector<int> object_of_ray(hits.size(), -1);
  std::vector<int> beams_of_row(of_object_.size());
  for (std::size_t row = 0; row < hits.size(); row += columns) {
    std::fill(beams_of_row.begin(), beams_of_row.end(), 0);
    for (std::size_t ray = row; ray < std::min(row + columns, hits.size()); ++ray) {
      const TrueHit& hit = hits[ray];
      if (hit.object < 0 || hit.range_m > range_m_) continue;
      object_of_ray[ray] = hit.object;
      ++beams_of_row[static_cast<std::size_t>(hit.object)];
    }
    for (std::size_t object = 0; object < of_object_.size(); ++object) {
      of_object_[object].beams = std::max(of_object_[object].beams, beams_of_row[object]);
    }
  }
  for (Sighting& sighting : of_object_) {
    if (sighting.beams == 0) continue;
    if (sighting.observations++ == 0) sighting.first_seen_ns = stamp_ns;
    sighting.last_seen_ns = stamp_ns;
  }
  return object_of_ray;
}

std::vector<std::size_t> objects_of_true_map(const World& world) {
  std::vector<std::size_t> places;
  for (const TrueObject& object : world.objects_at(0.0)) {
    if (object.ellipse_world) places.push_back(object.id - 1);
  }
  return places;
}

Objects true_map(const World& world, const Sightings& sightings, double time_s, double height_world_m) {
  Objects truth;
  truth.stamp_ns = nanoseconds(time_s);
  truth.height_world_m = height_world_m;
  for (const TrueObject& true_object : world.objects_at(time_s)) {
    if (!true_object.ellipse_world) continue;
    const Sightings::Sighting& sighting = sightings.of_object()[true_object.id - 1];
    Object object;
    object.id = true_object.id;
    object.ellipse_world = *true_object.ellipse_world;
    object.velocity_world_m_s = true_object.velocity_world_m_s;
    object.angular_velocity_rad_s = true_object.angular_velocity_rad_s;
    object.first_seen_ns = sighting.first_seen_ns;
    object.last_seen_ns = sighting.last_seen_ns;
    object.observations = sighting.observations;
    object.beams = sighting.beams;
    object.p_exists = true_object.is_there ? 1.0 : 0.0;
    truth.objects.push_back(object);
  }
  return truth;
}

}  // namespace situation_awareness
