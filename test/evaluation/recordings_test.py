#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/evaluate recordings: its measures of tracks whose errors are known."""
import json
import math
import pathlib
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/evaluation"))
import recordings  # noqa: E402

try:
    import rosbag
except ImportError:  # in a build without ROS
    rosbag = None

FRAMES = 100
PERIOD_S = 0.08
CAR = {"id": 0, "a": 0.2175, "b": 0.095, "hits": 20}


def car(k, **changes):
    """Along a line of heading 0.3 rad at 0.8 m/s."""
    heading, along_m = 0.3, 0.8 * PERIOD_S * k
    return {**CAR, "x": 1.0 + along_m * math.cos(heading), "y": -2.0 + along_m * math.sin(heading), "yaw": heading,
            "vx": 0.8 * math.cos(heading), "vy": 0.8 * math.sin(heading), **changes}


def truth(count=FRAMES):
    return [{"t": 1000.0 + PERIOD_S * k, "ego": [0.5, 0.2, 0.7], "objs": [car(k)]} for k in range(count)]


def element_of(thing, id_=7):
    rx, ry = recordings.moment_equal_semi_axes(thing)
    return {"id": id_, "rx": rx, "ry": ry, "psi": thing["yaw"], **{key: thing[key] for key in ("x", "y", "vx", "vy")}}


def perfect(frames):
    """The lines of a map that is the truth."""
    return [{"stamp": frame["t"], "objects": [element_of(thing, 7 + i) for i, thing in enumerate(frame["objs"])]}
            for frame in frames]


