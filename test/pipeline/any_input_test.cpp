// SPDX-License-Identifier: BSD-3-Clause
// Each stage that estimates, given anything among what is good: what it knows stays an estimate, and is good once what
// comes is good again for 10 s.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "map/polygons/guarded_map.hpp"
#include "map/polygons/room_polylines.hpp"
#include "pose/reflector_drive.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/covariance.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/path/obstacles.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "support/covariance.hpp"
#include "support/features.hpp"
#include "support/grid_ground.hpp"
#include "support/lively_scene.hpp"
#include "support/odd_number.hpp"

namespace situation_awareness::any_input_test {
namespace {

constexpr std::int64_t kBegin_ns = 1'000'000'000'000'000;
constexpr double kGood_s = 10.0;

template <int Size>
Eigen::Matrix<double, Size, Size> odd_covariance(Random& random, double usual = 0.01) {
  Eigen::Matrix<double, Size, Size> m = usual * Eigen::Matrix<double, Size, Size>::Identity();
  for (int k = 0; k < 2; ++k) {
    const int row = static_cast<int>(random.uniform(0.0, Size)) % Size;
    const int column = static_cast<int>(random.uniform(0.0, Size)) % Size;
    m(row, column) = m(column, row) = odd_number(random);
  }
  return m;
}

Pose2 odd_pose(Random& random) {
  Pose2 T{{random.normal(), random.normal()}, random.normal()};
  (random.uniform() < 0.5 ? T.translation_m.x() : T.yaw_rad) = odd_number(random);
  return T;
}

std::int64_t odd_stamp(std::int64_t stamp_ns, Random& random) {
  return random.uniform() < 0.7 ? stamp_ns + nanoseconds(random.uniform(-3.0, 3.0))
                                : static_cast<std::int64_t>(9e18 * random.uniform(-1.0, 1.0));
}

/// Returns the stamp of a message between this and the next, or any.
std::int64_t odd_or_next_stamp(std::int64_t stamp_ns, double period_s, Random& random) {
  return random.uniform() < 0.5 ? stamp_ns + nanoseconds(0.5 * period_s) : odd_stamp(stamp_ns, random);
}

template <class Value>
Value& any_of(std::vector<Value>& values, Random& random) {
  return values[static_cast<std::size_t>(random.uniform() * static_cast<double>(values.size())) % values.size()];
}

/// Good input for 3 s, with something odd after each message for 5 s, and good for 10 s.
template <class Stage>
void run(Stage& stage, std::uint64_t seed) {
  Random random(seed);
  double good_s = 0.0;
  for (double time_s = 0.0; good_s < kGood_s; time_s += Stage::kPeriod_s) {
    stage.give_good();
    if (time_s > 3.0 && time_s < 8.0) {
      stage.give_odd(random);
      good_s = 0.0;
    } else {
      good_s += Stage::kPeriod_s;
    }
    if (time_s <= 8.0) good_s = 0.0;
    stage.expect_sound();
    if (::testing::Test::HasFailure()) {
      ADD_FAILURE() << "seed " << seed << ", " << time_s << " s";
      return;
    }
  }
  stage.expect_good();
}

/// The kernel, as all that use it do: a covariance that is none is refused, and what is outside the gate.
class Kernel {
 public:
  static constexpr double kPeriod_s = 0.1;

  explicit Kernel(std::uint64_t seed) : random_(seed) { estimate_.P = Eigen::Matrix3d::Identity(); }

