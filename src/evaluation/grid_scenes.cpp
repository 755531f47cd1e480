// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/grid_scenes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <stdexcept>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kShadow_m = 8.0;  ///< behind a car, as far as it is judged
constexpr double kFar_m = 500.0;
constexpr double kImagePeriod_s = 0.5;
constexpr double kInertialAngleSigma_rad = 0.005;
constexpr double kBelow_m = 2.0;  ///< that cars reach into the ground, which may be steep

/// Along a ray from `p` in the unit direction `d` until something; infinite where nothing is.
double ground_range_m(const GridScene& scene, const Eigen::Vector3d& p, const Eigen::Vector3d& d) {
  const double per_gap = 1.0 / (std::max(-d.z(), 0.0) + scene.steepest * d.head<2>().norm() + 1e-3);
  double range_m = 0.0;
  for (int i = 0; i < 400 && range_m < kFar_m; ++i) {
    const Eigen::Vector3d at_m = p + range_m * d;
    const double gap_m = at_m.z() - scene.ground(at_m.x(), at_m.y());
    if (gap_m < 1e-3) return range_m;
    range_m += gap_m * per_gap;
  }
  return std::numeric_limits<double>::infinity();
}

/// To an upright box from `bottom_m` to `top_m` above the ground at its middle.
double box_range_m(const GridScene& scene, const Pose2& T_world_box, const Eigen::Vector2d& size_m, double bottom_m,
                   double top_m, const Eigen::Vector3d& p, const Eigen::Vector3d& d) {
  const Eigen::Vector2d middle_m = T_world_box.translation_m;
  const double ground_m = scene.ground(middle_m.x(), middle_m.y());
  const Eigen::Vector3d to_middle(middle_m.x() - p.x(), middle_m.y() - p.y(),
                                  ground_m + 0.5 * (bottom_m + top_m) - p.z());
  const double along_m = to_middle.dot(d);
  const Eigen::Vector3d half_m(0.5 * size_m.x(), 0.5 * size_m.y(), 0.5 * (top_m - bottom_m));
  if (to_middle.squaredNorm() - along_m * along_m > half_m.squaredNorm()) {
    return std::numeric_limits<double>::infinity();
  }
  const Eigen::Rotation2Dd to_box(-T_world_box.yaw_rad);
  Eigen::Vector3d from, along;
  from << to_box * (p.head<2>() - middle_m), -to_middle.z();
  along << to_box * d.head<2>(), d.z();
  double enter = 0.0, leave = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    if (std::abs(along(i)) < 1e-12) {
      if (std::abs(from(i)) > half_m(i)) return std::numeric_limits<double>::infinity();
      continue;
    }
    const double a = (-half_m(i) - from(i)) / along(i), b = (half_m(i) - from(i)) / along(i);
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave ? enter : std::numeric_limits<double>::infinity();
}

double car_range_m(const GridScene& scene, const SceneCar& car, const Eigen::Vector3d& p, const Eigen::Vector3d& d) {
  return box_range_m(scene, car.T_world_car, car.size_m.head<2>(), -kBelow_m, car.size_m.z(), p, d);
}

double range_m(const GridScene& scene, const SceneBox& box, const Eigen::Vector3d& p, const Eigen::Vector3d& d) {
  return box_range_m(scene, box.T_world_box, box.size_m.head<2>(), box.bottom_m, box.bottom_m + box.size_m.z(), p, d);
}

double tree_range_m(const GridScene& scene, const SceneTree& tree, const Eigen::Vector3d& p, const Eigen::Vector3d& d) {
  Eigen::Vector3d middle_m;
  middle_m << tree.p_world_m, scene.ground(tree.p_world_m.x(), tree.p_world_m.y()) + tree.middle_m;
  const double along_m = (middle_m - p).dot(d);
  const double off_m2 = (middle_m - p).squaredNorm() - along_m * along_m;
  const double half_m2 = tree.radius_m * tree.radius_m - off_m2;
  return half_m2 > 0.0 && along_m > 0.0 ? along_m - std::sqrt(half_m2) : std::numeric_limits<double>::infinity();
}

