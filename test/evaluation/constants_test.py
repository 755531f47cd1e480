#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/evaluate constants: which constants it finds, and the sources in which they can be changed."""
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/evaluation"))
import constants  # noqa: E402

SOURCE = """\
/// m. First. Second.
constexpr double kWidth_m = 0.5;
constexpr int kCount = 3;
const double kLog = std::log(4.0);
constexpr int kAxis = 6;
const int known = 1 + kCount;
"""


class ConstantsTest(unittest.TestCase):
    def test_the_maps_constants(self):
        found = {constant.name: constant for constant in constants.constants()}
        self.assertEqual(len(found), len(list(constants.constants())), "one name, two constants")
        self.assertIn("kSurelyMoving", found)
        self.assertFalse(set(found) & set(constants.LEFT_OUT))
        for constant in found.values():
            self.assertTrue(constant.meaning, constant.name)
            self.assertNotIn(constant.number, constant.varied().values(), constant.name)
        defined = {match[2] for path in constants.sources()
                   for match in constants.DEFINITION.finditer(path.read_text())}
        self.assertEqual(set(constants.LEFT_OUT) - defined, set())

    def test_unit_meaning_and_values(self):
        def constant(name, kind, value, comment):
            return constants.Constant(name, kind, value, "", comment)

        width = constant("kWidth_m", "double", "0.5", "m. First, of 1.5 m. Second.")
        self.assertEqual((width.unit, width.meaning), ("m", "First, of 1.5 m"))
        self.assertEqual(set(width.varied().values()), {0.25, 1.0})
        log = constant("kLog", "double", "std::log(4.0)", "Text.")
        self.assertEqual((log.unit, log.meaning, log.number), ("", "Text", math.log(4.0)))
        self.assertEqual(set(constant("kCount", "int", "3", "Text.").varied().values()), {2, 6})
        sure = constant("kSurelyMoving", "double", "0.95", "Probability. Text.")
        self.assertEqual((sure.unit, set(sure.varied().values())), ("probability", {0.975, 0.9}))

    def test_the_environment_overrides_constants_alone(self):
        text = constants.overridable(SOURCE)
        for line in ("constexpr int kAxis = 6;", "const int known = 1 + kCount;"):
            self.assertIn(line, text)
        program = ("#include <cmath>\n#include <cstdio>\n" + text
                   + 'int main() { std::printf("%g %d %g %d", kWidth_m, kCount, kLog, kAxis); }\n')
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder)
            (path / "main.cpp").write_text(program)
            subprocess.run(["c++", "-std=c++17", path / "main.cpp", "-o", path / "main"], check=True)

            def printed(**environment):
                return subprocess.run([path / "main"], env={**os.environ, **environment}, check=True,
                                      stdout=subprocess.PIPE, text=True).stdout

            self.assertEqual(printed(), "0.5 3 1.38629 6")
            self.assertEqual(printed(SITUATION_AWARENESS_kWidth_m="0.25"), "0.25 3 1.38629 6")
            self.assertEqual(printed(SITUATION_AWARENESS_kCount="6"), "0.5 6 1.38629 6")

    def test_a_file_without_constants_stays_as_it_is(self):
        self.assertEqual(constants.overridable("int f() { return 1; }\n"), "int f() { return 1; }\n")


if __name__ == "__main__":
    unittest.main(verbosity=2)
