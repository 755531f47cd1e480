#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The comparison of golden_test.py, with a test kind of map: vertex chains."""
import math
import pathlib
import tempfile
import unittest

import golden_test
from kinds import KINDS, Field, Kind, member

CHAINS = Kind("chains", (
    Field("length", lambda chain: sum(math.dist(a, b) for a, b in zip(chain["vertices"], chain["vertices"][1:])), "m",
          decimals=3, tolerance=0.01),
    member("heading", "rad", period=2 * math.pi),
    member("vertex_count", decimals=0, tolerance=0.5)))


def line(stamp, *lengths, heading=0.1):
    return {"stamp": stamp, "chains": [{"id": 7 + i, "vertices": [[0, 0], [length, 0]], "heading": heading,
                                        "vertex_count": 2} for i, length in enumerate(lengths)]}


class TablesTest(unittest.TestCase):
    def rows(self, *lines):
        return golden_test.rows_of(lines, CHAINS)

    def fields(self, before, after):
        return [(row[1], row[2]) for row in golden_test.differences(before, after, CHAINS)]

    def test_a_row_is_there_twice_a_second_and_where_elements_change(self):
        rows = self.rows(line(0.0), line(0.1), line(0.2, 1.0), line(0.3, 1.1), line(0.5, 1.2), line(0.6, 1.3, 4.0))
        self.assertEqual([*rows], [("0.000", 0), ("0.200", 7), ("0.500", 7), ("0.600", 7), ("0.600", 8)])
        self.assertEqual(rows["0.000", 0], {})
        self.assertEqual(rows["0.600", 8], {"length": 4.0, "heading": 0.1, "vertex_count": 2.0})

    def test_a_table_is_read_as_it_was_written(self):
        rows = self.rows(line(0.0), line(0.5, 1.2345), line(1.0, 2.0, 3.0, heading=-1.0))
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "room.chains.txt"
            golden_test.write_table(path, rows, CHAINS)
            self.assertEqual(golden_test.read_table(path, CHAINS), rows)
            self.assertEqual(path.read_text().splitlines()[1:4],
                             ["# stamp[s] id length[m] heading[rad] vertex_count", "0.000 0",
                              "0.500 7 1.234 0.100000 2"])

    def test_differences_are_those_beyond_the_tolerance_of_the_field(self):
        before = self.rows(line(0.0, 1.0, 2.0))
        self.assertEqual(self.fields(before, self.rows(line(0.0, 1.009, 2.0))), [])
        self.assertEqual(self.fields(before, self.rows(line(0.0, 1.02, 2.0))), [(7, "length")])
        self.assertEqual(self.fields(before, self.rows(line(0.0, 1.0, 2.0, heading=0.1 + 2 * math.pi))), [])
        self.assertEqual(self.fields(before, self.rows(line(0.0, 1.0, 2.0, heading=0.2))),
                         [(7, "heading"), (8, "heading")])

    def test_elements_that_come_and_go_are_differences(self):
        before = self.rows(line(0.0, 1.0))
        self.assertEqual(self.fields(before, self.rows(line(0.0, 1.0, 2.0))), [(8, "element")])
        self.assertEqual(self.fields(before, self.rows(line(0.0))), [(0, "element"), (7, "element")])

    def test_every_kind_names_its_tool_and_fields_once(self):
        for kind in KINDS:
            names = [field.name for field in kind.fields]
            self.assertEqual(len(set(names)), len(names))
            self.assertEqual(kind.tool, kind.name + "_bag")


if __name__ == "__main__":
    unittest.main()
