// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/undistortion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace situation_awareness {
namespace {

constexpr double kMostScale = 2.0;  ///< width and height of the result, in those of the image
constexpr int kBorderPoints = 64;   ///< on each side of the image
constexpr double kUnknown = -1e6;   ///< x and y of what cv::fisheye::undistortPoints does not know
constexpr double kFar = 1e3;
constexpr float kOutside = -1e4F;        ///< where the result shows nothing of the image
constexpr double kSameDirection_px = 1;  ///< there and back again

cv::Matx33d matrix_of(const PinholeCamera& camera) {
  return {camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0};
}

cv::Matx33d matrix_of(const Eigen::Matrix3d& R) {
  return {R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)};
}

void check(const LensDistortion& distortion) {
  const std::size_t n = distortion.coefficients.size();
  const bool is_polynomial = distortion.model == LensDistortion::Model::kPolynomial;
  if (is_polynomial ? n == 4 || n == 5 || n == 8 || n == 12 || n == 14 : n == 4) return;
  throw std::invalid_argument("a distortion has " + std::to_string(n) + " coefficients");
}

/// A lens by OpenCV.
class Lens {
 public:
  Lens(const PinholeCamera& camera, const LensDistortion& distortion)
      : K_(matrix_of(camera)),
        R_(matrix_of(distortion.R_rectified_camera)),
        D_(distortion.coefficients),
        is_polynomial_(distortion.model == LensDistortion::Model::kPolynomial) {}

  /// Pixels of the image as those of `to`.
  std::vector<cv::Point2d> undistorted(const std::vector<cv::Point2d>& pixels, const PinholeCamera& to) const {
    std::vector<cv::Point2d> result;
    if (is_polynomial_) {
      cv::undistortPoints(pixels, result, K_, D_, R_, matrix_of(to), kPrecise);
    } else {
      cv::fisheye::undistortPoints(pixels, result, K_, D_, R_, matrix_of(to));
    }
    return result;
  }

  /// For each pixel of `to` the column and the row in the image.
  std::array<cv::Mat, 2> map(const PinholeCamera& to) const {
    std::array<cv::Mat, 2> maps;
    const cv::Size size(to.width, to.height);
    if (is_polynomial_) {
      cv::initUndistortRectifyMap(K_, D_, R_, matrix_of(to), size, CV_32FC1, maps[0], maps[1]);
    } else {
      cv::fisheye::initUndistortRectifyMap(K_, D_, R_, matrix_of(to), size, CV_32FC1, maps[0], maps[1]);
    }
    return maps;
  }

 private:
  inline static const cv::TermCriteria kPrecise{cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-6};
  cv::Matx33d K_, R_;
  std::vector<double> D_;
  bool is_polynomial_;
};

/// That of all directions of the image's border, as far as it is not too large; none if they are not known.
std::optional<PinholeCamera> camera_around(const PinholeCamera& camera, const Lens& lens) {
  std::vector<cv::Point2d> border;
  for (int i = 0; i <= kBorderPoints; ++i) {
    const double u = static_cast<double>(i) / kBorderPoints * camera.width - 0.5;
    const double v = static_cast<double>(i) / kBorderPoints * camera.height - 0.5;
    border.insert(border.end(), {{u, -0.5}, {u, camera.height - 0.5}, {-0.5, v}, {camera.width - 0.5, v}});
  }
  const std::vector<cv::Point2d> directions = lens.undistorted(border, camera);
  double left = camera.cx_px, right = left, top = camera.cy_px, bottom = top;
  for (std::size_t i = 0; i < border.size(); ++i) {
    const bool is_known =
        std::isfinite(directions[i].x) && std::isfinite(directions[i].y) && directions[i].x != kUnknown;
    // A fisheye also looks aside and behind.
    const cv::Point2d away = kFar * (border[i] - cv::Point2d(camera.cx_px, camera.cy_px));
    const cv::Point2d p = is_known ? directions[i] : away;
    left = std::min(left, p.x);
    right = std::max(right, p.x);
    top = std::min(top, p.y);
    bottom = std::max(bottom, p.y);
  }
  const double half_width = 0.5 * kMostScale * camera.width, half_height = 0.5 * kMostScale * camera.height;
  left = std::ceil(std::max(left, camera.cx_px - half_width));
  right = std::floor(std::min(right, camera.cx_px + half_width));
  top = std::ceil(std::max(top, camera.cy_px - half_height));
  bottom = std::floor(std::min(bottom, camera.cy_px + half_height));
  if (!(left < right && top < bottom)) return std::nullopt;
  PinholeCamera around = camera;
  around.width = static_cast<int>(right - left) + 1;
  around.height = static_cast<int>(bottom - top) + 1;
  around.cx_px = camera.cx_px - left;
  around.cy_px = camera.cy_px - top;
  return around;
}

