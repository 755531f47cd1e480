#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/evaluate splinegons: its measures of boundaries whose errors are known, and the simulator of its worlds."""
import functools
import itertools
import json
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
import splinegons  # noqa: E402

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
            places, attitudes = worlds.inertial_navigation(flight, stamps, forces, rates)
            end = flight.at(stamps[-1:])[0]
            np.testing.assert_allclose(places[-1], end[:3], atol=0.01)
            turned = (Rotation.from_euler("ZYX", end[:2:-1]).inv() * attitudes[-1]).magnitude()
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

    def test_outages_and_outliers(self):
        simulation = world("ellipse", 1, "outage")
        begin_s, end_s = (simulation.flight.begin_s + after_s for after_s in worlds.OUTAGE_S)
        stamps = simulation.fixes.stamps
        self.assertAlmostEqual(np.diff(stamps).max(), end_s - begin_s, delta=2.0 * worlds.FIX_PERIOD_S)
        self.assertFalse(((stamps >= begin_s) & (stamps < end_s)).any())
        self.assertGreater(simulation.flight.end_s, end_s + 10.0)
        self.assertGreater(simulation.truth()["outage"]["ins_alone_m"], 5.0)
        simulation = world("ellipse", 1, "outliers")
        fixes = simulation.fixes
        off = np.hypot(*(fixes.positions - simulation.flight.at(fixes.stamps)[:, :3])[:, :2].T)
        self.assertTrue(fixes.outlier.any())
        self.assertGreater(off[fixes.outlier].min(), 20.0)
        self.assertLess(off[~fixes.outlier].max(), 10.0)


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
            in_plane = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(len(beam))))
            in_base = mount_place + mount_turn.apply(ranges[beam, None] * in_plane)
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


# --- the measures


SIGMA_M = 0.02
SCANS = 20


def splinegon(vertices, id_=1, closed=True, sigma_m=SIGMA_M):
    return {"id": id_, "closed": closed, "vertices": [[float(v) for v in vertex] for vertex in vertices],
            "sigma_m": [sigma_m] * len(vertices)}


def rounded(length, width, radius, x=0.0, y=0.0):
    """A rectangle whose corners are arcs: eight vertices, and all joints are smooth."""
    a, b, bulge = 0.5 * length, 0.5 * width, math.tan(math.pi / 8.0)
    return [(x + px, y + py, own) for px, py, own in (
        (a, radius - b, 0.0), (a, b - radius, bulge), (a - radius, b, 0.0), (radius - a, b, bulge),
        (-a, b - radius, 0.0), (-a, radius - b, bulge), (radius - a, -b, 0.0), (a - radius, -b, bulge))]


def circle(radius, arcs=16, x=0.0, y=0.0):
    bulge = math.tan(0.5 * math.pi / arcs)
    return [(x + radius * math.cos(angle), y + radius * math.sin(angle), bulge)
            for angle in 2.0 * math.pi / arcs * np.arange(arcs)]


def moved(own, dx=0.0, dy=0.0, turn=0.0, scale=1.0):
    c, s = scale * math.cos(turn), scale * math.sin(turn)
    return {**own, "vertices": [[c * x - s * y + dx, s * x + c * y + dy, bulge] for x, y, bulge in own["vertices"]]}


