// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/angles.hpp"

/// How a scanner sees the one thing that a synthetic segment is of.
namespace situation_awareness::synthetic {

constexpr double kFirstAzimuthRad = radians(-135.0);
constexpr double kFieldRad = radians(270.0);
constexpr double kPaperResolutionRad = radians(0.25);
constexpr double kPaperSigmaM = 0.01;
constexpr double kMinRangeM = 0.1;
constexpr double kPaperMaxRangeM = 10.0;
constexpr double kMaxRangeGapM = 0.2;  // neighbours farther apart are not one segment (segments/segmentation.hpp)
constexpr double kMissM = std::numeric_limits<double>::infinity();

using Edge = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

/// True with this probability.
inline bool chance(Random& random, double probability) { return random.uniform() < probability; }

inline int uniform_int(Random& random, int low, int high) {
  return low + static_cast<int>(std::floor(random.uniform() * static_cast<double>(high - low + 1)));
}

inline double square(double x) { return x * x; }

inline double log_uniform(Random& random, double low, double high) {
  return low * std::pow(high / low, random.uniform());
}

/// The scanner of one sample: the azimuth of beam k in the level frame, and the horizontal fraction of a slant range.
struct Scanner {
  double resolution_rad = kPaperResolutionRad;
  double range_sigma_m = kPaperSigmaM;  ///< nominal
  double noise = 1.0;                   ///< true standard deviation over the nominal one
  double max_range_m = kPaperMaxRangeM;
  double tilt_rad = 0.0;
  double tilt_axis_rad = 0.0;  ///< azimuth of the tilt axis

  int beams() const { return static_cast<int>(std::floor(kFieldRad / resolution_rad + 1e-6)) + 1; }

  double azimuth_rad(int k) const {
    const double azimuth = kFirstAzimuthRad + k * resolution_rad;
    if (tilt_rad == 0.0) return azimuth;
    const double from_axis = azimuth - tilt_axis_rad;
    const double level = std::atan2(std::sin(from_axis) * std::cos(tilt_rad), std::cos(from_axis));
    return azimuth + wrap_to_pi(level - from_axis);
  }

  double horizontal(int k) const {
    if (tilt_rad == 0.0) return 1.0;
    const double from_axis = kFirstAzimuthRad + k * resolution_rad - tilt_axis_rad;
    return std::sqrt(1.0 - std::pow(std::sin(from_axis) * std::sin(tilt_rad), 2));
  }

  int beam_near(double azimuth) const {
    return static_cast<int>(std::lround((azimuth - kFirstAzimuthRad) / resolution_rad));
  }
};

/// The object before the scanner.
struct Thing {
  std::vector<Ellipse> ellipses;
  std::vector<Edge> edges;
};

double range_to(const Thing& thing, double azimuth_rad);

/// The azimuths of the ends of a thing, seen from the sensor.
std::pair<double, double> azimuths_of(const Thing& thing);

bool within_range(const Ellipse& ellipse, double max_range_m);

/// The beams that hit: first, and one range per beam from there, infinite where the beam misses.
struct Hits {
  int first = 0;
  std::vector<double> ranges_m;

  int count() const { return static_cast<int>(ranges_m.size()); }
};

/// Noiseless; empty if the object extends beyond the field of view.
Hits cast(const Thing& thing, const Scanner& scanner);

/// True if segmentation would see one segment in it.
bool is_one_segment(const Hits& hits);

/// The surroundings of a segment's ends.
struct Ends {
  SegmentEnd right = SegmentEnd::kFree;
  SegmentEnd left = SegmentEnd::kFree;
  int right_blocked = 0;  ///< beams
  int left_blocked = 0;
};

/// Remove `hidden` beams from one end, with `beyond` more blocked beams beside it.
void hide(Hits& hits, Ends& ends, bool right, int hidden, int beyond);

/// Occludes one end, 30 to 70 % of the beams that would hit. False if too few would be left.
bool hide_one_end(Hits& hits, Ends& ends, int min_visible, Random& random);

/// `correlation`: of the errors of neighbouring hits.
void add_noise(Hits& hits, const Scanner& scanner, Random& random, double correlation = 0.0);

SyntheticSegment make_segment(const Hits& hits, const Ends& ends, const Scanner& scanner,
                              const std::optional<Ellipse>& ellipse, const std::optional<Box>& box);

}  // namespace situation_awareness::synthetic
