#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Count the results of build folders' tests from their reports, and list the slowest.

    scripts/test_report.py BUILD_FOLDER...

Each folder has tests.xml (ctest --output-junit) and, for each gtest binary, test_reports/NAME.xml of its test cases. A
binary that failed without a failed case (a crash, a timeout, no report) is one failed test. The last line is
`N passed, N failed[, N skipped]`; exit code 1 if any failed or none ran.
"""
import collections
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

SLOWEST = 12


def gtest_cases(report):
    """passed, failed and skipped of a gtest report; None where there is none."""
    try:
        cases = list(ElementTree.parse(report).getroot().iter("testcase"))
    except (OSError, ElementTree.ParseError):
        return None
    counts = collections.Counter()
    for case in cases:
        if case.find("failure") is not None:
            counts["failed"] += 1
        elif case.get("status") == "notrun":
            continue  # disabled
        else:
            counts["skipped" if case.get("result") == "skipped" else "passed"] += 1
    return counts


def read(folder):
    """Counter of a folder's results, and (seconds, name) of each ctest."""
    counts, times = collections.Counter(), []
    for test in ElementTree.parse(folder / "tests.xml").getroot().iter("testcase"):
        name, status = test.get("name"), test.get("status")
        times.append((float(test.get("time") or 0.0), f"{folder}: {name}"))
        if status == "notrun":
            counts["skipped"] += 1
            continue
        cases = gtest_cases(folder / "test_reports" / f"{name}.xml")
        if cases is None:
            counts["passed" if status == "run" else "failed"] += 1
            continue
        if status != "run" and not cases["failed"]:
            cases["failed"] += 1
        counts += cases
    return counts, times


def main():
    total, times = collections.Counter(), []
    for folder in map(pathlib.Path, sys.argv[1:]):
        counts, folder_times = read(folder)
        total += counts
        times += folder_times
    print(f"The {SLOWEST} slowest of {len(times)} test programs, {sum(seconds for seconds, _ in times):.0f} s in all:")
    for seconds, name in sorted(times, reverse=True)[:SLOWEST]:
        print(f"{seconds:6.0f} s  {name}")
    print(f"{total['passed']} passed, {total['failed']} failed" +
          (f", {total['skipped']} skipped" if total["skipped"] else ""))
    return 1 if total["failed"] or not total["passed"] else 0


if __name__ == "__main__":
    sys.exit(main())
