// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/geometry/ellipses_by_x.hpp"
#include "situation_awareness/map/objects/association.hpp"
#include "situation_awareness/map/objects/bodies.hpp"
#include "situation_awareness/map/objects/existence.hpp"
#include "situation_awareness/map/objects/map_element.hpp"
#include "situation_awareness/map/objects/map_snapshot.hpp"
#include "situation_awareness/map/objects/motion_models.hpp"
#include "situation_awareness/map/objects/object_map_params.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/objects/people.hpp"
#include "situation_awareness/map/objects/re_identification.hpp"
#include "situation_awareness/map/objects/resting_elements.hpp"

namespace situation_awareness {

/// Report of one update.
struct ObjectMapUpdate {
  std::vector<std::uint64_t> updated;  ///< ids
  std::vector<std::uint64_t> created;  ///< ids
  std::vector<std::uint64_t> deleted;  ///< ids
  Counters reasons;                    ///< of deleted elements, rejected matches or a dropped update
  std::uint64_t matches = 0;           ///< detections that corrected an element
  double mahalanobis2 = 0.0;           ///< sum of their squared Mahalanobis distances, each under the likelier motion
  double log_likelihood = 0.0;         ///< of the detections of `updated` and `created`: for tuning the filter
};

/// The semantic map of ellipses: for each element an EKF under two motions (ellipse paper, Sect. V; circle paper,
/// Sect. V-B) and a probability of existence, written out in docs/math/objects.md. The elements are independent given
/// the robot's pose, which is an input with a covariance, so the cost is linear in the number of elements: of an update
/// of those near what the scan sees and of those that were seen lately, of at() and snapshot() of all. These two
/// predict elements that were left out meanwhile, so that no other thread may use the map at the same time.
class ObjectMap {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit ObjectMap(const ObjectMapParams& params);

  /// Other parameters from the next update on; elements are kept. Throws std::invalid_argument naming field and bound,
  /// and for another shape; the old parameters are then kept.
  void set_params(const ObjectMapParams& params);

  /// Predict to the stamp of the detections, associate one to one, update, apply missed detections, create new
  /// elements, join parts of bodies, delete elements. None of the detections has a detection_defect, and their pose is
  /// finite. `memory`: a report no longer needed, whose memory this one reuses: no allocation after warm-up, except for
  /// more elements or detections than before.
  ObjectMapUpdate update(const Detections& detections, ObjectMapUpdate memory = {});

  /// The map at any time from the latest update on, by prediction of up to an hour (earlier times: as of the latest
  /// update). Elements that are not confirmed, and those that are part of another, are left out.
  Objects at(std::int64_t stamp_ns, Objects memory = {}) const;

  /// Number of elements, on the map or not.
  std::size_t size() const { return elements_.size() + resting_.size(); }

  /// Stamp of the latest update, kNoStamp before the first.
  std::int64_t stamp_ns() const { return order_.latest_ns(); }
  static constexpr std::int64_t kNoStamp = StampOrder::kNone;

  /// As StampOrder::trust, where another has judged the stamps.
  void trust_stamps() { order_.trust(); }

  /// Delete everything and restart at any time. Ids continue.
  void reset();

  /// The whole state; `world_frame` is left empty. Before the first update `stamp_ns` is kNoStamp.
  MapSnapshot snapshot() const;

  /// Replace the state by the snapshot; later updates give bit for bit the same as in the original map. New ids are
  /// larger than those of both maps. Throws std::invalid_argument as MapSnapshot::validate, or if the snapshot has
  /// another shape; this map is then unchanged.
  void restore(const MapSnapshot& snapshot);

  /// The same at another time and maybe another pose of the robot, as if no time had passed since the snapshot: all its
  /// stamps are shifted to the latest update of this map, if there was one, and then to the next, whatever its stamp.
  /// In that update elements are where they were, and the old pose of the robot is not used.
  void resume(const MapSnapshot& snapshot);

 private:
  enum class Advance { kRefused, kNoStep, kOneStep };

  /// An element that was not detected in this scan.
  struct Unseen {
    double x_m;
    std::size_t element;
  };

