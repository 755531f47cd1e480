#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/evaluate polygons: its measures of maps whose errors are known, and the simulator of its worlds."""
import dataclasses
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

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/evaluation"))
import polygon_associations as associations  # noqa: E402
import polygon_worlds as worlds  # noqa: E402
import polygons  # noqa: E402

try:
    import rosbag
except ImportError:
    rosbag = None

TRANSITS = 3


def small_world(seed=1, transits=TRANSITS):
    """A room of 5 m x 3 m and 1.5 m of way: a box stays, one goes before the second transit, one comes then, and one
    goes while a screen hides it. A person walks by in the second."""
    room = worlds.Thing("walls", "walls", "plaster", ((-1, -1.5), (4, -1.5), (4, 1.5), (-1, 1.5)))
    box = lambda name, x, y, present: worlds.Thing(name, "box", "card", worlds.placed(worlds.rectangle(0.4, 0.3), x, y),
                                                   present=present)
    things = [room, box("stays", 3.0, 1.0, (0, 1, 2)), box("goes", 2.4, -1.1, (0,)), box("comes", 1.2, 1.1, (1, 2)),
              worlds.Thing("barrel", "barrel", "wood", circle=(3.2, -0.9, 0.2), present=(0, 1, 2)),
              worlds.Thing("reflector_1", "reflector", "reflector", circle=(3.8, 0.2, 0.05), present=(0, 1, 2))]
    way = worlds.Way(((0.0, 0.0), (0.5, 0.05), (1.0, 0.0), (1.5, 0.0)))
    walk = worlds.Walk((0.0, 3.5), (3.5, 1.2), 0.6, True)
    return worlds.World("corridor", seed, things, way, [(3.8, 0.2, 0.05)], {1: walk}, (0.1, 0.0, 0.05), transits)


def run_simulation(simulation):
    """Its scans and its truth."""
    scans = list(simulation.scans())
    return scans, simulation.truth()


@functools.lru_cache(maxsize=None)
def part_chain(truth, thing, part):
    points = truth.part_points(thing, part)
    if part is None:
        return polygons.simplified(np.vstack((points, points[:1])), 1e-4)[:-1]
    return polygons.simplified(points, 1e-4)


