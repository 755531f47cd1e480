// SPDX-License-Identifier: BSD-3-Clause
// Topics, services, file and parameters of a kind of map that is made for this: posts, which are points with an id.
#include <unistd.h>

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/GetObjects.h"
#include "situation_awareness/LoadObjects.h"
#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/SaveObjects.h"
#include "situation_awareness/SegmentArray.h"
#include "situation_awareness/map/map_file.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/map_publisher.hpp"
#include "situation_awareness/ros/map_services.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {
namespace {

struct Post {
  std::uint64_t id = 0;
  Eigen::Vector2d position_world_m = Eigen::Vector2d::Zero();

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("id", self.id, 1, 1000);
    visit("position_world", self.position_world_m, Bounds{-1e3, 1e3});
  }
};

struct Posts {
  std::string world_frame;
  std::int64_t stamp_ns = -1;
  std::vector<Post> elements;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world_frame", self.world_frame);
    visit("stamp_ns", self.stamp_ns, 0, std::int64_t{1} << 62);
  }
  void validate() const { fields(*this, CheckFields()); }
};

struct PostFormat {
  using Snapshot = Posts;
  static constexpr std::size_t kMaxElements = 100;
  static MapFileHeader header() { return {"Posts.", "situation_awareness posts"}; }
  static std::string comment_on(const Post& /*post*/) { return ""; }
  static void read(Posts& posts, ReadFields& fields, std::uint64_t /*version*/) { Posts::fields(posts, fields); }
  static void read(Post& post, ReadFields& fields, std::uint64_t /*version*/, const Posts& /*snapshot*/) {
    Post::fields(post, fields);
  }
};

/// The posts that were seen last.
class PostMap {
 public:
  static constexpr std::int64_t kNoStamp = -1;

  void update(const Posts& posts) { posts_ = posts; }
  void reset() { posts_.elements.clear(); }
  void resume(const Posts& posts) { posts_ = posts; }
  std::int64_t stamp_ns() const { return posts_.stamp_ns; }
  std::size_t size() const { return posts_.elements.size(); }
  Posts snapshot() const { return posts_; }
  Posts at(std::int64_t stamp_ns) const {
    Posts then = posts_;
    then.stamp_ns = stamp_ns;
    return then;
  }

 private:
  Posts posts_;
};

struct PostMarkers {
  visualization_msgs::MarkerArray update(const Posts& posts, const std::string& /*world_frame*/) const {
    visualization_msgs::MarkerArray markers;
    markers.markers.resize(posts.elements.size());
    return markers;
  }
};

struct PostKind {
  using Map = PostMap;
  using Value = Posts;
  using Message = MappedObjectArray;
  using Get = GetObjects;
  using Save = SaveObjects;
  using Load = LoadObjects;
  using Markers = PostMarkers;
  static constexpr const char* kName = "posts";
  static constexpr const char* kMarkersTopic = "post_markers";

  static MappedObjectArray to_msg(const Posts& posts, const std::string& world_frame) {
    MappedObjectArray msg;
    msg.header.stamp = to_ros_time(posts.stamp_ns);
    msg.header.frame_id = world_frame;
    for (const Post& post : posts.elements) {
      msg.objects.emplace_back();
      msg.objects.back().id = post.id;
    }
    return msg;
  }
  static MappedObjectArray& map_of(GetObjects::Response& response) { return response.objects; }
  static void save(const std::string& file, const Posts& posts) { MapFile<PostFormat>::save(file, posts); }
  static Posts load(const std::string& file, const std::string& world_frame) {
    return MapFile<PostFormat>::load(file, world_frame);
  }
};

struct PostNodeletParams {
  NodeletParams nodelet;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
  }
};

/// Each point is a post.
class PostStage {
 public:
  using Context = StageContext<SegmentArray>;
  static constexpr const char* kInput = "points";
  static constexpr auto kReadParams = read_nodelet_params<PostNodeletParams>;

  PostStage(Context& context, const PostNodeletParams& params)
      : publisher_(context, params.nodelet),
        services_(context, params.nodelet.world_frame, map_,
                  [this](const Posts& posts) { publisher_.publish(posts); }) {}

  bool process(const SegmentArray& msg) {
    if (services_.passes_over()) return false;
    Posts posts;
    posts.stamp_ns = to_nanoseconds(msg.header.stamp);
    for (const SegmentPoint& point : msg.points)
      posts.elements.push_back({posts.elements.size() + 1, {point.x, point.y}});
    map_.update(posts);
    publisher_.publish(map_.at(map_.stamp_ns()));
    return true;
  }

 private:
  PostMap map_;
  MapPublisher<PostKind> publisher_;
  MapServices<PostKind> services_;
};

