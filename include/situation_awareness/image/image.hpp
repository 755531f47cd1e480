// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace situation_awareness {

/// A camera without distortion: u = fx x/z + cx, v = fy y/z + cy with z ahead, x to the right and y down. The centres
/// of pixels are at whole numbers, so that the image spans [-0.5, width - 0.5] by [-0.5, height - 0.5].
struct PinholeCamera {
  int width = 0, height = 0;
  double fx_px = 0.0, fy_px = 0.0;
  double cx_px = 0.0, cy_px = 0.0;
};

/// Throws std::invalid_argument naming the number if a size is less than 1, a focal length is not above 0, or a
/// number is above 1e6 or not finite.
void check(const PinholeCamera& camera);

/// The camera of the same image at another size: the image spans the same field of view, and each direction of it is
/// scaled on its own. Throws std::invalid_argument if the camera cannot be used or a size is less than 1.
PinholeCamera scaled(const PinholeCamera& camera, int width, int height);

/// An image of 8 bits for each of red, green and blue; rows from the top.
struct ColorImage {
  std::int64_t stamp_ns = 0;
  PinholeCamera camera;           ///< of this image's size
  std::vector<std::uint8_t> rgb;  ///< 3 * width * height numbers
};

/// Throws std::invalid_argument if the camera cannot be used or the number of numbers is not that of its pixels.
void check(const ColorImage& image);

/// For one class, the probability of each pixel of an image to show it; rows from the top. NaN: not known.
struct SoftLabels {
  std::int64_t stamp_ns = 0;
  PinholeCamera camera;            ///< of this image's size
  std::vector<float> probability;  ///< width * height numbers, in [0, 1] or NaN
};

/// Throws std::invalid_argument if the camera cannot be used or the number of probabilities is not that of its pixels.
void check(const SoftLabels& labels);

/// Makes each number that is not in [0, 1] unknown. Returns how many were made so, without those that were NaN.
std::size_t drop_out_of_range(SoftLabels& labels);

}  // namespace situation_awareness
