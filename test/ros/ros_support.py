# SPDX-License-Identifier: BSD-3-Clause
"""Common code of the tests of the ROS graph: scans of round objects, their transforms, and timeouts."""
import math
import subprocess
import threading
import time
import xmlrpc.client

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan
from situation_awareness.msg import MapUpdate
from situation_awareness.srv import LoadMap, SaveMap
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

import delayed_messages  # noqa: F401  Which delays messages where that is asked for.

ANGLE_MIN = -2.35619449
INCREMENT = 0.0087266463  # 0.5 deg
BEAMS = 541
PERIOD_S = 0.05


def ranges_to_circles(circles, beams=BEAMS, increment=INCREMENT, moved_x=0.0):
    """Ranges of a scanner among circles (x, y, radius), which moves from the origin by moved_x; +inf where there is
    none."""
    ranges = []
    for i in range(beams):
        angle = ANGLE_MIN + i * increment
        nearest = math.inf
        for world_x, y, radius in circles:
            x = world_x - moved_x * i / (beams - 1)
            along = x * math.cos(angle) + y * math.sin(angle)
            aside = -x * math.sin(angle) + y * math.cos(angle)
            if along > 0 and abs(aside) < radius:
                nearest = min(nearest, along - math.sqrt(radius ** 2 - aside ** 2))
        ranges.append(nearest)
    return ranges


def scan_msg(stamp, ranges=None, circles=((3.0, 0.5, 0.25),), frame="lidar", increment=INCREMENT):
    msg = LaserScan()
    msg.header.stamp = stamp
    msg.header.frame_id = frame
    msg.angle_min = ANGLE_MIN
    msg.angle_increment = increment
    msg.ranges = ranges_to_circles(circles) if ranges is None else ranges
    msg.angle_max = ANGLE_MIN + increment * max(len(msg.ranges) - 1, 0)
    msg.range_min = 0.1
    msg.range_max = 30.0
    return msg


def transform_msg(stamp, x=0.0, parent="world", child="lidar"):
    transform = TransformStamped()
    transform.header.stamp = stamp
    transform.header.frame_id = parent
    transform.child_frame_id = child
    transform.transform.translation.x = x
    transform.transform.rotation.w = 1.0
    return TFMessage([transform])


def yaw_of(q):
    """Of an orientation."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))


class Arrivals:
    """Of messages in this process: who waits for what they bring is woken by them."""

    def __init__(self):
        self.count, self.changed = 0, threading.Condition()

    def tell(self):
        with self.changed:
            self.count += 1
            self.changed.notify_all()

    def wait_beyond(self, count, at_most_s):
        with self.changed:
            self.changed.wait_for(lambda: self.count != count, at_most_s)


ARRIVALS = Arrivals()


def comes_true(condition, timeout_s):
    """Wait in wall time; false on timeout. The condition is asked for at each message, and each .02 s for what else it may
    depend on."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end and not rospy.is_shutdown():
        before = ARRIVALS.count
        if condition():
            return True
        ARRIVALS.wait_beyond(before, 0.02)
    return False


def wait_until(condition, timeout_s, what):
    """Wait in wall time; fail on timeout, naming the condition."""
    if not comes_true(condition, timeout_s):
        raise AssertionError(f"waited {timeout_s} s for {what}")


def run_beside(run):
    """In a thread of its own until the node ends, whose topics are closed meanwhile."""
    def until_shutdown():
        try:
            run()
        except rospy.ROSException:
            if not rospy.is_shutdown():
                raise
    threading.Thread(target=until_shutdown, daemon=True).start()


def refusal_of_node(program, *arguments):
    """The one line in which a program of this package, started with these private parameters, says why it ends."""
    name = f"refused_{program}"
    result = subprocess.run(["rosrun", "situation_awareness", program, f"__name:={name}", *arguments],
                            capture_output=True, text=True, timeout=30, check=False)
    rospy.delete_param(f"/{name}")
    said = result.stdout + result.stderr
    assert result.returncode == 1, said
    lines = [line for line in said.splitlines() if "FATAL" in line]
    assert len(lines) == 1, said
    return lines[0]


