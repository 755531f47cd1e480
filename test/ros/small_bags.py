# SPDX-License-Identifier: BSD-3-Clause
"""Bags of seconds for the tests of the bag tools: a robot in a room with reflectors, a car with GPS and IMU beside a
house, a camera above a car. What is wrong in a bag is changed in its messages."""
import math

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, Imu, LaserScan, NavSatFix
from tf2_msgs.msg import TFMessage

START_S = 1_600_000_000
ROOM = [(-5.0, -4.0), (6.0, -4.0), (6.0, 4.5), (-5.0, 4.5)]
REFLECTORS = [(5.5, -3.0), (5.2, 3.4), (-4.4, 3.9), (-4.6, -2.5), (0.7, 4.1), (1.9, -3.6)]
REFLECTOR_RADIUS_M = 0.05
LIDAR_X_M = 0.2  # on the base
HOUSE = [(-6.0, -4.0), (6.0, -4.0), (6.0, 4.0), (-6.0, 4.0)]
ORIGIN = (47.2, 8.7, 430.0)
GRAVITY = 9.80665
CAR = (2.0, -1.0)
CAMERA_HEIGHT_M = 20.0


def at(t):
    return rospy.Time.from_sec(START_S + t)


def in_order(messages):
    return sorted(messages, key=lambda entry: entry[0])


def write(path, messages, compression="none"):
    """`messages`: (seconds of arrival, topic, message)."""
    with rosbag.Bag(str(path), "w", compression=compression) as bag:
        for t, topic, msg in in_order(messages):
            bag.write(topic, msg, at(t))
    return path


