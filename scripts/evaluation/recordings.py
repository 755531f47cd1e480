# SPDX-License-Identifier: BSD-3-Clause
"""The map of recordings of real things against their truth (docs/benchmarks/recordings.md): runs objects_bag on every
NAME.bag with a NAME.gt.json in a folder. Run by scripts/evaluate.

NAME.gt.json is {"frames": [{"t": s, "ego": [x, y, yaw], "objs": [{"id", "x", "y", "yaw", "vx", "vy", "a", "b",
"hits"}]}]}, in m, rad and s, in the frame map: the stamp of a scan, the scanner's pose, and boxes of half sizes a and
b, each hit by so many beams of that scan. What has no box is unknown, not absent."""

import collections
import dataclasses
import json
import math
import pathlib
import statistics
import subprocess
import sys
import tempfile

import numpy as np
from matplotlib import patches
from scipy import optimize, stats

from map import MAPPED, MOVING, MOVING_TRUTH, draw_arrow, draw_robot, ellipse_patch, picture
from pictures import clean, images_folder, pyplot, save
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, section, table, targets_section,
                    write)
from soak import TOPICS

DATA = ROOT.parent / "shared/data"
SCAN_TOPIC, WORLD_FRAME = "/scan", "map"  # of recordings with truth
WITHOUT_TRUTH = {  # (bag, topic): options
    **{(name, topic): ("--static-sensor",) for name, topics in TOPICS.items() for topic in topics},
    ("freiburg_079.bag", "/scan"): ("--world-frame", "map"),
}

SAME_STAMP_S = 1e-4
VISIBLE_HITS = 8
MARGIN_M = 0.2  # a centre farther from the box is not on the object
GATE_M = 0.5  # as MapEvaluationParams::max_match_distance_m, for comparison
MOVING_M_S = 0.3
REGION = 0.9
ERRORS_M = (0.1, 0.2)  # bounds of the classes of position errors

# Targets: (attribute of Score, what, unit, target, decimals); a recall is to be above, all others below.
TARGETS = (
    ("recall", "recall at least {}", "", 0.99, 3), ("switches", "at most {} change of identity", "", 1, 0),
    ("position_rmse_m", "position RMSE at most {}", " m", 0.10, 3),
    ("velocity_rmse_m_s", "velocity RMSE at most {}", " m/s", 0.20, 3),
    ("false_movers", f"at most {{}} elements per scan that are faster than {MOVING_M_S:g} m/s and not the object",
     "", 0.2, 3),
)
MAX_ON_NO_MAP_S = 0.5
SCENES = 6  # of a picture
SCENE_M = 0.6
ID_COLORS = (MAPPED, "#8a5a83", "#b07d12", "#5fb49c")
MISSED, FALSE, OTHER, PATH = "#c8553d", "#c8553d", "0.55", "0.35"
SHOWN_ERROR_M = 0.5


# --- recordings


@dataclasses.dataclass(frozen=True)
class Recording:
    name: str
    bag: pathlib.Path
    frames: list  # of the truth


def recordings_with_truth(folder):
    for path in sorted(folder.glob("*.gt.json")):
        name = path.name.removesuffix(".gt.json")
        bag = path.with_name(f"{name}.bag")
        if bag.is_file():
            yield Recording(name, bag, json.loads(path.read_text())["frames"])


def run(arguments, bag, topic, *options, detections=False):
    """The account of the hits, the lines of the map after each scan, and of the detections if asked for."""
    with tempfile.TemporaryDirectory() as folder:
        points = pathlib.Path(folder) / "points.jsonl"
        out = {"--out": pathlib.Path(folder) / "map.jsonl"}
        if detections:
            out["--detections"] = pathlib.Path(folder) / "detections.jsonl"
        command = [arguments.tool, bag, "--scan-topic", topic, *options, "--config", arguments.config, "--model-folder",
                   ROOT / "models", "--points", points]
        for option, path in out.items():
            command += [option, path]
        result = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
        if result.returncode:
            sys.exit(f"objects_bag ended with code {result.returncode} on {bag}:\n{result.stderr}")
        with points.open(encoding="utf-8") as lines:
            account = Account(map(json.loads, lines))
        return account, *([json.loads(text) for text in path.read_text().splitlines()] for path in out.values())


