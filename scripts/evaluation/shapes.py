# SPDX-License-Identifier: BSD-3-Clause
"""The map of things that are no ellipses, and of persons by their legs, through each scanner of models/scanners
(docs/benchmarks/shapes.md): flies the worlds of shape_worlds.py and compares the map with the truth of each thing. Run
by scripts/evaluate.

An element of the map with an `outline`, [[x, y], ...], covers this polygon, another its ellipse. With a `shape` other
than `ellipse` its size is that of the rectangle about its outline, else that of the box with its ellipse's moments."""

import collections
import itertools
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np
from matplotlib import patches

import shape_worlds
import worlds
from map import (MAPPED, MOVING, MOVING_TRUTH, STANDING, TRUTH, draw_arrow, draw_robot, files_of, is_moving, picture,
                 read_trace)
from pictures import images_folder, pyplot, save
from recordings import assign, distance, mean, rms
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

VISIBLE_HITS = 8  # as in recordings.py
PART_HITS = 3  # a leg can be this little
PERSON_HITS = 6
COVERED_M = 0.1
COVER_PERIOD_S = 0.1  # at most so often are outlines compared
ON_PERSON_M = 0.5
SIDE_M = 0.002  # a hit so near to a side is on it
SIDE_PART = 0.8  # of a side that is seen
ELLIPSE_SIDES = 36

CALIBRATED = "rplidar_a2_calibrated"  # without the errors that a driver can correct
CALIBRATION = {"range_bias_slope": 0.0, "range_bias_square_1_m": 0.0, "sweep_against_order": 0,
               "time_increment_scale": 1.0, "stamp_error_s": 0.0}

# Targets: (experiments, attribute of their score, what, unit, target, decimals, more is better).
TARGETS = (
    ("boxes", "recall", "boxes: recall at least {}", "", 0.98, 3, True),
    ("boxes", "standing_rmse_m", "boxes that stand: centre RMSE at most {}", " m", 0.03, 3, False),
    ("boxes", "moving_rmse_m", "boxes that move: centre RMSE at most {}", " m", 0.05, 3, False),
    ("boxes", "size_rmse_m", "boxes: length and width within {} (RMSE) once two sides were seen", " m", 0.03, 3, False),
    ("boxes", "false_per_scan", "boxes: at most {} false elements per scan", "", 0.02, 3, False),
    ("furniture", "l_shape", "L-shapes: at least {} of the seen outline within 0.1 m of something on the map", "", 0.95,
     3, True),
    ("furniture", "table", "tables: the same", "", 0.95, 3, True),
    ("furniture", "chair", "chairs: the same", "", 0.95, 3, True),
    ("legs", "one_track", "persons at leg height: one element in at least {} of the frames", "", 0.97, 3, True),
    ("legs", "switches_per_minute", "persons at leg height: at most {} changes of identity per person and minute", "",
     0.5, 2, False),
)
GROUP_OF = {"boxes": "boxes", "furniture": "furniture", "seats": "furniture", "parking": "furniture",
            "clutter": "furniture", "legs": "legs", "torsos": "torsos"}
KINDS = {"l_shape": "L-shapes", "table": "tables", "chair": "chairs", "pallet": "pallets", "car": "cars",
         "clutter": "along walls"}
DRAWN = {"boxes": ("boxes_1",), "furniture": ("furniture_1", "seats_1", "parking_1", "clutter_1"),
         "people": ("legs_1",)}
DRAWN_SCANNERS = ("utm_30lx", "rplidar_a2")


# --- geometry


def outline_of(element):
    """The polygon that an element covers."""
    if element.get("outline"):
        return np.array(element["outline"], float)
    angle = 2.0 * math.pi / ELLIPSE_SIDES * np.arange(ELLIPSE_SIDES)
    c, s = math.cos(element["psi"]), math.sin(element["psi"])
    points = np.column_stack((element["rx"] * np.cos(angle), element["ry"] * np.sin(angle)))
    return points @ np.array(((c, s), (-s, c))) + (element["x"], element["y"])


