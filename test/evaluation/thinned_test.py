#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/evaluate thinned: its measures of maps that are known."""
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/evaluation"))
import polygons  # noqa: E402
import thinned  # noqa: E402


def samples_of(*lines):
    chains = [{"id": k, "closed": False, "points": points, "sigma_m": [0.01] * len(points)}
              for k, points in enumerate(lines)]
    return polygons.samples_of(polygons.chains_of({"polylines": chains}), thinned.SAMPLE_M)


def look(pose, ranges_m):
    azimuth = np.linspace(-0.5, 0.5, len(ranges_m))
    return thinned.Scan(0.0, np.array(ranges_m, float), azimuth, np.array(pose, float))


class Doubled(unittest.TestCase):
    WALL = [[0.0, 0.0], [2.0, 0.0]]  # its free side is at y > 0

    def part(self, *others):
        samples = samples_of(self.WALL, *others)
        return samples.length_m[thinned.doubled(samples)].sum()

    def test_is_what_is_behind_another_that_faces_the_same_way(self):
        self.assertEqual(self.part(), 0.0)
        self.assertAlmostEqual(self.part([[0.5, 0.06], [1.5, 0.06]]), 1.0, delta=0.05)

    def test_is_neither_the_back_nor_the_continuation_nor_what_is_far(self):
        self.assertEqual(self.part([[1.5, 0.06], [0.5, 0.06]]), 0.0)
        self.assertEqual(self.part([[2.02, 0.0], [3.0, 0.0]]), 0.0)
        self.assertEqual(self.part([[0.5, 0.15], [1.5, 0.15]]), 0.0)


class Hits(unittest.TestCase):
    def test_count_where_three_scans_hit(self):
        scans = [look((0.0, 0.0, 0.0), [1.0, 2.02, np.inf]), look((0.0, 0.0, 0.0), [1.5, 2.02, 3.0]),
                 look((0.0, 0.0, 0.0), [2.5, 2.02, np.inf])]
        self.assertEqual(thinned.often_hit(scans).tolist(), [[2.02, 0.0]] * 3)

    def test_are_where_the_scanner_was(self):
        scan = look((1.0, 2.0, 0.5 * np.pi), [np.inf, 3.0, np.inf])
        np.testing.assert_allclose(scan.hits(), [[1.0, 5.0]], atol=1e-9)


class Free(unittest.TestCase):
    def test_is_what_the_last_looks_went_through(self):
        before, after = look((0.0, 0.0, 0.0), [2.0] * 11), look((0.0, 0.0, 0.0), [4.0] * 11)
        place = np.array([[2.0, 0.0]])
        self.assertFalse(thinned.seen_free(place, [after] * 9 + [before] * 5)[0])
        self.assertTrue(thinned.seen_free(place, [before] * 9 + [after] * 5)[0])

    def test_is_not_what_is_hidden_or_out_of_view(self):
        scans = [look((0.0, 0.0, 0.0), [1.0] * 11)] * 9
        self.assertFalse(thinned.seen_free(np.array([[2.0, 0.0], [-2.0, 0.0]]), scans).any())


if __name__ == "__main__":
    unittest.main()
