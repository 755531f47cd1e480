// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/object_pipeline.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/time.hpp"
#include "support/level_scene.hpp"
#include "support/moving_lidar.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::object_pipeline_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;

std::string refusal(const std::string& yaml) {
  return refusal_of([&] { parse_object_pipeline_params(yaml, "my.yaml", ""); });
}

TEST(ObjectPipelineParams, TheShippedFileIsAcceptedAndNamesAModel) {
  const ObjectPipelineParams params =
      load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models",
                                  [](const UnknownKey& key) { ADD_FAILURE() << message_of(key); });
  EXPECT_EQ(params.detections.detector, "network");
  EXPECT_EQ(model_path(params.detections), kSource + "/models/ellipse.onnx");
}

// Users start from a copy of it: its values must be the defaults.
TEST(ObjectPipelineParams, TheShippedFileRepeatsTheDefaults) {
  EXPECT_EQ(yaml_from_params(load_object_pipeline_params(kSource + "/cfg/objects.yaml", "")),
            yaml_from_params(ObjectPipelineParams{}));
}

TEST(ObjectPipelineParams, KeepsDefaultsOfOmittedParameters) {
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

TEST(ObjectPipelineParams, AreRefusedWithFileFieldAndBound) {
  const auto expect_refusal = [](const std::string& yaml, const std::vector<std::string>& facts) {
    const std::string message = refusal(yaml);
    EXPECT_EQ(message.rfind("my.yaml: ", 0), 0U) << message;
    EXPECT_TRUE(names(message, facts));
  };
  expect_refusal("scan: {max_range_m: -1}", {"scan.max_range_m", "-1", "0", "1000"});
  expect_refusal("scan: {max_range_m: 1, min_range_m: 2}", {"scan.min_range_m", "scan.max_range_m"});
  expect_refusal("segments: {min_points: 4.5}", {"segments.min_points", "4.5", "2", "1000"});
  expect_refusal("scan: {volume: [[1, 0, 0]]}", {"scan.volume", "[nx, ny, nz, offset_m]"});
  expect_refusal("scan: {volume: [[0, 0, 0, 1]]}", {"scan.volume", "normal"});
  expect_refusal("detections: {min_p_ellipse: 1.5}", {"detections.min_p_ellipse", "1.5", "0", "1"});
  expect_refusal("detections: {detector: magic}", {"detections.detector", "magic", "least_squares"});
  expect_refusal("detections: {fit: {range_sigma_m: 0}}", {"detections.fit.range_sigma_m", "1e-04"});
  expect_refusal("objects: {shape: square}", {"objects.shape", "square", "circle"});
  EXPECT_THROW(load_object_pipeline_params("/does/not/exist.yaml", ""), std::invalid_argument);
}

TEST(ObjectPipelineParams, UnknownKeysAreWarnedOfOnStderrWithoutAHandler) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(parse_object_pipeline_params("scan: {range: 3, max_range_m: 5}", "my.yaml", "").scan.max_range_m, 5.0);
  const std::string warning = testing::internal::GetCapturedStderr();
  for (const char* fact : {"my.yaml", "scan.range", "max_range_m"}) EXPECT_TRUE(has_fact(warning, fact)) << warning;

  std::vector<std::string> paths;
  parse_object_pipeline_params("{segment: {min_points: 4}, detections: {fit: {sigma: 1}}}", "my.yaml", "",
                               [&](const UnknownKey& key) { paths.push_back(key.path); });
  EXPECT_EQ(paths, (std::vector<std::string>{"detections.fit.sigma", "segment"}));
}

/// Every parameter that is a number, out of its bounds on either side, is refused with its path and its bounds; at its
/// bounds it is read.
TEST(ObjectPipelineParams, AllRespectTheirBounds) {
  ObjectPipelineParams params;
  int numbers = 0;
  for (const Parameter& parameter : parameters_of(params)) {
    if (!parameter.bounds) continue;
    ++numbers;
    std::string yaml = parameter.name + ": ";
    std::string end;
    for (std::string section = parameter.section; !section.empty();) {
      const std::size_t dot = section.rfind('.');
      yaml = section.substr(dot == std::string::npos ? 0 : dot + 1) + ": {" + yaml;
      end += '}';
      section = dot == std::string::npos ? "" : section.substr(0, dot);
    }
    const bool whole = std::holds_alternative<int*>(parameter.value);
    const auto [low, high] = *parameter.bounds;
    const double below = whole ? low - 1.0 : std::nextafter(low, -INFINITY);
    const double above = whole ? high + 1.0 : std::nextafter(high, INFINITY);
    for (const double value : {below, above}) {
      const std::string message =
          refusal(yaml + (whole ? std::to_string(static_cast<std::int64_t>(value)) : yaml_text(value)) + end);
      EXPECT_EQ(message.rfind("my.yaml: ", 0), 0U) << message;
      EXPECT_TRUE(names(message, {parameter.path(), text_of(*parameter.bounds, parameter.unit)}));
    }
    for (const double value : {low, high}) {
      const std::string message =
          refusal(yaml + (whole ? std::to_string(static_cast<int>(value)) : yaml_text(value)) + end);
      // Another field may forbid it.
      EXPECT_FALSE(has_fact(message, text_of(*parameter.bounds, parameter.unit))) << message;
    }
  }
  EXPECT_GT(numbers, 36);
}

