// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/image.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "support/refusal.hpp"

namespace situation_awareness::image_test {
namespace {

PinholeCamera camera() {
  PinholeCamera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx_px = 500.0;
  camera.fy_px = 510.0;
  camera.cx_px = 310.0;
  camera.cy_px = 250.0;
  return camera;
}

// A direction is at the same part of the image's width and height at every size.
TEST(ScaledCamera, KeepsDirections) {
  for (const auto& [width, height] : {std::pair(28, 28), std::pair(1280, 60), std::pair(1, 1), std::pair(640, 480)}) {
    const PinholeCamera from = camera(), to = scaled(from, width, height);
    for (const double x : {-0.5, 0.0, 0.3}) {
      for (const double y : {-0.2, 0.1}) {
        EXPECT_NEAR((from.fx_px * x + from.cx_px + 0.5) / from.width, (to.fx_px * x + to.cx_px + 0.5) / to.width,
                    1e-12);
        EXPECT_NEAR((from.fy_px * y + from.cy_px + 0.5) / from.height, (to.fy_px * y + to.cy_px + 0.5) / to.height,
                    1e-12);
      }
    }
  }
}

TEST(ScaledCamera, RefusesCamerasAndSizesThatCannotBeUsed) {
  EXPECT_TRUE(names(refusal_of<std::invalid_argument>([] { scaled(camera(), 0, 10); }), {"size"}));
  EXPECT_TRUE(names(refusal_of<std::invalid_argument>([] { scaled(PinholeCamera(), 10, 10); }), {"size"}));
  PinholeCamera without_focal_length = camera();
  without_focal_length.fx_px = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(
      names(refusal_of<std::invalid_argument>([&] { scaled(without_focal_length, 10, 10); }), {"focal length"}));
}

TEST(ColorImage, HasThreeNumbersForEachPixel) {
  ColorImage image;
  image.camera = camera();
  image.rgb.resize(640 * 480);
  EXPECT_TRUE(names(refusal_of<std::invalid_argument>([&] { check(image); }), {"307200 numbers", "three colours"}));
  image.rgb.resize(3 * 640 * 480);
  EXPECT_NO_THROW(check(image));
}

}  // namespace
}  // namespace situation_awareness::image_test
