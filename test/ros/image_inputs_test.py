#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The same labels as they are, compressed, and with the camera_info of a lens whose images are rectified: live, the
targets are the same."""
import copy
import io
import os
import pathlib
import sys
import tempfile
import time
import unittest

import numpy as np
import PIL.Image
import rosbag
import rospy
import rostest
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import grid_bags  # noqa: E402
from ros_support import Diagnostics, Latest, wait_until  # noqa: E402
from situation_awareness.msg import TargetArray  # noqa: E402

NAMES = ("plain", "small", "rectified")
KINDS = {"/camera/labels": Image, "/camera/labels/compressed": CompressedImage, "/camera/rectified": Image,
         "/camera/camera_info": CameraInfo, "/camera/rectified_info": CameraInfo, "/tf": TFMessage}


def variants(topic, msg):
    """(topic, message) of all that is sent for one of the recording."""
    yield topic, msg
    if topic == "/camera/labels":
        file = io.BytesIO()
        PIL.Image.fromarray(np.frombuffer(msg.data, dtype="<f4").reshape(msg.height, msg.width)).save(file, "TIFF")
        yield topic + "/compressed", CompressedImage(msg.header, "32FC1; tiff compressed ", file.getvalue())
        yield "/camera/rectified", msg
    elif topic == "/camera/camera_info":
        of_lens = copy.deepcopy(msg)
        of_lens.D = [-0.25, 0.06, 0.0, 0.0, 0.0]
        of_lens.K = [1.3 * msg.K[0], 0, msg.K[2] + 4, 0, 1.3 * msg.K[4], msg.K[5] - 3, 0, 0, 1]
        yield "/camera/rectified_info", of_lens


class ImageInputsTest(unittest.TestCase):
    def test_targets_are_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            [case] = grid_bags.make_cases(os.environ["GRID_SCENES"], pathlib.Path(folder), ["orbit"], [56], 1)
            with rosbag.Bag(str(grid_bags.write_bag(case))) as recording:
                messages = [(topic, msg) for topic, msg, _ in recording.read_messages()]
        diagnostics = Diagnostics()
        targets = {name: Latest(f"/{name}/targets", TargetArray) for name in NAMES}
        publishers = {topic: rospy.Publisher(topic, kind, queue_size=100, tcp_nodelay=True)
                      for topic, kind in KINDS.items()}
        tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        wait_until(lambda: all(publisher.get_num_connections() > 2 for publisher in (publishers["/tf"], tf_static)) and
                   all(publisher.get_num_connections() > 0 for publisher in publishers.values()) and
                   all(latest.subscriber.get_num_connections() > 0 for latest in targets.values()), 30.0,
                   "the nodelets")
        for topic, msg in messages:
            if topic == "/tf_static":
                tf_static.publish(msg)
                time.sleep(0.5)
                continue
            for to, sent in variants(topic, msg):
                publishers[to].publish(sent)
            if topic == "/camera/camera_info":
                time.sleep(0.05)
            if topic == "/camera/labels":
                wait_until(lambda: all(latest.messages and latest.messages[-1].header.stamp >= msg.header.stamp
                                       for latest in targets.values()), 20.0, "targets of all")
        live = {name: [grid_bags.targets_of(message) for message in targets[name].messages] for name in NAMES}
        self.assertEqual(len(live["plain"][-1]), 4)
        self.assertEqual(live["small"], live["plain"])
        self.assertEqual(live["rectified"], live["plain"])
        for name, matrix in (("plain", "K"), ("rectified", "P")):
            stage = f"{name}/grid_mapping"
            self.assertEqual(diagnostics.stages[stage]["images have"], matrix + " of camera_info")
            self.assertEqual("images are taken for rectified" in diagnostics.summary(stage), name == "rectified")


if __name__ == "__main__":
    rospy.init_node("image_inputs_test")
    rostest.rosrun("situation_awareness", "image_inputs_test", ImageInputsTest)
