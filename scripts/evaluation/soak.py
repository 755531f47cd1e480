# SPDX-License-Identifier: BSD-3-Clause
"""Memory and time over days of data (docs/benchmarks/soak.md): runs map_soak on each kind of map, which never begins
anew, and soak on simulated scans and on the recordings of ../shared/data, if there are any. Run by scripts/evaluate."""

import argparse
import json
import pathlib
import statistics
import struct
import subprocess
import sys
import tempfile
import time

from pictures import clean, images_folder, pyplot, save
from report import (ROOT, arguments_parser, commit, facts, introduction, output_folder, print_progress, prose, section,
                    table, targets_section, write)

RECORDINGS = ROOT.parent / "shared/data"
TOPICS = {"leg_tracker_walking_person.bag": ("/scan",),
          "obstacle_detector_two_scanners.bag": ("/front_scan", "/rear_scan"),
          "scan_tools_hand_moved.bag": ("/scan",)}
HOURS = 40.0
DAY_HOURS = 24.0  # of each kind of map
KINDS = {"objects": "#0b6e4f", "polygons": "#c8553d", "splinegons": "#3d5a80", "grid": "#8a5a83"}
PARTS = ("scans", *KINDS)
WARM_UP_HOURS = 1.0
MAX_GROWTH_BYTES = 1_000_000
MAX_RATIO = 1.1  # of the p50 in the last quarter to that in the second
COLORS = {"simulated": "#0b6e4f", "recorded": "#c8553d"}
RESIDENT, HEAP = "#3d5a80", "#8a5a83"


# --- running


def write_recorded(path):
    """Write all recorded scans into a file for soak; {topic of a bag: scans}."""
    try:
        import rosbag
    except ImportError:
        print("no python3-rosbag: simulated scans alone")
        return {}
    counts = {}
    with path.open("wb") as file:
        for name, topics in TOPICS.items():
            if not (RECORDINGS / name).is_file():
                print(f"no {name}")
                continue
            with rosbag.Bag(str(RECORDINGS / name)) as bag:
                for topic in topics:
                    messages = [message for _, message, _ in bag.read_messages(topics=[topic])]
                    for scan in messages:
                        file.write(struct.pack(f"=5dI{len(scan.ranges)}f", scan.angle_min, scan.angle_increment,
                                               scan.time_increment, scan.range_min, scan.range_max, len(scan.ranges),
                                               *scan.ranges))
                    counts[f"{name} {topic}"] = len(messages)
    return counts


def run(arguments, tool, name, options):
    """The lines of a program, which prints one for each block; with --blocks those that it printed for this commit."""
    kept = arguments.blocks and arguments.blocks / f"{name}_{arguments.hours:g}h_{commit().replace(' ', '_')}.jsonl"
    if kept and kept.is_file():
        print(f"{name}: of {kept}")
        return [json.loads(text) for text in kept.read_text().splitlines()]
    command = [pathlib.Path(arguments.tool).with_name(tool), "--models", ROOT / "models", *options]
    begin, lines = time.monotonic(), []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for text in process.stdout:
            lines.append(json.loads(text))
            if "hours" in lines[-1]:
                print_progress(lines[-1]["scans"] / lines[-1]["of"], begin, f"{name}: {lines[-1]['hours']:.1f} h")
    print()
    if process.returncode != 0 or not lines:
        sys.exit(f"{tool}, {name}, ended with code {process.returncode}")
    lines[-1]["took_s"] = time.monotonic() - begin
    if kept:
        arguments.blocks.mkdir(parents=True, exist_ok=True)
        kept.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return lines


def run_scans(arguments):
    """(lines of the blocks, outcomes of the scans, recorded scans of each topic)"""
    with tempfile.TemporaryDirectory() as folder:
        scans = pathlib.Path(folder) / "scans"
        recorded = write_recorded(scans)
        lines = run(arguments, "soak", "scans", ["--config", ROOT / "cfg/objects.yaml", "--hours", str(arguments.hours),
                                                 *(["--scans", scans] if recorded else [])])
    return lines[:-1], lines[-1], recorded


def run_day(arguments, kind):
    """The lines of the blocks of one kind of map."""
    return run(arguments, "map_soak", kind, ["--kind", kind, "--config", ROOT / f"cfg/{kind}.yaml", "--hours",
                                             str(min(arguments.hours, DAY_HOURS))])


