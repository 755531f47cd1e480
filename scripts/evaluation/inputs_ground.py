# SPDX-License-Identifier: BSD-3-Clause
"""Elevations of hills as people have them, in GeoTIFFs: for scripts/evaluate inputs."""
import dataclasses
import math
import struct
import typing
import zlib

import numpy as np


def ground_m(x, y):
    """Hills, on which the cars stand."""
    return 3.0 * np.sin(x / 25.0) + 2.0 * np.cos(y / 18.0)


# --- where on the Earth it is


LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M = 47.5, 9.0, 460.0  # of the world's origin, in the middle of a zone of UTM
GEOID_M = 46.6  # of EGM96 above the ellipsoid there
ORIGIN = ("--origin", f"{LATITUDE_DEG},{LONGITUDE_DEG},{ALTITUDE_M}")
_A_M, _E2 = 6378137.0, 0.00669437999014  # of WGS 84
_W = math.sqrt(1.0 - _E2 * math.sin(math.radians(LATITUDE_DEG))**2)
ACROSS_M, ALONG_M = _A_M / _W, _A_M * (1.0 - _E2) / _W**3  # radii of curvature, across the meridian and along it
UTM_SCALE = 0.9996


def meridian_m(latitude_deg):
    """From the equator (Snyder, "Map projections: a working manual", 1987, 3-21)."""
    phi = math.radians(latitude_deg)
    return _A_M * ((1 - _E2 / 4 - 3 * _E2**2 / 64 - 5 * _E2**3 / 256) * phi -
                   (3 * _E2 / 8 + 3 * _E2**2 / 32 + 45 * _E2**3 / 1024) * math.sin(2 * phi) +
                   (15 * _E2**2 / 256 + 45 * _E2**3 / 1024) * math.sin(4 * phi) -
                   35 * _E2**3 / 3072 * math.sin(6 * phi))


# From coordinates of a raster to x and y in the world, near its origin. Lengths on the ellipsoid are shorter than at
# the altitude of the origin.
EAST_M, NORTH_M = 500e3, UTM_SCALE * meridian_m(LATITUDE_DEG)
UP = 1.0 + ALTITUDE_M / ACROSS_M
X_DEG = math.degrees(1.0 / ((ACROSS_M + ALTITUDE_M) * math.cos(math.radians(LATITUDE_DEG))))
Y_DEG = math.degrees(1.0 / (ALONG_M + ALTITUDE_M))


def of_utm(x, y):
    return (x - EAST_M) / UTM_SCALE * UP, (y - NORTH_M) / UTM_SCALE * UP


def of_degrees(x, y):
    return (x - LONGITUDE_DEG) / X_DEG, (y - LATITUDE_DEG) / Y_DEG


# --- GeoTIFF


METADATA = "<GDALMetadata>{}</GDALMetadata>"
ITEM = '<Item name="{}" sample="0" role="{}">{}</Item>'
SCALE_AND_OFFSET = METADATA.format(ITEM.format("SCALE", "scale", 0.1) + ITEM.format("OFFSET", "offset", -100))
# GeoTIFF's keys (OGC 19-008r4): kind of the CRS, its code.
UTM_32, WGS_84, EGM_96 = {1024: 1, 3072: 32632}, {1024: 2, 2048: 4326}, {4096: 5773}
TILE, NEAR_M = 256, 150.0