def write_split(folder, messages, parts):
    """As a recorder splits it: each bag has a part of the time."""
    entries = in_order(messages)
    ends = [len(entries) * i // parts for i in range(parts + 1)]
    return [write(folder / f"a_{i}.bag", entries[ends[i]:ends[i + 1]]) for i in range(parts)]


def transform(t, parent, child, xyz=(0.0, 0.0, 0.0), quaternion=(0.0, 0.0, 0.0, 1.0)):
    msg = TransformStamped()
    msg.header.stamp, msg.header.frame_id, msg.child_frame_id = at(t), parent, child
    translation, rotation = msg.transform.translation, msg.transform.rotation
    translation.x, translation.y, translation.z = map(float, xyz)
    rotation.x, rotation.y, rotation.z, rotation.w = map(float, quaternion)
    return TFMessage([msg])


def about_z(yaw):
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def quaternion_of(R):
    """By the eigenvector of the greatest eigenvalue (Bar-Itzhack, "New method for extracting the quaternion from a
    rotation matrix", 2000)."""
    K = np.array([[R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
                  [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
                  [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
                  [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]]])
    return np.linalg.eigh(K, "L")[1][:, -1]


def ranges(x, y, angles, corners, posts=()):
    """From a place, or one for each angle, to the sides of a polygon and to posts (x, y, radius)."""
    origin = np.stack(np.broadcast_arrays(x, y), -1)
    towards = np.stack([np.cos(angles), np.sin(angles)], 1)
    result = np.full(len(angles), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for a, b in zip(corners, corners[1:] + corners[:1]):
            side, to = np.subtract(b, a), np.subtract(a, origin)
            across = towards[:, 0] * side[1] - towards[:, 1] * side[0]
            along = (to[..., 0] * side[1] - to[..., 1] * side[0]) / across
            part = (to[..., 0] * towards[:, 1] - to[..., 1] * towards[:, 0]) / across
            result = np.where((along > 0) & (part >= 0) & (part <= 1) & (along < result), along, result)
        for px, py, radius in posts:
            to = np.subtract((px, py), origin)
            ahead = (towards * to).sum(-1)
            inside = ahead**2 - (to * to).sum(-1) + radius**2
            along = ahead - np.sqrt(inside)
            result = np.where((inside > 0) & (ahead > 0) & (along < result), along, result)
    return result


def scan(t, pose, corners, posts=(), beams=721, frame="laser", range_max=30.0, sigma_m=0.01, seed=0):
    """A full turn, all beams at one instant."""
    x, y, yaw = pose
    x, y = x + LIDAR_X_M * math.cos(yaw), y + LIDAR_X_M * math.sin(yaw)
    msg = LaserScan()
    msg.header.stamp, msg.header.frame_id = at(t), frame
    msg.angle_increment = 2 * math.pi / beams
    msg.angle_min, msg.angle_max = -math.pi, math.pi - msg.angle_increment
    msg.range_min, msg.range_max, msg.scan_time = 0.05, range_max, 0.1
    angles = msg.angle_min + msg.angle_increment * np.arange(beams)
    measured = ranges(x, y, yaw + angles, corners, posts)
    noise = np.random.default_rng(1000 * seed + int(1000 * t)).normal(0, sigma_m, beams)
    msg.ranges = list(np.where(np.isfinite(measured), measured + noise, np.inf))
    return msg


def turning_pose(t):
    """It drives slowly to and fro and turns to both sides; t may be an array."""
    return 0.8 * np.sin(0.25 * t), 0.5 * np.sin(0.4 * t), 1.2 * np.sin(0.6 * t)


def sweep(t, corners, posts=(), beams=360, sweep_s=0.095, order=1, stamp_part=0.0, range_max=12.0, sigma_m=0.01,
          nothing=None):
    """A full turn of turning_pose whose first beam is measured at t. `order`: -1 where the last beam of the array is that.
    `stamp_part`: of the sweep, where the stamp is. `nothing`: what is sent for "nothing there" in place of +inf, by a
    generator of random numbers."""
    random = np.random.default_rng(int(1000 * t))
    part = np.arange(beams) / (beams - 1)
    x, y, yaw = turning_pose(t + sweep_s * part)
    x, y = x + LIDAR_X_M * np.cos(yaw), y + LIDAR_X_M * np.sin(yaw)
    step = order * 2 * math.pi / beams
    first = -order * math.pi
    measured = ranges(x, y, yaw + first + step * np.arange(beams), corners, posts)
    measured = np.where(np.isfinite(measured), measured + random.normal(0, sigma_m, beams), np.inf)
    measured[measured >= range_max] = np.inf
    if nothing is not None:
        measured = np.where(np.isinf(measured), nothing(random, beams), measured)
    msg = LaserScan()
    msg.header.stamp, msg.header.frame_id = at(t + stamp_part * sweep_s), "laser"
    msg.angle_min, msg.angle_max, msg.angle_increment = first, first + step * (beams - 1), step
    msg.range_min, msg.range_max, msg.scan_time, msg.time_increment = 0.05, range_max, 0.1, sweep_s / (beams - 1)
    msg.ranges = list(measured)
    if order < 0:  # as a driver that turns the array round, so that angles increase
        msg.angle_min, msg.angle_max, msg.angle_increment = msg.angle_max, msg.angle_min, -step
        msg.ranges.reverse()
    return msg


def turning(seconds, corners=(), posts=(), late_s=0.0, world="odom", **scanner):
    """TF of a robot by turning_pose, `late_s` late, and sweeps at 10 Hz."""
    messages = [(0.0, "/tf_static", transform(0, "base_link", "laser", (LIDAR_X_M, 0.0, 0.3)))]
    for k in range(int(50 * seconds) + 10):
        t = k / 50
        x, y, yaw = turning_pose(t - late_s)
        messages.append((t, "/tf", transform(t, world, "base_link", (x, y, 0.0), about_z(yaw))))
    for k in range(int(10 * seconds) - 1):
        t = 0.05 + k / 10
        messages.append((t + 0.11, "/scan", sweep(t, list(corners), posts, **scanner)))
    return messages


def robot_pose(t):
    """It drives around in the room."""
    a = 0.25 * t
    return 1.2 * math.sin(a), 0.9 * (1.0 - math.cos(a)), math.atan2(0.9 * math.sin(a), 1.2 * math.cos(a))


def odometry(t, pose, frame="odom", child="base_link"):
    msg = Odometry()
    msg.header.stamp, msg.header.frame_id, msg.child_frame_id = at(t), frame, child
    msg.pose.pose.position.x, msg.pose.pose.position.y = pose[:2]
    q = msg.pose.pose.orientation
    q.x, q.y, q.z, q.w = about_z(pose[2])
    return msg


def room(seconds=6.0, bright=900.0, dim=100.0, change=lambda msg: msg, tf="/tf", scan_topic="/scan", frames=("odom", "base_link"),
         tf_base="base_link", mount=True):
    """A robot's scans with intensities, odometry of `frames`, and TF odom -> `tf_base` -> laser. `change`: of each
    scan."""
    messages = []
    if mount:
        messages.append((0.0, tf + "_static", transform(0, tf_base, "laser", (LIDAR_X_M, 0.0, 0.3))))
    for k in range(int(50 * seconds)):
        t = k / 50
        x, y, yaw = robot_pose(t)
        messages.append((t, tf, transform(t, "odom", tf_base, (x, y, 0.0), about_z(yaw))))
        messages.append((t + 0.001, "/odom", odometry(t, (x, y, yaw), *frames)))
    posts = [(x, y, REFLECTOR_RADIUS_M) for x, y in REFLECTORS]
    for k in range(int(10 * seconds) - 1):
        t = 0.05 + k / 10
        msg = scan(t, robot_pose(t), ROOM, posts, beams=1441, sigma_m=0.005)
        x, y, yaw = robot_pose(t)
        angles = yaw + msg.angle_min + msg.angle_increment * np.arange(len(msg.ranges))
        hits = np.array([x + LIDAR_X_M * math.cos(yaw), y + LIDAR_X_M * math.sin(yaw)])[:, None] + np.array(
            msg.ranges) * np.stack([np.cos(angles), np.sin(angles)])
        on = np.any([np.hypot(hits[0] - px, hits[1] - py) < radius + 0.02 for px, py, radius in posts], 0)
        msg.intensities = list(np.where(on, bright, dim))
        messages.append((t + 0.01, scan_topic, change(msg)))
    return messages


def reflectors_yaml(path, spread=1.0):
    path.write_text("reflectors:\n" + "".join(
        f"  - {{x: {spread * x}, y: {spread * y}, radius_m: {REFLECTOR_RADIUS_M}}}\n" for x, y in REFLECTORS))
    return path


class Drive:
    """A car stands for 4 s, sets off, and goes around the house at 4 m/s with speed and curvature that change."""

    STEP_S = 0.002

    def __init__(self, seconds):
        self.t = np.arange(0.0, seconds + 1.0, self.STEP_S)
        self.speed = np.interp(self.t, [0, 4, 7, 1e4], [0, 0, 4, 4]) + np.where(self.t > 9, 0.5 * np.sin(0.8 * self.t), 0)
        self.rate = np.where(self.t > 6, self.speed / 15, 0)
        self.yaw = np.cumsum(self.rate) * self.STEP_S
        self.x = np.cumsum(self.speed * np.cos(self.yaw)) * self.STEP_S - 6.0
        self.y = np.cumsum(self.speed * np.sin(self.yaw)) * self.STEP_S - 15.0
        self.acceleration = np.gradient(self.speed, self.STEP_S)

    def at(self, t, name):
        return float(np.interp(t, self.t, getattr(self, name)))

    def pose(self, t):
        return self.at(t, "x"), self.at(t, "y"), self.at(t, "yaw")


def geodetic(east, north, up):
    """To some centimetres, near the origin."""
    latitude, longitude, altitude = ORIGIN
    sine = math.sin(math.radians(latitude))
    normal = 6378137.0 / math.sqrt(1 - 0.00669437999014 * sine**2)
    meridian = normal * (1 - 0.00669437999014) / (1 - 0.00669437999014 * sine**2)
    return (latitude + math.degrees(north / (meridian + altitude)),
            longitude + math.degrees(east / ((normal + altitude) * math.cos(math.radians(latitude)))), altitude + up)


def car(seconds, imu=lambda msg, t: msg, fix=lambda msg, t: msg, change=lambda msg: msg, sigma_m=0.3):
    """Samples of an IMU in the base, fixes of an antenna above it, scans. `imu` and `fix` change a message, or leave it
    out: None. `change`: of each scan."""
    drive, rng = Drive(seconds), np.random.default_rng(4)
    messages = [(0.0, "/tf_static", transform(0, "base_link", frame, place))
                for frame, place in (("laser", (LIDAR_X_M, 0, 0.3)), ("imu", (0, 0, 0)), ("gps", (0, 0, 0.5)))]
    for k in range(int(100 * seconds)):
        t = k / 100
        msg = Imu()
        msg.header.stamp, msg.header.frame_id = at(t), "imu"
        noise = rng.normal(0, 1, 6)
        force, rate = msg.linear_acceleration, msg.angular_velocity
        force.x = drive.at(t, "acceleration") + 0.05 * noise[0]
        force.y = drive.at(t, "speed") * drive.at(t, "rate") + 0.05 * noise[1]
        force.z = GRAVITY + 0.05 * noise[2]
        rate.x, rate.y, rate.z = 0.003 * noise[3], 0.003 * noise[4], drive.at(t, "rate") + 0.003 * noise[5]
        msg = imu(msg, t)
        if msg is not None:
            messages.append((t + 0.001, "/imu", msg))
    for k in range(int(5 * seconds)):
        t = 0.013 + k / 5
        x, y, _ = drive.pose(t)
        noise = rng.normal(0, sigma_m, 3)
        msg = NavSatFix()
        msg.header.stamp, msg.header.frame_id = at(t), "gps"
        msg.latitude, msg.longitude, msg.altitude = geodetic(x + noise[0], y + noise[1], 0.5 + 2 * noise[2])
        msg.status.service, msg.position_covariance_type = 1, 2
        msg.position_covariance = [sigma_m**2, 0, 0, 0, sigma_m**2, 0, 0, 0, 4 * sigma_m**2]
        msg = fix(msg, t)
        if msg is not None:
            messages.append((t + 0.05, "/fix", msg))
    for k in range(int(5 * seconds)):
        t = 0.05 + k / 5
        msg = scan(t, drive.pose(t), HOUSE, beams=361, range_max=40.0, sigma_m=0.02)
        messages.append((t + 0.01, "/scan", change(msg)))
    return messages


def looking(place, to):
    """Axes of a camera in columns: x to the right, y down, z ahead."""
    z = np.subtract(to, place)
    z = z / np.linalg.norm(z)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], 1)


def camera(images=14, size=48, focal_px=44.0, with_car=True, labels=lambda pixels: pixels, turned=np.eye(3)):
    """A camera goes along an arc around a car and labels it. `turned`: the axes that TF has, in those of the camera."""
    messages, half = [], (size - 1) / 2
    u, v = np.meshgrid((np.arange(size) - half) / focal_px, (np.arange(size) - half) / focal_px)
    for k in range(images):
        angle = 0.16 * k
        place = np.array([30 * math.cos(angle), 30 * math.sin(angle), CAMERA_HEIGHT_M])
        R = looking(place, (0.0, 0.0, 0.0))
        rays = np.stack([u.ravel(), v.ravel(), np.ones(size * size)], 1) @ R.T
        with np.errstate(divide="ignore"):
            to_low, to_high = ((bound - place) / rays for bound in (np.array([CAR[0] - 2.2, CAR[1] - 0.9, 0.0]),
                                                                    np.array([CAR[0] + 2.2, CAR[1] + 0.9, 1.5])))
        enters, leaves = np.minimum(to_low, to_high).max(1), np.maximum(to_low, to_high).min(1)
        hit = (enters <= leaves) & (leaves > 0) & with_car
        t = 0.5 * k
        header = {"stamp": at(t), "frame_id": "camera"}
        image, info = Image(), CameraInfo()
        for msg in (image, info):
            msg.header.stamp, msg.header.frame_id, msg.width, msg.height = header["stamp"], "camera", size, size
        info.K = [focal_px, 0, half, 0, focal_px, half, 0, 0, 1]
        info.P = [focal_px, 0, half, 0, 0, focal_px, half, 0, 0, 0, 1, 0]
        info.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
        info.distortion_model = "plumb_bob"
        image.encoding, image.step = "32FC1", 4 * size
        image.data = labels(hit.reshape(size, size).astype("<f4")).astype("<f4").tobytes()
        messages += [(t, "/tf", transform(t, "world", "camera", place, quaternion_of(R @ turned))),
                     (t + 0.001, "/camera/camera_info", info), (t + 0.002, "/camera/labels", image)]
    return messages


def elevation(path, height_m=0.0, shift=(0.0, 0.0)):
    """100 m x 100 m of level ground about the origin, as an ASCII grid."""
    rows = "\n".join(" ".join([f"{height_m:g}"] * 50) for _ in range(50))
    path.write_text(f"ncols 50\nnrows 50\nxllcorner {-50.0 + shift[0]}\nyllcorner {-50.0 + shift[1]}\ncellsize 2.0\n"
                    f"NODATA_value -9999\n{rows}\n")
    return path


def elevation_in(path, crs, west, north, pixel, height_m=0.0, band=""):
    """The same pixels with the coordinates of a CRS, and what a band says of itself, as GDAL's XML."""
    grid = elevation(path.with_suffix(".asc"), height_m)
    source = f'<SimpleSource><SourceFilename relativeToVRT="1">{grid.name}</SourceFilename><SourceBand>1</SourceBand>'
    path.write_text(f'<VRTDataset rasterXSize="50" rasterYSize="50"><SRS>{crs}</SRS>'
                    f"<GeoTransform>{west!r}, {pixel!r}, 0, {north!r}, 0, {-pixel!r}</GeoTransform>"
                    f'<VRTRasterBand dataType="Float32" band="1">{band}{source}</SimpleSource></VRTRasterBand>'
                    "</VRTDataset>")
    return path