# --- numbers


class Day:
    """The blocks of one kind of map."""

    def __init__(self, kind, blocks):
        self.kind, self.blocks, self.hours = kind, blocks, blocks[-1]["hours"]

    def quarter(self, i):
        """Medians over the blocks of a quarter of the time, the largest of max_us, and what was there at its end."""
        begin, end = i * self.hours / 4, (i + 1) * self.hours / 4 + 1e-9
        blocks = [block for block in self.blocks if begin < block["hours"] <= end]
        medians = {name: statistics.median(block[name] for block in blocks) for name in ("p50_us", "p99_us")}
        return {**medians, "max_us": max(block["max_us"] for block in blocks),
                "p50_yardsticks": statistics.median(block["p50_us"] / block["yardstick_us"] for block in blocks),
                **{name: blocks[-1][name] for name in ("resident_bytes", "things", "elements")}}

    def ratio(self):
        return self.quarter(3)["p50_yardsticks"] / self.quarter(1)["p50_yardsticks"]

    def growth_bytes(self):
        """From the end of the warm-up to the largest after it."""
        warm = [block["resident_bytes"] for block in self.blocks if block["hours"] >= WARM_UP_HOURS - 1e-9]
        return max(warm) - warm[0]

    def targets(self):
        """(sentence, figure, met)"""
        growth, ratio = self.growth_bytes(), self.ratio()
        whole = self.hours >= DAY_HOURS - 1e-9
        part = "" if whole else f", in {self.hours:.1f} of {DAY_HOURS:g} h"  # which is no proof for a day
        yield (f"{self.kind}: resident memory grows by at most 1 MB after the first hour",
               f"{growth / 1e6:.3f} MB{part}", whole and growth <= MAX_GROWTH_BYTES)
        yield (f"{self.kind}: p50 in the last quarter of the time at most {MAX_RATIO} times that in the second",
               f"{ratio:.3f}{part}", whole and ratio <= MAX_RATIO)


def days_table(days):
    rows = []
    for day in days:
        for i in range(4):
            quarter = day.quarter(i)
            rows.append((day.kind, f"{(i + 1) * day.hours / 4:.1f}",
                         *(f"{quarter[name] / 1000:.3f}" for name in ("p50_us", "p99_us", "max_us")),
                         f"{quarter['p50_yardsticks']:.2f}", f"{quarter['resident_bytes'] / 1e6:.3f}",
                         f"{quarter['things']:,}", f"{quarter['elements']:,}"))
    return table(("map", "quarter until, h", "p50, ms", "p99, ms", "max, ms", "p50, yardsticks",
                  "resident at its end, MB", "on the map then", "elements then"), rows)


def draw_days(days, path):
    figure, (memory, latency) = pyplot.subplots(2, 1, figsize=(11, 7.2), layout="constrained", sharex=True)
    for day in days:
        hours = [block["hours"] for block in day.blocks]
        warm = next(block for block in day.blocks if block["hours"] >= WARM_UP_HOURS - 1e-9)["resident_bytes"]
        memory.plot(hours, [(block["resident_bytes"] - warm) / 1e6 for block in day.blocks], color=KINDS[day.kind],
                    lw=1.6, label=f"{day.kind}, {warm / 1e6:.1f} MB after {WARM_UP_HOURS:g} h")
        second = day.quarter(1)
        ratios = [block["p50_us"] / block["yardstick_us"] / second["p50_yardsticks"] for block in day.blocks]
        latency.plot(hours, ratios, color=KINDS[day.kind], lw=1.6,
                     label=f"{day.kind}, {second['p50_us'] / 1000:.2g} ms")
    memory.axhline(MAX_GROWTH_BYTES / 1e6, color="black", lw=1.0, ls="--")
    memory.axvspan(0.0, WARM_UP_HOURS, color="0.92", lw=0)
    memory.set_ylabel(f"memory, MB more than after {WARM_UP_HOURS:g} h")
    latency.axhline(MAX_RATIO, color="black", lw=1.0, ls="--")
    latency.set_ylim(0.0, 1.5)
    latency.set_ylabel("p50 in yardsticks, to that in the second quarter")
    latency.set_xlabel("hours of data")
    for ax, place in ((memory, "center right"), (latency, "lower right")):
        ax.legend(loc=place, frameon=False)
        clean(ax)
    save(figure, path)


