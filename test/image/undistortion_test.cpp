// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/undistortion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/geometry/angles.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::undistortion_test {
namespace {

using Model = LensDistortion::Model;

/// Where a lens images a direction, without focal length (the pages of OpenCV on calib3d).
Eigen::Vector2d bent(const Eigen::Vector2d& p, const LensDistortion& distortion) {
  std::vector<double> k = distortion.coefficients;
  const double r2 = p.squaredNorm(), x = p.x(), y = p.y();
  if (distortion.model == Model::kEquidistant) {
    const double r = std::sqrt(r2), angle = std::atan(r), a2 = angle * angle;
    const double bent_angle = angle * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
    return r > 1e-12 ? Eigen::Vector2d(bent_angle / r * p) : p;
  }
  k.resize(8);
  const double radial = (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return {x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x),
          y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y};
}

Eigen::Vector2d straight(const Eigen::Vector2d& p, const LensDistortion& distortion) {
  Eigen::Vector2d x = p;
  for (int i = 0; i < 100; ++i) x += 0.5 * (p - bent(x, distortion));
  return x;
}

/// Smooth, so that it can be interpolated, and everywhere another.
double probability_along(const Eigen::Vector3d& ray) {
  const Eigen::Vector2d p = ray.head<2>() / ray.z();
  return 0.5 + 0.2 * std::sin(2.0 * p.x()) + 0.2 * std::sin(1.5 * p.y() + 0.7 * p.x());
}

PinholeCamera camera() { return {96, 80, 60.0, 62.0, 46.0, 41.5}; }

/// What the lens shows.
SoftLabels image_of(const LensDistortion& distortion) {
  SoftLabels labels;
  labels.stamp_ns = 3;
  labels.camera = camera();
  for (int v = 0; v < camera().height; ++v) {
    for (int u = 0; u < camera().width; ++u) {
      const Eigen::Vector2d p =
          straight({(u - camera().cx_px) / camera().fx_px, (v - camera().cy_px) / camera().fy_px}, distortion);
      labels.probability.push_back(
          static_cast<float>(probability_along(distortion.R_rectified_camera * p.homogeneous())));
    }
  }
  return labels;
}

LensDistortion lens(Model model, std::vector<double> coefficients) { return {model, std::move(coefficients)}; }

std::vector<LensDistortion> lenses() {
  LensDistortion turned = lens(Model::kPolynomial, {-0.25, 0.06, 0.0, 0.0, 0.0});
  turned.R_rectified_camera = Eigen::AngleAxisd(0.1, Eigen::Vector3d(0.3, 1.0, 0.5).normalized()).toRotationMatrix();
  return {lens(Model::kPolynomial, {-0.25, 0.06, 0.001, -0.002, 0.0}), lens(Model::kPolynomial, {0.08, 0.01, 0.0, 0.0}),
          lens(Model::kPolynomial, {0.5, 0.1, 0.001, 0.0005, 0.01, 0.8, 0.25, 0.02}),
          lens(Model::kEquidistant, {-0.02, 0.003, 0.0, 0.0}), turned};
}

TEST(Undistortion, ShowsEachDirectionAsThePinholeCameraWould) {
  for (const LensDistortion& distortion : lenses()) {
    SoftLabels labels = image_of(distortion);
    Undistortion undistortion;
    ASSERT_TRUE(undistortion.undistort(labels, distortion));
    EXPECT_NO_THROW(check(labels));
    EXPECT_EQ(labels.stamp_ns, 3);
    EXPECT_EQ(labels.camera.fx_px, camera().fx_px);
    int known = 0;
    for (int v = 0; v < labels.camera.height; ++v) {
      for (int u = 0; u < labels.camera.width; ++u) {
        const float p = labels.probability[static_cast<std::size_t>(v * labels.camera.width + u)];
        if (std::isnan(p)) continue;
        ++known;
        const Eigen::Vector3d ray((u - labels.camera.cx_px) / labels.camera.fx_px,
                                  (v - labels.camera.cy_px) / labels.camera.fy_px, 1.0);
        ASSERT_NEAR(p, probability_along(ray), 2e-3) << u << ' ' << v << ' ' << distortion.coefficients[0];
      }
    }
    EXPECT_GT(known, 0.85 * camera().width * camera().height);
  }
}

// What is near the edge of a wide image is farther out without distortion: it is kept.
TEST(Undistortion, HoldsTheWholeImage) {
  for (const LensDistortion& distortion : lenses()) {
    SoftLabels labels = image_of(distortion);
    ASSERT_TRUE(Undistortion().undistort(labels, distortion));
    for (const Eigen::Vector2d& corner : {Eigen::Vector2d(2, 2), Eigen::Vector2d(93, 2), Eigen::Vector2d(2, 77),
                                          Eigen::Vector2d(93, 77), Eigen::Vector2d(93, 40)}) {
      const Eigen::Vector3d ray =
          distortion.R_rectified_camera *
          straight({(corner.x() - camera().cx_px) / camera().fx_px, (corner.y() - camera().cy_px) / camera().fy_px},
                   distortion)
              .homogeneous();
      const auto u = std::lround(labels.camera.fx_px * ray.x() / ray.z() + labels.camera.cx_px);
      const auto v = std::lround(labels.camera.fy_px * ray.y() / ray.z() + labels.camera.cy_px);
      ASSERT_TRUE(u >= 0 && v >= 0 && u < labels.camera.width && v < labels.camera.height) << corner.transpose();
      EXPECT_FALSE(std::isnan(labels.probability[static_cast<std::size_t>(v * labels.camera.width + u)]));
    }
  }
}

// Of a fisheye that sees more than a half of all directions the rectified image has what is ahead.
TEST(Undistortion, OfAWideFisheyeIsWhatIsAhead) {
  const LensDistortion distortion = lens(Model::kEquidistant, {0.0, 0.0, 0.0, 0.0});
  SoftLabels labels;
  labels.camera = {121, 121, 35.0, 35.0, 60.0, 60.0};  // 98 degrees to each side
  for (int v = 0; v < 121; ++v) {
    for (int u = 0; u < 121; ++u) {
      const double x = (u - 60) / 35.0, y = (v - 60) / 35.0, angle = std::hypot(x, y);
      // 60 degrees to the right, 50 degrees down
      const bool is_right = x > 0.95 && x < 1.15 && std::abs(y) < 0.1, is_down = std::hypot(x, y - 0.873) < 0.1;
      labels.probability.push_back(angle < 1.7 && (is_right || is_down) ? 1.0F : 0.0F);
    }
  }
  ASSERT_TRUE(Undistortion().undistort(labels, distortion));
  EXPECT_EQ(labels.camera.width, 2 * 121 + 1);
  const auto at = [&](double x, double y) {
    const auto u = std::lround(labels.camera.fx_px * x + labels.camera.cx_px);
    const auto v = std::lround(labels.camera.fy_px * y + labels.camera.cy_px);
    return labels.probability.at(static_cast<std::size_t>(v * labels.camera.width + u));
  };
  EXPECT_EQ(at(std::tan(radians(60.0)), 0.0), 1.0F);
  EXPECT_EQ(at(0.0, std::tan(radians(50.0))), 1.0F);
  EXPECT_EQ(at(-std::tan(radians(60.0)), 0.0), 0.0F);
  EXPECT_EQ(at(std::tan(radians(71.0)), 0.0), 0.0F);
  EXPECT_EQ(at(0.0, 0.0), 0.0F);
}

TEST(Undistortion, KeepsWhatIsUnknown) {
  const LensDistortion distortion = lenses()[0];
  SoftLabels labels = image_of(distortion);
  for (float& p : labels.probability) p = std::nanf("");
  ASSERT_TRUE(Undistortion().undistort(labels, distortion));
  for (const float p : labels.probability) ASSERT_TRUE(std::isnan(p));
}

TEST(Undistortion, FollowsAnotherCamera) {
  Undistortion undistortion;
  SoftLabels first = image_of(lenses()[0]), second = image_of(lenses()[3]), alone = second;
  ASSERT_TRUE(undistortion.undistort(first, lenses()[0]));
  ASSERT_TRUE(undistortion.undistort(second, lenses()[3]));
  ASSERT_TRUE(Undistortion().undistort(alone, lenses()[3]));
  EXPECT_EQ(second.camera.width, alone.camera.width);
  ASSERT_EQ(second.probability.size(), alone.probability.size());
  for (std::size_t i = 0; i < alone.probability.size(); ++i) {
    EXPECT_TRUE(second.probability[i] == alone.probability[i] ||
                (std::isnan(second.probability[i]) && std::isnan(alone.probability[i])));
  }
}

TEST(Undistortion, RefusesWhatIsNoDistortion) {
  SoftLabels labels = image_of(lenses()[0]);
  EXPECT_TRUE(names(refusal_of<std::invalid_argument>([&] {
                      Undistortion().undistort(labels, lens(Model::kPolynomial, {0.1, 0.2, 0.3}));
                    }),
                    {"3 coefficients"}));
  // All of the image is one direction and its surroundings come from nowhere.
  EXPECT_FALSE(Undistortion().undistort(labels, lens(Model::kPolynomial, {-1e6, 1e9, 0.0, 0.0})));
  EXPECT_EQ(labels.camera.width, camera().width);
}

}  // namespace
}  // namespace situation_awareness::undistortion_test