def pid_of(node):
    uri = rosgraph.Master("ros_support").lookupNode(node)
    return xmlrpc.client.ServerProxy(uri).getPid("ros_support")[2]


def shown_ids(arrays, namespace):
    """Of the markers of a namespace, those that are shown after these MarkerArrays."""
    ids = set()
    for marker in (marker for array in list(arrays) for marker in array.markers):
        if marker.action == Marker.DELETEALL:
            ids.clear()
        elif marker.ns == namespace and marker.action == Marker.DELETE:
            ids.discard(marker.id)
        elif marker.ns == namespace:
            ids.add(marker.id)
    return ids


class Latest:
    """The received messages of a topic."""

    def __init__(self, topic, kind):
        self.messages = []
        self.subscriber = rospy.Subscriber(topic, kind, self.receive, queue_size=1000)

    def receive(self, message):
        self.messages.append(message)
        ARRIVALS.tell()

    def stamps(self):
        return [message.header.stamp for message in list(self.messages)]


class MapFollower(Latest):
    """The features by id of who follows the updates."""

    def __init__(self, topic="semantic_map/updates"):
        self.features, self.map, self.version, self.missed = {}, None, None, 0
        super().__init__(topic, MapUpdate)

    def receive(self, message):
        if message.full:
            self.features = {}
        elif self.map is None:
            return  # it was under way when this subscriber came
        elif (message.map, message.base) != (self.map, self.version):
            self.missed += 1
        for gone in message.gone:
            self.features.pop(gone.id, None)
        self.features.update({feature.id: feature for feature in message.changed})
        self.map, self.version = message.map, message.version
        super().receive(message)


class MapServices:
    """The services of the one map."""

    def __init__(self):
        self.save = rospy.ServiceProxy("semantic_map/save_map", SaveMap)
        self.load = rospy.ServiceProxy("semantic_map/load_map", LoadMap)
        self.reset = rospy.ServiceProxy("semantic_map/reset", Trigger)
        self.pause = rospy.ServiceProxy("semantic_map/pause", SetBool)
        self.load.wait_for_service(60.0)


class Diagnostics:
    """The latest status of each stage, and all of them: `history` holds (stage, status)."""

    def __init__(self):
        self.stages = {}
        self.history = []
        self.subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self.receive, queue_size=100)

    def receive(self, message):
        for status in message.status:
            if status.values:
                name = status.name.split(":")[0].lstrip("/")  # that of a nodelet that was loaded by hand has one
                self.stages[name] = dict({pair.key: pair.value for pair in status.values}, summary=status.message,
                                         level=status.level)
                self.history.append((name, self.stages[name]))
        ARRIVALS.tell()

    def wait_for_reports(self, stage):
        """Two of the stage: the first may have been under way, the second is of what happened before this call."""
        before = len(self.history)
        wait_until(lambda: sum(name == stage for name, _ in self.history[before:]) >= 2, 10.0, f"reports of {stage}")

    def summary(self, stage):
        """The latest; nothing before its first report."""
        return self.stages.get(stage, {}).get("summary", "")

    def count(self, stage, key):
        return int(self.stages.get(stage, {}).get(key, "0"))


class Robot:
    """A scanner that stands at the world's origin, one scan and its transform at a time."""

    def __init__(self, transforms=True):
        self.scans = rospy.Publisher("scan", LaserScan, queue_size=1000)
        self.tf = rospy.Publisher("/tf", TFMessage, queue_size=1000)
        self.transforms = transforms
        wait_until(lambda: self.scans.get_num_connections() > 0 and self.tf.get_num_connections() > 0, 60.0,
                   "the segmentation nodelet")

    def publish(self, msg, transforms=None):
        if self.transforms if transforms is None else transforms:
            self.tf.publish(transform_msg(msg.header.stamp))
        self.scans.publish(msg)
        time.sleep(PERIOD_S)

    def run(self, count, **arguments):
        """`count` good scans at the present time; their stamps."""
        stamps = []
        for _ in range(count):
            stamps.append(rospy.Time.now())
            self.publish(scan_msg(stamps[-1], **arguments))
        return stamps
