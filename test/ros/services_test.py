#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The services of the mapping nodelet, called while scans come. The world frame is not the default one."""
import os
import pathlib
import shutil
import signal
import sys
import tempfile
import time
import unittest
import xmlrpc.client

import rosgraph
import rospy
import rostest
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Diagnostics, Latest, Robot, comes_true, scan_msg, shown_ids, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray  # noqa: E402
from situation_awareness.srv import GetObjects, LoadObjects, SaveObjects  # noqa: E402

STANDING = [(3.0, 0.5, 0.25), (2.0, -2.0, 0.3)]
VELOCITY = 0.6  # m/s, of the third, along y


class ServicesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.map = Latest("objects", MappedObjectArray)
        cls.markers = Latest("object_markers", MarkerArray)
        cls.diagnostics = Diagnostics()
        cls.robot = Robot(transforms=False)
        cls.services = {name: rospy.ServiceProxy(name, kind)
                        for name, kind in {"mapping/reset": Trigger, "mapping/pause": SetBool, "get_objects": GetObjects,
                                           "mapping/save_objects": SaveObjects, "mapping/load_objects": LoadObjects}.items()}
        for service in cls.services.values():
            service.wait_for_service(60.0)
        time.sleep(1.0)
        cls.folder = tempfile.mkdtemp()
        cls.file = os.path.join(cls.folder, "map.yaml")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def call(self, name, *arguments):
        answer = self.services[name](*arguments)
        self.assertTrue(answer.success, answer.message)
        return answer

    def refused(self, name, *arguments):
        answer = self.services[name](*arguments)
        self.assertFalse(answer.success)
        self.assertRegex(answer.message, r"\A.+\Z", "one line that says why")
        return answer.message

    def ids(self):
        return {ellipse.id for ellipse in self.map.messages[-1].objects}

    def run_and_map(self, count, **arguments):
        """Scans, and the resulting map."""
        stamp = self.robot.run(count, **dict({"circles": STANDING}, **arguments))[-1]
        wait_until(lambda: stamp in self.map.stamps(), 5.0, "the map")
        return self.map.messages[-1]

    def next_message(self, act):
        """The map that is published because of `act`, with no scan."""
        before = len(self.map.messages)
        act()
        wait_until(lambda: len(self.map.messages) > before, 2.0, "a map without a scan")
        self.assertEqual(len(self.map.messages), before + 1)
        return self.map.messages[-1]

    def assert_map_is(self, expected, stamp=rospy.Time()):
        map_now = self.call("get_objects", stamp).objects
        map_now.header.seq = expected.header.seq  # counts the messages of a topic
        self.assertEqual(map_now, expected)

    def test_1_calls_without_a_map_are_refused(self):
        self.refused("get_objects", rospy.Time())
        self.refused("mapping/save_objects", self.file)
        self.assertFalse(os.path.exists(self.file))
        self.call("mapping/reset")

    def test_2_get_map_predicts(self):
        start = rospy.Time.now()
        for _ in range(50):
            stamp = rospy.Time.now()
            y = -1.0 + VELOCITY * (stamp - start).to_sec()
            self.robot.publish(scan_msg(stamp, circles=STANDING + [(4.5, y, 0.25)]))
        wait_until(lambda: stamp in self.map.stamps(), 5.0, "the map")
        latest = self.map.messages[-1]
        self.assertEqual(len(latest.objects), 3)
        self.assertEqual(latest.header.frame_id, "odom")
        self.assert_map_is(latest)
        self.assert_map_is(latest, stamp)

        later = stamp + rospy.Duration(0.5)
        predicted = self.call("get_objects", later).objects
        self.assertEqual(predicted.header.stamp, later)
        self.assertEqual(predicted.header.frame_id, "odom")
        self.assertEqual([ellipse.id for ellipse in predicted.objects], [ellipse.id for ellipse in latest.objects])
        for now, then in zip(latest.objects, predicted.objects):
            self.assertEqual(now.last_seen, then.last_seen)
            if now.p_moving < 0.5:
                self.assertAlmostEqual(then.pose.position.x, now.pose.position.x, delta=0.01)
                self.assertAlmostEqual(then.pose.position.y, now.pose.position.y, delta=0.01)
        now = max(latest.objects, key=lambda ellipse: ellipse.p_moving)
        then = next(ellipse for ellipse in predicted.objects if ellipse.id == now.id)
        self.assertAlmostEqual(now.twist.linear.y, VELOCITY, delta=0.15)
        self.assertAlmostEqual(then.pose.position.y - now.pose.position.y, 0.5 * VELOCITY, delta=0.08)
        self.assertAlmostEqual(then.pose.position.x - now.pose.position.x, 0.0, delta=0.08)
        self.assertGreater(then.covariance[9], now.covariance[9] + 1e-4, "variance of y")

        self.assertIn("0.001", self.refused("get_objects", stamp - rospy.Duration(0.001)))
        self.assertIn("3600", self.refused("get_objects", stamp + rospy.Duration(3600)))
        self.refused("get_objects", rospy.Time(2 ** 32 - 1))
        self.assertEqual(len(self.call("get_objects", stamp + rospy.Duration(30)).objects.objects), 3)

    def test_3_paused_the_map_stays_as_it_is(self):
        before = self.run_and_map(20)
        ids = self.ids()
        drops = self.drops()
        self.call("mapping/pause", True)
        count = len(self.map.messages)
        self.robot.run(30, circles=[])
        wait_until(lambda: self.diagnostics.count("mapping", "passed over while paused") >= 30, 5.0, "the count")
        self.assertEqual(self.diagnostics.stages["mapping"]["summary"], "paused")
        self.assertEqual(len(self.map.messages), count)
        self.assert_map_is(before)
        self.call("mapping/pause", True)
        self.call("mapping/pause", False)
        after = self.run_and_map(5)
        self.assertEqual(self.ids(), ids)
        self.assertEqual(after.objects[0].observations, before.objects[0].observations + 5)
        wait_until(lambda: self.diagnostics.stages["mapping"]["summary"] != "paused", 5.0, "the end of the pause")
        self.assertEqual(self.drops(), drops)

    def drops(self):
        return {key: value for key, value in self.diagnostics.stages["mapping"].items() if key.startswith("dropped")}

    def test_4_save_reset_load(self):
        self.run_and_map(20)
        ids = self.ids()
        self.assertEqual(len(ids), 2)
        self.assertIn(self.file, self.call("mapping/save_objects", self.file).message)

        empty = self.next_message(lambda: self.call("mapping/reset"))
        self.assertEqual(empty.objects, [])
        wait_until(lambda: not self.shown(), 2.0, "the markers to go")
        self.refused("get_objects", rospy.Time())
        self.run_and_map(20)
        self.assertEqual(len(self.ids()), 2)
        self.assertGreater(min(self.ids()), max(ids), "ids are never used again")

        loaded = self.next_message(lambda: self.call("mapping/load_objects", self.file))
        self.assertEqual({ellipse.id for ellipse in loaded.objects}, ids)
        wait_until(lambda: self.shown() == ids, 2.0, "the markers of what was loaded")
        self.assertEqual({ellipse.id for ellipse in self.call("get_objects", rospy.Time()).objects.objects}, ids)
        self.run_and_map(20)
        self.assertEqual(self.ids(), ids)
        self.assertEqual(self.map.messages[-1].objects[0].observations, loaded.objects[0].observations + 20)

    def shown(self):
        return shown_ids(self.markers.messages, "object")

    def test_5_what_cannot_be_used_changes_nothing(self):
        self.run_and_map(20)
        self.call("mapping/save_objects", self.file)
        latest = self.call("get_objects", rospy.Time()).objects
        with open(self.file, encoding="ascii") as file:
            whole = file.read()

        def written(text):
            name = os.path.join(self.folder, "other.yaml")
            with open(name, "w", encoding="ascii") as file:
                file.write(text)
            return name
        head, _ = whole.rsplit("\nsha256: ", 1)
        for text, facts in ((whole[:len(whole) // 2], ("sha256",)),
                            (whole.replace("log_odds: ", "log_odds: 1", 1), ("sha256: edited",)), ("", ("sha256",)),
                            (whole.replace('"odom"', '"map"', 1), ("sha256: edited",)),
                            (head.replace('"odom"', '"map"', 1) + "\nsha256: edited\n", ("world_frame", "map", "odom")),
                            (head.replace("p_moving: ", "p_moving: 2  # not ", 1) + "\nsha256: edited\n",
                             ("p_moving", "2", "[0, 1]"))):
            message = self.refused("mapping/load_objects", written(text))
            for fact in (os.path.join(self.folder, "other.yaml"), *facts):
                self.assertIn(fact, message)
        self.assertIn("missing.yaml", self.refused("mapping/load_objects", os.path.join(self.folder, "missing.yaml")))
        self.assertIn("map.yaml", self.refused("mapping/load_objects", "map.yaml"))
        self.refused("mapping/save_objects", "")
        self.assertIn("missing", self.refused("mapping/save_objects", os.path.join(self.folder, "missing", "map.yaml")))
        other = written("no map")
        self.assertIn(other, self.refused("mapping/save_objects", other))
        with open(other, encoding="ascii") as file:
            self.assertEqual(file.read(), "no map")

        self.assert_map_is(latest)
        after = self.run_and_map(5)
        self.assertEqual(after.objects[0].observations, latest.objects[0].observations + 5)

    def test_6_a_fresh_manager_goes_on_with_a_saved_map(self):
        self.run_and_map(20)
        ids = self.ids()
        self.call("mapping/save_objects", self.file)
        saved = self.map.messages[-1]
        uri = rosgraph.Master("services_test").lookupNode("/objects_manager")
        os.kill(xmlrpc.client.ServerProxy(uri).getPid("services_test")[2], signal.SIGKILL)

        def loads():
            try:
                return self.services["mapping/load_objects"](self.file).success
            except rospy.ServiceException:
                return False
        wait_until(loads, 60.0, "the manager to come back")

        def maps_again():
            stamp = self.robot.run(1, circles=STANDING)[0]
            return comes_true(lambda: stamp in self.map.stamps(), 0.5)
        wait_until(maps_again, 60.0, "the stages before it to come back")
        self.assertEqual(self.ids(), ids)
        before = self.map.messages[-1].objects
        for then, now in zip(saved.objects, before):
            self.assertGreater(now.observations, then.observations)
        after = self.run_and_map(10).objects
        self.assertEqual(self.ids(), ids)
        self.assertEqual([ellipse.observations for ellipse in after],
                         [ellipse.observations + 10 for ellipse in before])


if __name__ == "__main__":
    rospy.init_node("services_test")
    rostest.rosrun("situation_awareness", "services_test", ServicesTest)
