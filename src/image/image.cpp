// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/image.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace situation_awareness {
namespace {

constexpr double kMost_px = 1e6;  ///< of a camera's numbers

}  // namespace

void check(const PinholeCamera& camera) {
  if (camera.width < 1 || camera.height < 1) {
    throw std::invalid_argument("the image's size " + std::to_string(camera.width) + " x " +
                                std::to_string(camera.height) + " is not 1 x 1 at least");
  }
  for (const double focal_length_px : {camera.fx_px, camera.fy_px}) {
    if (!(focal_length_px > 0.0 && focal_length_px <= kMost_px)) {
      throw std::invalid_argument("a focal length of the camera, " + std::to_string(focal_length_px) +
                                  ", is not above 0 and at most 1e6 px");
    }
  }
  if (!(std::abs(camera.cx_px) <= kMost_px && std::abs(camera.cy_px) <= kMost_px)) {
    throw std::invalid_argument("the principal point of the camera is not finite, or more than 1e6 px away");
  }
}

PinholeCamera scaled(const PinholeCamera& camera, int width, int height) {
  check(camera);
  const double sx = static_cast<double>(width) / camera.width, sy = static_cast<double>(height) / camera.height;
  PinholeCamera result;
  result.width = width;
  result.height = height;
  result.fx_px = sx * camera.fx_px;
  result.fy_px = sy * camera.fy_px;
  // The image's left edge is at -0.5 at every size.
  result.cx_px = sx * (camera.cx_px + 0.5) - 0.5;
  result.cy_px = sy * (camera.cy_px + 0.5) - 0.5;
  check(result);
  return result;
}

void check(const ColorImage& image) {
  check(image.camera);
  const std::size_t pixels =
      static_cast<std::size_t>(image.camera.width) * static_cast<std::size_t>(image.camera.height);
  if (image.rgb.size() != 3 * pixels) {
    throw std::invalid_argument("there are " + std::to_string(image.rgb.size()) + " numbers for " +
                                std::to_string(pixels) + " pixels of three colours");
  }
}

void check(const SoftLabels& labels) {
  check(labels.camera);
  const std::size_t pixels =
      static_cast<std::size_t>(labels.camera.width) * static_cast<std::size_t>(labels.camera.height);
  if (labels.probability.size() != pixels) {
    throw std::invalid_argument("there are " + std::to_string(labels.probability.size()) + " probabilities for " +
                                std::to_string(pixels) + " pixels");
  }
}

std::size_t drop_out_of_range(SoftLabels& labels) {
  std::size_t dropped = 0;
  for (float& probability : labels.probability) {
    if (std::isnan(probability) || (probability >= 0.0F && probability <= 1.0F)) continue;
    probability = std::numeric_limits<float>::quiet_NaN();
    ++dropped;
  }
  return dropped;
}

}  // namespace situation_awareness
