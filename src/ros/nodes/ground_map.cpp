// SPDX-License-Identifier: BSD-3-Clause
// downlink/semantic_map of a robot on another host -> ground/semantic_map/updates, ground/semantic_map_markers for the
// nodes on this host
#include <algorithm>
#include <chrono>
#include <exception>
#include <string>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>
#include <boost/asio/ip/tcp.hpp>

#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/map/map_replica.hpp"
#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/markers/map_markers.hpp"

namespace situation_awareness {
namespace {

const ros::WallDuration kMapTimeout(2.0);  ///< without a map, after which the master is queried
constexpr std::chrono::seconds kAnswerTime(1);
constexpr int kDatagramBytes = 1400;  ///< with all headers less than the Ethernet MTU

/// UDP, because after a broken link the next datagram arrives at once: TCP waits for its next retransmission, which may
/// take as long as the link was down, and then delivers outdated messages. An update that is lost is mended by the next
/// whole map. Markers are made here, so that they need no link and no deletion of a marker is lost.
class GroundMap {
 public:
  explicit GroundMap(const ros::NodeHandle& node) : node_(node) {
    updates_ = node_.advertise<MapUpdate>("ground/semantic_map/updates", 20);
    markers_ = node_.advertise<visualization_msgs::MarkerArray>("ground/semantic_map_markers", 5);
    subscribe();
  }

  /// After a broken link the robot may have closed the connection, or its nodes may be new ones that could not notify
  /// us. The master knows, but a call to it blocks while the link is down, so first check that it responds. A restarted
  /// master may not know the robot's nodes although their connection is alive: it is then kept.
  void check_link() {
    if (ros::SteadyTime::now() - alive_at_ < kMapTimeout) return;
    boost::asio::ip::tcp::iostream master;
    master.expires_after(kAnswerTime);
    master.connect(ros::master::getHost(), std::to_string(ros::master::getPort()));
    if (master && is_published()) {
      subscriber_.shutdown();
      subscribe();
    }
    alive_at_ = ros::SteadyTime::now();
  }

 private:
  bool is_published() const {
    ros::master::V_TopicInfo topics;
    return ros::master::getTopics(topics) && std::any_of(topics.begin(), topics.end(), [this](const auto& topic) {
             return topic.name == node_.resolveName("downlink/semantic_map");
           });
  }

  void subscribe() {
    subscriber_ = node_.subscribe("downlink/semantic_map", 5, &GroundMap::on_update, this,
                                  ros::TransportHints().unreliable().maxDatagramSize(kDatagramBytes));
  }

  void on_update(const MapUpdateConstPtr& msg) {
    alive_at_ = ros::SteadyTime::now();
    updates_.publish(msg);
    try {
      if (replica_.apply(map_delta_from_msg(*msg)) != MapReplica::Verdict::kTaken) return;
      if (markers_.getNumSubscribers() > 0) markers_.publish(draw_.update(replica_.map(), msg->header.frame_id));
    } catch (const std::exception& error) {
      ROS_WARN_STREAM_THROTTLE(5.0, ros::this_node::getName() << ": invalid map: " << error.what());
    }
  }

  ros::NodeHandle node_;
  ros::Publisher updates_, markers_;
  ros::Subscriber subscriber_;
  ros::SteadyTime alive_at_ = ros::SteadyTime::now();
  MapReplica replica_;
  MapMarkers draw_;
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "ground");
  const ros::NodeHandle node;
  situation_awareness::GroundMap ground(node);
  while (ros::ok()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
    ground.check_link();
  }
  return 0;
}
