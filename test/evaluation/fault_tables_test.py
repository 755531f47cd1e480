#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The tables of faults: a cell without a test, or with one that fails, is seen in the page and misses a target."""
import json
import os
import pathlib
import re
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/evaluation"))
sys.path.insert(0, str(ROOT / "test/ros"))
import fault_record  # noqa: E402
import fault_tables  # noqa: E402
import reliability  # noqa: E402


def cells(leave_out=None, failing=None):
    return [{"stage": stage, "input": name, "fault": fault, "does": "stands", "test": "a_test",
             "passed": (stage, name, fault) != failing}
            for stage, name, fault in fault_tables.expected_cells() if (stage, name, fault) != leave_out]


def text(lines):
    return "\n".join((*fault_tables.input_tables(lines), fault_tables.stamp_table(lines)))


class FaultTablesTest(unittest.TestCase):
    def test_all_cells(self):
        self.assertEqual([met for _, _, met in fault_tables.targets(cells())], [True, True])
        self.assertNotIn("**", text(cells()))
        self.assertEqual(text(cells()).count("stands"), len(list(fault_tables.expected_cells())))

    def test_a_cell_without_a_test(self):
        for place in (("safety_areas", "scan", "frozen"), ("grid", "image", "stamp +5 s")):
            some = cells(leave_out=place)
            self.assertEqual([met for _, _, met in fault_tables.targets(some)], [False, True])
            self.assertEqual(text(some).count("**no test**"), 1)

    def test_a_cell_whose_test_fails(self):
        some = cells(failing=("scout", "targets", "NaN"))
        self.assertEqual([met for _, _, met in fault_tables.targets(some)], [True, False])
        self.assertEqual(text(some).count("**not so:** stands"), 1)

    def test_no_test_at_all(self):
        self.assertEqual([met for _, _, met in fault_tables.targets([])], [False, False])

    def test_a_test_says_its_cell(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "faults.jsonl")
            os.environ["SITUATION_AWARENESS_FAULTS"] = str(path)
            try:
                with fault_record.cell("scout", "targets", "NaN", "flies on"):
                    pass
                with self.assertRaises(AssertionError), fault_record.cell("scout", "grid", "NaN", "flies on"):
                    self.fail()
            finally:
                del os.environ["SITUATION_AWARENESS_FAULTS"]
            lines = [json.loads(line) for line in path.read_text().splitlines()]
        self.assertEqual([(line["input"], line["passed"]) for line in lines], [("targets", True), ("grid", False)])
        self.assertEqual({line["test"] for line in lines}, {"fault_tables_test"})

    def test_all_tests_that_say_one_are_run(self):
        """By their names of ctest, and each name is of such a test."""
        names = set()
        for path in (ROOT / "test").glob("*/*_test.*"):
            of_python = path.suffix == ".py" and path.parent.name == "ros"
            says = r"^from (fault_record|process_faults) import" if of_python else r"\bFaultCell \w+\("
            if re.search(says, path.read_text(), re.MULTILINE) and path.suffix in (".py", ".cpp"):
                stem = path.stem if of_python or path.parent.name != "ros" else path.stem.replace("_test", "_gtest")
                names.add(f"{path.parent.name}/{stem}")
        self.assertGreater(len(names), 15)
        self.assertEqual([name for name in sorted(names) if not re.search(reliability.TESTS, name)], [])
        every = re.findall(r"\w+", re.sub(r"\b(ros|path|pipeline)/|_g?test\b", " ", reliability.TESTS))
        said = {re.sub(r"_g?test$", "", name.split("/")[1]) for name in names}
        self.assertEqual(sorted(set(every) - said), [])


if __name__ == "__main__":
    unittest.main()
