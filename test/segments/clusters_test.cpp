// SPDX-License-Identifier: BSD-3-Clause
// pcl::EuclideanClusterExtraction as an oracle of the segmentation.
//
// A cluster holds all hits that a chain of steps up to the tolerance connects, wherever they are in the scan. A segment
// holds hits that follow one another in the scan. With the tolerance at max_gap_m, and max_range_gap_m no smaller, the
// two are the same but for three differences, each intended:
//   * coarse beams: far away or at grazing incidence neighbouring beams are further apart than the tolerance. The
//     segmentation adds their spacing to its gap, so that it holds together what the clusters tear apart.
//   * interruption: something nearer cuts a thing in two, or things touch that beams between them part. What is behind
//     is not known, so these are several segments, and one cluster.
//   * missing beams: more than max_missing_beams without a return part two segments, however near they are.
// A fourth one arises where max_range_gap_m is smaller than the tolerance: a step in range parts two segments.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <utility>
#include <vector>

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/segmentation/extract_clusters.h>

#include "support/level_scene.hpp"
#include "support/segment_scan.hpp"

namespace situation_awareness {
namespace {

constexpr double kTolerance_m = 0.2;

using Partition = std::set<std::set<int>>;  // of beams

/// Every hit is in a segment, unless it is alone.
SegmentationParams params_without_limits() {
  SegmentationParams params;
  params.max_gap_m = kTolerance_m;
  params.max_range_gap_m = kTolerance_m;
  params.min_points_fraction = 0.0;
  params.min_points = 2;
  return params;
}

std::vector<Point> hits_of(const Points& points) {
  std::vector<Point> hits;
  for (const Point& point : points.points) {
    if (is_hit(point.state)) hits.push_back(point);
  }
  return hits;
}

/// Of each hit the index of its cluster.
std::vector<std::size_t> clusters_of(const std::vector<Point>& hits) {
  const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  for (const Point& hit : hits) {
    cloud->push_back(pcl::PointXYZ(static_cast<float>(hit.p_level_m.x()), static_cast<float>(hit.p_level_m.y()), 0.0F));
  }
  pcl::EuclideanClusterExtraction<pcl::PointXYZ> extraction;
  extraction.setClusterTolerance(kTolerance_m);
  extraction.setMinClusterSize(1);
  extraction.setInputCloud(cloud);
  std::vector<pcl::PointIndices> found;
  extraction.extract(found);
  std::vector<std::size_t> result(hits.size(), found.size());
  for (std::size_t c = 0; c < found.size(); ++c) {
    for (const int i : found[c].indices) result[static_cast<std::size_t>(i)] = c;
  }
  return result;
}

/// Of each hit the index of its segment; a hit that is alone is a segment of its own here.
std::vector<std::size_t> segments_of(const std::vector<Point>& hits, const Points& points,
                                     const SegmentationParams& params) {
  const Segments segments = segment(points, params);
  std::vector<std::size_t> of_beam(points.points.size());
  for (std::size_t i = 0; i < of_beam.size(); ++i) of_beam[i] = segments.segments.size() + i;
  for (std::size_t s = 0; s < segments.segments.size(); ++s) {
    const Segment& one = segments.segments[s];
    for (std::size_t i = one.first; i < one.first + one.count; ++i) {
      of_beam[static_cast<std::size_t>(segments.points[i].beam)] = s;
    }
  }
  std::vector<std::size_t> result;
  for (const Point& hit : hits) result.push_back(of_beam[static_cast<std::size_t>(hit.beam)]);
  return result;
}

Partition partition(const std::vector<Point>& hits, const std::vector<std::size_t>& group_of) {
  std::vector<std::set<int>> groups(1 + *std::max_element(group_of.begin(), group_of.end()));
  for (std::size_t i = 0; i < hits.size(); ++i) groups[group_of[i]].insert(hits[i].beam);
  Partition result(groups.begin(), groups.end());
  result.erase(std::set<int>{});
  return result;
}

struct Both {
  Partition segments;
  Partition clusters;
};

Both both_of(const Scan& scan, const SegmentationParams& params = params_without_limits()) {
  const Points points = project_horizontally(scan, Eigen::Isometry3d::Identity());
  const std::vector<Point> hits = hits_of(points);
  return {partition(hits, segments_of(hits, points, params)), partition(hits, clusters_of(hits))};
}

/// The sets of beams first..last.
Partition runs(const std::vector<std::pair<int, int>>& firsts_and_lasts) {
  Partition result;
  for (const auto& [first, last] : firsts_and_lasts) {
    std::set<int> beams;
    for (int beam = first; beam <= last; ++beam) beams.insert(beam);
    result.insert(beams);
  }
  return result;
}

// --- random scenes --------------------------------------------------------------------------------------------------

// Things with free beams and much room between them, near enough for close beams: no difference.
TEST(Clusters, AreTheSegmentsOfSeparateObjects) {
  Random random(1);
  std::size_t things = 0;
  for (int i = 0; i < 200; ++i) {
    LevelScene scene;
    const double first_rad = random.uniform(radians(-130.0), radians(-110.0));
    for (int k = 0; k < 5; ++k) {  // each in a sector of its own, of which it covers up to 2 * asin(0.4 / 1.5) = 31 deg
      const double azimuth_rad = first_rad + k * radians(50.0);
      const double range_m = random.uniform(1.5, 5.0);
      const double rx_m = random.uniform(0.05, 0.4);
      scene.ellipses.push_back({range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)),
                                random.uniform(-kPi / 2.0, kPi / 2.0), rx_m, rx_m * random.uniform(0.6, 1.0)});
    }
    const Both both = both_of(scene.scan(&random, 0.005));
    EXPECT_EQ(both.segments, both.clusters) << "scene " << i;
    EXPECT_EQ(both.clusters.size(), scene.ellipses.size()) << "scene " << i;
    things += both.clusters.size();
  }
  EXPECT_EQ(things, 1000U);
}

