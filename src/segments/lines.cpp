// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/lines.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Sine of the angle between beam and surface below which the weight of a hit is clamped: the footprint of the beam and
/// the error of its azimuth, which are not part of the range noise, dominate there.
constexpr double kMinIncidence = 0.1;

/// Gauss-Newton steps from total least squares, which is within a standard deviation of the optimum: the second one
/// moves the line by less than a hundredth of that, the third is not needed.
constexpr int kSteps = 2;

/// Points first ... last, both included.
struct Run {
  std::size_t first = 0;
  std::size_t last = 0;

  std::size_t count() const { return last - first + 1; }
};

/// Memory reused from scan to scan, with room from the start: the first scan with more runs would else allocate at any
/// time.
struct LinesWorkspace {
  std::vector<Run> open;
  std::vector<Run> runs;

  LinesWorkspace() {
    open.reserve(kUsualRoom);
    runs.reserve(kUsualRoom);
  }
};

/// Break points where they lie farther than `max_offset_m` from the chord of their ends (Douglas and Peucker, 1973),
/// into `work.runs`. A point at which they are broken belongs to the run after it.
void split(const Point* points, Run whole, double max_offset_m, LinesWorkspace& work) {
  work.open.assign(1, whole);
  while (!work.open.empty()) {
    const Run run = work.open.back();
    work.open.pop_back();
    const Eigen::Vector2d from = points[run.first].p_level_m;
    const Eigen::Vector2d chord = points[run.last].p_level_m - from;
    const double length_m = chord.norm();
    // Around a closed room the ends meet and give no direction.
    const bool has_direction = length_m > max_offset_m;
    const Eigen::Vector2d normal = Eigen::Vector2d(-chord.y(), chord.x()) / length_m;
    double farthest_m = max_offset_m;
    std::size_t farthest = run.first;
    for (std::size_t i = run.first + 1; i < run.last; ++i) {
      const Eigen::Vector2d d = points[i].p_level_m - from;
      const double offset = has_direction ? std::abs(normal.dot(d)) : d.norm();
      if (offset > farthest_m) {
        farthest_m = offset;
        farthest = i;
      }
    }
    if (farthest == run.first) {
      const bool at_end = run.last == whole.last;
      work.runs.push_back({run.first, at_end ? run.last : run.last - 1});
    } else {
      work.open.push_back({farthest, run.last});
      work.open.push_back({run.first, farthest});
    }
  }
}

Line fit_line(const Point* points, Run run) { return fit_line(points + run.first, run.count()); }

/// True if two runs are on one line, except for fewer than params.min_line_points consecutive hits.
bool on_one_line(const Point* points, const Run& right, const Run& left, const SegmentationParams& params) {
  const Line line = fit_line(points, Run{right.first, left.last});
  int off = 0;  // in a row
  for (std::size_t i = right.first; i <= left.last; ++i) {
    off = std::abs(offset_m(line, points[i].p_level_m)) > params.max_line_offset_m ? off + 1 : 0;
    if (off >= params.min_line_points) return false;
  }
  return true;
}

/// True if each hit of a run lies on the line of the run before it or on that of the run behind it: it is the noise at
/// the corner of these two.
bool is_corner_noise(const Point* points, const Run& run, const Run& right, const Run& left, double max_offset_m) {
  const Line right_line = fit_line(points, right);
  const Line left_line = fit_line(points, left);
  return std::all_of(points + run.first, points + run.last + 1, [&](const Point& point) {
    return std::abs(offset_m(right_line, point.p_level_m)) <= max_offset_m ||
           std::abs(offset_m(left_line, point.p_level_m)) <= max_offset_m;
  });
}

/// Drop short runs and those at corners, and merge runs on one line, also across a run between them.
void join(const Point* points, const SegmentationParams& params, std::vector<Run>& runs) {
  std::size_t kept = 0;
  for (Run run : runs) {
    if (run.count() < static_cast<std::size_t>(params.min_line_points)) continue;
    for (;;) {
      if (kept > 0 && on_one_line(points, runs[kept - 1], run, params)) {
        run.first = runs[--kept].first;
      } else if (kept > 1 && on_one_line(points, runs[kept - 2], run, params)) {
        kept -= 2;
        run.first = runs[kept].first;
      } else if (kept > 1 && is_corner_noise(points, runs[kept - 1], runs[kept - 2], run, params.max_line_offset_m)) {
        --kept;
      } else {
        break;
      }
    }
    runs[kept++] = run;
  }
  runs.resize(kept);
}

