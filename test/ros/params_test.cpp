// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cstdio>
#include <fstream>
#include <stdexcept>

#include <gtest/gtest.h>

#include "situation_awareness/common/canonical_yaml.hpp"
#include "situation_awareness/ros/params/circumnavigate_nodelet_params.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/params/localization_nodelet_params.hpp"
#include "situation_awareness/ros/params/map_nodelet_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/params/path_nodelet_params.hpp"
#include "situation_awareness/ros/params/scout_nodelet_params.hpp"
#include "support/aggregate_size.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::params_test {
namespace {

using XmlRpc::XmlRpcValue;

XmlRpcValue with_model_folder(XmlRpcValue tree = {}) {
  tree["model_folder"] = "/models";
  return tree;
}

std::string refusal(const XmlRpcValue& tree) {
  return refusal_of([&] { read_object_nodelet_params(ParamReader(tree, "parameters of /mapping")); });
}

TEST(YamlFromXmlRpc, WritesEveryKindOfValue) {
  XmlRpcValue tree;
  tree["flag"] = true;
  tree["whole"] = -3;
  tree["real"] = 0.1;
  tree["text"] = "a \"b\" \\ c: [d]\n";
  tree["list"][0] = 1.5;
  tree["list"][1] = 2;
  tree["nested"]["deep"] = "1e-3";
  EXPECT_EQ(yaml_from_xmlrpc(tree),
            "{\"flag\": true, \"list\": [1.5, 2], \"nested\": {\"deep\": \"1e-3\"}, \"real\": 0.1, "
            "\"text\": \"a \\\"b\\\" \\\\ c: [d]\\x0a\", \"whole\": -3}");
}

/// What is on the parameter server of each text, as roslaunch sends it, in canonical YAML; "" of what it refuses.
std::vector<std::string> by_rosparam(const std::vector<std::string>& texts) {
  const std::string file = testing::TempDir() + "/yaml_of_rosparam";
  std::ofstream in(file);
  for (const std::string& text : texts) in << text << '\0';
  in.close();
  const std::string script = R"(
import sys, xmlrpc.client, rosparam, yaml
for text in open(sys.argv[1]).read().split('\0')[:-1]:
    try:
        value = yaml.safe_load(text)
        xmlrpc.client.dumps((value,))
        style = dict(default_style='\x22', default_flow_style=True, sort_keys=False, width=10**6)
        print(yaml.safe_dump(value, **style).splitlines()[0])
    except Exception:
        print()
)";
  const std::string command = "/usr/bin/python3 -c \"" + script + "\" " + file;
  std::FILE* const out = popen(command.c_str(), "r");
  std::vector<std::string> values;
  std::array<char, 1024> line{};
  while (out != nullptr && std::fgets(line.data(), line.size(), out) != nullptr) {
    const std::string value = std::string(line.data()).substr(0, std::string(line.data()).size() - 1);
    values.push_back(value.empty() ? "" : canonical_yaml(value));
  }
  if (out != nullptr) pclose(out);
  std::remove(file.c_str());
  return values;
}

