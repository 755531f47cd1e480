// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/synthetic_segments.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "situation_awareness/geometry/angles.hpp"
#include "synthetic_scan.hpp"

namespace situation_awareness {

using namespace synthetic;

namespace {

using synthetic::within_range;  // beside those of boxes and things here

constexpr double kMinRadiusM = 0.05;
constexpr double kMaxRadiusM = 0.5;
constexpr double kMinSideM = 0.1;
constexpr double kMaxSideM = 1.5;
constexpr int kMinEllipseHits = 5;  // ellipse paper, Sect. IV-C
constexpr int kMinHits = 4;         // circle paper, Sect. III-C: 0.3 % of 1081 beams

Eigen::Vector2d anywhere(Random& random, double distance_m) {
  const double bearing_rad = random.uniform(kFirstAzimuthRad, kFirstAzimuthRad + kFieldRad);
  return distance_m * Eigen::Vector2d(std::cos(bearing_rad), std::sin(bearing_rad));
}

double distance_in_disc(Random& random) { return kPaperMaxRangeM * std::sqrt(random.uniform()); }

/// The ellipse paper's prior.
Ellipse draw_ellipse(Random& random, double distance_m) {
  Ellipse ellipse;
  ellipse.center_m = anywhere(random, distance_m);
  ellipse.psi_rad = random.uniform(-kPi / 2.0, kPi / 2.0);
  ellipse.rx_m = random.uniform(kMinRadiusM, kMaxRadiusM);
  ellipse.ry_m = random.uniform(kMinRadiusM, ellipse.rx_m);
  return ellipse;
}

std::optional<SyntheticSegment> try_ellipse(bool occluded, Random& random) {
  const Scanner scanner;
  const Ellipse ellipse = draw_ellipse(random, distance_in_disc(random));
  if (!within_range(ellipse, scanner.max_range_m)) return std::nullopt;
  Hits hits = cast({{ellipse}, {}}, scanner);
  if (hits.count() < kMinEllipseHits) return std::nullopt;
  Ends ends;
  if (occluded && !hide_one_end(hits, ends, kMinEllipseHits, random)) return std::nullopt;
  add_noise(hits, scanner, random);
  return make_segment(hits, ends, scanner, ellipse, std::nullopt);
}

std::optional<SyntheticSegment> try_circle(Random& random) {
  constexpr double kStepM = 0.05;
  const Scanner scanner;
  const double radius_m = kStepM * uniform_int(random, 1, 10);
  const int reach = static_cast<int>(std::lround(kPaperMaxRangeM / kStepM));
  const double x_m = kStepM * uniform_int(random, -reach, reach);
  const double y_m = kStepM * uniform_int(random, -reach, reach);
  const Ellipse circle{{x_m, y_m}, 0.0, radius_m, radius_m};
  if (!within_range(circle, scanner.max_range_m)) return std::nullopt;
  Hits hits = cast({{circle}, {}}, scanner);
  if (hits.count() < kMinHits) return std::nullopt;
  add_noise(hits, scanner, random);
  return make_segment(hits, {}, scanner, circle, std::nullopt);
}

Scanner draw_scanner(Random& random) {
  constexpr double kMaxTiltRad = radians(15.0);
  Scanner scanner;
  if (chance(random, 0.5)) scanner.resolution_rad = radians(random.uniform(0.25, 1.0));
  if (chance(random, 0.5)) scanner.range_sigma_m = log_uniform(random, 0.004, 0.03);
  if (chance(random, 0.3)) scanner.noise = log_uniform(random, 0.7, 1.4);
  scanner.max_range_m = 30.0;
  if (chance(random, 0.2)) {
    scanner.tilt_rad = random.uniform(0.0, kMaxTiltRad);
    scanner.tilt_axis_rad = random.uniform(-kPi, kPi);
  }
  return scanner;
}

/// Uniform over the disc, where most are far, and uniform in distance, to 10 m and beyond.
double draw_distance(Random& random) {
  const double which = random.uniform();
  if (which < 0.4) return distance_in_disc(random);
  return which < 0.85 ? random.uniform(0.5, kPaperMaxRangeM) : random.uniform(kPaperMaxRangeM, 25.0);
}

/// As `draw_distance`, with more that are near.
double draw_distance_more_near(Random& random) {
  return chance(random, 0.25) ? log_uniform(random, 0.3, kPaperMaxRangeM) : draw_distance(random);
}

using Distance = double (*)(Random&);

Thing draw_wall(Random& random, double min_length_m, double max_length_m, Distance distance) {
  const double length_m = log_uniform(random, min_length_m, max_length_m);
  const Eigen::Vector2d middle = anywhere(random, distance(random));
  const double heading_rad = random.uniform(-kPi, kPi);
  const Eigen::Vector2d half = 0.5 * length_m * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad));
  return {{}, {{middle - half, middle + half}}};
}

