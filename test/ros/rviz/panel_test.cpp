// SPDX-License-Identifier: BSD-3-Clause
// The panel as loaded by rviz, driven by user events, with mock nodes.
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <QApplication>
#include <QDoubleSpinBox>
#include <QLineEdit>
#include <QPushButton>
#include <QSpinBox>
#include <QTest>
#include <QTimer>
#include <QTreeWidget>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <dynamic_reconfigure/ConfigDescription.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rviz/config.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include "panel_fixture.hpp"
#include "situation_awareness/LoadMap.h"
#include "situation_awareness/SaveMap.h"

namespace situation_awareness {
namespace {

/// A mock of the nodelet semantic_map: services, live parameters and status.
class FakeMap {
 public:
  explicit FakeMap(const std::string& ns = "") : node_(ns) {
    services_ = {node_.advertiseService("semantic_map/reset", &FakeMap::reset, this),
                 node_.advertiseService("semantic_map/pause", &FakeMap::pause, this),
                 node_.advertiseService("semantic_map/save_map", &FakeMap::save, this),
                 node_.advertiseService("semantic_map/load_map", &FakeMap::load, this),
                 node_.advertiseService("semantic_map/live/set_parameters", &FakeMap::set, this)};
    diagnostics_ = node_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
    descriptions_ =
        node_.advertise<dynamic_reconfigure::ConfigDescription>("semantic_map/live/parameter_descriptions", 1, true);
    updates_ = node_.advertise<dynamic_reconfigure::Config>("semantic_map/live/parameter_updates", 1, true);
    descriptions_.publish(description());
    tell(0.999, 60);
  }

  void say(std::int8_t level, const std::string& summary, const std::string& dropped) const {
    diagnostic_msgs::DiagnosticArray msg;
    msg.status.resize(1);
    diagnostic_msgs::DiagnosticStatus& status = msg.status.front();
    status.name = node_.resolveName("semantic_map").substr(1) + ": stage";
    status.level = level;
    status.message = summary;
    for (const auto& [key, value] : {std::pair<const char*, std::string>{"rate [Hz]", "19.7"},
                                     {"latency p50 [ms]", "3.10"},
                                     {"dropped: queue full", dropped}}) {
      status.values.emplace_back();
      status.values.back().key = key;
      status.values.back().value = value;
    }
    diagnostics_.publish(msg);
  }

  void tell(double gate_probability, int max_unseen) {
    values_.doubles.resize(1);
    values_.doubles[0].name = "gate_probability";
    values_.doubles[0].value = gate_probability;
    values_.ints.resize(1);
    values_.ints[0].name = "max_unseen";
    values_.ints[0].value = max_unseen;
    updates_.publish(values_);
  }

  std::string summary() const { return paused_ ? "paused" : "running"; }

  double gate_probability() const { return values_.doubles[0].value; }

  std::vector<std::string> asked() const {
    const std::lock_guard lock(mutex_);
    return asked_;
  }

  void set_paused(bool paused) { paused_ = paused; }

  std::atomic<bool> good = true;
  std::atomic<int> delay_ms = 0;

 private:
  static dynamic_reconfigure::ConfigDescription description() {
    dynamic_reconfigure::ConfigDescription msg;
    msg.groups.resize(1);
    const auto add = [&msg](const char* name, auto member, auto low, auto high, auto value) {
      msg.groups[0].parameters.emplace_back();
      msg.groups[0].parameters.back().name = name;
      for (const auto& [config, number] : {std::pair{&msg.min, low}, {&msg.max, high}, {&msg.dflt, value}}) {
        (config->*member).emplace_back();
        (config->*member).back().name = name;
        (config->*member).back().value = number;
      }
    };
    add("gate_probability", &dynamic_reconfigure::Config::doubles, 0.5, 0.999999, 0.99);
    add("max_unseen", &dynamic_reconfigure::Config::ints, 0, 3600, 30);
    return msg;
  }

  bool note(const std::string& what) {
    std::this_thread::sleep_for(std::chrono::milliseconds(delay_ms));
    const std::lock_guard lock(mutex_);
    asked_.push_back(what);
    return good;
  }

  template <class Response>
  bool answer(const std::string& what, Response& response) {
    response.success = note(what);
    response.message = response.success ? what + " done" : "cannot " + what;
    return true;
  }

  bool reset(std_srvs::TriggerRequest&, std_srvs::TriggerResponse& response) { return answer("reset", response); }
  bool pause(std_srvs::SetBoolRequest& request, std_srvs::SetBoolResponse& response) {
    answer(request.data ? "pause" : "go on", response);
    if (response.success) paused_ = request.data != 0;
    return true;
  }
  bool save(SaveMapRequest& request, SaveMapResponse& response) { return answer("save " + request.file, response); }
  bool load(LoadMapRequest& request, LoadMapResponse& response) { return answer("load " + request.file, response); }
  bool set(dynamic_reconfigure::ReconfigureRequest& request, dynamic_reconfigure::ReconfigureResponse& response) {
    if (note("set")) {
      for (const auto& parameter : request.config.doubles) values_.doubles[0].value = parameter.value;
      for (const auto& parameter : request.config.ints) values_.ints[0].value = parameter.value;
    }
    updates_.publish(values_);
    response.config = values_;
    return true;
  }

