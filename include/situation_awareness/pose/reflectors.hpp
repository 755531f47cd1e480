// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// What the fit of a cylinder to the hits on it takes for true of the scanner (docs/math/reflectors.md).
struct ReflectorFitParams {
  double range_sigma_m = 0.012;
  double beam_width_rad = 0.001;

  // Constants of the method, which are not read from YAML.
  /// Standard deviation of a range of which no beam is entirely on the reflector, as a part of its difference to that
  /// of what is beside it: it may be a mean of both.
  double mixed_part = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("range_sigma_m", self.range_sigma_m, Bounds{1e-4, 0.2}, "m", "standard deviation of a range on a reflector");
    visit("beam_width_rad", self.beam_width_rad, Bounds{0.0, 0.05}, "rad",
          "a beam may see a reflector that its axis passes by half of this");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Parameters of the detection of reflectors.
struct ReflectorDetectionParams {
  double min_intensity = 430.0;
  double min_peak_intensity = 450.0;
  double radius_m = 0.05;
  double min_radius_m = 0.02;
  double max_radius_m = 0.1;
  double min_range_m = 0.3;
  double max_range_m = 20.0;
  ReflectorFitParams fit;

  // Constants of the method, which are not read from YAML.
  /// What has dim returns on both sides within this range of it is refused (part of a glossy surface); 0: none is.
  double flush_step_m = 0.03;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("min_intensity", self.min_intensity, Bounds{0.0, 1e9}, "",
          "least intensity of a beam on a reflector, in the sensor's own units");
    visit("min_peak_intensity", self.min_peak_intensity, Bounds{0.0, 1e9}, "",
          "least intensity of the brightest beam of a reflector, in the sensor's own units");
    visit("radius_m", self.radius_m, Bounds{0.001, 1.0}, "m",
          "radius that the sightings' own centres are for; localisation uses that of the map");
    visit("min_radius_m", self.min_radius_m, Bounds{0.001, 1.0}, "m",
          "what is narrower than the thinnest reflector can be at its range is refused");
    visit("max_radius_m", self.max_radius_m, Bounds{0.001, 1.0}, "m",
          "what is wider than the thickest reflector can be at its range is refused (a glossy wall)");
    visit("min_range_m", self.min_range_m, Bounds{0.0, 100.0}, "m", "what is nearer is refused");
    visit("max_range_m", self.max_range_m, Bounds{0.1, 1000.0}, "m", "what is farther away is refused");
    visit("fit", self.fit);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// One beam on a reflector.
struct ReflectorHit {
  double azimuth_rad = 0.0;
  double range_m = 0.0;
};

/// What may be a reflector, in the level frame of its scan: a run of bright beams.
struct ReflectorSighting {
  std::size_t first = 0;  ///< of its hits in ReflectorSightings::hits, by increasing azimuth
  std::size_t count = 0;
  double azimuth_rad = 0.0;      ///< of the middle between first and last hit, not wrapped
  double surface_range_m = 0.0;  ///< median range of the hits
  double free_before_rad = 0.0;  ///< from the first hit to the first beam before it that is beside the reflector; +inf
                                 ///< where something nearer hides that side
  double free_after_rad = 0.0;   ///< the same behind the last hit
  double step_m = 0.0;           ///< in range to what is beside the reflector, the greater of both sides
  double time_offset_s = 0.0;    ///< of the middle beam, after the stamp
  float peak_intensity = 0.0F;
  Eigen::Vector2d center_level_m = Eigen::Vector2d::Zero();  ///< for ReflectorDetectionParams::radius_m
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();      ///< of center_level_m
};

/// The sightings of one scan with what is needed to localise by them.
struct ReflectorSightings {
  std::int64_t stamp_ns = 0;
  double resolution_rad = 0.0;  ///< between beams
  ReflectorFitParams fit;       ///< as they were detected with
  std::vector<ReflectorHit> hits;
  std::vector<ReflectorSighting> sightings;
  FreeSpace free;             ///< of the scan, to tell what is missing from what is hidden
  double free_begin_s = 0.0;  ///< time of the first beam of `free` after the stamp ...
  double free_end_s = 0.0;    ///< ... and of the last; linear in between
  /// Runs of bright beams that are no sightings: "cut" (at the end of the field of view), "dim" (no beam is bright
  /// enough), "far", "near", "wide", "narrow", "flush" (level with the surface around it).
  Counters refused;
};

/// Runs of neighbouring beams of high intensity that may be reflectors (polygons paper, Sect. 5.1). `points` must have
/// been projected with one pose, without compensation of motion: localisation treats every sighting at its own time.
/// `memory`: as for limit_range. Time is linear in the beams.
ReflectorSightings detect_reflectors(const Points& points, const ReflectorDetectionParams& params,
                                     ReflectorSightings memory = {});

/// Centre of a cylinder of known radius by the hits of a sighting, as seen from the origin of the level frame.
struct ReflectorFit {
  double range_m = 0.0;  ///< to the centre
  double azimuth_rad = 0.0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< of range (m) and azimuth (rad)
  /// Part of the covariance that is new with every scan, by the noise of the ranges. The rest, by which beams are
  /// bright, is the same again while nothing moves.
  Eigen::Matrix2d white = Eigen::Matrix2d::Zero();
  bool is_width_plausible = false;  ///< a reflector of that radius can be as wide at that range
};

/// Mean and covariance of the centre given the hits, by integration over the azimuth (docs/math/reflectors.md): nearly
/// unbiased also for reflectors one or two beams wide, where a least squares fit is not.
ReflectorFit fit_reflector(const ReflectorSightings& sightings, const ReflectorSighting& sighting, double radius_m);

}  // namespace situation_awareness
