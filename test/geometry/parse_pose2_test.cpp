// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/parse_pose2.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace situation_awareness::parse_pose2_test {
namespace {

TEST(ParsePose2, ReadsThreeNumbersAndNothingElse) {
  const Pose2 pose = parse_pose2("-1.5,+0.25,-3e-1", "--initial-pose");
  EXPECT_EQ(pose.translation_m, Eigen::Vector2d(-1.5, 0.25));
  EXPECT_EQ(pose.yaw_rad, -0.3);
  for (const std::string text : {"", "1", "1,2", "1,2,", ",1,2", "1,,2", "1;2;3", "1,2,3,4", "1,2,3 m", "-,2,3",
                                 "--1,2,3", "nan,0,0", "0,inf,0", "0,0,1e999", "1 2 3", "X,Y,YAW"}) {
    try {
      parse_pose2(text, "--initial-pose");
      ADD_FAILURE() << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_EQ(error.what(), "--initial-pose: " + text + " is not X,Y,YAW in m and rad");
    }
  }
}

}  // namespace
}  // namespace situation_awareness::parse_pose2_test