Thing draw_corner(Random& random, double min_length_m, double max_length_m, Distance distance) {
  const Eigen::Vector2d corner = anywhere(random, distance(random));
  const double heading_rad = random.uniform(-kPi, kPi);
  const Eigen::Vector2d along(std::cos(heading_rad), std::sin(heading_rad));
  const Eigen::Vector2d across(-along.y(), along.x());
  const double first_m = log_uniform(random, min_length_m, max_length_m);
  const double second_m = log_uniform(random, min_length_m, max_length_m);
  return {{}, {{corner, corner + first_m * along}, {corner, corner + second_m * across}}};
}

/// The sides uniform in `min_side_m` ... `max_side_m`, the orientation uniform.
Box draw_box(Random& random, double distance_m, double min_side_m, double max_side_m) {
  Box box;
  box.center_m = anywhere(random, distance_m);
  box.psi_rad = random.uniform(-kPi, kPi);
  box.half_length_m = 0.5 * random.uniform(min_side_m, max_side_m);
  box.half_width_m = 0.5 * random.uniform(min_side_m, max_side_m);
  return box;
}

/// In this order of operations, on which the last bits of `product` depend.
std::vector<Edge> edges_of(const Box& box) {
  const Eigen::Vector2d x_axis(std::cos(box.psi_rad), std::sin(box.psi_rad));
  const Eigen::Vector2d y_axis(-std::sin(box.psi_rad), std::cos(box.psi_rad));
  const Eigen::Vector2d along = box.half_length_m * x_axis;
  const Eigen::Vector2d across = box.half_width_m * y_axis;
  const std::array<Eigen::Vector2d, 4> corners = {box.center_m + along + across, box.center_m - along + across,
                                                  box.center_m - along - across, box.center_m + along - across};
  std::vector<Edge> edges;
  for (std::size_t i = 0; i < corners.size(); ++i) edges.emplace_back(corners[i], corners[(i + 1) % 4]);
  return edges;
}

/// A box with rounded corners: circles in the corners and what is left of the sides. Their nearest crossing with a beam
/// from outside is the outline's.
Thing rounded(const Box& box, double radius_m) {
  Thing thing;
  for (const Edge& edge : edges_of(box)) {
    const Eigen::Vector2d along = radius_m * (edge.second - edge.first).normalized();
    const Eigen::Vector2d inward(-along.y(), along.x());
    thing.edges.emplace_back(edge.first + along, edge.second - along);
    thing.ellipses.push_back({edge.first + along + inward, 0.0, radius_m, radius_m});
  }
  return thing;
}

bool within_range(const Box& box, double max_range_m) {
  const std::array<Eigen::Vector2d, 4> all = corners(box);
  return offset_m(box, Eigen::Vector2d::Zero()) > kMinRangeM &&
         std::all_of(all.begin(), all.end(), [&](const Eigen::Vector2d& p) { return p.norm() < max_range_m; });
}

/// Number of faces that the sensor sees, 1 or 2 from outside.
int visible_faces(const Box& box) {
  const Eigen::Vector2d sensor_box = Eigen::Rotation2Dd(-box.psi_rad) * -box.center_m;
  return (std::abs(sensor_box.x()) > box.half_length_m ? 1 : 0) + (std::abs(sensor_box.y()) > box.half_width_m ? 1 : 0);
}

std::optional<SyntheticSegment> try_boxes(bool one_face, Random& random) {
  const Scanner scanner;
  const Box box = draw_box(random, distance_in_disc(random), kMinSideM, kMaxSideM);
  if (!within_range(box, scanner.max_range_m) || (one_face && visible_faces(box) != 1)) return std::nullopt;
  Hits hits = cast({{}, edges_of(box)}, scanner);
  if (hits.count() < kMinEllipseHits) return std::nullopt;
  add_noise(hits, scanner, random);
  if (!is_one_segment(hits)) return std::nullopt;
  return make_segment(hits, {}, scanner, std::nullopt, box);
}

