// SPDX-License-Identifier: BSD-3-Clause
// Each input of the safety areas and of path following against each fault: cells of docs/reliability.md. A vehicle
// drives in a corridor of known walls, past a person who stands with their back to one of them, and a fault is in one
// input from some scan on. What the stages take of their messages is as in their nodelets.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "path/safety_scene.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/pose_covariances.hpp"
#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "support/fault_cell.hpp"

namespace situation_awareness::safety_faults_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
constexpr std::int64_t kPeriod_ns = 40'000'000;
constexpr int kFault = 30, kLast = 220, kRestarted = 70;  // scans: 8.8 s
constexpr double kSettled_s = 1.6;                        // after a fault, until which its age is found

/// What the vehicle is to do once the fault is found.
enum class Does {
  kStands,        ///< a stop
  kConservative,  ///< at most as slow as beside standing things, for the person and the walls
  kGoesOn,        ///< nothing that counts is less than without the fault
};

struct Cell {
  const char* input;
  const char* fault;
  Does does;
  const char* text;
  bool of_objects = false;  ///< the fault is in the objects of the map alone
};

/// Messages and clocks of one scan. None: it does not come.
struct Messages {
  std::optional<std::int64_t> scan_ns, map_ns, objects_ns, covariance_ns, odometry_ns, transform_ns, verdict_ns;
  std::vector<float> ranges_m;
  Map map;
  std::optional<Feature> person;  ///< of the map
  Eigen::Matrix3d covariance = 1e-4 * Eigen::Matrix3d::Identity();
  double speed_m_s = 0.0;
  Pose2 T_world_base;
};

class Drive {
 public:
  explicit Drive(const Cell& cell) : cell_(cell) {
    scene_ = SafetyScene::straight();
    scene_.boxes = {{{5.0, 0.75}, 0.0, 9.0, 0.1},
                    {{5.0, -1.3}, 0.0, 9.0, 0.1},
                    {{14.1, -0.3}, 0.0, 0.1, 1.2},
                    {{3.5, 0.6}, 0.0, 0.2, 0.05}};  // the person, in the reach of the wall
    for (std::size_t i = 0; i < 3; ++i) scene_.know(scene_.boxes[i], i + 1);
    SafetyParams params;
    params.policy = SafetyPolicy::kIgnoreKnown;
    areas_.emplace(scene_.path, VehicleParams(), params);
    following_.emplace(scene_.path, VehicleParams(), PathFollowingParams());
    following_->start();
  }

  /// The speed at each scan.
  std::vector<double> run() {
    std::vector<double> speeds_m_s;
    for (scan_ = 0; scan_ < kLast; ++scan_) {
      scene_.advance(kPeriod_ns);
      Messages messages = good();
      const bool begins = cell_.fault == std::string("never came");
      if (begins || scan_ >= kFault) spoil(messages);
      step(messages);
      scene_.T_world_base = scene_.T_world_base * Pose2{{0.04 * speed_m_s_, 0.0}, 0.0};
      speeds_m_s.push_back(speed_m_s_);
      const bool is_beside = std::abs(scene_.T_world_base.translation_m.x() - 3.5) < 0.5;
      if (is_beside && !(cell_.of_objects && is("empty")))
        fastest_beside_m_s_ = std::max(fastest_beside_m_s_, speed_m_s_);
    }
    return speeds_m_s;
  }

  /// While the person is beside the vehicle.
  double fastest_beside_m_s() const { return fastest_beside_m_s_; }

 private:
  bool is(const char* fault) const { return cell_.fault == std::string(fault); }
  bool in(const char* input) const { return cell_.input == std::string(input); }