/// Each parameter set to something else than its default is written and read as that, and nothing else changes.
TEST(ObjectPipelineParams, AllAreReadBackAsWritten) {
  const std::string defaults = yaml_from_params(ObjectPipelineParams{});
  ObjectPipelineParams count;
  for (std::size_t i = 0; i < parameters_of(count).size(); ++i) {
    ObjectPipelineParams params;
    const Parameter parameter = parameters_of(params)[i];
    SCOPED_TRACE(parameter.path());
    if (auto* const* real = std::get_if<double*>(&parameter.value)) {
      **real += **real < parameter.bounds->high ? 1e-9 * (1.0 + **real) : -1e-9 * (1.0 + **real);
    } else if (auto* const* whole = std::get_if<int*>(&parameter.value)) {
      **whole += 1;
    } else if (auto* const* flag = std::get_if<bool*>(&parameter.value)) {
      **flag = !**flag;
    } else if (parameter.path() == "scan.volume") {
      std::get<YamlValue>(parameter.value).set("[[1, 0, 0, 2.5], [0, -1, 0, 3]]");
    } else if (parameter.path() == "detections.detector") {
      params.detections.detector = "vgg_polar";
    } else if (parameter.path() == "detections.model") {
      params.detections.model = "/opt/a model.onnx";
    } else if (parameter.path() == "scan.no_return") {
      params.scan.scanner.no_return = "zero";
    } else if (parameter.path() == "scan.beam_order") {
      params.scan.scanner.beam_order = "backward";
    } else if (parameter.path() == "scan.stamp_at") {
      params.scan.scanner.stamp_at = "middle";
    } else if (parameter.path() == "objects.shape") {
      params.objects.shape = "circle";
    } else {
      FAIL() << "a parameter that this test does not know how to change";
    }
    const std::string written = yaml_from_params(params);
    EXPECT_NE(written, defaults);
    EXPECT_EQ(yaml_from_params(parse_object_pipeline_params(written, "my.yaml", "")), written);
  }
}

ObjectPipelineParams params_without_model() {
  ObjectPipelineParams params;
  params.detections.detector = "least_squares";
  params.detections.boxes = false;
  return params;
}

TEST(ObjectPipeline, MapsStandingAndMovingObjectsFromScans) {
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

TEST(ObjectPipeline, UsesTheGivenMapForExpectedOutlines) {
  ObjectPipeline own(params_without_model()), told(params_without_model()), not_told(params_without_model());
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const auto detections_of = [](const ObjectPipelineResult& result) {
    std::vector<double> numbers;
    for (const Detection& detection : result.detections.detections) {
      const Vector5d smooth = smooth_parameters(detection.ellipse_level);
      numbers.insert(numbers.end(), smooth.data(), smooth.data() + smooth.size());
    }
    return numbers;
  };
  Random random(1);
  std::vector<double> by_own, by_told, by_none;
  for (int i = 0; i < 20; ++i) {
    LevelScene scene;
    scene.ellipses = {{{3.0, 1.5}, 0.6, 0.4, 0.2}, {{3.5, -2.5 + 0.04 * i}, 0.2, 0.25, 0.15}};
    Scan scan = scene.scan(&random);
    scan.stamp_ns = nanoseconds(0.05 * i);
    const Objects copy = told.map().at(told.map().stamp_ns());
    by_own = detections_of(own.process(scan, T));
    by_told = detections_of(told.process(scan, T, T, copy));
    by_none = detections_of(not_told.process(scan, T, T, Objects{}));
    ASSERT_EQ(by_own, by_told);
  }
  EXPECT_EQ(by_own.size(), by_none.size());
  EXPECT_NE(by_own, by_none);
}

// Flying at 2 m/s and turning at 60 deg/s, standing objects are mapped at their positions if each beam has its own
// time, and up to 5 cm beside if not.
TEST(ObjectPipeline, AMovingLidarSeesStandingObjectsAtTheirPositions) {
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
}  // namespace situation_awareness::object_pipeline_test
