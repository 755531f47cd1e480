# SPDX-License-Identifier: BSD-3-Clause
"""A day of simulated scans with random faults, and the tests of faults that cannot be part of a day
(docs/reliability.md). Run by scripts/evaluate."""

import json
import os
import pathlib
import shlex
import socket
import subprocess
import sys
import time

import fault_tables
from report import (ROOT, arguments_parser, facts, introduction, output_folder, print_progress, prose, section, table,
                    targets_section, write)

HOURS = 12.0
FAULT_EVERY_S = 15.0
MOST_UNTIL_BACK_S = 2.0
WARM_UP_HOURS = 1.0
MAX_GROWTH_BYTES = 5_000_000
LEFT_OUT_TIMES = 200  # of the fault that is not part of a day
# Those that say what a fault does (test/ros/fault_record.py, test/support/fault_cell.hpp).
TESTS = ("^ros/(faults|master_restart|mission_processes|gps_ins|reflector_localization|semantic_map|path|path_crash|"
         "path_processes|circumnavigate|grid_mapping|scout|inertial_semantic_map|wrong_stamps)_test$|^ros/inertial_navigation_gtest$|"
         "^(path/(safety_faults|circumnavigation|scouting)|pipeline/wrong_stamp)_test$")


# --- running


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def progress(blocks, begin, hours):
    print_progress(blocks[-1]["part"], begin, f"{blocks[-1]['hours']:.1f} of {hours:g} h of scans, "
                   f"{blocks[-1]['faults']:,} faults, {blocks[-1]['failures']} without the expected outcome")


def run_faults(words, folder, name, hours):
    """Runs fault_day with these arguments: (blocks, result, seconds)"""
    port = free_port()
    out = folder / f"{name}.jsonl"
    out.unlink(missing_ok=True)
    environment = dict(os.environ, ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1",
                       ROS_HOME=str(folder / "ros_home"))
    words = ["--out", str(out), "--fault-every-s", str(FAULT_EVERY_S), *words]
    begin, blocks, result = time.monotonic(), [], None
    with open(folder / f"{name}.log", "wb") as log:
        process = subprocess.Popen([str(ROOT / "devel/env.sh"), "roslaunch", "-p", str(port),
                                    str(ROOT / "test/ros/fault_day.launch"), f"args:={shlex.join(words)}"],
                                   env=environment, stdout=log, stderr=subprocess.STDOUT)
        read = 0
        while result is None:
            ended = process.poll() is not None
            lines = out.read_text().splitlines(keepends=True) if out.exists() else []
            for line in lines[read:]:
                if not line.endswith("\n"):
                    break
                read += 1
                value = json.loads(line)
                if "pid" in value:
                    blocks.append(value)
                    progress(blocks, begin, hours)
                else:
                    result = value
            if ended and result is None:
                sys.exit(f"it ended early: see {folder / f'{name}.log'}")
            time.sleep(1.0)
        process.wait()
    print()
    return blocks, result, time.monotonic() - begin


def run_tests(folder):
    """The tests' records of the faults that they inject: (faults with separate tests, cells of tables). Suites *Long say
    no others."""
    results = folder / "faults.jsonl"
    results.unlink(missing_ok=True)
    subprocess.run(["ctest", "--test-dir", str(ROOT / "build"), "-R", TESTS, "--output-on-failure"], check=False,
                   env=dict(os.environ, SITUATION_AWARENESS_FAULTS=str(results), GTEST_FILTER="-*Long.*:*Long/*"),
                   stdout=subprocess.DEVNULL)
    lines = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    return [line for line in lines if "how" in line], [line for line in lines if "stage" in line]


# --- numbers


def quantile(values, part):
    """Of sorted values."""
    return values[min(int(part * (len(values) - 1) + 0.5), len(values) - 1)] if values else None


def growth_bytes(blocks):
    """Of the process that lived longest: from the end of its first hour to the largest after it."""
    lives = {}
    for block in blocks:
        lives.setdefault(block["pid"], []).append(block)
    longest = max(lives.values(), key=lambda life: life[-1]["hours"] - life[0]["hours"])
    warm = [block for block in longest if block["hours"] - longest[0]["hours"] >= WARM_UP_HOURS]
    if not warm:
        return None, longest
    return max(block["resident_bytes"] for block in warm) - warm[0]["resident_bytes"], longest


