// SPDX-License-Identifier: BSD-3-Clause
// A member of a params struct that is not in its fields() is neither read nor documented.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/evaluation/dogleg.hpp"
#include "situation_awareness/evaluation/ellipse_posterior.hpp"
#include "situation_awareness/evaluation/ransac.hpp"
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"
#include "situation_awareness/path/dubins_following.hpp"
#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/path/vehicle.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"
#include "situation_awareness/pose/reflector_survey.hpp"
#include "support/aggregate_size.hpp"

namespace situation_awareness::params_declared_test {
namespace {

struct Two {
  std::string a;
  EllipseFitParams b;
};

TEST(AggregateSize, CountsMembers) {
  EXPECT_EQ(aggregate_size<Two>(), 2U);
  EXPECT_EQ(aggregate_size<HalfSpace>(), 2U);
}

TEST(ParamsStructs, DeclareAllTheirMembers) {
  EXPECT_EQ(declared_size<CloudSliceParams>(), aggregate_size<CloudSliceParams>());
  EXPECT_EQ(declared_size<ScannerParams>(), aggregate_size<ScannerParams>());
  EXPECT_EQ(declared_size<RangeLimiterParams>(), aggregate_size<RangeLimiterParams>() + 2) << "three in one member";
  EXPECT_EQ(declared_size<SegmentationParams>() + 3, aggregate_size<SegmentationParams>());
  EXPECT_EQ(declared_size<EllipseFitParams>() + 4, aggregate_size<EllipseFitParams>());
  EXPECT_EQ(declared_size<DoglegParams>(), aggregate_size<DoglegParams>());
  EXPECT_EQ(declared_size<RansacParams>(), aggregate_size<RansacParams>());
  EXPECT_EQ(declared_size<DetectionParams>() + 1, aggregate_size<DetectionParams>()) << "model_folder is the caller's";
  EXPECT_EQ(declared_size<ObjectMapParams>() + 6, aggregate_size<ObjectMapParams>());
  EXPECT_EQ(declared_size<ObjectPipelineParams>(), aggregate_size<ObjectPipelineParams>());
  EXPECT_EQ(declared_size<GpsInsParams>(), aggregate_size<GpsInsParams>());
  EXPECT_EQ(declared_size<InertialNoiseParams>(), aggregate_size<InertialNoiseParams>());
  EXPECT_EQ(declared_size<OdometryTrackParams>(), aggregate_size<OdometryTrackParams>());
  EXPECT_EQ(declared_size<MoverParams>(), aggregate_size<MoverParams>());
  EXPECT_EQ(declared_size<PolylineParams>(), aggregate_size<PolylineParams>());
  EXPECT_EQ(declared_size<PolygonMapParams>() + 1, aggregate_size<PolygonMapParams>());
  EXPECT_EQ(declared_size<PolygonPipelineParams>(), aggregate_size<PolygonPipelineParams>());
  EXPECT_EQ(declared_size<SplinegonFitParams>(), aggregate_size<SplinegonFitParams>());
  EXPECT_EQ(declared_size<DubinsFollowingParams>(), aggregate_size<DubinsFollowingParams>());
  EXPECT_EQ(declared_size<PathFollowingParams>(), aggregate_size<PathFollowingParams>());
  EXPECT_EQ(declared_size<SafetyParams>() + 3, aggregate_size<SafetyParams>());
  EXPECT_EQ(declared_size<VehicleParams>(), aggregate_size<VehicleParams>());
  EXPECT_EQ(declared_size<ReflectorDetectionParams>() + 1, aggregate_size<ReflectorDetectionParams>());
  EXPECT_EQ(declared_size<ReflectorFitParams>() + 1, aggregate_size<ReflectorFitParams>());
  EXPECT_EQ(declared_size<ReflectorLocalizationParams>() + 1, aggregate_size<ReflectorLocalizationParams>());
  EXPECT_EQ(declared_size<ReflectorSurveyParams>(), aggregate_size<ReflectorSurveyParams>());
  EXPECT_EQ(declared_size<WheelErrorParams>() + 2, aggregate_size<WheelErrorParams>());
  EXPECT_EQ(declared_size<SegmentModel>() + 1, aggregate_size<SegmentModel>()) << "shape is the caller's";
}

/// The keys of `yaml` that have no effect.
template <class Params>
std::vector<std::string> unknown_keys(const std::string& yaml) {
  std::vector<std::string> keys;
  params_from_yaml<Params>(yaml, "my.yaml", [&](const UnknownKey& key) { keys.push_back(key.path); });
  return keys;
}

// Constants of the method were parameters once: who still sets them is told.
TEST(Constants, AreToldToHaveNoEffectWhereTheyAreSet) {
  using Keys = std::vector<std::string>;
  EXPECT_EQ(unknown_keys<ObjectPipelineParams>("{objects: {stop_rate_1_s: 0.2, correlated_error_fraction: 0.1}, "
                                               "segments: {max_concavity_m: 0.1, occlusion_margin_m: 0.1}}"),
            (Keys{"objects.stop_rate_1_s", "objects.correlated_error_fraction", "segments.max_concavity_m",
                  "segments.occlusion_margin_m"}));
  EXPECT_EQ(unknown_keys<PolygonPipelineParams>("localization: {search: {min_matches: 4}, lost_scans: 3}"),
            (Keys{"localization.search", "localization.lost_scans"}));
  EXPECT_EQ(unknown_keys<GpsInsParams>("{learn_fix_noise: false, reset_time_jump_s: 2}"),
            (Keys{"learn_fix_noise", "reset_time_jump_s"}));
}

}  // namespace
}  // namespace situation_awareness::params_declared_test
