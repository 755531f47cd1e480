// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/hit_labels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::hit_labels_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;

/// A room with objects, a half hidden one, a corner, and objects that are too small or too far away.
LevelScene room(double moved_m = 0.0) {
  LevelScene scene;
  scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}, {{6.0, 8.0}, {-3.0, 8.0}}, {{1.2, -2.6}, {1.2, -3.0}}};
  scene.ellipses = {{{3.0, -1.0}, 0.3, 0.3, 0.2},  {{2.0, 1.5}, 0.0, 0.2, 0.2},       {{3.4, 2.1}, 1.0, 0.4, 0.25},
                    {{5.7, 0.5}, 0.0, 0.25, 0.25}, {{4.0, moved_m}, 0.5, 0.25, 0.15}, {{-1.0, 3.0}, 0.0, 0.01, 0.01},
                    {{-2.0, 5.0}, 0.0, 0.3, 0.3},  {{1.0, -5.0}, 0.0, 0.4, 0.06}};
  return scene;
}

class HitLabelsTest : public testing::Test {
 protected:
  /// The labels of the latest scan of some, with what the map knew before it.
  void fly(int scans) {
    ObjectPipelineParams params = load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models");
    params.detections.detector = "least_squares";
    params.scan.volume = {{Eigen::Vector3d::UnitY(), 4.5}};
    ObjectPipeline pipeline(params);
    Random random(1);
    for (int i = 0; i < scans; ++i) {
      Scan scan = room(0.02 * i).scan(&random);
      scan.stamp_ns = 1'000'000'000 + i * std::int64_t{50'000'000};
      known_ = pipeline.map().at(pipeline.map().stamp_ns());
      result_ = pipeline.process(scan, Eigen::Isometry3d::Identity());
    }
    labels_ = label_hits(result_.segments, result_.detections, known_, std::move(labels_));
  }

  Objects known_;
  ObjectPipelineResult result_;
  std::vector<HitLabel> labels_;
};

TEST_F(HitLabelsTest, EveryHitOfTheScanHasOneLabel) {
  for (const int scans : {1, 40}) {
    fly(scans);
    const Segments& segments = result_.segments;
    ASSERT_EQ(labels_.size(), segments.points.size());
    std::multiset<int> hits, labelled;
    for (const Point& point : result_.points.points) {
      if (is_hit(point.state)) hits.insert(point.beam);
    }
    for (const Point& point : segments.points) labelled.insert(point.beam);
    EXPECT_EQ(labelled, hits);

    // Per segment and run the same reasons are counted as by the stages.
    Counters counted;
    std::set<std::size_t> seen;
    std::size_t detected = 0;
    for (std::size_t i = 0; i < labels_.size(); ++i) {
      const HitLabel& label = labels_[i];
      const bool in_segment = label.segment != HitLabel::kNoSegmentIndex;
      EXPECT_EQ(in_segment, label.fate != HitFate::kNoSegment);
      EXPECT_EQ(label.reason == 0, label.fate == HitFate::kObject);
      if (!in_segment) continue;
      const Segment& segment = segments.segments.at(label.segment);
      EXPECT_TRUE(i >= segment.first && i < segment.first + segment.count);
      EXPECT_EQ(label.fate == HitFate::kStructure, segment.kind == SegmentKind::kStructure);
      if (!seen.insert(label.segment).second) continue;
      if (label.fate == HitFate::kObject) {
        ++detected;
      } else {
        ++counted[hit_reasons()[label.reason]];
      }
    }
    for (const RefusedRun& run : segments.refused_runs) {
      for (std::size_t i = run.first; i < run.first + run.count; ++i) {
        EXPECT_EQ(labels_[i].fate, HitFate::kNoSegment);
        EXPECT_STREQ(hit_reasons()[labels_[i].reason], text_of(run.why));
      }
      ++counted[text_of(run.why)];
    }
    EXPECT_EQ(detected, result_.detections.detections.size());
    for (const Counters& of : {segments.refused, result_.detections.refused}) {
      for (const auto& [why, count] : of) EXPECT_EQ(counted.of(why), count) << why;
    }
    EXPECT_GT(counted.of(text_of(RunRefusal::kTooFewPoints)), 0U);
    EXPECT_GT(counted.of(text_of(RunRefusal::kOutside)), 0U);
    EXPECT_GT(counted.of(text_of(StructureReason::kExtent)), 0U);
  }
}