def targets(blocks, result, tests, cells):
    """(sentence, figure, met)"""
    faults = [fault for fault in result["faults"] if fault["count"]]
    count = sum(fault["count"] for fault in faults)
    failures = sum(len(fault["failures"]) for fault in faults)
    back = sorted(value for fault in faults for value in fault["back_s"])
    yield ("the map is back within 2 s after every fault", f"{back[-1]:.2f} s at most, {len(back):,} of {count:,} seen",
           len(back) == count and back[-1] <= MOST_UNTIL_BACK_S)
    yield ("every fault has its expected outcome", f"{failures} of {count:,} deviations", failures == 0)
    yield ("every scan is mapped or counted as dropped, by its reason",
           f"{len(result['accounts'])} of {result['settled']} accounts do not balance", not result["accounts"])
    growth, life = growth_bytes(blocks)
    if growth is not None:
        hours = life[-1]["hours"] - life[0]["hours"]
        yield (f"memory of the nodelets' process grows by less than {MAX_GROWTH_BYTES / 1e6:g} MB after an hour",
               f"{growth / 1e6:.2f} MB, over the {hours:.1f} h of the process that lived longest",
               growth < MAX_GROWTH_BYTES)
    passed = sum(test["passed"] for test in tests)
    yield ("every fault with a separate test has its expected outcome", f"{passed} of {len(tests)}",
           bool(tests) and passed == len(tests))
    yield from fault_tables.targets(cells)


# --- tables


def seconds(value):
    return "" if value is None else f"{value:.2f}"


def day_table(result):
    rows = []
    for fault in result["faults"]:
        if not fault["count"]:
            continue
        back = fault["back_s"]
        wrong = len(fault["failures"])
        rows.append((fault["name"], fault["how"], fault["must"], f"{fault['count']:,}", f"{fault['sent']:,}",
                     f"{fault['mapped']:,}", str(fault["other_ids"]), seconds(quantile(back, 0.99)),
                     seconds(back[-1] if back else None), f"**{wrong} not**" if wrong else "always"))
    return table(("fault", "how it is injected", "expected outcome", "times", "scans", "maps", "other ids after",
                  "back after, p99, s", "max, s", "as expected"), rows)


def death_table(result):
    rows = [(fault["name"], str(fault["count"]), *(seconds(quantile(fault["down_s"], part)) for part in (0.5, 1.0)))
            for fault in result["faults"] if fault["down_s"]]
    return table(("fault", "times", "without a map, p50, s", "max, s"), rows) if rows else ""


def left_out(result):
    """The fault that is not part of a day."""
    return next(fault for fault in result["faults"] if not fault["in_day"])


def limit_table(result):
    fault = left_out(result)
    back = fault["back_s"]
    within = sum(value <= MOST_UNTIL_BACK_S for value in back)
    return table(("fault", "how it is injected", "times", "back within 2 s", "back after, p50, s", "p90, s",
                  "not before the next"),
                 [(fault["name"], fault["how"], str(fault["count"]), f"{within} times", seconds(quantile(back, 0.5)),
                   seconds(quantile(back, 0.9)), f"{fault['count'] - len(back)} times")])


def failures_list(result):
    lines = [f"- {fault['name']}, {failure}" for fault in result["faults"] for failure in fault["failures"]]
    lines += [f"- accounts, {failure}" for failure in result["accounts"]]
    return "\n".join(lines[:50]) + "\n" if lines else "Nothing.\n"


def test_table(tests):
    return table(("test", "fault", "how it is injected", "expected outcome", "times", "as expected"),
                 [(f"`ros/{test['test']}`", test["fault"], test["how"], test["must"], str(test["times"]),
                   "yes" if test["passed"] else "**no**") for test in tests])


