// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <stdexcept>
#include <string>
#include <vector>

#include "map/splinegons/outlines.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/splinegons/splinegon_map.hpp"

namespace situation_awareness::splinegon_fit_test {
namespace {

Splinegon fitted(const std::vector<SplinegonElement>& elements, bool closed, int vertices = 16) {
  SplinegonFitParams params;
  params.vertices = vertices;
  Splinegon splinegon;
  splinegon.closed = closed;
  SplinegonFit(params).fit(elements, closed, splinegon.vertices);
  return splinegon;
}

/// Largest break of the tangent where there is no corner.
double largest_break_rad(const Splinegon& splinegon) {
  double largest_rad = 0.0;
  const std::size_t n = splinegon.vertices.size();
  for (std::size_t k = splinegon.closed ? 0 : 1; k < arcs_of(splinegon); ++k) {
    if (splinegon.vertices[k].corner) continue;
    const Eigen::Vector2d before = point_at(splinegon, (k + n - 1) % n, 1.0).along_world;
    const Eigen::Vector2d after = point_at(splinegon, k, 0.0).along_world;
    largest_rad =
        std::max(largest_rad, std::abs(std::atan2(before.x() * after.y() - before.y() * after.x(), before.dot(after))));
  }
  return largest_rad;
}

std::size_t corners_of(const Splinegon& splinegon) {
  return static_cast<std::size_t>(std::count_if(splinegon.vertices.begin(), splinegon.vertices.end(),
                                                [](const SplinegonVertex& vertex) { return vertex.corner; }));
}

TEST(SplinegonFit, MeetsExactOutlines) {
  for (const int vertices : {16, 20}) {
    for (const Outline& outline : smooth_outlines()) {
      Random random(1);
      std::vector<SplinegonElement> elements = elements_of(outline, 0.15, 0.0, random);
      for (SplinegonElement& element : elements) element.variance_m2 = 1e-6;
      const Splinegon splinegon = fitted(elements, true, vertices);
      EXPECT_LT(hausdorff_m(outline, splinegon), vertices == 16 ? 0.017 : 0.009) << outline.name;
      EXPECT_NEAR(area_m2(splinegon) / outline.area_m2(), 1.0, 1e-4) << outline.name;
      EXPECT_EQ(splinegon.vertices.size(), 2U * static_cast<std::size_t>(vertices));
      EXPECT_EQ(corners_of(splinegon), 0U);
      EXPECT_LT(largest_break_rad(splinegon), 1e-9);
    }
  }
}

TEST(SplinegonFit, FindsTheCornersOfBoxes) {
  for (const double sigma_m : {0.001, 0.01, 0.03}) {
    for (const Outline& outline : cornered_outlines()) {
      for (int seed = 0; seed < 5; ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const Splinegon splinegon = fitted(elements_of(outline, 0.15, sigma_m, random), true);
        EXPECT_EQ(corners_of(splinegon), outline.corners) << outline.name;
        EXPECT_LT(hausdorff_m(outline, splinegon), 0.02 + 2.5 * sigma_m) << outline.name;
        EXPECT_LT(largest_break_rad(splinegon), 1e-9);
      }
    }
  }
}

TEST(SplinegonFit, MovesWithItsElements) {
  Random random(2);
  const std::vector<SplinegonElement> elements = elements_of(smooth_outlines()[3], 0.15, 0.01, random);
  const Pose2 T{{2000.0, -700.0}, 2.0};
  std::vector<SplinegonElement> moved = elements;
  for (SplinegonElement& element : moved) {
    element.p_world_m = T * element.p_world_m;
    element.normal_world = T.rotation() * element.normal_world;
  }
  const Splinegon a = fitted(elements, true), b = fitted(moved, true);
  ASSERT_EQ(a.vertices.size(), b.vertices.size());
  for (std::size_t k = 0; k < a.vertices.size(); ++k) {
    EXPECT_LT((T * a.vertices[k].p_world_m - b.vertices[k].p_world_m).norm(), 1e-6);
    EXPECT_NEAR(a.vertices[k].sigma_m, b.vertices[k].sigma_m, 1e-7);
  }
}

TEST(SplinegonFit, OutliersHardlyMoveIt) {
  for (const std::vector<Outline>& outlines : {smooth_outlines(), cornered_outlines()}) {
    for (const Outline& outline : outlines) {
      for (int seed = 0; seed < 5; ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        std::vector<SplinegonElement> elements = elements_of(outline, 0.15, 0.01, random);
        for (SplinegonElement& element : elements) {
          if (random.uniform() < 0.05) element.p_world_m += random.uniform(-1.0, 1.0) * element.normal_world;
        }
        const Splinegon splinegon = fitted(elements, true);
        EXPECT_LT(hausdorff_m(outline, splinegon), 0.04) << outline.name;
        EXPECT_EQ(corners_of(splinegon), outline.corners) << outline.name;
      }
    }
  }
}

TEST(SplinegonFit, VariancesThatAreTooSmallAreRaised) {
  for (const Outline& outline : cornered_outlines()) {
    Random random(8);
    std::vector<SplinegonElement> elements = elements_of(outline, 0.15, 0.02, random);
    const Splinegon expected = fitted(elements, true);
    for (SplinegonElement& element : elements) element.variance_m2 /= 9.0;
    const Splinegon splinegon = fitted(elements, true);
    EXPECT_EQ(corners_of(splinegon), outline.corners);
    double ratio = 0.0;
    for (std::size_t k = 0; k < expected.vertices.size(); ++k) {
      ratio +=
          splinegon.vertices[k].sigma_m / expected.vertices[k].sigma_m / static_cast<double>(expected.vertices.size());
    }
    EXPECT_NEAR(ratio, 1.0, 0.2);
  }
}

/// What was not seen is known less, and the envelope says so.
TEST(SplinegonFit, AGapIsBridgedAndUncertain) {
  for (const double gap_m : {1.0, 3.0, 6.0}) {
    double inside = 0.0, places = 0.0;
    for (const std::vector<Outline>& outlines : {smooth_outlines(), cornered_outlines()}) {
      for (const Outline& outline : outlines) {
        for (int seed = 0; seed < 4; ++seed) {
          Random random(static_cast<std::uint64_t>(seed));
          std::vector<SplinegonElement> elements = elements_of(outline, 0.15, 0.015, random);
          std::rotate(elements.begin(), elements.begin() + 1 + 70 * seed, elements.end());
          elements.resize(elements.size() - static_cast<std::size_t>(gap_m / 0.15));
          const Splinegon splinegon = fitted(elements, true);
          EXPECT_TRUE(is_simple(splinegon)) << outline.name;
          if (outline.corners == 0) {
            EXPECT_LT(hausdorff_m(outline, splinegon), gap_m < 5.0 ? 0.25 : 0.75) << outline.name;
          }
          for (std::size_t i = 0; i < outline.points_m.size(); i += 20) {
            inside += is_in_envelope(splinegon, outline.points_m[i]) ? 1.0 : 0.0;
            places += 1.0;
          }
        }
      }
    }
    EXPECT_GT(inside / places, 0.98) << gap_m;
  }
}

/// Of the wall: how much is inside the envelope, and how far it is from the boundary at most.
struct OfWall {
  double inside = 0.0, places = 0.0, worst_m = 0.0;

