# SPDX-License-Identifier: BSD-3-Clause
"""The pose by GPS and INS on recordings of real vehicles (docs/benchmarks/gps_ins.md): gps_ins_bag gets a part of the
fixes, or worse ones, and its pose of the antenna is compared with all. Run by scripts/evaluate."""

import bisect
import dataclasses
import functools
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

import numpy as np

from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

DATA = ROOT.parent / "shared/data"

# Outages: from FROM_S after the first fix on, in each minute.
FROM_S, MINUTE_S = 60.0, 60.0
OUTAGES_S = (10.0, 30.0)
# An ordinary receiver: one fix a second, whose error is kept in part from fix to fix.
ORDINARY_M, ORDINARY_PERIOD_S, ORDINARY_KEPT = (1.5, 1.5, 2.3), 0.99, 0.6
SEEDS = range(4)
# Starts in the drive, each with what comes from there on.
START_EVERY_S, START_WITHIN_S = 40.0, 60.0
MOVED_M = 0.5
# The yaw is that of the course where the vehicle goes straight on.
STRAIGHT_M_S, STRAIGHT_RAD, COURSE_SIGMA_RAD = 4.0, 0.02, 0.005
# Of fixes by which the pose is judged, each axis.
FIX_SIGMA_M = 0.015
WGS84_A_M, WGS84_E2 = 6378137.0, 6.69437999014e-3


@dataclasses.dataclass(frozen=True)
class Recording:
    bag: str
    imu: str
    velocity: str  # topic, or empty
    mounting: tuple  # place (m) and quaternion x, y, z, w of the IMU on the base, if the bag does not say so
    antenna_m: tuple  # of the fixes on the base
    sideslip_m_s: float


DRIVE = Recording("gnss_imu_drive.bag", "/imu", "/fix_velocity", (), (0.0, 0.05, 0.0), 0.0)
# Its IMU lies on its side: yaw -90, roll 90 degrees.
HUSKY = Recording("husky_gps_imu.bag", "/imu/data", "", (0.0, -0.3, 0.52, 0.5, -0.5, -0.5, 0.5), (0.0, 0.0, 0.0), 0.1)


# --- what the receiver measured


def local(origin, lat, lon, alt):
    """East, north and up at the origin (deg, deg, m), as GpsIns has it: by the earth-centred axes."""
    def earth(lat, lon, alt):
        lat, lon = math.radians(lat), math.radians(lon)
        n = WGS84_A_M / math.sqrt(1.0 - WGS84_E2 * math.sin(lat) ** 2)
        return np.array(((n + alt) * math.cos(lat) * math.cos(lon), (n + alt) * math.cos(lat) * math.sin(lon),
                         (n * (1.0 - WGS84_E2) + alt) * math.sin(lat)))
    return axes_at(origin) @ (earth(lat, lon, alt) - earth(*origin))


def axes_at(origin):
    lat, lon = math.radians(origin[0]), math.radians(origin[1])
    return np.array(((-math.sin(lon), math.cos(lon), 0.0),
                     (-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)),
                     (math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat))))


class Truth:
    """All fixes, and the course where they are on a straight line."""

    def __init__(self, fixes):
        self.origin = (fixes[0].latitude, fixes[0].longitude, fixes[0].altitude)
        self.stamps = [fix.header.stamp.to_sec() for fix in fixes]
        self.t = np.array(self.stamps) - self.stamps[0]
        self.p = np.array([local(self.origin, fix.latitude, fix.longitude, fix.altitude) for fix in fixes])
        self.sigma = np.array([[max(math.sqrt(fix.position_covariance[i]), FIX_SIGMA_M) for i in (0, 4, 8)]
                               for fix in fixes])
        self.course = np.full(len(fixes), math.nan)
        for i in range(2, len(fixes) - 2):
            around = self.p[i - 2:i + 3, :2]
            before, after = around[2] - around[0], around[4] - around[2]
            turned = math.atan2(after[1], after[0]) - math.atan2(before[1], before[0])
            way = around[3] - around[1]
            if (np.linalg.norm(way) > STRAIGHT_M_S * (self.t[i + 1] - self.t[i - 1])
                    and abs(math.remainder(turned, 2 * math.pi)) < STRAIGHT_RAD):
                self.course[i] = math.atan2(way[1], way[0])
        gone = np.linalg.norm(self.p - self.p[0], axis=1) > MOVED_M
        self.moves_s = float(self.t[gone.argmax()]) if gone.any() else math.nan