/// Whether nothing but cars and signs is in the way, as far as `to_m`.
bool is_free(const GridScene& scene, const Eigen::Vector3d& p, const Eigen::Vector3d& d, double to_m) {
  for (const SceneTree& tree : scene.trees) {
    if (tree_range_m(scene, tree, p, d) < to_m) return false;
  }
  for (const SceneBox& house : scene.houses) {
    if (range_m(scene, house, p, d) < to_m) return false;
  }
  return to_m <= ground_range_m(scene, p, d) + 0.05;
}

bool shows_car(const GridScene& scene, const Eigen::Vector3d& p, const Eigen::Vector3d& d) {
  double car_m = std::numeric_limits<double>::infinity();
  for (const SceneCar& car : scene.cars) car_m = std::min(car_m, car_range_m(scene, car, p, d));
  for (const SceneBox& sign : scene.signs) car_m = std::min(car_m, range_m(scene, sign, p, d));
  return std::isfinite(car_m) && is_free(scene, p, d, car_m);
}

/// Whether that image shows most of a car's roof.
bool shows_roof(const GridScene& scene, const SceneCar& car, const Eigen::Isometry3d& T_world_camera) {
  constexpr double kNear_m = 70.0, kHalfView = 0.577;  // HFOV 60 deg
  const Eigen::Vector3d p = T_world_camera.translation();
  const Eigen::Vector2d middle_m = car.T_world_car.translation_m;
  int seen = 0;
  for (const auto& [along, across] : {std::pair{0.0, 0.0}, {0.4, 0.4}, {0.4, -0.4}, {-0.4, 0.4}, {-0.4, -0.4}}) {
    Eigen::Vector3d at_m;
    at_m << car.T_world_car * Eigen::Vector2d(along * car.size_m.x(), across * car.size_m.y()),
        scene.ground(middle_m.x(), middle_m.y()) + car.size_m.z();
    const Eigen::Vector3d in_camera = T_world_camera.inverse() * at_m;
    if (in_camera.z() <= 0.0 || in_camera.head<2>().cwiseAbs().maxCoeff() > kHalfView * in_camera.z()) continue;
    const double range_m = (at_m - p).norm();
    seen += range_m < kNear_m && is_free(scene, p, (at_m - p) / range_m, range_m) ? 1 : 0;
  }
  return seen >= 3;
}

/// Takes the cars away that fewer images show.
void drop_unseen_cars(GridCase& given, int images) {
  std::vector<SceneCar>& cars = given.scene.cars;
  const auto is_unseen = [&](const SceneCar& car) {
    return std::count_if(given.T_world_camera.begin(), given.T_world_camera.end(),
                         [&](const Eigen::Isometry3d& T) { return shows_roof(given.scene, car, T); }) < images;
  };
  cars.erase(std::remove_if(cars.begin(), cars.end(), is_unseen), cars.end());
}

bool is_in(const SceneCar& car, const Eigen::Vector2d& p_world_m) {
  if ((p_world_m - car.T_world_car.translation_m).squaredNorm() > 0.25 * car.size_m.head<2>().squaredNorm())
    return false;
  const Eigen::Vector2d p_m = inverse(car.T_world_car) * p_world_m;
  return std::abs(p_m.x()) <= 0.5 * car.size_m.x() && std::abs(p_m.y()) <= 0.5 * car.size_m.y();
}

std::mt19937 random_of(std::uint32_t seed, std::uint32_t use, std::size_t i) {
  std::seed_seq sequence{seed, use, static_cast<std::uint32_t>(i)};
  return std::mt19937(sequence);
}

}  // namespace

SoftLabels label_image_of(const GridScene& scene, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                          int samples) {
  SoftLabels labels;
  labels.camera = camera;
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      int cars = 0;
      for (int i = 0; i < samples * samples; ++i) {
        const double du = (i % samples + 0.5) / samples - 0.5, dv = (i / samples + 0.5) / samples - 0.5;
        const Eigen::Vector3d d((u + du - camera.cx_px) / camera.fx_px, (v + dv - camera.cy_px) / camera.fy_px, 1.0);
        cars += shows_car(scene, T_world_camera.translation(), T_world_camera.linear() * d.normalized()) ? 1 : 0;
      }
      labels.probability.push_back(static_cast<float>(cars) / static_cast<float>(samples * samples));
    }
  }
  return labels;
}

Eigen::Isometry3d camera_pose(const Eigen::Vector3d& p_world_m, double yaw_rad, double pitch_rad) {
  Eigen::Matrix3d R_body_camera;  // x ahead, y left, z up in the body
  R_body_camera << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = p_world_m;
  T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(-pitch_rad, Eigen::Vector3d::UnitY()) * R_body_camera;
  return T;
}

