# SPDX-License-Identifier: BSD-3-Clause
"""The map of standing things as chains (docs/benchmarks/polygons.md): drives the worlds of polygon_worlds.py and
compares the map of each scan with the truth. Run by scripts/evaluate.

What counts as seen is the truth's (polygon_worlds.Sight): a bin of an outline, 1 cm long, that ten scans have hit. The
place of what has gone and was not yet seen to be free is neither right nor wrong, nor is a reflector."""

import concurrent.futures
import dataclasses
import functools
import json
import math
import pathlib
import re
import subprocess
import tempfile
import time

import numpy as np
from matplotlib import collections as drawn
from matplotlib import patches
from scipy import stats
from scipy.spatial import cKDTree

import polygon_associations
import polygon_worlds
from map import MAPPED, MOVING, STANDING, TRUTH, draw_robot, picture
from pictures import clean, images_folder, pyplot, save
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

SAMPLE_M = 0.01  # of chains, for what is measured after a transit
COARSE_M = 0.02  # of chains, for what is measured over time
NEAR_M = 0.1
MATCHED_PART = 0.5  # of a chain's length near the truth
COVERED_PART = 0.5  # of a thing's seen outline
ON_M, ON_PART = 0.1, 0.25  # a chain is on a thing with that much, or that part of what was seen if this is less
PART_GAP_M = 0.1  # unseen so far along an outline, its seen parts are apart
VERTEX_TOLERANCE_M = 0.02
GONE_M = 0.05  # a chain so near to a bin still covers it
CROWDED_M = 0.12  # of a gone thing's bin to what stands there: a chain may be of either
EVERY_SCANS = 5  # what is measured over time
SETTLE_S = 2.0  # of a run, before poses count
FOUND_M = 0.03
PERSON_M, PERSON_LEFT_S, PERSON_CHAIN_M = 0.3, 2.0, 0.1
PERSON_AWAY_M = 0.5
STAMP_TOLERANCE_S = 1e-3
NEVER = 10**9  # scan
ADDED_S, REMOVED_S = 4.0, 6.0  # targets; what was neither for less time in sight is not counted
VIEW_M = 6.0
NAMED = 5  # lost things of a run

OBJECTS = "objects"  # with the map of objects
TF = "tf"  # a run with true poses
ODOMETRY = "odometry"
CHANGES = "changes"  # short runs
NAMES = {"corridor": "corridor", "hall": "hall", "both": "corridors and halls"}
VARIANTS = {"plain": (False, True), "sweep": (True, False), OBJECTS: (False, True), TF: (False, True),
            ODOMETRY: (False, True)}  # sweep, pose
ENDS = {TF: "_tf", ODOMETRY: "_odometry"}  # of the names of bags
VARIANT_NAMES = {"plain": "", "sweep": ", sweep, no initial pose", OBJECTS: ", with the map of objects",
                 TF: ", true pose", ODOMETRY: ", odometry alone", CHANGES: ", short"}

# Targets: attribute of a group's score, what, unit, target, goal, scale, decimals, more is better, whether of poses.
TABLE_TARGETS = (
    ("table_mean_m", "Table 1, average at most {}", " cm", 2.46, 1.5, 100.0, 2, False, True),
    ("table_greatest_m", "Table 1, greatest at most {}", " cm", 6.0, None, 100.0, 2, False, True),
)
ODOMETRY_TARGETS = (
    ("table_mean_m", "Table 1, average by odometry alone at most {}", " cm", 4.7, None, 100.0, 2, False, False),
)
CHANGE_TARGETS = (
    ("change_precision", "changes: precision at least {}", "", 0.97, None, 1.0, 3, True, False),
    ("change_recall", "changes: recall at least {}", "", 0.97, None, 1.0, 3, True, False),
    ("known_95_s", "changes: 95 % of the things known after {} in view from 6 m", " s", 1.0, None, 1.0, 2, False,
     False),
    ("lost_things", "changes: at most {} things removed while they stand or are hidden", "", 0, None, 1.0, 0, False,
     False),
    ("persons_greatest_m", "changes: a person leaves no chain longer than {}, 2 s after", " m", PERSON_CHAIN_M, None,
     1.0, 2, False, False),
)
TARGETS = (
    ("precision", "precision at least {}", "", 0.97, None, 1.0, 3, True, False),
    ("recall", "recall of things at least {}", "", 0.97, None, 1.0, 3, True, False),
    ("coverage", "at least {} of the seen outlines within 10 cm of the map", "", 0.98, None, 1.0, 3, True, False),
    ("mean_m", "mean distance of the chains from the truth at most {}", " cm", 0.6, 0.2, 100.0, 2, False, False),
    ("greatest_m", "greatest distance of the chains from the truth at most {}", " cm", 6.0, 2.0, 100.0, 1, False,
     False),
    ("false_m", "false chains at most {}, after any run", " m", 0.1, None, 1.0, 2, False, False),
    ("ids_per_object", "chains per object at most {}", "", 1.15, None, 1.0, 2, False, False),
    ("id_stability", "the same id in at least {} of the cases", "", 0.95, None, 1.0, 3, True, False),
    ("vertices_ratio", "vertices at most {} times the fewest", "", 2.0, 1.3, 1.0, 2, False, False),
    ("vertex_ratio_low", "vertex error over sigma at least {}", "", 0.6, None, 1.0, 2, True, False),
    ("vertex_ratio_high", "vertex error over sigma at most {}", "", 1.6, None, 1.0, 2, False, False),
    ("added_95_s", "95 % of the things on the map after {} in sight", " s", ADDED_S, None, 1.0, 2, False, False),
    ("removed_95_s", "95 % of the things removed after {} of being seen to be gone", " s", REMOVED_S, 2.0, 1.0, 2,
     False, False),
    ("lost_things", "at most {} things lost while they stand or are hidden", "", 0, None, 1.0, 0, False, False),
    ("left_by_persons", "at most {} chains left by a person", "", 0, None, 1.0, 0, False, False),
    ("position_m", "pose RMS along x and y at most {}", " mm", {"corridor": 3.0, "hall": 4.0}, 1.8, 1000.0, 2, False,
     True),
    ("two_position_m", "the same with two reflectors in sight at most {}", " mm", 3.5, None, 1000.0, 2, False, True),
    ("yaw_rad", "yaw RMS at most {}", " mrad", 1.0, 0.7, 1000.0, 2, False, True),
    ("three_position_m", "pose RMS with three reflectors in sight at most {}", " mm", 3.0, None, 1000.0, 2, False,
     True),
    ("three_yaw_rad", "yaw RMS with three reflectors in sight at most {}", " mrad", 2.0, None, 1000.0, 2, False, True),
    ("three_sigma_m", "its sigma, of 95 % of these scans, at most {}", " mm", 3.0, None, 1000.0, 2, False, True),
    ("three_sigma_rad", "its sigma of the yaw, of 95 % of these scans, at most {}", " mrad", 2.0, None, 1000.0, 2,
     False, True),
    ("nees_low", "NEES of the pose (3 degrees of freedom) at least {}", "", 2.0, None, 1.0, 2, True, True),
    ("nees_high", "NEES of the pose at most {}", "", 4.0, None, 1.0, 2, False, True),
)
PAPER = (  # Table 1 in cm: mean (average, least, greatest), standard deviation
    ("Sim1", (4.71, 2.19, 6.62), (1.89, 1.25, 2.69)), ("Sim2", (4.46, 1.20, 12.37), (2.13, 0.91, 5.14)),
    ("Pal1", (2.46, 1.78, 2.86), (1.09, 0.99, 1.16)), ("Pal3a", (3.99, 2.14, 5.94), (1.68, 0.70, 3.18)),
    ("Pal3b", (4.55, 2.88, 6.86), (1.72, 1.21, 3.45)))


# --- geometry


@dataclasses.dataclass
class Chain:
    id: int
    points: np.ndarray
    closed: bool
    sigma_m: np.ndarray


def chains_of(line):
    return [Chain(polyline["id"], np.array(polyline["points"], float).reshape(-1, 2), polyline["closed"],
                  np.array(polyline["sigma_m"], float)) for polyline in line["polylines"]]


@dataclasses.dataclass
class Samples:
    """Places on chains, each for a piece of its length."""

    points: np.ndarray
    length_m: np.ndarray
    chain: np.ndarray  # index


def samples_of(chains, step_m=SAMPLE_M):
    lines = [np.vstack((chain.points, chain.points[:1])) if chain.closed else chain.points for chain in chains]
    ends = np.vstack([np.zeros((0, 2)), *lines])
    chain = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    edge = np.diff(ends, axis=0)
    own = chain[1:] == chain[:-1]
    start, edge, chain = ends[:-1][own], edge[own], chain[:-1][own]
    length = np.hypot(*edge.T)
    counts = np.ceil(length / step_m).astype(int)
    of = np.repeat(np.arange(len(edge)), counts)
    within = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    return Samples(start[of] + ((within + 0.5) / counts[of])[:, None] * edge[of], length[of] / counts[of], chain[of])


