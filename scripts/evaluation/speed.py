# SPDX-License-Identifier: BSD-3-Clause
"""Cost of a scan from scan to map (docs/benchmarks/speed.md): runs pipeline_speed over beams, objects, threads and
elements of the map, and the benchmarks of all maps. Run by scripts/evaluate."""

import argparse
import dataclasses
import json
import math
import pathlib
import statistics
import subprocess
import time

import speed_limits
import speed_of_maps
from pictures import clean, images_folder, pyplot, save
from report import (ROOT, arguments_parser, facts, introduction, output_folder, print_progress, prose, section, table,
                    targets_section, write)

BEAMS, OBJECTS, THREADS = (181, 541, 1081, 3600), (1, 12, 60, 200), (1, 2)
ELEMENTS = (0, 125, 250, 500, 1000, 2000)
USUAL_BEAMS, USUAL_OBJECTS, FINE_BEAMS = 1081, 12, 3600
RATE_HZ = 40
SCANS, ROUNDS = 600, 2
LINEAR_EXPONENT = 1.15  # of the cost, from the last point but one to the last
MOST_OF_OLDER = 0.5  # of the older build's time, where there is one
PAPERS_MS_PER_SEGMENT = 33  # Keras predict, as the papers ran theirs, measured once; not by this command
COLORS = {"limit": "#7f95b2", "project": "#3d5a80", "expect": "#b9cbe3", "segment": "#5fb49c", "divide": "#a7d3c4",
          "lines": "#cfe8df",
          "detect": "#c8553d", "arrivals": "#f4b6a6", "update": "#8a5a83", "publish": "#c9aec5"}
WHOLE, OTHER = "#0b6e4f", "#999999"


# --- running


@dataclasses.dataclass(frozen=True)
class Build:
    of_objects: pathlib.Path  # folder of pipeline_speed
    of_maps: pathlib.Path  # folder of the benchmarks of the maps


def case(beams=USUAL_BEAMS, objects=USUAL_OBJECTS, threads=1, elements=0, rate_hz=0, networks=False):
    return {"beams": beams, "objects": objects, "threads": threads, "elements": elements, "rate_hz": rate_hz,
            "networks": networks}


def key(of):
    return tuple(of[name] for name in ("beams", "objects", "threads", "elements", "rate_hz", "networks"))


def cases():
    for threads in THREADS:
        for beams in BEAMS:
            for objects in OBJECTS:
                yield case(beams, objects, threads)
    for elements in ELEMENTS[1:]:
        yield case(elements=elements)
    for objects in (12, 60):
        yield case(objects=objects, rate_hz=RATE_HZ)
        yield case(objects=objects, networks=True)


def run(arguments, tool, of):
    """A line of pipeline_speed."""
    command = [] if of["threads"] > 1 else ["taskset", "-c", str(arguments.core)]
    command += [tool, "--config", ROOT / "cfg/objects.yaml", "--models", ROOT / "models", "--scans",
                str(arguments.scans)]
    for name in ("beams", "objects", "threads", "elements", "rate_hz"):
        command += ["--" + name.replace("_", "-"), str(of[name])]
    if of["networks"]:
        command.append("--networks")
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)


def run_all(arguments):
    """{key of a case: (lines of this build, lines of the baseline)}, round by round, the two builds in turns."""
    wanted, results, begin, done = list(cases()), {}, time.monotonic(), 0
    tools = [build.of_objects / "pipeline_speed" for build in arguments.builds]
    total = arguments.rounds * len(wanted)
    for round_ in range(arguments.rounds):
        for of in wanted:
            lines = results.setdefault(key(of), tuple([] for _ in tools))
            order = range(len(tools)) if round_ % 2 == 0 else reversed(range(len(tools)))
            for i in order:
                lines[i].append(run(arguments, tools[i], of))
            done += 1
            print_progress(done / total, begin, f"{done} of {total} runs")
    print()
    return results


def median_of(values):
    """Of numbers, or of dictionaries of them, name by name."""
    if isinstance(values[0], dict):
        return {name: median_of([value[name] for value in values]) for name in values[0]}
    return statistics.median(values)


def stage_us(stages, name):
    """Of builds that refine detections in a stage of its own that is part of detecting, as it is now."""
    names = (name, "refine") if name == "detect" and "refine" in stages else (name,)
    return sum(stages[part]["cpu_p50_us"] for part in names)