def hits_of(recording):
    """The hits of each frame in the world, every beam from where the scanner was at its time; none without rosbag."""
    try:
        import rosbag
    except ImportError:
        return None
    t = np.array([frame["t"] for frame in recording.frames])
    x, y, yaw = np.array([frame["ego"] for frame in recording.frames]).T
    yaw = np.unwrap(yaw)
    hits = {}
    with rosbag.Bag(str(recording.bag)) as bag:
        for _, scan, _ in bag.read_messages(topics=[SCAN_TOPIC]):
            k = int(np.argmin(np.abs(t - scan.header.stamp.to_sec())))
            if abs(t[k] - scan.header.stamp.to_sec()) > SAME_STAMP_S:
                continue
            ranges, i = np.array(scan.ranges), np.arange(len(scan.ranges))
            at = t[k] + i * scan.time_increment
            angle = scan.angle_min + i * scan.angle_increment + np.interp(at, t, yaw)
            points = np.stack((np.interp(at, t, x) + ranges * np.cos(angle),
                               np.interp(at, t, y) + ranges * np.sin(angle)), axis=1)
            hits[k] = points[(ranges >= scan.range_min) & (ranges <= scan.range_max)]
    return [hits.get(k, np.zeros((0, 2))) for k in range(len(t))]


# --- numbers


def at_stamps(frames, lines, what):
    """Of each frame what the line with its stamp has, or nothing."""
    stamps = np.array([line["stamp"] for line in lines])
    for frame in frames:
        k = int(np.argmin(np.abs(stamps - frame["t"]))) if len(stamps) else None
        yield lines[k][what] if k is not None and abs(stamps[k] - frame["t"]) <= SAME_STAMP_S else []


def distance(a, b):
    return math.hypot(a["x"] - b["x"], a["y"] - b["y"])


def speed(thing):
    return math.hypot(thing["vx"], thing["vy"])


def distance_to_box(thing, point):
    dx, dy = point["x"] - thing["x"], point["y"] - thing["y"]
    c, s = math.cos(thing["yaw"]), math.sin(thing["yaw"])
    return math.hypot(max(abs(c * dx + s * dy) - thing["a"], 0.0), max(abs(c * dy - s * dx) - thing["b"], 0.0))


def is_on(thing, element):
    return distance_to_box(thing, element) <= MARGIN_M


def is_near(thing, element):
    return distance(thing, element) <= GATE_M


def assign(things, elements, may_be=is_on):
    """{index of a thing: index of its element}: as many pairs as possible, at the least total distance of centres."""
    if not things or not elements:
        return {}
    distances = np.array([[distance(thing, element) for element in elements] for thing in things])
    allowed = np.array([[may_be(thing, element) for element in elements] for thing in things])
    a_pair = (1.0 + distances.max()) * min(distances.shape)  # worth more than all distances
    costs = np.where(allowed, distances - a_pair, 0.0)
    return {int(i): int(j) for i, j in zip(*optimize.linear_sum_assignment(costs)) if allowed[i, j]}


def moment_equal_semi_axes(thing):
    """Of the ellipse with the area moments of the box: a^2 / 3 = r^2 / 4."""
    return tuple(2.0 / math.sqrt(3.0) * size for size in sorted((thing["a"], thing["b"]), reverse=True))


def rms(values):
    return math.sqrt(np.mean(np.square(values))) if len(values) else math.nan


def mean(values):
    return float(np.mean(values)) if len(values) else math.nan


def classes(errors_m, total):
    """Parts of the total with an error below the first bound, between the two and above the second."""
    errors_m = np.asarray(errors_m)
    low, high = ERRORS_M
    counts = np.sum(errors_m < low), np.sum((errors_m >= low) & (errors_m <= high)), np.sum(errors_m > high)
    return tuple(float(count) / total if total else math.nan for count in counts)