def simplified(points, tolerance_m):
    """Of an open line, those points that Douglas and Peucker keep."""
    points = np.asarray(points, float)
    keep = np.zeros(len(points), bool)
    keep[[0, -1]] = True
    todo = [(0, len(points) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        edge = points[last] - points[first]
        offset = points[first + 1:last] - points[first]
        part = np.clip(offset @ edge / max(edge @ edge, 1e-18), 0.0, 1.0)
        away = np.hypot(*(offset - part[:, None] * edge).T)
        if away.max() > tolerance_m:
            middle = first + 1 + int(away.argmax())
            keep[middle] = True
            todo += [(first, middle), (middle, last)]
    return points[keep]


def fewest_vertices(points, closed, tolerance_m=VERTEX_TOLERANCE_M):
    if not closed:
        return len(simplified(points, tolerance_m))
    # A ring is cut at two of its corners, which are far from its middle and from each other.
    points = np.roll(points, -int(np.hypot(*(points - points.mean(0)).T).argmax()), axis=0)
    far = int(np.hypot(*(points - points[0]).T).argmax())
    ring = np.vstack((points, points[:1]))
    return len(simplified(ring[:far + 1], tolerance_m)) + len(simplified(ring[far:], tolerance_m)) - 2


# --- truth


class Truth:
    """truth.json. A bin is a piece of a thing's outline; all bins are in one row."""

    def __init__(self, document):
        self.document = document
        self.things = document["things"]
        self.transits = document["transits"]
        scans = document["scans"]
        self.stamps = np.array(scans["stamp"])
        self.transit_of_scan = np.array(scans["transit"])
        self.poses = np.column_stack([scans[key] for key in ("x", "y", "yaw")])
        self.in_sight_of_scan = np.array(scans["reflectors_in_sight"])
        self.walker = scans["walker"]
        self.shapes = [polygon_worlds.Thing(thing["id"], thing["kind"], "", None if thing["circle"] else
                                            np.array(thing["outline"]), tuple(thing["circle"] or ()) or None)
                       for thing in self.things]
        self.optional = np.array([thing["optional"] for thing in self.things])
        stands = np.zeros((len(self.things), len(self.transits)), bool)
        for i, thing in enumerate(self.things):
            stands[i, thing["present"]] = True
        self.stands = stands
        self.last = np.array([max(thing["present"], default=-1) for thing in self.things])
        counts = [len(thing["seen_s"]) for thing in self.things]
        self.offsets = np.concatenate(([0], np.cumsum(counts)))
        self.thing_of_bin = np.repeat(np.arange(len(counts)), counts)
        self.bin_m = np.repeat([shape.length_m / n for shape, n in zip(self.shapes, counts)], counts)
        self.centres = np.vstack([shape.at((np.arange(n) + 0.5) * shape.length_m / n)
                                  for shape, n in zip(self.shapes, counts)])
        self.first_s, self.seen_s, self.first_free_s, self.free_s = (
            np.array([math.nan if value is None else value for thing in self.things for value in thing[key]], float)
            for key in ("first_s", "seen_s", "first_free_s", "free_s"))
        # Segments and circles, with their things.
        self._segments = [(i, shape.outline, np.roll(shape.outline, -1, axis=0) - shape.outline)
                          for i, shape in enumerate(self.shapes) if shape.circle is None]
        self._circles = [(i, *shape.circle) for i, shape in enumerate(self.shapes) if shape.circle is not None]

    def bins_of(self, thing):
        return slice(self.offsets[thing], self.offsets[thing + 1])

    def has_person(self, transit):
        return any(self.walker[scan] for scan in np.flatnonzero(self.transit_of_scan == transit))

    def scan_at(self, stamp_s):
        """Index of the scan with this stamp, or none."""
        at = int(np.clip(np.searchsorted(self.stamps, stamp_s), 1, len(self.stamps) - 1))
        at -= abs(self.stamps[at - 1] - stamp_s) < abs(self.stamps[at] - stamp_s)
        return at if abs(self.stamps[at] - stamp_s) < STAMP_TOLERANCE_S else None

    def standing(self, transit):
        """Of each thing that must be on the map, whether it stands there."""
        return self.stands[:, transit] & ~self.optional

    def nearest(self, points, things):
        """Distance to the nearest of these outlines, and its thing."""
        best, owner = np.full(len(points), np.inf), np.full(len(points), -1)
        for i, start, edge in self._segments:
            if not things[i]:
                continue
            offset = points[:, None, :] - start
            part = np.clip((offset * edge).sum(2) / np.maximum((edge**2).sum(1), 1e-18), 0.0, 1.0)
            away = np.sqrt(((offset - part[..., None] * edge)**2).sum(2).min(1))
            owner[away < best] = i
            best = np.minimum(best, away)
        for i, x, y, radius in self._circles:
            if not things[i]:
                continue
            away = np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius)
            owner[away < best] = i
            best = np.minimum(best, away)
        return best, owner

    def seen_bins(self, stamp_s, transit):
        """Of what must be on the map."""
        with np.errstate(invalid="ignore"):
            return (self.seen_s <= stamp_s) & self.standing(transit)[self.thing_of_bin]

    def is_open(self, points, stamp_s, transit, away_m):
        """Whether a chain at these points is neither right nor wrong: they are at what may be on the map, or at the
        place of what has gone and was not seen to be free, and not nearer to what stands there (`away_m`)."""
        with np.errstate(invalid="ignore"):
            bins = (self.last < transit)[self.thing_of_bin] & ~(self.free_s <= stamp_s)
        to_open_m, _ = self.nearest(points, self.stands[:, transit] & self.optional)
        if bins.any() and len(points):
            to_open_m = np.minimum(to_open_m, cKDTree(self.centres[bins]).query(points)[0])
        return (to_open_m <= NEAR_M) & (to_open_m < away_m)

    def seen_parts(self, thing, seen):
        """Of its own bins which were seen: [first, last] of the parts, which may go over the end; none if it is the
        whole outline."""
        if seen.all():
            return None
        at = np.flatnonzero(seen)
        if not len(at):
            return []
        bin_m = self.shapes[thing].length_m / len(seen)
        gap = math.ceil(PART_GAP_M / bin_m)
        parts = [[at[0], at[0]]]
        for i in at[1:]:
            if i - parts[-1][1] > gap:
                parts.append([i, i])
            parts[-1][1] = i
        if len(parts) > 1 and parts[0][0] + len(seen) - parts[-1][1] <= gap:
            parts[-1][1] = parts.pop(0)[1] + len(seen)
        least = min(ON_M, ON_PART * seen.sum() * bin_m) / bin_m
        return [part for part in parts if part[1] - part[0] + 1 >= least]

    def part_points(self, thing, part):
        """The seen part of the outline, with its corners."""
        shape, n = self.shapes[thing], self.offsets[thing + 1] - self.offsets[thing]
        bin_m = shape.length_m / n
        first, last = (0.0, shape.length_m) if part is None else (part[0] * bin_m, (part[1] + 1) * bin_m)
        arcs = np.arange(first, last, bin_m)
        if shape.circle is None:
            edge = np.hypot(*(np.roll(shape.outline, -1, axis=0) - shape.outline).T)
            corner = np.concatenate(([0.0], np.cumsum(edge)))[:-1]
            corner = np.concatenate((corner, corner + shape.length_m))
            arcs = np.union1d(arcs, corner[(corner > first) & (corner < last)])
        return shape.at(arcs if part is None else np.append(arcs, last))


# --- after a transit


@dataclasses.dataclass
class Snapshot:
    """The map at a scan and what is wrong with it."""

    transit: int
    stamp_s: float
    counted_m: float = 0.0  # of chains, less what is neither right nor wrong
    near_m: float = 0.0
    false_m: float = 0.0
    distance_sum_m2: float = 0.0  # over the length of the matched chains
    square_sum_m3: float = 0.0
    matched_m: float = 0.0
    greatest_m: float = 0.0
    seen_m: float = 0.0
    covered_m: float = 0.0
    things: int = 0
    found: int = 0
    found_things: list = dataclasses.field(default_factory=list)
    parts: int = 0
    chains_on: int = 0
    vertices: int = 0
    fewest: int = 0
    vertex_squares: list = dataclasses.field(default_factory=list)  # of error over sigma
    lengths_on: dict = dataclasses.field(default_factory=dict)  # {thing: {id: length}}
    is_covered: np.ndarray = None  # of each bin
    is_close: np.ndarray = None  # the same within GONE_M
    missed: list = dataclasses.field(default_factory=list)
    false_ids: list = dataclasses.field(default_factory=list)  # of chains with more than ON_M of what is false


def snapshot(truth, chains, stamp_s, transit):
    found = Snapshot(transit, stamp_s)
    standing = truth.standing(transit)
    samples = samples_of(chains)
    away_m, owner = truth.nearest(samples.points, standing)
    counted = ~truth.is_open(samples.points, stamp_s, transit, away_m)
    near = counted & (away_m <= NEAR_M)
    length = samples.length_m
    found.counted_m, found.near_m = length[counted].sum(), length[near].sum()
    found.false_m = found.counted_m - found.near_m

    count = len(chains)
    of_chain = lambda mask: np.bincount(samples.chain[mask], length[mask], minlength=count)
    with np.errstate(divide="ignore", invalid="ignore"):
        matched = of_chain(near) / of_chain(counted) >= MATCHED_PART
    if count:
        own = counted & matched[samples.chain]
        found.matched_m = length[own].sum()
        found.distance_sum_m2 = (length * away_m)[own].sum()
        found.square_sum_m3 = (length * away_m**2)[own].sum()
        found.greatest_m = float(away_m[own].max(initial=0.0))
        found.false_ids = [chains[k].id for k in np.flatnonzero(of_chain(counted & ~near) > ON_M)]

    # Things: what was seen of them, what of it is covered, and by which chains.
    seen = truth.seen_bins(stamp_s, transit)
    if len(samples.points):
        bin_away_m = cKDTree(samples.points).query(truth.centres)[0]
    else:
        bin_away_m = np.full(len(truth.centres), np.inf)
    found.is_covered, found.is_close = bin_away_m <= NEAR_M, bin_away_m <= GONE_M
    found.seen_m = truth.bin_m[seen].sum()
    found.covered_m = truth.bin_m[seen & found.is_covered].sum()
    for i in np.flatnonzero(standing):
        bins = truth.bins_of(i)
        own_seen, bin_m = seen[bins], truth.bin_m[bins.start]
        seen_m = own_seen.sum() * bin_m
        if seen_m < min(ON_M, ON_PART * truth.shapes[i].length_m):
            continue
        found.things += 1
        on = near & (owner == i)
        by_chain = np.bincount(samples.chain[on], length[on], minlength=count) if count else np.zeros(0)
        lengths = {chains[k].id: float(by_chain[k]) for k in np.flatnonzero(by_chain >= min(ON_M, ON_PART * seen_m))}
        covered = (own_seen & found.is_covered[bins]).sum() * bin_m
        name = truth.things[i]["id"]
        if lengths and covered >= COVERED_PART * seen_m:
            found.found += 1
            found.found_things.append(name)
        else:
            found.missed.append(name)
        parts = truth.seen_parts(i, own_seen)
        found.fewest += sum(fewest_vertices(truth.part_points(i, part), part is None)
                            for part in ([None] if parts is None else parts))
        if lengths:
            found.lengths_on[name] = lengths
            found.chains_on += len(lengths)
            found.parts += 1 if parts is None else max(1, len(parts))

    # Vertices, but those that are neither right nor wrong.
    for k, chain in enumerate(chains):
        if not matched[k]:
            continue
        vertex_m, _ = truth.nearest(chain.points, standing)
        counts = ~truth.is_open(chain.points, stamp_s, transit, vertex_m)
        found.vertices += int(counts.sum())
        own = counts & (vertex_m <= NEAR_M) & (chain.sigma_m > 0.0)
        found.vertex_squares += ((vertex_m[own] / chain.sigma_m[own])**2).tolist()
    return found


def lost_things(truth, before, after):
    """Things of which the map had more than ON_M, and has not any more though no beam went through their places."""
    with np.errstate(invalid="ignore"):
        untouched = (truth.seen_s <= before.stamp_s) & ~(truth.first_free_s <= after.stamp_s)
    had = before.is_close & untouched & ~truth.optional[truth.thing_of_bin]
    lost_m = np.bincount(truth.thing_of_bin, truth.bin_m * (had & ~after.is_covered), minlength=len(truth.things))
    had_m = np.bincount(truth.thing_of_bin, truth.bin_m * had, minlength=len(truth.things))
    return [truth.things[i]["id"] for i in np.flatnonzero((lost_m > np.minimum(ON_M, 0.5 * had_m)) & (lost_m > 0.0))]


def gone_things(truth, found):
    """{thing: whether the map still has it}, of those that were seen to have gone from ON_M of their outlines, or a
    quarter of what was seen, and farther than PART_GAP_M from what was not seen to be free: a chain bridges gaps that
    are shorter, and farther than CROWDED_M from what stands."""
    with np.errstate(invalid="ignore"):
        free = (truth.last < found.transit)[truth.thing_of_bin] & (truth.free_s <= found.stamp_s)
    standing, gone = truth.standing(found.transit), {}
    for i in np.flatnonzero((truth.last < found.transit) & ~truth.optional):
        own = np.arange(truth.offsets[i], truth.offsets[i + 1])
        own = own[~np.isnan(truth.seen_s[own])]
        clear = own[free[own]]
        if len(clear) and len(clear) < len(own):
            clear = clear[cKDTree(truth.centres[own[~free[own]]]).query(truth.centres[clear])[0] > PART_GAP_M]
        if len(clear):
            clear = clear[truth.nearest(truth.centres[clear], standing)[0] > CROWDED_M]
        bin_m = truth.bin_m[truth.offsets[i]]
        if len(clear) * bin_m >= min(ON_M, ON_PART * len(own) * bin_m):
            gone[truth.things[i]["id"]] = bool(found.is_close[clear].sum() * bin_m
                                               >= min(ON_M, ON_PART * len(clear) * bin_m))
    return gone


@dataclasses.dataclass
class Changes:
    """Of the map against those of the world, each counted after the first transit in which it was seen: things that
    have appeared and things that have gone. What is wrong: false chains, and things lost while they stand or are
    hidden."""

    appeared: dict = dataclasses.field(default_factory=dict)  # {thing: whether it is on the map}
    gone: dict = dataclasses.field(default_factory=dict)  # {thing: whether it is off the map}
    wrong: list = dataclasses.field(default_factory=list)  # (transit, id of a chain or of a thing)
    _false: set = dataclasses.field(default_factory=set)

    def add(self, truth, found, lost):
        first = {thing["id"]: min(thing["present"], default=0) for thing in truth.things}
        for thing in (*found.found_things, *found.missed):
            if first[thing] > 0:
                self.appeared.setdefault(thing, thing not in found.missed)
        for thing, is_left in gone_things(truth, found).items():
            self.gone.setdefault(thing, not is_left)
        self.wrong += [(found.transit, id_) for id_ in found.false_ids if id_ not in self._false]
        self.wrong += [(found.transit, thing) for thing in lost]
        self._false.update(found.false_ids)

    @property
    def right(self):
        return sum(self.appeared.values()) + sum(self.gone.values())

    @property
    def all(self):
        return len(self.appeared) + len(self.gone)

    @property
    def missed(self):
        return [thing for found in (self.appeared, self.gone) for thing, is_right in found.items() if not is_right]


# --- over time


def scans_within(runs, first, last):
    """How many scans of runs are of [first, last]."""
    return sum(max(0, min(last, b) - max(first, a) + 1) for a, b in runs)


class Delays:
    """From being seen to being on the map, and from being seen to be free to being off it; in seconds in which the
    thing was in sight, or its place was. What there was no time for is not counted."""

    def __init__(self, truth):
        self.truth = truth
        self.period_s = truth.document["scan_period_s"]
        self.waiting = []  # (scan, stamp, thing) to be added
        for i, thing in enumerate(truth.things):
            if thing["optional"]:
                continue
            seen = np.sort(truth.seen_s[truth.bins_of(i)])
            seen = seen[~np.isnan(seen)]
            bin_m = truth.bin_m[truth.offsets[i]]
            needed = math.ceil(min(ON_M, ON_PART * truth.shapes[i].length_m) / bin_m)
            if len(seen) >= needed:
                stamp_s = seen[needed - 1]
                self.waiting.append((truth.scan_at(stamp_s), stamp_s, i))
        self.added_s = {}
        self.known_s = {}  # since it was in view from VIEW_M
        self._in_view = {}  # {thing: scan}
        bins = np.flatnonzero(~np.isnan(truth.free_s) & ~truth.optional[truth.thing_of_bin])
        self.free_scan = {int(b): truth.scan_at(truth.free_s[b]) for b in bins}
        self._had = {}  # {thing: its bins that the map had when it went}
        self._off = {}  # {bin: scan}
        self._transit = -1

    def add(self, scan, samples):
        """The map at a scan."""
        truth = self.truth
        stamp_s, transit = truth.stamps[scan], truth.transit_of_scan[scan]
        tree = cKDTree(samples.points) if len(samples.points) else None
        distances = lambda bins: tree.query(truth.centres[bins])[0] if tree else np.full(len(bins), np.inf)
        still = []
        for first, since_s, i in self.waiting:
            if truth.last[i] < transit:
                self._end_added(first, i, scan - 1)
                continue
            if stamp_s < since_s:
                still.append((first, since_s, i))
                continue
            bins = np.arange(truth.offsets[i], truth.offsets[i + 1])
            with np.errstate(invalid="ignore"):
                bins = bins[truth.seen_s[bins] <= stamp_s]
            if np.mean(distances(bins) <= NEAR_M) >= COVERED_PART:
                runs = truth.things[i]["in_sight"]
                self.added_s[truth.things[i]["id"]] = scans_within(runs, first + 1, scan) * self.period_s
                if (begin := self._scan_in_view(i)) is not None:
                    self.known_s[truth.things[i]["id"]] = scans_within(runs, begin + 1, scan) * self.period_s
            else:
                still.append((first, since_s, i))
        self.waiting = still
        if transit != self._transit:
            self._transit = transit
            standing = truth.standing(transit)
            for i in np.flatnonzero((truth.last == transit - 1) & ~truth.optional):
                bins = np.arange(truth.offsets[i], truth.offsets[i + 1])
                bins = bins[~np.isnan(truth.seen_s[bins])]
                if len(bins):
                    clear = truth.nearest(truth.centres[bins], standing)[0] > CROWDED_M
                    self._had[i] = bins[clear & (distances(bins) <= GONE_M)]
        for i, bins in self._had.items():
            left = np.array([b for b in bins if b not in self._off], int)
            if len(left):
                for b in left[distances(left) > GONE_M]:
                    self._off[int(b)] = scan

    def _scan_in_view(self, i):
        """From this scan on ON_M of the thing, or a quarter of its outline, have been hit, and it is or was in sight
        within VIEW_M."""
        truth = self.truth
        hit = np.sort(truth.first_s[truth.bins_of(i)])
        needed = math.ceil(min(ON_M, ON_PART * truth.shapes[i].length_m) / truth.bin_m[truth.offsets[i]])
        begin = truth.scan_at(hit[needed - 1])
        for first, last in truth.things[i]["in_sight"]:
            scans = np.arange(max(first, begin), last + 1)
            away = truth.shapes[i].outline[None] - truth.poses[scans, None, :2]
            near = scans[np.hypot(away[..., 0], away[..., 1]).min(1, initial=np.inf) <= VIEW_M]
            if len(near):
                return int(near[0])
        return None

    def _end_added(self, first, i, scan):
        waited_s = scans_within(self.truth.things[i]["in_sight"], first + 1, scan) * self.period_s
        if waited_s > ADDED_S:
            self.added_s[self.truth.things[i]["id"]] = math.inf
            self.known_s[self.truth.things[i]["id"]] = math.inf

    def end(self, scan):
        """({thing: delay}, {thing: delay})"""
        for first, _, i in self.waiting:
            if first is not None:
                self._end_added(first, i, scan)
        removed_s = {}
        for i, bins in self._had.items():
            if not len(bins):
                continue
            runs, delays = self.truth.things[i]["passed"], []
            own = np.arange(self.truth.offsets[i], self.truth.offsets[i + 1])
            own = own[~np.isnan(self.truth.seen_s[own])]
            free = np.array([self.free_scan.get(int(b), NEVER) for b in own])
            tree = cKDTree(self.truth.centres[own])
            for b, beside in zip(bins, tree.query_ball_point(self.truth.centres[bins], PART_GAP_M)):
                freed = int(free[beside].max())  # a chain bridges gaps that are shorter
                if freed == NEVER:
                    continue
                off = self._off.get(int(b))
                waited_s = scans_within(runs, freed + 1, scan if off is None else off) * self.period_s
                if off is not None:
                    delays.append(waited_s)
                elif waited_s > REMOVED_S:
                    delays.append(math.inf)
            if delays:
                # Of its bins nine in ten: what remains is shorter than what counts as a chain.
                removed_s[self.truth.things[i]["id"]] = float(np.quantile(delays, 0.9, method="higher"))
        return self.added_s, removed_s


class Persons:
    """What a person leaves: a chain where it was, and is not any more."""

    def __init__(self, truth):
        self.truth = truth
        self.track = np.array([place or (np.nan, np.nan) for place in truth.walker], float)
        self.greatest_m = 0.0  # left by a person, at any time
        self.ids = set()
        self.seen, self.mapped = 0, 0  # scans of a person, and those in which a chain is on it

    def add(self, scan, chains, samples):
        truth = self.truth
        now = self.track[scan]
        begin = scan - round(PERSON_LEFT_S / truth.document["scan_period_s"])
        past = self.track[:max(begin, 0)]
        past = past[~np.isnan(past[:, 0])]
        is_here = not math.isnan(now[0])
        self.seen += is_here
        if not len(samples.points):
            return
        on_track = np.zeros(len(samples.points), bool)
        if len(past):
            on_track = cKDTree(past).query(samples.points, distance_upper_bound=PERSON_M)[0] <= PERSON_M
            recent = self.track[max(begin, 0):scan + 1]
            recent = recent[~np.isnan(recent[:, 0])]
            if len(recent):
                on_track &= cKDTree(recent).query(samples.points)[0] > PERSON_AWAY_M
        on_person = (np.hypot(*(samples.points - now).T) <= PERSON_M) if is_here else np.zeros(len(on_track), bool)
        either = np.flatnonzero(on_track | on_person)
        if not len(either):
            return
        transit, stamp_s = truth.transit_of_scan[scan], truth.stamps[scan]
        away_m, _ = truth.nearest(samples.points[either], truth.standing(transit))
        right = (away_m <= NEAR_M) | truth.is_open(samples.points[either], stamp_s, transit, away_m)
        wrong = np.zeros(len(on_track), bool)
        wrong[either] = ~right
        for mask, left in ((wrong & on_track, True), (wrong & on_person, False)):
            lengths = np.bincount(samples.chain[mask], samples.length_m[mask], minlength=len(chains))
            longest = np.flatnonzero(lengths > PERSON_CHAIN_M)
            if left:
                self.greatest_m = max(self.greatest_m, float(lengths.max(initial=0.0)))
                self.ids.update(chains[k].id for k in longest)
            else:
                self.mapped += len(longest) > 0


class Poses:
    def __init__(self, truth):
        self.truth = truth
        self.scans, self.errors, self.sigmas, self.nees = [], [], [], []
        self.none = 0
        self.found_s = None

    def add(self, scan, pose):
        if pose is None or pose.get("x") is None:
            self.none += 1
            return
        error = np.array([pose[key] for key in ("x", "y", "yaw")]) - self.truth.poses[scan]
        error[2] = (error[2] + math.pi) % (2.0 * math.pi) - math.pi
        after_s = self.truth.stamps[scan] - self.truth.stamps[0]
        if self.found_s is None and np.hypot(*error[:2]) <= FOUND_M:
            self.found_s = after_s
        if after_s < SETTLE_S:
            return
        covariance = np.array(pose.get("covariance") or np.zeros(9), float).reshape(3, 3)
        self.scans.append(scan)
        self.errors.append(error)
        self.sigmas.append(np.sqrt(np.maximum(np.diag(covariance), 0.0)))
        try:
            self.nees.append(float(error @ np.linalg.solve(covariance, error)))
        except np.linalg.LinAlgError:
            self.nees.append(math.inf)

    @property
    def in_sight(self):
        """Of each, how many reflectors."""
        return self.truth.in_sight_of_scan[self.scans] if self.scans else np.zeros(0, int)


@dataclasses.dataclass
class Run:
    """The score of one run of the tool."""

    name: str
    kind: str  # of world
    variant: str
    snapshots: list
    lost: list
    stable: tuple  # cases with the same id, all cases
    added_s: dict
    removed_s: dict
    known_s: dict
    changes: Changes
    persons: Persons
    poses: Poses
    scans: int
    ids: int  # that were ever on the map
    reused_ids: int  # in a line twice, or again after having gone
    chains: list = dataclasses.field(default_factory=list)  # after the last transit
    truth: Truth = None
    times_ms: tuple = (math.nan, math.nan)  # that the tool takes for a scan: p50, p99

    @property
    def last(self):
        return self.snapshots[-1]


def score(truth, lines, name="", kind="corridor", variant="plain"):
    """`lines` of the tool, one after the other, as dictionaries; those of no scan of the truth are left out."""
    delays, persons, poses = Delays(truth), Persons(truth), Poses(truth)
    last_of = {int(k): int(np.flatnonzero(truth.transit_of_scan == k)[-1]) for k in np.unique(truth.transit_of_scan)}
    snapshots, lost, changes = [], [], Changes()
    before_ids, all_ids, reused, scans, chains, scan = set(), set(), 0, 0, [], 0
    pending = None  # the latest line of the transit, in case that its last scan has none

    def take(line, at):
        transit = int(truth.transit_of_scan[at])
        found = snapshot(truth, chains_of(line), truth.stamps[at], transit)
        now_lost = lost_things(truth, snapshots[-1], found) if snapshots else []
        lost.extend((transit, thing) for thing in now_lost)
        changes.add(truth, found, now_lost)
        snapshots.append(found)

    for line in lines:
        at = truth.scan_at(line["stamp"])
        if at is None:
            continue
        if pending and truth.transit_of_scan[pending[1]] != truth.transit_of_scan[at]:
            take(*pending)
        scan, scans, pending = at, scans + 1, (line, at)
        poses.add(at, line.get("pose"))
        ids = [polyline["id"] for polyline in line["polylines"]]
        now = set(ids)
        reused += len(ids) - len(now) + len((now - before_ids) & all_ids)
        all_ids |= now
        before_ids = now
        if at % EVERY_SCANS == 0 or at in last_of.values():
            chains = chains_of(line)
            samples = samples_of(chains, COARSE_M)
            delays.add(at, samples)
            persons.add(at, chains, samples)
    if pending is None:
        raise ValueError(f"{name}: the tool gave no line for any scan")
    take(*pending)
    chains = chains_of(pending[0])

    same = cases = 0
    present = {thing["id"]: thing["present"] for thing in truth.things}
    for earlier, later in zip(snapshots, snapshots[1:]):
        for thing, lengths in earlier.lengths_on.items():
            if later.transit not in present[thing]:
                continue
            cases += 1
            main = max(lengths, key=lengths.get)
            same += later.lengths_on.get(thing, {}).get(main, 0.0) >= 0.5 * lengths[main]
    added_s, removed_s = delays.end(scan)
    return Run(name, kind, variant, snapshots, lost, (same, cases), added_s, removed_s, delays.known_s, changes,
               persons, poses, scans, len(all_ids), reused, chains, truth)


# --- runs of a kind together


def share(part, whole):
    return part / whole if whole else math.nan


def quantile(values, part):
    return float(np.quantile(values, part, method="higher")) if values else math.nan


def root_mean(values):
    return math.sqrt(np.mean(values)) if len(values) else math.nan


class Group:
    """Of runs: pooled, but greatest values and false chains are of the worst."""

    def __init__(self, runs):
        self.runs = runs
        total = lambda key: sum(getattr(run.last, key) for run in runs)
        self.precision = share(total("near_m"), total("counted_m"))
        self.recall = share(total("found"), total("things"))
        self.coverage = share(total("covered_m"), total("seen_m"))
        self.mean_m = share(total("distance_sum_m2"), total("matched_m"))
        self.greatest_m = max(run.last.greatest_m for run in runs)
        self.false_m = max(run.last.false_m for run in runs)
        self.ids_per_object = share(total("chains_on"), total("parts"))
        self.id_stability = share(sum(run.stable[0] for run in runs), sum(run.stable[1] for run in runs))
        self.vertices, self.fewest = total("vertices"), total("fewest")
        self.vertices_ratio = share(self.vertices, self.fewest)
        ratio = root_mean([square for run in runs for square in run.last.vertex_squares])
        self.vertex_ratio_low = self.vertex_ratio_high = ratio
        self.added = [value for run in runs for value in run.added_s.values()]
        self.removed = [value for run in runs for value in run.removed_s.values()]
        self.added_95_s, self.removed_95_s = quantile(self.added, 0.95), quantile(self.removed, 0.95)
        self.lost_things = sum(len(run.lost) for run in runs)
        self.left_by_persons = sum(len(run.persons.ids) for run in runs)
        errors = np.array([error for run in runs for error in run.poses.errors]).reshape(-1, 3)
        sigmas = np.array([sigma for run in runs for sigma in run.poses.sigmas]).reshape(-1, 3)
        in_sight = np.concatenate([run.poses.in_sight for run in runs])
        two, three = in_sight == 2, in_sight >= 3
        self.x_m, self.y_m, self.yaw_rad = (root_mean(errors[:, axis]**2) for axis in range(3))
        self.position_m = max(self.x_m, self.y_m)
        self.two_position_m = max(root_mean(errors[two, 0]**2), root_mean(errors[two, 1]**2))
        self.three_position_m = max(root_mean(errors[three, 0]**2), root_mean(errors[three, 1]**2))
        self.three_yaw_rad = root_mean(errors[three, 2]**2)
        # What is said: of nearly all of these scans.
        self.three_sigma_m = quantile(sigmas[three, :2].max(1, initial=0.0).tolist(), 0.95)
        self.three_sigma_rad = quantile(sigmas[three, 2].tolist(), 0.95)
        nees = np.array([v for run in runs for v in run.poses.nees])
        self.nees = float(nees.mean()) if len(nees) else math.nan
        self.nees_low = self.nees_high = self.nees
        self.nees_inside = float(np.mean(nees <= stats.chi2.ppf(0.95, 3))) if len(nees) else math.nan
        means, _ = self.over_transits()
        self.table_mean_m = float(np.mean(means)) if means else math.nan
        self.table_greatest_m = max(means, default=math.nan)
        # Changes.
        changes = [run.changes for run in runs]
        right, wrong = sum(found.right for found in changes), sum(len(found.wrong) for found in changes)
        self.change_count = sum(found.all for found in changes)
        self.change_precision, self.change_recall = share(right, right + wrong), share(right, self.change_count)
        self.known = [value for run in runs for value in run.known_s.values()]
        self.known_95_s = quantile(self.known, 0.95)
        self.persons_greatest_m = max(run.persons.greatest_m for run in runs)

    def over_transits(self, with_person=None):
        """(means, standard deviations) of the distance in m, one per transit and run; only those with or without a
        person, if this is asked for."""
        means, deviations = [], []
        for run in self.runs:
            for found in run.snapshots:
                if found.matched_m <= 0.0 or with_person not in (None, run.truth.has_person(found.transit)):
                    continue
                mean = found.distance_sum_m2 / found.matched_m
                means.append(mean)
                deviations.append(math.sqrt(max(0.0, found.square_sum_m3 / found.matched_m - mean**2)))
        return means, deviations


def groups_of(runs):
    """{(kind, variant): Group}"""
    keys = dict.fromkeys((run.kind, run.variant) for run in runs)
    return {key: Group([run for run in runs if (run.kind, run.variant) == key]) for key in keys}


def label(key):
    return NAMES[key[0]] + VARIANT_NAMES[key[1]]


# --- running the tool


def lines_of(path):
    with open(path) as file:
        for text in file:
            if text.strip():
                yield json.loads(text)


def bag_name(kind, seed, variant, picked=None):
    return polygon_worlds.name_of(kind, seed, *VARIANTS.get(variant, VARIANTS["plain"]), picked)


def run_tool(command):
    """What it prints."""
    return subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, text=True).stdout


