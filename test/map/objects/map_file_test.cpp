// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/map_file.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "support/lively_scene.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::map_file_test {
namespace {

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'123;

MapSnapshot snapshot_of(const ObjectMap& map) {
  MapSnapshot snapshot = map.snapshot();
  snapshot.world_frame = "world";
  return snapshot;
}

/// The map after `scans` scans of the lively scene.
ObjectMap lively_map(int scans, const ObjectMapParams& params = {}) {
  ObjectMap map(params);
  for (const Detections& detections : lively_scene(scans, kStart_ns, 1)) map.update(detections);
  return map;
}

/// The message of the exception on reading this text.
std::string refusal(const std::string& yaml) {
  return refusal_of([&] { map_from_yaml(yaml, "a.yaml"); });
}

/// The file with the last line of an edited file.
std::string edited(std::string yaml) {
  const std::size_t last_line = yaml.rfind("\nsha256: ") + 1;
  return yaml.substr(0, last_line) + "sha256: edited\n";
}

/// Replaces the value of the `count`th line that begins with this name; `value` may be several lines.
std::string with(std::string yaml, const std::string& name, const std::string& value, int count = 1) {
  std::size_t at = 0;
  for (int i = 0; i < count; ++i) {
    at = yaml.find(" " + name + ":", at + 1);
    if (at == std::string::npos) at = yaml.find("\n" + name + ":");
  }
  EXPECT_NE(at, std::string::npos) << name;
  const std::size_t from = at + name.size() + 2;
  return yaml.replace(from, yaml.find('\n', from) - from, " " + value);
}

/// The snapshot without the legs of persons, which versions before 3 do not have.
MapSnapshot without_legs(MapSnapshot snapshot) {
  for (MapElement& element : snapshot.elements) {
    element.other_leg = 0;
    element.other_leg_log_odds = 0.0;
    element.leg_offset_world_m.setZero();
  }
  return snapshot;
}

constexpr std::array kOfVersionThree = {
    "moving_scans",       "class",          "p_class",        "other_leg",
    "other_leg_log_odds", "leg_offset_x_m", "leg_offset_y_m", "leg_offset_variance_m2",
    "box_log_odds",       "box_psi"};

/// The file as versions before 3 have it.
std::string before_version_three(const std::string& yaml) {
  std::istringstream lines(yaml);
  std::string old, line;
  while (std::getline(lines, line)) {
    const bool is_new = std::any_of(kOfVersionThree.begin(), kOfVersionThree.end(), [&](const char* key) {
      return line.rfind("    " + std::string(key) + ":", 0) == 0;
    });
    if (line.rfind("    moving_scans:", 0) == 0) {
      old += "    moves: " + std::string(line.back() == '0' ? "false\n" : "true\n");
    }
    if (!is_new) old += line + '\n';
  }
  return old;
}

void expect_same(const Objects& a, const Objects& b) {
  ASSERT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.height_world_m, b.height_world_m);
  ASSERT_EQ(a.objects.size(), b.objects.size());
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    const Object& p = a.objects[i];
    const Object& q = b.objects[i];
    EXPECT_EQ(p.id, q.id);
    EXPECT_EQ(p.ellipse_world.center_m, q.ellipse_world.center_m);
    EXPECT_EQ(p.ellipse_world.psi_rad, q.ellipse_world.psi_rad);
    EXPECT_EQ(p.ellipse_world.rx_m, q.ellipse_world.rx_m);
    EXPECT_EQ(p.ellipse_world.ry_m, q.ellipse_world.ry_m);
    EXPECT_EQ(p.velocity_world_m_s, q.velocity_world_m_s);
    EXPECT_EQ(p.angular_velocity_rad_s, q.angular_velocity_rad_s);
    EXPECT_EQ(p.covariance, q.covariance);
    EXPECT_EQ(p.p_moving, q.p_moving);
    EXPECT_EQ(p.p_exists, q.p_exists);
    EXPECT_EQ(p.first_seen_ns, q.first_seen_ns);
    EXPECT_EQ(p.last_seen_ns, q.last_seen_ns);
    EXPECT_EQ(p.observations, q.observations);
    EXPECT_EQ(p.beams, q.beams);
    EXPECT_EQ(p.object_class, q.object_class);
    EXPECT_EQ(p.p_class, q.p_class);
    EXPECT_EQ(p.shape, q.shape);
    EXPECT_EQ(p.p_shape, q.p_shape);
  }
}