std::vector<std::string> grid_case_names() {
  return {"single",         "approach",     "orbit",        "orbit_bias_-2", "orbit_bias_-1", "orbit_bias_-0.5",
          "orbit_bias_0.5", "orbit_bias_1", "orbit_bias_2", "orbit_noise",   "labels",        "blobs",
          "never_seen",     "trees",        "hill",         "slope",         "lawnmower",     "far",
          "pose",           "wander",       "relief",       "relief_drawn",  "spurious",      "spurious_drawn"};
}

GridCase make_grid_case(const std::string& name, std::uint32_t seed) {
  GridCase made;
  made.name = name;
  std::mt19937 random = random_of(seed, 1, 0);
  const auto uniform = [&](double low, double high) { return std::uniform_real_distribution<>(low, high)(random); };
  made.scene.ground = [](double, double) { return 0.0; };
  const auto add_car = [&](double x, double y) {
    made.scene.cars.push_back({Pose2{{x + uniform(-1, 1), y + uniform(-1, 1)}, uniform(-M_PI, M_PI)}});
  };
  const auto ground_at = [&](double x, double y) { return made.scene.ground(x, y); };
  const auto orbit = [&](double range_m, double up_m, double pitch_deg, double from_deg, double to_deg, int images) {
    for (int i = 0; i < images; ++i) {
      const double angle = radians(from_deg + (to_deg - from_deg) * i / (images - 1));
      const double x = -range_m * std::cos(angle), y = -range_m * std::sin(angle);
      made.T_world_camera.push_back(camera_pose({x, y, ground_at(0, 0) + up_m}, angle, radians(pitch_deg)));
    }
  };
  const auto pass = [&](const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, double up_m, double pitch_deg,
                        int images) {
    const Eigen::Vector2d way_m = to_m - from_m;
    for (int i = 0; i < images; ++i) {
      const Eigen::Vector2d at_m = from_m + way_m * i / (images - 1);
      made.T_world_camera.push_back(
          camera_pose({at_m.x(), at_m.y(), up_m}, std::atan2(way_m.y(), way_m.x()), radians(pitch_deg)));
    }
  };
  const auto four_cars = [&] {
    add_car(6, 5);
    add_car(-6, 6);
    add_car(5, -7);
    add_car(-7, -6);
  };
  if (name == "single" || name == "approach") {
    add_car(55, 0);
    for (int i = 0; i < (name == "single" ? 1 : 21); ++i) {
      made.T_world_camera.push_back(camera_pose({2.0 * i, 0, 20}, 0, -radians(20 + 1.2 * i)));
    }
  } else if (name == "lawnmower" || name == "wander") {
    const int images = name == "lawnmower" ? 30 : 60;  // per lane
    for (int i = 0; i < 12; ++i) add_car(-45 + 30 * (i % 4), -30 + 30 * (i / 4));
    for (int lane = 0; lane < 3; ++lane) {
      const bool back = lane % 2 == 1;
      for (int i = 0; i < images; ++i) {
        const double x = -100 + 200.0 * i / (images - 1);
        made.T_world_camera.push_back(
            camera_pose({back ? -x : x, -30.0 + 30 * lane, 25}, back ? M_PI : 0, -radians(25)));
      }
    }
  } else if (name == "far") {
    four_cars();
    for (int i = 0; i < 31; ++i) {
      made.T_world_camera.push_back(camera_pose({-180.0 + 2.5 * i, 0, 40}, 0, -radians(16)));
    }
  } else if (name == "relief" || name == "relief_drawn") {
    const bool is_drawn = name == "relief_drawn";
    const auto drawn = [&](double fixed, double low, double high) { return is_drawn ? uniform(low, high) : fixed; };
    struct Bump {
      Eigen::Vector2d p_m;
      double height_m, sigma_m;
    };
    const std::vector<Bump> bumps{{{0.0, 0.0}, drawn(10, 6, 14), drawn(20, 15, 28)},
                                  {{drawn(45, 30, 55), drawn(-15, -35, 35)}, drawn(-4, -6, -2), drawn(10, 8, 14)}};
    made.scene.ground = [bumps](double x, double y) {
      double z_m = 0.0;
      for (const Bump& bump : bumps) {
        const double off_m2 = (Eigen::Vector2d(x, y) - bump.p_m).squaredNorm();
        z_m += bump.height_m * std::exp(-off_m2 / (2.0 * bump.sigma_m * bump.sigma_m));
      }
      return z_m;
    };
    for (const Bump& bump : bumps) made.scene.steepest += std::abs(bump.height_m) / bump.sigma_m * std::exp(-0.5);
    add_car(-22, 10);  // on the flank before the crest, two beside it, one behind it, one in the hollow
    add_car(-16, -12);
    add_car(4, 20);
    add_car(6, -22);
    add_car(22, 2);
    add_car(bumps[1].p_m.x(), bumps[1].p_m.y());
    while (made.scene.trees.size() < 10) {
      const Eigen::Vector2d p_m(uniform(-45, 60), uniform(-40, 40));
      const bool is_near = std::any_of(made.scene.cars.begin(), made.scene.cars.end(), [&](const SceneCar& car) {
        return (car.T_world_car.translation_m - p_m).norm() < 5.0;
      });
      if (!is_near) made.scene.trees.push_back({p_m, uniform(1.5, 2.5), uniform(3.0, 4.0)});
    }
    const double up_m = drawn(22, 18, 32), turn = drawn(0, -0.7, 0.7), aside_m = drawn(-8, -25, 25);
    const Eigen::Vector2d ahead(std::cos(turn), std::sin(turn)), across(-ahead.y(), ahead.x());
    if (is_drawn && uniform(0, 1) < 0.3) {
      orbit(drawn(0, 40, 60), up_m, -drawn(0, 20, 30), 0, drawn(0, 70, 180), 50);
    } else {
      pass(-90 * ahead + aside_m * across, 60 * ahead + aside_m * across, up_m, -drawn(25, 20, 32), 60);
    }
    drop_unseen_cars(made, 6);
  } else if (name == "spurious" || name == "spurious_drawn") {
    const bool is_drawn = name == "spurious_drawn";
    const auto drawn = [&](double fixed, double low, double high) { return is_drawn ? uniform(low, high) : fixed; };
    four_cars();
    made.blobs = 3;
    // The sign is on the wall that faces the middle of the way, or on the roof above it.
    const double towards_rad = drawn(radians(60), radians(20), radians(100)), away_m = drawn(20, 16, 26);
    const Eigen::Vector2d towards(std::cos(towards_rad), std::sin(towards_rad));
    const Eigen::Vector3d house_m(drawn(8, 5, 12), drawn(12, 6, 16), drawn(6, 4, 10));
    made.scene.houses.push_back({Pose2{away_m * towards, towards_rad}, house_m, 0.0});
    const double sign_m = drawn(1.5, 1.0, 2.0);
    const bool is_on_roof = is_drawn && uniform(0, 1) < 0.3;
    const double bottom_m = is_on_roof ? house_m.z() : drawn(3.5, 2.5, std::max(2.6, house_m.z() - sign_m));
    made.scene.signs.push_back(
        {Pose2{(away_m - 0.5 * house_m.x() - 0.1) * towards, towards_rad}, {0.2, drawn(4, 2, 5), sign_m}, bottom_m});
    if (is_drawn && uniform(0, 1) < 0.4) {
      const double heading = towards_rad + uniform(-0.9, 0.9), aside_m = uniform(-15, 15);
      const Eigen::Vector2d ahead(std::cos(heading), std::sin(heading)), across(-ahead.y(), ahead.x());
      pass(-80 * ahead + aside_m * across, 20 * ahead + aside_m * across, uniform(16, 30), -25, 50);
    } else {
      orbit(drawn(40, 35, 55), drawn(20, 16, 30), -drawn(25, 22, 30), 0, drawn(120, 70, 180), 40);
    }
    drop_unseen_cars(made, 6);
  } else {
    if (name == "hill") {
      made.scene.ground = [](double x, double y) { return 10 * std::exp(-(x * x + y * y) / (2 * 25.0 * 25.0)); };
      made.scene.steepest = 0.25;
    } else if (name == "slope") {
      made.scene.ground = [](double x, double) { return 0.12 * x; };
      made.scene.steepest = 0.12;
    }
    four_cars();
    if (name == "trees") {
      for (int i = 0; i < 8; ++i) {
        const double angle = uniform(0.6, 1.9);
        const double r = uniform(10, 14);
        made.scene.trees.push_back({{-r * std::cos(angle), -r * std::sin(angle)}, 2.5, 4.0});
      }
    } else if (name == "never_seen") {
      for (int i = 0; i < 3; ++i) {  // behind dense trees, 2.5 m before them
        const double y = -16 + 14 * i;
        made.scene.cars.push_back({Pose2{{24.0, y}, 1.57}});
        ++made.hidden_cars;
      }
      for (int k = 0; k < 60; ++k) made.scene.trees.push_back({{19.5 + 0.1 * (k % 3), -34 + 1.1 * k}, 2.2, 1.8});
    }
    orbit(40, 20, -25, 0, 120, 40);
  }
  if (name.rfind("orbit_bias_", 0) == 0) made.elevation_error_m = std::stod(name.substr(11));
  if (name == "orbit_noise") made.elevation_noise_m = 0.5;
  if (name == "labels") {
    made.label_precision = 0.76;
    made.label_recall = 0.61;
  }
  if (name == "blobs") made.blobs = 2;
  if (name == "pose") {
    made.position_noise_m = 1.0;
    made.angle_noise_rad = radians(1.0);
  }
  if (name == "wander") made.wander_m = 0.7;
  return made;
}

