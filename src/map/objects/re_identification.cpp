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

/// Number of the sorted shapes that are the same as `shape`, up to `enough`.
int count_same(const ElementShape& shape, const std::vector<ElementShape>& sorted, int enough) {
  const auto is_same = [](double a, double b) { return std::abs(a - b) <= kSameShape_m; };
  const double margin_m = 2.0 * kSameShape_m;  // against rounding
  auto other = std::lower_bound(sorted.begin(), sorted.end(), ElementShape{shape.first - margin_m, 0.0});
  int count = 0;
  for (; count < enough && other != sorted.end() && other->first <= shape.first + margin_m; ++other) {
    count += is_same(other->first, shape.first) && is_same(other->second, shape.second) ? 1 : 0;
  }
  return count;
}

}  // namespace

ElementShape element_shape(const MapElement& element) {
  const Vector8d& x = likelier(element.estimate).x;
  return {x(kShape), x.tail<2>().norm()};
}

const std::vector<char>& CommonShapes::find(const std::vector<MapElement>& elements,
                                            const std::vector<ElementShape>& others, double least_sigma_m) {
  assign_with_room(common_, elements.size(), 0);
  asked_.clear();
  asked_.reserve(kUsualRoom);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].state == TrackState::kTentative) continue;
    const double variance_m2 = likelier(elements[i].estimate).P.block<2, 2>(kPosition, kPosition).trace();
    // The trace bounds the variance in each direction; NaN is asked for, too.
    if (least_sigma_m < 0.0 || !(variance_m2 <= least_sigma_m * least_sigma_m)) asked_.push_back(i);
  }
  if (asked_.empty()) return common_;
  shapes_.clear();
  shapes_.reserve(kUsualRoom);
  for (const MapElement& element : elements) {
    if (element.state != TrackState::kTentative) shapes_.push_back(element_shape(element));
  }
  std::sort(shapes_.begin(), shapes_.end());
  for (const std::size_t i : asked_) {
    const ElementShape shape = element_shape(elements[i]);
    const int enough = kManyOfAShape + 1;  // with itself
    const int same = count_same(shape, shapes_, enough);
    common_[i] = same + count_same(shape, others, enough - same) >= enough ? 1 : 0;
  }
  return common_;
}

void re_identify(const std::vector<std::size_t>& newly_confirmed, const std::vector<char>& common_shape, double gate,
                 std::int64_t stamp_ns, std::vector<MapElement>& elements) {
  const MeasuringFrame world(Pose2{});
  for (const std::size_t i : newly_confirmed) {
    MapElement& found = elements[i];
    const ObjectEstimate estimate = combine(found.estimate);
    Measurement as_measurement;
    const Matrix58d H = world.jacobian(0.0);
    as_measurement.z = world.measure(estimate.x, 0.0);
    as_measurement.R = H * estimate.P * H.transpose();
    MapElement* best = nullptr;
    double most = kLogNewObjectDensity;
    for (std::size_t j = 0; j < i; ++j) {  // ids are ascending: lost elements come first
      MapElement& lost = elements[j];
      if (lost.state != TrackState::kLost || lost.is_part || differ_in_shape(lost, found)) continue;
      const MotionMatch candidate = match(lost.estimate, world, as_measurement, Eigen::Matrix3d::Zero());
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
