// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pose/reflector_map.hpp"

namespace situation_awareness {

/// Place of what may be a reflector in some frame, such as that of a scan or of odometry.
struct ReflectorPlace {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< m^2, positive definite
};

/// What a search has found.
struct ReflectorPose {
  bool is_known = false;
  /// Empty if known, else why it is not: "too few places", "no match", "ambiguous", "search not finished".
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
/// or a pattern that repeats itself; and so do matches of which as many may be there by chance. A mirror image is none,
/// since the plane is seen from above.
///
/// A call does a bounded number of steps; a search that needs more is continued by the next calls, with the places that
/// it began with.
class ReflectorSearch {
 public:
  /// Most places that are used: the first.
  static constexpr int kMaxPlaces = 12;

  /// Throws std::invalid_argument as check_reflectors. Time and memory grow with the square
  /// of the reflectors, up to 200 MB.
  explicit ReflectorSearch(const ReflectorMap& map);

  /// Begins a search, or continues the one that is not finished. No allocation after some calls. The result is
  /// overwritten by the next call.
  const ReflectorPose& find(const std::vector<ReflectorPlace>& places);

  /// Gives up the search that is not finished: its frame is no more.
  void begin_anew() { is_searching_ = false; }

 private:
  /// Two reflectors.
  struct Pair {
    float distance_m;
    std::int32_t a, b;
  };

  /// Two places, and the pairs of reflectors that they may be.
  struct Base {
    int i = 0, j = 0;
    std::size_t begin = 0, end = 0;  ///< in pairs_
    double difference_m = 0.0;       ///< in distance, allowed; 0: they are too near
  };

  /// Another place, as seen from a base.
  struct Other {
    int place = 0;
    Eigen::Vector2d p_m = Eigen::Vector2d::Zero();  ///< in the axes of the base, from its middle
    double radius_m = 0.0;                          ///< of a circle around its gate
  };

  struct Hypothesis {
    Pose2 T_world_frame;
    Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
    double cost = 0.0;  ///< of matched and unmatched places
    double fit_cost = 0.0;
    double pairs = 0.0;  ///< of reflectors as far apart as its base, besides
    std::vector<int> reflectors;
  };

  void list_pairs();
  void sort_into_cells();
  void begin(const std::vector<ReflectorPlace>& places);
  Base base_of(int i, int j) const;
  void order_places();
  void begin_base();
  bool is_settled() const;
  double cost_that_counts() const;
  void try_pair(std::int32_t a, std::int32_t b);
  template <class Act>
  void for_each_within(const Eigen::Vector2d& p_world_m, double radius_m, const Act& act);
  bool complete(Hypothesis& hypothesis);
  void remember();
  double share_there(std::size_t run) const;
  double log_expected(const Hypothesis& hypothesis) const;
  double expected_by_chance(int matches) const;
  const ReflectorPose& conclude();

  ReflectorMap map_;
  double gate_, far_gate_;
  std::vector<Pair> pairs_;                                                             ///< by ascending distance
  Eigen::Vector2d low_m_ = Eigen::Vector2d::Zero(), size_m_ = Eigen::Vector2d::Zero();  ///< of the map
  double cell_m_ = 1.0;
  int columns_ = 1, rows_ = 1;
  std::vector<std::int32_t> cell_begins_, in_cells_;  ///< of the reflectors, cell after cell

  bool is_searching_ = false;
  std::vector<ReflectorPlace> places_;
  std::vector<int> order_;       ///< of places_
  std::size_t base_number_ = 0;  ///< of the base, in the order of pairs of those
  Base base_;
  std::size_t next_pair_ = 0;   ///< of the base, two for each of pairs_: one each way round
  std::vector<Other> others_;   ///< of the base, those that are known best first
  std::int64_t steps_ = 0;      ///< of this call
  double pairs_of_base_ = 0.0;  ///< of reflectors as far apart, besides
  std::size_t telling_ = 0;     ///< so many others of the base are in a circle that is mostly empty
  /// Tries of all bases in which the first others were there and another one of those was looked for, those in which it
  /// was there too, and bases with so many.
  std::array<std::int64_t, kMaxPlaces> looked_for_{}, there_{}, telling_bases_{};
  double density_1_m2_ = 0.0;  ///< of reflectors

  std::vector<Hypothesis> hypotheses_;  ///< different poses, the best first; the memory of the others is kept
  std::size_t used_ = 0;
  Hypothesis next_;
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
