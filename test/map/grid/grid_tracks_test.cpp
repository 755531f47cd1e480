// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid_tracks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <vector>

namespace situation_awareness::grid_tracks_test {
namespace {

const PinholeCamera kCamera{101, 101, 90.0, 80.0, 50.0, 50.0};

/// 20 m above the origin, ahead along x and down by 45 degrees.
Eigen::Isometry3d pose() {
  Eigen::Matrix3d R;
  R << 0, -std::sqrt(0.5), std::sqrt(0.5), -1, 0, 0, 0, -std::sqrt(0.5), -std::sqrt(0.5);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = R;
  T.translation() = Eigen::Vector3d(0.0, 0.0, 20.0);
  return T;
}

CameraPoseCovariance covariance_of(double sigma_m, double sigma_rad) {
  CameraPoseCovariance covariance = CameraPoseCovariance::Zero();
  covariance.diagonal() << sigma_m * sigma_m, sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad,
      sigma_rad * sigma_rad, sigma_rad * sigma_rad;
  return covariance;
}

/// That the latest image shows as its thing of the number `shown`; 0: not at all.
GridCluster cluster_at(double x, double y, int images, int shown = 1) {
  return {{x, y}, 0.0, 8.0, 0.9, images, shown, shown};
}

TEST(GridTracks, ReportATargetFromItsThirdImageAndKeepItsId) {
  GridTracks tracks(GridTracksParams{});
  const CameraPoseCovariance covariance = covariance_of(0.1, 0.01);
  EXPECT_TRUE(tracks.update(1, {cluster_at(20, 0, 1)}, kCamera, pose(), covariance).targets.empty());
  EXPECT_TRUE(tracks.update(2, {cluster_at(20, 0, 2)}, kCamera, pose(), covariance).targets.empty());
  const GridTargets third = tracks.update(3, {cluster_at(20, 0, 3)}, kCamera, pose(), covariance);
  ASSERT_EQ(third.targets.size(), 1U);
  const auto id = third.targets[0].id;
  const GridTargets moved =
      tracks.update(4, {cluster_at(24, 9, 3), cluster_at(20.5, 0.3, 4)}, kCamera, pose(), covariance);
  ASSERT_EQ(moved.targets.size(), 2U);
  EXPECT_EQ(moved.targets[0].id, id);
  EXPECT_NE(moved.targets[1].id, id);
  EXPECT_EQ(moved.targets[0].p_world_m.x(), 20.5);
}

TEST(GridTracks, GiveATargetThatIsFoundAgainItsId) {
  GridTracks tracks(GridTracksParams{});
  const CameraPoseCovariance covariance = covariance_of(0.1, 0.01);
  const auto id = tracks.update(1, {cluster_at(20, 0, 3)}, kCamera, pose(), covariance).targets.at(0).id;
  EXPECT_TRUE(tracks.update(2, {}, kCamera, pose(), covariance).targets.empty());
  const GridTargets again =
      tracks.update(3, {cluster_at(20.4, 0.4, 3), cluster_at(40, 0, 3)}, kCamera, pose(), covariance);
  ASSERT_EQ(again.targets.size(), 2U);
  EXPECT_EQ(again.targets[0].id, id);
  EXPECT_GT(again.targets[1].id, id);
}

TEST(GridTracks, TakeTwoForOneUntilThreeImagesShowThemApart) {
  GridTracks tracks(GridTracksParams{});
  const CameraPoseCovariance covariance = covariance_of(0.1, 0.01);
  const auto id = tracks.update(1, {cluster_at(20, 0, 3)}, kCamera, pose(), covariance).targets.at(0).id;
  std::int64_t stamp_ns = 1;
  const auto targets = [&](int first, int second) {
    return tracks
        .update(++stamp_ns, {cluster_at(20, 0, 3, first), cluster_at(22.5, 1, 6, second)}, kCamera, pose(), covariance)
        .targets;
  };
  ASSERT_EQ(targets(0, 1).size(), 1U);
  const GridTarget one = targets(0, 1)[0];
  EXPECT_EQ(one.id, id);
  EXPECT_NEAR(one.p_world_m.x(), 20 + 2.5 * 6 / 9, 1e-12);  // by the images that showed either
  EXPECT_NEAR(one.p_world_m.y(), 1.0 * 6 / 9, 1e-12);
  EXPECT_EQ(targets(0, 0).size(), 1U);
  for (int image = 0; image < 5; ++image) EXPECT_EQ(targets(1, 1).size(), 1U);  // one thing, on both
  EXPECT_EQ(targets(1, 2).size(), 1U);
  EXPECT_EQ(targets(1, 2).size(), 1U);
  EXPECT_EQ(targets(1, 2).size(), 2U);
  EXPECT_EQ(targets(1, 0).size(), 2U);  // it remembers
}

TEST(GridTracks, TakeTwoForOneAsFarApartAsThePoseIsKnownBadly) {
  const auto count = [](double apart_m, double sigma_m, int second) {
    GridTracks tracks(GridTracksParams{});
    const CameraPoseCovariance covariance = covariance_of(sigma_m, 0.001);
    for (std::int64_t image = 1; image < 3; ++image) {
      tracks.update(image, {cluster_at(20, 0, 3), cluster_at(20 + apart_m, 0, 3, second)}, kCamera, pose(), covariance);
    }
    return tracks.update(3, {cluster_at(20, 0, 3), cluster_at(20 + apart_m, 0, 3, second)}, kCamera, pose(), covariance)
        .targets.size();
  };
  EXPECT_EQ(count(3.9, 0.1, 0), 1U);
  EXPECT_EQ(count(4.1, 0.1, 0), 2U);
  EXPECT_EQ(count(5.9, 1.5, 0), 1U);
  EXPECT_EQ(count(5.9, 1.5, 2), 2U);  // but images show both
  EXPECT_EQ(count(6.1, 1.5, 0), 2U);
}

TEST(GridTracks, TakeAFragmentForAPartOfWhatItIsNearThoughImagesShowBoth) {
  const CameraPoseCovariance covariance = covariance_of(0.1, 0.01);
  GridCluster fragment = cluster_at(22, 0, 3, 2);
  fragment.area_m2 = 3.5;
  const GridCluster whole = cluster_at(20, 0, 3);
  GridTracks tracks(GridTracksParams{});
  const auto id = tracks.update(1, {fragment}, kCamera, pose(), covariance).targets.at(0).id;
  for (std::int64_t stamp_ns = 2; stamp_ns < 6; ++stamp_ns) {
    const GridTargets both = tracks.update(stamp_ns, {whole, fragment}, kCamera, pose(), covariance);
    ASSERT_EQ(both.targets.size(), 1U);
    EXPECT_EQ(both.targets[0].id, id);  // but it is where most of it is
    EXPECT_EQ(both.targets[0].p_world_m.x(), 20.0);
    EXPECT_EQ(both.targets[0].area_m2, 8.0);
  }
  fragment.area_m2 = 4.5;
  EXPECT_EQ(tracks.update(6, {whole, fragment}, kCamera, pose(), covariance).targets.size(), 2U);
  fragment.area_m2 = 3.5;
  fragment.p_world_m.x() = 22.6;
  EXPECT_EQ(tracks.update(7, {whole, fragment}, kCamera, pose(), covariance).targets.size(), 2U);
}

TEST(GridTracks, TakeSmallClustersForNoTargets) {
  GridTracks tracks(GridTracksParams{});
  GridCluster small = cluster_at(20, 0, 5);
  small.area_m2 = 0.75;
  EXPECT_TRUE(tracks.update(1, {small}, kCamera, pose(), covariance_of(0.1, 0.01)).targets.empty());
}

TEST(GridTracks, CovarianceIsThatOfSightLinesWithNoiseOnTheGround) {
  GridTracksParams params;
  params.pose_correlation = 1.0;
  params.ground_sigma_m = 0.0;
  params.outline_sigma_m = 0.001;
  GridTracks tracks(params);
  const double sigma_m = 0.1, sigma_rad = 0.002;
  const Eigen::Vector2d p_m(25.0, 6.0);
  const GridTargets targets =
      tracks.update(1, {cluster_at(p_m.x(), p_m.y(), 3)}, kCamera, pose(), covariance_of(sigma_m, sigma_rad));
  ASSERT_EQ(targets.targets.size(), 1U);
  std::mt19937 random(1);
  std::normal_distribution<> normal;
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  constexpr int kCases = 20000;
  const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  for (int i = 0; i < kCases; ++i) {
    const Eigen::Vector3d from = pose().translation() + sigma_m * vector();
    const Eigen::Vector3d turn = sigma_rad * vector();
    const Eigen::Vector3d d = Eigen::AngleAxisd(turn.norm(), turn.normalized()) *
                              (Eigen::Vector3d(p_m.x(), p_m.y(), 0.0) - pose().translation());
    const Eigen::Vector2d off = (from - from.z() / d.z() * d).head<2>() - p_m;
    sum += off * off.transpose() / kCases;
  }
  EXPECT_LT((targets.targets[0].covariance_m2 - sum).norm(), 0.05 * sum.norm());
}

TEST(GridTracks, MoreImagesMakeItSurerButForWhatIsCommonToAll) {
  GridTracksParams params;
  params.ground_sigma_m = 0.0;
  params.outline_sigma_m = 0.001;
  params.pose_correlation = 0.25;
  GridTracks tracks(params);
  double first = 0.0, last = 0.0;
  for (int i = 1; i <= 400; ++i) {
    const GridTargets& targets = tracks.update(i, {cluster_at(20, 0, 3)}, kCamera, pose(), covariance_of(0.2, 0.01));
    (i == 1 ? first : last) = targets.targets.at(0).covariance_m2.trace();
  }
  EXPECT_NEAR(last / first, 0.25 + 0.75 / 400, 1e-3);
}

/// Five things, and of each image two more that are nowhere in the next one.
std::vector<GridCluster> cluttered(std::mt19937& random) {
  std::uniform_real_distribution<> place(-500.0, 500.0);
  std::vector<GridCluster> clusters;
  for (int i = 0; i < 5; ++i) clusters.push_back(cluster_at(20.0 + 12.0 * i, 600.0, 3));
  for (int i = 0; i < 2; ++i) clusters.push_back(cluster_at(place(random), place(random), 1));
  return clusters;
}

TEST(GridTracks, RememberSoManyThatAreLostAndNoMore) {
  GridTracks tracks(GridTracksParams{});
  std::mt19937 random(1);
  const CameraPoseCovariance covariance = covariance_of(0.1, 0.01);
  const auto update = [&](int images) {
    for (int i = 0; i < images; ++i) tracks.update(i, cluttered(random), kCamera, pose(), covariance);
  };
  update(1000);
  const std::vector<GridTarget> before = tracks.targets().targets;
  update(20000);
  EXPECT_LE(tracks.size(), 7 + GridTracks::kMostLost);
  ASSERT_EQ(tracks.targets().targets.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(tracks.targets().targets[i].id, before.at(i).id);
}

TEST(GridTracks, RememberATargetLongerThanWhatWasNone) {
  GridTracks tracks(GridTracksParams{});
  std::mt19937 random(2);
  const CameraPoseCovariance covariance = covariance_of(0.1, 0.01);
  const auto id = tracks.update(0, {cluster_at(20, 0, 3)}, kCamera, pose(), covariance).targets.at(0).id;
  for (int i = 1; i < 5000; ++i) tracks.update(i, cluttered(random), kCamera, pose(), covariance);
  EXPECT_EQ(tracks.update(5000, {cluster_at(20.4, 0.4, 3)}, kCamera, pose(), covariance).targets.at(0).id, id);
}

TEST(GridTracks, UseNoIdTwiceWhenTheMapBeginsAnew) {
  GridTracks tracks(GridTracksParams{});
  const CameraPoseCovariance covariance = covariance_of(0.1, 0.01);
  std::uint64_t last = 0;
  for (int i = 0; i < 5; ++i) {
    for (const GridTarget& target :
         tracks.update(i, {cluster_at(20, 0, 3), cluster_at(40, 0, 3)}, kCamera, pose(), covariance).targets) {
      EXPECT_GT(target.id, last);
      last = target.id;
    }
    tracks.forget();
    EXPECT_TRUE(tracks.targets().targets.empty());
    EXPECT_EQ(tracks.size(), 0U);
  }
}

TEST(GridTracks, RefuseParametersOutOfBounds) {
  GridTracksParams params;
  params.gate_m = 0.0;
  EXPECT_THROW(GridTracks{params}, std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::grid_tracks_test