  void give_good() {
    const Pose2 motion{{0.1, 0.0}, 0.05};
    truth_ = truth_ * motion;
    const Eigen::Matrix3d Q = Eigen::Vector3d(1e-5, 1e-5, 1e-6).asDiagonal();
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    F.topLeftCorner<2, 2>() = motion.rotation().transpose();
    F.block<2, 1>(0, 2) =
        motion.rotation().transpose() * Eigen::Vector2d(-motion.translation_m.y(), motion.translation_m.x());
    predict(estimate_, estimate_.x * motion, F, Q);
    measure(Manifold<Pose2>::local_coordinates(estimate_.x, truth_) + 0.01 * normal_vector<3>(random_),
            1e-4 * Eigen::Matrix3d::Identity());
  }
  void give_odd(Random& random) {
    Eigen::Vector3d nu = 0.01 * normal_vector<3>(random);
    if (random.uniform() < 0.5) nu(static_cast<int>(random.uniform(0.0, 3.0)) % 3) = odd_number(random);
    measure(nu, odd_covariance<3>(random));
  }
  void expect_sound() const {
    EXPECT_TRUE(is_covariance(estimate_.P));
    EXPECT_TRUE(estimate_.x.translation_m.allFinite() && std::isfinite(estimate_.x.yaw_rad));
  }
  void expect_good() const {
    EXPECT_LT(mahalanobis2(Manifold<Pose2>::local_coordinates(estimate_.x, truth_), estimate_.P), 25.0);
  }

 private:
  void measure(const Eigen::Vector3d& nu, const Eigen::Matrix3d& R) {
    if (!is_positive_semidefinite(R)) return;
    const Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
    const Innovation<3> compared = innovation(estimate_, nu, H, R);
    if (inside_gate(compared, chi_square_quantile(0.9999, 3))) update(estimate_, compared, H, R);
  }

  Random random_;
  Estimate<Pose2> estimate_;
  Pose2 truth_;
};

class ObjectStage {
 public:
  static constexpr double kPeriod_s = kLivelyPeriod_s;

  explicit ObjectStage(std::uint64_t seed) : scene_(lively_scene(400, kBegin_ns, seed)), map_(ObjectMapParams{}) {}

  void give_good() { map_.update(scene_[next_++]); }
  void give_odd(Random& random) {
    Detections odd = scene_[next_ - 1];
    odd.stamp_ns = odd_stamp(odd.stamp_ns, random);
    for (Detection& detection : odd.detections) {
      const double value = odd_number(random);
      switch (static_cast<int>(random.uniform(0.0, 6.0))) {
        case 0:
          detection.covariance = odd_covariance<5>(random);
          break;
        case 1:
          detection.ellipse_level.center_m.x() = value;
          break;
        case 2:
          detection.ellipse_level.rx_m = value;
          break;
        case 3:
          detection.time_offset_s = value;
          break;
        case 4:
          detection.p_ellipse = value;
          break;
        default:
          detection.ellipse_level.center_m += 3.0 * normal_vector<2>(random);
      }
    }
    const auto is_defect = [](const Detection& detection) { return *detection_defect(detection) != '\0'; };
    odd.detections.erase(std::remove_if(odd.detections.begin(), odd.detections.end(), is_defect), odd.detections.end());
    map_.update(odd);
  }
  void expect_sound() const {
    for (const Object& object : map_.at(map_.stamp_ns()).objects) {
      EXPECT_TRUE(is_covariance(object.covariance)) << object.id;
      EXPECT_TRUE(object.ellipse_world.center_m.allFinite()) << object.id;
    }
  }
  void expect_good() const {
    const Objects objects = map_.at(map_.stamp_ns());
    for (const Eigen::Vector2d& at_m : {Eigen::Vector2d(3.0, 0.0), Eigen::Vector2d(5.0, 0.3)}) {
      double least_m = std::numeric_limits<double>::infinity();
      for (const Object& object : objects.objects) {
        least_m = std::min(least_m, (object.ellipse_world.center_m - at_m).norm());
      }
      EXPECT_LT(least_m, 0.1);
    }
  }

 private:
  std::vector<Detections> scene_;
  std::size_t next_ = 0;
  ObjectMap map_;
};

/// In a room, whose four walls are one closed chain.
class PolygonStage {
 public:
  static constexpr double kPeriod_s = 0.04;

