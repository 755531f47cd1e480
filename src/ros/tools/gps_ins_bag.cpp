// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to the poses by GPS and INS, without a roscore and without scans.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>

#include "command_line.hpp"
#include "situation_awareness/common/json.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/line_file.hpp"
#include "situation_awareness/ros/bag/navigation.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "gps_ins_bag";
constexpr const char* kConfig = "map_outdoor.yaml";
constexpr const char* kDescription =
    R"(Reads an IMU and the fixes of a GPS receiver out of a bag and writes the pose of the base as the nodelet gps_ins
publishes it: one line of JSON for each, from when on it is known,
  {"stamp": s, "pose": {"x", "y", "z", "roll", "pitch", "yaw": number, "covariance": [36 numbers, row by row]},
   "velocity": [x, y, z]}
in m, rad and s, in the local east, north and up of the origin. The covariance is that of x, y, z and of the attitude's
error in the base; the velocity is that of the base in the world. The file is written atomically.
)";

struct Options {
  BagOptions bag;
  NavigationOptions navigation;
  std::string base_frame = "base_link", out;
  double rate_hz = 50.0;
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  add_navigation_options(app, options.navigation);
  app.add_option("--base-frame", options.base_frame, "of the vehicle").type_name("FRAME");
  app.add_option("--rate", options.rate_hz, "largest rate of the poses").type_name("HZ").check(in_range(0.0, 1e4));
  app.add_option("--out", options.out, "output file of the lines").type_name("FILE").required();
  app.callback([&options] { check_origin(options.navigation); });
}

/// Of the file, which may have those of all other stages.
struct Params {
  GpsInsParams gps_ins;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("gps_ins", self.gps_ins);
  }
};

std::string line_of(const GpsInsPose& pose) {
  Json line;
  line["pose"] = json_of_pose(pose.T_world_base, pose.covariance);
  line["velocity"] = list_of(3, [&](int i) { return pose.velocity_world_m_s(i); });
  return json_line(pose.stamp_ns, line);
}

int gps_ins_bag(const Options& options) {
  const std::string path = config_path(options.bag, kConfig);
  const OnUnknownKey warn_of_own = [](const UnknownKey& key) {
    if (key.path.rfind("gps_ins", 0) == 0) print_warning(key);
  };
  const auto params = params_from_yaml<Params>(read_text_file(path), path, warn_of_own);
  BagPlayer player(options.bag, {options.base_frame, true});
  BagNavigation navigation(kName, player, options.bag, options.navigation, options.base_frame, params.gps_ins, 0.0);
  LineFile out(options.out);
  std::size_t poses = 0;
  std::optional<std::int64_t> written_ns;
  navigation.on_pose([&](const GpsInsPose& pose) {
    const double since_s = written_ns ? seconds_between(*written_ns, pose.stamp_ns) : 0.0;
    if (written_ns && since_s >= 0.0 && since_s * options.rate_hz < 1.0 - 1e-6) return;
    written_ns = pose.stamp_ns;
    ++poses;
    out.write(line_of(pose));
  });
  player.play();
  std::printf("%zu poses\n", poses);
  navigation.print_summary();
  if (poses == 0) {
    throw std::runtime_error(recording_name(options.bag.bags) + ": no pose: " + navigation.why_not_ready());
  }
  out.finish();
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, gps_ins_bag);
}
