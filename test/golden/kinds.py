# SPDX-License-Identifier: BSD-3-Clause
"""The fields of each kind of map that the golden replay compares.

A scene test/golden/SCENE.bag is replayed for each kind of which it has a table SCENE.KIND.txt. To add a kind: its entry
in KINDS, an empty table for each scene, scripts/accept_golden.
"""
import dataclasses
import math
from typing import Callable, Optional, Union

# Tolerance for rounding of the network on other processors (docs/testing.md, "Golden replay").
TOLERANCE = 5e-6


@dataclasses.dataclass(frozen=True)
class Field:
    """A number of an element, as `value` has it from the element of a line."""
    name: str
    value: Callable[[dict], float]
    unit: str = ""
    decimals: int = 6  # 0: a whole number
    tolerance: Union[float, Callable[[dict, dict], float]] = TOLERANCE  # of two elements, by name of their fields
    period: Optional[float] = None  # after which an angle is the same again

    def text(self, value):
        return f"{value:.{self.decimals}f}"

    def rounded(self, value):
        return round(value, self.decimals) + 0.0  # not -0

    def difference(self, before, after):
        """The change between two elements, None if within the tolerance."""
        difference = after[self.name] - before[self.name]
        if self.period is not None:
            difference = math.remainder(difference, self.period)
        tolerance = self.tolerance(before, after) if callable(self.tolerance) else self.tolerance
        return None if abs(difference) <= tolerance else difference


@dataclasses.dataclass(frozen=True)
class Kind:
    """A kind of map: the tool NAME_bag writes lines {"stamp": s, LIST: [element, ...]}; LIST is NAME if not given."""
    name: str
    fields: tuple
    list: str = ""
    arguments: tuple = ()  # of the tool

    @property
    def tool(self):
        return f"{self.name}_bag"

    def elements(self, line):
        """{id: {field: value}} of a line."""
        return {element["id"]: {field.name: field.rounded(field.value(element)) for field in self.fields}
                for element in line[self.list or self.name]}


def member(name, unit="", **arguments):
    return Field(name, lambda element: element[name], unit, **arguments)


def sigma(index, name, unit, **arguments):
    return Field(f"sigma_{name}", lambda element: element["sigma"][index], unit, **arguments)


def angle_tolerance(before, after):
    """The tolerance of an ellipse's angle, from that at the ends of its axes."""
    rx, ry = (min(element[radius] for element in (before, after)) for radius in ("rx", "ry"))
    return TOLERANCE / max(rx - ry, TOLERANCE)


OBJECTS = Kind("objects", (
    member("x", "m"), member("y", "m"), member("psi", "rad", tolerance=angle_tolerance, period=math.pi),
    member("rx", "m"), member("ry", "m"), member("vx", "m/s"), member("vy", "m/s"), member("wz", "rad/s"),
    sigma(0, "x", "m"), sigma(1, "y", "m"), sigma(2, "vx", "m/s"), sigma(3, "vy", "m/s"),
    sigma(4, "psi", "rad", tolerance=angle_tolerance), sigma(5, "wz", "rad/s"), sigma(6, "rx", "m"),
    sigma(7, "ry", "m"), member("beams", decimals=0, tolerance=0.5)))



def along(chain):
    """The lengths of a chain's edges."""
    points = chain["points"] + chain["points"][:1] * chain["closed"]
    return [math.dist(a, b) for a, b in zip(points, points[1:])]


def mean(axis):
    return lambda chain: sum(point[axis] for point in chain["points"]) / len(chain["points"])


POLYGONS = Kind("polygons", (
    Field("x", mean(0), "m"), Field("y", mean(1), "m"), Field("length", lambda chain: sum(along(chain)), "m"),
    Field("sigma", lambda chain: max(chain["sigma_m"]), "m"), member("p"),
    Field("vertices", lambda chain: len(chain["points"]), decimals=0, tolerance=0.5),
    member("closed", decimals=0, tolerance=0.5),
    Field("age", lambda chain: chain["last_seen"] - chain["first_seen"], "s")),
    list="polylines", arguments=("--localization", "tf"))

KINDS = (OBJECTS, POLYGONS)