TIMES = re.compile(r"each: p50 ([\d.]+) ms, p99 ([\d.]+) ms")  # as bag_player.hpp prints


def drive(arguments, directory, bags, kind, seed, variant, picked):
    name = bag_name(kind, seed, variant, picked)
    document = json.loads((bags / f"{name}.truth.json").read_text())
    if variant == ODOMETRY and not (bags / f"{name}_odometry.bag").exists():
        polygon_worlds.write_odometry_bag(bags, name)
    bag = bags / f"{name}{ENDS.get(variant, '')}.bag"
    out = directory / f"{name}_{variant}.jsonl"
    command = [arguments.tool, bag, "--scan-topic", "/scan", "--odom-topic", "/odom", "--world-frame", "map",
               "--config", arguments.config, "--out", out]
    if variant == OBJECTS:
        command += ["--objects", "--model-folder", ROOT / "models"]
    if variant in ENDS:
        command += ["--localization", "tf"]
    else:
        command += ["--reflectors", bags / f"{name}.reflectors.yaml"]
        if document["initial_pose"]:
            command.append("--initial-pose=" + ",".join(f"{value:.6f}" for value in document["initial_pose"]))
    printed = run_tool(command)
    run = score(Truth(document), lines_of(out), f"{kind} {seed}{VARIANT_NAMES[variant]}", kind, variant)
    if times := TIMES.search(printed):
        run.times_ms = tuple(float(value) for value in times.groups())
    if not arguments.keep:
        out.unlink()
    return run


