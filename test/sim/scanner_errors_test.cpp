// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scanner_errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "support/aggregate_size.hpp"

namespace situation_awareness::scanner_errors_test {
namespace {

SimulatedScannerParams without_noise() {
  SimulatedScannerParams params;
  params.range_sigma_m = 0.0;
  return params;
}

const std::string kUser = R"(<size nuser_geom="1"/>)";

/// Scans of a scanner that stands at the origin, among geoms whose reflectivities are `user`.
std::vector<Scan> scans_of(const std::string& geoms, const SimulatedScannerParams& params, int count = 1,
                           std::uint64_t seed = 1) {
  const WorldFile file(world_text(kRobot + geoms, "", kUser));
  World world(file.path());
  SimulatedScanner scanner(world, world.T_robot_lidar(), params, seed);
  std::vector<Scan> scans;
  for (int i = 0; i < count; ++i) scans.push_back(scanner.next().scan);
  return scans;
}

/// A wall across x at this distance, 80 m long.
std::string wall_at(double distance_m, double diffuse = 0.5) {
  return "<geom type=\"box\" size=\"0.5 40 2\" pos=\"" + std::to_string(distance_m + 0.5) + " 0 1.5\" user=\"" +
         std::to_string(diffuse) + "\"/>";
}

double angle_of(const Scan& scan, std::size_t beam) {
  return scan.angle_min_rad + static_cast<double>(beam) * scan.angle_increment_rad;
}

/// Calls `visit(beam, angle, true range)` for the beams that a wall across x returns within 25 m, were it exact.
void for_each_on_wall(const Scan& scan, double distance_m,
                      const std::function<void(const Beam&, double, double)>& visit) {
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    const double angle = angle_of(scan, i);
    if (std::cos(angle) > distance_m / 25.0) visit(scan.beams[i], angle, distance_m / std::cos(angle));
  }
}

/// Within four standard deviations of a count of n cases with the probability p.
void expect_binomial(double count, double n, double p) {
  EXPECT_NEAR(count, n * p, 4.0 * std::sqrt(n * p * (1.0 - p))) << "of " << n;
}

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

TEST(ScannerErrors, DeclareAllTheirMembers) {
  EXPECT_EQ(declared_size<ScannerErrors>(), aggregate_size<ScannerErrors>());
  EXPECT_EQ(declared_size<SimulatedRingScannerParams>(), aggregate_size<SimulatedRingScannerParams>() - 2 +
                                                             declared_size<SimulatedIntensityParams>() +
                                                             declared_size<ScannerErrors>());
}

// --- ranges ---------------------------------------------------------------------------------------------------------

TEST(ScannerErrors, NoiseGrowsWithRangeAndIncidence) {
  SimulatedScannerParams params;
  params.range_sigma_m = 0.004;
  params.errors.range_sigma_slope = 0.003;
  params.errors.grazing_sigma_m = 0.02;
  for (const double distance_m : {1.0, 2.0, 6.0}) {
    const std::array<double, 4> first_m{distance_m, 1.2 * distance_m, 2.0 * distance_m, 4.0 * distance_m};
    std::array<double, 4> sum{}, sum_of_squares{}, n{};
    for (const Scan& scan : scans_of(wall_at(distance_m), params, 200)) {
      for_each_on_wall(scan, distance_m, [&](const Beam& beam, double angle, double range_m) {
        ASSERT_EQ(beam.state, BeamState::kHit);
        const double sigma_m = 0.004 + 0.003 * range_m + 0.02 * (1.0 - std::cos(angle));
        const double z = (beam.range_m - range_m) / sigma_m;
        std::size_t bin = 3;
        while (range_m < first_m[bin]) --bin;
        sum[bin] += z;
        sum_of_squares[bin] += z * z;
        n[bin] += 1.0;
      });
    }
    for (std::size_t bin = 0; bin < n.size(); ++bin) {
      ASSERT_GT(n[bin], 500.0);
      EXPECT_LT(std::abs(sum[bin]), 4.0 * std::sqrt(n[bin])) << distance_m << " m, bin " << bin;
      EXPECT_LT(std::abs(sum_of_squares[bin] - n[bin]), 4.0 * std::sqrt(2.0 * n[bin]))
          << distance_m << " m, bin " << bin;
    }
  }
}

TEST(ScannerErrors, BiasIsAPolynomialOfTheRangeAndGrowsWithTheIncidence) {
  SimulatedScannerParams params = without_noise();
  params.errors.range_bias_m = 0.02;
  params.errors.range_bias_slope = -0.008;
  params.errors.range_bias_square_1_m = -0.006;
  params.errors.grazing_bias_m = 0.05;
  for (const double distance_m : {1.0, 5.0}) {
    for_each_on_wall(scans_of(wall_at(distance_m), params).front(), distance_m,
                     [](const Beam& beam, double angle, double r) {
                       ASSERT_EQ(beam.state, BeamState::kHit);
                       const double bias_m = 0.02 - 0.008 * r - 0.006 * r * r + 0.05 * (1.0 - std::cos(angle));
                       EXPECT_NEAR(beam.range_m, r + bias_m, 1e-5);
                     });
  }
}

TEST(ScannerErrors, QuantisedRangesAreTheNearestMultiples) {
  SimulatedScannerParams params = without_noise();
  params.errors.range_quantum_m = 0.01;
  const auto expect_multiple = [](double range_m) {
    EXPECT_NEAR(range_m / 0.01, std::round(range_m / 0.01), 1e-3) << range_m;
  };
  for_each_on_wall(scans_of(wall_at(3.0), params).front(), 3.0, [&](const Beam& beam, double /*angle*/, double r) {
    expect_multiple(beam.range_m);
    EXPECT_LE(std::abs(beam.range_m - r), 0.005 + 1e-5);
  });
  params.range_sigma_m = 0.03;
  for_each_on_wall(scans_of(wall_at(3.0), params).front(), 3.0,
                   [&](const Beam& beam, double /*angle*/, double /*r*/) { expect_multiple(beam.range_m); });
}

TEST(ScannerErrors, QuantisedRangesStayWithinTheLimits) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const double quantum_m = random.uniform(1e-4, 0.1), low_m = random.uniform(0.01, 1.0);
    const double high_m = low_m + quantum_m * random.uniform(1.0, 50.0), range_m = random.uniform(-1.0, 7.0);
    const double result_m = quantised(range_m, quantum_m, low_m, high_m);
    EXPECT_GE(result_m, low_m - 1e-12);
    EXPECT_LE(result_m, high_m + 1e-12);
    EXPECT_NEAR(result_m / quantum_m, std::round(result_m / quantum_m), 1e-9);
  }
}