Elevation elevation_of(const GridCase& given, double pixel_m, std::uint32_t seed) {
  std::mt19937 random = random_of(seed, 2, 0);
  std::normal_distribution<> normal;
  const int pixels = static_cast<int>(500.0 / pixel_m);
  std::vector<float> heights;
  for (int row = 0; row < pixels; ++row) {
    for (int column = 0; column < pixels; ++column) {
      heights.push_back(
          static_cast<float>(given.scene.ground(-250 + (column + 0.5) * pixel_m, 250 - (row + 0.5) * pixel_m) +
                             given.elevation_error_m + given.elevation_noise_m * normal(random)));
    }
  }
  return {pixels, pixels, {-250.0, 250.0}, {pixel_m, pixel_m}, std::move(heights)};
}

SoftLabels labels_of(const GridCase& given, const PinholeCamera& camera, std::size_t i, std::uint32_t seed) {
  std::mt19937 random = random_of(seed, 3, i);
  std::uniform_real_distribution<> uniform;
  GridScene scene = given.scene;
  if (!scene.signs.empty() && uniform(random) >= given.sign_share) scene.signs.clear();
  SoftLabels labels = label_image_of(scene, camera, given.T_world_camera[i], std::clamp(448 / camera.width, 2, 4));
  if (given.label_recall < 1.0) {
    const auto cars = static_cast<double>(
        std::count_if(labels.probability.begin(), labels.probability.end(), [](float p) { return p > 0.5F; }));
    const double false_ones = cars * given.label_recall * (1.0 / given.label_precision - 1.0);
    const double share = false_ones / (static_cast<double>(labels.probability.size()) - cars);
    for (float& p : labels.probability) {
      const bool is_car = p > 0.5F ? uniform(random) < given.label_recall : uniform(random) < share;
      p = is_car ? 0.9F : 0.1F;
    }
  }
  for (int blob = 0; blob < given.blobs; ++blob) {
    const double u0 = uniform(random) * camera.width, v0 = uniform(random) * camera.height;
    const double radius = 0.03 * camera.width;
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        if (std::hypot(u - u0, v - v0) < radius) {
          labels.probability[static_cast<std::size_t>(v * camera.width + u)] = 0.95F;
        }
      }
    }
  }
  labels.stamp_ns = static_cast<std::int64_t>(i) * nanoseconds(kImagePeriod_s);
  return labels;
}