  explicit PolygonStage(std::uint64_t seed) : room_(seed, kBegin_ns), map_(PolygonMapParams{}) {}

  void give_good() {
    latest_ = room_.next();
    map_.update(latest_, good_covariance());
  }
  void give_odd(Random& random) {
    Polylines odd = latest_;
    odd.stamp_ns = odd_or_next_stamp(odd.stamp_ns, kPeriod_s, random);
    Eigen::Matrix3d covariance = good_covariance();
    PolylineHit& hit = any_of(odd.hits, random);
    const double value = odd_number(random);
    switch (static_cast<int>(random.uniform(0.0, 7.0))) {
      case 0:
        covariance = odd_covariance<3>(random, 1e-6);
        break;
      case 1:
        odd.T_world_level = odd_pose(random);
        break;
      case 2:
        hit.p_level_m.x() = value;
        break;
      case 3:
        for (PolylineHit& each : odd.hits) each.sigma_m = value;
        break;
      case 4:
        hit.normal_level.y() = value;
        break;
      case 5:
        any_of(odd.free_space.azimuth_rad, random) = static_cast<float>(value);
        break;
      default:
        any_of(odd.free_space.range_m, random) = static_cast<float>(value);
    }
    map_.update(odd, covariance);
  }
  void expect_sound() {
    const Polygons polygons = map_.polygons();
    for (const Chain& chain : polygons.chains) {
      for (const ChainVertex& vertex : chain.vertices) {
        EXPECT_TRUE(vertex.p_world_m.allFinite());
        EXPECT_TRUE(std::isfinite(vertex.sigma_m) && vertex.sigma_m > 0.0);
      }
    }
    const std::int64_t scan = (latest_.stamp_ns - kBegin_ns) / RoomPolylines::kPeriod_ns;
    if (scan % 8 == 0) {
      PolygonMap loaded(PolygonMapParams{});
      EXPECT_NO_THROW(loaded.restore(polygons)) << "what is saved can be loaded";
    }
  }
  void expect_good() {
    // What was mapped behind the walls, by wrong poses, is hidden: nothing can tell that it is not there.
    const std::vector<Chain> chains = map_.polygons().chains;
    ASSERT_EQ(std::count_if(chains.begin(), chains.end(), is_in_sight), 1);
    const Chain& room = *std::find_if(chains.begin(), chains.end(), is_in_sight);
    EXPECT_TRUE(room.closed);
    Obstacles edges;
    edges.add(feature_of(room));
    for (double part = -0.9; part < 1.0; part += 0.1) {
      for (const double side : {-1.0, 1.0}) {
        EXPECT_LT(distance_m(edges, {3.0 * side, 2.0 * part}), 0.02);
        EXPECT_LT(distance_m(edges, {3.0 * part, 2.0 * side}), 0.02);
      }
    }
  }

 private:
  static Eigen::Matrix3d good_covariance() { return Eigen::Vector3d(1e-6, 1e-6, 1e-7).asDiagonal(); }

  /// Whether a part of it is no farther than the walls.
  static bool is_in_sight(const Chain& chain) {
    return std::any_of(chain.vertices.begin(), chain.vertices.end(), [](const ChainVertex& vertex) {
      return std::abs(vertex.p_world_m.x()) < 3.1 && std::abs(vertex.p_world_m.y()) < 2.1;
    });
  }

  RoomPolylines room_;
  Polylines latest_;
  GuardedMap map_;
};

/// Images of four cars, from a camera that goes around them.
class GridStage {
 public:
  static constexpr double kPeriod_s = 0.2;

  explicit GridStage(std::uint64_t seed)
      : given_(make_grid_case("orbit", static_cast<std::uint32_t>(seed))), pipeline_({}, flat_ground()) {}

