#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A master that is restarted under running nodes: the map goes on over existing connections, and comes back, with its
parameters, when what feeds it was started anew as well. In a manager of somebody else, the nodelets never end it. Needs
masters of its own, so this is no rostest."""
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
MANAGER = "/map_manager"
FOREIGN_MANAGER = "/foreign_manager"
IDLE_S = 10.0  # longer than the detection of a new master (2 s) and of idleness (5 s)
STAGES = ("/segmentation", "/detection", "/mapping")
MAX_RANGE_M = 7.5  # different from the default

# A robot: scans with transforms at 20 Hz, and a line per map that comes back.
ROBOT = """
import sys
sys.path.insert(0, sys.argv[1])
import rospy
from ros_support import Robot
from situation_awareness.msg import MappedObjectArray
rospy.init_node(sys.argv[2], disable_signals=True)
rospy.Subscriber("objects", MappedObjectArray, lambda msg: print(len(msg.objects), flush=True))
robot = Robot()
while True:
    robot.run(1)
"""

# Each status of /diagnostics as a line: the node's name without a slash, and the summary.
LISTENER = """
import rospy
from diagnostic_msgs.msg import DiagnosticArray
rospy.init_node("listener", disable_signals=True)
def receive(msg):
    for status in msg.status:
        print(status.name.split(":")[0], status.message, sep="|", flush=True)
rospy.Subscriber("/diagnostics", DiagnosticArray, receive, queue_size=100)
rospy.spin()
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


class MasterTest(unittest.TestCase):
    """A master, and the processes started at it."""

    def setUp(self):
        self.port = free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI=f"http://127.0.0.1:{self.port}", ROS_IP="127.0.0.1")
        self.processes = []
        self.folder = tempfile.TemporaryDirectory()
        self.master = self.start_master()
        config = pathlib.Path(self.folder.name) / "objects.yaml"
        config.write_text(f"scan: {{max_range_m: {MAX_RANGE_M}}}\ndetections: {{detector: least_squares}}\n")
        self.config = f"config:={config}"

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

    def start_launch(self, *arguments):
        return self.start("launch", ["roslaunch", "--wait", str(ROOT / "launch/map.launch"), "kinds:=objects",
                                     "world_frame:=world", "rviz:=false", self.config, *arguments])

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
        """The number of non-empty maps received by the robot of that name."""
        return sum(line.strip().isdigit() and int(line) > 0 for line in self.log(name).read_text().splitlines())

    def nodes(self):
        state = self.server.getSystemState("/test")[2]
        return {node for kind in state for _, names in kind for node in names}

    def assert_maps_go_on(self, seconds):
        for _ in range(int(seconds)):
            before = self.maps_of("robot")
            time.sleep(1.0)
            self.assertGreater(self.maps_of("robot"), before, "a second without a map")

    def assert_parameters(self):
        for stage in STAGES:
            self.assertEqual(self.server.getParam("/test", f"{stage}/scan/max_range_m")[2], MAX_RANGE_M)


class MasterRestartTest(MasterTest):
    def setUp(self):
        super().setUp()
        self.start_launch()
        self.robot = self.start_robot("robot")
        wait_until(lambda: self.maps_of("robot") > 20, "the first maps")

    @fault("master out of reach", "stopped for 6 s, then it goes on", "maps go on, nothing ends")
    def test_1_no_master_for_a_while(self):
        """A broken link looks the same: no effect."""
        os.kill(self.master.pid, signal.SIGSTOP)
        self.assert_maps_go_on(6.0)
        os.kill(self.master.pid, signal.SIGCONT)
        self.assert_maps_go_on(6.0)
        self.assertIn(MANAGER, self.nodes())

    @fault("master restarts", "killed and started anew; 8 s later the robot is, too",
           "maps go on over existing connections; then the nodelets register at the new master, with their parameters")
    def test_2_a_new_master_and_then_a_new_robot(self):
        self.end(self.master)
        self.assert_maps_go_on(3.0)
        self.master = self.start_master()
        self.assert_maps_go_on(8.0)  # longer than the detection of the new master and the end of the process
        self.assertNotIn(MANAGER, self.nodes(), "a new master knows no node")
        wait_until(lambda: self.server.hasParam("/test", "/mapping")[2], "the parameters to be given back")

        self.end(self.robot)
        self.start_robot("new_robot")
        wait_until(lambda: self.maps_of("new_robot") > 20, "maps for the new robot")
        self.assertIn(MANAGER, self.nodes())
        self.assert_parameters()


class ForeignManagerTest(MasterTest):
    def start_manager(self):
        return self.start("manager", ["rosrun", "nodelet", "nodelet", "manager", f"__name:={FOREIGN_MANAGER[1:]}"])

    def heard(self):
        """The summaries on /diagnostics since the last call: a set for each node."""
        lines = self.log("listener").read_text().splitlines()
        begin, self.heard_lines = self.heard_lines, len(lines)
        said = {}
        for name, _, summary in (line.partition("|") for line in lines[begin:]):
            said.setdefault(f"/{name}", set()).add(summary)
        return said

    @fault("master restarts, nodelets in a manager of others", "killed and started anew; no scans come any more",
           "the manager lives on and its nodelets warn; when it is restarted, they come back with their parameters")
    def test_nodelets_never_end_another_manager(self):
        manager = self.start_manager()
        self.start_launch("start_manager:=false", f"manager:={FOREIGN_MANAGER[1:]}")
        self.start("listener", ["/usr/bin/python3", "-c", LISTENER])
        robot = self.start_robot("robot")
        wait_until(lambda: self.maps_of("robot") > 20, "the first maps")
        self.end(self.master)
        self.master = self.start_master()
        self.end(robot)
        for stage in STAGES:
            wait_until(lambda: self.server.hasParam("/test", stage)[2], f"the parameters of {stage} to be given back")
        self.assert_parameters()

        end = time.monotonic() + IDLE_S
        while time.monotonic() < end:
            self.assertIsNone(manager.poll(), "the manager was ended")
            time.sleep(0.1)
        self.heard_lines = 0
        self.heard()
        time.sleep(2.5)
        said = self.heard()
        for stage in STAGES:
            self.assertTrue(any("new master" in summary for summary in said.get(stage, ())), (stage, said))

        self.end(manager)
        self.start_manager()
        self.start_robot("new_robot")
        wait_until(lambda: self.maps_of("new_robot") > 20, "maps for the new robot")
        self.assertIn(FOREIGN_MANAGER, self.nodes())
        self.assert_parameters()


if __name__ == "__main__":
    unittest.main(verbosity=2, argv=sys.argv[:1])
