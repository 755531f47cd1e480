// SPDX-License-Identifier: BSD-3-Clause
// StageNodelet with stages made for this test.
#include <atomic>
#include <chrono>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/DetectionArray.h"
#include "situation_awareness/SegmentArray.h"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {
namespace {

struct EchoParams {
  std::vector<UnknownKey> unknown;
};

EchoParams read_echo_params(const ParamReader& reader) {
  return {{UnknownKey{reader.source(), "echo.wrong", {"echo.right"}}}};
}

/// Publishes a DetectionArray for each SegmentArray. `resolution` selects failure or drop.
class EchoStage {
 public:
  using Context = StageContext<SegmentArray>;
  static constexpr const char* kInput = "in";
  static constexpr auto kReadParams = read_echo_params;
  static constexpr double kThrow = 1.0, kDrop = 2.0;

  EchoStage(Context& context, const EchoParams& /*params*/)
      : context_(context), publisher_(context.node().advertise<DetectionArray>("out", 100)) {
    context.on_arrival(
        [this](const SegmentArrayConstPtr& msg, const ros::SteadyTime& arrival) {
          if (msg->resolution < 0.0) throw std::runtime_error("a negative resolution");
          context_.enqueue(msg, arrival);
        },
        [] { return 0; });
    context.every(0.001, [this] {
      EXPECT_TRUE(made_) << "called while it is made";
      ++ticks_;
    });
    context.when_made([this] {
      server_ = context_.private_node().advertiseService<std_srvs::TriggerRequest, std_srvs::TriggerResponse>(
          "ticks", [this](std_srvs::TriggerRequest&, std_srvs::TriggerResponse& response) {
            response.success = true;
            response.message = std::to_string(ticks_);
            return true;
          });
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(200));  // as one that loads a model
    made_ = true;
  }

  bool process(const SegmentArray& msg) {
    EXPECT_TRUE(made_) << "called while it is made";
    if (msg.resolution == kThrow) throw std::runtime_error("as told");
    if (msg.resolution == kDrop) return context_.drop(drop_reason::kBadMessage);
    DetectionArray output;
    output.header = msg.header;
    context_.publish(publisher_, output);
    return true;
  }

 private:
  Context& context_;
  std::atomic<bool> made_{false};
  int ticks_ = 0;
  ros::Publisher publisher_;
  ros::ServiceServer server_;
};

/// Refuses to start.
class BrokenStage {
 public:
  using Context = StageContext<SegmentArray>;
  static constexpr const char* kInput = "in";
  static constexpr auto kReadParams = read_echo_params;
  BrokenStage(Context& context, const EchoParams& /*params*/) {
    context.when_made([] { ADD_FAILURE() << "it does not run"; });
    throw std::invalid_argument("no model");
  }
  bool process(const SegmentArray& /*msg*/) { return true; }
};

boost::shared_ptr<nodelet::Nodelet> make(const std::string& type) {
  if (type == "echo") return boost::make_shared<StageNodelet<EchoStage>>();
  return boost::make_shared<StageNodelet<BrokenStage>>();
}

class StageNodeletTest : public testing::Test {
 protected:
  void SetUp() override {
    publisher_ = node_.advertise<SegmentArray>("in", 1000);
    out_ = node_.subscribe<DetectionArray>("out", 1000, [this](const DetectionArrayConstPtr& msg) {
      const std::lock_guard<std::mutex> lock(mutex_);
      outputs_.push_back(*msg);
    });
    diagnostics_ = node_.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 100, [this](const diagnostic_msgs::DiagnosticArrayConstPtr& msg) {
          const std::lock_guard<std::mutex> lock(mutex_);
          for (const auto& status : msg->status) {
            std::map<std::string, std::string>& said = said_[status.name];
            for (const auto& pair : status.values) said[pair.key] = pair.value;
            said["summary"] = status.message;
          }
        });
  }

  bool load(const std::string& name, const std::string& type) { return loader_.load(name, type, {}, {}); }
  bool is_connected() const { return publisher_.getNumSubscribers() > 0 && out_.getNumPublishers() > 0; }

  /// One message, which another one follows only after 10 ms: no flood.
  SegmentArray publish(double resolution = 0.0, double latency = 0.0) {
    const auto msg = boost::make_shared<SegmentArray>();
    msg->header.seq = ++count_;
    msg->header.stamp = ros::Time::now();
    msg->resolution = resolution;
    msg->latency = latency;
    publisher_.publish(msg);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return *msg;
  }

