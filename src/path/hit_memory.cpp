// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/hit_memory.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// m. Hits nearer to each other are of one outline; its pieces are so long at least.
constexpr double kGap_m = 1.5, kSpacing_m = 0.4;
/// m. Nothing is so slim that it stands between beams that are nearer to each other.
constexpr double kSlimmest_m = 0.1;

/// Whether all beams around a place passed it, near enough to each other: something there would have been hit.
bool shows_free(const FreeBeams& sight, const Eigen::Vector2d& p_world_m) {
  const Eigen::Vector2d way_m = p_world_m - sight.T_world_sensor.translation_m;
  const double distance_m = way_m.norm();
  if (distance_m * sight.step_rad > kSlimmest_m) return false;
  const double around_rad = std::atan2(HitMemory::kOnMap_m, std::max(distance_m, HitMemory::kOnMap_m));
  double angle_rad =
      std::remainder(std::atan2(way_m.y(), way_m.x()) - sight.T_world_sensor.yaw_rad - sight.from_rad, 2.0 * kPi);
  if (angle_rad < 0.0) angle_rad += 2.0 * kPi;
  const double first = std::floor((angle_rad - around_rad) / sight.step_rad);
  const double last = std::ceil((angle_rad + around_rad) / sight.step_rad);
  if (first < 0.0 || last >= static_cast<double>(sight.free_m.size())) return false;
  return std::all_of(sight.free_m.begin() + static_cast<std::ptrdiff_t>(first),
                     sight.free_m.begin() + static_cast<std::ptrdiff_t>(last) + 1,
                     [&](double free_m) { return free_m > distance_m + HitMemory::kOnMap_m; });
}

}  // namespace

HitMemory::HitMemory() {
  pieces_.reserve(kMost);
  kept_.reserve(2 * kMost);
  off_map_.reserve(kMost);
  run_m_.reserve(kMost + 1);
}

void HitMemory::add(const FreeBeams& sight, double reach_m, std::int64_t now_ns) {
  const Eigen::Vector2d& p_m = sight.T_world_sensor.translation_m;
  // Pieces of this scan.
  kept_.clear();
  Eigen::Vector2d begin_m = p_m, before_m = p_m;
  bool is_open = false, has_piece = false;
  const auto end = [&] {
    if (is_open && ((before_m - begin_m).norm() > 1e-3 || !has_piece)) {
      const Eigen::Vector2d out_m = before_m - p_m;
      const Eigen::Vector2d half_m = 0.5 * sight.step_rad * left_of(out_m);
      const bool is_slim = !has_piece && (before_m - begin_m).norm() < 2.0 * half_m.norm();
      if (is_slim && half_m.norm() > 0.0) {
        const Eigen::Vector2d middle_m = 0.5 * (begin_m + before_m);
        kept_.push_back({middle_m - half_m, middle_m + half_m, now_ns});
      } else {
        kept_.push_back({begin_m, before_m, now_ns});
      }
    }
    is_open = has_piece = false;
  };
  for (const Eigen::Vector2d& hit_m : sight.hits_world_m) {
    const bool counts = (hit_m - p_m).norm() < reach_m;
    if (is_open && (!counts || (hit_m - before_m).norm() > kGap_m)) end();
    if (!counts) continue;
    if (!is_open) {
      begin_m = hit_m;
      is_open = true;
    } else if ((hit_m - begin_m).norm() > kSpacing_m) {
      kept_.push_back({begin_m, hit_m, now_ns});
      begin_m = hit_m;
      has_piece = true;
    }
    before_m = hit_m;
  }
  end();
  // Of those before what is neither hit again nor shown not to be there.
  const std::size_t of_scan = kept_.size();
  for (const Piece& piece : pieces_) {
    if (seconds_between(piece.seen_ns, now_ns) >= kKept_s) continue;
    const Eigen::Vector2d middle_m = 0.5 * (piece.from_m + piece.to_m);
    if (shows_free(sight, middle_m)) continue;
    const bool is_hit_again = std::any_of(
        kept_.begin(), kept_.begin() + static_cast<std::ptrdiff_t>(of_scan),
        [&](const Piece& other) { return (0.5 * (other.from_m + other.to_m) - middle_m).norm() < kSpacing_m; });
    if (!is_hit_again) kept_.push_back(piece);
  }
  // The latest come first.
  if (kept_.size() > kMost) kept_.erase(kept_.begin() + kMost, kept_.end());
  pieces_.assign(kept_.begin(), kept_.end());
}

void HitMemory::add_to(Obstacles& obstacles, std::int64_t now_ns, bool maps_count) {
  kept_.clear();
  off_map_.clear();
  for (const Piece& piece : pieces_) {
    if (seconds_between(piece.seen_ns, now_ns) >= kKept_s) continue;
    const bool is_on_map =
        distance_m(obstacles, piece.from_m) <= kOnMap_m && distance_m(obstacles, piece.to_m) <= kOnMap_m;
    if (is_on_map && maps_count) continue;
    if (!is_on_map) off_map_.push_back(kept_.size());
    kept_.push_back(piece);
  }
  pieces_.assign(kept_.begin(), kept_.end());
  // Pieces that follow each other are one outline.
  run_m_.clear();
  for (const std::size_t i : off_map_) {
    const Piece& piece = pieces_[i];
    if (run_m_.empty() || piece.from_m != run_m_.back()) {
      obstacles.add(run_m_, false, kSigma_m, ObstacleKind::kHits, 0);
      run_m_.assign(1, piece.from_m);
    }
    run_m_.push_back(piece.to_m);
  }
  obstacles.add(run_m_, false, kSigma_m, ObstacleKind::kHits, 0);
}

}  // namespace situation_awareness
