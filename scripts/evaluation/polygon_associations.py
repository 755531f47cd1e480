# SPDX-License-Identifier: BSD-3-Clause
"""The association of polylines that the polygon paper prints (Lodi Rizzini, Boccalini and Caselli, 2012, sections 3.2
and 3.3), as printed and repaired, on scans of the simulated worlds. The map of polygons has none: it associates hits
with the elements at their places. Which polyline is of which thing is known from the simulation.

The map is the truth: of each thing, the parts of its outline that were seen in the first transit. The scans are of the
second, so that some of the chains of either are of nothing of the other; a person walks in it."""

import dataclasses
import math

import numpy as np

import polygon_worlds

GATE_M = 0.12  # "slightly above 10 cm"
OVERLAP_M = 0.05  # with less in common two chains have no clipped distance
STEP_M = 0.02  # of samples of chains
TOLERANCE_M = 0.03  # of Douglas and Peucker
NEAR_M = 1.0  # chains farther apart, by their boxes, are not compared
JUMP_RAD = 0.17  # of Borges and Aldon: the incidence up to which hits of one surface are joined
JUMP_SIGMAS = 3.0
LEAST_HITS = 4
PURE_PART = 1.0  # of a polyline's hits: it is of the thing of these
GAP_COST = 1.0  # of a chain without a partner; a pair costs its distance over the gate
SCANS = 25  # of each world
NOTHING, SEVERAL = -1, -2


# --- lines: (n, 2) arrays, open


def arcs_of(line):
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))


def at_arcs(line, arcs_m):
    own = arcs_of(line)
    return np.column_stack([np.interp(arcs_m, own, line[:, axis]) for axis in (0, 1)])


def dense(line, step_m=STEP_M):
    length_m = arcs_of(line)[-1]
    corners = arcs_of(line)
    return at_arcs(line, np.union1d(corners, np.linspace(0.0, length_m, max(2, math.ceil(length_m / step_m) + 1))))


def project(points, line):
    """(distances, arcs, edges) of the nearest places on the line."""
    if len(line) == 1:
        away = points - line[0]
        return np.hypot(*away.T), np.zeros(len(points)), np.zeros(len(points), int)
    start, edge = line[:-1], np.diff(line, axis=0)
    offset = points[:, None, :] - start
    part = np.clip((offset * edge).sum(2) / np.maximum((edge**2).sum(1), 1e-18), 0.0, 1.0)
    away = np.sqrt(((offset - part[..., None] * edge)**2).sum(2))
    nearest = away.argmin(1)
    rows = np.arange(len(points))
    length = np.hypot(*edge.T)
    return away[rows, nearest], (arcs_of(line)[:-1] + part * length)[rows, nearest], nearest


def cut(line, first_m, last_m):
    corners = arcs_of(line)
    return at_arcs(line, np.concatenate(([first_m], corners[(corners > first_m) & (corners < last_m)], [last_m])))


def hausdorff(a, b):
    """Of the lines, not of their vertices."""
    return max(project(dense(a), b)[0].max(), project(dense(b), a)[0].max())


# --- metrics


def printed_distance(a, b):
    """Eq. 3: each line restricted to its vertices from the least to the greatest index of a segment that is nearest to
    a vertex of the other. A segment's index is that of its last vertex, so the first one's first vertex is missing."""

    def restricted(line, other):
        of_segments = project(other, line)[2] + 1
        return line[of_segments.min():of_segments.max() + 1]

    return hausdorff(restricted(a, b), restricted(b, a))


def clipped_distance(a, b):
    """Both lines cut at the projections of the other's ends; infinite with less than OVERLAP_M in common."""

    def clipped(line, other):
        arcs = project(dense(other), line)[1]
        return cut(line, arcs.min(), arcs.max())

    own_a = clipped(a, b)
    own_b = clipped(b, own_a)
    if min(arcs_of(own_a)[-1], arcs_of(own_b)[-1]) < OVERLAP_M:
        return math.inf
    return hausdorff(own_a, own_b)


def similarity(a, b):
    """Eqs. 1 and 2, with the offset removed and not doubled: 0 for equal shapes."""
    shapes = []
    for line in (a, b):
        edge = np.diff(line, axis=0)
        arcs = arcs_of(line)
        shapes.append((arcs / arcs[-1], np.unwrap(np.arctan2(edge[:, 1], edge[:, 0])), arcs[-1]))
    (arcs_a, tangent_a, length_a), (arcs_b, tangent_b, length_b) = shapes
    knots = np.union1d(arcs_a, arcs_b)
    middle, width = 0.5 * (knots[1:] + knots[:-1]), np.diff(knots)
    difference = (tangent_b[np.clip(np.searchsorted(arcs_b, middle) - 1, 0, len(tangent_b) - 1)]
                  - tangent_a[np.clip(np.searchsorted(arcs_a, middle) - 1, 0, len(tangent_a) - 1)])
    mean = (width * difference).sum()
    return float((width * (difference - mean)**2).sum() * max(length_a / length_b, length_b / length_a))


