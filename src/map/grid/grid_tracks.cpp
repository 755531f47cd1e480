// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid_tracks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <set>
#include <tuple>

#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/estimation/gating.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. Clusters that are nearer to each other and of which one is less than half as large are one target.
constexpr double kFragment_m = 2.5;

constexpr double kFragment = 0.5;      ///< of the area of a thing, at most
constexpr double kFarthestSame = 1.5;  ///< of same_m, at most, where the pose is known badly
constexpr double kSameProbability = 0.99;
constexpr double kLeastSlope = 0.05;  ///< of a sight line that places something on the ground

/// How the place on level ground, to which a sight line points, follows the camera's place and attitude (about the
/// world's axes). `d_world_m`: from the camera to the place.
Eigen::Matrix<double, 2, 6> ground_jacobian(const Eigen::Vector3d& d_world_m) {
  const double down_m = std::min(d_world_m.z(), -kLeastSlope * d_world_m.head<2>().norm() - 1e-6);
  Eigen::Matrix<double, 2, 3> to_ground = Eigen::Matrix<double, 2, 3>::Identity();  // of a shift of the sight line
  to_ground.col(2) = -d_world_m.head<2>() / down_m;
  Eigen::Matrix3d turn;  // of a rotation: -[d]x
  turn << 0.0, d_world_m.z(), -d_world_m.y(), -d_world_m.z(), 0.0, d_world_m.x(), d_world_m.y(), -d_world_m.x(), 0.0;
  Eigen::Matrix<double, 2, 6> J;
  J << to_ground, to_ground * turn;
  return J;
}

}  // namespace

GridTracks::GridTracks(const GridTracksParams& params)
    : params_((params.validate(), params)), same_gate_(chi_square_quantile(kSameProbability, 2)) {}

const GridTargets& GridTracks::update(std::int64_t stamp_ns, const std::vector<GridCluster>& clusters,
                                      const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                                      const CameraPoseCovariance& covariance, const IsSettled& is_settled) {
  ++updates_;
  associate(clusters, is_settled);
  forget_lost();
  note_apart();
  targets_.stamp_ns = stamp_ns;
  targets_.targets.clear();
  images_.clear();
  for (Track& track : tracks_) {
    if (!track.is_on_map && !track.is_settled) continue;
    if (track.is_on_map) add_view(track, camera, T_world_camera, covariance);
    const GridCluster& cluster = track.cluster;
    if (cluster.images < params_.confirm_images) continue;
    track.was_reported = true;
    GridTarget found{track.id,
                     {cluster.p_world_m.x(), cluster.p_world_m.y(), cluster.ground_world_m},
                     covariance_of(track),
                     cluster.area_m2,
                     cluster.probability};
    const auto same = std::find_if(targets_.targets.begin(), targets_.targets.end(),
                                   [&](const GridTarget& target) { return is_one_with(track, target); });
    if (same == targets_.targets.end()) {
      targets_.targets.push_back(found);
      images_.push_back(cluster.images);
      continue;
    }
    int& images = images_[static_cast<std::size_t>(same - targets_.targets.begin())];
    if (same->area_m2 < kFragment * found.area_m2) {
      found.id = same->id;
      *same = found;
      images = cluster.images;
    } else if (found.area_m2 >= kFragment * same->area_m2) {
      const double part = static_cast<double>(cluster.images) / (images + cluster.images);
      same->p_world_m += part * (found.p_world_m - same->p_world_m);
      images += cluster.images;
    }
  }
  return targets_;
}

void GridTracks::associate(const std::vector<GridCluster>& clusters, const IsSettled& is_settled) {
  std::vector<Candidate> candidates;
  for (std::size_t row = 0; row < clusters.size(); ++row) {
    if (clusters[row].area_m2 < params_.min_area_m2) continue;
    for (std::size_t column = 0; column < tracks_.size(); ++column) {
      const double distance_m = (clusters[row].p_world_m - tracks_[column].cluster.p_world_m).norm();
      if (distance_m >= params_.gate_m) continue;
      candidates.push_back({static_cast<int>(row), static_cast<int>(column), distance_m - params_.gate_m});
    }
  }
  const std::vector<int> track_of =
      assign(static_cast<int>(clusters.size()), static_cast<int>(tracks_.size()), candidates);
  for (Track& track : tracks_) {
    if (track.is_on_map || track.is_settled) track.lost_at = updates_;
    track.is_settled = (track.is_on_map || track.is_settled) && track.was_reported && is_settled &&
                       is_settled(track.cluster.p_world_m);
    track.is_on_map = false;
  }
  for (std::size_t row = 0; row < clusters.size(); ++row) {
    if (clusters[row].area_m2 < params_.min_area_m2) continue;
    if (track_of[row] < 0) tracks_.emplace_back().id = ++last_id_;
    Track& track = track_of[row] < 0 ? tracks_.back() : tracks_[static_cast<std::size_t>(track_of[row])];
    // What is seen again replaces what was known when enough images show it.
    if (track.is_settled && clusters[row].images < params_.confirm_images) continue;
    track.cluster = clusters[row];
    track.is_on_map = true;
    track.is_settled = false;
  }
}