def true_document(*shapes, corners=()):
    """Of obstacles that are splinegons; the vehicle flies on a line, and has seen all from the middle of the flight
    on."""
    outlines = [splinegons.sampled(splinegons.Boundary(0, True, np.array(shape, float), np.ones(len(shape))), 0.01)[0]
                for shape in shapes]
    at = np.arange(SCANS) / (SCANS - 1)
    obstacles = []
    for k, (shape, outline) in enumerate(zip(shapes, outlines)):
        boundary = splinegons.Boundary(0, True, np.array(shape, float), np.ones(len(shape)))
        near = [int(np.hypot(*(outline - corner).T).argmin()) for corner in corners]
        obstacles.append({"id": f"obstacle_{k + 1}", "outline": outline.tolist(), "corners": near,
                          "area_m2": splinegons.area_m2(boundary)})
    return {"shape": "ellipse", "seed": 1, "variant": "plain", "origin": list(worlds.ORIGIN),
            "flight": {"begin_s": 0.0, "end_s": 10.0, "wind": [0.0, 0.0]}, "obstacles": obstacles,
            "fixes": {"stamp": [0.0, 5.0, 10.0], "x": [3.0, 28.0, 53.0], "y": [4.0] * 3, "z": [15.0] * 3,
                      "arrived": [0.1, 5.1, 10.1], "outlier": [False, True, False]},
            "outage": {"begin_s": 2.0, "end_s": 4.0, "ins_alone_m": 20.0},
            "scans": {"stamp": (10.0 * at).tolist(), "x": (50.0 * at).tolist(), "y": [0.0] * SCANS, "z": [15.0] * SCANS,
                      "roll": [0.0] * SCANS, "pitch": [0.0] * SCANS, "yaw": [3.1] * SCANS,
                      "seen": [[min(1.0, 2.0 * part)] * len(shapes) for part in at]}}


def oracle(truth, boundaries, error=(0.0, 0.0, 0.0), from_seen=1.0, sigma_m=1.0):
    """A line for each scan; the boundaries from when so much was seen."""
    for scan, stamp_s in enumerate(truth.stamps):
        x, y, z, roll, pitch, yaw = (float(v) for v in truth.poses[scan])
        yield {"stamp": float(stamp_s), "pose": {
            "x": x + error[0], "y": y + error[1], "z": z, "roll": roll, "pitch": pitch,
            "yaw": (yaw + error[2] + math.pi) % (2.0 * math.pi) - math.pi,
            "covariance": (sigma_m**2 * np.eye(6)).ravel().tolist()},
            "boundaries": boundaries(scan) if callable(boundaries) else
            boundaries if truth.seen[scan].min() >= from_seen else []}


def score(truth, boundaries, **options):
    return splinegons.score(truth, oracle(truth, boundaries, **options), "oracle")