  void give_good() {
    const std::size_t i = images_++ % given_.T_world_camera.size();
    latest_ = labels_of(given_, camera_, i, 1);
    latest_.stamp_ns = kBegin_ns + static_cast<std::int64_t>(images_) * nanoseconds(kPeriod_s);
    T_world_camera_ = given_pose(given_, i, 1);
    pipeline_.process(latest_, T_world_camera_, good_covariance());
  }
  void give_odd(Random& random) {
    SoftLabels odd = latest_;
    Eigen::Isometry3d T_world_camera = T_world_camera_;
    CameraPoseCovariance covariance = good_covariance();
    odd.stamp_ns = odd_or_next_stamp(odd.stamp_ns, kPeriod_s, random);
    const double value = odd_number(random);
    switch (static_cast<int>(random.uniform(0.0, 5.0))) {
      case 0:
        for (float& probability : odd.probability) {
          if (random.uniform() < 0.1) probability = static_cast<float>(odd_number(random));
        }
        break;
      case 1:
        for (double& variance : covariance.diagonal()) variance = random.uniform() < 0.2 ? std::abs(value) : variance;
        break;
      case 2:
        T_world_camera.translation()(static_cast<int>(random.uniform(0.0, 3.0)) % 3) = value;
        break;
      case 3:
        T_world_camera.linear() *=
            Eigen::AngleAxisd(random.normal(), normal_vector<3>(random).normalized()).toRotationMatrix();
        break;
      default:
        (random.uniform() < 0.5 ? odd.camera.fx_px : odd.camera.cy_px) = value;
    }
    drop_out_of_range(odd);
    try {
      pipeline_.process(odd, T_world_camera, covariance);
    } catch (const std::invalid_argument&) {  // refused by name
    }
  }
  void expect_sound() const {
    for (const GridTarget& target : pipeline_.targets().targets) {
      EXPECT_TRUE(target.p_world_m.allFinite()) << target.id;
      EXPECT_TRUE(is_covariance(target.covariance_m2)) << target.id << '\n' << target.covariance_m2;
    }
  }
  void expect_good() const {
    const std::vector<GridTarget>& targets = pipeline_.targets().targets;
    const std::vector<int> target_of = targets_of(given_.scene.cars, pipeline_.targets());
    EXPECT_EQ(targets.size(), given_.scene.cars.size());
    for (std::size_t car = 0; car < target_of.size(); ++car) {
      ASSERT_GE(target_of[car], 0);
      const GridTarget& target = targets[static_cast<std::size_t>(target_of[car])];
      const Eigen::Vector2d off_m = target.p_world_m.head<2>() - given_.scene.cars[car].T_world_car.translation_m;
      EXPECT_LT(off_m.norm(), 1.0);
      EXPECT_LT(target.covariance_m2.trace(), 1.0) << target.covariance_m2;
    }
  }

 private:
  static CameraPoseCovariance good_covariance() {
    CameraPoseCovariance covariance = CameraPoseCovariance::Zero();
    covariance.diagonal() << 0.01, 0.01, 0.01, 1e-6, 1e-6, 1e-6;
    return covariance;
  }

  GridCase given_;
  PinholeCamera camera_ = square_camera(56);
  GridPipeline pipeline_;
  std::size_t images_ = 0;
  SoftLabels latest_;
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();
};

class ReflectorStage {
 public:
  static constexpr double kPeriod_s = 0.04;

  explicit ReflectorStage(std::uint64_t seed) : drive_(map_of(5), world(), seed) { drive_.guess(); }

