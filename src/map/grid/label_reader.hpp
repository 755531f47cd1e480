// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "seen_row.hpp"
#include "situation_awareness/image/image.hpp"

namespace situation_awareness {

/// Labels that are read in between the pixels. Exactly 0.5 is not known, but for a pixel at an edge: one between others
/// of less and of more, which is half of the class.
class LabelReader {
 public:
  /// Takes the labels that are read from now on.
  void read(const SoftLabels& labels);

  static bool is_known(float p) { return !std::isnan(p); }

  bool is_all_known() const { return is_all_known_; }

  double right_px() const { return width_ - 0.5; }  ///< of the image
  double low_px() const { return height_ - 0.5; }

  bool contains(double u, double v) const { return u >= -0.5 && v >= -0.5 && u <= width_ - 0.5 && v <= height_ - 0.5; }

  /// Bilinear; NaN where a pixel that counts is not known.
  float value(double u, double v) const { return between(place_between(u, v), labels_); }

  /// Reads the bilinear value of the labels, and that of their means over 3 x 3 pixels, at places above each other,
  /// from a height above the foot on; both are as ImageExtent::A says. What is not known counts in means as nothing of
  /// the class. NaN and 0 where they are outside the image. False if none is known.
  bool read_column(const Eigen::Vector3d& foot, const Eigen::Vector3d& up, double first_m, double step_m,
                   std::vector<float>& sharp, std::vector<float>& soft) const;

  /// The greatest of 5 x 5 pixels around: less than 1 where something is thinner than a pixel.
  float peak(double u, double v) const {
    const int c = static_cast<int>(std::lround(std::clamp(u, 0.0, width_ - 1.0)));
    const int r = static_cast<int>(std::lround(std::clamp(v, 0.0, height_ - 1.0)));
    return peaks_[static_cast<std::size_t>(r) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(c)];
  }

  /// Whether a pixel that may be of the class is in a rectangle, or beside it.
  bool has_class(double u_min, double u_max, double v_min, double v_max) const {
    return has_class_between(begin(u_min, width_), end(u_max, width_), begin(v_min, height_), end(v_max, height_));
  }

  /// Whether such a pixel is in each of the rectangles between two points.
  void find_class(const Row<double>& u_px, const Row<double>& other_u_px, const Row<double>& v_px,
                  const Row<double>& other_v_px, const Mask& is_asked, Row<std::int32_t>& has) const;

 private:
  /// The first pixel of an extent, and the one after its last: the integers below and above its ends, in the image.
  static int begin(double least_px, int size) {
    const double most = size;
    const double bounded = least_px < 0.0 ? 0.0 : most < least_px ? most : least_px;
    return static_cast<int>(bounded);
  }
  static int end(double greatest_px, int size) {
    const double most = size;
    const double bounded = greatest_px < -1.0 ? -1.0 : most < greatest_px ? most : greatest_px;
    const int whole = static_cast<int>(bounded);
    const int after = whole + (static_cast<double>(whole) < bounded ? 2 : 1);
    return after < size ? after : size;
  }
  bool has_class_between(int c0, int c1, int r0, int r1) const {
    if (c0 >= c1 || r0 >= r1) return false;
    return class_count(c1, r1) - class_count(c0, r1) - class_count(c1, r0) + class_count(c0, r0) > 0;
  }

  bool is_edge(const std::vector<float>& labels, int u, int v) const;
  void find_peaks();
  void find_means();

  /// Four pixels around a place, and where it is between them.
  struct Between {
    std::size_t first, right, below, right_below;
    float a, b;
  };
  Between place_between(double u, double v) const {
    const double x = std::clamp(u, 0.0, width_ - 1.0), y = std::clamp(v, 0.0, height_ - 1.0);
    const int c = std::min(static_cast<int>(x), std::max(width_ - 2, 0));
    const int r = std::min(static_cast<int>(y), std::max(height_ - 2, 0));
    const int c1 = std::min(c + 1, width_ - 1), r1 = std::min(r + 1, height_ - 1);
    return {
        index(c, r), index(c1, r), index(c, r1), index(c1, r1), static_cast<float>(x - c), static_cast<float>(y - r)};
  }
  static float between(const Between& at, const std::vector<float>& values) {
    return (1.0F - at.b) * ((1.0F - at.a) * values[at.first] + at.a * values[at.right]) +
           at.b * ((1.0F - at.a) * values[at.below] + at.a * values[at.right_below]);
  }
  std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(u);
  }
  float at(int u, int v) const { return labels_[index(u, v)]; }
  std::size_t corner(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(width_ + 1) + static_cast<std::size_t>(u);
  }
  int& class_count(int u, int v) { return class_counts_[corner(u, v)]; }
  int class_count(int u, int v) const { return class_counts_[corner(u, v)]; }

  int width_ = 0, height_ = 0;
  bool is_all_known_ = true;
  std::vector<float> labels_;                         ///< NaN: not known
  std::vector<std::array<float, 2>> sharp_and_soft_;  ///< labels, and their means of 3 x 3 pixels
  std::vector<int> class_counts_;                     ///< of all pixels above and to the left
  std::vector<float> peaks_, peaks_along_rows_;
  std::vector<double> sums_;  ///< of the labels above and to the left
};

}  // namespace situation_awareness
