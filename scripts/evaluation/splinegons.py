# SPDX-License-Identifier: BSD-3-Clause
"""The boundaries of large obstacles as splinegons, and the pose by GPS and INS (docs/benchmarks/splinegons.md): flies
the worlds of splinegon_worlds.py and compares what `splinegons_bag` says of each scan with the truth. Run by
scripts/evaluate."""

import concurrent.futures
import dataclasses
import functools
import json
import math
import pathlib
import resource
import subprocess
import tempfile
import time

import numpy as np
import yaml
from matplotlib import patches
from scipy import stats
from scipy.spatial import cKDTree

import splinegon_worlds
from map import MAPPED, STANDING, TRUTH, picture
from pictures import clean, images_folder, pyplot, save
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

SAMPLE_M = 0.01  # of splinegons, for distances
COARSE_M, CHECK_M = 0.05, 0.2  # the same, for pictures, and for what is checked over time
FEW = 1500  # points at most, where the time goes with their square
ENVELOPE = 2.58  # sigmas of 99 %
ENOUGH_SEEN = 0.85  # of an outline, for a boundary to be closed
MAIN_PART = 0.5  # of an outline: from then on a boundary keeps its id
OWN_PART = 0.2  # of a boundary's length beside a second obstacle makes it one of both
FALSE_M = 2.0  # mean distance of a boundary that is of no obstacle
CORNER_M = 0.5  # a joint so near to a corner, after a rigid offset, may have a break
EVERY_SCANS = 5  # what is checked over time
STAMP_TOLERANCE_S = 1e-4
AFTER_S = 5.0  # of an outage, for the pose to be back

TF, EKF = "tf", "ekf"
POSES = {TF: "true pose", EKF: "GPS and INS"}
NAMES = {"ellipse": "ellipse, 10 m x 6 m", "peanut": "peanut", "kidney": "kidney, pocket of 3 m",
         "lobes": "three lobes", "box": "box, 12 m x 7 m", "two": "ellipse and box, 3 m apart",
         "columns": "building with 16 columns, 68 corners", "wings": "building with 4 wings, 16 corners",
         "island": "island, 330 m around"}
LARGE = ("columns", "wings", "island")  # of which more vertices are asked; by the true pose alone
VERTICES = (16, 20)

# Of the mean over runs: attribute, what, unit, {shape: target} or target, goal, scale, decimals, more is better.
SMOOTH = ("ellipse", "peanut", "lobes")
TF_TARGETS = (
    ("hausdorff_m", "true pose: Hausdorff distance, mean of the runs, at most {}", " cm",
     {**{shape: 4.0 for shape in SMOOTH}, "kidney": 5.0, "box": 12.0, "two": 10.0,
      **{shape: 10.0 for shape in LARGE}},
     {**{shape: 1.0 for shape in SMOOTH}, "kidney": 1.5, "box": 3.0, "two": 3.0, **{shape: 5.0 for shape in LARGE}}, 100.0, 1, False),
    ("inside", "true pose: at least {} of the outline inside the 99 % envelope", " %", 98.0, None, 100.0, 1, True),
    ("area_part", "true pose: area within {}", " %", 0.3, 0.05, 100.0, 3, False),
    ("joint_deg", "true pose: joints that are no corners within {}", " deg", 0.1, None, 1.0, 3, False),
)
EKF_TARGETS = (
    ("hausdorff_m", "GPS and INS: Hausdorff distance, mean of the runs, at most {}", " m", 1.0, 0.5, 1.0, 2, False),
    ("mean_m", "GPS and INS: mean distance at most {}", " m", 0.5, 0.25, 1.0, 2, False),
    ("shape_m", "GPS and INS: Hausdorff distance after a rigid offset at most {}", " m", 0.5, 0.2, 1.0, 2, False),
)
ALL_TARGETS = (
    ("wrong", "{} boundaries missed, false, merged, left open, closed early, crossing themselves, clockwise, or of a "
              "second id", "", 0, None, 1.0, 0, False),
    ("speed_least", "at least {} times as fast as real time, on one core", "", 20.0, 50.0, 1.0, 0, True),
)
POSE_TARGETS = (
    ("position_m", "pose: RMS of x, y at most {}", " m", 0.8, 0.5, 1.0, 2, False),
    ("yaw_rad", "pose: RMS of yaw at most {}", " deg", 3.0, 1.0, 180.0 / math.pi, 2, False),
    ("nees_low", "pose: NEES of x, y (2 degrees of freedom) at least {}", "", 1.5, None, 1.0, 2, True),
    ("nees_high", "pose: NEES of x, y at most {}", "", 2.5, None, 1.0, 2, False),
    ("inside_3_sigma", "pose: truth inside 3 sigma in at least {} of the scans", " %", 97.0, None, 100.0, 1, True),
)


OUTAGE_TARGETS = (
    ("outage_after_m", "pose: RMS of x, y over the runs 5 s after an outage of 30 s at most {}", " m", 1.2, None, 1.0,
     2, False),
    ("inside_3_sigma", "pose: truth inside 3 sigma in at least {} of the scans of flights with an outage of 30 s", " %",
     97.0, None, 100.0, 1, True),
)
OUTLIER_TARGETS = (
    ("outlier_ratio", "pose: a fix that is 30 m off moves it by at most {} times as much as others", "", 1.2, None, 1.0,
     2, False),
)


# --- geometry of splinegons


@dataclasses.dataclass
class Boundary:
    """`vertices`: rows of x, y and bulge, tan(sweep / 4) of the arc to the next one."""

    id: int
    closed: bool
    vertices: np.ndarray
    sigma_m: np.ndarray

    @property
    def ends(self):
        """(starts, ends, bulges) of the arcs."""
        points, bulge = self.vertices[:, :2], self.vertices[:, 2]
        if self.closed:
            return points, np.roll(points, -1, axis=0), bulge
        return points[:-1], points[1:], bulge[:-1]


def boundaries_of(line):
    return [Boundary(own["id"], own["closed"], np.array(own["vertices"], float).reshape(-1, 3),
                     np.array(own["sigma_m"], float)) for own in line["boundaries"]]


def arc_points(starts, ends, bulges, parts):
    """Points at parts of each arc's sweep; all are rows of the same number."""
    chord = ends - starts
    half = 2.0 * np.arctan(bulges)  # of the sweep
    # From the start the point at a part u of the sweep 2 h is at the chord's length times sin(u h) / sin(h), and its
    # direction is turned from the chord by (u - 1) h: counter-clockwise arcs are to the right of their chords.
    straight = np.abs(half) < 1e-9
    with np.errstate(divide="ignore", invalid="ignore"):
        length = np.where(straight, parts, np.sin(parts * half) / np.sin(half))
    turn = (parts - 1.0) * half
    cos, sin = np.cos(turn), np.sin(turn)
    return starts + length[:, None] * np.column_stack((cos * chord[:, 0] - sin * chord[:, 1],
                                                       sin * chord[:, 0] + cos * chord[:, 1]))