// One map sees the whole scene. Maps restored from its files see what it sees for the next 4 s.
TEST(MapFile, ASavedAndRestoredMapContinuesBitForBit) {
  constexpr std::size_t kScans = 80;
  struct Restored {
    std::size_t scans_before;
    ObjectMap map;
  };
  for (const std::string shape : {"ellipse", "circle"}) {
    ObjectMapParams params;
    params.shape = shape;
    params.max_unseen_s = 3.0;
    const std::vector<Detections> scene = lively_scene(300, kStart_ns, 2);
    ObjectMap map(params);
    std::deque<Restored> all_restored;
    int parts = 0;
    int forgotten = 0;
    for (std::size_t i = 0; i < scene.size(); ++i) {
      const ObjectMapUpdate a = map.update(scene[i]);
      const Objects now = map.at(map.stamp_ns());
      const Objects later = map.at(map.stamp_ns() + 700'000'000);
      for (Restored& restored : all_restored) {
        const ObjectMapUpdate b = restored.map.update(scene[i]);
        EXPECT_EQ(a.updated, b.updated);
        EXPECT_EQ(a.created, b.created);
        EXPECT_EQ(a.deleted, b.deleted);
        EXPECT_EQ(a.reasons, b.reasons);
        EXPECT_EQ(a.log_likelihood, b.log_likelihood);
        forgotten += static_cast<int>(b.deleted.size());
        expect_same(now, restored.map.at(now.stamp_ns));
        expect_same(later, restored.map.at(later.stamp_ns));
        if (HasFailure()) FAIL() << shape << ": saved after " << restored.scans_before << ", differs after " << i;
      }
      const bool ends = i + 1 == scene.size();
      while (!all_restored.empty() && (ends || i + 1 == all_restored.front().scans_before + kScans)) {
        ASSERT_EQ(map_to_yaml(snapshot_of(map)), map_to_yaml(snapshot_of(all_restored.front().map)));
        for (const MapElement& element : map.snapshot().elements) parts += element.is_part ? 1 : 0;
        all_restored.pop_front();
      }
      if (i % 11 != 2 || ends) continue;
      all_restored.push_back({i + 1, ObjectMap(params)});
      ObjectMap& restored = all_restored.back().map;
      restored.restore(map_from_yaml(map_to_yaml(snapshot_of(map)), "a.yaml"));
      expect_same(now, restored.at(restored.stamp_ns()));
    }
    EXPECT_GT(parts, 0) << "the scene is not as lively as it should be";
    EXPECT_GT(forgotten, 10) << "the scene is not as lively as it should be";
  }
}

TEST(MapFile, ReadsVersionOne) {
  MapSnapshot snapshot = snapshot_of(lively_map(60));
  snapshot.elements.at(0).state = TrackState::kTentative;
  snapshot.elements.at(1).state = TrackState::kConfirmed;
  snapshot.elements.at(1).last_seen_ns = snapshot.stamp_ns - 500'000'000;
  snapshot.elements.at(2).state = TrackState::kLost;
  snapshot.elements.at(2).last_seen_ns = snapshot.stamp_ns - 500'000'001;
  snapshot.elements.resize(3);
  for (MapElement& element : snapshot.elements) {
    element.body = 0;
    element.moving_scans = std::min(element.moving_scans, 1);  // all that was written of it
  }
  const std::string yaml = map_to_yaml(without_legs(snapshot));
  std::string old = with(before_version_three(yaml), "version", "1");
  for (const char* state : {"tentative", "confirmed", "lost"}) {
    const std::string line = std::string("    state: ") + state + "\n";
    const std::size_t at = old.find(line);
    ASSERT_NE(at, std::string::npos);
    old.replace(at, line.size(), std::string("    confirmed: ") + (*state == 't' ? "false" : "true") + "\n");
  }
  EXPECT_EQ(map_to_yaml(map_from_yaml(edited(old), "a.yaml")), yaml);
  // Each version knows only its own field.
  EXPECT_TRUE(names(refusal(edited(with(old, "confirmed", "yes"))), {"confirmed"}));
  EXPECT_TRUE(names(refusal(edited(with(before_version_three(yaml), "version", "1"))), {"confirmed"}));
  EXPECT_TRUE(names(refusal(edited(with(old, "version", "2"))), {"state"}));
}

