// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/inertial_history.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// What the force is on average: an error of the scale that stays goes into the bias.
constexpr double kMeanForce_s = 20.0;
/// Over which the noise of the IMU is measured.
constexpr double kNoiseWindow_s = 5.0;
constexpr std::array<int, 3> kNoiseBlocks = {1, 4, 16};
/// Rate of the IMU for which there is room from the begin on.
constexpr double kUsualRate_hz = 250.0;
/// A longer gap of the samples ends a block.
constexpr double kStandingGap_s = 0.5;
/// What stands: means of blocks of the force that differ by less, as a start by 0.25 m/s would make them, and a rate
/// that a bias can be.
constexpr double kStandingForceChange_m_s2 = 0.03, kMostBias_rad_s = 0.05;

}  // namespace

InertialHistory::InertialHistory(double duration_s, double most_hz, double standing_change_rad_s)
    : duration_s_(duration_s),
      standing_change_rad_s_(standing_change_rad_s),
      most_(static_cast<std::size_t>(std::ceil(duration_s * most_hz)) + 2),
      samples_(std::min(most_, static_cast<std::size_t>(std::ceil(duration_s * kUsualRate_hz)) + 2)) {
  clear();
}

bool InertialHistory::is_short() const {
  return is_full() && seconds_between((*this)[begin()].stamp_ns, latest().stamp_ns) < duration_s_;
}

void InertialHistory::grow() {
  const std::uint64_t first = begin();
  std::vector<Entry> more(std::min(2 * samples_.size(), most_));
  for (std::uint64_t i = first; i < end_; ++i) more[static_cast<std::size_t>(i % more.size())] = (*this)[i];
  samples_.swap(more);
  begin_ = first;
}

void InertialHistory::Blocks::add(const InertialSample& sample, double period_s) {
  sum.head<3>() += sample.specific_force_m_s2;
  sum.tail<3>() += sample.angular_velocity_rad_s;
  if (++count < length) return;
  const Eigen::Matrix<double, 6, 1> mean = sum / count;
  if (whole == 2) {
    // Of white noise the difference has 1.5 times the variance of a mean.
    const Eigen::Matrix<double, 6, 1> apart = last - 0.5 * (last_but_one + mean);
    const double block_s = length * period_s;
    duration_s = std::min(duration_s + block_s, kNoiseWindow_s);
    densities += block_s / duration_s * (apart.cwiseAbs2() * block_s / 1.5 - densities);
  } else {
    ++whole;
  }
  last_but_one = last;
  last = mean;
  sum.setZero();
  count = 0;
}

void InertialHistory::add(const InertialSample& sample) {
  const double period_s = empty() ? 0.0 : seconds_between(latest().stamp_ns, sample.stamp_ns);
  if (is_short() && samples_.size() < most_) grow();
  Entry& entry = samples_[static_cast<std::size_t>(end_++ % samples_.size())];
  static_cast<InertialSample&>(entry) = sample;
  add_to_block(entry, period_s);
  if (end_ - begin_ == 1) mean_force_m_s2_ = sample.specific_force_m_s2;
  const Eigen::Vector3d change_m_s2 = sample.specific_force_m_s2 - mean_force_m_s2_;
  mean_force_m_s2_ += std::min(period_s / kMeanForce_s, 1.0) * change_m_s2;
  force_variance_ += std::min(period_s / kForceChange_s, 1.0) * (change_m_s2.squaredNorm() - force_variance_);
  entry.force_change_m_s2 = std::sqrt(force_variance_);
  if (period_s <= 0.0) return;
  Eigen::Matrix<double, 6, 1> least = Eigen::Matrix<double, 6, 1>::Zero();
  for (Blocks& blocks : blocks_) {
    blocks.add(sample, period_s);
    if (blocks.duration_s < 1.0 && blocks.length > 1) continue;
    least = blocks.length == 1 ? blocks.densities : least.cwiseMin(blocks.densities).eval();
  }
  entry.accelerometer_noise = least.head<3>().cwiseSqrt();
  entry.gyroscope_noise = least.tail<3>().cwiseSqrt();
}

void InertialHistory::add_to_block(Entry& entry, double period_s) {
  entry.ends_block = false;
  if (period_s > kStandingGap_s) standing_ = Standing();
  if (standing_.count++ == 0) standing_.begin_ns = entry.stamp_ns;
  standing_.sum.head<3>() += entry.specific_force_m_s2;
  standing_.sum.tail<3>() += entry.angular_velocity_rad_s;
  const double block_s = seconds_between(standing_.begin_ns, entry.stamp_ns);
  if (block_s < kBlock_s) return;
  const Eigen::Matrix<double, 6, 1> mean = standing_.sum / standing_.count, change = mean - standing_.last;
  entry.ends_block = true;
  entry.block_s = block_s;
  entry.mean_rate_rad_s = mean.tail<3>();
  entry.rate_change_rad_s = change.tail<3>();
  entry.may_stand = standing_.has_last && change.head<3>().norm() < kStandingForceChange_m_s2 &&
                    change.tail<3>().cwiseAbs().maxCoeff() < standing_change_rad_s_ &&
                    mean.tail<3>().norm() < kMostBias_rad_s;
  standing_.last = mean;
  standing_.has_last = true;
  standing_.sum.setZero();
  standing_.count = 1;  // the last of one is the first of the next
  standing_.begin_ns = entry.stamp_ns;
  standing_.sum << entry.specific_force_m_s2, entry.angular_velocity_rad_s;
}

void InertialHistory::clear() {
  begin_ = end_;
  standing_ = Standing();
  force_variance_ = 0.0;
  blocks_ = {};
  for (std::size_t i = 0; i < blocks_.size(); ++i) blocks_[i].length = kNoiseBlocks[i];
}

std::uint64_t InertialHistory::last_until(std::int64_t stamp_ns) const {
  std::uint64_t low = begin(), high = end_;
  while (high - low > 1) {
    const std::uint64_t middle = low + (high - low) / 2;
    ((*this)[middle].stamp_ns <= stamp_ns ? low : high) = middle;
  }
  return low;
}

}  // namespace situation_awareness
