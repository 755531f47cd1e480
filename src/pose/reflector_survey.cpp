// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_survey.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <Eigen/Cholesky>

#include "reflector_survey_solution.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

/// Without scans a key is made after so many times the way, or the turning, of one with a scan.
constexpr double kWithoutScan = 3.0;
/// A new reflector is outside this gate of all others.
constexpr double kSurveyGateProbability = 0.99999;
/// What was seen so often at most is given up when it has not been seen for so many keys.
constexpr int kRareSightings = 2, kRareKeys = 20;
/// Most of yaw_scale_sigma that is used: the error of scale is one of the turns that odometry says, noise included,
/// which on a straight way pull it to -1. With 0.1 distances along a corridor are wrong by 11 mm at worst, with 0.02 by
/// 4 mm.
constexpr double kMostYawScaleSigma = 0.02;
/// Beams that end within this distance of a reflector's surface end on it; that end behind it by more pass through.
constexpr double kOnIt_m = 0.08;
/// Part of a reflector's width whose beams are looked at.
constexpr double kMiddlePart = 0.7;
/// A sighting with fewer beams between it and the end of the view may be cut.
constexpr double kCutBeams = 3.0;
/// Rounds of adjusting and leaving out what is no reflector.
constexpr int kMaxRounds = 6;