  /// Reused memory without meaning between updates.
  struct Workspace {
    ScanNeeds needs;
    std::size_t of_known = 0;       ///< detections of elements that were confirmed before this scan
    std::vector<Unseen> unseen;     ///< by x
    double largest_unseen_m = 0.0;  ///< radius
    std::vector<Measurement> measurements;
    std::vector<char> used;  ///< measurements
    EllipsesByX recently_seen;
    EllipsesByX seen_now;
    EllipsesByX standing;
    CommonShapes common_shapes;
    std::vector<ExpectedDetection> expected;  ///< of the elements
    People people;
    Associator associator;
    std::vector<std::size_t> newly_confirmed;  ///< elements
    BodyJoiner body_joiner;
    std::vector<char> dropped;        ///< elements
    std::vector<std::size_t> pieces;  ///< elements that are pieces of larger ones
  };

  /// kRefused, and the map unchanged, if the stamp is refused (StampOrder); kNoStep if no time has passed for the
  /// elements.
  Advance advance_to(std::int64_t stamp_ns, ObjectMapUpdate& report);
  void settle(const Detections& detections, const Eigen::Matrix3d& U, std::int64_t previous_ns);
  void predict_elements();
  void wake_all();
  /// By ascending id, those at rest as of their own times.
  template <class Visit>
  void for_each_element(Visit&& visit) const {
    auto resting = resting_.by_id().begin();
    const auto end = resting_.by_id().end();
    for (const MapElement& element : elements_) {
      for (; resting != end && resting->id < element.id; ++resting) visit(resting_.element(*resting));
      visit(element);
    }
    for (; resting != end; ++resting) visit(resting_.element(*resting));
  }
  void move_stamps_to(std::int64_t stamp_ns);
  void clear();
  Eigen::Matrix3d robot_covariance(const Detections& detections);
  void adapt_noise(double mahalanobis2);
  Measurement widened(const Detection& detection) const;
  void update_matched(const Detections& detections, const Eigen::Matrix3d& U, ObjectMapUpdate& report);
  void update_persons(const Detections& detections, const Eigen::Matrix3d& U, ObjectMapUpdate& report);
  void update_missed();
  void map_unmatched(const Detections& detections, const Eigen::Matrix3d& U, ObjectMapUpdate& report);
  MapElement* element_to_reinitialize(const Detection& detection, const Measurement& measurement,
                                      const Pose2& T_world_level);
  void find_unseen();
  bool explains_most(const Detections& detections);
  void correct(MapElement& element, const Detection& detection, const Measurement& measurement,
               const Eigen::Matrix3d& U, const Pose2& T_world_level) const;
  MotionEstimate new_estimate(const Measurement& measurement, const Pose2& T_world_level,
                              const Eigen::Matrix3d& U) const;
  bool has_travelled(const MapElement& element) const;
  void observe(MapElement& element, const Detection& detection, const Measurement& measurement,
               const Pose2& T_world_level) const;
  void confirm_if_due(std::size_t element, const Detection& detection);
  EllipsesByX seen_within(double past_s, EllipsesByX memory) const;
  EllipsesByX standing(EllipsesByX memory) const;
  MotionParams motion_of(const MapElement& element) const;
  void delete_elements(ObjectMapUpdate& report);

  ObjectMapParams params_;
  MotionParams motion_;
  StampOrder order_;
  double gate_;                       ///< of the squared Mahalanobis distance
  std::vector<MapElement> elements_;  ///< by ascending id, but for those at rest
  mutable RestingElements resting_;   ///< predicted when they are asked for
  Pose2 T_world_level_;               ///< of the latest update
  double noise_ = 1.0;   ///< noise factor: ratio of errors to those of the detections' covariances, squared
  double step_s_ = 0.0;  ///< time between the last two updates
  double height_world_m_ = 0.0;
  std::uint64_t next_id_ = 1;
  bool resumed_ = false;  ///< resumed and not updated since: its time is that of the next update
  Workspace work_;
};

}  // namespace situation_awareness
