// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pose/reflector_search.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness {

/// A hall with reflectors, and what a robot sees of them at a place in it: anywhere, along the walls, in rows, or the
/// same after half a turn but for some of them. Some in sight are not seen, and some places are of none.
struct ReflectorHall {
  /// `reflectors`: of the map; 0: from 4 to 1000.
  explicit ReflectorHall(std::uint64_t seed, int reflectors = 0) : random_(seed) {
    constexpr std::array<const char*, 4> kNames = {"anywhere", "walls", "rows", "symmetric"};
    const auto layout = static_cast<std::size_t>(random_.uniform(0.0, 4.0));
    name = kNames.at(layout);
    const int count = reflectors > 0
                          ? reflectors
                          : static_cast<int>(std::lround(std::exp(random_.uniform(std::log(4.0), std::log(1000.0)))));
    const double spacing_m = random_.uniform(1.5, 5.0);
    const double width_m = std::max(4.0, spacing_m * std::sqrt(count) * random_.uniform(0.4, 1.0));
    half_m_ = 0.5 * Eigen::Vector2d(width_m, std::max(4.0, spacing_m * spacing_m * count / width_m));
    if (layout == 0) add_anywhere(count);
    if (layout == 1) add_along_walls(count);
    if (layout == 2) add_in_rows(count, spacing_m);
    if (layout == 3) add_symmetric(count);
    T_world_frame = {{random_.uniform(-half_m_.x(), half_m_.x()), random_.uniform(-half_m_.y(), half_m_.y())},
                     random_.uniform(-kPi, kPi)};
    look();
  }

  /// Whether a pose is the truth, but for noise.
  bool is_right(const Pose2& T) const {
    const Pose2 error = inverse(T_world_frame) * T;
    return error.translation_m.norm() < 0.15 && std::abs(wrap_to_pi(error.yaw_rad)) < 0.1;
  }

  std::string name;
  ReflectorMap map;
  Pose2 T_world_frame;
  std::vector<ReflectorPlace> places;
  int true_places = 0;

 private:
  Eigen::Vector2d anywhere() {
    return {random_.uniform(-half_m_.x(), half_m_.x()), random_.uniform(-half_m_.y(), half_m_.y())};
  }

  bool add(const Eigen::Vector2d& p_m) {
    for (const Reflector& other : map.reflectors) {
      if ((p_m - other.center_world_m).norm() < 0.4) return false;
    }
    map.reflectors.push_back({p_m, 0.05});
    return true;
  }

  void add_anywhere(int count) {
    for (int added = 0; added < count;) added += add(anywhere()) ? 1 : 0;
  }

  void add_along_walls(int count) {
    half_m_ = half_m_.cwiseMax(Eigen::Vector2d::Constant(0.15 * count));
    for (int added = 0; added < count;) {
      Eigen::Vector2d p_m = anywhere();
      const int axis = random_.uniform() < 0.5 ? 0 : 1;
      p_m(axis) = std::copysign(half_m_(axis), p_m(axis)) + 0.01 * random_.normal();
      added += add(p_m) ? 1 : 0;
    }
  }

  /// At the racks of a store, some of them elsewhere by up to half a metre.
  void add_in_rows(int count, double spacing_m) {
    const double elsewhere = random_.uniform(0.0, 0.5);
    const int columns = std::max(1, static_cast<int>(2.0 * half_m_.x() / spacing_m));
    for (int i = 0; i < count; ++i) {
      Eigen::Vector2d p_m(spacing_m * (i % columns) - half_m_.x(), spacing_m * (i / columns) - half_m_.y());
      if (random_.uniform() < elsewhere) p_m += Eigen::Vector2d(random_.uniform(-0.5, 0.5), random_.uniform(-0.5, 0.5));
      add(p_m);
    }
  }

  void add_symmetric(int count) {
    const double different = random_.uniform(0.0, 0.3), most_m = random_.uniform() < 0.5 ? 0.1 : 1.0;
    for (int i = 0; i < std::max(2, count / 2); ++i) {
      const Eigen::Vector2d p_m = anywhere();
      if (!add(p_m)) continue;
      Eigen::Vector2d other_m = -p_m;
      if (random_.uniform() < different) {
        if (random_.uniform() < 0.3) continue;  // there is none
        other_m += most_m * Eigen::Vector2d(random_.uniform(-1.0, 1.0), random_.uniform(-1.0, 1.0));
      }
      add(other_m);
    }
  }

  void look() {
    const double range_m = random_.uniform(6.0, 20.0), seen = random_.uniform(0.4, 1.0);
    const double sigma_m = random_.uniform(0.003, 0.02);
    const auto see = [&](const Eigen::Vector2d& p_world_m) {
      ReflectorPlace place;
      place.center_m = place_of(T_world_frame, p_world_m);
      const Eigen::Vector2d along = place.center_m.normalized();
      const double along_m = sigma_m, across_m = sigma_m * random_.uniform(0.5, 1.5);
      place.covariance = along_m * along_m * along * along.transpose() +
                         across_m * across_m * (Eigen::Matrix2d::Identity() - along * along.transpose());
      place.center_m += draw(place.covariance, random_);
      places.push_back(place);
    };
    std::vector<Eigen::Vector2d> in_sight;
    for (const Reflector& reflector : map.reflectors) {
      const double distance_m = (reflector.center_world_m - T_world_frame.translation_m).norm();
      if (distance_m < range_m && distance_m > 0.1 && random_.uniform() < seen)
        in_sight.push_back(reflector.center_world_m);
    }
    shuffle(in_sight);
    if (in_sight.size() > 10) in_sight.resize(10);
    for (const Eigen::Vector2d& p_m : in_sight) see(p_m);
    true_places = static_cast<int>(places.size());
    const int others = random_.uniform() < 0.5 ? 0 : static_cast<int>(random_.uniform(1.0, 5.0));
    for (int i = 0; i < others; ++i) {
      see(T_world_frame * Eigen::Vector2d(random_.uniform(-range_m, range_m), random_.uniform(-range_m, range_m)));
    }
    shuffle(places);
  }

  template <class Items>
  void shuffle(Items& items) {
    for (std::size_t i = items.size(); i > 1; --i) {
      std::swap(items[i - 1], items[static_cast<std::size_t>(random_.uniform(0.0, static_cast<double>(i)))]);
    }
  }

  Random random_;
  Eigen::Vector2d half_m_ = Eigen::Vector2d::Zero();
};

}  // namespace situation_awareness