TEST(CanonicalYaml, IsWhatRosparamPutsOnTheParameterServer) {
  std::vector<std::string> texts;
  for (const char* value : {"010",
                            "08",
                            "0o17",
                            "0x1F",
                            "0b101",
                            "1_000",
                            "0_",
                            "0b_",
                            "12:30",
                            "12:30.5",
                            "09:30",
                            "1:60",
                            "190:20:30.15",
                            "1e-3",
                            "1.5e3",
                            "1.5e+3",
                            "685.230_15e+03",
                            ".5",
                            "-.5",
                            "+.5",
                            "5.",
                            "+5",
                            "-0",
                            "00",
                            "1_",
                            "_1",
                            "010.5",
                            "yes",
                            "No",
                            "ON",
                            "off",
                            "oN",
                            "y",
                            "N",
                            "true",
                            "TRUE",
                            ".inf",
                            "-.INF",
                            "inf",
                            "-.nan",
                            "2001-01-01",
                            "3000000000",
                            "-2147483648",
                            "4294967296.0",
                            "1.0e-5",
                            "\"010\"",
                            "'yes'",
                            "deg(90)",
                            "deg( 9.5 )",
                            "rad(pi/2)",
                            "rad(-2*pi/3)",
                            "rad(1.5)",
                            "rad(sin(1))",
                            "deg(x)",
                            "!degrees 90",
                            "!radians pi/2",
                            "!!float 3",
                            "!!int \"7\"",
                            "!!bool yes",
                            "!!str 7",
                            "!foo 3",
                            "=",
                            "<<",
                            "1,5",
                            "[1, 010, [yes, x]]",
                            "{a: 12:30, b: [0x1]}",
                            "{<<: {a: 1, b: {c: 1}}, b: {d: 010}}",
                            "{<<: [{a: 1, b: 2}, {b: 3}]}"}) {
    texts.push_back(std::string("v: ") + value);
  }
  for (const char* text : {"on: 1\nv: 2001-1-1", "a: 1\n---\na: 2", "%YAML 1.2\n---\na: 010", "a: |\n  010\n",
                           "a: >-\n  12:30\n", "a: &x {b: 010}\nc: {<<: *x, d: off}", "a: 1\n...\n"}) {
    texts.emplace_back(text);
  }
  const std::vector<std::string> expected = by_rosparam(texts);
  ASSERT_EQ(expected.size(), texts.size());
  for (std::size_t i = 0; i < texts.size(); ++i) {
    std::string value;
    const std::string refusal = refusal_of([&] { value = canonical_yaml(texts[i]); });
    EXPECT_EQ(value, expected[i]) << texts[i] << '\n' << refusal;
    EXPECT_EQ(refusal.empty(), !expected[i].empty()) << texts[i];
  }
}

TEST(ParamReader, RefusesWhatTheFileHasAndTheParameterServerLoses) {
  XmlRpcValue tree;
  tree["scan"]["max_range_m"] = 7;
  tree["config_yaml"] = "scan: {max_range_m: 7, max_range_m: 8}";
  EXPECT_TRUE(names(refusal(with_model_folder(tree)), {"parameters of /mapping", "scan.max_range_m", "twice"}));
  tree["config_yaml"] = "scan: {max_range_m: 5}\nnobody: {knows: it}";
  const ObjectNodeletParams params = read_object_nodelet_params(ParamReader(with_model_folder(tree), "here"));
  EXPECT_EQ(params.pipeline.scan.max_range_m, 7.0) << "the parameter server counts";
  EXPECT_TRUE(params.unknown.empty());
}

TEST(ParamReader, WithoutParametersGivesDefaults) {
  const ParamReader reader(XmlRpcValue(), "here");
  EXPECT_EQ(yaml_from_params(reader.read<ObjectNodeletParams>(refuse)), yaml_from_params(ObjectNodeletParams()));
}

TEST(ObjectNodeletParams, DeclareAllTheirMembers) {
  EXPECT_EQ(declared_size<NodeletParams>(), aggregate_size<NodeletParams>());
  const std::size_t others = 3;  // what was unknown; and the two whose fields are declared in their places
  EXPECT_EQ(declared_size<ObjectNodeletParams>(), aggregate_size<ObjectNodeletParams>() - others +
                                                      declared_size<NodeletParams>() +
                                                      declared_size<ObjectPipelineParams>());
}

TEST(ObjectNodeletParams, ReadBothKindsOfParameters) {
  XmlRpcValue tree;
  tree["world_frame"] = "/odom";
  tree["tf_timeout_s"] = 1;
  tree["deskew"] = false;
  tree["queue_size"] = 5;
  tree["scan_pose_offset_s"] = 0.13;
  tree["segments"]["min_points"] = 6;
  tree["scan"]["max_range_m"] = 7;
  tree["scan"]["volume"][0][0] = 1.0;
  tree["scan"]["volume"][0][1] = 0.0;
  tree["scan"]["volume"][0][2] = 0;
  tree["scan"]["volume"][0][3] = 4.5;
  tree["detections"]["model"] = "net.onnx";
  const ObjectNodeletParams params =
      read_object_nodelet_params(ParamReader(with_model_folder(tree), "parameters of /mapping"));
  EXPECT_EQ(params.nodelet.world_frame, "odom");
  EXPECT_EQ(params.nodelet.tf_timeout_s, 1.0);
  EXPECT_FALSE(params.nodelet.deskew);
  EXPECT_EQ(params.nodelet.queue_size, 5);
  EXPECT_EQ(params.pipeline.scan_pose_offset_s, 0.13);
  EXPECT_EQ(params.pipeline.segments.min_points, 6);
  EXPECT_EQ(params.pipeline.scan.max_range_m, 7.0);
  ASSERT_EQ(params.pipeline.scan.volume.size(), 1U);
  EXPECT_EQ(params.pipeline.scan.volume[0].offset_m, 4.5);
  EXPECT_EQ(model_path(params.pipeline.detections), "/models/net.onnx");
}

