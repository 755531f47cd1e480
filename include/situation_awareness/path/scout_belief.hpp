// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

// Where targets that were not found yet may be (docs/math/scouting.md). All in the world, lengths in m.

/// A camera that looks ahead and down from a vehicle, and how surely its images show targets.
struct ScoutCameraParams {
  double field_of_view_rad = radians(60.0);
  double vertical_field_of_view_rad = radians(60.0);
  double pitch_rad = radians(-20.0);
  double range_m = 110.0;
  double hiding = 0.06;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("field_of_view_rad", self.field_of_view_rad, Bounds{0.05, 3.0}, "rad", "from the left to the right edge");
    visit("vertical_field_of_view_rad", self.vertical_field_of_view_rad, Bounds{0.05, 3.0}, "rad",
          "from the upper to the lower edge");
    visit("pitch_rad", self.pitch_rad, Bounds{-1.5, 0.5}, "rad", "of its axis, positive up");
    visit("range_m", self.range_m, Bounds{5.0, 2000.0}, "m", "over the ground, beyond which targets are not found");
    visit("hiding", self.hiding, Bounds{0.0, 10.0}, "",
          "c: a target at distance d from below height h is not hidden by exp(-c d / h)");
  }

  /// Throws std::invalid_argument naming field and bound, and where the lower edge of its images is not below level.
  void validate() const;
};

/// A camera at a place, at a height above the ground.
struct ScoutView {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  double height_m = 0.0;
  double yaw_rad = 0.0;
};

/// Whether a place on the ground is in a camera's image, hidden or not, whatever its range.
bool is_in_view(const ScoutCameraParams& camera, const ScoutView& view, const Eigen::Vector2d& p_world_m);

/// Places on the ground with the number of targets that are expected there, and how surely one of these would have been
/// found from each of eight directions. What hides a target hides it from a direction, so that more images from there
/// do not help; other directions do.
class ScoutBelief {
 public:
  static constexpr std::size_t kSectors = 8;

  /// Cells over a rectangle, all alike, `expected` targets in all.
  ScoutBelief(const ScoutCameraParams& camera, const Eigen::Vector2d& low_world_m, const Eigen::Vector2d& high_world_m,
              double cell_m, double expected);

  /// So many images from there. Returns by how much the expected number of targets that were found grows.
  double look(const ScoutView& view, double images);

  /// Clusters that are no targets yet are places where one is expected, with its probability less a half.
  void set_tentative(const std::vector<GridCluster>& clusters);

  /// Where the grid has no evidence on any cell of a place in spite of enough images, the ground hides it from there:
  /// these directions say nothing.
  void take_unobserved(const SemanticGrid& grid);

  double expected() const { return expected_; }
  /// The expected number of targets that were not found yet.
  double left() const;
  std::size_t places() const { return places_.size(); }
  const Eigen::Vector2d& place_m(std::size_t place) const { return places_[place].p_m; }
  /// The probability that a target there was found.
  double found(std::size_t place) const { return 1.0 - places_[place].left; }

 private:
  struct Place {
    Eigen::Vector2d p_m = Eigen::Vector2d::Zero();
    double expected = 0.0;
    double left = 1.0;                            ///< probability that a target there was not found
    std::array<float, kSectors> found{};          ///< by the images of a direction; below 0: these say nothing
    std::array<std::uint16_t, kSectors> looks{};  ///< images
  };

  /// What an image shows of the ground.
  struct Cone {
    Eigen::Vector2d ahead = Eigen::Vector2d::Zero();
    double height_m = 0.0, near_m = 0.0, far_m = 0.0;
    double least_cosine = 0.0;  ///< of the angle off ahead
  };

  double look_at(Place& place, const Cone& cone, const Eigen::Vector2d& from_m, double images) const;

  ScoutCameraParams camera_;
  double cell_m_, expected_ = 0.0;
  int columns_ = 0, rows_ = 0;                         ///< of the lattice
  Eigen::Vector2d low_m_ = Eigen::Vector2d::Zero();    ///< its corner
  Eigen::Vector2d place_m_ = Eigen::Vector2d::Ones();  ///< edges of a place of it
  double near_slope_, far_slope_;                      ///< distance over height at which the image ends below and above
  std::size_t cells_ = 0;  ///< places of the lattice, the first ones; behind them the tentative ones
  std::vector<Place> places_;
};

}  // namespace situation_awareness
