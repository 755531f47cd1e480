# SPDX-License-Identifier: BSD-3-Clause
"""Scans and clouds of a drive in a room, as drivers may send them: two sections of scripts/evaluate inputs."""
import dataclasses
import functools
import math
import pathlib
import re
import tempfile
import typing

import numpy as np
import rosbag
import yaml
from sensor_msgs.msg import LaserScan, PointCloud2, PointField
from tf2_msgs.msg import TFMessage

from inputs_tools import MOST_RATIO, T0_S, Outcome, check_bag, map_bag, stamp, transform
from polygon_worlds import Caster, Thing
from report import ROOT

SECONDS = 20.0
POSTS = ((2.0, 1.6, 0.20), (-2.2, 2.4, 0.15), (3.0, -2.0, 0.30), (-3.4, -1.6, 0.25), (0.4, -3.0, 0.18))
# A room whose right wall has an opening 5 m wide, through which nothing is seen.
WALLS = np.array([(6.0, 2.5), (6.0, 4.5), (-6.0, 4.5), (-6.0, -4.5), (6.0, -4.5), (6.0, -2.5)])
FOUND_M, OFF_M = 0.2, 0.1
LEAST_ERROR_M = 0.005  # beside MOST_RATIO
MOUNT_M = 0.2


# --- the world, and a drive in it


def pose(t_s):
    """x, y, yaw of the scanner at these times."""
    x, y, yaw = 0.8 * np.sin(0.25 * t_s), 0.5 * np.sin(0.4 * t_s), 1.2 * np.sin(0.6 * t_s)
    return x + MOUNT_M * np.cos(yaw), y + MOUNT_M * np.sin(yaw), yaw


def things():
    """Walls of no width, there and back, and posts."""
    yield Thing("walls", "wall", "wall", np.vstack((WALLS, WALLS[-2:0:-1])))
    for i, post in enumerate(POSTS):
        yield Thing(f"post_{i}", "post", "post", circle=post)


def measured_m(caster, times_s, bearings):
    """Range at each bearing of the scanner, measured at its own time; inf where nothing is."""
    x, y, yaw = pose(times_s)
    directions = np.stack((np.cos(yaw + bearings), np.sin(yaw + bearings)), 1)
    return caster.cast(np.stack((x, y), 1), directions).range_m


def off_m(points):
    """Distance of points from all surfaces."""
    best = np.full(len(points), np.inf)
    for x, y, radius in POSTS:
        best = np.minimum(best, np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius))
    for a, b in zip(WALLS, WALLS[1:]):
        part = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(points - a - part[:, None] * (b - a)).T))
    return best


def write_motion(bag):
    for t_s in np.arange(-1.0, SECONDS + 1.0, 0.02):
        x, y, yaw = map(float, pose(t_s))
        quaternion = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
        bag.write("/tf", TFMessage([transform(t_s, "odom", "laser", (x, y, 0.0), quaternion)]), stamp(t_s))


# --- scanners, and what their drivers do


@dataclasses.dataclass(frozen=True)
class Scanner:
    beams: int
    field_deg: float
    range_m: float
    rate_hz: float
    sigma_m: float
    sweep: float  # part of the period in which the beams are measured


SCANNERS = {
    "1081 beams, 270 deg, 40 Hz": Scanner(1081, 270.0, 10.0, 40.0, 0.01, 0.75),
    "1081 beams, 270 deg, 25 Hz": Scanner(1081, 270.0, 20.0, 25.0, 0.008, 0.75),
    "541 beams, 270 deg, 50 Hz": Scanner(541, 270.0, 20.0, 50.0, 0.012, 0.75),
    "811 beams, 270 deg, 15 Hz": Scanner(811, 270.0, 25.0, 15.0, 0.01, 0.75),
    "726 beams, 240 deg, 10 Hz": Scanner(726, 240.0, 5.6, 10.0, 0.01, 0.67),
    "361 beams, 180 deg, 75 Hz": Scanner(361, 180.0, 30.0, 75.0, 0.01, 0.5),
    "360 beams, 360 deg, 10 Hz": Scanner(360, 360.0, 8.0, 10.0, 0.015, 1.0),
    "720 beams, 360 deg, 7 Hz": Scanner(720, 360.0, 10.0, 7.0, 0.015, 1.0),
    "1440 beams, 360 deg, 15 Hz": Scanner(1440, 360.0, 16.0, 15.0, 0.012, 1.0),
    "450 beams, 360 deg, 10 Hz": Scanner(450, 360.0, 8.0, 10.0, 0.01, 1.0),
}


