// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace situation_awareness {

constexpr int kTileCells = 32;  ///< along an edge of a tile of the grid
constexpr int kCellsOfTile = kTileCells * kTileCells;

/// Of the cells of a row of a tile.
template <class Number>
using Row = std::array<Number, kTileCells>;

/// The same of numbers that are 1 or 0. As wide as the numbers that they are found by, several are found at once.
using Mask = Row<double>;

/// What an image may show of cells.
struct ImageExtent {
  Eigen::Matrix3d A;  ///< of a point relative to the camera along the world's axes to (u z, v z, z)
  double camera_z_world_m;
  double right_px, low_px;  ///< of the image
  double reach_m;
  double least_depth_m;
};

/// The cells of a row of a tile that an image shows.
struct SeenRow {
  Row<double> x_m, z_m;                  ///< of the cells' middles from the camera
  Row<double> foot_x, foot_y, foot_z;    ///< of these places, as ImageExtent::A says
  Row<double> per_z;                     ///< 1 / foot_z
  Row<double> u_px, v_px, range_m;       ///< of the middles; the range is along the ground
  Row<double> hidden_below_m;            ///< height above the ground from which nearer ground is not in the way
  Row<double> seen;                      ///< weight of the image by the extent of the column
  Row<float> along_x, along_y, along_z;  ///< unit vectors from the camera
  Row<float> turn;                       ///< since the image before, as a weight
  Mask is_in;                            ///< 0: not seen
};

/// What a tile knows of the cells of a row: pointers to the first of them.
struct KnownRow {
  float *seen_x, *seen_y, *seen_z, *turned;  ///< Directions of all images that show the cell
  float *latest_x, *latest_y, *latest_z;     ///< the latest of these directions
  float* nothing_weight;                     ///< of images, until one shows something of the class on the cell
  std::int32_t* images;
};

/// Finds which middles of a row, whose SeenRow::x_m is set, are in the image and within reach, and where: SeenRow from
/// z_m to range_m, and is_in. `ground_world_m`: NaN where it is not known, which is not in the image. `y_m`: of the row
/// from the camera. False if none is.
bool find_in_image(const float* ground_world_m, double y_m, const ImageExtent& image, SeenRow& row);

/// Finds the directions of a row of points from the camera, in so many equal parts of the square through the axes at 1,
/// and the rings around it they are in, but for `own_m` before them. A ring is negative at the camera.
void find_rings(const SeenRow& row, double y_m, int parts, double own_m, double rings_per_m,
                Row<std::int32_t>& directions, Row<std::int32_t>& rings);

/// What hides the columns on a row of cells.
struct Hiding {
  double margin_m, most_m;  ///< hidden by less than the one is not hidden, by more than the other is not seen
  double low_z, top_z;      ///< of the ends of the columns, as ImageExtent::A says, below and above their feet
  double least_depth_m;
};

/// Finds which of the cells in the image are not hidden by nearer ground, and from which height on.
/// SeenRow::hidden_below_m has the slopes of the ground before them. False if all are hidden.
bool find_visible(const Hiding& hiding, SeenRow& row);

/// Finds from where the image looks at the cells of a row, and with which weight. `up`: a column of the class, as
/// ImageExtent::A says. `turn_rad`: that counts as a direction of its own. `resolved_px`: a column that is seen well.
void find_directions(const KnownRow& known, double y_m, const Eigen::Vector3d& up, float turn_rad, double resolved_px,
                     SeenRow& row);

/// Adds an image that shows nothing of the class to the cells where `shows_nothing` is 1; 0: they stay as they are.
/// `negative_weight`: of such an image. Older evidence and directions fade above `most`. Returns how many cells.
int add_nothing(const SeenRow& row, const Row<std::int32_t>& shows_nothing, double negative_weight, float most,
                const KnownRow& known);

}  // namespace situation_awareness