def size_of(element):
    """Length and width, the larger first."""
    if element.get("outline") and element.get("shape", "ellipse") != "ellipse":
        corners = np.array(element["outline"], float)
        sizes = []
        for edge in np.roll(corners, -1, axis=0) - corners:  # one side of the smallest rectangle is along an edge
            if length := math.hypot(*edge):
                x, y = edge / length
                sizes.append(np.ptp(corners @ np.array(((x, -y), (y, x))), axis=0))
        return tuple(sorted(min(sizes, key=np.prod), reverse=True))
    return tuple(math.sqrt(3.0) * r for r in sorted((element["rx"], element["ry"]), reverse=True))  # r = 2 a / sqrt 3


def distances_to(outline, points):
    """Of each point to the polygon, 0 inside of it."""
    start, end = outline, np.roll(outline, -1, axis=0)
    edge = end - start
    offset = points[:, None, :] - start
    along = np.clip((offset * edge).sum(2) / np.maximum((edge**2).sum(1), 1e-12), 0.0, 1.0)
    distances = np.sqrt(((offset - along[..., None] * edge)**2).sum(2)).min(1)
    above = offset[..., 1] >= 0.0  # the corner is below the point
    crosses = above != np.roll(above, -1, axis=1)
    left = (edge[:, 0] * offset[..., 1] - edge[:, 1] * offset[..., 0]) * np.sign(edge[:, 1]) < 0.0
    inside = (crosses & left).sum(1) % 2 == 1
    return np.where(inside, 0.0, distances)


def in_axes(thing, points):
    c, s = math.cos(thing["yaw"]), math.sin(thing["yaw"])
    return (np.array(points, float).reshape(-1, 2) - (thing["x"], thing["y"])) @ np.array(((c, -s), (s, c)))


def hits_of(thing):
    return [hit for part in thing["parts"] for hit in part["hits"]]


def sides_seen(thing):
    """Of a box: whether these hits show its length, whether its width."""
    half = np.array((thing["length"], thing["width"])) / 2
    hits = in_axes(thing, hits_of(thing))
    seen = [False, False]
    for axis in (0, 1):  # of the side's normal; the side shows the size along the other axis
        for sign in (1.0, -1.0):
            on_side = hits[np.abs(sign * hits[:, axis] - half[axis]) < SIDE_M, 1 - axis]
            if len(on_side) >= PART_HITS and np.ptp(on_side) >= SIDE_PART * 2.0 * half[1 - axis]:
                seen[1 - axis] = True
    return seen


def as_box(thing):
    """As recordings.py has boxes."""
    return {**thing, "a": thing["length"] / 2, "b": thing["width"] / 2, "hits": len(hits_of(thing))}


# --- scores, each of several flights


def part(share, whole):
    return share / whole if whole else math.nan


class BoxScore:
    """Boxes, and elements that are none. An element on a box that is hardly visible is neither right nor false."""

    def __init__(self):
        self.scans = self.visible = self.false = self.switches = 0
        self.errors_m = {False: [], True: []}  # by whether it moves
        self.seen_errors_m = {False: [], True: []}  # of them, once two sides were seen
        self.size_errors_m = []

    def add(self, frames):
        last_id, seen = {}, collections.defaultdict(lambda: [False, False])
        moving = set()
        for frame in frames:
            self.scans += 1
            things = [as_box(thing) for thing in frame["things"]]
            pairs = assign(things, frame["map"])
            self.false += len(frame["map"]) - len(pairs)
            for i, thing in enumerate(things):
                name = thing["name"]
                seen[name] = [a or b for a, b in zip(seen[name], sides_seen(thing))]
                if is_moving(thing):
                    moving.add(name)
                if thing["hits"] < VISIBLE_HITS:
                    continue
                self.visible += 1
                if i not in pairs:
                    continue
                element = frame["map"][pairs[i]]
                self.switches += last_id.get(name, element["id"]) != element["id"]
                last_id[name] = element["id"]
                self.errors_m[name in moving].append(distance(element, thing))
                if all(seen[name]):
                    self.seen_errors_m[name in moving].append(distance(element, thing))
                    true = sorted((thing["length"], thing["width"]), reverse=True)
                    self.size_errors_m += [a - b for a, b in zip(size_of(element), true)]

    @property
    def recall(self):
        return part(len(self.errors_m[False]) + len(self.errors_m[True]), self.visible)

    @property
    def standing_rmse_m(self):
        return rms(self.errors_m[False])

    @property
    def moving_rmse_m(self):
        return rms(self.errors_m[True])

    @property
    def size_rmse_m(self):
        return rms(self.size_errors_m)

    @property
    def size_bias_m(self):
        return mean(self.size_errors_m)

    @property
    def false_per_scan(self):
        return part(self.false, self.scans)