Thing draw_two(Random& random, Distance distance) {
  Ellipse first = draw_ellipse(random, distance(random));
  Ellipse second = draw_ellipse(random, 0.0);
  if (chance(random, 0.5)) {  // legs
    for (Ellipse* leg : {&first, &second}) {
      leg->rx_m = random.uniform(0.05, 0.12);
      leg->ry_m = random.uniform(0.7, 1.0) * leg->rx_m;
    }
  }
  const double heading_rad = random.uniform(-kPi, kPi);
  const double distance_m = random.uniform(0.5, 1.1) * (first.rx_m + second.rx_m);
  second.center_m = first.center_m + distance_m * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad));
  return {{first, second}, {}};
}

/// True if each of the two ellipses is hit by at least two beams: else only one is visible.
bool both_visible(const Thing& two, const Hits& hits, const Scanner& scanner) {
  std::array<int, 2> seen = {0, 0};
  for (int i = 0; i < hits.count(); ++i) {
    const double range_m = hits.ranges_m[static_cast<std::size_t>(i)];
    if (std::isinf(range_m)) continue;
    const double azimuth_rad = scanner.azimuth_rad(hits.first + i);
    ++seen[range_to({{two.ellipses[0]}, {}}, azimuth_rad) <= range_m ? 0 : 1];
  }
  return seen[0] >= 2 && seen[1] >= 2;
}

/// The depth of leaves scatters by more than the noise and less than a gap.
void scatter(Hits& hits, Random& random) {
  const double spread_m = log_uniform(random, 0.03, 0.15);
  for (double& range_m : hits.ranges_m) {
    if (!std::isinf(range_m)) range_m += random.uniform(-spread_m, spread_m);
  }
}

/// Real objects are no perfect ellipses: a few waves along the outline.
void roughen(Hits& hits, Random& random) {
  constexpr int kWaves = 3;
  const double amplitude_m = log_uniform(random, 0.002, 0.015);
  for (int wave = 0; wave < kWaves; ++wave) {
    const double turns = random.uniform(0.5, 5.0);
    const double phase = random.uniform(0.0, 2.0 * kPi);
    for (std::size_t i = 0; i < hits.ranges_m.size(); ++i) {
      const double place = static_cast<double>(i) / static_cast<double>(hits.ranges_m.size());
      if (!std::isinf(hits.ranges_m[i])) {
        hits.ranges_m[i] += amplitude_m / std::sqrt(kWaves) * std::sin(2.0 * kPi * turns * place + phase);
      }
    }
  }
}

bool within_range(const Thing& thing, double max_range_m) {
  for (const Ellipse& ellipse : thing.ellipses) {
    if (!within_range(ellipse, max_range_m)) return false;
  }
  return std::all_of(thing.edges.begin(), thing.edges.end(), [max_range_m](const Edge& edge) {
    const Eigen::Vector2d along = edge.second - edge.first;
    const double place = std::clamp(-edge.first.dot(along) / along.squaredNorm(), 0.0, 1.0);
    return (edge.first + place * along).norm() > 2.0 * kMinRangeM && edge.first.norm() < max_range_m &&
           edge.second.norm() < max_range_m;
  });
}

/// A wall, corner, box, bush or pair: not one ellipse.
std::optional<SyntheticSegment> try_other(SegmentCase which, Random& random) {
  const Scanner scanner = draw_scanner(random);
  Thing thing;
  std::optional<Box> box;
  switch (which) {
    case SegmentCase::kWall:
      thing = draw_wall(random, 1.0, 8.0, draw_distance);
      break;
    case SegmentCase::kCorner:
      thing = draw_corner(random, 0.5, 4.0, draw_distance);
      break;
    case SegmentCase::kBox:
      box = draw_box(random, draw_distance(random), 0.1, 1.0);
      thing.edges = edges_of(*box);
      break;
    case SegmentCase::kBush:
      thing.ellipses = {draw_ellipse(random, draw_distance(random))};
      break;
    default:
      thing = draw_two(random, draw_distance);
      break;
  }
  if (!within_range(thing, scanner.max_range_m)) return std::nullopt;
  Hits hits = cast(thing, scanner);
  if (hits.count() < kMinHits || !is_one_segment(hits)) return std::nullopt;
  if (which == SegmentCase::kTwo && !both_visible(thing, hits, scanner)) return std::nullopt;
  Ends ends;
  if (chance(random, 0.5) && !hide_one_end(hits, ends, kMinHits, random)) return std::nullopt;
  if (which == SegmentCase::kBush) scatter(hits, random);
  add_noise(hits, scanner, random);
  if (!is_one_segment(hits)) return std::nullopt;
  return make_segment(hits, ends, scanner, std::nullopt, box);
}

