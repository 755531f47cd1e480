#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/evaluate splinegons: its measures of boundaries whose errors are known, and the simulator of its worlds."""
import functools
import math
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation, Slerp

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/evaluation"))
import splinegon_worlds as worlds  # noqa: E402

try:
    import rosbag
except ImportError:
    rosbag = None

SILENT = {"noise": 0.0, "bias_sigma": 0.0, "bias_walk": 0.0}


@functools.lru_cache(maxsize=None)
def world(shape, seed=1, variant="plain"):
    return worlds.Simulation(shape, seed, variant)


def distances(points, outline):
    """To the nearest segment of a closed outline; the nearest point is at one end of it."""
    nearest = cKDTree(outline).query(points)[1]
    best = np.full(len(points), np.inf)
    for step in (-1, 0):
        start = outline[(nearest + step) % len(outline)]
        edge = outline[(nearest + step + 1) % len(outline)] - start
        part = np.clip(((points - start) * edge).sum(1) / (edge**2).sum(1), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(points - start - part[:, None] * edge).T))
    return best


class Geodesy(unittest.TestCase):
    def test_there_and_back(self):
        chance = np.random.default_rng(1)
        for origin in (worlds.ORIGIN, (-80.0, 179.9, -50.0), (0.0, 0.0, 0.0)):
            local = chance.uniform(-5000.0, 5000.0, (100, 3))
            np.testing.assert_allclose(worlds.local_of(worlds.geodetic_of(local, origin), origin), local, atol=1e-6)

    def test_the_origin_and_what_is_above_it(self):
        origin = np.array(worlds.ORIGIN)
        np.testing.assert_allclose(worlds.local_of(origin + (0.0, 0.0, 12.0), origin), (0.0, 0.0, 12.0), atol=1e-8)

    def test_a_degree_on_the_equator_and_at_the_pole_is_as_long_as_the_radii_of_curvature_say(self):
        small = 1e-4
        a, e2 = 6378137.0, 0.00669437999014
        east = worlds.local_of((0.0, small, 0.0), (0.0, 0.0, 0.0))
        np.testing.assert_allclose(east[0], math.radians(small) * a, rtol=1e-9)
        north = worlds.local_of((small, 0.0, 0.0), (0.0, 0.0, 0.0))
        np.testing.assert_allclose(north[1], math.radians(small) * a * (1.0 - e2), rtol=1e-9)
        of_pole = worlds.local_of((90.0 - small, 0.0, 0.0), (90.0, 0.0, 0.0))
        np.testing.assert_allclose(-of_pole[1], math.radians(small) * a / math.sqrt(1.0 - e2), rtol=1e-9)


class Obstacles(unittest.TestCase):
    def test_areas_are_those_of_the_formulas(self):
        for shape, area_m2 in (("ellipse", 60.0 * math.pi), ("peanut", math.pi * (49.0 + 4.5)),
                               ("lobes", math.pi * (56.25 + 2.0)), ("box", 84.0)):
            (obstacle,) = worlds.obstacles_of(shape)
            self.assertAlmostEqual(obstacle.area_m2, area_m2, delta=1e-3)

    def test_outlines_are_counter_clockwise_and_dense(self):
        for shape in worlds.SHAPES:
            for obstacle in world(shape).obstacles:
                self.assertGreater(obstacle.area_m2, 0.0)
                steps = np.hypot(*(np.roll(obstacle.outline, -1, axis=0) - obstacle.outline).T)
                self.assertLess(steps.max(), worlds.OUTLINE_M + 1e-6)
                self.assertGreater(steps.min(), 0.5 * worlds.OUTLINE_M)

    def test_the_pocket_is_three_metres_deep_and_the_two_are_three_metres_apart(self):
        (kidney,) = worlds.obstacles_of("kidney")
        self.assertAlmostEqual(worlds.pocket_depth(kidney.outline), 3.0, delta=1e-3)
        first, second = worlds.obstacles_of("two")
        self.assertAlmostEqual(cKDTree(first.outline).query(second.outline)[0].min(), 3.0, delta=1e-3)

    def test_a_box_has_its_corners(self):
        (box,) = worlds.obstacles_of("box")
        np.testing.assert_allclose(np.abs(box.outline[list(box.corners)]), np.tile((6.0, 3.5), (4, 1)))