Eigen::Isometry3d given_pose(const GridCase& given, std::size_t i, std::uint32_t seed) {
  std::mt19937 random = random_of(seed, 4, i);
  std::normal_distribution<> normal;
  const auto vector = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  Eigen::Isometry3d T = given.T_world_camera[i];
  const Eigen::Vector3d turn = vector(given.angle_noise_rad);
  T.translation() += vector(given.position_noise_m);
  if (given.wander_m > 0.0) {
    std::mt19937 steps = random_of(seed, 5, 0);
    std::normal_distribution<> step;
    const double stays = std::exp(-kImagePeriod_s / given.wander_s);
    Eigen::Vector3d off_m = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k <= i; ++k) {
      const double sigma_m = given.wander_m * (k == 0 ? 1.0 : std::sqrt(1.0 - stays * stays));
      off_m = stays * off_m + sigma_m * Eigen::Vector3d(step(steps), step(steps), step(steps));
    }
    T.translation() += off_m;
  }
  if (turn.norm() > 0.0) T.linear() = T.linear() * Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  return T;
}

std::optional<CameraPoseCovariance> given_covariance(const GridCase& given) {
  if (given.wander_m == 0.0) return std::nullopt;
  CameraPoseCovariance covariance = CameraPoseCovariance::Zero();
  covariance.diagonal().head<3>().setConstant(given.wander_m * given.wander_m);
  covariance.diagonal().tail<3>().setConstant(kInertialAngleSigma_rad * kInertialAngleSigma_rad);
  return covariance;
}

