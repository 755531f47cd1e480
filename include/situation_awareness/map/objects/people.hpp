// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/existence.hpp"
#include "situation_awareness/map/objects/map_element.hpp"
#include "situation_awareness/map/objects/motion_models.hpp"
#include "situation_awareness/map/objects/object_map_params.hpp"

namespace situation_awareness {

// Persons by their legs (docs/math/people.md): one element with the middle of two legs as its position, which takes up
// to two detections per scan.
//
//   symbol  meaning                                                                     space  code
//   c, v    middle of the legs, which is the element's position, and its velocity       R^2    MapElement::estimate
//   o       half of the way from the second leg to the first, which are at c + o, c - o R^2    leg_offset_world_m
//   s^2     variance of the error of o, per axis                                        R      leg_offset_variance_m2

/// Motion of a person, from that of other elements.
MotionParams motion_of_person(const MotionParams& motion);

/// Time update of the legs of a person: o is an Ornstein-Uhlenbeck process about zero.
void predict_legs(MapElement& element, double dt_s);

/// What one scan shows of a person.
struct SeenLegs {
  std::size_t element = 0;
  Measurement middle;
  Measurement view;        ///< the same without what is not known of a hidden leg
  Detection as_detection;  ///< its beams and flags; those of the middle where it is of both legs
  std::array<int, 2> columns{-1, -1};
  int legs = 0;  ///< 2: both, each for itself
};

/// Tracks persons by their legs; it has no state but reusable memory.
class People {
 public:
  /// The legs that the measurements of a scan may be: those of the detections, in their order, and then of its small
  /// segments.
  void see(const Detections& detections, const std::vector<Measurement>& measurements);

  /// Pairs of the legs of persons with what may be them, at their costs: for the assignment with the elements. Rows
  /// from elements.size() on are legs of persons, columns from the number of measurements on are small segments.
  void find_candidates(const std::vector<MapElement>& elements, const std::vector<ExpectedDetection>& expected,
                       const Pose2& T_world_level, const Eigen::Matrix3d& U, const ObjectMapParams& params,
                       double gate);
  const std::vector<Candidate>& candidates() const { return candidates_; }
  int rows() const { return rows_; }
  int columns() const { return static_cast<int>(legs_.size()); }

  /// What the assignment (column of each row, or -1) gave to the persons, those that were seen; updates their legs.
  const std::vector<SeenLegs>& update_legs(const std::vector<int>& column_of_row, const Pose2& T_world_level,
                                           std::int64_t stamp_ns, double step_s, std::vector<MapElement>& elements);

  /// True if a detection without an element may be a leg of a person, of whom only one leg was seen.
  bool may_be_leg(std::size_t detection, const std::vector<MapElement>& elements) const;

  /// Pairs of leg-sized elements that are the legs of one person become one element, a person: the older one, or a
  /// person that was lost; the other's state is then kDeleted. `elements` are updated at `stamp_ns`.
  void join_legs(std::int64_t stamp_ns, double step_s, const MotionParams& motion, double gate,
                 std::vector<MapElement>& elements);

 private:
  /// What may be a leg, or two legs side by side.
  struct Leg {
    Measurement measurement;
    Eigen::Vector2d center_world_m = Eigen::Vector2d::Zero();
    int beams = 0;
    bool has_shape = false;
    bool is_ellipse = false;  ///< rather than a box
    bool may_be_one = false;
    bool may_be_both = false;
  };
  /// Of `candidates_`.
  enum class Part : std::uint8_t { kFirst, kSecond, kBoth };
  struct Foot {
    std::size_t element;
    Eigen::Vector2d center_m;
    bool has_parted = false;  ///< what was seen as one thing is now a leg of two
    bool is_leg_sized = false;
  };

  void take_legs(std::int64_t stamp_ns, std::vector<MapElement>& elements) const;
  void step_about(const Foot& foot, std::int64_t stamp_ns, double step_s, const MotionParams& motion, double gate,
                  std::vector<MapElement>& elements);
  void find_owners(const std::vector<int>& column_of_row);
  bool is_both_in_one(std::size_t person) const;
  void find_both_in_one(std::int64_t stamp_ns, const std::vector<MapElement>& elements);
  bool is_free(std::size_t column, std::int64_t stamp_ns, const std::vector<MapElement>& elements) const;
  void find_missing_legs(std::int64_t stamp_ns, const std::vector<MapElement>& elements);
  static void become_person(MapElement& foot, const Eigen::Vector2d& middle_m, const Eigen::Vector2d& offset_m,
                            double pair_log_odds, const MotionParams& motion, double gate, std::int64_t stamp_ns,
                            std::vector<MapElement>& elements);
  static void become_one_person(MapElement& a, MapElement& b, const Eigen::Vector2d& middle_m,
                                const Eigen::Vector2d& offset_m, double pair_log_odds, const MotionParams& motion,
                                double gate, std::int64_t stamp_ns, std::vector<MapElement>& elements);
  static MapElement* who_may_be_at(const ObjectEstimate& middle_world, double gate, std::int64_t stamp_ns,
                                   std::vector<MapElement>& elements);
  static void come_back(MapElement& foot, const ObjectEstimate& middle_world, MapElement& person,
                        std::int64_t stamp_ns);
  static bool is_leg_of_lost(MapElement& foot, double gate, std::int64_t stamp_ns, std::vector<MapElement>& elements);
  void find_feet(std::int64_t stamp_ns, const std::vector<MapElement>& elements);
  bool has_parted(const MapElement& element, int column, std::int64_t stamp_ns) const;
  std::size_t nearest_foot(std::size_t foot, double max_m, double& second_nearest_m) const;

  std::vector<Leg> legs_;             ///< of the columns
  std::vector<std::size_t> by_x_;     ///< legs_, by x
  std::vector<std::size_t> persons_;  ///< elements
  std::vector<Candidate> candidates_;
  std::vector<Part> parts_;  ///< of the candidates
  int rows_ = 0;
  std::size_t first_row_ = 0;
  std::vector<SeenLegs> seen_;
  /// A leg that a person may miss.
  struct Missing {
    double distance_m;
    std::size_t person;  ///< of persons_
    std::size_t leg;
  };
  std::vector<int> row_of_column_;                     ///< or -1
  std::vector<int> column_of_row_;                     ///< or -1
  std::vector<std::array<int, 2>> columns_of_person_;  ///< of persons_
  std::vector<Missing> missing_;
  std::vector<std::size_t> robbed_;  ///< elements whose detections are legs of persons
  std::vector<Foot> feet_;           ///< leg-sized elements, by x
};

}  // namespace situation_awareness
