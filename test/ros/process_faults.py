# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the manager and of the master of stages that lead vehicles, for their cells of the tables of
docs/reliability.md."""
import contextlib
import inspect
import os
import pathlib
import signal
import time
import xmlrpc.client

from fault_record import recorded
from master_restart_test import ROOT, MasterTest, wait_until

STANDS_S = 3.0
# The begin of each program, which prints the time and what its vehicles are told.
PROGRAM = """
import math, sys, threading, time
sys.path.insert(0, sys.argv[1])
import rospy
from geometry_msgs.msg import Twist
rospy.init_node(sys.argv[2], disable_signals=True)
lock = threading.Lock()
def say(*words):
    with lock:
        print(time.monotonic(), *words, flush=True)
rospy.Subscriber("cmd_vel", Twist, lambda msg: say("cmd", msg.linear.x, msg.angular.z))
"""


class ProcessesTest(MasterTest):
    """Stages, and a program, after PROGRAM, that moves their vehicles and prints a line for whatever it is told: the time
    by the steady clock, the kind and numbers. Each test says what each of the stages does."""

    stages = ()
    manager = ""
    params = ""
    program = ""
    kinds = ()  # that the stages tell again and again

    def wait_until_it_goes(self):
        raise NotImplementedError

    def start_stages(self):
        config = pathlib.Path(self.folder.name) / "stages.yaml"
        config.write_text(self.params)
        return self.start("launch", ["roslaunch", "--wait", str(ROOT / "launch/stages.launch"),
                                     f"stages:={' '.join(self.stages)}", f"manager:={self.manager[1:]}",
                                     f"config:={config}"])

    def start_vehicles(self):
        return self.start("vehicles", ["/usr/bin/python3", "-c", PROGRAM + self.program, str(ROOT / "test/ros"),
                                       "vehicles"])

    def set_off(self):
        self.start_vehicles()
        self.start_stages()
        self.wait_until_it_goes()

    def told(self, kind, since=0.0):
        """(time, numbers) of all that was told."""
        path = self.log("vehicles")
        lines = [line.split() for line in path.read_text().splitlines()] if path.exists() else []
        told = [(float(line[0]), *map(float, line[2:])) for line in lines if len(line) > 2 and line[1] == kind]
        return [one for one in told if one[0] > since]

    def pid(self):
        uri = self.server.lookupNode("/test", self.manager)[2]
        return xmlrpc.client.ServerProxy(uri).getPid("/test")[2]

    def assert_silent(self, since, until):
        """Nobody is told anything, but for what was under way."""
        for kind in self.kinds:
            self.assertEqual([one for one in self.told(kind, since + 0.2) if one[0] < until], [])

    def assert_told(self, seconds):
        """Each is told something, again and again."""
        since = time.monotonic()
        wait_until(lambda: time.monotonic() > since + seconds, "time")
        for kind in self.kinds:
            times = [since, *(one[0] for one in self.told(kind, since))]
            self.assertGreater(times[-1], since + seconds - 2.0)
            self.assertLess(max(after - before for before, after in zip(times, times[1:])), 2.0, kind)

    @contextlib.contextmanager
    def cells(self, input_, fault, *does):
        with contextlib.ExitStack() as stack:
            for stage, text in zip(self.stages, does):
                stack.enter_context(recorded(stage=stage, input=input_, fault=fault, does=text,
                                             test=pathlib.Path(inspect.getfile(type(self))).stem))
            yield

    def check_manager_that_never_came(self, *does):
        with self.cells("manager", "never came", *does):
            self.start_vehicles()
            wait_until(lambda: len(self.told("pose")) > 30, "the vehicles")
            self.assert_silent(0.0, time.monotonic())

    @contextlib.contextmanager
    def stopped_manager(self):
        """The body is run at the end of some seconds in which it stands still."""
        pid = self.pid()
        os.kill(pid, signal.SIGSTOP)
        try:
            since = time.monotonic()
            wait_until(lambda: time.monotonic() > since + STANDS_S, "time")
            self.assert_silent(since, time.monotonic())
            yield
        finally:
            os.kill(pid, signal.SIGCONT)

    def check_master(self, never, on):
        with self.cells("master", "never came", *never):
            self.end(self.master)
            launch = self.start_stages()
            since = time.monotonic()
            wait_until(lambda: time.monotonic() > since + STANDS_S, "time")
            self.assertIsNone(launch.poll())
            self.assertEqual(sum((self.told(kind) for kind in self.kinds), []), [])
            self.master = self.start_master()
        self.start_vehicles()
        self.wait_until_it_goes()
        does = [on] * len(self.stages)
        with self.cells("master", "stopped", *does):
            self.master.send_signal(signal.SIGSTOP)
            self.assert_told(6.0)
            self.master.send_signal(signal.SIGCONT)
            self.assert_told(2.0)
        with self.cells("master", "killed", *does):
            self.end(self.master)
            self.assert_told(6.0)
        with self.cells("master", "restarted", *does):
            self.master = self.start_master()
            self.assert_told(6.0)
