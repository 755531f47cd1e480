# SPDX-License-Identifier: BSD-3-Clause
"""Faults of a message on its way to a mission, for its cells of the tables of docs/reliability.md: each is a function
from the message that should be sent to that which is sent, None for none."""
import copy
import math

import rospy


def set_number(msg, path, value):
    """Of a field like "pose.pose.position.x" or "vertices[0].x"; the copy with it."""
    msg = copy.deepcopy(msg)
    at = msg
    *names, last = path.replace("]", "").replace("[", ".").split(".")
    for name in names:
        at = at[int(name)] if name.isdigit() else getattr(at, name)
    if last.isdigit():
        at[int(last)] = value
    else:
        setattr(at, last, value)
    return msg


def numbers(path, values=("NaN", "inf", "-1")):
    """The faults of a number of the message."""
    return {name: lambda msg, value=float(name): set_number(msg, path, value) for name in values}


def shifted(by_s):
    def shift(msg):
        return set_number(msg, "header.stamp", max(msg.header.stamp + rospy.Duration(by_s), rospy.Time(0, 1)))
    return shift


def frozen():
    """The first message again and again, with new stamps."""
    first = []

    def repeat(msg):
        first.append(msg)
        return set_number(first[0], "header.stamp", msg.header.stamp)
    return repeat


def common():
    """Of any message with a header. A program that was killed, or never started, sends nothing."""
    return {"never came": lambda msg: None, "stopped": lambda msg: None, "killed": lambda msg: None,
            "frozen": frozen(), "late by 1 s": shifted(-1.0), "2 s ahead": shifted(2.0),
            "back by 1 h": shifted(-3600.0), "wrong frame": lambda msg: set_number(msg, "header.frame_id", "elsewhere")}


def yaw_quaternion(yaw):
    return {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