@dataclasses.dataclass(frozen=True)
class Raster:
    """The ground in a GeoTIFF: tiles of zlib, as many as there are near the world's origin."""
    transform: tuple = (-100.0, 1.0, 0.0, 100.0, 0.0, -1.0)  # as GDAL's: x and y of a corner, and by column and row
    size: int = 200
    kind: str = "<f4"
    world_of: typing.Callable = lambda x, y: (x, y)
    stored: typing.Callable = lambda heights, x, y: heights  # of the world's heights and places
    keys: dict = dataclasses.field(default_factory=dict)
    metadata: str = ""
    is_point: bool = False
    is_masked: typing.Callable = None
    bands: int = 1

    def places(self, columns, rows):
        x0, dx, by_row, y0, by_column, dy = self.transform
        c, r = np.meshgrid(columns, rows)
        return self.world_of(x0 + c * dx + r * by_row, y0 + c * by_column + r * dy)

    def tile(self, row, column, stored):
        """Compressed; nothing where it is far."""
        x, y = self.places(np.array([column, column + TILE]), np.array([row, row + TILE]))
        if min(x.max(), y.max(), -x.min(), -y.min()) < -NEAR_M:
            return b""
        x, y = self.places(column + np.arange(TILE) + 0.5, row + np.arange(TILE) + 0.5)
        values = stored(ground_m(x, y), x, y)
        values = np.rint(values) if self.kind[1] != "f" else values
        return zlib.compress(np.repeat(values[..., None], self.bands, 2).astype(self.kind).tobytes(), 1)

    def write(self, path):
        write_tiff(path, self, self.stored, self.kind)
        if self.is_masked:
            write_tiff(path.with_name(path.name + ".msk"),
                       dataclasses.replace(self, kind="|u1", keys={}, metadata=METADATA.format(
                           '<Item name="INTERNAL_MASK_FLAGS_1">2</Item>')),
                       lambda heights, x, y: np.where(self.is_masked(x, y), 0, 255), "|u1")


def write_tiff(path, raster, stored, kind):
    x0, dx, by_row, y0, by_column, dy = raster.transform
    half = 0.5 if raster.is_point else 0.0
    matrix = (dx, by_row, 0.0, x0 + half * (dx + by_row), by_column, dy, 0.0, y0 + half * (by_column + dy),
              *[0.0] * 4, 0.0, 0.0, 0.0, 1.0)
    keys = {1025: 2 if raster.is_point else 1, **raster.keys}
    directory = [1, 1, 0, len(keys)] + [part for key in sorted(keys) for part in (key, 0, 1, keys[key])]
    starts = range(0, raster.size, TILE)
    tiles = [raster.tile(row, column, stored) for row in starts for column in starts]
    offsets = 8 + np.concatenate([[0], np.cumsum([len(tile) for tile in tiles])])
    sample = {"f": 3, "i": 2, "u": 1}[kind[1]]
    entries = [  # tag, type (2 text, 3 uint16, 4 uint32, 12 float64), values
        (256, 4, [raster.size]), (257, 4, [raster.size]), (258, 3, [8 * np.dtype(kind).itemsize] * raster.bands),
        (259, 3, [8]), (262, 3, [2 if raster.bands == 3 else 1]), (277, 3, [raster.bands]), (284, 3, [1]),
        (322, 3, [TILE]), (323, 3, [TILE]),
        (324, 4, [offset if tile else 0 for offset, tile in zip(offsets, tiles)]),
        (325, 4, [len(tile) for tile in tiles]), (339, 3, [sample] * raster.bands), (34264, 12, matrix),
        (34735, 3, directory)] + ([(42112, 2, raster.metadata)] if raster.metadata else [])
    at = int(offsets[-1]) + offsets[-1] % 2
    table, beyond = struct.pack("<H", len(entries)), b""
    end = at + 2 + 12 * len(entries) + 4
    for tag, type_of, values in entries:
        data = values.encode() + b"\0" if type_of == 2 else \
            struct.pack(f"<{len(values)}{ {3: 'H', 4: 'I', 12: 'd'}[type_of] }", *values)
        table += struct.pack("<HHI", tag, type_of, len(values) + (type_of == 2))
        table += data.ljust(4, b"\0") if len(data) <= 4 else struct.pack("<I", end + len(beyond))
        beyond += data + b"\0" * (len(data) % 2) if len(data) > 4 else b""
    body = b"".join(tiles)
    path.write_bytes(struct.pack("<2sHI", b"II", 42, at) + body + b"\0" * (at - 8 - len(body)) + table +
                     struct.pack("<I", 0) + beyond)


# --- what people have


def above_ellipsoid(heights, x, y):
    return heights + ALTITUDE_M


def above_sea(heights, x, y):
    return heights + ALTITUDE_M - GEOID_M


def lower_by(depth_m):
    return lambda heights, x, y: heights - depth_m


def with_holes(value):
    """A strip in which nothing is known, beside the cars."""
    return lambda heights, x, y: np.where(is_hole(x, y), value, heights)


def is_hole(x, y):
    return abs(x + 30.0) < 8.0