/// A beam on the edge of an object may return a range between it and the surface beside it (mixed pixel).
void mix_pixels(Hits& hits, const Ends& ends, const Scanner& scanner, Random& random) {
  const auto mixed = [&](SegmentEnd end, double range_m) -> std::optional<double> {
    if (end == SegmentEnd::kBackground && chance(random, 0.2)) return range_m + random.uniform(0.0, kMaxRangeGapM);
    if (end == SegmentEnd::kOccluded && chance(random, 0.2)) return range_m - random.uniform(0.0, kMaxRangeGapM);
    return std::nullopt;
  };
  if (hits.first > 0) {
    if (const auto range_m = mixed(ends.right, hits.ranges_m.front())) {
      hits.ranges_m.insert(hits.ranges_m.begin(), *range_m);
      --hits.first;
    }
  }
  if (hits.first + hits.count() < scanner.beams()) {
    if (const auto range_m = mixed(ends.left, hits.ranges_m.back())) hits.ranges_m.push_back(*range_m);
  }
}

/// Occludes one end as in `occluded` or by anything, or both. False if too few hits would be left.
bool hide_any(Hits& hits, Ends& ends, const Scanner& scanner, Random& random) {
  const double how = random.uniform();
  if (how < 0.6) return hide_one_end(hits, ends, kMinHits, random);
  const bool right = chance(random, 0.5);
  for (const bool side : {right, !right}) {
    const int hidden = uniform_int(random, 0, static_cast<int>(0.8 * hits.count()));
    if (hits.count() - hidden < kMinHits) return false;
    const double widest_rad = radians(chance(random, 0.8) ? 40.0 : 180.0);
    const int beyond = static_cast<int>(random.uniform(0.0, widest_rad) / scanner.resolution_rad);
    hide(hits, ends, side, hidden, std::max(beyond, hidden == 0 ? 1 : 0));
    if (how < 0.9) break;
  }
  return true;
}

/// Half of the silhouettes are before a background.
void draw_background(Ends& ends, Random& random) {
  for (SegmentEnd* end : {&ends.right, &ends.left}) {
    if (*end == SegmentEnd::kFree && chance(random, 0.5)) *end = SegmentEnd::kBackground;
  }
}

/// Beams without a return between the first hit and the last. False if too few hits are left.
bool lose_beams(Hits& hits, Random& random) {
  const double lost = random.uniform(0.0, 0.3);
  for (std::size_t i = 1; i + 1 < hits.ranges_m.size(); ++i) {
    if (chance(random, lost)) hits.ranges_m[i] = kMissM;
  }
  return std::count_if(hits.ranges_m.begin(), hits.ranges_m.end(), [](double r) { return !std::isinf(r); }) >= kMinHits;
}

std::optional<SyntheticSegment> try_product(Random& random) {
  const double kind = random.uniform();
  // Most segments are ellipses; the others are for training the refusal.
  constexpr double kEllipses = 0.7;
  const Scanner scanner = draw_scanner(random);
  Thing thing;
  std::optional<Box> box;
  const bool one_ellipse = kind < kEllipses;
  const bool two = kind >= 0.94;
  const bool bush = kind >= 0.90 && kind < 0.94;
  if (one_ellipse || bush) {
    thing.ellipses = {draw_ellipse(random, draw_distance(random))};
  } else if (kind < 0.78) {
    thing = draw_wall(random, 0.5, 8.0, draw_distance);
  } else if (kind < 0.85) {
    thing = draw_corner(random, 0.2, 4.0, draw_distance);
  } else if (kind < 0.90) {
    box = draw_box(random, draw_distance(random), 0.1, 1.0);
    thing.edges = edges_of(*box);
  } else {
    thing = draw_two(random, draw_distance);
  }
  if (!within_range(thing, scanner.max_range_m)) return std::nullopt;
  Hits hits = cast(thing, scanner);
  if (hits.count() < kMinHits) return std::nullopt;
  if (!one_ellipse && !is_one_segment(hits)) return std::nullopt;
  if (two && !both_visible(thing, hits, scanner)) return std::nullopt;

  Ends ends;
  if (chance(random, 0.4) && !hide_any(hits, ends, scanner, random)) return std::nullopt;
  draw_background(ends, random);
  if (bush) scatter(hits, random);
  if (chance(random, 0.3)) roughen(hits, random);
  add_noise(hits, scanner, random);
  mix_pixels(hits, ends, scanner, random);
  if (chance(random, 0.1) && hits.count() > 2 && !lose_beams(hits, random)) return std::nullopt;
  if (!one_ellipse && !is_one_segment(hits)) return std::nullopt;
  return make_segment(hits, ends, scanner, one_ellipse ? std::optional(thing.ellipses.front()) : std::nullopt, box);
}