  std::vector<DetectionArray> outputs() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return outputs_;
  }
  std::string said(const std::string& key) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return said_["echo: stage"][key];
  }
  bool is_said_of(const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return said_.count(name + ": stage") > 0;
  }

  static bool until(const std::function<bool()>& condition, double timeout_s = 10.0) {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(timeout_s);
    while (!condition() && ros::SteadyTime::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return condition();
  }
  bool is_output(const SegmentArray& msg) {
    return until([&] { return !outputs().empty() && outputs().back().header.stamp == msg.header.stamp; }, 2.0);
  }

  ros::NodeHandle node_;
  ros::Publisher publisher_;
  ros::Subscriber out_, diagnostics_;
  std::mutex mutex_;
  std::vector<DetectionArray> outputs_;
  std::map<std::string, std::map<std::string, std::string>> said_;
  unsigned count_ = 0;
  nodelet::Loader loader_{boost::function<boost::shared_ptr<nodelet::Nodelet>(const std::string&)>(make)};
};

TEST_F(StageNodeletTest, AStageThatThrowsIsNotLoadedAndOthersAre) {
  EXPECT_FALSE(load("/broken", "broken"));
  EXPECT_TRUE(loader_.listLoadedNodelets().empty());
  ASSERT_TRUE(load("/echo", "echo"));
  ASSERT_TRUE(until([this] { return is_connected(); }));
  EXPECT_TRUE(is_output(publish()));
  ASSERT_TRUE(until([this] { return is_said_of("echo"); }));
  EXPECT_FALSE(is_said_of("broken")) << "one that does not start says so in the log alone";
}

TEST_F(StageNodeletTest, EveryMessageIsAccountedForAlsoWhereTheStageThrows) {
  ASSERT_TRUE(load("/echo", "echo"));
  ASSERT_TRUE(until([this] { return is_connected(); }));
  publish(EchoStage::kThrow);
  publish(EchoStage::kDrop);
  publish(-1.0);
  EXPECT_TRUE(is_output(publish()));
  ASSERT_TRUE(until([this] { return said("received") == "4"; }));
  EXPECT_EQ(said("processed"), "1");
  EXPECT_EQ(said("waiting"), "0");
  EXPECT_EQ(said(std::string("dropped: ") + drop_reason::kError), "2");
  EXPECT_EQ(said(std::string("dropped: ") + drop_reason::kBadMessage), "1");
  EXPECT_NE(said("unknown parameter echo.wrong"), "");
}

TEST_F(StageNodeletTest, LatencyAddsUp) {
  ASSERT_TRUE(load("/echo", "echo"));
  ASSERT_TRUE(until([this] { return is_connected(); }));
  ASSERT_TRUE(is_output(publish(0.0, 2.5)));
  EXPECT_GT(outputs().back().latency, 2.5);
  EXPECT_LT(outputs().back().latency, 4.5);
  using Limits = std::numeric_limits<double>;
  for (const double nonsense : {Limits::quiet_NaN(), -3.0, Limits::infinity()}) {
    ASSERT_TRUE(is_output(publish(0.0, nonsense)));
    EXPECT_GT(outputs().back().latency, 0.0);
    EXPECT_LT(outputs().back().latency, 2.0);
  }
}

TEST_F(StageNodeletTest, NothingIsCalledDuringConstruction) {
  std::atomic<bool> loaded{false};
  std::thread loading([&] { loaded = load("/echo", "echo"); });
  while (!loaded) publish();
  loading.join();
  EXPECT_TRUE(until([&] { return is_output(publish()); })) << "and then what is published";
}

TEST_F(StageNodeletTest, ServicesAnswerAndTimersRun) {
  ASSERT_TRUE(load("/echo", "echo"));
  ASSERT_TRUE(ros::service::waitForService("/echo/ticks", 10000));
  std_srvs::Trigger trigger;
  ASSERT_TRUE(until([&] { return ros::service::call("/echo/ticks", trigger) && trigger.response.message.size() > 1; }));
}

TEST_F(StageNodeletTest, IsUnloadedUnderLoad) {
  std::atomic<bool> stop{false};
  std::thread flood([&] {
    while (!stop) {
      publisher_.publish(boost::make_shared<SegmentArray>());
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
  });
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(load("/echo", "echo"));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_TRUE(loader_.unload("/echo"));
  }
  stop = true;
  flood.join();
  EXPECT_FALSE(outputs().empty());
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "stage_nodelet_test");
  ros::NodeHandle node;  // outlives those of the tests, which need it for the log
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
