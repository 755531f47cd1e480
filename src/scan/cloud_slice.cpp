// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/cloud_slice.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cloud_directions.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kMaxTime_s = 1.0;
constexpr double kSameColumn = 0.1;      ///< measurements this close in azimuth, in bearings, are of one column
constexpr double kMaxSweepError = 0.05;  ///< mean difference of times from those of an even sweep, in revolutions
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// From the sensor's frame at any time to the level frame of the first measurement, by constant velocities
/// (docs/math/points.md, "Motion"). Rows of a cloud repeat the times of its columns, so poses at kPoses even times are
/// computed once: the nearest is off by at most a thousandth of the motion.
class ToLevel {
 public:
  void set(const Eigen::Isometry3d& T_world_sensor, const Eigen::Isometry3d& T_world_sensor_end, CloudTimes times) {
    const Eigen::Vector3d x_world = T_world_sensor.linear().col(0);
    T_world_level_ = Eigen::Translation3d(T_world_sensor.translation()) *
                     Eigen::AngleAxisd(std::atan2(x_world.y(), x_world.x()), Eigen::Vector3d::UnitZ());
    T_level_sensor_.assign(1, T_world_level_.inverse() * T_world_sensor);
    const double duration_s = times.last_s - times.first_s;
    if (!(duration_s > 0.0) || T_world_sensor.matrix() == T_world_sensor_end.matrix()) return;
    first_s_ = times.first_s;
    poses_per_s_ = (kPoses - 1) / duration_s;
    const Eigen::Isometry3d T_level_last = T_world_level_.inverse() * T_world_sensor_end;
    const Eigen::Quaterniond R_level_first(T_level_sensor_[0].linear());
    const Eigen::Quaterniond R_level_last(T_level_last.linear());
    for (int i = 1; i < kPoses; ++i) {
      const double part = static_cast<double>(i) / (kPoses - 1);
      T_level_sensor_.push_back(Eigen::Translation3d(part * T_level_last.translation()) *
                                R_level_first.slerp(part, R_level_last));
    }
  }

  const Eigen::Isometry3d& T_level_sensor(double time_s) const {
    if (T_level_sensor_.size() == 1) return T_level_sensor_[0];
    return T_level_sensor_[static_cast<std::size_t>(std::lround((time_s - first_s_) * poses_per_s_))];
  }

  const Eigen::Isometry3d& T_world_level() const { return T_world_level_; }

 private:
  static constexpr int kPoses = 501;
  Eigen::Isometry3d T_world_level_;
  std::vector<Eigen::Isometry3d> T_level_sensor_;
  double first_s_ = 0.0, poses_per_s_ = 0.0;
};

/// When measurements were that have no time of their own: a structured cloud has one for each column or, if those
/// scatter less, for each row; between those that are known, times are on straight lines.
class LineTimes {
 public:
  void learn(const Cloud& cloud) {
    columns_ = cloud.columns;
    std::vector<Line> columns(cloud.columns), rows(cloud.rows);
    for (std::size_t place = 0; place < cloud.points.size(); ++place) {
      const double time_s = cloud.points[place].time_s;
      if (std::isnan(time_s)) continue;
      columns[place % columns_].add(time_s);
      rows[place / columns_].add(time_s);
    }
    is_by_column_ = scatter(columns) <= scatter(rows);
    interpolate(is_by_column_ ? columns : rows);
  }

  double at(std::size_t place) const { return times_s_[is_by_column_ ? place % columns_ : place / columns_]; }

 private:
  struct Line {
    double first_s = kInfinity, last_s = -kInfinity;

    void add(double time_s) {
      first_s = std::min(first_s, time_s);
      last_s = std::max(last_s, time_s);
    }
    bool is_known() const { return first_s <= last_s; }
  };

  /// Mean of what the known ones span.
  static double scatter(const std::vector<Line>& lines) {
    double sum_s = 0.0;
    int known = 0;
    for (const Line& line : lines) {
      if (!line.is_known()) continue;
      sum_s += line.last_s - line.first_s;
      ++known;
    }
    return known > 0 ? sum_s / known : kInfinity;
  }

