# SPDX-License-Identifier: BSD-3-Clause
"""Cost of each kind of map as what it has to do grows (docs/benchmarks/speed.md): runs the benchmarks of the maps, and
those of an older commit in turns with them. Part of speed.py."""

import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import time

from pictures import clean, pyplot, save
from report import ROOT, print_progress, prose, section, table
from speed_limits import (CELL, COMPARED_PAIR, CORRIDOR_BEAMS, FLIGHT_BEAMS, FUSED_HIT, HALL_BEAMS, MISSED_ELEMENT,
                          POLYLINES_TO_MAP, REFLECTOR, SCAN_TO_POLYLINES, SPLINEGON_ELEMENT, SPLINEGON_ELEMENTS,
                          STREET_BEAMS, UPDATED_ELEMENT)

PROGRAMS = ("object_map_benchmark", "polygon_map_benchmark", "polygon_growth_benchmark", "splinegon_benchmark",
            "grid_growth_benchmark", "reflector_search_benchmark")
# In one round: an older build takes minutes for one, and each figure is a median over many scans, images or halls.
ONCE = ("street", "lanes", "first_pose")
NEW, OLD = "#0b6e4f", "#999999"


class Growth:
    """What is measured at each of some points: `pattern` finds the point in the name of a benchmark, the value is its
    CPU time or a counter; or in the name of a counter of `benchmark`."""

    def __init__(self, map_, what, program, benchmark, pattern, counter=None, unit="µs", most=None, most_of_older=None,
                 work=None):
        """`most`: of the last point's value, as a factor on the first's. `most_of_older`: {point: ratio to the older
        commit's value}. `work`: of the last point, by that and the counters there (speed_limits.py)."""
        self.map, self.what, self.program, self.benchmark = map_, what, program, benchmark
        self.pattern, self.counter, self.unit, self.most = re.compile(pattern), counter, unit, most
        self.most_of_older, self.work = most_of_older or {}, work

    def _own(self, lines):
        return [line for line in lines if line["name"].split("/")[0] == self.benchmark.split("/")[0]
                and self.benchmark in line["name"]]

    def limit_us(self, lines, machine):
        """Of the last point; None: there is none."""
        if self.work is None:
            return None
        return self.work(list(self.points(lines))[-1], self._own(lines)[-1]).limit_us(machine)

    def points(self, lines):
        """{point: value} of the lines of a run of the program."""
        found = {}
        for line in self._own(lines):
            if match := self.pattern.search(line["name"]):
                found[int(match.group(1))] = line[self.counter] if self.counter else line["cpu_time"]
            for name, value in line.items():
                if match := self.pattern.fullmatch(name):
                    found[int(match.group(1))] = value
        return dict(sorted(found.items()))


ARGUMENT = r"^\w+/(\d+)/"


def work_of_splinegon(_, __):
    return FLIGHT_BEAMS * (SCAN_TO_POLYLINES + FUSED_HIT) + SPLINEGON_ELEMENTS * SPLINEGON_ELEMENT


GROWTHS = (
    Growth("objects", "elements at rest elsewhere, 13 in view", "object_map_benchmark", "by_elements_at_rest", ARGUMENT,
           most=1.5, most_of_older={3000: 0.1}, work=lambda n, of: 13 * UPDATED_ELEMENT),
    Growth("objects", "detections in each scan that match nothing", "object_map_benchmark", "clutter", ARGUMENT,
           most_of_older={60: 0.1},
           work=lambda n, of: n * (COMPARED_PAIR + UPDATED_ELEMENT) + of["elements"] * MISSED_ELEMENT),
    Growth("objects", "elements in view, 200 detections", "object_map_benchmark", "by_elements", ARGUMENT,
           work=lambda n, of: 200 * (COMPARED_PAIR + UPDATED_ELEMENT) + (n - 200) * MISSED_ELEMENT),
    Growth("objects", "detections, 1,000 elements in view", "object_map_benchmark", "by_detections", ARGUMENT,
           work=lambda n, of: n * (COMPARED_PAIR + UPDATED_ELEMENT) + (1000 - n) * MISSED_ELEMENT),
    Growth("polygons", "chains, 40 in view", "polygon_map_benchmark", "from_scan_to_map", ARGUMENT, most=1.2,
           work=lambda n, of: CORRIDOR_BEAMS * (SCAN_TO_POLYLINES + POLYLINES_TO_MAP)),
    Growth("polygons", "kilometres of a street", "polygon_growth_benchmark", "street", r"km_(\d+)_us", most=1.2,
           work=lambda n, of: STREET_BEAMS * POLYLINES_TO_MAP),
    Growth("polygons", "drives along a street, memory of each km", "polygon_growth_benchmark", "street",
           r"street/iterations:(\d+)", "kib_per_km", unit="KiB", most_of_older={1: 0.5}),
    Growth("polygons", "m of a hall, all of it in view", "polygon_growth_benchmark", "hall", r"hall/(\d+)/", "p50_us",
           most_of_older={24: 0.5}, work=lambda n, of: HALL_BEAMS * POLYLINES_TO_MAP),
    Growth("splinegons", "minutes around a building and six movers", "splinegon_benchmark",
           "by_inertial_navigation/movers", r"minute_(\d+)_us", most=1.2, most_of_older={6: 0.5},
           work=work_of_splinegon),
    Growth("splinegons", "minutes around an ellipse", "splinegon_benchmark", "by_inertial_navigation/ellipse",
           r"minute_(\d+)_us", most=1.2, most_of_older={6: 0.5}, work=work_of_splinegon),
    Growth("grid", "pixels along the edge of the labels", "grid_growth_benchmark", "orbit", ARGUMENT, "update_us",
           most_of_older={56: 0.3, 224: 0.4}, work=lambda n, of: of["cells"] * CELL),
    Growth("grid", "lanes of 1.8 km", "grid_growth_benchmark", "lanes", r"lane_(\d+)_us", most=1.2),
    Growth("grid", "lanes of 1.8 km, memory", "grid_growth_benchmark", "lanes", r"lane_(\d+)_MB", unit="MB", most=2.0),
    Growth("reflectors", "reflectors on the map, first pose", "reflector_search_benchmark", "first_pose", ARGUMENT,
           "p50_us", most_of_older={1000: 0.01}, work=lambda n, of: n * REFLECTOR),
)


