# SPDX-License-Identifier: BSD-3-Clause
"""Images of a camera that goes around cars, as drivers may send them, and over elevations as people have them: three
sections of scripts/evaluate inputs."""
import dataclasses
import functools
import io
import math
import pathlib
import tempfile
import typing

import numpy as np
import PIL.Image
import rosbag
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage

from inputs_ground import RASTERS, Raster, ground_m
from inputs_tools import MOST_RATIO, Outcome, check_bag, map_bag, stamp, transform

CARS = ((-8.0, 5.0, 0.4), (9.0, 7.0, 1.7), (3.0, -9.0, -0.7))  # x, y, yaw
CAR_HALF_M = np.array([2.25, 0.9, 0.75])
IMAGES, PERIOD_S, RADIUS_M, HEIGHT_M = 20, 0.5, 40.0, 22.0
FOUND_M = 1.0
MORE_M = 0.1  # beside MOST_RATIO: a fifth of a cell, a tenth of what a label pixel of the network shows of the ground
LABELS = "/camera/labels"


# --- the world, and a flight around it


def camera_pose(t_s):
    """Place, and axes in columns: x to the right, y down, z ahead."""
    angle = math.radians(-150.0 + 9.0 * t_s)
    place = np.array([RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), HEIGHT_M])
    ahead = np.array([1.0, 1.0, 0.0]) - place
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return place, np.stack([right, np.cross(ahead, right), ahead], 1)


def seen(place, rays):
    """(the car that each ray meets or -1, the axis of its side, the ray's length there)"""
    car, side, length = np.full(len(rays), -1), np.zeros(len(rays), int), np.full(len(rays), np.inf)
    for i, (x, y, yaw) in enumerate(CARS):
        middle = np.array([x, y, ground_m(x, y) + CAR_HALF_M[2]])
        turn = Rotation.from_euler("z", -yaw)
        origin, towards = turn.apply(place - middle), turn.apply(rays)
        with np.errstate(divide="ignore"):
            one, other = (-CAR_HALF_M - origin) / towards, (CAR_HALF_M - origin) / towards
        enters, leaves = np.minimum(one, other), np.maximum(one, other)
        meets = (enters.max(1) <= leaves.min(1)) & (leaves.min(1) > 0.0) & (enters.max(1) < length)
        car[meets], side[meets], length[meets] = i, enters[meets].argmax(1), enters[meets].max(1)
    return car, side, length


# --- lenses


@dataclasses.dataclass(frozen=True)
class Lens:
    model: str
    D: tuple

    def straight(self, bent):
        """Coordinates without distortion, of points (n, 2) with it, by the equations of sensor_msgs/CameraInfo."""
        if self.model == "equidistant":
            bent_angle = np.hypot(*bent.T)
            angle = bent_angle.copy()
            for _ in range(50):
                angle = bent_angle / np.polynomial.polynomial.polyval(angle**2, (1.0, *self.D))
            return bent * (np.tan(angle) / np.maximum(bent_angle, 1e-12))[:, None]
        k1, k2, p1, p2, k3, k4, k5, k6 = (*self.D, *[0.0] * (8 - len(self.D)))
        straight = bent.copy()
        for _ in range(50):
            x, y = straight.T
            r2 = x**2 + y**2
            scale = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            across = np.stack([2.0 * p1 * x * y + p2 * (r2 + 2.0 * x**2), p1 * (r2 + 2.0 * y**2) + 2.0 * p2 * x * y], 1)
            straight = (bent - across) / scale[:, None]
        return straight


PINHOLE = Lens("plumb_bob", (0.0,) * 5)
LENSES = {
    "plumb_bob": Lens("plumb_bob", (-0.25, 0.06, 0.001, -0.001, 0.0)),
    "rational_polynomial": Lens("rational_polynomial", (0.2, 0.05, 0.0005, -0.0005, 0.0, 0.5, 0.1, 0.0)),
    "equidistant": Lens("equidistant", (-0.03, 0.004, 0.0, 0.0)),
}


# --- images


SIZE, FOCAL_PX = 84, 72.0
PICTURE_SIZE, PICTURE_FOCAL_PX = 256, 290.0
PAINT = np.array([(170, 25, 30), (225, 225, 228), (30, 50, 120)], float)
LIGHT = np.array([0.75, 0.6, 1.0])  # on the sides across x, y and z
GLASS = (40, 45, 50)
FLOORS_M = np.array([ground_m(x, y) for x, y, _ in CARS])


