// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/image/image.hpp"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

struct GridTracksParams {
  double gate_m = 4.0;
  double same_m = 4.0;
  int confirm_images = 3;
  double min_area_m2 = 1.0;

  // Constants of the method, which are not read from YAML.
  /// Part of the variance of the camera's pose that is common to all images.
  double pose_correlation = 0.2;
  /// Standard deviation of a target's centroid by what its cells and labels are.
  double outline_sigma_m = 0.15;
  /// Standard deviation of the ground's height below a target.
  double ground_sigma_m = 0.2;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("gate_m", self.gate_m, Bounds{0.1, 100.0}, "m", "farther apart, a cluster and a target are not the same");
    visit("same_m", self.same_m, Bounds{0.0, 100.0}, "m",
          "clusters that are nearer to each other and that no images show apart are one target; half as much more "
          "where the pose is known badly");
    visit("confirm_images", self.confirm_images, Bounds{1, 1000}, "", "images that show a target until it is reported");
    visit("min_area_m2", self.min_area_m2, Bounds{0.0, 1e4}, "m^2", "smaller clusters are no targets");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "targets"); }
};

/// Follows the clusters of a grid as targets with ids: a target is tentative until enough images showed it, confirmed
/// while its cluster is on the map, and lost without; found again near by, it has its id again. Of those that are lost
/// at most kMostLost are remembered: the latest ones, those that were reported before all others. No id is used twice.
/// Where the pose has
/// wandered between two visits, one thing has two clusters: two that are near each other and that no three images show
/// apart, or of which one is but a fragment, are one target, with the older id.
class GridTracks {
 public:
  /// Tracks: each of them costs every update.
  static constexpr std::size_t kMostLost = 200;

  /// Throws std::invalid_argument naming field and bound.
  explicit GridTracks(const GridTracksParams& params);

  /// Whether what the map says of a place is by evidence that it does not have any more (GridMap::is_settled).
  using IsSettled = std::function<bool(const Eigen::Vector2d& p_world_m)>;

  /// The clusters after an image. A target that had a cluster stays as it is where its place is settled. Returns the
  /// confirmed targets, valid until the next call.
  const GridTargets& update(std::int64_t stamp_ns, const std::vector<GridCluster>& clusters,
                            const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                            const CameraPoseCovariance& covariance, const IsSettled& is_settled = {});

  const GridTargets& targets() const { return targets_; }

  /// Number of those that are followed or remembered.
  std::size_t size() const { return tracks_.size(); }

  /// All are forgotten: the map begins anew. Ids go on.
  void forget();

 private:
  struct Track {
    std::uint64_t id = 0;
    GridCluster cluster;
    bool is_on_map = false, was_reported = false;
    bool is_settled = false;    ///< its cluster is as it was when the map had the evidence for it
    std::uint64_t lost_at = 0;  ///< number of the update that lost it
    int images = 0;             ///< that had it in view
    Eigen::Matrix2d covariance_sum_m2 = Eigen::Matrix2d::Zero();  ///< of the place by one image, by the camera's pose
    Eigen::Matrix2d ground_sum_m2 = Eigen::Matrix2d::Zero();      ///< by the ground's height
    Eigen::Matrix2d information_sum_1_m2 = Eigen::Matrix2d::Zero();  ///< on the place, by each image

    bool is_lost() const { return !is_on_map && !is_settled; }
  };

  void associate(const std::vector<GridCluster>& clusters, const IsSettled& is_settled);
  void add_view(Track& track, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                const CameraPoseCovariance& covariance) const;
  Eigen::Matrix2d covariance_of(const Track& track) const;
  Eigen::Matrix2d covariance_by_one_image(const Track& track) const;
  Eigen::Matrix2d outline_m2() const;
  void note_apart();
  void forget_lost();
  bool is_one_with(const Track& track, const GridTarget& target) const;

  GridTracksParams params_;
  double same_gate_;                                              ///< of the squared distance in standard deviations
  std::vector<Track> tracks_;                                     ///< by id
  std::map<std::pair<std::uint64_t, std::uint64_t>, int> apart_;  ///< of two targets' ids: images that show them apart
  std::uint64_t last_id_ = 0, updates_ = 0;
  GridTargets targets_;
  std::vector<int> images_;  ///< of each target, that showed it
};

}  // namespace situation_awareness