# --- running


def built_of(commit, folder):
    """The folder of an older commit's programs: its own pipeline_speed, and the benchmarks of this tree with its
    libraries. They are built once."""
    source, build = folder / "source", folder / "build"
    if not source.exists():
        source.mkdir(parents=True)
        archive = subprocess.run(["git", "-C", ROOT, "archive", commit], check=True, stdout=subprocess.PIPE).stdout
        subprocess.run(["tar", "-x", "-C", source], check=True, input=archive)
        lines = [f'add_library(growth_support STATIC "{ROOT}/test/support/random_gaussian.cpp")',
                 "situation_awareness_target(growth_support)",
                 f'target_include_directories(growth_support PUBLIC "{ROOT}/benchmark" "{ROOT}/test")',
                 "target_link_libraries(growth_support PUBLIC ${PROJECT_NAME}_core)"]
        for program in PROGRAMS:
            target = f"growth_{program}"
            lines += [f'add_executable({target} "{ROOT}/benchmark/{program}.cpp")',
                      f"situation_awareness_target({target})",
                      f'target_compile_definitions({target} PRIVATE SITUATION_AWARENESS_SOURCE_DIR="{source}")',
                      f"target_link_libraries({target} PRIVATE growth_support ${{PROJECT_NAME}}_evaluation "
                      "benchmark::benchmark_main)",
                      f"set_target_properties({target} PROPERTIES OUTPUT_NAME {program} "
                      "RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/growth)"]
        with open(source / "benchmark/CMakeLists.txt", "a", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")
    subprocess.run(["cmake", "-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON",
                    "-DSITUATION_AWARENESS_ROS=OFF", "-DSITUATION_AWARENESS_SIM=OFF", "-DSITUATION_AWARENESS_TESTS=OFF",
                    "-DSITUATION_AWARENESS_BENCHMARKS=ON"], check=True, stdout=subprocess.DEVNULL)
    targets = ["pipeline_speed", *(f"growth_{program}" for program in PROGRAMS)]
    subprocess.run(["cmake", "--build", build, "--parallel", str(os.cpu_count()), "--target", *targets], check=True,
                   stdout=subprocess.DEVNULL)
    return build


def run(folder, program, benchmark, core):
    """The lines of a run of one of the program's benchmarks."""
    command = ["taskset", "-c", str(core), folder / program, "--benchmark_format=json",
               f"--benchmark_filter=^{benchmark}(/|$)"]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)["benchmarks"]


def run_all(folders, rounds, core, machine):
    """{growth: [{point: value} of each round] of each folder}, the builds in turns; and {growth: limit in µs of the
    first folder's last point, None where there is none}."""
    results, begin = {growth: [[] for _ in folders] for growth in GROWTHS}, time.monotonic()
    limits_us = {}
    benchmarks = list(dict.fromkeys((growth.program, growth.benchmark) for growth in GROWTHS))
    of_rounds = [[of for of in benchmarks if round_ == 0 or of[1] not in ONCE] for round_ in range(rounds)]
    done, total = 0, sum(map(len, of_rounds))
    for round_, of_round in enumerate(of_rounds):
        for program, benchmark in of_round:
            order = range(len(folders)) if round_ % 2 == 0 else reversed(range(len(folders)))
            for i in order:
                lines = run(folders[i], program, benchmark, core)
                for growth in GROWTHS:
                    if (growth.program, growth.benchmark) == (program, benchmark):
                        results[growth][i].append(growth.points(lines))
                        if i == 0:
                            limits_us[growth] = growth.limit_us(lines, machine)
            done += 1
            print_progress(done / total, begin, f"{done} of {total} runs of maps")
    print()
    return results, limits_us


# --- figures


