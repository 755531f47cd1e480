// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

#include "seen_row.hpp"
#include "several_at_once.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Weight of evidence against the class, as what is hidden by something unknown looks like nothing.
constexpr double kNegativeWeight = 0.4;
/// Weight of a column that shows the class in a part only: at an edge, or partly hidden.
constexpr double kPartialWeight = 0.7;
/// Weight of a cell's evidence: an image counts 1 at most, and after so many older ones fade.
constexpr double kMaxWeight = 100.0;
/// Evidence of which half makes a cell of the class, however weak all is around it.
constexpr double kLeastMean = 0.5;
/// m. Step between the nine errors of the elevation that are tried.
constexpr double kOffsetStep_m = 0.5;

constexpr int kOffsets = GridMap::kOffsets;
constexpr double kLeastDepth_m = 0.1;
constexpr float kLeastLabel = 0.2F;  ///< columns that see no pixel above it are not of the class
constexpr double kHeightStep_m = 0.25;
constexpr double kFarthest_m = 1e6;  ///< of a camera from the world's origin

/// Of a tile, or of a cell.
struct Place {
  int column = 0, row = 0;
  bool operator<(const Place& other) const { return row != other.row ? row < other.row : column < other.column; }
};

/// From where images look at a cell: unit vectors along their sight lines, each weighted by how much the direction has
/// turned since the image before.
struct Directions {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float turned = 0.0F;

  void add(const Eigen::Vector3f& along, float turn) {
    sum += turn * along;
    turned += turn;
  }
  void scale(float part) {
    sum *= part;
    turned *= part;
  }
  /// Their variance on the unit sphere.
  float spread() const { return turned > 0.0F ? std::max(0.0F, 1.0F - (sum / turned).squaredNorm()) : 0.0F; }
};

/// Of a cell on which an image showed something of the class, by each error of the elevation: sums over images of their
/// weights, and of their evidence times these.
struct Evidence {
  std::array<float, kOffsets> weight{};
  std::array<float, kOffsets> sharp_sum{};      ///< by the labels as they are
  std::array<float, kOffsets> soft_sum{};       ///< by their means over 3 x 3 pixels
  std::array<Directions, kOffsets> class_seen;  ///< from where images show the class
  std::int32_t class_images = 0;                ///< with evidence for the class, by any offset
  std::int32_t class_latest = 0;                ///< the number of the latest by the offset that was believed

  float sharp(std::size_t offset) const { return weight[offset] > 0.0F ? sharp_sum[offset] / weight[offset] : 0.0F; }
  float soft(std::size_t offset) const { return weight[offset] > 0.0F ? soft_sum[offset] / weight[offset] : 0.0F; }
};

/// What images tell of the cells of a tile. Numbers of a cell are in arrays, as most cells are treated alike, a row at
/// a time: those that show nothing of the class.
struct Observed {
  using Cells = std::array<float, kCellsOfTile>;

  std::array<std::int32_t, kCellsOfTile> images{};
  Cells seen_x{}, seen_y{}, seen_z{}, turned{};  ///< Directions of all images that show the cell
  Cells latest_x{}, latest_y{}, latest_z{};      ///< the latest of these directions
  Cells nothing_weight{};                        ///< of images, until one shows something of the class on the cell
  std::array<std::uint16_t, kCellsOfTile> number_of{};  ///< from 1 on, of the cell's evidence from then on; 0: none
  std::vector<Evidence> evidence;
  bool is_any_known = false;  ///< an image is evidence on a cell
  bool has_evidence = false;  ///< an image showed something of the class in the tile

  KnownRow row(std::size_t first) {
    return {&seen_x[first],   &seen_y[first],   &seen_z[first],         &turned[first], &latest_x[first],
            &latest_y[first], &latest_z[first], &nothing_weight[first], &images[first]};
  }
  Evidence* find(std::size_t cell) { return number_of[cell] == 0 ? nullptr : &evidence[number_of[cell] - 1U]; }
  const Evidence* find(std::size_t cell) const {
    return number_of[cell] == 0 ? nullptr : &evidence[number_of[cell] - 1U];
  }
  Directions seen(std::size_t cell) const {
    return {Eigen::Vector3f(seen_x[cell], seen_y[cell], seen_z[cell]), turned[cell]};
  }
};

/// Cells of a square of the world.
struct Tile {
  std::array<float, kCellsOfTile> ground_world_m;  ///< NaN where it is not known
  std::unique_ptr<Observed> observed;              ///< null until an image shows the tile
  double low_m = 0.0, high_m = 0.0;                ///< of its ground; low_m > high_m where none is known
};

/// What the map says of the cells of a tile whose evidence it does not have any more.
struct SettledTile {
  static constexpr int kMostImages = 65535;

  /// A cell of which an image showed the class.
  struct Cell {
    std::uint16_t cell;
    float probability;
    std::int32_t class_images;
  };

  std::array<std::uint16_t, kCellsOfTile> images{};  ///< with evidence, up to kMostImages; 0: not observed
  std::vector<Cell> of_class;                        ///< by cell; all others that were observed are not of the class
};

