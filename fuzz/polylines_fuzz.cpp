// SPDX-License-Identifier: BSD-3-Clause
// From any segments to polylines, and from these to the map of polygons, at any stamps and with any parameters.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "draw_polylines.hpp"
#include "input.hpp"
#include "map/polygons/guarded_map.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "support/covariance.hpp"

namespace situation_awareness::fuzz {
namespace {

void check_polylines(const Polylines& polylines, std::size_t points) {
  require(polylines.hits.size() <= points, "no hit is there twice");
  std::size_t hit = 0, vertex = 0;
  for (const Polyline& polyline : polylines.polylines) {
    require(polyline.first_hit == hit && polyline.hits >= 1, "hits are of one polyline each, in order");
    require(polyline.first_vertex == vertex && polyline.vertices >= 1, "and so are vertices");
    require(polyline.vertices > 1 || polyline.hits == 1, "a single vertex is that of a single hit");
    hit += polyline.hits;
    vertex += polyline.vertices;
  }
  require(hit == polylines.hits.size() && vertex == polylines.vertices.size(), "all are of a polyline");
  for (const PolylineHit& each : polylines.hits) {
    require(each.p_level_m.allFinite() && each.sigma_m > 0.0 && std::isfinite(each.sigma_m), "a hit is finite");
    require(std::abs(each.normal_level.norm() - 1.0) < 1e-6, "a normal is a unit vector");
    require(each.normal_level.dot(each.p_level_m) <= 1e-9 * each.range_m, "towards the sensor");
  }
  for (const PolylineVertex& each : polylines.vertices) {
    require(each.p_level_m.allFinite() && each.covariance.allFinite(), "a vertex is finite");
    require(each.covariance(0, 0) >= 0.0 && each.covariance(1, 1) >= 0.0, "variances are not negative");
  }
}

/// Ids ascend, and what was gone does not come back.
class Ids {
 public:
  void check(const Polygons& polygons) {
    std::set<std::uint64_t> now;
    std::uint64_t last = 0;
    for (const Chain& chain : polygons.chains) {
      require(chain.id > last, "ids ascend");
      last = chain.id;
      require(now_.count(chain.id) > 0 || chain.id > greatest_ || hidden_.count(chain.id) > 0, "no id is used again");
      now.insert(chain.id);
    }
    // A chain that lies on a larger one is not shown, and may be again.
    for (const std::uint64_t id : now_) hidden_.insert(id);
    greatest_ = std::max(greatest_, last);
    now_ = std::move(now);
  }
  void forget() { hidden_.clear(), now_.clear(); }

 private:
  std::set<std::uint64_t> now_, hidden_;
  std::uint64_t greatest_ = 0;
};

void run(Input input) {
  const auto polyline_params = draw_params<PolylineParams>(input);
  const auto params = draw_params<PolygonMapParams>(input);
  GuardedMap map(params);
  Ids ids;
  std::int64_t stamp_ns = 1'000'000'000;
  Polylines polylines;
  Segments segments = draw_segments(input);
  for (int scan = 0; scan < 20 && (scan < 3 || input.left()); ++scan) {
    if (input.integer(0, 3) == 0) segments = draw_segments(input);
    switch (input.integer(0, 15)) {
      case 0:
        stamp_ns -= 500'000'000;
        break;
      case 1:
        stamp_ns = input.any_int64() & ((std::int64_t{1} << 61) - 1);
        break;
      case 2:
        stamp_ns += 5'000'000'000;
        break;
      default:
        stamp_ns += 60'000'000;
    }
    segments.stamp_ns = stamp_ns;
    polylines = extract_polylines(segments, polyline_params, std::move(polylines));
    check_polylines(polylines, segments.points.size());
    if (input.integer(0, 31) == 0 && !polylines.hits.empty()) polylines.hits[0].p_level_m.x() = input.any<double>();
    Eigen::Matrix3d covariance = input.by_magnitude(1e-12, 1.0) * Eigen::Matrix3d::Identity();
    if (input.integer(0, 31) == 0) covariance(0, 1) = input.any<double>();
    const std::int64_t before_ns = map.stamp_ns();
    map.update(polylines, covariance);
    if (input.integer(0, 31) == 0) map.reset();
    if (map.stamp_ns() < before_ns) ids.forget();
    check_polygons(map.polygons());
    ids.check(map.polygons());
  }
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}
