// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/points/horizontal_projection.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Motion from the lidar's pose at its first beam to that at its last.
struct Motion {
  Eigen::Vector3d axis_lidar = Eigen::Vector3d::UnitZ();  ///< of the rotation
  double turn_rad = 0.0;
  Eigen::Vector3d translation_world_m = Eigen::Vector3d::Zero();
  bool moves = false;
};

Motion motion_between(const Eigen::Isometry3d& T_world_first, const Eigen::Isometry3d& T_world_last) {
  Motion motion;
  motion.moves = T_world_first.matrix() != T_world_last.matrix();
  if (!motion.moves) return motion;  // exactly none: R^T R is the identity only up to rounding
  const Eigen::AngleAxisd turn(T_world_first.linear().transpose() * T_world_last.linear());
  motion.axis_lidar = turn.axis();
  motion.turn_rad = turn.angle();
  motion.translation_world_m = T_world_last.translation() - T_world_first.translation();
  return motion;
}

/// The beams of a scan in the lidar's frame: the same from scan to scan.
struct Rays {
  double angle_min_rad = 0.0;
  double angle_increment_rad = 0.0;
  std::vector<double> angle_rad, cosine, sine;
  std::vector<double> part;  ///< of the sweep before the beam
};

/// Kept until angles or their number change.
const Rays& rays_lidar(const Scan& scan) {
  thread_local Rays rays;
  const std::size_t n = scan.beams.size();
  const bool same = rays.part.size() == n && rays.angle_min_rad == scan.angle_min_rad &&
                    rays.angle_increment_rad == scan.angle_increment_rad;
  if (same) return rays;
  rays.angle_min_rad = scan.angle_min_rad;
  rays.angle_increment_rad = scan.angle_increment_rad;
  for (std::vector<double>* const values : {&rays.angle_rad, &rays.cosine, &rays.sine, &rays.part}) values->resize(n);
  const double steps = n > 1 ? static_cast<double>(n - 1) : 1.0;
  for (std::size_t i = 0; i < n; ++i) {
    rays.angle_rad[i] = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    rays.cosine[i] = std::cos(rays.angle_rad[i]);
    rays.sine[i] = std::sin(rays.angle_rad[i]);
    rays.part[i] = static_cast<double>(i) / steps;
  }
  return rays;
}

/// Numbers of each beam, one behind the other, so that the compiler can make loops over them of vector instructions.
struct Beams {
  std::vector<double> x, y;          ///< direction in the level frame
  std::vector<double> turned_rad;    ///< azimuth of the direction, less that of the beam in the lidar's frame
  std::vector<double> range_m;       ///< 0 where there is no hit
  std::vector<double> p_x_m, p_y_m;  ///< of the hit in the level frame
  std::vector<double> distance_m;    ///< of the hit
  std::vector<double> parallax_rad;  ///< azimuth of the hit less that of the direction
  std::vector<double> across, along;

  void resize(std::size_t n) {
    for (std::vector<double>* const values :
         {&x, &y, &turned_rad, &range_m, &p_x_m, &p_y_m, &distance_m, &parallax_rad, &across, &along}) {
      values->resize(n);
    }
  }
};

/// Sine of an angle, and its cosine less 1, by their series. The first terms that are left out are below 1e-17 for all
/// that a lidar may turn during a sweep.
static_assert(kMaxTurnOfSweep * 2.0 * kPi < 0.65);

double sine_of_turn(double angle_rad) {
  const double a2 = angle_rad * angle_rad;
  double sum = -1.0 / 1307674368000.0;
  sum = 1.0 / 6227020800.0 + a2 * sum;
  sum = -1.0 / 39916800.0 + a2 * sum;
  sum = 1.0 / 362880.0 + a2 * sum;
  sum = -1.0 / 5040.0 + a2 * sum;
  sum = 1.0 / 120.0 + a2 * sum;
  sum = -1.0 / 6.0 + a2 * sum;
  return angle_rad + angle_rad * (a2 * sum);
}

double cosine_less_1_of_turn(double angle_rad) {
  const double a2 = angle_rad * angle_rad;
  double sum = 1.0 / 20922789888000.0;
  sum = -1.0 / 87178291200.0 + a2 * sum;
  sum = 1.0 / 479001600.0 + a2 * sum;
  sum = -1.0 / 3628800.0 + a2 * sum;
  sum = 1.0 / 40320.0 + a2 * sum;
  sum = -1.0 / 720.0 + a2 * sum;
  sum = 1.0 / 24.0 + a2 * sum;
  return a2 * (-0.5 + a2 * sum);
}