/// Labels that are read in between the pixels. Exactly 0.5 is not known, but for a pixel at an edge: one between others
/// of less and of more, which is half of the class.
class LabelReader {
 public:
  /// From now on of these.
  void read(const SoftLabels& labels) {
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
  SITUATION_AWARENESS_SEVERAL_AT_ONCE
  bool read_column(const Eigen::Vector3d& foot, const Eigen::Vector3d& up, double first_m, double step_m,
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

  /// The same of the rectangles between two points each.
  void find_class(const Row<double>& u_px, const Row<double>& other_u_px, const Row<double>& v_px,
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

 private:
  static constexpr int kPeakReach = 2;

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

  bool is_edge(const std::vector<float>& labels, int u, int v) const {
    bool has_less = false, has_more = false;
    for (int r = std::max(v - 1, 0); r <= std::min(v + 1, height_ - 1); ++r) {
      for (int c = std::max(u - 1, 0); c <= std::min(u + 1, width_ - 1); ++c) {
        has_less |= labels[index(c, r)] < 0.5F;
        has_more |= labels[index(c, r)] > 0.5F;
      }
    }
    return has_less && has_more;
  }

  void find_peaks() {
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

  void find_means() {
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

/// Which ground and how much above it the camera sees past nearer ground: the steepest sight line so far, outwards.
class Horizon {
 public:
  Horizon(const Elevation& elevation, double reach_m, double step_m, double class_height_m)
      : elevation_(&elevation), rings_per_m_(1.0 / step_m), rings_(static_cast<int>(std::ceil(reach_m / step_m)) + 1) {
    ground_slopes_.assign(first_place(kDirections), -std::numeric_limits<float>::infinity());
    top_slopes_ = ground_slopes_;
    for (int ring = 0; ring < rings_; ++ring) {
      rings_m_.push_back((ring + 0.5) * step_m);
      per_ring_m_.push_back(1.0 / rings_m_.back());
      class_slopes_.push_back(class_height_m / rings_m_.back());
    }
    steepest_.resize(kDirections);
    marched_.resize(kDirections);
  }

  /// From now on that of a camera there.
  void begin(const Eigen::Vector3d& p_world_camera_m) {
    p_ = p_world_camera_m;
    std::fill(steepest_.begin(), steepest_.end(), Steepest{});
    std::fill(marched_.begin(), marched_.end(), 0);
  }

  /// Of the ground before a point, given from the camera on, but for its own surroundings.
  double slope_before(const Eigen::Vector2d& away_m, double range_m) {
    return static_cast<double>(ground_slopes_[place_before(away_m, range_m, kOwn_m)]);
  }

  /// Writes the slope before each cell of a row that is in the image to SeenRow::hidden_below_m.
  void find_slopes_before(double y_m, SeenRow& row) {
    Row<std::int32_t> directions, rings;
    find_rings(row, y_m, kDirections, kOwn_m, rings_per_m_, directions, rings);
    Row<std::size_t> places;
    for (std::size_t c = 0; c < kTileCells; ++c) {
      places[c] = row.is_in[c] != 0.0 ? place_of(directions[c], rings[c]) : 0;
    }
    for (std::size_t c = 0; c < kTileCells; ++c) row.hidden_below_m[c] = static_cast<double>(ground_slopes_[places[c]]);
  }

  /// The same of the tops of what may stand on the ground, but for what is as near to the point as its own size.
  double top_slope_before(const Eigen::Vector2d& away_m, double range_m, double size_m) {
    return static_cast<double>(top_slopes_[place_before(away_m, range_m, size_m)]);
  }

 private:
  static constexpr int kDirections = 2048;
  static constexpr double kOwn_m = 1.5;

  std::size_t place_before(const Eigen::Vector2d& away_m, double range_m, double own_m) {
    const int direction = static_cast<int>(quarters(away_m) * (kDirections / 4) + 0.5) % kDirections;
    return place_of(direction, static_cast<int>((range_m - own_m) * rings_per_m_));
  }

  /// The index of the slopes up to a ring in a direction, which is marched to it; before the first ring there is none.
  std::size_t place_of(int direction, int ring) {
    const int last = std::min(ring, rings_ - 1);
    if (last >= marched_[static_cast<std::size_t>(direction)]) march(direction, last);
    return first_place(direction) + static_cast<std::size_t>(std::max(last + 1, 0));
  }

  std::size_t first_place(int direction) const {
    return static_cast<std::size_t>(direction) * static_cast<std::size_t>(rings_ + 1);
  }

  /// Grows with the angle of a vector, from 0 to 4, without a call of atan2: along the square through the axes at 1.
  static double quarters(const Eigen::Vector2d& v) {
    const double sum = std::abs(v.x()) + std::abs(v.y());
    if (sum == 0.0) return 0.0;
    if (v.y() >= 0.0) return v.x() >= 0.0 ? v.y() / sum : 1.0 - v.x() / sum;
    return v.x() < 0.0 ? 2.0 - v.y() / sum : 3.0 + v.x() / sum;
  }

  static Eigen::Vector2d unit_vector_at(double quarters) {
    const int quarter = static_cast<int>(quarters);
    const double part = quarters - quarter;
    Eigen::Vector2d v(1.0 - part, part);
    for (int i = 0; i < quarter; ++i) v = {-v.y(), v.x()};
    return v.normalized();
  }

  /// Goes on in a direction to a ring, or a few more.
  void march(int direction, int to_ring) {
    std::int32_t& marched = marched_[static_cast<std::size_t>(direction)];
    Steepest& steepest = steepest_[static_cast<std::size_t>(direction)];
    const Eigen::Vector2d ahead = unit_vector_at(4.0 * direction / kDirections);
    const double camera_z_m = p_.z();
    while (marched <= to_ring) {
      const auto first = static_cast<std::size_t>(marched);
      const std::size_t count = std::min(kAtOnce, static_cast<std::size_t>(rings_) - first);
      float* const ground_slopes = &ground_slopes_[first_place(direction) + 1 + first];
      float* const top_slopes = &top_slopes_[first_place(direction) + 1 + first];
      std::array<double, kAtOnce> slopes;
      elevation_->along(p_.head<2>(), ahead, &rings_m_[first], count, slopes.data());
      for (std::size_t i = 0; i < count; ++i) slopes[i] = (slopes[i] - camera_z_m) * per_ring_m_[first + i];
      Steepest so_far = steepest;
      for (std::size_t i = 0; i < count; ++i) {
        so_far.ground = std::max(so_far.ground, slopes[i]);  // but for what is not known, NaN
        so_far.top = std::max(so_far.top, slopes[i] + class_slopes_[first + i]);
        ground_slopes[i] = static_cast<float>(so_far.ground);
        top_slopes[i] = static_cast<float>(so_far.top);
      }
      steepest = so_far;
      marched += static_cast<std::int32_t>(count);
    }
  }

  /// Up to where a direction was marched.
  struct Steepest {
    double ground = -1e6, top = -1e6;
  };

  static constexpr std::size_t kAtOnce = 32;  ///< rings

  const Elevation* elevation_;
  Eigen::Vector3d p_ = Eigen::Vector3d::Zero();
  double rings_per_m_;
  int rings_;
  std::vector<std::int32_t> marched_;              ///< rings, by direction
  std::vector<Steepest> steepest_;                 ///< by direction
  std::vector<float> ground_slopes_, top_slopes_;  ///< by direction and ring; before the first ring there is none
  std::vector<double> rings_m_;                    ///< from the camera, to the rings' middles
  std::vector<double> per_ring_m_;                 ///< 1 by each of these
  std::vector<double> class_slopes_;               ///< that the class's height adds there
};

/// One image while it is added.
struct View {
  const PinholeCamera& camera;
  Eigen::Matrix3d R_camera_world;
  Eigen::Vector3d p_world_camera_m;
  double reach_m;
  Eigen::Matrix3d A;  ///< of a point relative to the camera along the world's axes to (u z, v z, z)
  std::array<Eigen::Vector3d, 4> outwards;  ///< unit vectors away from the planes through the image's edges

  /// Whether a sphere may be in the image.
  bool may_see(const Eigen::Vector3d& middle_world_m, double radius_m) const {
    const Eigen::Vector3d p = R_camera_world * (middle_world_m - p_world_camera_m);
    if (p.norm() > reach_m + radius_m || p.z() < -radius_m) return false;
    return std::all_of(outwards.begin(), outwards.end(),
                       [&](const Eigen::Vector3d& outward) { return outward.dot(p) < radius_m; });
  }
};

/// View::outwards, along the camera's axes.
std::array<Eigen::Vector3d, 4> outwards_of(const PinholeCamera& camera) {
  return {Eigen::Vector3d(camera.fx_px, 0.0, -(camera.width - 0.5 - camera.cx_px)).normalized(),
          Eigen::Vector3d(-camera.fx_px, 0.0, -(camera.cx_px + 0.5)).normalized(),
          Eigen::Vector3d(0.0, camera.fy_px, -(camera.height - 0.5 - camera.cy_px)).normalized(),
          Eigen::Vector3d(0.0, -camera.fy_px, -(camera.cy_px + 0.5)).normalized()};
}

double probability_of(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

}  // namespace

class GridMap::Impl {
 public:
  Impl(const GridMapParams& params, std::shared_ptr<const Elevation> elevation)
      : params_((params.validate(), params)),
        elevation_(elevation ? std::move(elevation) : throw std::invalid_argument("a grid needs an elevation")),
        horizon_(*elevation_, params.reach_m, 2.0 * params.cell_m, params.class_height_m) {
    ground_ = params.smooth_m > 0.0 ? std::make_shared<Elevation>(elevation_->smoothed(params.smooth_m)) : elevation_;
    heights_per_offset_ = std::max(1, static_cast<int>(std::lround(params.class_height_m / kHeightStep_m)));
    height_step_m_ = params.class_height_m / heights_per_offset_;
    steps_per_offset_ = std::max(1, static_cast<int>(std::lround(kOffsetStep_m / height_step_m_)));
    soft_column_.resize(static_cast<std::size_t>((kOffsets - 1) * steps_per_offset_ + heights_per_offset_ + 1));
    for (std::vector<float>* const values : {&column_, &least_, &greatest_, &soft_least_}) {
      values->resize(soft_column_.size());
    }
    known_.resize(soft_column_.size());
  }

  GridUpdate update(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera) {
    check(labels);
    if (!T_world_camera.matrix().allFinite()) throw std::invalid_argument("the camera's pose is not finite");
    if (T_world_camera.translation().norm() > kFarthest_m) {
      throw std::invalid_argument("the camera is more than 1000 km from the world's origin");
    }
    Eigen::Matrix3d K;
    K << labels.camera.fx_px, 0.0, labels.camera.cx_px, 0.0, labels.camera.fy_px, labels.camera.cy_px, 0.0, 0.0, 1.0;
    const Eigen::Matrix3d R_camera_world = T_world_camera.linear().transpose();
    const View view{labels.camera,   R_camera_world,     T_world_camera.translation(),
                    params_.reach_m, K * R_camera_world, outwards_of(labels.camera)};
    const LabelReader& reader = reader_;
    reader_.read(labels);
    Horizon& horizon = horizon_;
    horizon.begin(view.p_world_camera_m);
    GridUpdate done;
    stamp_ns_ = labels.stamp_ns;
    ++images_;
    shared_.fill(0.0);
    all_.fill(0.0);
    believed_ = best_offset();
    const double edge_m = kTileCells * params_.cell_m;
    const int reach = static_cast<int>(std::ceil(params_.reach_m / edge_m)) + 1;
    const auto tile_of = [&](double coordinate_m) { return static_cast<int>(std::floor(coordinate_m / edge_m)); };
    const int column = tile_of(view.p_world_camera_m.x()), row = tile_of(view.p_world_camera_m.y());
    auto next = tiles_.begin();
    for (int r = row - reach; r <= row + reach; ++r) {
      for (int c = column - reach; c <= column + reach; ++c) {
        const Eigen::Vector2d middle_m = Eigen::Vector2d(c + 0.5, r + 0.5) * edge_m;
        if ((middle_m - view.p_world_camera_m.head<2>()).norm() > params_.reach_m + edge_m) continue;
        Tile& tile = known_tile({c, r}, next);
        if (tile.low_m > tile.high_m) continue;
        const double radius_m =
            std::hypot(0.71 * edge_m, 0.5 * (tile.high_m - tile.low_m) + params_.class_height_m + max_offset_m());
        if (!view.may_see({middle_m.x(), middle_m.y(), 0.5 * (tile.low_m + tile.high_m)}, radius_m)) continue;
        add_to(tile, {c, r}, view, reader, horizon, done);
      }
    }
    for (int offset = 0; offset < kOffsets; ++offset) {
      const auto i = static_cast<std::size_t>(offset);
      shared_sum_[i] += shared_[i];
      all_sum_[i] += all_[i];
    }
    return done;
  }

  void keep_around(const Eigen::Vector2d& p_world_m, double distance_m) {
    for (auto it = tiles_.begin(); it != tiles_.end();) {
      it = is_far(it->first, p_world_m, distance_m) ? tiles_.erase(it) : std::next(it);
    }
    for (auto it = settled_.begin(); it != settled_.end();) {
      it = is_far(it->first, p_world_m, distance_m) ? settled_.erase(it) : std::next(it);
    }
  }

  void settle_beyond(const Eigen::Vector2d& p_world_m, double distance_m, const SemanticGrid& judged) {
    for (auto it = tiles_.begin(); it != tiles_.end();) {
      if (!is_far(it->first, p_world_m, distance_m)) {
        ++it;
        continue;
      }
      if (is_observed(it->second)) settle(it->first, *it->second.observed, judged);
      it = tiles_.erase(it);
    }
  }

  bool is_settled(const Eigen::Vector2d& p_world_m) const {
    const Eigen::Vector2d at = p_world_m / params_.cell_m;
    if (!(at.cwiseAbs().maxCoeff() < kFarthest_m / params_.cell_m)) return false;
    const auto [key, cell] = place_of(static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())));
    const auto settled = settled_.find(key);
    if (settled == settled_.end() || settled->second.images[cell] == 0) return false;
    const auto tile = tiles_.find(key);
    return tile == tiles_.end() || !tile->second.observed || tile->second.observed->images[cell] < kEnough;
  }

  int best_offset() const {
    int best = kOffsets / 2;
    for (int offset = 0; offset < kOffsets; ++offset) {
      if (credible(offset) > credible(best)) best = offset;
    }
    return best;
  }

  double offset_m(int offset) const { return (offset - kOffsets / 2) * steps_per_offset_ * height_step_m_; }

  void read(SemanticGrid& grid, bool only_class) const {
    grid.stamp_ns = stamp_ns_;
    grid.cell_m = params_.cell_m;
    const auto counts = [&](const Tile& tile) { return only_class ? has_evidence(tile) : is_observed(tile); };
    int left = std::numeric_limits<int>::max(), right = std::numeric_limits<int>::min(), low = left, high = right;
    const auto extend = [&](const Place& key) {
      left = std::min(left, key.column);
      right = std::max(right, key.column);
      low = std::min(low, key.row);
      high = std::max(high, key.row);
    };
    for (const auto& [key, tile] : tiles_) {
      if (counts(tile)) extend(key);
    }
    for (const auto& [key, settled] : settled_) {
      if (!only_class) extend(key);
    }
    const bool is_empty = left > right;
    grid.first_column = is_empty ? 0 : left * kTileCells;
    grid.first_row = is_empty ? 0 : low * kTileCells;
    grid.width = is_empty ? 0 : (right - left + 1) * kTileCells;
    grid.height = is_empty ? 0 : (high - low + 1) * kTileCells;
    const std::size_t cells = static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height);
    grid.probability.assign(cells, std::numeric_limits<float>::quiet_NaN());
    grid.ground_world_m.assign(cells, std::numeric_limits<float>::quiet_NaN());
    grid.images.assign(cells, 0);
    grid.class_images.assign(cells, 0);
    grid.class_latest.assign(cells, 0);
    grid.latest = images_;
    const int best = best_offset();
    const auto believed = static_cast<std::size_t>(best);
    std::vector<std::size_t> of_class;
    std::vector<float> soft(cells, 0.0F);
    for (const auto& [key, tile] : tiles_) {
      if (!counts(tile)) continue;
      for (int r = 0; r < kTileCells; ++r) {
        for (int c = 0; c < kTileCells; ++c) {
          const auto from = static_cast<std::size_t>(r * kTileCells + c);
          const std::size_t to = grid.index((key.column - left) * kTileCells + c, (key.row - low) * kTileCells + r);
          grid.ground_world_m[to] = tile.ground_world_m[from] + static_cast<float>(offset_m(best));
          grid.images[to] = tile.observed->images[from];
          if (grid.images[to] == 0) continue;
          grid.probability[to] = 0.0F;
          const Evidence* const evidence = tile.observed->find(from);
          if (evidence == nullptr) continue;
          grid.class_images[to] = evidence->class_images;
          grid.class_latest[to] = evidence->class_latest;
          const float sharp = evidence->sharp(believed), softer = evidence->soft(believed);
          if (sharp <= 0.01F && softer <= 0.01F) continue;
          const float enough = enough_images(*tile.observed, from, *evidence) *
                               enough_directions(*tile.observed, from, *evidence, believed);
          grid.probability[to] = sharp * enough * enough;
          soft[to] = softer * enough * enough;
          if (soft[to] > 0.01F || grid.probability[to] > 0.01F) of_class.push_back(to);
        }
      }
    }
    judge(grid, soft, of_class, best);
    for (const auto& [key, settled] : settled_) {
      if (!only_class) add_settled(key, settled, static_cast<float>(offset_m(best)), grid);
    }
  }

  /// From means of evidence to probabilities: something of the class is where the mean is at least half of what it is
  /// around. Labels that miss the class in a part of the images, or a pose with noise, lower both. Where labels are so
  /// noisy that columns that are of the class from foot to top are rare, it is the soft means.
  void judge(SemanticGrid& grid, const std::vector<float>& soft, const std::vector<std::size_t>& of_class,
             int believed) const {
    const std::vector<float> sharp = grid.probability;
    const int reach = std::max(1, static_cast<int>(std::lround(kAround_m / params_.cell_m)));
    const auto greatest_around = [&](const std::vector<float>& values, std::size_t cell) {
      const int column = static_cast<int>(cell) % grid.width, row = static_cast<int>(cell) / grid.width;
      float greatest = 0.0F;
      for (int r = std::max(row - reach, 0); r <= std::min(row + reach, grid.height - 1); ++r) {
        for (int c = std::max(column - reach, 0); c <= std::min(column + reach, grid.width - 1); ++c) {
          const float value = values[grid.index(c, r)];
          if (value > greatest) greatest = value;  // not NaN
        }
      }
      return greatest;
    };
    for (float& probability : grid.probability) {
      if (!std::isnan(probability)) probability = static_cast<float>(probability_by(0.0));
    }
    double sharp_sum = 0.0, soft_sum = 0.0;
    std::vector<float> greatest(of_class.size());
    for (std::size_t i = 0; i < of_class.size(); ++i) {
      const std::size_t cell = of_class[i];
      greatest[i] = greatest_around(soft, cell);
      if (soft[cell] < std::max(0.8F * greatest[i], 0.25F)) continue;
      sharp_sum += static_cast<double>(sharp[cell]);
      soft_sum += static_cast<double>(soft[cell]);
    }
    const bool is_noisy = sharp_sum < kNoisy * soft_sum;
    const std::vector<float>& mean = is_noisy ? soft : sharp;
    for (std::size_t i = 0; i < of_class.size(); ++i) {
      const std::size_t cell = of_class[i];
      if (!is_noisy) greatest[i] = greatest_around(sharp, cell);
      const float around = std::max(greatest[i], static_cast<float>(kLeastMean));
      const float part = mean[cell] / around;
      if (part > 0.5F && is_of_something_nearer(grid, cell, believed)) continue;
      grid.probability[cell] = static_cast<float>(probability_by(static_cast<double>(part)));
    }
  }

  static double probability_by(double part) { return probability_of(kSteepness * (part - 0.5)); }

  const GridMapParams& params() const { return params_; }

 private:
  static constexpr double kSteepness = 8.0;
  static constexpr int kEnough = 6, kFew = 4;
  static constexpr float kTurn_rad = 0.14F;  ///< that makes an image count as one from a direction of its own
  /// Parts of the directions that a cell was seen from, and of their spread, from which the class is shown.
  static constexpr float kClassTurned = 0.2F, kClassSpread = 0.7F, kLeastSpread = 1e-4F;
  static constexpr float kParallax = 2.0F;   ///< of the directions' turn, that tells near from far
  static constexpr float kBetter = 1.3F;     ///< evidence on something nearer, as a part of that on the cell
  static constexpr double kSearch_m = 40.0;  ///< for something nearer
  static constexpr double kGrazing = 0.2;    ///< a shadow five times as long as the class is high
  static constexpr double kFront_m = 2.0, kShadowStep_m = 1.0;
  static constexpr double kHiddenFoot = 0.25;  ///< of the height of the class
  static constexpr double kSize = 4.0;         ///< of the class, in its heights: nearer ground may be itself
  static constexpr float kNothing = 0.35F;     ///< of the class, where it has not begun
  static constexpr double kAround_m = 2.0;
  static constexpr double kAsGiven = 50.0;     ///< cells seen from another direction, that agree as without an error
  static constexpr double kLeastGain = 0.025;  ///< in agreement, per step away from the elevation as it is given

  bool is_far(const Place& key, const Eigen::Vector2d& p_world_m, double distance_m) const {
    const double edge_m = kTileCells * params_.cell_m;
    const Eigen::Vector2d middle_m = Eigen::Vector2d(key.column + 0.5, key.row + 0.5) * edge_m;
    return (middle_m - p_world_m).cwiseAbs().maxCoeff() > distance_m + 0.5 * edge_m;
  }

  /// The tile of a cell of the grid, and the cell in it.
  static std::pair<Place, std::size_t> place_of(int column, int row) {
    const auto tile_of = [](int i) { return i >= 0 ? i / kTileCells : (i + 1) / kTileCells - 1; };
    const Place key{tile_of(column), tile_of(row)};
    return {key,
            static_cast<std::size_t>((row - key.row * kTileCells) * kTileCells + column - key.column * kTileCells)};
  }

  /// What was settled before stays where no image has shown a cell since.
  void settle(const Place& key, const Observed& observed, const SemanticGrid& judged) {
    SettledTile& settled = settled_[key];
    std::vector<SettledTile::Cell> of_class;
    for (const SettledTile::Cell& before : settled.of_class) {
      if (observed.images[before.cell] == 0) of_class.push_back(before);
    }
    for (std::size_t cell = 0; cell < kCellsOfTile; ++cell) {
      if (observed.images[cell] == 0) continue;
      settled.images[cell] = static_cast<std::uint16_t>(std::min(observed.images[cell], SettledTile::kMostImages));
      const Evidence* const evidence = observed.find(cell);
      if (evidence == nullptr) continue;
      const int column = key.column * kTileCells + static_cast<int>(cell) % kTileCells - judged.first_column;
      const int row = key.row * kTileCells + static_cast<int>(cell) / kTileCells - judged.first_row;
      if (column < 0 || row < 0 || column >= judged.width || row >= judged.height) continue;
      of_class.push_back(
          {static_cast<std::uint16_t>(cell), judged.probability[judged.index(column, row)], evidence->class_images});
    }
    of_class.shrink_to_fit();
    settled.of_class = std::move(of_class);
  }

  void add_settled(const Place& key, const SettledTile& settled, float offset_m, SemanticGrid& grid) const {
    const auto found = tiles_.find(key);
    const Observed* const observed = found == tiles_.end() ? nullptr : found->second.observed.get();
    const auto is_shown_since = [&](std::size_t cell) { return observed != nullptr && observed->images[cell] > 0; };
    const auto index_of = [&](std::size_t cell) {
      return grid.index(key.column * kTileCells + static_cast<int>(cell) % kTileCells - grid.first_column,
                        key.row * kTileCells + static_cast<int>(cell) / kTileCells - grid.first_row);
    };
    Tile ground;
    if (observed == nullptr) find_ground(key, ground);
    for (std::size_t cell = 0; cell < kCellsOfTile; ++cell) {
      const std::size_t to = index_of(cell);
      if (observed == nullptr) grid.ground_world_m[to] = ground.ground_world_m[cell] + offset_m;
      if (settled.images[cell] == 0 || is_shown_since(cell)) continue;
      grid.images[to] = settled.images[cell];
      grid.probability[to] = static_cast<float>(probability_by(0.0));
    }
    for (const SettledTile::Cell& cell : settled.of_class) {
      if (is_shown_since(cell.cell)) continue;
      grid.probability[index_of(cell.cell)] = cell.probability;
      grid.class_images[index_of(cell.cell)] = cell.class_images;
    }
  }

  /// A cell of the grid and its tile; null where that has no evidence.
  std::pair<const Tile*, std::size_t> find_cell(int column, int row) const {
    const auto [key, cell] = place_of(column, row);
    const auto found = tiles_.find(key);
    if (found == tiles_.end() || !has_evidence(found->second)) return {nullptr, 0};
    return {&found->second, cell};
  }

  /// Whether the images that show the class on a cell agree better on something nearer to them that their sight lines
  /// to the cell pass through: on the ground, or above it as far as the errors of the elevation reach.
  bool is_of_something_nearer(const SemanticGrid& grid, std::size_t cell, int believed) const {
    const int column = grid.first_column + static_cast<int>(cell) % grid.width;
    const int row = grid.first_row + static_cast<int>(cell) / grid.width;
    const auto [tile, own] = find_cell(column, row);
    if (tile == nullptr || tile->observed->turned[own] < kParallax) return false;
    const Evidence* const evidence = tile->observed->find(own);
    if (evidence == nullptr) return false;
    const auto i = static_cast<std::size_t>(believed);
    const Eigen::Vector3d along = evidence->class_seen[i].sum.cast<double>();
    const double flat = along.head<2>().norm();
    if (!(flat > 0.0) || along.z() >= 0.0) return false;
    const float enough = kBetter * evidence->soft(i);
    for (double m = 2.0 * params_.cell_m; m < kSearch_m; m += params_.cell_m) {
      const Eigen::Vector2d at =
          Eigen::Vector2d(column + 0.5, row + 0.5) - m / (flat * params_.cell_m) * along.head<2>();
      const auto [near, there] = find_cell(static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())));
      if (near == nullptr) continue;
      const double above_m =
          static_cast<double>(tile->ground_world_m[own] - near->ground_world_m[there]) - m * along.z() / flat;
      const int offset = believed + static_cast<int>(std::lround(above_m / offset_m(kOffsets / 2 + 1)));
      if (offset >= kOffsets) return false;
      if (offset < believed) continue;
      const Evidence* const nearer = near->observed->find(there);
      if (nearer != nullptr && nearer->soft(static_cast<std::size_t>(offset)) > enough) return true;
    }
    return false;
  }

  /// 1 where as many images show the class as it takes to believe them. One of the many that a map has is not enough
  /// even where no other shows the cell.
  float enough_images(const Observed& observed, std::size_t cell, const Evidence& evidence) const {
    const int images = std::clamp(observed.images[cell], std::min(images_, kFew), kEnough);
    return std::min(1.0F, static_cast<float>(evidence.class_images) / static_cast<float>(images));
  }

  /// 1 where images from enough of the directions that the cell was seen from show the class, or from both ends of
  /// them: what is above the ground shows before the cell from a few directions side by side.
  static float enough_directions(const Observed& observed, std::size_t cell, const Evidence& evidence,
                                 std::size_t offset) {
    const Directions& of_class = evidence.class_seen[offset];
    const Directions all = observed.seen(cell);
    if (of_class.turned <= 0.0F) return 0.0F;
    return std::min(1.0F, std::max(of_class.turned / (kClassTurned * all.turned),
                                   of_class.spread() / (kClassSpread * std::max(all.spread(), kLeastSpread))));
  }

  static bool is_observed(const Tile& tile) { return tile.observed && tile.observed->is_any_known; }
  static bool has_evidence(const Tile& tile) { return tile.observed && tile.observed->has_evidence; }

  double max_offset_m() const { return offset_m(kOffsets - 1); }

  /// How well the images agree with an error of the elevation, less what speaks against a large one.
  double credible(int offset) const {
    const auto i = static_cast<std::size_t>(offset);
    const double as_given = all_sum_[kOffsets / 2] > 0.0 ? shared_sum_[kOffsets / 2] / all_sum_[kOffsets / 2] : 0.0;
    const double agreement = (shared_sum_[i] + kAsGiven * as_given) / (all_sum_[i] + kAsGiven);
    return agreement - kLeastGain * std::abs(offset - kOffsets / 2);
  }

  /// Of the ground in a direction; none beside ground that is not known.
  double slope_along(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& ahead) const {
    const Eigen::Vector2d far_m = p_world_m + ahead, near_m = p_world_m - ahead;
    const double slope = 0.5 * (ground_->at(far_m.x(), far_m.y()) - ground_->at(near_m.x(), near_m.y()));
    return std::isnan(slope) ? 0.0 : slope;
  }

  /// The tile is looked for at `next` first, which is then set to the one after it: tiles in order take no search.
  Tile& known_tile(Place key, std::map<Place, Tile>::iterator& next) {
    const std::size_t before = tiles_.size();
    const auto found = tiles_.try_emplace(next, key);
    if (tiles_.size() > before) find_ground(key, found->second);
    next = std::next(found);
    return found->second;
  }

  void find_ground(Place key, Tile& tile) const {
    tile.low_m = std::numeric_limits<double>::infinity();
    tile.high_m = -tile.low_m;
    for (int r = 0; r < kTileCells; ++r) {
      for (int c = 0; c < kTileCells; ++c) {
        const double x_m = (key.column * kTileCells + c + 0.5) * params_.cell_m;
        const double y_m = (key.row * kTileCells + r + 0.5) * params_.cell_m;
        const double ground_m = ground_->at(x_m, y_m);
        const auto i = static_cast<std::size_t>(r * kTileCells + c);
        tile.ground_world_m[i] = static_cast<float>(ground_m);
        if (std::isnan(ground_m)) continue;
        tile.low_m = std::min(tile.low_m, ground_m);
        tile.high_m = std::max(tile.high_m, ground_m);
      }
    }
  }

  /// Which columns of a row may show the class.
  void find_class(const View& view, const LabelReader& reader, Row<std::int32_t>& sees_class) const {
    const SeenRow& row = row_;
    const Eigen::Vector3d up = view.A.col(2);
    const double below_m = max_offset_m(), above_m = below_m + params_.class_height_m;
    const Eigen::Vector3d low = below_m * up, top = above_m * up;
    Row<double> low_u_px, low_v_px, top_u_px, top_v_px;
    for (std::size_t c = 0; c < kTileCells; ++c) {
      const double low_z = row.foot_z[c] - low.z(), top_z = row.foot_z[c] + top.z();
      low_u_px[c] = (row.foot_x[c] - low.x()) / low_z;
      low_v_px[c] = (row.foot_y[c] - low.y()) / low_z;
      top_u_px[c] = (row.foot_x[c] + top.x()) / top_z;
      top_v_px[c] = (row.foot_y[c] + top.y()) / top_z;
    }
    reader.find_class(low_u_px, top_u_px, low_v_px, top_v_px, row.is_in, sees_class);
  }

  /// Whether any column of a tile may show the class, by the corners of the box around all of them.
  bool may_see_class(const Tile& tile, Place key, const View& view, const LabelReader& reader) const {
    const double edge_m = kTileCells * params_.cell_m, low_m = tile.low_m - max_offset_m();
    const double up_m = tile.high_m + max_offset_m() + params_.class_height_m - low_m;
    Eigen::Vector2d least = Eigen::Vector2d::Constant(kFarthest_m), greatest = -least;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d at_m((key.column + corner % 2) * edge_m, (key.row + corner / 2 % 2) * edge_m,
                                 low_m + corner / 4 * up_m);
      const Eigen::Vector3d image = view.A * (at_m - view.p_world_camera_m);
      if (image.z() < kLeastDepth_m) return true;
      least = least.cwiseMin(image.head<2>() / image.z());
      greatest = greatest.cwiseMax(image.head<2>() / image.z());
    }
    return reader.has_class(least.x(), greatest.x(), least.y(), greatest.y());
  }