def medians(rounds):
    return {point: statistics.median(one[point] for one in rounds) for point in rounds[0]}


def growth_of(rounds):
    """The last point's value against the first's, the median of the rounds."""
    return statistics.median(list(one.values())[-1] / list(one.values())[0] for one in rounds)


def ratios(rounds):
    """{point: new / old}, each within its round; medians."""
    new, old = rounds
    return {point: statistics.median(a[point] / b[point] for a, b in zip(new, old)) for point in new[0]}


def targets(results):
    """(sentence, figure, met)"""
    for growth, rounds in results.items():
        name = f"{growth.map}, {growth.what}"
        if growth.most is not None:
            points, factor = list(rounds[0][0]), growth_of(rounds[0])
            yield (f"{name}: {points[-1]:,} take at most {growth.most} times what {points[0]:,} take", f"{factor:.2f}",
                   factor <= growth.most)
        if len(rounds) == 2:
            found = ratios(rounds)
            for point, most in growth.most_of_older.items():
                yield (f"{name}: {point:,} take at most {most} times what they took in the older build",
                       f"{found[point]:.3f}", found[point] <= most)


def figures(results, limits_us):
    """For the file with all figures."""
    return [{"map": growth.map, "what": growth.what, "unit": growth.unit, "values": medians(rounds[0]),
             **({"limit_of_last": limits_us[growth]} if limits_us[growth] else {}),
             **({"ratios_to_baseline": ratios(rounds)} if len(rounds) == 2 else {})}
            for growth, rounds in results.items()]


def number(value):
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"


def limit_text(limit_us, taken_us):
    return f"{number(limit_us)}, taken {number(taken_us / limit_us)} times" if limit_us else ""


def growth_table(results, limits_us):
    with_older = len(next(iter(results.values()))) == 2
    rows = []
    for growth, rounds in results.items():
        values = medians(rounds[0])
        cells = [growth.map, growth.what, ", ".join(f"{point:,}: {number(value)}" for point, value in values.items()),
                 growth.unit, f"{growth_of(rounds[0]):.2f}" if len(values) > 1 else "",
                 limit_text(limits_us[growth], list(values.values())[-1])]
        if with_older:
            cells += [f"{growth_of(rounds[1]):.2f}" if len(values) > 1 else "",
                      ", ".join(f"{point:,}: {number(ratio)}" for point, ratio in ratios(rounds).items())]
        rows.append(cells)
    header = ("map", "of what there are more", "cost", "unit", "last / first", "limit of the last")
    return table((*header, "the older build's", "ratio to it") if with_older else header, rows)


def draw(results, path):
    """Each cost against what grows."""
    growths = [growth for growth in results if len(results[growth][0][0]) > 1]
    columns = 4
    figure, axes = pyplot.subplots(math.ceil(len(growths) / columns), columns, figsize=(16, 9.5), layout="constrained")
    for ax in axes.flat[len(growths):]:
        ax.remove()
    for ax, growth in zip(axes.flat, growths):
        for rounds, color, width in reversed(list(zip(results[growth], (NEW, OLD), (2.4, 1.6)))):
            values = medians(rounds)
            scale = 1.0 if growth.unit == "MB" else 1e-3
            ax.plot(values.keys(), [scale * value for value in values.values()], "o-", color=color, lw=width, ms=4.5)
        ax.set_ylim(bottom=0.0)
        ax.set_xlabel(growth.what)
        ax.set_title(f"{growth.map}, {'MB' if growth.unit == 'MB' else 'ms of CPU'}", fontsize=10)
        clean(ax)
    with_older = len(results[growths[0]]) == 2
    handles = [pyplot.Line2D([], [], color=NEW, lw=2.4, marker="o", label="this build")]
    handles += [pyplot.Line2D([], [], color=OLD, lw=1.6, marker="o", label="the older build")] * with_older
    save(figure, path, handles)


TEXT = """
Processor's time of one thread for one scan (grid: one image; reflectors: until the first pose is known), each kind of
map alone, as what is on the map, in view, or in the past grows:
[object_map_benchmark](../../benchmark/object_map_benchmark.cpp),
[polygon_map_benchmark](../../benchmark/polygon_map_benchmark.cpp),
[polygon_growth_benchmark](../../benchmark/polygon_growth_benchmark.cpp),
[splinegon_benchmark](../../benchmark/splinegon_benchmark.cpp),
[grid_growth_benchmark](../../benchmark/grid_growth_benchmark.cpp) and
[reflector_search_benchmark](../../benchmark/reflector_search_benchmark.cpp), on one core; medians of the rounds, of
which one has kilometres, lanes and first poses. What does not grow is what a scan that sees the same has to cost. The
limit is that of the last point, as above.
"""
OLDER_TEXT = """
Below 1 in the last column is faster than `{older}`, whose libraries the same benchmarks were linked with; both ran in
turns.
"""


def report_section(results, limits_us, older, picture):
    text = prose(TEXT) + ("\n" + prose(OLDER_TEXT.format(older=older)) if older else "")
    return section("All maps", picture, text, growth_table(results, limits_us))
