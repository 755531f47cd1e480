// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/canonical_yaml.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/yaml_defect.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "support/refusal.hpp"

namespace situation_awareness::params_test {
namespace {

/// A user-defined type with YAML text: [low, high].
struct Span {
  int low = 1;
  int high = 2;
};
std::string yaml_text(const Span& span) {
  return '[' + std::to_string(span.low) + ", " + std::to_string(span.high) + ']';
}
void read_yaml_text(const std::string& yaml, Span& span) {
  char end = '\0';
  const int read = std::sscanf(yaml.c_str(), "[%d, %d%c", &span.low, &span.high, &end);
  if (read != 3 || end != ']') throw std::invalid_argument("must be [low, high]");
}

struct InnerParams {
  double size_m = 0.5;
  int count = 3;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("size_m", self.size_m, Bounds{0.0, 2.0}, "m", "a size");
    visit("count", self.count, Bounds{1, 10}, "", "a count");
  }

  void validate() const {
    check_bounds(*this, "middle.inner");
    if (size_m * count > 10.0) throw std::invalid_argument("middle.inner.count is too large for its size_m");
  }
};

struct MiddleParams {
  InnerParams inner;
  bool flag = false;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("inner", self.inner);
    visit("flag", self.flag, "a flag");  // behind a section: the order of declarations is free
  }
};

struct OuterParams {
  std::string name = "a name";
  MiddleParams middle;
  Span span;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("name", self.name, "a text");
    visit("middle", self.middle);
    visit("span", self.span, "a span");
  }
};

OuterParams read(const std::string& yaml) {
  return params_from_yaml<OuterParams>(yaml, "my.yaml",
                                       [](const UnknownKey& key) { ADD_FAILURE() << message_of(key); });
}

/// The message on `yaml` is one line that holds all of `facts`, the source first.
void expect_refusal(const std::string& yaml, const std::vector<std::string>& facts) {
  const std::string message = refusal_of([&] { read(yaml); });
  EXPECT_EQ(message.rfind("my.yaml: ", 0), 0U) << message;
  EXPECT_TRUE(names(message, facts));
}

TEST(Parameters, AreListedWithTheirDeclarations) {
  OuterParams params;
  const std::vector<Parameter> list = parameters_of(params);
  std::vector<std::string> paths;
  for (const Parameter& parameter : list) paths.push_back(parameter.path());
  EXPECT_EQ(paths, (std::vector<std::string>{"name", "middle.inner.size_m", "middle.inner.count", "middle.flag",  //
                                             "span"}));
  const Parameter& size = list[1];
  EXPECT_EQ(size.section, "middle.inner");
  EXPECT_EQ(size.unit, "m");
  EXPECT_EQ(size.doc, "a size");
  ASSERT_TRUE(size.bounds);
  EXPECT_EQ(size.bounds->high, 2.0);
  EXPECT_FALSE(list[3].bounds);
  *std::get<double*>(size.value) = 1.25;
  EXPECT_EQ(params.middle.inner.size_m, 1.25) << "the list refers to the struct";
}

TEST(Parameters, AreReadAndOmittedOnesKeepTheirDefaults) {
  const OuterParams params = read("{middle: {inner: {size_m: 1}, flag: true}, span: [3, 4]}");
  EXPECT_EQ(params.name, "a name");
  EXPECT_EQ(params.middle.inner.size_m, 1.0);
  EXPECT_EQ(params.middle.inner.count, 3);
  EXPECT_TRUE(params.middle.flag);
  EXPECT_EQ(params.span.low, 3);
  EXPECT_EQ(params.span.high, 4);
  for (const char* yaml : {"", "{}", "middle:", "middle: {inner: ~}", "# nothing"}) {
    EXPECT_EQ(yaml_from_params(read(yaml)), yaml_from_params(OuterParams{})) << yaml;
  }
}

TEST(Parameters, KeepTheGivenDefaults) {
  OuterParams defaults;
  defaults.middle.inner.count = 7;
  defaults.name = "other";
  const auto params = params_from_yaml<OuterParams>("name: third", "my.yaml", print_warning, defaults);
  EXPECT_EQ(params.middle.inner.count, 7);
  EXPECT_EQ(params.name, "third");
}