  /// A cell and what an image shows of it.
  struct Sight {
    std::size_t cell;
    Eigen::Vector3d from_camera, foot;
    double hidden_below_m;  ///< height above the ground from which nearer ground is not in the way
    Eigen::Vector3f along;  ///< unit vector from the camera
    float turn;             ///< since the image before, as a weight
    double seen;            ///< weight of the image by the extent of the column
  };

  void add_to(Tile& tile, Place key, const View& view, const LabelReader& reader, Horizon& horizon, GridUpdate& done) {
    const bool may_show_class = may_see_class(tile, key, view, reader);
    const double up_z = view.A(2, 2), below_m = max_offset_m();
    const ImageExtent image{view.A,          view.p_world_camera_m.z(), reader.right_px(),
                            reader.low_px(), params_.reach_m,           kLeastDepth_m};
    const Hiding hiding{kHiddenMargin_m, 0.5 * params_.class_height_m, below_m * up_z,
                        (below_m + params_.class_height_m) * up_z, kLeastDepth_m};
    const Eigen::Vector3d up = params_.class_height_m * view.A.col(2);
    SeenRow& row = row_;
    for (int c = 0; c < kTileCells; ++c) {
      row.x_m[static_cast<std::size_t>(c)] =
          (key.column * kTileCells + c + 0.5) * params_.cell_m - view.p_world_camera_m.x();
    }
    for (int r = 0; r < kTileCells; ++r) {
      const auto first = static_cast<std::size_t>(r * kTileCells);
      const double y_m = (key.row * kTileCells + r + 0.5) * params_.cell_m - view.p_world_camera_m.y();
      if (!find_in_image(&tile.ground_world_m[first], y_m, image, row)) continue;
      horizon.find_slopes_before(y_m, row);
      if (!find_visible(hiding, row)) continue;
      if (!tile.observed) tile.observed = std::make_unique<Observed>();
      Observed& observed = *tile.observed;
      find_directions(observed.row(first), y_m, up, kTurn_rad, kResolved_px, row);
      add_row(observed, first, y_m, may_show_class, view, reader, horizon, done);
    }
  }