def ratios_of(news, olds):
    """Medians of new / old, each within its round."""
    def ratio(of):
        return statistics.median(of(new) / of(old) if of(old) else math.inf if of(new) else 1.0
                                 for new, old in zip(news, olds))

    ratios = {name: ratio(lambda line, name=name: line["whole"][name])
              for name in ("p50_us", "p99_us", "cpu_us", "cpu_p50_us", "cpu_p99_us", "allocations", "bytes")}
    shared = [name for name in news[0]["stages"] if name in olds[0]["stages"]]
    ratios["stages"] = {name: ratio(lambda line, name=name: stage_us(line["stages"], name)) for name in shared}
    return ratios


# --- numbers


def rounded(value):
    """Rounded to significant digits."""
    if isinstance(value, dict):
        return {name: rounded(part) for name, part in value.items()}
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    return value


class Results:
    def __init__(self, lines):
        self.medians = {of: median_of(new_and_old[0]) for of, new_and_old in lines.items()}
        self.ratios = {of: ratios_of(*new_and_old) for of, new_and_old in lines.items() if len(new_and_old) == 2}

    def of(self, **what):
        return self.medians[key(case(**what))]

    def json(self):
        names = ("beams", "objects", "threads", "elements", "rate_hz", "networks")
        return [{"case": dict(zip(names, of)), "result": rounded(result),
                 **({"ratios_to_baseline": rounded(self.ratios[of])} if of in self.ratios else {})}
                for of, result in self.medians.items()]


GROWTH = {  # what grows: (its values, the case at a value, where it is to be read)
    f"objects in {FINE_BEAMS} beams": (OBJECTS, lambda n: {"beams": FINE_BEAMS, "objects": n}, "objects"),
    f"objects in {USUAL_BEAMS} beams": (OBJECTS, lambda n: {"objects": n}, "objects"),
    f"beams on {USUAL_OBJECTS} objects": (BEAMS, lambda n: {"beams": n}, "beams"),
    f"elements of the map, {USUAL_OBJECTS} of them in sight": (ELEMENTS, lambda n: {"elements": n}, "elements"),
}


def growth(results, what):
    """(values, results)"""
    values, at, where = GROWTH[what]
    found = [results.of(**at(n)) for n in values]
    return [line[where] for line in found], found


def last_exponent(results, what):
    values, found = growth(results, what)
    costs = [line["whole"]["cpu_p50_us"] for line in found]
    return math.log(costs[-1] / costs[-2]) / math.log(values[-1] / values[-2])


# --- verdicts


def targets(results):
    """(sentence, figure, met)"""
    twelve, sixty = results.of(), results.of(objects=60)
    yield ("12 objects in 1081 beams: p50 at most 1.5 ms", ms(twelve["whole"]["p50_us"]),
           twelve["whole"]["p50_us"] <= 1500.0)
    yield ("12 objects in 1081 beams: p99 at most 3 ms", ms(twelve["whole"]["p99_us"]),
           twelve["whole"]["p99_us"] <= 3000.0)
    yield ("60 objects in 1081 beams: p99 at most 8 ms", ms(sixty["whole"]["p99_us"]),
           sixty["whole"]["p99_us"] <= 8000.0)
    networks = [results.of(objects=objects, networks=True)["networks"] for objects in (12, 60)]
    whole = min(found["vgg_forward_to_whole"] for found in networks)
    yield ("a full forward of the paper's VGG-Net takes at least 15 times as long per segment as the whole pipeline",
           f"{whole:.0f} times; {min(found['vgg_forward_to_detector'] for found in networks):.0f} times the detector "
           "alone", whole >= 15.0)
    allocations = [line["whole"]["allocations"] for line in results.medians.values()]
    yield ("no allocation after warm-up", f"{min(allocations):,.3g} to {max(allocations):,.3g} per scan",
           max(allocations) == 0.0)
    for what in GROWTH:
        exponent = last_exponent(results, what)
        yield (f"the cost against {what} is linear: exponent of at most {LINEAR_EXPONENT} at the last point",
               f"{exponent:.2f}", exponent <= LINEAR_EXPONENT)
    others = max(line["other_threads_cpu_part"] for line in results.medians.values() if line["detections"] > 10)
    yield ("OpenCV's own threads are not used: with more than 10 detections other threads take below 1 % of the CPU",
           f"{100 * others:.2f} %", others < 0.01)