  void interpolate(const std::vector<Line>& lines) {
    times_s_.assign(lines.size(), 0.0);
    std::size_t next = 0;  // that is not set yet
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (!lines[i].is_known()) continue;
      const double time_s = 0.5 * (lines[i].first_s + lines[i].last_s);
      const double before_s = next > 0 ? times_s_[next - 1] : time_s;
      const std::size_t steps = i + 1 - next;
      for (std::size_t k = 1; k <= steps; ++k) {
        const double part = next > 0 ? static_cast<double>(k) / static_cast<double>(steps) : 1.0;
        times_s_[next + k - 1] = before_s + part * (time_s - before_s);
      }
      next = i + 1;
    }
    for (; next > 0 && next < times_s_.size(); ++next) times_s_[next] = times_s_[next - 1];
  }

  std::size_t columns_ = 1;
  bool is_by_column_ = true;
  std::vector<double> times_s_;
};

/// What was measured at one bearing.
struct Bearing {
  double first_s = kInfinity;  ///< time of its first measurement
  double nearest_m;            ///< return in the slice; max_range_m where there is none
  double off_middle = 1.0;     ///< of those that could see it, the nearest to the middle
  double surface_m = kInfinity;
  double sum_m = 0.0;  ///< of the returns from the surface
  double sum_intensity = 0.0;
  int count = 0;
  bool free = false;

  bool measured() const { return first_s < kInfinity; }
};

/// As far as one measurement is in the slice.
struct Measurement {
  std::size_t bearing;
  double off_middle;  ///< azimuth from the middle of its bearing, in bearings
  double reach_m;     ///< horizontal range up to where it ends or leaves the slice
  bool is_hit;        ///< it ends there, at a return in the slice
  float intensity;
};

/// Azimuth in bearings, from 0 to their number.
double bearings_to(const Eigen::Vector3d& direction_level, std::size_t bearings) {
  const double turns = (std::atan2(direction_level.y(), direction_level.x()) + kPi) / (2.0 * kPi);
  return turns * static_cast<double>(bearings);
}

/// Horizontal range at which a ray from the sensor leaves the slice.
double range_in_slice_m(const Eigen::Vector3d& direction_level, const CloudSliceParams& params) {
  const double height_m = direction_level.z() < 0.0 ? -params.min_height_m : params.max_height_m;
  return height_m / std::abs(direction_level.z()) * direction_level.head<2>().norm();  // +inf where it is level
}

/// How the sensor sweeps over the bearings; at once, without times, by default.
struct Sweep {
  std::size_t start = 0;
  bool counter_clockwise = true;
  double increment_s = 0.0;

  /// The bearing of the k-th beam.
  std::size_t bearing(std::size_t k, std::size_t n) const { return (start + (counter_clockwise ? k : n - k)) % n; }
};

/// From the times of the bearings, if they grow evenly around the circle.
Sweep sweep_of(const std::vector<Bearing>& bearings, CloudTimes times) {
  const double duration_s = times.last_s - times.first_s;
  if (duration_s <= 0.0) return {};
  const std::size_t n = bearings.size();
  double sum_s = 0.0;  // of the steps from bearing to bearing, without the one from the last measured to the first
  int steps = 0;
  std::size_t start = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Bearing& bearing = bearings[i];
    const Bearing& next = bearings[(i + 1) % n];
    if (bearing.first_s < bearings[start].first_s) start = i;
    if (!bearing.measured() || !next.measured()) continue;
    const double step_s = next.first_s - bearing.first_s;
    if (std::abs(step_s) > 0.5 * duration_s) continue;
    sum_s += step_s;
    ++steps;
  }
  if (steps == 0) return {};
  const Sweep sweep{start, sum_s > 0.0, std::abs(sum_s) / steps};
  double error_s = 0.0;
  int measured = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const Bearing& bearing = bearings[sweep.bearing(k, n)];
    if (!bearing.measured()) continue;
    error_s += std::abs(bearing.first_s - bearings[start].first_s - static_cast<double>(k) * sweep.increment_s);
    ++measured;
  }
  return error_s <= kMaxSweepError * static_cast<double>(n) * sweep.increment_s * measured ? sweep : Sweep{};
}