/// Directions in the level frame: R_level_lidar R(t), by Rodrigues' formula the sum of three matrices times 1, sine and
/// cosine of what the lidar has turned, of which rays in its plane need two columns.
void find_directions(const Rays& rays, const Eigen::Matrix<double, 2, 3>& R_level_lidar, const Motion& motion,
                     Beams& beams) {
  const std::size_t n = rays.part.size();
  const Eigen::Matrix2d at_rest = R_level_lidar.leftCols<2>();
  const double* const cosine = rays.cosine.data();
  const double* const sine = rays.sine.data();
  double* const x = beams.x.data();
  double* const y = beams.y.data();
  if (!motion.moves) {
    for (std::size_t i = 0; i < n; ++i) {
      x[i] = at_rest(0, 0) * cosine[i] + at_rest(0, 1) * sine[i];
      y[i] = at_rest(1, 0) * cosine[i] + at_rest(1, 1) * sine[i];
    }
    return;
  }
  const Eigen::Vector3d& axis = motion.axis_lidar;
  Eigen::Matrix3d hat;
  hat << 0.0, -axis.z(), axis.y(), axis.z(), 0.0, -axis.x(), -axis.y(), axis.x(), 0.0;
  const Eigen::Matrix2d by_sine = (R_level_lidar * hat).leftCols<2>();
  const Eigen::Matrix2d by_cosine = -(R_level_lidar * hat * hat).leftCols<2>();
  const double* const part = rays.part.data();
  for (std::size_t i = 0; i < n; ++i) {
    const double angle_rad = part[i] * motion.turn_rad;
    const double s = sine_of_turn(angle_rad);
    const double c = cosine_less_1_of_turn(angle_rad);
    x[i] = (at_rest(0, 0) + s * by_sine(0, 0) + c * by_cosine(0, 0)) * cosine[i] +
           (at_rest(0, 1) + s * by_sine(0, 1) + c * by_cosine(0, 1)) * sine[i];
    y[i] = (at_rest(1, 0) + s * by_sine(1, 0) + c * by_cosine(1, 0)) * cosine[i] +
           (at_rest(1, 1) + s * by_sine(1, 1) + c * by_cosine(1, 1)) * sine[i];
  }
}

/// atan2(across, along): small for most beams, so that a series decides it, which is much faster.
void find_angles(const std::vector<double>& across, const std::vector<double>& along, std::vector<double>& angle_rad) {
  constexpr double kSmall = 0.1;  // the first term that is left out is below 1e-18
  const std::size_t n = across.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double t = across[i] / along[i];
    const double t2 = t * t;
    double sum = -1.0 / 15.0;
    sum = 1.0 / 13.0 + t2 * sum;
    sum = -1.0 / 11.0 + t2 * sum;
    sum = 1.0 / 9.0 + t2 * sum;
    sum = -1.0 / 7.0 + t2 * sum;
    sum = 1.0 / 5.0 + t2 * sum;
    sum = -1.0 / 3.0 + t2 * sum;
    angle_rad[i] = t + t * (t2 * sum);
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!(std::abs(across[i]) < kSmall * along[i])) angle_rad[i] = std::atan2(across[i], along[i]);
  }
}

/// By how much tilt and turn of the lidar change the angles of the beams. `side`: -1 below a lidar that is upside down.
void find_turned(const Rays& rays, double side, Beams& beams) {
  for (std::size_t i = 0; i < rays.part.size(); ++i) {
    const double y = side * rays.sine[i];
    beams.across[i] = rays.cosine[i] * beams.y[i] - y * beams.x[i];
    beams.along[i] = rays.cosine[i] * beams.x[i] + y * beams.y[i];
  }
  find_angles(beams.across, beams.along, beams.turned_rad);
}

/// The hits, and their azimuths as seen from the lidar's place at the first beam.
void find_hits(const Rays& rays, const Eigen::Vector2d& translation_level_m, bool moves, Beams& beams) {
  const std::size_t n = rays.part.size();
  const double shift_x_m = moves ? translation_level_m.x() : 0.0;
  const double shift_y_m = moves ? translation_level_m.y() : 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double shifted_x_m = rays.part[i] * shift_x_m;
    const double shifted_y_m = rays.part[i] * shift_y_m;
    const double p_x_m = beams.range_m[i] * beams.x[i] + shifted_x_m;
    const double p_y_m = beams.range_m[i] * beams.y[i] + shifted_y_m;
    const bool hit = beams.range_m[i] > 0.0;
    beams.p_x_m[i] = p_x_m;
    beams.p_y_m[i] = p_y_m;
    beams.distance_m[i] = std::sqrt(p_x_m * p_x_m + p_y_m * p_y_m);
    const double across = beams.x[i] * shifted_y_m - beams.y[i] * shifted_x_m;
    const double along = beams.x[i] * p_x_m + beams.y[i] * p_y_m;
    beams.across[i] = hit ? across : 0.0;
    beams.along[i] = hit ? along : 1.0;
  }
  if (moves) find_angles(beams.across, beams.along, beams.parallax_rad);
}