def ratio_targets(results):
    """(sentence, figure, met), to the older build."""
    if not results.ratios:
        return
    for objects in (12, 60):
        ratios = results.ratios[key(case(objects=objects))]
        for name, quantile in (("p50", "p50_us"), ("p99", "p99_us")):
            yield (f"{objects} objects in {USUAL_BEAMS} beams: {name} at most {MOST_OF_OLDER} times the older build's",
                   f"{ratios[quantile]:.3f}", ratios[quantile] <= MOST_OF_OLDER)


# --- tables


def ms(us):
    return f"{us / 1000:.3f} ms"


def short_ms(us):
    return f"{us / 1000:.2f}"


def whole_table(results):
    rows = []
    for of, line in results.medians.items():
        beams, objects, threads, elements, rate_hz, networks = of
        if elements or networks:
            continue
        whole = line["whole"]
        rows.append((str(beams), str(objects), f"{line['detections']:.1f}",
                     str(threads) + (f", at {rate_hz} Hz" if rate_hz else ""), short_ms(whole["p50_us"]),
                     short_ms(whole["p99_us"]), short_ms(whole["max_us"]), short_ms(whole["cpu_us"]),
                     short_ms(whole["cpu_p99_us"]), f"{whole['allocations']:.0f}", f"{whole['bytes'] / 1024:.0f}"))
    return table(("beams", "objects", "detected", "threads", "p50, ms", "p99, ms", "max, ms", "CPU, ms",
                  "its p99, ms", "allocations", "KiB"), rows)


def elements_table(results):
    rows = []
    for elements in ELEMENTS:
        line = results.of(elements=elements)
        whole = line["whole"]
        rows.append((f"{line['elements']:.0f}", short_ms(whole["p50_us"]), short_ms(whole["p99_us"]),
                     short_ms(whole["cpu_us"]), f"{whole['allocations']:.0f}",
                     *(f"{stage['cpu_p50_us']:.0f}" for stage in line["stages"].values())))
    return table(("elements", "p50, ms", "p99, ms", "CPU, ms", "allocations",
                  *(f"{name}, µs of CPU" for name in results.of()["stages"])), rows)


def stages_table(results):
    twelve, sixty = results.of(), results.of(objects=60)
    rows = [(name, *(text for line in (twelve, sixty) for text in (
        f"{line['stages'][name]['p50_us']:.1f}", f"{line['stages'][name]['p99_us']:.1f}",
        f"{line['stages'][name]['max_us']:.0f}", f"{line['stages'][name]['cpu_us']:.1f}",
        f"{line['stages'][name]['allocations']:.1f}"))) for name in twelve["stages"]]
    rows.append(("**whole**", *(text for line in (twelve, sixty) for text in (
        f"{line['whole']['p50_us']:.1f}", f"{line['whole']['p99_us']:.1f}", f"{line['whole']['max_us']:.0f}",
        f"{line['whole']['cpu_us']:.1f}", f"{line['whole']['allocations']:.1f}"))))
    return table(("µs per scan", *(f"{what}, {n}" for n in (12, 60) for what in
                                   ("p50", "p99", "max", "CPU", "allocations"))), rows)


def limits_table(results, machine):
    rows, sums = [], {12: 0.0, 60: 0.0}
    lines = {objects: results.of(objects=objects) for objects in sums}
    works = {objects: speed_limits.of_stages(line) for objects, line in lines.items()}
    for name in works[12]:
        row = [name]
        for objects, line in lines.items():
            limit_us = works[objects][name].limit_us(machine)
            sums[objects] += limit_us
            row += limit_cells(works[objects][name], limit_us, line["stages"][name]["cpu_p50_us"])
        rows.append(row)
    total = {objects: sum(work.values(), speed_limits.Work(0, 0)) for objects, work in works.items()}
    rows.append(["**whole**", *(text for objects, line in lines.items() for text in limit_cells(
        total[objects], sums[objects], line["whole"]["cpu_p50_us"]))])
    return table(("", *(f"{what}, {n}" for n in sums for what in
                        ("operations", "KiB", "limit, µs", "taken, µs", "times"))), rows)


def limit_cells(work, limit_us, taken_us):
    return (f"{work.operations:,.0f}", f"{work.bytes / 1024:,.0f}", f"{limit_us:.2f}", f"{taken_us:.1f}",
            f"{taken_us / limit_us:.0f}")


