#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Recorded clouds of a 3D scanner that sweeps while its robot turns, whatever its driver makes of the times of points:
no roscore. The map is that of good times, or it is said why not."""
import json
import math
import pathlib
import sys
import unittest

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import small_bags as bags  # noqa: E402
from bag_tools import BagToolTest, run_program  # noqa: E402

CONFIG = pathlib.Path(__file__).resolve().parent / "objects_without_model.yaml"
POSTS = [(2.2, 1.4, 0.2), (-2.0, 2.2, 0.15), (2.6, -2.1, 0.25), (-2.8, -1.7, 0.2)]
RINGS, COLUMNS, SWEEP_S, SECONDS = 6, 720, 0.1, 3.0
FLOAT, DOUBLE, WHOLE = (PointField.FLOAT32, "<f4"), (PointField.FLOAT64, "<f8"), (PointField.UINT32, "<u4")


def pose(t):
    return 0.2 * math.sin(0.5 * t), 0.2 * math.cos(0.5 * t), 1.2 * t


def sweep(t, rng):
    """Times of columns after the first, and x, y, z of points: NaN where there is no return."""
    dt = SWEEP_S * np.arange(COLUMNS) / COLUMNS
    azimuth = -2 * math.pi * np.arange(COLUMNS) / COLUMNS
    level = np.empty(COLUMNS)
    for i, after in enumerate(dt):
        x, y, yaw = pose(t + after)
        x, y = x + bags.LIDAR_X_M * math.cos(yaw), y + bags.LIDAR_X_M * math.sin(yaw)
        level[i] = bags.ranges(x, y, np.array([yaw + azimuth[i]]), bags.ROOM, POSTS)[0]
    level = level + rng.normal(0, 0.008, (RINGS, COLUMNS))
    level[:, np.arange(COLUMNS) % 61 == 3] = np.nan
    rise = np.tan(np.radians(np.linspace(-5, 5, RINGS)))[:, None]
    return np.broadcast_to(dt, level.shape), level * np.cos(azimuth), level * np.sin(azimuth), level * rise


SWEEPS = [sweep(0.1 + 0.1 * k, np.random.default_rng(k)) for k in range(int(10 * SECONDS) - 2)]


def cloud(k, name=None, kind=FLOAT, number=None, row_step=None):
    """`number`(time after the stamp, stamp, whether there is a return) is the field `name`."""
    dt, x, y, z = SWEEPS[k]
    fields = [("x", *FLOAT, x), ("y", *FLOAT, y), ("z", *FLOAT, z)]
    if name:
        fields.append((name, *kind, number(dt, bags.START_S + 0.1 + 0.1 * k, np.isfinite(x))))
    points = np.zeros(x.shape, np.dtype([(field[0], field[2]) for field in fields]))
    for field in fields:
        points[field[0]] = field[3]
    msg = PointCloud2(height=RINGS, width=COLUMNS, point_step=points.dtype.itemsize, data=points.tobytes())
    msg.header.stamp, msg.header.frame_id = bags.at(0.1 + 0.1 * k), "laser"
    msg.fields = [PointField(field[0], points.dtype.fields[field[0]][1], field[1], 1) for field in fields]
    msg.row_step = points.dtype.itemsize * COLUMNS if row_step is None else row_step
    return msg


def recording(path, **of_cloud):
    messages = [(0.0, "/tf_static", bags.transform(0, "base_link", "laser", (bags.LIDAR_X_M, 0.0, 0.3)))]
    for k in range(int(50 * SECONDS) + 20):
        x, y, yaw = pose(k / 50)
        messages.append((k / 50, "/tf", bags.transform(k / 50, "odom", "base_link", (x, y, 0.0), bags.about_z(yaw))))
    messages += [(0.23 + 0.1 * k, "/points", cloud(k, **of_cloud)) for k in range(len(SWEEPS))]
    return bags.write(path, messages)


def spoilt(number, value, at=(7, 800, 3000)):
    """The same but for some points."""
    def changed(dt, stamp_s, has_return):
        numbers = np.array(number(dt, stamp_s, has_return), dtype=float)
        numbers.flat[list(at)] = value
        return numbers
    return changed


GOOD = {"name": "time", "number": lambda dt, stamp_s, has_return: dt}
# By the boot of a device, which was 777 s before the recording.
SINCE_BOOT = {"name": "t", "kind": WHOLE,
              "number": lambda dt, stamp_s, has_return: 1e6 * (stamp_s - bags.START_S + 777 + dt)}
USABLE = {
    "ns of the clock, NaN without a return": {
        "name": "timestamp", "kind": DOUBLE,
        "number": lambda dt, stamp_s, has_return: np.where(has_return, 1e9 * (stamp_s + dt), np.nan)},
    "s of the clock, 0 without a return": {
        "name": "time_stamp", "kind": DOUBLE,
        "number": lambda dt, stamp_s, has_return: np.where(has_return, stamp_s + dt, 0.0)},
    "whole us": {"name": "t", "kind": WHOLE, "number": lambda dt, stamp_s, has_return: 1e6 * dt},
    "ms": {"name": "offset_time", "number": lambda dt, stamp_s, has_return: 1e3 * dt},
    "parts of the sweep": {"name": "time", "number": lambda dt, stamp_s, has_return: dt / SWEEP_S},
    "us since boot": SINCE_BOOT,
    "row_step 0": {**GOOD, "row_step": 0},
}
A_FEW_BAD = {
    "NaN": {**GOOD, "number": spoilt(GOOD["number"], np.nan)},
    "3.6 s late": {"name": "t", "kind": WHOLE, "number": spoilt(lambda dt, *_: 1e9 * dt, 3.6e9)},
    "negative": {**GOOD, "number": spoilt(GOOD["number"], -0.8)},
}
UNUSABLE = {
    "noise": {**GOOD, "number": lambda dt, *_: np.random.default_rng(1).normal(0, 1e6, dt.shape)},
    "NaN": {**GOOD, "number": lambda dt, *_: np.full(dt.shape, np.nan)},
    "NaN of a quarter": {
        **GOOD, "number": lambda dt, *_: np.where(np.arange(dt.size).reshape(dt.shape) % 4 == 0, np.nan, dt)},
}


class CloudBagsTest(BagToolTest):
    def error_of(self, **of_cloud):
        """RMS of the posts' places on the map in m, and what was said."""
        bag = recording(self.path / "clouds.bag", **of_cloud)
        text, said = self.written("objects_bag", bag, "--cloud-topic", "/points", "--world-frame", "odom", "--config",
                                  CONFIG)
        errors = []
        for line in map(json.loads, text.splitlines()):
            if line["stamp"] < bags.START_S + 2.0:
                continue
            places = np.array([(o["x"], o["y"]) for o in line["objects"]]).reshape(-1, 2)
            near = [np.hypot(*(places - post[:2]).T).min() if len(places) else 9.0 for post in POSTS]
            self.assertLess(max(near), 0.5)
            errors += near
        self.assertGreater(len(errors), 20)
        return float(np.sqrt(np.mean(np.square(errors)))), said

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.good_m, cls.good_said = cls.error_of(cls("test_good_times"), **GOOD)

    def test_good_times(self):
        self.assertLess(self.good_m, 0.05)
        self.assertNotIn("warning", self.good_said)

    def test_times_are_read_whatever_they_count_and_from_when(self):
        for name, of_cloud in USABLE.items():
            with self.subTest(name):
                error_m, said = self.error_of(**of_cloud)
                self.assertLess(error_m, 1.2 * self.good_m + 0.002)
                if name != "parts of the sweep":  # of the first cloud none can tell
                    self.assertNotIn("warning", said)

    def test_a_few_bad_times_cost_their_points(self):
        for name, of_cloud in A_FEW_BAD.items():
            with self.subTest(name):
                error_m, said = self.error_of(**of_cloud)
                self.assertLess(error_m, 1.2 * self.good_m + 0.002)
                self.assertIn("points dropped, whose times cannot be", said)
                self.assertNotIn("cannot be used", said)

    def test_times_that_cannot_be_used_are_told(self):
        for name, of_cloud in UNUSABLE.items():
            with self.subTest(name):
                error_m, said = self.error_of(**of_cloud)
                self.assertGreater(error_m, 1.5 * self.good_m)  # by the sweep
                self.assertIn(f"times of points of {len(SWEEPS)} of {len(SWEEPS)} clouds cannot be used", said)

    def test_motion_without_times_is_told(self):
        for of_cloud in ({}, {**GOOD, "number": lambda dt, *_: 0.0 * dt}, {"name": "height", "number": GOOD["number"]}):
            _, said = self.error_of(**of_cloud)
            self.assertIn("clouds have no times, but the sensor moves while it sweeps", said)

    def test_check_bag_follows_clouds(self):
        for of_cloud, words in ((GOOD, None), ({}, "clouds have no times, but the sensor moves while it sweeps"),
                                (UNUSABLE["NaN"], "clouds cannot be used"),
                                (A_FEW_BAD["NaN"], "points dropped, whose times cannot be")):
            done = run_program("check_bag", recording(self.path / "clouds.bag", **of_cloud))
            self.assertEqual(done.returncode, 0, done.stdout)
            self.assertIn("the scanner moves", done.stdout)
            if words is None:
                self.assertNotIn("To look at", done.stdout)
            else:
                self.assertIn(words, done.stdout.split("To look at")[1])

    def test_lines_and_one_map_of_clouds(self):
        bag = recording(self.path / "clouds.bag", **GOOD)
        for tool, *options in (("polygons_bag", "--localization", "tf"), ("splinegons_bag", "--localization", "tf"),
                               ("map_bag", "--kinds", "objects,polygons")):
            text, said = self.written(tool, bag, "--cloud-topic", "/points", "--world-frame", "odom", *options)
            self.assertIn(f"{len(SWEEPS)} clouds, {len(SWEEPS)} mapped", said)
            line = json.loads(text.splitlines()[-1])
            if tool == "map_bag":
                continue
            corners = np.array([p[:2] for outline in line.get("polylines", line.get("boundaries"))
                                for p in outline.get("points", outline.get("vertices"))])
            off = [min(abs(x + 5), abs(x - 6), abs(y + 4), abs(y - 4.5),
                       *(abs(math.hypot(x - px, y - py) - radius) for px, py, radius in POSTS)) for x, y in corners]
            self.assertGreater(len(off), 4)
            self.assertLess(np.quantile(off, 0.9), 0.1)

    def test_what_does_not_go_together_is_refused(self):
        bag = recording(self.path / "clouds.bag", **GOOD)
        for tool, *options in (("polygons_bag", "--reflectors", "none.yaml"), ("map_bag", "--pose", "gps"), ("splinegons_bag", "--localization", "gps"),
                               ("objects_bag", "--scan-topic", "/scan")):
            done = run_program(tool, bag, "--cloud-topic", "/points", "--out", self.path / "no", *options)
            self.assertNotEqual(done.returncode, 0, done.stdout)
            self.assertIn("scan", done.stdout)
        done = run_program("objects_bag", bag, "--cloud-topic", "/cloud", "--out", self.path / "no")
        self.assertIn("topics of type sensor_msgs/PointCloud2: /points", done.stdout)


if __name__ == "__main__":
    unittest.main()
