// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/moving_objects.hpp"

#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::moving_objects_test {
namespace {

constexpr double kPeriod_s = 0.04;

Object object_at(const Eigen::Vector2d& center_m, const Eigen::Vector2d& velocity_m_s, double p_moving,
                 std::uint64_t id = 1) {
  Object object;
  object.id = id;
  object.ellipse_world = {center_m, 0.3, 0.25, 0.15};
  object.velocity_world_m_s = velocity_m_s;
  object.p_moving = p_moving;
  object.covariance = 1e-4 * Matrix8d::Identity();
  return object;
}

/// Maps of one object, one after the other.
class Scene {
 public:
  explicit Scene(const Pose2& T = {}, const MoverParams& params = {}) : T_(T), movers_(params) {}

  void stand(double duration_s) {
    for (double t_s = 0.0; t_s < duration_s; t_s += kPeriod_s) add({0.0, 0.0}, 0.01);
  }
  void move(double duration_s, const Eigen::Vector2d& velocity_m_s) {
    for (double t_s = 0.0; t_s < duration_s; t_s += kPeriod_s) {
      center_m_ += kPeriod_s * velocity_m_s;
      add(velocity_m_s, 0.99);
    }
  }
  /// It is where its velocity takes it, as far as the map of objects knows.
  void move_unseen(double duration_s, const Eigen::Vector2d& velocity_m_s) {
    for (double t_s = 0.0; t_s < duration_s; t_s += kPeriod_s) {
      center_m_ += kPeriod_s * velocity_m_s;
      add(velocity_m_s, 0.99, 1, false);
    }
  }
  /// It is not on the map meanwhile.
  void jump(double duration_s, const Eigen::Vector2d& to_m) {
    stamp_ns_ += nanoseconds(duration_s);
    center_m_ = to_m;
  }
  void add(const Eigen::Vector2d& velocity_m_s, double p_moving, std::uint64_t id = 1, bool seen = true) {
    Objects objects;
    objects.stamp_ns = stamp_ns_ += nanoseconds(kPeriod_s);
    if (seen) last_seen_ns_ = stamp_ns_;
    Object object = object_at(T_ * center_m_, T_.rotation() * velocity_m_s, p_moving, id);
    object.ellipse_world.psi_rad += T_.yaw_rad;
    object.first_seen_ns = first_seen_ns_;
    object.last_seen_ns = last_seen_ns_;
    objects.objects = {object};
    if (!sees_) {
      movers_.add(objects);
      return;
    }
    // A scanner 3 m away sees the object where it is, something else where it was, and a wall.
    FreeSpace free_space;
    for (double azimuth_rad = -0.6; azimuth_rad < 0.6; azimuth_rad += 0.0087) {
      const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
      double range_m = 4.0 / u.x();
      for (const Ellipse& ellipse : seen_) {
        if (const auto hit_m = intersect_ray(ellipse, kScanner_m, u)) range_m = std::min(range_m, *hit_m);
      }
      const Ellipse now{center_m_, 0.3, 0.25, 0.15};
      if (const auto hit_m = intersect_ray(now, kScanner_m, u)) range_m = std::min(range_m, *hit_m);
      free_space.azimuth_rad.push_back(static_cast<float>(azimuth_rad));
      free_space.range_m.push_back(static_cast<float>(range_m));
    }
    movers_.add(objects, free_space, T_ * Pose2{kScanner_m, 0.0});
  }
  /// From now on scans see these, too.
  void see(const std::vector<Ellipse>& ellipses) {
    sees_ = true;
    seen_ = ellipses;
  }
  /// Whether a place beside the object is covered.
  bool covers(const Eigen::Vector2d& beside_m = {0.0, 0.0}, double later_s = 0.0) {
    return movers_.at(stamp_ns_ + nanoseconds(later_s)).cover(T_ * Eigen::Vector2d(center_m_ + beside_m));
  }
  MovingObjects& movers() { return movers_; }
  const Eigen::Vector2d& center_m() const { return center_m_; }
  std::int64_t stamp_ns() const { return stamp_ns_; }