def rays_of(size, focal_px, lens, part):
    """Of `part` x `part` points of each pixel, in the camera."""
    middles = (np.arange(size * part) + 0.5) / part - 0.5 * size
    u, v = np.meshgrid(middles / focal_px, middles / focal_px)
    straight = lens.straight(np.stack([u.ravel(), v.ravel()], 1))
    return np.column_stack([straight, np.ones(len(straight))])


@functools.lru_cache(maxsize=None)
def labels(focal_px, lens):
    """The part of each pixel that shows a car, in all images."""
    rays, images = rays_of(SIZE, focal_px, lens, 2), []
    for k in range(IMAGES):
        place, axes = camera_pose(PERIOD_S * k)
        shown = seen(place, rays @ axes.T)[0] >= 0
        images.append(shown.reshape(SIZE, 2, SIZE, 2).mean((1, 3)).astype(np.float32))
    return images


@functools.lru_cache(maxsize=None)
def pictures():
    """The colours of all images."""
    rays, images, grass = rays_of(PICTURE_SIZE, PICTURE_FOCAL_PX, PINHOLE, 2), [], np.random.default_rng(5)
    tufts = grass.normal(0.0, 9.0, (64, 64))
    for k in range(IMAGES):
        place, axes = camera_pose(PERIOD_S * k)
        towards = rays @ axes.T
        car, side, length = seen(place, towards)
        ground = place + towards * (-place[2] / np.minimum(towards[:, 2], -1e-3))[:, None]
        tuft = tufts[tuple((np.floor(2.0 * ground[:, :2]).astype(int) % 64).T)]
        colors = np.array([105.0, 112.0, 88.0]) + tuft[:, None]
        colors[car >= 0] = (PAINT[car] * LIGHT[side][:, None])[car >= 0]
        met = place + towards * np.where(car >= 0, length, 0.0)[:, None]
        above = met[:, 2] - FLOORS_M[car]
        colors[(car >= 0) & (side < 2) & (above > 0.85) & (above < 1.35)] = GLASS
        pixels = colors.reshape(PICTURE_SIZE, 2, PICTURE_SIZE, 2, 3).mean((1, 3))
        images.append(np.clip(pixels, 0, 255).astype(np.uint8))
    return images


def info_message(t_s, size, K_px, P_px=None, lens=PINHOLE):
    message, middle = CameraInfo(width=size, height=size, distortion_model=lens.model, D=list(lens.D)), 0.5 * (size - 1)
    message.header.stamp, message.header.frame_id = stamp(t_s), "camera"
    P_px = P_px or K_px
    message.K, message.R = [K_px, 0, middle, 0, K_px, middle, 0, 0, 1], [1, 0, 0, 0, 1, 0, 0, 0, 1]
    message.P = [P_px, 0, middle, 0, 0, P_px, middle, 0, 0, 0, 1, 0]
    return message


def image_message(encoding, data, size, is_bigendian=0):
    return Image(height=size, width=size, encoding=encoding, step=len(data) // size, data=data,
                 is_bigendian=is_bigendian)


def label_message(pixels):
    return image_message("32FC1", pixels.astype("<f4").tobytes(), SIZE)


def write_images(path, topic, messages, info, turned=np.eye(3), infos=IMAGES):
    """`info`: of a time. `turned`: the axes that TF has, in those of the camera. `infos`: so many of them are sent."""
    with rosbag.Bag(str(path), "w") as bag:
        for k, message in enumerate(messages):
            t_s = PERIOD_S * k
            for at_s in np.arange(t_s, t_s + PERIOD_S - 1e-6, 0.1):
                place, axes = camera_pose(at_s)
                quaternion = Rotation.from_matrix(axes @ turned).as_quat()
                bag.write("/tf", TFMessage([transform(at_s, "world", "camera", place, quaternion)]), stamp(at_s))
            message.header.stamp, message.header.frame_id = stamp(t_s), "camera"
            if k < infos:
                bag.write("/camera/camera_info", info(t_s), stamp(t_s + 0.02))
            bag.write(topic, message, stamp(t_s + 0.03))


# --- what the tools make of it


@dataclasses.dataclass
class CarScore:
    found: int      # cars
    error_m: float  # RMS of these
    others: int     # targets that are no car

    def __str__(self):
        return f"{self.found} cars, {self.error_m:.2f} m" + (f", {self.others} others" if self.others else "")

    def is_right(self, ideal):
        return self.found >= ideal.found and self.others <= ideal.others and \
            self.error_m <= max(MOST_RATIO * ideal.error_m, ideal.error_m + MORE_M)


