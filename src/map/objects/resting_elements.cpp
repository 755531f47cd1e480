// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/resting_elements.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/existence.hpp"
#include "situation_awareness/map/objects/rates.hpp"
#include "situation_awareness/map/objects/shape_belief.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

/// s. An element that has stood for longer begins to move at start_rate_1_s. No test bounds it. In flights half of
/// it raises the false elements per 1,000 scans from 8 to 109.
constexpr double kSettled_s = 1.5;
/// m^2. What is less certain than this does not rest: the reach of its gate would be large.
constexpr double kMaxVariance_m2 = 0.25;
/// Factor on the variance at which a lost element is deleted.
constexpr double kBeforeDeletion = 0.8;
/// s. Rest ends by so much before it has to, against rounding.
constexpr double kBefore_s = 1e-3;
/// s. No element is kept for so long.
constexpr double kForEver_s = 1e8;

/// Sectors of azimuth, of each of which the longest beam is looked up.
constexpr int kSectors = 512;
/// rad. Error of rough_azimuth.
constexpr double kRough_rad = 0.005;
/// m. What reaches so near is looked at, against rounding.
constexpr double kRestRounding_m = 1e-6;
/// m. An element that covers another may move by so much within a scan.
constexpr double kCoverMargin_m = 0.5;

double position_variance_m2(const ObjectEstimate& estimate) {
  return estimate.P.block<2, 2>(kPosition, kPosition).trace();
}

/// Azimuth to kRough_rad.
double rough_azimuth_rad(const Eigen::Vector2d& p) {
  const double x = std::abs(p.x());
  const double y = std::abs(p.y());
  const double most = std::max(x, y);
  if (!(most > 0.0)) return 0.0;
  const double ratio = std::min(x, y) / most;
  double azimuth_rad = ratio * (0.25 * kPi + 0.273 * (1.0 - ratio));
  if (y > x) azimuth_rad = 0.5 * kPi - azimuth_rad;
  if (p.x() < 0.0) azimuth_rad = kPi - azimuth_rad;
  return p.y() < 0.0 ? -azimuth_rad : azimuth_rad;
}

int sector_of(double azimuth_rad) {
  return static_cast<int>(std::floor((azimuth_rad + kPi) * (kSectors / (2.0 * kPi))));
}

std::size_t wrapped(int sector) { return static_cast<std::size_t>(((sector % kSectors) + kSectors) % kSectors); }

}  // namespace

bool is_settled(const MapElement& element) { return !element.mobile && element.stood_s > kSettled_s; }

RestingPlace resting_place(const MapElement& element, std::int64_t stamp_ns) {
  return {ellipse_world(element.estimate.standing.x), position_variance_m2(element.estimate.standing), stamp_ns,
          is_box(element)};
}

std::int64_t end_of_rest_ns(const MapElement& element, std::int64_t stamp_ns, const ObjectMapParams& params) {
  constexpr std::int64_t kNever_ns = std::numeric_limits<std::int64_t>::min();
  const MotionEstimate& estimate = element.estimate;
  if (element.state != TrackState::kLost || !is_settled(element) || is_person(element)) return kNever_ns;
  if (!(estimate.p_moving < 0.5) || !is_out_of_sight(element, stamp_ns)) return kNever_ns;
  if (element.is_part || element.has_parts || element.beams != 0 || !has_no_rates(estimate.standing)) return kNever_ns;
  if (element.log_odds < log_odds(params.deletion_probability)) return kNever_ns;
  const double most_m2 = std::min(kMaxVariance_m2, kBeforeDeletion * std::pow(params.lost_position_sigma_m, 2));
  const double room_m2 = most_m2 - position_variance_m2(estimate.standing);
  if (!(room_m2 > 0.0)) return kNever_ns;
  const double growth_m2_s = 2.0 * params.standing_drift_m * params.standing_drift_m;
  const double certain_s = growth_m2_s * kForEver_s > room_m2 ? room_m2 / growth_m2_s : kForEver_s;
  const double kept_s = std::min(params.max_unseen_s, kForEver_s);
  return std::min(stamp_ns + nanoseconds(certain_s), element.last_seen_ns + nanoseconds(kept_s - kBefore_s));
}

