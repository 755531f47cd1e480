// SPDX-License-Identifier: BSD-3-Clause
// Targets and cells of a grid that a vehicle leaves, whose evidence is freed, and comes back to.
#include "situation_awareness/pipeline/grid_pipeline.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/grid_ground.hpp"

namespace situation_awareness::grid_pipeline_test {
namespace {

const Eigen::Vector2d kCar_m(1.0, 2.0);

std::shared_ptr<const Elevation> wide_ground() {
  return std::make_shared<Elevation>(1, 1, Eigen::Vector2d(-3000.0, 3000.0), Eigen::Vector2d(6000.0, 6000.0),
                                     std::vector<float>{0.0F});
}

/// A flight past a car, or past where it was, and far away.
class Flight {
 public:
  explicit Flight(const GridPipelineParams& params = {}) : Flight(GridPipeline(params, wide_ground())) {}
  explicit Flight(GridPipeline pipeline) : pipeline_(std::move(pipeline)) {
    scene_.scene.ground = [](double, double) { return 0.0; };
    scene_.scene.cars.push_back({Pose2{{kCar_m.x(), kCar_m.y()}, radians(30.0)}});
  }

  /// Images around the car, the same ones in each round.
  void look(int images) {
    for (int i = 0; i < images; ++i) {
      const double angle_rad = radians(12.0 * i);
      const Eigen::Vector2d from_m = kCar_m - 35.0 * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
      add(camera_pose({from_m.x(), from_m.y(), 20.0}, angle_rad, radians(-28.0)));
    }
  }
  void fly_away() {
    for (int i = 0; i <= 12; ++i) add(camera_pose({50.0 + 50.0 * i, 0.0, 20.0}, 0.0, radians(-28.0)));
  }
  void remove_the_car() { scene_.scene.cars.clear(); }

  const GridPipeline& pipeline() const { return pipeline_; }
  const std::vector<GridTarget>& targets() const { return pipeline_.targets().targets; }

 private:
  void add(const Eigen::Isometry3d& T_world_camera) {
    scene_.T_world_camera = {T_world_camera};
    SoftLabels labels = labels_of(scene_, square_camera(84), 0, 1);
    labels.stamp_ns = stamp_ns_ += 500'000'000;
    pipeline_.process(labels, T_world_camera);
  }