TEST(ScannerErrors, TheBearingIsNoisy) {
  SimulatedScannerParams params = without_noise();
  params.errors.bearing_sigma_rad = 0.005;
  double sum = 0.0, sum_of_squares = 0.0, n = 0.0;
  for (const Scan& scan : scans_of(wall_at(3.0), params, 100)) {
    for_each_on_wall(scan, 3.0, [&](const Beam& beam, double angle, double /*range_m*/) {
      if (angle < radians(30.0) || angle > radians(70.0)) return;  // where the range says the direction
      const double z = (std::acos(3.0 / beam.range_m) - angle) / 0.005;
      sum += z;
      sum_of_squares += z * z;
      n += 1.0;
    });
  }
  ASSERT_GT(n, 10000.0);
  EXPECT_LT(std::abs(sum), 4.0 * std::sqrt(n));
  EXPECT_LT(std::abs(sum_of_squares - n), 4.0 * std::sqrt(2.0 * n));
}

// --- depth edges ----------------------------------------------------------------------------------------------------

// The face of a box at x = 2 m, 1 m wide, before a wall at x = 5 m.
const std::string kBox = R"(<geom type="box" size="0.5 0.5 1" pos="2.5 0 1.5"/>)";
const double kEdge_rad = std::atan2(0.5, 2.0);  // azimuth of the face's end, to either side
constexpr double kHalfWidth_rad = 0.01;         // of the beam

SimulatedScannerParams with_wide_beam() {
  SimulatedScannerParams params = without_noise();
  params.errors.beam_divergence_rad = 2.0 * kHalfWidth_rad;
  return params;
}

/// From the azimuth of an edge to a beam; above 0 on the wall's side.
double beyond_edge(double angle_rad) { return std::abs(angle_rad) - kEdge_rad; }