TEST(ObjectNodeletParams, AreRefusedWithNodeFieldAndBound) {
  EXPECT_EQ(refusal(with_model_folder()), "");
  const auto expect_refusal = [](const XmlRpcValue& tree, const std::vector<std::string>& facts) {
    const std::string message = refusal(tree);
    EXPECT_EQ(message.rfind("parameters of /mapping: ", 0), 0U) << message;
    EXPECT_TRUE(names(message, facts));
  };
  const auto expect_refusal_of = [&](const char* name, const XmlRpcValue& value,
                                     const std::vector<std::string>& facts) {
    XmlRpcValue tree;
    tree[name] = value;
    expect_refusal(with_model_folder(tree), facts);
  };
  expect_refusal_of("tf_timeout_s", -1.0, {"tf_timeout_s", "-1", "0", "60"});
  expect_refusal_of("scan_pose_offset_s", 1.5, {"scan_pose_offset_s", "1.5", "-1", "1"});
  expect_refusal_of("queue_size", 0, {"queue_size", "0", "1", "1000"});
  expect_refusal_of("queue_size", 1.5, {"queue_size", "1.5", "whole number"});
  expect_refusal_of("deskew", "no", {"deskew", "\"no\"", "true", "false"});
  expect_refusal_of("world_frame", 3, {"world_frame", "3", "text"});
  expect_refusal_of("world_frame", "", {"world_frame", "empty"});
  XmlRpcValue tree;
  tree["objects"]["gate_probability"] = 2.0;
  expect_refusal(with_model_folder(tree), {"objects.gate_probability", "2", "0.5", "0.999999"});
  expect_refusal(XmlRpcValue(42), {"map", "42"});
}

TEST(ObjectNodeletParams, TellOfUnknownKeysOfBothKinds) {
  XmlRpcValue tree;
  tree["tf_timeout"] = 0.5;
  tree["segments"]["max_gap"] = 0.2;
  tree["segments"]["min_points"] = 6;
  tree["live"]["max_gap_m"] = 0.3;  // of LiveParams
  const ObjectNodeletParams params =
      read_object_nodelet_params(ParamReader(with_model_folder(tree), "parameters of /mapping"));
  ASSERT_EQ(params.unknown.size(), 2U);
  EXPECT_EQ(params.unknown[0].source, "parameters of /mapping");
  EXPECT_EQ(params.unknown[0].path, "segments.max_gap");
  EXPECT_TRUE(names(message_of(params.unknown[0]), {"segments.max_gap", "max_gap_m"}));
  EXPECT_EQ(params.unknown[1].path, "tf_timeout");
  EXPECT_EQ(params.unknown[1].known,
            (std::vector<std::string>{"cloud", "deskew", "detections", "downlink_rate_hz", "max_stamp_ahead_s",
                                      "model_folder", "objects", "queue_size", "scan", "scan_pose_offset_s", "segments",
                                      "tf_timeout_s", "world_frame"}));
  EXPECT_EQ(params.pipeline.segments.min_points, 6);
  EXPECT_EQ(params.nodelet.tf_timeout_s, NodeletParams{}.tf_timeout_s);
}