METRES_OF_UTM = (EAST_M - 100.0, 1.0, 0.0, NORTH_M + 100.0, 0.0, -1.0)
TURN = math.radians(30.0)
IDEAL_RASTER = "float32, m, in the world's metres"
IN_UTM = Raster(METRES_OF_UTM, world_of=of_utm, stored=above_ellipsoid, keys=UTM_32)
IN_DEGREES = Raster((LONGITUDE_DEG - 1e-3, 1e-5, 0.0, LATITUDE_DEG + 1e-3, 0.0, -1e-5), world_of=of_degrees,
                    stored=above_ellipsoid, keys=WGS_84)
RASTERS = {  # the raster, options of it, and those that put it right where they are asked for
    IDEAL_RASTER: (Raster(), (), ()),
    "the same, of a world with an origin": (Raster(), ORIGIN, ()),
    "UTM, of a world with an origin": (IN_UTM, ORIGIN, ()),
    "UTM, of a world without": (IN_UTM, (), ORIGIN),
    "degrees, of a world with an origin": (IN_DEGREES, ORIGIN, ()),
    "degrees, of a world without": (IN_DEGREES, (), ORIGIN),
    "degrees, without a CRS": (dataclasses.replace(IN_DEGREES, keys={}), (), ()),
    "feet": (Raster(stored=lambda heights, x, y: heights / 0.3048,
                    metadata=METADATA.format(ITEM.format("UNITTYPE", "unittype", "ft"))), (), ()),
    "int16, scale 0.1, offset -100": (Raster(kind="<i2", stored=lambda heights, x, y: 10.0 * (heights + 100.0),
                                             metadata=SCALE_AND_OFFSET), (), ()),
    "a mask": (Raster(stored=with_holes(250.0), is_masked=is_hole), (), ()),
    "voids of -9999 that are not declared": (Raster(stored=with_holes(-9999.0)), (), ()),
    "voids of -32768 that are not declared, int16":
        (Raster(kind="<i2", stored=lambda heights, x, y: with_holes(-32768.0)(10.0 * (heights + 100.0), x, y),
                metadata=SCALE_AND_OFFSET), (), ()),
    "south up": (Raster((-100.0, 1.0, 0.0, -100.0, 0.0, 1.0)), (), ()),
    "rotated by 30 deg": (Raster((-205.0, math.cos(TURN), math.sin(TURN), 55.0, math.sin(TURN), -math.cos(TURN)), 300),
                          (), ()),
    "a pixel is a point": (Raster((-100.0, 4.0, 0.0, 100.0, 0.0, -4.0), 50, is_point=True), (), ()),
    "another area, in the world's metres": (Raster((900.0, 1.0, 0.0, 100.0, 0.0, -1.0),
                                                   world_of=lambda x, y: (x - 1000.0, y)), (), ()),
    "another area, UTM, of a world with an origin":
        (Raster((700e3, 1.0, 0.0, 5200e3, 0.0, -1.0), world_of=lambda x, y: (x - 700e3, y - 5200e3 + 200.0),
                stored=above_ellipsoid, keys=UTM_32), ORIGIN, ()),
    "above the sea, by its CRS": (dataclasses.replace(IN_DEGREES, stored=above_sea, keys={**WGS_84, **EGM_96}), ORIGIN,
                                  ("--dem-geoid-m", str(GEOID_M))),
    "above the sea, and does not say so": (dataclasses.replace(IN_DEGREES, stored=above_sea), ORIGIN,
                                           ("--dem-vertical", "egm96", "--dem-geoid-m", str(GEOID_M))),
    "2 m lower": (Raster(stored=lower_by(2.0)), (), ()),
    "5 m lower": (Raster(stored=lower_by(5.0)), (), ()),
    "47 m lower": (Raster(stored=lower_by(47.0)), (), ()),
    "pixels of 1e-6 deg":
        (dataclasses.replace(IN_DEGREES, size=1600,
                             transform=(LONGITUDE_DEG - 8e-4, 1e-6, 0.0, LATITUDE_DEG + 8e-4, 0.0, -1e-6)), ORIGIN, ()),
    "20,000 x 20,000 pixels": (Raster((-5000.0, 0.5, 0.0, 5000.0, 0.0, -0.5), 20000), (), ()),
    "three bands of colours": (Raster(kind="|u1", stored=lambda heights, x, y: 100.0 + 5.0 * heights, bands=3), (), ()),
}