def networks_table(results):
    rows = []
    for objects in (12, 60):
        found = results.of(objects=objects, networks=True)["networks"]
        rows.append((str(objects), *(f"{found[name]:.1f}" for name in (
            "vgg_forward_us", "vgg_batched_us", "vgg_detector_us", "detector_us", "whole_us")),
            f"**{found['vgg_forward_to_detector']:.0f}**", f"**{found['vgg_forward_to_whole']:.0f}**"))
    return table(("objects", "VGG-Net, one by one", "VGG-Net, in one batch", "detector `vgg`", "detector `network`",
                  "whole pipeline", "VGG / detector", "VGG / pipeline"), rows)


def ratio_text(ratio):
    return "from none" if math.isinf(ratio) else f"{ratio:.2f}"


def ratios_table(results):
    names = ("p50_us", "cpu_us", "cpu_p99_us", "allocations")
    rows = []
    middle = {name: statistics.median(ratios[name] for ratios in results.ratios.values()) for name in names}
    rows.append(("**median of all**", "", "", "", *(ratio_text(middle[name]) for name in names), ""))
    for of, ratios in results.ratios.items():
        beams, objects, threads, elements, rate_hz, networks = of
        if networks:
            continue
        rows.append((str(beams), str(objects), str(threads) + (f", at {rate_hz} Hz" if rate_hz else ""), str(elements),
                     *(ratio_text(ratios[name]) for name in names),
                     ", ".join(f"{name} {ratio_text(ratio)}" for name, ratio in ratios["stages"].items())))
    return table(("beams", "objects", "threads", "elements besides", "p50", "CPU", "its p99", "allocations",
                  "stages, CPU"), rows)


# --- pictures


def color_of(stage):
    return COLORS.get(stage, OTHER)


def draw_growth(results, path):
    """CPU time of whole and stages on logarithmic axes, where linear growth has the slope of the dotted line."""
    figure, axes = pyplot.subplots(1, len(GROWTH), figsize=(17, 5.6), layout="constrained", sharey=True)
    for ax, what in zip(axes, GROWTH):
        values, found = growth(results, what)
        for stage in found[0]["stages"]:
            ax.plot(values, [line["stages"][stage]["cpu_p50_us"] / 1000 for line in found], "o-", color=color_of(stage),
                    lw=1.3, ms=3.5)
        p50 = [line["whole"]["cpu_p50_us"] / 1000 for line in found]
        p99 = [line["whole"]["cpu_p99_us"] / 1000 for line in found]
        ax.plot(values, p50, "o-", color=WHOLE, lw=2.4, ms=6, zorder=4)
        ax.plot(values, p99, "o--", color=WHOLE, lw=1.4, ms=4, zorder=4)
        ax.plot((values[0], values[-1]), (p50[-1] * values[0] / values[-1], p50[-1]), ":", color="black", lw=1.2,
                zorder=5)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xticks(values, [f"{value:,.0f}" for value in values])
        ax.minorticks_off()
        ax.set_xlabel(what)
        clean(ax)
    axes[0].set_ylabel("CPU time, ms per scan")
    axes[0].set_ylim(bottom=5e-4)
    handles = [pyplot.Line2D([], [], color=WHOLE, lw=2.4, marker="o", label="whole, p50"),
               pyplot.Line2D([], [], color=WHOLE, lw=1.4, ls="--", marker="o", ms=4, label="whole, p99"),
               pyplot.Line2D([], [], color="black", lw=1.2, ls=":", label="slope 1: linear")]
    handles += [pyplot.Line2D([], [], color=color_of(stage), lw=1.3, marker="o", ms=3.5, label=stage)
                for stage in results.of()["stages"]]
    save(figure, path, handles, ncol=6)