TEST(MapFile, ReadsVersionTwo) {
  MapSnapshot snapshot = without_legs(snapshot_of(lively_map(60)));
  for (MapElement& element : snapshot.elements) element.moving_scans = std::min(element.moving_scans, 1);
  const std::string yaml = map_to_yaml(snapshot);
  const std::string old = with(before_version_three(yaml), "version", "2");
  EXPECT_EQ(map_to_yaml(map_from_yaml(edited(old), "a.yaml")), yaml) << "of unknown class";
  EXPECT_TRUE(names(refusal(edited(with(yaml, "version", "2"))), {"class"}));
  EXPECT_TRUE(names(refusal(edited(with(old, "version", "3"))), {"moving_scans"}));
}

TEST(MapFile, KeepsClassAndShape) {
  ObjectMap map = lively_map(60);
  MapSnapshot snapshot = snapshot_of(map);
  const std::uint64_t id = map.at(map.stamp_ns()).objects.at(0).id;
  for (MapElement& element : snapshot.elements) {
    if (element.id != id) continue;
    element.object_class = ObjectClass::kPerson;
    element.p_class = 0.8;
    element.box_log_odds = 2.0;
    element.box_psi_rad = 0.3;
  }
  map.restore(map_from_yaml(map_to_yaml(snapshot), "a.yaml"));
  const Objects objects = map.at(map.stamp_ns());
  EXPECT_EQ(objects.objects.at(0).object_class, ObjectClass::kPerson);
  EXPECT_EQ(objects.objects.at(0).p_class, 0.8);
  EXPECT_EQ(objects.objects.at(0).shape, Shape::kBox);
  EXPECT_NEAR(objects.objects.at(0).p_shape, 1.0 / (1.0 + std::exp(-2.0)), 1e-12);
  EXPECT_EQ(objects.objects.at(1).object_class, ObjectClass::kUnknown);
}

TEST(MapFile, AnEmptyMapIsAMap) {
  ObjectMap map{ObjectMapParams()};
  Detections none;
  none.stamp_ns = kStart_ns;
  map.update(none);
  const MapSnapshot snapshot = map_from_yaml(map_to_yaml(snapshot_of(map)), "a.yaml");
  EXPECT_EQ(snapshot.stamp_ns, kStart_ns);
  EXPECT_TRUE(snapshot.elements.empty());
}

TEST(MapFile, BeforeItsFirstUpdateThereIsNothingToSave) {
  EXPECT_THROW(map_to_yaml(snapshot_of(ObjectMap{ObjectMapParams()})), std::invalid_argument);
}

TEST(MapFile, KeepsTheFirstAndTheLastBitOfEveryNumber) {
  MapSnapshot snapshot = snapshot_of(lively_map(40));
  snapshot.height_world_m = -0.0;
  snapshot.elements[0].estimate.moving.x(0) = 0.1 + 0.2;
  snapshot.elements[0].estimate.moving.x(2) = 5e-324;
  snapshot.elements[0].stood_s = std::nextafter(1e9, 0.0);
  snapshot.next_id = std::uint64_t{1} << 53;
  const MapSnapshot read = map_from_yaml(map_to_yaml(snapshot), "a.yaml");
  EXPECT_TRUE(std::signbit(read.height_world_m));
  EXPECT_EQ(read.elements[0].estimate.moving.x, snapshot.elements[0].estimate.moving.x);
  EXPECT_EQ(read.elements[0].stood_s, snapshot.elements[0].stood_s);
  EXPECT_EQ(read.next_id, snapshot.next_id);
  EXPECT_EQ(read.stamp_ns, snapshot.stamp_ns);
}