/// At an edge beams may find nothing, so that the segment ends beside a beam without return, inside the true edge.
void lose_edges(Hits& hits, const Ends& ends, const Scanner& scanner, Random& random) {
  constexpr double kShare = 0.25;
  constexpr double kMaxLostM = 0.15;
  std::vector<double>& ranges_m = hits.ranges_m;
  for (const bool right : {true, false}) {
    if ((right ? ends.right : ends.left) != SegmentEnd::kFree || !chance(random, kShare)) continue;
    const double lost_m = random.uniform(0.0, kMaxLostM);
    const auto range_m = [&](int i) { return ranges_m[static_cast<std::size_t>(right ? i : hits.count() - 1 - i)]; };
    int lost = 0;
    for (double length_m = 0.0; hits.count() - lost > kMinHits; ++lost) {
      length_m += std::hypot(range_m(lost + 1) - range_m(lost), range_m(lost) * scanner.resolution_rad);
      if (!(length_m < lost_m)) break;
    }
    if (right) {
      ranges_m.erase(ranges_m.begin(), ranges_m.begin() + lost);
      hits.first += lost;
    } else {
      ranges_m.resize(ranges_m.size() - static_cast<std::size_t>(lost));
    }
  }
}

/// Sets a part of the outline back, such as what is above a bumper.
void set_back(Hits& hits, Random& random) {
  const double depth_m = log_uniform(random, 0.005, 0.04);
  const int begin = uniform_int(random, 0, hits.count() - 1);
  const int end = uniform_int(random, begin, hits.count());
  for (int i = begin; i < end; ++i) hits.ranges_m[static_cast<std::size_t>(i)] += depth_m;
}

void quantise(Hits& hits, const Scanner& scanner, Random& random) {
  const double quantum_m = log_uniform(random, 0.001, 0.01);
  for (int i = 0; i < hits.count(); ++i) {
    double& range_m = hits.ranges_m[static_cast<std::size_t>(i)];
    const double step_m = quantum_m * scanner.horizontal(hits.first + i);
    if (!std::isinf(range_m)) range_m = step_m * std::round(range_m / step_m);
  }
}

enum class ShapeKind { kEllipse, kBox, kWall, kCorner, kBush, kTwo };

ShapeKind draw_kind(Random& random) {
  const double kind = random.uniform();
  if (kind < 0.4) return ShapeKind::kEllipse;
  if (kind < 0.8) return ShapeKind::kBox;
  if (kind < 0.87) return ShapeKind::kWall;
  if (kind < 0.93) return ShapeKind::kCorner;
  return kind < 0.96 ? ShapeKind::kBush : ShapeKind::kTwo;
}

/// Half of them with the sides of `boxes`; of all, a third square on or nearly.
Box draw_any_box(Random& random) {
  constexpr double kNearlyRad = radians(10.0);
  Box box = draw_box(random, draw_distance_more_near(random), kMinSideM, kMaxSideM);
  if (chance(random, 0.5)) {
    box.half_length_m = 0.5 * log_uniform(random, 0.1, 2.0);
    box.half_width_m = 0.5 * log_uniform(random, 0.1, 2.0);
  }
  if (chance(random, 1.0 / 3.0)) {
    box.psi_rad = std::atan2(box.center_m.y(), box.center_m.x()) + random.uniform(-kNearlyRad, kNearlyRad);
  }
  return box;
}

Thing draw_outline(const Box& box, Random& random) {
  constexpr double kMaxRadiusOfCornersM = 0.06;
  if (chance(random, 0.5)) return {{}, edges_of(box)};
  const double largest_m = 0.8 * std::min(box.half_length_m, box.half_width_m);
  return rounded(box, std::min(random.uniform(0.001, kMaxRadiusOfCornersM), largest_m));
}

