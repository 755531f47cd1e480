// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/object_pipeline.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "situation_awareness/common/time.hpp"
#include "support/level_scene.hpp"
#include "support/moving_lidar.hpp"

namespace situation_awareness {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;

std::string refusal_of(const std::string& yaml) {
  try {
    parse_object_pipeline_params(yaml, "my.yaml", "");
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ObjectPipelineParams, TheShippedFileIsAcceptedAndNamesAModel) {
  const ObjectPipelineParams params =
      load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models",
                                  [](const UnknownKey& key) { ADD_FAILURE() << sentence_of(key); });
  EXPECT_EQ(params.detections.detector, "network");
  EXPECT_EQ(model_path(params.detections), kSource + "/models/ellipse.onnx");
}

template <class Params>
std::map<std::string, std::string> written(const Params& params) {
  std::map<std::string, std::string> fields;
  Params::fields(params, [&](const char* name, const auto& value, const auto&...) {
    std::ostringstream text;
    text << value;
    fields[name] = text.str();
  });
  return fields;
}

// A copy of it is where users begin: what it writes out must be what it leaves out.
TEST(ObjectPipelineParams, TheShippedFileRepeatsTheDefaultsOfSegmentsAndObjects) {
  const ObjectPipelineParams params = load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models");
  EXPECT_EQ(written(params.segments), written(SegmentationParams{}));
  EXPECT_EQ(written(params.objects), written(ObjectMapParams{}));
}

TEST(ObjectPipelineParams, ReadsWhatIsThereAndKeepsDefaultsForTheRest) {
  const ObjectPipelineParams params = parse_object_pipeline_params(
      "scan: {max_range_m: 5, volume: [[1, 0, 0, 2.5], [0, -1, 0, 3]]}\n"
      "segments: {min_points: 6}\n"
      "detections: {detector: vgg_polar, model: /opt/m.onnx, min_p_ellipse: 0.7, fit: {range_sigma_m: 0.02}}\n"
      "objects:\n",
      "my.yaml", "models");
  EXPECT_EQ(params.scan.max_range_m, 5.0);
  EXPECT_EQ(params.scan.min_range_m, RangeLimiterParams{}.min_range_m);
  ASSERT_EQ(params.scan.volume.size(), 2U);
  EXPECT_EQ(params.scan.volume[1].normal_world, -Eigen::Vector3d::UnitY());
  EXPECT_EQ(params.scan.volume[1].offset_m, 3.0);
  EXPECT_EQ(params.segments.min_points, 6);
  EXPECT_EQ(params.detections.detector, "vgg_polar");
  EXPECT_EQ(model_path(params.detections), "/opt/m.onnx");
  EXPECT_EQ(params.detections.min_p_ellipse, 0.7);
  EXPECT_EQ(params.detections.fit.range_sigma_m, 0.02);
  EXPECT_EQ(params.objects.confirmation_probability, ObjectMapParams{}.confirmation_probability);
  EXPECT_EQ(parse_object_pipeline_params("", "my.yaml", "").segments.min_points, SegmentationParams{}.min_points);
}

TEST(ObjectPipelineParams, RefusesInOneSentenceWithFileFieldAndBound) {
  EXPECT_EQ(refusal_of("scan: {max_range_m: -1}"), "my.yaml: scan.max_range_m = -1 is outside [0, 1000] m");
  EXPECT_EQ(refusal_of("scan: {max_range_m: far}"), "my.yaml: scan.max_range_m must be a number in [0, 1000] m");
  EXPECT_EQ(refusal_of("segments: {min_points: 4.5}"),
            "my.yaml: segments.min_points must be a whole number in [2, 1000]");
  EXPECT_EQ(refusal_of("segments: {max_gap_m: .nan}"), "my.yaml: segments.max_gap_m = nan is outside [0.001, 10] m");
  EXPECT_EQ(refusal_of("scan: {volume: [[1, 0, 0]]}"), "my.yaml: scan.volume must be a list of [nx, ny, nz, offset_m]");
  EXPECT_EQ(refusal_of("detections: {min_p_ellipse: 1.5}"),
            "my.yaml: detections.min_p_ellipse = 1.5 is outside [0, 1]");
  EXPECT_EQ(refusal_of("detections: {detector: magic}").find("my.yaml: detections.detector = magic is unknown"), 0U);
  EXPECT_EQ(refusal_of("scan: 3"), "my.yaml: scan must be a map of parameters");
  EXPECT_EQ(refusal_of("scan: [").find("my.yaml: not valid YAML"), 0U);
  EXPECT_EQ(refusal_of("[scan]: 3"), "my.yaml: the name of a parameter must be a text");
  EXPECT_EQ(refusal_of("scan: {? {a: b} : 3}"), "my.yaml: the name of a parameter in scan must be a text");
  EXPECT_THROW(load_object_pipeline_params("/does/not/exist.yaml", ""), std::invalid_argument);
}

/// The sentences on keys of `yaml` that nothing reads.
std::vector<std::string> unknown_in(const std::string& yaml) {
  std::vector<std::string> sentences;
  parse_object_pipeline_params(yaml, "my.yaml", "",
                               [&](const UnknownKey& key) { sentences.push_back(sentence_of(key)); });
  return sentences;
}

TEST(ObjectPipelineParams, TellOfUnknownKeysAndReadTheRest) {
  using Sentences = std::vector<std::string>;
  EXPECT_EQ(unknown_in("scan: {max_range_m: 3}"), Sentences{});
  EXPECT_EQ(unknown_in("scan: {range: 3}"),
            Sentences{"my.yaml: unknown parameter scan.range has no effect, known are: max_range_m, min_range_m, "
                      "volume"});
  EXPECT_EQ(unknown_in("segment: {min_points: 4}"),
            Sentences{"my.yaml: unknown parameter segment has no effect, known are: detections, objects, scan, "
                      "segments"});
  EXPECT_EQ(unknown_in("detections: {fit: {sigma: 1}}").at(0).find("my.yaml: unknown parameter detections.fit.sigma"),
            0U);

  int told = 0;
  const ObjectPipelineParams params = parse_object_pipeline_params("scan: {range: 3, max_range_m: 5}", "my.yaml", "",
                                                                   [&told](const UnknownKey& /*key*/) { ++told; });
  EXPECT_EQ(told, 1);
  EXPECT_EQ(params.scan.max_range_m, 5.0);
}

TEST(ObjectPipelineParams, UnknownKeysAreWarnedOfOnStderrUnlessSomeoneElseIsTold) {
  testing::internal::CaptureStderr();
  parse_object_pipeline_params("scan: {range: 3}", "my.yaml", "");
  EXPECT_EQ(testing::internal::GetCapturedStderr().find("warning: my.yaml: unknown parameter scan.range"), 0U);
}

ObjectPipelineParams params_without_model() {
  ObjectPipelineParams params;
  params.detections.detector = "least_squares";
  return params;
}

TEST(ObjectPipeline, MapsWhatStandsAndWhatMovesFromScansAlone) {
  for (const char* detector : {"least_squares", "network", "vgg_polar"}) {
    ObjectPipelineParams params;
    params.detections.detector = detector;
    params.detections.model_folder = kSource + "/models";
    ObjectPipeline pipeline(params);
    Random random(1);
    const Ellipse standing{{3.0, 1.5}, 0.6, 0.4, 0.2};
    const auto walking = [](double t) { return Ellipse{{3.5, -2.5 + 0.8 * t}, 0.2, 0.25, 0.15}; };
    double time_s = 0.0;
    for (int i = 0; i < 40; ++i) {
      time_s = 0.05 * i;
      LevelScene scene;
      scene.ellipses = {standing, walking(time_s)};
      scene.walls = {{{8.0, -9.0}, {8.0, 9.0}}};
      Scan scan = scene.scan(&random);
      scan.stamp_ns = nanoseconds(time_s);
      pipeline.process(scan, Eigen::Isometry3d::Identity());
    }
    const Objects map = pipeline.map().at(nanoseconds(time_s));
    ASSERT_EQ(map.objects.size(), 2U);
    for (const Object& object : map.objects) {
      const bool stands = object.ellipse_world.center_m.y() > 0.5;
      const Ellipse truth = stands ? standing : walking(time_s);
      EXPECT_LT((object.ellipse_world.center_m - truth.center_m).norm(), 0.05) << detector;
      EXPECT_LT((object.velocity_world_m_s - Eigen::Vector2d(0.0, stands ? 0.0 : 0.8)).norm(), 0.15);
    }
  }
}

// Flying at 2 m/s and turning at 60 deg/s, what stands is found where it is if each beam is taken at its own time, and
// up to 5 cm beside if not.
TEST(ObjectPipeline, AMovingLidarSeesStandingThingsWhereTheyAre) {
  MovingLidar lidar;
  lidar.ellipses_world = {{{3.0, 0.5}, 0.5, 0.4, 0.2}, {{0.5, 2.0}, 0.0, 0.25, 0.25}, {{1.5, -3.0}, 1.0, 0.3, 0.2}};
  lidar.T_world_lidar_end.translation() << 2.0 * 19e-3, 0.0, 0.0;
  lidar.T_world_lidar_end.rotate(Eigen::AngleAxisd(radians(60.0) * 19e-3, Eigen::Vector3d::UnitZ()));
  const auto largest_error_m = [&](const Detections& detections) {
    EXPECT_EQ(detections.detections.size(), lidar.ellipses_world.size());
    double largest_m = 0.0;
    for (const Detection& detection : detections.detections) {
      const Eigen::Vector2d center_world_m = detections.T_world_level * detection.ellipse_level.center_m;
      double nearest_m = 1e9;
      for (const Ellipse& truth : lidar.ellipses_world) {
        nearest_m = std::min(nearest_m, (center_world_m - truth.center_m).norm());
      }
      largest_m = std::max(largest_m, nearest_m);
    }
    return largest_m;
  };
  const Scan scan = lidar.scan();
  MovingLidar still = lidar;
  still.T_world_lidar_end = still.T_world_lidar;
  const double still_error_m =
      largest_error_m(ObjectPipeline(params_without_model()).process(still.scan(), still.T_world_lidar).detections);
  const double error_m = largest_error_m(
      ObjectPipeline(params_without_model()).process(scan, lidar.T_world_lidar, lidar.T_world_lidar_end).detections);
  EXPECT_LT(error_m, still_error_m + 0.005);
  const double smeared_error_m =
      largest_error_m(ObjectPipeline(params_without_model()).process(scan, lidar.T_world_lidar).detections);
  EXPECT_GT(smeared_error_m, still_error_m + 0.03);
}

TEST(ObjectPipeline, AnUnusableScanThrowsAndLeavesTheMapAlone) {
  ObjectPipeline pipeline(params_without_model());
  Scan scan;
  EXPECT_THROW(pipeline.process(scan, Eigen::Isometry3d::Identity()), std::invalid_argument);
  LevelScene scene;
  Eigen::Isometry3d on_edge = Eigen::Isometry3d::Identity();
  on_edge.rotate(Eigen::AngleAxisd(kPi / 2.0, Eigen::Vector3d::UnitX()));
  EXPECT_THROW(pipeline.process(scene.scan(), on_edge), std::invalid_argument);
  Eigen::Isometry3d turned_away = Eigen::Isometry3d::Identity();
  turned_away.rotate(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitZ()));
  EXPECT_THROW(pipeline.process(scene.scan(), Eigen::Isometry3d::Identity(), turned_away), std::invalid_argument);
  EXPECT_EQ(pipeline.map().stamp_ns(), ObjectMap::kNoStamp);
}

