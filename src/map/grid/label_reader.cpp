// SPDX-License-Identifier: BSD-3-Clause
#include "label_reader.hpp"

#include <limits>

#include "several_at_once.hpp"

namespace situation_awareness {
namespace {

constexpr float kLeastLabel = 0.2F;  ///< columns that see no pixel above it are not of the class
constexpr int kPeakReach = 2;

}  // namespace

void LabelReader::read(const SoftLabels& labels) {
  width_ = labels.camera.width;
  height_ = labels.camera.height;
  is_all_known_ = true;
  labels_ = labels.probability;
  for (int v = 0; v < height_; ++v) {
    for (int u = 0; u < width_; ++u) {
      const std::size_t i = index(u, v);
      if (labels.probability[i] == 0.5F && !is_edge(labels.probability, u, v)) {
        labels_[i] = std::numeric_limits<float>::quiet_NaN();
      }
      is_all_known_ &= is_known(labels_[i]);
    }
  }
  find_peaks();
  find_means();
  class_counts_.assign(static_cast<std::size_t>(width_ + 1) * static_cast<std::size_t>(height_ + 1), 0);
  for (int v = 0; v < height_; ++v) {
    int class_row = 0;
    for (int u = 0; u < width_; ++u) {
      const float p = at(u, v);
      if (is_known(p) && p > kLeastLabel) class_row += 1;
      class_count(u + 1, v + 1) = class_count(u + 1, v) + class_row;
    }
  }
}

SITUATION_AWARENESS_SEVERAL_AT_ONCE
bool LabelReader::read_column(const Eigen::Vector3d& foot, const Eigen::Vector3d& up, double first_m, double step_m,
                              std::vector<float>& sharp, std::vector<float>& soft) const {
  const double right_px = this->right_px(), low_px = this->low_px(), most_u = width_ - 1.0, most_v = height_ - 1.0;
  const std::int32_t most_column = std::max(width_ - 2, 0), most_row = std::max(height_ - 2, 0);
  const std::size_t next_column = width_ > 1 ? 1 : 0, next_row = height_ > 1 ? static_cast<std::size_t>(width_) : 0;
  const double x = foot.x(), y = foot.y(), z = foot.z(), up_x = up.x(), up_y = up.y(), up_z = up.z();
  std::int32_t any_known = 0;
  for (std::size_t begin = 0; begin < sharp.size(); begin += kTileCells) {
    Row<std::int32_t> is_in, columns, rows;
    Row<float> a, b;
    Row<std::array<std::array<float, 2>, 4>> pixels;
    const std::size_t count = std::min(sharp.size() - begin, static_cast<std::size_t>(kTileCells));
    for (std::size_t i = 0; i < count; ++i) {
      const double height_m = static_cast<double>(static_cast<std::int32_t>(begin + i)) * step_m + first_m;
      const double per_z = 1.0 / (z + height_m * up_z);
      const double u = (x + height_m * up_x) * per_z, v = (y + height_m * up_y) * per_z;
      const bool contains = (u >= -0.5) & (v >= -0.5) & (u <= right_px) & (v <= low_px);
      const double u0 = contains & (u > 0.0) ? u : 0.0, v0 = contains & (v > 0.0) ? v : 0.0;
      const double u1 = u0 < most_u ? u0 : most_u, v1 = v0 < most_v ? v0 : most_v;
      const auto whole_u = static_cast<std::int32_t>(u1), whole_v = static_cast<std::int32_t>(v1);
      columns[i] = whole_u < most_column ? whole_u : most_column;
      rows[i] = whole_v < most_row ? whole_v : most_row;
      a[i] = static_cast<float>(u1 - static_cast<double>(columns[i]));
      b[i] = static_cast<float>(v1 - static_cast<double>(rows[i]));
      is_in[i] = contains ? 1 : 0;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t first = index(columns[i], rows[i]);
      pixels[i] = {sharp_and_soft_[first], sharp_and_soft_[first + next_column], sharp_and_soft_[first + next_row],
                   sharp_and_soft_[first + next_row + next_column]};
    }
    for (std::size_t i = 0; i < count; ++i) {
      std::array<float, 2> mean;
      for (std::size_t k = 0; k < 2; ++k) {
        mean[k] = (1.0F - b[i]) * ((1.0F - a[i]) * pixels[i][0][k] + a[i] * pixels[i][1][k]) +
                  b[i] * ((1.0F - a[i]) * pixels[i][2][k] + a[i] * pixels[i][3][k]);
      }
      sharp[begin + i] = is_in[i] != 0 ? mean[0] : std::numeric_limits<float>::quiet_NaN();
      soft[begin + i] = is_in[i] != 0 ? mean[1] : 0.0F;
      any_known |= is_known(sharp[begin + i]) ? 1 : 0;
    }
  }
  return any_known != 0;
}

void LabelReader::find_class(const Row<double>& u_px, const Row<double>& other_u_px, const Row<double>& v_px,
                             const Row<double>& other_v_px, const Mask& is_asked, Row<std::int32_t>& has) const {
  Row<std::int32_t> columns, end_columns, rows, end_rows;
  const auto find_ends = [](const Row<double>& one, const Row<double>& other, int size, Row<std::int32_t>& begins,
                            Row<std::int32_t>& ends) {
    for (std::size_t c = 0; c < kTileCells; ++c) {
      begins[c] = begin(one[c] < other[c] ? one[c] : other[c], size);
      ends[c] = end(one[c] < other[c] ? other[c] : one[c], size);
    }
  };
  find_ends(u_px, other_u_px, width_, columns, end_columns);
  find_ends(v_px, other_v_px, height_, rows, end_rows);
  for (std::size_t c = 0; c < kTileCells; ++c) {
    has[c] = is_asked[c] != 0.0 && has_class_between(columns[c], end_columns[c], rows[c], end_rows[c]) ? 1 : 0;
  }
}

bool LabelReader::is_edge(const std::vector<float>& labels, int u, int v) const {
  bool has_less = false, has_more = false;
  for (int r = std::max(v - 1, 0); r <= std::min(v + 1, height_ - 1); ++r) {
    for (int c = std::max(u - 1, 0); c <= std::min(u + 1, width_ - 1); ++c) {
      has_less |= labels[index(c, r)] < 0.5F;
      has_more |= labels[index(c, r)] > 0.5F;
    }
  }
  return has_less && has_more;
}

void LabelReader::find_peaks() {
  std::vector<float>& along = peaks_along_rows_;
  along.assign(labels_.size(), 0.0F);
  peaks_.assign(labels_.size(), 0.0F);
  for (int v = 0; v < height_; ++v) {
    for (int u = 0; u < width_; ++u) {
      const float p = at(u, v);
      if (!is_known(p) || p <= 0.0F) continue;
      for (int c = std::max(u - kPeakReach, 0); c <= std::min(u + kPeakReach, width_ - 1); ++c) {
        along[index(c, v)] = std::max(along[index(c, v)], p);
      }
    }
  }
  for (int v = 0; v < height_; ++v) {
    for (int u = 0; u < width_; ++u) {
      const float p = along[index(u, v)];
      if (p <= 0.0F) continue;
      for (int r = std::max(v - kPeakReach, 0); r <= std::min(v + kPeakReach, height_ - 1); ++r) {
        peaks_[index(u, r)] = std::max(peaks_[index(u, r)], p);
      }
    }
  }
}

void LabelReader::find_means() {
  std::vector<double>& sums = sums_;
  sums.assign(static_cast<std::size_t>(width_ + 1) * static_cast<std::size_t>(height_ + 1), 0.0);
  for (int v = 0; v < height_; ++v) {
    double row = 0.0;
    for (int u = 0; u < width_; ++u) {
      const float p = at(u, v);
      if (is_known(p)) row += static_cast<double>(p);
      sums[corner(u + 1, v + 1)] = sums[corner(u + 1, v)] + row;
    }
  }
  sharp_and_soft_.resize(labels_.size());
  for (int v = 0; v < height_; ++v) {
    const int r0 = std::max(v - 1, 0), r1 = std::min(v + 2, height_);
    for (int u = 0; u < width_; ++u) {
      const int c0 = std::max(u - 1, 0), c1 = std::min(u + 2, width_);
      const double sum = sums[corner(c1, r1)] - sums[corner(c0, r1)] - sums[corner(c1, r0)] + sums[corner(c0, r0)];
      sharp_and_soft_[index(u, v)] = {at(u, v), static_cast<float>(sum / ((c1 - c0) * (r1 - r0)))};
    }
  }
}

}  // namespace situation_awareness