/// Whether the outermost rays of the beam are on different sides of an edge.
bool is_on_edge(double angle_rad) {
  return std::abs(beyond_edge(angle_rad)) < kHalfWidth_rad * place_in_beam(kRaysOfBeam - 1);
}

/// The mean range of a beam by the light returned, as an integral over its width.
double mixture(double angle_rad) {
  constexpr int kCount = 20000;
  double power = 0.0, sum_m = 0.0;
  for (int i = 0; i < kCount; ++i) {
    const double place = (2.0 * i + 1.0) / kCount - 1.0, cosine = std::cos(angle_rad + kHalfWidth_rad * place);
    const double range_m = (beyond_edge(angle_rad + kHalfWidth_rad * place) < 0.0 ? 2.0 : 5.0) / cosine;
    const double part = std::sqrt(1.0 - place * place) * cosine / (1.0 + range_m * range_m / 64.0);
    power += part;
    sum_m += part * range_m;
  }
  return sum_m / power;
}

TEST(DepthEdges, MixtureIsBetweenTheSurfacesAndNowhereElse) {
  const Scan exact = scans_of(kBox + wall_at(5.0), without_noise()).front();
  const Scan wide = scans_of(kBox + wall_at(5.0), with_wide_beam()).front();
  int mixed = 0;
  double before_m = 0.0;
  for (std::size_t i = 0; i < exact.beams.size(); ++i) {
    const double angle = angle_of(exact, i);
    const double range_m = wide.beams[i].range_m;
    if (!is_on_edge(angle)) {
      EXPECT_EQ(wide.beams[i].state, exact.beams[i].state);
      EXPECT_EQ(wide.beams[i].range_m, exact.beams[i].range_m) << angle;
      before_m = 0.0;
      continue;
    }
    ++mixed;
    EXPECT_GT(range_m, 2.0 / std::cos(angle) + 0.05);
    EXPECT_LT(range_m, 5.0 / std::cos(angle) - 0.05);
    EXPECT_NEAR(range_m, mixture(angle), 0.08 * 3.0);
    if (before_m > 0.0) {
      EXPECT_EQ(range_m > before_m, angle > 0.0) << "farther away from the box, more of the wall";
    }
    before_m = range_m;
  }
  EXPECT_GE(mixed, 6);
}

TEST(DepthEdges, FractionsOfMissingAndMixedBeams) {
  SimulatedScannerParams params = with_wide_beam();
  params.errors.edge_missing_fraction = 0.4;
  params.errors.edge_mixed_fraction = 0.25;
  double n = 0.0, missing = 0.0, mixed = 0.0;
  for (const Scan& scan : scans_of(kBox + wall_at(5.0), params, 400)) {
    for (std::size_t i = 0; i < scan.beams.size(); ++i) {
      const double angle = angle_of(scan, i), near_m = 2.0 / std::cos(angle), far_m = 5.0 / std::cos(angle);
      if (!is_on_edge(angle)) continue;
      n += 1.0;
      if (scan.beams[i].state != BeamState::kHit) {
        missing += 1.0;
      } else if (scan.beams[i].range_m > near_m + 0.05 && scan.beams[i].range_m < far_m - 0.05) {
        mixed += 1.0;
      } else {  // one of the surfaces
        EXPECT_LT(std::min(std::abs(scan.beams[i].range_m - near_m), std::abs(scan.beams[i].range_m - far_m)), 0.02);
      }
    }
  }
  ASSERT_GT(n, 2000.0);
  expect_binomial(missing, n, 0.4);
  expect_binomial(mixed, n - missing, 0.25);
}

TEST(DepthEdges, BeforeNothingWidensTheObject) {
  const Scan exact = scans_of(kBox, without_noise()).front(), wide = scans_of(kBox, with_wide_beam()).front();
  int more = 0;
  for (std::size_t i = 0; i < exact.beams.size(); ++i) {
    const double angle = angle_of(exact, i);
    const bool is_seen = beyond_edge(angle) < 0.0 || is_on_edge(angle);
    ASSERT_EQ(wide.beams[i].state == BeamState::kHit, is_seen) << angle;
    if (!is_seen) continue;
    EXPECT_NEAR(wide.beams[i].range_m, 2.0 / std::cos(angle), 0.02);
    more += exact.beams[i].state != BeamState::kHit ? 1 : 0;
  }
  EXPECT_GE(more, 4);
}