 private:
  inline static const Eigen::Vector2d kScanner_m{-3.0, 0.0};

  Pose2 T_;
  MovingObjects movers_;
  bool sees_ = false;
  std::vector<Ellipse> seen_;
  Eigen::Vector2d center_m_ = Eigen::Vector2d::Zero();
  std::int64_t first_seen_ns_ = 1'000'000'000, last_seen_ns_ = 0, stamp_ns_ = 1'000'000'000;
};

TEST(MoverOutline, CoversWhatIsInsideOrBesideItByTheMargin) {
  Random random(1);
  int covered = 0;
  for (int i = 0; i < 20000; ++i) {
    const Ellipse ellipse{{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)}, random.uniform(-3.0, 3.0), 0.4, 0.3};
    const Box box{ellipse.center_m, ellipse.psi_rad, 0.4, 0.2};
    const Eigen::Vector2d p_m(random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0));
    const double margin_m = random.uniform(0.0, 0.2);
    const double off_box_m = offset_m(box, p_m), off_ellipse_m = offset_m(ellipse, p_m);
    if (std::abs(off_box_m - margin_m) > 1e-9) {
      EXPECT_EQ(MoverOutline(box, margin_m).covers(p_m), off_box_m < margin_m);
    }
    // Beside an ellipse the way is measured towards its centre: longer by up to its slant.
    if (off_ellipse_m < 0.95 * margin_m - 1e-6) {
      EXPECT_TRUE(MoverOutline(ellipse, margin_m).covers(p_m));
    }
    if (off_ellipse_m > margin_m + 1e-6) {
      EXPECT_FALSE(MoverOutline(ellipse, margin_m).covers(p_m));
    }
    covered += off_ellipse_m < margin_m ? 1 : 0;
  }
  EXPECT_GT(covered, 500);
}

TEST(MoverOutline, IsCrossedWhereItIsEnteredAndLeft) {
  Random random(3);
  int crossed = 0;
  for (int i = 0; i < 20000; ++i) {
    const Ellipse ellipse{{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)}, random.uniform(-3.0, 3.0), 0.4, 0.3};
    const Box box{ellipse.center_m, ellipse.psi_rad, 0.4, 0.2};
    const Eigen::Vector2d from_m(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0));
    const double azimuth_rad = random.uniform(-kPi, kPi);
    const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
    for (const bool is_box : {false, true}) {
      const MoverOutline outline = is_box ? MoverOutline(box, 0.1) : MoverOutline(ellipse, 0.1);
      const auto off_m = [&](double along_m) {
        const Eigen::Vector2d p_m = from_m + along_m * u;
        return is_box ? offset_m(box, p_m) : offset_m(ellipse, p_m);
      };
      const auto crossing = outline.crossing(from_m, u);
      if (!crossing) {
        if (off_m(0.0) < 0.0) continue;  // begins inside
        for (double along_m = 0.0; along_m < 6.0; along_m += 0.05) EXPECT_GT(off_m(along_m), -1e-3);
        continue;
      }
      ++crossed;
      EXPECT_GE(off_m(0.0), 0.0);
      EXPECT_NEAR(off_m(crossing->entry_m), 0.0, 1e-9);
      EXPECT_NEAR(off_m(crossing->exit_m), 0.0, 1e-9);
      EXPECT_LE(off_m(0.5 * (crossing->entry_m + crossing->exit_m)), 0.0);
    }
  }
  EXPECT_GT(crossed, 2000);
}

TEST(MovingObjects, WhatStandsIsNoMover) {
  Scene scene;
  scene.stand(30.0);
  EXPECT_FALSE(scene.covers());
  EXPECT_EQ(scene.movers().set_off(), 0U);
  EXPECT_TRUE(scene.movers().at(scene.stamp_ns()).traces.empty());
}

// Jumps of an estimate are no way that is travelled.
TEST(MovingObjects, WhatSeemsToMoveForAMomentIsNoMover) {
  Scene scene;
  for (int i = 0; i < 20; ++i) {
    scene.stand(1.0);
    scene.move(0.12, {i % 2 == 0 ? 1.5 : -1.5, 0.0});
  }
  EXPECT_EQ(scene.movers().set_off(), 0U);
  EXPECT_FALSE(scene.covers());
}