@dataclasses.dataclass(frozen=True)
class Convention:
    nothing: float = math.inf  # what is sent where nothing is met; math.pi: range_max
    backwards: bool = False    # the last element of the array is measured first
    stamped_at: float = 0.0    # part of the sweep after which it is stamped
    varying: bool = False      # the number of beams changes from scan to scan


RANGE_MAX = math.pi
IDEAL_SCAN = "as sensor_msgs/LaserScan says"
CONVENTIONS = {
    IDEAL_SCAN: Convention(),
    "range_max for nothing": Convention(nothing=RANGE_MAX),
    "0 for nothing": Convention(nothing=0.0),
    "NaN for nothing": Convention(nothing=math.nan),
    "measured from the last element on": Convention(backwards=True),
    "stamped at the last beam": Convention(stamped_at=1.0),
    "stamped in the middle": Convention(stamped_at=0.5),
    "from the last element on, stamped at the end": Convention(backwards=True, stamped_at=1.0),
    "the number of beams varies": Convention(varying=True),
}


def scan_message(caster, scanner, convention, t_s, noise, counts):
    """`noise`, `counts`: generators, so that conventions differ in nothing but what they say."""
    count = scanner.beams - (int(counts.integers(0, 4)) if convention.varying else 0)
    increment = math.radians(scanner.field_deg) / scanner.beams
    bearings = -0.5 * math.radians(scanner.field_deg) + increment * np.arange(count)
    between_s = scanner.sweep / scanner.rate_hz / scanner.beams
    order = np.arange(count)[::-1] if convention.backwards else np.arange(count)
    ranges = measured_m(caster, t_s + between_s * order, bearings)
    ranges = ranges + noise.normal(0.0, scanner.sigma_m, scanner.beams)[:count]
    nothing = scanner.range_m if convention.nothing == RANGE_MAX else convention.nothing
    ranges = np.where(ranges < scanner.range_m, ranges, nothing)
    message = LaserScan()
    message.header.frame_id = "laser"
    message.header.stamp = stamp(t_s + convention.stamped_at * between_s * (count - 1))
    message.angle_min, message.angle_max, message.angle_increment = bearings[0], bearings[-1], increment
    message.time_increment, message.scan_time = between_s, 1.0 / scanner.rate_hz
    message.range_min, message.range_max, message.ranges = 0.05, scanner.range_m, ranges.astype(np.float32).tolist()
    return message, t_s + scanner.sweep / scanner.rate_hz + 0.002


def write_scans(path, scanner, convention):
    caster, noise, counts = Caster(list(things())), np.random.default_rng(1), np.random.default_rng(2)
    with rosbag.Bag(str(path), "w") as bag:
        write_motion(bag)
        for t_s in np.arange(0.0, SECONDS, 1.0 / scanner.rate_hz):
            message, at_s = scan_message(caster, scanner, convention, t_s, noise, counts)
            bag.write("/scan", message, stamp(at_s))


# --- clouds, and what their drivers do


RINGS, COLUMNS, SWEEP_S, CLOUD_RANGE_M, CLOUD_SIGMA_M = 8, 900, 0.1, 10.0, 0.01
FLOAT, DOUBLE, WHOLE, SIGNED = PointField.FLOAT32, PointField.FLOAT64, PointField.UINT32, PointField.INT32
NUMPY = {FLOAT: "f4", DOUBLE: "f8", WHOLE: "u4", SIGNED: "i4"}


def of_first(unit_s):
    """Times after the first point."""
    return lambda after_s, at_s, has_return: after_s / unit_s


def of_clock(unit_s):
    return lambda after_s, at_s, has_return: (at_s + after_s) / unit_s


def of_boot(unit_s):
    """By a clock that began 1,000 s before the recording."""
    return lambda after_s, at_s, has_return: (at_s - T0_S + 1000.0 + after_s) / unit_s


def of_last(after_s, at_s, has_return):
    return after_s - SWEEP_S


def spoilt(number, value, part=0.003):
    """`value` in the place of a part of the times."""
    def changed(after_s, at_s, has_return):
        numbers = np.array(number(after_s, at_s, has_return), dtype=float)
        numbers[np.random.default_rng(3).random(numbers.shape) < part] = value
        return numbers
    return changed


@dataclasses.dataclass(frozen=True)
class CloudFormat:
    field: str = "time"          # of the times of points; empty: none
    kind: int = FLOAT
    number: typing.Callable = of_first(1.0)  # from s after the first point, its s of the clock, whether it has a return
    stamped_at: float = 0.0      # part of the sweep after which it is stamped
    late_s: float = 0.0          # so much later than that it is stamped
    nothing: float = math.nan    # x, y and z without a return; None: such points are left out
    columns_first: bool = False  # a row of the cloud is what all rings measure at once
    to_the_left: bool = False    # it sweeps counter-clockwise
    xyz: int = FLOAT
    big_endian: bool = False
    row_step: bool = True        # is not left out


