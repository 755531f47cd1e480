// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/transit_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kBin_m = 0.02;
constexpr double kSample_m = 0.02;   ///< of chains
constexpr double kCell_m = 0.12;     ///< places nearer than this are in the same cell or the next
constexpr double kHitNear_m = 0.05;  ///< a hit this near is one of the outline: 4 sigma of an LMS100
constexpr double kBehind_m = 0.15;   ///< a beam that ends so far behind a place went through it
constexpr int kSeenHits = 3;         ///< one or two may be mixtures at a depth edge
constexpr int kFreeBeams = 5;
constexpr double kOnMap_m = 0.06;        ///< a chain this near is one of the thing
constexpr double kOnMapPart = 0.5;       ///< of what was seen of a thing, for it to be on the map
constexpr double kLeftPart = 0.25;       ///< of what was seen to be free, for the thing to be still there
constexpr double kGonePart = 1.0 / 3.0;  ///< of what was seen of a thing, seen to be free: it is known to have gone
constexpr double kLeastSeen_m = 0.06;    ///< less of an outline is not in sight
constexpr double kMoves_m_s = 0.1, kStands_m_s = 0.02;
constexpr std::int64_t kSpeedTime_ns = 200'000'000;

constexpr double kFar = std::numeric_limits<double>::infinity();

/// Places along an edge at most `spacing_m` apart, each in the middle of a piece of `length_m`.
template <class Visit>
void along_edge(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double spacing_m, const Visit& visit) {
  const double edge_m = (b - a).norm();
  const int pieces = std::max(1, static_cast<int>(std::ceil(edge_m / spacing_m)));
  for (int i = 0; i < pieces; ++i) visit(a + (i + 0.5) / pieces * (b - a), edge_m / pieces);
}

double distance_to_edge(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d edge = b - a;
  const double square = edge.squaredNorm();
  const double along = square > 0.0 ? std::clamp((p - a).dot(edge) / square, 0.0, 1.0) : 0.0;
  return (p - a - along * edge).norm();
}

Pose2 between(const Pose2& a, const Pose2& b, double part) {
  return {a.translation_m + part * (b.translation_m - a.translation_m),
          a.yaw_rad + part * wrap_to_pi(b.yaw_rad - a.yaw_rad)};
}

}  // namespace

bool TransitEvaluation::Bin::is_seen() const { return hits >= kSeenHits; }
bool TransitEvaluation::Bin::is_free() const { return passed >= kFreeBeams; }

std::int64_t TransitEvaluation::cell_of(const Eigen::Vector2d& p_m) {
  const auto x = static_cast<std::int64_t>(std::floor(p_m.x() / kCell_m));
  const auto y = static_cast<std::int64_t>(std::floor(p_m.y() / kCell_m));
  return x * (std::int64_t{1} << 32) + y;
}

void TransitEvaluation::make_bins(const std::vector<TransitThing>& things) {
  bins_.clear();
  cells_.clear();
  for (std::size_t i = 0; i < things.size(); ++i) {
    if (things[i].can_move) continue;
    for (const std::vector<Eigen::Vector2d>& outline : things[i].outlines_world_m) {
      for (std::size_t k = 0; k < outline.size(); ++k) {
        along_edge(outline[k], outline[(k + 1) % outline.size()], kBin_m,
                   [&](const Eigen::Vector2d& p, double length_m) {
                     cells_[cell_of(p)].push_back(static_cast<int>(bins_.size()));
                     bins_.push_back({p, length_m, static_cast<int>(i)});
                   });
      }
    }
  }
}

void TransitEvaluation::begin(int transit, const std::vector<TransitThing>& things) {
  const bool is_first = things_.empty();
  const auto same = [](const TransitThing& a, const TransitThing& b) { return a.name == b.name; };
  if (is_first) {
    make_bins(things);
  } else if (!std::equal(things.begin(), things.end(), things_.begin(), things_.end(), same)) {
    throw std::invalid_argument("transit " + std::to_string(transit) + " has other things than the one before");
  }
  was_there_.assign(things.size(), is_first);
  for (std::size_t i = 0; i < things_.size(); ++i) was_there_[i] = things_[i].is_there;
  for (Bin& bin : bins_) {
    const auto thing = static_cast<std::size_t>(bin.thing);
    if (things[thing].is_there && !was_there_[thing]) bin.hits = bin.passed = 0;
  }
  things_ = things;
  transit_ = transit;
  poses_ = stops_ = 0;
  position_sum_m2_ = position_max_m_ = yaw_sum_rad2_ = nees_sum_ = 0.0;
  recent_.clear();
  moves_ = false;
}