std::optional<SyntheticSegment> try_shape(ShapeKind kind, Random& random) {
  const Scanner scanner = draw_scanner(random);
  Thing thing;
  std::optional<Ellipse> ellipse;
  std::optional<Box> box;
  switch (kind) {
    case ShapeKind::kEllipse:
      ellipse = draw_ellipse(random, draw_distance_more_near(random));
      thing.ellipses = {*ellipse};
      break;
    case ShapeKind::kBox:
      box = draw_any_box(random);
      thing = draw_outline(*box, random);
      break;
    case ShapeKind::kWall:
      thing = draw_wall(random, 0.2, 8.0, draw_distance_more_near);
      break;
    case ShapeKind::kCorner:
      thing = draw_corner(random, 0.2, 4.0, draw_distance_more_near);
      break;
    case ShapeKind::kBush:
      thing.ellipses = {draw_ellipse(random, draw_distance_more_near(random))};
      break;
    case ShapeKind::kTwo:
      thing = draw_two(random, draw_distance_more_near);
      break;
  }
  if (box ? !within_range(*box, scanner.max_range_m) : !within_range(thing, scanner.max_range_m)) return std::nullopt;
  Hits hits = cast(thing, scanner);
  if (hits.count() < kMinHits || !is_one_segment(hits)) return std::nullopt;
  if (kind == ShapeKind::kTwo && !both_visible(thing, hits, scanner)) return std::nullopt;

  Ends ends;
  const double hidden_share = kind == ShapeKind::kWall ? 0.7 : 0.4;
  if (chance(random, hidden_share) && !hide_any(hits, ends, scanner, random)) return std::nullopt;
  draw_background(ends, random);
  lose_edges(hits, ends, scanner, random);
  if (kind == ShapeKind::kBush) scatter(hits, random);
  if (chance(random, 0.3)) roughen(hits, random);
  if (chance(random, 0.15)) set_back(hits, random);
  add_noise(hits, scanner, random, chance(random, 0.2) ? random.uniform(0.2, 0.8) : 0.0);
  if (chance(random, 0.5)) quantise(hits, scanner, random);
  mix_pixels(hits, ends, scanner, random);
  if (chance(random, 0.2) && !lose_beams(hits, random)) return std::nullopt;
  if (!is_one_segment(hits)) return std::nullopt;
  return make_segment(hits, ends, scanner, ellipse, box);
}

constexpr std::array<std::pair<const char*, SegmentCase>, 12> kNames = {{{"ellipse", SegmentCase::kEllipse},
                                                                         {"circle", SegmentCase::kCircle},
                                                                         {"occluded", SegmentCase::kOccluded},
                                                                         {"product", SegmentCase::kProduct},
                                                                         {"wall", SegmentCase::kWall},
                                                                         {"corner", SegmentCase::kCorner},
                                                                         {"box", SegmentCase::kBox},
                                                                         {"bush", SegmentCase::kBush},
                                                                         {"two", SegmentCase::kTwo},
                                                                         {"boxes", SegmentCase::kBoxes},
                                                                         {"faces", SegmentCase::kFaces},
                                                                         {"shapes", SegmentCase::kShapes}}};

}  // namespace

SyntheticSegment draw_segment(SegmentCase which, Random& random) {
  // Of the segments that are kept, so that how often a kind is discarded does not change its share.
  const ShapeKind kind = which == SegmentCase::kShapes ? draw_kind(random) : ShapeKind::kEllipse;
  while (true) {
    std::optional<SyntheticSegment> sample;
    switch (which) {
      case SegmentCase::kEllipse:
      case SegmentCase::kOccluded:
        sample = try_ellipse(which == SegmentCase::kOccluded, random);
        break;
      case SegmentCase::kCircle:
        sample = try_circle(random);
        break;
      case SegmentCase::kProduct:
        sample = try_product(random);
        break;
      case SegmentCase::kBoxes:
      case SegmentCase::kFaces:
        sample = try_boxes(which == SegmentCase::kFaces, random);
        break;
      case SegmentCase::kShapes:
        sample = try_shape(kind, random);
        break;
      default:
        sample = try_other(which, random);
        break;
    }
    if (sample) return *std::move(sample);
  }
}

std::string name_of(SegmentCase which) {
  for (const auto& [name, value] : kNames) {
    if (value == which) return name;
  }
  throw std::invalid_argument("a segment case without a name");
}

SegmentCase segment_case(const std::string& name) {
  std::string known;
  for (const auto& [known_name, value] : kNames) {
    if (name == known_name) return value;
    known += (known.empty() ? "" : ", ") + std::string(known_name);
  }
  throw std::invalid_argument("unknown case '" + name + "', known are: " + known);
}

}  // namespace situation_awareness
