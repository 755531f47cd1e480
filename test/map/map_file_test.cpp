// SPDX-License-Identifier: BSD-3-Clause
// The file of a map of any kind, by a test kind of vertex chains; map/objects/map_file_test.cpp tests damage.
#include "situation_awareness/map/map_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/refusal.hpp"

namespace situation_awareness::map_file_test {
namespace {

constexpr std::uint64_t kMaxId = 1000;
constexpr std::size_t kMaxVertices = 4;

enum class Certainty { kSeen, kGuessed };

std::string yaml_text(Certainty certainty) { return certainty == Certainty::kSeen ? "seen" : "guessed"; }

void read_yaml_text(const std::string& text, Certainty& certainty) {
  if (text != "seen" && text != "guessed") throw std::invalid_argument("must be seen or guessed");
  certainty = text == "seen" ? Certainty::kSeen : Certainty::kGuessed;
}

struct ChainVertex {
  Eigen::Vector2d position_world_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d P = Eigen::Matrix2d::Zero();

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("position_world", self.position_world_m, Bounds{-1e3, 1e3});
    visit("covariance", self.P, Bounds{0.0, 100.0});
  }
};

struct Chain {
  std::uint64_t id = 0;
  Certainty certainty = Certainty::kSeen;
  bool closed = false;
  int observations = 0;
  std::vector<ChainVertex> vertices;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("id", self.id, 1, kMaxId);
    visit("certainty", self.certainty);
    visit("closed", self.closed);
    visit("observations", self.observations);
    visit("vertices", self.vertices, kMaxVertices);
  }
};

struct Chains {
  std::string world_frame;
  std::int64_t stamp_ns = 0;
  double height_world_m = 0.0;
  Pose2 T_world_level;
  std::vector<Chain> elements;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world_frame", self.world_frame);
    visit("stamp_ns", self.stamp_ns, 0, std::int64_t{1} << 62);
    visit("height_world_m", self.height_world_m, Bounds{-100.0, 100.0});
    visit("world_level", self.T_world_level, Bounds{-1e6, 1e6});
  }

  void validate() const {
    fields(*this, CheckFields());
    for (std::size_t i = 0; i < elements.size(); ++i) {
      Chain::fields(elements[i], CheckFields("elements[" + std::to_string(i) + "]: "));
    }
  }
};

struct ChainFormat {
  using Snapshot = Chains;
  static constexpr std::size_t kMaxElements = 3;

  static MapFileHeader header() { return {"Chains.", "situation_awareness chains", 3, 2}; }
  static std::string comment_on(const Chain& chain) { return chain.closed ? "around" : ""; }
  static void read(Chains& chains, ReadFields& fields, std::uint64_t /*version*/) { Chains::fields(chains, fields); }
  static void read(Chain& chain, ReadFields& fields, std::uint64_t version, const Chains& /*snapshot*/) {
    if (version == 2) fields.add("certainty", "seen");  // there was no other
    Chain::fields(chain, fields);
  }
};

using ChainFile = MapFile<ChainFormat>;

Chains two_chains() {
  Chains chains;
  chains.world_frame = "odom";
  chains.stamp_ns = 1'700'000'000'000'000'123;
  chains.height_world_m = 0.1 + 0.2;
  chains.T_world_level = {{1.0, -2.0}, 0.5};
  Chain open;
  open.id = 4;
  open.observations = 7;
  Eigen::Matrix2d P;
  P << 0.04, 0.01, 0.01, 0.09;
  open.vertices = {{{1.0, 2.0}, P}, {{3.0, -0.0}, Eigen::Matrix2d::Zero()}};
  Chain closed;
  closed.id = 9;
  closed.certainty = Certainty::kGuessed;
  closed.closed = true;
  chains.elements = {open, closed};
  return chains;
}

constexpr const char* kTwoChains = R"(# Chains.
format: "situation_awareness chains"
version: 3
world_frame: "odom"
stamp_ns: 1700000000000000123
height_world_m: 0.30000000000000004
world_level: {x_m: 1, y_m: -2, yaw_rad: 0.5}
elements:
  -
    id: 4
    certainty: seen
    closed: false
    observations: 7
    vertices:
      -
        position_world: {x_m: 1, y_m: 2}
        covariance:
          - [0.04, 0.01]
          - [0.01, 0.09]
      -
        position_world: {x_m: 3, y_m: -0}
        covariance:
          - [0, 0]
          - [0, 0]
  -  # around
    id: 9
    certainty: guessed
    closed: true
    observations: 0
    vertices: []
)";

std::string edited(const std::string& content) { return content + "sha256: edited\n"; }

/// The two chains with one text replaced by another.
std::string with(const std::string& old, const std::string& text) {
  std::string yaml = kTwoChains;
  const std::size_t at = yaml.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  return edited(yaml.replace(at, old.size(), text));
}

std::string refusal(const std::string& yaml) {
  return refusal_of([&] { ChainFile::from_yaml(yaml, "a.yaml"); });
}

