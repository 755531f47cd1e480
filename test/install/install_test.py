#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What `cmake --install` leaves runs by itself: neither the source tree nor the devel space is needed or touched, and
another package can build against it.

    install_test.py BUILD_DIR PREFIX
"""
import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree as ElementTree

TEST = pathlib.Path(__file__).resolve().parent
SOURCE = TEST.parents[1]
BUILD, PREFIX = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
PACKAGE = PREFIX / "share" / "situation_awareness"
REQUIRED_ARGUMENTS = {"stages.launch": ("stages:=segmentation detection", "manager:=map_manager",
                                        f"config:={PACKAGE / 'cfg' / 'objects.yaml'}")}


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def mapped_files(port):
    """Files of this project that the nodes of the master at this port have mapped: programs and libraries."""
    files = set()
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            environment = (process / "environ").read_bytes().split(b"\0")
            if any(re.fullmatch(rb"ROS_MASTER_URI=http://[^/]*:%d/?" % port, entry) for entry in environment):
                for line in (process / "maps").read_text(encoding="utf-8").splitlines():
                    path = line.split(maxsplit=5)[5:]
                    if path and path[0].startswith(str(SOURCE)):
                        files.add(pathlib.Path(path[0]))
    return files


class InstallTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(PREFIX, ignore_errors=True)
        subprocess.run(["cmake", "--install", str(BUILD)], check=True, stdout=subprocess.DEVNULL)
        cls.work = tempfile.TemporaryDirectory()
        cls.port = free_port()
        # The environment of a new shell, and then only the installed setup.bash.
        clean = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": cls.work.name, "ROS_IP": "127.0.0.1",
                 "ROS_HOME": cls.work.name, "ROS_MASTER_URI": f"http://127.0.0.1:{cls.port}", "LANG": "C.UTF-8"}
        shell = subprocess.run(["bash", "-c", '. "$1" && env -0', "bash", str(PREFIX / "setup.bash")], env=clean,
                               check=True, capture_output=True, text=True)
        cls.environment = dict(item.split("=", 1) for item in shell.stdout.split("\0") if "=" in item)

    @classmethod
    def tearDownClass(cls):
        cls.work.cleanup()

    def run_installed(self, *command, timeout=60):
        return subprocess.run(command, env=self.environment, cwd=self.work.name, capture_output=True, text=True,
                              timeout=timeout, check=False)

    def test_1_the_environment_knows_the_install_space_alone(self):
        for name in ("ROS_PACKAGE_PATH", "LD_LIBRARY_PATH", "CMAKE_PREFIX_PATH", "PYTHONPATH", "PKG_CONFIG_PATH"):
            for path in filter(None, self.environment[name].split(":")):
                path = pathlib.Path(path)
                if SOURCE in (path, *path.parents):
                    self.assertIn(PREFIX, (path, *path.parents), f"{name}={self.environment[name]}")
        found = self.run_installed("rospack", "find", "situation_awareness")
        self.assertEqual(found.stdout.strip(), str(PACKAGE), found.stderr)

    def test_2_files_named_by_launch_files_exist(self):
        for launch in sorted((SOURCE / "launch").glob("*.launch")):
            files = self.run_installed("roslaunch", "--files", "situation_awareness", launch.name,
                                       *REQUIRED_ARGUMENTS.get(launch.name, ()))
            self.assertEqual(files.returncode, 0, files.stderr)
            for path in files.stdout.split():
                self.assertTrue(path.startswith(str(PACKAGE)), path)
            for node in ElementTree.parse(launch).getroot().iter("node"):
                if node.get("pkg") == "situation_awareness":
                    program = PREFIX / "lib" / "situation_awareness" / node.get("type")
                    self.assertTrue(os.access(program, os.X_OK), f"{launch.name} starts {program}")
        for folder in ("cfg", "launch", "models", "msg", "srv"):
            for path in (SOURCE / folder).rglob("*"):
                if path.is_file():
                    self.assertTrue((PACKAGE / path.relative_to(SOURCE)).is_file(), f"{path} is not installed")

    def test_3_plugins_are_found_with_and_without_a_workspace(self):
        exports = ElementTree.parse(PACKAGE / "package.xml").getroot().findall("export/*[@plugin]")
        self.assertTrue(exports)
        for export in exports:
            description = pathlib.Path(export.get("plugin").replace("${prefix}", str(PACKAGE)))
            library = ElementTree.parse(description).getroot().get("path")
            # Below /usr pluginlib asks the loader for the bare name: a folder in front of it would not be found there.
            self.assertNotIn("/", library, str(description))
            self.assertTrue((PREFIX / "lib" / f"{library}.so").is_file(), str(description))

    def test_4_a_simulated_flight_makes_a_map(self):
        bag = pathlib.Path(self.work.name) / "flight.bag"
        command = ["roslaunch", "-p", str(self.port), "situation_awareness", "sim.launch", "world:=demo", "rviz:=false"]
        launch = subprocess.Popen(command, env=self.environment, cwd=self.work.name, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True)
        try:
            end = time.monotonic() + 60.0
            number = 0
            while number < 3 and time.monotonic() < end:
                seen = self.run_installed("timeout", "20", "rostopic", "echo", "-n1", "/objects/objects")
                number = seen.stdout.count("last_seen:")
            used = mapped_files(self.port)
            self.run_installed("rosbag", "record", "-q", "--duration=3", "-O", str(bag), "scan", "tf", "tf_static")
        finally:
            launch.send_signal(signal.SIGINT)
            output = launch.communicate(timeout=60)[0]
        self.assertGreaterEqual(number, 3, output)
        self.assertIn("libsituation_awareness_nodelets.so", {path.name for path in used})
        for path in used:
            self.assertIn(PREFIX, path.parents, "mapped by the running launch")

        out = pathlib.Path(self.work.name) / "map.jsonl"
        result = self.run_installed("rosrun", "situation_awareness", "objects_bag", str(bag), "--out", str(out))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue(json.loads(out.read_text(encoding="utf-8").splitlines()[-1])["objects"], result.stderr)

    def test_5_another_package_builds_against_it(self):
        build = pathlib.Path(self.work.name) / "consumer"
        for command in (["cmake", "-S", str(TEST / "consumer"), "-B", str(build)], ["cmake", "--build", str(build)]):
            result = self.run_installed(*command, timeout=300)
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        flags = json.loads((build / "compile_commands.json").read_text(encoding="utf-8"))[0]["command"]
        for flag in flags.split():
            if str(SOURCE) in flag and "consumer" not in flag:
                self.assertTrue(flag.startswith(str(PREFIX)), flags)
        consumer = self.run_installed(str(build / "consumer"))
        self.assertEqual(consumer.stdout.strip(), "1", consumer.stderr)

    def test_6_what_only_measures_is_not_installed(self):
        self.assertEqual([str(path) for path in PREFIX.rglob("*evaluation*")], [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
