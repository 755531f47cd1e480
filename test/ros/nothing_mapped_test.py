#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A run of a bag tool that maps nothing ends with 1 and the one reason that a user can act on; one whose map is empty
because nothing is there ends with 0. A case is a row of the table: no roscore."""
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

import genpy
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import small_bags as bags  # noqa: E402
from bag_tools import run_program  # noqa: E402

CONFIG = pathlib.Path(__file__).resolve().parent / "objects_without_model.yaml"
WORLD = pathlib.Path(__file__).resolve().parents[2] / "models/worlds/orchard.xml"


class Case:
    """`write` makes the files of a run in a folder and returns its arguments; `parts` are in its last line on stderr, the
    one sentence, or among its lines if it is `warned` of something as well. `code`: None where a map that is warned of may
    be made or not."""

    def __init__(self, name, tool, write, *parts, code=1, warned=False):
        self.name, self.tool, self.write, self.parts, self.code, self.warned = name, tool, write, parts, code, warned


def objects(*options, **changes):
    def write(folder):
        return [bags.write(folder / "in.bag", bags.room(2.0, **changes)), "--world-frame", "odom", "--config", CONFIG, *options]
    return write


def polygons(*options, spread=1.0, extra=(), keep=lambda entry: True, **changes):
    def write(folder):
        messages = [entry for entry in bags.room(**changes) if keep(entry)] + list(extra)
        bag = bags.write(folder / "in.bag", messages)
        return [bag, "--reflectors", bags.reflectors_yaml(folder / "reflectors.yaml", spread), *options]
    return write


def polygons_by_tf(*options, **changes):
    def write(folder):
        return [bags.write(folder / "in.bag", bags.room(2.0, **changes)), "--localization", "tf", "--world-frame", "odom", *options]
    return write


def reflectors(*options, **changes):
    def write(folder):
        return [bags.write(folder / "in.bag", bags.room(**changes)), *options]
    return write


def splinegons(*options, seconds=12.0, **changes):
    def write(folder):
        return [bags.write(folder / "in.bag", bags.car(seconds, **changes)), *options]
    return write


def grid(height_m=0.0, shift=(0.0, 0.0), options=(), **changes):
    def write(folder):
        return [bags.write(folder / "in.bag", bags.camera(**changes)), "--world-frame", "world", "--dem",
                bags.elevation(folder / "dem.asc", height_m, shift), *options]
    return write


def changed_bag(change, *options, name="in.bag", compression="none"):
    """objects_bag of a room's bag of which `change` makes other bytes."""
    def write(folder):
        bag = bags.write(folder / "whole.bag", bags.room(2.0), compression)
        (folder / name).write_bytes(change(bag.read_bytes()))
        return [folder / name, "--world-frame", "odom", "--config", CONFIG, *options]
    return write


def without_index(data):
    """As a recorder leaves it that did not close it: where the index will be is not known yet."""
    return data.replace(b"index_pos=" + data.split(b"index_pos=")[1][:8], b"index_pos=" + bytes(8))[:-2000]


def lz4_of_others(data):
    """With the size of the content in the head of its frames, as the library liblz4 has it where it is told."""
    return data.replace(b"\x04\x22\x4d\x18\x64", b"\x04\x22\x4d\x18\x48")


def files(*names, data=b"", tool_options=("--world-frame", "odom", "--config", CONFIG)):
    """What objects_bag is given is the first of the files, or the folder that has them."""
    def write(folder):
        for name in names:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(data)
        return [folder / names[0] if len(names) == 1 else (folder / names[0]).parent, *tool_options]
    return write


def split(parts, *given):
    """A room's recording in `parts` bags, and those of them that are given."""
    def write(folder):
        paths = bags.write_split(folder, bags.room(2.0), parts)
        return [*(paths[i] for i in given), "--world-frame", "odom", "--config", CONFIG]
    return write