TEST(MovingObjects, AWayThatNobodySawIsNone) {
  Scene scene;
  scene.stand(2.0);
  scene.move(0.12, {2.0, 0.0});
  scene.move_unseen(0.4, {2.0, 0.0});
  EXPECT_EQ(scene.movers().set_off(), 0U) << "it was seen to travel 0.24 m";
  scene.move(0.08, {2.0, 0.0});
  EXPECT_EQ(scene.movers().set_off(), 1U) << "it is seen where it would be";
  scene.move_unseen(0.4, {2.0, 0.0});
  EXPECT_TRUE(scene.covers());
}

// The map of objects takes a thing that appears for one that it has lost elsewhere, and knows a velocity from that.
TEST(MovingObjects, TheWayBetweenTwoThingsThatAreTakenForOneIsNone) {
  Scene scene;
  scene.stand(1.8);
  scene.jump(3.0, {8.2, 1.0});
  scene.move(0.04, {3.0, 0.3});
  scene.move_unseen(0.5, {3.0, 0.3});
  scene.jump(0.3, {8.2, 1.0});
  scene.stand(2.0);
  EXPECT_EQ(scene.movers().set_off(), 0U);
  EXPECT_FALSE(scene.covers());
  EXPECT_TRUE(scene.movers().at(scene.stamp_ns()).traces.empty());
  scene.move(0.4, {1.0, 0.0});
  EXPECT_EQ(scene.movers().set_off(), 1U);
  const Movers& movers = scene.movers().at(scene.stamp_ns());
  EXPECT_FALSE(movers.traces.empty());
  for (const MoverTrace& trace : movers.traces) EXPECT_FALSE(trace.outline.covers({0.0, 0.0})) << "another thing";
}

// The outline that is seen of a thing that stands moves with the view of it.
TEST(MovingObjects, WhatIsStillHitWhereItStoodHasNotSetOff) {
  const Ellipse stood{{0.0, 0.0}, 0.3, 0.25, 0.15};
  for (const Pose2& T : {Pose2{}, Pose2{{2.0, -7.0}, 2.0}}) {
    Scene scene(T);
    scene.see({stood});
    scene.stand(2.0);
    scene.move(0.5, {0.0, 1.0});
    EXPECT_EQ(scene.movers().set_off(), 0U);
    EXPECT_FALSE(scene.covers());
    EXPECT_TRUE(scene.movers().at(scene.stamp_ns()).traces.empty());

    Scene free(T), hidden(T);
    for (Scene* const other : {&free, &hidden}) {
      other->see(other == &free ? std::vector<Ellipse>{} : std::vector<Ellipse>{{{-1.5, 0.0}, 0.0, 0.2, 0.2}});
      other->stand(2.0);
      other->move(0.5, {0.0, 1.0});
      EXPECT_EQ(other->movers().set_off(), 1U);
    }
  }
}

TEST(MovingObjects, WhoIsHiddenForAMomentGoesOn) {
  Scene scene;
  scene.move(1.0, {1.0, 0.0});
  ASSERT_TRUE(scene.covers());
  scene.jump(2.0, {3.0, 0.1});
  scene.move(0.04, {1.0, 0.0});
  EXPECT_TRUE(scene.covers());
  EXPECT_EQ(scene.movers().set_off(), 1U);
}

TEST(MovingObjects, WhatTravelsIsOneUntilItHasParked) {
  Scene scene;
  scene.stand(2.0);
  scene.move(0.2, {1.0, 0.0});
  EXPECT_FALSE(scene.covers()) << "it has travelled 0.2 m";
  scene.move(0.2, {1.0, 0.0});
  EXPECT_TRUE(scene.covers());
  EXPECT_FALSE(scene.covers({0.6, 0.0}));
  EXPECT_EQ(scene.movers().count(), 1U);
  scene.move(2.0, {1.0, 0.0});
  EXPECT_EQ(scene.movers().set_off(), 1U);
  scene.stand(9.8);
  EXPECT_TRUE(scene.covers());
  scene.stand(0.4);
  EXPECT_FALSE(scene.covers());
  scene.move(1.0, {0.0, -0.5});
  EXPECT_TRUE(scene.covers());
  EXPECT_EQ(scene.movers().set_off(), 2U);
}