def arc_lengths(starts, ends, bulges):
    half = 2.0 * np.arctan(bulges)
    return np.hypot(*(ends - starts).T) / np.sinc(half / math.pi)


def sampled(boundary, step_m=SAMPLE_M, most=20000):
    """(points, sigmas): from each vertex on at equal distances along the arc, and the last vertex of an open one. A
    boundary that is too long for so many points has them farther apart."""
    starts, ends, bulges = boundary.ends
    lengths_m = arc_lengths(starts, ends, bulges)
    counts = np.maximum(1, np.ceil(lengths_m / max(step_m, lengths_m.sum() / most)).astype(int))
    arc = np.repeat(np.arange(len(counts)), counts)
    parts = (np.arange(len(arc)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[arc]
    after = np.roll(boundary.sigma_m, -1)
    points = arc_points(starts[arc], ends[arc], bulges[arc], parts)
    sigmas = boundary.sigma_m[arc] * (1.0 - parts) + after[arc] * parts
    if not boundary.closed:
        points, sigmas = np.vstack((points, boundary.vertices[-1:, :2])), np.append(sigmas, boundary.sigma_m[-1])
    return points, sigmas


def area_m2(boundary):
    """Of a closed one; positive if it is counter-clockwise. Chords' polygon, and the segment of each arc."""
    starts, ends, bulges = boundary.ends
    (x0, y0), (x1, y1) = (starts - starts[0]).T, (ends - starts[0]).T
    polygon = 0.5 * float((x0 * y1 - x1 * y0).sum())
    sweep = 4.0 * np.arctan(bulges)
    chord2 = ((ends - starts)**2).sum(1)
    small = np.abs(sweep) < 1e-3
    with np.errstate(divide="ignore", invalid="ignore"):
        segment = chord2 / (8.0 * np.sin(0.5 * sweep)**2) * (sweep - np.sin(sweep))
    return polygon + float(np.where(small, chord2 * sweep / 12.0, segment).sum())


def joint_breaks(boundary):
    """Of each vertex between two arcs: (its index, angle between their tangents)."""
    starts, ends, bulges = boundary.ends
    chord = ends - starts
    angle, half = np.arctan2(chord[:, 1], chord[:, 0]), 2.0 * np.arctan(bulges)
    out, into = angle - half, angle + half  # at the start and at the end of each arc
    at = np.arange(len(starts)) if boundary.closed else np.arange(1, len(starts))
    turn = out[at] - into[at - 1]
    return at, np.abs((turn + math.pi) % (2.0 * math.pi) - math.pi)


def is_simple(points, closed):
    """Whether no two pieces of the line, other than neighbours, meet."""
    starts, ends = (points, np.roll(points, -1, axis=0)) if closed else (points[:-1], points[1:])
    n = len(starts)
    edge = ends - starts

    def side(p):  # of each edge (rows), points (columns)
        to = p[None] - starts[:, None]
        return edge[:, None, 0] * to[..., 1] - edge[:, None, 1] * to[..., 0]

    crosses = side(starts) * side(ends) <= 0.0
    crosses &= crosses.T
    apart = np.abs(np.arange(n)[:, None] - np.arange(n))
    neighbours = (apart <= 1) | (closed & (apart == n - 1))
    # Pieces on one line that do not touch have all products zero: their boxes are apart.
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    boxes = ((low[:, None] <= high[None]) & (high[:, None] >= low[None])).all(2)
    return not (crosses & boxes & ~neighbours).any()


def distances(points, line, closed=True, tree=None):
    """(distance, index of the nearest of the line's points) of each point to a line of short pieces of like lengths."""
    away, nearest = (tree or cKDTree(line)).query(points)
    best = away.copy()
    for step in (-1, 0):
        first, second = nearest + step, nearest + step + 1
        if closed:
            first, second = first % len(line), second % len(line)
        else:
            first, second = np.clip(first, 0, len(line) - 1), np.clip(second, 0, len(line) - 1)
        edge = line[second] - line[first]
        part = np.clip(((points - line[first]) * edge).sum(1) / np.maximum((edge**2).sum(1), 1e-18), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(points - line[first] - part[:, None] * edge).T))
    return best, nearest


def rigid_offset(points, outline, steps=30):
    """(turn, place): the motion p -> turn p + place that brings the points nearest to the outline in the least-squares
    sense, by Gauss-Newton over the distances along the outline's normals."""
    tangent = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    normal = np.column_stack((tangent[:, 1], -tangent[:, 0])) / np.hypot(*tangent.T)[:, None]
    tree, middle = cKDTree(outline), points.mean(0)
    turn, place = np.eye(2), np.zeros(2)
    for _ in range(steps):
        moved = points @ turn.T + place
        _, nearest = tree.query(moved)
        n = normal[nearest]
        arm = moved - middle
        jacobian = np.column_stack((n, arm[:, 0] * n[:, 1] - arm[:, 1] * n[:, 0]))
        residual = ((moved - outline[nearest]) * n).sum(1)
        # A circle has no heading: what cannot be seen is not turned.
        step = np.linalg.solve(jacobian.T @ jacobian + 1e-6 * len(points) * np.eye(3), -jacobian.T @ residual)
        c, s = math.cos(step[2]), math.sin(step[2])
        more = np.array(((c, -s), (s, c)))
        turn, place = more @ turn, more @ (place - middle) + middle + step[:2]
        if np.abs(step).max() < 1e-7:
            break
    return turn, place


# --- truth


class Truth:
    """truth.json"""

    def __init__(self, document):
        self.document = document
        scans = document["scans"]
        self.stamps = np.array(scans["stamp"])
        self.poses = np.column_stack([scans[key] for key in ("x", "y", "z", "roll", "pitch", "yaw")])
        self.seen = np.array(scans["seen"])
        self.ids = [obstacle["id"] for obstacle in document["obstacles"]]
        self.outlines = [np.array(obstacle["outline"]) for obstacle in document["obstacles"]]
        self.corners = [outline[obstacle["corners"]]
                        for outline, obstacle in zip(self.outlines, document["obstacles"])]
        self.areas_m2 = [obstacle["area_m2"] for obstacle in document["obstacles"]]
        self.lengths_m = [float(np.hypot(*(np.roll(outline, -1, axis=0) - outline).T).sum())
                          for outline in self.outlines]
        self.trees = [cKDTree(outline) for outline in self.outlines]

    def scan_at(self, stamp_s):
        """Index of the scan with this stamp, or none."""
        at = int(np.clip(np.searchsorted(self.stamps, stamp_s), 1, len(self.stamps) - 1))
        at -= abs(self.stamps[at - 1] - stamp_s) < abs(self.stamps[at] - stamp_s)
        return at if abs(self.stamps[at] - stamp_s) < STAMP_TOLERANCE_S else None

    def places_at(self, stamps):
        return np.column_stack([np.interp(stamps, self.stamps, self.poses[:, axis]) for axis in range(3)])

    def fix_errors(self):
        """East and north, of the fixes that the receiver calls good."""
        fixes = self.document["fixes"]
        stamps = np.array(fixes["stamp"])
        error = np.column_stack((fixes["x"], fixes["y"])) - self.places_at(stamps)[:, :2]
        return error[~np.array(fixes["outlier"]) & (stamps >= self.stamps[0]) & (stamps <= self.stamps[-1])]

    def seen_from(self, scan, pose, points):
        """`points` of a map, moved with the vehicle from where `pose` says that it was at the scan to where it was."""
        true = self.poses[scan]
        turn = true[5] - pose["yaw"]
        c, s = math.cos(turn), math.sin(turn)
        return (points - (pose["x"], pose["y"])) @ np.array(((c, s), (-s, c))) + true[:2]

    def obstacles_of(self, points):
        """(share of the points to which each obstacle is the nearest, mean distance to it)"""
        away = np.stack([tree.query(points)[0] for tree in self.trees])
        owner = away.argmin(0)
        return np.bincount(owner, minlength=len(self.trees)) / len(points), float(away.min(0).mean())


# --- after a run


@dataclasses.dataclass
class Fit:
    """What is wrong with a boundary, against the outline of its obstacle."""

    obstacle: str
    entries: int
    closed: bool
    simple: bool
    hausdorff_m: float
    mean_m: float
    area_part: float
    shape_m: float
    shape_turn_rad: float
    joint_deg: float  # the largest break that is at no corner
    inside: float  # of the outline, in the envelope
    sigma_m: float


def fit_of(truth, which, boundary):
    outline = truth.outlines[which]
    points, sigmas = sampled(boundary)
    away, _ = distances(points, outline, tree=truth.trees[which])
    back, nearest = distances(outline, points, boundary.closed)
    turn, place = rigid_offset(points[::5], outline)
    moved = points @ turn.T + place
    shape_m = max(distances(moved, outline, tree=truth.trees[which])[0].max(),
                  distances(outline, moved, boundary.closed)[0].max())
    at, breaks = joint_breaks(boundary)
    if len(truth.corners[which]):
        joints = boundary.vertices[at, :2] @ turn.T + place
        breaks = breaks[cKDTree(truth.corners[which]).query(joints)[0] > CORNER_M]
    area = area_m2(boundary) if boundary.closed else math.nan
    return Fit(truth.ids[which], len(boundary.vertices), boundary.closed,
               is_simple(sampled(boundary, COARSE_M, FEW)[0], boundary.closed), float(max(away.max(), back.max())),
               float(away.mean()), abs(area / truth.areas_m2[which] - 1.0), float(shape_m),
               math.atan2(turn[1, 0], turn[0, 0]), math.degrees(breaks.max(initial=0.0)),
               float(np.mean(back <= ENVELOPE * sigmas[nearest])), float(sigmas.mean()))


class Poses:
    def __init__(self):
        self.scans, self.errors, self.nees = [], [], []

    def add(self, truth, scan, pose):
        error = np.array([pose[key] for key in ("x", "y", "z", "yaw")]) - truth.poses[scan][[0, 1, 2, 5]]
        error[3] = (error[3] + math.pi) % (2.0 * math.pi) - math.pi
        covariance = np.array(pose["covariance"], float).reshape(6, 6)[:2, :2]
        self.scans.append(scan)
        self.errors.append(error)
        try:
            self.nees.append(float(error[:2] @ np.linalg.solve(covariance, error[:2])))
        except np.linalg.LinAlgError:
            self.nees.append(math.inf)


def outage_of(run):
    """(error of x, y at the end of the outage, AFTER_S later, that of the IMU alone at the end), or none."""
    outage = run.truth.document["outage"]
    if not outage or not run.poses.scans:
        return None
    stamps, away_m = run.truth.stamps[run.poses.scans], np.hypot(*np.array(run.poses.errors)[:, :2].T)
    last = max(0, int(np.searchsorted(stamps, outage["end_s"], side="right")) - 1)
    later = min(int(np.searchsorted(stamps, outage["end_s"] + AFTER_S)), len(stamps) - 1)
    return float(away_m[last]), float(away_m[later]), outage["ins_alone_m"]


def steps_of(run):
    """How far the estimate of x, y goes against the truth from the last scan before a fix comes in to the first one
    after it: ([of good fixes], [of outliers])."""
    fixes = run.truth.document["fixes"]
    stamps, errors = run.truth.stamps[run.poses.scans], np.array(run.poses.errors)[:, :2]
    after = np.searchsorted(stamps, fixes["arrived"])
    inside = (after > 0) & (after < len(stamps))
    step_m = np.hypot(*(errors[after[inside]] - errors[after[inside] - 1]).T)
    outlier = np.array(fixes["outlier"])[inside]
    return step_m[~outlier].tolist(), step_m[outlier].tolist()


@dataclasses.dataclass
class Wrong:
    """Of one run: how often, or which."""

    missed: list = dataclasses.field(default_factory=list)
    open: list = dataclasses.field(default_factory=list)
    false: int = 0  # boundaries, after the last scan
    merged: int = 0
    doubled: list = dataclasses.field(default_factory=list)  # obstacles with two boundaries, after the last scan
    ids: list = dataclasses.field(default_factory=list)  # obstacles whose main boundary changed its id
    early: list = dataclasses.field(default_factory=list)  # closed before enough was seen
    crossing: int = 0  # boundaries, at any time
    clockwise: int = 0
    stamps: int = 0  # lines that do not come after the one before, or are of no scan

    @property
    def count(self):
        return sum(value if isinstance(value, int) else len(value) for value in vars(self).values())

    def __str__(self):
        return ", ".join(f"{key} {value if isinstance(value, int) else ' '.join(value)}"
                         for key, value in vars(self).items() if value) or "nothing"


@dataclasses.dataclass
class Run:
    """The score of one run of the tool."""

    name: str
    shape: str
    vertices: int
    pose: str
    variant: str
    fits: list
    wrong: Wrong
    poses: Poses
    closed_s: dict  # {obstacle: time of its first closed boundary}
    truth: Truth
    lines: int
    boundaries: list  # after the last scan
    history: list  # (scan, boundaries), now and then
    speed: float = math.nan  # over real time

    def worst(self, key):
        values = [getattr(fit, key) for fit in self.fits]
        return max(values, default=math.inf)


def score(truth, lines, name="", shape="ellipse", vertices=16, pose=TF, variant="plain"):
    """`lines` of the tool, one after the other, as dictionaries."""
    poses, wrong, closed_s, history = Poses(), Wrong(), {}, []
    ids = {name: set() for name in truth.ids}
    before_s, count, boundaries, scan, owners = -math.inf, 0, [], 0, []
    for line in lines:
        at = truth.scan_at(line["stamp"])
        if at is None or line["stamp"] <= before_s:
            wrong.stamps += 1
            continue
        before_s, scan, count = line["stamp"], at, count + 1
        poses.add(truth, at, line["pose"])
        if at % EVERY_SCANS and at + 1 < len(truth.stamps) and not any(
                own["closed"] and own["id"] not in closed_s for own in line["boundaries"]):
            continue
        boundaries = boundaries_of(line)
        history.append((at, boundaries))
        owners = check(truth, at, line["pose"], boundaries, ids, closed_s, wrong)
    if not count:
        raise ValueError(f"{name}: the tool gave no line for any scan")
    # The last line, in case that it is of no scan that was checked.
    if not history or history[-1][0] != scan:
        boundaries = boundaries_of(line)
        owners = check(truth, scan, line["pose"], boundaries, ids, closed_s, wrong)
        history.append((scan, boundaries))

    fits = []
    for which, obstacle in enumerate(truth.ids):
        own = [boundary for boundary, owner in zip(boundaries, owners) if owner == which]
        if not own:
            wrong.missed.append(obstacle)
            continue
        if len(own) > 1:
            wrong.doubled.append(obstacle)
        fits.append(fit_of(truth, which, max(own, key=lambda boundary: arc_lengths(*boundary.ends).sum())))
        if not fits[-1].closed:
            wrong.open.append(obstacle)
    wrong.false = owners.count(None)
    wrong.merged = owners.count("both")
    wrong.ids = [obstacle for obstacle, own in ids.items() if len(own) > 1]
    first_s = truth.stamps[0]
    closed_s = {truth.ids[owner]: stamp_s - first_s for owner, stamp_s in closed_s.values() if owner in range(
        len(truth.ids))}
    return Run(name, shape, vertices, pose, variant, fits, wrong, poses, closed_s, truth, count, boundaries, history)


def check(truth, scan, pose, boundaries, ids, closed_s, wrong):
    """Of each boundary after a scan the obstacle (its number, "both" or none), as the vehicle sees it: what `pose`, the
    estimate of this scan, is off by is no error of the boundary's shape, and is counted elsewhere. `ids`: {obstacle: those of its longest
    boundary, from when it has half of the outline on}: pieces that were seen apart are joined. `closed_s`: {id:
    (obstacle, stamp)}."""
    owners, longest = [], {}
    for boundary in boundaries:
        if len(boundary.vertices) < 2:
            owners.append(None)
            continue
        points, _ = sampled(boundary, CHECK_M, FEW)
        shares, mean_m = truth.obstacles_of(truth.seen_from(scan, pose, points))
        second = np.sort(shares)[-2] if len(shares) > 1 else 0.0
        owner = None if mean_m > FALSE_M else "both" if second > OWN_PART else int(shares.argmax())
        owners.append(owner)
        if isinstance(owner, int):
            length_m = float(arc_lengths(*boundary.ends).sum())
            longest[owner] = max(longest.get(owner, (0.0, None)), (length_m, boundary.id))
        wrong.crossing += not is_simple(points, boundary.closed)
        if boundary.closed:
            wrong.clockwise += area_m2(boundary) <= 0.0
            if boundary.id not in closed_s:
                closed_s[boundary.id] = (owner, truth.stamps[scan])
                if isinstance(owner, int) and truth.seen[scan, owner] < ENOUGH_SEEN:
                    wrong.early.append(truth.ids[owner])
    for owner, (length_m, id_) in longest.items():
        if length_m >= MAIN_PART * truth.lengths_m[owner]:
            ids[truth.ids[owner]].add(id_)
    return owners


# --- runs together


def number(value, decimals=3):
    if math.isnan(value):
        return "none"
    return "never" if math.isinf(value) else f"{value:.{decimals}f}"


def mean(values):
    values = list(values)
    return float(np.mean(values)) if values else math.nan


def root_mean(values):
    return math.sqrt(np.mean(values)) if len(values) else math.nan


class Group:
    """Of runs: means over them of the worst of their boundaries, poses pooled."""

    def __init__(self, runs):
        self.runs = runs
        fitted = [run for run in runs if run.fits]
        for key in ("hausdorff_m", "mean_m", "shape_m", "area_part", "sigma_m"):
            setattr(self, key, mean(run.worst(key) for run in fitted))
        fits = [fit for run in runs for fit in run.fits]
        self.hausdorff_most_m = max((fit.hausdorff_m for fit in fits), default=math.nan)
        self.joint_deg = max((fit.joint_deg for fit in fits), default=math.nan)
        self.inside = mean(fit.inside for fit in fits)
        self.entries = (min((fit.entries for fit in fits), default=0), max((fit.entries for fit in fits), default=0))
        self.closed_s = [value for run in runs for value in run.closed_s.values()]
        self.wrong = sum(run.wrong.count for run in runs)
        speeds = [run.speed for run in runs if not math.isnan(run.speed)]
        self.speed, self.speed_least = mean(speeds), min(speeds, default=math.nan)
        errors = np.array([error for run in runs for error in run.poses.errors]).reshape(-1, 4)
        nees = np.array([value for run in runs for value in run.poses.nees])
        self.position_m = root_mean((errors[:, :2]**2).sum(1))
        self.height_m, self.yaw_rad = root_mean(errors[:, 2]**2), root_mean(errors[:, 3]**2)
        self.nees = self.nees_low = self.nees_high = float(nees.mean()) if len(nees) else math.nan
        self.inside_3_sigma = float(np.mean(nees <= 9.0)) if len(nees) else math.nan
        outages = [found for run in runs if (found := outage_of(run))]
        self.outage_end_m, self.outage_after_m, self.ins_alone_m = (
            root_mean([found[k]**2 for found in outages]) for k in range(3))
        steps = [steps_of(run) for run in runs]
        self.usual_step_m, self.outlier_step_m = (mean(value for own in steps for value in own[k]) for k in range(2))
        self.outlier_ratio = self.outlier_step_m / self.usual_step_m if self.usual_step_m else math.nan
        self.fix_m = root_mean(np.concatenate([(run.truth.fix_errors()**2).sum(1) for run in runs]))
        self.posed = sum(run.lines for run in runs) / sum(len(run.truth.stamps) for run in runs)


def pooled(runs, **wanted):
    """A group of those with these attributes, or none."""
    own = [run for run in runs if all(getattr(run, key) == value for key, value in wanted.items())]
    return Group(own) if own else None


# --- verdicts


def limit_text(limit, unit):
    if not isinstance(limit, dict):
        return f"{limit:g}{unit}"
    named = {}
    for shape, value in limit.items():
        named.setdefault(value, []).append(shape)
    return ", ".join(f"{value:g}{unit} ({', '.join(shapes)})" for value, shapes in named.items())


def targets_of(groups, wanted):
    """`groups`: {(name, shape): Group}"""
    for key, what, unit, target, goal, scale, decimals, more in wanted:
        if not groups:
            continue
        sentence = what.format(limit_text(target, unit))
        if goal is not None:
            sentence += f" (goal {limit_text(goal, unit)})"
        values = {name: scale * getattr(group, key) for name, group in groups.items()}
        limit = lambda name: target[name[1]] if isinstance(target, dict) else target
        met = all(value >= limit(name) if more else value <= limit(name) for name, value in values.items())
        yield sentence, ", ".join(f"{number(value, decimals)} {name[0]}".strip() for name, value in values.items()), met


def targets(runs):
    """(sentence, figure, met)"""
    plain = [run for run in runs if run.variant == "plain"]
    by_shape = lambda pose: {(f"{shape} {vertices}", shape): pooled(plain, shape=shape, vertices=vertices, pose=pose)
                             for shape in NAMES for vertices in VERTICES
                             if pooled(plain, shape=shape, vertices=vertices, pose=pose)}
    yield from targets_of(by_shape(TF), TF_TARGETS)
    yield from targets_of(by_shape(EKF), EKF_TARGETS)
    by_pose = {(POSES[pose], None): pooled(plain, pose=pose) for pose in POSES if pooled(plain, pose=pose)}
    yield from targets_of(by_pose, ALL_TARGETS)
    if flown := pooled(plain, pose=EKF):
        yield (f"GPS and INS: at least 98 % of the outlines inside the 99 % envelope, over {len(flown.runs)} runs",
               f"{100.0 * flown.inside:.1f} %", flown.inside >= 0.98)
        yield from targets_of({("", None): flown}, POSE_TARGETS)
    for variant, wanted in (("outage", OUTAGE_TARGETS), ("outliers", OUTLIER_TARGETS)):
        if group := pooled(runs, pose=EKF, variant=variant):
            yield from targets_of({("", None): group}, wanted)


# --- tables


def groups_of(runs, pose, variant="plain"):
    for shape in NAMES:
        for vertices in sorted({run.vertices for run in runs}):
            if group := pooled(runs, shape=shape, vertices=vertices, pose=pose, variant=variant):
                yield shape, vertices, group


def boundary_table(runs, pose, scale=100.0, unit="cm", decimals=2):
    rows = []
    for shape, vertices, g in groups_of(runs, pose):
        rows.append((NAMES[shape], str(vertices), f"{g.entries[0]} to {g.entries[1]}",
                     f"{number(scale * g.hausdorff_m, decimals)} ({number(scale * g.hausdorff_most_m, decimals)})",
                     number(scale * g.mean_m, decimals), number(scale * g.shape_m, decimals),
                     number(100.0 * g.area_part, 3), number(g.joint_deg, 3), number(100.0 * g.inside, 1),
                     number(scale * g.sigma_m, decimals)))
    return table(("obstacle", "vertices", "entries", f"Hausdorff, {unit} (worst run)", f"mean, {unit}",
                  f"after a rigid offset, {unit}", "area, %", "largest break, deg", "inside the envelope, %",
                  f"sigma, {unit}"), rows)


def variant_table(runs):
    rows = []
    for variant in VARIANT_TEXTS:
        for pose in POSES:
            if g := pooled(runs, pose=pose, variant=variant):
                rows.append((variant, POSES[pose], str(len(g.runs)),
                             f"{number(g.hausdorff_m, 3)} ({number(g.hausdorff_most_m, 3)})", number(g.shape_m, 3),
                             number(100.0 * g.inside, 1), number(g.position_m, 2),
                             number(math.degrees(g.yaw_rad), 2), number(g.nees, 2), str(g.wrong)))
    return table(("variant", "pose", "runs", "Hausdorff, m (worst run)", "after a rigid offset, m",
                  "inside the envelope, %", "RMS of x, y, m", "yaw, deg", "NEES", "wrong"), rows)


def least_error_m(slow_m, slow_s, time_s):
    """RMS of x, y that remains of a Gauss-Markov error (sigma on each axis, time constant) when what it is added to is
    constant for a time: of the best linear unbiased mean, whose variance is 2 sigma^2 / (2 + T / tau)."""
    return slow_m * math.sqrt(4.0 / (2.0 + time_s / slow_s))


def pose_table(runs):
    rows = []
    for shape in (*NAMES, None):
        wanted = {"pose": EKF, "variant": "plain", **({"shape": shape} if shape else {})}
        if g := pooled(runs, **wanted):
            rows.append((NAMES.get(shape, "**all**"), number(g.fix_m, 2), number(g.position_m, 2),
                         number(g.height_m, 2), number(math.degrees(g.yaw_rad), 2), number(g.nees, 2),
                         number(100.0 * g.inside_3_sigma, 1), number(100.0 * g.posed, 1)))
    return table(("obstacle", "fixes alone: RMS of x, y, m", "RMS of x, y, m", "z, m", "yaw, deg", "NEES of x, y",
                  "inside 3 sigma, %", "scans with a pose, %"), rows)


def outage_table(runs):
    rows = []
    for shape in (*NAMES, None):
        wanted = {"pose": EKF, "variant": "outage", **({"shape": shape} if shape else {})}
        if g := pooled(runs, **wanted):
            rows.append((NAMES.get(shape, "**all**"), number(g.ins_alone_m, 1), number(g.outage_end_m, 2),
                         number(g.outage_after_m, 2), number(g.position_m, 2), number(g.nees, 2),
                         number(100.0 * g.inside_3_sigma, 1)))
    return table(("obstacle", "IMU alone at the end, m", "at the end, m", f"{AFTER_S:g} s later, m",
                  "RMS of x, y of the flight, m", "NEES", "inside 3 sigma, %"), rows)


def outlier_text(runs):
    group = pooled(runs, pose=EKF, variant="outliers")
    return "" if group is None else prose(OUTLIERS.format(
        off=splinegon_worlds.OUTLIER_M, part=100.0 * splinegon_worlds.OUTLIER_CHANCE,
        outlier=100.0 * group.outlier_step_m, usual=100.0 * group.usual_step_m))


def wrong_table(runs):
    rows = [(run.name, str(run.wrong)) for run in runs if run.wrong.count]
    return table(("run", "what is wrong"), rows) if rows else "None.\n"


def cost_table(runs):
    rows = []
    for pose in POSES:
        for vertices in VERTICES:
            if g := pooled(runs, pose=pose, vertices=vertices, variant="plain"):
                rows.append((POSES[pose], str(vertices), number(g.speed, 0), number(g.speed_least, 0),
                             f"{number(mean(g.closed_s), 1)} / {number(max(g.closed_s, default=math.nan), 1)}"))
    return table(("pose", "vertices", "times real time: mean", "slowest run", "closed after, s: mean / latest"), rows)


# --- pictures


SPLINEGON = MAPPED
PATH, ESTIMATE = "0.55", "#3d5a80"
LEGEND = [
    patches.Patch(fc=TRUTH, ec=STANDING, label="obstacle"),
    pyplot.Line2D([], [], color=SPLINEGON, lw=1.6, marker=".", label="splinegon, its arcs' ends"),
    patches.Patch(color=SPLINEGON, alpha=0.18, label="99 % envelope"),
    pyplot.Line2D([], [], color=PATH, lw=1.0, label="true path"),
    pyplot.Line2D([], [], color=ESTIMATE, lw=1.0, ls="--", label="estimated path"),
]


def draw_boundary(ax, boundary):
    points, sigmas = sampled(boundary, COARSE_M)
    step = np.gradient(points, axis=0) if not boundary.closed else np.roll(points, -1, axis=0) - np.roll(points, 1,
                                                                                                        axis=0)
    normal = np.column_stack((step[:, 1], -step[:, 0])) / np.maximum(np.hypot(*step.T), 1e-12)[:, None]
    wide = ENVELOPE * sigmas[:, None] * normal
    sides = [points + wide, points - wide]
    if boundary.closed:
        sides = [np.vstack((side, side[:1])) for side in sides]
        points = np.vstack((points, points[:1]))
    ax.add_patch(patches.Polygon(np.vstack((sides[0], sides[1][::-1])), fc=SPLINEGON, ec="none", alpha=0.18, zorder=2))
    ax.plot(*points.T, color=SPLINEGON, lw=1.2, zorder=4)
    ax.plot(*boundary.vertices[:, :2].T, ".", color=SPLINEGON, ms=5, mew=0, zorder=5)


def draw_map(ax, run, scan=None, boundaries=None, estimate=True):
    truth = run.truth
    scan = len(truth.stamps) - 1 if scan is None else scan
    for outline in truth.outlines:
        ax.add_patch(patches.Polygon(outline, fc=TRUTH, ec=STANDING, lw=0.8, zorder=1))
    for boundary in run.boundaries if boundaries is None else boundaries:
        draw_boundary(ax, boundary)
    ax.plot(*truth.poses[:scan + 1, :2].T, color=PATH, lw=1.0, zorder=3)
    if estimate and run.pose == EKF:
        own = np.array(run.poses.scans) <= scan
        if own.any():
            ax.plot(*(truth.poses[run.poses.scans, :2] + np.array(run.poses.errors)[:, :2])[own].T, color=ESTIMATE,
                    lw=1.0, ls="--", zorder=3)
    draw_vehicle(ax, truth.poses[scan])
    middle = np.vstack(truth.outlines).mean(0)
    reach = np.abs(np.vstack(truth.outlines) - middle).max() + 9.5
    ax.set(aspect="equal", xticks=[], yticks=[], xlim=middle[0] + np.array((-reach, reach)),
           ylim=middle[1] + np.array((-reach, reach)))
    for spine in ax.spines.values():
        spine.set_color("0.8")


def draw_vehicle(ax, pose, size=1.2):
    corners = np.array(((1.0, 0.0), (-0.7, 0.6), (-0.4, 0.0), (-0.7, -0.6))) * size
    c, s = math.cos(pose[5]), math.sin(pose[5])
    ax.add_patch(patches.Polygon(corners @ np.array(((c, s), (-s, c))) + pose[:2], color="black", zorder=6))


def firsts(runs, pose, vertices=VERTICES[0]):
    """The first run of each shape."""
    found = {}
    for run in runs:
        if run.pose == pose and run.vertices == vertices and run.variant == "plain":
            found.setdefault(run.shape, run)
    return [found[shape] for shape in NAMES if shape in found]


def hausdorff_text(run):
    worst_m = run.worst("hausdorff_m")
    return "missed" if math.isinf(worst_m) else f"Hausdorff distance {100.0 * worst_m:.1f} cm"


def draw_maps(runs, path):
    """Figs. 11 and 12 of the paper: the maps at the end."""
    columns = min(3, len(runs))
    figure, axes = pyplot.subplots(math.ceil(len(runs) / columns), columns, squeeze=False, layout="constrained",
                                   figsize=(4.2 * columns, 4.3 * math.ceil(len(runs) / columns)))
    for ax in axes.flat[len(runs):]:
        ax.set_visible(False)
    for ax, run in zip(axes.flat, runs):
        draw_map(ax, run)
        ax.set_title(f"{NAMES[run.shape]}\n{hausdorff_text(run)}", fontsize=9)
    save(figure, path, LEGEND[:5 if runs[0].pose == EKF else 4])


def draw_cycles(run, path, count=6):
    """Figs. 9 and 10 of the paper: the map as it grows."""
    known = [entry for entry in run.history if entry[1]]
    if not known:
        return
    at = [known[int(k)] for k in np.linspace(0, len(known) - 1, count + 1)[1:]]
    figure, axes = pyplot.subplots(2, math.ceil(count / 2), figsize=(4.2 * math.ceil(count / 2), 8.6), squeeze=False,
                                   layout="constrained")
    for ax, (scan, boundaries) in zip(axes.flat, at):
        draw_map(ax, run, scan, boundaries)
        seen = ", ".join(f"{100.0 * share:.0f} %" for share in run.truth.seen[scan])
        ax.set_title(f"after {run.truth.stamps[scan] - run.truth.stamps[0]:.0f} s, seen {seen}", fontsize=9)
    save(figure, path, LEGEND[:5 if run.pose == EKF else 4])


def draw_vertices(runs, path):
    """Fig. 6 of the paper: one obstacle with 16 and 20 vertices, large."""
    figure, axes = pyplot.subplots(1, len(runs), figsize=(5.6 * len(runs), 4.6), squeeze=False, layout="constrained")
    for ax, run in zip(axes.flat, runs):
        draw_map(ax, run)
        points = np.vstack(run.truth.outlines)
        (x0, y0), (x1, y1) = points.min(0) - 1.0, points.max(0) + 1.0
        ax.set(xlim=(x0, x1), ylim=(y0, y1))
        ax.set_title(f"{run.vertices} vertices, {len(run.boundaries[0].vertices) if run.boundaries else 0} arcs, "
                     f"{hausdorff_text(run)}", fontsize=9)
    save(figure, path, LEGEND[:3])


def draw_poses(run, path):
    """Fig. 4 of the paper, with a truth: the way around, and the errors of the pose in its own sigmas."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained", width_ratios=(1.0, 1.3))
    draw_map(left, run)
    fixes = run.truth.document["fixes"]
    left.plot(fixes["x"], fixes["y"], ".", color="#e0a100", ms=3, mew=0, zorder=2)
    since_s = run.truth.stamps[run.poses.scans] - run.truth.stamps[0]
    errors = np.array(run.poses.errors)
    right.plot(since_s, np.hypot(*errors[:, :2].T), color=STANDING, lw=1.2)
    stamps = np.array(fixes["stamp"])
    right.plot(stamps - run.truth.stamps[0], np.hypot(*(np.column_stack((fixes["x"], fixes["y"]))
                                                        - run.truth.places_at(stamps)[:, :2]).T), ".",
               color="#e0a100", ms=3, mew=0)
    right.plot(since_s, np.degrees(np.abs(errors[:, 3])), color=ESTIMATE, lw=1.0)
    right.set(xlabel="time of the flight, s", ylabel="error of x, y in m; of yaw in deg", yscale="log",
              ylim=(0.01, 20.0))
    clean(right)
    save(figure, path, [*LEGEND, pyplot.Line2D([], [], color="#e0a100", ls="", marker=".", label="fixes"),
                        pyplot.Line2D([], [], color=STANDING, label="error of x, y"),
                        pyplot.Line2D([], [], color=ESTIMATE, label="error of yaw")], ncol=4)


def draw_all(runs, images):
    for pose in POSES:
        if own := firsts(runs, pose):
            draw_maps(own, images / f"splinegons_{pose}.png")
    by_truth, flown = firsts(runs, TF), firsts(runs, EKF)
    if flown or by_truth:
        draw_cycles((flown or by_truth)[min(2, len(flown or by_truth) - 1)], images / "splinegons_cycles.png")
    if flown:
        draw_poses(flown[0], images / "splinegons_pose.png")
    if by_truth:
        shape = by_truth[-1].shape if len(by_truth) < 4 else "lobes"
        draw_vertices([run for vertices in VERTICES for run in firsts(runs, TF, vertices) if run.shape == shape],
                      images / "splinegons_vertices.png")


# --- running the tool


def lines_of(path):
    with open(path) as file:
        for text in file:
            if text.strip():
                yield json.loads(text)


def run_tool(command):
    """Its time on a processor in s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        raise RuntimeError(f"{command[0]}, of {command[1]}: {done.stderr.strip() or done.returncode}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def write_config(config, vertices, path):
    """The configuration, with as many vertices."""
    values = yaml.safe_load(config.read_text()) or {}
    values.setdefault("splinegons", {})["vertices"] = vertices
    path.write_text(yaml.safe_dump(values, sort_keys=False))


def drive(arguments, directory, bags, shape, seed, variant, vertices, pose):
    name = splinegon_worlds.name_of(shape, seed, variant)
    document = json.loads((bags / f"{name}.truth.json").read_text())
    out = directory / f"{name}_{pose}_{vertices}.jsonl"
    bag = bags / f"{name}{'_tf' if pose == TF else ''}.bag"
    command = [arguments.tool, bag, "--scan-topic", "/scan", "--imu-topic", "/imu", "--fix-topic", "/fix",
               "--origin=" + ",".join(map(str, document["origin"])), "--lidar-frame", "laser", "--base-frame",
               "base_link", "--config", directory / f"{vertices}.yaml", "--out", out]
    if pose == TF:
        command += ["--localization", "tf", "--world-frame", "world"]
    spent_s = run_tool(command)
    run = score(Truth(document), lines_of(out), f"{name}, {vertices} vertices, {POSES[pose]}", shape, vertices, pose,
                variant)
    run.speed = (document["flight"]["end_s"] - document["flight"]["begin_s"]) / max(spent_s, 1e-6)
    if not arguments.keep:
        out.unlink()
    return run


def wanted_runs(arguments):
    """(shape, seed, variant, vertices, pose)"""
    for variant in arguments.variants:
        for shape in arguments.shapes:
            for pose in arguments.poses:
                if (pose == TF and variant in FLOWN_ONLY) or (shape in LARGE and (pose, variant) != (TF, "plain")):
                    continue
                seeds = {TF: arguments.seeds, EKF: arguments.flown_seeds}[pose]
                of_variant = VERTICES[:1] if variant != "plain" or shape in LARGE else arguments.vertices
                for seed in range(1, (seeds if variant == "plain" else min(seeds, arguments.variant_seeds)) + 1):
                    for vertices in of_variant:
                        yield shape, seed, variant, vertices, pose


def run_all(arguments, directory):
    bags = arguments.bags or directory / "bags"
    wanted = list(wanted_runs(arguments))
    to_make = {}
    for shape, seed, variant, *_ in wanted:
        name = splinegon_worlds.name_of(shape, seed, variant)
        if not (bags / f"{name}.truth.json").exists():
            to_make[name] = (shape, seed, variant)
    processes = concurrent.futures.ProcessPoolExecutor
    if to_make:
        run_pieces(functools.partial(splinegon_worlds.write_world, bags), to_make, "worlds", processes)
    for vertices in {piece[3] for piece in wanted}:
        write_config(arguments.config, vertices, directory / f"{vertices}.yaml")
    found = run_pieces(functools.partial(drive, arguments, directory, bags), {piece: piece for piece in wanted}, "runs",
                       processes)
    return [found[piece] for piece in wanted]


# --- report


INTRODUCTION = """
{scans:,} scans of {runs} runs in {minutes:.1f} minutes, with {config}. Simulated worlds
([splinegon_worlds.py](../../scripts/evaluation/splinegon_worlds.py)): a fixed-wing-like vehicle flies straight for 15 s
and then one and a half times around one or two large obstacles, at 5 m/s and 4.5 m to 10 m from their walls, in turns
of up to 20 deg of bank that tilt its scanner. The scanner has 270°, 0.5°, 25 Hz, a sweep of 30 ms, and a noise of 3 cm;
the IMU is a MEMS one at 200 Hz; fixes come at 5 Hz, 0.1 s late, with an error of 1.5 m per axis of which most stays for
half a minute. {seeds}
"""
BOUNDARY = """
Means over the runs, of the worse of two obstacles. *Hausdorff*: the greatest distance of any place on the splinegon
from the outline, or of the outline from the splinegon, sampled each centimetre along the arcs. *Mean*: of the
splinegon's places from the outline. *After a rigid offset*: Hausdorff distance after the planar motion that brings the
splinegon nearest to the outline. *Area*: its error. *Largest break*: of the tangents of two arcs that meet, farther
than {corner:g} m from a corner. *Inside the envelope*: the share of the outline within 2.58 sigma of the nearest place
of the splinegon. *Entries*: of `vertices`, one per arc.
"""
TRUE_POSE = """With the pose of base_link from TF; what is left is the noise of the scanner and the splinegon's own."""
FLOWN = """With the pose by GPS and INS; its error is that of the boundary."""
POSE = """
Of base_link at the stamps of the scans, from the first with a pose on. *Inside 3 sigma*: scans with a NEES of at most
9. Of the slow part of the fixes' error even a perfect IMU leaves an RMS of {least[0]:.2f} m in x, y after a flight of
{time:.0f} s, and {least[1]:.2f} m where errors stay for 5 s (*short*): fixes that err together say little more than one.
"""
VARIANT = """
{vertices} vertices. {texts}
"""
VARIANT_TEXTS = {
    "wind": "*Wind*: of 1.2 m/s, with gusts that turn the vehicle: its heading is not its course.",
    "yawed": "*Yawed*: a scanner of 360° at 10 Hz, turned by 35°.",
    "flipped": "*Flipped*: a scanner that is upside down.",
    "short": "*Short*: errors of the fixes stay for 5 s instead of half a minute.",
    "outage": "*Outage*: five and a half rounds, without fixes for 30 s.",
    "outliers": "*Outliers*: two and a half rounds, some fixes are 30 m off.",
}
FLOWN_ONLY = ("short", "outage", "outliers")
OUTAGE = """
No fixes for 30 s, after a minute of the flight. Root mean squares over the runs of the error of x, y, at the end of the
outage and later. *IMU alone*: integrated from the true motion at the begin.
"""
OUTLIERS = """
Of the good fixes {part:g} % are {off:g} m off: each moves the estimate by {outlier:.1f} cm from scan to scan, other
fixes by {usual:.1f} cm (means).
"""
PICTURES = {
    "cycles": "As Figs. 9 and 10 of the paper: the map while the vehicle flies, with what was seen of the outline.",
    "vertices": "As Fig. 6 of the paper.",
    TF: "As Figs. 11 and 12 of the paper: the maps at the end, by the true pose.",
    EKF: "The same by GPS and INS.",
    "pose": "As Fig. 4 of the paper: the way around the obstacle, with the errors of fixes and of the pose.",
}


def figure(images, name):
    drawn = picture(images, f"splinegons_{name}.png", PICTURES[name].rstrip("."))
    return prose(PICTURES[name]) + "\n" + drawn if drawn else ""


def report_of(arguments, measured, runs, images, spent_s):
    shipped = arguments.config == ROOT / "cfg/splinegons.yaml"
    seeds = (f"Runs by the true pose have {arguments.seeds} seeds for each obstacle, flown ones "
             f"{arguments.flown_seeds}.")
    parts = ["# Boundaries of large obstacles\n", introduction(measured, INTRODUCTION.format(
        scans=sum(run.lines for run in runs), runs=len(runs), minutes=spent_s / 60.0, seeds=seeds,
        config="the shipped `cfg/splinegons.yaml` but for the number of vertices" if shipped else "other parameters"))]
    if not arguments.whole:
        parts.append(prose(f"**A part only**: {', '.join(arguments.shapes)}; {', '.join(arguments.variants)}; "
                           f"{arguments.seeds} and {arguments.flown_seeds} seeds ({SEEDS} and {FLOWN_SEEDS} are "
                           "published)."))
    parts.append(targets_section(list(targets(runs))))
    explained = prose(BOUNDARY.format(corner=CORNER_M))
    if pooled(runs, pose=TF, variant="plain"):
        parts.append(section("By the true pose", explained, prose(TRUE_POSE), boundary_table(runs, TF),
                             figure(images, TF), figure(images, "vertices")))
        explained = ""
    if pooled(runs, pose=EKF, variant="plain"):
        parts.append(section("By GPS and INS", explained, prose(FLOWN), boundary_table(runs, EKF, 1.0, "m"),
                             figure(images, EKF), figure(images, "cycles")))
        flown = pooled(runs, pose=EKF, variant="plain")
        time_s = mean(run.truth.stamps[-1] - run.truth.stamps[0] for run in flown.runs)
        least_m = (least_error_m(splinegon_worlds.FIX_SLOW_M, slow_s, time_s) for slow_s in (
            splinegon_worlds.FIX_SLOW_S, splinegon_worlds.FIX_SHORT_S))
        parts.append(section("The pose", prose(POSE.format(time=time_s, least=tuple(least_m))), pose_table(runs),
                             figure(images, "pose")))
    others = [variant for variant in VARIANT_TEXTS if variant in arguments.variants]
    if others:
        texts = " ".join(VARIANT_TEXTS[variant] for variant in others)
        parts.append(section("Wind, mountings, outages and outliers",
                             prose(VARIANT.format(vertices=VERTICES[0], texts=texts)), variant_table(runs)))
    if pooled(runs, pose=EKF, variant="outage"):
        parts.append(section("An outage of 30 s", prose(OUTAGE), outage_table(runs)))
    if outliers := outlier_text(runs):
        parts.append(section("Outliers", outliers))
    parts.append(section("Cost", prose("Time of `splinegons_bag` on a processor, reading of the bag included."),
                         cost_table(runs)))
    parts.append(section("What is wrong", prose(WRONG), wrong_table(runs)))
    return "\n".join(parts)


WRONG = """
*Missed*: an obstacle without a boundary at the end; *open*: with one that is not closed; *false*: a boundary with a
mean distance of more than 2 m from any outline; *merged*: with a fifth of its length beside a second obstacle, all as
seen from the vehicle: moved with it from its estimated to its true pose, since the error of that is counted above;
*doubled*: two boundaries of one obstacle; *ids*: another one of the longest boundary, after it had half of the
outline; *early*: closed before 85 % of the outline was seen; *crossing*, *clockwise*: boundaries that cross themselves
or run clockwise, at any fifth scan; *stamps*: lines out of order or of no scan.
"""

SEEDS, FLOWN_SEEDS, VARIANT_SEEDS = 5, 9, 2


def main(words=None):
    parser = arguments_parser(__doc__, "docs/benchmarks", "a part of the runs or other parameters")
    parser.add_argument("--tool", required=True, type=pathlib.Path, help="splinegons_bag")
    parser.add_argument("--config", type=pathlib.Path, default=ROOT / "cfg/splinegons.yaml", help="cfg/splinegons.yaml")
    parser.add_argument("--shapes", nargs="+", choices=list(NAMES), default=list(NAMES))
    parser.add_argument("--variants", nargs="+", choices=splinegon_worlds.VARIANTS,
                        default=list(splinegon_worlds.VARIANTS))
    parser.add_argument("--poses", nargs="+", choices=list(POSES), default=list(POSES))
    parser.add_argument("--vertices", nargs="+", type=int, default=list(VERTICES))
    parser.add_argument("--seeds", type=int, metavar="N", help=f"by the true pose, 1 to N, {SEEDS}")
    parser.add_argument("--flown-seeds", type=int, metavar="N", help=f"by GPS and INS, {FLOWN_SEEDS}")
    parser.add_argument("--quick", action="store_true", help="one seed, 16 vertices, no variants")
    parser.add_argument("--bags", type=pathlib.Path, help="a folder of splinegon_worlds.py; what is missing is added")
    parser.add_argument("--keep", type=pathlib.Path, metavar="DIR", help="keep the tool's output there")
    arguments = parser.parse_args(words)
    arguments.seeds = arguments.seeds or (1 if arguments.quick else SEEDS)
    arguments.flown_seeds = arguments.flown_seeds or (1 if arguments.quick else FLOWN_SEEDS)
    arguments.variant_seeds = VARIANT_SEEDS
    if arguments.quick:
        arguments.variants, arguments.vertices = ["plain"], list(VERTICES[:1])
    arguments.whole = (set(arguments.shapes) == set(NAMES) and set(arguments.poses) == set(POSES)
                       and set(arguments.variants) == set(splinegon_worlds.VARIANTS)
                       and set(arguments.vertices) >= set(VERTICES) and arguments.seeds >= SEEDS
                       and arguments.flown_seeds >= FLOWN_SEEDS and arguments.config == ROOT / "cfg/splinegons.yaml")
    output = output_folder(arguments, arguments.whole)
    measured = facts(arguments, {"--config": "FILE", "--bags": "DIR", "--keep": "DIR"})
    images = images_folder(output)

    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        directory = arguments.keep or pathlib.Path(folder)
        directory.mkdir(parents=True, exist_ok=True)
        runs = run_all(arguments, directory)
    spent_s = time.monotonic() - begin
    draw_all(runs, images)
    write(output, "splinegons.md", report_of(arguments, measured, runs, images, spent_s))


if __name__ == "__main__":
    main()