  Messages good() {
    Messages m;
    const std::int64_t now_ns = scene_.stamp_ns;
    m.scan_ns = m.map_ns = m.objects_ns = m.covariance_ns = m.odometry_ns = m.transform_ns = m.verdict_ns = now_ns;
    for (const Point& point : scene_.points().points) {
      m.ranges_m.push_back(point.state == BeamState::kHit ? static_cast<float>(point.range_m + 0.005 * random_.normal())
                                                          : std::numeric_limits<float>::infinity());
    }
    m.map = scene_.map;
    SafetyScene with_person = scene_;
    m.person = with_person.add(9, EllipseShape{{{3.5, 0.6}, 0.0, 0.25, 0.1}, {}});
    m.person->object_class = ObjectClass::kPerson;
    m.speed_m_s = speed_m_s_;
    m.T_world_base = scene_.T_world_base;
    if (scan_ == kFault - 1) frozen_ = m;
    return m;
  }

  std::optional<std::int64_t>& stamp_of(Messages& m) const {
    if (in("scan")) return m.scan_ns;
    if (in("map")) return cell_.of_objects ? m.objects_ns : m.map_ns;
    if (in("pose covariance")) return m.covariance_ns;
    if (in("odometry")) return m.odometry_ns;
    if (in("TF")) return m.transform_ns;
    return m.verdict_ns;
  }

  void spoil(Messages& m) {
    std::optional<std::int64_t>& stamp_ns = stamp_of(m);
    const bool is_gone = is("never came") || is("stopped") || is("killed") || is("wrong frame");
    if (is_gone || (is("restarted") && scan_ < kRestarted)) stamp_ns.reset();
    if (is("late by 1 s")) *stamp_ns -= kNanosecondsPerSecond;
    if (is("2 s ahead")) *stamp_ns += 2 * kNanosecondsPerSecond;
    if (is("back by 1 h")) *stamp_ns -= 3600 * kNanosecondsPerSecond;
    if (is("frozen")) freeze(m);
    if (is("empty")) empty(m);
    if (is("contradicts another input")) contradict(m);
    if (is("NaN") || is("inf") || is("-1")) fill(m, is("NaN") ? kNan : is("inf") ? kInf : -1.0);
  }

  void freeze(Messages& m) const {
    if (in("scan")) m.ranges_m = frozen_.ranges_m;
    if (in("map")) m.map = frozen_.map;
    if (in("map")) m.person = frozen_.person;
    if (in("pose covariance")) m.covariance = frozen_.covariance;
    if (in("odometry")) m.speed_m_s = frozen_.speed_m_s;
    if (in("TF")) m.T_world_base = frozen_.T_world_base;
    if (in("verdict")) m.verdict_ns = frozen_.verdict_ns;
  }

  void empty(Messages& m) {
    if (in("scan")) m.ranges_m.clear();
    if (in("map")) m.person.reset();
    if (in("map") && !cell_.of_objects) m.map.features.clear();
  }

  void contradict(Messages& m) const {
    if (in("scan")) std::fill(m.ranges_m.begin(), m.ranges_m.end(), 15.0F);
    if (cell_.of_objects) {
      m.person->shape = EllipseShape{{{scene_.T_world_base.translation_m.x() + 0.8, 0.0}, 0.0, 0.25, 0.1}, {}};
    } else if (in("map")) {
      // A known wall where the scan sees through, which would explain who stands there.
      m.map.features.front().shape = PolylineShape{{{{-4.0, 0.45}, 0.003}, {{14.0, 0.45}, 0.003}}, false};
    }
    if (in("pose covariance")) m.covariance(0, 1) = m.covariance(1, 0) = 2e-4;
    if (in("odometry")) m.speed_m_s = 0.0;
    if (in("TF")) m.T_world_base.translation_m.y() += 0.7;
    if (in("verdict")) m.verdict_ns.reset();  // STOP with a speed is refused (ros/convert_test)
  }

  void fill(Messages& m, double value) const {
    if (in("scan")) std::fill(m.ranges_m.begin(), m.ranges_m.end(), static_cast<float>(value));
    // Maps and transforms with such numbers are refused when they are converted (ros/convert_test).
    if (in("map")) m.map_ns.reset();
    if (in("TF")) m.transform_ns.reset();
    if (in("pose covariance")) m.covariance.diagonal().setConstant(value);
    if (in("odometry")) m.speed_m_s = value;
    if (in("verdict")) m.verdict_ns.reset();
  }