class CoverScore:
    """How much of the hits on things is near to something on the map, by kind. `score.table` is the part of tables."""

    def __init__(self):
        self.hits, self.covered = collections.Counter(), collections.Counter()

    def add(self, frames):
        before_s = -math.inf
        for frame in frames:
            if frame["t"] - before_s < COVER_PERIOD_S - 1e-6:
                continue
            before_s = frame["t"]
            outlines = [outline_of(element) for element in frame["map"]]
            for thing in frame["things"]:
                seen = [hit for own in thing["parts"] if len(own["hits"]) >= PART_HITS for hit in own["hits"]]
                if not seen:
                    continue
                self.hits[thing["kind"]] += len(seen)
                if outlines:
                    nearest = np.min([distances_to(outline, np.array(seen)) for outline in outlines], axis=0)
                    self.covered[thing["kind"]] += int((nearest <= COVERED_M).sum())

    def __getattr__(self, kind):
        if kind not in KINDS:
            raise AttributeError(kind)
        return part(self.covered[kind], self.hits[kind])


class PersonScore:
    """Persons. An element is that of the nearest person, if this is near enough to it."""

    def __init__(self):
        self.scans = self.false = self.switches = 0
        self.with_tracks = collections.Counter()  # number of elements: frames of a visible person
        self.seconds = 0.0  # of visible persons
        self.errors_m = []

    def add(self, frames):
        last_id, before_s = {}, None
        for frame in frames:
            self.scans += 1
            period_s = 0.0 if before_s is None else frame["t"] - before_s
            before_s = frame["t"]
            persons = [thing for thing in frame["things"] if thing["kind"] == "person"]
            own = [[] for _ in persons]
            for element in frame["map"]:
                nearest = min(range(len(persons)), key=lambda i: distance(persons[i], element), default=None)
                if nearest is None or distance(persons[nearest], element) > ON_PERSON_M:
                    self.false += 1
                else:
                    own[nearest].append(element)
            for person, elements in zip(persons, own):
                if len(hits_of(person)) < PERSON_HITS:
                    continue
                self.seconds += period_s
                self.with_tracks[len(elements)] += 1
                if not elements:
                    continue
                name = person["name"]
                element = min(elements, key=lambda e: (e["id"] != last_id.get(name), distance(person, e)))
                self.switches += last_id.get(name, element["id"]) != element["id"]
                last_id[name] = element["id"]
                self.errors_m.append(distance(person, element))

    def part_with(self, least, most=math.inf):
        return part(sum(count for tracks, count in self.with_tracks.items() if least <= tracks <= most),
                    sum(self.with_tracks.values()))

    @property
    def one_track(self):
        return self.part_with(1, 1)

    @property
    def switches_per_minute(self):
        return part(60.0 * self.switches, self.seconds)

    @property
    def center_rmse_m(self):
        return rms(self.errors_m)

    @property
    def false_per_scan(self):
        return part(self.false, self.scans)