TEST(ObjectPipeline, AnythingASensorMaySendIsHandled) {
  ObjectPipeline pipeline(params_without_model());
  Random random(2);
  for (int i = 0; i < 300; ++i) {
    Scan scan;
    scan.stamp_ns = nanoseconds(0.05 * i);
    const int beams = 2 + static_cast<int>(random.uniform() * 1500);
    scan.angle_min_rad = random.uniform(-7.0, 7.0);
    scan.angle_increment_rad = (random.uniform() < 0.5 ? -1.0 : 1.0) * random.uniform(1e-4, 2.0 * kPi / beams);
    for (int b = 0; b < beams; ++b) {
      const double kind = random.uniform();
      const float range_m = kind < 0.2   ? std::nanf("")
                            : kind < 0.3 ? INFINITY
                            : kind < 0.4 ? -INFINITY
                            : kind < 0.5 ? -1.0F
                            : kind < 0.6 ? 1e30F
                                         : static_cast<float>(random.uniform(0.0, 12.0));
      scan.beams.push_back(beam_from_range(range_m, 0.1F, 30.0F));
    }
    Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
    T_world_lidar.rotate(Eigen::AngleAxisd(random.uniform(-1.0, 1.0), Eigen::Vector3d::UnitX()));
    pipeline.process(scan, T_world_lidar);
    for (const Object& object : pipeline.map().at(scan.stamp_ns).objects) {
      ASSERT_TRUE(object.ellipse_world.center_m.allFinite());
      ASSERT_TRUE(object.covariance.allFinite());
    }
  }
}

}  // namespace
}  // namespace situation_awareness
