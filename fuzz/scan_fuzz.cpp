// SPDX-License-Identifier: BSD-3-Clause
// From any scan, with any pose and any parameters, to segments.
#include <set>
#include <stdexcept>
#include <string>

#include "input.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/segments/divide.hpp"
#include "situation_awareness/segments/lines.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/covariance.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::fuzz {
namespace {

constexpr std::size_t kMaxBeams = 600;

/// A scan of a few objects, with arbitrary ranges in some places.
Scan draw_scan(Input& input) {
  LevelScene scene;
  scene.beams = static_cast<int>(input.count(kMaxBeams));
  if (input.flag()) {
    scene.angle_increment_rad = input.any<double>();
    scene.angle_min_rad = input.any<double>();
  } else {
    const double sweep_rad = input.uniform(0.0, 2.0 * kPi * (1.0 + 2e-4));
    scene.angle_increment_rad = (input.flag() ? 1.0 : -1.0) * sweep_rad / std::max(1, scene.beams - 1);
    scene.angle_min_rad = input.coordinate(kPi, 1e6);
  }
  for (std::size_t i = input.count(4); i > 0; --i) scene.ellipses.push_back(input.ellipse());
  for (std::size_t i = input.count(2); i > 0; --i) {
    const Eigen::Vector2d from(input.coordinate(10.0, 1e3), input.coordinate(10.0, 1e3));
    scene.walls.push_back({from, {input.coordinate(10.0, 1e3), input.coordinate(10.0, 1e3)}});
  }
  scene.max_range_m = input.flag() ? 30.0 : 1e4;
  Scan scan = scene.scan();
  for (Beam& beam : scan.beams) {
    if (beam.state == BeamState::kHit) beam = beam_from_range(beam.range_m, 0.0F, 1e5F);
  }
  scan.stamp_ns = input.any_int64();
  scan.time_increment_s = input.flag() ? 0.0 : input.uniform(0.0, 1e-3);
  const float range_min_m = input.flag() ? 0.1F : input.any<float>();
  const float range_max_m = input.flag() ? 30.0F : input.any<float>();
  for (std::size_t runs = input.count(8); runs > 0 && !scan.beams.empty(); --runs) {
    const std::size_t first = input.count(scan.beams.size() - 1);
    const std::size_t last = std::min(first + input.count(30), scan.beams.size() - 1);
    const float range_m = input.any<float>();
    const bool all_any = input.flag();
    for (std::size_t i = first; i <= last; ++i) {
      scan.beams[i] = beam_from_range(all_any ? input.any<float>() : range_m, range_min_m, range_max_m);
    }
  }
  return scan;
}

Eigen::Isometry3d draw_pose(Input& input) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << input.coordinate(10.0, 1e6), input.coordinate(10.0, 1e6), input.coordinate(10.0, 1e6);
  const Eigen::Quaterniond rotation(input.uniform(-1.0, 1.0), input.uniform(-1.0, 1.0), input.uniform(-1.0, 1.0),
                                    input.uniform(-1.0, 1.0));
  if (input.flag() && rotation.norm() > 1e-3) {
    T.linear() = rotation.normalized().toRotationMatrix();
  } else {
    T.linear() = Eigen::AngleAxisd(input.uniform(-kPi, kPi), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  }
  return T;
}

/// A pose after a little motion, as during a sweep, or any pose.
Eigen::Isometry3d draw_end(Input& input, const Eigen::Isometry3d& T_world_lidar) {
  if (input.flag()) return T_world_lidar;
  if (input.integer(0, 3) == 0) return draw_pose(input);
  Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
  step.translation() << input.coordinate(0.1, 100.0), input.coordinate(0.1, 100.0), input.coordinate(0.1, 100.0);
  step.linear() = Eigen::AngleAxisd(input.uniform(-0.5, 0.5), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T_world_lidar * step;
}

RangeLimiterParams draw_limits(Input& input) {
  auto params = draw_params<RangeLimiterParams>(input);
  for (std::size_t i = input.count(3); i > 0; --i) {
    params.volume.push_back({{input.any<double>(), input.any<double>(), input.any<double>()}, input.any<double>()});
  }
  return params;
}

bool same(const Beam& a, const Beam& b) { return a.range_m == b.range_m && a.state == b.state; }

Scan check_limit_range(const Scan& scan, const Eigen::Isometry3d& T_world_lidar, const RangeLimiterParams& params) {
  Scan limited = limit_range(scan, T_world_lidar, params);
  const Scan again = limit_range(limited, T_world_lidar, params);
  require(limited.beams.size() == scan.beams.size(), "the range limiter keeps the number of beams");
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    const Beam& before = scan.beams[i];
    const Beam& after = limited.beams[i];
    require(before.state == BeamState::kHit || same(before, after), "what is no hit stays as it is");
    require(before.state != BeamState::kHit || after.range_m == (is_hit(after.state) ? before.range_m : 0.0F),
            "a hit keeps its range");
    require(same(after, again.beams[i]), "what is limited once stays as it is");
  }
  return limited;
}

void check_points(const Points& points, const Scan& scan, bool moved) {
  require(points.stamp_ns == scan.stamp_ns, "points keep the stamp");
  const bool beyond_circle = moved || points.full_circle;
  require(beyond_circle ? points.points.size() <= scan.beams.size() : points.points.size() == scan.beams.size(),
          "one point per beam");
  require(points.resolution_rad >= 0.0 && std::isfinite(points.resolution_rad), "the resolution is a number");
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const Point& point = points.points[i];
    const auto beam = static_cast<std::size_t>(point.beam);
    require(point.beam >= 0 && beam < scan.beams.size(), "a point names its beam");
    require(point.state == scan.beams[beam].state, "a point has the state of its beam");
    const bool free = point.state == BeamState::kFree;
    require(std::isfinite(point.azimuth_rad) && point.p_level_m.allFinite(), "points are finite");
    require(point.range_m >= 0.0 && (free || std::isfinite(point.range_m)), "what is free alone may have no end");
    require(is_hit(point.state) || free || point.range_m == 0.0, "what is neither hit nor free has no range");
    require(i == 0 || point.azimuth_rad >= points.points[i - 1].azimuth_rad, "azimuths grow");
    if (!is_hit(point.state)) continue;
    require(std::abs(point.p_level_m.norm() - point.range_m) <= 1e-9 * point.range_m, "a point lies at its range");
    if (moved || point.range_m == 0.0) continue;
    const double azimuth_rad = std::atan2(point.p_level_m.y(), point.p_level_m.x());
    require(std::abs(wrap_to_pi(azimuth_rad - point.azimuth_rad)) < 1e-9, "a point lies on its azimuth");
  }
}