def score_of(features):
    places = np.array([(f["x"], f["y"]) for f in features if f["kind"] == "target"]).reshape(-1, 2)
    off = np.hypot(*(places[:, None] - np.array(CARS)[None, :, :2]).transpose(2, 0, 1))
    errors = [column.min() for column in off.T if len(column) and column.min() < FOUND_M]
    return CarScore(len(errors), float(np.sqrt(np.mean(np.square(errors)))) if errors else math.nan,
                    int((off.min(1, initial=math.inf) >= FOUND_M).sum()))


def mapped(programs, bag, raster, arguments):
    features, warned = map_bag(programs, bag, bag.parent / "map.jsonl", "--kinds", "grid", "--world-frame", "world",
                               "--camera-info-topic", "/camera/camera_info", "--dem", raster, *arguments)
    return Outcome(score_of(features), warned)


def tried(programs, write, topic, raster, of_raster=(), remedy=()):
    """What the tools make of the images that `write` writes over a raster with these options, and with `remedy`."""
    with tempfile.TemporaryDirectory() as name:
        bag, path = pathlib.Path(name) / "flight.bag", pathlib.Path(name) / "ground.tif"
        write(bag)
        raster.write(path)
        outcome = mapped(programs, bag, path, (*topic, *of_raster))
        outcome.findings = check_bag(programs, bag, "--dem", path, *of_raster)
        if not remedy:
            return outcome, None
        return outcome, (" ".join(remedy), mapped(programs, bag, path, (*topic, *of_raster, *remedy)))


# --- encodings


def file_of(pixels, kind):
    file = io.BytesIO()
    PIL.Image.fromarray(pixels).save(file, kind, quality=90)
    return file.getvalue()


def grey(pixels):
    return np.rint(pixels @ np.array([0.299, 0.587, 0.114])).astype(np.uint8)