  Points points_of(const Messages& m) const {
    Points points = scene_.points();
    points.stamp_ns = *m.scan_ns;
    points.T_world_level = m.T_world_base;
    points.points.resize(m.ranges_m.size());
    for (std::size_t i = 0; i < points.points.size(); ++i) {
      Point& point = points.points[i];
      const Beam beam = beam_from_range(m.ranges_m[i], 0.1F, 20.0F);
      point.state = beam.state;
      point.range_m = static_cast<double>(beam.range_m);
      point.p_level_m = point.range_m * Eigen::Vector2d(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
    }
    return points;
  }

  void step(const Messages& m) {
    const std::int64_t now_ns = scene_.stamp_ns;
    if (m.map_ns) take_map(m);
    const bool has_source = !(in("pose covariance") && is("never came"));
    if (has_source) poses_.expect();
    if (m.covariance_ns) poses_.add(*m.covariance_ns, {m.T_world_base.translation_m, m.covariance});
    if (m.odometry_ns) odometry_ = {m.T_world_base, Eigen::Matrix3d::Zero(), m.speed_m_s, *m.odometry_ns};
    // A scan waits for the transform of its time.
    if (m.scan_ns && m.transform_ns && *m.transform_ns >= *m.scan_ns && *m.scan_ns - *m.transform_ns <= kPeriod_ns &&
        std::abs(seconds_between(*m.transform_ns, *m.scan_ns)) < 2.5) {
      VehicleState state = odometry_;
      state.T_world_base = m.T_world_base;
      const std::optional<BasePose> pose = poses_.latest(*m.scan_ns);
      state.covariance_world = pose                  ? pose->covariance_world
                               : poses_.has_source() ? Eigen::Matrix3d(Eigen::Matrix3d::Constant(kNan))
                                                     : Eigen::Matrix3d(4e-4 * Eigen::Matrix3d::Identity());
      decision_ = areas_->update(points_of(m), state, map_, m.ranges_m);
      if (m.verdict_ns) {
        allowed_ = {decision_->allowed_speed_m_s, decision_->may_turn};
        allowed_ns_ = *m.verdict_ns - now_ns + *m.scan_ns;
      }
    }
    const auto is_fresh = [&](std::int64_t stamp_ns) {
      return std::abs(seconds_between(stamp_ns, now_ns)) <= PathFollowingParams().timeout_s;
    };
    if (m.transform_ns) {
      transform_ns_ = *m.transform_ns;
      T_world_base_ = m.T_world_base;
    }
    const bool may_drive = is_fresh(allowed_ns_) && is_fresh(transform_ns_);
    speed_m_s_ =
        (may_drive ? following_->update(now_ns, T_world_base_, allowed_) : following_->brake(now_ns)).command.speed_m_s;
  }

  /// A map that its objects did not come to has those of before.
  void take_map(const Messages& m) {
    const std::int64_t objects_stamp_ns = map_.objects_stamp_ns;
    map_ = m.map;
    map_.stamp_ns = *m.map_ns;
    map_.objects_stamp_ns = objects_stamp_ns;
    if (m.objects_ns) {
      map_.objects_stamp_ns = cell_.of_objects ? *m.objects_ns : *m.map_ns;
      person_ = m.person;
    }
    if (person_) map_.features.push_back(*person_);
  }

  Cell cell_;
  SafetyScene scene_;
  std::optional<SafetyAreas> areas_;
  std::optional<PathFollowing> following_;
  Random random_{7};
  int scan_ = 0;
  Messages frozen_;
  Map map_;
  std::optional<Feature> person_;  ///< of that map
  PoseCovariances poses_{SafetyParams().max_pose_age_s};
  VehicleState odometry_{{}, Eigen::Matrix3d::Zero(), kNan, {}};
  std::optional<SafetyDecision> decision_;
  AllowedMotion allowed_;
  std::int64_t allowed_ns_ = 0, transform_ns_ = 0;
  Pose2 T_world_base_;
  double speed_m_s_ = 0.0, fastest_beside_m_s_ = 0.0;
};

constexpr const char* kNoVerdict = "no verdict: the vehicle stands after path/timeout_s";
constexpr const char* kNoMap = "conservative after safety/max_map_age_s, all hits are unknown, and said";
constexpr const char* kNoObjects = "without its objects: conservative after safety/max_map_age_s, and said";
constexpr const char* kNoCovariance = "a stop by the pose, and said";
constexpr const char* kNoSpeed = "it counts as driving at its greatest speed, and is as careful as before";

const Cell kCells[] = {
    {"scan", "never came", Does::kStands, kNoVerdict},
    {"scan", "stopped", Does::kStands, kNoVerdict},
    {"scan", "killed", Does::kStands, kNoVerdict},
    {"scan", "wrong frame", Does::kStands, "dropped, no transform: the vehicle stands after path/timeout_s"},
    {"scan", "frozen", Does::kStands, "a stop: frozen scan"},
    {"scan", "late by 1 s", Does::kStands, "verdicts too old to be used: the vehicle stands"},
    {"scan", "2 s ahead", Does::kStands, "no transform of its time: the vehicle stands"},
    {"scan", "back by 1 h", Does::kStands, "verdicts too old to be used: the vehicle stands"},
    {"scan", "NaN", Does::kStands, "a stop: all is hidden"},
    {"scan", "inf", Does::kStands, "a stop: scan and map contradict each other"},
    {"scan", "-1", Does::kStands, "a stop: all is hidden"},
    {"scan", "empty", Does::kStands, "a stop: all is hidden"},
    {"scan", "contradicts another input", Does::kStands, "a stop: scan and map contradict each other"},
    {"scan", "restarted", Does::kGoesOn, "the vehicle stands meanwhile, and goes on"},
    {"map", "never came", Does::kConservative, kNoMap},
    {"map", "stopped", Does::kConservative, kNoMap},
    {"map", "killed", Does::kConservative, kNoMap},
    {"map", "wrong frame", Does::kConservative, kNoMap},
    {"map", "frozen", Does::kConservative, "what the map no longer sees explains nothing"},
    {"map", "late by 1 s", Does::kGoesOn, "used, as the walls stand; movers are taken along by their velocities"},
    {"map", "2 s ahead", Does::kConservative, kNoMap},
    {"map", "back by 1 h", Does::kConservative, kNoMap},
    {"map", "NaN", Does::kConservative, "refused: conservative after safety/max_map_age_s"},
    {"map", "inf", Does::kConservative, "refused: conservative after safety/max_map_age_s"},
    {"map", "-1", Does::kConservative, "refused: conservative after safety/max_map_age_s"},
    {"map", "empty", Does::kConservative, "all hits are unknown"},
    {"map", "contradicts another input", Does::kStands, "a stop: scan and map contradict each other"},
    {"map", "restarted", Does::kGoesOn, "conservative meanwhile"},
    {"map", "never came", Does::kConservative, kNoObjects, true},
    {"map", "stopped", Does::kConservative, kNoObjects, true},
    {"map", "late by 1 s", Does::kGoesOn, "used, as the walls stand; movers are taken along by their velocities", true},
    {"map", "2 s ahead", Does::kConservative, kNoObjects, true},
    {"map", "back by 1 h", Does::kConservative, kNoObjects, true},
    {"map", "empty", Does::kGoesOn, "without its objects nobody stands there: hits on known chains are the chains",
     true},
    {"map", "contradicts another input", Does::kStands, "what moves on the map counts, seen or not", true},
    {"pose covariance", "never came", Does::kGoesOn, "the default, where pose never had a publisher, and said"},
    {"pose covariance", "stopped", Does::kStands, kNoCovariance},
    {"pose covariance", "killed", Does::kStands, kNoCovariance},
    {"pose covariance", "wrong frame", Does::kStands, kNoCovariance},
    {"pose covariance", "frozen", Does::kGoesOn, "one that stays the same with new stamps is as good as before"},
    {"pose covariance", "late by 1 s", Does::kStands, kNoCovariance},
    {"pose covariance", "2 s ahead", Does::kStands, kNoCovariance},
    {"pose covariance", "back by 1 h", Does::kStands, kNoCovariance},
    {"pose covariance", "NaN", Does::kStands, kNoCovariance},
    {"pose covariance", "inf", Does::kStands, kNoCovariance},
    {"pose covariance", "-1", Does::kStands, kNoCovariance},
    {"pose covariance", "contradicts another input", Does::kStands,
     "one that is not positive semidefinite is none: a stop"},
    {"pose covariance", "restarted", Does::kGoesOn, "the vehicle stands meanwhile, and goes on"},
    {"odometry", "never came", Does::kGoesOn, kNoSpeed},
    {"odometry", "stopped", Does::kGoesOn, kNoSpeed},
    {"odometry", "killed", Does::kGoesOn, kNoSpeed},
    {"odometry", "wrong frame", Does::kGoesOn, kNoSpeed},
    {"odometry", "frozen", Does::kGoesOn, "what is allowed does not depend on it"},
    {"odometry", "late by 1 s", Does::kGoesOn, kNoSpeed},
    {"odometry", "2 s ahead", Does::kGoesOn, kNoSpeed},
    {"odometry", "back by 1 h", Does::kGoesOn, kNoSpeed},
    {"odometry", "NaN", Does::kGoesOn, kNoSpeed},
    {"odometry", "inf", Does::kGoesOn, kNoSpeed},
    {"odometry", "-1", Does::kGoesOn, "a speed of 1 m/s: what is allowed does not depend on it"},
    {"odometry", "contradicts another input", Does::kGoesOn, "what is allowed does not depend on it"},
    {"odometry", "restarted", Does::kGoesOn, kNoSpeed},
    {"TF", "never came", Does::kStands, kNoVerdict},
    {"TF", "stopped", Does::kStands, kNoVerdict},
    {"TF", "killed", Does::kStands, kNoVerdict},
    {"TF", "wrong frame", Does::kStands, kNoVerdict},
    {"TF", "frozen", Does::kStands, "a stop by the pose: it stands while the measured speed does not"},
    {"TF", "late by 1 s", Does::kStands, kNoVerdict},
    {"TF", "2 s ahead", Does::kStands, "a pose too far ahead is none: the vehicle stands"},
    {"TF", "back by 1 h", Does::kStands, kNoVerdict},
    {"TF", "NaN", Does::kStands, "dropped, bad transform: the vehicle stands after path/timeout_s"},
    {"TF", "inf", Does::kStands, "dropped, bad transform: the vehicle stands after path/timeout_s"},
    {"TF", "-1", Does::kStands, "dropped, bad transform: the vehicle stands after path/timeout_s"},
    {"TF", "contradicts another input", Does::kStands, "walls that are elsewhere are unknown hits, or a contradiction"},
    {"TF", "restarted", Does::kGoesOn, "the vehicle stands meanwhile, and goes on"},
};

const Cell kVerdictCells[] = {
    {"verdict", "never came", Does::kStands, "the vehicle stands"},
    {"verdict", "stopped", Does::kStands, "the vehicle stands after path/timeout_s"},
    {"verdict", "killed", Does::kStands, "the vehicle stands after path/timeout_s"},
    {"verdict", "wrong frame", Does::kStands, "refused: the vehicle stands after path/timeout_s"},
    {"verdict", "frozen", Does::kStands, "its stamp does not go on: the vehicle stands after path/timeout_s"},
    {"verdict", "contradicts another input", Does::kStands, "one that contradicts its own speed is refused: it stands"},
    {"verdict", "late by 1 s", Does::kStands, "too old to be used: the vehicle stands"},
    {"verdict", "2 s ahead", Does::kStands, "too far ahead to be used: the vehicle stands"},
    {"verdict", "back by 1 h", Does::kStands, "too old to be used: the vehicle stands"},
    {"verdict", "NaN", Does::kStands, "refused: the vehicle stands after path/timeout_s"},
    {"verdict", "inf", Does::kStands, "refused: the vehicle stands after path/timeout_s"},
    {"verdict", "-1", Does::kStands, "refused: the vehicle stands after path/timeout_s"},
    {"verdict", "restarted", Does::kGoesOn, "the vehicle stands meanwhile, and goes on"},
};

class SafetyFaults : public testing::TestWithParam<Cell> {
 protected:
  void check(const std::vector<double>& speeds_m_s) const {
    const Cell& cell = GetParam();
    const bool from_the_start = cell.fault == std::string("never came");
    const auto settled = static_cast<std::size_t>((from_the_start ? 0 : kFault) + kSettled_s / 0.04);
    const double fastest_m_s =
        *std::max_element(speeds_m_s.begin() + static_cast<std::ptrdiff_t>(settled), speeds_m_s.end());
    switch (cell.does) {
      case Does::kStands:
        EXPECT_EQ(fastest_m_s, 0.0);
        break;
      case Does::kConservative:
        EXPECT_LE(fastest_m_s, SafetyParams().slow_speed_m_s + 1e-9);
        break;
      case Does::kGoesOn:
        EXPECT_GT(fastest_m_s, 0.3);
        break;
    }
  }
};

TEST_P(SafetyFaults, TheVehicleDoesWhatTheTableSays) {
  const Cell& cell = GetParam();
  const FaultCell recorded(cell.input == std::string("verdict") ? "path_following" : "safety_areas", cell.input,
                           cell.fault, cell.text);
  std::optional<FaultCell> also;
  if (cell.input == std::string("TF")) also.emplace("path_following", cell.input, cell.fault, cell.text);
  SCOPED_TRACE(std::string(cell.input) + ": " + cell.fault);
  Drive drive(cell);
  check(drive.run());
  EXPECT_LE(drive.fastest_beside_m_s(), SafetyParams().slow_speed_m_s + 0.05);
}

INSTANTIATE_TEST_SUITE_P(SafetyAreas, SafetyFaults, testing::ValuesIn(kCells));
INSTANTIATE_TEST_SUITE_P(PathFollowing, SafetyFaults, testing::ValuesIn(kVerdictCells));

// Without a fault the vehicle drives, and past the person as slowly as beside whoever may move.
TEST(SafetyFaultsNone, ItDrivesAndIsSlowBesideThePerson) {
  Drive drive({"scan", "none", Does::kGoesOn, ""});
  const std::vector<double> speeds_m_s = drive.run();
  EXPECT_GT(*std::max_element(speeds_m_s.begin(), speeds_m_s.end()), 0.4);
  EXPECT_LE(drive.fastest_beside_m_s(), SafetyParams().slow_speed_m_s + 0.05);
}

struct WrongParams {
  const char* fault;
  const char* yaml;
};

TEST(SafetyFaultsParameters, AreRefusedByName) {
  for (const auto& [fault, yaml] : {WrongParams{"NaN", "margin_m: .nan"}, WrongParams{"inf", "mover_speed_m_s: .inf"},
                                    WrongParams{"-1", "margin_m: -1"}, WrongParams{"empty", "policy: ''"},
                                    WrongParams{"contradicts another input", "floor_margin_m: 1.0"}}) {
    const FaultCell cell("safety_areas", "parameters", fault, "refused by name: the stage does not start");
    EXPECT_THROW(params_from_yaml<SafetyParams>(yaml, "test"), std::invalid_argument) << yaml;
  }
  for (const auto& [fault, yaml] : {WrongParams{"NaN", "timeout_s: .nan"}, WrongParams{"inf", "timeout_s: .inf"},
                                    WrongParams{"-1", "timeout_s: -1"}, WrongParams{"empty", "timeout_s: ''"},
                                    WrongParams{"contradicts another input", "turn_to_rad: 1.0"}}) {
    const FaultCell cell("path_following", "parameters", fault, "refused by name: the stage does not start");
    EXPECT_THROW(params_from_yaml<PathFollowingParams>(yaml, "test"), std::invalid_argument) << yaml;
  }
}

}  // namespace
}  // namespace situation_awareness::safety_faults_test