class Results:
    def __init__(self, blocks):
        self.blocks = blocks
        self.hours = blocks[-1]["hours"]
        self.sources = [name for name in COLORS if any(self.source(block) == name for block in blocks)]

    @staticmethod
    def source(block):
        return "recorded" if block["recorded"] else "simulated"

    def within(self, source, begin, end):
        """Blocks of the source that end in (begin, end] hours."""
        return [block for block in self.blocks if self.source(block) == source and begin < block["hours"] <= end]

    def quarter(self, source, i):
        """Medians over the blocks of a quarter of the time."""
        blocks = self.within(source, i * self.hours / 4, (i + 1) * self.hours / 4 + 1e-9)
        medians = {name: statistics.median(block[name] for block in blocks)
                   for name in ("p50_us", "p99_us", "yardstick_us", "detections", "objects")}
        return {**medians, "max_us": max(block["max_us"] for block in blocks),
                "p50_yardsticks": statistics.median(block["p50_us"] / block["yardstick_us"] for block in blocks),
                "p99_yardsticks": statistics.median(block["p99_us"] / block["yardstick_us"] for block in blocks)}

    def hourly(self, source, name):
        """(hours, medians over the blocks of each hour)"""
        hours, values = [], []
        for hour in range(int(self.hours)):
            blocks = self.within(source, hour, hour + 1 + 1e-9)
            hours.append(hour + 0.5)
            values.append(statistics.median(block[name] for block in blocks))
        return hours, values

    def ratio(self, source, name):
        return self.quarter(source, 3)[name] / self.quarter(source, 1)[name]

    def growth_bytes(self, name):
        """From the end of the warm-up to the largest after it."""
        warm = [block[name] for block in self.blocks if block["hours"] >= WARM_UP_HOURS - 1e-9]
        return max(warm) - warm[0]


def targets(results, accounts):
    """(sentence, figure, met)"""
    growth = results.growth_bytes("resident_bytes")
    yield ("resident memory grows by less than 1 MB after the first hour", f"{growth / 1e6:.3f} MB",
           growth < MAX_GROWTH_BYTES)
    for source in results.sources:
        ratio = results.ratio(source, "p50_yardsticks")
        yield (f"{source} scans: p50 in the last quarter of the time at most {MAX_RATIO} times that in the second",
               f"{ratio:.3f}", ratio <= MAX_RATIO)
    lost = accounts["sent"] - sum(kind["outcomes"].get(kind["must"], 0) for kind in accounts["kinds"])
    yield ("every scan ends as its kind must", f"{lost:,} of {accounts['sent']:,} do not", accounts["accounted"])


# --- tables


def memory_table(results):
    rows = []
    for hours in [WARM_UP_HOURS] + [results.hours * part / 4 for part in (1, 2, 3, 4)]:
        block = min(results.blocks, key=lambda block: abs(block["hours"] - hours))
        rows.append((f"{block['hours']:.0f}", f"{block['resident_bytes'] / 1e6:.3f}",
                     f"{block['heap_bytes'] / 1e6:.3f}"))
    return table(("after hours", "resident, MB", "allocated on the heap, MB"), rows)


def time_table(results):
    rows = []
    for source in results.sources:
        for i in range(4):
            quarter = results.quarter(source, i)
            rows.append((source, f"{i + 1}",
                         *(f"{quarter[name] / 1000:.3f}" for name in ("p50_us", "p99_us", "max_us")),
                         f"{quarter['yardstick_us']:.1f}",
                         *(f"{quarter[name]:.2f}" for name in ("p50_yardsticks", "p99_yardsticks")),
                         f"{quarter['detections']:.1f}", f"{quarter['objects']:.1f}"))
        rows.append((f"**{source}**", "**4th / 2nd**",
                     *(f"**{results.ratio(source, name):.3f}**" for name in ("p50_us", "p99_us")), "",
                     *(f"**{results.ratio(source, name):.3f}**"
                       for name in ("yardstick_us", "p50_yardsticks", "p99_yardsticks")), "", ""))
    return table(("scans", "quarter", "p50, ms", "p99, ms", "max, ms", "yardstick, µs", "p50, yardsticks",
                  "p99, yardsticks", "detections", "objects on the map"), rows)