double distance_m(const Point& point) {
  return is_hit(point.state) ? point.range_m : std::numeric_limits<double>::infinity();
}

/// Make azimuths non-decreasing where they decrease by parallax of the moving lidar. Seen from the origin the nearer
/// points cover the others: they keep their azimuths, and the covered points get the azimuth of their edge.
void order_azimuths(Points& points) {
  struct Block {  // of points at one azimuth, that of the nearest of them
    double azimuth_rad;
    double distance_m;
    std::size_t end;
  };
  const std::size_t n = points.points.size();
  const auto decreases = [](const Point& before, const Point& after) { return before.azimuth_rad > after.azimuth_rad; };
  const bool in_order =
      std::adjacent_find(points.points.begin(), points.points.end(), decreases) == points.points.end();
  if (in_order && !points.full_circle) return;
  // The nearest point keeps its azimuth, so that a circle is complete when it is reached again.
  const auto nearest = std::min_element(points.points.begin(), points.points.end(),
                                        [](const Point& a, const Point& b) { return distance_m(a) < distance_m(b); });
  const std::size_t start = points.full_circle ? static_cast<std::size_t>(nearest - points.points.begin()) : 0;
  const auto index = [&](std::size_t k) { return start + k < n ? start + k : start + k - n; };
  const auto turn_rad = [&](std::size_t k) { return start + k < n ? 0.0 : 2.0 * kPi; };

  thread_local std::vector<Block> blocks;  // kept for its memory
  blocks.clear();
  for (std::size_t k = 0; k < n; ++k) {
    const Point& point = points.points[index(k)];
    Block block{point.azimuth_rad + turn_rad(k), distance_m(point), k + 1};
    while (!blocks.empty() && blocks.back().azimuth_rad > block.azimuth_rad) {
      if (blocks.back().distance_m <= block.distance_m) {
        block.azimuth_rad = blocks.back().azimuth_rad;
        block.distance_m = blocks.back().distance_m;
      }
      blocks.pop_back();
    }
    blocks.push_back(block);
  }
  // Each point from its own side of the seam, so that rounding does not separate equal azimuths.
  const double first_rad = points.full_circle ? points.points[start].azimuth_rad : 0.0;
  std::size_t k = 0;
  for (const Block& block : blocks) {
    for (; k < block.end; ++k) {
      double& azimuth_rad = points.points[index(k)].azimuth_rad;
      azimuth_rad = block.azimuth_rad - turn_rad(k);
      if (points.full_circle) azimuth_rad = std::min(azimuth_rad, first_rad + (2.0 * kPi - turn_rad(k)));
    }
  }
}

}  // namespace

double tilt_rad(const Eigen::Isometry3d& T_world_lidar) {
  return std::acos(std::min(1.0, std::abs(T_world_lidar.linear()(2, 2))));
}