def behind(thing, frame, estimate):
    """How much farther from the scanner the estimate is than the thing, along the line to the thing."""
    x, y = thing["x"] - frame["ego"][0], thing["y"] - frame["ego"][1]
    return ((estimate["x"] - thing["x"]) * x + (estimate["y"] - thing["y"]) * y) / math.hypot(x, y)


@dataclasses.dataclass
class Look:
    """At one thing in one scan."""
    k: int  # of the frame
    t: float
    thing: dict
    visible: bool
    element: dict  # or nothing


class Score:
    """The map against the truth. Errors, recall and identity are of the scans in which a thing is visible; an element
    on a thing that is hardly visible is neither right nor false."""

    def __init__(self, frames, lines, may_be=is_on):
        self.scans = len(frames)
        self.looks = collections.defaultdict(list)  # by the thing's id
        self.others = []  # elements of each frame that are no thing's own
        duplicates = 0
        behind_m = []
        for k, (frame, elements) in enumerate(zip(frames, at_stamps(frames, lines, "objects"))):
            things = frame["objs"]
            pairs = assign(things, elements, may_be)
            for i, thing in enumerate(things):
                look = Look(k, frame["t"], thing, thing["hits"] >= VISIBLE_HITS,
                            elements[pairs[i]] if i in pairs else None)
                self.looks[thing["id"]].append(look)
                if look.visible and look.element:
                    behind_m.append(behind(thing, frame, look.element))
            own = set(pairs.values())
            others = [element for j, element in enumerate(elements) if j not in own]
            duplicates += sum(any(is_on(thing, element) for thing in things) for element in others)
            self.others.append(others)

        visible = [look for looks in self.looks.values() for look in looks if look.visible]
        mapped = [look for look in visible if look.element]
        self.visible, self.mapped = len(visible), len(mapped)
        self.recall = len(mapped) / len(visible) if visible else math.nan
        errors_m = [distance(look.element, look.thing) for look in mapped]
        self.position_rmse_m, self.behind_m = rms(errors_m), mean(behind_m)
        self.classes = classes(errors_m, len(visible))
        self.velocity_rmse_m_s = rms([math.hypot(look.element["vx"] - look.thing["vx"],
                                                 look.element["vy"] - look.thing["vy"]) for look in mapped])
        self.semi_axis_mae_m = mean([abs(estimate - true) for look in mapped for estimate, true in zip(
            sorted((look.element["rx"], look.element["ry"]), reverse=True), moment_equal_semi_axes(look.thing))])
        self.ids, self.switches, self.fragments, self.longest_off_s = 0, 0, 0, 0.0
        for looks in self.looks.values():
            self.follow([look for look in looks if look.visible])
        self.duplicates = duplicates / self.scans
        self.false_movers, self.standing_others = (
            sum((speed(element) > MOVING_M_S) == moving for others in self.others for element in others) / self.scans
            for moving in (True, False))

    def follow(self, looks):
        """One thing's identity, and the gaps in its track, over the scans in which it is visible."""
        ids = [look.element["id"] for look in looks if look.element]
        self.ids += len(set(ids))
        self.switches += sum(before != after for before, after in zip(ids, ids[1:]))
        off_since, was_mapped = None, False
        for look in looks:
            if look.element:
                if off_since is not None:
                    self.longest_off_s = max(self.longest_off_s, look.t - off_since)
                off_since, was_mapped = None, True
            elif off_since is None:
                off_since = look.t
                self.fragments += was_mapped
        if off_since is not None:
            self.longest_off_s = max(self.longest_off_s, looks[-1].t - off_since)


class DetectionScore:
    """The detections, before the map, against the truth: the nearest one on each visible thing."""

    def __init__(self, frames, lines):
        total, errors_m, behind_m, held = 0, [], [], []
        bound = stats.chi2.ppf(REGION, 2)
        for frame, detections in zip(frames, at_stamps(frames, lines, "detections")):
            x, y, yaw = frame["ego"]
            turn = np.array(((math.cos(yaw), -math.sin(yaw)), (math.sin(yaw), math.cos(yaw))))
            placed = [dict(zip(("x", "y"), turn @ (found["x"], found["y"]) + (x, y))) for found in detections]
            visible = [thing for thing in frame["objs"] if thing["hits"] >= VISIBLE_HITS]
            total += len(visible)
            for i, j in assign(visible, placed).items():
                error = np.array([placed[j][axis] - visible[i][axis] for axis in ("x", "y")])
                errors_m.append(math.hypot(*error))
                behind_m.append(behind(visible[i], frame, placed[j]))
                P = turn @ np.array(detections[j]["covariance"]).reshape(5, 5)[:2, :2] @ turn.T
                held.append(error @ np.linalg.solve(P, error) <= bound)
        self.visible = total
        self.classes = classes(errors_m, total)
        self.position_rmse_m, self.behind_m, self.held = rms(errors_m), mean(behind_m), mean(held)


