// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// The begin of an arc of a splinegon: a main vertex, or the joint of the two arcs between main vertices.
struct SplinegonVertex {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  double bulge = 0.0;    ///< tan(sweep / 4) of the arc to the next vertex, counter-clockwise positive (as in DXF)
  double sigma_m = 0.0;  ///< of the boundary, across it: absolute, the pose's error included; linear along an arc
  bool corner = false;   ///< the tangent breaks here; else the arcs before and after share it
};

/// The boundary of an obstacle as a chain of arcs, as far as it was seen, counter-clockwise around the obstacle: its
/// free side lies to the right. Of finite numbers, neighbouring vertices differ, sigma_m >= 0. Main vertices and joints
/// alternate, first a main vertex; a closed one ends with a joint, an open one with a main vertex, whose bulge is 0.
/// (The splinegon paper, Sect. IV; docs/math/splinegons.md.)
struct Splinegon {
  std::uint64_t id = 0;                   ///< never used twice
  bool closed = false;                    ///< the last arc leads back to the first vertex
  std::vector<SplinegonVertex> vertices;  ///< three at least, of a closed one four
  std::int64_t first_seen_ns = 0;         ///< stamps of scans that hit it
  std::int64_t last_seen_ns = 0;          ///< of those that the vertices are of: others may have hit it since
};

/// All boundaries.
struct Splinegons {
  std::int64_t stamp_ns = 0;
  std::vector<Splinegon> boundaries;
  double height_world_m = 0.0;  ///< of the scans, for display
};

/// A chain of the map of polygons that a boundary was fitted to, alone or with others.
struct ChainOfBoundary {
  std::uint64_t chain = 0, boundary = 0;  ///< their ids
};

/// Standard deviations to either side of a boundary that contain 99 % of a normal distribution.
constexpr double kSigmasOf99Percent = 2.5758293035489004;

/// A place on a splinegon.
struct SplinegonPoint {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d along_world = Eigen::Vector2d::UnitX();  ///< unit, counter-clockwise around the obstacle
  double sigma_m = 0.0;                                    ///< of the boundary, across it
  std::size_t arc = 0;                                     ///< index of the vertex at which its arc begins
  double part = 0.0;                                       ///< of that arc, in [0, 1]
};

/// Of vertices.size(), one less if open.
std::size_t arcs_of(const Splinegon& splinegon);

double length_m(const Splinegon& splinegon);

/// Of a closed one; negative if it runs clockwise.
double area_m2(const Splinegon& splinegon);

SplinegonPoint point_at(const Splinegon& splinegon, std::size_t arc, double part);

/// The nearest place on the boundary.
SplinegonPoint nearest_on(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m);

/// To the boundary, not negative.
double distance_m(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m);

/// Whether a point is within a closed splinegon. Not of points on the boundary.
bool contains(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m);

/// Points in order, no further apart than `spacing_m` > 0 along the boundary, among them all vertices, each once.
/// `memory`: a result no longer needed, whose memory this one reuses.
std::vector<SplinegonPoint> sampled(const Splinegon& splinegon, double spacing_m,
                                    std::vector<SplinegonPoint> memory = {});

/// The boundary does not meet itself, its arcs taken for polygons that are off by 0.1 mm at most.
bool is_simple(const Splinegon& splinegon);
/// The same without allocation after warm-up; `points_m` is overwritten.
bool is_simple(const Splinegon& splinegon, std::vector<Eigen::Vector2d>& points_m);

/// The band that contains the boundary with 99 % at any place: offset by 2.58 sigma to either side.
struct SplinegonEnvelope {
  std::vector<Eigen::Vector2d> free_side_world_m, obstacle_side_world_m;  ///< one point per sample, in order
};
SplinegonEnvelope envelope_of(const Splinegon& splinegon, double spacing_m);

/// Whether a point is in that band.
bool is_in_envelope(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m);

}  // namespace situation_awareness
