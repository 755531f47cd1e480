// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scan_simulation.hpp"

#include <utility>

namespace situation_awareness {
class ScanSimulation::Impl {
 public:
  Impl(const std::string& mjcf_path, const SimulatedScannerParams& scanner, std::uint64_t seed)
      : world_(mjcf_path),
        T_robot_lidar_(world_.T_robot_lidar()),
        scanner_(world_, T_robot_lidar_, scanner, seed),
        sightings_(world_.names().size()),
        place_in_truth_(world_.names().size(), -1) {
    for (const std::size_t object : objects_of_true_map(world_)) {
      place_in_truth_[object] = static_cast<int>(names_.size());
      names_.push_back(world_.names()[object]);
    }
  }

  SimulatedScan next() {
    const double time_s = scanner_.next_time_s() + scanner_.params().stamp_error_s;
    ScannerSample sample = scanner_.next();
    SimulatedScan out;
    out.robot = world_.robot_at(time_s);
    out.T_world_lidar = sample.T_world_lidar;
    out.T_world_lidar_end = sample.T_world_lidar_end;
    out.object_of_beam = sightings_.add(sample.scan.stamp_ns, sample.hits, sample.hits.size());
    for (int& object : out.object_of_beam) {
      if (object >= 0) object = place_in_truth_[static_cast<std::size_t>(object)];
    }
    out.scan = std::move(sample.scan);
    out.hits = std::move(sample.hits);
    out.truth = truth_at(time_s);
    out.names = names_;
    return out;
  }

  const World& world() const { return world_; }

  Objects truth_at(double time_s) const {
    const Eigen::Isometry3d T_world_lidar = world_.robot_at(time_s).T_world_robot * T_robot_lidar_;
    return true_map(world_, sightings_, time_s, T_world_lidar.translation().z());
  }

  const Eigen::Isometry3d& T_robot_lidar() const { return T_robot_lidar_; }

 private:
  World world_;
  Eigen::Isometry3d T_robot_lidar_;
  SimulatedScanner scanner_;
  Sightings sightings_;
  std::vector<std::string> names_;   // of the truth's objects
  std::vector<int> place_in_truth_;  // of each object of the world; -1: none
};

ScanSimulation::ScanSimulation(const std::string& mjcf_path, const SimulatedScannerParams& scanner,
                               std::uint64_t seed) {
  scanner.validate();
  impl_ = std::make_unique<Impl>(mjcf_path, scanner, seed);
}
ScanSimulation::~ScanSimulation() = default;
ScanSimulation::ScanSimulation(ScanSimulation&&) noexcept = default;
ScanSimulation& ScanSimulation::operator=(ScanSimulation&&) noexcept = default;

SimulatedScan ScanSimulation::next() { return impl_->next(); }

const World& ScanSimulation::world() const { return impl_->world(); }

Objects ScanSimulation::truth_at(double time_s) const { return impl_->truth_at(time_s); }

const Eigen::Isometry3d& ScanSimulation::T_robot_lidar() const { return impl_->T_robot_lidar(); }

}  // namespace situation_awareness
