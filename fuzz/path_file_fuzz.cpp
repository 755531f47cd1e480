// SPDX-License-Identifier: BSD-3-Clause
// Any text as the file of a path, and as that of its local maps.
#include <stdexcept>
#include <string>
#include <utility>

#include "input.hpp"
#include "situation_awareness/path/local_maps.hpp"
#include "situation_awareness/path/path.hpp"
#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/path/spline_path.hpp"

namespace situation_awareness::fuzz {
namespace {

/// Whether `read` takes the text; a refusal names the file and the reason.
template <class Read>
bool accepts(const Read& read) {
  try {
    read();
  } catch (const std::invalid_argument& error) {
    const std::string sentence = error.what();
    require(sentence.rfind("fuzz.yaml: ", 0) == 0 && sentence.size() > 11, "a refusal names the file and the reason");
    return false;
  }
  return true;
}

void follow(const Path& path) {
  const SplinePath spline(path);
  require(spline.length_m() > 0.0 && std::isfinite(spline.length_m()), "a path has a length");
  for (const double part : {-0.1, 0.0, 0.3, 0.77, 1.0, 1.2}) {
    const PathPoint point = spline.at(part * spline.length_m());
    require(point.p_world_m.allFinite() && std::isfinite(point.yaw_rad) && std::isfinite(point.curvature_1_m),
            "points of a path are finite");
    const double way_m = spline.nearest_m(point.p_world_m, part * spline.length_m());
    require(way_m >= 0.0 && way_m <= spline.length_m(), "the nearest point is on the path");
  }
  if (spline.length_m() > 1e4) return;  // the speeds along it are tabulated
  PathFollowing following(path, {}, {});
  SafetyAreas areas(path, {}, {});
  following.start();
  Points points;
  VehicleState state;
  state.T_world_base = spline.at(0.4 * spline.length_m()).pose();
  for (int i = 0; i < 3; ++i) {
    points.stamp_ns += 40'000'000;
    const SafetyDecision& decision = areas.update(points, state, {});
    require(decision.verdict == SafetyDecision::Verdict::kStop, "nothing that is not seen is free");
    const PathFollowingResult& result = following.update(points.stamp_ns, state.T_world_base, {1.0, true});
    require(std::isfinite(result.command.speed_m_s) && std::isfinite(result.command.turn_rate_rad_s),
            "commands are finite");
  }
}

void run(const std::string& yaml) {
  Path path;
  if (accepts([&] { path = read_path(yaml, "fuzz.yaml"); })) {
    const Path again = read_path(yaml_text(path), "again.yaml");
    require(yaml_text(again) == yaml_text(path), "what is written reads back");
    if (accepts([&] { SplinePath(path, "fuzz.yaml"); })) follow(path);
  }
  std::vector<LocalMap> maps;
  if (accepts([&] { maps = read_local_maps(yaml, 3, "fuzz.yaml"); })) {
    require(yaml_text(read_local_maps(yaml_text(maps), 3, "again.yaml")) == yaml_text(maps),
            "what is written reads back");
  }
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({reinterpret_cast<const char*>(data), size});
  return 0;
}