TEST(Parameters, ReadBackAsTheyAreWritten) {
  OuterParams params;
  params.name = "\"quoted\" \\ and: [odd] \t\n#\x01\x7F end \xC3\xA4";
  params.middle.inner.size_m = 1.0 / 3.0;
  params.middle.inner.count = 9;
  params.middle.flag = true;
  params.span = {-5, 7};
  const OuterParams again = read(yaml_from_params(params));
  EXPECT_EQ(again.name, params.name);
  EXPECT_EQ(again.middle.inner.size_m, params.middle.inner.size_m);
  EXPECT_EQ(again.middle.inner.count, 9);
  EXPECT_TRUE(again.middle.flag);
  EXPECT_EQ(again.span.low, -5);
  EXPECT_EQ(yaml_from_params(again), yaml_from_params(params));
}

TEST(YamlText, IsTheShortestThatReadsBack) {
  using situation_awareness::yaml_text;
  EXPECT_EQ(yaml_text(0.1), "0.1");
  EXPECT_EQ(yaml_text(-2.0), "-2");
  EXPECT_EQ(yaml_text(1e300), "1e+300");
  EXPECT_EQ(yaml_text(std::nan("")), ".nan");
  EXPECT_EQ(yaml_text(-std::numeric_limits<double>::infinity()), "-.inf");
  EXPECT_EQ(yaml_text(true), "true");
  EXPECT_EQ(yaml_text(-3), "-3");
  EXPECT_EQ(yaml_text(4294967296.0), "4294967296.0") << "no whole number of 32 bits";
}

TEST(Parameters, OutOfBoundsAreRefusedWithPathValueAndBound) {
  expect_refusal("middle: {inner: {size_m: 2.5}}", {"middle.inner.size_m", "2.5", "0", "2"});
  expect_refusal("middle: {inner: {size_m: -.inf}}", {"middle.inner.size_m", "-.inf", "0", "2"});
  expect_refusal("middle: {inner: {size_m: .nan}}", {"middle.inner.size_m", ".nan", "0", "2"});
  expect_refusal("middle: {inner: {count: 0}}", {"middle.inner.count", "0", "1", "10"});
  EXPECT_EQ(read("middle: {inner: {size_m: 2, count: 1}}").middle.inner.size_m, 2.0) << "bounds are inside";
}

TEST(Parameters, OfAnotherTypeAreRefusedWithPathValueAndType) {
  expect_refusal("middle: {inner: {size_m: far}}", {"middle.inner.size_m", "far", "number", "0", "2"});
  expect_refusal("middle: {inner: {size_m: [1]}}", {"middle.inner.size_m", "list", "number"});
  expect_refusal("middle: {inner: {size_m: }}", {"middle.inner.size_m", "null", "number"});
  expect_refusal("middle: {inner: {count: 4.5}}", {"middle.inner.count", "4.5", "whole number", "1", "10"});
  expect_refusal("middle: {inner: {count: 99999999999}}", {"middle.inner.count", "whole number"});
  expect_refusal("middle: {flag: 1}", {"middle.flag", "1", "true", "false"});
  expect_refusal("middle: {flag: \"no\"}", {"middle.flag", "\"no\"", "true", "false"});
  expect_refusal("name: 3", {"name", "3", "text"});
  expect_refusal("name: true", {"name", "true", "text"});
  expect_refusal("name: ~", {"name", "null", "text"});
  expect_refusal("name: {a: b}", {"name", "map", "text"});
  expect_refusal("span: 7", {"span", "[low, high]"});
  expect_refusal("middle: 7", {"middle", "map", "7"});
  expect_refusal("middle: {inner: [1]}", {"middle.inner", "map", "list"});
  expect_refusal("7", {"map", "7"});
  expect_refusal("middle: {inner: {size_m: \"two\\nlines\"}}", {"middle.inner.size_m"});
  const std::string long_value = "middle: {inner: {size_m: " + std::string(500, 'x') + "}}";
  expect_refusal(long_value, {"middle.inner.size_m"});
  EXPECT_LT(refusal_of([&] { read(long_value); }).size(), 150U) << "a long value is cut";
}

TEST(Parameters, MayBeQuoted) {
  // rosparam reads 1e-1 as a string, as in YAML 1.1.
  EXPECT_EQ(read("middle: {inner: {size_m: \"1e-1\"}}").middle.inner.size_m, 0.1);
  EXPECT_EQ(read("name: \"3\"").name, "3");
  EXPECT_EQ(read("name: 'true'").name, "true");
  EXPECT_EQ(read("name: 3d map").name, "3d map");
}

