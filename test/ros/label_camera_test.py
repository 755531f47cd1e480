#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator publishes the label cameras that the world's file asks for: what simulate_bag records, image by image
(label_camera_test.cpp has what the labels are), and their frames."""
import io
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosbag
import rospy
import rostest
from sensor_msgs.msg import CameraInfo, Image, LaserScan
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, wait_until  # noqa: E402

WORLD = pathlib.Path(__file__).resolve().parent / "label_camera.xml"
RATES_HZ = {"/label_camera": 5, "/second_eye/label_camera": 2}
TOPICS = {f"{camera}/{name}": kind for camera in RATES_HZ
          for name, kind in (("camera_info", CameraInfo), ("objects", Image), ("classes", Image))}
TOPICS["/second_eye/label_camera/image"] = Image
SECONDS = 6


def bytes_of(msg):
    """All fields but the sequence number."""
    msg.header.seq = 0
    buffer = io.BytesIO()
    msg.serialize(buffer)
    return buffer.getvalue()


class LabelCameraTest(unittest.TestCase):
    def test_topics_have_what_the_bag_has(self):
        static = Latest("/tf_static", TFMessage)
        scans = Latest("scan", LaserScan)  # the simulation waits for someone to see it
        wait_until(lambda: len(scans.messages) >= 10, 60.0, "scans, during which no image is drawn")
        topics = {topic: Latest(topic, kind) for topic, kind in TOPICS.items()}
        wait_until(lambda: scans.messages[-1].header.stamp.to_sec() >= 1000.0 + SECONDS, 60.0, "the end")
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "labels.bag"
            subprocess.run(["rosrun", "situation_awareness", "simulate_bag", "--world", WORLD, "--out", path,
                            "--duration", str(SECONDS), "--rate", "10"], check=True, timeout=60)
            with rosbag.Bag(str(path)) as bag:
                recorded = {topic: {msg.header.stamp: bytes_of(msg) for _, msg, _ in bag.read_messages([topic])}
                            for topic in TOPICS}
        for topic, latest in topics.items():
            common = [msg for msg in list(latest.messages) if msg.header.stamp in recorded[topic]]
            rate_hz = next(rate for camera, rate in RATES_HZ.items() if topic.startswith(camera + "/"))
            self.assertGreaterEqual(len(common), (SECONDS - 3) * rate_hz, topic)
            self.assertEqual(len({msg.header.stamp for msg in common}), len(common), topic)
            for msg in common:
                self.assertEqual(bytes_of(msg), recorded[topic][msg.header.stamp], topic)
        frames = {t.child_frame_id: t.header.frame_id for msg in static.messages for t in msg.transforms}
        for frame in ("eye", "second_eye", "lidar"):
            self.assertEqual(frames.get(frame), "robot", frame)
        names = [name for name, _ in rospy.get_published_topics()]
        self.assertNotIn("/label_camera/image", names, "the file asks for no colours")


if __name__ == "__main__":
    rospy.init_node("label_camera_test")
    rostest.rosrun("situation_awareness", "label_camera_test", LabelCameraTest)