TEST(MapFile, CutOffAnywhereItIsRefused) {
  const std::string yaml = map_to_yaml(snapshot_of(lively_map(20)));
  for (const std::string& whole : {yaml, edited(yaml)}) {
    EXPECT_EQ(refusal(whole), "");
    for (std::size_t size = 0; size < whole.size(); ++size) {
      ASSERT_TRUE(names(refusal(whole.substr(0, size)), {"a.yaml", "sha256"})) << size;
    }
  }
}

/// Some bytes changed, lost, doubled or put in.
std::string damaged(std::string yaml, Random& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random.uniform() * static_cast<double>(n)); };
  for (std::size_t damages = 1 + below(3); damages > 0; --damages) {
    const std::size_t at = below(yaml.size());
    const std::size_t count = 1 + below(20);
    switch (below(5)) {
      case 0:
        yaml[at] = static_cast<char>(yaml[at] ^ (1 << below(8)));
        break;
      case 1:
        yaml[at] = static_cast<char>(below(256));
        break;
      case 2:
        yaml.erase(at, count);
        break;
      case 3:
        yaml.insert(at, yaml.substr(below(yaml.size()), count));
        break;
      default:
        yaml[at] = "0123456789-.e:{[&*#\n"[below(20)];
    }
  }
  return yaml;
}

TEST(MapFileStatistics, DamagedItIsRefused) {
  const std::string yaml = map_to_yaml(snapshot_of(lively_map(40)));
  Random random(1);
  for (int i = 0; i < 5000; ++i) {
    const std::string file = damaged(yaml, random);
    if (file == yaml) continue;
    ASSERT_TRUE(has_fact(refusal(file), "a.yaml")) << i;
  }
}

TEST(MapFileStatistics, DamagedAndEditedItIsRefusedOrAValidMap) {
  MapSnapshot few = snapshot_of(lively_map(8));
  few.elements.resize(2);
  const std::string yaml = edited(map_to_yaml(few));
  const std::vector<Detections> scene = lively_scene(13, kStart_ns, 1);
  Random random(2);
  int maps = 0;
  for (int i = 0; i < 4000; ++i) {
    const std::string file = edited(damaged(yaml, random));
    MapSnapshot snapshot;
    try {
      snapshot = map_from_yaml(file, "a.yaml");
    } catch (const std::invalid_argument& error) {
      ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
      continue;
    }
    ++maps;
    ObjectMap map{ObjectMapParams()};
    map.resume(snapshot);
    for (std::size_t k = 8; k < scene.size(); ++k) map.update(scene[k]);
    for (const Object& object : map.at(map.stamp_ns()).objects) {
      ASSERT_TRUE(object.covariance.allFinite() && object.ellipse_world.center_m.allFinite()) << i;
    }
  }
  EXPECT_GT(maps, 100);  // changed digits may give a valid map
}

