// SPDX-License-Identifier: BSD-3-Clause
// The display of a test kind of map, chains of points: the functions of MapDisplay for any kind.
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "display_fixture.hpp"
#include "map_display.hpp"
#include "situation_awareness/SegmentArray.h"

namespace situation_awareness {
namespace {

struct Chain {
  std::uint64_t id;
  bool straight;  ///< of two points
  Polyline line_m;
};

/// Draws each segment as a wall along its points.
class ChainDrawing {
 public:
  using Message = SegmentArray;
  using Map = std::vector<Chain>;
  static constexpr const char* kColorings[] = {"id", "straight or bent"};
  static constexpr const char* kColoringsHelp = "A colour for each chain, or one for all that are straight.";

  explicit ChainDrawing(rviz::Property& parent)
      : width_(new rviz::FloatProperty("Width", 0.1F, "Width of the chains in m.", &parent)) {}

  static Map map_of(const SegmentArray& msg) {
    Map map;
    for (const LaserSegment& segment : msg.segments) {
      Chain& chain = map.emplace_back(Chain{map.size(), segment.count == 2, {}});
      for (std::uint32_t i = 0; i < segment.count; ++i) {
        const SegmentPoint& point = msg.points.at(segment.first + i);
        if (!std::isfinite(point.x + point.y)) throw std::invalid_argument("a point is not finite");
        chain.line_m.emplace_back(point.x, point.y);
      }
    }
    return map;
  }

  static std::size_t size_of(const Map& map) { return map.size(); }
  static std::vector<MapPosition> positions_of(const Map& /*map*/) { return {}; }  // chains stay where they are

  static std::vector<MapLabel> labels_of(const Map& map, const MapStyle& style) {
    std::vector<MapLabel> labels;
    for (const Chain& chain : map) {
      const Eigen::Vector2f place_m = chain.line_m.front().cast<float>();
      labels.push_back({label_text(chain.id, ""), {place_m.x(), place_m.y(), static_cast<float>(style.body_height_m)}});
    }
    return labels;
  }

  void draw(const Map& map, const MapHistory& /*history*/, const MapStyle& style, MapMesh& mesh) const {
    clear(mesh);
    for (const Chain& chain : map) {
      const Color color = style.coloring == 0 ? color_of(chain.id) : chain.straight ? kStandingColor : kMovingColor;
      const Paint paint{color, static_cast<float>(style.alpha)};
      const Polyline left = right_of(chain.line_m, -0.5 * width_->getFloat());
      const Polyline right = right_of(chain.line_m, 0.5 * width_->getFloat());
      add_wall(mesh.translucent, chain.line_m, right, 0.0, style.body_height_m, paint);
      add_band(mesh.solid, left, right, style.body_height_m, paint);
    }
  }

 private:
  rviz::FloatProperty* width_;
};

class KindDisplayTest : public DisplayFixture {
 protected:
  void SetUp() override {
    DisplayFixture::SetUp();
    auto* display = new MapDisplay<ChainDrawing>;
    display->setName("Chains");
    manager_->addDisplay(display, true);
    connect(display, node_.advertise<SegmentArray>("chains", 10));
  }

  void publish(double stamp_s, const std::vector<Polyline>& chains, const std::string& frame = "world") {
    SegmentArray msg;
    msg.header.stamp = ros::Time(stamp_s);
    msg.header.frame_id = frame;
    for (const Polyline& chain : chains) {
      LaserSegment& segment = msg.segments.emplace_back();
      segment.first = static_cast<std::uint32_t>(msg.points.size());
      segment.count = static_cast<std::uint32_t>(chain.size());
      for (const Eigen::Vector2d& p_m : chain) {
        msg.points.emplace_back();
        msg.points.back().x = p_m.x();
        msg.points.back().y = p_m.y();
      }
    }
    maps_.publish(msg);
  }