# --- bags with a part of the measurements


def transform_of(recording):
    import geometry_msgs.msg
    import tf2_msgs.msg
    transform = geometry_msgs.msg.TransformStamped()
    transform.header.frame_id, transform.child_frame_id = "base_link", "imu_link"
    at, q = transform.transform.translation, transform.transform.rotation
    at.x, at.y, at.z, q.x, q.y, q.z, q.w = recording.mounting
    return tf2_msgs.msg.TFMessage([transform])


def in_outage(t, outage_s):
    return outage_s > 0.0 and t >= FROM_S and t % MINUTE_S < outage_s


def write_bag(recording, folder, path, keep, change):
    """What `keep(topic, time since the first fix)` lets through, with fixes changed."""
    import rosbag
    topics = ("/fix", recording.imu, recording.velocity, *(() if recording.mounting else ("/tf_static",)))
    with rosbag.Bag(str(folder / recording.bag)) as bag, rosbag.Bag(str(path), "w") as out:
        first = next(received for _, _, received in bag.read_messages(topics=["/fix"], raw=True))
        if recording.mounting:
            out.write("/tf_static", transform_of(recording), first)
        for topic, (kind, data, md5sum, _, message), received in bag.read_messages(topics=topics, raw=True):
            if topic != "/tf_static" and not keep(topic, (received - first).to_sec()):
                continue
            if topic != "/fix":
                out.write(topic, (kind, data, md5sum, message), received, raw=True)
                continue
            fix = message()
            fix.deserialize(data)
            fix = change(fix)
            if fix is not None:
                out.write(topic, fix, received)


def fixes_of(folder, recording):
    import rosbag
    with rosbag.Bag(str(folder / recording.bag)) as bag:
        return [msg for _, msg, _ in bag.read_messages(topics=["/fix"])]


