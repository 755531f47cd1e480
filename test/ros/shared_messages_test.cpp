// SPDX-License-Identifier: BSD-3-Clause
// Messages between the stages are not serialised: subscribers get the published object itself. This test is the manager
// into which launch/map.launch loads the nodelets.
#include <atomic>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <ros/xmlrpc_manager.h>
#include <sensor_msgs/LaserScan.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/DetectionArray.h"
#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/SegmentArray.h"
#include "situation_awareness/ros/backlog.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {
namespace {

/// One round object, 3 m ahead.
sensor_msgs::LaserScanPtr scan_msg(const ros::Time& stamp) {
  auto msg = boost::make_shared<sensor_msgs::LaserScan>();
  msg->header.stamp = stamp;
  msg->header.frame_id = "lidar";
  msg->angle_min = -1.57F;
  msg->angle_increment = 0.005F;
  msg->range_min = 0.1F;
  msg->range_max = 30.0F;
  constexpr double kDistance_m = 3.0, kRadius_m = 0.25;
  for (int i = 0; i < 629; ++i) {
    const double angle_rad = msg->angle_min + msg->angle_increment * static_cast<float>(i);
    const double aside_m = kDistance_m * std::sin(angle_rad);
    const bool hit = std::abs(aside_m) < kRadius_m && std::cos(angle_rad) > 0.0;
    msg->ranges.push_back(hit ? static_cast<float>(kDistance_m * std::cos(angle_rad) -
                                                   std::sqrt(kRadius_m * kRadius_m - aside_m * aside_m))
                              : INFINITY);
  }
  msg->angle_max = msg->angle_min + msg->angle_increment * 628.0F;
  return msg;
}

bool wait_until(const std::function<bool()>& condition, double timeout_s) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout_s);
  while (!condition()) {
    if (ros::WallTime::now() > end || !ros::ok()) return false;
    ros::WallDuration(0.01).sleep();
  }
  return true;
}

/// The messages received by this process on a topic, over all connections.
struct Received {
  int connections = 0, messages = 0, bytes = 0;
};

/// By topic, from roscpp's statistics. Bytes are those serialised: none for a shared message.
std::map<std::string, Received> received_by_topic() {
  XmlRpc::XmlRpcClient client("127.0.0.1", static_cast<int>(ros::XMLRPCManager::instance()->getServerPort()), "/");
  XmlRpc::XmlRpcValue caller, answer;
  caller[0] = ros::this_node::getName();
  std::map<std::string, Received> by_topic;
  if (!client.execute("getBusStats", caller, answer)) return by_topic;
  XmlRpc::XmlRpcValue& subscriptions = answer[1];  // of [publications, subscriptions, services]
  for (int i = 0; i < subscriptions.size(); ++i) {
    Received& received = by_topic[static_cast<std::string&>(subscriptions[i][0])];
    XmlRpc::XmlRpcValue& connections = subscriptions[i][1];  // of [id, bytes, messages, drops, 0]
    for (int k = 0; k < connections.size(); ++k) {
      ++received.connections;
      received.bytes += static_cast<int&>(connections[k][1]);
      received.messages += static_cast<int&>(connections[k][2]);
    }
  }
  return by_topic;
}

TEST(Stages, NothingIsSerialisedFromScanToMap) {
  ros::NodeHandle node;
  ros::Publisher scans = node.advertise<sensor_msgs::LaserScan>("scan", 10);
  std::atomic<int> maps{0};
  ros::Time latest;  // roscpp may deliver a message twice: TimedSubscriber
  const ros::Subscriber map_subscriber =
      node.subscribe<MappedObjectArray>("objects", 0, [&maps, &latest](const MappedObjectArrayConstPtr& msg) {
        maps += !msg->objects.empty() && msg->header.stamp != latest;
        latest = msg->header.stamp;
      });
  const ros::Subscriber copies_subscriber = node.subscribe<sensor_msgs::LaserScan>(
      "copies", 0, +[](const sensor_msgs::LaserScanConstPtr&) {});
  ros::Publisher copies = node.advertise<sensor_msgs::LaserScan>("copies", 10);
  ASSERT_TRUE(wait_until([&] { return map_subscriber.getNumPublishers() > 0 && scans.getNumSubscribers() > 0; }, 60.0));

  ASSERT_TRUE(wait_until(
      [&] {
        const sensor_msgs::LaserScanPtr msg = scan_msg(ros::Time::now());
        scans.publish(msg);
        copies.publish(*msg);
        ros::WallDuration(0.05).sleep();
        return maps >= 20;
      },
      30.0));
  std::map<std::string, Received> received = received_by_topic();
  for (const std::string topic : {"/scan", "/segments", "/detections", "/objects"}) {
    EXPECT_EQ(received[topic].connections, 1) << topic << ": from its publisher, for all that listen to it";
    EXPECT_GE(received[topic].messages, 20) << topic;
    EXPECT_EQ(received[topic].bytes, 0) << topic;
  }
  EXPECT_GE(received["/copies"].messages, 20);
  EXPECT_GT(received["/copies"].bytes, 20 * 629 * 4) << "what is published by reference is serialised";
}