INTRODUCTION = """
{sent:,} scans, {hours:g} simulated hours at 20 Hz of their stamps, through the nodelets as `launch/map.launch`
starts them, in {minutes:.0f} minutes; faults of {kinds} kinds, and none for comparison, one every {every:g} s on
average, in random order and at random times, seed {seed}. `scripts/evaluate reliability` writes this page.
"""
DAY = """
Scans are of a walled room with 12 ellipses, half of them moving, 1081 beams with noise and a robot that sways
([synthetic_scene.hpp](../benchmark/synthetic_scene.hpp)); the room changes whenever time is reset. They are sent in
lock-step with the map, at most 3 unprocessed, with `/clock` and TF. The map is *back* when each of the 12 objects is on
it exactly once, within 15 cm of the truth, without false elements, and every position's standard deviation is at most
the 0.24 m of `max_position_sigma_m`; and when this holds until the next fault, at least 4 s later. *Back after* is the
time, by stamps, from the last scan of the fault to the first such map; after a reset of time, from the first scan of
the new time; where a process dies, from the last scan before it, while scans are sent at 20 Hz of wall time, so that it
includes the respawn. Scans that are not mapped are dropped and counted by reason: every ten minutes the stages' counts
of received, processed and dropped messages are compared with the scans sent. Ids are compared for all 12 objects:
*other ids after* counts the faults after which an id had changed. Moving objects accelerate by up to 0.74 m/s², nearly
twice `acceleration_sigma_m_s2`: unseen for half a second, one may not be re-identified, so ids must be kept only where
fewer than ten scans in a row are lost. The faults are listed in [faults.cpp](../test/ros/fault_day/faults.cpp); CI
injects each twice and kills processes once (`ros/fault_day_test`).
"""
DEATHS = """
The time without a map, in wall time; it is part of *back after*. `respawn_delay` is 0.5 s, as shipped. Processes are
killed only in the last quarter of the day, so that the memory of one process can be measured over the first three.
"""
LIMITS = """
One fault is not part of the day, since in some runs the map is not back within 2 s: where beams falsely report free
space, an object is seen with holes, its pieces become elements, and one of them may remain beside it for a while. Here
it is injected alone, every {every:g} s on average; if the map was not back before the next fault, this counts for that
one, too.
"""
TESTED = """
Faults that cannot be part of a day, and those of localisation (`reflector_localization_test`), of the pose by GPS and INS
(`gps_ins_test`), of the one map (`semantic_map_test`), of safety areas and path following (`path_test`), of the
mission around unknown obstacles (`circumnavigate_test`), of the semantic grid (`grid_mapping_test`) and of scouting
(`scout_test`); each has a test that runs in CI.
"""
INPUTS = """
What a stage that moves a vehicle, or lets it move, does where a fault is in one of its inputs while it drives or flies.
Each cell is a test that runs in CI, in the core where it can be, else live; "–" is where an input cannot have the
fault. *Frozen* is an input that repeats its last values with new stamps; *killed* and *restarted* are of the program
that sends it.
"""
STAMPS = """
What one message of a recording whose stamp is wrong by so much does to the final map or pose, against the same recording
without that message.
"""


def report_of(blocks, result, tests, cells, limit, measured):
    verdicts = list(targets(blocks, result, tests, cells))
    kinds = sum(fault["count"] > 0 for fault in result["faults"]) - 1  # without "no fault"
    return "\n".join((
        "# Fault injection\n",
        introduction(measured, INTRODUCTION.format(sent=result["sent"], hours=measured["hours"],
                                                   minutes=measured["minutes"], kinds=kinds, every=FAULT_EVERY_S,
                                                   seed=measured["seed"])),
        targets_section(verdicts),
        section("A day", prose(DAY), day_table(result)),
        section("Processes that die", prose(DEATHS), death_table(result)),
        section("Violations", failures_list(result)),
        section("Faults with separate tests", prose(TESTED), test_table(tests)),
        section("Inputs against faults", prose(INPUTS)), *fault_tables.input_tables(cells),
        section("One wrong stamp", prose(STAMPS), fault_tables.stamp_table(cells)),
        section("A fault with longer recovery", prose(LIMITS.format(every=FAULT_EVERY_S)), limit_table(limit)))), \
        all(met for _, _, met in verdicts)


def main():
    parser = arguments_parser(__doc__, "docs", "fewer hours")
    parser.add_argument("--hours", type=float, default=HOURS, help=f"of scans (default {HOURS:g})")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    folder = ROOT / "build/evaluation/reliability"
    folder.mkdir(parents=True, exist_ok=True)
    output = output_folder(arguments, arguments.hours >= HOURS)

    measured = {**facts(arguments), "hours": arguments.hours, "seed": arguments.seed}
    seed = ["--seed", str(arguments.seed)]
    blocks, result, took_s = run_faults(["--hours", str(arguments.hours), *seed], folder, "day", arguments.hours)
    only = ["--only", left_out(result)["name"], "--rounds", str(LEFT_OUT_TIMES)]
    _, limit, _ = run_faults([*only, *seed], folder, "limit", LEFT_OUT_TIMES * FAULT_EVERY_S / 3600)
    tests, cells = run_tests(folder)
    report, kept = report_of(blocks, result, tests, cells, limit, {**measured, "minutes": took_s / 60})
    write(output, "reliability.md", report)
    sys.exit(0 if kept else 1)


if __name__ == "__main__":
    main()