TEST(NodeletParams, OfEachKindDoNotWarnOfThoseOfTheOthers) {
  XmlRpcValue tree;
  tree["model_folder"] = "/models";
  tree["objects"]["max_unseen_s"] = 30.0;  // of the map of objects
  tree["polygons"]["removal_s"] = 1.2;     // of that of polygons
  tree["pose_timeout_s"] = 0.1;            // of the nodelet that keeps it
  tree["localization"]["max_sigma_m"] = 0.5;
  tree["reflector_file"] = "/reflectors.yaml";  // of localisation
  tree["path"]["pause_s"] = 1.0;
  tree["path_file"] = "/path.yaml";  // of the nodelets that drive
  tree["gps_ins"]["max_delay_s"] = 2.0;
  tree["fix_sigma_m"] = 3.0;          // of the nodelet with GPS and INS
  tree["polygons"]["removal"] = 1.2;  // of nobody
  const ParamReader reader(tree, "one file");
  const auto expect_one = [](const std::vector<UnknownKey>& unknown) {
    ASSERT_EQ(unknown.size(), 1U);
    EXPECT_EQ(unknown[0].path, "polygons.removal");
  };
  expect_one(read_map_nodelet_params(reader).unknown);
  expect_one(read_localization_nodelet_params(reader).unknown);
  EXPECT_TRUE(read_path_nodelet_params(reader).unknown.empty()) << "it has no such section";
}

TEST(GpsInsNodeletParams, ShareAFileWithOtherStages) {
  XmlRpcValue tree;
  tree["gps_ins"]["max_delay_s"] = 2.0;
  tree["polygons"]["removal_s"] = 1.2;
  tree["scan"]["max_range_m"] = 7.0;
  EXPECT_TRUE(read_gps_ins_nodelet_params(ParamReader(tree, "here")).unknown.empty());
  EXPECT_TRUE(read_map_nodelet_params(ParamReader(tree, "here")).unknown.empty());
  tree["gps_ins"]["max_delay"] = 2.0;
  const auto unknown = read_gps_ins_nodelet_params(ParamReader(tree, "here")).unknown;
  ASSERT_EQ(unknown.size(), 1U);
  EXPECT_EQ(unknown[0].path, "gps_ins.max_delay");
}

TEST(GpsInsNodeletParams, AreReadAndChecked) {
  const auto read = [](const char* name, const XmlRpcValue& value) {
    XmlRpcValue tree;
    tree[name] = value;
    return read_gps_ins_nodelet_params(ParamReader(tree, "here"));
  };
  const auto refused = [&](const char* name, const XmlRpcValue& value) {
    return refusal_of([&] { read(name, value); });
  };
  EXPECT_EQ(read("imu_frame", "/imu_link").imu_frame, "imu_link");
  EXPECT_EQ(read("fix_frame", "/gps").fix_frame, "gps");
  EXPECT_EQ(read("origin", "48.1,11.5,520").origin, "48.1,11.5,520");
  XmlRpcValue section;
  section["max_delay_s"] = 2.0;
  EXPECT_EQ(read("gps_ins", section).gps_ins.max_delay_s, 2.0);
  section["max_delay_s"] = 11.0;
  EXPECT_TRUE(names(refused("gps_ins", section), {"here", "gps_ins.max_delay_s", "11"}));
  EXPECT_TRUE(names(refused("origin", "north"), {"here", "origin", "north", "LAT,LON,ALT"}));
  EXPECT_TRUE(names(refused("base_frame", ""), {"here", "base_frame", "empty"}));
  EXPECT_TRUE(names(refused("base_frame", "world"), {"here", "world_frame", "base_frame", "both world"}));
  EXPECT_TRUE(names(refused("fix_sigma_m", 0.0), {"here", "fix_sigma_m", "0"}));
}

TEST(NodeletParams, OfEachKindDeclareAllTheirMembers) {
  EXPECT_EQ(declared_size<GpsInsNodeletParams>(),
            aggregate_size<GpsInsNodeletParams>() - 2 + declared_size<NodeletParams>());
  const std::size_t others = 3;  // as above
  const std::size_t shared = declared_size<NodeletParams>() + declared_size<PolygonPipelineParams>();
  EXPECT_EQ(declared_size<LocalizationNodeletParams>(), aggregate_size<LocalizationNodeletParams>() - others + shared);
  EXPECT_EQ(declared_size<PathNodeletParams>(),
            aggregate_size<PathNodeletParams>() - 2 + declared_size<NodeletParams>());
}

/// A nodelet of another kind of map, without objects.
struct ChainNodeletParams {
  NodeletParams nodelet;
  double max_gap_m = 0.2;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("max_gap_m", self.max_gap_m, Bounds{0.0, 1.0}, "m", "largest gap within a chain");
  }
};