def pattern(pixels, channels):
    """What a sensor measures behind filters of these channels, at even and odd rows and columns."""
    measured = np.empty(pixels.shape[:2], np.uint8)
    for i, channel in enumerate(channels):
        measured[i // 2::2, i % 2::2] = pixels[i // 2::2, i % 2::2, channel]
    return measured


def luma_and_chroma(pixels, luma):
    """Rows of luma and chroma in turn (ITU-R BT.601), luma first or second."""
    of_pixel = np.asarray(PIL.Image.fromarray(pixels).convert("YCbCr")).astype(float)
    result = np.empty((*pixels.shape[:2], 2))
    result[..., luma] = 16.0 + of_pixel[..., 0] * 219.0 / 255.0
    chroma = 128.0 + (0.5 * (of_pixel[:, ::2, 1:] + of_pixel[:, 1::2, 1:]) - 128.0) * 224.0 / 255.0
    result[:, ::2, 1 - luma], result[:, 1::2, 1 - luma] = chroma[..., 0], chroma[..., 1]
    return np.rint(result).astype(np.uint8)


def plain(encoding, numbers, is_bigendian=0):
    return lambda pixels: image_message(encoding, np.ascontiguousarray(numbers(pixels)).tobytes(), PICTURE_SIZE,
                                        is_bigendian)


def compressed(kind, text):
    return lambda pixels: CompressedImage(format=text, data=file_of(pixels, kind))


IDEAL_ENCODING = "rgb8"
ENCODINGS = {  # "/compressed" where its messages are
    IDEAL_ENCODING: plain("rgb8", lambda pixels: pixels),
    "bgr8": plain("bgr8", lambda pixels: pixels[..., ::-1]),
    "8UC3": plain("8UC3", lambda pixels: pixels[..., ::-1]),
    "rgb16": plain("rgb16", lambda pixels: 257 * pixels.astype("<u2")),
    "rgb16, big-endian": plain("rgb16", lambda pixels: (257 * pixels.astype("u2")).astype(">u2"), 1),
    "mono8": plain("mono8", grey),
    "mono16": plain("mono16", lambda pixels: 257 * grey(pixels).astype("<u2")),
    "bayer_rggb8": plain("bayer_rggb8", lambda pixels: pattern(pixels, (0, 1, 1, 2))),
    "bayer_gbrg8": plain("bayer_gbrg8", lambda pixels: pattern(pixels, (1, 2, 0, 1))),
    "yuv422": plain("yuv422", lambda pixels: luma_and_chroma(pixels, 1)),
    "yuv422_yuy2": plain("yuv422_yuy2", lambda pixels: luma_and_chroma(pixels, 0)),
    "jpeg": compressed("JPEG", "rgb8; jpeg compressed bgr8"),
    "png": compressed("PNG", "rgb8; png compressed bgr8"),
    "nv12": plain("nv12", grey),
}


def encodings(programs, encoding):
    topic, message_of = "/camera/image", ENCODINGS[encoding]
    messages = [message_of(pixels) for pixels in pictures()]
    suffix = "/compressed" if isinstance(messages[0], CompressedImage) else ""
    info = lambda t_s: info_message(t_s, PICTURE_SIZE, PICTURE_FOCAL_PX)
    return tried(programs, lambda bag: write_images(bag, topic + suffix, messages, info), ("--image-topic", topic),
                 Raster())


# --- lenses and cameras


@dataclasses.dataclass(frozen=True)
class View:
    lens: Lens = PINHOLE
    is_raw: bool = False       # the images are as the lens makes them
    P_px: float = FOCAL_PX
    topic: str = LABELS
    remedy: tuple = ()
    turned: tuple = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    infos: int = IMAGES
    change: typing.Callable = lambda info: None
    message_of: typing.Callable = label_message


def twice(info):
    """The camera has twice the pixels."""
    info.width, info.height = 2 * info.width, 2 * info.height
    for matrix in (info.K, info.P):
        for i, value in enumerate(matrix):
            matrix[i] = value if value in (0, 1) else 2.0 * value + (0.5 if value == 0.5 * (SIZE - 1) else 0.0)


def binned(info):
    twice(info)
    info.binning_x = info.binning_y = 2


def of_region(info):
    info.roi.x_offset, info.roi.y_offset, info.roi.width, info.roi.height = 60, 40, info.width, info.height
    info.width, info.height = 200, 150
    info.K[2], info.K[5], info.P[2], info.P[6] = info.K[2] + 60, info.K[5] + 40, info.P[2] + 60, info.P[6] + 40


def without_p(info):
    info.P = [0.0] * 12


IDEAL_VIEW = "no distortion"
VIEWS = {
    IDEAL_VIEW: View(),
    "binning 2": View(change=binned),
    "region of interest": View(change=of_region),
    "one camera_info": View(infos=1),
    "P all 0": View(change=without_p),
    "camera_info of twice the size": View(change=twice),
    "no distortion, P other than K": View(P_px=0.8 * FOCAL_PX),
    "a frame with x ahead": View(turned=((0, -1, 0), (0, 0, -1), (1, 0, 0))),
    "labels mono8": View(message_of=lambda pixels: image_message("mono8", (255 * pixels).astype("u1").tobytes(), SIZE)),
    "labels big-endian":
        View(message_of=lambda pixels: image_message("32FC1", pixels.astype(">f4").tobytes(), SIZE, 1)),
}
for _name, _lens in LENSES.items():
    VIEWS[f"{_name}, raw, on image_raw, P = K"] = View(_lens, True, topic="/camera/image_raw")
    VIEWS[f"{_name}, raw, on image_raw, P other"] = View(_lens, True, 0.8 * FOCAL_PX, "/camera/image_raw")
    VIEWS[f"{_name}, raw, P = K"] = View(_lens, True, remedy=("--image-kind", "raw"))
    VIEWS[f"{_name}, raw, P other"] = View(_lens, True, 0.8 * FOCAL_PX, remedy=("--image-kind", "raw"))
    VIEWS[f"{_name}, rectified, on image_rect"] = View(_lens, False, 0.8 * FOCAL_PX, "/camera/image_rect")
    VIEWS[f"{_name}, rectified"] = View(_lens, False, 0.8 * FOCAL_PX)


def views(programs, name):
    view = VIEWS[name]
    images = labels(FOCAL_PX, view.lens) if view.is_raw else \
        labels(FOCAL_PX if view.lens is PINHOLE else view.P_px, PINHOLE)

    def info(t_s):
        message = info_message(t_s, SIZE, FOCAL_PX, view.P_px, view.lens)
        view.change(message)
        return message

    def write(bag):
        write_images(bag, view.topic, [view.message_of(pixels) for pixels in images], info, np.array(view.turned),
                     view.infos)
    return tried(programs, write, ("--labels-topic", view.topic), Raster(), remedy=view.remedy)


# --- elevations

def rasters(programs, name):
    raster, of_raster, remedy = RASTERS[name]
    info = lambda t_s: info_message(t_s, SIZE, FOCAL_PX)
    messages = [label_message(pixels) for pixels in labels(FOCAL_PX, PINHOLE)]
    return tried(programs, lambda bag: write_images(bag, LABELS, messages, info), ("--labels-topic", LABELS), raster,
                 of_raster, remedy)
