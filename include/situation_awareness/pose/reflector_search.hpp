// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pose/reflector_map.hpp"

namespace situation_awareness {

/// Parameters of the search for a pose without a guess.
struct ReflectorSearchParams {
  double gate_probability = 0.999;
  int min_matches = 3;
  double min_distance_m = 0.3;
  double min_advantage = 9.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("gate_probability", self.gate_probability, Bounds{0.5, 0.999999}, "",
          "probability that the place of a reflector is inside the gate of the reflector that it is");
    visit("min_matches", self.min_matches, Bounds{3, 100}, "", "least number of reflectors that a pose is found by");
    visit("min_distance_m", self.min_distance_m, Bounds{0.0, 100.0}, "m",
          "least distance of the pairs of reflectors that a search begins with");
    visit("min_advantage", self.min_advantage, Bounds{0.0, 1000.0}, "",
          "a pose is ambiguous if another one has a cost, the sum of squared Mahalanobis distances and of the gate for "
          "each place left unmatched, that is not higher by this");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Place of what may be a reflector in some frame, such as that of a scan or of odometry.
struct ReflectorPlace {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< m^2, positive definite
};

/// What a search has found.
struct ReflectorPose {
  bool is_known = false;
  /// Empty if known, else why it is not: "too few places", "no match", "ambiguous".
  const char* reason = "";
  Pose2 T_world_frame;  ///< the best one, also where it is ambiguous
  /// Covariance of the error e (m, m, rad), T_world_frame exp(e) = truth.
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  std::vector<int> reflectors;  ///< index in the map for each place, or -1
  double cost = 0.0;            ///< sum of squared Mahalanobis distances of the matched places
};

/// Searches the pose of a frame in which the places of reflectors are known, without any guess: two pairs of equal
/// distance give a pose, the other places confirm it, and the pose that explains most is refined by least squares
/// (docs/math/reflectors.md). Poses that explain as much make it ambiguous: reflectors that look the same after a turn,
/// or a pattern that repeats itself. A mirror image is none, since the plane is seen from above.
class ReflectorSearch {
 public:
  /// Most places that are used: the first. The time grows with their square and that of the reflectors.
  static constexpr int kMaxPlaces = 8;

  /// Throws std::invalid_argument as check_reflectors and the params' validate().
  ReflectorSearch(const ReflectorMap& map, const ReflectorSearchParams& params);

  /// Reflectors with a true entry in `excluded` (empty: none) are not matched. No allocation after some calls. The
  /// result is overwritten by the next call.
  const ReflectorPose& find(const std::vector<ReflectorPlace>& places, const std::vector<char>& excluded = {});

 private:
  struct Hypothesis {
    Pose2 T_world_frame;
    Eigen::Matrix3d P;
    double cost;  ///< of matched and unmatched places
    double fit_cost;
    std::vector<int> reflectors;
  };

  bool complete(const std::vector<ReflectorPlace>& places, const std::vector<char>& excluded, Hypothesis& hypothesis);
  bool refine(const std::vector<ReflectorPlace>& places, Hypothesis& hypothesis) const;

  ReflectorMap map_;
  ReflectorSearchParams params_;
  double gate_;
  std::vector<Hypothesis> hypotheses_;  ///< those with different matches; the memory of the others is kept
  std::size_t used_ = 0;
  Hypothesis next_;
  std::vector<char> taken_;
  ReflectorPose result_;
};

/// Pose of a frame by matched places: least squares from the guess, by Gauss-Newton steps until nothing changes.
/// `covariance` is the inverse of the information. Returns the sum of squared Mahalanobis distances, or a negative
/// number if the information is singular (fewer than two reflectors).
double fit_pose(const std::vector<ReflectorPlace>& places, const std::vector<int>& reflectors, const ReflectorMap& map,
                Pose2& T_world_frame, Eigen::Matrix3d& P);

/// Place of a reflector in the frame, T^-1 l, and its Jacobian by the error of the pose.
Eigen::Vector2d place_of(const Pose2& T_world_frame, const Eigen::Vector2d& center_world_m);
Eigen::Matrix<double, 2, 3> place_jacobian(const Eigen::Vector2d& center_frame_m);

}  // namespace situation_awareness