/// Which measurements say what is at their bearings.
///
/// Things that are near have several rings of the sensor in the slice, what is behind them has few. So where a bearing
/// is half on one and half on the other, a ring that meets the thing beside the middle is not contradicted by its own
/// measurement in the middle, which has left the slice: things would grow by a part of a bearing on each side. Of those
/// that could see the nearest, the one nearest to the middle decides.
void judge(const std::vector<Measurement>& measurements, const CloudSliceParams& params,
           std::vector<Bearing>& bearings) {
  const auto could_see_nearest = [&](const Measurement& m) { return m.reach_m >= bearings[m.bearing].nearest_m; };
  for (const Measurement& m : measurements) {
    Bearing& bearing = bearings[m.bearing];
    if (could_see_nearest(m)) bearing.off_middle = std::min(bearing.off_middle, m.off_middle);
  }
  const auto decides = [&](const Measurement& m) {
    return could_see_nearest(m) && m.off_middle <= bearings[m.bearing].off_middle + kSameColumn;
  };
  for (const Measurement& m : measurements) {
    if (!decides(m)) continue;
    Bearing& bearing = bearings[m.bearing];
    if (m.is_hit) bearing.surface_m = std::min(bearing.surface_m, m.reach_m);
    if (m.reach_m >= params.max_range_m) bearing.free = true;
  }
  for (const Measurement& m : measurements) {
    Bearing& bearing = bearings[m.bearing];
    if (!m.is_hit || !decides(m) || m.reach_m > bearing.surface_m + params.max_depth_m) continue;
    bearing.sum_m += m.reach_m;
    bearing.sum_intensity += m.intensity;
    ++bearing.count;
  }
}

Beam beam_of(const Bearing& bearing, const CloudSliceParams& params) {
  if (bearing.count > 0) {
    return {static_cast<float>(bearing.sum_m / bearing.count), BeamState::kHit,
            static_cast<float>(bearing.sum_intensity / bearing.count)};
  }
  if (bearing.free) return {static_cast<float>(params.max_range_m), BeamState::kFree};
  return {};
}

/// Kept for its memory.
struct Workspace {
  ToLevel to_level;
  CloudDirections directions;
  std::vector<Bearing> bearings;
  std::vector<Measurement> measurements;
};

}  // namespace

void CloudSliceParams::validate() const {
  check_bounds(*this, "cloud");
  if (!(min_range_m < max_range_m)) {
    throw std::invalid_argument("cloud.min_range_m must be less than cloud.max_range_m");
  }
}

std::optional<CloudTimes> times_of(const Cloud& cloud) {
  if (cloud.points.empty()) return CloudTimes{};
  CloudTimes times{kInfinity, -kInfinity};
  for (const CloudPoint& point : cloud.points) {
    if (std::isnan(point.time_s)) continue;
    times = {std::min(times.first_s, static_cast<double>(point.time_s)),
             std::max(times.last_s, static_cast<double>(point.time_s))};
  }
  const bool are_valid = std::abs(times.first_s) <= kMaxTime_s && std::abs(times.last_s) <= kMaxTime_s;
  return are_valid ? std::optional(times) : std::nullopt;
}