def seen_chains(truth, stamp_s, ids):
    """A map that is the truth: the seen parts of what stands, and of what has gone and was not seen to be free. The id
    of a chain is 100 times the number of its thing, and more; a part keeps the id of that before which it has most in
    common with. `ids`: {id: bins} of the last map, for the next."""
    polylines, kept = [], {}
    for i, thing in enumerate(truth.things):
        if thing["optional"]:
            continue
        bins = truth.bins_of(i)
        with np.errstate(invalid="ignore"):
            seen = (truth.seen_s[bins] <= stamp_s) & ~(truth.free_s[bins] <= stamp_s)
        parts = truth.seen_parts(i, seen)
        for k, part in enumerate([None] if parts is None else parts):
            points = part_chain(truth, i, part and tuple(part))
            own = set(np.arange(*((0, len(seen)) if part is None else (part[0], part[1] + 1))) % len(seen))
            common = {id_: len(own & before) for id_, before in ids.items() if id_ // 100 == i and id_ not in kept}
            id_ = max(common, key=common.get, default=None)
            if id_ is None or not common[id_]:
                id_ = max((known for known in {**ids, **kept} if known // 100 == i), default=100 * i - 1) + 1
            kept[id_] = own
            polylines.append(polyline(points, id_, part is None))
    ids.update(kept)
    return polylines


def polyline(points, id_, closed=False, sigma_m=0.01):
    return {"id": id_, "closed": closed, "points": np.asarray(points, float).tolist(),
            "sigma_m": [sigma_m] * len(points), "first_seen": 0.0, "last_seen": 0.0, "p": 0.9}


def oracle(truth, change=lambda polylines, scan: polylines, pose_error=(0.0, 0.0, 0.0)):
    """A line for each scan. `change`: of the map, given the scan, in those that are compared; between them the map
    stays as it is."""
    error, ids = np.asarray(pose_error, float), {}
    for scan, stamp_s in enumerate(truth.stamps):
        x, y, yaw = (float(v) for v in truth.poses[scan] + error)
        exact = scan % polygons.EVERY_SCANS == 0 or scan + 1 == len(truth.stamps) \
            or truth.transit_of_scan[scan] != truth.transit_of_scan[scan + 1]
        if exact or not scan:
            polylines = change(seen_chains(truth, stamp_s, ids), scan)
        yield {"stamp": float(stamp_s), "polylines": polylines,
               "pose": {"x": x, "y": y, "yaw": yaw, "covariance": np.diag((1e-6, 1e-6, 1e-6)).ravel().tolist()}}


def score(truth, **options):
    return polygons.score(truth, oracle(truth, **options), "oracle")


def shifted(polylines, dx=0.0, dy=0.0):
    return [{**found, "points": (np.array(found["points"]) + (dx, dy)).tolist()} for found in polylines]


class Casting(unittest.TestCase):
    def test_a_ray_on_a_wall_and_on_a_circle_is_as_geometry_says(self):
        wall = worlds.Thing("wall", "walls", "plaster", ((2.0, -1.0), (2.0, 1.0), (2.1, 1.0), (2.1, -1.0)))
        ball = worlds.Thing("ball", "barrel", "wood", circle=(0.0, 3.0, 0.5))
        caster = worlds.Caster([wall, ball])
        angles = np.array((0.0, 0.2, -0.4, math.pi / 2, math.pi / 2 + 0.1, math.pi))
        hits = caster.cast((0.0, 0.0), np.column_stack((np.cos(angles), np.sin(angles))))
        off_m = 3.0 * math.sin(0.1)
        at_ball = 3.0 * math.cos(0.1) - math.sqrt(0.25 - off_m**2)
        np.testing.assert_allclose(hits.range_m, (2.0, 2.0 / math.cos(0.2), 2.0 / math.cos(0.4), 2.5, at_ball, np.inf),
                                   atol=1e-12)
        np.testing.assert_array_equal(hits.thing, (0, 0, 0, 1, 1, -1))
        np.testing.assert_allclose(hits.cos_incidence[:5], (1.0, math.cos(0.2), math.cos(0.4), 1.0,
                                                            math.sqrt(0.25 - off_m**2) / 0.5), atol=1e-12)
        np.testing.assert_allclose(hits.arc_m[:3], (1.0, 1.0 + 2.0 * math.tan(0.2), 1.0 - 2.0 * math.tan(0.4)),
                                   atol=1e-12)
        np.testing.assert_allclose(hits.arc_m[3], 1.5 * math.pi * 0.5, atol=1e-12)  # its lowest point

    def test_a_hit_is_at_its_arc_length_of_the_outline(self):
        things = [worlds.Thing("l", "l_shape", "wood", worlds.placed(worlds.l_shape(1.0, 0.6, 0.2), 2.0, 0.5, 0.7)),
                  worlds.Thing("ball", "barrel", "wood", circle=(-2.0, 0.3, 0.4))]
        angles = np.linspace(-math.pi, math.pi, 721)
        directions = np.column_stack((np.cos(angles), np.sin(angles)))
        hits = worlds.Caster(things).cast((0.1, -0.2), directions)
        for i, thing in enumerate(things):
            own = hits.thing == i
            self.assertGreater(own.sum(), 20)
            points = (0.1, -0.2) + hits.range_m[own, None] * directions[own]
            np.testing.assert_allclose(thing.at(hits.arc_m[own]), points, atol=1e-9)

    def test_the_nearest_of_all_edges_is_hit_from_many_places_in_any_direction(self):
        """Against all rays with all edges."""
        chance = np.random.default_rng(5)
        things = [worlds.Thing(f"box_{i}", "box", "card", worlds.placed(worlds.rectangle(*chance.uniform(0.2, 2.0, 2)),
                                                                        *chance.uniform(-3.0, 3.0, 2), i))
                  for i in range(12)]
        caster = worlds.Caster(things)
        for spread_m in (0.0, 0.02, 1.0):
            angles = chance.uniform(-4.0, 4.0, 300)
            directions = np.column_stack((np.cos(angles), np.sin(angles)))
            origins = chance.uniform(-spread_m, spread_m, (300, 2))
            expected = np.full(300, np.inf)
            for outline in (thing.outline for thing in things):
                for start, end in zip(outline, np.roll(outline, -1, axis=0)):
                    for k in range(300):
                        matrix = np.column_stack((directions[k], start - end))
                        t, u = np.linalg.solve(matrix, start - origins[k])
                        if 0.0 <= u <= 1.0 and t > 0.0:
                            expected[k] = min(expected[k], t)
            hits = caster.cast(origins, directions)
            np.testing.assert_allclose(hits.range_m, expected, rtol=1e-9)
            np.testing.assert_array_equal(hits.thing >= 0, np.isfinite(expected))

    def test_rays_from_different_places(self):
        wall = worlds.Thing("wall", "walls", "plaster", ((2.0, -1.0), (2.0, 1.0), (2.1, 1.0), (2.1, -1.0)))
        hits = worlds.Caster([wall]).cast(np.array(((0.0, 0.0), (1.0, 0.5))), np.array(((1.0, 0.0), (1.0, 0.0))))
        np.testing.assert_allclose(hits.range_m, (2.0, 1.0))


class Scanning(unittest.TestCase):
    def measured(self, things, count=200):
        """Many scans from (0, 0)."""
        angles = worlds.ANGLE_MIN_RAD + worlds.ANGLE_INCREMENT_RAD * np.arange(worlds.BEAMS)
        rays = (angles[:, None] + worlds.FOOTPRINT_RAD).ravel()
        hits = worlds.Caster(things).cast((0.0, 0.0), np.column_stack((np.cos(rays), np.sin(rays))))
        chance = np.random.default_rng(1)
        return [worlds.measure(chance, [worlds.MATERIALS[thing.material] for thing in things], hits)
                for _ in range(count)]

    def test_noise_is_12_mm_and_diffuse_things_are_below_400(self):
        wall = worlds.Thing("wall", "walls", "ceramic", ((3.0, -4.0), (3.0, 4.0), (3.1, 4.0), (3.1, -4.0)))
        scans = self.measured([wall])
        ahead = np.array([scan.range_m[270] for scan in scans])
        ahead = ahead[np.isfinite(ahead)]
        self.assertAlmostEqual(ahead.std(), 0.012, delta=0.003)
        self.assertAlmostEqual(ahead.mean(), 3.0, delta=0.003)
        self.assertLess(max(scan.intensity.max() for scan in scans), 400.0)

    def test_a_beam_over_an_edge_may_give_a_range_between(self):
        things = [worlds.Thing("wall", "walls", "plaster", ((3.0, -4.0), (3.0, 4.0), (3.1, 4.0), (3.1, -4.0))),
                  worlds.Thing("box", "box", "plaster", ((2.0, 0.001), (2.0, 1.0), (2.1, 1.0), (2.1, 0.001)))]
        scans = self.measured(things)
        at_edge = np.array([scan.range_m[270] for scan in scans])
        between = (at_edge > 2.1) & (at_edge < 2.9)
        self.assertGreater(between.mean(), 0.3)
        for scan, mixed in zip(scans, between):
            if mixed:
                self.assertEqual(scan.thing[270], -1)
        off_edge = np.array([scan.range_m[280] for scan in scans])
        self.assertLess(np.abs(off_edge[np.isfinite(off_edge)] - 2.0 / math.cos(math.radians(5.0))).max(), 0.07)

    def test_reflectors_are_bright(self):
        scans = self.measured([worlds.Thing("r", "reflector", "reflector", circle=(3.0, 0.0, 0.05))], 20)
        self.assertGreater(np.mean([scan.intensity[270] for scan in scans]), 800.0)


class Worlds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.simulation = worlds.Simulation(small_world(), sweep=True)
        cls.scans, cls.document = run_simulation(cls.simulation)
        cls.truth = polygons.Truth(cls.document)

    def test_the_same_seed_gives_the_same(self):
        scans, document = run_simulation(worlds.Simulation(small_world(), sweep=True))
        self.assertEqual(document, self.document)
        for (stamp, _, a), (other_stamp, _, b) in zip(scans, self.scans):
            self.assertEqual(stamp, other_stamp)
            np.testing.assert_array_equal(a.range_m, b.range_m)
            np.testing.assert_array_equal(a.intensity, b.intensity)
        (_, _, other), *_ = worlds.Simulation(small_world(seed=2), sweep=True).scans()
        self.assertFalse(np.array_equal(other.range_m, self.scans[0][2].range_m))

    def test_each_world_can_be_made_and_nothing_stands_in_another_or_in_the_way(self):
        for name in worlds.WORLDS:
            for seed in (1, 2, 3, 4):
                world = worlds.make_world(name, seed)
                self.assertGreater(world.way.length_m, 10.0)
                self.assertLess(world.way.length_m, 13.0)
                self.assertEqual(len({thing.id for thing in world.things}), len(world.things))
                way, _ = world.way.at(np.linspace(0.0, world.way.length_m, 400))
                for thing in world.things:
                    self.assertGreater(np.hypot(*(thing.outline[:, None] - way).transpose(2, 0, 1)).min(), 0.5)
                solid = [thing for thing in world.things if thing.kind not in ("walls", "screen")]
                for transit in range(worlds.TRANSITS):
                    here = [thing for thing in solid if transit in thing.present]
                    for i, thing in enumerate(here):
                        for other in here[:i]:
                            a, b = thing.bin_centres(), other.bin_centres()
                            self.assertGreater(np.hypot(*(a[:, None] - b).transpose(2, 0, 1)).min(), 0.03,
                                               (name, seed, thing.id, other.id))

    def test_what_was_seen_is_in_sight_of_the_way(self):
        ids = [thing["id"] for thing in self.document["things"]]
        stays = self.document["things"][ids.index("stays")]
        bins = self.truth.bins_of(ids.index("stays"))
        y = self.truth.centres[bins][:, 1]
        seen = ~np.isnan(self.truth.seen_s[bins])
        self.assertTrue(seen[y < 0.86].mean() > 0.9)  # its face towards the way
        self.assertFalse(seen[y > 1.1499].mean() > 0.1)  # its back
        self.assertEqual(stays["free_s"], [None] * len(stays["free_s"]))
        self.assertTrue(all(value is None or value >= self.document["transits"][1][0]
                            for value in self.document["things"][ids.index("comes")]["seen_s"]))

    def test_what_has_gone_is_seen_to_be_free_but_not_before(self):
        goes = next(thing for thing in self.document["things"] if thing["id"] == "goes")
        free = [value for value in goes["free_s"] if value is not None]
        self.assertGreater(len(free), 0.5 * len(goes["free_s"]))
        self.assertGreater(min(free), self.document["transits"][1][0])
        self.assertTrue(goes["passed"])

    def test_a_walker_is_no_standing_thing(self):
        self.assertFalse(any("walk" in thing["id"] or thing["kind"] in ("person", "walker")
                             for thing in self.document["things"]))
        places = [place for place in self.document["scans"]["walker"] if place]
        self.assertGreater(len(places), 20)
        transits = {transit for transit, place in zip(self.document["scans"]["transit"],
                                                      self.document["scans"]["walker"]) if place}
        self.assertEqual(transits, {1})
        # The walker's hits are of no thing: of the scans with it more beams are, that have a range all the same.
        of_none = [((scan.thing >= 5 + (transit > 0)) | (scan.thing < 0)) & np.isfinite(scan.range_m)
                   for _, transit, scan in self.scans]
        with_walker = np.array([place is not None for place in self.document["scans"]["walker"]])
        counts = np.array([mask.sum() for mask in of_none])
        self.assertGreater(counts[with_walker].mean(), counts[~with_walker].mean() + 3)

    def test_odometry_drifts_but_not_far(self):
        stamps, poses, _, variance, yaw_variance = self.simulation.odometry
        true = self.simulation.drive.at(stamps)
        moved = worlds.composed(worlds.inverse(true[0]), true)
        error = np.hypot(*(moved - poses)[:, :2].T)
        self.assertGreater(error.max(), 0.003)
        self.assertLess(error.max(), 0.5)
        self.assertTrue((np.diff(variance) >= 0.0).all() and (np.diff(yaw_variance) >= 0.0).all())

    def test_an_initial_pose_is_good_to_its_bounds(self):
        for seed in range(20):
            simulation = worlds.Simulation(small_world(seed=seed, transits=1))
            error = simulation.initial_pose - simulation.drive.at(worlds.BEGIN_S)
            self.assertLessEqual(math.hypot(*error[:2]), worlds.INITIAL_M)
            self.assertLessEqual(abs(error[2]), worlds.INITIAL_RAD)
        self.assertIsNone(worlds.Simulation(small_world(), with_initial_pose=False).initial_pose)

    def test_a_sweep_casts_each_beam_at_its_time(self):
        """In 30 ms at 0.5 m/s the robot drives 15 mm, half of them until the beams that look ahead."""
        simulation, beams = self.simulation, np.arange(200, 341)
        caster = worlds.Caster([thing for thing in simulation.world.things if 0 in thing.present])
        residuals = {True: [], False: []}  # by whether each beam's time is heeded
        for stamp_s, transit, scan in self.scans[40:80]:
            self.assertEqual(transit, 0)
            for heeded, found in residuals.items():
                times = stamp_s + heeded * simulation.time_increment_s * beams
                poses = worlds.composed(simulation.drive.at(times), np.array(simulation.world.mount))
                heading = poses[:, 2] + worlds.ANGLE_MIN_RAD + worlds.ANGLE_INCREMENT_RAD * beams
                hits = caster.cast(poses[:, :2], np.column_stack((np.cos(heading), np.sin(heading))))
                found += (scan.range_m[beams] - hits.range_m).tolist()
        self.assertAlmostEqual(np.median(residuals[True]), 0.0, delta=0.001)
        self.assertAlmostEqual(np.median(residuals[False]), -0.0075, delta=0.002)

    @unittest.skipUnless(rosbag, "no python3-rosbag")
    def test_a_bag_has_the_scans_and_the_true_transforms(self):
        with tempfile.TemporaryDirectory() as folder:
            paths = [pathlib.Path(folder) / name for name in ("a.bag", "a_tf.bag")]
            simulation = worlds.Simulation(small_world(transits=1), sweep=True)
            writer = worlds.BagWriter(simulation, *paths)
            writer.write_all()
            writer.close()
            for path, frames in zip(paths, ({("odom", "base_link")}, {("odom", "base_link"), ("map", "odom")})):
                with rosbag.Bag(str(path)) as bag:
                    scans = [message for _, message, _ in bag.read_messages("/scan")]
                    transforms = {(t.header.frame_id, t.child_frame_id)
                                  for _, message, _ in bag.read_messages("/tf") for t in message.transforms}
                    (mount,) = [message.transforms[0] for _, message, _ in bag.read_messages("/tf_static")]
                stamps = [scan.header.stamp.to_sec() for scan in scans]
                np.testing.assert_allclose(stamps, simulation.truth()["scans"]["stamp"], atol=1e-6)
                self.assertEqual(transforms, frames)
                self.assertEqual((mount.header.frame_id, mount.child_frame_id), ("base_link", "laser"))
                self.assertEqual({len(scan.ranges) for scan in scans}, {worlds.BEAMS})
                self.assertAlmostEqual(scans[0].time_increment * (worlds.BEAMS - 1), worlds.SWEEP_S, places=6)
                self.assertTrue(all(value == math.inf or value <= worlds.RANGE_MAX_M
                                    for scan in scans[:20] for value in scan.ranges))


    @unittest.skipUnless(rosbag, "no python3-rosbag")
    def test_odometry_alone_is_true_at_the_beginning_of_each_transit(self):
        with tempfile.TemporaryDirectory() as folder:
            directory = pathlib.Path(folder)
            with mock.patch.dict(worlds.MAKERS, corridor=small_world):
                name = worlds.write_world(directory, "corridor", 1, transits=2)
            worlds.write_odometry_bag(directory, name)
            spans = json.loads((directory / f"{name}.truth.json").read_text())["transits"]

            def corrections(end):
                with rosbag.Bag(str(directory / f"{name}{end}.bag")) as bag:
                    found = [message.transforms[0] for _, message, _ in bag.read_messages("/tf")]
                    scans = bag.get_message_count("/scan")
                return {own.header.stamp.to_sec(): (own.transform.translation.x, own.transform.translation.y,
                                                    own.transform.rotation.z) for own in found}, scans

            (true, scans), (held, held_scans) = corrections("_tf"), corrections("_odometry")
            self.assertEqual(set(true), set(held))
            self.assertEqual(scans, held_scans)
            stamps = np.array(sorted(true))
            self.assertGreater(len({true[stamp_s] for stamp_s in stamps}), 100)
            for begin_s, end_s in spans:
                own = stamps[(stamps >= begin_s) & (stamps < end_s)]
                self.assertEqual({held[stamp_s] for stamp_s in own}, {true[own[0]]})

    def test_a_world_in_some_of_its_transits(self):
        whole = worlds.make_world("corridor", 2)
        short = worlds.only_transits(whole, worlds.SHORT)
        self.assertEqual(short.transits, len(worlds.SHORT))
        self.assertEqual(set(short.walks), set(range(len(worlds.SHORT))))
        present = {thing.id: thing.present for thing in short.things}
        for thing in whole.things:
            expected = tuple(k for k, transit in enumerate(worlds.SHORT) if transit in thing.present)
            self.assertEqual(present.get(thing.id, ()), expected)
        self.assertEqual(present["box_appears"][0], 1)
        self.assertEqual((present["hidden_goes"], present["screen"]), ((0, 1), (1, 2)))  # it goes behind the screen


def moved(line, angle, dx, dy):
    return worlds.placed(line, dx, dy, angle)


class Associations(unittest.TestCase):
    STEPS = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (2.0, 0.5)))

    def test_the_clipped_distance_is_that_of_what_both_have(self):
        along = np.array(((0.0, 0.0), (2.0, 0.0)))
        beside = np.array(((1.0, 0.03), (3.0, 0.03)))  # overhangs on one side
        self.assertAlmostEqual(associations.clipped_distance(along, beside), 0.03)
        self.assertAlmostEqual(associations.clipped_distance(beside, along), 0.03)
        self.assertGreater(associations.printed_distance(along, beside), 0.9)  # as printed it is the overhang
        self.assertEqual(associations.clipped_distance(along, along + (2.05, 0.0)), math.inf)  # end to end
        corner = np.array(((2.0, 0.0), (2.0, 1.0)))
        self.assertEqual(associations.clipped_distance(along, corner), math.inf)

    def test_distances_are_symmetric_and_invariant(self):
        part = associations.cut(self.STEPS, 0.3, 2.2) + (0.0, 0.02)
        for metric in (associations.clipped_distance, associations.printed_distance):
            expected = metric(self.STEPS, part)
            self.assertAlmostEqual(metric(part, self.STEPS), expected, delta=1e-9)
            self.assertAlmostEqual(metric(moved(self.STEPS, 0.7, 3.0, -2.0), moved(part, 0.7, 3.0, -2.0)), expected,
                                   delta=1e-9)
            self.assertAlmostEqual(metric(self.STEPS, self.STEPS), 0.0, delta=1e-9)
        self.assertLess(associations.clipped_distance(self.STEPS, part), 0.03)

    def test_similarity_is_of_shape_alone(self):
        self.assertAlmostEqual(associations.similarity(self.STEPS, moved(2.0 * self.STEPS, 1.1, 4.0, 5.0)), 0.0)
        self.assertAlmostEqual(associations.similarity(self.STEPS[:2], moved(self.STEPS[:2], 0.5, 0.0, 9.0)), 0.0)
        bent = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))  # 0 and a right angle, of equal length: variance
        self.assertAlmostEqual(associations.similarity(np.array(((0.0, 0.0), (2.0, 0.0))), bent), (math.pi / 4)**2)
        twice = np.array(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)))
        self.assertAlmostEqual(associations.similarity(np.array(((0.0, 0.0), (2.0, 0.0))), twice),
                               2.0 * (math.pi / 4)**2)

    def test_forced_pairs_are_the_cheapest_path(self):
        def paths(i, j, rows, columns):
            if (i, j) == (rows - 1, columns - 1):
                yield [(i, j)]
            for di, dj in ((1, 0), (0, 1), (1, 1)):
                if i + di < rows and j + dj < columns:
                    for rest in paths(i + di, j + dj, rows, columns):
                        yield [(i, j), *rest]

        chance = np.random.default_rng(1)
        for rows, columns in itertools.product((1, 2, 4), (1, 3, 4)):
            costs = chance.random((rows, columns))
            best = min(sum(costs[pair] for pair in path) for path in paths(0, 0, rows, columns))
            found = associations.forced_pairs(costs)
            self.assertAlmostEqual(sum(costs[pair] for pair in found), best)
            self.assertEqual((found[0], found[-1]), ((0, 0), (rows - 1, columns - 1)))

    def test_pairs_with_gaps_are_the_cheapest_in_order(self):
        """Against all sets of pairs in order."""
        def cost_of(pairs, costs, gap):
            alone = sum(set(range(n)).difference(pair[axis] for pair in pairs).__len__()
                        for axis, n in enumerate(costs.shape))
            return sum(costs[pair] for pair in pairs) + gap * alone

        chance = np.random.default_rng(2)
        for _ in range(20):
            costs = chance.random((3, 3)) * 3.0
            costs[chance.random((3, 3)) < 0.3] = np.inf
            everything = [pair for pair in itertools.product(range(3), range(3)) if np.isfinite(costs[pair])]
            best = math.inf
            for count in range(len(everything) + 1):
                for pairs in itertools.combinations(everything, count):
                    if all((a[0] <= b[0] and a[1] <= b[1]) for a, b in zip(pairs, pairs[1:])):
                        best = min(best, cost_of(pairs, costs, 1.0))
            found = associations.pairs_with_gaps(costs, 1.0)
            self.assertTrue(all(np.isfinite(costs[pair]) for pair in found))
            self.assertAlmostEqual(cost_of(found, costs, 1.0), best)

    def test_polylines_of_a_scan_are_of_their_things(self):
        simulation = worlds.Simulation(small_world(transits=1))
        stamp_s, _, scan = list(simulation.scans())[50]
        pose = worlds.composed(simulation.drive.at(stamp_s), np.array(simulation.world.mount))
        here = [i for i, thing in enumerate(simulation.world.things) if 0 in thing.present]
        found = associations.polylines_of(scan, np.array(here + [-1])[scan.thing], pose, polygons.simplified)
        self.assertGreater(len(found), 3)
        self.assertIn(1, [own.thing for own in found])  # the box that stays
        for own in found:
            if own.thing >= 0:
                outline = simulation.world.things[own.thing].outline
                away_m = associations.project(own.points, np.vstack((outline, outline[:1])))[0]
                self.assertLess(away_m.max(), 0.06)


