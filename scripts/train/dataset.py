# SPDX-License-Identifier: BSD-3-Clause
"""The ellipse paper's synthetic data set (Sect. IV-C), in the frame the network works in (docs/math/detections.md).

One sample is one ellipse seen alone by the paper's LIDAR: its hits, its five parameters and the beam in the middle of
its segment. Samples are drawn on the fly, so that no two epochs see the same one.
"""

from dataclasses import dataclass

import numpy as np

BEAMS = 1081
MIDDLE = 540  # index of the network's input at which the middle point of every segment lies
RESOLUTION_RAD = np.radians(0.25)
FIRST_AZIMUTH_RAD = np.radians(-135.0)
MIN_RANGE_M, MAX_RANGE_M = 0.1, 10.0
MIN_RADIUS_M, MAX_RADIUS_M = 0.05, 0.5
RANGE_SIGMA_M = 0.01
MIN_HITS = 5
NEAREST_CENTER_M = 0.7  # of the near part of the training mix
DEVIATION_GAIN = 4.0  # amplifies the shape of the segment against its distance
RANGE_SCALE = 0.1


@dataclass
class Samples:
    """`n` segments; the hits of all of them lie one after the other in `ranges_m`, by growing azimuth."""

    ellipses: np.ndarray  # n x 5: t_x, t_y, psi, rx, ry in the sensor frame
    middle_azimuth_rad: np.ndarray  # n: azimuth of the point with index counts // 2 of the segment
    counts: np.ndarray  # n: hits
    first_hit: np.ndarray  # n: index of the first hit in ranges_m
    ranges_m: np.ndarray
    mean_range_m: np.ndarray  # n

    def __len__(self):
        return len(self.counts)

    def half_widths(self):
        """Beams from the middle of each segment to its farther end."""
        return self.counts // 2  # the middle point has counts // 2 hits before it and never more behind it

    def inputs(self, which, half_width):
        """The network's inputs of the samples `which`, cut to MIDDLE +- half_width: float32, len(which) x beams."""
        counts = self.counts[which]
        row = np.repeat(np.arange(len(which)), counts)
        beam = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        hit = np.repeat(self.first_hit[which], counts) + beam
        column = half_width + beam - np.repeat(counts // 2, counts)
        mean = np.repeat(self.mean_range_m[which], counts)
        window = np.zeros((len(which), 2 * half_width + 1), np.float32)
        window[row, column] = RANGE_SCALE * mean + DEVIATION_GAIN * (self.ranges_m[hit] - mean)
        return window

    def targets(self, which):
        """What the network shall answer, float32, len(which) x 5: t_x - r_mean, t_y, m, p, q in the segment's frame."""
        t_x, t_y, psi, rx, ry = self.ellipses[which].T
        azimuth = self.middle_azimuth_rad[which]
        cos, sin = np.cos(azimuth), np.sin(azimuth)
        half_difference = (rx - ry) / 2
        doubled = 2 * (psi - azimuth)
        columns = (
            cos * t_x + sin * t_y - self.mean_range_m[which],
            cos * t_y - sin * t_x,
            (rx + ry) / 2,
            half_difference * np.cos(doubled),
            half_difference * np.sin(doubled),
        )
        return np.stack(columns, axis=1).astype(np.float32)


def _draw_ellipses(random, n, near_fraction):
    """Centres uniform over the disc, or for `near_fraction` of them uniform in distance; radii and axis as printed."""
    distance = MAX_RANGE_M * np.sqrt(random.random(n))
    near = random.random(n) < near_fraction
    distance = np.where(near, random.uniform(NEAREST_CENTER_M, MAX_RANGE_M, n), distance)
    bearing = random.uniform(FIRST_AZIMUTH_RAD, -FIRST_AZIMUTH_RAD, n)
    psi = random.uniform(-np.pi / 2, np.pi / 2, n)
    rx = random.uniform(MIN_RADIUS_M, MAX_RADIUS_M, n)
    ry = MIN_RADIUS_M + random.random(n) * (rx - MIN_RADIUS_M)
    return np.stack((distance * np.cos(bearing), distance * np.sin(bearing), psi, rx, ry), axis=1)


def _tangent_azimuths(ellipses):
    """First and last azimuth of the beams that meet each ellipse; NaN where the sensor is inside it.

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


def sample(random, n, near_fraction=0.0):
    """Draw n samples with the numpy Generator `random`; near_fraction = 0 is the paper's distribution."""
    parts, missing = [], n
    while missing > 0:
        ellipses = _draw_ellipses(random, 2 * missing + 64, near_fraction)
        ellipses = ellipses[_inside_range(ellipses)]
        low, high = _tangent_azimuths(ellipses)
        first = np.ceil((low - FIRST_AZIMUTH_RAD) / RESOLUTION_RAD)
        last = np.floor((high - FIRST_AZIMUTH_RAD) / RESOLUTION_RAD)
        whole = (low >= FIRST_AZIMUTH_RAD) & (high <= -FIRST_AZIMUTH_RAD) & (last - first + 1 >= MIN_HITS)
        kept = np.flatnonzero(whole)[:missing]
        parts.append((ellipses[kept], first[kept].astype(int), last[kept].astype(int)))
        missing -= len(kept)
    ellipses, first, last = (np.concatenate(column) for column in zip(*parts))

    counts = last - first + 1
    first_hit = np.cumsum(counts) - counts
    beam = np.arange(counts.sum()) - np.repeat(first_hit - first, counts)
    azimuth = FIRST_AZIMUTH_RAD + beam * RESOLUTION_RAD
    ranges = _ranges(np.repeat(ellipses, counts, axis=0), azimuth) + random.normal(0.0, RANGE_SIGMA_M, len(beam))
    middle_azimuth = FIRST_AZIMUTH_RAD + (first + counts // 2) * RESOLUTION_RAD
    return Samples(ellipses, middle_azimuth, counts, first_hit, ranges, np.add.reduceat(ranges, first_hit) / counts)