// Anything anywhere: what is between walls, hidden, too near to one another, cut by beams without a return.
TEST(Clusters, DifferFromSegmentsOnlyAsStated) {
  Random random(2);
  const SegmentationParams params = params_without_limits();
  int coarse = 0, interrupted = 0, missing_beams = 0;
  for (int i = 0; i < 300; ++i) {
    LevelScene scene;
    scene.beams = 541;
    scene.angle_increment_rad = radians(0.5);
    scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}, {{6.0, 8.0}, {-3.0, 8.0}}};
    for (int k = 0; k < 12; ++k) {
      const Eigen::Vector2d center_m(random.uniform(-5.0, 5.5), random.uniform(-5.0, 5.0));
      const double rx_m = random.uniform(0.02, 0.5);
      if (center_m.norm() < 1.0) continue;
      scene.ellipses.push_back(
          {center_m, random.uniform(-kPi / 2.0, kPi / 2.0), rx_m, rx_m * random.uniform(0.3, 1.0)});
    }
    Scan scan = scene.scan(&random, 0.01);
    for (int gap = 0; gap < 6; ++gap) {  // beams without a return, fewer and more than are bridged
      const auto first = static_cast<std::size_t>(random.uniform(0.0, 530.0));
      const auto count = static_cast<std::size_t>(random.uniform(1.0, 7.0));
      for (std::size_t k = first; k < first + count; ++k) scan.beams[k].state = BeamState::kInvalid;
    }
    const Points points = project_horizontally(scan, Eigen::Isometry3d::Identity());
    const std::vector<Point> hits = hits_of(points);
    const std::vector<std::size_t> segment_of = segments_of(hits, points, params);
    const std::vector<std::size_t> cluster_of = clusters_of(hits);

    // Hits that follow one another.
    std::vector<bool> parted(hits.size(), false);  // from the hit before, by a gap or missing beams
    for (std::size_t k = 1; k < hits.size(); ++k) {
      const Point &a = hits[k - 1], &b = hits[k];
      const double distance_m = (b.p_level_m - a.p_level_m).norm();
      const double spacing_m = std::min(a.range_m, b.range_m) * (b.azimuth_rad - a.azimuth_rad);
      const bool bridged = b.beam - a.beam - 1 <= params.max_missing_beams;
      parted[k] = distance_m > kTolerance_m || !bridged;
      if (segment_of[k - 1] == segment_of[k]) {
        EXPECT_TRUE(bridged);
        if (cluster_of[k - 1] == cluster_of[k]) continue;
        EXPECT_GT(distance_m, kTolerance_m);
        EXPECT_LE(distance_m, kTolerance_m + spacing_m);
        ++coarse;
      } else {
        EXPECT_TRUE(parted[k]) << "scene " << i << ", beam " << b.beam;
      }
    }
    // Hits of one cluster in several segments: somewhere between them the scan is parted.
    std::vector<std::size_t> latest(hits.size(), hits.size());  // hit of each cluster so far
    for (std::size_t k = 0; k < hits.size(); ++k) {
      const std::size_t before = latest[cluster_of[k]];
      latest[cluster_of[k]] = k;
      if (before == hits.size() || segment_of[before] == segment_of[k]) continue;
      const auto from = parted.begin() + static_cast<std::ptrdiff_t>(before) + 1;
      const auto to = parted.begin() + static_cast<std::ptrdiff_t>(k) + 1;
      EXPECT_GT(std::count(from, to, true), 0) << "scene " << i << ", beam " << hits[k].beam;
      const bool only_missing = before + 1 == k && (hits[k].p_level_m - hits[before].p_level_m).norm() <= kTolerance_m;
      ++(only_missing ? missing_beams : interrupted);
    }
  }
  // Each kind of difference was there.
  EXPECT_GT(coarse, 30);
  EXPECT_GT(interrupted, 30);
  EXPECT_GT(missing_beams, 30);
}

