#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet grid_mapping and grid_bag make the same of the same images; and what it does with bad ones."""
import copy
import filecmp
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np
import rosbag
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import grid_bags  # noqa: E402
from fault_record import fault  # noqa: E402
from ros_support import Latest, wait_until  # noqa: E402
from situation_awareness.msg import TargetArray  # noqa: E402
from situation_awareness.srv import SaveGrid  # noqa: E402

DEM = HERE.parents[1] / "data" / "flat.tif"
KINDS = {"/camera/labels": Image, "/camera/camera_info": CameraInfo, "/tf": TFMessage}


class GridMappingTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        [case] = grid_bags.make_cases(os.environ["GRID_SCENES"], cls.path, ["orbit"], [56], 1)
        cls.bag = grid_bags.write_bag(case)
        subprocess.run(["rosrun", "situation_awareness", "grid_bag", str(cls.bag), "--world-frame", "world", "--dem",
                        str(DEM), "--out", str(cls.path / "out.jsonl"), "--grid-out", str(cls.path / "offline.tif")],
                       check=True, timeout=60)
        cls.lines = [json.loads(line) for line in (cls.path / "out.jsonl").read_text().splitlines()]
        cls.targets = Latest("/targets", TargetArray)
        cls.grid, cls.cells = Latest("/grid", OccupancyGrid), Latest("/grid_cells", PointCloud2)
        cls.markers, cls.diagnostics = Latest("/semantic_map_markers", MarkerArray), Latest("/diagnostics", DiagnosticArray)
        cls.publishers = {topic: rospy.Publisher(topic, kind, queue_size=100, tcp_nodelay=True)
                          for topic, kind in KINDS.items()}
        cls.tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        links = [*cls.publishers.values(), cls.tf_static, cls.targets.subscriber, cls.grid.subscriber]
        wait_until(lambda: all(link.get_num_connections() > 0 for link in links), 20.0, "the nodelet")
        time.sleep(0.5)
        cls.images = []
        with rosbag.Bag(str(cls.bag)) as recording:
            for topic, msg, _ in recording.read_messages():
                if topic == "/tf_static":
                    cls.tf_static.publish(msg)
                    time.sleep(0.3)
                    continue
                cls.publishers[topic].publish(msg)
                if topic == "/tf":
                    cls.pose = msg
                if topic == "/camera/camera_info":
                    time.sleep(0.05)
                if topic == "/camera/labels":
                    cls.images.append(msg)
                    wait_until(lambda: cls.targets.messages and
                               cls.targets.messages[-1].header.stamp >= msg.header.stamp, 20.0, "targets")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def stay_until(self, stamp):
        """The camera stays where its last pose was."""
        self.pose.transforms[0].header.stamp = stamp
        self.publishers["/tf"].publish(self.pose)

    def test_targets_are_those_of_grid_bag(self):
        live = self.targets.messages[:len(self.lines)]
        self.assertEqual(len(live), len(self.lines))
        for message, line in zip(live, self.lines):
            self.assertEqual(message.header.frame_id, "world")
            self.assertAlmostEqual(message.header.stamp.to_sec(), line["stamp"], places=6)
            self.assertEqual(grid_bags.targets_of(message), line["targets"])
        self.assertEqual(len(live[-1].targets), 4)

    def test_grid_is_saved_as_by_grid_bag(self):
        saved = self.path / "live.tif"
        save = rospy.ServiceProxy("/grid_mapping/save_grid", SaveGrid)
        response = save(str(saved))
        self.assertTrue(response.success, response.message)
        self.assertTrue(filecmp.cmp(saved, self.path / "offline.tif", shallow=False))
        for file in ("relative.tif", "/nowhere/grid.tif"):
            response = save(file)
            self.assertFalse(response.success)
            self.assertIn(file, response.message)

    def test_grid_cells_and_markers_are_published(self):
        grids = {message.header.stamp: message for message in self.grid.messages}
        cells = next(message for message in reversed(self.cells.messages) if message.header.stamp in grids)
        grid = grids[cells.header.stamp]
        values = np.array(grid.data)
        self.assertEqual(len(values), grid.info.width * grid.info.height)
        self.assertEqual(grid.info.resolution, 0.5)
        self.assertTrue(((values >= -1) & (values <= 100)).all())
        self.assertEqual(cells.width * cells.height, (values >= 0).sum())
        car = self.lines[-1]["targets"][0]
        column = int((car["x"] - grid.info.origin.position.x) / grid.info.resolution)
        row = int((car["y"] - grid.info.origin.position.y) / grid.info.resolution)
        self.assertGreater(values[row * grid.info.width + column], 50)
        namespaces = {marker.ns for message in self.markers.messages for marker in message.markers}
        self.assertLessEqual({"target", "region", "label"}, namespaces)

    def keys(self):
        """Of what the stage has reported so far."""
        return {value.key for message in self.diagnostics.messages for status in message.status
                if "grid_mapping" in status.name for value in status.values}

    @fault("label images that cannot be used", "another encoding, too little data, another size than that of the camera, "
           "a number of 7", "each is dropped or, of the number, not used, and counted by its reason", times=4)
    def test_images_that_cannot_be_used_are_counted(self):
        self.stay_until(self.images[-1].header.stamp + rospy.Duration(0.005))

        def smaller(msg):
            msg.width -= 1

        for i, (reason, spoil) in enumerate((
                ("labels are not 32FC1", lambda msg: setattr(msg, "encoding", "mono8")),
                ("image with too little data", lambda msg: setattr(msg, "data", msg.data[:-4])),
                ("camera_info of another size", smaller),
                ("labels out of [0, 1]", lambda msg: setattr(msg, "data", np.float32(7).tobytes() + msg.data[4:])))):
            bad = copy.deepcopy(self.images[-1])
            bad.header.stamp += rospy.Duration(0, 10 * (i + 1))
            spoil(bad)
            self.publishers["/camera/labels"].publish(bad)
            wait_until(lambda reason=reason: any(reason in key for key in self.keys()), 10.0, reason)

    def test_images_that_tell_nothing_are_counted_and_the_targets_stay(self):
        unknown = copy.deepcopy(self.images[-1])
        unknown.header.stamp += rospy.Duration(0, 100)
        unknown.data = np.full(unknown.height * unknown.width, 0.5, dtype="<f4").tobytes()
        self.stay_until(unknown.header.stamp + rospy.Duration(0.006))
        self.publishers["/camera/labels"].publish(unknown)
        wait_until(lambda: self.targets.messages[-1].header.stamp == unknown.header.stamp, 10.0, "targets")
        self.assertEqual(len(self.targets.messages[-1].targets), 4)
        wait_until(lambda: any("no label is known" in key for key in self.keys()), 10.0, "the reason")

    def test_zz_reset_forgets_the_targets(self):  # the last one
        self.assertTrue(rospy.ServiceProxy("/grid_mapping/reset", Trigger)().success)
        again = copy.deepcopy(self.images[-1])
        again.header.stamp += rospy.Duration(0, 2000)
        self.stay_until(again.header.stamp + rospy.Duration(0.01))
        self.publishers["/camera/labels"].publish(again)
        wait_until(lambda: self.targets.messages[-1].header.stamp == again.header.stamp, 10.0, "targets")
        self.assertEqual(self.targets.messages[-1].targets, [])
        # What is found again has ids that nobody had.
        before = {target.id for message in self.targets.messages for target in message.targets}
        for _ in range(5):
            again.header.stamp += rospy.Duration(0.1)
            self.stay_until(again.header.stamp + rospy.Duration(0.01))
            self.publishers["/camera/labels"].publish(again)
            wait_until(lambda: self.targets.messages[-1].header.stamp == again.header.stamp, 10.0, "targets")
        found = {target.id for target in self.targets.messages[-1].targets}
        self.assertTrue(found)
        self.assertFalse(found & before)


if __name__ == "__main__":
    rospy.init_node("grid_mapping_test")
    rostest.rosrun("situation_awareness", "grid_mapping_test", GridMappingTest)
