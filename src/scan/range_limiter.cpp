// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/range_limiter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <stdexcept>
#include <utility>

#include <yaml-cpp/yaml.h>

namespace situation_awareness {

std::string yaml_text(const std::vector<HalfSpace>& volume) {
  std::string list;
  for (const HalfSpace& half_space : volume) {
    list += list.empty() ? "[" : ", [";
    for (const double n : half_space.normal_world) list += yaml_text(n) + ", ";
    list += yaml_text(half_space.offset_m) + "]";
  }
  return "[" + list + "]";
}

void read_yaml_text(const std::string& yaml, std::vector<HalfSpace>& volume) try {
  const YAML::Node list = YAML::Load(yaml);
  if (!list.IsSequence()) throw YAML::Exception(YAML::Mark::null_mark(), "no list");
  std::vector<HalfSpace> read;
  for (const auto& row : list.as<std::vector<std::array<double, 4>>>()) {
    read.push_back({{row[0], row[1], row[2]}, row[3]});
  }
  volume = read;
} catch (const YAML::Exception&) {
  throw std::invalid_argument("must be a list of [nx, ny, nz, offset_m]");
}

void ScannerParams::validate() const {
  const auto check = [](const char* name, const std::string& value, std::initializer_list<const char*> known) {
    if (std::find(known.begin(), known.end(), value) != known.end()) return;
    std::string list;
    for (const char* one : known) list += (list.empty() ? "" : ", ") + std::string(one);
    throw std::invalid_argument("scan." + std::string(name) + " = " + value + " is unknown, known are: " + list);
  };
  check("no_return", no_return, {"inf", "nan", "range_max", "zero"});
  check("beam_order", beam_order, {"backward", "forward"});
  check("stamp_at", stamp_at, {"first", "last", "middle"});
}

void RangeLimiterParams::validate() const {
  check_bounds(*this, "scan");
  scanner.validate();
  if (!(min_range_m < max_range_m)) throw std::invalid_argument("scan.min_range_m must be less than scan.max_range_m");
  for (const HalfSpace& half_space : volume) {
    if (!half_space.normal_world.allFinite() || !std::isfinite(half_space.offset_m) ||
        half_space.normal_world.norm() < 1e-9) {
      throw std::invalid_argument("scan.volume has a half-space without a finite normal that is not zero");
    }
  }
}

Scan limit_range(const Scan& scan, const Eigen::Isometry3d& T_world_lidar, const RangeLimiterParams& params,
                 Scan memory) {
  Scan limited = std::move(memory);
  limited = scan;
  const Eigen::Vector3d x_world = T_world_lidar.linear().col(0);
  const Eigen::Vector3d y_world = T_world_lidar.linear().col(1);
  const Eigen::Vector3d lidar_world = T_world_lidar.translation();
  for (std::size_t i = 0; i < limited.beams.size(); ++i) {
    Beam& beam = limited.beams[i];
    if (beam.state != BeamState::kHit) continue;
    const double range_m = beam.range_m;
    if (range_m < params.min_range_m) {
      beam.range_m = 0.0F;
      beam.state = BeamState::kTooClose;
      continue;
    }
    if (range_m > params.max_range_m) {
      beam.state = BeamState::kOutside;
      continue;
    }
    if (params.volume.empty()) continue;
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const Eigen::Vector3d p_world =
        lidar_world + range_m * (std::cos(angle_rad) * x_world + std::sin(angle_rad) * y_world);
    for (const HalfSpace& half_space : params.volume) {
      if (half_space.normal_world.dot(p_world) > half_space.offset_m) {
        beam.state = BeamState::kOutside;
        break;
      }
    }
  }
  return limited;
}

}  // namespace situation_awareness