# --- association


def forced_pairs(costs):
    """Eq. 5: from the first pair to the last one, each chain of either list with at least one of the other."""
    rows, columns = costs.shape
    if not rows or not columns:
        return []
    total = np.full((rows, columns), np.inf)
    for i in range(rows):
        for j in range(columns):
            before = [total[i - di, j - dj] for di, dj in ((1, 0), (0, 1), (1, 1)) if i >= di and j >= dj]
            total[i, j] = costs[i, j] + (min(before) if before else 0.0)
    i, j = rows - 1, columns - 1
    pairs = [(i, j)]
    while i or j:
        steps = [(i - di, j - dj) for di, dj in ((1, 1), (1, 0), (0, 1)) if i >= di and j >= dj]
        i, j = min(steps, key=lambda step: total[step])
        pairs.append((i, j))
    return pairs[::-1]


def pairs_with_gaps(costs, gap=GAP_COST):
    """The same order, but a chain may stay without a partner, at a cost, and pairs of infinite cost are none."""
    rows, columns = costs.shape
    # `paired`: the best up to (i, j) that ends in this pair; `best`: of all.
    paired, best = np.full((rows + 1, columns + 1), np.inf), np.full((rows + 1, columns + 1), np.inf)
    best[0, :], best[:, 0] = gap * np.arange(columns + 1), gap * np.arange(rows + 1)
    for i in range(1, rows + 1):
        for j in range(1, columns + 1):
            paired[i, j] = costs[i - 1, j - 1] + min(best[i - 1, j - 1], paired[i - 1, j], paired[i, j - 1])
            best[i, j] = min(paired[i, j], best[i - 1, j] + gap, best[i, j - 1] + gap)
    pairs, i, j, in_pair = [], rows, columns, False
    while i and j:
        if in_pair or paired[i, j] <= best[i, j]:
            pairs.append((i - 1, j - 1))
            came = paired[i, j] - costs[i - 1, j - 1]
            if came == best[i - 1, j - 1] or abs(came - best[i - 1, j - 1]) < 1e-12:
                i, j, in_pair = i - 1, j - 1, False
            elif abs(came - paired[i - 1, j]) < 1e-12:
                i, in_pair = i - 1, True
            else:
                j, in_pair = j - 1, True
        elif abs(best[i, j] - best[i - 1, j] - gap) < 1e-12:
            i -= 1
        else:
            j -= 1
    return pairs[::-1]


# --- chains of scans and of the map


@dataclasses.dataclass
class Polyline:
    points: np.ndarray  # in the world
    thing: int  # index; NOTHING: of a person or a reflector; SEVERAL: not counted


def polylines_of(scan, things, pose, simplify):
    """Of a scan of the simulation; `things`: of each beam, -1 if it is of none that stands."""
    angles = polygon_worlds.ANGLE_MIN_RAD + polygon_worlds.ANGLE_INCREMENT_RAD * np.arange(polygon_worlds.BEAMS)
    hits = np.flatnonzero(np.isfinite(scan.range_m))
    range_m = scan.range_m[hits]
    points = range_m[:, None] * np.column_stack((np.cos(angles[hits]), np.sin(angles[hits])))
    nearer = np.minimum(range_m[1:], range_m[:-1])
    turn = angles[hits[1:]] - angles[hits[:-1]]
    most_m = (nearer * np.sin(turn) / np.sin(np.maximum(JUMP_RAD - turn, 0.01))
              + JUMP_SIGMAS * polygon_worlds.RANGE_SIGMA_M)
    breaks = np.flatnonzero((np.hypot(*np.diff(points, axis=0).T) > most_m) | (turn > math.radians(2.1))) + 1
    found = []
    for own in np.split(np.arange(len(hits)), breaks):
        if len(own) < LEAST_HITS:
            continue
        counts = np.bincount(things[hits[own]] + 1)
        thing = int(counts.argmax()) - 1
        kept = simplify(points[own], TOLERANCE_M)
        in_world = polygon_worlds.composed(pose, np.column_stack((kept, np.zeros(len(kept)))))[:, :2]
        found.append(Polyline(in_world, thing if counts.max() >= PURE_PART * len(own) else SEVERAL))
    return found


def map_chains(truth, stamp_s):
    """Of what has been seen until then, the truth."""
    import polygons  # which uses this module

    found = []
    for i, thing in enumerate(truth.things):
        if thing["optional"]:
            continue
        with np.errstate(invalid="ignore"):
            seen = truth.seen_s[truth.bins_of(i)] <= stamp_s
        parts = truth.seen_parts(i, seen)
        for part in [None] if parts is None else parts:
            points = truth.part_points(i, part)
            if part is None:
                points = np.vstack((points, points[:1]))
            found.append(Polyline(polygons.simplified(points, 1e-3), i))
    return found


