// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/knobs.hpp"

#include <gtest/gtest.h>

namespace situation_awareness::knobs_test {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigDescription;

void append(Config& to, const Config& from) {
  to.bools.insert(to.bools.end(), from.bools.begin(), from.bools.end());
  to.ints.insert(to.ints.end(), from.ints.begin(), from.ints.end());
  to.doubles.insert(to.doubles.end(), from.doubles.begin(), from.doubles.end());
  to.strs.insert(to.strs.end(), from.strs.begin(), from.strs.end());
}

void add(ConfigDescription& description, const Knob& knob) {
  if (description.groups.empty()) description.groups.emplace_back();
  description.groups.back().parameters.emplace_back();
  description.groups.back().parameters.back().name = knob.name;
  description.groups.back().parameters.back().description = knob.description;
  append(description.dflt, config_of(knob.name, knob.value));
  append(description.min, config_of(knob.name, knob.low));
  append(description.max, config_of(knob.name, knob.high));
}

TEST(Knobs, AreThoseOfTheDescription) {
  const std::vector<Knob> knobs{{"gate_probability", "in it", 0.999, 0.5, 0.999999},
                                {"min_points", "at least", 4, 2, 100},
                                {"volume", "half-spaces", std::string("[]"), std::string(), std::string()},
                                {"on", "or off", true, false, true}};
  ConfigDescription description;
  for (const Knob& knob : knobs) add(description, knob);
  description.groups.back().parameters.emplace_back();
  description.groups.back().parameters.back().name = "without_bounds";
  EXPECT_TRUE(knobs_of(description) == knobs);
}

TEST(Knobs, AreSetOneByOne) {
  for (const KnobValue& value :
       {KnobValue(true), KnobValue(-3), KnobValue(0.25), KnobValue(std::string("[[0, 0, 1, 2]]"))}) {
    const Config config = config_of("x", value);
    EXPECT_EQ(config.bools.size() + config.ints.size() + config.doubles.size() + config.strs.size(), 1U);
    EXPECT_EQ(value_in(config, "x"), value);
    EXPECT_FALSE(value_in(config, "y"));
  }
}

TEST(Knobs, AreWrittenWithTheDigitsTheyNeed) {
  EXPECT_EQ(text_of(0.999999), "0.999999");
  EXPECT_EQ(text_of(0.1), "0.1");
  EXPECT_EQ(text_of(60.0), "60");
  EXPECT_EQ(text_of(4), "4");
  EXPECT_EQ(text_of(false), "false");
}

}  // namespace
}  // namespace situation_awareness::knobs_test
