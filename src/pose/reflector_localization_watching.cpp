// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "reflector_localization_parts.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"

// Whether the reflectors are where the map says, and the pose is what they say.
namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. A reflector is missing only where it should be seen nearer than this.
constexpr double kMaxView_m = 8.0;
/// A reflector is missing after so many scans with beams through its place, less those that saw it.
constexpr int kMissingScans = 25;
/// A reflector is moved after so many scans in a row that saw one standing near its place instead.
constexpr int kMovedScans = 25;
/// m. A reflector that moved farther is a missing one.
constexpr double kMaxMove_m = 1.0;
/// m. Error added to the position, in each direction, by a scan that contradicts it.
constexpr double kLostSigma_m = 0.03;
/// rad. Error added to the yaw by a scan that contradicts it.
constexpr double kLostSigma_rad = 0.02;

/// Reflectors are judged only by a pose that is known better than this.
constexpr double kCertain_m = 0.05;
constexpr double kCertain_rad = 0.03;
/// Beams that pass through the place of a reflector end farther behind it than this.
constexpr double kBehindReflector_m = 0.1;
/// What is seen nearer than this to a reflector's place and not in it hides that place, or is the reflector itself.
constexpr double kBesidePlace_m = 0.15;
/// m. A sighting of none of the reflectors is of the same thing as an earlier one within this distance.
constexpr double kSameStranger_m = 0.25;
/// Scans with a match that saw it, after which it is known.
constexpr int kStrangerScans = 5;
/// m. The place of a moved reflector is known to this standard deviation, in each direction, when it begins to be used:
/// so much more than the errors by which it was found that these, which come again, count for nothing.
constexpr double kMovedSigma_m = 0.05;

/// After so many matches a pose is that of these reflectors.
constexpr std::size_t kSureMatches = 3;

}  // namespace

bool ReflectorLocalization::MovedPlaces::any() const {
  return std::any_of(is_used.begin(), is_used.end(), [](bool used) { return used; });
}

// A moved reflector is used from now on where it has been seen standing, if there is room.
void ReflectorLocalization::use_moved(Watched& watched) {
  const auto room = std::find(moved_.is_used.begin(), moved_.is_used.end(), false);
  if (room == moved_.is_used.end()) return;
  *room = true;
  const int i = static_cast<int>(room - moved_.is_used.begin());
  watched.used = i;
  watched.beams = {};
  moved_.l.segment<2>(2 * i) = watched.stands.center_world_m();
  moved_.P.block<2, 2>(2 * i, 2 * i) = kMovedSigma_m * kMovedSigma_m * Eigen::Matrix2d::Identity();
  ++counters_["moved reflector used"];
}

void ReflectorLocalization::leave_moved(Watched& watched) {
  const int i = watched.used;
  if (i < 0) return;
  watched.used = -1;
  watched.beams = {};
  moved_.is_used[static_cast<std::size_t>(i)] = false;
  moved_.l.segment<2>(2 * i).setZero();
  moved_.P.middleRows<2>(2 * i).setZero();
  moved_.P.middleCols<2>(2 * i).setZero();
  moved_.P_state.middleCols<2>(2 * i).setZero();
}