def grid_in(crs, west, north, pixel, height_m=0.0, options=(), band=""):
    def write(folder):
        return [bags.write(folder / "in.bag", bags.camera()), "--world-frame", "world", "--dem",
                bags.elevation_in(folder / "dem.vrt", crs, west, north, pixel, height_m, band), *options]
    return write


def ranges(value):
    """A change of a scan: all ranges are so."""
    def change(msg):
        msg.ranges = [value] * len(msg.ranges)
        return msg
    return change


def without_intensities(msg):
    msg.intensities = []
    return msg


def times(vector, x, y, z):
    vector.x, vector.y, vector.z = x * vector.x, y * vector.y, z * vector.z


def of_imu(force=(1, 1, 1), rate=(1, 1, 1), lift=0.0):
    """A change of a sample: factors of x, y and z, before which `lift` is added to the force upwards."""
    def change(msg, _):
        msg.linear_acceleration.z += lift
        times(msg.linear_acceleration, *force)
        times(msg.angular_velocity, *rate)
        return msg
    return change


def later(seconds):
    """A change of stamps."""
    def change(msg, _):
        msg.header.stamp += genpy.Duration.from_sec(seconds)
        return msg
    return change


def no_fix(msg, _):
    msg.status.status = -1
    return msg


ORIGIN = ("--origin", "47.5,8.5,460")
DEGREES = (8.4993, 47.5007, 2.8e-5)  # west, north and pixel of bags.elevation_in around ORIGIN
IN_G, IN_DEGREES, DOWN = (1 / bags.GRAVITY,) * 3, (math.degrees(1),) * 3, (1, -1, -1)
FOOTPRINT = ("odom", "base_footprint")
BODY_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # x ahead, y left, z up

