// SPDX-License-Identifier: BSD-3-Clause
#include "seen_row.hpp"

#include <cmath>
#include <cstring>

#include "several_at_once.hpp"

namespace situation_awareness {
namespace {

constexpr std::size_t kCells = kTileCells;

inline bool any_of(const Mask& mask) {
  std::uint64_t any = 0;
  for (const double is : mask) {  // several at once: no comparison of each
    std::uint64_t bits = 0;
    std::memcpy(&bits, &is, sizeof bits);
    any |= bits;
  }
  return any != 0;
}

}  // namespace

SITUATION_AWARENESS_SEVERAL_AT_ONCE
bool find_in_image(const float* ground_world_m, double y_m, const ImageExtent& image, SeenRow& row) {
  const double xx = image.A(0, 0), yx = image.A(1, 0), zx = image.A(2, 0);
  const double xz = image.A(0, 2), yz = image.A(1, 2), zz = image.A(2, 2);
  const double xy = image.A(0, 1) * y_m, yy = image.A(1, 1) * y_m, zy = image.A(2, 1) * y_m;
  const double camera_z_m = image.camera_z_world_m, right_px = image.right_px, low_px = image.low_px;
  const double reach_m = image.reach_m, least_depth_m = image.least_depth_m, y2 = y_m * y_m;
  for (std::size_t c = 0; c < kCells; ++c) {
    const double x_m = row.x_m[c], z_m = static_cast<double>(ground_world_m[c]) - camera_z_m;
    const double foot_x = xx * x_m + (xy + xz * z_m);
    const double foot_y = yx * x_m + (yy + yz * z_m);
    const double foot_z = zx * x_m + (zy + zz * z_m);
    const double per_z = 1.0 / foot_z, u_px = foot_x * per_z, v_px = foot_y * per_z;
    const double range_m = std::sqrt(x_m * x_m + y2);
    row.z_m[c] = z_m;
    row.foot_x[c] = foot_x;
    row.foot_y[c] = foot_y;
    row.foot_z[c] = foot_z;
    row.per_z[c] = per_z;
    row.u_px[c] = u_px;
    row.v_px[c] = v_px;
    row.range_m[c] = range_m;
    const bool is_in = (foot_z >= least_depth_m) & (u_px >= -0.5) & (v_px >= -0.5) & (u_px <= right_px) &
                       (v_px <= low_px) & (range_m <= reach_m);
    row.is_in[c] = is_in ? 1.0 : 0.0;
  }
  return any_of(row.is_in);
}

SITUATION_AWARENESS_SEVERAL_AT_ONCE
void find_rings(const SeenRow& row, double y_m, int parts, double own_m, double rings_per_m,
                Row<std::int32_t>& directions, Row<std::int32_t>& rings) {
  const double y_abs_m = std::abs(y_m), of_quarter = 0.25 * parts;
  // Quarters of the way around, by the side of the axes: before the y axis they grow from x > 0 on, after it to it.
  const double right = y_m >= 0.0 ? 0.0 : 3.0, left = y_m >= 0.0 ? 1.0 : 2.0;
  const bool is_right_by_y = y_m >= 0.0;
  for (std::size_t c = 0; c < kCells; ++c) {
    const double x_m = row.x_m[c], x_abs_m = std::abs(x_m);
    const bool is_right = x_m >= 0.0;
    const double part = (is_right == is_right_by_y ? y_abs_m : x_abs_m) / (x_abs_m + y_abs_m);
    const double direction = ((is_right ? right : left) + part) * of_quarter + 0.5;
    directions[c] = static_cast<std::int32_t>(direction >= 0.0 ? direction : 0.0);  // at the camera itself: NaN
  }
  for (std::size_t c = 0; c < kCells; ++c) directions[c] = directions[c] < parts ? directions[c] : 0;
  for (std::size_t c = 0; c < kCells; ++c) {
    const double ring = (row.range_m[c] - own_m) * rings_per_m;
    rings[c] = static_cast<std::int32_t>(ring);
  }
}

SITUATION_AWARENESS_SEVERAL_AT_ONCE
bool find_visible(const Hiding& hiding, SeenRow& row) {
  const double margin_m = hiding.margin_m, most_m = hiding.most_m, low_z = hiding.low_z, top_z = hiding.top_z,
               least_depth_m = hiding.least_depth_m;
  for (std::size_t c = 0; c < kCells; ++c) {
    const double hidden_below_m = row.hidden_below_m[c] * row.range_m[c] - row.z_m[c] - margin_m;
    row.hidden_below_m[c] = hidden_below_m;
    const bool is_not =
        (hidden_below_m > most_m) | (row.foot_z[c] - low_z < least_depth_m) | (row.foot_z[c] + top_z < least_depth_m);
    row.is_in[c] = is_not ? 0.0 : row.is_in[c];
  }
  return any_of(row.is_in);
}

SITUATION_AWARENESS_SEVERAL_AT_ONCE
void find_directions(const KnownRow& known, double y_m, const Eigen::Vector3d& up, float turn_rad, double resolved_px,
                     SeenRow& row) {
  const float* const latest_x = known.latest_x;
  const float* const latest_y = known.latest_y;
  const float* const latest_z = known.latest_z;
  const std::int32_t* const images = known.images;
  const auto y = static_cast<float>(y_m);
  const float per_turn = 1.0F / turn_rad;
  for (std::size_t c = 0; c < kCells; ++c) {
    const float square_m2 = static_cast<float>(row.range_m[c] * row.range_m[c] + row.z_m[c] * row.z_m[c]);
    const float per_length = 1.0F / std::sqrt(square_m2);
    row.along_x[c] = static_cast<float>(row.x_m[c]) * per_length;
    row.along_y[c] = y * per_length;
    row.along_z[c] = static_cast<float>(row.z_m[c]) * per_length;
  }
#pragma GCC ivdep
  for (std::size_t c = 0; c < kCells; ++c) {
    const float dx = row.along_x[c] - latest_x[c], dy = row.along_y[c] - latest_y[c], dz = row.along_z[c] - latest_z[c];
    const float turned = std::sqrt(dx * dx + (dy * dy + dz * dz)) * per_turn;
    const float turn = turned < 1.0F ? turned : 1.0F;
    row.turn[c] = images[c] == 0 ? 1.0F : turn;
  }
  const double up_x = up.x(), up_y = up.y(), up_z = up.z(), per_square = 1.0 / (resolved_px * resolved_px);
  for (std::size_t c = 0; c < kCells; ++c) {
    const double u_px = row.per_z[c] * (up_x - up_z * row.u_px[c]), v_px = row.per_z[c] * (up_y - up_z * row.v_px[c]);
    const double part = (u_px * u_px + v_px * v_px) * per_square, bounded = part < 0.01 ? 0.01 : part;
    row.seen[c] = bounded < 1.0 ? bounded : 1.0;
  }
}

SITUATION_AWARENESS_SEVERAL_AT_ONCE
int add_nothing(const SeenRow& row, const Row<std::int32_t>& shows_nothing, double negative_weight, float most,
                const KnownRow& known) {
  Row<float> weights, parts;
#pragma GCC ivdep
  for (std::size_t c = 0; c < kCells; ++c) {
    const float weight = row.turn[c] * static_cast<float>(row.seen[c]);
    const float turned = known.turned[c] + weight, fade = most / turned;
    weights[c] = weight;
    parts[c] = turned > most ? fade : 1.0F;  // older directions fade
  }
  float* const sums[] = {known.seen_x, known.seen_y, known.seen_z};
  float* const latest[] = {known.latest_x, known.latest_y, known.latest_z};
  const float* const along[] = {row.along_x.data(), row.along_y.data(), row.along_z.data()};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    float *const of_sum = sums[axis], *const of_latest = latest[axis];
    const float* const now = along[axis];
#pragma GCC ivdep
    for (std::size_t c = 0; c < kCells; ++c) {
      const float before = of_sum[c], sum = (before + weights[c] * now[c]) * parts[c];
      of_sum[c] = shows_nothing[c] != 0 ? sum : before;
    }
#pragma GCC ivdep
    for (std::size_t c = 0; c < kCells; ++c) {
      const float before = of_latest[c], after = now[c];
      of_latest[c] = shows_nothing[c] != 0 ? after : before;
    }
  }
  float *const of_turned = known.turned, *const nothing_weight = known.nothing_weight;
  std::int32_t* const images = known.images;
#pragma GCC ivdep
  for (std::size_t c = 0; c < kCells; ++c) {
    const float before = of_turned[c], turned = (before + weights[c]) * parts[c];
    of_turned[c] = shows_nothing[c] != 0 ? turned : before;
  }
  std::int32_t count = 0;
#pragma GCC ivdep
  for (std::size_t c = 0; c < kCells; ++c) {
    const float before = nothing_weight[c];
    const float weight = before + static_cast<float>(negative_weight * row.seen[c]);
    const float bounded = most < weight ? most : weight;
    nothing_weight[c] = shows_nothing[c] != 0 ? bounded : before;
    images[c] += shows_nothing[c];
    count += shows_nothing[c];
  }
  return count;
}

}  // namespace situation_awareness
