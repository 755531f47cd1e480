// SPDX-License-Identifier: BSD-3-Clause
// Prints docs/parameters.md from the lists of fields that also check and load the parameters.
#include <charconv>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kUsage =
    "usage: parameter_reference\n"
    "\n"
    "Prints the reference of all parameters as Markdown. After a change of parameters:\n"
    "  build/parameter_reference > docs/parameters.md\n";

constexpr const char* kIntroduction =
    R"(# Parameters

*Printed by `build/parameter_reference` from the lists of fields that the package itself reads; a test compares them.*

Each nodelet reads the same private parameters, so that one file and one line of a launch file serve all three. The
sections `scan`, `segments`, `detections` and `objects` make a YAML file of the form of
[cfg/objects.yaml](../cfg/objects.yaml); what it leaves out keeps its default:

    roslaunch situation_awareness objects.launch config:=/path/to/my.yaml

The first section are arguments of `objects.launch`, of the same names. `objects_bag` takes the same file by `--config`. A
value out of its bounds, or of another type, is refused with a sentence that names it.
)";

std::string text_of(double value) {
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  if (error != std::errc()) throw std::runtime_error("a number has no text");
  return {text, end};
}

std::string text_of(bool value) { return value ? "true" : "false"; }
std::string text_of(const std::string& value) { return value.empty() ? "\"\"" : value; }
std::string text_of(const std::vector<HalfSpace>& value) {
  if (!value.empty()) throw std::logic_error("a default volume is not foreseen here");
  return "[]";
}

struct PrintRow {
  template <class Value>
  void operator()(const char* name, const Value& value, Bounds bounds, const char* unit, const char* doc) const {
    const std::string range = "[" + text_of(bounds.low) + ", " + text_of(bounds.high) + "]";
    print(name, text_of(static_cast<double>(value)), range + (*unit != '\0' ? " " : "") + unit, doc);
  }

  template <class Value>
  void operator()(const char* name, const Value& value, const char* doc) const {
    print(name, text_of(value), "", doc);
  }

 private:
  static void print(const char* name, const std::string& value, const std::string& range, const char* doc) {
    std::printf("| `%s` | `%s` | %s | %s |\n", name, value.c_str(), range.c_str(), doc);
  }
};

template <class Params>
void print_section(const char* title, const Params& params) {
  std::printf("\n## %s\n\n| Name | Default | Bounds and unit | |\n|---|---|---|---|\n", title);
  Params::fields(params, PrintRow{});
}

void print_all() {
  std::fputs(kIntroduction, stdout);
  const NodeletParams params;
  print_section("Arguments of the launch file", params);
  print_section("scan", params.pipeline.scan);
  print_section("segments", params.pipeline.segments);
  print_section("detections", params.pipeline.detections);
  std::printf("\n`detector` may be:");
  for (const std::string& name : detector_names()) std::printf(" `%s`", name.c_str());
  std::printf("; [ros.md](ros.md) says what they are.\n");
  print_section("detections/fit", params.pipeline.detections.fit);
  print_section("objects", params.pipeline.objects);
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char**) {
  if (argc != 1) {
    std::fputs(situation_awareness::kUsage, stderr);
    return 2;
  }
  try {
    situation_awareness::print_all();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "parameter_reference: %s\n", error.what());
    return 1;
  }
  return std::fflush(stdout) == 0 ? 0 : 1;
}