void check_segments(const Segments& segments, const Points& points, const SegmentationParams& params) {
  require(segments.free_space.azimuth_rad.size() == points.points.size() &&
              segments.free_space.range_m.size() == points.points.size(),
          "the free space has a value per point");
  std::set<int> beams;
  std::size_t end = 0;
  for (const Segment& segment : segments.segments) {
    require(segment.first >= end, "segments do not overlap and are in order");
    end = segment.first + segment.count;
    require(end <= segments.points.size(), "a segment names points that are there");
    require(segment.count >= static_cast<std::size_t>(std::min(params.min_points, params.min_narrow_points)),
            "a segment has enough points");
    for (const double hidden_rad : {segment.right_hidden_rad, segment.left_hidden_rad}) {
      require(std::isfinite(hidden_rad) && hidden_rad >= 0.0, "a hidden azimuth is a number >= 0");
    }
    require(!is_sure_silhouette(segment.right_end) || segment.right_hidden_rad == 0.0,
            "nothing is hidden at a sure silhouette");
    require((segment.kind == SegmentKind::kStructure) == (segment.structure != StructureReason::kNone),
            "a structure has its reason");
    require(!is_sure_silhouette(segment.left_end) || segment.left_hidden_rad == 0.0,
            "nothing is hidden at a sure silhouette");
    for (std::size_t i = segment.first; i < end; ++i) {
      const Point& point = segments.points[i];
      require(is_hit(point.state), "every point of a segment is a hit");
      require(beams.insert(point.beam).second, "a beam is in one segment at most");
      require(i == segment.first || point.azimuth_rad >= segments.points[i - 1].azimuth_rad,
              "azimuths grow within a segment");
    }
  }
  for (const RefusedRun& run : segments.refused_runs) {
    require(run.count > 0 && run.first + run.count <= segments.points.size(), "a refused run has points");
    for (std::size_t i = run.first; i < run.first + run.count; ++i) {
      require(beams.insert(segments.points[i].beam).second, "a beam is in one segment or one refused run");
    }
  }
  const auto hits =
      std::count_if(points.points.begin(), points.points.end(), [](const Point& point) { return is_hit(point.state); });
  require(beams.size() == static_cast<std::size_t>(hits) && segments.points.size() == beams.size(), "no hit is lost");
}