class Flights(unittest.TestCase):
    def test_the_vehicle_flies_around_and_never_near_or_tighter_than_it_can(self):
        for shape in worlds.SHAPES:
            for seed, variant in ((1, "plain"), (2, "wind"))[:1 + (shape in ("ellipse", "box"))]:
                with self.subTest(shape=shape, seed=seed):
                    simulation = world(shape, seed, variant)
                    flight = simulation.flight
                    times = np.arange(flight.begin_s, flight.end_s, 0.01)
                    poses, rates, accelerations = (flight.at(times, order) for order in range(3))
                    outline = np.vstack([obstacle.outline for obstacle in simulation.obstacles])
                    self.assertGreater(cKDTree(outline).query(poses[:, :2])[0].min(), 4.0)
                    speed = np.hypot(*rates[:, :2].T)
                    curvature = (rates[:, 0] * accelerations[:, 1] - rates[:, 1] * accelerations[:, 0]) / speed**3
                    self.assertLess(np.abs(curvature).max(), 1.0 / 6.0)
                    np.testing.assert_allclose(np.hypot(*(rates[:, :2] - flight.wind).T), 5.0, atol=0.02)
                    np.testing.assert_allclose(poses[:, 2], worlds.ALTITUDE_M, atol=1e-9)
                    gust = worlds.GUST_RAD["roll"] if variant == "wind" else 0.0
                    bank = np.degrees(np.abs(poses[:, 3]).max())
                    self.assertTrue(15.0 < bank < 20.01 + math.degrees(gust), bank)
                    self.assertLess(np.abs(curvature[times < flight.begin_s + 10.0]).max(), 1e-3)
                    course = np.unwrap(np.arctan2(rates[:, 1], rates[:, 0]))
                    turned = (course[-1] - course[0]) / (2.0 * math.pi)
                    self.assertAlmostEqual(turned, 1.5 if seed % 2 else -1.5, delta=0.15)

    def test_turns_are_coordinated_and_the_nose_is_along_the_way_without_wind(self):
        flight = world("peanut").flight
        times = np.arange(flight.begin_s + 0.1, flight.end_s - 0.1, 0.01)
        rates, (roll, _, yaw) = flight.at(times, 1), flight.at(times)[:, 3:].T
        below_limit = np.abs(roll) < math.radians(15.0)
        self.assertGreater(below_limit.mean(), 0.6)
        self.assertLess(np.abs(flight.specific_force(times)[below_limit, 1]).max(), 0.02)
        self.assertLess(np.abs(rates[:, 0] * np.sin(yaw) - rates[:, 1] * np.cos(yaw)).max(), 1e-3)

    def test_in_wind_heading_is_not_course(self):
        flight = world("ellipse", 1, "wind").flight
        times = np.arange(flight.begin_s, flight.end_s, 0.05)
        rates, yaw = flight.at(times, 1), flight.at(times)[:, 5]
        beside = np.abs((np.arctan2(rates[:, 1], rates[:, 0]) - yaw + math.pi) % (2.0 * math.pi) - math.pi)
        self.assertGreater(math.degrees(beside.max()), 10.0)

    def test_an_imu_at_rest_measures_gravity_upwards(self):
        times = worlds.BEGIN_S + np.arange(0.0, 5.0, 0.02)
        still = worlds.Flight(times, np.zeros((len(times), 3)), np.zeros((len(times), 3)), np.zeros(2))
        np.testing.assert_allclose(still.specific_force(times), np.tile((0.0, 0.0, 9.80665), (len(times), 1)))
        np.testing.assert_allclose(still.angular_velocity(times), 0.0, atol=1e-12)

    def test_an_imu_without_errors_integrates_to_the_truth(self):
        with mock.patch.multiple(worlds, GYROSCOPE=SILENT, ACCELEROMETER=SILENT):
            flight = world("lobes", 2, "wind").flight
            stamps, forces, rates = worlds.imu_of(np.random.default_rng(1), flight)
            period = np.diff(stamps)
            turns = Rotation.from_rotvec(0.5 * (rates[:-1] + rates[1:]) * period[:, None])
            begin = flight.at(stamps[:1])[0]
            attitude = Rotation.from_euler("ZYX", begin[:2:-1])
            place, velocity = begin[:3].copy(), flight.at(stamps[:1], 1)[0, :3].copy()
            gravity = np.array((0.0, 0.0, 9.80665))
            for k, dt in enumerate(period):
                after = attitude * turns[k]
                acceleration = 0.5 * (attitude.apply(forces[k]) + after.apply(forces[k + 1])) - gravity
                place += velocity * dt + 0.5 * acceleration * dt**2
                velocity += acceleration * dt
                attitude = after
            end = flight.at(stamps[-1:])[0]
            np.testing.assert_allclose(place, end[:3], atol=0.01)
            turned = (Rotation.from_euler("ZYX", end[:2:-1]).inv() * attitude).magnitude()
            self.assertLess(turned, 1e-5)

    def test_errors_of_the_imu_and_of_fixes_are_as_large_as_said(self):
        flight = world("ellipse").flight
        _, forces, rates = worlds.imu_of(np.random.default_rng(5), flight)
        with mock.patch.multiple(worlds, GYROSCOPE=SILENT, ACCELEROMETER=SILENT):
            _, true_forces, true_rates = worlds.imu_of(np.random.default_rng(5), flight)
        for value, true, noise in ((forces, true_forces, 2.0e-3), (rates, true_rates, 1.0e-4)):
            steps = np.diff(value - true, axis=0) / math.sqrt(2.0)
            np.testing.assert_allclose(steps.std(0), noise / math.sqrt(worlds.IMU_PERIOD_S), rtol=0.03)
        errors, lag = [], []
        for seed in range(200):
            fixes = worlds.fixes_of(np.random.default_rng(seed), flight)
            error = fixes.positions - flight.at(fixes.stamps)[:, :3]
            errors.append(error)
            steps = round(10.0 / worlds.FIX_PERIOD_S)
            lag.append((error[steps:] * error[:-steps]).mean())
        self.assertAlmostEqual(float(np.std(errors)), 1.5, delta=0.05)
        self.assertAlmostEqual(float(np.mean(lag)), 1.4**2 * math.exp(-10.0 / 30.0), delta=0.15)


