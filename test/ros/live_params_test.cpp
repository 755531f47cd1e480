// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/live_params.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <dynamic_reconfigure/config_tools.h>

#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::live_params_test {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigDescription;
using dynamic_reconfigure::ConfigTools;

using Names = std::vector<std::string>;

Names names_of(const std::vector<Parameter>& parameters) {
  Names names;
  for (const Parameter& parameter : parameters) names.push_back(parameter.name);
  return names;
}

template <class Value>
Value value_in(const Config& config, const std::string& name) {
  Value value{};
  EXPECT_TRUE(ConfigTools::getParameter(config, name, value)) << name << " is not there, or of another type";
  return value;
}

template <class Value>
Config config_with(const std::string& name, const Value& value) {
  Config config;
  ConfigTools::appendParameter(config, name, value);
  return config;
}

/// A parameter of each type.
struct EveryParams {
  bool flag = true;
  int count = 4;
  double size_m = 0.5;
  std::string name = "a";
  std::vector<HalfSpace> region;
  double fixed_m = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("flag", self.flag, "a flag", kLive);
    visit("count", self.count, Bounds{1, 10}, "", "a count", kLive);
    visit("size_m", self.size_m, Bounds{0.0, 2.0}, "m", "a size", kLive);
    visit("name", self.name, "a name", kLive);
    visit("region", self.region, "a volume", kLive);
    visit("fixed_m", self.fixed_m, Bounds{0.0, 2.0}, "m", "a size at the start");
  }
};

// Names used in scripts and dashboards.
TEST(LiveParameters, OfTheNodeletsHaveTheNamesThatArePublished) {
  ObjectPipelineParams params;
  EXPECT_EQ(names_of(live_parameters(parameters_of(params.scan))), (Names{"min_range_m", "max_range_m", "volume"}));
  EXPECT_EQ(names_of(live_parameters(parameters_of(params.segments))),
            (Names{"max_gap_m", "max_range_gap_m", "max_missing_beams", "min_points", "min_narrow_points",
                   "max_object_extent_m", "min_bulge"}));
  EXPECT_EQ(names_of(live_parameters(parameters_of(params.detections))), (Names{"min_p_ellipse", "max_residual_m"}));
  EXPECT_EQ(names_of(live_parameters(parameters_of(params.objects))),
            (Names{"gate_probability", "confirmation_probability", "deletion_probability", "max_position_sigma_m",
                   "max_unseen_s"}));
}

TEST(LiveParameters, OfOneServerHaveDifferentNames) {
  EveryParams a, b;
  std::vector<Parameter> both = parameters_of(a, "a");
  for (const Parameter& parameter : parameters_of(b, "b")) both.push_back(parameter);
  EXPECT_THROW(live_parameters(both), std::logic_error);
}

TEST(LiveDescription, IsThatOfTheDeclarations) {
  ObjectPipelineParams params;
  EveryParams every;
  std::vector<Parameter> all = parameters_of(params);
  for (const Parameter& parameter : parameters_of(every)) all.push_back(parameter);
  const std::vector<Parameter> live = live_parameters(all);
  EXPECT_EQ(names_of(live).size(), 26U);
  const ConfigDescription description = description_of(live);
  ASSERT_EQ(description.groups.size(), 1U);
  EXPECT_EQ(description.groups[0].id, 0) << "clients look for this group";
  const auto& entries = description.groups[0].parameters;
  ASSERT_EQ(entries.size(), live.size());
  for (std::size_t i = 0; i < live.size(); ++i) {
    SCOPED_TRACE(live[i].path());
    EXPECT_EQ(entries[i].name, live[i].name);
    EXPECT_EQ(entries[i].description.find(live[i].doc), 0U);
    if (auto* const* real = std::get_if<double*>(&live[i].value)) {
      EXPECT_EQ(entries[i].type, "double");
      EXPECT_EQ(value_in<double>(description.min, live[i].name), live[i].bounds->low);
      EXPECT_EQ(value_in<double>(description.max, live[i].name), live[i].bounds->high);
      EXPECT_EQ(value_in<double>(description.dflt, live[i].name), **real);
    } else if (auto* const* whole = std::get_if<int*>(&live[i].value)) {
      EXPECT_EQ(entries[i].type, "int");
      EXPECT_EQ(value_in<int>(description.min, live[i].name), live[i].bounds->low);
      EXPECT_EQ(value_in<int>(description.max, live[i].name), live[i].bounds->high);
      EXPECT_EQ(value_in<int>(description.dflt, live[i].name), **whole);
    } else if (live[i].name == "flag") {
      EXPECT_EQ(entries[i].type, "bool");
      EXPECT_FALSE(value_in<bool>(description.min, "flag"));
      EXPECT_TRUE(value_in<bool>(description.max, "flag"));
      EXPECT_TRUE(value_in<bool>(description.dflt, "flag"));
    } else {
      EXPECT_EQ(entries[i].type, "str");
      EXPECT_EQ(value_in<std::string>(description.min, live[i].name), "");
      EXPECT_EQ(value_in<std::string>(description.max, live[i].name), "");
    }
  }
  EXPECT_EQ(entries.back().name, "region");
  EXPECT_EQ(value_in<std::string>(description.dflt, "region"), "[]");
  EXPECT_NE(entries[0].description.find("[m]"), std::string::npos) << "with its unit";
}