def wanted_runs(arguments):
    """(kind, seed, variant, picked transits)"""
    picked = arguments.picked
    for kind in arguments.worlds if "map" in arguments.only else ():
        for seed in range(1, arguments.seeds + 1):
            for variant in arguments.variants:
                yield kind, seed, variant, picked
    if "changes" in arguments.only:  # of other seeds
        for k in range(arguments.changes):
            yield (arguments.worlds[k % len(arguments.worlds)], 101 + k // len(arguments.worlds), CHANGES,
                   polygon_worlds.SHORT)


def do_piece(arguments, directory, bags, what, *piece):
    """In a process of its own."""
    if what == "run":
        return drive(arguments, directory, bags, *piece)
    if what == "associations":
        return polygon_associations.compare(*piece)
    return json.loads(run_tool(piece))


def run_all(arguments, directory):
    """The runs, and {what: result} of the others."""
    bags = arguments.bags or directory / "bags"
    wanted = list(wanted_runs(arguments))
    to_make = {}
    for kind, seed, variant, picked in wanted:
        name = bag_name(kind, seed, variant, picked)
        if not (bags / f"{name}.truth.json").exists():
            to_make[name] = (kind, seed, *VARIANTS.get(variant, VARIANTS["plain"]), polygon_worlds.TRANSITS, picked)
    processes = concurrent.futures.ProcessPoolExecutor
    if to_make:
        run_pieces(functools.partial(polygon_worlds.write_world, bags), to_make, "worlds", processes)
    pieces = {}
    if "policies" in arguments.only:  # takes longest
        pieces["policies"] = ("program", arguments.programs / "safety_transits",
                              *(f"--{what}={count}" for what, count in arguments.policy_runs.items()))
    if "associations" in arguments.only:
        pieces |= {("associations", kind, seed): ("associations", kind, seed) for kind in arguments.worlds
                   for seed in range(1, arguments.seeds + 1)}
    pieces |= {piece: ("run", *piece) for piece in wanted}
    found = run_pieces(functools.partial(do_piece, arguments, directory, bags), pieces, "runs", processes)
    runs = [found.pop(piece) for piece in wanted]
    if "cost" in arguments.only:  # alone
        found["cost"] = {name: json.loads(run_tool((arguments.programs / "benchmark" / name, "--benchmark_format=json",
                                                    *arguments.benchmark_options)))["benchmarks"]
                         for name in BENCHMARKS}
    return runs, found