  void add_row(Observed& observed, std::size_t first, double y_m, bool may_show_class, const View& view,
               const LabelReader& reader, Horizon& horizon, GridUpdate& done) {
    SeenRow& row = row_;
    const Eigen::Vector3d up = view.A.col(2);
    Row<std::int32_t> shows_nothing, may_show{};
    for (std::size_t c = 0; c < kTileCells; ++c) shows_nothing[c] = static_cast<std::int32_t>(row.is_in[c]);
    if (may_show_class) find_class(view, reader, may_show);
    const bool is_simple = !may_show_class && reader.is_all_known() && !observed.has_evidence;
    for (std::size_t c = 0; c < kTileCells && !is_simple; ++c) {
      if (row.is_in[c] == 0.0) continue;
      const Eigen::Vector3d foot(row.foot_x[c], row.foot_y[c], row.foot_z[c]);
      const bool sees_class = may_show[c] != 0;
      if (!sees_class && !reader.is_all_known() && std::isnan(reader.value(row.u_px[c], row.v_px[c]))) {
        shows_nothing[c] = 0;
        continue;
      }
      const std::size_t i = first + c;
      if (!sees_class && observed.number_of[i] == 0) continue;
      shows_nothing[c] = 0;
      const Sight sight{i,
                        {row.x_m[c], y_m, row.z_m[c]},
                        foot,
                        row.hidden_below_m[c],
                        {row.along_x[c], row.along_y[c], row.along_z[c]},
                        row.turn[c],
                        row.seen[c]};
      if (!sees_class) {
        add_direction(observed, i, sight.along, sight.turn * static_cast<float>(sight.seen));
        add_nothing(observed, sight);
      } else if (is_in_shadow(sight.from_camera, sight.hidden_below_m, view, reader, horizon) ||
                 !add_column(observed, sight, up, reader, done)) {
        continue;
      }
      observed.latest_x[i] = sight.along.x();
      observed.latest_y[i] = sight.along.y();
      observed.latest_z[i] = sight.along.z();
      ++observed.images[i];
      ++done.observed_cells;
    }
    const int count = situation_awareness::add_nothing(row, shows_nothing, kNegativeWeight,
                                                       static_cast<float>(kMaxWeight), observed.row(first));
    observed.is_any_known = observed.is_any_known || count > 0;
    done.observed_cells += static_cast<std::size_t>(count);
  }