def draw_stages(results, path):
    """Where the time goes, and the time per segment beside the paper's network."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(14, 4.6), layout="constrained", width_ratios=(1.3, 1))
    for i, objects in enumerate(OBJECTS):
        line, start = results.of(objects=objects), 0.0
        total = sum(stage["cpu_p50_us"] for stage in line["stages"].values())
        for name, stage in line["stages"].items():
            part = stage["cpu_p50_us"] / total
            left.barh(i, part, left=start, color=color_of(name), height=0.65)
            if part > 0.07:
                left.text(start + part / 2, i, f"{name}\n{stage['cpu_p50_us']:.0f}", ha="center", va="center",
                          fontsize=8)
            start += part
        left.text(1.01, i, f"{total / 1000:.2f} ms", va="center", fontsize=9)
    left.set_yticks(range(len(OBJECTS)), [f"{n} object{'s' * (n > 1)}" for n in OBJECTS])
    left.invert_yaxis()
    left.set_xlim(0, 1.0)
    left.set_xticks([])
    left.spines[:].set_visible(False)
    left.legend(handles=[pyplot.Rectangle((0, 0), 1, 1, color=color_of(stage), label=stage)
                         for stage in results.of()["stages"]],
                ncol=len(results.of()["stages"]), loc="upper center", bbox_to_anchor=(0.5, 0.0), frameon=False,
                fontsize=8, handlelength=1.0, columnspacing=1.0)
    left.set_title(f"CPU time of the stages in µs, p50, {USUAL_BEAMS} beams", fontsize=10)

    found = results.of(networks=True)["networks"]
    bars = (("VGG-Net by Keras, measured before", 1000.0 * PAPERS_MS_PER_SEGMENT, "0.75"),
            ("VGG-Net, full forward", found["vgg_forward_us"], OTHER),
            ("VGG-Net, full forward, in one batch", found["vgg_batched_us"], OTHER),
            ("whole pipeline, scan to map", found["whole_us"], WHOLE), ("detector `network`", found["detector_us"],
                                                                  COLORS["detect"]))
    for i, (label, time_us, color) in enumerate(bars):
        right.barh(i, time_us, color=color, height=0.65)
        right.text(time_us * 1.1, i, f"{time_us:,.0f}" if time_us > 100 else f"{time_us:.1f}", va="center", fontsize=9)
    right.set_yticks(range(len(bars)), [label for label, _, _ in bars])
    right.invert_yaxis()
    right.set_xscale("log")
    right.set_xlim(1.0, 3e5)
    right.set_xlabel("CPU time, µs per segment")
    right.set_title(f"per segment, {USUAL_OBJECTS} objects", fontsize=10)
    right.spines[["top", "right"]].set_visible(False)
    save(figure, path)


# --- report


INTRODUCTION = """
Synthetic scans, one behind the other, through the whole core from scan to map with the shipped `cfg/objects.yaml`: no
ROS, no messages. A robot hovers and sways in a walled room, in a ring of ellipses of which half move and none occludes
another ([synthetic_scene.hpp](../../benchmark/synthetic_scene.hpp)); 270 degrees, 1 cm of noise, a sweep of 19 ms.
{scans} scans each after {warm_up} to warm up; every figure is the median of {rounds} rounds. "whole" is
`ObjectPipeline::process`; the stages are timed on the same scans in the same run, and the tool fails unless both give
bit for bit the same map. With one thread everything runs on one core (`taskset`). Recorded scans are timed by
`objects_bag`.
"""
WHOLE_TEXT = """
"detected" is the mean number of objects with a detection in a scan: with few beams narrow objects have too few hits.
With two threads two pipelines run at once, each with its own scans. At {rate} Hz there is a pause between the scans, as
with a scanner, and caches are cold. CPU is the mean CPU time of the thread: time taken by other programs is in p99 and
max, but not in CPU and its p99. The picture shows CPU time. Allocations and KiB are heap allocations, OpenCV's
included.
"""
ELEMENTS_TEXT = """
The map also has elements of other rooms: {objects} objects are in sight, the
rest is out of sight.
"""
NETWORKS_TEXT = """
Median CPU time in µs per segment, in turns on the same segments: the paper's VGG-Net by OpenCV dnn in full, one segment
at a time as the papers did and all segments of a scan in one batch; the two detectors with pre- and post-processing;
and the whole pipeline from scan to map, divided by its segments. Keras, as used in the papers, took {papers} ms per
segment in an earlier measurement.
"""
LIMITS_TEXT = """
What the machine can do: in this run one core made {operations:,.0f} multiplications and additions of double precision
and moved {bytes:,.0f} bytes to or from its caches in each µs
([machine_benchmark](../../benchmark/machine_benchmark.cpp)). The limit is the longer of both for the operations and
bytes that the equations ask for, counted in [speed_limits.py](../../scripts/evaluation/speed_limits.py): every number
in a vector register, no decision, nothing looked for. A product and a sum of the networks in single precision are one
operation. "taken" is the median of the CPU time, for 12 objects and for 60.
"""
RATIOS_TEXT = """
This build / the older build `{baseline}`, both in this run and in turns: medians of the ratios of the rounds. Below 1
is faster.
"""


def report_of(arguments, results, maps, limits_us, machine, measured):
    parts = ["# Time from scan to map\n", introduction(measured, INTRODUCTION.format(
        scans=arguments.scans, warm_up=1200, rounds=arguments.rounds))]
    if not arguments.full:
        parts.append("**A quick look**: fewer scans or rounds than are published.\n")
    picture = lambda name, text: f"![{text}](images/{name})\n"
    parts.append(targets_section([*targets(results), *ratio_targets(results), *speed_of_maps.targets(maps)]))
    parts.append(section("Where the time goes", picture("speed_stages.png", "Stages, and time per segment"),
                         stages_table(results)))
    parts.append(section("Beside what the machine can do", prose(LIMITS_TEXT.format(
        operations=machine["operations_per_us"], bytes=machine["bytes_per_us"])), limits_table(results, machine)))
    parts.append(section("How it grows", picture("speed_growth.png", "Cost against objects, beams and elements"),
                         prose(WHOLE_TEXT.format(rate=RATE_HZ)), whole_table(results)))
    parts.append(section("A large map", prose(ELEMENTS_TEXT.format(objects=USUAL_OBJECTS)),
                         elements_table(results)))
    parts.append(speed_of_maps.report_section(maps, limits_us, arguments.baseline, picture(
        "speed_maps.png", "Cost of each map against what grows")))
    parts.append(section("Beside the paper's network",
                         prose(NETWORKS_TEXT.format(papers=PAPERS_MS_PER_SEGMENT)), networks_table(results)))
    if results.ratios:
        parts.append(section("Against an older build", prose(RATIOS_TEXT.format(baseline=arguments.baseline)),
                             ratios_table(results)))
    return "\n".join(parts)


def at_least_one(text):
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "a quick look")
    parser.add_argument("--tool", required=True)
    parser.add_argument("--programs", required=True, type=pathlib.Path, help="folder of the build")
    parser.add_argument("--baseline", metavar="COMMIT", help="an older one, to be built and run in turns with this one")
    parser.add_argument("--rounds", type=at_least_one, default=ROUNDS)
    parser.add_argument("--scans", type=at_least_one, default=SCANS)
    parser.add_argument("--core", type=int, default=0, help="that runs what has one thread (default 0)")
    arguments = parser.parse_args()
    arguments.full = arguments.rounds >= ROUNDS and arguments.scans >= SCANS
    output = output_folder(arguments, arguments.full)
    images = images_folder(output)

    arguments.builds = [Build(arguments.programs / "benchmark", arguments.programs / "benchmark")]
    if arguments.baseline:
        # roslaunch finds launch files in folders not hidden.
        older = speed_of_maps.built_of(arguments.baseline, ROOT / "build/.older" / arguments.baseline)
        arguments.builds.append(Build(older / "benchmark", older / "growth"))
    measured = {**facts(arguments), "scans": arguments.scans, "rounds": arguments.rounds}
    machine = speed_limits.rates(arguments.programs / "benchmark/machine_benchmark", arguments.core)
    results = Results(run_all(arguments))
    maps, limits_us = speed_of_maps.run_all([build.of_maps for build in arguments.builds], arguments.rounds,
                                            arguments.core, machine)
    speed_of_maps.draw(maps, images / "speed_maps.png")
    draw_growth(results, images / "speed_growth.png")
    draw_stages(results, images / "speed_stages.png")
    head = ",\n".join(f"{json.dumps(name)}: {json.dumps(value)}"
                      for name, value in {**measured, "one_core": rounded(machine)}.items())
    cases_text, maps_text = (",\n".join(json.dumps(line) for line in lines) for lines in (
        results.json(), map(rounded, speed_of_maps.figures(maps, limits_us))))
    (output / "speed_baseline.json").write_text(
        f"{{\n{head},\n\"cases\": [\n{cases_text}\n],\n\"maps\": [\n{maps_text}\n]}}\n")
    write(output, "speed.md", report_of(arguments, results, maps, limits_us, machine, measured))
    print(f"wrote {output / 'speed_baseline.json'}")


if __name__ == "__main__":
    main()
