#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A master that starts anew under nodes that run: the map goes on over the links there are, and comes back, with its
parameters, when what feeds it was started anew as well. Needs masters of its own, so this is no rostest."""
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
PATIENCE_S = 60.0
MANAGER = "/objects_manager"
STAGES = ("/segmentation", "/detection", "/mapping")
MAX_RANGE_M = 7.5  # as no default is

# A robot: scans with transforms at 20 Hz, and a line per map that comes back.
ROBOT = """
import sys
sys.path.insert(0, sys.argv[1])
import rospy
from ros_support import Robot
from situation_awareness.msg import EllipseMap
rospy.init_node(sys.argv[2], disable_signals=True)
rospy.Subscriber("objects", EllipseMap, lambda msg: print(len(msg.ellipses), flush=True))
robot = Robot()
while True:
    robot.run(1)
"""


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_until(condition, what, timeout_s=PATIENCE_S):
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError(f"waited {timeout_s} s for {what}")


class MasterRestartTest(unittest.TestCase):
    def setUp(self):
        self.port = free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI=f"http://127.0.0.1:{self.port}", ROS_IP="127.0.0.1")
        self.processes = []
        self.folder = tempfile.TemporaryDirectory()
        self.master = self.start_master()
        config = pathlib.Path(self.folder.name) / "objects.yaml"
        config.write_text(f"scan: {{max_range_m: {MAX_RANGE_M}}}\ndetections: {{detector: least_squares}}\n")
        self.launch = self.start("launch", ["roslaunch", "--wait", str(ROOT / "launch/objects.launch"), "rviz:=false",
                                            f"config:={config}"])
        self.robot = self.start_robot("robot")
        wait_until(lambda: self.maps_of("robot") > 20, "the first maps")

    def tearDown(self):
        for process in reversed(self.processes):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                try:
                    process.wait(timeout=20)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        self.folder.cleanup()

    def start(self, name, command):
        with open(self.log(name), "ab") as log:
            process = subprocess.Popen(command, env=self.environment, stdout=log, stderr=subprocess.STDOUT)
        self.processes.append(process)
        return process

    def log(self, name):
        return pathlib.Path(self.folder.name) / f"{name}.log"

    def start_robot(self, name):
        return self.start(name, ["/usr/bin/python3", "-c", ROBOT, str(ROOT / "test/ros"), name])

    def start_master(self):
        """As roscore does: a master, and a /run_id of its own."""
        process = self.start("master", ["rosmaster", "--core", "-p", str(self.port)])
        self.server = xmlrpc.client.ServerProxy(self.environment["ROS_MASTER_URI"])

        def answers():
            try:
                return self.server.getPid("/test")[0] == 1
            except OSError:
                return False
        wait_until(answers, "the master")
        self.server.setParam("/test", "/run_id", f"run {time.monotonic()}")
        return process

    def end(self, process):
        process.kill()
        process.wait()

    def maps_of(self, name):
        """How many maps the robot of that name got that had something in them."""
        return sum(line.strip().isdigit() and int(line) > 0 for line in self.log(name).read_text().splitlines())

    def nodes(self):
        state = self.server.getSystemState("/test")[2]
        return {node for kind in state for _, names in kind for node in names}

    def assert_maps_go_on(self, seconds):
        for _ in range(int(seconds)):
            before = self.maps_of("robot")
            time.sleep(1.0)
            self.assertGreater(self.maps_of("robot"), before, "a second without a map")

    @fault("master out of reach", "stopped for 6 s, then it goes on", "maps go on, nothing ends")
    def test_1_no_master_for_a_while(self):
        """A link that is cut looks the same: nothing happens."""
        os.kill(self.master.pid, signal.SIGSTOP)
        self.assert_maps_go_on(6.0)
        os.kill(self.master.pid, signal.SIGCONT)
        self.assert_maps_go_on(6.0)
        self.assertIn(MANAGER, self.nodes())

    @fault("master restarts", "killed and started anew; 8 s later the robot is, too",
           "maps go on over the links there are; then the nodelets come back at the new master, with their parameters")
    def test_2_a_new_master_and_then_a_new_robot(self):
        self.end(self.master)
        self.assert_maps_go_on(3.0)
        self.master = self.start_master()
        self.assert_maps_go_on(8.0)  # longer than it takes to see the new master and to end
        self.assertNotIn(MANAGER, self.nodes(), "a new master knows no node")
        wait_until(lambda: self.server.hasParam("/test", "/mapping")[2], "the parameters to be given back")

        self.end(self.robot)
        self.start_robot("new_robot")
        wait_until(lambda: self.maps_of("new_robot") > 20, "maps for the new robot")
        self.assertIn(MANAGER, self.nodes())
        for stage in STAGES:
            self.assertEqual(self.server.getParam("/test", f"{stage}/scan/max_range_m")[2], MAX_RANGE_M)


if __name__ == "__main__":
    unittest.main(verbosity=2, argv=sys.argv[:1])
