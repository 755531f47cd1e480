# SPDX-License-Identifier: BSD-3-Clause
"""Delays for the tests of the ROS graph: where SITUATION_AWARENESS_DELAYS is set ("0.1 7": at most .1 s, seed 7), each
message that a test sends or receives is late by a time of its own, drawn at random. Messages of one topic keep their
order, as TCP does; those of two topics do not."""
import copy
import os
import queue
import random
import threading
import time

import rospy
from rospy.topics import _SubscriberImpl


class Line:
    """What is done in order, each at a time of its own after it was asked for; where `queue_size` later ones are due, too,
    it is left out, as in a queue that is full."""

    def __init__(self, name, at_most_s, seed, queue_size=None):
        self.random = random.Random(f"{name} {seed}")
        self.at_most_s, self.queue_size = at_most_s, queue_size
        self.waiting = queue.Queue()
        threading.Thread(target=self.run, daemon=True).start()

    def add(self, act):
        self.waiting.put((time.monotonic() + self.random.uniform(0.0, self.at_most_s), act))

    def run(self):
        while True:
            due_s, act = self.waiting.get()
            time.sleep(max(0.0, due_s - time.monotonic()))
            if self.is_full():
                continue
            try:
                act()
            except rospy.ROSException:  # The topic was closed meanwhile.
                pass

    def is_full(self):
        later = self.waiting.queue
        return (self.queue_size is not None and len(later) >= self.queue_size
                and later[self.queue_size - 1][0] <= time.monotonic())


def delay_messages(at_most_s, seed):
    """Of all publishers and subscribers of this process."""
    lines, lock = {}, threading.Lock()

    def line_of(key, name, queue_size=None):
        with lock:
            if key not in lines:
                lines[key] = Line(name, at_most_s, seed, queue_size)
            return lines[key]

    publish, invoke = rospy.Publisher.publish, _SubscriberImpl._invoke_callback

    def publish_late(self, *args, **kwds):
        message = copy.deepcopy(args), copy.deepcopy(kwds)  # The caller may change it meanwhile.
        line_of(self, "to " + self.resolved_name).add(lambda: publish(self, *message[0], **message[1]))

    def invoke_late(self, msg, cb, cb_args):
        line_of((self, cb), "from " + self.resolved_name, self.queue_size).add(lambda: invoke(self, msg, cb, cb_args))

    rospy.Publisher.publish, _SubscriberImpl._invoke_callback = publish_late, invoke_late


if "SITUATION_AWARENESS_DELAYS" in os.environ:
    delay_messages(*(float(word) for word in os.environ["SITUATION_AWARENESS_DELAYS"].split()))
