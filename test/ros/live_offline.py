# SPDX-License-Identifier: BSD-3-Clause
"""Plays a recording to nodelets in step, so that what they make of it can be compared with the lines of a tool."""
import json
import pathlib
import subprocess
import time

import genpy
import rosbag
import rospy
from sensor_msgs.msg import Imu, LaserScan, NavSatFix
from tf2_msgs.msg import TFMessage

from ros_support import wait_until

# Fixes are sent so far ahead of the samples, and it is waited until they have come: a fix is used by its stamp. Nothing
# else depends on the order in which messages of two topics come.
AHEAD_S = 1.5
KINDS = {"/imu": Imu, "/fix": NavSatFix, "/scan": LaserScan, "/tf": TFMessage}
# The topic by whose messages the pose of a scan is known, and up to when.
BY_TF = ("/tf", lambda msg: max(t.header.stamp for t in msg.transforms))
BY_IMU = ("/imu", lambda msg: msg.header.stamp)


class Text(float):
    """A number as text: a stamp has more digits than a float."""

    def __init__(self, text):
        self.text = text


def lines_of(tool, bag, out, *arguments):
    """The lines of a tool, by their stamps; their numbers are Text."""
    subprocess.run(["rosrun", "situation_awareness", tool, str(bag), *arguments, "--out", str(out)], check=True,
                   timeout=120)
    lines = [json.loads(line, parse_float=Text) for line in pathlib.Path(out).read_text().splitlines()]
    return {genpy.Time(*map(int, line["stamp"].text.split("."))): line for line in lines}


def play_in_step(bag, namespace, maps, stamps, by, fixes_received=None):
    """Yields the stamp of each scan that is among `stamps` when a message of `maps` of that stamp or a later one has
    come. `fixes_received()`: the number that the nodelet has, where the pose is by GPS."""
    topics = ["/scan", by[0]] + (["/fix"] if fixes_received else [])
    publishers = {topic: rospy.Publisher(f"/{namespace}{topic}", KINDS[topic], queue_size=10000, tcp_nodelay=True)
                  for topic in topics}
    tf_static = rospy.Publisher(f"/{namespace}/tf_static", TFMessage, queue_size=10, latch=True)
    links = [*publishers.values(), tf_static, maps.subscriber]
    wait_until(lambda: all(link.get_num_connections() > 0 for link in links), 60.0, "the nodelets")
    time.sleep(1.0)  # the connections among the nodelets
    with rosbag.Bag(str(bag)) as recording:
        messages = [(topic, msg) for topic, msg, _ in recording.read_messages()]
    fixes = [msg for topic, msg in messages if topic == "/fix" and fixes_received]
    fixes_sent, fixes_until = 0, None
    waiting, known = [], genpy.Time()
    for topic, msg in messages:
        if topic == "/tf_static":
            tf_static.publish(msg)
            time.sleep(0.3)
        if topic not in publishers or topic == "/fix":
            continue
        if fixes and (fixes_until is None or msg.header.stamp >= fixes_until):
            fixes_until = msg.header.stamp + genpy.Duration.from_sec(AHEAD_S)
            while fixes_sent < len(fixes) and fixes[fixes_sent].header.stamp < fixes_until:
                publishers["/fix"].publish(fixes[fixes_sent])
                fixes_sent += 1
            wait_until(lambda: fixes_received() == fixes_sent, 20.0, f"{fixes_sent} fixes")
        publishers[topic].publish(msg)
        if topic == by[0]:
            known = max(known, by[1](msg))
        elif topic == "/scan" and msg.header.stamp in stamps:
            waiting.append(msg)
        while waiting and waiting[0].header.stamp + genpy.Duration(
                nsecs=round(1e9 * waiting[0].time_increment * (len(waiting[0].ranges) - 1))) <= known:
            stamp = waiting.pop(0).header.stamp
            wait_until(lambda: maps.messages and maps.messages[-1].header.stamp >= stamp, 20.0, f"the map of {stamp}")
            yield stamp