class Counts:
    """Of a map without truth."""

    def __init__(self, lines):
        self.scans = len(lines)
        spans = {}
        for line in lines:
            for element in line["objects"]:
                spans.setdefault(element["id"], [line["stamp"], line["stamp"]])[1] = line["stamp"]
        self.ids = len(spans)
        self.minutes = (lines[-1]["stamp"] - lines[0]["stamp"]) / 60.0 if lines else 0.0
        lives_s = [end - begin for begin, end in spans.values()]
        self.mean_life_s = mean(lives_s)
        self.median_life_s = statistics.median(lives_s) if lives_s else math.nan
        elements = [element for line in lines for element in line["objects"]]
        self.elements = len(elements) / max(self.scans, 1)
        self.movers = sum(speed(element) > MOVING_M_S for element in elements) / max(self.scans, 1)


class Account:
    """What became of the hits, and the compact segments that are on no map, of the lines of --points."""

    FATES = ("on a mapped object", "detected, on no object yet", "refused", "structure", "no segment")

    def __init__(self, lines):
        self.scans, self.compact, self.on_no_map, self.longest_s = 0, 0, 0, 0.0
        self.hits = collections.Counter()
        for line in lines:
            self.scans += 1
            self.compact += line["compact"]
            self.on_no_map += line["on_no_map"]
            self.longest_s = max(self.longest_s, line["on_no_map_s"])
            self.hits.update("on a mapped object" if id_ is not None else
                             "detected, on no object yet" if fate == "object" else fate
                             for fate, id_ in zip(line["fate"], line["id"]))

    def part(self, fate):
        return self.hits[fate] / self.hits.total() if self.hits else math.nan


# --- verdicts


def targets(scores):
    """(sentence, figure, met), of {name: score}"""
    for key, what, unit, target, decimals in TARGETS:
        values = {name: getattr(score, key) for name, score in scores.items()}
        figure = ", ".join(f"{value:.{decimals}f}{unit} {name}" for name, value in values.items())
        met = all(value >= target if key == "recall" else value <= target for value in values.values())
        yield what.format(f"{target:g}{unit}"), figure, met


def account_target(accounts):
    """The same for the longest time on no map, of {name: account}."""
    worst = max(accounts, key=lambda name: accounts[name].longest_s)
    longest_s = accounts[worst].longest_s
    return (f"no compact segment of at least {VISIBLE_HITS} hits on no map for more than {MAX_ON_NO_MAP_S:g} s",
            f"{longest_s:.2f} s {worst}", longest_s <= MAX_ON_NO_MAP_S)


# --- tables


def percent(part):
    return "" if math.isnan(part) else f"{100.0 * part:.0f}"


def map_table(scores, near, calibrated=""):
    """`calibrated`: said of the recordings beside their results."""
    rows = [(name, str(score.scans), str(score.visible), f"{score.recall:.3f}", f"{score.position_rmse_m:.3f}",
             f"{score.behind_m:+.3f}", f"{score.velocity_rmse_m_s:.3f}", f"{score.semi_axis_mae_m:.3f}",
             " / ".join(percent(part) for part in (*score.classes, 1.0 - score.recall)))
            for name, score in {**scores, **{f"{name}, by the centres alone": near[name] for name in near}}.items()]
    return table((f"recording{calibrated}", "scans", "visible", "recall", "position RMSE, m", "behind the truth, mean, m",
                  "velocity RMSE, m/s", "semi-axes MAE, m",
                  f"error under {ERRORS_M[0]:g} m / up to {ERRORS_M[1]:g} m / more / not on the map, %"), rows)


