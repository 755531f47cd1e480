# SPDX-License-Identifier: BSD-3-Clause
"""The papers' synthetic data sets: ellipses (ellipse paper, Sect. IV-C) and circles (circle paper, Sect. IV-B).

One sample is one ellipse seen alone by the papers' LIDAR: its hits and its five parameters. Samples are drawn on the
fly, so that none is seen twice.
"""

from dataclasses import dataclass

import numpy as np

BEAMS = 1081
RESOLUTION_RAD = np.radians(0.25)
FIRST_AZIMUTH_RAD = np.radians(-135.0)
MIN_RANGE_M, MAX_RANGE_M = 0.1, 10.0
MIN_RADIUS_M, MAX_RADIUS_M = 0.05, 0.5
RANGE_SIGMA_M = 0.01
MIN_HITS = 5
CIRCLE_MIN_HITS = 4
CIRCLE_STEP_M = 0.05  # of the circles' radii and centres


@dataclass
class Samples:
    """`n` segments; the hits of all are one after the other in `ranges_m`, by increasing azimuth."""

    ellipses: np.ndarray  # n x 5: t_x, t_y, psi, rx, ry in the sensor frame
    first_beam: np.ndarray  # n: beam of the first hit
    counts: np.ndarray  # n: hits
    first_hit: np.ndarray  # n: index of the first hit in ranges_m
    ranges_m: np.ndarray

    def __len__(self):
        return len(self.counts)


def _draw_ellipses(random, n):
    """Centres uniform over the disc; radii and axis as printed."""
    distance = MAX_RANGE_M * np.sqrt(random.random(n))
    bearing = random.uniform(FIRST_AZIMUTH_RAD, -FIRST_AZIMUTH_RAD, n)
    psi = random.uniform(-np.pi / 2, np.pi / 2, n)
    rx = random.uniform(MIN_RADIUS_M, MAX_RADIUS_M, n)
    ry = MIN_RADIUS_M + random.random(n) * (rx - MIN_RADIUS_M)
    return np.stack((distance * np.cos(bearing), distance * np.sin(bearing), psi, rx, ry), axis=1)


def _draw_circles(random, n):
    """Radii 0.05, 0.1 ... 0.5 m, centres on a grid of 0.05 m over the whole range."""
    radius = CIRCLE_STEP_M * random.integers(1, 11, n)
    reach = round(MAX_RANGE_M / CIRCLE_STEP_M)
    center = CIRCLE_STEP_M * random.integers(-reach, reach + 1, (n, 2))
    return np.column_stack((center, np.zeros(n), radius, radius))


def _tangent_azimuths(ellipses):
    """First and last azimuth of the beams that hit each ellipse; NaN where the sensor is inside it.

    Scaled along its axes the ellipse is the unit circle, whose tangents from a point are known; the scaling maps them
    to tangents.
    """
    t_x, t_y, psi, rx, ry = ellipses.T
    cos, sin = np.cos(psi), np.sin(psi)
    center_x, center_y = (cos * t_x + sin * t_y) / rx, (cos * t_y - sin * t_x) / ry
    distance = np.hypot(center_x, center_y)
    half_angle = np.arcsin(1 / np.where(distance > 1, distance, np.nan))
    bearing = np.arctan2(t_y, t_x)
    tangents = []
    for sign in (-1, 1):
        scaled = np.arctan2(center_y, center_x) + sign * half_angle
        own_x, own_y = rx * np.cos(scaled), ry * np.sin(scaled)
        azimuth = np.arctan2(sin * own_x + cos * own_y, cos * own_x - sin * own_y)
        tangents.append(bearing + np.remainder(azimuth - bearing + np.pi, 2 * np.pi) - np.pi)
    return tangents


def _inside_range(ellipses):
    """Whole ellipses between the range limits: the farthest and nearest points, found among 64 on the curve."""
    t_x, t_y, psi, rx, ry = (column[:, None] for column in ellipses.T)
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    own_x, own_y = rx * np.cos(angle), ry * np.sin(angle)
    cos, sin = np.cos(psi), np.sin(psi)
    distance = np.hypot(t_x + cos * own_x - sin * own_y, t_y + sin * own_x + cos * own_y)
    return (distance.max(axis=1) < MAX_RANGE_M) & (distance.min(axis=1) > MIN_RANGE_M)


def _ranges(ellipses, azimuth_rad):
    """Noiseless distance of the near crossing of each beam with its ellipse; rows of both belong together."""
    t_x, t_y, psi, rx, ry = ellipses.T
    cos, sin = np.cos(psi), np.sin(psi)
    center_x, center_y = (cos * t_x + sin * t_y) / rx, (cos * t_y - sin * t_x) / ry
    ray_x, ray_y = np.cos(azimuth_rad - psi) / rx, np.sin(azimuth_rad - psi) / ry
    a = ray_x**2 + ray_y**2
    b = ray_x * center_x + ray_y * center_y
    c = center_x**2 + center_y**2 - 1
    return (b - np.sqrt(np.maximum(b**2 - a * c, 0.0))) / a


def sample_ellipses(random, n):
    """Draw n ellipses with the numpy Generator `random`."""
    return _sample(random, n, _draw_ellipses, MIN_HITS)


def sample_circles(random, n):
    """Draw n circles: any of the circle paper's, each as likely as the other."""
    return _sample(random, n, _draw_circles, CIRCLE_MIN_HITS)


def _sample(random, n, draw, min_hits):
    parts, missing = [], n
    while missing > 0:
        ellipses = draw(random, 2 * missing + 64)
        ellipses = ellipses[_inside_range(ellipses)]
        low, high = _tangent_azimuths(ellipses)
        first = np.ceil((low - FIRST_AZIMUTH_RAD) / RESOLUTION_RAD)
        last = np.floor((high - FIRST_AZIMUTH_RAD) / RESOLUTION_RAD)
        whole = (low >= FIRST_AZIMUTH_RAD) & (high <= -FIRST_AZIMUTH_RAD) & (last - first + 1 >= min_hits)
        kept = np.flatnonzero(whole)[:missing]
        parts.append((ellipses[kept], first[kept].astype(int), last[kept].astype(int)))
        missing -= len(kept)
    ellipses, first, last = (np.concatenate(column) for column in zip(*parts))

    counts = last - first + 1
    first_hit = np.cumsum(counts) - counts
    beam = np.arange(counts.sum()) - np.repeat(first_hit - first, counts)
    azimuth = FIRST_AZIMUTH_RAD + beam * RESOLUTION_RAD
    ranges = _ranges(np.repeat(ellipses, counts, axis=0), azimuth) + random.normal(0.0, RANGE_SIGMA_M, len(beam))
    return Samples(ellipses, first, counts, first_hit, ranges)