CloudSlice slice_cloud(const Cloud& cloud, const Eigen::Isometry3d& T_world_sensor,
                       const Eigen::Isometry3d& T_world_sensor_end, const CloudSliceParams& params, CloudSlice memory) {
  if (cloud.points.size() != cloud.rows * cloud.columns) {
    throw std::invalid_argument("a cloud has not rows * columns points");
  }
  if (!T_world_sensor.matrix().allFinite() || !T_world_sensor_end.matrix().allFinite()) {
    throw std::invalid_argument("the sensor's pose is not finite");
  }
  thread_local Workspace work;
  const std::optional<CloudTimes> valid_times = times_of(cloud);
  const CloudTimes times = valid_times.value_or(CloudTimes{});
  work.to_level.set(T_world_sensor, T_world_sensor_end, times);
  work.directions.learn(cloud);
  const auto n = static_cast<std::size_t>(std::lround(2.0 * kPi / params.angle_increment_rad));
  Bearing nothing_known;
  nothing_known.nearest_m = params.max_range_m;
  work.bearings.assign(n, nothing_known);
  work.measurements.clear();

  std::size_t untimed_returns = 0;
  LineTimes line_times;
  const auto is_untimed = [](const CloudPoint& point) { return std::isnan(point.time_s); };
  const bool has_untimed = valid_times && std::any_of(cloud.points.begin(), cloud.points.end(), is_untimed);
  if (has_untimed && work.directions.known()) line_times.learn(cloud);
  for (std::size_t place = 0; place < cloud.points.size(); ++place) {
    const CloudPoint& point = cloud.points[place];
    const bool has_return = is_return(point), has_no_time = has_untimed && is_untimed(point);
    if (!has_return && !work.directions.known()) continue;
    if (has_return && has_no_time) {
      ++untimed_returns;
      continue;
    }
    const double time_s = !valid_times ? 0.0 : has_no_time ? line_times.at(place) : point.time_s;
    const Eigen::Isometry3d& T_level_sensor = work.to_level.T_level_sensor(time_s);
    const Eigen::Vector3d ray_level =
        T_level_sensor.linear() * (has_return ? position_sensor(point) : work.directions.at(place));
    const Eigen::Vector3d p_level = ray_level + T_level_sensor.translation();
    const double range_m = has_return ? p_level.head<2>().norm() : kInfinity;
    const bool is_hit =
        range_m <= params.max_range_m && p_level.z() >= params.min_height_m && p_level.z() <= params.max_height_m;
    const double reach_m = is_hit ? range_m : std::min(range_m, range_in_slice_m(ray_level, params));
    if (reach_m < params.min_range_m) continue;

    const double at = bearings_to(has_return ? p_level : ray_level, n);
    const std::size_t i = static_cast<std::size_t>(std::lround(at)) % n;
    Bearing& bearing = work.bearings[i];
    bearing.first_s = std::min(bearing.first_s, time_s);
    if (is_hit) bearing.nearest_m = std::min(bearing.nearest_m, range_m);
    work.measurements.push_back({i, std::abs(at - std::round(at)), reach_m, is_hit, point.intensity});
  }
  judge(work.measurements, params, work.bearings);

  const Sweep sweep = sweep_of(work.bearings, times);
  CloudSlice slice = std::move(memory);
  slice.T_world_level = work.to_level.T_world_level();
  slice.times_valid = valid_times.has_value();
  slice.duration_s = times.last_s - times.first_s;
  slice.untimed_returns = untimed_returns;
  Scan& scan = slice.scan;
  scan.stamp_ns = cloud.stamp_ns + nanoseconds(times.first_s);
  const double increment_rad = 2.0 * kPi / static_cast<double>(n);
  scan.angle_increment_rad = sweep.counter_clockwise ? increment_rad : -increment_rad;
  scan.angle_min_rad = -kPi + static_cast<double>(sweep.start) * increment_rad;
  scan.time_increment_s = sweep.increment_s;
  scan.beams.clear();
  for (std::size_t k = 0; k < n; ++k) scan.beams.push_back(beam_of(work.bearings[sweep.bearing(k, n)], params));
  return slice;
}

bool UntimedMotion::add(const CloudSlice& slice, const Eigen::Isometry3d& T_world_sensor,
                        const CloudSliceParams& params) {
  const Scan& scan = slice.scan;
  const double period_s = stamp_ns_ ? seconds_between(*stamp_ns_, scan.stamp_ns) : 0.0;
  const Eigen::Isometry3d T_before_now = T_world_sensor_.inverse() * T_world_sensor;
  stamp_ns_ = scan.stamp_ns;
  T_world_sensor_ = T_world_sensor;
  if (slice.duration_s > 0.0 || !(period_s > 0.0 && period_s <= kMaxTime_s)) return false;
  double sum_m = 0.0;
  std::size_t hits = 0, known = 0;
  for (const Beam& beam : scan.beams) {
    known += beam.state != BeamState::kInvalid ? 1 : 0;
    if (beam.state != BeamState::kHit) continue;
    sum_m += beam.range_m;
    ++hits;
  }
  if (hits == 0 || 2 * known < scan.beams.size()) return false;  // a camera sees all at once
  const double angle_rad = Eigen::AngleAxisd(T_before_now.linear()).angle();
  const double off_m = T_before_now.translation().norm() + angle_rad * sum_m / static_cast<double>(hits);
  if (off_m <= params.max_depth_m) return false;
  ++clouds_;
  most_m_ = std::max(most_m_, off_m);
  return true;
}

}  // namespace situation_awareness