TEST(DepthEdges, AreStepsOfTheGivenDepth) {
  SimulatedScannerParams params = with_wide_beam();
  params.errors.edge_missing_fraction = 1.0;
  const auto missing = [&](double depth_m) {
    params.errors.edge_depth_m = depth_m;
    int count = 0;
    const Scan scan = scans_of(kBox + wall_at(2.3), params).front();
    for (const Beam& beam : scan.beams) count += beam.state != BeamState::kHit ? 1 : 0;
    return count;
  };
  // From 2 m to 2.3 m along the beam to the edge, 0.309 m; besides, directions without a wall have no return.
  EXPECT_GE(missing(0.30), missing(0.32) + 6);
  EXPECT_EQ(missing(0.32), missing(100.0));
}

TEST(DepthEdges, ABeamHasTheDiameterThatItLeavesTheScannerWith) {
  SimulatedScannerParams params = without_noise();
  params.errors.beam_diameter_m = 0.08;
  const Scan wide = scans_of(kBox + wall_at(5.0), params).front();
  int mixed = 0;
  for (std::size_t i = 0; i < wide.beams.size(); ++i) {
    const double angle = angle_of(wide, i), near_m = 2.0 / std::cos(angle);
    if (std::abs(angle) > 1.3 || wide.beams[i].range_m < near_m + 0.05 ||
        wide.beams[i].range_m > 5.0 / std::cos(angle) - 0.05) {
      continue;
    }
    ++mixed;
    const double from_corner_m = std::hypot(2.0, 0.5) * std::sin(std::abs(beyond_edge(angle)));
    EXPECT_LT(from_corner_m, 0.04) << "parallel rays";
  }
  EXPECT_NEAR(mixed, 2.0 * 0.08 * place_in_beam(kRaysOfBeam - 1) / std::hypot(2.0, 0.5) / radians(0.25), 2.0);
}

TEST(DepthEdges, TheBrightestSurfaceAndTheMeansByPower) {
  BeamRays rays;
  const auto set = [&rays](int first, int last, int surface, double range_m, double power) {
    for (int i = first; i <= last; ++i) rays[static_cast<std::size_t>(i)] = {surface, range_m, power};
  };
  set(0, 2, 7, 2.0, 1.0);
  set(3, 8, 4, 6.0, 0.25);
  EXPECT_TRUE(is_at_depth_edge(rays, 3.9));
  EXPECT_FALSE(is_at_depth_edge(rays, 4.1));
  const EdgeReturn pure = edge_return(rays, false), mixed = edge_return(rays, true);
  EXPECT_EQ(pure.ray, 2) << "its ray nearest to the axis";
  EXPECT_EQ(pure.range_m, 2.0);
  EXPECT_EQ(pure.power, 3.0);
  EXPECT_EQ(mixed.ray, 2);
  EXPECT_EQ(mixed.power, 4.5);
  EXPECT_DOUBLE_EQ(mixed.range_m, (3.0 * 2.0 + 1.5 * 6.0) / 4.5);
  double shares = 0.0;
  for (int i = 0; i < kRaysOfBeam; ++i) {
    shares += share_of_beam(i);
    EXPECT_DOUBLE_EQ(share_of_beam(i), share_of_beam(kRaysOfBeam - 1 - i));
  }
  EXPECT_NEAR(shares, 1.0, 1e-12);
  EXPECT_EQ(place_in_beam(kRaysOfBeam / 2), 0.0);
}

// --- beams without a return -----------------------------------------------------------------------------------------

/// Light from a diffuse wall by Lambert's law, with the default half range of 8 m.
double power_of(double diffuse, double range_m, double cos_incidence) {
  return diffuse * cos_incidence / (1.0 + range_m * range_m / 64.0);
}