/// The oldest of those that are lost, as many as there are too many.
void GridTracks::forget_lost() {
  const auto lost = static_cast<std::size_t>(
      std::count_if(tracks_.begin(), tracks_.end(), [](const Track& t) { return t.is_lost(); }));
  if (lost <= kMostLost) return;
  std::vector<const Track*> oldest;
  for (const Track& track : tracks_) {
    if (track.is_lost()) oldest.push_back(&track);
  }
  const auto rank = [](const Track* t) { return std::make_tuple(t->was_reported, t->lost_at, t->id); };
  const auto end = oldest.begin() + static_cast<std::ptrdiff_t>(lost - kMostLost);
  std::nth_element(oldest.begin(), end, oldest.end(), [&](const auto* a, const auto* b) { return rank(a) < rank(b); });
  std::set<std::uint64_t> ids;
  std::for_each(oldest.begin(), end, [&](const Track* track) { ids.insert(track->id); });
  tracks_.erase(
      std::remove_if(tracks_.begin(), tracks_.end(), [&](const Track& track) { return ids.count(track.id) > 0; }),
      tracks_.end());
  for (auto pair = apart_.begin(); pair != apart_.end();) {
    const bool goes = ids.count(pair->first.first) > 0 || ids.count(pair->first.second) > 0;
    pair = goes ? apart_.erase(pair) : std::next(pair);
  }
}

void GridTracks::forget() {
  tracks_.clear();
  apart_.clear();
  targets_ = {};
  images_.clear();
}

/// Of those near each other.
void GridTracks::note_apart() {
  for (auto one = tracks_.begin(); one != tracks_.end(); ++one) {
    if (!one->is_on_map) continue;
    for (auto other = std::next(one); other != tracks_.end(); ++other) {
      if (!other->is_on_map || !shown_apart(one->cluster, other->cluster)) continue;
      const double distance_m = (one->cluster.p_world_m - other->cluster.p_world_m).norm();
      if (distance_m < kFarthestSame * params_.same_m) ++apart_[{one->id, other->id}];
    }
  }
}

bool GridTracks::is_one_with(const Track& track, const GridTarget& target) const {
  const Eigen::Vector2d off_m = track.cluster.p_world_m - target.p_world_m.head<2>();
  const double distance_m = off_m.norm();
  const auto apart = apart_.find({target.id, track.id});
  const bool are_apart = apart != apart_.end() && apart->second >= params_.confirm_images;
  if (!are_apart && distance_m < kFarthestSame * params_.same_m) {
    if (distance_m < params_.same_m) return true;
    const auto other = std::lower_bound(tracks_.begin(), tracks_.end(), target.id,
                                        [](const Track& one, std::uint64_t id) { return one.id < id; });
    const Eigen::Matrix2d S = covariance_by_one_image(track) + covariance_by_one_image(*other);
    if (off_m.dot(S.inverse() * off_m) < same_gate_) return true;
  }
  const auto [less_m2, more_m2] = std::minmax(track.cluster.area_m2, target.area_m2);
  return distance_m < kFragment_m && less_m2 < kFragment * more_m2;
}

void GridTracks::add_view(Track& track, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                          const CameraPoseCovariance& covariance) const {
  const Eigen::Vector3d p_world_m(track.cluster.p_world_m.x(), track.cluster.p_world_m.y(),
                                  track.cluster.ground_world_m);
  const Eigen::Vector3d p_camera_m = T_world_camera.inverse() * p_world_m;
  if (p_camera_m.z() <= 0.0) return;
  const double u_px = camera.fx_px * p_camera_m.x() / p_camera_m.z() + camera.cx_px;
  const double v_px = camera.fy_px * p_camera_m.y() / p_camera_m.z() + camera.cy_px;
  if (u_px < -0.5 || v_px < -0.5 || u_px > camera.width - 0.5 || v_px > camera.height - 0.5) return;
  const Eigen::Matrix<double, 2, 6> J = ground_jacobian(p_world_m - T_world_camera.translation());
  const Eigen::Matrix2d by_pose_m2 = J * covariance * J.transpose();
  const Eigen::Matrix2d by_ground_m2 =
      J.col(2) * J.col(2).transpose() * params_.ground_sigma_m * params_.ground_sigma_m;
  ++track.images;
  track.covariance_sum_m2 += by_pose_m2;
  track.ground_sum_m2 += by_ground_m2;
  track.information_sum_1_m2 += (by_pose_m2 + by_ground_m2 + outline_m2()).inverse();
}

Eigen::Matrix2d GridTracks::outline_m2() const {
  return params_.outline_sigma_m * params_.outline_sigma_m * Eigen::Matrix2d::Identity();
}

/// Those that know it best count most: from afar a sight line tells little of where it meets the ground.
Eigen::Matrix2d GridTracks::covariance_by_one_image(const Track& track) const {
  if (track.images == 0) return outline_m2();
  return (track.information_sum_1_m2 / track.images).inverse();
}

Eigen::Matrix2d GridTracks::covariance_of(const Track& track) const {
  const double n = std::max(track.images, 1);
  const double common = params_.pose_correlation + (1.0 - params_.pose_correlation) / n;
  Eigen::Matrix2d covariance = track.covariance_sum_m2 / n * common + track.ground_sum_m2 / n + outline_m2();
  covariance(1, 0) = covariance(0, 1);  // but for round-off
  return covariance;
}

}  // namespace situation_awareness