/// Subscribes to `topic` like the stages.
template <typename M>
class Listener {
 public:
  Listener(ros::NodeHandle& node, const std::string& topic)
      : diagnostics_("listener"),
        backlog_(node, diagnostics_,
                 [this](const boost::shared_ptr<const M>& msg, const ros::SteadyTime&) {
                   std::atomic_store(&handled_, std::make_shared<Held>(Held{msg}));
                 }),
        subscriber_(node, topic, [this](const boost::shared_ptr<const M>& msg, const ros::SteadyTime& arrival) {
          backlog_.add(msg, arrival);
        }) {}

  const M* handled() const {
    const auto held = std::atomic_load(&handled_);
    return held ? held->msg.get() : nullptr;
  }

 private:
  struct Held {
    boost::shared_ptr<const M> msg;
  };

  std::shared_ptr<Held> handled_;
  StageDiagnostics diagnostics_;
  Backlog<M> backlog_;
  TimedSubscriber<M> subscriber_;
};

template <typename M>
class SharedMessages : public testing::Test {};
using Messages = testing::Types<sensor_msgs::LaserScan, SegmentArray, DetectionArray>;
TYPED_TEST_SUITE(SharedMessages, Messages);

TYPED_TEST(SharedMessages, WhatIsPublishedIsWhatIsHandled) {
  ros::NodeHandle node("identity");
  ros::Publisher publisher = node.advertise<TypeParam>("topic", 10);
  Listener<TypeParam> first(node, "topic"), second(node, "topic");
  for (int i = 0; i < 10; ++i) {
    auto msg = boost::make_shared<TypeParam>();
    msg->header.stamp = ros::Time::now();
    publisher.publish(msg);
    EXPECT_TRUE(wait_until([&] { return first.handled() == msg.get() && second.handled() == msg.get(); }, 5.0));
  }
}

TEST(TimedSubscriber, ASharedMessageIsTakenOnceHoweverOftenItIsDelivered) {
  ros::NodeHandle node("once");
  ros::Publisher publisher = node.advertise<DetectionArray>("topic", 10);
  std::atomic<int> taken{0};
  std::atomic<std::uint32_t> latest{0};
  const TimedSubscriber<DetectionArray> subscriber(node, "topic",
                                                   [&](const DetectionArrayConstPtr& msg, const ros::SteadyTime&) {
                                                     ++taken;
                                                     latest = msg->header.stamp.sec;
                                                   });
  for (std::uint32_t second = 1; second <= 5; ++second) {
    auto msg = boost::make_shared<DetectionArray>();
    msg->header.stamp.sec = second;
    publisher.publish(msg);
    publisher.publish(msg);
  }
  ASSERT_TRUE(wait_until([&] { return latest == 5; }, 10.0));
  ros::WallDuration(0.1).sleep();  // for the last one again
  EXPECT_EQ(taken, 5);
}

TEST(TimedSubscriber, ArrivalIsWhenAMessageCameAlsoWhereItIsProcessedLater) {
  ros::NodeHandle node("arrival");
  ros::Publisher publisher = node.advertise<DetectionArray>("topic", 10);
  std::vector<double> late_s;
  std::vector<ros::SteadyTime> published(3);
  std::atomic<std::size_t> done{0};
  const ros::WallDuration busy(0.2);
  const TimedSubscriber<DetectionArray> subscriber(node, "topic",
                                                   [&](const DetectionArrayConstPtr&, const ros::SteadyTime& arrival) {
                                                     late_s.push_back((arrival - published[done]).toSec());
                                                     busy.sleep();
                                                     ++done;
                                                   });
  for (ros::SteadyTime& time : published) {
    time = ros::SteadyTime::now();
    publisher.publish(boost::make_shared<DetectionArray>());
  }
  ASSERT_TRUE(wait_until([&] { return done == published.size(); }, 10.0));
  for (const double each_s : late_s) {
    EXPECT_GE(each_s, 0.0);
    EXPECT_LT(each_s, 0.5 * busy.toSec());
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "map_manager");
  nodelet::Loader loader;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const int result = RUN_ALL_TESTS();
  ros::shutdown();  // before the loader ends, as in the program nodelet
  return result;
}