  GridCase scene_;
  GridPipeline pipeline_;
  std::int64_t stamp_ns_ = 0;
};

float probability_at(const SemanticGrid& grid, const Eigen::Vector2d& p_m) {
  return grid.probability[grid.index(static_cast<int>(std::floor(p_m.x() / grid.cell_m)) - grid.first_column,
                                     static_cast<int>(std::floor(p_m.y() / grid.cell_m)) - grid.first_row)];
}

TEST(GridPipeline, ATargetStaysWhereItsEvidenceWasFreedAndHasItsIdWhenItIsSeenAgain) {
  Flight flight;
  flight.look(8);
  ASSERT_EQ(flight.targets().size(), 1U);
  const GridTarget before = flight.targets()[0];
  flight.fly_away();
  SemanticGrid of_class;
  flight.pipeline().map().read_class(of_class);
  EXPECT_EQ(of_class.width, 0);
  EXPECT_TRUE(flight.pipeline().map().is_settled(kCar_m));
  ASSERT_EQ(flight.targets().size(), 1U);
  EXPECT_EQ(flight.targets()[0].id, before.id);
  EXPECT_LT((flight.targets()[0].p_world_m - before.p_world_m).norm(), 0.1);
  for (int image = 1; image <= 8; ++image) {
    flight.look(1);
    ASSERT_EQ(flight.targets().size(), 1U) << image;
    EXPECT_EQ(flight.targets()[0].id, before.id) << image;
  }
  flight.look(8);
  EXPECT_FALSE(flight.pipeline().map().is_settled(kCar_m));
  ASSERT_EQ(flight.targets().size(), 1U);
  EXPECT_EQ(flight.targets()[0].id, before.id);
  EXPECT_LT((flight.targets()[0].p_world_m.head<2>() - kCar_m).norm(), 0.5);
}

TEST(GridPipeline, OverAFileOfWhichPartsAreReadTheMapIsThatOverTheWhole) {
  const std::string path = testing::TempDir() + "/grid_pipeline_" + std::to_string(::getpid()) + ".tif";
  constexpr int kEdge = 4200;  // more pixels than are read as a whole
  Elevation(kEdge, kEdge, {-2100.0, 2100.0}, {1.0, 1.0}, std::vector<float>(kEdge * kEdge, 0.0F)).save(path);
  Flight whole, parts(GridPipeline({}, ElevationFile({path})));
  for (Flight* const flight : {&whole, &parts}) {
    flight->look(8);
    flight->fly_away();
    flight->look(3);
  }
  ASSERT_EQ(whole.targets().size(), 1U);
  ASSERT_EQ(parts.targets().size(), 1U);
  EXPECT_EQ(parts.targets()[0].p_world_m, whole.targets()[0].p_world_m);
  const SemanticGrid one = whole.pipeline().map().grid(), other = parts.pipeline().map().grid();
  EXPECT_EQ(one.images, other.images);
  std::filesystem::remove(path);
}

TEST(GridPipeline, ATargetThatLeftMeanwhileIsLostWhenEnoughImagesShowItsPlace) {
  Flight flight;
  flight.look(8);
  ASSERT_EQ(flight.targets().size(), 1U);
  flight.fly_away();
  flight.remove_the_car();
  flight.look(2);
  EXPECT_EQ(flight.targets().size(), 1U);
  flight.look(8);
  EXPECT_TRUE(flight.targets().empty());
  EXPECT_LT(probability_at(flight.pipeline().map().grid(), kCar_m), 0.5F);
}

TEST(GridPipeline, TheGridStaysAsItWasWhereEvidenceIsFreed) {
  GridPipelineParams params;
  params.evidence_m = 0.0;
  Flight keeping(params), freeing;
  for (Flight* const flight : {&keeping, &freeing}) {
    flight->look(8);
    flight->fly_away();
  }
  const SemanticGrid all = keeping.pipeline().map().grid(), found = freeing.pipeline().map().grid();
  EXPECT_EQ(found.first_column, all.first_column);
  EXPECT_EQ(found.first_row, all.first_row);
  ASSERT_EQ(found.width, all.width);
  ASSERT_EQ(found.height, all.height);
  EXPECT_EQ(found.images, all.images);
  EXPECT_EQ(found.class_images, all.class_images);
  EXPECT_GT(probability_at(found, kCar_m), 0.5F);
  for (std::size_t i = 0; i < all.probability.size(); ++i) {
    EXPECT_EQ(std::isnan(found.probability[i]), std::isnan(all.probability[i])) << i;
    if (!std::isnan(all.probability[i])) {
      EXPECT_NEAR(found.probability[i], all.probability[i], 1e-6) << i;
      EXPECT_EQ(found.ground_world_m[i], all.ground_world_m[i]) << i;
    }
  }
  ASSERT_EQ(keeping.targets().size(), freeing.targets().size());
  EXPECT_EQ(keeping.targets()[0].id, freeing.targets()[0].id);
}

TEST(GridPipeline, AGridThatScrollsForgetsTargets) {
  GridPipelineParams params;
  params.keep_m = 250.0;
  Flight flight(params);
  flight.look(8);
  ASSERT_EQ(flight.targets().size(), 1U);
  flight.fly_away();
  EXPECT_TRUE(flight.targets().empty());
  EXPECT_FALSE(flight.pipeline().map().is_settled(kCar_m));
}

}  // namespace
}  // namespace situation_awareness::grid_pipeline_test