  /// How much of the class a nearer column shows, m metres before a cell: at a part of its height above the lowest that
  /// nearer ground does not hide. NaN where that is not known.
  float shown_before(const Eigen::Vector3d& from_camera, double m, double part, const View& view,
                     const LabelReader& reader, Horizon& horizon) const {
    const double range_m = from_camera.head<2>().norm();
    Eigen::Vector3d q = from_camera * (1.0 - m / range_m);
    const Eigen::Vector2d at_m = view.p_world_camera_m.head<2>() + q.head<2>();
    q.z() = ground_->at(at_m.x(), at_m.y()) - view.p_world_camera_m.z();
    const double hidden_m = std::max(horizon.slope_before(q.head<2>(), range_m - m) * (range_m - m) - q.z(), 0.0);
    if (hidden_m > params_.class_height_m) return 0.0F;
    q.z() += hidden_m + part * (params_.class_height_m - hidden_m) + offset_m(believed_);
    const Eigen::Vector3d image = view.A * q;
    const double u = image.x() / image.z(), v = image.y() / image.z();
    if (!(image.z() > kLeastDepth_m) || !reader.contains(u, v)) return std::numeric_limits<float>::quiet_NaN();
    return reader.value(u, v) / std::max(reader.peak(u, v), kLeastPeak);
  }