class Geometry(unittest.TestCase):
    def test_fewest_vertices(self):
        line = np.column_stack((np.linspace(0.0, 2.0, 50), np.zeros(50)))
        self.assertEqual(polygons.fewest_vertices(line, False), 2)
        corner = np.vstack((line, np.column_stack((np.full(50, 2.0), np.linspace(0.02, 1.0, 50)))))
        self.assertEqual(polygons.fewest_vertices(corner, False), 3)
        square = worlds.Thing("s", "box", "card", worlds.rectangle(1.0, 1.0))
        ring = np.vstack((square.outline, square.bin_centres()))
        ring = ring[np.argsort(np.arctan2(ring[:, 1], ring[:, 0]))]
        self.assertEqual(polygons.fewest_vertices(np.roll(ring, -7, axis=0), True), 4)

    def test_samples_are_of_the_chains_length(self):
        chains = polygons.chains_of({"polylines": [polyline(((0, 0), (1, 0), (1, 1)), 1), polyline(
            ((0, 0), (1, 0), (1, 1)), 2, closed=True), polyline(((0, 0),), 3), polyline((), 4)]})
        samples = polygons.samples_of(chains)
        lengths = np.bincount(samples.chain, samples.length_m, minlength=4)
        np.testing.assert_allclose(lengths, (2.0, 2.0 + math.sqrt(2.0), 0.0, 0.0))
        self.assertLessEqual(samples.length_m.max(), polygons.SAMPLE_M + 1e-12)

    def test_parts_that_were_seen(self):
        document = {"things": [{"id": "a", "kind": "box", "optional": False, "circle": None, "present": [0],
                                "outline": [[0, 0], [1, 0], [1, 1], [0, 1]], "first_s": [None] * 400,
                                "seen_s": [None] * 400, "first_free_s": [None] * 400, "free_s": [None] * 400}],
                    "transits": [[0.0, 1.0]], "scans": {"stamp": [0.0, 0.04], "transit": [0, 0], "x": [0, 0],
                                                        "y": [0, 0], "yaw": [0, 0], "reflectors_in_sight": [0, 0],
                                                        "walker": [None, None]}}
        truth = polygons.Truth(document)
        seen = np.zeros(400, bool)
        seen[:50] = seen[55:80] = seen[200:300] = seen[390:] = True
        self.assertEqual(truth.seen_parts(0, seen), [[200, 299], [390, 479]])
        self.assertIsNone(truth.seen_parts(0, np.ones(400, bool)))
        points = truth.part_points(0, [390, 479])
        np.testing.assert_allclose(points[[0, -1]], ((0.0, 0.1), (0.8, 0.0)), atol=1e-9)
        self.assertTrue((np.hypot(*points.T) < 1e-9).any())  # with its corner