class OrdinaryReceiver:
    """Makes fixes worse, one a second; None for those between."""

    def __init__(self, seed):
        self.random, self.last, self.error = random.Random(seed), None, None

    def __call__(self, fix):
        stamp = fix.header.stamp.to_sec()
        if self.last is not None and stamp - self.last < ORDINARY_PERIOD_S:
            return None
        new = np.array([self.random.gauss(0.0, 1.0) for _ in range(3)])
        kept = ORDINARY_KEPT
        self.error = new if self.error is None else kept * self.error + math.sqrt(1.0 - kept * kept) * new
        self.last = stamp
        east, north, up = np.array(ORDINARY_M) * self.error
        flat = 1.0 - WGS84_E2 * math.sin(math.radians(fix.latitude)) ** 2
        n = WGS84_A_M / math.sqrt(flat)  # radii of curvature, across the meridian and along it
        m = n * (1.0 - WGS84_E2) / flat
        fix.latitude += math.degrees(north / (m + fix.altitude))
        fix.longitude += math.degrees(east / ((n + fix.altitude) * math.cos(math.radians(fix.latitude))))
        fix.altitude += up
        fix.position_covariance = [ORDINARY_M[i // 4] ** 2 if i % 4 == 0 else 0.0 for i in range(9)]
        return fix


# --- the pose against the truth


def rotation(pose):
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(pose[key]), math.sin(pose[key])) for key in ("roll", "pitch", "yaw"))
    return np.array(((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                     (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr), (-sp, cp * sr, cp * cr)))


@dataclasses.dataclass
class Look:
    """At the pose at the stamp of a fix."""
    t: float
    error: np.ndarray  # of the antenna, m
    sigma: np.ndarray  # of the pose and of the fix
    yaw: float  # error, rad; NaN where the course is not known
    yaw_sigma: float


def looks(recording, truth, lines):
    """At all fixes, at the latest pose until their stamp, moved on by its velocity."""
    stamps = [line["stamp"] for line in lines]
    for i, stamp in enumerate(truth.stamps):
        k = bisect.bisect_right(stamps, stamp + 1e-4) - 1
        if k < 0 or stamp - stamps[k] > 0.1:
            continue
        pose, R = lines[k]["pose"], rotation(lines[k]["pose"])
        P = np.array(pose["covariance"]).reshape(6, 6)
        at = np.array([pose[axis] for axis in "xyz"]) + R @ np.array(recording.antenna_m)
        at = at + (stamp - stamps[k]) * np.array(lines[k]["velocity"])
        yaw_variance = R[2] @ P[3:, 3:] @ R[2]
        yield Look(truth.t[i], truth.p[i] - at, np.sqrt(P.diagonal()[:3] + truth.sigma[i] ** 2),
                   math.remainder(truth.course[i] - pose["yaw"], 2 * math.pi) if truth.course[i] == truth.course[i]
                   else math.nan, math.sqrt(yaw_variance + COURSE_SIGMA_RAD ** 2))


def rms(values):
    return math.sqrt(np.mean(np.square(values))) if len(values) else math.nan


@dataclasses.dataclass
class Score:
    position_m: float
    worst_m: float
    yaw_rad: float
    nees: tuple  # x, y, z, yaw
    count: int

    def __init__(self, of):
        of = list(of)
        level = [float(np.linalg.norm(look.error[:2])) for look in of]
        self.count = len(of)
        self.position_m, self.worst_m = rms(level), max(level, default=math.nan)
        turned = [look for look in of if not math.isnan(look.yaw)]
        self.yaw_rad = rms([look.yaw for look in turned])
        self.nees = tuple(rms([look.error[i] / look.sigma[i] for look in of]) ** 2 for i in range(3)) + (
            rms([look.yaw / look.yaw_sigma for look in turned]) ** 2,)


class Run:
    """One run of gps_ins_bag, with what it did not get as the truth."""

    def __init__(self, arguments, recording, truth, with_velocity=False, outage_s=0.0, seed=None, from_s=0.0,
                 until_s=math.inf):
        change = (lambda fix: fix) if seed is None else OrdinaryReceiver(seed)

        def keep(topic, t):
            return from_s <= t <= until_s and (topic == recording.imu or not in_outage(t, outage_s))
        with tempfile.TemporaryDirectory() as folder:
            bag, out, config = (pathlib.Path(folder) / name for name in ("in.bag", "out.jsonl", "config.yaml"))
            write_bag(recording, arguments.data, bag, keep, change)
            config.write_text(f"gps_ins: {{sideslip_sigma_m_s: {recording.sideslip_m_s}}}\n")
            command = [arguments.tool, bag, "--imu-topic", recording.imu, "--config", config, "--out", out, "--origin",
                       ",".join(f"{number:.9f}" for number in truth.origin)]
            if with_velocity:
                command += ["--velocity-topic", recording.velocity]
            result = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
            if result.returncode and "no pose" not in result.stderr:
                sys.exit(f"gps_ins_bag ended with code {result.returncode}:\n{result.stderr}")
            lines = [json.loads(text) for text in out.read_text().splitlines()] if out.is_file() else []
        all_looks = list(looks(recording, truth, lines))
        self.ready_s = lines[0]["stamp"] - truth.stamps[0] - from_s if lines else math.nan
        judged = [look for look in all_looks if not outage_s or in_outage(look.t, outage_s)]
        self.score = Score(judged)
        self.ends = Score([look for look, after in zip(judged, judged[1:]) if after.t - look.t > 1.0])


# --- report


INTRODUCTION = """
`gps_ins_bag` with the default parameters on recordings of a car and of a small robot, in real time: no pose knows what
came later. The car has RTK fixes of 1 cm, which are the truth where they are withheld or made worse; a receiver's
velocity, and an IMU of 100 Hz. What is compared is the place of the antenna with the fixes that the filter did not get,
in the plane; the yaw with the course where the car goes straight on. The recordings are not part of this repository
(rtklibexplorer/GNSS_IMU, drive_0708, and robot_localization's test1).
"""
OUTAGES = """
From 60 s on fixes and velocities are withheld for the first seconds of each minute; errors at the ends of these outages,
and the normalised squared errors (NEES, 1 if the covariance is right) in them.
"""
ORDINARY = """
One fix a second with an error of 1.5 m along east and north, 2.3 m upwards, 0.6 of it kept from fix to fix, and a
covariance that says so; errors at all fixes of the recording from when on the pose is known. The car moves 38.5 s after
the first fix.
"""
STARTS = """
The recording begins at a time in the drive, with all fixes and velocities: seconds until the pose is known.
Nothing but an acceleration, or a way on which it is seen to go where it heads, shows the yaw.
"""


def number(value, digits=2):
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def row(name, run, ends=False):
    of = run.ends if ends else run.score
    return (name, str(of.count), number(of.position_m), number(of.worst_m),
            *(number(value) for value in run.score.nees), number(math.degrees(run.score.yaw_rad)))


HEADER = ("", "n", "position, RMS m", "worst, m", "NEES of x", "y", "z", "yaw", "yaw, RMS deg")


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "other recordings")
    parser.add_argument("--tool", required=True)
    parser.add_argument("--data", type=pathlib.Path, default=DATA, help="folder of the recordings: ../shared/data")
    arguments = parser.parse_args()
    for recording in (DRIVE, HUSKY):
        if not (arguments.data / recording.bag).is_file():
            sys.exit(f"{arguments.data} has no {recording.bag}")
    output = output_folder(arguments, arguments.data == DATA)
    measured = facts(arguments, {"--data": "DIR"})
    truths = {recording: Truth(fixes_of(arguments.data, recording)) for recording in (DRIVE, HUSKY)}

    def piece(recording, **how):
        return (functools.partial(Run, arguments, recording, truths[recording], **how),)
    pieces = {("husky", 10.0): piece(HUSKY, outage_s=10.0)}
    for velocity in (False, True):
        pieces |= {("outage", velocity, s): piece(DRIVE, with_velocity=velocity, outage_s=s) for s in OUTAGES_S}
        pieces |= {("ordinary", velocity, seed): piece(DRIVE, with_velocity=velocity, seed=seed) for seed in SEEDS}
    starts = np.arange(START_EVERY_S, truths[DRIVE].t[-1] - START_WITHIN_S, START_EVERY_S)
    pieces |= {("start", float(t)): piece(DRIVE, with_velocity=True, from_s=t, until_s=t + START_WITHIN_S)
               for t in starts}
    runs = run_pieces(lambda make: make(), pieces, "runs")

    ends_m = max(runs["outage", velocity, 10.0].ends.position_m for velocity in (False, True))
    ordinary_m = rms([runs["ordinary", False, seed].score.position_m for seed in SEEDS])
    moves_s = truths[DRIVE].moves_s
    begins_s = max(runs["ordinary", True, seed].ready_s for seed in SEEDS) - moves_s
    verdicts = (
        ("ends of outages of 10 s: at most 2.0 m RMS", f"{ends_m:.2f} m", ends_m <= 2.0),
        ("fixes of 1.5 m once a second, without velocities, four seeds: at most 1.6 m RMS", f"{ordinary_m:.2f} m",
         ordinary_m <= 1.6),
        ("the same with velocities: the pose is known within 5 s of moving", f"{begins_s:.1f} s", begins_s <= 5.0))
    names = {False: "fixes alone", True: "with velocities"}
    report = "\n".join((
        "# The pose by GPS and INS\n", introduction(measured, INTRODUCTION), targets_section(verdicts),
        section("Outages", prose(OUTAGES),
                table(HEADER, [*(row(f"car, {s:g} s, {name}", runs["outage", velocity, s], True)
                                 for s in OUTAGES_S for velocity, name in names.items()),
                               row("small robot, 10 s, `sideslip_sigma_m_s` 0.1", runs["husky", 10.0], True)])),
        section("An ordinary receiver", prose(ORDINARY),
                table((*HEADER, "known after moving, s"),
                      [(*row(f"seed {seed}, {name}", run), number(run.ready_s - moves_s, 1))
                       for velocity, name in names.items() for seed in SEEDS
                       for run in (runs["ordinary", velocity, seed],)])),
        section("Starts", prose(STARTS), table(
            ("begins at, s", *(f"{t:g}" for t in starts)),
            [("known after, s", *(number(runs["start", float(t)].ready_s, 1) for t in starts))]))))
    write(output, "gps_ins.md", report)


if __name__ == "__main__":
    main()