def tracks_table(scores):
    rows = [(name, str(score.ids), str(score.switches), str(score.fragments), f"{score.longest_off_s:.2f}",
             f"{score.duplicates:.3f}", f"{score.false_movers:.3f}", f"{score.standing_others:.3f}")
            for name, score in scores.items()]
    return table(("recording", "ids", "id switches", "fragments", "longest off the map, s", "duplicates per scan",
                  "false movers per scan", "others that stand, per scan"), rows)


def detections_table(scores):
    rows = [(name, *(percent(part) for part in (1.0 - sum(score.classes), *score.classes)),
             f"{score.position_rmse_m:.3f}", f"{score.behind_m:+.3f}", percent(score.held))
            for name, score in scores.items()]
    return table(("recording", "no detection, %", f"error under {ERRORS_M[0]:g} m, %", f"up to {ERRORS_M[1]:g} m, %",
                  "more, %", "position RMSE, m", "behind the truth, mean, m",
                  f"truth in its {100 * REGION:.0f} % region, % of the detections"), rows)


def accounts_table(accounts):
    rows = [(name, f"{account.compact / account.scans:.2f}", f"{account.on_no_map / account.scans:.2f}",
             f"{account.longest_s:.2f}", " / ".join(percent(account.part(fate)) for fate in Account.FATES))
            for name, account in accounts.items()]
    return table(("recording", "compact segments per scan", "of those on no map", "longest on no map, s",
                  f"hits {' / '.join(Account.FATES)}, %"), rows)


def counts_table(counts):
    rows = [(name, f"{count.scans:,}", f"{count.elements:.2f}", f"{count.movers:.2f}", str(count.ids),
             f"{count.ids / count.minutes:.1f}", f"{count.mean_life_s:.1f}", f"{count.median_life_s:.1f}")
            for name, count in counts.items()]
    return table(("recording", "scans", "elements per scan", f"of those faster than {MOVING_M_S:g} m/s", "ids",
                  "ids per minute", "life of an id, mean, s", "median, s"), rows)


# --- pictures


def box_patch(thing, **style):
    size = np.array((thing["a"], thing["b"]))
    c, s = math.cos(thing["yaw"]), math.sin(thing["yaw"])
    corners = np.array(((1, 1), (-1, 1), (-1, -1), (1, -1))) * size @ np.array(((c, s), (-s, c)))
    return patches.Polygon(corners + (thing["x"], thing["y"]), **style)


def colors_of(looks):
    """{id: color}, in the order of appearance."""
    ids = dict.fromkeys(look.element["id"] for look in looks if look.element)
    return {found: ID_COLORS[i % len(ID_COLORS)] for i, found in enumerate(ids)}


def draw_track(ax, recording, score, hits):
    """From above: the truth's path and boxes, and where the map had the thing."""
    if hits:
        ax.plot(*np.concatenate(hits).T, ".", color="0.75", ms=1.5, mew=0, zorder=0)
    ax.plot(*np.array([frame["ego"][:2] for frame in recording.frames]).T, color="black", lw=0.8, ls=":", zorder=1)
    draw_robot(ax, recording.frames[0]["ego"], 0.18)
    corners = [frame["ego"][:2] for frame in recording.frames]
    for looks in score.looks.values():
        colors = colors_of(looks)
        ax.plot([look.thing["x"] for look in looks], [look.thing["y"] for look in looks], color=PATH, lw=1.2, zorder=2)
        corners += [(look.thing["x"], look.thing["y"]) for look in looks]
        last = None
        for look in looks:  # a box each 0.6 m
            if last is None or distance(look.thing, last) > 0.6:
                last = look.thing
                ax.add_patch(box_patch(last, fc=MOVING_TRUTH, ec=MOVING, lw=0.7, alpha=0.7, zorder=1))
            if look.visible and not look.element:
                ax.plot(look.thing["x"], look.thing["y"], "x", color=MISSED, ms=4, mew=1, zorder=4)
            elif look.element:
                color = colors[look.element["id"]]
                ax.plot((look.thing["x"], look.element["x"]), (look.thing["y"], look.element["y"]), color=color, lw=0.5,
                        zorder=3)
                ax.plot(look.element["x"], look.element["y"], "o", color=color, ms=3, mew=0, zorder=4)
    movers = [element for others in score.others for element in others if speed(element) > MOVING_M_S]
    standing = [element for others in score.others for element in others if speed(element) <= MOVING_M_S]
    for elements, color, size in ((standing, OTHER, 2.5), (movers, FALSE, 3.5)):
        ax.plot([e["x"] for e in elements], [e["y"] for e in elements], "s", color=color, ms=size, mew=0, zorder=2)
    (left, low), (right, high) = np.min(corners, axis=0) - 0.9, np.max(corners, axis=0) + 0.9
    ax.set(xlim=(left, right), ylim=(low, high), xlabel="x, m", ylabel="y, m")
    ax.set_aspect("equal", adjustable="datalim")
    clean(ax)


