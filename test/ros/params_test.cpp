// SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>

#include <gtest/gtest.h>

#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"

namespace situation_awareness {
namespace {

using XmlRpc::XmlRpcValue;

XmlRpcValue with_model_folder(XmlRpcValue tree = {}) {
  tree["model_folder"] = "/models";
  return tree;
}

std::string refusal(const XmlRpcValue& tree) {
  try {
    read_nodelet_params(ParamReader(tree, "parameters of /mapping"));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

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
            "{\"flag\": true, \"list\": [1.5, 2], \"nested\": {\"deep\": \"1e-3\"}, \"real\": 0.10000000000000001, "
            "\"text\": \"a \\\"b\\\" \\\\ c: [d]\\x0a\", \"whole\": -3}");
}

TEST(ParamReader, TakesWhatIsThereAndKeepsTheRest) {
  XmlRpcValue tree;
  tree["a"] = 2;
  tree["b"] = 0.5;
  tree["c"] = "text";
  tree["d"]["e"] = 1;
  ParamReader reader(tree, "here");
  EXPECT_EQ(reader.take_integer("a", 7, Bounds{0, 10}, ""), 2);
  EXPECT_EQ(reader.take_number("b", 7.0, Bounds{0.0, 1.0}, "m"), 0.5);
  EXPECT_EQ(reader.take_number("missing", 7.0, Bounds{0.0, 1.0}, "m"), 7.0);
  EXPECT_EQ(reader.take_text("c", ""), "text");
  EXPECT_EQ(reader.rest_as_yaml(), "{\"d\": {\"e\": 1}}");
  EXPECT_THROW(reader.refuse_rest(), std::invalid_argument);
}

TEST(ParamReader, WithoutParametersGivesDefaults) {
  ParamReader reader(XmlRpcValue(), "here");
  EXPECT_EQ(reader.take_integer("a", 7, Bounds{0, 10}, ""), 7);
  EXPECT_EQ(reader.rest_as_yaml(), "{}");
  EXPECT_NO_THROW(reader.refuse_rest());
}

TEST(NodeletParams, ReadBothKindsOfParameters) {
  XmlRpcValue tree;
  tree["world_frame"] = "/odom";
  tree["tf_timeout_s"] = 1;
  tree["deskew"] = false;
  tree["queue_size"] = 5;
  tree["segments"]["min_points"] = 6;
  tree["scan"]["max_range_m"] = 7;
  tree["scan"]["volume"][0][0] = 1.0;
  tree["scan"]["volume"][0][1] = 0.0;
  tree["scan"]["volume"][0][2] = 0;
  tree["scan"]["volume"][0][3] = 4.5;
  tree["detections"]["model"] = "net.onnx";
  const NodeletParams params = read_nodelet_params(ParamReader(with_model_folder(tree), "parameters of /mapping"));
  EXPECT_EQ(params.world_frame, "odom");
  EXPECT_EQ(params.tf_timeout_s, 1.0);
  EXPECT_FALSE(params.deskew);
  EXPECT_EQ(params.queue_size, 5);
  EXPECT_EQ(params.pipeline.segments.min_points, 6);
  EXPECT_EQ(params.pipeline.scan.max_range_m, 7.0);
  ASSERT_EQ(params.pipeline.scan.volume.size(), 1U);
  EXPECT_EQ(params.pipeline.scan.volume[0].offset_m, 4.5);
  EXPECT_EQ(model_path(params.pipeline.detections), "/models/net.onnx");
}

TEST(NodeletParams, RefuseInOneSentence) {
  EXPECT_EQ(refusal(with_model_folder()), "");

  XmlRpcValue tree;
  tree["tf_timeout_s"] = -1.0;
  EXPECT_EQ(refusal(with_model_folder(tree)), "parameters of /mapping: tf_timeout_s = -1 is outside [0, 60] s");

  tree = XmlRpcValue();
  tree["queue_size"] = 0;
  EXPECT_TRUE(has(refusal(with_model_folder(tree)), "queue_size = 0 is outside [1, 1000]"));

  tree = XmlRpcValue();
  tree["queue_size"] = 1.5;
  EXPECT_TRUE(has(refusal(with_model_folder(tree)), "queue_size = 1.5 is not an integer"));

  tree = XmlRpcValue();
  tree["deskew"] = "no";
  EXPECT_EQ(refusal(with_model_folder(tree)), "parameters of /mapping: deskew = \"no\" is not true or false");

  tree = XmlRpcValue();
  tree["world_frame"] = 3;
  EXPECT_TRUE(has(refusal(with_model_folder(tree)), "world_frame = 3 is not a text"));

  tree = XmlRpcValue();
  tree["objects"]["gate_probability"] = 2.0;
  EXPECT_TRUE(has(refusal(with_model_folder(tree)), "gate_probability"));
  EXPECT_TRUE(has(refusal(with_model_folder(tree)), "0.5"));

  EXPECT_TRUE(has(refusal(XmlRpcValue(42)), "parameters of /mapping"));
}

TEST(NodeletParams, TellOfUnknownKeysOfBothKinds) {
  XmlRpcValue tree;
  tree["tf_timeout"] = 0.5;
  tree["segments"]["max_gap"] = 0.2;
  tree["segments"]["min_points"] = 6;
  tree["live"]["max_gap_m"] = 0.3;  // of another reader
  const NodeletParams params = read_nodelet_params(ParamReader(with_model_folder(tree), "parameters of /mapping"));
  ASSERT_EQ(params.unknown.size(), 2U);
  EXPECT_TRUE(has(sentence_of(params.unknown[0]), "parameters of /mapping: unknown parameter segments.max_gap has no"));
  EXPECT_TRUE(has(sentence_of(params.unknown[0]), " max_gap_m, "));
  EXPECT_EQ(sentence_of(params.unknown[1]),
            "parameters of /mapping: unknown parameter tf_timeout has no effect, known are: deskew, detections, "
            "downlink_rate_hz, "
            "model_folder, objects, queue_size, scan, segments, tf_timeout_s, world_frame");
  EXPECT_EQ(params.pipeline.segments.min_points, 6);
  EXPECT_EQ(params.tf_timeout_s, NodeletParams{}.tf_timeout_s);
}

}  // namespace
}  // namespace situation_awareness
