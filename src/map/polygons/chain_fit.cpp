// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/chain_fit.hpp"

#include <algorithm>
#include <cmath>

namespace situation_awareness {
namespace {

/// Of an edge with more elements than this, those at its corners do not count for its line: they are of both edges, and
/// round the corner.
constexpr std::size_t kLongEdge = 6;
constexpr std::size_t kAtCorner = 2;
/// Elements of an edge that is a line, at least.
constexpr std::size_t kFewestOfLine = 4;
/// m. Length of an edge that may be a rounded corner.
constexpr double kShortEdge_m = 0.12;
/// m. Farthest place of a vertex from the elements at its corner.
constexpr double kMaxCorner_m = 0.06;
/// rad. Edges that turn by less have no corner.
constexpr double kLeastTurn_rad = 0.15;
/// rad. Edges that turn by less may be one.
constexpr double kStraight_rad = 0.3;
/// m. Half the least length of what one element stands for.
constexpr double kLeastHalf_m = 0.005;
/// m. Standard deviation of an element's place that its hits do not show: beams over an edge, normals that are off. The
/// more elements an edge has, the less it matters.
constexpr double kElementSigma_m = 0.017;
/// m. Poses have errors that repeat: no boundary is known better.
constexpr double kLeastSigma_m = 0.002;
/// Standard deviation of an open end along its edge, in parts of the distance of its last two elements: the boundary
/// ends half of that before or behind its last element at most, anywhere (of a uniform distribution, 1 / sqrt(12)).
constexpr double kEndSigma = 0.2887;

}  // namespace

double ChainFit::FittedLine::sigma_at(const Eigen::Vector2d& p_m) const {
  const double s_m = Eigen::Vector2d(-normal.y(), normal.x()).dot(p_m - through_m);
  return std::sqrt(offset_variance_m2 + turn_variance * s_m * s_m + spread_m2 + kLeastSigma_m * kLeastSigma_m);
}

/// Where two lines meet; false where they hardly turn.
bool ChainFit::crossing(const FittedLine& a, const FittedLine& b, Eigen::Vector2d& crossing_m) {
  const double determinant = a.normal.x() * b.normal.y() - a.normal.y() * b.normal.x();
  if (std::abs(determinant) < std::sin(kLeastTurn_rad)) return false;
  const double d_a = a.normal.dot(a.through_m);
  const double d_b = b.normal.dot(b.through_m);
  crossing_m << (d_a * b.normal.y() - d_b * a.normal.y()) / determinant,
      (d_b * a.normal.x() - d_a * b.normal.x()) / determinant;
  return true;
}

/// Sums are relative to the first element: far from the world's origin they would be lost in rounding.
ChainFit::FittedLine ChainFit::line_of(const std::vector<BoundaryElement>& elements, bool closed,
                                       std::size_t edge) const {
  const std::size_t trim = corners_[edge + 1] - corners_[edge] > kLongEdge ? kAtCorner : 0;
  const std::size_t first = corners_[edge] + (closed || edge > 0 ? trim : 0);
  const std::size_t last = corners_[edge + 1] - (closed || edge + 2 < corners_.size() ? trim : 0);
  double weight = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (std::size_t i = first; i <= last; ++i) {
    const BoundaryElement& element = elements[i % elements.size()];
    const Eigen::Vector2d p_m = element.p_world_m - elements[0].p_world_m;
    weight += 1.0 / element.variance_m2;
    sum += p_m / element.variance_m2;
    squares += p_m * p_m.transpose() / element.variance_m2;
  }
  FittedLine line;
  line.through_m = sum / weight;
  const Eigen::Matrix2d S = squares / weight - line.through_m * line.through_m.transpose();
  const double angle_rad = 0.5 * std::atan2(2.0 * S(0, 1), S(0, 0) - S(1, 1));
  const Eigen::Vector2d along(std::cos(angle_rad), std::sin(angle_rad));
  line.normal = {-along.y(), along.x()};
  line.offset_variance_m2 = 1.0 / weight;
  line.turn_variance = line.offset_variance_m2 / std::max(along.dot(S * along), 1e-8);
  line.spread_m2 = std::max(line.normal.dot(S * line.normal), 0.0) +
                   kElementSigma_m * kElementSigma_m / static_cast<double>(last - first + 1);
  line.elements = last - first + 1;
  return line;
}

void ChainFit::find_corners(std::vector<BoundaryElement>& elements, bool closed, double tolerance_m) {
  const auto at = [&](std::size_t i) -> const Eigen::Vector2d& { return elements[i % elements.size()].p_world_m; };
  const auto allowance_m = [&](std::size_t i) { return 2.0 * std::sqrt(elements[i % elements.size()].variance_m2); };
  corners_.assign(1, 0);
  if (!closed) {
    simplification_.add(0, elements.size() - 1, tolerance_m, at, allowance_m, corners_);
    return;
  }
  // What is farthest from any element is a corner. The chain begins there.
  const auto farthest_from_first = [&] {
    const auto nearer = [&](const BoundaryElement& a, const BoundaryElement& b) {
      return (a.p_world_m - at(0)).squaredNorm() < (b.p_world_m - at(0)).squaredNorm();
    };
    return std::max_element(elements.begin(), elements.end(), nearer);
  };
  std::rotate(elements.begin(), farthest_from_first(), elements.end());
  const auto opposite = static_cast<std::size_t>(farthest_from_first() - elements.begin());
  simplification_.add(0, opposite, tolerance_m, at, allowance_m, corners_);
  simplification_.add(opposite, elements.size(), tolerance_m, at, allowance_m, corners_);
}

/// A short edge between two whose lines meet beside it is their corner.
void ChainFit::drop_rounded_corners(const std::vector<BoundaryElement>& elements, bool closed) {
  const auto place_m = [&](std::size_t corner) -> Eigen::Vector2d {
    return elements[corners_[corner] % elements.size()].p_world_m - elements[0].p_world_m;
  };
  const auto is_corner = [&](std::size_t before, std::size_t edge, std::size_t after) {
    const Eigen::Vector2d from_m = place_m(edge), to_m = place_m(edge + 1);
    Eigen::Vector2d crossing_m;
    return (to_m - from_m).norm() < kShortEdge_m && crossing(lines_[before], lines_[after], crossing_m) &&
           (crossing_m - from_m).norm() < kMaxCorner_m && (crossing_m - to_m).norm() < kMaxCorner_m;
  };
  for (std::size_t k = 1; k + 1 < lines_.size();) {
    if (is_corner(k - 1, k, k + 1)) {
      corners_[k] += (corners_[k + 1] - corners_[k]) / 2;
      corners_.erase(corners_.begin() + static_cast<std::ptrdiff_t>(k + 1));
      lines_.erase(lines_.begin() + static_cast<std::ptrdiff_t>(k));
    } else {
      ++k;
    }
  }
  // On both sides of where a closed chain begins.
  if (closed && lines_.size() > 3 && is_corner(lines_.size() - 2, lines_.size() - 1, 0)) {
    corners_.erase(corners_.end() - 2);
    lines_.pop_back();
  }
  if (closed && lines_.size() > 3 && is_corner(lines_.size() - 1, 0, 1)) {
    corners_.erase(corners_.begin() + 1);
    lines_.erase(lines_.begin());
  }
}

/// Elements at a corner that are of both its sides may have bent an edge: two that are one without those are one.
void ChainFit::straighten(const std::vector<BoundaryElement>& elements, bool closed, double tolerance_m) {
  const std::size_t fewest = closed ? 3 : 1;
  for (std::size_t k = 0; k + 1 < lines_.size() && lines_.size() > fewest;) {
    const std::size_t corner = corners_[k + 1];
    corners_.erase(corners_.begin() + static_cast<std::ptrdiff_t>(k + 1));
    const FittedLine line = line_of(elements, closed, k);
    bool is_straight = std::abs(lines_[k].normal.dot(lines_[k + 1].normal)) > std::cos(kStraight_rad);
    for (std::size_t i = corners_[k] + kAtCorner; is_straight && i + kAtCorner <= corners_[k + 1]; ++i) {
      const BoundaryElement& element = elements[i % elements.size()];
      const double off_m = std::abs(line.normal.dot(element.p_world_m - elements[0].p_world_m - line.through_m));
      is_straight = off_m < tolerance_m + 2.0 * std::sqrt(element.variance_m2);
    }
    if (is_straight) {
      lines_[k] = line;
      lines_.erase(lines_.begin() + static_cast<std::ptrdiff_t>(k + 1));
    } else {
      corners_.insert(corners_.begin() + static_cast<std::ptrdiff_t>(k + 1), corner);
      ++k;
    }
  }
}

void ChainFit::fit(std::vector<BoundaryElement>& elements, bool& closed, double tolerance_m,
                   std::vector<ChainVertex>& vertices) {
  vertices.clear();
  if (elements.size() == 1) {
    closed = false;
    const BoundaryElement& only = elements[0];
    const double middle_m = 0.5 * (only.high_m + only.low_m);
    const double half_m = std::max(0.5 * (only.high_m - only.low_m), kLeastHalf_m);
    for (const double along_m : {middle_m - half_m, middle_m + half_m}) {
      vertices.push_back(
          {only.p_world_m + along_m * only.along_world, std::hypot(std::sqrt(only.variance_m2), kElementSigma_m)});
    }
    return;
  }
  find_corners(elements, closed, tolerance_m);
  if (closed && corners_.size() < 4) {  // no area is between two edges
    closed = false;
    find_corners(elements, closed, tolerance_m);
  }
  lines_.clear();
  for (std::size_t k = 0; k + 1 < corners_.size(); ++k) lines_.push_back(line_of(elements, closed, k));
  drop_rounded_corners(elements, closed);
  straighten(elements, closed, tolerance_m);

  const Eigen::Vector2d origin_m = elements[0].p_world_m;
  const auto add_end = [&](const FittedLine& line, const BoundaryElement& element, const BoundaryElement& beside,
                           double beyond_m) {
    const Eigen::Vector2d p_m = element.p_world_m - origin_m + beyond_m * element.along_world;
    const Eigen::Vector2d on_line_m = p_m - line.normal * line.normal.dot(p_m - line.through_m);
    const double along_sigma_m = kEndSigma * (beside.p_world_m - element.p_world_m).norm();
    vertices.push_back({origin_m + on_line_m, std::hypot(line.sigma_at(on_line_m), along_sigma_m)});
  };
  const auto add_corner = [&](const FittedLine& right, const FittedLine& left, const BoundaryElement& element) {
    Eigen::Vector2d p_m = element.p_world_m - origin_m;
    Eigen::Vector2d crossing_m;
    // Short edges follow a curve, on which the element is and the crossing is not.
    if (std::min(right.elements, left.elements) >= kFewestOfLine && crossing(right, left, crossing_m) &&
        (crossing_m - p_m).norm() < kMaxCorner_m) {
      p_m = crossing_m;
    }
    vertices.push_back({origin_m + p_m, std::max(right.sigma_at(p_m), left.sigma_at(p_m))});
  };
  if (!closed) add_end(lines_.front(), elements.front(), elements[1], elements.front().low_m);
  for (std::size_t k = 0; k + 1 < lines_.size(); ++k) {
    add_corner(lines_[k], lines_[k + 1], elements[corners_[k + 1] % elements.size()]);
  }
  if (closed) {
    add_corner(lines_.back(), lines_.front(), elements.front());
  } else {
    add_end(lines_.back(), elements.back(), elements[elements.size() - 2], elements.back().high_m);
  }
}

}  // namespace situation_awareness
