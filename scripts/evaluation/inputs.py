# SPDX-License-Identifier: BSD-3-Clause
"""Conventions of drivers: the same drive as each driver would record it, through check_bag and map_bag. Run by
scripts/evaluate inputs."""
import dataclasses
import json
import math
import pathlib
import re
import subprocess
import tempfile

import genpy
import numpy as np
import rosbag
import yaml
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from polygon_worlds import Caster, Thing
import splinegon_worlds
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

T0_S = 1_700_000_000.0
SECONDS = 20.0
POSTS = ((2.0, 1.6, 0.20), (-2.2, 2.4, 0.15), (3.0, -2.0, 0.30), (-3.4, -1.6, 0.25), (0.4, -3.0, 0.18))
# A room whose right wall has an opening 5 m wide, through which nothing is seen.
WALLS = np.array([(6.0, 2.5), (6.0, 4.5), (-6.0, 4.5), (-6.0, -4.5), (6.0, -4.5), (6.0, -2.5)])
FOUND_M, OFF_M = 0.2, 0.1
MOST_RATIO, LEAST_ERROR_M = 1.2, 0.005
MOUNT_M = 0.2
NEEDS = re.compile(r"set scan/(no_return|beam_order|stamp_at) to (\w+)")


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


def off_m(points):
    """Distance of points from all surfaces."""
    best = np.full(len(points), np.inf)
    for x, y, radius in POSTS:
        best = np.minimum(best, np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius))
    for a, b in zip(WALLS, WALLS[1:]):
        part = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(points - a - part[:, None] * (b - a)).T))
    return best


def transform(t_s, parent, child, x, y, yaw):
    message = TransformStamped()
    message.header.stamp, message.header.frame_id = genpy.Time.from_sec(T0_S + t_s), parent
    message.child_frame_id = child
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation.z, message.transform.rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return message


def write_motion(bag):
    for t_s in np.arange(-1.0, SECONDS + 1.0, 0.02):
        x, y, yaw = map(float, pose(t_s))
        bag.write("/tf", TFMessage([transform(t_s, "odom", "laser", x, y, yaw)]), genpy.Time.from_sec(T0_S + t_s))


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
IDEAL = "as sensor_msgs/LaserScan says"
CONVENTIONS = {
    IDEAL: Convention(),
    "range_max for nothing": Convention(nothing=RANGE_MAX),
    "0 for nothing": Convention(nothing=0.0),
    "NaN for nothing": Convention(nothing=math.nan),
    "measured from the last element on": Convention(backwards=True),
    "stamped at the last beam": Convention(stamped_at=1.0),
    "stamped in the middle": Convention(stamped_at=0.5),
    "from the last element on, stamped at the end": Convention(backwards=True, stamped_at=1.0),
    "the number of beams varies": Convention(varying=True),
}


def scan_message(caster, scanner, convention, t_s, chance):
    count = scanner.beams - (int(chance.integers(0, 4)) if convention.varying else 0)
    increment = math.radians(scanner.field_deg) / scanner.beams
    bearings = -0.5 * math.radians(scanner.field_deg) + increment * np.arange(count)
    between_s = scanner.sweep / scanner.rate_hz / scanner.beams
    order = np.arange(count)[::-1] if convention.backwards else np.arange(count)
    x, y, yaw = pose(t_s + between_s * order)
    directions = np.stack((np.cos(yaw + bearings), np.sin(yaw + bearings)), 1)
    ranges = caster.cast(np.stack((x, y), 1), directions).range_m
    ranges = ranges + chance.normal(0.0, scanner.sigma_m, count)
    nothing = scanner.range_m if convention.nothing == RANGE_MAX else convention.nothing
    ranges = np.where(ranges < scanner.range_m, ranges, nothing)
    message = LaserScan()
    message.header.frame_id = "laser"
    message.header.stamp = genpy.Time.from_sec(T0_S + t_s + convention.stamped_at * between_s * (count - 1))
    message.angle_min, message.angle_max, message.angle_increment = bearings[0], bearings[-1], increment
    message.time_increment, message.scan_time = between_s, 1.0 / scanner.rate_hz
    message.range_min, message.range_max, message.ranges = 0.05, scanner.range_m, ranges.astype(np.float32).tolist()
    return message, t_s + scanner.sweep / scanner.rate_hz + 0.002