def accounts_table(accounts):
    rows = [(kind["kind"], f"{kind['sent']:,}", kind["must"].strip(),
             ", ".join(f"{count:,} {outcome.strip()}" for outcome, count in kind["outcomes"].items()))
            for kind in accounts["kinds"]]
    rows.append(("**all**", f"**{accounts['sent']:,}**", "",
                 f"**{sum(sum(kind['outcomes'].values()) for kind in accounts['kinds']):,}**"))
    return table(("kind", "sent", "must be", "was"), rows)


# --- picture


def draw(results, path):
    figure, (memory, latency) = pyplot.subplots(2, 1, figsize=(11, 7.2), layout="constrained", sharex=True,
                                                height_ratios=(1, 1.5))
    hours = [block["hours"] for block in results.blocks]
    for name, label, color in (("resident_bytes", "resident", RESIDENT), ("heap_bytes", "allocated on the heap", HEAP)):
        warm = next(block[name] for block in results.blocks if block["hours"] >= WARM_UP_HOURS - 1e-9)
        memory.plot(hours, [(block[name] - warm) / 1e6 for block in results.blocks], color=color, lw=1.6,
                    label=f"{label}, {warm / 1e6:.1f} MB after {WARM_UP_HOURS:g} h")
    memory.axhline(MAX_GROWTH_BYTES / 1e6, color="black", lw=1.0, ls="--")
    memory.text(hours[-1], MAX_GROWTH_BYTES / 1e6 - 0.05, "at most", ha="right", va="top", fontsize=9)
    memory.axvspan(0.0, WARM_UP_HOURS, color="0.92", lw=0)
    memory.set_ylim(-1.15, 1.15)
    memory.set_ylabel(f"memory, MB more than after {WARM_UP_HOURS:g} h")
    memory.legend(loc="lower right", frameon=False)

    for source in results.sources:
        color = COLORS[source]
        blocks = results.within(source, 0.0, results.hours)
        for name, style, label in (("p50_us", "-", "p50"), ("p99_us", "--", "p99")):
            latency.plot([block["hours"] for block in blocks], [block[name] / 1000 for block in blocks], "o",
                         color=color, ms=2.5, alpha=0.3, mew=0)
            at, values = results.hourly(source, name)
            latency.plot(at, [value / 1000 for value in values], style, color=color, lw=1.8,
                         label=f"{source}, {label}")
    latency.set_ylim(bottom=0.0)
    latency.set_ylabel("CPU time, ms per scan")
    latency.set_xlabel("hours of scans")
    latency.set_xlim(0.0, results.hours)
    latency.legend(loc="lower right", ncol=len(results.sources), frameon=False)
    for ax in (memory, latency):
        clean(ax)
    save(figure, path)


# --- report


DAYS_TEXT = """
Up to {hours:g} hours of data through each kind of map, which never begins anew, with the shipped `cfg/KIND.yaml`
([map_soak.cpp](../../benchmark/map_soak.cpp)); what stands stays as it is, so that nothing new is to be seen after the
first hour. Rates are low, so that a day takes minutes: 5 scans a second of 361 beams, one image in 2 s. Objects, and
polygons with objects: a hall of 24 m x 16 m with boxes and posts, three that walk, and a robot that goes round at about
1 m/s. Splinegons, at true pose: two buildings and one that walks, flown around at 12 m/s. Poses have noise of 3 mm and
0.5 mrad in each scan. Grid: the orbit about four cars with noisy labels and a false blob in each image, over and over,
and noise of the pose.
"""
INTRODUCTION = """
Many hours of data as fast as the programs take them, one after the other, in one process each: no ROS, no messages.
"""
SCANS_TEXT = """
{scans:,} scans, {hours:g} hours at 20 Hz of their stamps, in sequence through one `ObjectPipeline` with
the shipped `cfg/objects.yaml`, in {minutes:.0f} minutes. Simulated scans are of a walled room
with 12 objects, half of them moving, 1081 beams, a loop of 64 s with noise
([synthetic_scene.hpp](../../benchmark/synthetic_scene.hpp)). {recorded}
Stamps are reset after 10 min, 20 min, 30 min and 4 h in turn, as by a bag that loops; the
map then starts anew. Otherwise they increase, also when the source changes: then all objects of the map vanish at once.
"""
RECORDED = """
Ten minutes of them alternate with ten of recorded ones: a
loop of {count:,} scans of four scanners, one after the
other ({bags}), recorded at 10 Hz and sent at 20, with a static scanner at the world's
origin.
"""
NOT_RECORDED = "**No recorded scans were at hand, so all are simulated.**"
MEMORY_TEXT = """
Every ten minutes of scans: resident memory of the whole process (`/proc/self/statm`), and allocated heap memory
(`mallinfo2`); `malloc_trim` is not called. The first hour is the warm-up; growth is from its end to the
largest value after it.
"""
TIME_TEXT = """
CPU time of the thread for `ObjectPipeline::process` and `ObjectMap::at`: p50 and p99 of each ten minutes of scans, and
the medians of those over a quarter of the time; max is the largest of all. The yardstick is the time of projection and
segmentation of one fixed scan by stateless functions, every 20 scans: it measures the momentary speed of the machine.
The ratio of the target is of times in yardsticks.
"""
ACCOUNTS_TEXT = """
Each kind of invalid scan occurs at random with a probability of about 2 in 1,000. A scan counts as mapped if the map
then has its stamp, and as refused or thrown only if the map's stamp is unchanged; reasons are those of
`ObjectMapUpdate`, messages those of `std::invalid_argument`.
"""


