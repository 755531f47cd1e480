// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>

#include "class_columns.hpp"
#include "class_probability.hpp"
#include "grid_tiles.hpp"
#include "horizon.hpp"
#include "image_view.hpp"
#include "label_reader.hpp"
#include "seen_row.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// The weight of evidence against the class, since what is hidden by something unknown looks like nothing.
constexpr double kNegativeWeight = 0.4;
/// The weight of a column that shows the class in a part only: at an edge, or partly hidden.
constexpr double kPartialWeight = 0.7;
/// The greatest weight of a cell's evidence, of which an image has 1 at most: from there on older ones fade.
constexpr double kMaxWeight = 100.0;
/// The step in m between the nine errors of the elevation that are tried.
constexpr double kOffsetStep_m = 0.5;

constexpr int kOffsets = GridMap::kOffsets;
constexpr double kLeastDepth_m = 0.1;

}  // namespace

class GridMap::Impl {
 public:
  Impl(const GridMapParams& params, std::shared_ptr<const Elevation> elevation)
      : params_((params.validate(), params)),
        elevation_(elevation ? std::move(elevation) : throw std::invalid_argument("a grid needs an elevation")),
        ground_(ground_of(elevation_)),
        tiles_(params.cell_m, ground_),
        columns_(params.class_height_m, kOffsetStep_m),
        horizon_(*elevation_, params.reach_m, 2.0 * params.cell_m, params.class_height_m) {}

