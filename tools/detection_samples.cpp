// SPDX-License-Identifier: BSD-3-Clause
// Writes synthetic segments as inputs of the package's networks, for training by scripts/train/.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/detections/segment_encoding.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/box.hpp"

namespace {

constexpr const char* kUsage =
    "usage: detection_samples CASE SEED FIRST COUNT\n"
    "\n"
    "Writes COUNT samples of CASE to the standard output, one row of 32-bit floats each: the network's inputs, then\n"
    "the truth (t_x, t_y, m, p, q) in m in the segment's frame, whether it is one ellipse (0 or 1), mean range and "
    "half\n"
    "width in m, number of hits, azimuth of the segment's frame in rad; then of a box: (t_x, t_y, m, p, q) of its\n"
    "moment-equal ellipse, whether it is one box (0 or 1), cosine and sine of four times its orientation in the\n"
    "segment's frame. All of a truth is 0 where there is none. Sample k is drawn with seed SEED + k, so any part can "
    "be\n"
    "had again.\n";

constexpr double kMaxRadiusM = 0.5;  // the unit of the prior, as in the data sets

void append_box(std::vector<float>& row, const std::optional<situation_awareness::Box>& box_level,
                const situation_awareness::SegmentEncoding& encoding) {
  using namespace situation_awareness;
  Vector5d truth = Vector5d::Zero();
  Eigen::Vector2d orientation = Eigen::Vector2d::Zero();
  if (box_level) {
    truth = to_segment_frame(encoding, moment_equal_ellipse(*box_level));
    const double angle_rad = 4.0 * (box_level->psi_rad - encoding.azimuth_rad);
    orientation << std::cos(angle_rad), std::sin(angle_rad);
  }
  for (const double value : truth) row.push_back(static_cast<float>(value));
  row.push_back(box_level ? 1.0F : 0.0F);
  for (const double value : orientation) row.push_back(static_cast<float>(value));
}

}  // namespace

int main(int argc, char** argv) {
  using namespace situation_awareness;
  if (argc != 5) {
    std::fputs(kUsage, stderr);
    return 2;
  }
  try {
    const SegmentCase which = segment_case(argv[1]);
    const std::uint64_t seed = std::stoull(argv[2]);
    const std::uint64_t first = std::stoull(argv[3]);
    const std::uint64_t count = std::stoull(argv[4]);
    std::vector<float> row;
    for (std::uint64_t k = first; k < first + count; ++k) {
      Random random(seed + k);
      const SyntheticSegment sample = draw_segment(which, random);
      const Segment& segment = sample.segments.segments.front();
      const SegmentEncoding encoding = encode(sample.segments, segment, sample.range_sigma_m, kMaxRadiusM);
      row.assign(encoding.inputs.begin(), encoding.inputs.end());
      const Vector5d truth =
          sample.ellipse_level ? to_segment_frame(encoding, *sample.ellipse_level) : Vector5d::Zero();
      for (const double value : truth) row.push_back(static_cast<float>(value));
      for (const double value : {sample.ellipse_level ? 1.0 : 0.0, encoding.mean_range_m, encoding.half_width_m,
                                 static_cast<double>(segment.count), encoding.azimuth_rad}) {
        row.push_back(static_cast<float>(value));
      }
      append_box(row, sample.box_level, encoding);
      if (std::fwrite(row.data(), sizeof(float), row.size(), stdout) != row.size()) return 1;
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "detection_samples: %s\n", error.what());
    return 1;
  }
  return 0;
}