// All beams that would meet the reflector, wherever it is by the errors of the pose, end far behind it.
bool ReflectorLocalization::is_seen_through(const ReflectorSightings& sightings, const Pose2& T_base_lidar,
                                            const Reflector& known) const {
  const std::vector<float>& azimuths = sightings.free.azimuth_rad;
  if (azimuths.size() < 2) return false;
  double time_s = 0.5 * (sightings.free_begin_s + sightings.free_end_s);
  Eigen::Vector2d z;
  Eigen::Matrix<double, 2, 3> H;
  double azimuth_rad = 0.0;
  OdometryTrack::Entry now;
  if (!track_.at(sightings.stamp_ns, now)) return false;
  for (int iteration = 0; iteration < 2; ++iteration) {  // the time depends on the azimuth
    OdometryTrack::Entry then;
    if (!track_.at(sightings.stamp_ns + nanoseconds(time_s), then)) return false;
    const Pose2 T_base_then_lidar = inverse(now.T_track_base) * then.T_track_base * T_base_lidar;
    z = observed_reflector(at_stamp_.x, T_base_then_lidar, known.center_world_m);
    H = observed_reflector_jacobian(at_stamp_.x, T_base_then_lidar, known.center_world_m);
    azimuth_rad = z(1);
    while (azimuth_rad < azimuths.front()) azimuth_rad += 2.0 * kPi;
    while (azimuth_rad - 2.0 * kPi >= azimuths.front()) azimuth_rad -= 2.0 * kPi;
    const double part = (azimuth_rad - azimuths.front()) / static_cast<double>(azimuths.back() - azimuths.front());
    time_s = sightings.free_begin_s + std::min(1.0, part) * (sightings.free_end_s - sightings.free_begin_s);
  }
  if (z(0) > kMaxView_m || z(0) < known.radius_m + 0.1) return false;
  const Eigen::Matrix2d HPH = transformed(H, at_stamp_.P);
  const double half_rad = std::asin(std::min(1.0, known.radius_m / z(0))) + 2.0 * std::sqrt(HPH(1, 1));
  const double behind_m = z(0) + known.radius_m + kBehindReflector_m + 2.0 * std::sqrt(HPH(0, 0));
  const auto begin = std::lower_bound(azimuths.begin(), azimuths.end(), static_cast<float>(azimuth_rad - half_rad));
  const auto end = std::upper_bound(begin, azimuths.end(), static_cast<float>(azimuth_rad + half_rad));
  if (begin == azimuths.begin() || begin == end || end == azimuths.end()) return false;
  return std::all_of(sightings.free.range_m.begin() + (begin - azimuths.begin()),
                     sightings.free.range_m.begin() + (end - azimuths.begin()),
                     [&](float range_m) { return range_m > behind_m; });
}

// Unmatched sightings of what was not seen before while others were matched. Those of a scan with matches are
// remembered.
std::size_t ReflectorLocalization::count_strange(const ReflectorSightings& sightings) {
  std::size_t strange = 0;
  for (const Seen& seen : seen_) {
    const bool is_unmatched =
        std::find(update_.unmatched.begin(), update_.unmatched.end(), seen.sighting) != update_.unmatched.end();
    if (!is_unmatched) continue;
    const ReflectorSighting& sighting = sightings.sightings[seen.sighting];
    const Eigen::Vector2d p_lidar =
        sighting.surface_range_m * Eigen::Vector2d(std::cos(sighting.azimuth_rad), std::sin(sighting.azimuth_rad));
    const Eigen::Vector2d p_world = at_stamp_.x * (seen.T_base_lidar * p_lidar);
    const auto known = std::find_if(strangers_.begin(), strangers_.end(), [&](const Stranger& stranger) {
      return (stranger.p_world_m - p_world).norm() < kSameStranger_m;
    });
    if (known == strangers_.end() || known->scans < kStrangerScans) ++strange;
    if (update_.matches.empty() || contradicted_ > 0) continue;
    if (known != strangers_.end()) {
      ++known->scans;
    } else {
      if (strangers_.size() == kMaxStrangers) strangers_.erase(strangers_.begin());  // the oldest
      strangers_.push_back({p_world, 1});
    }
  }
  return strange;
}