def draw_over_time(axes, recording, score):
    error, speeds, others = axes
    begin = recording.frames[0]["t"]
    for looks in score.looks.values():
        visible, colors = [look for look in looks if look.visible], colors_of(looks)
        t = [look.t - begin for look in looks]
        error.fill_between(t, 0.0, SHOWN_ERROR_M, where=[look.visible and not look.element for look in looks],
                           step="mid", color=MISSED, alpha=0.2, lw=0)
        for id_, color in colors.items():
            own = [look for look in visible if look.element and look.element["id"] == id_]
            at = [look.t - begin for look in own]
            error.plot(at, [distance(look.element, look.thing) for look in own], ".", color=color, ms=4)
            speeds.plot(at, [speed(look.element) for look in own], ".", color=color, ms=4)
        speeds.plot(t, [speed(look.thing) for look in looks], color=PATH, lw=1.2)
    target_m = next(target for key, _, _, target, _ in TARGETS if key == "position_rmse_m")
    error.axhline(target_m, color="black", lw=1, ls="--")
    error.set(ylim=(0, SHOWN_ERROR_M), ylabel="position error, m")
    speeds.set(ylabel="speed, m/s")
    speeds.set_ylim(bottom=0)
    t = [frame["t"] - begin for frame in recording.frames]
    for moving, color in ((False, OTHER), (True, FALSE)):
        counts = [sum((speed(element) > MOVING_M_S) == moving for element in elements) for elements in score.others]
        others.step(t, counts, color=color, lw=1.2, where="mid")
    others.set(ylabel="other elements", xlabel="t, s", xlim=(t[0], t[-1]))
    others.set_ylim(bottom=0)
    for ax in axes:
        clean(ax)
        ax.tick_params(labelbottom=ax is others)


def draw_scene(ax, recording, score, hits, look):
    k, thing, frame = look.k, look.thing, recording.frames[look.k]
    for other in frame["objs"]:
        ax.add_patch(box_patch(other, fc=MOVING_TRUTH, ec=MOVING, lw=0.8, zorder=2))
    if hits:
        ax.plot(*hits[k].T, ".", color="0.15", ms=4, zorder=4)
    own = [found.element for looks in score.looks.values() for found in looks if found.k == k and found.element]
    for elements, color in ((own, MAPPED), (score.others[k], OTHER)):
        for element in elements:
            shown = FALSE if color == OTHER and speed(element) > MOVING_M_S else color
            ax.add_patch(ellipse_patch(element, fill=False, ec=shown, lw=1.8, zorder=3))
            if max(abs(element["x"] - thing["x"]), abs(element["y"] - thing["y"])) < SCENE_M:
                ax.annotate(str(element["id"]), (element["x"], element["y"]), xytext=(9, 9),
                            textcoords="offset points", color=shown, fontsize=9, zorder=6)
    x, y = frame["ego"][0] - thing["x"], frame["ego"][1] - thing["y"]
    tip, tail = (part * SCENE_M / max(abs(x), abs(y)) for part in (0.88, 0.66))
    ax.annotate("", (thing["x"] + tip * x, thing["y"] + tip * y), (thing["x"] + tail * x, thing["y"] + tail * y),
                arrowprops={"arrowstyle": "-|>", "color": "black"}, zorder=5)
    draw_arrow(ax, thing, 0.3, MOVING)
    ax.set(xlim=(thing["x"] - SCENE_M, thing["x"] + SCENE_M), ylim=(thing["y"] - SCENE_M, thing["y"] + SCENE_M),
           aspect="equal", xticks=[], yticks=[])
    ax.set_title(f"t = {frame['t'] - recording.frames[0]['t']:.1f} s, {thing['hits']} hits", fontsize=10)
    for spine in ax.spines.values():
        spine.set_color("0.8")