class Scans(unittest.TestCase):
    def points(self, simulation):
        """Of each tenth scan, by the true poses."""
        kept = []
        for k, (stamp_s, range_m) in enumerate(simulation.scans()):
            if k % 10:
                continue
            origins, directions = simulation.rays(stamp_s)
            hit = np.flatnonzero(np.isfinite(range_m))
            kept.append(origins[hit, :2] + range_m[hit, None] * directions[hit, :2])
        return np.vstack(kept)

    def test_without_noise_they_are_on_the_outline_however_the_scanner_is_mounted(self):
        with mock.patch.object(worlds, "RANGE_SIGMA_M", 0.0):
            for variant in ("yawed", "flipped"):
                simulation = worlds.Simulation("lobes", 2, variant)
                (obstacle,) = simulation.obstacles
                self.assertLess(distances(self.points(simulation), obstacle.outline).max(), 1e-6)
                seen = simulation.truth()["scans"]["seen"]
                self.assertEqual(seen[-1], [1.0])
                self.assertTrue(all(a <= b for a, b in zip(seen, seen[1:])))

    @unittest.skipUnless(rosbag, "no rosbag")
    def test_a_bag_has_what_its_truth_says(self):
        """The scans of a bag, by the poses that its TF has at the beams' times, are on the outline to their noise;
        without the sweep or the bank they are not."""
        with tempfile.TemporaryDirectory() as folder:
            name = worlds.write_world(folder, "two", 2, "flipped")
            messages, times = {}, []
            with rosbag.Bag(str(pathlib.Path(folder) / f"{name}_tf.bag")) as bag:
                for topic, message, at in bag.read_messages():
                    messages.setdefault(topic, []).append(message)
                    times.append(at.to_sec())
            with rosbag.Bag(str(pathlib.Path(folder) / f"{name}.bag")) as bag:
                self.assertEqual(set(bag.get_type_and_topic_info().topics), {"/tf_static", "/scan", "/imu", "/fix"})
        self.assertEqual(times, sorted(times))
        (mount,) = messages["/tf_static"][0].transforms
        mount_place, mount_turn = place_of(mount)
        base = [message.transforms[0] for message in messages["/tf"]]
        stamps = np.array([own.header.stamp.to_sec() for own in base])
        places, turns = zip(*map(place_of, base))
        places = np.array(places)
        turn_at = Slerp(stamps, Rotation.concatenate(turns))
        outline = np.vstack([obstacle.outline for obstacle in worlds.Simulation("two", 2, "flipped").obstacles])
        found = {"all": [], "sweep": [], "bank": []}
        for scan in messages["/scan"][200::10]:
            ranges = np.array(scan.ranges)
            beam = np.flatnonzero(np.isfinite(ranges))
            angle = scan.angle_min + beam * scan.angle_increment
            in_base = mount_turn.apply(ranges[beam, None] * np.column_stack((np.cos(angle), np.sin(angle), 0.0 * angle)))
            in_base += mount_place
            for what, kept in found.items():
                at_s = scan.header.stamp.to_sec() + (0.0 if what == "sweep" else scan.time_increment) * beam
                place = np.column_stack([np.interp(at_s, stamps, places[:, axis]) for axis in range(3)])
                turn = turn_at(at_s)
                if what == "bank":
                    turn = Rotation.from_euler("Z", turn.as_euler("ZYX")[:, 0])
                kept.append((place + turn.apply(in_base))[:, :2])
        away = {what: cKDTree(outline).query(np.vstack(kept))[0] for what, kept in found.items()}
        self.assertLess(np.sqrt(np.mean(away["all"]**2)), worlds.RANGE_SIGMA_M + 0.005)
        self.assertGreater(np.sqrt(np.mean(away["all"]**2)), 0.5 * worlds.RANGE_SIGMA_M)
        self.assertGreater(np.sqrt(np.mean(away["sweep"]**2)), 1.5 * worlds.RANGE_SIGMA_M)
        self.assertGreater(np.sqrt(np.mean(away["bank"]**2)), 3.0 * worlds.RANGE_SIGMA_M)
        fixes = messages["/fix"]
        self.assertTrue(any(math.isnan(fix.latitude) for fix in fixes))
        self.assertTrue(any(fix.status.status < 0 for fix in fixes))


def place_of(transform):
    t, q = transform.transform.translation, transform.transform.rotation
    return np.array((t.x, t.y, t.z)), Rotation.from_quat((q.x, q.y, q.z, q.w))


if __name__ == "__main__":
    unittest.main(verbosity=2)