TEST(MovingObjects, WhereItStoodIsGivenUpWhateverItsAgeAndItsWaySinceItWasSeen) {
  Scene scene;
  scene.stand(5.0);
  const Eigen::Vector2d stood_m = scene.center_m();
  scene.move(0.6, {1.0, 0.0});
  const Movers& movers = scene.movers().at(scene.stamp_ns());
  bool old_elements_too = false;
  for (const MoverTrace& trace : movers.traces) {
    if (trace.outline.covers(stood_m) && trace.since_ns == std::numeric_limits<std::int64_t>::min()) {
      old_elements_too = true;
    }
  }
  EXPECT_TRUE(old_elements_too);
  scene.move(5.0, {1.0, 0.0});
  for (const MoverTrace& trace : scene.movers().at(scene.stamp_ns()).traces) {
    EXPECT_FALSE(trace.outline.covers(stood_m));
    EXPECT_EQ(trace.since_ns, 500'000'000);
  }
}

TEST(MovingObjects, AMoverGoesOnUnderAnotherId) {
  Scene scene;
  scene.move(1.0, {1.0, 0.0});
  ASSERT_TRUE(scene.covers());
  scene.add({0.0, 0.0}, 0.1, 7);
  EXPECT_TRUE(scene.covers());
  for (double t_s = 0.0; t_s < 9.0; t_s += kPeriod_s) scene.add({0.0, 0.0}, 0.1, 7);
  EXPECT_TRUE(scene.covers());
  for (double t_s = 0.0; t_s < 1.2; t_s += kPeriod_s) scene.add({0.0, 0.0}, 0.1, 7);
  EXPECT_FALSE(scene.covers());
}

TEST(MovingObjects, ItIsPredictedForAMomentWhereAMapIsMissing) {
  Scene scene;
  scene.move(1.0, {1.0, 0.0});
  EXPECT_TRUE(scene.covers({0.2, 0.0}, 0.2));
  EXPECT_FALSE(scene.covers({-0.25, 0.0}, 0.2));
  EXPECT_FALSE(scene.covers({2.0, 0.0}, 2.0));
  EXPECT_FALSE(scene.covers({0.0, 0.0}, -1.0)) << "of a later time";
}

TEST(MovingObjects, AStampThatGoesBackBeginsAnew) {
  Scene scene;
  scene.move(1.0, {1.0, 0.0});
  Objects before;
  before.stamp_ns = 1;
  scene.movers().add(before);
  EXPECT_TRUE(scene.movers().at(2).outlines.empty());
  EXPECT_EQ(scene.movers().count(), 0U);
}

TEST(MovingObjects, ItIsTheSameUnderRigidMotion) {
  const Pose2 T{{-3.0, 7.0}, 2.2};
  Scene here, there(T);
  const auto drive = [](Scene& scene) {
    scene.stand(2.0);
    scene.move(1.3, {0.6, -0.3});
    scene.stand(1.0);
  };
  drive(here);
  drive(there);
  const Movers at_here = here.movers().at(here.stamp_ns());
  const Movers at_there = there.movers().at(there.stamp_ns());
  ASSERT_EQ(at_here.outlines.size(), at_there.outlines.size());
  ASSERT_EQ(at_here.traces.size(), at_there.traces.size());
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector2d p_m(random.uniform(-1.0, 2.0), random.uniform(-1.5, 1.0));
    EXPECT_EQ(at_here.cover(p_m), at_there.cover(T * p_m));
  }
}

TEST(MovingObjects, RefusesParametersNamingFieldAndBound) {
  MoverParams params;
  params.parked_after_s = -1.0;
  EXPECT_TRUE(names(refusal_of([&] { MovingObjects{params}; }), {"movers.parked_after_s", "-1", "0"}));
}

}  // namespace
}  // namespace situation_awareness::moving_objects_test