  void add(const Outline& outline, const Splinegon& splinegon) {
    for (std::size_t i = 0; i < outline.points_m.size(); i += 30) {
      const SplinegonPoint nearest = nearest_on(splinegon, outline.points_m[i]);
      const double distance_m = (nearest.p_world_m - outline.points_m[i]).norm();
      // An open one ends with its elements.
      const bool is_end =
          nearest.arc + 1 == arcs_of(splinegon) ? nearest.part == 1.0 : nearest.arc == 0 && nearest.part == 0.0;
      if (!outline.closed && is_end && distance_m < 0.3) continue;
      inside += distance_m <= kSigmasOf99Percent * nearest.sigma_m ? 1.0 : 0.0;
      places += 1.0;
      worst_m = std::max(worst_m, distance_m);
    }
  }
};

/// However many corners there are, and however long it is, and again from the fit before.
TEST(SplinegonFit, FollowsBuildingsStreetsAndBanks) {
  Random random(12);
  std::vector<Outline> outlines = {comb_outline(2, 8.0, 14.0, 14.0), comb_outline(6, 3.0, 2.0, 4.0),
                                   comb_outline(25, 2.0, 1.5, 3.0), stepped_outline(20, 2.0, 1.0),
                                   street_outline(400.0, random)};
  for (const int columns : {4, 8, 11, 16, 20, 24, 32}) {
    for (const double width_m : {0.5, 0.6, 1.0, 2.0}) {
      if (columns < 32 || width_m > 0.6) outlines.push_back(columns_outline(columns, width_m));
    }
  }
  for (const double length_m : {100.0, 300.0, 1000.0}) outlines.push_back(bank_outline(length_m, random));
  for (const Outline& outline : outlines) {
    OfWall of_wall;
    double astray_m = 0.0;  // what the boundary has where there is no wall
    for (int seed = 0; seed < 2; ++seed) {
      ObstacleBoundary boundary;
      boundary.closed = outline.closed;
      boundary.elements = elements_of(outline, 0.15, seed == 0 ? 0.01 : 0.003, random);
      SplinegonMap map{SplinegonMapParams(), SplinegonFitParams()};
      for (std::int64_t stamp_ns = 1; stamp_ns < 3; ++stamp_ns) {
        boundary.last_seen_ns = stamp_ns;
        const Splinegons& splinegons = map.update(stamp_ns, {boundary});
        ASSERT_EQ(splinegons.boundaries.size(), 1U) << outline.name;
        EXPECT_EQ(splinegons.boundaries[0].closed, outline.closed) << outline.name;
        of_wall.add(outline, splinegons.boundaries[0]);
        if (outline.closed && stamp_ns == 2) {
          astray_m = std::max(astray_m, hausdorff_m(outline, splinegons.boundaries[0]));
        }
      }
    }
    EXPECT_GT(of_wall.inside / of_wall.places, 0.98) << outline.name;
    EXPECT_LT(of_wall.worst_m, 0.1) << outline.name;
    EXPECT_LT(astray_m, 0.1) << outline.name;
  }
}

/// What it meets with the usual number has no more.
TEST(SplinegonFit, HasNoMoreVerticesThanItTakes) {
  std::vector<Outline> outlines = smooth_outlines();
  outlines.push_back(polar_outline("circle", [](double) { return 5.0; }));
  outlines.push_back(polar_outline("large circle", [](double) { return 60.0; }));
  outlines.push_back(box_outline());
  outlines.push_back(polygon_outline("hall", {{-80.0, -40.0}, {80.0, -40.0}, {80.0, 40.0}, {-80.0, 40.0}}));
  for (const Outline& outline : outlines) {
    Random random(13);
    SplinegonFit fit{SplinegonFitParams()};
    std::vector<SplinegonVertex> vertices;
    for (int scan = 0; scan < 20; ++scan) fit.fit(elements_of(outline, 0.15, 0.01, random), true, vertices);
    EXPECT_EQ(vertices.size(), 32U) << outline.name;
  }
}

/// A curve that no arc meets in between: what is off is told.
TEST(SplinegonFit, TellsWhatArcsDoNotFollow) {
  for (const double tooth_m : {0.3, 0.45}) {
    Random random(14);
    std::vector<Eigen::Vector2d> corners_m = {{0.0, -5.0}, {20.0, -5.0}};
    for (int i = 20; i > 0; --i) {
      corners_m.emplace_back(i, 0.0);
      corners_m.emplace_back(i - 0.5, tooth_m);
    }
    corners_m.emplace_back(0.0, 0.0);
    const Outline outline = polygon_outline("saw", corners_m);
    Splinegon splinegon;
    splinegon.closed = true;
    SplinegonFit fit{SplinegonFitParams()};
    fit.fit(elements_of(outline, 0.15, 0.01, random), true, splinegon.vertices);
    OfWall of_wall;
    of_wall.add(outline, splinegon);
    EXPECT_GT(of_wall.inside / of_wall.places, 0.95) << tooth_m;
    EXPECT_LT(of_wall.worst_m, 0.15) << tooth_m;
  }
}

/// CPU time of a fit from nothing.
double cost_s(const Outline& outline) {
  Random random(15);
  const std::vector<SplinegonElement> elements = elements_of(outline, 0.15, 0.01, random);
  SplinegonFit fit{SplinegonFitParams()};
  double least_s = 1e9;
  for (int round = 0; round < 3; ++round) {
    Splinegon splinegon;
    const std::clock_t begin = std::clock();
    fit.fit(elements, false, splinegon.vertices);
    is_simple(splinegon);
    least_s = std::min(least_s, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  return least_s;
}

TEST(SplinegonFit, TakesTimeInProportionToTheLength) {
  Random random(16);
  const Outline bank = bank_outline(2000.0, random), street = street_outline(2000.0, random);
  for (const Outline& whole : {bank, street}) {
    Outline part = whole;
    part.points_m.resize(part.points_m.size() / 8);
    EXPECT_LT(cost_s(whole), 24.0 * cost_s(part)) << whole.name;  // of 8 times the length
  }
}

/// As a boundary is seen bit by bit.
TEST(SplinegonFit, GrowsWithItsElements) {
  for (const std::vector<Outline>& outlines : {smooth_outlines(), cornered_outlines()}) {
    for (const Outline& outline : outlines) {
      Random random(9);
      const std::vector<SplinegonElement> all = elements_of(outline, 0.15, 0.01, random);
      SplinegonFit fit{SplinegonFitParams()};
      Splinegon splinegon;
      for (std::size_t n = 12; n <= all.size(); n += 6) {
        const std::vector<SplinegonElement> seen(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(n));
        fit.fit(seen, false, splinegon.vertices);
        EXPECT_TRUE(is_simple(splinegon));
        double farthest_m = 0.0;
        for (const SplinegonPoint& point : sampled(splinegon, 0.1)) {
          double least_m2 = 1e9;
          for (std::size_t i = 0; i < outline.points_m.size(); i += 5) {
            least_m2 = std::min(least_m2, (outline.points_m[i] - point.p_world_m).squaredNorm());
          }
          farthest_m = std::max(farthest_m, std::sqrt(least_m2));
        }
        EXPECT_LT(farthest_m, 0.06) << outline.name << ' ' << n;
      }
    }
  }
}

TEST(SplinegonFit, OpenStaysOpenAndEndsWithItsElements) {
  for (const Outline& outline : smooth_outlines()) {
    for (const double to : {0.05, 0.2, 0.5, 0.9}) {
      Random random(4);
      const std::vector<SplinegonElement> elements = elements_of(outline, 0.15, 0.01, random, 0.0, to);
      const Splinegon splinegon = fitted(elements, false);
      ASSERT_GE(splinegon.vertices.size(), 3U);
      EXPECT_EQ(splinegon.vertices.size() % 2, 1U);
      EXPECT_EQ(splinegon.vertices.back().bulge, 0.0);
      EXPECT_LT((splinegon.vertices.front().p_world_m - elements.front().p_world_m).norm(), 0.06);
      EXPECT_LT((splinegon.vertices.back().p_world_m - elements.back().p_world_m).norm(), 0.06);
      for (const SplinegonElement& element : elements) {
        EXPECT_LT(distance_m(splinegon, element.p_world_m), 0.06) << outline.name << ' ' << to;
      }
      EXPECT_LT(largest_break_rad(splinegon), 1e-9);
    }
  }
}

TEST(SplinegonFit, BeginsWithTheFitBefore) {
  for (const Outline& outline : smooth_outlines()) {
    Random random(6);
    SplinegonFit fit{SplinegonFitParams()};
    Splinegon splinegon;
    splinegon.closed = true;
    EXPECT_FALSE(fit.fit(elements_of(outline, 0.15, 0.01, random), true, splinegon.vertices).warm);
    std::vector<SplinegonElement> later = elements_of(outline, 0.15, 0.01, random);
    std::rotate(later.begin(), later.begin() + 100, later.end());  // the elements may begin anywhere
    EXPECT_TRUE(fit.fit(later, true, splinegon.vertices).warm);
    EXPECT_LT(hausdorff_m(outline, splinegon), 0.025) << outline.name;
    // That of another boundary is of no use.
    for (SplinegonElement& element : later) element.p_world_m.x() += 20.0;
    EXPECT_FALSE(fit.fit(later, true, splinegon.vertices).warm);
  }
}

TEST(SplinegonFit, OfTooLittleThereIsNothing) {
  Random random(7);
  std::vector<SplinegonElement> elements = elements_of(ellipse_outline(), 0.15, 0.01, random);
  elements.resize(5);
  EXPECT_TRUE(fitted(elements, false).vertices.empty());
  std::vector<SplinegonElement> one_place(20, elements[0]);
  EXPECT_TRUE(fitted(one_place, true).vertices.empty());
}

/// Elements without order: what comes out is a splinegon, or nothing.
TEST(SplinegonFit, OfDisorderThereIsNothingInvalid) {
  Random random(10);
  SplinegonFit fit{SplinegonFitParams()};
  std::vector<SplinegonVertex> vertices;
  for (int trial = 0; trial < 500; ++trial) {
    const bool closed = random.uniform() < 0.5;
    const double height_m = trial % 3 == 0 ? 0.0 : random.uniform();
    std::vector<SplinegonElement> elements(static_cast<std::size_t>(60.0 * random.uniform()));
    for (SplinegonElement& element : elements) {
      element = {{std::round(3.0 * random.normal()), height_m * random.normal()}, {0.0, 1.0}, 1e-4};
    }
    fit.fit(elements, closed, vertices);
    for (std::size_t k = 0; k < vertices.size(); ++k) {
      EXPECT_TRUE(vertices[k].p_world_m.allFinite() && std::isfinite(vertices[k].bulge));
      EXPECT_GT(vertices[k].sigma_m, 0.0);
      EXPECT_GT((vertices[k].p_world_m - vertices[(k + 1) % vertices.size()].p_world_m).norm(), 0.0);
    }
  }
}

/// Where elements are missing here and there, main vertices and polygons meet at places that hardly any element tells.
TEST(SplinegonFit, GoesNowhereThereAndBack) {
  for (const double missing : {0.3, 0.6}) {
    for (const double sigma_m : {0.003, 0.01}) {
      for (const Outline& outline : cornered_outlines()) {
        for (int seed = 0; seed < 30; ++seed) {
          Random random(static_cast<std::uint64_t>(seed));
          std::vector<SplinegonElement> elements;
          for (const SplinegonElement& element : elements_of(outline, 0.15, sigma_m, random)) {
            if (random.uniform() >= missing) elements.push_back(element);
          }
          const std::vector<SplinegonVertex> vertices = fitted(elements, true).vertices;
          ASSERT_GE(vertices.size(), 4U);
          for (std::size_t k = 0; k < vertices.size(); ++k) {
            const Eigen::Vector2d& at = vertices[k].p_world_m;
            const Eigen::Vector2d before = at - vertices[(k + vertices.size() - 1) % vertices.size()].p_world_m;
            const Eigen::Vector2d after = vertices[(k + 1) % vertices.size()].p_world_m - at;
            EXPECT_GT(before.dot(after), -0.5 * before.norm() * after.norm())
                << outline.name << " " << seed << " at " << at.transpose();
          }
        }
      }
    }
  }
}

TEST(SplinegonFit, RefusesBadParameters) {
  SplinegonFitParams params;
  params.vertices = 3;
  EXPECT_THROW(SplinegonFit{params}, std::invalid_argument);
}

/// Hausdorff distance, area, and whether what is said of the error holds.
TEST(SplinegonFitStatistics, ErrorsAreSmallAndAsTheyAreSaidToBe) {
  constexpr int kSeeds = 10;
  for (const int vertices : {16, 20}) {
    std::vector<Outline> outlines = smooth_outlines();
    for (const Outline& outline : cornered_outlines()) outlines.push_back(outline);
    for (const Outline& outline : outlines) {
      SCOPED_TRACE(outline.name + ' ' + std::to_string(vertices));
      double hausdorff_sum_m = 0.0, area_sum = 0.0, squares = 0.0, inside = 0.0, places = 0.0;
      for (int seed = 0; seed < kSeeds; ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const Splinegon splinegon = fitted(elements_of(outline, 0.15, 0.01, random), true, vertices);
        EXPECT_TRUE(is_simple(splinegon));
        EXPECT_EQ(corners_of(splinegon), outline.corners);
        hausdorff_sum_m += hausdorff_m(outline, splinegon);
        area_sum += std::abs(area_m2(splinegon) / outline.area_m2() - 1.0);
        for (std::size_t i = 0; i < outline.points_m.size(); i += 20) {
          const SplinegonPoint nearest = nearest_on(splinegon, outline.points_m[i]);
          const double sigmas = (nearest.p_world_m - outline.points_m[i]).norm() / nearest.sigma_m;
          squares += sigmas * sigmas;
          inside += sigmas < kSigmasOf99Percent ? 1.0 : 0.0;
          places += 1.0;
        }
      }
      std::array<char, 128> text{};
      std::snprintf(text.data(), text.size(),
                    "Hausdorff %.2f cm, area %.4f %%, error / sigma %.2f, in envelope %.2f %%",
                    100.0 * hausdorff_sum_m / kSeeds, 100.0 * area_sum / kSeeds, std::sqrt(squares / places),
                    100.0 * inside / places);
      RecordProperty(outline.name + '_' + std::to_string(vertices), text.data());
      EXPECT_LT(hausdorff_sum_m / kSeeds, outline.corners > 0 ? 0.03 : 0.015);
      EXPECT_LT(area_sum / kSeeds, 5e-4);
      EXPECT_GT(std::sqrt(squares / places), 0.6);
      EXPECT_LT(std::sqrt(squares / places), 1.6);
      EXPECT_GT(inside / places, 0.98);
    }
  }
}

}  // namespace
}  // namespace situation_awareness::splinegon_fit_test