// --- each difference alone ---------------------------------------------------------------------------------

/// A wall across the view of 41 beams, one degree apart; beam 20 looks straight at it.
LevelScene wall(double distance_m) {
  LevelScene scene;
  scene.beams = 41;
  scene.angle_min_rad = radians(-20.0);
  scene.angle_increment_rad = radians(1.0);
  scene.walls = {{{distance_m, -20.0}, {distance_m, 20.0}}};
  return scene;
}

TEST(Clusters, AndSegmentsAreOneForAWall) {
  const LevelScene scene = wall(3.0);
  const Both both = both_of(scene.scan());
  EXPECT_EQ(both.segments, runs({{0, 40}}));
  EXPECT_EQ(both.clusters, runs({{0, 40}}));
}

TEST(Clusters, SplitObjectsUnderCoarseBeams) {
  const LevelScene scene = wall(15.0);  // 0.26 m from beam to beam
  const Both both = both_of(scene.scan());
  EXPECT_EQ(both.segments, runs({{0, 40}}));
  EXPECT_EQ(both.clusters.size(), 41U);
}

TEST(Clusters, JoinAcrossAnOccluder) {
  LevelScene scene = wall(1.5);
  scene.ellipses = {{{1.0, 0.0}, 0.0, 0.02, 0.02}};  // hides 0.1 m of the wall
  const Both both = both_of(scene.scan());
  EXPECT_EQ(both.segments, runs({{0, 18}, {19, 21}, {22, 40}}));
  Partition expected = runs({{19, 21}});
  std::set<int> cut = *runs({{0, 40}}).begin();
  for (const int beam : {19, 20, 21}) cut.erase(beam);
  expected.insert(cut);
  EXPECT_EQ(both.clusters, expected);
}

TEST(Clusters, BridgeAnyNumberOfMissingBeams) {
  const LevelScene scene = wall(1.0);  // 0.018 m from beam to beam
  const SegmentationParams params = params_without_limits();
  for (const int missing : {params.max_missing_beams, params.max_missing_beams + 1}) {
    Scan scan = scene.scan();
    std::set<int> seen = *runs({{0, 40}}).begin();
    for (int k = 10; k < 10 + missing; ++k) {
      scan.beams[static_cast<std::size_t>(k)].state = BeamState::kInvalid;
      seen.erase(k);
    }
    const Both both = both_of(scan, params);
    EXPECT_EQ(both.clusters, Partition{seen});
    if (missing == params.max_missing_beams) {
      EXPECT_EQ(both.segments, Partition{seen});
    } else {
      EXPECT_EQ(both.segments, runs({{0, 9}, {10 + missing, 40}}));
    }
  }
}

TEST(Clusters, IgnoreStepsInRange) {
  LevelScene scene = wall(3.0);
  scene.walls = {{{3.0, -20.0}, {3.0, 0.01}}, {{3.15, 0.01}, {3.15, 20.0}}};
  SegmentationParams params = params_without_limits();
  const Both both = both_of(scene.scan(), params);
  EXPECT_EQ(both.segments, both.clusters);
  params.max_range_gap_m = 0.1;
  const Both stepped = both_of(scene.scan(), params);
  EXPECT_EQ(stepped.clusters, runs({{0, 40}}));
  EXPECT_EQ(stepped.segments, runs({{0, 20}, {21, 40}}));
}

}  // namespace
}  // namespace situation_awareness