std::string sentence_of(const char* format, double value) {
  char text[200];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace

void ReflectorSurveyParams::validate() const {
  check_bounds(*this, "survey");
  wheels.validate();
  odometry.validate();
}

ReflectorSurvey::ReflectorSurvey(const ReflectorSurveyParams& params, const Pose2& T_world_base)
    : params_(params), gate_(0.0), far_gate_(0.0), track_(params.odometry) {
  params_.validate();
  params_.wheels.yaw_scale_sigma = std::min(params_.wheels.yaw_scale_sigma, kMostYawScaleSigma);
  gate_ = chi_square_quantile(params_.gate_probability, 2);
  far_gate_ = chi_square_quantile(std::max(kSurveyGateProbability, params_.gate_probability), 2);
  x_.T_world_base = T_world_base;
  P_ = Eigen::MatrixXd::Zero(5, 5);
  P_(3, 3) = params_.wheels.distance_scale_sigma * params_.wheels.distance_scale_sigma;
  P_(4, 4) = params_.wheels.yaw_scale_sigma * params_.wheels.yaw_scale_sigma;
}

// --- on the way ------------------------------------------------------------------------------------------------------

OdometryTrack::Verdict ReflectorSurvey::add_odometry(std::int64_t stamp_ns, const Pose2& T_odom_base,
                                                     std::int64_t received_ns) {
  const OdometryTrack::Verdict verdict = track_.add(stamp_ns, T_odom_base, received_ns);
  was_restarted_ = was_restarted_ || verdict == OdometryTrack::Verdict::kRestarted;
  // Where there are no scans, such as where the robot turns with its scanner off.
  if (verdict == OdometryTrack::Verdict::kAdded && has_key_) {
    const Pose2 u = inverse(at_.T_track_base) * track_.latest().T_track_base;
    if (u.translation_m.norm() >= kWithoutScan * params_.key_distance_m ||
        std::abs(u.yaw_rad) >= kWithoutScan * params_.key_turn_rad) {
      begin_key(track_.latest());
    }
  }
  return verdict;
}

void ReflectorSurvey::begin_key(const OdometryTrack::Entry& at) {
  Key key;
  if (has_key_) {
    key.u = inverse(at_.T_track_base) * at.T_track_base;
    key.jumps = at.jumps - at_.jumps;
    way_m_ += key.u.translation_m.norm();
    predict(key.u, key.jumps);
  }
  key.T_world_base = x_.T_world_base;
  has_key_ = true;
  at_ = at;
  keys_.push_back(std::move(key));
}

// An error w of the pose in its own frame is one of the whole world about the robot: of the pose, and the opposite one
// of all reflectors, which have not moved.
Eigen::MatrixXd ReflectorSurvey::error_of_own(const Pose2& T_world_base) const {
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(P_.rows(), 3);
  G.topRows<3>() = adjoint_se2(T_world_base);
  for (Eigen::Index i = 0; i < centers_m_.size(); i += 2) {
    G(5 + i, 2) = centers_m_(i + 1);
    G(6 + i, 2) = -centers_m_(i);
  }
  return G;
}

void ReflectorSurvey::predict(const Pose2& u, int jumps) {
  const Eigen::Matrix<double, 6, 6> Q = odometry_noise(u, params_.wheels);
  Eigen::Matrix3d of_pose = Q.topLeftCorner<3, 3>();
  const Eigen::Vector3d jump(params_.wheels.jump_sigma_m, params_.wheels.jump_sigma_m, params_.wheels.jump_sigma_rad);
  of_pose.diagonal() += jumps * jump.cwiseAbs2();
  const Eigen::Matrix<double, 3, 2> J_own_s = moved_by_odometry_jacobian(x_, u, u.yaw_rad).block<3, 2>(0, 3);
  x_ = moved_by_odometry(x_, u, u.yaw_rad);
  const Eigen::MatrixXd G = error_of_own(x_.T_world_base);
  // F P F^T + G Q G^T with F = I but for the columns of the scales.
  const Eigen::MatrixXd of_scales = G * J_own_s, noise = G * of_pose;
  const Eigen::MatrixXd scale_rows = P_.middleRows<2>(3);
  P_.noalias() += of_scales * scale_rows;
  const Eigen::MatrixXd scale_columns = P_.middleCols<2>(3);
  P_.noalias() += scale_columns * of_scales.transpose();
  P_.noalias() += noise * G.transpose();
  P_.diagonal().segment<2>(3) += Q.diagonal().segment<2>(3);
}

Eigen::Vector2d ReflectorSurvey::center_of(const Found& found) const {
  return centers_m_.segment<2>(2 * static_cast<Eigen::Index>(found.place));
}

// Squared Mahalanobis distance. A sighting is of the difference of the reflector and the robot's place alone.
double ReflectorSurvey::distance2(const Found& found, const Sighting& sighting) const {
  const Eigen::Index at = 5 + 2 * static_cast<Eigen::Index>(found.place);
  const Eigen::Matrix2d J = place_by_center_jacobian(x_.T_world_base, sighting.T_base_lidar, center_of(found));
  const Eigen::Matrix2d of_difference =
      P_.block<2, 2>(0, 0) + P_.block<2, 2>(at, at) - P_.block<2, 2>(0, at) - P_.block<2, 2>(at, 0);
  const Eigen::Matrix2d S = J * of_difference * J.transpose() + sighting.R;
  const Eigen::Vector2d nu = residual_of(sighting.z, x_.T_world_base, sighting.T_base_lidar, center_of(found));
  return nu.dot(S.llt().solve(nu));
}

void ReflectorSurvey::correct(std::size_t found, const Sighting& sighting) {
  const Eigen::Index at = 5 + 2 * static_cast<Eigen::Index>(found_[found].place);
  const Eigen::Vector2d center_m = center_of(found_[found]);
  const Eigen::Matrix2d J = place_by_center_jacobian(x_.T_world_base, sighting.T_base_lidar, center_m);
  const Eigen::Vector2d nu = residual_of(sighting.z, x_.T_world_base, sighting.T_base_lidar, center_m);
  const Eigen::MatrixXd PHt = (P_.middleCols<2>(at) - P_.leftCols<2>()) * J.transpose();
  const Eigen::Matrix2d S = J * (PHt.middleRows<2>(at) - PHt.topRows<2>()) + sighting.R;
  const Eigen::MatrixXd K = PHt * S.inverse();
  const Eigen::VectorXd e = K * nu;
  // Joseph's form, P - K H P - P H^T K^T + K S K^T: the square of the reflectors, where its matrices take their cube.
  const Eigen::MatrixXd half = 0.5 * K * S - PHt;
  P_.noalias() += half * K.transpose();
  P_.noalias() += K * half.transpose();
  const Pose2 turn{{0.0, 0.0}, e(2)};
  x_.T_world_base = turn * x_.T_world_base;
  x_.T_world_base.translation_m += e.head<2>();
  x_.scale_error += e.segment<2>(3);
  for (Eigen::Index i = 0; i < centers_m_.size(); i += 2) {
    centers_m_.segment<2>(i) = turn * Eigen::Vector2d(centers_m_.segment<2>(i)) + e.segment<2>(5 + i);
  }
}

// A reflector that was not known: its error is that of the pose and of the sighting.
void ReflectorSurvey::start(const Sighting& sighting) {
  const Eigen::Vector2d along(std::cos(sighting.z(1)), std::sin(sighting.z(1)));
  const Eigen::Vector2d center_m = x_.T_world_base * (sighting.T_base_lidar * (sighting.z(0) * along));
  const Eigen::Matrix2d J_z_l = place_by_center_jacobian(x_.T_world_base, sighting.T_base_lidar, center_m);
  const Eigen::Matrix2d J_l_z = J_z_l.inverse();
  const Eigen::Index n = P_.cols();
  Eigen::MatrixXd grown(n + 2, n + 2);
  grown.topLeftCorner(n, n) = P_;
  grown.bottomLeftCorner(2, n) = P_.topRows<2>();
  grown.topRightCorner(n, 2) = grown.bottomLeftCorner(2, n).transpose();
  grown.bottomRightCorner<2, 2>() = P_.topLeftCorner<2, 2>() + J_l_z * sighting.R * J_l_z.transpose();
  P_ = std::move(grown);
  Found found;
  found.place = static_cast<int>(centers_m_.size() / 2);
  found.first_key = static_cast<int>(keys_.size()) - 1;
  centers_m_.conservativeResize(centers_m_.size() + 2);
  centers_m_.tail<2>() = center_m;
  found_.push_back(found);
}

// What was seen once or twice, such as a walker's trousers, does not stay in the filter.
void ReflectorSurvey::give_up_rare() {
  const int now = static_cast<int>(keys_.size()) - 1;
  for (Found& found : found_) {
    if (found.place < 0 || found.sightings > kRareSightings || now - found.latest_key < kRareKeys) continue;
    found.center_world_m = center_of(found);
    const Eigen::Index begin = 5 + 2 * static_cast<Eigen::Index>(found.place), behind = P_.cols() - begin - 2;
    P_.middleRows(begin, behind) = P_.bottomRows(behind).eval();
    P_.middleCols(begin, behind) = P_.rightCols(behind).eval();
    P_.conservativeResize(P_.rows() - 2, P_.cols() - 2);
    centers_m_.segment(begin - 5, behind) = centers_m_.tail(behind).eval();
    centers_m_.conservativeResize(centers_m_.size() - 2);
    for (Found& other : found_) other.place -= other.place > found.place ? 1 : 0;
    found.place = -1;
  }
}

void ReflectorSurvey::add(const ReflectorSightings& sightings, const Pose2& T_base_lidar) {
  OdometryTrack::Entry now;
  if (was_restarted_ || !track_.at(sightings.stamp_ns, now)) return;
  if (has_key_) {
    // Near to the key before a scan has the errors of that one's.
    if (now.stamp_ns <= at_.stamp_ns) return;
    const Pose2 u = inverse(at_.T_track_base) * now.T_track_base;
    if (u.translation_m.norm() < params_.key_distance_m && std::abs(u.yaw_rad) < params_.key_turn_rad) return;
  }
  begin_key(now);
  keys_.back().T_base_lidar = T_base_lidar;
  keys_.back().free = sightings.free;

  struct Open {
    Sighting sighting;
    Eigen::Matrix2d white;
  };
  std::vector<Open> open;
  for (const ReflectorSighting& seen : sightings.sightings) {
    const ReflectorFit fit = fit_reflector(sightings, seen, params_.radius_m);
    OdometryTrack::Entry then;
    if (!fit.is_width_plausible || !track_.at(sightings.stamp_ns + nanoseconds(seen.time_offset_s), then)) continue;
    const Pose2 u = inverse(now.T_track_base) * then.T_track_base;
    ReflectorState scaled;
    scaled.scale_error = x_.scale_error;
    const Pose2 T_base_then_lidar = moved_by_odometry(scaled, u, u.yaw_rad).T_world_base * T_base_lidar;
    Eigen::Matrix2d R = fit.covariance;
    const double model_m2 = params_.model_sigma_m * params_.model_sigma_m;
    R(0, 0) += model_m2;
    R(1, 1) += model_m2 / (fit.range_m * fit.range_m);
    // Of the wheels since the stamp, as errors of the pose.
    const Eigen::Vector2d center_m =
        x_.T_world_base *
        (T_base_then_lidar * (fit.range_m * Eigen::Vector2d(std::cos(fit.azimuth_rad), std::sin(fit.azimuth_rad))));
    const Eigen::Matrix<double, 2, 3> H = observed_reflector_jacobian(x_.T_world_base, T_base_then_lidar, center_m);
    R += H * odometry_noise(u, params_.wheels).topLeftCorner<3, 3>() * H.transpose();
    open.push_back({{0, {fit.range_m, fit.azimuth_rad}, R, T_base_then_lidar}, fit.white});
  }

  // The clearest first; each makes the others clearer.
  std::vector<char> taken(found_.size(), 0);
  const auto known = found_.size();
  while (!open.empty()) {
    std::size_t best = open.size(), best_found = 0;
    double best_advantage = -1.0;
    for (std::size_t i = 0; i < open.size(); ++i) {
      double least = std::numeric_limits<double>::infinity(), second = 4.0 * far_gate_;
      std::size_t nearest = 0;
      for (std::size_t k = 0; k < known; ++k) {
        if (found_[k].place < 0 || taken[k] != 0) continue;
        const double d2 = distance2(found_[k], open[i].sighting);
        if (d2 < least) {
          second = std::min(second, least);
          least = d2;
          nearest = k;
        } else {
          second = std::min(second, d2);
        }
      }
      const double advantage = second - least;
      if (!(least <= gate_) || advantage < params_.min_advantage || advantage <= best_advantage) continue;
      best = i;
      best_found = nearest;
      best_advantage = advantage;
    }
    if (best == open.size()) break;
    Sighting sighting = open[best].sighting;
    sighting.reflector = best_found;
    Found& found = found_[best_found];
    const double azimuth_rad = observed_reflector(x_.T_world_base, sighting.T_base_lidar, center_of(found))(1);
    sighting.R = found.beams.new_covariance(sighting.R, open[best].white, azimuth_rad, sightings.resolution_rad);
    taken[best_found] = 1;
    found.latest_key = static_cast<int>(keys_.size()) - 1;
    ++found.sightings;
    if (sighting.R.allFinite()) {
      correct(best_found, sighting);
      keys_.back().sightings.push_back(sighting);
    }
    open.erase(open.begin() + static_cast<std::ptrdiff_t>(best));
  }
  for (const Open& left : open) {
    const auto near = [&](const Found& found) {
      if (found.place < 0) return false;
      const Eigen::Vector2d along(std::cos(left.sighting.z(1)), std::sin(left.sighting.z(1)));
      const Eigen::Vector2d place_m = x_.T_world_base * (left.sighting.T_base_lidar * (left.sighting.z(0) * along));
      return (place_m - center_of(found)).norm() < params_.min_separation_m ||
             distance2(found, left.sighting) < far_gate_;
    };
    if (std::any_of(found_.begin(), found_.end(), near)) continue;
    start(left.sighting);
    Found& found = found_.back();
    found.sightings = 1;
    found.latest_key = found.first_key;
    found.beams.used(left.sighting.z(1));
    keys_.back().sightings.push_back(left.sighting);
    keys_.back().sightings.back().reflector = found_.size() - 1;
  }
  keys_.back().T_world_base = x_.T_world_base;
  give_up_rare();
}

// --- at the end ------------------------------------------------------------------------------------------------------

// Leaves out what is no reflector to localise by.
void ReflectorSurvey::judge(Solution& solution) const {
  std::vector<int> latest(found_.size(), -1), bright(found_.size(), 0), dim(found_.size(), 0),
      through(found_.size(), 0);
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    for (const Sighting& sighting : keys_[i].sightings) {
      latest[solution.same_as[sighting.reflector]] = static_cast<int>(i);
    }
  }
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    const Key& key = keys_[i];
    const std::vector<float>& azimuths = key.free.azimuth_rad;
    if (azimuths.size() < 2) continue;
    for (const std::size_t j : solution.used) {
      const Eigen::Vector2d z = observed_reflector(solution.T_world_base[i], key.T_base_lidar, solution.centers_m[j]);
      if (z(0) > params_.max_view_m || z(0) < params_.radius_m + 0.1) continue;
      const bool is_bright = std::any_of(key.sightings.begin(), key.sightings.end(), [&](const Sighting& sighting) {
        return solution.same_as[sighting.reflector] == j;
      });
      if (is_bright) {
        ++bright[j];
        continue;
      }
      double azimuth_rad = z(1);
      while (azimuth_rad < azimuths.front()) azimuth_rad += 2.0 * kPi;
      while (azimuth_rad - 2.0 * kPi >= azimuths.front()) azimuth_rad -= 2.0 * kPi;
      const double whole_rad = std::asin(std::min(1.0, params_.radius_m / z(0)));
      const double half_rad = kMiddlePart * whole_rad;
      const auto begin = std::lower_bound(azimuths.begin(), azimuths.end(), static_cast<float>(azimuth_rad - half_rad));
      const auto end = std::upper_bound(begin, azimuths.end(), static_cast<float>(azimuth_rad + half_rad));
      // At the ends of the view a sighting is cut.
      const double margin_rad = whole_rad + kCutBeams * std::abs(azimuths[1] - azimuths[0]);
      if (azimuth_rad - margin_rad < azimuths.front() || azimuth_rad + margin_rad > azimuths.back() || begin == end) {
        continue;
      }
      const auto all = [&](auto is) {
        return std::all_of(key.free.range_m.begin() + (begin - azimuths.begin()),
                           key.free.range_m.begin() + (end - azimuths.begin()), is);
      };
      const double surface_m = z(0) - params_.radius_m;
      if (all([&](float range_m) { return std::abs(range_m - surface_m) < kOnIt_m; })) ++dim[j];
      const double behind_m = z(0) + params_.radius_m + kOnIt_m;
      if (static_cast<int>(i) > latest[j] && all([&](float range_m) { return range_m > behind_m; })) ++through[j];
    }
  }
  std::vector<int> sightings(found_.size(), 0);
  for (const Key& key : keys_) {
    for (const Sighting& sighting : key.sightings) ++sightings[solution.same_as[sighting.reflector]];
  }
  for (const std::size_t j : solution.used) {
    if (solution.same_as[j] != j) continue;
    solution.bright_part[j] = bright[j] / std::max(1.0, static_cast<double>(bright[j] + dim[j]));
    if (sightings[j] < params_.min_sightings) {
      solution.refused[j] = "seen too seldom";
    } else if (solution.bright_part[j] < params_.min_bright_part) {
      solution.refused[j] = "not always bright";
    } else if (through[j] >= params_.gone_scans) {
      solution.refused[j] = "gone";
    } else if (solution.nis[j] > params_.max_nis) {
      solution.refused[j] = "does not stand still";
    }
  }
}

