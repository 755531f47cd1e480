# SPDX-License-Identifier: BSD-3-Clause
"""The map of standing things by one recording of which every scan, every second, fifth and so on is used
(docs/benchmarks/thinned.md): a map should not depend on how often a scanner looks. Run by scripts/evaluate.

There is no truth: the map is compared with the hits that it was made of, and with what the whole recording saw of its
places last."""

import dataclasses
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from scipy.spatial import cKDTree

import polygons
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, section, table, targets_section,
                    write)

DATA = ROOT.parent / "shared/data"
TOPIC, BASE_FRAME, TRANSFORMS = "/scan", "base_link", ("/tf", "/tf_static")
RECORDINGS = {  # options of polygons_bag
    "freiburg_079": ("--world-frame", "map"),
    "leg_tracker_walking_person": ("--static-sensor",),
}
EVERY = (1, 2, 5, 20, 70)

LIMITS_M = (0.1, 20.0)  # of ranges, as scan: of the parameters has them
NEAR_M = 0.05  # of a hit to the map
CELL_M, HIT_BY = 0.05, 3  # places, and the scans that have hit one that is to be on the map
SAMPLE_M = 0.02
BESIDE_M, DOUBLE_M, LEAST_DOUBLE_M = 0.02, 0.10, 0.01  # along and across, to another boundary before a sample
SAME_WAY = math.cos(math.radians(45.0))
LOOKS, PASSED_M = 5, 0.2  # the last scans with a place in view, and how far behind it their beams end if it is free
LEAST_COVERED, MOST_DOUBLED = 0.85, 0.05


# --- recordings


def thin(bag_file, out_file, every):
    """Of the scans the first of so many, and all transforms."""
    import rosbag
    with rosbag.Bag(str(bag_file)) as bag, rosbag.Bag(str(out_file), "w") as out:
        scans = 0
        for topic, message, stamp, connection in bag.read_messages(topics=(TOPIC, *TRANSFORMS), raw=True,
                                                                   return_connection_header=True):
            if topic == TOPIC:
                scans += 1
                if (scans - 1) % every:
                    continue
            out.write(topic, message, stamp, raw=True, connection_header=connection)


def planar(transform):
    t, q = transform.translation, transform.rotation
    return np.array((t.x, t.y, 2.0 * math.atan2(q.z, q.w)))


@dataclasses.dataclass
class Scan:
    stamp_s: float
    ranges_m: np.ndarray  # inf without a return
    azimuth_rad: np.ndarray
    pose: np.ndarray = None  # x, y, yaw of the scanner in the world

    def hits(self):
        held = np.isfinite(self.ranges_m)
        angle = self.azimuth_rad[held] + self.pose[2]
        return self.pose[:2] + self.ranges_m[held, None] * np.stack((np.cos(angle), np.sin(angle)), axis=1)


def scans_of(bag_file):
    """The scans, and where the scanner is on the base."""
    import rosbag
    scans, T_base_scanner = [], np.zeros(3)
    with rosbag.Bag(str(bag_file)) as bag:
        for topic, message, _ in bag.read_messages(topics=(TOPIC, "/tf_static")):
            if topic == TOPIC:
                ranges = np.array(message.ranges, float)
                low_m, high_m = max(message.range_min, LIMITS_M[0]), min(message.range_max, LIMITS_M[1])
                ranges[~((ranges >= low_m) & (ranges <= high_m))] = np.inf
                scans.append(Scan(message.header.stamp.to_sec(), ranges,
                                  message.angle_min + message.angle_increment * np.arange(len(ranges))))
                continue
            for transform in message.transforms:
                if transform.header.frame_id.strip("/") == BASE_FRAME:
                    T_base_scanner = planar(transform.transform)
    return scans, T_base_scanner


def place(scans, lines, T_base_scanner):
    """Gives the scans of the lines their poses; those alone."""
    poses = {round(line["stamp"], 4): line["pose"] for line in lines}
    placed = []
    for scan in scans:
        pose = poses.get(round(scan.stamp_s, 4))
        if pose is None:
            continue
        c, s = math.cos(pose["yaw"]), math.sin(pose["yaw"])
        x, y, yaw = T_base_scanner
        scan.pose = np.array((pose["x"] + c * x - s * y, pose["y"] + s * x + c * y, pose["yaw"] + yaw))
        placed.append(scan)
    return placed