TEST(LiveConfig, IsReadAsItIsWritten) {
  EveryParams params;
  params.flag = false;
  params.count = 9;
  params.size_m = 1.0 / 3.0;
  params.name = "b";
  params.region = {{{0.1, -1e-7, 0.0}, 1.0 / 3.0}, {{0.0, 0.0, 1.0}, 2.5}};
  params.fixed_m = 1.5;
  const Config config = config_of(live_parameters(parameters_of(params)));
  ASSERT_EQ(config.groups.size(), 1U);
  EXPECT_TRUE(config.groups[0].state);

  EveryParams read;
  EXPECT_EQ(set_from_config(live_parameters(parameters_of(read)), config), Names{});
  EXPECT_FALSE(read.flag);
  EXPECT_EQ(read.count, 9);
  EXPECT_EQ(read.size_m, 1.0 / 3.0);
  EXPECT_EQ(read.name, "b");
  EXPECT_EQ(read.fixed_m, 1.0) << "it is not live";
  ASSERT_EQ(read.region.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read.region[i].normal_world, params.region[i].normal_world);
    EXPECT_EQ(read.region[i].offset_m, params.region[i].offset_m);
  }
}

TEST(LiveConfig, IsClampedToTheBounds) {
  EveryParams params;
  const std::vector<Parameter> live = live_parameters(parameters_of(params));
  set_from_config(live, config_with("size_m", 1e9));
  EXPECT_EQ(params.size_m, 2.0);
  set_from_config(live, config_with("size_m", -INFINITY));
  EXPECT_EQ(params.size_m, 0.0);
  set_from_config(live, config_with("count", -7));
  EXPECT_EQ(params.count, 1);
  set_from_config(live, config_with("size_m", std::nan("")));
  EXPECT_TRUE(std::isnan(params.size_m)) << "which validate() then refuses";
  EXPECT_THROW(check_bounds(params, "every"), std::invalid_argument);
}

TEST(LiveConfig, ReturnsUnknownNames) {
  EveryParams params;
  const std::vector<Parameter> live = live_parameters(parameters_of(params));
  EXPECT_EQ(set_from_config(live, config_with("size", 1.0)), Names{"size"});
  EXPECT_EQ(set_from_config(live, config_with("size_m", 1)), Names{"size_m"}) << "a whole number is another type";
  EXPECT_EQ(set_from_config(live, config_with("fixed_m", 1.5)), Names{"fixed_m"}) << "it is not live";
  EXPECT_EQ(params.size_m, 0.5);
  EXPECT_EQ(params.fixed_m, 1.0);
}

TEST(LiveConfig, ThatCannotBeReadIsRefusedByName) {
  EveryParams params;
  const std::vector<Parameter> live = live_parameters(parameters_of(params));
  EXPECT_TRUE(
      names(refusal_of([&] { set_from_config(live, config_with<std::string>("region", "a room")); }), {"region"}));
  EXPECT_TRUE(params.region.empty());
}

}  // namespace
}  // namespace situation_awareness::live_params_test