IDEAL_CLOUD = "`time` float32, s after the stamp, NaN for nothing"
FORMATS = {
    IDEAL_CLOUD: CloudFormat(),
    "counter-clockwise": CloudFormat(to_the_left=True),
    "`t` uint32, ns; 0, 0, 0 for nothing": CloudFormat("t", WHOLE, of_first(1e-9), nothing=0.0),
    "`t` uint32, us": CloudFormat("t", WHOLE, of_first(1e-6)),
    "`time` float32, us": CloudFormat(number=of_first(1e-6)),
    "`offset_time` uint32, ns, returns alone": CloudFormat("offset_time", WHOLE, of_first(1e-9), nothing=None),
    "`time` float32, s before the last point, stamped then, returns alone":
        CloudFormat(number=of_last, stamped_at=1.0, nothing=None),
    "`timestamp` float64, s of the clock": CloudFormat("timestamp", DOUBLE, of_clock(1.0)),
    "`timestamp` float64, s of the clock, stamped 40 ms late":
        CloudFormat("timestamp", DOUBLE, of_clock(1.0), late_s=0.04),
    "`timestamp` float64, ns of the clock, returns alone":
        CloudFormat("timestamp", DOUBLE, of_clock(1e-9), nothing=None),
    "`time_stamp` float64, s of the clock, NaN without a return":
        CloudFormat("time_stamp", DOUBLE, lambda after_s, at_s, has: np.where(has, at_s + after_s, np.nan)),
    "`timestamp` float64, s since the device began": CloudFormat("timestamp", DOUBLE, of_boot(1.0)),
    "`t` uint32, us since the device began": CloudFormat("t", WHOLE, of_boot(1e-6)),
    "`time` float32, parts of the sweep": CloudFormat(number=of_first(SWEEP_S)),
    "`time_offset_ns` int32": CloudFormat("time_offset_ns", SIGNED, of_first(1e-9)),
    "`time` float32, s of the clock: all alike": CloudFormat(number=of_clock(1.0)),
    "times after the first point, stamped at the last": CloudFormat(stamped_at=1.0),
    "no times": CloudFormat(field=""),
    "`time` 0 everywhere": CloudFormat(number=lambda after_s, *_: 0.0 * after_s),
    "`time` NaN everywhere": CloudFormat(number=spoilt(of_first(1.0), math.nan, 2.0)),
    "0.3 % of the times NaN": CloudFormat(number=spoilt(of_first(1.0), math.nan)),
    "0.3 % of the times an hour off": CloudFormat(number=spoilt(of_first(1.0), 3600.0)),
    "row_step 0": CloudFormat(row_step=False),
    "a row for each column": CloudFormat(columns_first=True),
    "returns alone": CloudFormat(nothing=None),
    "x, y, z float64": CloudFormat(xyz=DOUBLE),
    "big-endian": CloudFormat(big_endian=True),
}


@functools.lru_cache(maxsize=2)
def sweeps(to_the_left):
    """(start in s, ranges of rings and columns), of all of the drive."""
    caster, chance, result = Caster(list(things())), np.random.default_rng(2), []
    for t_s in np.arange(0.0, SECONDS, SWEEP_S):
        ranges = measured_m(caster, t_s + SWEEP_S * np.arange(COLUMNS) / COLUMNS, bearings_of(to_the_left))
        ranges = ranges + chance.normal(0.0, CLOUD_SIGMA_M, (RINGS, COLUMNS))
        result.append((t_s, np.where(ranges < CLOUD_RANGE_M, ranges, np.nan)))
    return result


def bearings_of(to_the_left):
    return (1.0 if to_the_left else -1.0) * 2.0 * math.pi * np.arange(COLUMNS) / COLUMNS


def cloud_message(t_s, ranges, form):
    order = ">" if form.big_endian else "<"
    bearings, rise = bearings_of(form.to_the_left), np.tan(np.radians(np.linspace(-7.0, 7.0, RINGS)))[:, None]
    after_s = np.broadcast_to(SWEEP_S * np.arange(COLUMNS) / COLUMNS, ranges.shape)
    values = [(name, form.xyz, ranges * along if form.nothing is None else
               np.where(np.isfinite(ranges), ranges * along, form.nothing))
              for name, along in (("x", np.cos(bearings)), ("y", np.sin(bearings)), ("z", rise))]
    values.append(("intensity", FLOAT, np.full(ranges.shape, 7.0)))
    if form.field:
        values.append((form.field, form.kind, form.number(after_s, T0_S + t_s, np.isfinite(ranges))))
    points = np.zeros(ranges.shape, np.dtype([(name, order + NUMPY[kind]) for name, kind, _ in values]))
    for name, _, numbers in values:
        points[name] = numbers
    if form.columns_first:
        points = np.ascontiguousarray(points.T)
    elif form.nothing is None:
        points = points.T[np.isfinite(ranges.T)][None]
    message = PointCloud2(height=points.shape[0], width=points.shape[1], point_step=points.dtype.itemsize,
                          is_bigendian=form.big_endian, is_dense=form.nothing is None, data=points.tobytes())
    message.row_step = points.shape[1] * points.dtype.itemsize if form.row_step else 0
    message.fields = [PointField(name, points.dtype.fields[name][1], kind, 1) for name, kind, _ in values]
    message.header.frame_id = "laser"
    message.header.stamp = stamp(t_s + form.stamped_at * SWEEP_S * (COLUMNS - 1) / COLUMNS + form.late_s)
    return message