  /// Whether what a column shows of the class may be of something nearer: then the image did not see what is there.
  /// On ground that falls away nearly as the sight lines do, all columns behind something show it from foot to top. The
  /// class begins with the nearest of them, and where a crest hides their feet it is not known where.
  bool is_in_shadow(const Eigen::Vector3d& from_camera, double hidden_below_m, const View& view,
                    const LabelReader& reader, Horizon& horizon) const {
    const double height_m = params_.class_height_m, range_m = from_camera.head<2>().norm();
    const Eigen::Vector2d ahead = from_camera.head<2>() / range_m;
    const auto shown = [&](double m, double part) { return shown_before(from_camera, m, part, view, reader, horizon); };
    const Eigen::Vector3d middle =
        view.A * (from_camera + Eigen::Vector3d(0.0, 0.0, 0.5 * height_m + offset_m(believed_)));
    const double u = middle.x() / middle.z(), v = middle.y() / middle.z();
    if (reader.contains(u, v) && reader.value(u, v) < kNothing * kLeastPeak) return false;  // nothing of the class
    const Eigen::Vector2d p_world_m = view.p_world_camera_m.head<2>() + from_camera.head<2>();
    const double over_ground =  // slope of the sight line to its top
        slope_along(p_world_m, ahead) - (from_camera.z() + height_m) / range_m;
    if (over_ground < kGrazing || hidden_below_m > 0.0) {
      if (hidden_below_m > kHiddenFoot * height_m) return true;
      if (!(shown(kFront_m, 0.0) < 0.5F) || !(shown(2.0 * kFront_m, 0.0) < kNothing)) return true;
    }
    const double slope = (from_camera.z() + 0.5 * height_m) / range_m;  // of the sight line to its middle
    if (horizon.top_slope_before(from_camera.head<2>(), range_m, kSize * height_m) <= slope) return false;
    for (double m = kSize * height_m; m < range_m - kFront_m; m += kShadowStep_m) {
      const Eigen::Vector2d at_m = p_world_m - m * ahead;
      const double above_m = view.p_world_camera_m.z() + slope * (range_m - m) - ground_->at(at_m.x(), at_m.y());
      if (above_m < height_m && shown(m, 0.0) > 0.5F && shown(m, 0.5) > 0.5F && shown(m, 1.0) > 0.5F) return true;
    }
    return false;
  }