def draw(recording, score, hits, path):
    figure = pyplot.figure(figsize=(15, 10.5), layout="constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=(2.6, 1))
    above = grid[0].subgridspec(3, 2, width_ratios=(1.25, 1))
    draw_track(figure.add_subplot(above[:, 0]), recording, score, hits)
    first = figure.add_subplot(above[0, 1])
    draw_over_time([first, *(figure.add_subplot(above[i, 1], sharex=first) for i in (1, 2))], recording, score)
    visible = [look for looks in score.looks.values() for look in looks if look.visible]
    chosen = [visible[int(part * (len(visible) - 1))] for part in np.linspace(0.1, 0.9, SCENES)] if visible else []
    scenes = grid[1].subgridspec(1, SCENES)
    for i, look in enumerate(chosen):
        draw_scene(figure.add_subplot(scenes[i]), recording, score, hits, look)
    save(figure, path, [
        pyplot.Line2D([], [], color=PATH, lw=1.2, label="truth"),
        patches.Patch(fc=MOVING_TRUTH, ec=MOVING, label="its box"),
        pyplot.Line2D([], [], marker="o", ls="-", lw=0.5, ms=4, color=ID_COLORS[0],
                      label="its element, and the error (a colour for each id)"),
        pyplot.Line2D([], [], marker="x", ls="", color=MISSED, label="visible, not on the map"),
        pyplot.Line2D([], [], marker="s", ls="", ms=4, color=FALSE, label="another element that moves"),
        pyplot.Line2D([], [], marker="s", ls="", ms=4, color=OTHER, label="one that stands"),
        pyplot.Line2D([], [], color="black", lw=0.8, ls=":", label="scanner"),
        pyplot.Line2D([], [], marker=".", ls="", color="0.5", label="hits"),
    ], ncol=4)


# --- report


INTRODUCTION = """
`objects_bag` with {config} on every recording with truth of the data folder: {count} recordings, {scans:,} scans.
{about}
"""
ABOUT = """
A scanner of 360 beams (1°, 12.9 Hz, 4 to 5 mm of noise at 1 m) on a small car, and around it another car, a box of
0.435 m x 0.19 m, 0.4 to 1.2 m away; the poses of both are from motion capture. The recordings are
[datmo](https://github.com/kostaskonkk/datmo)'s examples; the scanner's place, its ranges and the times of its beams
were calibrated on them. They are not part of this repository.
"""
CALIBRATED = " (scanner's place, ranges and times calibrated on it)"
MEASURES = """
An object is visible in a scan if at least {hits} beams hit it, as the truth counts them. An element is on the object
if its centre is on the box or within {margin:g} m of it; of these the nearest to the object's centre is its own, scan
by scan, without regard to the past. Recall is the part of the scans with the object visible in which it has an
element, from the first scan on; errors are over those scans, at the scan's stamp. *Behind the truth*: along the line
from the scanner, negative towards it. The semi-axes are compared with those of the ellipse of equal moments, 2/√3 of
the box's. The lower rows are for comparison with `scripts/evaluate map`: there an element is the object's if their
centres are within {gate:g} m, and here a post that the car passes would be, too.
"""
TRACKS = """
An id switch is a change of the id since the object was last visible and on the map, after any time; a fragment is a
time off the map while it is visible, after it was on it. Duplicates are other elements on the object. Elements faster
than {moving:g} m/s that are not the object's own are false movers, also duplicates: nothing else moves. Others that
stand cannot be judged, since posts and walls are in sight that have no truth.
"""
DETECTIONS = """
What the map is given: the detection on the visible object that is nearest to its centre, in % of the scans with the
object visible. The published covariance of a detection's centre should contain the truth in {region:.0f} % of all cases.
"""
ACCOUNTS = """
What became of every hit ([`objects_bag --points`](../offline.md#objects_bag)). Compact are the segments of at least
{hits} hits that are no structure. One is on no map if none of its hits is inside an object on the map after the
scan, or within 0.15 m of its outline; a new object is on no map until it is confirmed. The longest time is that of one
place, from its first scan on no map to its last, until it is on the map or not seen for 0.5 s.
"""
WITHOUT = """
What the map makes of recordings of other scanners: no errors, since nothing is known to compare with. The life of an
id is from its first to its last scan on the map.
"""


def report_of(measured, config, about, scores, near, detections, counts, accounts, images):
    return "\n".join((
        "# The map on recordings\n",
        introduction(measured, INTRODUCTION.format(config=config, about=about, count=len(scores),
                                                   scans=sum(score.scans for score in scores.values()))),
        targets_section([*targets(scores), account_target(accounts)]),
        section("The object on the map", prose(MEASURES.format(hits=VISIBLE_HITS, margin=MARGIN_M, gate=GATE_M)),
                map_table(scores, near, CALIBRATED if about else "")),
        section("Identity and other elements", prose(TRACKS.format(moving=MOVING_M_S)),
                tracks_table(scores)),
        section("Pictures", *(f"**{name}**\n\n" + picture(images, f"recordings_{name}.png",
                                                         f"Track and truth of {name} from above, over time, and in six "
                                                         "scans") for name in scores),
                prose("In the scans of the lower rows the scanner is in the direction of the black arrow; the blue "
                      "arrow is the object's way in 0.3 s.")),
        section("Detections", prose(DETECTIONS.format(region=100 * REGION)), detections_table(detections)),
        section("Nothing compact vanishes", prose(ACCOUNTS.format(hits=VISIBLE_HITS)), accounts_table(accounts)),
        *([section("Recordings without truth", prose(WITHOUT), counts_table(counts))] if counts else ()),
    ))


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "other recordings or parameters")
    parser.add_argument("--tool", required=True)
    parser.add_argument("--data", type=pathlib.Path, default=DATA, help="folder of the recordings: ../shared/data")
    parser.add_argument("--config", type=pathlib.Path, default=ROOT / "cfg/objects.yaml", help="cfg/objects.yaml")
    arguments = parser.parse_args()
    recordings = list(recordings_with_truth(arguments.data))
    if not recordings:
        sys.exit(f"{arguments.data} has no NAME.bag with a NAME.gt.json")
    whole = arguments.data == DATA and arguments.config == ROOT / "cfg/objects.yaml"
    output = output_folder(arguments, whole)
    measured, images = facts(arguments, {"--data": "DIR", "--config": "FILE"}), images_folder(output)

    scores, near, detections, counts, accounts = {}, {}, {}, {}, {}
    for recording in recordings:
        print(recording.name, flush=True)
        accounts[recording.name], lines, detected = run(arguments, recording.bag, SCAN_TOPIC, "--world-frame",
                                                        WORLD_FRAME, detections=True)
        score = scores[recording.name] = Score(recording.frames, lines)
        near[recording.name] = Score(recording.frames, lines, is_near)
        detections[recording.name] = DetectionScore(recording.frames, detected)
        draw(recording, score, hits_of(recording), images / f"recordings_{recording.name}.png")
    for (name, topic), options in WITHOUT_TRUTH.items():
        if (arguments.data / name).is_file():
            print(name, topic, flush=True)
            accounts[f"`{name} {topic}`"], lines = run(arguments, arguments.data / name, topic, *options)
            counts[f"`{name} {topic}`"] = Counts(lines)
    config = "the shipped `cfg/objects.yaml`" if arguments.config == ROOT / "cfg/objects.yaml" else "other parameters"
    about = ABOUT if arguments.data == DATA else ""
    write(output, "recordings.md", report_of(measured, config, about, scores, near, detections, counts, accounts,
                                                images))


if __name__ == "__main__":
    main()
