// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag of label images to a semantic grid, without a roscore, as fast as possible.
#include <string>

#include "command_line.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/map/grid/geotiff.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/images.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/line_file.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "grid_bag";
constexpr const char* kConfig = "grid.yaml";
constexpr const char* kDescription =
    R"(Reads label images of a camera, or images that a network labels, camera_info and transforms from a bag and maps a
class over an elevation model.
Writes the targets after each image as one line of JSON:
  {"stamp": s, "targets": [{"id": int, "x", "y", "z": m, "covariance": [xx, xy, yx, yy], "area_m2", "p": number}]}
and the grid at the end as a GeoTIFF: band 1 the probability, NaN where nothing was observed, band 2 the number of images
with evidence. Labels are the probability of the class per pixel (32FC1), NaN or exactly 0.5 where it is not known.
Images that cannot be used have no line and are counted by reason; those that show no known ground are counted, too. Files are written atomically.
)";

struct Options {
  BagOptions bag;
  ImageOptions images;
  std::string out, grid_out;
};

void add_options(CommandLine& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  add_image_options(app, options.images);
  add_model_folder_option(app, options.images);
  app.add_option("--odom-topic", options.images.odom_topic,
                 "nav_msgs/Odometry, whose covariance is that of the pose (default: that of the parameters)")
      .type_name("TOPIC");
  add_dem_options(app, options.images.elevation).required();
  app.add_option(
         "--origin", options.images.elevation.origin,
         "of the world, in degrees and m above the ellipsoid, where the elevation has a CRS (default: it has none)")
      .type_name("LAT,LON,ALT");
  app.add_option("--out", options.out, "output file of the lines").type_name("FILE").required();
  app.add_option("--grid-out", options.grid_out, "output file of the grid, a GeoTIFF").type_name("FILE");
}

Json json_of(const GridTargets& targets) {
  Json line;
  Json& list = line["targets"] = Json::array();
  for (const GridTarget& target : targets.targets) {
    Json& element = add_object(list, 7);
    element["id"] = target.id;
    element["x"] = finite(target.p_world_m.x());
    element["y"] = finite(target.p_world_m.y());
    element["z"] = finite(target.p_world_m.z());
    element["covariance"] = list_of(4, [&](int i) { return target.covariance_m2(i / 2, i % 2); });
    element["area_m2"] = finite(target.area_m2);
    element["p"] = finite(target.probability);
  }
  return line;
}

int grid_bag(const Options& options) {
  const std::string path = config_path(options.bag, kConfig);
  const auto params = params_from_yaml<GridPipelineParams>(read_text_file(path), path, print_warning);
  BagPlayer player(options.bag, {});
  LineFile out(options.out);
  BagImages images(player, options.bag, options.images, params,
                   [&out](const GridTargets& targets) { out.write(json_line(targets.stamp_ns, json_of(targets))); });
  player.play();
  player.print_summary();
  images.print_summary(kName);
  player.check_mapped(images.pipeline().why_nothing());
  if (!options.grid_out.empty()) save_geotiff(options.grid_out, images.pipeline().map().grid());
  out.finish();
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, grid_bag);
}