TEST(Parameters, AreRefusedIfNotYaml) {
  expect_refusal("middle: [", {"YAML"});
  expect_refusal("name: a\nname: b", {"name", "twice"});
  expect_refusal("middle: {inner: {count: 2, count: 3}}", {"middle.inner.count", "twice"});
  expect_refusal("[name]: 3", {"text"});
  expect_refusal("middle: {? {a: b} : 3}", {"middle", "text"});
}

TEST(Parameters, AreValidatedFromTheInsideOut) {
  expect_refusal("middle: {inner: {size_m: 2, count: 10}}", {"middle.inner.count", "size_m"});
  OuterParams params;
  params.middle.inner.size_m = 3.0;
  EXPECT_THROW(validate_all(params), std::invalid_argument);
}

TEST(UnknownKeys, AreReportedWithTheKeysOfTheirSection) {
  std::vector<UnknownKey> keys;
  const auto params = params_from_yaml<OuterParams>(
      "{nam: x, middle: {inner: {size: 1, count: 5}, inner.count: 1, '': 1}, middle.flag: true}", "my.yaml",
      [&keys](const UnknownKey& key) { keys.push_back(key); });
  EXPECT_EQ(params.middle.inner.count, 5) << "the rest is read";
  EXPECT_FALSE(params.middle.flag);
  ASSERT_EQ(keys.size(), 5U);
  EXPECT_EQ(keys[0].source, "my.yaml");
  EXPECT_EQ(keys[0].path, "middle.inner.size");
  EXPECT_EQ(keys[0].known, (std::vector<std::string>{"count", "size_m"}));
  EXPECT_EQ(keys[1].path, "middle.inner.count") << "a key with a dot is no path";
  EXPECT_EQ(keys[1].known, (std::vector<std::string>{"flag", "inner"}));
  EXPECT_EQ(keys[2].path, "middle.");
  EXPECT_EQ(keys[3].path, "nam");
  EXPECT_EQ(keys[3].known, (std::vector<std::string>{"middle", "name", "span"}));
  EXPECT_EQ(keys[4].path, "middle.flag");

  EXPECT_TRUE(names(message_of(keys[0]), {"my.yaml", "middle.inner.size", "count", "size_m"}));
}

TEST(UnknownKeys, AreWarnedOfOnStderrOrRefused) {
  testing::internal::CaptureStderr();
  params_from_yaml<OuterParams>("nam: x", "my.yaml");
  std::string warning = testing::internal::GetCapturedStderr();
  ASSERT_FALSE(warning.empty());
  EXPECT_EQ(warning.back(), '\n');
  warning.pop_back();
  const std::vector<std::string> facts = {"my.yaml", "nam", "middle", "name", "span"};
  EXPECT_TRUE(names(warning, facts));
  EXPECT_TRUE(names(refusal_of([] { params_from_yaml<OuterParams>("nam: x", "my.yaml", refuse); }), facts));
}

TEST(TextFile, IsReadOrRefusedByName) {
  const std::string path = testing::TempDir() + "/params_test.yaml";
  std::ofstream(path) << "name: x\n";
  EXPECT_EQ(read_text_file(path), "name: x\n");
  std::ofstream(path, std::ios::trunc).flush();
  EXPECT_EQ(read_text_file(path), "");
  std::remove(path.c_str());
  for (const std::string& bad : {path, testing::TempDir()}) {
    EXPECT_EQ(refusal_of([&] { read_text_file(bad); }).rfind(bad, 0), 0U);
  }
}