template <class Accepts>
int TransitEvaluation::nearest(const Eigen::Vector2d& p_m, const Accepts& accepts) const {
  int best = -1;
  double least_m2 = kFar;
  for (int dx = -1; dx <= 1; ++dx) {
    for (int dy = -1; dy <= 1; ++dy) {
      const auto cell = cells_.find(cell_of(p_m + kCell_m * Eigen::Vector2d(dx, dy)));
      if (cell == cells_.end()) continue;
      for (const int i : cell->second) {
        const Bin& bin = bins_[static_cast<std::size_t>(i)];
        const double square_m2 = (bin.p_world_m - p_m).squaredNorm();
        if (square_m2 < least_m2 && accepts(bin)) {
          least_m2 = square_m2;
          best = i;
        }
      }
    }
  }
  return best;
}

void TransitEvaluation::add_scan(const Scan& scan, const Pose2& T_world_lidar, const Pose2& T_world_lidar_end) {
  const double beams = static_cast<double>(scan.beams.size());
  const auto pose_of = [&](double beam) { return between(T_world_lidar, T_world_lidar_end, beam / (beams - 1.0)); };
  const auto is_there = [this](const Bin& bin) { return things_[static_cast<std::size_t>(bin.thing)].is_there; };
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    if (scan.beams[i].state != BeamState::kHit) continue;
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const Eigen::Vector2d p_lidar = scan.beams[i].range_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
    const Eigen::Vector2d p_world = pose_of(static_cast<double>(i)) * p_lidar;
    const int hit = nearest(p_world, is_there);
    if (hit < 0 || (bins_[static_cast<std::size_t>(hit)].p_world_m - p_world).norm() > kHitNear_m) continue;
    ++bins_[static_cast<std::size_t>(hit)].hits;
    // From beam to beam there may be several bins: those nearer to this hit than to the next were seen as well.
    const double half_m = 0.5 * scan.beams[i].range_m * std::abs(scan.angle_increment_rad);
    const Bin middle = bins_[static_cast<std::size_t>(hit)];
    for (const int step : {-1, 1}) {
      for (int k = hit + step; k >= 0 && k < static_cast<int>(bins_.size()); k += step) {
        Bin& bin = bins_[static_cast<std::size_t>(k)];
        if (bin.thing != middle.thing || (bin.p_world_m - middle.p_world_m).norm() > half_m) break;
        ++bin.hits;
      }
    }
  }
  for (Bin& bin : bins_) {
    if (is_there(bin) || !bin.is_seen()) continue;
    double beam = 0.0;
    Eigen::Vector2d p_lidar;
    for (int i = 0; i < 2; ++i) {  // the beam's time depends on the beam
      p_lidar = inverse(pose_of(std::clamp(beam, 0.0, beams - 1.0))) * bin.p_world_m;
      const double bearing_rad = std::atan2(p_lidar.y(), p_lidar.x());
      beam = (bearing_rad - scan.angle_min_rad) / scan.angle_increment_rad;
    }
    if (!(beam >= 0.0 && beam <= beams - 1.0)) continue;
    const double through_m = p_lidar.norm() + kBehind_m;
    const auto low = std::min(static_cast<std::size_t>(beam), scan.beams.size() - 2);
    // A beam without a return may be a lost one.
    const auto passes = [&](const Beam& b) { return b.state == BeamState::kHit && b.range_m > through_m; };
    if (passes(scan.beams[low]) && passes(scan.beams[low + 1])) ++bin.passed;
  }
}

void TransitEvaluation::add_motion(std::int64_t stamp_ns, const Pose2& T_world_base) {
  recent_.emplace_back(stamp_ns, T_world_base);
  const std::int64_t since_ns = stamp_ns - recent_.front().first;
  if (since_ns < kSpeedTime_ns) return;
  const double speed_m_s = (T_world_base.translation_m - recent_.front().second.translation_m).norm() /
                           (static_cast<double>(since_ns) / kNanosecondsPerSecond);
  recent_.erase(recent_.begin());
  if (moves_ && speed_m_s < kStands_m_s) {
    ++stops_;
    moves_ = false;
  } else if (speed_m_s > kMoves_m_s) {
    moves_ = true;
  }
}