// Whether something stands near the place of a reflector, `is_gone` from it, that is nobody else's.
void ReflectorLocalization::judge_elsewhere(const ReflectorSightings& sightings, const Pose2& T_base_lidar,
                                            std::size_t reflector, bool is_gone) {
  Watched& watched = watched_[reflector];
  const Reflector& known = map_.reflectors[reflector];
  double nearest_m = kMaxMove_m;
  Eigen::Vector2d nearest_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d lidar_world_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  bool is_plausible = false;
  for (const Seen& seen : seen_) {
    if (std::find(update_.unmatched.begin(), update_.unmatched.end(), seen.sighting) == update_.unmatched.end()) {
      continue;
    }
    const ReflectorFit fit = fit_reflector(sightings, sightings.sightings[seen.sighting], known.radius_m);
    const Pose2 T_world_lidar = at_stamp_.x * seen.T_base_lidar;
    const Eigen::Vector2d along(std::cos(fit.azimuth_rad), std::sin(fit.azimuth_rad));
    const Eigen::Vector2d p_world = T_world_lidar * (fit.range_m * along);
    const double distance_m = (p_world - known.center_world_m).norm();
    // Where the place itself is hidden, something bright at some distance is another thing.
    if (distance_m >= nearest_m || (distance_m > kBesidePlace_m && !is_gone && !watched.is_missing)) continue;
    nearest_m = distance_m;
    nearest_world_m = p_world;
    lidar_world_m = T_world_lidar.translation_m;
    is_plausible = fit.is_width_plausible;
    const Eigen::Vector2d along_world = T_world_lidar.rotation() * along;
    Eigen::Matrix2d J;  // d(x, y) / d(range, azimuth)
    J << along_world.x(), -fit.range_m * along_world.y(), along_world.y(), fit.range_m * along_world.x();
    const double yaw_m2 = fit.range_m * fit.range_m * at_stamp_.P(2, 2);
    covariance = transformed(J, fit.covariance) +
                 (larger_eigenvalue(at_stamp_.P.topLeftCorner<2, 2>()) + yaw_m2) * Eigen::Matrix2d::Identity();
  }
  const bool is_seen = nearest_m < kMaxMove_m;
  if (!is_seen && watched.elsewhere > 0 &&
      is_seen_through(sightings, T_base_lidar, {watched.elsewhere_world_m, known.radius_m})) {
    // Not there any more: someone who stood there, or a reflector that was moved again.
    if (++watched.left >= kMissingScans) {
      watched.elsewhere = watched.left = 0;
      watched.is_moved = false;
    }
    watched.stands = {};
  }
  if (!is_seen) return;
  if (watched.elsewhere > 0 && (nearest_world_m - watched.elsewhere_world_m).norm() > kStands_m) {
    watched.elsewhere = 0;
    watched.stands = {};
  }
  watched.left = 0;
  ++watched.elsewhere;
  watched.elsewhere_world_m += (nearest_world_m - watched.elsewhere_world_m) / watched.elsewhere;
  if (is_plausible) watched.stands.add(sightings.stamp_ns, nearest_world_m, covariance, lidar_world_m);
  if (watched.elsewhere < kMovedScans) return;
  if (!watched.is_moved) ++counters_["reflector moved"];
  watched.is_moved = true;
  if (watched.stands.seen_s() >= params_.moved_use_s && watched.stands.is_reflector()) use_moved(watched);
}

