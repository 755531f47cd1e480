#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""sim.launch camera:=chase: images come, with the robot at its projection."""
import pathlib
import sys
import unittest

import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, refusal_of_node, wait_until  # noqa: E402


def unrotated(q, x, y, z):
    """The vector in the axes that the quaternion turns from."""
    return (
        (1 - 2 * (q.y * q.y + q.z * q.z)) * x + 2 * (q.x * q.y + q.z * q.w) * y + 2 * (q.x * q.z - q.y * q.w) * z,
        2 * (q.x * q.y - q.z * q.w) * x + (1 - 2 * (q.x * q.x + q.z * q.z)) * y + 2 * (q.y * q.z + q.x * q.w) * z,
        2 * (q.x * q.z + q.y * q.w) * x + 2 * (q.y * q.z - q.x * q.w) * y + (1 - 2 * (q.x * q.x + q.y * q.y)) * z)


class CameraTest(unittest.TestCase):
    def test_1_the_robot_is_where_it_projects_to(self):
        images, infos = Latest("camera/image", Image), Latest("camera/camera_info", CameraInfo)
        odometry, transforms = Latest("odometry", Odometry), Latest("/tf", TFMessage)

        def whole():
            """The latest picture with the poses of its time, and these: topics come in any order."""
            robots = {msg.header.stamp: msg.pose.pose.position for msg in list(odometry.messages)}
            cameras = {(t.child_frame_id, t.header.stamp): t.transform
                       for msg in list(transforms.messages) for t in msg.transforms}
            for image in reversed(list(images.messages)):
                stamp = image.header.stamp
                camera = cameras.get((image.header.frame_id, stamp))
                if stamp in robots and camera:
                    return image, robots[stamp], camera
            return None

        wait_until(lambda: len(images.messages) >= 5 and infos.messages and whole(), 60.0, "5 pictures")
        (image, robot, camera), info = whole(), infos.messages[-1]
        self.assertEqual((image.width, image.height, image.encoding, image.step), (640, 480, "rgb8", 1920))
        self.assertEqual(len(image.data), 640 * 480 * 3)
        self.assertEqual(info.header.frame_id, image.header.frame_id)
        x, y, z = unrotated(camera.rotation, robot.x - camera.translation.x, robot.y - camera.translation.y,
                            robot.z - camera.translation.z)
        u, v = info.K[0] * x / z + info.K[2], info.K[4] * y / z + info.K[5]
        self.assertTrue(0 < u < 640 and 0 < v < 480 and z > 0, (u, v, z))

        def brightness(column, row):
            return sum(image.data[3 * (640 * int(row) + int(column)):][:3])

        self.assertLess(min(brightness(u + i, v + j) for i in range(-3, 4) for j in range(-3, 4)), 200, "the airframe")
        self.assertGreater(max(brightness(column, 10) for column in range(0, 640, 10)), 350, "the room")

    def test_2_it_refuses_what_it_cannot_show(self):
        for argument, facts in (("_camera:=aloft", ("aloft",)), ("_world:=atlantis", ("atlantis.xml",)),
                                ("_width:=1", ("width", "1", "[16, 4096]")), ("_hop:=1", ("hop", "height"))):
            message = refusal_of_node("camera", argument)
            for fact in facts:
                self.assertIn(fact, message)


if __name__ == "__main__":
    rospy.init_node("camera_test")
    rostest.rosrun("situation_awareness", "camera_test", CameraTest)