  const Polyline straight_{{-2.0, -1.0}, {2.0, -1.0}}, bent_{{-1.0, 0.0}, {1.0, 0.0}, {1.0, 1.5}};
  static constexpr std::uint64_t kStraight = 0, kBent = 1;
};

TEST_F(KindDisplayTest, DrawsTheChainsWhereTheyAreUntilTheMapIsEmpty) {
  publish(10.0, {straight_, bent_});
  ASSERT_TRUE(until([this] { return status() == "2 elements"; })) << status().toStdString();
  Ogre::Image image = picture();
  EXPECT_NEAR(blob_of(image, color_of(kStraight)).area_m2, 4.0 * 0.1, 0.05);
  EXPECT_NEAR(blob_of(image, color_of(kStraight)).center_m.y(), -1.0, 0.03);
  EXPECT_TRUE(alike(color_at(image, {-0.5, 0.0}), color_of(kBent)));
  EXPECT_TRUE(alike(color_at(image, {1.0, 1.0}), color_of(kBent)));
  EXPECT_FALSE(alike(color_at(image, {0.0, 0.75}), color_of(kBent))) << "between its ends there is nothing";

  publish(10.1, {});
  ASSERT_TRUE(until([this] { return status() == "0 elements"; }));
  image = picture();
  for (const std::uint64_t id : {kStraight, kBent}) EXPECT_EQ(blob_of(image, color_of(id)).area_m2, 0.0);
}

TEST_F(KindDisplayTest, FollowsTheTransformOfTheMapsFrame) {
  publish(10.0, {straight_}, "odom");
  ASSERT_TRUE(until([this] { return status() == "1 elements"; })) << status().toStdString();
  EXPECT_NEAR(blob_of(picture(), color_of(kStraight)).center_m.y(), 0.0, 0.03);
  publish(10.1, {straight_}, "nowhere");
  publish(10.2, {straight_}, "world");
  ASSERT_TRUE(until([this] { return std::abs(blob_of(picture(), color_of(kStraight)).center_m.y() + 1.0) < 0.03; }));
}

TEST_F(KindDisplayTest, HasPropertiesOfItsOwnAndOnesThatAnyKindHas) {
  publish(10.0, {straight_, bent_});
  ASSERT_TRUE(until([this] { return status() == "2 elements"; }));
  display_->subProp("Color")->setValue("straight or bent");
  display_->subProp("Width")->setValue(0.2);
  Ogre::Image image = picture();
  EXPECT_NEAR(blob_of(image, kStandingColor).area_m2, 4.0 * 0.2, 0.05);
  EXPECT_TRUE(alike(color_at(image, {1.0, 1.0}), kMovingColor));
  const auto ink = [this] {  // of the texts, which are dark
    const Ogre::Image with_texts = picture();
    int count = 0;
    for (std::size_t row = 0; row < with_texts.getHeight(); ++row) {
      for (std::size_t column = 0; column < with_texts.getWidth(); ++column) {
        const Ogre::ColourValue color = with_texts.getColourAt(column, row, 0);
        if (color.r + color.g + color.b < 0.3F) ++count;
      }
    }
    return count;
  };
  EXPECT_EQ(ink(), 0);
  display_->subProp("IDs")->setValue(true);
  EXPECT_GT(ink(), 20);
}

TEST_F(KindDisplayTest, KeepsThePictureWhereAMapCannotBeDrawn) {
  publish(10.0, {straight_});
  ASSERT_TRUE(until([this] { return status() == "1 elements"; }));
  publish(10.1, {bent_, {{0.0, std::numeric_limits<double>::quiet_NaN()}, {1.0, 1.0}}});
  ASSERT_TRUE(until([this] { return status() == "not drawn: a point is not finite"; })) << status().toStdString();
  EXPECT_NEAR(blob_of(picture(), color_of(kStraight)).area_m2, 4.0 * 0.1, 0.05);
  display_->reset();
  EXPECT_EQ(blob_of(picture(), color_of(kStraight)).area_m2, 0.0);
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) { return situation_awareness::run_display_tests(argc, argv, "rviz_kind_display_test"); }