MotionParams motion_at_rest(const MotionParams& motion) {
  MotionParams result = motion;
  result.start_rate_1_s = result.stop_rate_1_s = 0.0;
  return result;
}

void RestingElements::clear() {
  slots_.clear();
  free_.clear();
  by_x_.clear();
  by_id_.clear();
  shapes_.clear();
  next_end_ns_ = 0;
  largest_radius_m_ = 0.0;
}

void RestingElements::add(const MapElement& element, const RestingPlace& place, std::int64_t end_ns) {
  slots_.reserve(kUsualRoom);
  free_.reserve(kUsualRoom);
  by_x_.reserve(kUsualRoom);
  by_id_.reserve(kUsualRoom);
  shapes_.reserve(kUsualRoom);
  std::size_t slot = slots_.size();
  if (free_.empty()) {
    slots_.push_back(element);
  } else {
    slot = free_.back();
    free_.pop_back();
    slots_[slot] = element;
  }
  const Entry entry{place, end_ns, element.id, slot, false};
  by_x_.insert(first_from(entry.x_m()), entry);
  const auto after = std::upper_bound(by_id_.begin(), by_id_.end(), element.id,
                                      [](std::uint64_t id, const ById& other) { return id < other.id; });
  by_id_.insert(after, {element.id, slot});
  const ElementShape shape = element_shape(element);
  shapes_.insert(std::upper_bound(shapes_.begin(), shapes_.end(), shape), shape);
  next_end_ns_ = by_id_.size() == 1 ? end_ns : std::min(next_end_ns_, end_ns);
  largest_radius_m_ = std::max(largest_radius_m_, place.ellipse_world.rx_m);
}

std::vector<RestingElements::Entry>::iterator RestingElements::first_from(double x_m) {
  return std::lower_bound(by_x_.begin(), by_x_.end(), x_m,
                          [](const Entry& entry, double wanted_m) { return entry.x_m() < wanted_m; });
}

/// In steps within which the bound of the orientation's uncertainty does not matter, as in those from scan to scan.
void RestingElements::bring_to(Entry& entry, std::int64_t stamp_ns, const MotionParams& motion) {
  if (entry.place.stamp_ns == stamp_ns) return;
  MotionEstimate& estimate = slots_[entry.slot].estimate;
  double left_s = seconds_between(entry.place.stamp_ns, stamp_ns);
  while (left_s > 0.0) {
    const double step_s = longest_step_s(estimate.moving, left_s, motion.moving);
    predict(estimate, step_s, motion);
    left_s -= step_s;
  }
  entry.place.stamp_ns = stamp_ns;
  entry.place.variance_m2 = position_variance_m2(estimate.standing);
}

void RestingElements::bring_to(std::int64_t stamp_ns, const MotionParams& motion) {
  for (Entry& entry : by_x_) bring_to(entry, stamp_ns, motion);
}

void RestingElements::mark_ended(std::int64_t stamp_ns) {
  if (by_x_.empty() || stamp_ns < next_end_ns_) return;
  next_end_ns_ = std::numeric_limits<std::int64_t>::max();
  for (Entry& entry : by_x_) {
    if (entry.end_ns <= stamp_ns) {
      entry.is_marked = true;
    } else {
      next_end_ns_ = std::min(next_end_ns_, entry.end_ns);
    }
  }
}

void RestingElements::mark_all() {
  for (Entry& entry : by_x_) entry.is_marked = true;
}

