// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/re_identification.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/count.hpp"
#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/map/objects/association.hpp"
#include "situation_awareness/map/objects/shape_belief.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

/// m. Shapes whose (rx + ry) / 2 and |(p, q)| differ by no more do not distinguish objects. No source is recorded. From
/// 0.01 to 0.014 by re_identification_test; in flights half and twice it change no figure beyond chance.
constexpr double kSameShape_m = 0.01;
/// Number of other elements of a shape that makes it a common one. No source is recorded; the tests assert this value.
/// In flights 2 and 6 change no figure beyond chance.
constexpr int kManyOfAShape = 3;

}  // namespace

const std::vector<char>& CommonShapes::find(const std::vector<MapElement>& elements) {
  assign_with_room(common_, elements.size(), 0);
  by_mean_radius_m_.clear();
  by_mean_radius_m_.reserve(kUsualRoom);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].state == TrackState::kTentative) continue;
    by_mean_radius_m_.emplace_back(likelier(elements[i].estimate).x(kShape), i);
  }
  std::sort(by_mean_radius_m_.begin(), by_mean_radius_m_.end());
  const auto mean_radius_m = [&](std::size_t k) { return by_mean_radius_m_[k].first; };
  const auto half_difference_m = [&](std::size_t k) {
    return likelier(elements[by_mean_radius_m_[k].second].estimate).x.tail<2>().norm();
  };
  for (std::size_t k = 0; k < by_mean_radius_m_.size(); ++k) {
    const auto same_radius = [&](std::size_t other) {
      return std::abs(mean_radius_m(other) - mean_radius_m(k)) <= kSameShape_m;
    };
    const auto same_shape = [&](std::size_t other) {
      return std::abs(half_difference_m(other) - half_difference_m(k)) <= kSameShape_m;
    };
    int others = 0;
    for (std::size_t j = k; others < kManyOfAShape && j-- > 0 && same_radius(j);) others += same_shape(j) ? 1 : 0;
    for (std::size_t j = k + 1; others < kManyOfAShape && j < by_mean_radius_m_.size() && same_radius(j); ++j) {
      others += same_shape(j) ? 1 : 0;
    }
    common_[by_mean_radius_m_[k].second] = others >= kManyOfAShape ? 1 : 0;
  }
  return common_;
}

void re_identify(const std::vector<std::size_t>& newly_confirmed, const std::vector<char>& common_shape, double gate,
                 std::int64_t stamp_ns, std::vector<MapElement>& elements) {
  for (const std::size_t i : newly_confirmed) {
    MapElement& found = elements[i];
    const ObjectEstimate estimate = combine(found.estimate);
    Measurement as_measurement;
    const Matrix58d H = measurement_jacobian({}, 0.0);
    as_measurement.z = measure(estimate.x, {}, 0.0);
    as_measurement.R = H * estimate.P * H.transpose();
    MapElement* best = nullptr;
    double most = kLogNewObjectDensity;
    for (std::size_t j = 0; j < i; ++j) {  // ids are ascending: lost elements come first
      MapElement& lost = elements[j];
      if (lost.state != TrackState::kLost || lost.is_part || differ_in_shape(lost, found)) continue;
      const MotionMatch candidate = match(lost.estimate, {}, as_measurement, Eigen::Matrix3d::Zero());
      const bool common = j < common_shape.size() && common_shape[j] != 0;
      if (*match_defect(lost, candidate, gate, common, stamp_ns) != '\0' || !(candidate.log_likelihood > most))
        continue;
      most = candidate.log_likelihood;
      best = &lost;
    }
    if (best == nullptr) continue;
    best->estimate = found.estimate;
    best->log_odds = found.log_odds;
    best->state = TrackState::kConfirmed;
    best->last_seen_ns = found.last_seen_ns;
    best->beams = found.beams;
    count_more(best->observations, found.observations);
    found.state = TrackState::kDeleted;
  }
}

}  // namespace situation_awareness
