// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace situation_awareness {

/// How cameras code colours in images of one or two bytes a pixel.
enum class ColorCoding {
  kBayerRggb,  ///< a byte a pixel: the first of the first row is red, its neighbours green
  kBayerBggr,
  kBayerGbrg,
  kBayerGrbg,
  kUyvy,  ///< YUV 4:2:2, two bytes a pixel: the first is of colour
  kYuyv,  ///< the same, the first is of brightness
};

/// Whether an image of this size can be coded so: of even width and, by Bayer's pattern, height, 4 at least.
bool is_size_of(ColorCoding coding, std::uint32_t width, std::uint32_t height);

/// The colours of an image, 3 * width * height numbers: red, green and blue of each pixel, rows from the top. `step`:
/// bytes from row to row. Throws std::invalid_argument if its size is none of the coding.
std::vector<std::uint8_t> rgb_of(const std::uint8_t* data, int width, int height, std::size_t step, ColorCoding coding);

/// Pixels of an image file.
struct DecodedImage {
  int width = 0, height = 0;
  int channels = 0;                ///< 1, or 3 or 4 in the order of blue, green, red and alpha
  int bytes = 0;                   ///< of a number, in the processor's order: 1, 2 or, of floats, 4
  std::vector<std::uint8_t> data;  ///< rows from the top, without gaps; empty: the file could not be read
};

/// Decodes a JPEG, PNG or other file that OpenCV reads. Throws nothing.
DecodedImage decode_image(const std::vector<std::uint8_t>& file);

}  // namespace situation_awareness
