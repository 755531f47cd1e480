// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/stage_board.hpp"

#include <gtest/gtest.h>

namespace situation_awareness::stage_board_test {
namespace {

using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;
using Level = StageStatus::Level;

DiagnosticStatus status(const std::string& name, std::int8_t level, const std::string& summary,
                        const std::vector<std::pair<std::string, std::string>>& values) {
  DiagnosticStatus result;
  result.name = name;
  result.level = level;
  result.message = summary;
  for (const auto& [key, value] : values) {
    result.values.emplace_back();
    result.values.back().key = key;
    result.values.back().value = value;
  }
  return result;
}

DiagnosticArray array(const std::vector<DiagnosticStatus>& statuses) {
  DiagnosticArray msg;
  msg.status = statuses;
  return msg;
}

const std::vector<std::string> kNames{"segmentation", "detection", "mapping"};

TEST(StageBoard, ShowsMissingStages) {
  const StageBoard board(kNames);
  const auto stages = board.stages(100.0);
  ASSERT_EQ(stages.size(), 3U);
  for (const StageStatus& stage : stages) EXPECT_EQ(stage.level, Level::kStale);
  EXPECT_EQ(stages[2].name, "mapping");
  EXPECT_EQ(stages[2].summary, "not there");
}

TEST(StageBoard, ShowsAStatusUntilItIsStaleAndAgainAfterANewOne) {
  StageBoard board(kNames);
  const auto msg = array({status("mapping: stage", DiagnosticStatus::OK, "running", {{"rate [Hz]", "20.0"}})});
  board.receive(msg, 50.0);
  EXPECT_EQ(board.stages(53.0)[2].level, Level::kOk);
  EXPECT_EQ(board.stages(53.0)[2].value("rate [Hz]"), "20.0");
  EXPECT_FALSE(board.stages(53.0)[2].value("rate"));
  EXPECT_EQ(board.stages(57.1)[2].level, Level::kStale);
  EXPECT_EQ(board.stages(57.1)[2].summary, "silent for 7 s");
  board.receive(msg, 58.0);
  EXPECT_EQ(board.stages(58.0)[2].summary, "running");
  EXPECT_EQ(board.stages(58.0)[0].level, Level::kStale);
}

TEST(StageBoard, KeepsRobotsApart) {
  StageBoard board({"robot1/segmentation", "robot1/detection", "robot1/mapping"});
  board.receive(array({status("mapping: stage", DiagnosticStatus::ERROR, "another robot's", {}),
                       status("robot10/mapping: stage", DiagnosticStatus::ERROR, "another robot's", {}),
                       status("robot1/mapping: stage", DiagnosticStatus::WARN, "no input", {})}),
                1.0);
  EXPECT_EQ(board.stages(1.0)[2].summary, "no input");
  EXPECT_EQ(board.stages(1.0)[2].level, Level::kWarn);
}

TEST(StageBoard, ShowsAnyStages) {
  StageBoard board({"robot1/polylines", "robot1/polygons"});
  board.receive(array({status("robot1/polygons: stage", DiagnosticStatus::OK, "running", {})}), 1.0);
  const auto stages = board.stages(1.0);
  ASSERT_EQ(stages.size(), 2U);
  EXPECT_EQ(stages[0].name, "polylines");
  EXPECT_EQ(stages[0].level, Level::kStale);
  EXPECT_EQ(stages[1].name, "polygons");
  EXPECT_EQ(stages[1].summary, "running");
  EXPECT_TRUE(StageBoard({}).stages(1.0).empty());
}

TEST(StageBoard, HasTheMostSevereLevelOfANode) {
  StageBoard board(kNames);
  board.receive(array({status("mapping: stage", DiagnosticStatus::OK, "running", {{"a", "1"}}),
                       status("mapping: map", DiagnosticStatus::ERROR, "inconsistent", {{"b", "2"}}),
                       status("mapping: more", DiagnosticStatus::WARN, "slow", {{"c", "3"}})}),
                1.0);
  const StageStatus mapping = board.stages(1.0)[2];
  EXPECT_EQ(mapping.level, Level::kError);
  EXPECT_EQ(mapping.summary, "inconsistent");
  EXPECT_EQ(mapping.values.size(), 3U);
}

TEST(StageBoard, ShowsWhetherAStageIsPaused) {
  StageBoard board(kNames);
  board.receive(array({status("mapping: stage", DiagnosticStatus::WARN, "paused", {}),
                       status("mapping: map", DiagnosticStatus::ERROR, "inconsistent", {})}),
                1.0);
  EXPECT_TRUE(board.stages(1.0)[2].paused);
  EXPECT_FALSE(board.stages(1.0)[1].paused);
  EXPECT_FALSE(board.stages(9.0)[2].paused) << "nobody knows what a node does that is silent";
}

TEST(StageBoard, MarksDropsThatGrow) {
  StageBoard board(kNames);
  const auto with = [](const char* full, const char* processed) {
    return array({status("detection: stage", DiagnosticStatus::WARN, "input dropped",
                         {{"processed", processed}, {"dropped: queue full", full}, {"dropped: pose", "2"}})});
  };
  board.receive(with("9", "100"), 1.0);
  board.receive(with("10", "200"), 2.0);
  StageStatus detection = board.stages(2.0)[1];
  EXPECT_FALSE(detection.values[0].grows_badly);
  EXPECT_TRUE(detection.values[1].grows_badly);
  EXPECT_FALSE(detection.values[2].grows_badly);
  board.receive(with("10", "300"), 3.0);
  EXPECT_FALSE(board.stages(3.0)[1].values[1].grows_badly);
}

}  // namespace
}  // namespace situation_awareness::stage_board_test