/// Extend runs by adjacent free hits on their lines; where two runs meet, move the border between them to the best fit
/// of both lines.
void settle_ends(const Point* points, Run whole, const SegmentationParams& params, std::vector<Run>& runs) {
  const auto min_points = static_cast<std::size_t>(params.min_line_points);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    Run& run = runs[r];
    const std::size_t first = r > 0 ? runs[r - 1].last + 1 : whole.first;
    const std::size_t last = r + 1 < runs.size() ? runs[r + 1].first - 1 : whole.last;
    const Line line = fit_line(points, run);
    const auto on_line = [&](std::size_t i) {
      return std::abs(offset_m(line, points[i].p_level_m)) <= params.max_line_offset_m;
    };
    while (run.first > first && on_line(run.first - 1)) --run.first;
    while (run.last < last && on_line(run.last + 1)) ++run.last;
    if (r == 0 || runs[r - 1].last + 1 != run.first) continue;
    Run& right = runs[r - 1];
    const Line right_line = fit_line(points, right);
    // Of all borders k, the sum of squares of right.first ... k - 1 from one line and of k ... run.last from the other,
    // but for a constant.
    double sum = 0.0;
    double least = std::numeric_limits<double>::infinity();
    std::size_t border = run.first;
    for (std::size_t k = right.first; k + min_points <= run.last + 1; ++k) {
      if (k >= right.first + min_points && sum < least) {
        least = sum;
        border = k;
      }
      const Eigen::Vector2d& p = points[k].p_level_m;
      sum += std::pow(offset_m(right_line, p), 2) - std::pow(offset_m(line, p), 2);
    }
    right.last = border - 1;
    run.first = border;
  }
}

/// A line by its normal and the distance of the origin, and the sums over the hits about it.
struct Hesse {
  Eigen::Vector2d normal;
  double distance_m;
};

/// Sums for a Gauss-Newton step, with weights for a range noise of 1 m.
struct Sums {
  double w = 0.0;  ///< of weights
  double s = 0.0;  ///< of positions along the line
  double e = 0.0;  ///< of offsets
  double ss = 0.0;
  double se = 0.0;

  double mean_s() const { return s / w; }
  double mean_e() const { return e / w; }
  double variance_s() const { return std::max(ss / w - mean_s() * mean_s(), 0.0); }  ///< weighted
};

Sums sums_about(const Hesse& line, const Point* points, std::size_t count, double max_offset_m) {
  const Eigen::Vector2d along(-line.normal.y(), line.normal.x());
  Sums sums;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d& p = points[i].p_level_m;
    const double e = line.normal.dot(p) - line.distance_m;
    if (std::abs(e) > max_offset_m) continue;
    const double range_m = points[i].range_m;
    const double incidence = line.normal.dot(p) / range_m;
    const bool grazing = !(incidence > kMinIncidence);
    // Where the beam meets the line: the measured position is correlated with the offset's error and would bias the
    // rotation.
    const double s = along.dot(p) * (grazing ? 1.0 : line.distance_m / (range_m * incidence));
    const double w = 1.0 / std::pow(grazing ? kMinIncidence : incidence, 2);
    sums.w += w;
    sums.s += w * s;
    sums.e += w * e;
    sums.ss += w * s * s;
    sums.se += w * s * e;
  }
  return sums;
}

/// estimate_line from a first line, of the hits within `max_offset_m` of that.
LineEstimate refine_line(const Line& first, const Point* points, std::size_t count, double range_sigma_m,
                         double max_offset_m) {
  const double side = first.normal.dot(first.through_m) < 0.0 ? -1.0 : 1.0;
  Hesse line{side * first.normal, side * first.normal.dot(first.through_m)};
  Sums sums = sums_about(line, points, count, max_offset_m);
  for (int step = 0; step < kSteps; ++step) {
    // Minimise the sum of w (e + turn s - shift)^2.
    const double variance_s = sums.variance_s();
    if (!(variance_s > 0.0)) break;
    const double turn_rad = -(sums.se / sums.w - sums.mean_s() * sums.mean_e()) / variance_s;
    line.normal = Eigen::Rotation2Dd(turn_rad) * line.normal;
    line.distance_m += sums.mean_e() + turn_rad * sums.mean_s();
    sums = sums_about(line, points, count, max_offset_m);
  }
  LineEstimate estimate;
  estimate.line_level.normal = line.normal;
  const Eigen::Vector2d along(-line.normal.y(), line.normal.x());
  estimate.line_level.through_m = line.distance_m * line.normal + sums.mean_s() * along;
  const double variance_m2 = range_sigma_m * range_sigma_m;
  // About the weighted mean the two errors are independent.
  estimate.covariance.diagonal() << variance_m2 / sums.w, variance_m2 / (sums.w * sums.variance_s());
  return estimate;
}