# --- verdicts and tables


def number(value, decimals=3):
    if math.isnan(value):
        return "none"
    return "never" if math.isinf(value) else f"{value:.{decimals}f}"


def target_of(target, kind):
    return target[kind] if isinstance(target, dict) else target


def targets(groups, found=None):
    """(sentence, figure, met); `found`: of what is no run."""
    by_odometry = {key: group for key, group in groups.items() if key[1] == ODOMETRY}
    short = {key: group for key, group in groups.items() if key[1] == CHANGES}
    others = {key: group for key, group in groups.items() if key[1] not in (ODOMETRY, CHANGES)}
    yield from targets_of(others, TABLE_TARGETS + TARGETS)
    yield from targets_of(by_odometry, ODOMETRY_TARGETS)
    if short:
        # One group: how many changes there are in a run of one kind is too few for a part of three hundredths.
        pooled = Group([run for group in short.values() for run in group.runs])
        yield from targets_of({("both", CHANGES): pooled}, CHANGE_TARGETS)
        low, high = stats.chi2.ppf((0.025, 0.975), 3 * len(pooled.runs)) / len(pooled.runs)
        yield (f"mean NEES of the poses of {len(pooled.runs)} runs within its 95 % band, {low:.2f} to {high:.2f}",
               f"{pooled.nees:.2f}", low <= pooled.nees <= high)
        yield (f"at least 95 % of the poses of {len(pooled.runs)} runs in their 95 % regions",
               f"{100.0 * pooled.nees_inside:.1f} %", pooled.nees_inside >= 0.95)
    yield from other_targets(found or {})


def targets_of(groups, wanted):
    for key, what, unit, target, goal, scale, decimals, more, of_poses in wanted:
        values = {group: scale * getattr(found, key) for group, found in groups.items()
                  if not (of_poses and group[1] == TF)}
        if not values:
            continue
        limit = (", ".join(f"{value:g}{unit} ({kind})" for kind, value in target.items())
                 if isinstance(target, dict) else f"{target:g}{unit}")
        sentence = what.format(limit) + (f" (goal {goal:g}{unit})" if goal is not None else "")
        met = all(value >= target_of(target, group[0]) if more else value <= target_of(target, group[0])
                  for group, value in values.items())
        yield sentence, ", ".join(f"{number(value, decimals)} {label(group)}" for group, value in values.items()), met


def three(values, scale=100.0):
    if not values:
        return "none"
    return " / ".join(f"{scale * value:.2f}" for value in (float(np.mean(values)), min(values), max(values)))


def paper_table(groups):
    rows = []
    for key, group in groups.items():
        for with_person, which in ((False, "no person"), (True, "a person")):
            means, deviations = group.over_transits(with_person)
            rows.append((f"{label(key)}, {which}", str(len(means)), three(means), three(deviations)))
    rows += [(f"{name}, printed", "", *(" / ".join(f"{v:.2f}" for v in values) for values in (mean, deviation)))
             for name, mean, deviation in PAPER]
    return table(("world", "transits", "mean, cm: average / least / greatest", "standard deviation, cm: the same"),
                 rows)


def map_table(groups):
    rows = [(label(key), number(g.precision), number(g.recall), number(g.coverage), number(100.0 * g.mean_m, 2),
             number(100.0 * g.greatest_m, 1), number(g.false_m, 2), number(g.ids_per_object, 2),
             number(g.id_stability), f"{g.vertices} / {g.fewest}", number(g.vertex_ratio_low, 2))
            for key, g in groups.items()]
    return table(("world", "precision", "recall", "coverage", "mean distance, cm", "greatest, cm",
                  "false chains, m, worst run", "chains per object", "same id", "vertices / fewest",
                  "vertex error over sigma"), rows)


def change_table(groups):
    def delays(values):
        return f"{number(quantile(values, 0.5), 2)} / {number(quantile(values, 0.95), 2)} / " \
               f"{number(max(values, default=math.nan), 2)} ({len(values)})"

    rows = []
    for key, g in groups.items():
        seen, mapped = (sum(getattr(run.persons, name) for run in g.runs) for name in ("seen", "mapped"))
        rows.append((label(key), delays(g.added), delays(g.removed), str(g.lost_things), str(g.left_by_persons),
                     number(max(run.persons.greatest_m for run in g.runs), 2), number(100.0 * share(mapped, seen), 1),
                     str(sum(run.reused_ids for run in g.runs))))
    return table(("world", "added, s: median / 95 % / longest (things)", "removed, s: the same", "lost",
                  "left by persons", "longest of them, m", "chain on a person, % of its scans", "ids used twice"),
                 rows)


def pose_table(groups):
    rows = []
    for key, g in groups.items():
        found = [run.poses.found_s for run in g.runs]
        late = math.inf if any(value is None for value in found) else max(found)
        of_all = (label(key), f"{number(1000 * g.x_m, 2)} / {number(1000 * g.y_m, 2)}", number(1000 * g.yaw_rad, 2))
        if key[1] == ODOMETRY:  # whose covariance is a guess
            rows.append((*of_all, "", "", "", "", "", "", str(sum(run.poses.none for run in g.runs))))
            continue
        rows.append((*of_all,
                     f"{number(1000 * g.three_position_m, 2)}, {number(1000 * g.three_yaw_rad, 2)} mrad",
                     f"{number(1000 * g.three_sigma_m, 2)}, {number(1000 * g.three_sigma_rad, 2)} mrad",
                     number(1000 * g.two_position_m, 2), number(g.nees, 2), number(100 * g.nees_inside, 1),
                     number(late, 2), str(sum(run.poses.none for run in g.runs))))
    return table(("world", "RMS along x / y, mm", "yaw, mrad", "three or more in sight: RMS, mm",
                  "its sigma, mm (95 % of the scans)", "two in sight: RMS, mm", "NEES", "in the 95 % region, %",
                  "found to 3 cm after, s", "scans without a pose"), rows)