void require_same(const Segments& a, const Segments& b) {
  require(a.points.size() == b.points.size() && a.segments.size() == b.segments.size(), "memory does not matter");
  for (std::size_t i = 0; i < a.segments.size(); ++i) {
    require(a.segments[i].first == b.segments[i].first && a.segments[i].count == b.segments[i].count &&
                a.segments[i].kind == b.segments[i].kind,
            "memory does not matter");
  }
}

void check_straight_pieces(const Segments& segments, const SegmentationParams& params) {
  std::size_t end = 0;
  for (const StraightPiece& piece : segments.straight_pieces) {
    require(piece.segment < segments.segments.size(), "a straight piece names a segment that is there");
    const Segment& segment = segments.segments[piece.segment];
    require(segment.kind == SegmentKind::kStructure, "a straight piece is of a structure");
    require(piece.first >= std::max(end, segment.first), "straight pieces do not overlap and are in order");
    end = piece.first + piece.count;
    require(end <= segment.first + segment.count, "a straight piece is within its segment");
    require(piece.count >= static_cast<std::size_t>(params.min_line_points), "a straight piece has enough points");
    require(piece.line_level.through_m.allFinite() && std::abs(piece.line_level.normal.norm() - 1.0) < 1e-9,
            "a straight piece has a line");
    require(is_covariance(piece.covariance), "and its covariance");
    require(std::isfinite(piece.rms_m) && piece.right_level_m.allFinite() && piece.left_level_m.allFinite(),
            "and ends that are finite");
  }
}

void run(Input input) {
  const Scan scan = draw_scan(input);
  const Eigen::Isometry3d T_world_lidar = draw_pose(input);
  const Eigen::Isometry3d T_world_lidar_end = draw_end(input, T_world_lidar);
  const RangeLimiterParams limits = draw_limits(input);
  const auto params = draw_params<SegmentationParams>(input);
  params.validate();
  try {
    limits.validate();
  } catch (const std::invalid_argument&) {
    return;
  }
  if (*scan_defect(scan) != '\0') return;

  const Scan limited = check_limit_range(scan, T_world_lidar, limits);
  const bool refused = *projection_defect(limited, T_world_lidar, T_world_lidar_end) != '\0';
  Points points;
  try {
    points = project_horizontally(limited, T_world_lidar, T_world_lidar_end);
    require(!refused, "what has a defect is not projected");
  } catch (const std::invalid_argument&) {
    require(refused, "what has no defect is projected");
    return;
  }
  check_points(points, limited, T_world_lidar.matrix() != T_world_lidar_end.matrix());

  const Segments segments = segment(points, params);
  check_segments(segments, points, params);
  static Segments memory;  // of another input, which must have no effect
  memory = segment(points, params, std::move(memory));
  require_same(memory, segments);

  std::vector<ExpectedOutline> known_level;
  for (std::size_t i = input.count(4); i > 0; --i) known_level.push_back(input.ellipse());
  const Segments divided = divide(segments, known_level, params);
  check_segments(divided, points, params);
  require(divided.points.size() == segments.points.size(), "a division keeps all points");
  if (known_level.empty()) require_same(divided, segments);

  const double range_sigma_m = input.uniform(1e-4, 0.1);
  const Segments whole = with_straight_pieces(divided, params, range_sigma_m);
  check_straight_pieces(whole, params);
  require_same(whole, divided);
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}
