# SPDX-License-Identifier: BSD-3-Clause
"""Conventions of drivers: the same drives and flights as each driver would record them, through map_bag and check_bag.
Run by scripts/evaluate inputs."""
import dataclasses
import json
import math
import pathlib
import tempfile

import genpy
import numpy as np
import rosbag

import inputs_camera
import inputs_ground
import inputs_room
import splinegon_worlds
from inputs_tools import MOST_RATIO, Outcome, check_bag, map_bag, verdict_of
from report import (arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

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
IDEAL_MESSAGES = "as sensor_msgs/Imu and NavSatFix say"
FAULTS = {
    IDEAL_MESSAGES: lambda *_: True,
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

    def __str__(self):
        return f"{self.lines} scans, {self.error_m:.2f} m" if self.lines else "no pose"

    def is_right(self, ideal):
        return self.lines >= 0.9 * ideal.lines and \
            self.error_m <= max(MOST_RATIO * ideal.error_m, ideal.error_m + MOST_POSITION_M)


def navigation(programs, world, fault):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        bag, out = folder / "fault.bag", folder / "map.jsonl"
        with rosbag.Bag(f"{world}.bag") as whole, rosbag.Bag(str(bag), "w") as altered:
            for topic, message, at in whole.read_messages():
                if FAULTS[fault](topic, message, at):
                    altered.write(topic, message, at)
        _, warned = map_bag(programs, bag, out, "--scan-topic", "/scan", "--lidar-frame", "laser", "--pose", "gps",
                            "--kinds", "splinegons")
        truth = json.loads(pathlib.Path(f"{world}.truth.json").read_text())["scans"]
        places = {round(stamp, 3): place for stamp, *place in zip(truth["stamp"], truth["x"], truth["y"])}
        poses = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
        errors = np.array([np.subtract((line["pose"]["x"], line["pose"]["y"]), places[round(line["stamp"], 3)])
                           for line in poses]).reshape(-1, 2)
        # The origin is the first fix, which has an error of its own.
        errors = errors - np.median(errors, axis=0) if len(errors) else errors
        error_m = float(np.sqrt((errors**2).sum(1).mean())) if len(errors) else math.nan
        return Outcome(PoseScore(len(poses), error_m), warned, check_bag(programs, bag)), None


# --- report


INTRODUCTION = """
The same drives and flights as drivers may send them, each mapped by `map_bag` and read by `check_bag`. Right is a map
with as much of what is there as with the ideal messages, that is at most {ratio} times as far off. What is not right at
once is to be named: by a warning or the exit code of `map_bag`, which are the warnings on `/diagnostics` live, and by
`check_bag`. Where they ask for an option that puts it right, the map with it is to be right.
"""


@dataclasses.dataclass
class Section:
    """A part of the report: what is tried in each of its cases."""
    title: str
    text: str
    header: tuple            # of the table; of names that are tuples, each element has a column
    cases: dict              # {name: what `run` gets}
    run: object              # its result: (Outcome, retry of verdict_of)
    ideal_of: object         # a case's name -> that of the case without faults
    target: str
    needs_retry: bool = False

    def measure(self):
        """(verdict for targets_section, text)"""
        results = run_pieces(self.run, self.cases, self.title.lower())
        rows, good = [], 0
        for name in self.cases:
            text, is_good = verdict_of(*results[name], results[self.ideal_of(name)][0], self.needs_retry)
            rows.append((*((name,) if isinstance(name, str) else name), text))
            good += is_good
        verdict = (self.target, f"{good} of {len(self.cases)}", good == len(self.cases))
        return verdict, section(self.title, prose(self.text), table(self.header, rows))


def sections(programs, world):
    """{name of --only: Section}; `world`: of a flight by GPS."""
    room, camera = inputs_room, inputs_camera
    of_each = lambda names: {name: (programs, name) for name in names}
    return {
        "scanners": Section(
            "Scanners", f"""
            A drive of {room.SECONDS:.0f} s, to and fro and turning at up to 0.7 rad/s, in a room with an opening and
            {len(room.POSTS)} posts, as {len(room.SCANNERS)} scanners measure it. Right is a map with these posts, at
            most {1e3 * room.LEAST_ERROR_M:.0f} mm or {MOST_RATIO} times as far off as with the ideal messages, and no
            more than 1 % more of the vertices of its lines on nothing.""",
            ("messages", "scanner", "the map"),
            {(convention, scanner): (programs, scanner, convention) for convention in room.CONVENTIONS
             for scanner in room.SCANNERS}, room.scans, lambda name: (room.IDEAL_SCAN, name[1]),
            "every convention of a scanner is right at once, or named and right then", True),
        "clouds": Section(
            "Clouds", f"""
            The same drive by a scanner of {room.RINGS} rings and {room.COLUMNS} columns at
            {1.0 / room.SWEEP_S:.0f} Hz, without scans. Where a case does not say otherwise its clouds are as the first
            one's: organised in a row for each ring, clockwise, stamped at the first point.""",
            ("clouds", "the map"), of_each(room.FORMATS), room.clouds, lambda _: room.IDEAL_CLOUD,
            "every format of clouds is right or named"),
        "encodings": Section(
            "Images", f"""
            A flight around {len(camera.CARS)} cars on hills. {camera.IMAGES} images of {camera.PICTURE_SIZE} x
            {camera.PICTURE_SIZE} pixels are labelled by the network that `map_bag` has. Right is a map with as many
            cars and no other targets, at most {MOST_RATIO} times as far off as ideal (or {camera.MORE_M:.1f} m
            more).""",
            ("images", "the targets"), of_each(camera.ENCODINGS), camera.encodings, lambda _: camera.IDEAL_ENCODING,
            "every encoding of images is right or named"),
        "lenses": Section(
            "Lenses and cameras", f"""
            The same flight, with label images of {camera.SIZE} x {camera.SIZE} pixels; on `/camera/labels` where a case
            does not name another topic.""",
            ("labels", "the targets"), of_each(camera.VIEWS), camera.views, lambda _: camera.IDEAL_VIEW,
            "every lens and camera is right or named"),
        "elevations": Section(
            "Elevations", """
            The same flight and labels over the elevation of the hills as people have it.""",
            ("elevation", "the targets"), of_each(inputs_ground.RASTERS), camera.rasters,
            lambda _: inputs_ground.IDEAL_RASTER, "every elevation is right or named"),
        "navigation": Section(
            "IMU and receiver", f"""
            A flight around an ellipse by IMU and GPS as `scripts/evaluate splinegons` simulates it, and what drivers do
            to its messages. Right is a pose with at most {MOST_RATIO} times the error of the ideal messages (or
            {MOST_POSITION_M:.1f} m more) at nine tenths of the scans.""",
            ("messages", "the pose"), {fault: (programs, world, fault) for fault in FAULTS}, navigation,
            lambda _: IDEAL_MESSAGES, "every fault of an IMU or a receiver is right or named"),
    }


def main():
    names = list(sections(None, None))
    parser = arguments_parser(__doc__, "docs/benchmarks", "a part of the sections")
    parser.add_argument("--tool", required=True, type=pathlib.Path, help="map_bag; check_bag is beside it")
    parser.add_argument("--programs", type=pathlib.Path)
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="SECTION", help=", ".join(names))
    arguments = parser.parse_args()
    output = output_folder(arguments, arguments.only == names)
    measured = facts(arguments)
    with tempfile.TemporaryDirectory() as folder:
        world = pathlib.Path(folder) / "none"
        if "navigation" in arguments.only:
            world = pathlib.Path(folder) / splinegon_worlds.write_world(folder, "ellipse", 1)
        all_sections = sections(arguments.tool.parent, world)
        verdicts, texts = zip(*(all_sections[name].measure() for name in names if name in arguments.only))
    write(output, "inputs.md", "\n".join((
        "# Conventions of drivers\n", introduction(measured, INTRODUCTION.format(ratio=MOST_RATIO)),
        targets_section(verdicts), *texts)))


if __name__ == "__main__":
    main()