class Scores(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        _, document = run_simulation(worlds.Simulation(small_world()))
        cls.document = document
        cls.truth = polygons.Truth(document)
        cls.perfect = score(cls.truth)
        cls.group = polygons.Group([cls.perfect])

    def of(self, change):
        return polygons.Group([score(self.truth, change=lambda polylines, scan: change(polylines))])

    def test_a_perfect_map(self):
        self.assertEqual((self.group.precision, self.group.recall), (1.0, 1.0))
        self.assertGreater(self.group.coverage, 0.999)
        self.assertLess(self.group.greatest_m, 1e-3)
        self.assertEqual(self.group.false_m, 0.0)
        self.assertEqual(self.group.id_stability, 1.0)
        self.assertLess(self.group.ids_per_object, 1.01)
        self.assertEqual((self.group.lost_things, self.group.left_by_persons), (0, 0))
        self.assertEqual(self.perfect.reused_ids, 0)
        self.assertLess(self.group.added_95_s, 0.5)
        self.assertLess(self.group.removed_95_s, 0.3)
        self.assertEqual(self.group.position_m, 0.0)
        self.assertIn("goes", self.perfect.removed_s)
        self.assertIn("comes", self.perfect.added_s)

    def test_a_shifted_map_has_its_shift(self):
        """Walls along x are off by dy, those along y by nothing."""
        walls = polygons.Group([polygons.score(self.truth, oracle(self.truth, lambda polylines, _: shifted(
            [found for found in polylines if found["id"] < 100], dy=0.03)))])
        self.assertAlmostEqual(walls.greatest_m, 0.03, delta=1e-6)
        self.assertLess(walls.mean_m, 0.03)
        self.assertEqual(walls.precision, 1.0)
        self.assertLess(self.of(lambda polylines: shifted(polylines, dx=0.5, dy=0.5)).precision, 0.6)

    def test_a_missing_thing_lowers_recall(self):
        group = self.of(lambda polylines: [found for found in polylines if not 100 <= found["id"] < 200])  # "stays"
        standing = self.perfect.last.things
        self.assertAlmostEqual(group.recall, (standing - 1) / standing)
        self.assertEqual(group.runs[0].last.missed, ["stays"])
        self.assertLess(group.coverage, self.group.coverage)
        self.assertEqual(group.runs[0].added_s["stays"], math.inf)
        self.assertEqual(group.precision, 1.0)

    def test_an_extra_chain_is_false(self):
        extra = polyline(((1.0, -0.6), (1.5, -0.6)), 999)
        group = self.of(lambda polylines: polylines + [extra])
        self.assertAlmostEqual(group.false_m, 0.5, places=6)
        self.assertLess(group.precision, 1.0)
        self.assertLess(group.greatest_m, 1e-3)  # it is of no matched chain

    def test_a_chain_that_goes_too_far_counts_in_the_greatest_distance(self):
        def change(polylines):
            if not polylines:
                return polylines
            *rest, last = polylines
            x, y = last["points"][-1]
            return [*rest, polyline((*last["points"], (x - 0.3, y)), last["id"])]

        self.assertFalse(seen_chains(self.truth, self.truth.stamps[-1], {})[-1]["closed"])
        self.assertGreater(self.of(change).greatest_m, 0.1)

    def test_reflectors_may_be_on_the_map(self):
        reflector = self.truth.shapes[-1]
        group = self.of(lambda polylines: polylines + [polyline(reflector.outline, 999, True)])
        self.assertEqual((group.precision, group.false_m), (1.0, 0.0))

    def test_what_stays_after_it_was_seen_to_be_gone_is_false(self):
        stays = {}

        def change(polylines):
            for found in polylines:
                if 200 <= found["id"] < 300:  # "goes"
                    stays.setdefault(found["id"], found)
            kept = [found for id_, found in stays.items() if id_ not in [other["id"] for other in polylines]]
            return [stays.get(found["id"], found) for found in polylines] + kept

        group = self.of(change)
        self.assertGreater(group.false_m, 0.3)
        self.assertEqual(group.runs[0].removed_s["goes"], math.inf)

    def test_what_is_removed_while_it_stands_or_is_hidden_is_lost(self):
        begin = self.truth.transits[1][0]

        def change(polylines, scan):
            return [found for found in polylines if self.truth.stamps[scan] < begin or not 100 <= found["id"] < 200]

        run = score(self.truth, change=change)
        self.assertEqual(run.lost, [(1, "stays")])

    def test_changes_are_counted_once(self):
        self.assertEqual(self.perfect.changes.appeared, {"comes": True})
        self.assertEqual(self.perfect.changes.gone, {"goes": True})
        self.assertEqual((self.group.change_precision, self.group.change_recall), (1.0, 1.0))
        self.assertEqual(self.group.persons_greatest_m, 0.0)
        self.assertLess(self.group.known_95_s, 0.6)
        without = self.of(lambda polylines: [found for found in polylines if not 300 <= found["id"] < 400])  # "comes"
        self.assertEqual(without.runs[0].changes.missed, ["comes"])
        self.assertEqual((without.change_precision, without.change_recall), (1.0, 0.5))
        self.assertEqual(without.runs[0].known_s["comes"], math.inf)
        extra = polyline(((1.0, -0.6), (1.5, -0.6)), 999)
        false = self.of(lambda polylines: polylines + [extra])
        self.assertEqual(false.runs[0].changes.wrong, [(0, 999)])
        self.assertAlmostEqual(false.change_precision, 2 / 3)
        kept = {}

        def keep(polylines, scan):
            goes = {found["id"]: found for found in polylines if 200 <= found["id"] < 300}
            if self.truth.transit_of_scan[scan] == 0:
                kept.update(goes)
            return [found for found in polylines if found["id"] not in goes] + list(kept.values())

        still_there = polygons.Group([score(self.truth, change=keep)])
        self.assertEqual(still_there.runs[0].changes.gone, {"goes": False})
        self.assertLess(still_there.change_precision, 0.6)

    def test_transits_with_a_person_are_told_from_the_others(self):
        self.assertEqual([self.truth.has_person(transit) for transit in range(TRANSITS)], [False, True, False])
        self.assertEqual([len(self.group.over_transits(which)[0]) for which in (None, True, False)], [3, 1, 2])

    def test_poses_with_three_reflectors_in_sight(self):
        truth = polygons.Truth(self.document)
        truth.in_sight_of_scan = np.where(np.arange(len(truth.stamps)) % 2, 3, 2)
        group = polygons.Group([score(truth, pose_error=(0.003, -0.004, 0.001))])
        self.assertAlmostEqual(group.three_position_m, 0.004)
        self.assertAlmostEqual(group.three_yaw_rad, 0.001)
        self.assertAlmostEqual(group.three_sigma_m, 0.001)
        self.assertEqual(group.nees_inside, 0.0)
        truth.in_sight_of_scan[:] = 2
        self.assertTrue(math.isnan(polygons.Group([score(truth)]).three_position_m))

    def test_what_a_person_leaves(self):
        walker = np.array([place for place in self.truth.walker if place])
        place = walker[len(walker) // 2]
        left = polyline((place - (0.1, 0.0), place + (0.1, 0.0)), 999)
        begin = self.truth.transits[1][0]
        run = score(self.truth, change=lambda polylines, scan: polylines + [left] * bool(
            self.truth.stamps[scan] > begin + 0.5))
        self.assertEqual(run.persons.ids, {999})
        self.assertAlmostEqual(run.persons.greatest_m, 0.2, places=6)

    def test_new_ids_are_not_stable_and_two_chains_on_a_thing_are_two(self):
        def renamed(polylines, scan):
            return [{**found, "id": found["id"] + 1000 * int(self.truth.transit_of_scan[scan])} for found in polylines]

        def halved(polylines):
            found = []
            for one in polylines:
                points = np.array(one["points"])
                if one["closed"]:
                    points = np.vstack((points, points[:1]))
                middle = (points[0] + points[1]) / 2 if len(points) == 2 else points[len(points) // 2]
                k = 1 if len(points) == 2 else len(points) // 2
                found += [polyline((*points[:k], middle), one["id"]), polyline((middle, *points[k:]), one["id"] + 5000)]
            return found

        self.assertEqual(polygons.Group([score(self.truth, change=renamed)]).id_stability, 0.0)
        self.assertGreater(self.of(halved).ids_per_object, 1.7)
        twice = score(self.truth, change=lambda polylines, _: polylines + polylines[:1])
        self.assertGreater(twice.reused_ids, 0)

    def test_vertices_and_their_sigma(self):
        def dense(polylines):
            """With a vertex in the middle of each edge."""
            found = []
            for one in polylines:
                points = np.array(one["points"])
                between = np.vstack((points, points[:1])) if one["closed"] else points
                middle = (between[:-1] + between[1:]) / 2
                rows = np.empty((len(points) + len(middle), 2))
                rows[0::2], rows[1::2] = points, middle
                found.append(polyline(rows, one["id"], one["closed"]))
            return found

        self.assertGreater(self.of(dense).vertices_ratio, 1.5 * self.group.vertices_ratio)
        chance = np.random.default_rng(3)

        def noisy(polylines):
            found = dense(dense(polylines))
            return [{**one, "points": (np.array(one["points"]) + chance.normal(0.0, 0.01, (len(one["points"]), 2)))
                     .tolist()} for one in found]

        self.assertAlmostEqual(self.of(noisy).vertex_ratio_low, 1.0, delta=0.2)

    def test_pose_errors_are_rms_of_each_axis(self):
        group = polygons.Group([score(self.truth, pose_error=(0.003, -0.004, 0.001))])
        self.assertAlmostEqual(group.x_m, 0.003)
        self.assertAlmostEqual(group.position_m, 0.004)
        self.assertAlmostEqual(group.yaw_rad, 0.001)
        self.assertAlmostEqual(group.nees, 9.0 + 16.0 + 1.0, places=4)

    def test_the_regions_of_poses_are_a_target_beside_their_mean_nees(self):
        for pose_error, inside in (((0.0, 0.0, 0.0), True), ((0.003, -0.004, 0.001), False)):
            group = polygons.Group([score(self.truth, pose_error=pose_error)])
            met = {what: met for what, _, met in polygons.targets({("corridor", polygons.CHANGES): group})}
            [regions] = [what for what in met if "95 % regions" in what]
            [mean] = [what for what in met if what.startswith("mean NEES")]
            self.assertEqual((met[regions], met[mean]), (inside, False))

    def test_a_map_of_nothing_and_a_tool_that_says_nothing(self):
        group = self.of(lambda polylines: [])
        self.assertEqual((group.recall, group.coverage), (0.0, 0.0))
        self.assertTrue(math.isnan(group.precision))
        self.assertFalse(all(met for _, _, met in polygons.targets({("corridor", "plain"): group})))
        with self.assertRaises(ValueError):
            polygons.score(self.truth, iter(()))

    def test_tables_and_pictures(self):
        groups = polygons.groups_of([self.perfect])
        verdicts = list(polygons.targets(groups))
        self.assertEqual(len(verdicts), len(polygons.TARGETS + polygons.TABLE_TARGETS))
        for text in (polygons.map_table(groups), polygons.paper_table(groups), polygons.change_table(groups),
                     polygons.pose_table(groups), polygons.run_table([self.perfect])):
            self.assertIn("corridor" if "oracle" not in text else "oracle", text)
        with tempfile.TemporaryDirectory() as folder:
            polygons.draw([self.perfect], pathlib.Path(folder))
            self.assertTrue((pathlib.Path(folder) / "polygons_corridor.png").exists())


def world_of_eight(name):
    """The maker of a small world that has the transits of the others."""
    def make(seed, transits):
        world = small_world(seed, transits)
        spread = {0: (0, 1, 2), 1: (3, 4), 2: (5, 6, 7)}
        return dataclasses.replace(world, name=name, walks={3: world.walks[1]}, things=[
            dataclasses.replace(thing, present=tuple(k for own in thing.present for k in spread.get(own, ())))
            for thing in world.things])

    return make


def answer(command):
    """Of the programs that the evaluation runs: the tool's map is the truth."""
    program = pathlib.Path(command[0]).name
    words = [str(word) for word in command]
    if program == "polygons_bag":
        name = words[1].removesuffix(".bag").removesuffix("_tf")
        truth = polygons.Truth(json.loads(pathlib.Path(f"{name}.truth.json").read_text()))
        lines = [json.dumps(line) for line in oracle(truth)]
        pathlib.Path(words[words.index("--out") + 1]).write_text("\n".join(lines))
        return "260 scans, 260 mapped\neach: p50 0.512 ms, p99 0.733 ms, max 1.2 ms\n"
    if program == "safety_transits":
        walkers = {"runs": 5, "arrived": 5, "touched": 0, "least_clearance_m": 0.3, "mean_s": 23.0}
        return json.dumps({policy: {
            "boxes": {"runs": 1, "mean_s": mean_s, "least_s": mean_s, "most_s": mean_s, "saved": 1.0 - mean_s / 60.0},
            "walkers": walkers, "walkers_behind_a_box": walkers}
            for policy, mean_s in (("conservative", 60.0), ("updated", 55.0), ("ignore_known", 27.0))})
    names = {"polygon_map_benchmark": {f"{name}/{chains}/iterations:500": 0.5 + 0.004 * chains for chains in
                                       (40, 250, 500) for name in ("from_scan_to_map", "from_scan_to_both_maps")},
             "reflector_localization_benchmark": {"filter/3": 0.02, "from_scan/3": 0.05}}[program]
    return json.dumps({"benchmarks": [{"name": name, "run_type": "iteration", "cpu_time": 1000.0 * time_ms,
                                       "time_unit": "us", **({"p50_us": 900.0 * time_ms, "p99_us": 5000.0 * time_ms}
                                                             if "both" in name else {})}
                                      for name, time_ms in names.items()]})


class NoBags:
    def __init__(self, simulation, *paths):
        self.simulation = simulation

    def write_all(self):
        for _ in self.simulation.scans():
            pass

    def close(self):
        pass


class WholeEvaluation(unittest.TestCase):
    def test_a_quick_look_writes_a_report_with_all_its_parts(self):
        """Of a small world whose map is the truth; the programs' answers are told."""
        with tempfile.TemporaryDirectory() as folder, \
                mock.patch.dict(worlds.MAKERS, corridor=world_of_eight("corridor")), \
                mock.patch.object(worlds, "BagWriter", NoBags), mock.patch.object(polygons, "run_tool", answer), \
                mock.patch("sys.stdout"):
            polygons.main(["--tool", "polygons_bag", "--programs", "build", "--output", folder, "--quick", "--worlds",
                           "corridor", "--variants", "plain", "--changes", "1"])
            text = (pathlib.Path(folder) / "polygons.md").read_text()
            for part in ("**A part only**", "## Targets", "## The map", "## Table 1 of the paper", "a person",
                         "## What changes, in 1 runs", "Fig. 5", "## The paper's metric", "as printed",
                         "## Transit time under the policies", "ignore known", "## Cost", "0.51 / 0.73"):
                self.assertIn(part, text)
            self.assertNotIn(str(folder), text.replace("--output " + folder, ""))
            self.assertRegex(text, r'"updated" saves at least 15 % .* \| 8.3 % \| \*\*no\*\*')
            self.assertRegex(text, r"objects, 40 chains, .* \| 0.59 ms, 3.30 ms \| \*\*no\*\*")
            self.assertRegex(text, r"does not grow with the map: with 500 chains, .* \| 3.79 \| \*\*no\*\*")
            self.assertRegex(text, r"reflector EKF at most .* \| 0.020 ms \| yes")
            self.assertRegex(text, r"changes: recall at least 0.97 \| 1.000 .* \| yes")
            for name in [line.split("](")[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]:
                self.assertTrue((pathlib.Path(folder) / name).exists(), name)


if __name__ == "__main__":
    unittest.main(verbosity=2)