GridScore score(const GridCase& given, const SemanticGrid& grid) {
  GridScore result;
  int both = 0, either = 0, shadow = 0, called = 0;
  const auto last_seen = given.scene.cars.end() - static_cast<std::ptrdiff_t>(given.hidden_cars);
  const Eigen::Vector2d eye_m = given.T_world_camera.back().translation().head<2>();
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const Eigen::Vector2d p_m = grid.middle_world_m(column, row);
      const bool is_car =
          std::any_of(given.scene.cars.begin(), last_seen, [&](const SceneCar& car) { return is_in(car, p_m); });
      const bool says_car = grid.probability[grid.index(column, row)] > 0.5F;
      both += is_car && says_car ? 1 : 0;
      either += is_car || says_car ? 1 : 0;
      if (is_car) continue;
      const bool is_behind = std::any_of(given.scene.cars.begin(), given.scene.cars.end(), [&](const SceneCar& car) {
        if ((p_m - car.T_world_car.translation_m).norm() > kShadow_m + car.size_m.norm()) return false;
        const Eigen::Vector2d to_eye = (eye_m - p_m).normalized();
        for (double back_m = 0.1; back_m < kShadow_m; back_m += 0.1) {
          if (is_in(car, p_m + back_m * to_eye)) return true;
        }
        return false;
      });
      shadow += is_behind ? 1 : 0;
      called += is_behind && says_car ? 1 : 0;
    }
  }
  result.intersection_over_union = either > 0 ? static_cast<double>(both) / either : 1.0;
  result.shadow_share = shadow > 0 ? static_cast<double>(called) / shadow : 0.0;
  return result;
}

std::vector<int> targets_of(const std::vector<SceneCar>& cars, const GridTargets& targets) {
  constexpr double kNear_m = 3.0;
  constexpr double kGain_m = 1e4;  // of a pair more, above what any distances cost
  std::vector<Candidate> candidates;
  for (std::size_t car = 0; car < cars.size(); ++car) {
    for (std::size_t target = 0; target < targets.targets.size(); ++target) {
      const double distance_m =
          (targets.targets[target].p_world_m.head<2>() - cars[car].T_world_car.translation_m).norm();
      if (distance_m > kNear_m) continue;
      candidates.push_back({static_cast<int>(car), static_cast<int>(target), distance_m - kGain_m});
    }
  }
  return assign(static_cast<int>(cars.size()), static_cast<int>(targets.targets.size()), candidates);
}

TargetScore score(const GridCase& given, const GridTargets& targets) {
  constexpr double kChiSquare99 = 9.2103;
  const std::vector<SceneCar> cars(given.scene.cars.begin(),
                                   given.scene.cars.end() - static_cast<std::ptrdiff_t>(given.hidden_cars));
  const std::vector<int> target_of = targets_of(cars, targets);
  TargetScore result;
  result.cars = static_cast<int>(cars.size());
  result.wrong = static_cast<int>(targets.targets.size());
  for (std::size_t car = 0; car < cars.size(); ++car) {
    if (target_of[car] < 0) {
      ++result.missed;
      continue;
    }
    --result.wrong;
    const GridTarget& target = targets.targets[static_cast<std::size_t>(target_of[car])];
    const Eigen::Vector2d off_m = target.p_world_m.head<2>() - cars[car].T_world_car.translation_m;
    result.distance_sum_m += off_m.norm();
    result.inside += off_m.dot(target.covariance_m2.inverse() * off_m) < kChiSquare99 ? 1 : 0;
  }
  return result;
}

}  // namespace situation_awareness
