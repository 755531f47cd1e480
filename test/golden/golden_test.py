#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Golden replay: the map of each stored bag must be the one in the table beside it.

    test/golden/golden_test.py [--accept]      in the environment of the devel space (docs/testing.md)

Prints what differs and exits with 1; with --accept it also rewrites the tables. A table has the elements of the map
twice a second, and whenever one appears or disappears.
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
SIGMAS = ("sigma_x", "sigma_y", "sigma_vx", "sigma_vy", "sigma_psi", "sigma_wz", "sigma_rx", "sigma_ry")
FIELDS = ("x", "y", "psi", "rx", "ry", "vx", "vy", "wz") + SIGMAS + ("beams",)
UNITS = dict(x="m", y="m", psi="rad", rx="m", ry="m", vx="m/s", vy="m/s", wz="rad/s", sigma_x="m", sigma_y="m",
             sigma_vx="m/s", sigma_vy="m/s", sigma_psi="rad", sigma_wz="rad/s", sigma_rx="m", sigma_ry="m", beams="")
DECIMALS = 6
PERIOD_S = 0.5
# Processors round the network's sums differently (docs/testing.md, "Golden replay"): this much is no change. Of an
# angle, it is what this much at the ends of the axes makes.
TOLERANCE = 5e-6
MOST_ROWS = 40


def replay(bag):
    """The map after each scan, as objects_bag writes it."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "map.jsonl"
        subprocess.run(["rosrun", "situation_awareness", "objects_bag", str(bag), "--out", str(out)], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=300)
        return [json.loads(line) for line in out.read_text().splitlines()]


def rows_of(maps):
    """{(stamp, id): values}; a map without elements has one row, of id 0 and no values."""
    rows = {}
    ids_before, period_before = None, None
    for line in maps:
        ids = [element["id"] for element in line["objects"]]
        period = math.floor(line["stamp"] / PERIOD_S + 1e-6)
        if ids != ids_before or period != period_before:
            stamp = f"{line['stamp']:.3f}"
            if not ids:
                rows[stamp, 0] = ()
            for element in line["objects"]:
                numbers = [element[name] for name in FIELDS[:8]] + element["sigma"]
                rows[stamp, element["id"]] = tuple(round(x, DECIMALS) + 0.0 for x in numbers) + (element["beams"],)
        ids_before, period_before = ids, period
    return rows


def write_table(path, rows):
    header = " ".join(f"{name}[{UNITS[name]}]" if UNITS[name] else name for name in FIELDS)
    lines = [f"# The map of {path.stem}.bag. A change is accepted by scripts/accept_golden.",
             f"# stamp[s] id {header}"]
    for (stamp, element), values in rows.items():
        numbers = [f"{value:.{DECIMALS}f}" for value in values[:-1]] + [str(value) for value in values[-1:]]
        lines.append(" ".join([stamp, str(element), *numbers]))
    path.write_text("\n".join(lines) + "\n")


def read_table(path):
    rows = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        if line.startswith("#"):
            continue
        stamp, element, *numbers = line.split()
        rows[stamp, int(element)] = tuple(float(number) for number in numbers[:-1]) + tuple(map(int, numbers[-1:]))
    return rows


def tolerance_of(name, before, after):
    if name == "beams":
        return 0.5
    if name in ("psi", "sigma_psi"):
        rx, ry = (min(values[FIELDS.index(radius)] for values in (before, after)) for radius in ("rx", "ry"))
        return TOLERANCE / max(rx - ry, TOLERANCE)
    return TOLERANCE


def differences(before, after):
    """(stamp, id, field, before, after, difference) of what is not the same."""
    found = []
    for key in sorted(set(before) | set(after), key=lambda key: (float(key[0]), key[1])):
        if key not in before or key not in after:
            there = ("nothing" if key[1] == 0 else "there", "-")
            found.append((*key, "element", *(there if key in before else there[::-1]), None))
            continue
        for name, old, new in zip(FIELDS, before[key], after[key]):
            difference = new - old
            if name == "psi":  # the axis of an ellipse is the same after half a turn
                difference = math.remainder(difference, math.pi)
            if not abs(difference) <= tolerance_of(name, before[key], after[key]):
                found.append((*key, name, old, new, difference))
    return found


def print_differences(scene, found, rows):
    print(f"{scene}: {len(found)} numbers differ in {len({key[:2] for key in found})} of {rows} rows")
    print(f"  {'stamp':>9} {'id':>4} {'field':<10} {'before':>12} {'after':>12} {'difference':>12}")
    text = (lambda value: value if isinstance(value, str) else f"{value:.{DECIMALS}f}")
    for stamp, element, name, old, new, difference in found[:MOST_ROWS]:
        change = "" if difference is None else f"{difference:+.{DECIMALS}f}"
        print(f"  {stamp:>9} {element:>4} {name:<10} {text(old):>12} {text(new):>12} {change:>12}")
    if len(found) > MOST_ROWS:
        print(f"  ... and {len(found) - MOST_ROWS} more")
    print("  largest per field:")
    for name in ("element", *FIELDS):
        of_field = [row for row in found if row[2] == name]
        if not of_field:
            continue
        largest = max(of_field, key=lambda row: abs(row[5] or 0.0))
        change = "" if largest[5] is None else f" {largest[5]:+.{DECIMALS}f} {UNITS[name]}"
        print(f"    {name:<10} {len(of_field):>5} changes{change} (id {largest[1]} at {largest[0]})")


def main():
    if sys.argv[1:] not in ([], ["--accept"]):
        sys.exit(__doc__)
    accept = "--accept" in sys.argv
    bags = sorted(HERE.glob("*.bag"))
    if not bags:
        sys.exit(f"no bag in {HERE}")
    changed = False
    for bag in bags:
        table = bag.with_suffix(".txt")
        before, after = read_table(table), rows_of(replay(bag))
        found = differences(before, after)
        if found:
            changed = True
            print_differences(bag.stem, found, len(set(before) | set(after)))
        else:
            print(f"{bag.stem}: {len(after)} rows as before")
        if accept and found:
            write_table(table, after)
    if changed and accept:
        print("accepted: test/golden/*.txt are rewritten; commit them with the reason")
    elif changed:
        print("If this is meant: scripts/accept_golden, and commit the tables with the reason.")
    return 1 if changed and not accept else 0


if __name__ == "__main__":
    sys.exit(main())
