#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Golden replay: the maps of each stored bag must be those in the tables beside it.

    test/golden/golden_test.py [--accept]      in the environment of the devel space (docs/testing.md)

Prints what differs and exits with 1; with --accept it also rewrites the tables. A table SCENE.KIND.txt has the elements
of the map of this kind (kinds.py) twice a second, and whenever one appears or disappears.
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile

from kinds import KINDS

HERE = pathlib.Path(__file__).resolve().parent
PERIOD_S = 0.5
MOST_ROWS = 40


def replay(bag, kind):
    """The map after each scan, as the tool of this kind writes it."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "map.jsonl"
        subprocess.run(["rosrun", "situation_awareness", kind.tool, str(bag), "--out", str(out), *kind.arguments], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=300)
        return [json.loads(line) for line in out.read_text().splitlines()]


def rows_of(maps, kind):
    """{(stamp, id): {field: value}}; a map without elements has one row, of id 0 and without fields."""
    rows = {}
    ids_before, period_before = None, None
    for line in maps:
        elements = kind.elements(line)
        period = math.floor(line["stamp"] / PERIOD_S + 1e-6)
        if list(elements) != ids_before or period != period_before:
            stamp = f"{line['stamp']:.3f}"
            for id_, values in (elements or {0: {}}).items():
                rows[stamp, id_] = values
        ids_before, period_before = list(elements), period
    return rows


def write_table(path, rows, kind):
    scene = path.name.split(".")[0]
    header = " ".join(f"{field.name}[{field.unit}]" if field.unit else field.name for field in kind.fields)
    lines = [f"# The map of {scene}.bag. A change is accepted by scripts/accept_golden.", f"# stamp[s] id {header}"]
    for (stamp, id_), values in rows.items():
        numbers = [field.text(values[field.name]) for field in kind.fields] if values else []
        lines.append(" ".join([stamp, str(id_), *numbers]))
    path.write_text("\n".join(lines) + "\n")


def read_table(path, kind):
    rows = {}
    for line in path.read_text().splitlines():
        if line.startswith("#"):
            continue
        stamp, id_, *numbers = line.split()
        rows[stamp, int(id_)] = {field.name: float(number) for field, number in zip(kind.fields, numbers)}
    return rows


def differences(before, after, kind):
    """(stamp, id, field, before, after, difference) of what is not the same."""
    found = []
    for key in sorted(set(before) | set(after), key=lambda key: (float(key[0]), key[1])):
        if key not in before or key not in after:
            there = ("nothing" if key[1] == 0 else "there", "-")
            found.append((*key, "element", *(there if key in before else there[::-1]), None))
            continue
        for field in kind.fields if before[key] and after[key] else ():
            difference = field.difference(before[key], after[key])
            if difference is not None:
                texts = (field.text(values[field.name]) for values in (before[key], after[key]))
                found.append((*key, field.name, *texts, difference))
    return found


def print_differences(name, found, rows, kind):
    print(f"{name}: {len(found)} numbers differ in {len({key[:2] for key in found})} of {rows} rows")
    print(f"  {'stamp':>9} {'id':>4} {'field':<10} {'before':>12} {'after':>12} {'difference':>12}")
    for stamp, id_, field, old, new, difference in found[:MOST_ROWS]:
        change = "" if difference is None else f"{difference:+.6f}"
        print(f"  {stamp:>9} {id_:>4} {field:<10} {old:>12} {new:>12} {change:>12}")
    if len(found) > MOST_ROWS:
        print(f"  ... and {len(found) - MOST_ROWS} more")
    print("  largest per field:")
    for field, unit in (("element", ""), *((field.name, field.unit) for field in kind.fields)):
        of_field = [row for row in found if row[2] == field]
        if not of_field:
            continue
        largest = max(of_field, key=lambda row: abs(row[5] or 0.0))
        change = "" if largest[5] is None else f" {largest[5]:+.6f} {unit}"
        print(f"    {field:<10} {len(of_field):>5} changes{change} (id {largest[1]} at {largest[0]})")


def main():
    if sys.argv[1:] not in ([], ["--accept"]):
        sys.exit(__doc__)
    accept = "--accept" in sys.argv
    tables = {kind: sorted(HERE.glob(f"*.{kind.name}.txt")) for kind in KINDS}
    for kind in KINDS:
        if not tables[kind]:
            sys.exit(f"no table of {kind.name} in {HERE}")
    changed = False
    for kind, table in ((kind, table) for kind in KINDS for table in tables[kind]):
        bag = table.with_name(table.name.split(".")[0] + ".bag")
        before, after = read_table(table, kind), rows_of(replay(bag, kind), kind)
        found = differences(before, after, kind)
        if found:
            changed = True
            print_differences(table.stem, found, len(set(before) | set(after)), kind)
        else:
            print(f"{table.stem}: {len(after)} rows as before")
        if accept and found:
            write_table(table, after, kind)
    if changed and accept:
        print("accepted: test/golden/*.txt are rewritten; commit them with the reason")
    elif changed:
        print("If this is meant: scripts/accept_golden, and commit the tables with the reason.")
    return 1 if changed and not accept else 0


if __name__ == "__main__":
    sys.exit(main())