SCORES = {"boxes": BoxScore, "furniture": CoverScore, "legs": PersonScore, "torsos": PersonScore}


# --- flying


def calibrated(text, changes):
    """The text of a preset with other values of some of its keys, each of which it has."""
    for key, value in changes.items():
        text, count = re.subn(rf"(?m)^{key}: \S+", f"{key}: {value}", text)
        if count != 1:
            raise ValueError(f"the preset has no {key}")
    return text


def scanners_of(directory):
    """{name: preset for map_flights}"""
    folder = ROOT / "models/scanners"
    found = {path.stem: path.stem for path in sorted(folder.glob("*.yaml"))}
    preset = directory / f"{CALIBRATED}.yaml"
    preset.write_text(calibrated((folder / "rplidar_a2.yaml").read_text(), CALIBRATION))
    return {**found, CALIBRATED: preset}


def is_drawn(flight, scanner):
    return scanner in DRAWN_SCANNERS and any(flight.name in names for names in DRAWN.values())


def fly(arguments, directory, flight, scanner, preset):
    """The lines of its trace."""
    world, _ = files_of(directory, flight)
    trace = directory / f"{flight.name}_{scanner}.jsonl"
    command = [arguments.tool, "--world", world, "--config", arguments.config, "--models", ROOT / "models", "--scanner",
               preset, "--seeds", str(flight.seeds[0]), "--duration", f"{flight.duration_s:g}", "--trace", trace]
    if is_drawn(flight, scanner):
        command.append("--trace-points")
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    with open(trace) as lines:
        frames = [json.loads(line) for line in lines]
    if not is_drawn(flight, scanner):
        trace.unlink()
    return frames


def score_all(arguments, directory):
    """{(scanner, group): score}, and the number of scans."""
    scanners = scanners_of(directory)
    if unknown := set(arguments.scanner) - set(scanners):
        sys.exit(f"no scanner {sorted(unknown)}; there are {' '.join(scanners)}")
    scanners = {name: preset for name, preset in scanners.items() if not arguments.scanner or name in arguments.scanner}
    flights = [flight for flight in worlds.flights(arguments.only, shape_worlds.EXPERIMENTS)
               if not arguments.quick or flight.seeds[0] == 1]
    scores = {(scanner, GROUP_OF[flight.experiment]): SCORES[GROUP_OF[flight.experiment]]()
              for scanner in scanners for flight in flights}
    one_at_a_time = threading.Lock()

    def run(flight, scanner):
        frames = fly(arguments, directory, flight, scanner, scanners[scanner])
        with one_at_a_time:
            scores[scanner, GROUP_OF[flight.experiment]].add(frames)
        return len(frames)

    for flight in flights:
        files_of(directory, flight)[0].write_text(flight.xml)
    pieces = {(flight.name, scanner): (flight, scanner) for flight in flights for scanner in scanners}
    return scores, sum(run_pieces(run, pieces, "flights").values())


def of_group(scores, group):
    return {scanner: score for (scanner, of), score in scores.items() if of == group}


# --- verdicts


def number(value, decimals=3):
    return "none" if math.isnan(value) else f"{value:.{decimals}f}"


def targets(scores):
    """(sentence, figure, met), of {(scanner, group): score}; those of a calibrated scanner are for comparison."""
    for group, key, what, unit, target, decimals, more in TARGETS:
        values = {scanner: getattr(score, key) for scanner, score in of_group(scores, group).items()}
        if not values:
            continue
        figure = ", ".join(f"{number(value, decimals)} {scanner}" for scanner, value in values.items())
        met = all(value >= target if more else value <= target for scanner, value in values.items()
                  if scanner != CALIBRATED)
        yield what.format(f"{target:g}{unit}"), figure, met


# --- tables


def percent(value):
    return number(100.0 * value, 1)