TEST(NodeletParams, AreReadWithThoseOfAnyKindOfMap) {
  XmlRpcValue tree;
  tree["world_frame"] = "/odom";
  tree["max_gap_m"] = 0.5;
  tree["detections"]["model"] = "net.onnx";
  tree["live"]["max_gap_m"] = 0.3;
  const auto params = read_nodelet_params<ChainNodeletParams>(ParamReader(tree, "parameters of /chains"));
  EXPECT_EQ(params.nodelet.world_frame, "odom");
  EXPECT_EQ(params.max_gap_m, 0.5);
  ASSERT_EQ(params.unknown.size(), 1U);
  EXPECT_EQ(params.unknown[0].path, "detections");
}

TEST(CircumnavigateNodeletParams, DeclareAllTheirMembers) {
  // What was unknown, and the nodelet's, which are declared in its place.
  EXPECT_EQ(declared_size<CircumnavigateNodeletParams>(),
            aggregate_size<CircumnavigateNodeletParams>() - 2 + declared_size<NodeletParams>());
  EXPECT_EQ(declared_size<CircumnavigationParams>() + 1, aggregate_size<CircumnavigationParams>());
}

TEST(ScoutNodeletParams, DeclareAllTheirMembers) {
  // What was unknown, and the nodelet's, which are declared in its place.
  EXPECT_EQ(declared_size<ScoutNodeletParams>(), aggregate_size<ScoutNodeletParams>() - 3 +
                                                     declared_size<NodeletParams>() + declared_size<ElevationParams>());
  EXPECT_EQ(declared_size<ScoutingParams>() + 1, aggregate_size<ScoutingParams>());
}

TEST(CircumnavigateNodeletParams, PlacesAreReadBackExactly) {
  SearchPlaces search, read;
  search.places = {{{0.1, -2.0}, {}, 1.0}, {{3.0, 4.0}, 0.3, 1.0}};
  read_yaml_text(yaml_text(search), read);
  ASSERT_EQ(read.places.size(), 2U);
  EXPECT_EQ(read.places[0].p_m, search.places[0].p_m);
  EXPECT_FALSE(read.places[0].yaw_rad);
  EXPECT_EQ(read.places[1].yaw_rad, 0.3);
  EXPECT_THROW(read_yaml_text("[[1]]", read), std::invalid_argument);
  EXPECT_THROW(read_yaml_text("places", read), std::invalid_argument);
}

TEST(MapNodeletParams, DeclareAllTheirMembers) {
  // What was unknown and the objects', which are read apart; and the four whose fields are declared in their places.
  const std::size_t others = 6;
  EXPECT_EQ(declared_size<MapNodeletParams>(),
            aggregate_size<MapNodeletParams>() - others + declared_size<NodeletParams>() +
                declared_size<ScanPoseParams>() + declared_size<InertialParams>() + declared_size<MapPipelineParams>());
}

TEST(MapNodeletParams, KnowTheKindsAndThoseOfOtherStages) {
  const auto read = [](const char* name, const XmlRpcValue& value) {
    XmlRpcValue tree;
    tree[name] = value;
    tree["objects"]["gate_probability"] = 0.99;  // of another stage
    const MapNodeletParams params = read_map_nodelet_params(ParamReader(tree, "here"));
    EXPECT_TRUE(params.unknown.empty());
    return params;
  };
  EXPECT_EQ(read("pose_sigma_m", 0.5).scan_pose.covariance()(1, 1), 0.25);
  const MapKinds kinds = map_kinds_of(read("kinds", "polygons,grid").kinds);
  EXPECT_TRUE(!kinds.objects && kinds.polygons && !kinds.boundaries && kinds.targets);
  const auto refused = [&](const char* name, const XmlRpcValue& value) {
    return refusal_of([&] { read(name, value); });
  };
  EXPECT_TRUE(names(refused("kinds", "polygons,walls"), {"here", "kinds", "walls", "objects", "grid"}));
  EXPECT_TRUE(names(refused("kinds", ""), {"here", "kinds", "nothing"}));
  XmlRpcValue tree;
  tree["kinds"] = "objects,grid";
  EXPECT_TRUE(names(refusal_of([&] { read_inertial_map_nodelet_params(ParamReader(tree, "here")); }),
                    {"here", "kinds", "grid", "TF"}));
}

}  // namespace
}  // namespace situation_awareness::params_test