void TransitEvaluation::add_pose(const Pose2& estimate, const Eigen::Matrix3d& covariance, const Pose2& truth) {
  Eigen::Vector3d error;
  error << estimate.translation_m - truth.translation_m, wrap_to_pi(estimate.yaw_rad - truth.yaw_rad);
  const double position_m2 = error.head<2>().squaredNorm();
  ++poses_;
  position_sum_m2_ += position_m2;
  position_max_m_ = std::max(position_max_m_, std::sqrt(position_m2));
  yaw_sum_rad2_ += error.z() * error.z();
  nees_sum_ += error.dot(covariance.ldlt().solve(error));
}

bool TransitEvaluation::counts_as_truth(const Bin& bin) const {
  return things_[static_cast<std::size_t>(bin.thing)].is_there || (bin.is_seen() && !bin.is_free());
}

std::vector<double> TransitEvaluation::distances_to(const std::vector<Eigen::Vector2d>& places_m) const {
  std::vector<double> distances(places_m.size(), kFar);
  for (std::size_t thing = 0; thing < things_.size(); ++thing) {
    if (!things_[thing].is_there || things_[thing].can_move) continue;
    for (const std::vector<Eigen::Vector2d>& outline : things_[thing].outlines_world_m) {
      for (std::size_t k = 0; k < outline.size(); ++k) {
        const Eigen::Vector2d& a = outline[k];
        const Eigen::Vector2d& b = outline[(k + 1) % outline.size()];
        for (std::size_t i = 0; i < places_m.size(); ++i) {
          distances[i] = std::min(distances[i], distance_to_edge(places_m[i], a, b));
        }
      }
    }
  }
  for (std::size_t i = 0; i < places_m.size(); ++i) {  // what has gone while no beam could tell
    const int bin = nearest(places_m[i], [this](const Bin& b) {
      return counts_as_truth(b) && !things_[static_cast<std::size_t>(b.thing)].is_there;
    });
    if (bin < 0) continue;
    const double apart_m = (bins_[static_cast<std::size_t>(bin)].p_world_m - places_m[i]).norm();
    distances[i] = std::min(distances[i], std::sqrt(std::max(0.0, apart_m * apart_m - 0.25 * kBin_m * kBin_m)));
  }
  return distances;
}

void TransitEvaluation::score_distances(const Polygons& map, TransitScore& score) const {
  std::vector<Eigen::Vector2d> places_m;
  std::vector<double> lengths_m;
  for (const Chain& chain : map.chains) {
    const std::size_t edges = chain.vertices.size() - (chain.closed ? 0 : 1);
    for (std::size_t k = 0; k < edges && chain.vertices.size() > 1; ++k) {
      along_edge(chain.vertices[k].p_world_m, chain.vertices[(k + 1) % chain.vertices.size()].p_world_m, kSample_m,
                 [&](const Eigen::Vector2d& p, double length_m) {
                   places_m.push_back(p);
                   lengths_m.push_back(length_m);
                 });
    }
  }
  const std::vector<double> distances = distances_to(places_m);
  double length_m = 0.0, sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < distances.size(); ++i) {
    length_m += lengths_m[i];
    sum += lengths_m[i] * distances[i];
    squares += lengths_m[i] * distances[i] * distances[i];
    score.max_distance_m = std::max(score.max_distance_m, distances[i]);
    if (distances[i] > kFalse_m) score.false_m += lengths_m[i];
  }
  score.mean_distance_m = sum / length_m;
  score.sigma_distance_m = std::sqrt(std::max(0.0, squares / length_m - score.mean_distance_m * score.mean_distance_m));
}

/// The other way round: the distance of each bin from the nearest chain, if that is less than what it was.
void TransitEvaluation::find_bins(const Polygons& map, std::vector<double>& chain_m) const {
  for (const Chain& chain : map.chains) {
    const std::size_t edges = chain.vertices.size() - (chain.closed ? 0 : 1);
    for (std::size_t k = 0; k < edges && chain.vertices.size() > 1; ++k) {
      const Eigen::Vector2d& a = chain.vertices[k].p_world_m;
      const Eigen::Vector2d& b = chain.vertices[(k + 1) % chain.vertices.size()].p_world_m;
      for (std::size_t i = 0; i < bins_.size(); ++i) {
        chain_m[i] = std::min(chain_m[i], distance_to_edge(bins_[i].p_world_m, a, b));
      }
    }
  }
}