def run_table(runs):
    rows = [(run.name, f"{run.scans:,}", str(len(run.chains)), str(run.ids), " ".join(run.last.missed) or "none",
             ", ".join([f"{thing} ({transit + 1})" for transit, thing in run.lost[:NAMED]]
                       + [f"{len(run.lost) - NAMED} more"] * (len(run.lost) > NAMED)) or "none",
             " / ".join(number(time_ms, 2) for time_ms in run.times_ms)) for run in runs]
    return table(("run", "scans", "chains at the end", "ids in all", "missed at the end", "lost (transit)",
                  "time per scan, ms: p50 / p99"), rows)


def changes_table(groups):
    def delays(values):
        return " / ".join(number(value, 2) for value in (quantile(values, 0.5), quantile(values, 0.95),
                                                         max(values, default=math.nan)))

    rows = []
    for key, g in groups.items():
        found = [run.changes for run in g.runs]
        part = lambda name: (f"{sum(sum(getattr(own, name).values()) for own in found)} of "
                             f"{sum(len(getattr(own, name)) for own in found)}")
        false = sum(isinstance(what, int) for own in found for _, what in own.wrong)
        rows.append((label(key), str(len(g.runs)), part("appeared"), part("gone"), str(false), str(g.lost_things),
                     number(g.change_precision), number(g.change_recall), delays(g.known), delays(g.removed),
                     f"{g.left_by_persons}, {number(g.persons_greatest_m, 2)}"))
    return table(("world", "runs", "appeared, on the map", "gone, off the map", "false chains", "lost", "precision",
                  "recall", "known after, s: median / 95 % / longest", "removed after, s: the same",
                  "left by persons, longest in m"), rows)


def changes_missed(runs):
    """What was wrong, run by run."""
    lines = []
    for run in runs:
        wrong = [f"{what} (transit {transit + 1})" if isinstance(what, str) else f"chain {what} (transit {transit + 1})"
                 for transit, what in run.changes.wrong]
        parts = [f"missed {', '.join(run.changes.missed)}"] * bool(run.changes.missed)
        parts += [f"wrong: {', '.join(wrong)}"] * bool(wrong)
        if parts:
            lines.append(f"- {run.name}: {'; '.join(parts)}")
    return "\n".join(lines) + "\n" if lines else ""


# --- of what is no run: associations, policies, cost


POLICIES = {"conservative": "conservative", "updated": "updated", "ignore_known": "ignore known"}
MAP_BENCHMARK, FILTER_BENCHMARK = BENCHMARKS = ("polygon_map_benchmark", "reflector_localization_benchmark")
SAVED_PART = 0.15
P50_MS, P99_MS, FILTER_MS = 1.5, 3.0, 0.2
GROWTH = 1.2  # of the cost, from the map that is in view to one that is much larger


def associations_of(found):
    """(kind, seed): Comparison, together, or none."""
    together = polygon_associations.Comparison()
    for key, comparison in found.items():
        if key[0] == "associations":
            together.add(comparison)
    return together if together.scans else None


def benchmark_times(cost, program, name, counter=None):
    """{size: time in ms}: the mean, or one of the benchmark's own, which is in microseconds."""
    scale = {"ns": 1e-6, "us": 1e-3, "ms": 1.0}
    return {int(own["name"].split("/")[1]):
            own[counter] * 1e-3 if counter else own["cpu_time"] * scale[own["time_unit"]]
            for own in cost[program] if own["name"].split("/")[0] == name
            and own.get("run_type", "iteration") == "iteration" and (not counter or counter in own)}


def other_targets(found):
    if policies := found.get("policies"):
        saved = policies["updated"]["boxes"]["saved"]
        yield (f'the policy "updated" saves at least {100.0 * SAVED_PART:g} % of the transit time with three misplaced '
               "boxes", f"{100.0 * saved:.1f} %", saved >= SAVED_PART)
        runs = {name: policies[name]["walkers"] for name in POLICIES}
        touched = {name: runs[name]["touched"] + policies[name]["walkers_behind_a_box"]["touched"] for name in POLICIES}
        yield (f"no policy lets the vehicle touch a person who steps into the way, in {runs['updated']['runs']:,} runs",
               ", ".join(f"{touched[name]} {title}" for name, title in POLICIES.items()), not any(touched.values()))
    if cost := found.get("cost"):
        p50, p99 = (benchmark_times(cost, MAP_BENCHMARK, "from_scan_to_both_maps", counter)
                    for counter in ("p50_us", "p99_us"))
        times = p50 or benchmark_times(cost, MAP_BENCHMARK, "from_scan_to_map")
        if p50:
            yield (f"from scan to chains and objects, 40 chains, one core: p50 at most {P50_MS:g} ms, p99 at most "
                   f"{P99_MS:g} ms", f"{p50[40]:.2f} ms, {p99[40]:.2f} ms", p50[40] <= P50_MS and p99[40] <= P99_MS)
        else:
            yield (f"from scan to chains, 40 chains, one core: mean at most {P50_MS:g} ms", f"{times[40]:.2f} ms",
                   times[40] <= P50_MS)
        if {40, 500} <= times.keys():
            growth = times[500] / times[40]
            yield (f"its cost does not grow with the map: with 500 chains, of which the same 40 are in view, at most "
                   f"{GROWTH:g} times as much", f"{growth:.2f}", growth <= GROWTH)
        filters = benchmark_times(cost, FILTER_BENCHMARK, "filter")
        yield (f"reflector EKF at most {FILTER_MS:g} ms per scan", f"{max(filters.values()):.3f} ms",
               max(filters.values()) <= FILTER_MS)


def metric_table(comparison):
    right, wrong = np.array(comparison.right).reshape(-1, 3), np.array(comparison.wrong).reshape(-1, 2)
    gate_m = polygon_associations.GATE_M
    rows = []
    for k, name in enumerate(("its greatest distance from the truth", "restricted distance as printed",
                              "clipped distance")):
        accepted = f"{100.0 * np.mean(wrong[:, k - 1] <= gate_m):.1f}" if k and len(wrong) else ""
        rows.append((name, *(f"{100.0 * np.quantile(right[:, k], part, method='higher'):.1f}" for part in (0.5, 0.95)),
                     f"{100.0 * np.mean(right[:, k] > gate_m):.1f}", accepted))
    return table(("of a polyline and its chain", "median, cm", "95 %, cm", f"beyond {100.0 * gate_m:g} cm, %",
                  "of wrong pairs within, %"), rows)


def association_table(comparison):
    rows = [(name, number(share(right, pairs)), number(share(with_partner, having)))
            for name, (right, pairs, with_partner, having) in comparison.associations.items()]
    return table(("association", "precision of its pairs", "polylines with a right partner, of those that have one"),
                 rows)


def policy_table(policies):
    rows = []
    for name, title in POLICIES.items():
        boxes, walkers, hidden = (policies[name][what] for what in ("boxes", "walkers", "walkers_behind_a_box"))
        rows.append((title, f"{boxes['mean_s']:.1f} ({boxes['least_s']:.1f} to {boxes['most_s']:.1f})",
                     f"{100.0 * boxes['saved']:.1f}", f"{walkers['mean_s']:.1f}",
                     f"{walkers['touched']} of {walkers['runs']:,}", f"{100.0 * walkers['least_clearance_m']:.0f}",
                     f"{hidden['touched']} of {hidden['runs']:,}", f"{100.0 * hidden['least_clearance_m']:.0f}"))
    return table(("policy", "transit with three boxes, s: mean (least to most)", "saved, %", "transit with a person, s",
                  "touched", "nearest, cm", "from behind a box: touched", "nearest, cm"), rows)


def cost_table(cost):
    titles = {"from_scan_to_map": "from scan to chains, {} chains on the map",
              "from_scan_to_both_maps": "from scan to chains and objects, {} chains on the map",
              "filter": "reflector EKF, {} reflectors", "from_scan": "from scan to pose, {} reflectors"}
    rows = []
    for program in BENCHMARKS:
        names = dict.fromkeys(own["name"].split("/")[0] for own in cost[program])
        for name in (name for name in names if name in titles):
            p50, p99 = (benchmark_times(cost, program, name, counter) for counter in ("p50_us", "p99_us"))
            rows += [(titles[name].format(size), f"{time_ms:.3f}", *(f"{times[size]:.3f}" if size in times else ""
                                                                    for times in (p50, p99)))
                     for size, time_ms in benchmark_times(cost, program, name).items()]
    return table(("what", "ms per scan, mean, one core", "p50", "p99"), rows)


# --- pictures


LEGEND = [
    patches.Patch(fc=TRUTH, ec=STANDING, label="truth"),
    pyplot.Line2D([], [], color="#e0a100", lw=4, alpha=0.5, label="seen"),
    pyplot.Line2D([], [], color=MAPPED, lw=1.6, marker=".", label="map, with ids"),
    patches.Patch(fc="0.9", ec="0.6", ls=":", label="gone, or a reflector"),
]