TEST(DroppedReturns, OfSurfacesWithLessLightThanTheDarkOne) {
  SimulatedScannerParams params = without_noise();
  params.errors.dark_range_m = 4.0;
  const auto is_seen_ahead = [&](double distance_m, double diffuse) {
    return scans_of(wall_at(distance_m, diffuse), params).front().beams[540].state == BeamState::kHit;
  };
  EXPECT_TRUE(is_seen_ahead(3.99, 0.1));
  EXPECT_FALSE(is_seen_ahead(4.01, 0.1));
  EXPECT_TRUE(is_seen_ahead(4.01, 0.11));
  EXPECT_FALSE(is_seen_ahead(1.0, 0.05));
  const double least = power_of(0.1, 4.0, 1.0);
  for (const double diffuse : {0.15, 0.3, 0.9}) {
    int hits = 0, dropped = 0;
    for_each_on_wall(scans_of(wall_at(2.0, diffuse), params).front(), 2.0,
                     [&](const Beam& beam, double angle, double range_m) {
                       const double power = power_of(diffuse, range_m, std::cos(angle));
                       if (std::abs(power - least) < 1e-6) return;
                       ASSERT_EQ(beam.state, power > least ? BeamState::kHit : BeamState::kFree);
                       (power > least ? hits : dropped) += 1;
                     });
    EXPECT_GT(hits, 50);
    EXPECT_GT(dropped, 50);
  }
}

TEST(DroppedReturns, GrowWithIncidenceAndDarkness) {
  SimulatedScannerParams params = without_noise();
  params.errors.dark_range_m = 10.0;
  params.errors.detection_sigma = 0.4;
  const double least = power_of(0.1, 10.0, 1.0);
  std::array<double, 5> before{};  // share of beams dropped on the brighter wall, by incidence
  for (const double diffuse : {0.2, 0.1, 0.06}) {
    std::array<double, 5> n{}, dropped{}, expected{}, variance{};
    for (const Scan& scan : scans_of(wall_at(3.0, diffuse), params, 200)) {
      for_each_on_wall(scan, 3.0, [&](const Beam& beam, double angle, double range_m) {
        const auto bin = static_cast<std::size_t>(std::abs(angle) / radians(15.0));
        if (bin >= n.size()) return;
        const double p = normal_cdf((least / power_of(diffuse, range_m, std::cos(angle)) - 1.0) / 0.4);
        n[bin] += 1.0;
        dropped[bin] += beam.state != BeamState::kHit ? 1.0 : 0.0;
        expected[bin] += p;
        variance[bin] += p * (1.0 - p);
      });
    }
    for (std::size_t bin = 0; bin < n.size(); ++bin) {
      EXPECT_NEAR(dropped[bin], expected[bin], 4.0 * std::sqrt(variance[bin])) << diffuse << ", bin " << bin;
      const double share = dropped[bin] / n[bin];
      if (bin > 0) {
        EXPECT_GT(share, dropped[bin - 1] / n[bin - 1]) << diffuse << ", bin " << bin;
      }
      EXPECT_GT(share, before[bin]) << diffuse << ", bin " << bin;
      before[bin] = share;
    }
  }
}

TEST(DroppedReturns, OfWhatOnlyAPartOfTheBeamMeets) {
  SimulatedScannerParams params = with_wide_beam();
  params.errors.dark_range_m = 20.0;
  const auto hits = [&](const std::string& radius) {
    int count = 0;
    const std::string pole = "<geom type=\"cylinder\" size=\"" + radius + " 2\" pos=\"4 0 1.5\" user=\"0.1\"/>";
    const Scan scan = scans_of(pole, params).front();
    for (const Beam& beam : scan.beams) count += beam.state == BeamState::kHit ? 1 : 0;
    return count;
  };
  EXPECT_EQ(hits("0.003"), 0) << "a seventh of the light at most: of the middle ray";
  EXPECT_GT(hits("0.1"), 5);
}

TEST(DroppedReturns, BeamsAreMissingAtRandomAndTheOthersAsTheyWere) {
  SimulatedScannerParams params, plain;
  params.errors.missing_fraction = 0.2;
  const std::vector<Scan> some = scans_of(wall_at(3.0), params, 20), all = scans_of(wall_at(3.0), plain, 20);
  double n = 0.0, missing = 0.0;
  for (std::size_t s = 0; s < all.size(); ++s) {
    for (std::size_t i = 0; i < all[s].beams.size(); ++i) {
      const Beam &beam = some[s].beams[i], &whole = all[s].beams[i];
      if (beam.state == BeamState::kHit) {
        ASSERT_EQ(beam.range_m, whole.range_m);
      } else {
        EXPECT_EQ(beam.state, BeamState::kFree);
        EXPECT_EQ(beam.range_m, 30.0F);
      }
      if (whole.state != BeamState::kHit) continue;
      n += 1.0;
      missing += beam.state != BeamState::kHit ? 1.0 : 0.0;
    }
  }
  expect_binomial(missing, n, 0.2);
}