/// Takes out what comes into the image again far from where the lens was calibrated, as polynomials do.
void drop_second_directions(std::array<cv::Mat, 2>& maps, const PinholeCamera& from, const PinholeCamera& to,
                            const Lens& lens) {
  std::vector<cv::Point2d> pixels;
  std::vector<int> columns;
  for (int row = 0; row < to.height; ++row) {
    float *const u = maps[0].ptr<float>(row), *const v = maps[1].ptr<float>(row);
    pixels.clear();
    columns.clear();
    for (int column = 0; column < to.width; ++column) {
      if (u[column] >= -1.0F && v[column] >= -1.0F && u[column] <= static_cast<float>(from.width) &&
          v[column] <= static_cast<float>(from.height)) {
        pixels.emplace_back(u[column], v[column]);
        columns.push_back(column);
      } else {
        u[column] = v[column] = kOutside;  // not finite, too
      }
    }
    if (pixels.empty()) continue;
    const std::vector<cv::Point2d> back = lens.undistorted(pixels, to);
    for (std::size_t i = 0; i < back.size(); ++i) {
      const int column = columns[i];
      if (std::hypot(back[i].x - column, back[i].y - row) < kSameDirection_px) continue;
      u[column] = v[column] = kOutside;
    }
  }
}

bool is_same(const PinholeCamera& a, const PinholeCamera& b) {
  return a.width == b.width && a.height == b.height && a.fx_px == b.fx_px && a.fy_px == b.fy_px && a.cx_px == b.cx_px &&
         a.cy_px == b.cy_px;
}

}  // namespace

struct Undistortion::Map {
  PinholeCamera from;
  LensDistortion distortion;
  std::optional<PinholeCamera> to;
  std::array<cv::Mat, 2> maps;
};

Undistortion::Undistortion() = default;
Undistortion::~Undistortion() = default;

bool Undistortion::undistort(SoftLabels& labels, const LensDistortion& distortion) {
  check(labels);
  check(distortion);
  if (!map_ || !is_same(map_->from, labels.camera) || !(map_->distortion == distortion)) {
    map_ = std::make_unique<Map>(Map{labels.camera, distortion, {}, {}});
    const Lens lens(labels.camera, distortion);
    if (const auto to = camera_around(labels.camera, lens)) {
      map_->maps = lens.map(*to);
      drop_second_directions(map_->maps, labels.camera, *to, lens);
      if (cv::countNonZero(map_->maps[0] != kOutside) > 0) map_->to = to;
    }
  }
  if (!map_->to) return false;
  const cv::Mat from(labels.camera.height, labels.camera.width, CV_32FC1, labels.probability.data());
  std::vector<float> probability(static_cast<std::size_t>(map_->to->width) *
                                 static_cast<std::size_t>(map_->to->height));
  cv::Mat to(map_->to->height, map_->to->width, CV_32FC1, probability.data());
  cv::remap(from, to, map_->maps[0], map_->maps[1], cv::INTER_LINEAR, cv::BORDER_CONSTANT,
            cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()));
  labels.camera = *map_->to;
  labels.probability = std::move(probability);
  return true;
}

}  // namespace situation_awareness