class Arcs(unittest.TestCase):
    def boundary(self, vertices, closed=True):
        return splinegons.Boundary(1, closed, np.array(vertices, float), np.linspace(0.01, 0.02, len(vertices)))

    def test_area_and_length_of_a_circle_and_of_a_rounded_rectangle(self):
        for arcs in (2, 3, 16):
            boundary = self.boundary(circle(6.0, arcs, 100.0, -50.0))
            self.assertAlmostEqual(splinegons.area_m2(boundary), 36.0 * math.pi, places=8)
            self.assertAlmostEqual(splinegons.arc_lengths(*boundary.ends).sum(), 12.0 * math.pi, places=9)
        boundary = self.boundary(rounded(12.0, 7.0, 2.0))
        self.assertAlmostEqual(splinegons.area_m2(boundary), 84.0 - (4.0 - math.pi) * 4.0, places=9)

    def test_samples_are_on_the_circle_whatever_its_direction(self):
        for sign in (1.0, -1.0):
            boundary = self.boundary([(x, sign * y, sign * bulge) for x, y, bulge in circle(6.0, 3)])
            points, _ = splinegons.sampled(boundary)
            np.testing.assert_allclose(np.hypot(*points.T), 6.0, atol=1e-12)
            self.assertLess(np.hypot(*np.diff(points, axis=0).T).max(), splinegons.SAMPLE_M + 1e-9)
            self.assertAlmostEqual(splinegons.area_m2(boundary), sign * 36.0 * math.pi, places=8)

    def test_an_arc_of_more_than_half_a_circle(self):
        boundary = self.boundary(((6.0, 0.0, math.tan(0.375 * math.pi)), (0.0, -6.0, math.tan(0.125 * math.pi))))
        np.testing.assert_allclose(np.hypot(*splinegons.sampled(boundary)[0].T), 6.0, atol=1e-9)
        self.assertAlmostEqual(splinegons.area_m2(boundary), 36.0 * math.pi, places=8)

    def test_area_of_nearly_straight_arcs_is_continuous(self):
        areas = [splinegons.area_m2(self.boundary([(x, y, bulge) for x, y, _ in rounded(12.0, 7.0, 2.0)]))
                 for bulge in (0.0, 2.49e-4, 2.51e-4)]
        self.assertAlmostEqual(areas[1] / areas[2], 1.0, places=5)
        self.assertAlmostEqual((areas[1] - areas[0]) / 2.49e-4, (areas[2] - areas[0]) / 2.51e-4, places=4)

    def test_a_boundary_of_kilometres_is_sampled_with_as_many_points(self):
        points, _ = splinegons.sampled(self.boundary(circle(5000.0)))
        self.assertLess(len(points), 21000)
        np.testing.assert_allclose(np.hypot(*points.T), 5000.0, atol=1e-6)

    def test_sigma_is_linear_along_an_arc(self):
        boundary = self.boundary(((0.0, 0.0, 0.4), (1.0, 0.0, 0.4)), closed=False)
        points, sigmas = splinegons.sampled(boundary)
        self.assertAlmostEqual(float(np.interp(0.5, np.linspace(0.0, 1.0, len(points)), sigmas)), 0.015)
        self.assertEqual((sigmas[0], sigmas[-1]), (0.01, 0.02))

    def test_breaks_are_at_corners_only(self):
        _, breaks = splinegons.joint_breaks(self.boundary(rounded(12.0, 7.0, 2.0)))
        np.testing.assert_allclose(breaks, 0.0, atol=1e-12)
        _, breaks = splinegons.joint_breaks(self.boundary([(x, y, 0.0) for x, y in worlds.polygon_worlds.rectangle(
            12.0, 7.0)]))
        np.testing.assert_allclose(breaks, 0.5 * math.pi)
        at, _ = splinegons.joint_breaks(self.boundary(circle(6.0), closed=False))
        self.assertEqual(list(at), list(range(1, 15)))

    def test_what_crosses_itself_is_not_simple(self):
        points, _ = splinegons.sampled(self.boundary(rounded(12.0, 7.0, 2.0)), 0.2)
        self.assertTrue(splinegons.is_simple(points, True))
        eight = np.array(((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)))
        self.assertFalse(splinegons.is_simple(eight, True))
        self.assertTrue(splinegons.is_simple(eight[:3], False))

    def test_distances_are_to_the_pieces(self):
        line = np.array(((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)))
        points = np.array(((0.5, 0.3), (1.4, -0.2), (4.0, 0.0)))
        np.testing.assert_allclose(splinegons.distances(points, line, False)[0], (0.3, 0.2, 1.0), atol=1e-12)

    def test_a_rigid_offset_is_found_back(self):
        outline = splinegons.sampled(self.boundary(rounded(12.0, 7.0, 2.0)))[0]
        away = moved(splinegon(rounded(12.0, 7.0, 2.0)), 0.6, -0.3, 0.05)
        points = splinegons.sampled(self.boundary(away["vertices"]))[0]
        turn, place = splinegons.rigid_offset(points, outline)
        self.assertAlmostEqual(math.atan2(turn[1, 0], turn[0, 0]), -0.05, places=4)
        np.testing.assert_allclose(points @ turn.T + place, outline, atol=1e-3)