def around(polylines, viewpoint):
    """In order around the viewpoint, by the bearings of their middles."""
    bearing = [math.atan2(*(at_arcs(own.points, [0.5 * arcs_of(own.points)[-1]])[0] - viewpoint)[::-1])
               for own in polylines]
    return [polylines[k] for k in np.argsort(bearing)]


# --- comparison


@dataclasses.dataclass
class Comparison:
    """Of pairs of a scan's polyline and a map's chain, and of the associations of scans."""

    right: list = dataclasses.field(default_factory=list)  # (truth, printed, clipped), in m, of pairs of one thing
    wrong: list = dataclasses.field(default_factory=list)  # (printed, clipped) of pairs of two, near each other
    # {association: [right pairs, pairs, of polylines that have a partner those with it, polylines that have one]}
    associations: dict = dataclasses.field(default_factory=dict)
    scans: int = 0

    def add(self, other):
        self.right += other.right
        self.wrong += other.wrong
        self.scans += other.scans
        for name, counts in other.associations.items():
            own = self.associations.setdefault(name, [0] * len(counts))
            self.associations[name] = [a + b for a, b in zip(own, counts)]


ASSOCIATIONS = ("as printed", "as printed, but validated by the clipped distance",
                "in order, with gaps, of least clipped distance", "all pairs within the gate, without an order")


def compare_scan(polylines, chains, viewpoint, outlines):
    """`outlines`: of each thing, closed."""
    found = Comparison(scans=1)
    polylines, chains = around(polylines, viewpoint), around(chains, viewpoint)
    shape = (len(polylines), len(chains))
    similarities, printed, clipped = np.zeros(shape), np.full(shape, np.inf), np.full(shape, np.inf)
    partner = np.zeros(shape, bool)
    for i, own in enumerate(polylines):
        for j, chain in enumerate(chains):
            similarities[i, j] = similarity(own.points, chain.points)
            apart = np.maximum(own.points.min(0) - chain.points.max(0), chain.points.min(0) - own.points.max(0))
            if apart.max() > NEAR_M:
                continue
            printed[i, j] = printed_distance(own.points, chain.points)
            clipped[i, j] = clipped_distance(own.points, chain.points)
            # Of the same thing, and of the part of it that the scan sees.
            partner[i, j] = (own.thing == chain.thing
                             and np.mean(project(dense(own.points), chain.points)[0] <= GATE_M) >= 0.5)
            if partner[i, j]:
                true_m = float(project(dense(own.points), outlines[own.thing])[0].max())
                found.right.append((true_m, printed[i, j], clipped[i, j]))
            elif own.thing != SEVERAL and own.thing != chain.thing:
                found.wrong.append((printed[i, j], clipped[i, j]))
    costs = np.where(clipped <= GATE_M, clipped / GATE_M, np.inf)
    forced = forced_pairs(similarities)
    pairs = dict(zip(ASSOCIATIONS, ([pair for pair in forced if printed[pair] <= GATE_M],
                                    [pair for pair in forced if clipped[pair] <= GATE_M], pairs_with_gaps(costs),
                                    list(zip(*np.nonzero(clipped <= GATE_M))))))
    for name, own in pairs.items():
        own = [(i, j) for i, j in own if polylines[i].thing != SEVERAL]
        right = [pair for pair in own if partner[pair]]
        found.associations[name] = [len(right), len(own), len({i for i, _ in right}), int(partner.any(1).sum())]
    return found


def compare(kind, seed):
    """In the world of this kind and seed."""
    import polygons

    made = polygon_worlds.make_world(kind, seed)
    simulation = polygon_worlds.Simulation(polygon_worlds.only_transits(made, (0, 3)))
    things = simulation.world.things
    scans, here = [], [i for i, thing in enumerate(things) if 1 in thing.present]
    index_of = np.array(here + [-1] * 3)
    for stamp_s, transit, scan in simulation.scans():
        if transit == 1:
            scans.append((stamp_s, scan))
    truth = polygons.Truth(simulation.truth())
    chains = map_chains(truth, truth.transits[0][1])
    outlines = [np.vstack((thing.outline, thing.outline[:1])) for thing in things]
    found = Comparison()
    for stamp_s, scan in scans[::max(1, len(scans) // SCANS)]:
        pose = polygon_worlds.composed(simulation.drive.at(stamp_s), np.array(simulation.world.mount))
        standing = index_of[np.minimum(scan.thing, len(here))]
        reflector = np.array([thing.optional for thing in things] + [False])[standing]
        polylines = polylines_of(scan, np.where(reflector, NOTHING, standing), pose, polygons.simplified)
        found.add(compare_scan(polylines, chains, pose[:2], outlines))
    return found