void TransitEvaluation::score_things(const std::vector<double>& chain_m, TransitScore& score) const {
  double seen_m = 0.0, covered_m = 0.0;
  for (std::size_t thing = 0; thing < things_.size(); ++thing) {
    if (things_[thing].can_move || things_[thing].is_optional) continue;
    double own_seen_m = 0.0, own_on_map_m = 0.0, free_m = 0.0, left_m = 0.0;
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      const Bin& bin = bins_[i];
      if (bin.thing != static_cast<int>(thing) || !bin.is_seen()) continue;
      own_seen_m += bin.length_m;
      if (chain_m[i] < kOnMap_m) own_on_map_m += bin.length_m;
      if (things_[thing].is_there) {
        seen_m += bin.length_m;
        if (chain_m[i] < kFalse_m) covered_m += bin.length_m;
        continue;
      }
      // Near what stands a chain may be that one's.
      const int standing =
          nearest(bin.p_world_m, [this](const Bin& b) { return things_[static_cast<std::size_t>(b.thing)].is_there; });
      const bool is_apart =
          standing < 0 || (bins_[static_cast<std::size_t>(standing)].p_world_m - bin.p_world_m).norm() > kOnMap_m;
      if (!bin.is_free() || !is_apart) continue;
      free_m += bin.length_m;
      if (chain_m[i] < kOnMap_m) left_m += bin.length_m;
    }
    if (own_seen_m < kLeastSeen_m) continue;
    const std::string& name = things_[thing].name;
    if (things_[thing].is_there) {
      score.in_sight.push_back(name);
      const bool is_missed = own_on_map_m < kOnMapPart * own_seen_m;
      if (is_missed) score.missed.push_back(name);
      if (!was_there_[thing]) {
        score.appeared.push_back(name);
        if (is_missed) score.appeared_missed.push_back(name);
      }
    } else if (free_m >= kGonePart * own_seen_m) {
      score.gone.push_back(name);
      if (left_m > kLeftPart * free_m) score.gone_left.push_back(name);
    }
  }
  score.coverage = covered_m / seen_m;
}

TransitScore TransitEvaluation::end(double duration_s, const Polygons& map, const Polygons& bodies) {
  TransitScore score;
  score.transit = transit_;
  score.duration_s = duration_s;
  score.stops = moves_ ? stops_ : std::max(0, stops_ - 1);
  score_distances(map, score);
  std::vector<double> chain_m(bins_.size(), kFar);
  find_bins(map, chain_m);
  find_bins(bodies, chain_m);
  score_things(chain_m, score);
  score.poses = poses_;
  score.position_rms_m = std::sqrt(position_sum_m2_ / poses_);
  score.position_max_m = position_max_m_;
  score.yaw_rms_rad = std::sqrt(yaw_sum_rad2_ / poses_);
  score.nees = nees_sum_ / poses_;
  return score;
}

std::string format_table(const std::vector<TransitScore>& scores) {
  std::string table =
      "        |       |       |  distance of chains [cm] |         |       |  things   |  new  | gone  |        pose\n"
      "transit | time  | stops |  mean   sigma   greatest |  false  | cover |  found    | found | found | RMS [mm] "
      "[mrad]  NEES\n";
  std::string notes;
  const auto row = [&table](const char* name, const TransitScore& s, std::size_t sight, std::size_t found,
                            std::size_t appeared, std::size_t appeared_found, std::size_t gone,
                            std::size_t gone_found) {
    char line[256];
    std::snprintf(line, sizeof line,
                  "%7s | %5.1f | %5d | %6.2f  %6.2f  %8.2f  | %5.2f m | %.3f | %3zu of %-3zu| %zu/%-3zu | %zu/%-3zu | "
                  "%7.1f  %6.1f  %5.1f\n",
                  name, s.duration_s, s.stops, 100.0 * s.mean_distance_m, 100.0 * s.sigma_distance_m,
                  100.0 * s.max_distance_m, s.false_m, s.coverage, found, sight, appeared_found, appeared, gone_found,
                  gone, 1000.0 * s.position_rms_m, 1000.0 * s.yaw_rms_rad, s.nees);
    table += line;
  };
  const auto list = [&notes](const TransitScore& s, const char* what, const std::vector<std::string>& names) {
    if (names.empty()) return;
    notes += "transit " + std::to_string(s.transit) + ", " + what + ":";
    for (const std::string& name : names) notes += ' ' + name;
    notes += '\n';
  };
  for (const TransitScore& s : scores) {
    row(std::to_string(s.transit).c_str(), s, s.in_sight.size(), s.in_sight.size() - s.missed.size(), s.appeared.size(),
        s.appeared.size() - s.appeared_missed.size(), s.gone.size(), s.gone.size() - s.gone_left.size());
    list(s, "not on the map", s.missed);
    list(s, "gone and still on the map", s.gone_left);
  }
  return table + notes;
}

}  // namespace situation_awareness
