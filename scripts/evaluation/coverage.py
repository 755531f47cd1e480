#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The core's line coverage (docs/benchmarks/coverage.md) from what gcovr --json says: by folder, and every run of lines
that no test reaches."""
import collections
import datetime
import itertools
import json
import pathlib
import sys

from report import ROOT, commit, machine, prose

SHOWN = 40  # runs of lines that are named


def runs(lines):
    """First and last of each run of lines without coverage; lines without code between them do not end one."""
    for covered, group in itertools.groupby(lines, key=lambda line: line["count"] > 0):
        if not covered:
            group = list(group)
            yield group[0]["line_number"], group[-1]["line_number"], len(group)


def main():
    files = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))["files"]
    folders = collections.defaultdict(lambda: [0, 0])
    missed = []
    for file in files:
        lines = {}  # a header's lines come once for each template and program: covered where any of them is
        for line in file["lines"]:
            if line.get("gcovr/noncode"):
                continue
            known = lines.setdefault(line["line_number"], {"line_number": line["line_number"], "count": 0})
            known["count"] = max(known["count"], line["count"])
        lines = [lines[number] for number in sorted(lines)]
        parts = pathlib.Path(file["file"]).parts
        folder = folders[parts[2] if parts[0] == "include" else parts[1]]
        folder[0] += sum(line["count"] > 0 for line in lines)
        folder[1] += len(lines)
        missed += [(count, file["file"], first, last) for first, last, count in runs(lines)]
    covered, total = (sum(folder[i] for folder in folders.values()) for i in (0, 1))
    missed.sort(key=lambda entry: (-entry[0], entry[1:]))

    figure = f"{100.0 * covered / total:.1f} % of the core's {total} lines ({total - covered} are not run by a test)"
    text = ["# Coverage of the core", "",
            prose(f"`scripts/coverage` on {datetime.date.today()}, commit {commit()}, {machine()}: the core's own gtests, "
                  f"without ROS and simulator, run {figure}."), "| folder | lines | run |", "|---|---|---|"]
    for name, (run, lines) in sorted(folders.items()):
        text.append(f"| {name} | {lines} | {100.0 * run / lines:.1f} % |")
    text += ["", f"## The longest pieces that no test runs ({min(SHOWN, len(missed))} of {len(missed)})", "",
             "| file | lines | of code |", "|---|---|---|"]
    for count, name, first, last in missed[:SHOWN]:
        text.append(f"| {name} | {first}{f' to {last}' if last > first else ''} | {count} |")
    (ROOT / "docs/benchmarks/coverage.md").write_text("\n".join(text) + "\n", encoding="utf-8")
    print(f"coverage: {figure}: docs/benchmarks/coverage.md")


if __name__ == "__main__":
    main()