def write_clouds(path, form):
    with rosbag.Bag(str(path), "w") as bag:
        write_motion(bag)
        for t_s, ranges in sweeps(form.to_the_left):
            bag.write("/points", cloud_message(t_s, ranges, form), stamp(t_s + SWEEP_S + 0.002))


# --- what the tools make of it


@dataclasses.dataclass
class RoomScore:
    found: int      # posts
    error_m: float  # RMS of these
    off: float      # part of the vertices of lines that is on nothing

    def __str__(self):
        return f"{self.found} posts, {1e3 * self.error_m:.0f} mm, {1e2 * self.off:.0f} % off"

    def is_right(self, ideal):
        return self.found >= ideal.found and self.off <= ideal.off + 0.01 and \
            self.error_m <= max(MOST_RATIO * ideal.error_m, LEAST_ERROR_M)


def error_of(feature, post):
    """How far a feature is from a post: its centre from the post's, or the vertices of a line from the surface."""
    if feature["kind"] in ("ellipse", "box"):
        return math.hypot(feature["x"] - post[0], feature["y"] - post[1])
    x, y = np.array([point[:2] for point in feature["outline"]]).T
    return float(np.sqrt(np.mean(np.square(np.hypot(x - post[0], y - post[1]) - post[2]))))


def score_of(features):
    errors = [min((error_of(feature, post) for feature in features), default=math.inf) for post in POSTS]
    found = [error for error in errors if error < FOUND_M]
    vertices = np.array([point[:2] for feature in features if feature["kind"] in ("polyline", "boundary")
                         for point in feature["outline"]]).reshape(-1, 2)
    return RoomScore(len(found), float(np.sqrt(np.mean(np.square(found)))) if found else math.nan,
                     float((off_m(vertices) > OFF_M).mean()) if len(vertices) else 0.0)


def mapped(programs, bag, topic, params=None):
    """What map_bag makes of a bag with cfg/map.yaml and these parameters: {"section/name": value}."""
    config = yaml.safe_load((ROOT / "cfg/map.yaml").read_text())
    for name, value in (params or {}).items():
        *section, last = name.split("/")
        (config.setdefault(section[0], {}) if section else config)[last] = value
    config_path = bag.parent / "map.yaml"
    config_path.write_text(yaml.safe_dump(config))
    features, warned = map_bag(programs, bag, bag.parent / "map.jsonl", *topic, "--world-frame", "odom", "--config",
                               config_path)
    return Outcome(score_of(features), warned)


def asked_for(sentences):
    """The parameters that these sentences ask for."""
    text = "\n".join(sentences)
    params = {f"scan/{name}": value for name, value in re.findall(r"set scan/(\w+) to (\w+)", text)}
    params.update(("scan_pose_offset_s", float(value))
                  for value in re.findall(r"scan_pose_offset_s should be (-?[\d.]+) s", text))
    return params


def tried(programs, write, topic):
    """What the tools make of the drive as it is recorded, and with the parameters that they ask for, if they name
    nothing else; None if they do."""
    with tempfile.TemporaryDirectory() as name:
        bag = pathlib.Path(name) / "drive.bag"
        write(bag)
        outcome = mapped(programs, bag, topic)
        outcome.findings = check_bag(programs, bag)
        params = asked_for([*outcome.warned.values(), *outcome.findings.values()])
        if not params or not all(asked_for([sentence]) for sentence in outcome.warned.values()):
            return outcome, None
        named = ", ".join(f"{parameter}: {value}" for parameter, value in params.items())
        return outcome, (named, mapped(programs, bag, topic, params))


def scans(programs, scanner, convention):
    return tried(programs, lambda bag: write_scans(bag, SCANNERS[scanner], CONVENTIONS[convention]),
                 ("--scan-topic", "/scan"))


def clouds(programs, form):
    return tried(programs, lambda bag: write_clouds(bag, FORMATS[form]), ("--cloud-topic", "/points"))
