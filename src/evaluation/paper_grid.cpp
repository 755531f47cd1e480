// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/paper_grid.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace situation_awareness {
namespace {

constexpr double kPaperCell_m = 0.5;
constexpr double kReach_m = 220.0;
constexpr double kClassHeight_m = 1.5;  // h_c
constexpr double kZeta = 0.2, kGamma = 1.0;
constexpr double kMaxLogOdds = 20.0;
constexpr double kAbove = 3.0;  ///< rays so many class heights above the ground tell nothing

/// alpha and beta of the cases 0, 1, 2 and 4 (eq. 1).
struct CaseWeights {
  double alpha, beta;
};
constexpr CaseWeights kAgainst{-100.0, -100.0}, kBelowAndAbove{-10.0, -10.0}, kBelow{-10.0, -1.0}, kOver{-1.0, -10.0};

}  // namespace

PaperGridMethod paper_grid_method(const std::string& name) {
  if (name == "full") return PaperGridMethod::kFull;
  if (name == "projection") return PaperGridMethod::kProjection;
  if (name == "rays") return PaperGridMethod::kRays;
  throw std::invalid_argument("'" + name + "' is not full, projection or rays");
}

PaperGrid::PaperGrid(PaperGridMethod method, std::shared_ptr<const Elevation> elevation)
    : method_(method), elevation_(std::move(elevation)) {}

void PaperGrid::update(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera) {
  check(labels);
  const PinholeCamera& camera = labels.camera;
  std::map<Place, Cell> cells;
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const auto p = static_cast<double>(labels.probability[static_cast<std::size_t>(v * camera.width + u)]);
      if (std::isnan(p) || p == 0.5) continue;
      const Eigen::Vector3d d_camera((u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, 1.0);
      cast(T_world_camera.translation(), T_world_camera.linear() * d_camera.normalized(), p, cells);
    }
  }
  integrate(cells);
}

void PaperGrid::cast(const Eigen::Vector3d& from_m, const Eigen::Vector3d& along, double probability,
                     std::map<Place, Cell>& cells) const {
  if (along.z() >= 0.0) return;
  constexpr double kStep_m = 0.5 * kPaperCell_m;
  const double flat = along.head<2>().norm();
  const double step_m = flat > 1e-6 ? kStep_m / flat : 1e-2;
  Place before{std::numeric_limits<int>::min(), 0};
  bool counted = false;  // in the cell
  for (double range_m = 0.0; range_m * flat < kReach_m; range_m += step_m) {
    const Eigen::Vector3d p_m = from_m + range_m * along;
    const double height_m = p_m.z() - elevation_->at(p_m.x(), p_m.y());
    if (std::isnan(height_m)) continue;
    const bool meets_ground = height_m <= 0.0;
    const Place at{static_cast<int>(std::floor(p_m.x() / kPaperCell_m)),
                   static_cast<int>(std::floor(p_m.y() / kPaperCell_m))};
    const bool counts = method_ == PaperGridMethod::kProjection ? meets_ground : height_m < kAbove * kClassHeight_m;
    if (counts) {
      if (at != before) counted = false;
      before = at;
      Cell& cell = cells[at];
      const double above_m = std::max(height_m, 0.0);
      const bool is_class = probability > 0.5, is_low = above_m < kClassHeight_m;
      if (is_class) {
        cell.highest_m = cell.has_class_ray ? std::max(cell.highest_m, above_m) : above_m;
        cell.lowest_m = cell.has_class_ray ? std::min(cell.lowest_m, above_m) : above_m;
        cell.has_class_ray = true;
        (is_low ? cell.below : cell.above) = true;
      }
      if (is_low && !counted) {
        counted = true;
        (is_class ? cell.n_for : cell.n_against) += 1.0;
        (is_class ? cell.p_for : cell.p_against) += is_class ? probability : 1.0 - probability;
      }
    }
    if (meets_ground) return;
  }
}

void PaperGrid::integrate(const std::map<Place, Cell>& cells) {
  for (const auto& [at, cell] : cells) {
    if (cell.n_for + cell.n_against == 0.0) continue;
    double phi = cell.n_for / (cell.n_for + cell.n_against);  // projection and single rays: the share of the labels
    if (method_ == PaperGridMethod::kFull) {
      const bool is_against = cell.n_against > cell.n_for;
      if (!is_against && !cell.has_class_ray) continue;  // case 3: 0.5
      const CaseWeights weights = is_against                 ? kAgainst
                                  : cell.below && cell.above ? kBelowAndAbove
                                  : cell.below               ? kBelow
                                                             : kOver;
      const double share = cell.n_for > 0.0 ? cell.p_for / cell.n_for : 0.0;
      phi = std::exp(weights.alpha * cell.lowest_m / kClassHeight_m) *
            std::exp(weights.beta * std::max(0.0, kClassHeight_m - cell.highest_m) / kClassHeight_m) * share;
    }
    const bool is_for = cell.n_for >= cell.n_against && phi - 0.5 >= kZeta;
    const bool is_against = cell.n_against >= cell.n_for && 0.5 - phi >= kZeta;
    auto& [log_odds, images] = log_odds_[at];
    ++images;
    if (!is_for && !is_against) continue;
    log_odds = std::clamp(log_odds + kGamma * (cell.n_for - cell.n_against), -kMaxLogOdds, kMaxLogOdds);
  }
}

SemanticGrid PaperGrid::grid() const {
  SemanticGrid grid;
  grid.cell_m = kPaperCell_m;
  if (log_odds_.empty()) return grid;
  int left = std::numeric_limits<int>::max(), right = std::numeric_limits<int>::min(), low = left, high = right;
  for (const auto& [at, value] : log_odds_) {
    left = std::min(left, at.first);
    right = std::max(right, at.first);
    low = std::min(low, at.second);
    high = std::max(high, at.second);
  }
  grid.first_column = left;
  grid.first_row = low;
  grid.width = right - left + 1;
  grid.height = high - low + 1;
  const std::size_t cells = static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height);
  grid.probability.assign(cells, std::numeric_limits<float>::quiet_NaN());
  grid.images.assign(cells, 0);
  grid.class_images.assign(cells, 0);
  grid.class_latest.assign(cells, 0);
  grid.ground_world_m.assign(cells, 0.0F);
  for (const auto& [at, value] : log_odds_) {
    const std::size_t i = grid.index(at.first - left, at.second - low);
    grid.probability[i] = static_cast<float>(1.0 / (1.0 + std::exp(-value.first)));
    grid.images[i] = value.second;
  }
  return grid;
}

}  // namespace situation_awareness