class Measures(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shape = rounded(12.0, 7.0, 2.0, 20.0, 10.0)
        cls.truth = splinegons.Truth(true_document(cls.shape))
        cls.perfect = score(cls.truth, [splinegon(cls.shape)])

    def of(self, boundaries, **options):
        return splinegons.Group([score(self.truth, boundaries, **options)])

    def test_a_perfect_splinegon_has_no_errors(self):
        (fit,) = self.perfect.fits
        self.assertLess(max(fit.hausdorff_m, fit.mean_m, fit.shape_m), 1e-5)
        self.assertLess(fit.area_part, 1e-9)
        self.assertLess(fit.joint_deg, 1e-9)
        self.assertEqual((fit.inside, fit.entries, fit.closed, fit.simple), (1.0, 8, True, True))
        self.assertEqual(self.perfect.wrong.count, 0, self.perfect.wrong)

    def test_a_shifted_one_has_the_shift_and_its_shape_is_right(self):
        (fit,) = score(self.truth, [moved(splinegon(self.shape), 0.3, -0.4)]).fits
        self.assertAlmostEqual(fit.hausdorff_m, 0.5, delta=1e-3)
        self.assertLess(fit.mean_m, 0.5)
        self.assertLess(fit.shape_m, 1e-3)
        self.assertLess(fit.area_part, 1e-9)

    def test_a_turned_one_has_a_right_shape(self):
        (fit,) = score(self.truth, [moved(splinegon(self.shape), 0.2, -0.3, 0.05)]).fits
        self.assertGreater(fit.hausdorff_m, 0.3)
        self.assertLess(fit.shape_m, 1e-3)
        self.assertAlmostEqual(fit.shape_turn_rad, -0.05, places=4)

    def test_a_larger_circle_is_off_by_its_radius_everywhere(self):
        truth = splinegons.Truth(true_document(circle(6.0)))
        (fit,) = score(truth, [splinegon(circle(6.1))]).fits
        for value in (fit.hausdorff_m, fit.mean_m, fit.shape_m):
            self.assertAlmostEqual(value, 0.1, delta=1e-4)
        self.assertAlmostEqual(fit.area_part, (6.1 / 6.0)**2 - 1.0, places=6)

    def test_the_envelope_is_of_sigma(self):
        truth = splinegons.Truth(true_document(circle(6.0)))
        for sigma_m, inside in ((0.1 / 2.5, 1.0), (0.1 / 2.7, 0.0)):
            (fit,) = score(truth, [splinegon(circle(6.1), sigma_m=sigma_m)]).fits
            self.assertEqual(fit.inside, inside)

    def test_a_dent_counts_in_both_directions(self):
        """A splinegon that cuts a corner off: the outline's corner is far from it."""
        (fit,) = score(self.truth, [splinegon([(x, y, 0.0) for x, y, _ in self.shape])]).fits
        self.assertAlmostEqual(fit.hausdorff_m, 2.0 * (1.0 - math.sqrt(0.5)), delta=1e-3)

    def test_breaks_at_true_corners_do_not_count(self):
        corners = worlds.polygon_worlds.rectangle(12.0, 7.0)
        box = [(x, y, 0.0) for x, y in corners]
        truth = splinegons.Truth(true_document(box, corners=corners))
        self.assertLess(score(truth, [splinegon(box)]).fits[0].joint_deg, 1e-9)
        self.assertLess(score(truth, [moved(splinegon(box), 1.5, 0.7)]).fits[0].joint_deg, 1e-9)
        halved = [(*point, 0.01) for point in 0.5 * (np.array(corners) + np.roll(corners, -1, axis=0))]
        both = [vertex for pair in zip(box, halved) for vertex in pair]
        self.assertAlmostEqual(score(truth, [splinegon(both)]).fits[0].joint_deg, math.degrees(2.0 * math.atan(0.01)),
                               places=6)

    def test_what_is_missing_open_false_or_doubled_is_wrong(self):
        own = splinegon(self.shape)
        self.assertEqual(score(self.truth, []).wrong.missed, ["obstacle_1"])
        self.assertEqual(score(self.truth, [{**own, "closed": False}]).wrong.open, ["obstacle_1"])
        false = score(self.truth, [own, moved(splinegon(self.shape, 2), 60.0)]).wrong
        self.assertEqual((false.false, false.count), (1, 1))
        doubled = score(self.truth, [own, {**own, "id": 2}]).wrong
        self.assertEqual((doubled.doubled, doubled.count), (["obstacle_1"], 1))

    def test_a_map_that_is_off_as_the_pose_is_has_its_boundaries(self):
        """Only what is off from the vehicle's sight is of another obstacle, or of none."""
        turn, dx, dy = 0.05, 3.0, -4.0
        right, alone = (score(self.truth, [moved(splinegon(self.shape), dx, dy)], error=error)
                        for error in ((dx, dy, 0.0), (0.0, 0.0, 0.0)))
        self.assertEqual(right.wrong.count, 0, right.wrong)
        self.assertAlmostEqual(right.fits[0].hausdorff_m, 5.0, delta=0.01)
        self.assertEqual((alone.wrong.missed, alone.wrong.false), (["obstacle_1"], 1))
        # Turned about the place of the vehicle.
        points = np.array([[1.0, 2.0], [-3.0, 0.5]])
        pose = {"x": self.truth.poses[7, 0] + dx, "y": dy, "yaw": 3.1 + turn}
        c, s = math.cos(turn), math.sin(turn)
        seen = (points - self.truth.poses[7, :2]) @ np.array(((c, s), (-s, c))) + (pose["x"], pose["y"])
        np.testing.assert_allclose(self.truth.seen_from(7, pose, seen), points, atol=1e-12)

    def test_a_change_of_the_id_is_wrong(self):
        wrong = score(self.truth, lambda scan: [splinegon(self.shape, 1 + (scan > 12))] if scan > 9 else []).wrong
        self.assertEqual((wrong.ids, wrong.count), (["obstacle_1"], 1))

    def test_pieces_that_are_joined_may_have_other_ids(self):
        pieces = [splinegon(self.shape[:3], 5, False), splinegon(self.shape[4:7], 6, False)]
        run = score(self.truth, lambda scan: [splinegon(self.shape)] if scan > 9 else pieces)
        self.assertEqual(run.wrong.count, 0, run.wrong)

    def test_closed_before_enough_was_seen_is_early(self):
        early = score(self.truth, [splinegon(self.shape)], from_seen=0.7)
        self.assertEqual(early.wrong.early, ["obstacle_1"])
        self.assertEqual(score(self.truth, [splinegon(self.shape)], from_seen=0.9).wrong.early, [])
        open_at_first = lambda scan: [splinegon(self.shape, closed=bool(self.truth.seen[scan, 0] >= 0.85))]
        self.assertEqual(score(self.truth, open_at_first).wrong.count, 0)

    def test_two_obstacles_are_told_apart_and_one_boundary_of_both_is_merged(self):
        first, second = rounded(6.0, 6.0, 2.0), rounded(6.0, 6.0, 2.0, 9.0)
        truth = splinegons.Truth(true_document(first, second))
        right = score(truth, [splinegon(second, 7), splinegon(first, 4)])
        self.assertEqual(right.wrong.count, 0, right.wrong)
        self.assertLess(right.worst("hausdorff_m"), 1e-5)
        both = score(truth, [splinegon(rounded(15.0, 6.0, 2.0, 4.5))]).wrong
        self.assertEqual((both.merged, both.missed), (1, ["obstacle_1", "obstacle_2"]))

    def test_clockwise_and_crossing_are_wrong(self):
        backwards = self.shape[::-1]
        clockwise = [(x, y, -backwards[(k + 1) % 8][2]) for k, (x, y, _) in enumerate(backwards)]
        run = score(self.truth, [splinegon(clockwise)])
        self.assertGreater(run.wrong.clockwise, 0)
        self.assertLess(run.fits[0].hausdorff_m, 1e-5)
        crossed = [self.shape[k] for k in (0, 2, 1, 3, 4, 5, 6, 7)]
        self.assertGreater(score(self.truth, [splinegon(crossed)]).wrong.crossing, 0)

    def test_stamps_that_go_back_are_wrong(self):
        lines = list(oracle(self.truth, [splinegon(self.shape)]))
        twice = list(itertools.chain(lines[:12], lines[10:]))
        self.assertEqual(splinegons.score(self.truth, twice).wrong.stamps, 2)
        with self.assertRaises(ValueError):
            splinegons.score(self.truth, iter(()))

    def test_errors_of_the_pose(self):
        group = self.of([splinegon(self.shape)], error=(0.3, -0.4, 0.1), sigma_m=0.25)
        self.assertAlmostEqual(group.position_m, 0.5)
        self.assertAlmostEqual(group.yaw_rad, 0.1)  # over the turn from pi to -pi
        self.assertAlmostEqual(group.nees, 4.0)
        self.assertEqual(group.inside_3_sigma, 1.0)
        self.assertAlmostEqual(group.fix_m, 5.0)
        self.assertEqual(self.of([], error=(0.3, -0.4, 0.1), sigma_m=0.1).inside_3_sigma, 0.0)

    def test_errors_at_the_end_of_an_outage_and_the_step_of_an_outlier(self):
        """The pose is off by 10 cm for each second of the flight, and after an outlier by 30 cm more."""
        lines = list(oracle(self.truth, []))
        for line in lines:
            line["pose"]["x"] += 0.1 * line["stamp"] + 0.3 * (line["stamp"] >= 5.1)
        run = splinegons.score(self.truth, lines)
        at_end, later, alone = splinegons.outage_of(run)
        before_end = self.truth.stamps[self.truth.stamps <= 4.0][-1]
        self.assertAlmostEqual(at_end, 0.1 * before_end)
        self.assertAlmostEqual(later, 0.3 + 0.1 * self.truth.stamps[self.truth.stamps >= 9.0][0])
        self.assertEqual(alone, 20.0)
        usual, outliers = splinegons.steps_of(run)
        period_s = self.truth.stamps[1]
        np.testing.assert_allclose(usual, (0.1 * period_s,))
        np.testing.assert_allclose(outliers, (0.3 + 0.1 * period_s,))
        self.assertAlmostEqual(splinegons.Group([run]).outlier_ratio, 1.0 + 3.0 / period_s)

    def test_the_least_error_is_that_of_the_best_mean_of_a_slow_error(self):
        """Of 1,000 samples the weights that make the mean best, by their covariance."""
        for slow_s, time_s in ((5.0, 40.0), (30.0, 40.0)):
            at = np.linspace(0.0, time_s, 1000)
            covariance = 1.4**2 * np.exp(-np.abs(at[:, None] - at) / slow_s)
            variance = 1.0 / np.linalg.solve(covariance, np.ones(len(at))).sum()
            self.assertAlmostEqual(splinegons.least_error_m(1.4, slow_s, time_s), math.sqrt(2.0 * variance), places=3)

    def test_a_group_has_the_mean_of_the_worse_boundaries(self):
        group = splinegons.Group([self.perfect, score(self.truth, [moved(splinegon(self.shape), 0.2)])])
        self.assertAlmostEqual(group.hausdorff_m, 0.1, delta=1e-3)
        self.assertAlmostEqual(group.hausdorff_most_m, 0.2, delta=1e-3)


def answer(command):
    """Of the tool: the boundary is the truth, at its corners and each half metre between them."""
    words = [str(word) for word in command]
    name = words[1].removesuffix(".bag").removesuffix("_tf")
    truth = splinegons.Truth(json.loads(pathlib.Path(f"{name}.truth.json").read_text()))
    boundaries = [splinegon([(*point, 0.0) for point in outline[::25]], id_)
                  for id_, outline in enumerate(truth.outlines)]
    lines = oracle(truth, boundaries, from_seen=0.9)
    pathlib.Path(words[words.index("--out") + 1]).write_text("\n".join(json.dumps(line) for line in lines))
    return 0.5


def without_bags(simulation, *_paths):
    for _ in simulation.scans():
        pass


class WholeEvaluation(unittest.TestCase):
    def test_a_quick_look_writes_a_report_with_all_its_parts(self):
        """The map is nearly the truth; the tool's answers are told."""
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(worlds, "write_bags", without_bags), \
                mock.patch.object(splinegons, "run_tool", answer), mock.patch("sys.stdout"):
            config = pathlib.Path(folder) / "config.yaml"
            config.write_text("scan: {max_range_m: 40.0}\nsplinegons: {vertices: 18}\n")
            splinegons.main(["--tool", "splinegons_bag", "--config", str(config), "--output", folder, "--quick",
                             "--shapes", "ellipse", "two", "--keep", folder])
            text = (pathlib.Path(folder) / "splinegons.md").read_text()
            for part in ("**A part only**", "## Targets", "## By the true pose", "## By GPS and INS", "## The pose",
                         "## Cost", "## What is wrong\n", "None."):
                self.assertIn(part, text)
            self.assertRegex(text, r"0 boundaries missed.* \| 0 true pose, 0 GPS and INS \| yes")
            self.assertRegex(text, r"at least 20 times .* \| yes")
            self.assertIn("max_range_m: 40.0", (pathlib.Path(folder) / "16.yaml").read_text())
            self.assertIn("vertices: 16", (pathlib.Path(folder) / "16.yaml").read_text())
            self.assertEqual(text.count("!["), 5)
            for name in [line.split("](")[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]:
                self.assertTrue((pathlib.Path(folder) / name).exists(), name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