  GridUpdate update(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera) {
    check(labels);
    if (!T_world_camera.matrix().allFinite()) throw std::invalid_argument("the camera's pose is not finite");
    if (T_world_camera.translation().norm() > GridTiles::kFarthest_m) {
      throw std::invalid_argument("the camera is more than 1000 km from the world's origin");
    }
    const ImageView view(labels.camera, T_world_camera, params_.reach_m);
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
        Tile& tile = tiles_.known({c, r}, next);
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

  GridTiles& tiles() { return tiles_; }

  void set_elevation(std::shared_ptr<const Elevation> elevation) {
    ground_ = ground_of(elevation);
    elevation_ = std::move(elevation);
    tiles_.set_ground(ground_);
    horizon_.set_elevation(*elevation_);
  }

  /// The reach covers all of each tile, whose ground is found when it is first in reach, and what it is smoothed by.
  double needed_reach_m() const { return params_.reach_m + 3.0 * kTileCells * params_.cell_m + 4.0 * params_.smooth_m; }

  bool is_settled(const Eigen::Vector2d& p_world_m) const {
    return tiles_.is_settled(p_world_m, ClassProbability::kEnough);
  }

  int best_offset() const {
    int best = kOffsets / 2;
    for (int offset = 0; offset < kOffsets; ++offset) {
      if (credible(offset) > credible(best)) best = offset;
    }
    return best;
  }

  double offset_m(int offset) const { return columns_.offset_m(offset); }

  void read(SemanticGrid& grid, bool only_class) const {
    grid.stamp_ns = stamp_ns_;
    grid.cell_m = params_.cell_m;
    tiles_.set_extent(only_class, grid);
    grid.latest = images_;
    ClassProbability(tiles_, columns_, params_.cell_m, images_, best_offset()).read(grid, only_class);
  }

  const GridMapParams& params() const { return params_; }

 private:
  std::shared_ptr<const Elevation> ground_of(const std::shared_ptr<const Elevation>& elevation) const {
    if (params_.smooth_m <= 0.0) return elevation;
    return std::make_shared<Elevation>(elevation->smoothed(params_.smooth_m));
  }

  static constexpr float kTurn_rad = 0.14F;  ///< that makes an image count as one from a direction of its own
  static constexpr double kGrazing = 0.2;    ///< a shadow five times as long as the class is high
  static constexpr double kFront_m = 2.0, kShadowStep_m = 1.0;
  static constexpr double kHiddenFoot = 0.25;  ///< of the height of the class
  static constexpr double kSize = 4.0;         ///< of the class, in its heights: nearer ground may be itself
  static constexpr float kNothing = 0.35F;     ///< of the class, where it has not begun
  static constexpr double kAsGiven = 50.0;     ///< cells seen from another direction, that agree as without an error
  static constexpr double kLeastGain = 0.025;  ///< in agreement, per step away from the elevation as it is given

  double max_offset_m() const { return offset_m(kOffsets - 1); }

  /// Returns how well the images agree with an error of the elevation, less what speaks against a large one.
  double credible(int offset) const {
    const auto i = static_cast<std::size_t>(offset);
    const double as_given = all_sum_[kOffsets / 2] > 0.0 ? shared_sum_[kOffsets / 2] / all_sum_[kOffsets / 2] : 0.0;
    const double agreement = (shared_sum_[i] + kAsGiven * as_given) / (all_sum_[i] + kAsGiven);
    return agreement - kLeastGain * std::abs(offset - kOffsets / 2);
  }

  /// Returns the slope of the ground in a direction, or 0 beside ground that is not known.
  double slope_along(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& ahead) const {
    const Eigen::Vector2d far_m = p_world_m + ahead, near_m = p_world_m - ahead;
    const double slope = 0.5 * (ground_->at(far_m.x(), far_m.y()) - ground_->at(near_m.x(), near_m.y()));
    return std::isnan(slope) ? 0.0 : slope;
  }

  /// Finds which columns of a row may show the class.
  void find_class(const ImageView& view, const LabelReader& reader, Row<std::int32_t>& sees_class) const {
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

  /// Returns whether any column of a tile may show the class, by the corners of the box around all of them.
  bool may_see_class(const Tile& tile, Place key, const ImageView& view, const LabelReader& reader) const {
    const double edge_m = kTileCells * params_.cell_m, low_m = tile.low_m - max_offset_m();
    const double up_m = tile.high_m + max_offset_m() + params_.class_height_m - low_m;
    Eigen::Vector2d least = Eigen::Vector2d::Constant(GridTiles::kFarthest_m), greatest = -least;
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

  void add_to(Tile& tile, Place key, const ImageView& view, const LabelReader& reader, Horizon& horizon,
              GridUpdate& done) {
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

  void add_row(Observed& observed, std::size_t first, double y_m, bool may_show_class, const ImageView& view,
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

  /// Returns how much of the class a nearer column shows, m metres before a cell, at a part of its height above the
  /// lowest that nearer ground does not hide; NaN where that is not known.
  float shown_before(const Eigen::Vector3d& from_camera, double m, double part, const ImageView& view,
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

  /// Returns whether what a column shows of the class may be of something nearer: then the image did not see what is
  /// there.
  /// On ground that falls away nearly as the sight lines do, all columns behind something show it from foot to top. The
  /// class begins with the nearest of them, and where a crest hides their feet it is not known where.
  bool is_in_shadow(const Eigen::Vector3d& from_camera, double hidden_below_m, const ImageView& view,
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

  /// Adds a direction to those of a cell. Older directions fade as older evidence does.
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

  /// Returns the weight of a column whose extent in pixels has that square: what is smaller than a few of them may not
  /// be in the labels.
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

  /// Adds an image that shows something of the class on a cell; false where it knows nothing of the column.
  bool add_column(Observed& observed, const Sight& sight, const Eigen::Vector3d& up, const LabelReader& reader,
                  GridUpdate& done) {
    const Eigen::Vector3d& foot = sight.foot;
    if (!columns_.read(reader, foot, up)) return false;
    Evidence& evidence = observed.begin_evidence(sight.cell);
    const bool is_first = observed.images[sight.cell] == 0;
    bool any_added = false;
    const auto turned = static_cast<double>(sight.turn);
    bool is_class = false, is_believed = false;  // of the class by any offset, and by the one that is believed
    const Eigen::Vector3d top = foot + params_.class_height_m * up, middle = foot + 0.5 * params_.class_height_m * up;
    const double seen = resolved((top.head<2>() / top.z() - foot.head<2>() / foot.z()).squaredNorm());
    const float peak = std::max(reader.peak(middle.x() / middle.z(), middle.y() / middle.z()), kLeastPeak);
    columns_.find_extremes(sight.hidden_below_m);
    for (int offset = 0; offset < kOffsets; ++offset) {
      const auto [least, greatest, soft_least, known] = columns_.extremes(offset);
      if (known == 0) continue;
      // What is cut off by the image's edge or not known may be anything.
      if (2 * known <= columns_.heights() && least > 0.5F) continue;
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
  static constexpr float kSoftClass = 0.4F;
  static constexpr double kHiddenMargin_m = 0.1;

  GridMapParams params_;
  std::shared_ptr<const Elevation> elevation_;  ///< as given: what hides the ground behind it
  std::shared_ptr<const Elevation> ground_;     ///< smoothed: where things stand
  GridTiles tiles_;
  SeenRow row_;
  ClassColumns columns_;
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
void GridMap::set_elevation(std::shared_ptr<const Elevation> elevation) { impl_->set_elevation(std::move(elevation)); }
double GridMap::needed_reach_m() const { return impl_->needed_reach_m(); }
void GridMap::keep_around(const Eigen::Vector2d& p_world_m, double distance_m) {
  impl_->tiles().keep_around(p_world_m, distance_m);
}
void GridMap::settle_beyond(const Eigen::Vector2d& p_world_m, double distance_m, const SemanticGrid& judged) {
  impl_->tiles().settle_beyond(p_world_m, distance_m, judged);
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