TEST(MapFile, RefusesInvalidMapsByElementAndField) {
  const MapSnapshot snapshot = snapshot_of(lively_map(60));
  ASSERT_GE(snapshot.elements.size(), 3U);
  const std::string yaml = edited(map_to_yaml(snapshot));
  const std::string id_0 = std::to_string(snapshot.elements[0].id);
  const std::string id_1 = std::to_string(snapshot.elements[1].id);
  struct Case {
    std::string yaml;
    std::vector<std::string> facts;  ///< beside the file
  };
  const std::string state = "{x_m: 1, y_m: 1, vx_m_s: 0, vy_m_s: 0, wz_rad_s: 0, mean_radius_m: ";
  const auto matrix = [](const std::string& first_row, const std::string& second_row) {
    std::string text = "\n      - " + first_row + "\n      - " + second_row;
    for (int i = 2; i < 8; ++i) {
      text += "\n      - [";
      for (int j = 0; j < 8; ++j) text += (j == 0 ? "" : ", ") + std::string(i == j ? "1" : "0");
      text += "]";
    }
    return text;
  };
  // Each matrix stands before the one that it pushes down, whose rows then have no name.
  const auto replaced = [&](const std::string& first_row, const std::string& second_row) {
    std::string text = yaml;
    const std::size_t from = text.find("    moving_covariance:");
    const std::size_t to = text.find("    view_covariance:");
    return text.replace(from, to - from, "    moving_covariance:" + matrix(first_row, second_row) + "\n");
  };
  const std::string good_row = "[0, 1, 0, 0, 0, 0, 0, 0]";
  const std::vector<Case> cases = {
      {with(yaml, "format", "octomap"), {"format", "octomap"}},
      {with(yaml, "version", "0"), {"version", "0", "1", "3"}},
      {with(yaml, "version", "4"), {"version", "4", "1", "3"}},
      {with(yaml, "world_frame", "\"\""), {"world_frame"}},
      {with(yaml, "world_frame", "[a]"), {"world_frame"}},
      {with(yaml, "shape", "square"), {"shape", "square"}},
      {with(yaml, "stamp_ns", "-1"), {"stamp_ns", "-1", "0"}},
      {with(yaml, "stamp_ns", "1.5"), {"stamp_ns", "1.5"}},
      {with(yaml, "stamp_ns", "99999999999999999999"), {"stamp_ns", "99999999999999999999"}},
      {with(yaml, "height_world_m", ".nan"), {"height_world_m", ".nan"}},
      {with(yaml, "height_world_m", "nan"), {"height_world_m", "nan"}},
      {with(yaml, "height_world_m", "inf"), {"height_world_m", "inf"}},
      {with(yaml, "height_world_m", "1e999"), {"height_world_m", "1e999"}},
      {with(yaml, "height_world_m", ""), {"height_world_m"}},
      {with(yaml, "height_world_m", "0\nhue: 1"), {"hue"}},
      {with(yaml, "height_world_m", "0\nnext_id: 1"), {"next_id"}},
      {with(yaml, "noise_factor", "0.5"), {"noise_factor", "0.5", "1", "100"}},
      {with(yaml, "next_id", id_1), {"elements[1]", id_1, "next_id"}},
      {with(yaml, "world_level", "{x_m: 1, y_m: 2}"), {"world_level", "yaw_rad"}},
      {with(yaml, "id", id_0, 2), {"elements[1]", id_0, "id"}},
      {with(yaml, "id", "0"), {"id", "0", "1"}},
      {with(yaml, "state", "dead", 2), {"elements[1]", "state", "dead"}},
      {with(yaml, "state", "deleted", 2), {"elements[1]", "state", "deleted"}},
      {with(yaml, "mobile", "yes", 2), {"elements[1]", "mobile", "yes"}},
      {with(yaml, "state", "confirmed\n    colour: red", 2), {"elements[1]", "colour"}},
      {with(yaml, "state", "confirmed\n    state: lost", 2), {"elements[1]", "state"}},
      {with(yaml, "class", "dog", 2), {"elements[1]", "class", "dog", "person"}},
      {with(yaml, "p_class", "1.5", 2), {"elements[1]", id_1, "p_class", "1.5", "0", "1"}},
      {with(yaml, "p_moving", "1.5", 2), {"elements[1]", id_1, "p_moving", "1.5", "0", "1"}},
      {with(yaml, "log_odds", "8", 2), {"elements[1]", id_1, "log_odds", "8"}},
      {with(yaml, "last_seen_ns", std::to_string(snapshot.stamp_ns + 1)),
       {"elements[0]", id_0, "last_seen_ns", "stamp_ns"}},
      {with(yaml, "first_seen_ns", "-2000000000000000000"), {"elements[0]", id_0, "first_seen_ns", "stamp_ns"}},
      {with(yaml, "observations", "-1"), {"elements[0]", id_0, "observations", "-1"}},
      {with(yaml, "body", "77777"), {"elements[0]", id_0, "body", "77777"}},
      {with(yaml, "body", id_0), {"elements[0]", id_0, "body"}},
      {with(yaml, "moving", state + "0.2, p_m: 0.3, q_m: 0}"), {"elements[0]", id_0, "moving", "radius"}},
      {with(yaml, "moving", state + "-0.2, p_m: 0, q_m: 0}"), {"elements[0]", id_0, "moving", "radius"}},
      {with(yaml, "moving", state + "0.2, p_m: 0}"), {"elements[0]", "moving", "q_m"}},
      {with(yaml, "moving", state + "0.2, p_m: 0, q_m: 0, r_m: 1}"), {"elements[0]", "moving", "r_m"}},
      {with(yaml, "moving", "[1, 2]"), {"elements[0]", "moving"}},
      {replaced("[1, 0, 0, 0, 0, 0, 0]", good_row), {"elements[0]", "moving_covariance"}},
      {replaced("[1, 0.5, 0, 0, 0, 0, 0, 0]", good_row), {"elements[0]", id_0, "moving_covariance", "symmetric"}},
      {replaced("[1, 2, 0, 0, 0, 0, 0, 0]", "[2, 1, 0, 0, 0, 0, 0, 0]"),
       {"elements[0]", id_0, "moving_covariance", "semidefinite"}},
      {replaced("[-1, 0, 0, 0, 0, 0, 0, 0]", good_row), {"elements[0]", id_0, "moving_covariance", "-1"}},
      {replaced("[0, 0.1, 0, 0, 0, 0, 0, 0]", "[0.1, 1, 0, 0, 0, 0, 0, 0]"),
       {"elements[0]", id_0, "moving_covariance", "variance"}},
      {yaml.substr(0, yaml.find("elements:")) + "sha256: edited\n", {"elements"}},
      {yaml.substr(0, yaml.find("elements:")) + "elements: 3\nsha256: edited\n", {"elements"}},
      {yaml.substr(0, yaml.find("elements:")) + "elements: [3]\nsha256: edited\n", {"elements[0]"}},
      {yaml.substr(0, yaml.find("elements:")) + "elements: &a [*a]\nsha256: edited\n", {"elements[0]"}},
      {yaml.substr(0, yaml.find("elements:")) + "elements: []\n---\n3\nsha256: edited\n", {"YAML"}},
      {yaml.substr(0, yaml.find("elements:")) + "elements: [\nsha256: edited\n", {"YAML"}},
      {yaml.substr(0, yaml.find("elements:")) + "elements: " + std::string(100'000, '[') + "\nsha256: edited\n",
       {"YAML"}},
      {"sha256: edited\n", {}},
      {",\nsha256: edited\n", {}},
      {"", {}},
  };
  EXPECT_EQ(refusal(replaced("[1, 0, 0, 0, 0, 0, 0, 0]", good_row)), "");
  for (const Case& c : cases) {
    EXPECT_EQ(refusal(c.yaml).rfind("a.yaml: ", 0), 0U) << refusal(c.yaml);
    EXPECT_TRUE(names(refusal(c.yaml), c.facts));
  }
}

TEST(MapFile, RefusesTooManyElements) {
  MapSnapshot snapshot = snapshot_of(lively_map(20));
  MapElement element = snapshot.elements[0];
  element.id = snapshot.next_id = 1000;
  while (snapshot.elements.size() <= map_bounds::kMaxElements) {
    element.id = snapshot.next_id++;
    snapshot.elements.push_back(element);
  }
  EXPECT_THROW(map_to_yaml(snapshot), std::invalid_argument);
  EXPECT_THROW(ObjectMap{ObjectMapParams()}.restore(snapshot), std::invalid_argument);
}

TEST(MapFile, CanBeEditedByHand) {
  const MapSnapshot snapshot = snapshot_of(lively_map(40));
  const std::string yaml = with(map_to_yaml(snapshot), "log_odds", "2.25   # I am sure of it", 2);
  EXPECT_TRUE(names(refusal(yaml), {"a.yaml", "sha256: edited"})) << "what to write there";
  const MapSnapshot read = map_from_yaml(edited(yaml), "a.yaml");
  EXPECT_EQ(read.elements[1].log_odds, 2.25);
  MapSnapshot expected = snapshot;
  expected.elements[1].log_odds = 2.25;
  EXPECT_EQ(map_to_yaml(read), map_to_yaml(expected)) << "and nothing else";
}

/// A temporary folder.
class MapFileOnDisk : public testing::Test {
 protected:
  MapFileOnDisk() : folder_(testing::TempDir() + "map_file_test_" + std::to_string(::getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~MapFileOnDisk() override { std::filesystem::remove_all(folder_); }

  std::string file(const std::string& name) const { return folder_ + "/" + name; }
  std::string content(const std::string& name) const {
    std::ifstream stream(file(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
  std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()));
  }

  std::string folder_;
  const MapSnapshot small_ = snapshot_of(lively_map(10));
  const MapSnapshot large_ = snapshot_of(lively_map(60));
};

TEST_F(MapFileOnDisk, IsSavedAndLoaded) {
  save_map(file("a.yaml"), large_);
  EXPECT_EQ(map_to_yaml(load_map(file("a.yaml"))), map_to_yaml(large_));
  save_map(file("a.yaml"), small_);
  EXPECT_EQ(content("a.yaml"), map_to_yaml(small_));
  EXPECT_EQ(files(), 1U);
}

TEST_F(MapFileOnDisk, OnAFullDiskTheOldFileStays) {
  save_map(file("a.yaml"), small_);
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit little = before;
  little.rlim_cur = 5000;
  const auto handler = signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &little), 0);
  EXPECT_THROW(save_map(file("a.yaml"), large_), std::runtime_error);
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, handler);
  EXPECT_EQ(content("a.yaml"), map_to_yaml(small_));
  EXPECT_EQ(files(), 1U);
}

TEST_F(MapFileOnDisk, AProcessKilledWhileSavingLeavesACompleteFile) {
  save_map(file("a.yaml"), small_);
  const std::string small = map_to_yaml(small_);
  const std::string large = map_to_yaml(large_);
  Random random(1);
  for (int i = 0; i < 30; ++i) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      for (;;) {
        save_map(file("a.yaml"), large_);
        save_map(file("a.yaml"), small_);
      }
    }
    usleep(static_cast<useconds_t>(random.uniform(1000.0, 30'000.0)));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const std::string found = content("a.yaml");
    ASSERT_TRUE(found == small || found == large) << i;
  }
  save_map(file("a.yaml"), large_);
  EXPECT_EQ(files(), 1U) << "what the killed ones left is gone";
}

TEST_F(MapFileOnDisk, ReplacesNothingButMaps) {
  std::ofstream(file("thesis.tex")) << "years of work\n";
  EXPECT_THROW(save_map(file("thesis.tex"), small_), std::runtime_error);
  EXPECT_EQ(content("thesis.tex"), "years of work\n");
  EXPECT_THROW(save_map(folder_, small_), std::runtime_error);
  EXPECT_THROW(save_map(file("missing/a.yaml"), small_), std::runtime_error);
  EXPECT_EQ(files(), 1U);
}

TEST_F(MapFileOnDisk, NamesTheFileThatCannotBeRead) {
  const auto says = [](const std::string& path) {
    return refusal_of<std::exception>([&] { load_map(path); }).rfind(path + ": ", 0) == 0;
  };
  EXPECT_TRUE(says(file("missing.yaml")));
  EXPECT_TRUE(says(folder_));
  EXPECT_TRUE(says("/dev/zero"));
  std::ofstream(file("huge.yaml")) << "x";
  std::filesystem::resize_file(file("huge.yaml"), std::uintmax_t{1} << 33);
  EXPECT_TRUE(says(file("huge.yaml")));
}

}  // namespace
}  // namespace situation_awareness::map_file_test
