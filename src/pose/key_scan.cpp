// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/key_scan.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// A surface is fitted to the hits on each side of one up to this distance, at least and at most so many. With three
/// neighbours at any distance, within 2 cm of a line, a minute of the demo with an RPLidar A2 has 2 to 7 windows of
/// motion, in place of about 30.
constexpr double kHalfLength_m = 0.1;
constexpr double kMinNeighbours = 3.0;
constexpr double kMaxNeighbours = 12.0;
/// From beam to beam; one of 0 has no spacing.
constexpr double kLeastStep_rad = 1e-6;
/// Of these hits from each other, beside the spacing of their beams, and from a line, absolutely and relative to their
/// extent: more is an edge or a corner.
constexpr double kMaxGap_m = 0.1;
constexpr double kMaxGapSteps = 3.5;
constexpr double kMaxRms_m = 0.05;
constexpr double kMaxRelativeRms = 0.2;
/// Cosine between beam and normal: the place of a surface at grazing incidence is uncertain.
constexpr double kMinIncidence = 0.2;

constexpr std::size_t kMaxHits = ScanMatch::kMaxHits;
constexpr int kIterations = 4;
/// Between a hit and its surface; the first iterations start from a guess.
constexpr double kMaxDistance_m = 0.25;
constexpr double kMaxLastDistance_m = 0.1;
/// Cells of azimuth on each side in which the surface of a hit is looked for.
constexpr int kSearchCells = 6;
/// Least spread of the hits about the surfaces, since ranges of neighbouring beams share errors.
constexpr double kMinSpread_m = 0.003;
constexpr int kMinPairs = 30;
/// Of the hits near a surface within the spread of it; below, too much has moved or is new.
constexpr double kMinAgreeing = 0.6;
/// Of the hits that are matched with a surface; below, the scans have too little in common.
constexpr double kMinPaired = 0.5;
/// Inverse variance of the guess, in 1/m^2 and 1/rad^2, which decides where the surfaces do not.
constexpr double kGuessInformation = 100.0;

int cell_of(const Eigen::Vector2d& p, int cells) {
  const double turn = (std::atan2(p.y(), p.x()) + kPi) / (2.0 * kPi);
  return std::min(static_cast<int>(turn * cells), cells - 1);
}

/// The surface through neighbouring hits; false if they are not on a line or it is seen at grazing incidence.
bool fit_normal(const Eigen::Vector2d* first, std::size_t count, const Eigen::Vector2d& p, Eigen::Vector2d& normal) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < count; ++i) mean += first[i];
  mean /= static_cast<double>(count);
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d d = first[i] - mean;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  const double along_rad = 0.5 * std::atan2(2.0 * xy, xx - yy);
  normal = {-std::sin(along_rad), std::cos(along_rad)};
  const double half_trace = 0.5 * (xx + yy);
  const double least = half_trace - std::hypot(0.5 * (xx - yy), xy);
  const double rms_m = std::sqrt(std::max(least, 0.0) / static_cast<double>(count));
  const double extent_m = (first[count - 1] - first[0]).norm();
  return rms_m <= std::min(kMaxRms_m, kMaxRelativeRms * extent_m) &&
         std::abs(normal.dot(p)) >= kMinIncidence * p.norm();
}

}  // namespace

void KeyScan::set(const Points& points) {
  for (Surface& surface : surfaces_) surface.is_valid = false;
  hits_m_.clear();
  for (const Point& point : points.points) {
    if (is_hit(point.state)) hits_m_.push_back(point.p_level_m);
  }
  const double step_rad = std::max(points.resolution_rad, kLeastStep_rad);
  for (std::size_t begin = 0, end = 0; begin < hits_m_.size(); begin = end) {
    for (end = begin + 1; end < hits_m_.size(); ++end) {
      const double max_gap_m = kMaxGap_m + kMaxGapSteps * step_rad * hits_m_[end].norm();
      if ((hits_m_[end] - hits_m_[end - 1]).norm() > max_gap_m) break;
    }
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d& p_m = hits_m_[i];
      const double neighbours = kHalfLength_m / (step_rad * std::max(p_m.norm(), kHalfLength_m));
      const auto side = static_cast<std::size_t>(std::clamp(neighbours, kMinNeighbours, kMaxNeighbours));
      const std::size_t from = i - std::min(i - begin, side);
      const std::size_t to = std::min(i + side + 1, end);
      if (to - from <= side) continue;
      Surface& surface = surfaces_[static_cast<std::size_t>(cell_of(p_m, kCells))];
      surface.is_valid = fit_normal(&hits_m_[from], to - from, p_m, surface.normal);
      surface.p_m = p_m;
    }
  }
}