class MapKindTest : public testing::Test {
 protected:
  void SetUp() override {
    points_ = node_.advertise<SegmentArray>("points", 10);
    count<MappedObjectArray>("posts");
    count<MappedObjectArray>("downlink/posts");
    subscribers_.push_back(node_.subscribe<visualization_msgs::MarkerArray>(
        "post_markers", 10, [this](const visualization_msgs::MarkerArrayConstPtr& msg) {
          const std::lock_guard<std::mutex> lock(mutex_);
          sizes_["post_markers"].push_back(msg->markers.size());
        }));
    ASSERT_TRUE(loader_.load("/keeper", "posts", {}, {}));
    ASSERT_TRUE(ros::service::waitForService("/keeper/load_posts", 10'000));
    ASSERT_TRUE(until([this] { return points_.getNumSubscribers() > 0; }));
    for (const ros::Subscriber& subscriber : subscribers_) {
      ASSERT_TRUE(until([&] { return subscriber.getNumPublishers() > 0; }));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }

  template <class Message>
  void count(const std::string& topic) {
    const boost::function<void(const boost::shared_ptr<const Message>&)> add = [this, topic](const auto& msg) {
      const std::lock_guard<std::mutex> lock(mutex_);
      sizes_[topic].push_back(msg->objects.size());
    };
    subscribers_.push_back(node_.subscribe<Message>(topic, 10, add));
  }

  static bool until(const std::function<bool()>& condition) {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(10.0);
    while (!condition() && ros::SteadyTime::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return condition();
  }

  void publish(std::size_t points) {
    SegmentArray msg;
    msg.header.stamp = ros::Time::now();
    msg.points.resize(points);
    points_.publish(msg);
  }

  /// The number of elements in each message of a topic.
  std::vector<std::size_t> sizes(const std::string& topic) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return sizes_[topic];
  }

  template <class Service>
  static Service call(const std::string& name, typename Service::Request request = {}) {
    Service service;
    service.request = request;
    EXPECT_TRUE(ros::service::call(name, service)) << name;
    return service;
  }
  template <class Service>
  static Service call_with(const std::string& name, const std::string& file) {
    typename Service::Request request;
    request.file = file;
    return call<Service>(name, request);
  }

  using Sizes = std::vector<std::size_t>;
  ros::NodeHandle node_;
  ros::Publisher points_;
  std::vector<ros::Subscriber> subscribers_;
  std::mutex mutex_;
  std::map<std::string, Sizes> sizes_;
  const std::string file_ = testing::TempDir() + "posts_" + std::to_string(::getpid()) + ".yaml";
  nodelet::Loader loader_{boost::function<boost::shared_ptr<nodelet::Nodelet>(const std::string&)>(
      [](const std::string&) { return boost::make_shared<StageNodelet<PostStage>>(); })};
};

TEST_F(MapKindTest, TopicsAndServicesBearItsName) {
  EXPECT_FALSE(call<GetObjects>("/get_posts").response.success) << "there is no map yet";
  EXPECT_FALSE(call_with<SaveObjects>("/keeper/save_posts", file_).response.success);
  publish(2);
  ASSERT_TRUE(until([this] { return sizes("post_markers") == Sizes{2}; }));
  EXPECT_EQ(sizes("posts"), Sizes{2});
  EXPECT_EQ(sizes("downlink/posts"), Sizes{2});
  const GetObjects got = call<GetObjects>("/get_posts");
  ASSERT_TRUE(got.response.success) << got.response.message;
  ASSERT_EQ(got.response.objects.objects.size(), 2U);
  EXPECT_EQ(got.response.objects.objects[1].id, 2U);
  EXPECT_EQ(got.response.objects.header.frame_id, "world");

  EXPECT_TRUE(call<std_srvs::SetBool>("/keeper/pause",
                                      [] {
                                        std_srvs::SetBool::Request pause;
                                        pause.data = 1;
                                        return pause;
                                      }())
                  .response.success);
  publish(5);
  const SaveObjects saved = call_with<SaveObjects>("/keeper/save_posts", file_);
  EXPECT_TRUE(saved.response.success) << saved.response.message;
  EXPECT_TRUE(call<std_srvs::Trigger>("/keeper/reset").response.success);
  ASSERT_TRUE(until([this] { return sizes("posts") == Sizes{2, 0}; })) << "what came in the pause is passed over";
  EXPECT_FALSE(call_with<LoadObjects>("/keeper/load_posts", "posts.yaml").response.success) << "no absolute path";
  const LoadObjects loaded = call_with<LoadObjects>("/keeper/load_posts", file_);
  EXPECT_TRUE(loaded.response.success) << loaded.response.message;
  ASSERT_TRUE(until([this] { return sizes("posts") == Sizes{2, 0, 2}; }));
  ::unlink(file_.c_str());
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "map_kind_test");
  ros::NodeHandle node;  // outlives those of the tests: without a node there is no log
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