CASES = [
    # What is not there, or called otherwise.
    Case("namespaced_tf", "objects_bag", objects(tf="/robot1/tf"), "/robot1/tf", "--tf-topic"),
    Case("namespaced_tf_read", "objects_bag", objects("--tf-topic", "/robot1/tf", tf="/robot1/tf"), code=0),
    Case("namespaced_tf_of_polygons", "polygons_bag", polygons_by_tf(tf="/robot1/tf"), "/robot1/tf", "--tf-topic"),
    Case("namespaced_tf_of_reflectors", "polygons_bag", polygons(tf="/robot1/tf"), "/robot1/tf", "--tf-topic"),
    Case("namespaced_tf_of_reflectors_read", "polygons_bag", polygons("--tf-topic", "robot1/tf", tf="/robot1/tf"), code=0),
    Case("world_frame", "objects_bag", objects("--world-frame", "wrold"), "TF does not connect wrold with laser, it has no frame wrold", "base_link, laser, odom"),
    Case("no_mounting", "objects_bag", objects(mount=False), "it has no frame laser"),
    Case("no_frame_id", "polygons_bag", polygons(frames=("", "")), "/odom has no frame_id", "--odom-frame"),
    Case("no_child_frame_id", "polygons_bag", polygons(frames=("odom", "")), "/odom has no child_frame_id", "--base-frame"),
    Case("no_child_frame_id_of_survey", "record_reflectors", reflectors(frames=("odom", "")), "/odom has no child_frame_id"),
    # TF has the poses: odometry would only name the base.
    Case("no_frame_id_by_tf", "polygons_bag", polygons_by_tf(frames=("", "")), code=0),
    Case("no_child_frame_id_by_tf", "polygons_bag", polygons_by_tf(frames=("odom", "")), code=0),
    Case("other_child_frame_id_by_tf", "polygons_bag", polygons_by_tf(frames=FOOTPRINT), code=0),
    Case("frames_given", "polygons_bag", polygons("--odom-frame", "odom", "--base-frame", "base_link", frames=("", "")),
         code=0),
    Case("other_child_frame_id", "polygons_bag", polygons(frames=FOOTPRINT), "TF does not connect base_footprint with laser, it has no frame base_footprint"),
    Case("unconnected_child_frame_id", "polygons_bag",
         polygons(frames=FOOTPRINT, extra=[(0.0, "/tf_static", bags.transform(0, "base_footprint", "camera"))]),
         "TF does not connect base_footprint with laser"),
    Case("unconnected_child_frame_id_of_survey", "record_reflectors", reflectors(frames=FOOTPRINT),
         "it has no frame base_footprint"),
    Case("base_is_a_child", "polygons_bag",
         polygons(frames=FOOTPRINT, extra=[(0.0, "/tf_static", bags.transform(0, "base_link", "base_footprint"))]), code=0),
    Case("base_is_a_parent", "polygons_bag",
         polygons(frames=FOOTPRINT, extra=[(0.0, "/tf_static", bags.transform(0, "base_footprint", "base_link"))],
                  keep=lambda entry: entry[1] != "/tf"), code=0),
    Case("base_of_splinegons", "splinegons_bag",
         splinegons("--localization", "tf", "--world-frame", "base_link", "--base-frame", "rover"), "it has no frame rover"),
    Case("lidar_of_splinegons", "splinegons_bag", splinegons("--lidar-frame", "velodyne", seconds=25.0),
         "it has no frame velodyne"),
    Case("no_odometry", "polygons_bag", polygons(keep=lambda entry: entry[1] != "/odom"),
         "topic /odom is not in the bag; topics of type nav_msgs/Odometry: none"),
    Case("other_odometry", "polygons_bag", polygons("--odom-topic", "/wheels"),
         "topics of type nav_msgs/Odometry: /odom"),
    Case("other_odometry_of_survey", "record_reflectors", reflectors("--odom-topic", "/wheels"),
         "topics of type nav_msgs/Odometry: /odom"),
    # Files that are no bag of ROS 1, or none that can be read.
    Case("no_such_bag", "objects_bag", lambda folder: [folder / "in.bag"], "in.bag: no such bag"),
    Case("no_bag", "objects_bag", changed_bag(lambda data: b"a text"), "damaged, or no bag"),
    Case("cut_in_the_middle", "objects_bag", changed_bag(lambda data: data[:len(data) // 2]), "cut short",
         "rosbag reindex "),
    Case("cut_near_the_end", "objects_bag", changed_bag(lambda data: data[:-5]), "cut short", "rosbag reindex "),
    Case("not_closed", "objects_bag", changed_bag(without_index, name="in.bag.active"), "recorded still",
         "rosbag reindex ", "in.bag.active makes"),
    Case("damaged_message", "objects_bag",
         changed_bag(lambda data: data[:5000] + bytes(20000) + data[25000:]), "in.bag: damaged"),
    Case("lz4_of_others", "objects_bag", changed_bag(lz4_of_others, compression="lz4"),
         "in.bag: unsupported compression: lz4 of another writer", "ros2_to_ros1 "),
    Case("lz4", "objects_bag", changed_bag(lambda data: data, compression="lz4"), code=0),
    Case("damaged_lz4", "objects_bag",
         changed_bag(lambda data: data[:6000] + bytes(2000) + data[8000:], compression="lz4"), "in.bag: damaged: "),
    Case("folder_of_bags", "objects_bag", files("run/a.bag", "run/b.bag"), "run: no bag: name the files of bags"),
    Case("ros2_database", "objects_bag", files("run.db3", data=b"SQLite format 3\0" + bytes(4000)),
         "run.db3: a recording of ROS 2 (SQLite)", "ros2_to_ros1 ", "run.db3 OUT.bag"),
    Case("ros2_database_of_another_name", "polygons_bag", files("run", data=b"SQLite format 3\0", tool_options=(
        "--localization", "tf")), "a recording of ROS 2 (SQLite)"),
    Case("ros2_mcap", "splinegons_bag", files("run.mcap", data=b"\x89MCAP0\r\n" + bytes(40), tool_options=()),
         "run.mcap: a recording of ROS 2 (MCAP)", "ros2_to_ros1 "),
    Case("ros2_folder", "map_bag", files("run/metadata.yaml", "run/run_0.db3", tool_options=()),
         "run: a recording of ROS 2 (a folder)", "ros2_to_ros1 "),
    Case("ros2_folder_without_metadata", "objects_bag", files("run/run_0.mcap", "run/run_1.mcap"),
         "run: a recording of ROS 2 (a folder)"),
    Case("ros2_metadata", "record_reflectors", files("metadata.yaml", tool_options=()), "a recording of ROS 2"),
    Case("ros2_compressed", "objects_bag", files("run_0.db3.zstd", data=b"\x28\xb5\x2f\xfd"),
         "a recording of ROS 2 (compressed)"),
    Case("split", "objects_bag", split(3, 0, 1, 2), code=0),
    Case("split_and_twice", "objects_bag", split(2, 0, 1, 0), "a_0.bag: the same bag as"),
    Case("split_without_transforms", "objects_bag", split(4, 2, 3), "a_2.bag and 1 more: nothing mapped",
         "it has no frame laser"),
    # Scans by which nothing can be mapped, and some that show that nothing is there.
    Case("no_numbers", "objects_bag", objects(change=ranges(math.nan)), "no beam of 19 scans hit anything", "27379 are no range"),
    Case("nothing_in_range", "polygons_bag", polygons_by_tf(change=ranges(math.inf)), "no beam of 19 scans hit anything"),
    Case("millimetres", "polygons_bag", polygons_by_tf(change=ranges(2500.0)), "27379 say that there is nothing"),
    Case("all_far", "objects_bag", objects(change=ranges(29.0)), "29.00 to 29.00 m", "scan/max_range_m"),
    Case("no_numbers_by_gps", "splinegons_bag", splinegons(seconds=25.0, change=ranges(math.nan)), "no beam of"),
    Case("an_empty_room", "objects_bag", objects(), code=0),
    # Reflectors.
    Case("dim", "polygons_bag", polygons(bright=240.0, dim=30.0), "the brightest beam is 240, below reflectors/min_intensity 430"),
    Case("dim_survey", "record_reflectors", reflectors(bright=240.0, dim=30.0),
         "the brightest beam is 240, below reflectors/min_intensity 430", "in two groups, up to 32 and from 240 on",
         "set reflectors/min_intensity and reflectors/min_peak_intensity to 88"),
    Case("of_0_to_1", "polygons_bag", polygons(bright=0.9, dim=0.05),
         "the brightest beam is 0.9, below reflectors/min_intensity 430", "reflectors/min_peak_intensity to 0.2"),
    Case("of_16_bits", "polygons_bag", polygons(bright=60000.0, dim=9000.0), code=0),
    Case("nearly_bright", "polygons_bag", polygons(bright=440.0),
         "the brightest beam is 440, below reflectors/min_peak_intensity 450"),
    Case("no_intensities", "polygons_bag", polygons(change=without_intensities), "the scans have no intensities"),
    Case("no_intensities_of_survey", "record_reflectors", reflectors(change=without_intensities),
         "the scans have no intensities"),
    Case("all_bright", "polygons_bag", polygons(bright=900.0, dim=800.0), code=0),  # by their width, and what is behind
    Case("other_reflectors", "polygons_bag", polygons(spread=1.3), "the pose by reflectors is not known", "of 6"),
    Case("reflectors", "polygons_bag", polygons(), code=0),
    # GPS and IMU.
    Case("force_in_g", "splinegons_bag", splinegons(imu=of_imu(IN_G)), "the force that the IMU measures is not that of gravity: it is 1 at rest, as in g"),
    Case("force_in_milli_g", "splinegons_bag", splinegons(imu=of_imu((1000 / bags.GRAVITY,) * 3)), "not that of gravity: it is about 1000 at rest"),
    Case("force_in_cm_s2", "splinegons_bag", splinegons(imu=of_imu((100,) * 3)), "not that of gravity: it is about 1000 at rest", "cm/s^2"),
    Case("force_in_feet", "splinegons_bag", splinegons(imu=of_imu((1 / 0.3048,) * 3)), "not that of gravity: m/s^2"),
    Case("no_gravity", "splinegons_bag", splinegons(imu=of_imu(lift=-bags.GRAVITY)), "not that of gravity: it is 0 at rest"),
    Case("no_gravity_and_axes_down", "splinegons_bag", splinegons(imu=of_imu(DOWN, DOWN, -bags.GRAVITY)), "not that of gravity: it is 0 at rest"),
    Case("no_force", "splinegons_bag", splinegons(imu=of_imu((0, 0, 0))), "not that of gravity: it is 0 at rest"),
    Case("force_down", "splinegons_bag", splinegons(imu=of_imu((1, 1, -1))), "gravity is not along the base's z", "NED"),
    Case("axes_down", "splinegons_bag", splinegons(imu=of_imu(DOWN, DOWN), seconds=30.0), "gravity is not along the base's z", "NED", "contradict each other"),
    Case("axes_down_in_g", "splinegons_bag", splinegons(imu=of_imu(np.multiply(DOWN, IN_G), DOWN)), "as in g"),
    Case("gravity_down", "splinegons_bag", splinegons(imu=of_imu((-1, -1, -1))), "gravity is not along the base's z", "NED"),
    Case("no_fix", "splinegons_bag", splinegons(fix=no_fix), "no usable fix yet", "dropped: no fix"),
    Case("no_imu", "splinegons_bag", splinegons(imu=lambda msg, t: msg if t < 0.5 else None), "dropped: fix ahead of the imu"),
    Case("car", "splinegons_bag", splinegons(seconds=25.0), code=0),
    Case("rates_in_degrees", "splinegons_bag", splinegons(seconds=60.0, imu=of_imu(rate=IN_DEGREES)),
         "the rates of the IMU and the fixes contradict each other: the rates turn 5", "as rates in deg/s do: rad/s", warned=True, code=None),
    Case("rates_in_degrees_and_down", "splinegons_bag", splinegons(seconds=40.0, imu=of_imu(rate=np.multiply(DOWN, IN_DEGREES))),
         "the rates turn -5", "rad/s are expected, positive to the left", warned=True, code=None),
    Case("rates_down", "splinegons_bag", splinegons(seconds=40.0, imu=of_imu(rate=DOWN)), "contradict each other: the rates turn -",
         "positive to the left is expected", warned=True, code=None),
    Case("rates_in_turns", "splinegons_bag", splinegons(seconds=60.0, imu=of_imu(rate=(1 / math.tau,) * 3)), "contradict each other", warned=True, code=None),
    Case("fixes_in_gps_time", "splinegons_bag", splinegons(fix=later(18)), "the stamps of the fixes are 18 s ahead of", "UTC", "fix ahead of the imu"),
    Case("imu_in_gps_time", "splinegons_bag", splinegons(imu=later(18)), "the stamps of the fixes are 18 s behind", "UTC"),
    Case("fixes_of_another_clock", "splinegons_bag", splinegons(fix=later(-500)), "the stamps of the fixes are 500.0 s behind those of the IMU"),
    Case("fixes_half_a_second_ahead", "splinegons_bag", splinegons(seconds=30.0, fix=later(0.6)), "the stamps of the fixes are 0.6 s ahead of those of the IMU", warned=True, code=None),
    # A camera over an elevation.
    Case("elsewhere", "grid_bag", grid(shift=(465000.0, 5247000.0)), "x 464950 to 465050", "the camera at (", "looks at (0.0, 0.0, 0.0)"),
    Case("lower", "grid_bag", grid(height_m=-47.0), "above the elevation", "z -47 to -47", "looks at", "zero of height"),
    Case("a_little_lower", "grid_bag", grid(height_m=-4.0), "m above the elevation, not on it", "zero of height"),
    Case("a_little_higher", "grid_bag", grid(height_m=5.0), "m below the elevation, not on it", "zero of height"),
    Case("higher", "grid_bag", grid(height_m=47.0), "27.0 m below the elevation", "zero of height"),
    Case("body_axes", "grid_bag", grid(turned=BODY_AXES), "above the horizon", "optical"),
    Case("no_label", "grid_bag", grid(labels=lambda pixels: np.full_like(pixels, 0.5)), "no label of 14 images is known"),
    Case("labels_of_bytes", "grid_bag", grid(labels=lambda pixels: 255 * pixels + 254), "no label of 14 images is known"),
    Case("band_of_feet", "grid_bag",
         grid_in("", -50.0, 50.0, 2.0, 100.0, band="<Offset>-100</Offset><UnitType>ft</UnitType>"), code=0),
    Case("band_of_degrees", "grid_bag", grid_in("", -50.0, 50.0, 2.0, band="<UnitType>degC</UnitType>"), "degC"),
    Case("degrees", "grid_bag", grid_in("EPSG:4326", *DEGREES), "EPSG:4326", "origin", "gdalwarp", "+lat_0=47.5"),
    Case("degrees_without_crs", "grid_bag", grid_in("", *DEGREES), "degrees", "-a_srs EPSG:4326"),
    Case("degrees_of_origin", "grid_bag", grid_in("EPSG:4326", *DEGREES, 460.0, [*ORIGIN, "--dem-vertical", "ellipsoid"]),
         code=0),
    Case("above_what", "grid_bag", grid_in("EPSG:4326", *DEGREES, 460.0, ORIGIN),
         "does not say what its heights are above", code=0, warned=True),
    Case("above_the_sea", "grid_bag", grid_in("EPSG:4326", *DEGREES, 412.6, [*ORIGIN, "--dem-vertical", "ellipsoid"]),
         "m above the elevation, not on it", "zero of height"),
    Case("above_the_sea_by_so_much", "grid_bag",
         grid_in("EPSG:4326", *DEGREES, 412.6, [*ORIGIN, "--dem-vertical", "egm2008", "--dem-geoid-m", "47.4"]), code=0),
    Case("above_the_sea_somewhere", "grid_bag", grid(options=("--dem-vertical", "egm96")), "egm96", "origin"),
    Case("metres_of_utm", "grid_bag", grid_in("EPSG:32632", 465000.0, 5247000.0, 2.0), "x 465000 to 465100",
         "the camera at (", "EPSG:32632", "gdalwarp"),
    Case("voids", "grid_bag", grid(height_m=-9999.0), "no height of the elevation is known"),
    Case("no_car", "grid_bag", grid(with_car=False), code=0),
    Case("car_on_ground", "grid_bag", grid(), code=0),
    # A simulation without a scan.
    Case("no_time", "simulate_bag", lambda folder: ["--world", WORLD, "--duration", "0.01"], "--duration"),
]


class NothingMappedTest(unittest.TestCase):
    def run_case(self, case):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            out = folder / "out"
            done = run_program(case.tool, *case.write(folder), "--out", out, stderr=subprocess.PIPE)
            said = done.stdout + done.stderr
            if case.code is not None:
                self.assertEqual(done.returncode, case.code, said)
            self.assertEqual(out.exists(), done.returncode == 0, said)
            self.assertEqual(list(folder.glob("*.part")), [])
            lines = [line for line in done.stderr.splitlines() if line.startswith(case.tool + ": ")]
            self.assertEqual(bool(lines), bool(case.parts), said)
            for part in case.parts:
                self.assertIn(part, "\n".join(lines) if case.warned else lines[-1], said)


for one in CASES:
    setattr(NothingMappedTest, "test_" + one.name, lambda self, case=one: self.run_case(case))

if __name__ == "__main__":
    unittest.main()