void RestingElements::give_marked(std::int64_t stamp_ns, const MotionParams& motion,
                                  std::vector<MapElement>& elements) {
  leaving_.clear();
  leaving_.reserve(kUsualRoom);
  std::size_t kept = 0;
  for (Entry& entry : by_x_) {
    if (!entry.is_marked) {
      by_x_[kept++] = entry;
      continue;
    }
    bring_to(entry, stamp_ns, motion);
    leaving_.push_back({entry.id, entry.slot});
  }
  if (leaving_.empty()) return;
  by_x_.resize(kept);
  const auto by_id = [](const ById& a, const ById& b) { return a.id < b.id; };
  std::sort(leaving_.begin(), leaving_.end(), by_id);
  auto leaving = leaving_.cbegin();
  by_id_.erase(std::remove_if(by_id_.begin(), by_id_.end(),
                              [&](const ById& entry) {
                                const bool leaves = leaving != leaving_.cend() && leaving->id == entry.id;
                                if (leaves) ++leaving;
                                return leaves;
                              }),
               by_id_.end());

  // Merged from behind.
  std::size_t from = elements.size();
  std::size_t to = from + leaving_.size();
  elements.resize(to);
  for (auto last = leaving_.crbegin(); last != leaving_.crend(); ++last) {
    const MapElement& element = slots_[last->slot];
    while (from > 0 && elements[from - 1].id > element.id) elements[--to] = elements[--from];
    elements[--to] = element;
    shapes_.erase(std::lower_bound(shapes_.begin(), shapes_.end(), element_shape(element)));
    free_.push_back(last->slot);
  }
}

void ScanNeeds::make_room(std::size_t detections, std::size_t elements) {
  sectors_m_.reserve(kSectors);
  situation_awareness::make_room(reaches_, detections);
  situation_awareness::make_room(covers_, elements);
}

void ScanNeeds::set(const Detections& detections, const std::vector<Measurement>& measurements,
                    const Eigen::Matrix3d& U, double gate, double drift_m, const std::vector<MapElement>& elements) {
  detections_ = &detections;
  T_level_world_ = inverse(detections.T_world_level);
  R_level_world_ = T_level_world_.rotation();
  gate_ = gate;
  drift_m_ = drift_m;
  make_room(measurements.size(), elements.size());
  set_sectors();
  reaches_.clear();
  for (std::size_t j = 0; j < measurements.size(); ++j) {
    const Eigen::Vector2d center_level_m = measurements[j].z.head<2>();
    const double variance_m2 = measurements[j].R.topLeftCorner<2, 2>().trace() + U.topLeftCorner<2, 2>().trace() +
                               center_level_m.squaredNorm() * U(2, 2);
    reaches_.push_back(
        {detections.T_world_level * center_level_m, variance_m2, detections.detections[j].ellipse_level.rx_m});
  }
  covers_.clear();
  for (const MapElement& element : elements) {
    if (element.state != TrackState::kConfirmed || element.mobile) continue;
    const Vector8d& x = element.estimate.standing.x;
    covers_.push_back({x.segment<2>(kPosition), x(kShape) + x.segment<2>(kShape + 1).norm() + kCoverMargin_m});
  }
}

void ScanNeeds::set_sectors() {
  const FreeSpace& free_space = detections_->free_space;
  sectors_m_.assign(kSectors, -std::numeric_limits<float>::infinity());
  farthest_m_ = 0.0;
  half_spacing_rad_ = 0.0;
  const std::size_t n = free_space.azimuth_rad.size();
  if (n < 2) return;
  half_spacing_rad_ = 0.5 * static_cast<double>(free_space.azimuth_rad.back() - free_space.azimuth_rad.front()) /
                      static_cast<double>(n - 1);
  for (std::size_t i = 0; i < n; ++i) {
    float& longest_m = sectors_m_[wrapped(sector_of(static_cast<double>(free_space.azimuth_rad[i])))];
    longest_m = std::max(longest_m, free_space.range_m[i]);
    farthest_m_ = std::max(farthest_m_, static_cast<double>(free_space.range_m[i]));
  }
}