def map_of(arguments, bag, options, folder):
    """The lines, without their chains, and the chains after the last scan."""
    out = folder / "map.jsonl"
    result = subprocess.run([arguments.tool, bag, "--scan-topic", TOPIC, "--localization", "tf", *options, "--config",
                             arguments.config, "--changes", "--full-every", "1e9", "--out", out],
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if result.returncode:
        sys.exit(f"polygons_bag ended with code {result.returncode} on {bag}:\n{result.stderr}")
    lines, chains = [], {}
    for line in polygons.lines_of(out):
        for id_ in line["gone"]:
            chains.pop(id_, None)
        chains |= {chain["id"]: chain for chain in line["changed"]}
        lines.append({"stamp": line["stamp"], "pose": line["pose"]})
    return lines, polygons.chains_of({"polylines": list(chains.values())})


# --- measures


def often_hit(scans):
    """The hits of cells that at least HIT_BY of the scans have hit."""
    hits = [scan.hits() for scan in scans]
    points = np.vstack(hits)
    scan_of = np.repeat(np.arange(len(hits)), [len(points) for points in hits])
    cells = np.floor(points / CELL_M).astype(np.int64)
    _, cell_of = np.unique(cells, axis=0, return_inverse=True)
    cell_of = cell_of.ravel()
    pairs = np.unique(np.stack((cell_of, scan_of), axis=1), axis=0)
    by = np.bincount(pairs[:, 0])
    return points[by[cell_of] >= HIT_BY]


def along_of(samples):
    """Unit, from right to left as seen from the free side; of samples in the order of their edges."""
    along = np.diff(samples.points, axis=0, append=samples.points[-1:])
    last = np.append(samples.chain[1:] != samples.chain[:-1], True)
    along[last] = np.roll(along, 1, axis=0)[last]
    return along / np.maximum(np.hypot(*along.T), 1e-9)[:, None]


def doubled(samples):
    """Whether another boundary that faces the same way is right before each sample."""
    along = along_of(samples)
    result = np.zeros(len(samples.points), bool)
    pairs = cKDTree(samples.points).query_pairs(DOUBLE_M, output_type="ndarray")
    for a, b in (pairs.T, pairs.T[::-1]):
        d = samples.points[b] - samples.points[a]
        beside = np.abs(np.sum(along[a] * d, axis=1)) <= BESIDE_M
        before = along[a, 0] * d[:, 1] - along[a, 1] * d[:, 0]  # towards the free side
        same_way = np.sum(along[a] * along[b], axis=1) > SAME_WAY
        result[a[beside & same_way & (before >= LEAST_DOUBLE_M)]] = True
    return result


def seen_free(points, scans):
    """Whether most of the last looks at each place went through it."""
    looks, passed = np.zeros(len(points), int), np.zeros(len(points), int)
    for scan in reversed(scans):
        open_ = np.nonzero(looks < LOOKS)[0]
        if not len(open_):
            break
        d = points[open_] - scan.pose[:2]
        distance = np.hypot(*d.T)
        bearing = np.arctan2(d[:, 1], d[:, 0]) - scan.pose[2] - scan.azimuth_rad[0]
        beam = np.rint(np.mod(bearing, 2.0 * np.pi) / (scan.azimuth_rad[1] - scan.azimuth_rad[0])).astype(int)
        within = (beam >= 1) & (beam < len(scan.ranges_m) - 1)
        open_, beam, distance = open_[within], beam[within], distance[within]
        beside = scan.ranges_m[beam[:, None] + np.array((-1, 0, 1))]
        seen = np.all(np.isfinite(beside), axis=1) & (beside[:, 1] > distance - NEAR_M)
        looks[open_[seen]] += 1
        passed[open_[seen & (beside.min(axis=1) > distance + PASSED_M)]] += 1
    return 2 * passed > looks


@dataclasses.dataclass
class Measured:
    """One recording at one rate."""

    scans: int
    period_s: float
    hits: int  # of places that are to be on the map
    covered: float
    length_m: float
    doubled: float  # share of the length
    free_m: float
    chains: int


def measure(arguments, name, every, whole, folder):
    """`whole`: the scans of the whole recording, which is measured first."""
    bag = arguments.data / f"{name}.bag"
    if every > 1:
        thin(bag, folder / bag.name, every)
        bag = folder / bag.name
    lines, chains = map_of(arguments, bag, RECORDINGS[name], folder)
    scans, T_base_scanner = scans_of(bag)
    scans = place(scans, lines, T_base_scanner)
    if every == 1:
        whole.extend(scans)
    points, samples = often_hit(scans), polygons.samples_of(chains, SAMPLE_M)
    distance_m = cKDTree(samples.points).query(points)[0] if chains else np.full(len(points), np.inf)
    length_m = float(samples.length_m.sum())
    return Measured(len(scans), float(np.median(np.diff([scan.stamp_s for scan in scans]))), len(points),
                    float(np.mean(distance_m <= NEAR_M)), length_m,
                    float(samples.length_m[doubled(samples)].sum()) / max(length_m, 1e-9),
                    float(samples.length_m[seen_free(samples.points, whole)].sum()), len(chains))


# --- report

INTRODUCTION = """
`polygons_bag` with {config} on one in so many scans of recordings of real scanners, with the poses that they have
(`freiburg_079`: a SLAM program's; the other scanner stands still while a person walks about it). They are not part of
this repository. A map should be the same however often the scanner looks.
"""
MEASURES = """
*Covered*: the part of the hits within {near:.0f} cm of the map after the last scan, of hits in cells of {cell:.0f} cm
that at least {by} of the used scans have hit. These are also places where persons stood or that have changed since, and
poses are off by more in some scans. *Doubled*: the part of the map's length right before which, within {double:.0f} cm,
there is another boundary that faces the same way. Some of that is real, such as frames and plinths. *Free*: the length
where most of the last {looks} looks of the whole recording at the place ended more than {passed:.0f} cm behind it.
"""


def targets(measured):
    for what, key, met, sentence in (
            ("covered", min, lambda value: value >= LEAST_COVERED, f"at least {LEAST_COVERED:g} of the hits covered"),
            ("doubled", max, lambda value: value <= MOST_DOUBLED, f"at most {MOST_DOUBLED:g} of the map doubled")):
        for name in dict.fromkeys(name for name, _ in measured):
            value, every = key((getattr(m, what), every) for (own, every), m in measured.items() if own == name)
            yield f"{sentence} at any rate, `{name}`", f"{value:.3f}, 1 in {every}", met(value)


def measured_table(measured):
    return table(("recording", "scans", "s between them", "used", "hits", "covered", "map, m", "doubled", "free, m",
                  "chains"),
                 [(name, f"1 in {every}", f"{m.period_s:.2f}", f"{m.scans:,}", f"{m.hits:,}", f"{m.covered:.3f}",
                   f"{m.length_m:.0f}", f"{m.doubled:.3f}", f"{m.free_m:.1f}", str(m.chains))
                  for (name, every), m in measured.items()])


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "other recordings, rates or parameters")
    parser.add_argument("--tool", required=True, type=pathlib.Path, help="polygons_bag")
    parser.add_argument("--data", type=pathlib.Path, default=DATA, help="folder of the recordings: ../shared/data")
    parser.add_argument("--config", type=pathlib.Path, default=ROOT / "cfg/polygons.yaml", help="cfg/polygons.yaml")
    parser.add_argument("--only", nargs="+", choices=list(RECORDINGS), default=list(RECORDINGS))
    parser.add_argument("--every", nargs="+", type=int, default=list(EVERY), help="the whole recording is always used")
    arguments = parser.parse_args()
    shipped = arguments.config == ROOT / "cfg/polygons.yaml"
    output = output_folder(arguments, shipped and arguments.data == DATA and set(arguments.only) == set(RECORDINGS)
                           and set(arguments.every) >= set(EVERY))
    found = facts(arguments, {"--data": "DIR", "--config": "FILE"})
    measured = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.only:
            whole = []
            for every in sorted({1, *arguments.every}):
                measured[name, every] = measure(arguments, name, every, whole, pathlib.Path(folder))
                print(name, every, measured[name, every], flush=True)
    write(output, "thinned.md", "\n".join((
        "# Standing things by few scans\n",
        introduction(found, INTRODUCTION.format(
            config="the shipped `cfg/polygons.yaml`" if shipped else "other parameters")),
        targets_section(list(targets(measured))),
        section("Rates", prose(MEASURES.format(near=100 * NEAR_M, cell=100 * CELL_M, by=HIT_BY, double=100 * DOUBLE_M,
                                               looks=LOOKS, passed=100 * PASSED_M)), measured_table(measured)))))


if __name__ == "__main__":
    main()