const char* projection_defect(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                              const Eigen::Isometry3d& T_world_lidar_end) {
  if (!T_world_lidar.matrix().allFinite() || !T_world_lidar_end.matrix().allFinite()) return "pose";
  const bool level_enough = tilt_rad(T_world_lidar) <= kMaxTiltRad && tilt_rad(T_world_lidar_end) <= kMaxTiltRad;
  if (!level_enough) return "tilt";
  const double steps = scan.beams.empty() ? 0.0 : static_cast<double>(scan.beams.size() - 1);
  const double most_rad = kMaxTurnOfSweep * steps * std::abs(scan.angle_increment_rad);
  return motion_between(T_world_lidar, T_world_lidar_end).turn_rad <= most_rad ? "" : "turn";
}

Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
  return project_horizontally(scan, T_world_lidar, T_world_lidar);
}

Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                            const Eigen::Isometry3d& T_world_lidar_end, Points memory) {
  const std::string defect = projection_defect(scan, T_world_lidar, T_world_lidar_end);
  const Motion motion = motion_between(T_world_lidar, T_world_lidar_end);
  if (defect == "pose") throw std::invalid_argument("the lidar's pose is not finite");
  if (defect == "tilt") {
    const double tilt = std::max(tilt_rad(T_world_lidar), tilt_rad(T_world_lidar_end));
    throw std::invalid_argument("scan plane tilted by " + std::to_string(degrees(tilt)) + " deg, at most " +
                                std::to_string(degrees(kMaxTiltRad)) + " deg can be projected");
  }
  if (defect == "turn") {
    throw std::invalid_argument("lidar turned by " + std::to_string(degrees(motion.turn_rad)) +
                                " deg during a scan, more than " + std::to_string(kMaxTurnOfSweep) + " of its sweep");
  }

  const Eigen::Matrix3d R_world_lidar = T_world_lidar.linear();
  const double yaw_rad = std::atan2(R_world_lidar(1, 0), R_world_lidar(0, 0));
  const Eigen::Matrix3d R_level_world = Eigen::AngleAxisd(-yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Matrix<double, 2, 3> R_level_lidar = (R_level_world * R_world_lidar).topRows<2>();
  const Eigen::Vector2d translation_level_m = (R_level_world * motion.translation_world_m).head<2>();

  Points result = std::move(memory);
  result.full_circle = false;
  result.resolution_rad = 0.0;
  result.stamp_ns = scan.stamp_ns;
  result.T_world_level = {T_world_lidar.translation().head<2>(), yaw_rad};
  result.height_world_m = T_world_lidar.translation().z();
  result.time_increment_s = scan.time_increment_s;
  const std::size_t n = scan.beams.size();
  result.points.resize(n);
  if (n == 0) return result;

  // A lidar turned upside down, or one with a negative increment, sweeps clockwise seen from above: read it in reverse.
  const bool clockwise = (R_world_lidar(2, 2) < 0.0) != (scan.angle_increment_rad < 0.0);
  const double increment_rad = std::abs(scan.angle_increment_rad);
  // The x axis stays where it is but for the tilt, y points the other way below a lidar that is upside down.
  const double side = R_world_lidar(2, 2) < 0.0 ? -1.0 : 1.0;
  const Rays& rays = rays_lidar(scan);
  thread_local Beams beams;  // kept for its memory
  beams.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    beams.range_m[i] = is_hit(scan.beams[i].state) ? static_cast<double>(scan.beams[i].range_m) : 0.0;
  }
  find_directions(rays, R_level_lidar, motion, beams);
  find_turned(rays, side, beams);
  find_hits(rays, translation_level_m, motion.moves, beams);
  double first_rad = 0.0;
  double previous_rad = 0.0;
  double turns_rad = 0.0;  // from the angles of the scan to azimuths
  std::size_t count = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t i = clockwise ? n - 1 - k : k;
    const double direction_rad = side * rays.angle_rad[i] + turns_rad + beams.turned_rad[i];
    double step_rad = wrap_to_pi(direction_rad - previous_rad);
    if (step_rad < increment_rad - kPi) step_rad += 2.0 * kPi;  // more than half a turn to the next beam
    const double azimuth_rad = k == 0 ? wrap_to_pi(direction_rad) : previous_rad + step_rad;
    if (k == 0) {
      first_rad = azimuth_rad;
      turns_rad = azimuth_rad - direction_rad;
    }
    if (azimuth_rad > first_rad + 2.0 * kPi) break;  // beyond a full circle: seen already
    previous_rad = azimuth_rad;

    // Filled where it stays: a point that is copied right after its members were set waits for them.
    Point& point = result.points[count++];
    point.beam = static_cast<int>(i);
    point.state = scan.beams[i].state;
    point.intensity = scan.beams[i].intensity;
    point.azimuth_rad = azimuth_rad;
    if (is_hit(point.state)) {
      point.p_level_m = {beams.p_x_m[i], beams.p_y_m[i]};
      point.range_m = beams.distance_m[i];
      if (motion.moves) point.azimuth_rad += beams.parallax_rad[i];
    } else {
      point.p_level_m.setZero();
      const bool free = point.state == BeamState::kFree;
      point.range_m = free ? scan.beams[i].range_m * Eigen::Vector2d(beams.x[i], beams.y[i]).norm() : 0.0;
    }
  }
  result.points.resize(count);

  result.resolution_rad = count > 1 ? (previous_rad - first_rad) / static_cast<double>(count - 1) : increment_rad;
  result.full_circle = increment_rad * (static_cast<double>(n) + 0.5) >= 2.0 * kPi;
  if (motion.moves) order_azimuths(result);
  return result;
}

}  // namespace situation_awareness