/// Whether a beam reaches it that look_at counts: a bound, much faster than that.
bool ScanNeeds::may_see(const RestingPlace& place) const {
  const double radius_m = place.ellipse_world.rx_m + kSightMargin_m + kRestRounding_m;
  const Eigen::Vector2d p_m = R_level_world_ * place.ellipse_world.center_m + T_level_world_.translation_m;
  const double distance_m = p_m.norm();
  if (distance_m - radius_m > farthest_m_) return false;
  if (distance_m <= radius_m) return true;
  const double half_rad = std::max(radius_m / distance_m, half_spacing_rad_) + kRough_rad;
  if (half_rad >= kPi) return true;
  const double azimuth_rad = rough_azimuth_rad(p_m);
  const int last = sector_of(azimuth_rad + half_rad);
  for (int sector = sector_of(azimuth_rad - half_rad); sector <= last; ++sector) {
    if (static_cast<double>(sectors_m_[wrapped(sector)]) >= distance_m - radius_m) return true;
  }
  return false;
}

bool ScanNeeds::sees(const RestingPlace& place) const {
  return may_see(place) &&
         look_at(T_level_world_ * place.ellipse_world, detections_->free_space, kSightMargin_m) != Sight::kHidden;
}

/// Whether a detection may be of the element, by its gate, or a new element of this detection may be. The variance of
/// that, whose motion is not certain, is up to (1 + gate) times that of the detection, which is as far from its mean as
/// the gate allows.
bool ScanNeeds::is_near(const Reach& reach, const RestingPlace& place) const {
  const double since_s = std::max(0.0, seconds_between(place.stamp_ns, detections_->stamp_ns));
  const double variance_m2 = place.variance_m2 + 2.0 * drift_m_ * drift_m_ * since_s;
  const double reach_m = std::sqrt(gate_ * ((1.0 + gate_) * reach.variance_m2 + variance_m2)) +
                         std::sqrt(gate_ * reach.variance_m2) + reach.radius_m;
  return (place.ellipse_world.center_m - reach.center_world_m).squaredNorm() <= reach_m * reach_m;
}

/// A standing box on which something larger is seen is a piece of that.
bool ScanNeeds::is_under(const Cover& cover, const RestingPlace& place) {
  return place.is_box &&
         (place.ellipse_world.center_m - cover.center_world_m).squaredNorm() <= cover.radius_m * cover.radius_m;
}

bool ScanNeeds::needs(const RestingPlace& place) const {
  return std::any_of(reaches_.begin(), reaches_.end(), [&](const Reach& reach) { return is_near(reach, place); }) ||
         std::any_of(covers_.begin(), covers_.end(), [&](const Cover& cover) { return is_under(cover, place); }) ||
         sees(place);
}

void ScanNeeds::mark(RestingElements& resting) const {
  if (resting.empty()) return;
  const Eigen::Vector2d& sensor_world_m = detections_->T_world_level.translation_m;
  resting.mark_within(sensor_world_m.x(), farthest_m_ + resting.largest_radius_m() + kSightMargin_m + kRestRounding_m,
                      [this](const RestingPlace& place) { return sees(place); });
  for (const Reach& reach : reaches_) {
    const double most_m = std::sqrt(gate_ * ((1.0 + gate_) * reach.variance_m2 + 2.0 * kMaxVariance_m2)) +
                          std::sqrt(gate_ * reach.variance_m2) + reach.radius_m;
    resting.mark_within(reach.center_world_m.x(), most_m,
                        [&](const RestingPlace& place) { return is_near(reach, place); });
  }
  for (const Cover& cover : covers_) {
    resting.mark_within(cover.center_world_m.x(), cover.radius_m,
                        [&](const RestingPlace& place) { return is_under(cover, place); });
  }
}

}  // namespace situation_awareness