// --- random numbers -------------------------------------------------------------------------------------------------

bool are_same(const Scan& a, const Scan& b) {
  return a.stamp_ns == b.stamp_ns && a.time_increment_s == b.time_increment_s &&
         std::equal(a.beams.begin(), a.beams.end(), b.beams.begin(), b.beams.end(), [](const Beam& x, const Beam& y) {
           const bool same_intensity =
               x.intensity == y.intensity || (std::isnan(x.intensity) && std::isnan(y.intensity));
           return x.state == y.state && x.range_m == y.range_m && same_intensity;
         });
}

std::vector<Scan> flight(const SimulatedScannerParams& params, std::uint64_t seed, int scans) {
  ScanSimulation simulation(kWorlds + "demo.xml", params, seed);
  std::vector<Scan> result;
  for (int i = 0; i < scans; ++i) result.push_back(simulation.next().scan);
  return result;
}

TEST(ScannerErrors, ThatAreOffChangeNothingBitForBit) {
  SimulatedScannerParams plain, off;
  plain.intensity.gain = off.intensity.gain = 400.0;
  // Without a width there are no edges; without a range of dark surfaces none is dropped.
  off.errors.edge_depth_m = 0.01;
  off.errors.edge_missing_fraction = off.errors.edge_mixed_fraction = 0.7;
  off.errors.detection_sigma = 0.5;
  const std::vector<Scan> a = flight(plain, 3, 10), b = flight(off, 3, 10);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(are_same(a[i], b[i]));
}

TEST(ScannerErrors, SameSeedSameScansBitForBit) {
  SimulatedScannerParams params;
  params.sweep_s = 0.04;
  params.sweep_against_order = 1;
  params.stamp_error_s = 0.01;
  params.intensity.gain = 400.0;
  ScannerErrors& errors = params.errors;
  errors.range_sigma_slope = 0.003;
  errors.grazing_sigma_m = 0.01;
  errors.range_bias_slope = -0.01;
  errors.grazing_bias_m = 0.01;
  errors.range_quantum_m = 0.001;
  errors.bearing_sigma_rad = 0.005;
  errors.beam_diameter_m = 0.01;
  errors.beam_divergence_rad = 0.01;
  errors.edge_missing_fraction = 0.3;
  errors.edge_mixed_fraction = 0.5;
  errors.dark_range_m = 8.0;
  errors.detection_sigma = 0.3;
  errors.missing_fraction = 0.1;
  const std::vector<Scan> a = flight(params, 5, 5), b = flight(params, 5, 5), c = flight(params, 6, 5);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(are_same(a[i], b[i]));
    EXPECT_FALSE(are_same(a[i], c[i]));
  }
}

TEST(ScannerErrors, OfARingScannerAreTheSame) {
  const WorldFile file(world_text(kRobot + R"(<geom type="cylinder" size="4 9" pos="9 0 0"/>)"));
  World world(file.path());
  SimulatedRingScannerParams params;
  params.range_sigma_m = 0.0;
  const Cloud exact = SimulatedRingScanner(world, world.T_robot_lidar(), params, 1).next().cloud;
  params.errors.range_bias_slope = 0.02;
  params.errors.missing_fraction = 0.3;
  const Cloud cloud = SimulatedRingScanner(world, world.T_robot_lidar(), params, 1).next().cloud;
  double n = 0.0, missing = 0.0;
  for (std::size_t i = 0; i < exact.points.size(); ++i) {
    if (std::isnan(exact.points[i].x_m)) continue;
    n += 1.0;
    if (std::isnan(cloud.points[i].x_m)) {
      missing += 1.0;
    } else {
      EXPECT_NEAR(cloud.points[i].x_m, 1.02 * exact.points[i].x_m, 1e-5);
    }
  }
  ASSERT_GT(n, 1000.0);
  expect_binomial(missing, n, 0.3);
}

// --- time -----------------------------------------------------------------------------------------------------------