class ScoreTest(unittest.TestCase):
    def setUp(self):
        self.frames = truth()
        self.lines = perfect(self.frames)

    def score(self):
        return recordings.Score(self.frames, self.lines)

    def test_a_perfect_map(self):
        score = self.score()
        self.assertEqual((score.scans, score.visible, score.mapped, score.recall), (FRAMES, FRAMES, FRAMES, 1.0))
        for error in (score.position_rmse_m, score.velocity_rmse_m_s, score.behind_m, score.semi_axis_mae_m):
            self.assertAlmostEqual(error, 0.0)
        self.assertEqual((score.ids, score.switches, score.fragments, score.longest_off_s), (1, 0, 0, 0.0))
        self.assertEqual((score.duplicates, score.false_movers, score.standing_others), (0.0, 0.0, 0.0))
        self.assertEqual(score.classes, (1.0, 0.0, 0.0))

    def test_an_empty_map(self):
        self.lines = [{"stamp": frame["t"], "objects": []} for frame in self.frames]
        score = self.score()
        self.assertEqual((score.recall, score.ids, score.switches, score.fragments), (0.0, 0, 0, 0))
        self.assertTrue(math.isnan(score.position_rmse_m) and math.isnan(score.velocity_rmse_m_s))
        self.assertAlmostEqual(score.longest_off_s, (FRAMES - 1) * PERIOD_S)

    def test_position_and_velocity_errors(self):
        for line in self.lines[:FRAMES // 2]:  # 0.05 m and 0.3 m/s in half of the scans, 0.15 m in the others
            (element,) = line["objects"]
            element["x"] += 0.03
            element["y"] -= 0.04
            element["vx"] += 0.3
        for line in self.lines[FRAMES // 2:]:
            line["objects"][0]["y"] += 0.15
        score = self.score()
        self.assertAlmostEqual(score.position_rmse_m, math.sqrt(0.5 * (0.05**2 + 0.15**2)))
        self.assertAlmostEqual(score.velocity_rmse_m_s, math.sqrt(0.5 * 0.3**2))
        self.assertEqual(score.classes, (0.5, 0.5, 0.0))
        self.assertEqual((score.recall, score.switches, score.false_movers), (1.0, 0, 0.0))

    def test_errors_along_the_line_of_sight(self):
        for frame, line in zip(self.frames, self.lines):  # 0.1 m towards the scanner, 0.05 m across
            (thing,), (element,) = frame["objs"], line["objects"]
            bearing = math.atan2(thing["y"] - frame["ego"][1], thing["x"] - frame["ego"][0])
            element["x"] += -0.1 * math.cos(bearing) - 0.05 * math.sin(bearing)
            element["y"] += -0.1 * math.sin(bearing) + 0.05 * math.cos(bearing)
        self.assertAlmostEqual(self.score().behind_m, -0.1)
        self.assertAlmostEqual(self.score().position_rmse_m, math.hypot(0.1, 0.05))

    def test_semi_axes_of_equal_moments(self):
        rx, ry = recordings.moment_equal_semi_axes({"a": 0.1, "b": 0.4})
        x, y = np.meshgrid(np.linspace(-0.5, 0.5, 1501), np.linspace(-0.5, 0.5, 1501))
        box = (np.abs(x) < 0.4) & (np.abs(y) < 0.1)
        ellipse = (x / rx)**2 + (y / ry)**2 < 1.0
        for axis in (x, y):
            self.assertAlmostEqual(np.mean(axis[ellipse]**2), np.mean(axis[box]**2), delta=0.01 * np.mean(axis[box]**2))
        for line in self.lines:  # 2 cm too long, 1 cm too slim; which of the two is rx does not matter
            (element,) = line["objects"]
            element["rx"], element["ry"] = element["ry"] - 0.01, element["rx"] + 0.02
        self.assertAlmostEqual(self.score().semi_axis_mae_m, 0.015)

    def test_changes_of_identity(self):
        for line in self.lines[30:60]:
            line["objects"][0]["id"] = 8
        for line in self.lines[80:]:
            line["objects"][0]["id"] = 9
        score = self.score()
        self.assertEqual((score.ids, score.switches, score.fragments), (3, 3, 0))  # 7, 8, 7, 9

    def test_a_change_of_identity_while_off_the_map(self):
        for line in self.lines[40:50]:
            line["objects"].clear()
        self.assertEqual(self.score().switches, 0)
        for line in self.lines[50:]:
            line["objects"][0]["id"] = 8
        score = self.score()
        self.assertEqual((score.switches, score.fragments), (1, 1))
        self.assertAlmostEqual(score.recall, 0.9)
        self.assertAlmostEqual(score.longest_off_s, 10 * PERIOD_S)

    def test_late_on_the_map_is_no_fragment(self):
        for line in self.lines[:5]:
            line["objects"].clear()
        score = self.score()
        self.assertEqual((score.fragments, score.switches), (0, 0))
        self.assertAlmostEqual(score.recall, 0.95)

    def test_gone_for_good_is_a_fragment(self):
        for line in self.lines[90:]:
            line["objects"].clear()
        self.assertEqual(self.score().fragments, 1)
        self.assertAlmostEqual(self.score().longest_off_s, 9 * PERIOD_S)  # as far as it is known

    def test_scans_without_a_line_are_missed(self):
        del self.lines[20:30], self.lines[-1]
        score = self.score()
        self.assertAlmostEqual(score.recall, 0.89)
        self.assertEqual(score.fragments, 2)

    def test_scans_with_few_hits_do_not_count(self):
        for frame, line in zip(self.frames[:20], self.lines[:20]):
            frame["objs"][0]["hits"] = 7
            line["objects"][0]["y"] += 0.3
            line["objects"][0]["id"] = 1
        for line in self.lines[:10]:
            line["objects"].clear()
        self.frames[20]["objs"][0]["hits"] = 8
        score = self.score()
        self.assertEqual((score.visible, score.recall, score.switches, score.fragments), (FRAMES - 20, 1.0, 0, 0))
        self.assertAlmostEqual(score.position_rmse_m, 0.0)
        self.assertEqual(score.false_movers, 0.0)  # nor is it false

    def test_an_element_off_the_box_is_another(self):
        for k, line in enumerate(self.lines[:20]):
            left_m = CAR["b"] + (0.21 if k < 10 else 0.19)
            line["objects"][0]["x"] -= left_m * math.sin(0.3)
            line["objects"][0]["y"] += left_m * math.cos(0.3)
        score = self.score()
        self.assertAlmostEqual(score.recall, 0.9)
        self.assertAlmostEqual(score.false_movers, 0.1)
        self.assertEqual((score.classes[0], score.classes[2]), (0.8, 0.1))

    def test_by_the_centres_alone(self):
        for line in self.lines[:10]:
            line["objects"][0]["y"] += 0.51
        for line in self.lines[10:20]:
            line["objects"][0]["y"] += 0.49
        self.assertAlmostEqual(self.score().recall, 0.8)
        self.assertAlmostEqual(recordings.Score(self.frames, self.lines, recordings.is_near).recall, 0.9)

    def test_a_post_that_the_car_passes_is_not_the_car(self):
        post = {"id": 3, "x": car(50)["x"] - 0.31 * math.sin(0.3), "y": car(50)["y"] + 0.31 * math.cos(0.3), "vx": 0.0,
                "vy": 0.0, "rx": 0.05, "ry": 0.05, "psi": 0.0}
        for line in self.lines:
            line["objects"] = [post]
        self.assertEqual((self.score().recall, self.score().standing_others), (0.0, 1.0))
        self.assertGreater(recordings.Score(self.frames, self.lines, recordings.is_near).recall, 0.1)

    def test_duplicates(self):
        for k, line in enumerate(self.lines[:30]):  # ahead of it by as much beyond its front
            ahead_m = CAR["a"] + (0.19 if k < 20 else 0.21)
            (element,) = line["objects"]
            duplicate = {**element, "id": 30, "vx": 0.0, "vy": 0.0}
            duplicate["x"] += ahead_m * math.cos(0.3)
            duplicate["y"] += ahead_m * math.sin(0.3)
            line["objects"].insert(0, duplicate)
        score = self.score()
        self.assertAlmostEqual(score.duplicates, 0.2)
        self.assertAlmostEqual(score.standing_others, 0.3)
        self.assertAlmostEqual(score.position_rmse_m, 0.0)  # the nearer one is the car's
        self.assertEqual((score.switches, score.false_movers), (0, 0.0))

    def test_distance_to_a_box(self):
        box = {"x": 1.0, "y": 2.0, "a": 0.3, "b": 0.1, "yaw": math.pi / 2}  # along y
        for x, y, expected in ((1.0, 2.0, 0.0), (1.09, 2.29, 0.0), (1.0, 2.5, 0.2), (1.3, 2.0, 0.2), (1.4, 2.7, 0.5)):
            self.assertAlmostEqual(recordings.distance_to_box(box, {"x": x, "y": y}), expected)

    def test_false_movers(self):
        post = {"id": 3, "x": 9.0, "y": 9.0, "vx": 0.0, "vy": 0.0, "rx": 0.1, "ry": 0.1, "psi": 0.0}
        for k, line in enumerate(self.lines):
            line["objects"] += [post, {**post, "id": 4, "x": 5.0, "vy": 0.31 if k < 40 else 0.29}]
        for line in self.lines[:10]:
            line["objects"].append({**post, "id": 5, "vx": -0.3, "vy": 0.3})
        score = self.score()
        self.assertAlmostEqual(score.false_movers, 0.5)
        self.assertAlmostEqual(score.standing_others, 1.6)
        self.assertEqual((score.recall, score.ids, score.duplicates), (1.0, 1, 0.0))

    def test_several_things(self):
        for k, frame in enumerate(self.frames):
            frame["objs"].append(car(k, id=5, x=car(k)["x"] + 0.5))
        self.lines = perfect(self.frames)
        for line in self.lines:  # the second one's element is nearer to the first one than the first one's own
            line["objects"][0]["x"] -= 0.3
            line["objects"][1]["x"] -= 0.28
        score = self.score()
        self.assertEqual((score.visible, score.recall, score.switches), (2 * FRAMES, 1.0, 0))
        self.assertAlmostEqual(score.position_rmse_m, math.sqrt(0.5 * (0.3**2 + 0.28**2)))
        self.assertEqual(score.standing_others + score.false_movers, 0.0)

    def test_a_match_does_not_cost_another(self):
        """One pair at no distance, or two at a large one."""
        things = [{**CAR, "x": 0.0, "y": 0.0, "yaw": 0.0}, {**CAR, "x": 0.4, "y": 0.0, "yaw": 0.0}]
        elements = [{"x": 0.4, "y": 0.0}, {"x": 0.8, "y": 0.0}]
        self.assertEqual(recordings.assign(things, elements), {0: 0, 1: 1})
        self.assertEqual(recordings.assign(things, elements[1:]), {1: 0})
        self.assertEqual(recordings.assign(things, []), {})

    def test_a_rigid_motion_of_everything_changes_nothing(self):
        rng = np.random.default_rng(1)
        for line in self.lines:
            for key in ("x", "y", "vx", "vy"):
                line["objects"][0][key] += float(rng.normal(0.0, 0.1))
        before, angle = self.score(), 1.1
        c, s = math.cos(angle), math.sin(angle)

        def moved(x, y, dx=0.0, dy=0.0):
            return c * x - s * y + dx, s * x + c * y + dy

        for frame, line in zip(self.frames, self.lines):
            frame["ego"] = [*moved(*frame["ego"][:2], 3.0, -4.0), frame["ego"][2] + angle]
            for thing in frame["objs"] + line["objects"]:
                thing["x"], thing["y"] = moved(thing["x"], thing["y"], 3.0, -4.0)
                thing["vx"], thing["vy"] = moved(thing["vx"], thing["vy"])
            frame["objs"][0]["yaw"] += angle
        after = self.score()
        for key in ("recall", "position_rmse_m", "velocity_rmse_m_s", "behind_m", "duplicates", "false_movers"):
            self.assertAlmostEqual(getattr(after, key), getattr(before, key), msg=key)


class DetectionScoreTest(unittest.TestCase):
    def lines(self, frames, dx, dy, xx, yy):
        """Detections off by (dx, dy) in the scanner's frame, with variances xx and yy there."""
        lines = []
        for frame in frames:
            x, y, yaw = frame["ego"]
            ahead, left = frame["objs"][0]["x"] - x, frame["objs"][0]["y"] - y
            P = np.diag((xx, yy, 1.0, 1.0, 1.0)).ravel().tolist()
            detection = {"x": math.cos(yaw) * ahead + math.sin(yaw) * left + dx,
                         "y": math.cos(yaw) * left - math.sin(yaw) * ahead + dy, "covariance": P}
            lines.append({"stamp": frame["t"], "detections": [detection]})
        return lines

    def test_in_the_scanners_frame(self):
        frames = truth(20)
        bound = math.sqrt(-2.0 * math.log(0.1))  # in standard deviations: 90 % of a Gaussian of two dimensions
        for part, held in ((0.99, 1.0), (1.01, 0.0)):
            score = recordings.DetectionScore(frames, self.lines(frames, 0.02 * bound * part, 0.0, 0.02**2, 1e-6))
            self.assertAlmostEqual(score.position_rmse_m, 0.02 * bound * part)
            self.assertEqual((score.held, score.classes), (held, (1.0, 0.0, 0.0)))

    def test_scans_without_detection(self):
        frames = truth(20)
        lines = self.lines(frames, 0.15, 0.0, 1.0, 1.0)
        for line in lines[:5]:
            line["detections"].clear()
        frames[5]["objs"][0]["hits"] = 3
        score = recordings.DetectionScore(frames, lines)
        self.assertEqual(score.visible, 19)
        self.assertAlmostEqual(score.classes[1], 14 / 19)
        self.assertEqual(score.held, 1.0)


class CountsTest(unittest.TestCase):
    def test_lives(self):
        post = {"id": 1, "vx": 0.0, "vy": 0.0}
        lines = [{"stamp": 10.0 * k, "objects": [post]} for k in range(7)]
        for line in lines[2:5]:
            line["objects"] = [post, {"id": 2, "vx": 0.3, "vy": 0.4}]
        count = recordings.Counts(lines)
        self.assertEqual((count.scans, count.ids, count.minutes), (7, 2, 1.0))
        self.assertEqual((count.mean_life_s, count.median_life_s), (40.0, 40.0))  # of 60 s and 20 s
        self.assertAlmostEqual(count.elements, 10 / 7)
        self.assertAlmostEqual(count.movers, 3 / 7)


class AccountTest(unittest.TestCase):
    def line(self, compact, on_no_map, on_no_map_s, *hits):
        return {"compact": compact, "on_no_map": on_no_map, "on_no_map_s": on_no_map_s,
                "fate": [fate for fate, _ in hits], "id": [id_ for _, id_ in hits]}

    def test_each_hit_has_one_fate(self):
        account = recordings.Account([
            self.line(3, 1, 0.2, ("object", 4), ("refused", 4), ("structure", None), ("structure", None)),
            self.line(2, 2, 0.3, ("object", None), ("refused", None), ("no segment", None), ("no segment", 7))])
        self.assertEqual((account.scans, account.compact, account.on_no_map, account.longest_s), (2, 5, 3, 0.3))
        parts = [account.part(fate) for fate in recordings.Account.FATES]
        self.assertEqual(parts, [3 / 8, 1 / 8, 1 / 8, 2 / 8, 1 / 8])

    def test_the_worst_recording_must_meet_the_target(self):
        accounts = {name: recordings.Account([self.line(1, 1, longest_s)])
                    for name, longest_s in (("a", 0.5), ("b", 0.4))}
        self.assertEqual(recordings.account_target(accounts)[1:], ("0.50 s a", True))
        accounts["b"] = recordings.Account([self.line(1, 1, 0.51), self.line(1, 0, 0.0)])
        self.assertEqual(recordings.account_target(accounts)[1:], ("0.51 s b", False))


@unittest.skipUnless(rosbag, "no python3-rosbag")
class HitsTest(unittest.TestCase):
    """A scanner that drives and turns before a wall measures it beam by beam."""

    def test_hits_are_where_the_beams_were(self):
        import genpy
        from sensor_msgs.msg import LaserScan

        wall_x, beams, beam_s = 4.0, 41, 0.001
        frames = [{"t": 100.0 + PERIOD_S * k, "ego": [0.08 * k, 1.0 - 0.02 * k, 3.1 + 0.1 * k], "objs": []}
                  for k in range(8)]  # 1 m/s and 1.25 rad/s, over the end of the range of angles
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "wall.bag"
            with rosbag.Bag(str(path), "w") as bag:
                for k, frame in enumerate(frames[:-1]):
                    scan = LaserScan(angle_min=-3.4, angle_increment=0.01, time_increment=beam_s, range_min=0.1,
                                     range_max=10.0)
                    scan.header.stamp = genpy.Time.from_sec(frame["t"])
                    for i in range(beams):
                        after = k + i * beam_s / PERIOD_S
                        yaw = 3.1 + 0.1 * after
                        scan.ranges.append((wall_x - 0.08 * after) / math.cos(yaw - 3.4 + 0.01 * i))
                    scan.ranges[7] = math.inf  # no return
                    bag.write("/scan", scan, scan.header.stamp)
            for frame in frames:
                frame["ego"][2] = math.remainder(frame["ego"][2], 2.0 * math.pi)
            hits = recordings.hits_of(recordings.Recording("wall", path, frames))
        self.assertEqual([len(found) for found in hits], [beams - 1] * 7 + [0])
        for found in hits[:-1]:
            self.assertLess(np.max(np.abs(found[:, 0] - wall_x)), 1e-3)
            self.assertGreater(np.ptp(found[:, 1]), 1.0)


class ReportTest(unittest.TestCase):
    def test_recordings_are_bags_with_truth(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for bag in ("b.bag", "a.bag", "without_truth.bag"):
                (folder / bag).touch()
            for number, name in enumerate(("a", "b", "without_bag")):
                (folder / f"{name}.gt.json").write_text(json.dumps({"frames": truth(number + 1)}))
            found = list(recordings.recordings_with_truth(folder))
        self.assertEqual([(recording.name, recording.bag.name, len(recording.frames)) for recording in found],
                         [("a", "a.bag", 1), ("b", "b.bag", 2)])

    def test_each_recording_must_meet_a_target(self):
        frames = truth()
        good, bad = perfect(frames), perfect(frames)
        for line in bad[:2]:
            line["objects"].clear()
        for k, line in enumerate(bad):
            if line["objects"]:
                line["objects"][0]["vx"] += 0.21
                line["objects"][0]["id"] = k // 40
        scores = {"good": recordings.Score(frames, good), "bad": recordings.Score(frames, bad)}
        self.assertEqual([met for _, _, met in recordings.targets({"good": scores["good"]})], [True] * 5)
        verdicts = list(recordings.targets(scores))
        self.assertEqual([met for _, _, met in verdicts], [False, False, True, False, True])
        self.assertEqual(verdicts[0][1], "1.000 good, 0.980 bad")
        self.assertEqual(verdicts[1][1], "0 good, 2 bad")

    def test_no_figure_is_no_success(self):
        frames = truth()
        never = recordings.Score(frames, [])
        self.assertEqual([met for _, _, met in recordings.targets({"never": never})], [False, True, False, False, True])


if __name__ == "__main__":
    unittest.main(verbosity=2)
