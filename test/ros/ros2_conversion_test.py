#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/ros2_to_ros1 makes the bag of ROS 1 of a recording of ROS 2: by rosbags of PyPI, which it installs."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosbag
from std_msgs.msg import String

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import ros2_recordings  # noqa: E402
import small_bags as bags  # noqa: E402
from bag_tools import ROOT, run_program  # noqa: E402

SCRIPT = ROOT / "scripts" / "ros2_to_ros1"
CONFIG = pathlib.Path(__file__).resolve().parent / "objects_without_model.yaml"


def camera():
    """With a camera whose matrices all differ: a reader that takes one for another makes another message."""
    messages = bags.camera()
    for _, topic, msg in messages:
        if topic.endswith("camera_info"):
            msg.D = [0.1, -0.2, 0.001, 0.002, 0.05]
            msg.R = [0.8, 0.6, 0.0, -0.6, 0.8, 0.0, 0.0, 0.0, 1.0]
            msg.K[0], msg.P[3] = msg.K[0] + 1.0, 0.25
    return messages


class Ros2ConversionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.python = cls.folder / "venv/bin/python"
        subprocess.run(["/usr/bin/python3", "-m", "venv", cls.folder / "venv"], check=True)
        installed = subprocess.run([cls.python, "-m", "pip", "install", "-q", "rosbags>=0.11,<0.12"], check=False)
        if installed.returncode != 0:
            print("rosbags cannot be installed")
            sys.exit(77)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def convert(self, recording, code=0):
        bag = self.folder / f"{recording.name}_{len(list(self.folder.iterdir()))}.bag"
        done = subprocess.run([self.python, SCRIPT, recording, bag], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              text=True, check=False)
        self.assertEqual((done.returncode, bag.exists()), (code, code == 0), done.stdout)
        self.assertEqual(list(self.folder.glob("*.part*")), [])
        return bag, done.stdout

    def rosbags_convert(self, source, target, *options):
        subprocess.run([self.python.with_name("rosbags-convert"), "--src", source, "--dst", target, *options],
                       check=True, stdout=subprocess.PIPE)
        return target

    def assert_has(self, bag, messages):
        contents = []
        for path in (bag, bags.write(self.folder / "ideal.bag", messages)):
            with rosbag.Bag(str(path)) as recording:
                contents.append(sorted((at, topic, str(msg)) for topic, msg, at in recording))
                types = {c.topic: (c.datatype, c.md5sum) for c in recording._get_connections()}
                contents[-1].append(types)
        self.assertEqual(len(contents[0]), len(contents[1]))
        for found, expected in zip(*contents):
            self.assertEqual(found, expected)

    def test_all_messages_of_a_robot_are_the_same(self):
        messages = bags.room(2.0)
        folder = ros2_recordings.write_folder(self.folder / "robot", messages)
        bag, _ = self.convert(folder)
        self.assert_has(bag, messages)
        with rosbag.Bag(str(bag)) as converted:
            latching = {one.topic: one.header.get("latching") for one in converted._get_connections()}
        self.assertEqual((latching["/tf_static"], latching["/tf"]), (b"1", b"0"))
        outputs = []
        for recording in (bags.write(self.folder / "ideal.bag", messages), bag):
            out = self.folder / "out.jsonl"
            done = run_program("objects_bag", recording, "--world-frame", "odom", "--config", CONFIG, "--out", out)
            self.assertEqual(done.returncode, 0, done.stdout)
            outputs.append(out.read_bytes())
        self.assertEqual(*outputs)
        mcap = self.rosbags_convert(folder, self.folder / "mcap", "--dst-storage", "mcap",
                                    "--src-typestore", "ros2_humble")
        for recording in (folder / "run_0.db3", mcap, next(mcap.glob("*.mcap"))):
            self.assert_has(self.convert(recording)[0], messages)
        (mcap / "metadata.yaml").unlink()  # as a recorder that was killed
        self.assert_has(self.convert(mcap)[0], messages)

    def test_all_messages_of_a_camera_are_the_same(self):
        messages = camera()
        self.assert_has(self.convert(ros2_recordings.write_database(self.folder / "camera.db3", messages))[0], messages)

    def test_all_messages_of_a_car_are_the_same(self):
        messages = bags.car(2.0)
        self.assert_has(self.convert(ros2_recordings.write_folder(self.folder / "car", messages))[0], messages)

    def test_a_topic_whose_type_nothing_defines_is_left_out(self):
        class Own(String):
            _type = "my_robot/Own"

        messages = bags.room(0.5)
        path = ros2_recordings.write_database(self.folder / "own.db3", [*messages, (0.1, "/own", Own("x"))])
        bag, said = self.convert(path)
        self.assertIn("/own is left out: nothing defines my_robot/msg/Own", said)
        self.assert_has(bag, messages)

    def test_a_bag_of_another_compression_is_written_anew(self):
        messages = bags.room(1.0)
        bag = bags.write(self.folder / "plain.bag", messages)
        other = self.rosbags_convert(bag, self.folder / "lz4.bag", "--compress", "lz4")
        out = self.folder / "out.jsonl"
        done = run_program("objects_bag", other, "--world-frame", "odom", "--config", CONFIG, "--out", out)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("lz4.bag: unsupported compression: lz4 of another writer", done.stdout)
        self.assert_has(self.convert(other)[0], messages)

    def test_says_what_is_wrong(self):
        damaged = self.folder / "damaged.mcap"
        damaged.write_bytes(b"\x89MCAP0\r\n" + bytes(100))
        other = ros2_recordings.write_database(self.folder / "ros1.db3", bags.room(0.2), serialization="ros1")
        for recording in (damaged, other, self.folder / "none.db3"):
            _, said = self.convert(recording, code=1)
            self.assertEqual(said.count("\n"), 1, said)
            self.assertIn(f"ros2_to_ros1: {recording}: ", said)


if __name__ == "__main__":
    unittest.main()
