#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/evaluate shapes: its measures of maps whose errors are known, and the truth of its worlds."""
import math
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/evaluation"))
import shape_worlds  # noqa: E402
import shapes  # noqa: E402

PERIOD_S = 0.1


def placed(points, x, y, yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    return [[x + c * px - s * py, y + s * px + c * py] for px, py in points]


def box(name="box_1", x=2.0, y=1.0, yaw=0.3, length=0.8, width=0.4, sides=("front",), hits=20, **motion):
    """With hits from end to end of its sides: front is a long one, end a short one."""
    a, b = length / 2, width / 2
    along = np.linspace(-1.0, 1.0, hits)
    seen = []
    for side in sides:
        seen += [(a * part, -b) for part in along] if side == "front" else [(-a, b * part) for part in along]
    corners = ((-a, -b), (a, -b), (a, b), (-a, b))
    return {"name": name, "kind": name.rstrip("_0123456789"), "x": x, "y": y, "yaw": yaw, "length": length,
            "width": width, "vx": 0.0, "vy": 0.0, "wz": 0.0, **motion,
            "parts": [{"outline": placed(corners, x, y, yaw), "hits": placed(seen, x, y, yaw)}]}


def person(name="person_1", x=2.0, y=1.0, hits=10):
    legs = [{"outline": placed(((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)), x, y + dy, 0.0),
             "hits": [[x - 0.05, y + dy]] * (hits // 2)} for dy in (-0.1, 0.1)]
    return {"name": name, "kind": "person", "x": x, "y": y, "yaw": 0.0, "length": 0.1, "width": 0.3, "vx": 0.0,
            "vy": 0.0, "wz": 0.0, "parts": legs}


def element_of(thing, id_=7, **changes):
    """The ellipse with the moments of the thing's rectangle."""
    return {"id": id_, "x": thing["x"], "y": thing["y"], "psi": thing["yaw"], "rx": thing["length"] / math.sqrt(3.0),
            "ry": thing["width"] / math.sqrt(3.0), "vx": 0.0, "vy": 0.0, **changes}


def outlined(thing, shape, **changes):
    return element_of(thing, shape=shape, outline=thing["parts"][0]["outline"], **changes)


def frames_of(things, count=50, ids=None):
    """A map that is the truth."""
    return [{"t": PERIOD_S * k, "things": things, "map": [element_of(thing, 7 + i) for i, thing in enumerate(things)]}
            for k in range(count)]


def score(kind, *flights):
    found = kind()
    for frames in flights:
        found.add(frames)
    return found


class Geometry(unittest.TestCase):
    def test_distances_to_a_polygon_that_is_not_convex(self):
        hook = np.array(((0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)), float)
        points = np.array(((0.5, 2.5), (1.5, 0.5), (1.5, 2.0), (3.0, 0.5), (-0.3, -0.4), (1.2, 1.2), (1.0, 2.0)))
        for turned in (hook, hook[::-1]):
            np.testing.assert_allclose(shapes.distances_to(turned, points), (0, 0, 0.5, 1.0, 0.5, 0.2, 0), atol=1e-12)

    def test_an_element_covers_its_outline_or_else_its_ellipse(self):
        element = {"x": 1.0, "y": 2.0, "psi": 0.5, "rx": 0.6, "ry": 0.2}
        ahead, left = np.array((math.cos(0.5), math.sin(0.5))), np.array((-math.sin(0.5), math.cos(0.5)))
        points = np.array((1.0, 2.0)) + np.array((0.7 * ahead, 0.3 * left, 0.55 * ahead))
        np.testing.assert_allclose(shapes.distances_to(shapes.outline_of(element), points), (0.1, 0.1, 0.0), atol=2e-3)
        element["outline"] = [[5, 5], [6, 5], [6, 6]]
        np.testing.assert_allclose(shapes.outline_of(element), element["outline"])

    def test_the_size_of_a_box(self):
        thing = box(yaw=1.1, length=0.9, width=0.25)
        np.testing.assert_allclose(shapes.size_of(element_of(thing)), (0.9, 0.25))
        np.testing.assert_allclose(shapes.size_of(element_of(thing, rx=0.1, ry=0.3)), np.sqrt(3) * np.array((0.3, 0.1)))
        wrong = {"rx": 2.0, "ry": 1.0}  # the outline is better known
        np.testing.assert_allclose(shapes.size_of(outlined(thing, "box", **wrong)), (0.9, 0.25), atol=1e-12)
        np.testing.assert_allclose(shapes.size_of(outlined(thing, "compact", **wrong)), (0.9, 0.25), atol=1e-12)
        np.testing.assert_allclose(shapes.size_of(outlined(thing, "ellipse", **wrong)), np.sqrt(3) * np.array((2, 1)))

    def test_the_size_of_a_hull_without_a_corner(self):
        hull = placed(((0.4, 0.1), (0.35, 0.15), (-0.4, 0.15), (-0.4, -0.15), (0.4, -0.15)), 1.0, 2.0, 0.7)
        for start in range(5):
            element = element_of(box(), shape="compact", outline=hull[start:] + hull[:start])
            np.testing.assert_allclose(shapes.size_of(element), (0.8, 0.3), atol=1e-12)

    def test_sides_that_were_seen(self):
        self.assertEqual(shapes.sides_seen(box(sides=("front",))), [True, False])  # its length
        self.assertEqual(shapes.sides_seen(box(sides=("end",), yaw=2.5)), [False, True])
        self.assertEqual(shapes.sides_seen(box(sides=("front", "end"), yaw=-1.9)), [True, True])
        half = box(sides=("front",))
        half["parts"][0]["hits"] = half["parts"][0]["hits"][:10]
        self.assertEqual(shapes.sides_seen(half), [False, False])
        self.assertEqual(shapes.sides_seen(box(sides=("front",), hits=2)), [False, False])
        self.assertEqual(shapes.sides_seen(box(sides=())), [False, False])


class Boxes(unittest.TestCase):
    def setUp(self):
        self.things = [box("box_1", sides=("front", "end")), box("box_2", x=-2.0, sides=("front", "end"), vx=0.5)]
        self.frames = frames_of(self.things)

    def score(self):
        return score(shapes.BoxScore, self.frames)

    def test_a_perfect_map(self):
        found = self.score()
        self.assertEqual((found.recall, found.visible, found.false_per_scan, found.switches), (1.0, 100, 0.0, 0))
        for error in (found.standing_rmse_m, found.moving_rmse_m, found.size_rmse_m, found.size_bias_m):
            self.assertAlmostEqual(error, 0.0)

    def test_standing_and_moving_errors(self):
        for frame in self.frames[:25]:
            frame["map"][0]["x"] += 0.03
            frame["map"][0]["y"] += 0.04
        for frame in self.frames:
            frame["map"][1]["y"] -= 0.1
        found = self.score()
        self.assertAlmostEqual(found.standing_rmse_m, 0.05 * math.sqrt(0.5))
        self.assertAlmostEqual(found.moving_rmse_m, 0.1)
        self.assertEqual((found.recall, found.false_per_scan), (1.0, 0.0))

    def test_what_moves_now_and_then_moves(self):
        still = {**self.things[1], "vx": 0.0}
        for frame in self.frames[10:20]:
            frame["things"] = [self.things[0], still]
        self.assertEqual(len(self.score().errors_m[True]), 50)

    def test_missed_false_and_second_ones(self):
        for frame in self.frames[:5]:
            del frame["map"][0]
        self.frames[10]["map"].append(element_of(self.things[0], 20))
        self.frames[11]["map"].append(element_of(self.things[0], 21, x=4.0))
        found = self.score()
        self.assertAlmostEqual(found.recall, 0.95)
        self.assertAlmostEqual(found.false_per_scan, 2 / 50)

    def test_an_element_0_2_m_off_the_box_is_on_it(self):
        for off_m, recall in ((0.19, 1.0), (0.21, 0.5)):
            frames = frames_of(self.things)
            for frame in frames:  # across its long side
                frame["map"][0]["x"] -= (0.2 + off_m) * math.sin(0.3)
                frame["map"][0]["y"] += (0.2 + off_m) * math.cos(0.3)
            self.assertAlmostEqual(score(shapes.BoxScore, frames).recall, recall)

    def test_a_box_with_few_hits_is_neither_missed_nor_false(self):
        hardly = box("box_1", sides=("front",), hits=7)
        frames = frames_of([hardly], 10)
        frames[0]["map"].clear()
        found = score(shapes.BoxScore, frames)
        self.assertEqual((found.visible, found.false_per_scan), (0, 0.0))
        self.assertTrue(math.isnan(found.recall))
        self.assertEqual(score(shapes.BoxScore, frames_of([box("box_1", hits=8)], 10)).visible, 10)

    def test_length_and_width_once_two_sides_were_seen(self):
        frames = frames_of([box(sides=("front",))], 30)
        for frame in frames[10:20]:
            frame["things"] = [box(sides=("end",))]
        for k, frame in enumerate(frames):
            frame["map"][0]["rx"] += (1.0 if k < 10 else 0.04) / math.sqrt(3.0)
        found = score(shapes.BoxScore, frames)
        self.assertEqual(len(found.size_errors_m), 2 * 20)
        self.assertAlmostEqual(found.size_rmse_m, 0.04 * math.sqrt(0.5))
        self.assertAlmostEqual(found.size_bias_m, 0.02)

    def test_errors_once_two_sides_were_seen(self):
        frames = frames_of([box(sides=("front",))], 30)
        for frame in frames[10:20]:
            frame["things"] = [box(sides=("end",))]
        for k, frame in enumerate(frames):
            frame["map"][0]["x"] += 0.15 if k < 10 else 0.02
        found = score(shapes.BoxScore, frames)
        self.assertEqual((len(found.errors_m[False]), len(found.seen_errors_m[False])), (30, 20))
        self.assertAlmostEqual(max(found.seen_errors_m[False]), 0.02)

    def test_flights_are_pooled_and_their_ids_are_not_compared(self):
        other = frames_of(self.things)
        for frame in other:
            for element in frame["map"]:
                element["id"] += 100
            frame["map"].pop()
        found = score(shapes.BoxScore, self.frames, other)
        self.assertEqual((found.switches, found.scans), (0, 100))
        self.assertAlmostEqual(found.recall, 0.75)

    def test_changes_of_identity(self):
        for frame in self.frames[20:30]:
            frame["map"][0]["id"] = 30
        self.assertEqual(self.score().switches, 2)


class Covers(unittest.TestCase):
    def test_hits_within_10_cm_of_anything_on_the_map(self):
        table = box("table_1", length=1.2, width=0.8, yaw=0.0, x=0.0, y=0.0)
        corners = ((-0.6, -0.4), (0.6, -0.4), (0.6, 0.4), (-0.6, 0.4))
        table["parts"] = [{"outline": [], "hits": [list(corner)] * 3} for corner in corners]
        leg = {"id": 1, "rx": 0.03, "ry": 0.03, "psi": 0.0}
        frames = [{"t": PERIOD_S * k, "things": [table], "map": [{**leg, "x": x, "y": y} for x, y in corners[:3]]}
                  for k in range(20)]
        found = score(shapes.CoverScore, frames)
        self.assertAlmostEqual(found.table, 0.75)
        self.assertTrue(math.isnan(found.chair))
        for off_m, part in ((0.125, 1.0), (0.135, 0.75)):
            for frame in frames:
                frame["map"][3:] = [{**leg, "x": -0.6, "y": 0.4 + off_m}]
            self.assertAlmostEqual(score(shapes.CoverScore, frames).table, part)
        for frame in frames:  # one element for all of it
            frame["map"] = [outlined(box("table_1", length=1.2, width=0.8, yaw=0.0, x=0.0, y=0.0), "compact")]
        self.assertEqual(score(shapes.CoverScore, frames).table, 1.0)
        for frame in frames:
            frame["map"].clear()
        self.assertEqual(score(shapes.CoverScore, frames).table, 0.0)

    def test_parts_with_less_than_three_hits_do_not_count(self):
        chair = box("chair_1")
        chair["parts"] = [{"outline": [], "hits": [[0.0, 0.0]] * 3}, {"outline": [], "hits": [[9.0, 9.0]] * 2}]
        frames = [{"t": PERIOD_S * k, "things": [chair], "map": [element_of(box(x=0.0, y=0.0))]} for k in range(5)]
        found = score(shapes.CoverScore, frames)
        self.assertEqual((found.chair, found.hits["chair"]), (1.0, 15))

    def test_not_more_often_than_every_tenth_of_a_second(self):
        frames = frames_of([box("l_shape_1")], 40)
        for k, frame in enumerate(frames):
            frame["t"] = 0.025 * k
        self.assertEqual(score(shapes.CoverScore, frames).hits["l_shape"], 10 * 20)


class Persons(unittest.TestCase):
    def setUp(self):
        self.frames = frames_of([person(), person("person_2", y=2.0)])

    def score(self):
        return score(shapes.PersonScore, self.frames)

    def test_a_perfect_map(self):
        found = self.score()
        self.assertEqual((found.one_track, found.switches_per_minute, found.false_per_scan), (1.0, 0.0, 0.0))
        self.assertAlmostEqual(found.center_rmse_m, 0.0)

    def test_two_elements_are_not_one_person(self):
        for frame in self.frames[1:11]:
            frame["map"][0]["y"] -= 0.2
            frame["map"].append(element_of(person(y=1.1), 20))
        for frame in self.frames[11:16]:
            del frame["map"][1]
        found = self.score()
        self.assertAlmostEqual(found.one_track, 0.85)
        self.assertAlmostEqual(found.part_with(0, 0), 0.05)
        self.assertAlmostEqual(found.part_with(2), 0.1)
        self.assertEqual(found.switches, 0)  # the first is still there
        self.assertAlmostEqual(found.center_rmse_m, 0.2 * math.sqrt(10 / 95))

    def test_an_element_far_from_all_is_on_no_person(self):
        for off_m, false in ((0.49, 0.0), (0.51, 1.0)):
            frames = frames_of([person()], 10)
            for frame in frames:
                frame["map"][0]["x"] += off_m
            found = score(shapes.PersonScore, frames)
            self.assertEqual((found.false_per_scan, found.one_track), (false, 1.0 - false))

    def test_elements_between_persons_are_of_the_nearest(self):
        for frame in self.frames:
            frame["map"][0]["y"] += 0.45  # still nearer to the first
        self.assertEqual(self.score().one_track, 1.0)
        for frame in self.frames:
            frame["map"][0]["y"] += 0.1
        found = self.score()
        self.assertEqual((found.part_with(0, 0), found.part_with(2)), (0.5, 0.5))

    def test_identities_that_are_exchanged(self):
        for frame in self.frames[25:]:
            frame["map"][0]["id"], frame["map"][1]["id"] = frame["map"][1]["id"], frame["map"][0]["id"]
        found = self.score()
        self.assertEqual(found.switches, 2)
        self.assertAlmostEqual(found.seconds, 2 * 49 * PERIOD_S)
        self.assertAlmostEqual(found.switches_per_minute, 60.0 * 2 / (2 * 49 * PERIOD_S))

    def test_a_change_while_hidden_is_one(self):
        for frame in self.frames[20:30]:
            frame["things"] = [person(hits=4), frame["things"][1]]
            del frame["map"][0]
        for frame in self.frames[30:]:
            frame["map"][0]["id"] = 30
        found = self.score()
        self.assertEqual(found.switches, 1)
        self.assertEqual(found.one_track, 1.0)  # hidden is not missed
        self.assertEqual(sum(found.with_tracks.values()), 90)


class Targets(unittest.TestCase):
    def test_each_scanner_must_meet_a_target_but_the_calibrated_one(self):
        good = score(shapes.BoxScore, frames_of([box(sides=("front", "end")), box("box_2", x=-2.0, vx=1.0)]))
        bad = score(shapes.BoxScore, [{**frame, "map": []} for frame in frames_of([box()])])
        scores = {("a", "boxes"): good, (shapes.CALIBRATED, "boxes"): bad}
        self.assertEqual([met for _, _, met in shapes.targets(scores)], [True] * 5)
        scores["b", "boxes"] = bad
        verdicts = list(shapes.targets(scores))
        self.assertEqual([met for _, _, met in verdicts], [False, False, False, False, True])  # no figure, no success
        self.assertEqual(verdicts[1][1], f"0.000 a, none {shapes.CALIBRATED}, none b")
        self.assertEqual(verdicts[0][1], f"1.000 a, 0.000 {shapes.CALIBRATED}, 0.000 b")

    def test_a_preset_with_other_values(self):
        text = "a: 1.0  # [1]\nab: 2  # a: 3\n"
        self.assertEqual(shapes.calibrated(text, {"a": 0.5}), "a: 0.5  # [1]\nab: 2  # a: 3\n")
        with self.assertRaises(ValueError):
            shapes.calibrated(text, {"c": 1})


class Worlds(unittest.TestCase):
    def test_a_world_follows_from_its_seed(self):
        for experiment in shape_worlds.EXPERIMENTS:
            first, second = shape_worlds.flights_of(experiment)
            self.assertEqual([flight.xml for flight in shape_worlds.flights_of(experiment)], [first.xml, second.xml])
            self.assertNotEqual(first.xml.replace(first.name, ""), second.xml.replace(second.name, ""))

    def test_boxes_are_of_all_lengths_and_clear_of_each_other(self):
        for seed in shape_worlds.SEEDS:
            things = shape_worlds.scene_of("boxes", seed).things
            self.assertEqual(sum(thing.moves for thing in things), 3)
            for thing in things:
                (half,) = (part.half for part in thing.parts)
                self.assertTrue(0.1 <= half[0] <= 0.75 and 0.06 <= half[1] <= half[0])
            for i, thing in enumerate(things):
                for other in things[:i]:
                    apart = np.hypot(*(thing.path.at(shape_worlds.TIMES) - other.path.at(shape_worlds.TIMES)).T)
                    self.assertGreater(apart.min() - thing.reach - other.reach, 0.3)

    def test_an_l_shape_has_its_origin_in_the_middle(self):
        (part,) = shape_worlds.l_shape("l_shape_1", shape_worlds.stand(0, 0), 0.0, 1.0, 0.6, 0.2).parts
        corners = np.array(part.outline)
        np.testing.assert_allclose(corners.min(0), (-0.5, -0.3))
        np.testing.assert_allclose(corners.max(0), (0.5, 0.3))
        x, y = corners.T
        area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)  # positive: counter-clockwise
        self.assertAlmostEqual(area, 1.0 * 0.2 + 0.4 * 0.2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