  void give_good() { drive_.scan(); }
  void give_odd(Random& random) {
    const std::int64_t stamp_ns = nanoseconds(drive_.time_s());
    if (random.uniform() < 0.5) {
      drive_.localization.add_odometry(odd_stamp(stamp_ns, random), odd_pose(random));
      return;
    }
    ReflectorSightings odd = drive_.sightings;
    odd.stamp_ns = odd_stamp(stamp_ns, random);
    for (ReflectorSighting& sighting : odd.sightings) {
      if (random.uniform() < 0.5) sighting.center_level_m += normal_vector<2>(random);
    }
    drive_.localization.update(odd, drive_.world.T_base_lidar);
  }
  void expect_sound() const {
    if (!drive_.localization.is_known()) return;
    const LocalizedPose pose = drive_.localization.pose();
    EXPECT_TRUE(pose.T_world_base.x.translation_m.allFinite() && std::isfinite(pose.T_world_base.x.yaw_rad));
    EXPECT_TRUE(is_covariance(pose.covariance_world));
  }
  void expect_good() const {
    ASSERT_TRUE(drive_.localization.is_known());
    EXPECT_LT(drive_.error().head<2>().norm(), 0.05);
    EXPECT_LT(std::abs(drive_.error().z()), 0.03);
  }

 private:
  static ReflectorWorld world() {
    ReflectorWorld world = room_with(map_of(5));
    world.path = winding_path(0.5);
    return world;
  }

  Drive drive_;
};

template <class Stage>
class AnyInput : public ::testing::Test {};

using Stages = ::testing::Types<Kernel, ObjectStage, PolygonStage, GridStage, ReflectorStage>;
TYPED_TEST_SUITE(AnyInput, Stages);

TYPED_TEST(AnyInput, LeavesAnEstimateThatIsGoodAgainSoon) {
  for (std::uint64_t seed = 1; seed <= 4 && !::testing::Test::HasFailure(); ++seed) {
    TypeParam stage(seed);
    run(stage, 100 + seed);
  }
}

/// An image of 4 x 4 pixels of the ground, from 30 m above it.
struct ImageFromAbove {
  explicit ImageFromAbove(float probability) {
    labels.stamp_ns = kBegin_ns;
    labels.camera = {4, 4, 4.0, 4.0, 1.5, 1.5};
    labels.probability.assign(16, probability);
    T_world_camera.linear() = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();  // looks down
    T_world_camera.translation().z() = 30.0;
  }

  SoftLabels labels;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

TEST(GridPipeline, RefusesWhatIsNoCovariance) {
  GridPipeline pipeline({}, flat_ground());
  auto [labels, T_world_camera] = ImageFromAbove(0.0F);
  CameraPoseCovariance covariance = 0.01 * CameraPoseCovariance::Identity();
  EXPECT_NO_THROW(pipeline.process(labels, T_world_camera, covariance));
  labels.stamp_ns += 100'000'000;
  for (const double correlated : {1.5, std::numeric_limits<double>::quiet_NaN()}) {
    covariance(0, 1) = covariance(1, 0) = 0.01 * correlated;
    EXPECT_THROW(pipeline.process(labels, T_world_camera, covariance), std::invalid_argument);
  }
  covariance(0, 1) = covariance(1, 0) = 0.005;
  EXPECT_NO_THROW(pipeline.process(labels, T_world_camera, covariance));
  EXPECT_EQ(pipeline.verdict(), StampOrder::Verdict::kNext);
}

// What is said to be anywhere is put nowhere.
TEST(GridPipeline, LearnsNothingByAPoseThatIsNotKnown) {
  GridPipeline pipeline({}, flat_ground());
  const auto [labels, T_world_camera] = ImageFromAbove(1.0F);
  for (const int axis : {0, 2, 5}) {
    CameraPoseCovariance covariance = 0.01 * CameraPoseCovariance::Identity();
    covariance(axis, axis) = 1e4;
    pipeline.process(labels, T_world_camera, covariance);
    EXPECT_FALSE(pipeline.is_pose_known());
    EXPECT_TRUE(pipeline.map().grid().images.empty());
  }
  pipeline.process(labels, T_world_camera, 0.01 * CameraPoseCovariance::Identity());
  EXPECT_TRUE(pipeline.is_pose_known());
  EXPECT_FALSE(pipeline.map().grid().images.empty());
}

}  // namespace
}  // namespace situation_awareness::any_input_test