def write_scans(path, scanner, convention):
    caster, chance = Caster(list(things())), np.random.default_rng(1)
    with rosbag.Bag(str(path), "w") as bag:
        write_motion(bag)
        for t_s in np.arange(0.0, SECONDS, 1.0 / scanner.rate_hz):
            message, at_s = scan_message(caster, scanner, convention, t_s, chance)
            bag.write("/scan", message, genpy.Time.from_sec(T0_S + at_s))


# --- what the tools make of it


def run_tool(programs, name, *arguments):
    return subprocess.run([programs / name, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, check=False)


def features_of(path):
    """The map after the last line of map_bag."""
    features = {}
    for line in path.read_text().splitlines():
        update = json.loads(line)
        if update["full"]:
            features.clear()
        for gone in update["gone"]:
            features.pop(gone["id"], None)
        for feature in update["changed"]:
            features[feature["id"]] = feature
    return list(features.values())


@dataclasses.dataclass
class Score:
    found: int        # posts
    error_m: float    # RMS of these
    off: float        # part of the vertices of lines that is on nothing
    says: str         # of conventions, by map_bag and check_bag
    code: int         # of map_bag


def error_of(feature, post):
    """How far a feature is from a post: its centre from the post's, or the vertices of a line from the surface."""
    if feature["kind"] in ("ellipse", "box"):
        return math.hypot(feature["x"] - post[0], feature["y"] - post[1])
    x, y = np.array([point[:2] for point in feature["outline"]]).T
    return float(np.sqrt(np.mean(np.square(np.hypot(x - post[0], y - post[1]) - post[2]))))


def score_of(path, says, code):
    features = features_of(path) if code == 0 else []
    errors = [min((error_of(feature, post) for feature in features), default=math.inf) for post in POSTS]
    found = [error for error in errors if error < FOUND_M]
    vertices = np.array([point[:2] for feature in features if feature["kind"] in ("polyline", "boundary")
                         for point in feature["outline"]]).reshape(-1, 2)
    return Score(len(found), float(np.sqrt(np.mean(np.square(found)))) if found else math.nan,
                 float((off_m(vertices) > OFF_M).mean()) if len(vertices) else 0.0, says, code)


def mapped(programs, bag, folder, params=None):
    """The score of a bag with these parameters of the section `scan`, beside those of cfg/map.yaml."""
    config = yaml.safe_load((ROOT / "cfg/map.yaml").read_text())
    config.setdefault("scan", {}).update(params or {})
    (folder / "map.yaml").write_text(yaml.safe_dump(config))
    out = folder / "map.jsonl"
    out.unlink(missing_ok=True)
    done = run_tool(programs, "map_bag", bag, "--scan-topic", "/scan", "--world-frame", "odom", "--config",
                    folder / "map.yaml", "--out", out)
    return score_of(out, "\n".join(line for line in done.stderr.splitlines() if " % of " not in line), done.returncode)


def scans(programs, scanner, convention):
    """The score of the drive as it is recorded, and with the parameters that the tools ask for; None without any."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        bag = folder / "drive.bag"
        write_scans(bag, SCANNERS[scanner], CONVENTIONS[convention])
        score = mapped(programs, bag, folder)
        score.says += "\n" + run_tool(programs, "check_bag", bag).stdout.partition("To look at")[2]
        params = dict(NEEDS.findall(score.says))
        return score, (params, mapped(programs, bag, folder, params)) if params else None


# --- IMU and receiver


def of_topic(topic, change):
    """A fault that changes the messages of a topic, of which those are left out for which `change` returns False."""
    def alter(name, message, at):
        return name != topic or change(message, at) is not False
    return alter


def scaled(field, factors):
    def change(message, _):
        vector = getattr(message, field)
        for axis, factor in zip("xyz", factors):
            setattr(vector, axis, factor * getattr(vector, axis))
    return change


def without_gravity(message, _):
    message.linear_acceleration.z -= 9.81


def to_ned(message, _):
    for vector in (message.linear_acceleration, message.angular_velocity):
        vector.y, vector.z = -vector.y, -vector.z


def in_bursts(message, at):
    """Ten samples are stamped when the last of them is received."""
    message.header.stamp = genpy.Time.from_sec(0.1 * math.ceil(at.to_sec() / 0.1))


def ahead(message, _):
    message.header.stamp += genpy.Duration(18)


def without_altitude(message, _):
    message.altitude = math.nan


def jumping(message, at):
    if int(at.to_sec() / 20.0) % 2:
        message.altitude -= 47.0


def without_fix(message, at):
    if int(at.to_sec()) % 4 == 0:
        message.status.status, message.latitude, message.longitude = -1, 0.0, 0.0


def without_covariance(message, _):
    message.position_covariance, message.position_covariance_type = [0.0] * 9, 0


DEGREES = 180.0 / math.pi
FAULTS = {
    IDEAL: lambda *_: True,
    "force in g": of_topic("/imu", scaled("linear_acceleration", [1.0 / 9.80665] * 3)),
    "rates in deg/s": of_topic("/imu", scaled("angular_velocity", [DEGREES] * 3)),
    "x ahead, y to the right, z down": of_topic("/imu", to_ned),
    "rates positive to the right": of_topic("/imu", scaled("angular_velocity", [1.0, -1.0, -1.0])),
    "gravity removed": of_topic("/imu", without_gravity),
    "stamped in bursts of ten": of_topic("/imu", in_bursts),
    "fixes by the time of GPS": of_topic("/fix", ahead),
    "altitude NaN": of_topic("/fix", without_altitude),
    "altitude jumps by 47 m": of_topic("/fix", jumping),
    "a quarter STATUS_NO_FIX at 0, 0": of_topic("/fix", without_fix),
    "covariance unknown": of_topic("/fix", without_covariance),
}
MOST_POSITION_M = 0.2  # beside MOST_RATIO


@dataclasses.dataclass
class PoseScore:
    lines: int
    error_m: float  # RMS of x and y
    says: set       # warnings and findings, without their numbers


def sentences(text):
    return {re.sub(r"-?\d+(\.\d+)?", "#", line).strip() for line in text.splitlines() if line.strip()}


def navigation(programs, world, fault):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        bag, out = folder / "fault.bag", folder / "map.jsonl"
        with rosbag.Bag(f"{world}.bag") as whole, rosbag.Bag(str(bag), "w") as altered:
            for topic, message, at in whole.read_messages():
                if FAULTS[fault](topic, message, at):
                    altered.write(topic, message, at)
        done = run_tool(programs, "map_bag", bag, "--scan-topic", "/scan", "--lidar-frame", "laser", "--pose", "gps",
                        "--kinds", "splinegons", "--out", out)
        truth = json.loads(pathlib.Path(f"{world}.truth.json").read_text())["scans"]
        places = {round(stamp, 3): place for stamp, *place in zip(truth["stamp"], truth["x"], truth["y"])}
        poses = [json.loads(line) for line in out.read_text().splitlines()] if done.returncode == 0 else []
        errors = np.array([np.subtract((line["pose"]["x"], line["pose"]["y"]), places[round(line["stamp"], 3)])
                           for line in poses]).reshape(-1, 2)
        # The origin is the first fix, which has an error of its own.
        errors = errors - np.median(errors, axis=0) if len(errors) else errors
        says = [line for line in done.stderr.splitlines() if " % of " not in line]
        findings = run_tool(programs, "check_bag", bag).stdout.partition("To look at")[2].partition("Map it")[0]
        return PoseScore(len(poses), float(np.sqrt((errors**2).sum(1).mean())) if len(poses) else math.nan,
                         sentences("\n".join(says).replace(str(bag), "") + "\n" + findings))


def navigation_verdict(score, ideal):
    """(text, whether it is right or named)"""
    text = f"{score.lines} scans, {score.error_m:.2f} m" if score.lines else "no pose"
    said = sorted(score.says - ideal.says)
    if score.lines >= 0.9 * ideal.lines and \
            score.error_m <= max(MOST_RATIO * ideal.error_m, ideal.error_m + MOST_POSITION_M):
        return f"right: {text}", True
    return (f"named: {text}; " + said[0].replace("|", "/"), True) if said else (f"**silent**: {text}", False)


# --- report


def is_right(score, ideal):
    return score.code == 0 and score.found >= ideal.found and score.off <= ideal.off + 0.01 and \
        score.error_m <= max(MOST_RATIO * ideal.error_m, LEAST_ERROR_M)


INTRODUCTION = """
A drive of {seconds:.0f} s, to and fro and turning at up to 0.7 rad/s, in a room with an opening and {posts} posts, as
{scanners} scanners measure it and as their drivers may send it. Each is mapped by `map_bag` with `cfg/map.yaml` and read
by `check_bag`. Right is a map with the same posts, which are at most {ratio} times as far off as with the ideal
messages (or {least:.0f} mm), and with no more than 1 % more of the vertices of its lines on nothing. What is not right
at once is to be named, with the parameter that puts it right.
"""


def verdict_of(score, retry, ideal):
    """(text, whether the case is right at once or named and right then)"""
    text = f"{score.found} posts, {1e3 * score.error_m:.0f} mm, {1e2 * score.off:.0f} % off"
    if is_right(score, ideal):
        return f"right: {text}", True
    if retry is None:
        return f"**silent**: {text}", False
    params, again = retry
    text = f"{text}; " + ", ".join(f"`{name}: {value}`" for name, value in params.items()) + \
        f": {again.found} posts, {1e3 * again.error_m:.0f} mm, {1e2 * again.off:.0f} % off"
    return (f"named: {text}", True) if is_right(again, ideal) else (f"**named, not right**: {text}", False)


GPS = """
A flight around an ellipse by IMU and GPS as `scripts/evaluate splinegons` simulates it, and what drivers do to its
messages. Right is a pose with at most {ratio} times the error of the ideal messages (or {least:.1f} m more) at nine
tenths of the scans; else a warning or finding is to name the fault that the ideal messages do not give.
"""


def report_of(measured, results, faults):
    rows, good = [], 0
    for scanner in SCANNERS:
        ideal = results[scanner, IDEAL][0]
        verdicts = [verdict_of(*results[scanner, convention], ideal) for convention in CONVENTIONS]
        good += sum(ok for _, ok in verdicts)
        rows.append((scanner, *(text for text, _ in verdicts)))
    count = len(SCANNERS) * len(CONVENTIONS)
    named = {fault: navigation_verdict(score, faults[IDEAL]) for fault, score in faults.items()}
    well = sum(ok for _, ok in named.values())
    return "\n".join((
        "# Conventions of drivers\n",
        introduction(measured, INTRODUCTION.format(seconds=SECONDS, posts=len(POSTS), scanners=len(SCANNERS),
                                                   ratio=MOST_RATIO, least=1e3 * LEAST_ERROR_M)),
        targets_section([("every convention of a scanner is right at once, or named and right then",
                          f"{good} of {count}", good == count),
                         ("every fault of an IMU or a receiver is right or named", f"{well} of {len(named)}",
                          well == len(named))]),
        section("Scanners", *(table((convention, "the map"), [(row[0], row[1 + i]) for row in rows])
                              for i, convention in enumerate(CONVENTIONS))),
        section("IMU and receiver", prose(GPS.format(ratio=MOST_RATIO, least=MOST_POSITION_M)),
                table(("messages", "the pose"), [(fault, text) for fault, (text, _) in named.items()])),
    ))


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "a part of the scanners")
    parser.add_argument("--tool", required=True, type=pathlib.Path, help="map_bag; check_bag is beside it")
    parser.add_argument("--programs", type=pathlib.Path)
    parser.add_argument("--scanners", nargs="*", choices=list(SCANNERS), default=list(SCANNERS))
    arguments = parser.parse_args()
    output = output_folder(arguments, len(arguments.scanners) == len(SCANNERS))
    measured = facts(arguments)
    for name in set(SCANNERS) - set(arguments.scanners):
        del SCANNERS[name]
    programs = arguments.tool.parent
    pieces = {(scanner, convention): (programs, scanner, convention) for scanner in SCANNERS
              for convention in CONVENTIONS}
    drives = run_pieces(scans, pieces, "drives") if pieces else {}
    with tempfile.TemporaryDirectory() as folder:
        world = pathlib.Path(folder) / splinegon_worlds.write_world(folder, "ellipse", 1)
        faults = run_pieces(navigation, {fault: (programs, world, fault) for fault in FAULTS}, "flights")
    write(output, "inputs.md", report_of(measured, drives, {fault: faults[fault] for fault in FAULTS}))


if __name__ == "__main__":
    main()
