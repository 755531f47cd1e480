#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bags of what a camera sees of analytic scenes: label images, camera_info and poses.

    scripts/evaluation/grid_bags.py --tool build/grid_scenes --folder DIR [--scenes NAME...] [--sizes N...] [--seeds N]

For each scene DIR/NAME_SIZE_SEED/ gets labels.bag beside dem.tif and case.json, the truth. `labels.bag` has
/camera/labels (32FC1) and /camera/camera_info of frame camera_optical, /tf world -> base_link at 50 Hz and /tf_static
base_link -> camera_optical.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

START_S = 1000.0
TF_HZ = 50.0
# Of the camera on its vehicle: ahead of it and below.
P_BASE_CAMERA_M = np.array([0.1, 0.0, -0.05])
R_BASE_CAMERA = Rotation.from_euler("ZYX", [0.0, np.radians(20.0), 0.0]) * Rotation.from_matrix(
    [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])


def make_cases(tool, folder, scenes, sizes, seeds, first_seed=1):
    """The folders, made by the tool."""
    subprocess.run([str(tool), "--write", str(folder), "--scenes", *scenes, "--sizes", *map(str, sizes),
                    "--seeds", str(seeds), "--first-seed", str(first_seed)], check=True)
    return [folder / f"{scene}_{size}_{seed}" for scene in scenes for size in sizes
            for seed in range(first_seed, first_seed + seeds)]


def labels_of(folder, case):
    """Images x rows x columns."""
    return np.fromfile(folder / "labels.f32", dtype=np.float32).reshape(-1, case["height"], case["width"])


def image_msg(stamp, pixels):
    """A label image."""
    from sensor_msgs.msg import Image
    pixels = np.ascontiguousarray(pixels, dtype="<f4")
    msg = Image(height=pixels.shape[0], width=pixels.shape[1], encoding="32FC1", step=4 * pixels.shape[1],
                data=pixels.tobytes())
    msg.header.stamp, msg.header.frame_id = stamp, "camera_optical"
    return msg


def camera_info_msg(stamp, case):
    """The camera of a case."""
    from sensor_msgs.msg import CameraInfo
    fx, fy, cx, cy = (case[key] for key in ("fx", "fy", "cx", "cy"))
    msg = CameraInfo(height=case["height"], width=case["width"], distortion_model="plumb_bob", D=[0.0] * 5,
                     K=[fx, 0, cx, 0, fy, cy, 0, 0, 1], R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
                     P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0])
    msg.header.stamp, msg.header.frame_id = stamp, "camera_optical"
    return msg


def targets_of(message):
    """Those of a TargetArray, as a line of grid_bag has them."""
    return [{"id": t.id, "x": t.position.x, "y": t.position.y, "z": t.position.z, "covariance": list(t.covariance),
             "area_m2": t.area, "p": t.probability} for t in message.targets]


def transform_msg(stamp, parent, child, p, q):
    """A transform."""
    from geometry_msgs.msg import TransformStamped
    msg = TransformStamped(child_frame_id=child)
    msg.header.stamp, msg.header.frame_id = stamp, parent
    (msg.transform.translation.x, msg.transform.translation.y, msg.transform.translation.z) = map(float, p)
    (msg.transform.rotation.x, msg.transform.rotation.y, msg.transform.rotation.z,
     msg.transform.rotation.w) = map(float, q)
    return msg


def write_bag(folder, change=lambda messages: messages):
    """labels.bag of a folder; `change` gets and returns the list of (time, topic, message)."""
    import rosbag
    import rospy
    from tf2_msgs.msg import TFMessage
    case = json.loads((folder / "case.json").read_text())
    at = lambda s: rospy.Time.from_sec(round(START_S + s, 9))
    poses = np.array([image["pose"] for image in case["images"]])
    times_s = np.array([image["stamp_ns"] * 1e-9 for image in case["images"]])
    cameras = Rotation.from_quat(poses[:, 3:])
    bases = cameras * R_BASE_CAMERA.inv()
    places = poses[:, :3] - bases.apply(P_BASE_CAMERA_M)
    messages = [(at(-1.0), "/tf_static", TFMessage([transform_msg(
        at(-1.0), "base_link", "camera_optical", P_BASE_CAMERA_M, R_BASE_CAMERA.as_quat())]))]
    # TF has each image's pose at its stamp, and others between.
    ticks = np.unique(np.round(
        np.concatenate([times_s, np.arange(times_s[0], times_s[-1] + 0.5 / TF_HZ, 1.0 / TF_HZ)]), 6))
    ticks = ticks[ticks <= times_s[-1]]
    turns = Slerp(times_s, bases)(ticks) if len(times_s) > 1 else bases
    for k, tick in enumerate(ticks):
        place = [np.interp(tick, times_s, places[:, i]) for i in range(3)]
        messages.append((at(tick), "/tf", TFMessage([transform_msg(at(tick), "world", "base_link", place,
                                                                   turns[k].as_quat())])))
    for time_s, pixels in zip(times_s, labels_of(folder, case)):
        messages.append((at(time_s + 0.03), "/camera/camera_info", camera_info_msg(at(time_s), case)))
        messages.append((at(time_s + 0.05), "/camera/labels", image_msg(at(time_s), pixels)))
    with rosbag.Bag(str(folder / "labels.bag"), "w") as bag:
        for time, topic, message in sorted(change(messages), key=lambda entry: entry[0]):
            bag.write(topic, message, time)
    return folder / "labels.bag"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tool", required=True, type=pathlib.Path, help="grid_scenes")
    parser.add_argument("--folder", required=True, type=pathlib.Path)
    parser.add_argument("--scenes", nargs="+", default=["orbit"])
    parser.add_argument("--sizes", nargs="+", type=int, default=[112])
    parser.add_argument("--seeds", type=int, default=1)
    arguments = parser.parse_args()
    for folder in make_cases(arguments.tool, arguments.folder, arguments.scenes, arguments.sizes, arguments.seeds):
        print(write_bag(folder))


if __name__ == "__main__":
    main()
