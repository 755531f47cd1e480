// SPDX-License-Identifier: BSD-3-Clause
#include "class_columns.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace situation_awareness {
namespace {

constexpr double kHeightStep_m = 0.25;

}  // namespace

ClassColumns::ClassColumns(double class_height_m, double offset_step_m)
    : heights_(std::max(1, static_cast<int>(std::lround(class_height_m / kHeightStep_m)))),
      height_step_m_(class_height_m / heights_) {
  steps_per_offset_ = std::max(1, static_cast<int>(std::lround(offset_step_m / height_step_m_)));
  soft_.resize(static_cast<std::size_t>((GridMap::kOffsets - 1) * steps_per_offset_ + heights_ + 1));
  for (std::vector<float>* const values : {&sharp_, &least_, &greatest_, &soft_least_}) values->resize(soft_.size());
  known_.resize(soft_.size());
}

bool ClassColumns::read(const LabelReader& reader, const Eigen::Vector3d& foot, const Eigen::Vector3d& up) {
  return reader.read_column(foot, up, -offset_m(GridMap::kOffsets - 1), height_step_m_, sharp_, soft_);
}

/// Finds the extremes from each step of all heights on; those from the last foot on are of no use.
void ClassColumns::find_extremes(double hidden_below_m) {
  const std::size_t count = sharp_.size();
  for (std::size_t i = 0; i < count; ++i) {
    least_[i] = soft_least_[i] = 1.0F;
    greatest_[i] = 0.0F;
    known_[i] = 0;
  }
  for (int h = 0; h <= heights_; ++h) {
    if (h * height_step_m_ < hidden_below_m) continue;
    const float *const sharp = sharp_.data() + h, *const soft = soft_.data() + h;
    float *const least = least_.data(), *const greatest = greatest_.data(), *const soft_least = soft_least_.data();
    std::int32_t* const known = known_.data();
#pragma GCC ivdep
    for (std::size_t i = 0; i < count - static_cast<std::size_t>(h); ++i) {
      const float value = sharp[i], soft_value = std::isnan(value) ? 1.0F : soft[i];
      least[i] = value < least[i] ? value : least[i];
      greatest[i] = greatest[i] < value ? value : greatest[i];
      soft_least[i] = soft_value < soft_least[i] ? soft_value : soft_least[i];
      known[i] += std::isnan(value) ? 0 : 1;
    }
  }
}

}  // namespace situation_awareness