  ros::NodeHandle node_;
  std::vector<ros::ServiceServer> services_;
  ros::Publisher diagnostics_, descriptions_, updates_;
  dynamic_reconfigure::Config values_;
  std::atomic<bool> paused_ = false;
  mutable std::mutex mutex_;
  std::vector<std::string> asked_;
};

TEST_F(PanelTest, ShowsTheStagesAndMarksSilentOnes) {
  EXPECT_EQ(cell(0, 0), "segmentation");
  EXPECT_EQ(cell(3, 1), "not there");
  const FakeMap map;
  QTest::qWait(500);
  map.say(diagnostic_msgs::DiagnosticStatus::OK, "running", "3");
  ASSERT_TRUE(until([this] { return cell(3, 1) == "running"; }));
  EXPECT_EQ(cell(3, 2), "19.7");
  EXPECT_EQ(cell(3, 3), "3.10");
  map.say(diagnostic_msgs::DiagnosticStatus::WARN, "input dropped", "4");
  ASSERT_TRUE(until([this] { return cell(3, 1) == "input dropped"; }));
  const QTreeWidget& values = part<QTreeWidget>("values");
  ASSERT_EQ(values.topLevelItemCount(), 3);
  EXPECT_EQ(values.topLevelItem(2)->text(0), "dropped: queue full");
  EXPECT_EQ(values.topLevelItem(2)->text(1), "4");
  EXPECT_NE(values.topLevelItem(2)->foreground(1), values.topLevelItem(1)->foreground(1));
  ASSERT_TRUE(until([this] { return cell(3, 1).rfind("silent for ", 0) == 0; }));
  map.say(diagnostic_msgs::DiagnosticStatus::OK, "running", "4");
  EXPECT_TRUE(until([this] { return cell(3, 1) == "running"; }));
}

TEST_F(PanelTest, CallsTheServices) {
  FakeMap map;
  QTimer life;
  QObject::connect(&life, &QTimer::timeout,
                   [&map] { map.say(diagnostic_msgs::DiagnosticStatus::OK, map.summary(), "0"); });
  life.start(300);
  ASSERT_TRUE(until([this] { return cell(3, 1) == "running"; }));
  click("reset");
  ASSERT_TRUE(until([this] { return answer() == "semantic_map/reset: reset done"; })) << answer();

  EXPECT_EQ(part<QPushButton>("pause").text(), "Pause");
  click("pause");
  ASSERT_TRUE(until([this] { return answer() == "semantic_map/pause: pause done"; })) << answer();
  EXPECT_EQ(part<QPushButton>("pause").text(), "Go on");
  click("pause");
  ASSERT_TRUE(until([this] { return answer() == "semantic_map/pause: go on done"; })) << answer();
  EXPECT_EQ(part<QPushButton>("pause").text(), "Pause");
  map.set_paused(true);  // by another client
  ASSERT_TRUE(until([this] { return part<QPushButton>("pause").text() == "Go on"; }));

  choose("save", "/tmp/situation_awareness_panel_test_map");
  ASSERT_TRUE(until([this] {
    return answer() == "semantic_map/save_map: save /tmp/situation_awareness_panel_test_map.json done";
  })) << answer();
  map.good = false;
  choose("load", "/tmp/situation_awareness_panel_test_none.json");
  ASSERT_TRUE(until([&] {
    return answer() == "semantic_map/load_map: cannot load /tmp/situation_awareness_panel_test_none.json";
  })) << answer();
}

TEST_F(PanelTest, DoesNotBlock) {
  click("reset");
  ASSERT_TRUE(until([this] { return answer() == "semantic_map/reset is not available"; })) << answer();

  FakeMap map;
  map.delay_ms = 1500;
  click("reset");
  double longest_s = 0.0;
  auto before = std::chrono::steady_clock::now();
  ASSERT_TRUE(until([&] {
    const auto now = std::chrono::steady_clock::now();
    longest_s = std::max(longest_s, std::chrono::duration<double>(now - before).count());
    before = now;
    return answer() == "semantic_map/reset: reset done";
  }));
  EXPECT_LT(longest_s, 0.7) << "the GUI stood still";

  // Closing a panel during a call does not wait for the response.
  map.delay_ms = 2500;
  click("reset");
  QTest::qWait(500);
  before = std::chrono::steady_clock::now();
  panel_.reset();
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count(), 1.5);
  ASSERT_TRUE(until([&map] { return map.asked().size() == 2; })) << "the server itself goes on";
}

TEST_F(PanelTest, SetsLiveParameters) {
  QWidget& form = part<QWidget>("semantic_map");
  const auto gate = [&form] { return form.findChild<QDoubleSpinBox*>("gate_probability"); };
  EXPECT_EQ(gate(), nullptr);
  auto map = std::make_unique<FakeMap>();
  ASSERT_TRUE(until([&] { return gate() != nullptr && gate()->isEnabled(); }));
  ASSERT_TRUE(until([&] { return gate()->value() == 0.999; })) << gate()->value();
  EXPECT_EQ(gate()->text(), "0.999");
  EXPECT_EQ(gate()->maximum(), 0.999999);
  EXPECT_EQ(form.findChild<QSpinBox*>("max_unseen")->value(), 60);

  type(gate(), "0.95");
  ASSERT_TRUE(until([this] { return answer() == "gate_probability = 0.95"; })) << answer();
  EXPECT_EQ(map->gate_probability(), 0.95);

  map->good = false;
  type(gate(), "0.6");
  ASSERT_TRUE(until([this] { return answer() == "gate_probability = 0.95, not 0.6"; })) << answer();
  EXPECT_EQ(gate()->value(), 0.95);

  map->tell(0.75, 10);  // changed by another client
  ASSERT_TRUE(until([&] { return gate()->value() == 0.75; }));
  EXPECT_EQ(map->asked().size(), 2U) << "what is shown is not set";

  map.reset();
  ASSERT_TRUE(until([&] { return !gate()->isEnabled(); }));
  map = std::make_unique<FakeMap>();
  EXPECT_TRUE(until([&] { return gate()->isEnabled() && gate()->value() == 0.999; }));
}

TEST_F(PanelTest, UsesItsNamespaceAndSavesItInTheConfig) {
  const FakeMap other, own("/robot1");
  QLineEdit& field = part<QLineEdit>("namespace");
  QTest::keyClicks(&field, "/robot1");
  QTest::keyClick(&field, Qt::Key_Return);
  QTest::qWait(500);
  other.say(diagnostic_msgs::DiagnosticStatus::ERROR, "another robot's", "0");
  own.say(diagnostic_msgs::DiagnosticStatus::OK, "running", "0");
  ASSERT_TRUE(until([this] { return cell(3, 1) == "running"; }));
  click("reset");
  ASSERT_TRUE(until([&] { return !own.asked().empty(); }));
  EXPECT_TRUE(other.asked().empty());

  rviz::Config config;
  panel_->save(config);
  SetUp();
  panel_->load(config);
  EXPECT_EQ(part<QLineEdit>("namespace").text(), "/robot1");
  EXPECT_EQ(part<QLineEdit>("stage_names").text(), "segmentation detection mapping semantic_map");
  QTest::keyClicks(&part<QLineEdit>("namespace"), " $");
  QTest::keyClick(&part<QLineEdit>("namespace"), Qt::Key_Return);
  EXPECT_NE(answer(), "") << "no name";
}

TEST_F(PanelTest, ShowsTheStagesThatItIsGiven) {
  const FakeMap map;
  rviz::Config config;
  config.mapSetValue("Stages", "semantic_map gps_ins");
  panel_->load(config);
  EXPECT_EQ(part<QTreeWidget>("stages").topLevelItemCount(), 2);
  EXPECT_EQ(cell(0, 0), "semantic_map");
  EXPECT_EQ(cell(1, 0), "gps_ins");
  EXPECT_EQ(panel_->findChild<QWidget*>("segmentation"), nullptr) << "live parameters of what is not there";
  EXPECT_NE(panel_->findChild<QWidget*>("gps_ins"), nullptr);
  QTest::qWait(500);
  map.say(diagnostic_msgs::DiagnosticStatus::OK, "running", "0");
  ASSERT_TRUE(until([this] { return cell(0, 1) == "running"; }));
  EXPECT_EQ(cell(1, 1), "not there");
  click("reset");
  ASSERT_TRUE(until([this] { return answer() == "semantic_map/reset: reset done"; })) << "whichever is the last stage";

  QLineEdit& field = part<QLineEdit>("stage_names");
  field.selectAll();
  QTest::keyClicks(&field, " ");
  QTest::keyClick(&field, Qt::Key_Return);
  EXPECT_NE(answer(), "") << "no stage";
  EXPECT_EQ(part<QTreeWidget>("stages").topLevelItemCount(), 2) << "what was shown stays";
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  QApplication app(argc, argv);
  ros::init(argc, argv, "rviz_panel_test");
  ros::AsyncSpinner spinner(2);  // of the mock nodes
  spinner.start();
  return RUN_ALL_TESTS();
}