def box_table(scores):
    rows = [(scanner, f"{score.visible:,}", number(score.recall),
             f"{number(score.standing_rmse_m)} / {number(score.moving_rmse_m)}",
             f"{number(rms(score.seen_errors_m[False]))} / {number(rms(score.seen_errors_m[True]))}",
             f"{number(score.size_rmse_m)} / {number(score.size_bias_m)}", number(score.false_per_scan),
             str(score.switches)) for scanner, score in scores.items()]
    return table(("scanner", "visible", "recall", "centre RMSE standing / moving, m",
                  "once two sides were seen, m", "length and width, RMSE / mean error, m", "false per scan",
                  "id switches"), rows)


def cover_table(scores):
    kinds = [kind for kind in KINDS if any(score.hits[kind] for score in scores.values())]
    rows = [(scanner, *(percent(getattr(score, kind)) for kind in kinds)) for scanner, score in scores.items()]
    return table(("scanner", *(f"{KINDS[kind]}, %" for kind in kinds)), rows)


def person_table(scores):
    rows = [(scanner, f"{sum(score.with_tracks.values()):,}", percent(score.one_track), percent(score.part_with(0, 0)),
             percent(score.part_with(2)), number(score.switches_per_minute, 2), number(score.center_rmse_m),
             number(score.false_per_scan)) for scanner, score in scores.items()]
    return table(("scanner", "frames of a person", "one element, %", "none, %", "several, %",
                  "changes of identity per person and minute", "centre RMSE, m", "elements on no person, per scan"),
                 rows)


# --- pictures


def draw_frame(ax, frame, walls=()):
    for x, y, half_x, half_y in walls:
        ax.add_patch(patches.Rectangle((x - half_x, y - half_y), 2 * half_x, 2 * half_y, color="0.82", lw=0))
    for thing in frame["things"]:
        fill, edge = (MOVING_TRUTH, MOVING) if is_moving(thing) else (TRUTH, STANDING)
        for own in thing["parts"]:
            ax.add_patch(patches.Polygon(own["outline"], fc=fill, ec=edge, lw=0.8, zorder=2))
        if is_moving(thing):
            draw_arrow(ax, thing, 0.5, MOVING)
    ax.plot(*np.array(frame["points"]).reshape(-1, 2).T, ".", color="0.15", ms=2, zorder=4)
    for element in frame["map"]:
        ax.add_patch(patches.Polygon(outline_of(element), fill=False, ec=MAPPED, lw=1.8, zorder=5))
        ax.annotate(str(element["id"]), (element["x"], element["y"]), xytext=(7, 7), textcoords="offset points",
                    fontsize=8, color=MAPPED, zorder=6, clip_on=True)
    draw_robot(ax, frame["robot"], 0.25)
    ax.set(aspect="equal", xticks=[], yticks=[])
    for spine in ax.spines.values():
        spine.set_color("0.8")


LEGEND = [
    patches.Patch(fc=TRUTH, ec=STANDING, label="truth, standing"),
    patches.Patch(fc=MOVING_TRUTH, ec=MOVING, label="truth, moving; arrow: its way in 0.5 s"),
    patches.Patch(fill=False, ec=MAPPED, lw=1.8, label="map, with ids"),
    pyplot.Line2D([], [], marker=".", ls="", color="0.15", label="hits"),
]