const KeyScan::Surface* KeyScan::nearest(const Eigen::Vector2d& p_m, double max_distance_m) const {
  const Surface* best = nullptr;
  double least = max_distance_m * max_distance_m;
  const int middle = cell_of(p_m, kCells);
  for (int k = -kSearchCells; k <= kSearchCells; ++k) {
    const Surface& surface = surfaces_[static_cast<std::size_t>((middle + k + kCells) % kCells)];
    if (!surface.is_valid) continue;
    const double distance2 = (surface.p_m - p_m).squaredNorm();
    if (distance2 > least) continue;
    least = distance2;
    best = &surface;
  }
  return best;
}

ScanMatch KeyScan::match(const Points& points, const Pose2& guess) const {
  struct Pair {
    Eigen::Vector3d gradient;  // of the offset by the error
    double offset_m;
  };
  std::array<Pair, kMaxHits> pairs;
  std::array<double, kMaxHits> sizes_m;
  // Evenly spread over the hits.
  const auto all = static_cast<std::size_t>(std::count_if(points.points.begin(), points.points.end(),
                                                          [](const Point& point) { return is_hit(point.state); }));
  const std::size_t stride = (all + kMaxHits - 1) / kMaxHits;

  ScanMatch result;
  result.T_key_level = guess;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const bool is_last = iteration + 1 == kIterations;
    const double max_distance_m = iteration < 2 ? kMaxDistance_m : kMaxLastDistance_m;
    const Eigen::Matrix2d R_key_level = result.T_key_level.rotation();
    std::size_t seen = 0, hits = 0, count = 0;
    for (const Point& point : points.points) {
      if (!is_hit(point.state) || seen++ % stride != 0) continue;
      ++hits;
      const Eigen::Vector2d& p = point.p_level_m;
      const Eigen::Vector2d p_key = R_key_level * p + result.T_key_level.translation_m;
      const Surface* const surface = nearest(p_key, max_distance_m);
      if (surface == nullptr) continue;
      const Eigen::Vector2d normal = R_key_level.transpose() * surface->normal;
      result.hits[count].beam = point.beam;
      pairs[count] = {{normal.x(), normal.y(), p.x() * normal.y() - p.y() * normal.x()},
                      surface->normal.dot(p_key - surface->p_m)};
      sizes_m[count] = std::abs(pairs[count].offset_m);
      ++count;
    }
    if (count < kMinPairs) return result;
    std::nth_element(sizes_m.begin(), sizes_m.begin() + static_cast<std::ptrdiff_t>(count / 2),
                     sizes_m.begin() + static_cast<std::ptrdiff_t>(count));
    const double spread_m = std::max(1.4826 * sizes_m[count / 2], kMinSpread_m);

    // Tukey's biweight: what is far off has no weight.
    const double limit_m = 4.0 * spread_m;
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    std::size_t agreeing = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double part = pairs[i].offset_m / limit_m;
      if (std::abs(part) >= 1.0) continue;
      if (std::abs(part) < 0.5) ++agreeing;
      const double weight = (1.0 - part * part) * (1.0 - part * part) / (spread_m * spread_m);
      H += weight * pairs[i].gradient * pairs[i].gradient.transpose();
      b -= weight * pairs[i].offset_m * pairs[i].gradient;
    }
    if (is_last) {
      result.count = count;
      for (std::size_t i = 0; i < count; ++i) result.hits[i].offset_m = static_cast<float>(pairs[i].offset_m);
      result.information = H;
      result.is_valid = static_cast<double>(count) >= kMinPaired * static_cast<double>(hits) &&
                        static_cast<double>(agreeing) >= kMinAgreeing * static_cast<double>(count);
      return result;
    }
    const Eigen::Vector3d step = (H + kGuessInformation * Eigen::Matrix3d::Identity()).ldlt().solve(b);
    if (!step.allFinite()) return result;
    result.T_key_level = result.T_key_level * Pose2{step.head<2>(), step.z()};
  }
  return result;
}

}  // namespace situation_awareness