ReflectorSurveyResult ReflectorSurvey::solve() const {
  ReflectorSurveyResult result;
  result.way_m = way_m_;
  if (was_restarted_) {
    result.reason = "the stamps of odometry go back: a survey is of one drive";
    return result;
  }
  if (track_.empty()) {
    result.reason = "there is no odometry";
    return result;
  }
  if (keys_.size() < 2) {
    result.reason = keys_.empty() ? "no scan has odometry" : "the robot did not move";
    return result;
  }
  Solution solution;
  solution.scale_error = x_.scale_error;
  for (const Key& key : keys_) solution.T_world_base.push_back(key.T_world_base);
  for (std::size_t j = 0; j < found_.size(); ++j) {
    const bool is_kept = found_[j].place >= 0;
    solution.centers_m.push_back(is_kept ? center_of(found_[j]) : found_[j].center_world_m);
    solution.same_as.push_back(j);
    solution.refused.push_back(is_kept && found_[j].sightings > kRareSightings ? nullptr : "seen too seldom");
  }
  solution.sightings.assign(found_.size(), 0);
  solution.nis.assign(found_.size(), 0.0);
  solution.bright_part.assign(found_.size(), 0.0);
  for (int round = 0; round < kMaxRounds; ++round) {
    solution = adjust(solution);
    const std::size_t used = solution.used.size();
    merge(solution);
    judge(solution);
    const auto left = std::count_if(solution.used.begin(), solution.used.end(), [&](std::size_t j) {
      return solution.same_as[j] == j && solution.refused[j] == nullptr;
    });
    if (static_cast<std::size_t>(left) == used) break;
  }
  result.T_world_base = solution.T_world_base;
  result.scale_error = solution.scale_error;
  for (std::size_t j = 0; j < found_.size(); ++j) {
    if (solution.same_as[j] == j && solution.refused[j] != nullptr && found_[j].sightings > kRareSightings) {
      result.refused.push_back({solution.centers_m[j], found_[j].sightings, solution.refused[j]});
    }
  }
  for (std::size_t a = 0; a < solution.used.size(); ++a) {
    const std::size_t j = solution.used[a];
    const auto at = [](std::size_t i) { return 2 * static_cast<Eigen::Index>(i); };
    result.reflectors.push_back({{solution.centers_m[j], params_.radius_m},
                                 solution.covariance.block<2, 2>(at(a), at(a)),
                                 solution.sightings[j],
                                 solution.nis[j],
                                 solution.bright_part[j]});
    for (std::size_t b = 0; b < a; ++b) {
      const Eigen::Vector2d along = (solution.centers_m[j] - solution.centers_m[solution.used[b]]).normalized();
      const Eigen::Matrix2d S =
          solution.covariance.block<2, 2>(at(a), at(a)) + solution.covariance.block<2, 2>(at(b), at(b)) -
          solution.covariance.block<2, 2>(at(a), at(b)) - solution.covariance.block<2, 2>(at(b), at(a));
      result.distance_sigma_m = std::max(result.distance_sigma_m, std::sqrt(std::max(0.0, along.dot(S * along))));
    }
  }
  if (result.reflectors.empty()) {
    result.reason = "nothing was seen to be a reflector in " + std::to_string(params_.min_sightings) + " scans or more";
  } else if (result.reflectors.size() == 1) {
    result.reason = "only one reflector was found, and a pose needs two or more in sight";
  } else if (!(result.distance_sigma_m <= params_.max_distance_sigma_m)) {
    result.reason = sentence_of(
        "the drive does not tell the distances of the reflectors: one has a standard deviation of "
        "%.3f m; drive so that two or more are in sight everywhere, and return to the start",
        result.distance_sigma_m);
  } else if (solution.odometry_nis > params_.max_nis) {
    result.reason = sentence_of(
        "sightings and odometry contradict each other: mean squared error %.1f of what odometry "
        "should have (wheels that slip, or another set of parameters is needed)",
        solution.odometry_nis);
  }
  if (!result.reason.empty()) return result;
  for (const SurveyedReflector& surveyed : result.reflectors) result.map.reflectors.push_back(surveyed.reflector);
  return result;
}

}  // namespace situation_awareness
