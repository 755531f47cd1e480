// SPDX-License-Identifier: BSD-3-Clause
// Any sequence of detections, at any stamps and from anywhere, into the map.
#include "draw_detections.hpp"
#include "input.hpp"
#include "situation_awareness/map/objects/object_map.hpp"

namespace situation_awareness::fuzz {
namespace {

void run(Input input) {
  auto params = draw_params<ObjectMapParams>(input);
  if (input.integer(0, 3) == 0) params.shape = "circle";
  params.validate();
  ObjectMap map(params);

  // A few objects that are detected repeatedly, so that there are tracks.
  std::vector<Ellipse> things_world;
  for (std::size_t i = 1 + input.count(3); i > 0; --i) things_world.push_back(input.ellipse());
  std::uint64_t largest_id = 0;
  std::int64_t stamp_ns = input.any_int64();
  Detections detections;
  for (int scan = 0; scan < 40 && input.left(); ++scan) {
    stamp_ns = detections.stamp_ns = draw_stamp(input, stamp_ns);
    if (scan == 0 || input.integer(0, 3) == 0) detections.T_world_level = input.pose2();
    if (scan == 0 || input.integer(0, 3) == 0) detections.free_space = draw_free_space(input);
    detections.detections.clear();
    const Pose2 T_level_world = inverse(detections.T_world_level);
    for (const Ellipse& thing : things_world) {
      if (input.integer(0, 7) == 0) continue;
      detections.detections.push_back(draw_detection(input, T_level_world * thing));
    }
    for (std::size_t i = input.count(3); i > 0; --i) {
      if (input.flag()) detections.detections.push_back(draw_detection(input, input.ellipse()));
    }

    const std::int64_t before_ns = map.stamp_ns();
    const ObjectMapUpdate update = map.update(detections);
    require(std::isfinite(update.log_likelihood), "the log-likelihood is a number");
    for (const std::uint64_t id : update.created) {
      require(id > largest_id, "a new element has a new id");
      largest_id = id;
    }
    for (const std::uint64_t id : update.updated) require(id > 0 && id <= largest_id, "what is updated was created");
    for (const std::uint64_t id : update.deleted) require(id > 0 && id <= largest_id, "what is deleted was created");
    require(map.stamp_ns() == before_ns || map.stamp_ns() == stamp_ns, "the map is of the stamp, or as before");

    check_objects(map.at(map.stamp_ns()), largest_id);
    check_objects(map.at(input.flag() ? draw_stamp(input, stamp_ns) : input.any_int64()), largest_id);
  }
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}
