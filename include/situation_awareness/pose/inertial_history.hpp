// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/pose/inertial_motion.hpp"

namespace situation_awareness {

/// Inertial samples of the last seconds, in the axes of the base; a ring that is numbered from the first one on. The
/// density of their noise is measured as Allan's variance is: by how far the mean of a block of samples is from that of
/// its neighbours, over some seconds, for blocks of several lengths. It is the same for all of them if the noise is
/// white, more for short ones by shaking and for long ones by motion: the least is taken.
class InertialHistory {
 public:
  struct Entry : InertialSample {
    Eigen::Vector3d accelerometer_noise = Eigen::Vector3d::Zero();  ///< m/s^2/sqrt(Hz), each axis
    Eigen::Vector3d gyroscope_noise = Eigen::Vector3d::Zero();      ///< rad/s/sqrt(Hz)
    double force_change_m_s2 = 0.0;  ///< root mean square of the force about its mean, over some seconds
    /// At the end of a block of kBlock_s: whether its means and those of the block before are those of something that
    /// may stand, the mean of the rate, and what that differs by from the one before.
    bool ends_block = false, may_stand = false;
    double block_s = 0.0;
    Eigen::Vector3d mean_rate_rad_s = Eigen::Vector3d::Zero(), rate_change_rad_s = Eigen::Vector3d::Zero();
  };
  /// Blocks are so long: there the means of two of them differ least, by white noise and by the walk of the bias.
  static constexpr double kBlock_s = 8.0;
  /// Over which `force_change_m_s2` is (s).
  static constexpr double kForceChange_s = 5.0;

  /// It keeps the samples of this time, if they come at `most_hz` at most, and less of faster ones; it grows with their
  /// rate, and then stays.
  /// What stands has rates whose means of two blocks differ by less than `standing_change_rad_s`, each axis.
  InertialHistory(double duration_s, double most_hz, double standing_change_rad_s);

  void add(const InertialSample& sample);
  void clear();

  std::uint64_t begin() const {
    return end_ - begin_ > samples_.size() ? end_ - static_cast<std::uint64_t>(samples_.size()) : begin_;
  }
  std::uint64_t end() const { return end_; }
  bool empty() const { return begin_ == end_; }
  const Entry& operator[](std::uint64_t number) const {
    return samples_[static_cast<std::size_t>(number % samples_.size())];
  }
  const Entry& latest() const { return (*this)[end_ - 1]; }
  /// Whether the samples are too fast for the time it is to keep.
  bool is_short() const;
  /// Number of the last sample that is not later than the stamp; begin() if all are.
  std::uint64_t last_until(std::int64_t stamp_ns) const;

 private:
  bool is_full() const { return end_ - begin_ >= samples_.size(); }
  void grow();
  void add_to_block(Entry& entry, double period_s);

  double duration_s_, standing_change_rad_s_;
  std::size_t most_;
  std::vector<Entry> samples_;
  std::uint64_t begin_ = 0, end_ = 0;
  Eigen::Vector3d mean_force_m_s2_ = Eigen::Vector3d::Zero();
  double force_variance_ = 0.0;
  struct Blocks {
    int length = 1;  ///< samples
    int count = 0;   ///< samples of the present one
    int whole = 0;   ///< blocks until now, 2 at most
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero(), last = sum, last_but_one = sum;
    double duration_s = 0.0;                      ///< that the densities are of
    Eigen::Matrix<double, 6, 1> densities = sum;  ///< squared, of force and rate
    void add(const InertialSample& sample, double period_s);
  };
  std::array<Blocks, 3> blocks_;
  struct Standing {
    std::int64_t begin_ns = 0;
    int count = 0;  ///< samples of the present block
    bool has_last = false;
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero(), last = sum;  ///< force, rate
  };
  Standing standing_;
};

}  // namespace situation_awareness