TEST(CanonicalYaml, HasEachValueAsItIsOnTheParameterServer) {
  const std::vector<std::pair<const char*, const char*>> cases = {{"010", "8"},
                                                                  {"0x1F", "31"},
                                                                  {"0b101", "5"},
                                                                  {"1_000", "1000"},
                                                                  {"-12:30", "-750"},
                                                                  {"1:30.5", "90.5"},
                                                                  {"08", "\"08\""},
                                                                  {"09:30", "\"09:30\""},
                                                                  {"1e-3", "\"1e-3\""},
                                                                  {"1.0e-5", "1.0e-05"},
                                                                  {".5", "0.5"},
                                                                  {"-.5", "\"-.5\""},
                                                                  {"5.", "5"},
                                                                  {"010.5", "10.5"},
                                                                  {".inf", ".inf"},
                                                                  {"inf", "\"inf\""},
                                                                  {"Yes", "true"},
                                                                  {"off", "false"},
                                                                  {"y", "\"y\""},
                                                                  {"\"yes\"", "\"yes\""},
                                                                  {"'010'", "\"010\""},
                                                                  {"~", "~"},
                                                                  {"deg(180)", "3.141592653589793"},
                                                                  {"rad(pi/2)", "1.5707963267948966"},
                                                                  {"!!float 3", "3"},
                                                                  {"!!int \"7\"", "7"},
                                                                  {"!!str 7", "\"7\""},
                                                                  {"[010, {a: on}]", "[8, {\"a\": true}]"}};
  for (const auto& [text, canonical] : cases) {
    const std::string yaml = std::string("v: ") + text, expected = std::string("{\"v\": ") + canonical + '}';
    EXPECT_EQ(canonical_yaml(yaml), expected) << text;
    EXPECT_EQ(canonical_yaml(expected), expected) << text;
  }
  EXPECT_EQ(canonical_yaml("a: &x {b: 1, c: {d: 1}}\ne: {<<: *x, c: {f: 2}}"),
            "{\"a\": {\"b\": 1, \"c\": {\"d\": 1}}, \"e\": {\"b\": 1, \"c\": {\"f\": 2}}}");
}

TEST(Parameters, AreThoseOfTheParameterServer) {
  EXPECT_EQ(read("middle: {inner: {count: 010}}").middle.inner.count, 8);
  EXPECT_EQ(read("middle: {inner: {count: 7.0}}").middle.inner.count, 7);
  EXPECT_EQ(read("middle: {inner: {size_m: 1e-3}}").middle.inner.size_m, 1e-3);
  EXPECT_EQ(read("middle: {inner: {size_m: 0b1}}").middle.inner.size_m, 1.0);
  EXPECT_EQ(read("name: y").name, "y");
  EXPECT_EQ(read("span: [010, 11]").span.low, 8);
  expect_refusal("middle: {flag: y}", {"middle.flag", "y", "true", "false"});
  expect_refusal("name: 12:30", {"name", "750", "text"});
  expect_refusal("middle: {inner: {size_m: 12:30}}", {"middle.inner.size_m", "750", "0", "2"});
}

TEST(CanonicalYaml, RefusesByNameWhatTheParameterServerRefusesOrLoses) {
  const auto refused = [](const char* yaml, const std::vector<std::string>& facts) {
    EXPECT_TRUE(names(refusal_of([&] { canonical_yaml(yaml); }), facts)) << yaml;
  };
  refused("a: {b: 1, b: 2}", {"a.b", "twice"});
  refused("other: {'b': 1, b: 1}", {"other.b", "twice"});
  refused("a: 1\n---\na: 2", {"several documents"});
  refused("a: 2001-02-03", {"a", "2001-02-03", "time"});
  refused("a: {on: 1}", {"name", "a", "on", "text"});
  refused("7: 1", {"name", "7", "text"});
  refused("a: 3000000000", {"a", "3000000000", "3000000000.0"});
  refused("a: {<<: 3}", {"a", "merge"});
  refused("a: !foo 3", {"a", "!foo"});
  refused("a: deg(x)", {"a", "deg(x)"});
  refused("a: &a [*a]", {"nested"});
  refused(
      "a: &a [1, 2, 3, 4, 5, 6, 7, 8, 9, 0]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a, *a]\n"
      "c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b, *b]\nd: &d [*c, *c, *c, *c, *c, *c, *c, *c, *c, *c]\n"
      "e: &e [*d, *d, *d, *d, *d, *d, *d, *d, *d, *d]\nf: [*e, *e, *e, *e, *e, *e, *e, *e, *e, *e]",
      {"nested"});
  EXPECT_EQ(canonical_yaml("a: " + std::string(100'000, '1')), "{\"a\": \"" + std::string(100'000, '1') + "\"}");
}

TEST(YamlDefect, IsOneLine) {
  EXPECT_EQ(yaml_defect(std::runtime_error("unknown escape character: \n")),
            "not valid YAML: unknown escape character:  ");
}

}  // namespace
}  // namespace situation_awareness::params_test