  /// Older directions fade as older evidence does.
  void add_direction(Observed& observed, std::size_t cell, const Eigen::Vector3f& along, float turn) const {
    Directions seen = observed.seen(cell);
    seen.add(along, turn);
    const auto most = static_cast<float>(kMaxWeight);
    if (seen.turned > most) {
      const float part = most / seen.turned;
      seen.scale(part);
      if (Evidence* const evidence = observed.find(cell)) {
        for (Directions& of_class : evidence->class_seen) of_class.scale(part);
      }
    }
    observed.seen_x[cell] = seen.sum.x();
    observed.seen_y[cell] = seen.sum.y();
    observed.seen_z[cell] = seen.sum.z();
    observed.turned[cell] = seen.turned;
  }

  /// Keeps the evidence of a cell on which the class is now seen for each error of the elevation.
  static Evidence& begin_evidence(Observed& observed, std::size_t cell) {
    observed.is_any_known = observed.has_evidence = true;
    if (Evidence* const known = observed.find(cell)) return *known;
    Evidence& evidence = observed.evidence.emplace_back();
    observed.number_of[cell] = static_cast<std::uint16_t>(observed.evidence.size());
    evidence.weight.fill(observed.nothing_weight[cell]);
    return evidence;
  }

  void add(Evidence& evidence, std::size_t offset, double weight, double sharp, double soft) const {
    evidence.sharp_sum[offset] += static_cast<float>(weight * sharp);
    evidence.soft_sum[offset] += static_cast<float>(weight * soft);
    evidence.weight[offset] += static_cast<float>(weight);
    const auto most = static_cast<float>(kMaxWeight);
    if (evidence.weight[offset] <= most) return;
    evidence.sharp_sum[offset] *= most / evidence.weight[offset];
    evidence.soft_sum[offset] *= most / evidence.weight[offset];
    evidence.weight[offset] = most;
  }

  /// Of a column whose extent in pixels has that square, as a weight: what is smaller than a few of them may not be in
  /// the labels.
  static double resolved(double extent_px2) {
    return std::clamp(extent_px2 / (kResolved_px * kResolved_px), 0.01, 1.0);
  }

  /// Adds an image that shows nothing of the class to a cell on which one did.
  void add_nothing(Observed& observed, const Sight& sight) {
    Evidence& evidence = *observed.find(sight.cell);
    const double weight = kNegativeWeight * sight.seen, turned = static_cast<double>(sight.turn);
    const auto most = static_cast<float>(kMaxWeight), added = static_cast<float>(weight);
    for (std::size_t offset = 0; offset < kOffsets; ++offset) {
      const float before = evidence.weight[offset], sum = evidence.soft_sum[offset] / before;
      all_[offset] += turned * weight * static_cast<double>(before > 0.0F ? sum : 0.0F);
    }
    std::array<float, kOffsets> parts;
    for (std::size_t offset = 0; offset < kOffsets; ++offset) {
      const float after = evidence.weight[offset] + added, part = most / after;
      parts[offset] = after > most ? part : 1.0F;
      evidence.weight[offset] = after > most ? most : after;
    }
    for (std::size_t offset = 0; offset < kOffsets; ++offset) evidence.sharp_sum[offset] *= parts[offset];
    for (std::size_t offset = 0; offset < kOffsets; ++offset) evidence.soft_sum[offset] *= parts[offset];
  }