TEST(MapFileOfAKind, HasTheFieldsThatItsSnapshotDeclares) {
  const std::string yaml = ChainFile::to_yaml(two_chains());
  EXPECT_EQ(yaml.substr(0, yaml.rfind("sha256: ")), kTwoChains);
}

TEST(MapFileOfAKind, IsReadAsItWasWritten) {
  const std::string yaml = ChainFile::to_yaml(two_chains());
  const Chains read = ChainFile::from_yaml(yaml, "a.yaml");
  ASSERT_EQ(read.elements.size(), 2U);
  EXPECT_EQ(read.height_world_m, two_chains().height_world_m);
  EXPECT_EQ(read.elements[0].vertices.at(0).P, two_chains().elements[0].vertices[0].P);
  EXPECT_TRUE(std::signbit(read.elements[0].vertices.at(1).position_world_m.y()));
  EXPECT_EQ(read.elements[1].certainty, Certainty::kGuessed);
  EXPECT_EQ(ChainFile::to_yaml(read), yaml);
}

TEST(MapFileOfAKind, IsRefusedByElementAndField) {
  EXPECT_EQ(refusal(edited(kTwoChains)), "");
  EXPECT_TRUE(names(refusal(kTwoChains), {"a.yaml", "sha256"}));
  const auto expect_refusal = [](const std::string& yaml, const std::vector<std::string>& facts) {
    EXPECT_EQ(refusal(yaml).rfind("a.yaml: ", 0), 0U) << refusal(yaml);
    EXPECT_TRUE(names(refusal(yaml), facts));
  };
  expect_refusal(with("situation_awareness chains", "situation_awareness map"), {"format", "situation_awareness map"});
  expect_refusal(with("version: 3", "version: 4"), {"version", "4", "2", "3"});
  expect_refusal(with("world_frame: \"odom\"", "world_frame: \"\""), {"world_frame"});
  expect_refusal(with("height_world_m: 0.30000000000000004", "height_world_m: 101"), {"height_world_m", "101", "100"});
  expect_refusal(with("id: 9", "id: 1001"), {"elements[1]", "id", "1001", "1000"});
  expect_refusal(with("observations: 7", "observations: -1"), {"elements[0]", "observations", "-1"});
  expect_refusal(with("certainty: seen", "certainty: sure"), {"elements[0]", "certainty", "sure", "guessed"});
  expect_refusal(with("x_m: 3", "x_m: 3e3"), {"elements[0]", "vertices[1]", "position_world", "3000"});
  expect_refusal(with("x_m: 3, ", ""), {"elements[0]", "vertices[1]", "position_world", "x_m"});
  expect_refusal(with("[0.04, 0.01]", "[0.04, 0.01, 0]"), {"elements[0]", "vertices[0]", "covariance", "2"});
  expect_refusal(with("[0.04, 0.01]", "[0.04, 0.02]"), {"elements[0]", "vertices[0]", "covariance", "symmetric"});
  expect_refusal(with("[0.04, 0.01]\n          - [0.01, 0.09]", "[0.04, 0.09]\n          - [0.09, 0.09]"),
                 {"elements[0]", "vertices[0]", "covariance", "semidefinite"});
  expect_refusal(with("vertices: []", "vertices: [{}, {}, {}, {}, {}]"), {"elements[1]", "vertices", "4"});
  expect_refusal(with("closed: true", "closed: true\n    open: false"), {"elements[1]", "open"});
}

TEST(MapFileOfAKind, HasVersionsOfItsOwn) {
  std::string old = with("version: 3", "version: 2");
  for (const std::string line : {"    certainty: seen\n", "    certainty: guessed\n"}) {
    old.erase(old.find(line), line.size());
  }
  EXPECT_EQ(ChainFile::from_yaml(old, "a.yaml").elements.at(1).certainty, Certainty::kSeen);
  EXPECT_TRUE(names(refusal(with("version: 3", "version: 2")), {"elements[0]", "certainty"})) << "version 2 has none";
}

TEST(MapFileOfAKind, IsNotWrittenWhereItCouldNotBeRead) {
  Chains chains = two_chains();
  chains.elements[0].vertices.resize(kMaxVertices + 1);
  EXPECT_THROW(ChainFile::to_yaml(chains), std::invalid_argument);
  chains = two_chains();
  chains.world_frame.clear();
  EXPECT_THROW(ChainFile::to_yaml(chains), std::invalid_argument);
}

TEST(MapFileOfAKind, ReplacesNoFileOfAnotherKind) {
  const std::string path = testing::TempDir() + "chains_" + std::to_string(::getpid()) + ".yaml";
  std::ofstream(path) << "format: \"situation_awareness map\"\n";
  EXPECT_THROW(ChainFile::save(path, two_chains()), std::runtime_error);
  std::filesystem::remove(path);
  ChainFile::save(path, two_chains());
  ChainFile::save(path, two_chains());
  EXPECT_EQ(ChainFile::to_yaml(ChainFile::load(path, "odom")), ChainFile::to_yaml(two_chains()));
  EXPECT_TRUE(names(refusal_of([&] { ChainFile::load(path, "world"); }), {path, "odom", "world"}));
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace situation_awareness::map_file_test
