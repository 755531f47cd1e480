#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What drivers of IMUs and receivers do otherwise, and which is made good: the pose of splinegons_bag is as good as without
it. What is not made good is named: nothing_mapped_test. No roscore."""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

import genpy
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import small_bags as bags  # noqa: E402
from bag_tools import run_program  # noqa: E402

SECONDS = 40.0


def stamped(stamp_of):
    """A change of stamps, by their time in the recording (s)."""
    def change(msg, t):
        msg.header.stamp += genpy.Duration.from_sec(stamp_of(t) - t)
        return msg
    return change


def read_at_once(count, apart_s=0.0):
    """Stamped when the last of so many samples was read."""
    def stamp(t):
        k = round(100 * t)
        behind = count - 1 - k % count
        return (k + behind) / 100 + 0.0005 - behind * apart_s
    return stamped(stamp)


def flat(msg, _):
    msg.altitude = math.nan
    return msg


def flat_without_variance(msg, _):
    msg.altitude, msg.position_covariance = math.nan, [*msg.position_covariance[:8], 0.0]
    return msg


def unknown(*covariance):
    def change(msg, _):
        msg.position_covariance_type, msg.position_covariance = 0, list(covariance)
        return msg
    return change


def when(condition, change):
    return lambda msg, t: change(msg, t) if condition(t) else msg


def raised(by_m):
    def change(msg, _):
        msg.altitude += by_m
        return msg
    return change


def no_fix(msg, _):
    msg.status.status, msg.latitude, msg.longitude, msg.altitude = -1, 0.0, 0.0, 0.0
    return msg


ALTITUDE = "the altitude of the fixes jumps by "


class ImuAndFixesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.good_m, cls.good_rad = cls.errors()

    @classmethod
    def errors(cls, warning="", seconds=SECONDS, **changes):
        """Root mean squares of the position's error (m) and of the yaw's."""
        drive = bags.Drive(seconds)
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            bag, out = bags.write(folder / "in.bag", bags.car(seconds, **changes)), folder / "out"
            origin = ",".join(map(str, bags.ORIGIN))
            done = run_program("splinegons_bag", bag, "--origin", origin, "--out", out, stderr=subprocess.PIPE)
            said = done.stdout + done.stderr
            assert done.returncode == 0, said
            warnings = [line for line in done.stderr.splitlines() if "warning" in line]
            assert bool(warnings) == bool(warning) and all(warning in line for line in warnings), said
            poses = [(line["stamp"], line["pose"]) for line in map(json.loads, out.read_text().splitlines())]
        begin_s = bags.at(0.0).to_sec()
        off = [(pose["x"] - x, pose["y"] - y, math.remainder(pose["yaw"] - yaw, math.tau))
               for stamp, pose in poses for x, y, yaw in [drive.pose(stamp - begin_s)]]
        assert len(off) > 50, said
        return math.sqrt(np.mean([x * x + y * y for x, y, _ in off])), math.sqrt(np.mean([yaw**2 for *_, yaw in off]))

    def check(self, warning="", sigma_m=0.0, sigma_rad=0.02, **changes):
        error_m, error_rad = self.errors(warning, **changes)
        self.assertLess(error_m, 1.2 * self.good_m + sigma_m + 0.05)
        self.assertLess(error_rad, 1.2 * self.good_rad + sigma_rad)

    def test_good(self):
        self.assertLess(self.good_m, 0.8)
        self.assertLess(self.good_rad, 0.05)

    def test_stamps_in_bunches(self):
        for count, apart_s in ((4, 0.0), (10, 0.0), (10, 0.0001), (30, 0.0005)):
            with self.subTest(count=count, apart_s=apart_s):
                self.check(imu=read_at_once(count, apart_s))

    def test_coarse_stamps(self):
        self.check(imu=stamped(lambda t: math.floor(10 * t + 1e-6) / 10))

    def test_jitter_of_stamps(self):
        rng = np.random.default_rng(1)
        for sigma_s in (0.002, 0.005):
            with self.subTest(sigma_s=sigma_s):
                self.check(imu=stamped(lambda t, sigma_s=sigma_s: max(t + sigma_s * rng.normal(), 0.0)), sigma_rad=0.08)

    def test_fixes_without_altitude(self):
        for change in (flat, flat_without_variance, when(lambda t: 15 < t < 30, flat), when(lambda t: round(5 * t) % 2, flat)):
            self.check(fix=change)

    def test_altitudes_that_jump(self):
        for condition, by_m in ((lambda t: t > 20, -47.0), (lambda t: t > 3, 47.0), (lambda t: t % 20 > 10, -47.0)):
            self.check(ALTITUDE, fix=when(condition, raised(by_m)))

    def test_covariance_unknown(self):
        for covariance in ([0.0] * 9, [-1.0] + [0.0] * 8, [1e12, 5.0, 5.0, 5.0, -3.0, 5.0, 5.0, 5.0, math.nan]):
            self.check(fix=unknown(*covariance), sigma_m=0.5, sigma_rad=0.04, seconds=60.0)  # 2 m are assumed, not 0.3 m

    def test_no_fix_now_and_then(self):
        for condition in (lambda t: round(5 * t) % 3 == 0, lambda t: 4 < t < 6, lambda t: 20 < t < 22):
            self.check(fix=when(condition, no_fix), sigma_m=0.3)  # fewer fixes


if __name__ == "__main__":
    unittest.main()