TEST(ScanTimes, OfASweepAgainstTheOrderWithWrongStamps) {
  // The robot flies at a wall and away from a post.
  const WorldFile file(world_text(kRobot + wall_at(9.0) + object_text("post", "pos=\"-3 0 1\"", "0.3 0.3 1"),
                                  R"(<text name="robot" data="straight from 0 0 velocity 1.5 0"/>)", kUser));
  SimulatedScannerParams params = without_noise();
  params.sweep_s = 0.04;
  params.sweep_against_order = 1;
  params.time_increment_scale = 0.5;
  for (const double stamp_error_s : {0.015, -0.02}) {
    params.stamp_error_s = stamp_error_s;
    ScanSimulation simulation(file.path(), params, 1);
    for (int s = 0; s < 20; ++s) {
      const SimulatedScan simulated = simulation.next();
      const double start_s = 0.05 * s, stamp_s = start_s + stamp_error_s;
      const Scan& scan = simulated.scan;
      EXPECT_NEAR(1e-9 * static_cast<double>(scan.stamp_ns), stamp_s, 1e-9);
      EXPECT_NEAR(scan.time_increment_s, 0.5 * 0.04 / 1080.0, 1e-12);
      EXPECT_NEAR(simulated.T_world_lidar.translation().x(), 1.5 * stamp_s, 1e-9);
      EXPECT_NEAR(simulated.T_world_lidar_end.translation().x(), 1.5 * (stamp_s + 0.02), 1e-9);
      EXPECT_NEAR(simulated.robot.T_world_robot.translation().x(), 1.5 * stamp_s, 1e-9);
      EXPECT_EQ(simulated.truth.stamp_ns, scan.stamp_ns);
      for (std::size_t i = 0; i < scan.beams.size(); ++i) {
        const double angle = angle_of(scan, i);
        if (std::abs(angle) > 1.0) continue;
        const double measured_s = start_s + 0.04 * static_cast<double>(scan.beams.size() - 1 - i) / 1080.0;
        ASSERT_NEAR(scan.beams[i].range_m * std::cos(angle), 9.0 - 1.5 * measured_s, 1e-5) << "beam " << i;
      }
    }
  }
}

TEST(ScanTimes, WithoutAClaimOfASweepAllBeamsAreAtTheStamp) {
  const WorldFile file(world_text(kRobot + wall_at(9.0), "", kUser));
  SimulatedScannerParams params;
  params.sweep_s = 0.04;
  params.time_increment_scale = 0.0;
  ScanSimulation simulation(file.path(), params, 1);
  EXPECT_EQ(simulation.next().scan.time_increment_s, 0.0);
}

// --- refusals -------------------------------------------------------------------------------------------------------

TEST(ScannerErrors, RefuseBadParamsNamingFieldAndBound) {
  const auto message = [](const std::function<void(SimulatedScannerParams&)>& spoil) {
    SimulatedScannerParams params;
    spoil(params);
    return refusal_of([&] { params.validate(); });
  };
  EXPECT_EQ(message([](auto& /*params*/) {}), "");
  EXPECT_TRUE(
      names(message([](auto& p) { p.errors.missing_fraction = 1.5; }), {"scanner.missing_fraction", "1.5", "0", "1"}));
  EXPECT_TRUE(names(message([](auto& p) { p.errors.range_quantum_m = -0.001; }),
                    {"scanner.range_quantum_m", "-0.001", "0", "0.1"}));
  EXPECT_TRUE(names(message([](auto& p) { p.errors.beam_divergence_rad = std::nan(""); }),
                    {"scanner.beam_divergence_rad", ".nan"}));
  EXPECT_TRUE(names(message([](auto& p) { p.stamp_error_s = 2.0; }), {"scanner.stamp_error_s", "2", "-1", "1"}));
  EXPECT_TRUE(
      names(message([](auto& p) { p.sweep_against_order = 2; }), {"scanner.sweep_against_order", "2", "0", "1"}));
  EXPECT_TRUE(names(message([](auto& p) {
                      p.range_max_m = p.range_min_m + 0.01;
                      p.errors.range_quantum_m = 0.02;
                    }),
                    {"scanner.range_quantum_m", "scanner.range_max_m", "scanner.range_min_m"}));
}

}  // namespace
}  // namespace situation_awareness::scanner_errors_test
