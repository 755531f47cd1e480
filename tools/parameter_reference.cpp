// SPDX-License-Identifier: BSD-3-Clause
// Prints docs/parameters.md from the lists of fields that also check and load the parameters.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/params/circumnavigate_nodelet_params.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/params/grid_nodelet_params.hpp"
#include "situation_awareness/ros/params/localization_nodelet_params.hpp"
#include "situation_awareness/ros/params/map_nodelet_params.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/params/path_nodelet_params.hpp"
#include "situation_awareness/ros/params/scout_nodelet_params.hpp"

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

Each nodelet reads the same private parameters, so that one file and one line of a launch file serve all. The sections
`scan`, `segments`, `detections` and `objects` make a YAML file of the form of [cfg/objects.yaml](../cfg/objects.yaml);
`scan`, `segments` and those from `reflectors` to `movers` one of the form of [cfg/polygons.yaml](../cfg/polygons.yaml),
which may have all. [cfg/splinegons.yaml](../cfg/splinegons.yaml) has `scan`, `segments`, `polylines`, `polygons`,
`gps_ins`, `alignment`, `boundaries` and `splinegons`, [cfg/grid.yaml](../cfg/grid.yaml) those after
[the semantic grid](#the-semantic-grid). Omitted parameters keep their defaults:

    roslaunch situation_awareness map.launch config:=/path/to/my.yaml
    roslaunch situation_awareness map.launch kinds:=grid grid_config:=/path/to/my.yaml dem:=/path/to/dem.tif

[cfg/map.yaml](../cfg/map.yaml) may have the sections of all but the grid. The first section are arguments of
`map.launch` of the same names; what several nodelets read is in the second one, once. `objects_bag`,
`polygons_bag`, `splinegons_bag` and `grid_bag` take the same files by `--config`; `map_bag` takes one that may have the
sections of all, and those of [cfg/grid.yaml](../cfg/grid.yaml) within a section `grid`. A value out of its bounds, or of
another type, is refused with a message that names it; a key that is none of these has no effect, and a warning says so.

Tools and nodelets read a file alike, by the rules of YAML 1.1 that rosparam has: `010` is 8, `12:30` is 750, `1_000` is
1000, `yes`, `on`, `no` and `off` are true and false, `deg(90)` is an angle in rad, `<<` merges maps. `1e-3`, `08` and
`-.5` are texts there, and are taken for numbers where a number is needed. A key that is given twice, several documents,
a date without quotes and a whole number beyond 32 bits are refused by name. `rosparam load` without the launch files
keeps the last of two equal keys, and says nothing. Of a section without keys (`scan:`) roslaunch cannot make a
parameter, and ends with an error: write `scan: {}`.

Parameters marked *live* can be changed while the nodelets run ([ros.md](ros.md#live-parameters)).
)";

/// Strings without quotes where YAML needs none.
std::string default_of(const Parameter& parameter) {
  const auto* const* text = std::get_if<std::string*>(&parameter.value);
  return text != nullptr && !(*text)->empty() ? **text : yaml_text(parameter);
}

std::string heading_of(const std::string& section) {
  if (section.empty()) return "Arguments of the launch file";
  std::string heading = section;
  std::replace(heading.begin(), heading.end(), '.', '/');
  return heading;
}

bool has_section(const std::vector<Parameter>& parameters, const std::string& section) {
  return std::any_of(parameters.begin(), parameters.end(),
                     [&](const Parameter& parameter) { return parameter.section == section; });
}

/// Whether two nodelets declare the same parameter: one line of a launch file may serve both.
bool is_same(const Parameter& a, const Parameter& b) {
  return a.section == b.section && a.name == b.name && default_of(a) == default_of(b);
}

bool is_in(const std::vector<Parameter>& parameters, const Parameter& parameter) {
  return std::any_of(parameters.begin(), parameters.end(),
                     [&](const Parameter& other) { return is_same(other, parameter); });
}

/// The parameters at the top that several of the nodelets have and `before` has not, each once, as the first declares.
std::vector<Parameter> common_of(const std::vector<std::vector<Parameter>>& nodelets,
                                 const std::vector<Parameter>& before) {
  std::vector<Parameter> common;
  for (std::size_t i = 0; i < nodelets.size(); ++i) {
    for (const Parameter& parameter : nodelets[i]) {
      if (parameter.section.empty() && !parameter.doc.empty() && !is_in(before, parameter) &&
          !is_in(common, parameter) &&
          std::any_of(nodelets.begin() + static_cast<std::ptrdiff_t>(i) + 1, nodelets.end(),
                      [&](const auto& other) { return is_in(other, parameter); })) {
        common.push_back(parameter);
      }
    }
  }
  return common;
}

/// The parameters of a section but those that `before` has, too.
void print_section(const std::vector<Parameter>& parameters, const std::string& section, const std::string& heading,
                   const std::vector<Parameter>& before) {
  std::printf("\n## %s\n\n| Name | Default | Bounds and unit | Live | |\n|---|---|---|---|---|\n", heading.c_str());
  for (const Parameter& parameter : parameters) {
    if (parameter.section != section || parameter.doc.empty() || is_in(before, parameter)) continue;
    const std::string range = parameter.bounds ? text_of(*parameter.bounds, parameter.unit) : "";
    std::printf("| `%s` | `%s` | %s | %s | %s |\n", parameter.name.c_str(), default_of(parameter).c_str(),
                range.c_str(), parameter.live ? "live" : "", parameter.doc.c_str());
  }
  if (section == "detections") {
    std::printf("\n`detector` may be:");
    for (const std::string& name : detector_names()) std::printf(" `%s`", name.c_str());
    std::printf("; [ros.md](ros.md) describes them.\n");
  }
}

/// All sections in the order of their first parameters, but those that `before` has, too.
void print_sections(const std::vector<Parameter>& parameters, const std::vector<Parameter>& before) {
  std::vector<std::string> sections;
  for (const Parameter& parameter : parameters) {
    if (std::find(sections.begin(), sections.end(), parameter.section) == sections.end() &&
        !has_section(before, parameter.section)) {
      sections.push_back(parameter.section);
    }
  }
  for (const std::string& section : sections) print_section(parameters, section, heading_of(section), {});
}

void print_all() {
  std::fputs(kIntroduction, stdout);
  ObjectNodeletParams object_params;
  PolygonPipelineParams polygon_params;
  LocalizationNodeletParams localization_params;
  PathNodeletParams path_params;
  GpsInsNodeletParams gps_ins_params;
  SplinegonPipelineParams splinegon_params;
  MapNodeletParams map_params;
  CircumnavigateNodeletParams mission_params;
  GridNodeletParams grid_params;
  ScoutNodeletParams scout_params;
  const std::vector<Parameter> of_objects = parameters_of(object_params);
  const std::vector<Parameter> of_polygons = parameters_of(polygon_params);
  const std::vector<Parameter> of_localization = parameters_of(localization_params);
  const std::vector<Parameter> of_path = parameters_of(path_params);
  const std::vector<Parameter> of_gps_ins = parameters_of(gps_ins_params);
  const std::vector<Parameter> of_splinegons = parameters_of(splinegon_params);
  const std::vector<Parameter> of_map = parameters_of(map_params);
  const std::vector<Parameter> of_mission = parameters_of(mission_params);
  const std::vector<Parameter> of_grid = parameters_of(grid_params);
  const std::vector<Parameter> of_scout = parameters_of(scout_params);
  const std::vector<Parameter> common =
      common_of({of_gps_ins, of_localization, of_path, of_map, of_mission, of_grid, of_scout}, of_objects);
  std::vector<Parameter> printed = of_objects;  // at the top
  printed.insert(printed.end(), common.begin(), common.end());

  print_section(of_objects, "", heading_of(""), {});
  print_section(common, "", "Common to several nodelets", {});
  print_sections(of_objects, common);
  print_sections(of_polygons, of_objects);
  print_section(of_localization, "", "reflector_localization", printed);
  print_section(of_path, "", "safety_areas and path_following", printed);
  print_sections(of_path, of_objects);
  print_section(of_gps_ins, "", "The nodelet gps_ins", printed);
  print_sections(of_gps_ins, of_objects);
  std::vector<Parameter> before = of_polygons;
  before.insert(before.end(), of_gps_ins.begin(), of_gps_ins.end());
  print_sections(of_splinegons, before);
  before.insert(before.end(), of_splinegons.begin(), of_splinegons.end());
  print_section(of_map, "", "The one map", printed);
  print_sections(of_map, before);
  print_section(of_mission, "", "The nodelet circumnavigate", printed);
  print_sections(of_mission, of_objects);
  print_section(of_grid, "", "The semantic grid", printed);
  print_sections(of_grid, of_objects);
  print_section(of_scout, "", "The nodelet scout", printed);
  print_sections(of_scout, of_objects);
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