/// Add the straight pieces of one segment.
void add_pieces(Segments& segments, std::size_t index, const SegmentationParams& params, double range_sigma_m,
                LinesWorkspace& work) {
  const Segment& segment = segments.segments[index];
  const Point* points = segments.points.data();
  const Run whole{segment.first, segment.first + segment.count - 1};
  work.runs.clear();
  split(points, whole, params.max_line_offset_m, work);
  join(points, params, work.runs);
  settle_ends(points, whole, params, work.runs);
  // A room all around the sensor is one segment whose ends are neighbours.
  const double turn_rad = points[whole.last].azimuth_rad - points[whole.first].azimuth_rad;
  const bool closed = turn_rad + (params.max_missing_beams + 1.5) * segments.resolution_rad >= 2.0 * kPi &&
                      (points[whole.last].p_level_m - points[whole.first].p_level_m).norm() <=
                          params.max_gap_m + points[whole.first].range_m * (2.0 * kPi - turn_rad);
  for (const Run& run : work.runs) {
    const Line first = fit_line(points, run);
    const LineEstimate estimate =
        refine_line(first, points + run.first, run.count(), range_sigma_m, params.max_line_offset_m);
    if (!estimate.line_level.through_m.allFinite() || !estimate.covariance.allFinite()) continue;  // of no length
    const Line& line = estimate.line_level;
    const auto onto_line = [&line](const Eigen::Vector2d& p) { return p - offset_m(line, p) * line.normal; };
    StraightPiece piece;
    piece.segment = index;
    piece.first = run.first;
    piece.count = run.count();
    piece.line_level = line;
    piece.covariance = estimate.covariance;
    piece.rms_m = rms_m(line, points + run.first, run.count());
    piece.right_level_m = onto_line(points[run.first].p_level_m);
    piece.left_level_m = onto_line(points[run.last].p_level_m);
    piece.right_end = run.first > whole.first || closed ? SegmentEnd::kContinues : segment.right_end;
    piece.left_end = run.last < whole.last || closed ? SegmentEnd::kContinues : segment.left_end;
    segments.straight_pieces.push_back(piece);
  }
}

}  // namespace

Line fit_line(const Point* points, std::size_t count) {
  Line line;
  for (std::size_t i = 0; i < count; ++i) line.through_m += points[i].p_level_m;
  line.through_m /= static_cast<double>(count);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d d = points[i].p_level_m - line.through_m;
    scatter += d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(scatter);
  line.normal = solver.eigenvectors().col(0);
  return line;
}

double rms_m(const Line& line, const Point* points, std::size_t count) {
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += std::pow(offset_m(line, points[i].p_level_m), 2);
  return std::sqrt(sum / static_cast<double>(count));
}

Bulge bulge_of(const Line& line, const Point* points, std::size_t count) {
  const Eigen::Vector2d direction = along(line);
  const double towards = line.normal.dot(line.through_m) > 0.0 ? -1.0 : 1.0;  // the sensor is at the origin
  Bulge bulge;
  double s2 = 0.0;
  double s3 = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double s = direction.dot(points[i].p_level_m - line.through_m);
    s2 += s * s;
    s3 += s * s * s;
    bulge.half_m = std::max(bulge.half_m, std::abs(s));
  }
  if (!(s2 > 0.0)) return bulge;
  double rq = 0.0;
  double qq = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d d = points[i].p_level_m - line.through_m;
    const double s = direction.dot(d);
    const double q = s * s - s2 / static_cast<double>(count) - s3 / s2 * s;  // the part of s^2 orthogonal to all lines
    rq += towards * line.normal.dot(d) * q;
    qq += q * q;
  }
  if (qq > 0.0) bulge.ratio = -rq / qq * bulge.half_m;
  return bulge;
}

LineEstimate estimate_line(const Point* points, std::size_t count, double range_sigma_m) {
  return refine_line(fit_line(points, count), points, count, range_sigma_m, std::numeric_limits<double>::infinity());
}

Segments with_straight_pieces(Segments segments, const SegmentationParams& params, double range_sigma_m) {
  thread_local LinesWorkspace work;
  segments.straight_pieces.clear();
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    if (segments.segments[i].kind == SegmentKind::kStructure) add_pieces(segments, i, params, range_sigma_m, work);
  }
  return segments;
}

}  // namespace situation_awareness