def draw_map(ax, run):
    truth, stamp_s = run.truth, run.truth.stamps[-1]
    transit = len(truth.transits) - 1
    standing = truth.standing(transit)
    for i, shape in enumerate(truth.shapes):
        if standing[i]:
            ax.add_patch(patches.Polygon(shape.outline, fill=truth.things[i]["kind"] != "walls", fc=TRUTH,
                                         ec=STANDING, lw=0.8, zorder=1))
        elif truth.optional[i] and truth.stands[i, transit] or truth.last[i] < transit:
            ax.add_patch(patches.Polygon(shape.outline, fc="0.9", ec="0.6", ls=":", lw=0.8, zorder=0))
    seen = truth.seen_bins(stamp_s, transit)
    ax.plot(*truth.centres[seen].T, ".", color="#e0a100", ms=3, mew=0, alpha=0.5, zorder=2)
    lines = [np.vstack((chain.points, chain.points[:1])) if chain.closed else chain.points for chain in run.chains]
    ax.add_collection(drawn.LineCollection(lines, colors=MAPPED, lw=1.4, zorder=3))
    for chain in run.chains:
        ax.plot(*chain.points.T, ".", color=MAPPED, ms=4, mew=0, zorder=4)
        if len(chain.points):
            ax.annotate(str(chain.id), chain.points[len(chain.points) // 2], fontsize=6, color=MAPPED, zorder=5,
                        xytext=(3, 3), textcoords="offset points")
    ax.plot(*truth.poses[:, :2].T, ",", color="0.5", zorder=0)
    draw_robot(ax, truth.poses[-1], 0.25)
    low, high = truth.shapes[0].outline.min(0) - 0.3, truth.shapes[0].outline.max(0) + 0.3
    ax.set(aspect="equal", xticks=[], yticks=[], xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    for spine in ax.spines.values():
        spine.set_color("0.8")
    ax.set_title(run.name, fontsize=10)


DRAWN = ("plain", ODOMETRY)


def draw(runs, images):
    """The last map of the first run of each kind, by reflectors and by odometry alone, where there are both."""
    for kind in dict.fromkeys(run.kind for run in runs):
        own = [run for run in runs if run.kind == kind and run.variant != CHANGES]
        if not own:
            continue
        firsts = {run.variant: run for run in reversed(own)}
        firsts = [firsts[variant] for variant in DRAWN if variant in firsts] or list(firsts.values())[-1:]
        rows, columns, size = (len(firsts), 1, (12.0, 3.6)) if kind == "corridor" else (1, len(firsts), (8.0, 6.4))
        figure, axes = pyplot.subplots(rows, columns, figsize=(columns * size[0], rows * size[1]), squeeze=False,
                                       layout="constrained")
        for ax, run in zip(axes.flat, firsts):
            draw_map(ax, run)
        save(figure, images / f"polygons_{kind}.png", LEGEND)


AXES = (("x", 1000.0, "mm"), ("y", 1000.0, "mm"), ("yaw", 1000.0, "mrad"))
SIGHT_COLORS = {0: "#c8553d", 1: "#e0a100", 2: "#f4d58d"}  # of the time with so few reflectors


def draw_poses(run, path, transit=1):
    """Fig. 5 of the paper: errors of the pose over a transit, in what it says of them."""
    poses, truth = run.poses, run.truth
    own = np.flatnonzero(truth.transit_of_scan[poses.scans] == min(transit, truth.transit_of_scan.max()))
    scans = np.array(poses.scans)[own]
    errors, sigmas = np.array(poses.errors)[own], np.array(poses.sigmas)[own]
    since_s = truth.stamps[scans] - truth.stamps[scans[0]]
    figure, axes = pyplot.subplots(4, 1, figsize=(9.0, 7.6), sharex=True, layout="constrained")
    for k, (ax, (name, scale, unit)) in enumerate(zip(axes, AXES)):
        for sigmas_wide, alpha in ((2, 0.18), (1, 0.3)):
            ax.fill_between(since_s, -sigmas_wide * scale * sigmas[:, k], sigmas_wide * scale * sigmas[:, k],
                            color=MAPPED, alpha=alpha, lw=0)
        ax.plot(since_s, scale * errors[:, k], color=STANDING, lw=0.9)
        ax.set_ylabel(f"{name}, {unit}")
    low, high = stats.chi2.ppf((0.025, 0.975), 3)
    axes[3].axhspan(low, high, color=MAPPED, alpha=0.18, lw=0)
    axes[3].plot(since_s, np.array(poses.nees)[own], color=STANDING, lw=0.9)
    axes[3].set(ylabel="NEES", xlabel="time of the transit, s", yscale="log")
    in_sight = truth.in_sight_of_scan[scans]
    for ax in axes:
        clean(ax)
        for count, color in SIGHT_COLORS.items():
            ax.fill_between(since_s, 0.0, 0.04, where=in_sight == count, color=color, step="mid", lw=0,
                            transform=ax.get_xaxis_transform())
    axes[0].set_title(f"{run.name}, transit {transit + 1}", fontsize=10)
    save(figure, path, [pyplot.Line2D([], [], color=STANDING, label="error, NEES"),
                        patches.Patch(color=MAPPED, alpha=0.4, label="1 and 2 sigma, 95 % of the NEES"),
                        *(patches.Patch(color=color, label=f"{count} in sight")
                          for count, color in SIGHT_COLORS.items() if (in_sight == count).any())])


PRINTED_MEANS = ((2.46, "best printed", "--"), (4.71, "printed, by odometry alone", ":"))
TRANSIT_COLORS = {"plain": "#0b6e4f", "sweep": "#3d5a80", OBJECTS: "#e0a100", TF: "#8a5a83", ODOMETRY: "#c8553d"}


def draw_transits(groups, path):
    """Distances from the truth after each transit: of the mean, lines of the runs' mean and their range."""
    kinds = list(dict.fromkeys(kind for kind, variant in groups if variant != CHANGES))
    figure, axes = pyplot.subplots(1, len(kinds), figsize=(5.2 * len(kinds), 3.6), squeeze=False, sharey=True,
                                   layout="constrained")
    for ax, kind in zip(axes.flat, kinds):
        for variant, color in TRANSIT_COLORS.items():
            if (kind, variant) not in groups:
                continue
            runs = groups[kind, variant].runs
            means = np.array([[100.0 * share(found.distance_sum_m2, found.matched_m) for found in run.snapshots]
                              for run in runs])
            at = 1 + np.arange(means.shape[1])
            ax.fill_between(at, means.min(0), means.max(0), color=color, alpha=0.15, lw=0)
            ax.plot(at, means.mean(0), color=color, marker=".", lw=1.4)
        truth = runs[0].truth
        for transit in range(len(truth.transits)):
            if truth.has_person(transit):
                ax.axvspan(transit + 0.6, transit + 1.4, color="0.93", zorder=0, lw=0)
        for mean_cm, text, style in PRINTED_MEANS:
            ax.axhline(mean_cm, color="0.5", lw=0.9, ls=style)
        ax.set(title=NAMES[kind], xlabel="after transit", yscale="log", xticks=at, ylim=(0.02, 20.0),
               yticks=(0.1, 1.0, 10.0), yticklabels=("0.1", "1", "10"))
        clean(ax)
    axes[0, 0].set_ylabel("mean distance from the truth, cm")
    save(figure, path, [*(pyplot.Line2D([], [], color=color, marker=".", label=VARIANT_NAMES[variant].strip(", ")
                                        or "reflectors") for variant, color in TRANSIT_COLORS.items()
                          if any(key[1] == variant for key in groups)),
                        *(pyplot.Line2D([], [], color="0.5", lw=0.9, ls=style, label=text)
                          for _, text, style in PRINTED_MEANS), patches.Patch(color="0.93", label="a person walks")],
         ncol=4)


def draw_policies(policies, path):
    figure, axes = pyplot.subplots(1, 2, figsize=(8.4, 2.6), layout="constrained", sharey=True)
    titles = {"boxes": "three boxes beside the way", "walkers": "a person steps into the way"}
    for ax, (what, title) in zip(axes, titles.items()):
        times = [policies[name][what]["mean_s"] for name in POLICIES]
        bars = ax.barh(list(POLICIES.values()), times, color=[STANDING, MAPPED, MOVING], height=0.6)
        ax.bar_label(bars, [f" {time_s:.1f} s" for time_s in times], fontsize=8)
        ax.set(title=title, xlabel="mean time of a transit of 12 m, s", xlim=(0.0, 1.18 * max(times)))
        clean(ax)
    axes[0].invert_yaxis()
    save(figure, path)


# --- report


INTRODUCTION = """
{scans:,} scans of {runs} runs in {minutes:.1f} minutes, with {config}. Simulated worlds
([polygon_worlds.py](../../scripts/evaluation/polygon_worlds.py)): a corridor of 15.6 m x 3.2 m and a hall of 16 m x 12
m, {seeds} of each for the map. A robot with a scanner of 270°, 0.5° and 25 Hz and a noise of 12 mm drives the same 12 m
in {transits} transits at 0.5 m/s. Between them, while it is docked and its scanner is off, boxes appear, move and go,
and a screen is put before two crates and taken away again; of these one has gone meanwhile. In four transits a person
walks ahead of the robot or towards it, and stands for 3 s. In worlds of even seeds one reflector vanishes and another
is moved, and nobody tells. {variants}
"""
VARIANT_TEXTS = {"sweep": "*Sweep*: each beam is cast at its own time.",
                 OBJECTS: "*With the map of objects*: what that follows is kept off the chains (`--objects`).",
                 TF: "*True pose*: from TF, for comparison.",
                 ODOMETRY: "*Odometry alone*: no reflectors, but each transit begins at a place that is known."}
MAP = """
After the last transit. Chains are sampled each {sample:.0f} cm, outlines in bins as long. *Precision*: the part of the
chains' length within 10 cm of what stands there. *Recall*: of the things of which 10 cm (or a quarter of the outline,
if this is less) were seen, those with a chain of their own and half of what was seen within 10 cm of the map.
*Coverage*: the part of the seen outlines within 10 cm of the map. Seen are bins that {seen} scans hit. What is nearer
to a reflector, or to the place of a thing that has gone and was not seen to be free, is neither right nor wrong.
*Distances* are of all of the matched chains, those with half their length within 10 cm of the truth, without a gate on
what exceeds it. *False chains*: what is farther than 10 cm from what stands there. *Chains per object*: chains on a
thing, with at least 10 cm or a quarter of what was seen, over the parts of its outline that were seen and are 10 cm
apart. *Same id*: of the things on the map after a transit that still stand, those on which the chain that had most of
them has at least half as much after the next. *Fewest*: the vertices that Douglas and Peucker leave of the seen truth
at {tolerance:.0f} cm. *Vertex error over sigma*: root mean square of each vertex's distance from the truth over its
`sigma_m`.
"""
CHANGE = """
*Added*: from when 10 cm (or a quarter of the outline) were seen until half of what was seen is on the map, in time in
which the thing was in sight. *Removed*: of nine in ten of its bins, from when {seen} scans have passed through all of
its outline within 10 cm until the map has nothing within 5 cm, in time in which beams passed; bins within 12 cm of what
stands there are left out. What had no time to be added or removed does not count. *Lost*: things of which the map had
more than 10 cm after one transit and not after the next, though no beam went through the place. *Left by persons*:
chains with more than 10 cm farther than 10 cm from anything that stands, within 0.3 m of where a person was at least 2
s ago and none has been since.
"""
POSE = """
Of base_link at the stamps of the scans, from {settle:g} s after the first. Two reflectors are in sight if at least two
beams hit each of two, at an intensity of at least {bright:.0f}.
"""


TABLE_1 = """
Distance of the matched chains from the truth, after each transit. The map is of all transits so far. *By odometry
alone*: without reflectors, and nothing but odometry from the dock on, whose place is known; the map is told a sigma of
2 cm and 10 mrad (`--localization tf`). Chains that its drift has put farther than 10 cm from all that stands are not
matched and not counted here, as in print; the table of the map has their length. The printed figures are distances
between two maps of the method, without a ground truth, of chains that a gate of about 10 cm let pass; of these Sim1 and
Sim2 are by odometry alone.
"""
CHANGED = """
Runs of other seeds, corridors and halls in turn, of {transits} transits each, with a person in each: boxes appear,
move, go and come back, a screen hides two crates and is taken away, and one of them has gone meanwhile. *Appeared*,
*gone*: things, each after the first transit in which 10 cm of it (or a quarter), or of its place, were seen by {seen}
scans. *Precision*: of what the map shows as changed, these over these and false chains (longer than 10 cm, farther than
10 cm from what stands) and lost things. *Known after*: from when the thing was within {view:g} m and 10 cm of it (or a
quarter) had been hit, in time in which it was in sight.
"""
ASSOCIATED = """
What the paper prints in sections 3.2 and 3.3, and repairs of it, on {scans} scans of the second transit against the
true outlines seen in the first: polylines broken by the criterion of Borges and Aldon and simplified at {tolerance:.0f}
cm; those with hits of several things are left out. The map of this package has no such association, for what the tables
show: it finds the element at the place of each hit, and chains anew. Restricted by indices of segments, the printed
distance takes ends that overhang for errors; both chains cut at the projections of each other's ends, it is what the
noise leaves. A least overlap of {overlap:.0f} cm keeps apart what touches end to end. *As printed*: all pairs of the
path of least dissimilarity of shapes, then the gate of {gate:.0f} cm: a path that must take every chain takes wrong
ones, and the gate cannot find the right ones again. An order around the viewpoint, even with gaps, loses the pairs of a
wall that goes on behind a box.
"""
POLICY = """
`safety_transits`: a vehicle of the Pioneer's size follows 12 m through a corridor with a scanner of 270°, its latency
and its braking simulated ([path](../math/path.md)). Three boxes stand beside the way, within the warning area; or
someone steps into the way, from a side or from behind a box. *Nearest*: of the moving vehicle to the person.
"""
COST = """
`benchmark/polygon_map_benchmark`, `benchmark/reflector_localization_benchmark`: a corridor with 40 chains in view of
541 beams, and as many more on the map as said; a robot among reflectors, with odometry at 50 Hz.
"""
FIGURE_5 = """
The errors of one transit, in one and two of the sigmas that the pose has; the paper's Fig. 5 has the filter's
corrections in their place, without a truth. Along the bottom: when fewer than three reflectors are in sight. Whether
errors are what the covariance says, over 50 seeds with three in sight, is also tested
(`build/test/pose_tests --gtest_filter=ReflectorPoseStatistics.*`).
"""
PARTS = ("map", "changes", "associations", "policies", "cost")


def report_of(arguments, measured, runs, found, images, spent_s):
    groups = groups_of(runs)
    short = {key: group for key, group in groups.items() if key[1] == CHANGES}
    long = {key: group for key, group in groups.items() if key[1] != CHANGES}
    shipped = arguments.config == ROOT / "cfg/polygons.yaml"
    parts = ["# The map of standing things as chains\n", introduction(measured, INTRODUCTION.format(
        scans=sum(run.scans for run in runs), runs=len(runs), minutes=spent_s / 60.0, seeds=arguments.seeds,
        transits=polygon_worlds.TRANSITS,
        variants=" ".join(text for variant, text in VARIANT_TEXTS.items() if variant in arguments.variants),
        config="the shipped `cfg/polygons.yaml`" if shipped else "other parameters"))]
    if not arguments.whole:
        texts = {"map": f"the map, {arguments.seeds} of each of {', '.join(arguments.worlds)} "
                        f"({', '.join(arguments.variants)}; {SEEDS} are published)",
                 "changes": f"{arguments.changes} short runs of changes ({CHANGE_RUNS})",
                 "associations": "associations",
                 "policies": f"policies with {arguments.walkers:,} persons each ({WALKER_RUNS:,})", "cost": "cost"}
        parts.append(prose(f"**A part only**: {'; '.join(texts[part] for part in PARTS if part in arguments.only)}."))
    parts.append(targets_section(list(targets(groups, found))))
    if long:
        parts.append(section("The map", prose(MAP.format(sample=100.0 * SAMPLE_M, seen=polygon_worlds.SEEN_SCANS,
                                                         tolerance=100.0 * VERTEX_TOLERANCE_M)), map_table(long),
                             *(picture(images, f"polygons_{kind}.png", f"The {kind} after the last transit")
                               for kind in dict.fromkeys(key[0] for key in long))))
        parts.append(section("Table 1 of the paper", prose(TABLE_1), paper_table(long),
                             picture(images, "polygons_transits.png", "Mean distance from the truth, by transit")))
        parts.append(section("What changes in eight transits", prose(CHANGE.format(seen=polygon_worlds.SEEN_SCANS)),
                             change_table({key: group for key, group in long.items() if key[1] != ODOMETRY})))
    if short:
        parts.append(section(f"What changes, in {sum(len(group.runs) for group in short.values())} runs",
                             prose(CHANGED.format(transits=len(polygon_worlds.SHORT), seen=polygon_worlds.SEEN_SCANS,
                                                  view=VIEW_M)), changes_table(short),
                             changes_missed([run for group in short.values() for run in group.runs])))
    if localised := {key: group for key, group in groups.items() if key[1] != TF}:
        parts.append(section("The pose, and Fig. 5 of the paper",
                             prose(POSE.format(settle=SETTLE_S, bright=polygon_worlds.IN_SIGHT_INTENSITY)),
                             pose_table(localised), prose(FIGURE_5),
                             picture(images, "polygons_pose.png", "Errors of the pose over a transit")))
    if together := associations_of(found):
        parts.append(section("The paper's metric and association", prose(ASSOCIATED.format(
            scans=together.scans, tolerance=100.0 * polygon_associations.TOLERANCE_M,
            overlap=100.0 * polygon_associations.OVERLAP_M, gate=100.0 * polygon_associations.GATE_M)),
                             metric_table(together), association_table(together)))
    if policies := found.get("policies"):
        parts.append(section("Transit time under the policies", prose(POLICY), policy_table(policies),
                             picture(images, "polygons_policies.png", "Transit times under the three policies")))
    if cost := found.get("cost"):
        parts.append(section("Cost", prose(COST), cost_table(cost)))
    if long:
        parts.append(section("Runs", run_table([run for run in runs if run.variant != CHANGES])))
    return "\n".join(parts)


def draw_all(runs, found, images):
    groups = groups_of(runs)
    draw(runs, images)
    if any(key[1] != CHANGES for key in groups):
        draw_transits(groups, images / "polygons_transits.png")
    localised = [run for run in runs if run.variant not in (TF, ODOMETRY)]
    if localised:
        draw_poses(localised[0], images / "polygons_pose.png")
    if policies := found.get("policies"):
        draw_policies(policies, images / "polygons_policies.png")


SEEDS, CHANGE_RUNS, BOX_RUNS, WALKER_RUNS = 5, 50, 20, 1000
QUICK_TRANSITS = (0, 3)


def main(words=None):
    parser = arguments_parser(__doc__, "docs/benchmarks", "a part of the runs or other parameters")
    parser.add_argument("--tool", required=True, type=pathlib.Path, help="polygons_bag")
    parser.add_argument("--programs", type=pathlib.Path, help="the build's folder with the other programs")
    parser.add_argument("--config", type=pathlib.Path, default=ROOT / "cfg/polygons.yaml", help="cfg/polygons.yaml")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=" ".join(PARTS))
    parser.add_argument("--worlds", nargs="+", choices=polygon_worlds.WORLDS, default=list(polygon_worlds.WORLDS))
    parser.add_argument("--seeds", type=int, metavar="N", help=f"of the map, 1 to N, {SEEDS}")
    parser.add_argument("--variants", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--changes", type=int, metavar="N", help=f"short runs, {CHANGE_RUNS}")
    parser.add_argument("--walkers", type=int, metavar="N",
                        help=f"persons in the way, per policy, {WALKER_RUNS}; from behind a box a fifth")
    parser.add_argument("--quick", action="store_true",
                        help="one seed, two transits, two short runs, and few of everything else")
    parser.add_argument("--bags", type=pathlib.Path, help="a folder of polygon_worlds.py; what is missing is added")
    parser.add_argument("--keep", type=pathlib.Path, metavar="DIR", help="keep the tool's output there")
    arguments = parser.parse_args(words)
    arguments.seeds = arguments.seeds or (1 if arguments.quick else SEEDS)
    arguments.changes = arguments.changes or (2 if arguments.quick else CHANGE_RUNS)
    arguments.picked = QUICK_TRANSITS if arguments.quick else None
    arguments.walkers = arguments.walkers or (5 if arguments.quick else WALKER_RUNS)
    arguments.policy_runs = {"boxes": 1 if arguments.quick else BOX_RUNS, "walkers": arguments.walkers,
                             "hidden": max(1, arguments.walkers // 5)}
    sizes = "(40|3)(/|$)" if arguments.quick else ""
    arguments.benchmark_options = (f"--benchmark_filter=(from_scan|filter).*/{sizes}",)
    if not arguments.programs and {"policies", "cost"} & set(arguments.only):
        parser.error("--programs is missing")
    arguments.whole = (not arguments.quick and set(arguments.only) == set(PARTS)
                       and set(arguments.worlds) == set(polygon_worlds.WORLDS) and arguments.seeds >= SEEDS
                       and arguments.changes >= CHANGE_RUNS and arguments.walkers >= WALKER_RUNS
                       and set(arguments.variants) == set(VARIANTS)
                       and arguments.config == ROOT / "cfg/polygons.yaml")
    output = output_folder(arguments, arguments.whole)
    measured = facts(arguments, {"--config": "FILE", "--bags": "DIR", "--keep": "DIR"})
    images = images_folder(output)

    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        directory = arguments.keep or pathlib.Path(folder)
        directory.mkdir(parents=True, exist_ok=True)
        runs, found = run_all(arguments, directory)
    spent_s = time.monotonic() - begin
    if runs:
        draw_all(runs, found, images)
    write(output, "polygons.md", report_of(arguments, measured, runs, found, images, spent_s))


if __name__ == "__main__":
    main()
