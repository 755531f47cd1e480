// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include "map/splinegons/outlines.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {
namespace {

Splinegon fitted(const std::vector<SplinegonElement>& elements, bool closed, int vertices = 16,
                 double common_variance_m2 = 0.0) {
  SplinegonFitParams params;
  params.vertices = vertices;
  Splinegon splinegon;
  splinegon.closed = closed;
  SplinegonFit(params).fit(elements, closed, common_variance_m2, splinegon.vertices);
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
        fit.fit(seen, false, 0.0, splinegon.vertices);
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

TEST(SplinegonFit, TheCommonErrorIsAdded) {
  Random random(5);
  const std::vector<SplinegonElement> elements = elements_of(ellipse_outline(), 0.15, 0.01, random);
  const Splinegon without = fitted(elements, true), with = fitted(elements, true, 16, 0.09);
  for (std::size_t k = 0; k < without.vertices.size(); ++k) {
    EXPECT_EQ(without.vertices[k].p_world_m, with.vertices[k].p_world_m);
    EXPECT_NEAR(with.vertices[k].sigma_m, std::hypot(without.vertices[k].sigma_m, 0.3), 1e-12);
  }
}

TEST(SplinegonFit, BeginsWithTheFitBefore) {
  for (const Outline& outline : smooth_outlines()) {
    Random random(6);
    SplinegonFit fit{SplinegonFitParams()};
    Splinegon splinegon;
    splinegon.closed = true;
    EXPECT_FALSE(fit.fit(elements_of(outline, 0.15, 0.01, random), true, 0.0, splinegon.vertices).warm);
    std::vector<SplinegonElement> later = elements_of(outline, 0.15, 0.01, random);
    std::rotate(later.begin(), later.begin() + 100, later.end());  // the elements may begin anywhere
    EXPECT_TRUE(fit.fit(later, true, 0.0, splinegon.vertices).warm);
    EXPECT_LT(hausdorff_m(outline, splinegon), 0.025) << outline.name;
    // That of another boundary is of no use.
    for (SplinegonElement& element : later) element.p_world_m.x() += 20.0;
    EXPECT_FALSE(fit.fit(later, true, 0.0, splinegon.vertices).warm);
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
    fit.fit(elements, closed, 1e-4, vertices);
    for (std::size_t k = 0; k < vertices.size(); ++k) {
      EXPECT_TRUE(vertices[k].p_world_m.allFinite() && std::isfinite(vertices[k].bulge));
      EXPECT_GT(vertices[k].sigma_m, 0.0);
      EXPECT_GT((vertices[k].p_world_m - vertices[(k + 1) % vertices.size()].p_world_m).norm(), 0.0);
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
}  // namespace situation_awareness