TEST_F(HitLabelsTest, AHitHasTheIdOfTheElementThatItIsOn) {
  fly(40);
  ASSERT_GE(known_.objects.size(), 4U);
  std::set<std::uint64_t> found;
  for (std::size_t i = 0; i < labels_.size(); ++i) {
    const HitLabel& label = labels_[i];
    if (label.object_id == 0) continue;
    EXPECT_EQ(label.fate, HitFate::kObject);
    found.insert(label.object_id);
    double nearest_m = 1e9;
    std::uint64_t nearest = 0;
    const Eigen::Vector2d p_world_m = result_.segments.T_world_level * result_.segments.points[i].p_level_m;
    for (const Object& object : known_.objects) {
      const double offset = (object.ellipse_world.center_m - p_world_m).norm();
      if (offset < nearest_m) {
        nearest_m = offset;
        nearest = object.id;
      }
    }
    EXPECT_EQ(label.object_id, nearest);
    EXPECT_LT(nearest_m, 0.5);
  }
  EXPECT_GE(found.size(), 4U);
}

// A person has no outline by which detections are refined: its legs have others.
TEST_F(HitLabelsTest, HitsOnAPersonHaveItsIdAndThoseOnOthersTheirs) {
  fly(40);
  const std::vector<HitLabel> before = labels_;
  Objects with_person = known_;
  ASSERT_GE(with_person.objects.size(), 4U);
  const std::uint64_t person = with_person.objects[1].id;
  with_person.objects[1].object_class = ObjectClass::kPerson;
  labels_ = label_hits(result_.segments, result_.detections, with_person, std::move(labels_));
  std::set<std::uint64_t> found;
  for (std::size_t i = 0; i < labels_.size(); ++i) {
    found.insert(labels_[i].object_id);
    if (before[i].object_id == 0) continue;
    EXPECT_EQ(labels_[i].object_id, before[i].object_id);
  }
  EXPECT_EQ(found.count(person), 1U);
}

TEST_F(HitLabelsTest, WithoutAMapNoHitHasAnId) {
  fly(1);
  int objects = 0;
  for (const HitLabel& label : labels_) {
    EXPECT_EQ(label.object_id, 0U);
    objects += label.fate == HitFate::kObject ? 1 : 0;
  }
  EXPECT_GT(objects, 50);
}

TEST_F(HitLabelsTest, EachReasonHasItsIndex) {
  std::set<std::string> texts;
  for (std::size_t i = 0; i < hit_reasons().size(); ++i) {
    EXPECT_EQ(hit_reason_index(hit_reasons()[i]), i);
    EXPECT_TRUE(texts.insert(hit_reasons()[i]).second);
  }
  EXPECT_STREQ(hit_reasons()[hit_reason_index("unknown text")], "other");
}

// A segment without a detection or a refusal, and points in neither segment nor run, as messages may contain them.
TEST_F(HitLabelsTest, HitsWithoutAnyResultHaveALabel) {
  fly(1);
  Segments segments = result_.segments;
  segments.refused_runs.clear();
  const std::vector<HitLabel> labels = label_hits(segments, {}, {});
  ASSERT_EQ(labels.size(), labels_.size());
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const bool object = labels_[i].fate == HitFate::kObject || labels_[i].fate == HitFate::kRefused;
    EXPECT_EQ(labels[i].fate, object ? HitFate::kRefused : labels_[i].fate);
    EXPECT_STREQ(hit_reasons()[labels[i].reason],
                 labels_[i].fate == HitFate::kStructure ? hit_reasons()[labels_[i].reason] : "other");
  }
  EXPECT_TRUE(label_hits({}, {}, {}).empty());
}

TEST_F(HitLabelsTest, RefusesDetectionsOfOtherSegments) {
  fly(1);
  Detections other = result_.detections;
  other.detections.at(0).segment = result_.segments.segments.size();
  EXPECT_THROW(label_hits(result_.segments, other, {}), std::invalid_argument);
  other = result_.detections;
  other.refused_segments.push_back({result_.segments.segments.size(), detection_refusal::kNotOneEllipse});
  EXPECT_THROW(label_hits(result_.segments, other, {}), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::hit_labels_test
