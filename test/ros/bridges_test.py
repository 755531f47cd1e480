#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The bridges in a workspace that has the messages of costmap_converter and obstacle_detector, as catkin_make builds it:
Debian has neither package, so test/ros/bridges stands in for them."""
import importlib
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[2]
PACKAGES = {"costmap_converter": "ObstacleArrayMsg", "obstacle_detector": "Obstacles"}


def run(*words):
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise AssertionError(f"{words}:\n{result.stdout[-4000:]}\n{result.stderr[-4000:]}")
    return result.stdout


class BridgesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = cls.enterClassContext(tempfile.TemporaryDirectory())
        cls.workspace = pathlib.Path(folder)
        packages = cls.workspace / "src"
        packages.mkdir()
        (packages / "CMakeLists.txt").symlink_to("/usr/share/catkin/cmake/toplevel.cmake")
        (packages / "situation_awareness").symlink_to(SOURCE)
        for package in PACKAGES:
            (packages / package).symlink_to(SOURCE / "test/ros/bridges" / package)
        cls.build = cls.workspace / "build"
        run("cmake", "-S", packages, "-B", cls.build, "-DSITUATION_AWARENESS_SIM=OFF", "-DCMAKE_BUILD_TYPE=Debug",
            f"-DCATKIN_DEVEL_PREFIX={cls.workspace}/devel", "-DSITUATION_AWARENESS_WERROR=ON")
        run("cmake", "--build", cls.build, "--parallel", os.cpu_count(), "--target", "bridges_gtest",
            *(f"{package}_generate_messages_py" for package in PACKAGES))

    def test_1_conversions(self):
        print(run(next(self.build.rglob("bridges_gtest"))))

    def test_2_the_programs_turn_a_map_into_obstacles(self):
        sys.path.append(str(next(self.workspace.glob("devel/lib/python3*/*-packages"))))
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
        import rospy
        from ros_support import Latest, wait_until
        from situation_awareness.msg import MappedObject, MappedObjectArray
        programs = [["rosmaster", "--core", "-p", str(port)]]
        programs += [[str(self.workspace / f"devel/lib/situation_awareness/{package}_bridge"),
                      f"obstacles:={package}/obstacles"] for package in PACKAGES]
        for program in programs:
            process = subprocess.Popen(program)
            self.addCleanup(process.wait)
            self.addCleanup(process.terminate)
        rospy.init_node("bridges_test")  # waits for the master
        ellipse = MappedObject(id=3, rx=0.5, ry=0.2)
        ellipse.pose.orientation.w = 1.0
        publisher = rospy.Publisher("objects", MappedObjectArray, queue_size=1)
        received = {package: Latest(f"{package}/obstacles", getattr(importlib.import_module(f"{package}.msg"), kind))
                    for package, kind in PACKAGES.items()}

        def both_came():
            publisher.publish(MappedObjectArray(objects=[ellipse]))
            return all(latest.messages for latest in received.values())
        wait_until(both_came, 20.0, "obstacles")
        self.assertEqual(received["costmap_converter"].messages[0].obstacles[0].id, 3)
        self.assertEqual(received["obstacle_detector"].messages[0].circles[0].true_radius, 0.5)


if __name__ == "__main__":
    unittest.main(verbosity=2)