def report_of(scans, measured, days):
    """Of (results, accounts, recorded), or None, and of the days of some kinds of map."""
    verdicts, sections = [verdict for day in days for verdict in day.targets()], []
    if days:
        words = DAYS_TEXT.format(hours=max(day.hours for day in days))
        sections += [section("A day of each kind of map", prose(words), days_table(days)),
                     "![Memory of each kind of map, and CPU time per scan or image, over the hours]"
                     "(images/soak_days.png)\n"]
    if scans:
        results, accounts, recorded = scans
        verdicts += targets(results, accounts)
        names = ", ".join(f"`{name}` {count:,}" for name, count in recorded.items())
        words = SCANS_TEXT.format(
            scans=accounts["sent"], hours=results.hours, minutes=accounts["took_s"] / 60,
            recorded=RECORDED.format(count=sum(recorded.values()), bags=names) if recorded else NOT_RECORDED)
        sections += [section("Scans that begin anew", prose(words)),
                     "![Memory, and CPU time per scan, over the hours](images/soak.png)\n",
                     section("Memory", prose(MEMORY_TEXT), memory_table(results)),
                     section("Time", prose(TIME_TEXT), time_table(results)),
                     section("Outcome of the scans", prose(ACCOUNTS_TEXT), accounts_table(accounts))]
    report = "\n".join(("# Soak test\n", introduction(measured, INTRODUCTION), targets_section(verdicts), *sections))
    return report, all(met for _, _, met in verdicts)


def hours_of(text):
    hours = float(text)
    if not hours >= 4.0:
        raise argparse.ArgumentTypeError("must be at least 4: an hour to each quarter")
    return hours


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "fewer hours or parts")
    parser.add_argument("--tool", required=True)
    parser.add_argument("--hours", type=hours_of, default=HOURS, help=f"of scans (default {HOURS:g})")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART",
                        help=f"of {', '.join(PARTS)}: scans that begin anew, and kinds of map")
    parser.add_argument("--blocks", type=pathlib.Path, metavar="DIR",
                        help="where what was measured is kept; a part that is there, of this commit, is not run again")
    arguments = parser.parse_args()
    whole = arguments.hours >= HOURS and set(arguments.only) == set(PARTS)
    output, measured = output_folder(arguments, whole), facts(arguments)
    scans = None
    if "scans" in arguments.only:
        blocks, accounts, recorded = run_scans(arguments)
        scans = (Results(blocks), accounts, recorded)
        draw(scans[0], images_folder(output) / "soak.png")
    days = [Day(kind, run_day(arguments, kind)) for kind in KINDS if kind in arguments.only]
    if days:
        draw_days(days, images_folder(output) / "soak_days.png")
    report, kept = report_of(scans, measured, days)
    write(output, "soak.md", report)
    sys.exit(0 if kept else 1)


if __name__ == "__main__":
    main()