// What the scan says of a reflector, by a pose that `is_certain` or not. True if it is not where it was up to now.
bool ReflectorLocalization::judge_reflector(const ReflectorSightings& sightings, const Pose2& T_base_lidar,
                                            std::size_t k, bool is_certain) {
  Watched& watched = watched_[k];
  const bool is_matched = std::any_of(update_.matches.begin(), update_.matches.end(),
                                      [&](const ReflectorMatch& m) { return m.reflector == static_cast<int>(k); });
  if (is_matched && watched.used >= 0) {
    watched.left = std::max(0, watched.left - 2);
    watched.back = 0;
    watched.elsewhere_world_m = moved_.at(watched.used);
    return false;
  }
  if (is_matched) {
    watched.missing = std::max(0, watched.missing - 2);
    watched.elsewhere = 0;
    watched.stands = {};
    if (watched.missing == 0) watched.is_missing = false;
    return false;
  }
  const bool is_gone = is_seen_through(sightings, T_base_lidar, map_.reflectors[k]);
  const bool is_new = is_gone && !watched.is_missing && !watched.is_moved;
  if (!is_certain) return is_new;
  if (is_gone) {
    watched.missing = std::min(watched.missing + 1, kMissingScans);
    watched.back = 0;
    if (watched.missing == kMissingScans && !watched.is_missing) {
      watched.is_missing = true;
      ++counters_["reflector missing"];
    }
  }
  // Back in its place.
  if (watched.is_moved && watched.back >= kMovedScans) {
    leave_moved(watched);
    watched = {};
    ++counters_["reflector back"];
    return is_new;
  }
  if (watched.used < 0) {
    judge_elsewhere(sightings, T_base_lidar, k, is_gone);
  } else if (is_seen_through(sightings, T_base_lidar, {center_of(k), map_.reflectors[k].radius_m}) &&
             ++watched.left >= kMovedScans) {
    leave_moved(watched);  // moved again, or it was none
    watched.elsewhere = watched.left = 0;
    watched.is_moved = false;
    watched.stands = {};
    ++counters_["moved reflector gone"];
  }
  return is_new;
}

void ReflectorLocalization::tell_displaced() {
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    if (watched_[k].is_moved) {
      MovedReflector moved;
      moved.reflector = static_cast<int>(k);
      moved.center_world_m = watched_[k].elsewhere_world_m;
      moved.is_used = watched_[k].used >= 0;
      if (moved.is_used) moved.covariance_m2 = moved_.covariance_at(watched_[k].used);
      update_.moved.push_back(moved);
    } else if (watched_[k].is_missing) {
      update_.missing.push_back(static_cast<int>(k));
    }
  }
}

// `seen_through`: reflectors that are not where they were up to now.
void ReflectorLocalization::judge_pose(const ReflectorSightings& sightings, std::size_t seen_through) {
  const std::size_t matches = update_.matches.size();
  // After a long way with few reflectors one may be matched by chance, and those that it hides are soon known as things
  // that shine: a search tells. A pose that was known all the time needs none: things that shine, and reflectors that
  // were moved, may be more than those that are matched.
  if (matches >= kSureMatches && doubtful_ == 0) was_unsure_ = false;
  const std::size_t unmatched = update_.unmatched.size();
  if (unmatched >= 2 && unmatched > matches && was_unsure_) {
    ++doubtful_;
  } else if (matches > 0) {
    doubtful_ = std::max(0, doubtful_ - 1);
  }
  // What was there before, while the pose was known, is no sign of another pose: a reflector that was moved, a thing
  // that shines.
  const std::size_t strange = count_strange(sightings);
  update_.is_contradicted =
      (seen_through >= 2 && seen_through > matches && strange >= 2) || (matches == 0 && strange >= 3);
  if (!update_.is_contradicted) {
    if (matches >= 1) contradicted_ = 0;
    return;
  }
  ++contradicted_;
  const Eigen::Vector3d sigma(kLostSigma_m, kLostSigma_m, kLostSigma_rad);
  estimate_.P.diagonal().head<3>() += sigma.cwiseAbs2();
  at_stamp_.P.diagonal() += sigma.cwiseAbs2();
}

void ReflectorLocalization::judge_reflectors(const ReflectorSightings& sightings, const Pose2& T_base_lidar) {
  if (update_.matches.size() >= 2) confirmed_ns_ = stamp_ns_;
  const bool is_certain = !update_.matches.empty() && seconds_between(confirmed_ns_, stamp_ns_) < kConfirmed_s &&
                          larger_eigenvalue(at_stamp_.P.topLeftCorner<2, 2>()) < kCertain_m * kCertain_m &&
                          at_stamp_.P(2, 2) < kCertain_rad * kCertain_rad;
  std::size_t seen_through = 0;
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    seen_through += judge_reflector(sightings, T_base_lidar, k, is_certain) ? 1 : 0;
  }
  tell_displaced();
  judge_pose(sightings, seen_through);
}

}  // namespace situation_awareness
