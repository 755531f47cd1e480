// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/map_element.hpp"
#include "situation_awareness/map/objects/object_map_params.hpp"
#include "situation_awareness/map/objects/re_identification.hpp"

namespace situation_awareness {

// Elements at rest (docs/math/objects.md, "Rest"): lost ones that stood, where a scan neither looks nor detects
// anything. A scan changes nothing of them but the prediction of their estimates, and one long step of that equals many
// short ones up to rounding. So they are predicted when a scan needs them, or when somebody asks for the whole map.

/// True if it has stood for so long that it begins to move at start_rate_1_s, and out of sight not at all.
bool is_settled(const MapElement& element);

/// What tells whether a scan needs an element at rest. Only the variance changes with time.
struct RestingPlace {
  Ellipse ellipse_world;     ///< of the standing estimate
  double variance_m2 = 0.0;  ///< sum of the variances of the standing position along two axes, at `stamp_ns`
  std::int64_t stamp_ns = 0;
  bool is_box = false;
};

/// The place of an element whose estimate is of `stamp_ns`.
RestingPlace resting_place(const MapElement& element, std::int64_t stamp_ns);

/// Time at which the rest of an element ends whose estimate is of `stamp_ns`, because it may be deleted from then on;
/// a time before `stamp_ns` where it may not rest at all: it is not lost or did not stand, its prediction is not that
/// of an object at rest, or other elements depend on it.
std::int64_t end_of_rest_ns(const MapElement& element, std::int64_t stamp_ns, const ObjectMapParams& params);

/// Process model of elements at rest, from that of the others: no transitions.
MotionParams motion_at_rest(const MotionParams& motion);

/// Elements at rest, of a map whose other elements are elsewhere.
class RestingElements {
 public:
  std::size_t size() const { return by_id_.size(); }
  bool empty() const { return by_id_.empty(); }
  void clear();

  /// An element whose estimate is of the place's stamp.
  void add(const MapElement& element, const RestingPlace& place, std::int64_t end_ns);

  /// Predicts all elements to `stamp_ns`.
  void bring_to(std::int64_t stamp_ns, const MotionParams& motion);

  /// Marks the elements within `reach_m` of a place along x for which `is_needed(place)`.
  template <class IsNeeded>
  void mark_within(double x_m, double reach_m, IsNeeded&& is_needed) {
    for (auto entry = first_from(x_m - reach_m); entry != by_x_.end() && entry->x_m() <= x_m + reach_m; ++entry) {
      entry->is_marked = entry->is_marked || is_needed(std::as_const(entry->place));
    }
  }
  /// Marks the elements whose rest has ended.
  void mark_ended(std::int64_t stamp_ns);
  void mark_all();

  /// Moves the marked elements, predicted to `stamp_ns`, to `elements`, both by ascending id.
  void give_marked(std::int64_t stamp_ns, const MotionParams& motion, std::vector<MapElement>& elements);

  /// By ascending id.
  struct ById {
    std::uint64_t id;
    std::size_t slot;
  };
  const std::vector<ById>& by_id() const { return by_id_; }
  const MapElement& element(const ById& entry) const { return slots_[entry.slot]; }

  /// Their shapes, sorted.
  const std::vector<ElementShape>& shapes() const { return shapes_; }

  /// m. No element is larger, nor has been since the last clear().
  double largest_radius_m() const { return largest_radius_m_; }

 private:
  struct Entry {
    RestingPlace place;
    std::int64_t end_ns;
    std::uint64_t id;
    std::size_t slot;
    bool is_marked;

    double x_m() const { return place.ellipse_world.center_m.x(); }
  };

  std::vector<Entry>::iterator first_from(double x_m);
  void bring_to(Entry& entry, std::int64_t stamp_ns, const MotionParams& motion);

  std::vector<MapElement> slots_;
  std::vector<std::size_t> free_;  ///< slots
  std::vector<Entry> by_x_;
  std::vector<ById> by_id_;
  std::vector<ElementShape> shapes_;
  std::vector<ById> leaving_;
  std::int64_t next_end_ns_ = 0;  ///< no element's rest ends before
  double largest_radius_m_ = 0.0;
};

/// What one scan needs of the elements at rest: what is in sight of its beams, near its detections, or covered by what
/// was just seen. The last two are bounds: of matches and of elements that are found again.
class ScanNeeds {
 public:
  /// `elements`: those not at rest, at the time of the scan before; `U`: covariance of the pose. The detections are
  /// used until the next call.
  void set(const Detections& detections, const std::vector<Measurement>& measurements, const Eigen::Matrix3d& U,
           double gate, double drift_m, const std::vector<MapElement>& elements);

  /// Room for so many detections and elements, and some more: the first element may rest long after warm-up.
  void make_room(std::size_t detections, std::size_t elements);

  bool needs(const RestingPlace& place) const;

  /// Marks the elements at rest that the scan needs: those for which needs() is true.
  void mark(RestingElements& resting) const;

 private:
  /// A detection, with the sum of the variances of its position, the robot's errors included.
  struct Reach {
    Eigen::Vector2d center_world_m;
    double variance_m2;
    double radius_m;
  };
  /// A standing element that was seen.
  struct Cover {
    Eigen::Vector2d center_world_m;
    double radius_m;
  };

  void set_sectors();
  bool may_see(const RestingPlace& place) const;
  bool sees(const RestingPlace& place) const;
  bool is_near(const Reach& reach, const RestingPlace& place) const;
  static bool is_under(const Cover& cover, const RestingPlace& place);

  const Detections* detections_ = nullptr;
  Pose2 T_level_world_;
  Eigen::Matrix2d R_level_world_ = Eigen::Matrix2d::Identity();
  double gate_ = 0.0;
  double drift_m_ = 0.0;
  std::vector<float> sectors_m_;  ///< longest range of the beams in each sector of the azimuth
  double half_spacing_rad_ = 0.0;
  double farthest_m_ = 0.0;
  std::vector<Reach> reaches_;
  std::vector<Cover> covers_;
};

}  // namespace situation_awareness