  /// Of what is known of the column that is as high as the class, from each step of all heights on: but for what is
  /// hidden below a height above its foot. From the last foot on it is not of use.
  void find_extremes(double hidden_below_m) {
    const std::size_t count = column_.size();
    for (std::size_t i = 0; i < count; ++i) {
      least_[i] = soft_least_[i] = 1.0F;
      greatest_[i] = 0.0F;
      known_[i] = 0;
    }
    for (int h = 0; h <= heights_per_offset_; ++h) {
      if (h * height_step_m_ < hidden_below_m) continue;
      const float *const sharp = column_.data() + h, *const soft = soft_column_.data() + h;
      float *const least = least_.data(), *const greatest = greatest_.data(), *const soft_least = soft_least_.data();
      std::int32_t* const known = known_.data();
#pragma GCC ivdep
      for (std::size_t i = 0; i < count - static_cast<std::size_t>(h); ++i) {
        const float value = sharp[i], soft_value = std::isnan(value) ? 1.0F : soft[i];
        least[i] = value < least[i] ? value : least[i];
        greatest[i] = greatest[i] < value ? value : greatest[i];
        soft_least[i] = soft_value < soft_least[i] ? soft_value : soft_least[i];
        known[i] += std::isnan(value) ? 0 : 1;
      }
    }
  }

  /// False where nothing is known.
  bool add_column(Observed& observed, const Sight& sight, const Eigen::Vector3d& up, const LabelReader& reader,
                  GridUpdate& done) {
    const Eigen::Vector3d& foot = sight.foot;
    const double below_m = max_offset_m();
    if (!reader.read_column(foot, up, -below_m, height_step_m_, column_, soft_column_)) return false;
    Evidence& evidence = begin_evidence(observed, sight.cell);
    const bool is_first = observed.images[sight.cell] == 0;
    bool any_added = false;
    const auto turned = static_cast<double>(sight.turn);
    bool is_class = false, is_believed = false;  // of the class by any offset, and by the one that is believed
    const Eigen::Vector3d top = foot + params_.class_height_m * up, middle = foot + 0.5 * params_.class_height_m * up;
    const double seen = resolved((top.head<2>() / top.z() - foot.head<2>() / foot.z()).squaredNorm());
    const float peak = std::max(reader.peak(middle.x() / middle.z(), middle.y() / middle.z()), kLeastPeak);
    find_extremes(sight.hidden_below_m);
    for (int offset = 0; offset < kOffsets; ++offset) {
      const auto first = static_cast<std::size_t>(offset * steps_per_offset_);
      const float least = least_[first], greatest = greatest_[first], soft_least = soft_least_[first];
      const int known = known_[first];
      if (known == 0) continue;
      // What is cut off by the image's edge or not known may be anything.
      if (2 * known <= heights_per_offset_ && least > 0.5F) continue;
      const auto i = static_cast<std::size_t>(offset);
      any_added = true;
      const double sharp = std::clamp(0.5 + kContrast * (static_cast<double>(least / peak) - 0.5), 0.0, 1.0);
      const double weight = seen * (least > 0.5F * peak      ? 1.0
                                    : greatest > 0.5F * peak ? kPartialWeight
                                                             : kNegativeWeight);
      const auto soft = static_cast<double>(soft_least), before = static_cast<double>(evidence.soft(i));
      if (!is_first) {
        shared_[i] += turned * weight * std::min(soft, before);
        all_[i] += turned * weight * std::max(soft, before);
      }
      const bool is_class_here = least > 0.5F * peak || soft_least > kSoftClass;
      is_class |= is_class_here;
      if (is_class_here) evidence.class_seen[i].add(sight.along, sight.turn * static_cast<float>(seen));
      is_believed |= is_class_here && offset == believed_;
      add(evidence, i, weight, sharp, soft);
    }
    if (!any_added) return false;
    add_direction(observed, sight.cell, sight.along, sight.turn * static_cast<float>(seen));
    if (is_believed) evidence.class_latest = images_;
    if (is_class) {
      ++evidence.class_images;
      ++done.class_cells;
    }
    return true;
  }

  static constexpr double kContrast = 3.0;
  static constexpr double kResolved_px = 2.0;  ///< of a column that is seen well
  static constexpr float kLeastPeak = 0.4F;
  static constexpr float kSoftClass = 0.4F, kNoisy = 0.9F;
  static constexpr double kHiddenMargin_m = 0.1;

  GridMapParams params_;
  std::shared_ptr<const Elevation> elevation_;  ///< as given: what hides the ground behind it
  std::shared_ptr<const Elevation> ground_;     ///< smoothed: where things stand
  int heights_per_offset_ = 0, steps_per_offset_ = 0;
  double height_step_m_ = 0.0;
  std::map<Place, Tile> tiles_;
  std::map<Place, SettledTile> settled_;  ///< whose evidence was freed; those that images show again are in both
  SeenRow row_;
  std::vector<float> column_, soft_column_;           ///< from the lowest foot on
  std::vector<float> least_, greatest_, soft_least_;  ///< of the columns that begin there
  std::vector<std::int32_t> known_;
  Horizon horizon_;
  LabelReader reader_;
  std::int64_t stamp_ns_ = 0;
  std::int32_t images_ = 0;
  int believed_ = kOffsets / 2;  ///< offset before this image
  /// What an image and the map before it share, and what either has: of this image and of all.
  std::array<double, kOffsets> shared_{}, all_{}, shared_sum_{}, all_sum_{};
};

GridMap::GridMap(const GridMapParams& params, std::shared_ptr<const Elevation> elevation)
    : impl_(std::make_unique<Impl>(params, std::move(elevation))) {}
GridMap::~GridMap() = default;
GridMap::GridMap(GridMap&&) noexcept = default;
GridMap& GridMap::operator=(GridMap&&) noexcept = default;

GridUpdate GridMap::update(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera) {
  return impl_->update(labels, T_world_camera);
}
void GridMap::keep_around(const Eigen::Vector2d& p_world_m, double distance_m) {
  impl_->keep_around(p_world_m, distance_m);
}
void GridMap::settle_beyond(const Eigen::Vector2d& p_world_m, double distance_m, const SemanticGrid& judged) {
  impl_->settle_beyond(p_world_m, distance_m, judged);
}
bool GridMap::is_settled(const Eigen::Vector2d& p_world_m) const { return impl_->is_settled(p_world_m); }
double GridMap::elevation_offset_m() const { return impl_->offset_m(impl_->best_offset()); }
SemanticGrid GridMap::grid() const {
  SemanticGrid grid;
  impl_->read(grid, false);
  return grid;
}
void GridMap::read_class(SemanticGrid& grid) const { impl_->read(grid, true); }
const GridMapParams& GridMap::params() const { return impl_->params(); }

}  // namespace situation_awareness
