// SPDX-License-Identifier: BSD-3-Clause
// The panel as loaded by rviz, driven by user events, with the real nodelets and the simulator.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <string>

#include <QApplication>
#include <QDoubleSpinBox>
#include <QPushButton>

#include <gtest/gtest.h>
#include <ros/ros.h>

#include "panel_fixture.hpp"
#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/map/map_replica.hpp"
#include "situation_awareness/ros/convert/map.hpp"

namespace situation_awareness {
namespace {

class PanelLiveTest : public PanelTest {
 protected:
  void SetUp() override {
    PanelTest::SetUp();
    subscriber_ = node_.subscribe<MapUpdate>("semantic_map/updates", 100, [this](const MapUpdateConstPtr& msg) {
      const std::lock_guard lock(mutex_);
      replica_.apply(map_delta_from_msg(*msg));
      ++maps_;
    });
    const auto running = [this] {
      return cell(0, 1) == "running" && cell(1, 1) == "running" && cell(2, 1) == "running" && cell(3, 1) == "running";
    };
    ASSERT_TRUE(until(running, 90'000)) << cell(0, 1) << ", " << cell(1, 1) << ", " << cell(2, 1) << ", " << cell(3, 1);
  }

  Map map() {
    const std::lock_guard lock(mutex_);
    return replica_.map();
  }
  static bool is_seen(const Map& map, const Feature& feature) { return feature.last_seen_ns == map.stamp_ns; }
  int maps() {
    const std::lock_guard lock(mutex_);
    return maps_;
  }

  ros::NodeHandle node_;
  ros::Subscriber subscriber_;
  std::mutex mutex_;
  MapReplica replica_;
  int maps_ = 0;
};

TEST_F(PanelLiveTest, PausesResetsSavesAndLoads) {
  ASSERT_TRUE(until([this] { return map().features.size() >= 3; }, 60'000));
  click("pause");
  ASSERT_TRUE(until([this] { return part<QPushButton>("pause").text() == "Go on"; })) << answer();
  QTest::qWait(1000);
  const int before = maps();
  QTest::qWait(2000);
  EXPECT_EQ(maps(), before) << "a paused map is not published";
  ASSERT_TRUE(until([this] { return cell(3, 1) == "paused"; })) << cell(3, 1);

  const std::string file = "/tmp/situation_awareness_panel_live_test_" + std::to_string(getpid()) + ".json";
  const std::size_t saved = map().features.size();
  choose("save", file.c_str());
  ASSERT_TRUE(until([this] { return answer().rfind("semantic_map/save_map: ", 0) == 0; })) << answer();
  EXPECT_TRUE(std::ifstream(file).good()) << answer();

  click("reset");
  ASSERT_TRUE(until([this] { return answer().rfind("semantic_map/reset: ", 0) == 0; })) << answer();
  choose("load", file.c_str());
  ASSERT_TRUE(until([this] { return answer().rfind("semantic_map/load_map: ", 0) == 0; })) << answer();
  choose("load", "/dev/null");
  ASSERT_TRUE(until([this] { return answer().find("/dev/null") != std::string::npos; })) << answer();

  click("pause");
  ASSERT_TRUE(until([this] { return part<QPushButton>("pause").text() == "Pause"; })) << answer();
  ASSERT_TRUE(until([&] { return maps() > before + 5; })) << answer();
  EXPECT_GE(map().features.size() + 2, saved);
  std::remove(file.c_str());
}

TEST_F(PanelLiveTest, ShowsLatenciesAlsoUnderSimulatedTime) {
  const auto latency_ms = [this](int stage) { return std::atof(cell(stage, 3).c_str()); };
  EXPECT_TRUE(until([&] { return latency_ms(0) > 0.0 && latency_ms(3) > latency_ms(0); }))
      << latency_ms(0) << ", " << latency_ms(1) << ", " << latency_ms(3);
}

TEST_F(PanelLiveTest, ChangesLiveParameters) {
  ASSERT_TRUE(until([this] { return map().features.size() >= 3; }, 60'000));
  QWidget& form = part<QWidget>("segmentation");
  const auto range = [&form] { return form.findChild<QDoubleSpinBox*>("max_range_m"); };
  ASSERT_TRUE(until([&] { return range() != nullptr && range()->isEnabled() && range()->value() == 10.0; }));
  type(range(), "0.2");
  ASSERT_TRUE(until([this] { return answer() == "max_range_m = 0.2"; })) << answer();
  ASSERT_TRUE(until([this] {
    const Map now = map();
    return std::none_of(now.features.begin(), now.features.end(), [&](const Feature& f) { return is_seen(now, f); });
  })) << "nothing is seen nearer than 0.2 m";
  type(range(), "10");
  ASSERT_TRUE(until([this] { return answer() == "max_range_m = 10"; })) << answer();
  EXPECT_TRUE(until([this] {
    const Map now = map();
    return std::any_of(now.features.begin(), now.features.end(), [&](const Feature& f) { return is_seen(now, f); });
  }));
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  QApplication app(argc, argv);
  ros::init(argc, argv, "rviz_panel_live_test");
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