def draw_scenes(directory, flights, names, path):
    """The middle of each flight, a row for each scanner if there are several flights."""
    rows, columns = (1, len(DRAWN_SCANNERS)) if len(names) == 1 else (len(DRAWN_SCANNERS), len(names))
    figure, axes = pyplot.subplots(rows, columns, layout="constrained", figsize=(14.0, rows * 11.5 / columns))
    for ax, (scanner, name) in zip(axes.flat, itertools.product(DRAWN_SCANNERS, names)):
        flight = flights[name]
        trace = read_trace(directory, f"{name}_{scanner}")
        frame = trace[len(trace) // 2]
        draw_frame(ax, frame, flight.walls)
        half_x, half_y = shape_worlds.ROOM_M if flight.walls else (9.0, 6.0)
        ax.set(xlim=(-half_x - 0.2, half_x + 0.2), ylim=(-half_y - 0.2, half_y + 0.2))
        ax.set_title(f"{name}, {scanner}, t = {frame['t']:.0f} s", fontsize=10)
    save(figure, path, LEGEND)


def draw_crossing(directory, name, path):
    """Two persons in six frames about the time when they are nearest to each other."""
    figure, axes = pyplot.subplots(len(DRAWN_SCANNERS), 6, figsize=(15, 5.6), layout="constrained")
    for row, scanner in zip(axes, DRAWN_SCANNERS):
        trace = read_trace(directory, f"{name}_{scanner}")
        pair = [{thing["name"]: thing for thing in frame["things"]} for frame in trace]
        apart = [distance(things["person_1"], things["person_2"]) for things in pair]
        begin = len(trace) // 4
        meet_s = trace[begin + int(np.argmin(apart[begin:]))]["t"]
        for ax, after_s in zip(row, (-0.9, -0.5, -0.15, 0.15, 0.5, 0.9)):
            frame = min(trace, key=lambda f: abs(f["t"] - meet_s - after_s))
            draw_frame(ax, frame)
            things = {thing["name"]: thing for thing in frame["things"]}
            x, y = (0.5 * (things["person_1"][axis] + things["person_2"][axis]) for axis in "xy")
            ax.set(xlim=(x - 1.2, x + 1.2), ylim=(y - 1.2, y + 1.2))
            ax.set_title(f"{scanner}, t = {frame['t']:.2f} s", fontsize=9)
    save(figure, path, LEGEND)


def draw(arguments, directory, images):
    flights = {flight.name: flight for flight in worlds.flights(arguments.only, shape_worlds.EXPERIMENTS)}
    for group, names in DRAWN.items():
        if not all((directory / f"{name}_{scanner}.jsonl").exists() for name in names for scanner in DRAWN_SCANNERS):
            continue
        if group == "people":
            draw_crossing(directory, *names, images / "shapes_people.png")
        else:
            draw_scenes(directory, flights, names, images / f"shapes_{group}.png")


# --- report


INTRODUCTION = """
{scans:,} scans in {minutes:.1f} minutes, with {config}. Simulated worlds of things that are no ellipses
([shape_worlds.py](../../scripts/evaluation/shape_worlds.py)), each flown with every preset of a scanner
([models/scanners](../../models/worlds/README.md#errors-of-real-scanners)), with its errors and for {duration:.0f} s,
those of persons for {persons:.0f} s; within 10 m, with an exact pose of a robot that drives at a constant 0.18 to 0.23
m/s, or stands before persons.
"""
ABOUT_CALIBRATED = """
The RPLidar A2 reads short, by 4 cm at 2 m and 8 cm at 3 m, and says wrong times, both as measured on recordings: no
map can place things better than that. *{name}* is the same scanner without these two, which a driver can correct. It
is for comparison and in no target.
"""
BOXES = """
Six boxes of 0.2 to 1.5 m that stand and three that drive at 0.3 to 1 m/s, in a walled room. A box is visible if at
least {hits} beams hit it. An element is on it if its centre is on the box or within 0.2 m of it, and of these the
nearest to its centre is its own. False are all others, second ones on a box among them. Recall is from the first scan
on. Length and width are compared once two sides were seen, one of each direction: each in a scan with at least
{side_hits} hits on it, over {side:.0f} % of its length. Before that nothing tells how far a box extends behind its
face, and so where its centre is.
"""
COVER = """
What part of the hits on things, as they are without the scanner's errors, is within {covered:g} m of something on the
map or inside of it. Parts of things, such as legs, count in scans with at least {hits} hits on them. Tables, chairs
and pallets at 0.1 m of height, by their legs and blocks; the same at 0.46 m, where the scanner meets seats and loads;
parked and driving cars; boxes, posts and L-shapes along walls, many of which touch them. What is structure to the map
is on no map.
"""
PERSONS = """
Five persons: two that cross each other again and again, 0.8 m apart, one on a loop, one that comes and goes, one that
stands; 0.5 to 1.5 m/s. At leg height two legs, of which one stands while the other swings; at torso height a torso and
two arms that swing. A person counts in scans with at least {hits} hits. An element is that of the nearest person if it
is within {on:g} m of its centre. A change of identity is one of the id since the person was last visible and on the
map, after any time.
"""


def report_of(arguments, measured, scores, scans, images, spent_s):
    config = "the shipped `cfg/objects.yaml`" if arguments.config == ROOT / "cfg/objects.yaml" else "other parameters"
    parts = ["# The map of boxes, furniture and persons\n", introduction(measured, INTRODUCTION.format(
        scans=scans, minutes=spent_s / 60, config=config, duration=shape_worlds.DURATION_S,
        persons=shape_worlds.PERSONS_DURATION_S))]
    if not arguments.whole:
        parts.append(prose(f"**A part only**: {'one world of each kind, ' if arguments.quick else ''}"
                           f"{', '.join(arguments.only) or 'all kinds of worlds'}, "
                           f"{', '.join(arguments.scanner) or 'all scanners'}."))
    parts.append(targets_section(list(targets(scores))))
    if any(scanner == CALIBRATED for scanner, _ in scores):
        parts.append(prose(ABOUT_CALIBRATED.format(name=CALIBRATED)))
    boxes, things = of_group(scores, "boxes"), of_group(scores, "furniture")
    if boxes:
        parts.append(section("Boxes", prose(BOXES.format(hits=VISIBLE_HITS, side_hits=PART_HITS, side=100 * SIDE_PART)),
                             box_table(boxes), picture(images, "shapes_boxes.png", "Boxes, by two scanners")))
    if things:
        parts.append(section("L-shapes, furniture, pallets, cars and what stands along walls",
                             prose(COVER.format(covered=COVERED_M, hits=PART_HITS)), cover_table(things),
                             picture(images, "shapes_furniture.png", "Four worlds, by two scanners")))
    persons = {what: of_group(scores, group) for group, what in (("legs", "leg"), ("torsos", "torso"))}
    if any(persons.values()):
        parts.append(section("Persons", prose(PERSONS.format(hits=PERSON_HITS, on=ON_PERSON_M)),
                             *(f"At {what} height:\n\n{person_table(found)}" for what, found in persons.items()
                               if found),
                             picture(images, "shapes_people.png", "Two persons cross, by two scanners")))
    return "\n".join(parts)


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "a part of the runs or other parameters")
    parser.add_argument("--tool", required=True)
    parser.add_argument("--only", action="append", default=[], choices=list(shape_worlds.EXPERIMENTS),
                        metavar="EXPERIMENT", help=f"may be repeated: {' '.join(shape_worlds.EXPERIMENTS)}")
    parser.add_argument("--scanner", action="append", default=[], metavar="NAME", help="may be repeated: a preset")
    parser.add_argument("--quick", action="store_true", help="one world of each kind")
    parser.add_argument("--config", type=pathlib.Path, default=ROOT / "cfg/objects.yaml", help="cfg/objects.yaml")
    arguments = parser.parse_args()
    arguments.whole = (not (arguments.only or arguments.scanner or arguments.quick)
                       and arguments.config == ROOT / "cfg/objects.yaml")
    output, measured = output_folder(arguments, arguments.whole), facts(arguments, {"--config": "FILE"})
    images = images_folder(output)

    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        directory = pathlib.Path(folder)
        scores, scans = score_all(arguments, directory)
        spent_s = time.monotonic() - begin
        draw(arguments, directory, images)
    write(output, "shapes.md", report_of(arguments, measured, scores, scans, images, spent_s))


if __name__ == "__main__":
    main()
