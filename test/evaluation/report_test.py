#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What the reports of scripts/evaluate share: printed tables, command line, and what a part of the runs may overwrite."""
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/evaluation"))
import printed  # noqa: E402
import report  # noqa: E402


class PrintedTest(unittest.TestCase):
    def test_tables_of_the_ellipse_paper(self):
        tables = printed.map_tables("ellipse")
        self.assertEqual({name: len(rows) for name, rows in tables.items()},
                         {"table_6": 8, "table_7": 6, "table_8": 5, "table_9": 3})
        self.assertTrue(all(len(errors) == 10 for rows in tables.values() for errors in rows.values()))
        baseline = (2.7868e-04, 0.0488, 1.8034e-04, 0.0343, 3.3412e-04, 0.0647, 4.7924e-04, 0.0443, 8.0020, 9.0519)
        for table, row in (("table_6", "45"), ("table_7", "0.35"), ("table_8", "2"), ("table_9", "1")):
            self.assertEqual(tables[table][row], baseline, table)  # one experiment, printed four times

    def test_tables_of_the_circle_paper(self):
        tables = printed.map_tables("circle")
        self.assertEqual({name: len(rows) for name, rows in tables.items()}, {"table_4": 5, "table_5": 5})
        self.assertTrue(all(len(errors) == 6 for rows in tables.values() for errors in rows.values()))
        self.assertEqual(tables["table_4"]["0.3"], tables["table_5"]["2"])

    def test_detectors(self):
        ellipse = printed.detector_errors("ellipse")
        self.assertEqual(set(ellipse), {"vgg", "alex", "dogleg", "ransac"})
        self.assertEqual(ellipse["ransac"], {"loss": 0.37044})
        circle = printed.detector_errors("circle")["circle"]
        self.assertAlmostEqual(circle["mse"], circle["loss"] / 3, places=6)  # eq. 7: the sum over three parameters

    def test_the_best_of_the_peers(self):
        self.assertEqual(printed.best_of_peers(), {
            "recall": 1.00, "false_per_scan": 0.02, "center_standing_m": 0.092, "center_moving_m": 0.092,
            "velocity_standing_m_s": 0.00, "velocity_moving_m_s": 0.34, "semi_axes_m": 0.048})

    def test_every_table_says_its_source(self):
        for path in printed.DATA.iterdir():
            self.assertRegex(path.read_text(), r"(?m)^# Sources?: ", path.name)


class ReportTest(unittest.TestCase):
    def setUp(self):
        self.argv = sys.argv
        self.addCleanup(lambda: setattr(sys, "argv", self.argv))

    def arguments(self, *words):
        sys.argv = ["scripts/evaluation/speed.py", *words]
        parser = report.arguments_parser("", "docs/benchmarks", "a quick look")
        parser.add_argument("--tool")
        parser.add_argument("--baseline")
        return parser.parse_args()

    def test_a_part_of_the_runs_does_not_go_where_the_published_report_is(self):
        root = report.ROOT
        self.addCleanup(lambda: setattr(report, "ROOT", root))
        with tempfile.TemporaryDirectory() as folder:
            report.ROOT = pathlib.Path(folder)
            arguments = self.arguments()
            self.assertEqual(report.output_folder(arguments), pathlib.Path(folder) / "docs/benchmarks")
            self.assertEqual(report.output_folder(arguments, False), pathlib.Path(folder) / "build/evaluation/speed")
            asked = pathlib.Path(folder) / "asked"
            self.assertEqual(report.output_folder(self.arguments("--output", str(asked)), False), asked)

    def test_the_command_is_the_users(self):
        arguments = self.arguments("--tool", "build/speed", "--baseline", "/home/me/old")
        self.assertEqual(report.facts(arguments, {"--baseline": "abc123"})["command"],
                         "scripts/evaluate speed --baseline abc123")

    def test_targets_are_counted(self):
        text = report.targets_section([("a", "1", True), ("b", "2", False), ("c", "3", True)])
        self.assertTrue(text.startswith("## Targets: 2 of 3 met\n"))
        self.assertIn("| b | 2 | **no** |", text)

    def test_pieces_keep_their_keys(self):
        pieces = {i: (i, 2) for i in range(20)}
        self.assertEqual(report.run_pieces(pow, pieces, "squares"), {i: i * i for i in range(20)})

    def test_a_failing_piece_fails_the_run(self):
        with self.assertRaises(ZeroDivisionError):
            report.run_pieces(lambda i: 1 // i, {i: (i,) for i in range(3)}, "quotients")


if __name__ == "__main__":
    unittest.main(verbosity=2)
