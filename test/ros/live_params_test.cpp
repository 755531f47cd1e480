// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/live_params.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "situation_awareness/DetectionConfig.h"
#include "situation_awareness/MappingConfig.h"
#include "situation_awareness/SegmentationConfig.h"
#include "situation_awareness/pipeline/object_pipeline.hpp"

namespace situation_awareness {
namespace {

/// What a params struct says of its fields, in the words of dynamic_reconfigure.
class Fields {
 public:
  struct Field {
    std::string type, doc;
    double value = 0.0;
    Bounds bounds{};
  };

  void operator()(const char* name, double value, Bounds bounds, const char* unit, const char* doc) {
    fields_[name] = {"double", with_unit(doc, unit), value, bounds};
  }
  void operator()(const char* name, int value, Bounds bounds, const char* unit, const char* doc) {
    fields_[name] = {"int", with_unit(doc, unit), static_cast<double>(value), bounds};
  }
  template <class Value>
  void operator()(const char* name, const Value& /*value*/, const char* doc) {
    fields_[name] = {"str", doc, 0.0, {}};
  }
  template <class Section>
  void operator()(const char* /*name*/, const Section& /*section*/) {}

  const Field* find(const std::string& name) const {
    const auto field = fields_.find(name);
    return field == fields_.end() ? nullptr : &field->second;
  }
  std::size_t size() const { return fields_.size(); }

 private:
  static std::string with_unit(const std::string& doc, const std::string& unit) {
    return unit.empty() ? doc : doc + " [" + unit + "]";
  }

  std::map<std::string, Field> fields_;
};

template <class Config>
double number_in(const Config& config, const std::string& name) {
  dynamic_reconfigure::Config msg;
  config.__toMessage__(msg);
  for (const auto& entry : msg.doubles) {
    if (entry.name == name) return entry.value;
  }
  for (const auto& entry : msg.ints) {
    if (entry.name == name) return entry.value;
  }
  ADD_FAILURE() << name << " is no number";
  return 0.0;
}

/// A .cfg and the structs behind it say the same: names, types, defaults, bounds, units and sentences.
template <class Config, class... Params>
void expect_agreement(const Params&... params) {
  Fields fields;
  (Params::fields(params, fields), ...);
  const std::vector<std::size_t> sizes = {[](const auto& each) {
    Fields own;
    std::decay_t<decltype(each)>::fields(each, own);
    return own.size();
  }(params)...};
  std::size_t sum = 0;
  for (const std::size_t size : sizes) sum += size;
  EXPECT_EQ(fields.size(), sum) << "a name in two structs would be set in both";

  for (const auto& description : Config::__getParamDescriptions__()) {
    SCOPED_TRACE(description->name);
    const Fields::Field* const field = fields.find(description->name);
    ASSERT_NE(field, nullptr) << "no field has this name";
    EXPECT_EQ(description->type, field->type);
    EXPECT_EQ(description->description, field->doc);
    if (field->type == "str") continue;
    EXPECT_EQ(number_in(Config::__getDefault__(), description->name), field->value);
    EXPECT_EQ(number_in(Config::__getMin__(), description->name), field->bounds.low);
    EXPECT_EQ(number_in(Config::__getMax__(), description->name), field->bounds.high);
  }
}

TEST(LiveParams, AreThoseOfTheStructs) {
  expect_agreement<SegmentationConfig>(RangeLimiterParams{}, SegmentationParams{});
  expect_agreement<DetectionConfig>(DetectionParams{}, EllipseFitParams{});
  expect_agreement<MappingConfig>(ObjectMapParams{});
}

TEST(LiveParams, AreReadAndWrittenByName) {
  dynamic_reconfigure::Config msg;
  SegmentationConfig::__getDefault__().__toMessage__(msg);
  RangeLimiterParams scan;
  scan.max_range_m = 1.0 / 3.0;
  scan.volume = {{{0.1, -1e-7, 0.0}, 1.0 / 3.0}, {{0.0, 0.0, 1.0}, 2.5}};
  SegmentationParams segments;
  segments.min_points = 9;
  RangeLimiterParams::fields(scan, WriteConfig(msg));
  SegmentationParams::fields(segments, WriteConfig(msg));

  RangeLimiterParams scan_read;
  SegmentationParams segments_read;
  segments_read.min_points_fraction = 0.25;  // not live
  RangeLimiterParams::fields(scan_read, ReadConfig(msg));
  SegmentationParams::fields(segments_read, ReadConfig(msg));
  EXPECT_EQ(scan_read.max_range_m, scan.max_range_m);
  ASSERT_EQ(scan_read.volume.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(scan_read.volume[i].normal_world, scan.volume[i].normal_world);
    EXPECT_EQ(scan_read.volume[i].offset_m, scan.volume[i].offset_m);
  }
  EXPECT_EQ(segments_read.min_points, 9);
  EXPECT_EQ(segments_read.min_points_fraction, 0.25);
}

TEST(LiveParams, SayWhatHasChanged) {
  dynamic_reconfigure::Config before, after;
  SegmentationConfig config = SegmentationConfig::__getDefault__();
  config.__toMessage__(before);
  config.max_range_m = 4.5;
  config.min_points = 6;
  config.__toMessage__(after);
  EXPECT_EQ(config_changes(before, before, "was"), "");
  EXPECT_EQ(config_changes(before, after, "was"), "max_range_m = 4.5 (was 10), min_points = 6 (was 4)");
  EXPECT_EQ(config_text([] {
              dynamic_reconfigure::Config msg;
              DetectionConfig::__getDefault__().__toMessage__(msg);
              return msg;
            }()),
            "min_p_ellipse = 0.9, max_residual_m = 0.06");
}

}  // namespace
}  // namespace situation_awareness
