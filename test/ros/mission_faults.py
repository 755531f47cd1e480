# SPDX-License-Identifier: BSD-3-Clause
"""Faults of a message on its way to a mission, for its cells of the tables of docs/reliability.md: each is a function
from the message that should be sent to that which is sent, None for none."""
import copy

import rospy
from geometry_msgs.msg import Point
from situation_awareness.msg import MapFeature, MapUpdate


def outline_feature(feature_id, points, sigma=0.1, closed=False, bulge=None):
    """A polyline of the map; with bulges a boundary, all of whose main vertices are corners."""
    msg = MapFeature(id=feature_id, kind=MapFeature.POLYLINE, motion=MapFeature.FIXED, p_exists=1.0, closed=closed,
                     outline=[Point(x, y, 0) for x, y in points], sigma=[sigma] * len(points))
    if bulge is not None:
        msg.kind, msg.bulge, msg.corner = MapFeature.BOUNDARY, list(bulge), [i % 2 == 0 for i in range(len(points))]
    return msg


def ellipse_feature(feature_id, x, y, rx, ry):
    """One that stands."""
    return MapFeature(id=feature_id, kind=MapFeature.ELLIPSE, motion=MapFeature.STANDING, p_exists=1.0,
                      center=Point(x, y, 0), rx=rx, ry=ry, covariance=[0.01 * (i % 9 == 0) for i in range(64)])


def map_update(stamp, version, features=(), frame="map"):
    """A whole map."""
    msg = MapUpdate(map="fixed", version=version, full=True, changed=sorted(features, key=lambda one: one.id))
    msg.header.frame_id, msg.header.stamp = frame, stamp
    return msg


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


def after(steps):
    """Nothing for so many steps, then all."""
    left = [steps]

    def begin(msg):
        left[0] -= 1
        return None if left[0] >= 0 else msg
    return begin


def cells_of(fault):
    """Those that a fault shows: a program that was killed sends nothing, as one that stopped."""
    return (fault, "killed") if fault == "stopped" else (fault,)


def common(restarts_after):
    """Of any message with a header; a program that is restarted is silent for so many steps."""
    return {"never came": lambda msg: None, "stopped": lambda msg: None, "restarted": after(restarts_after),
            "frozen": frozen(), "late by 1 s": shifted(-1.0), "2 s ahead": shifted(2.0),
            "back by 1 h": shifted(-3600.0), "wrong frame": lambda msg: set_number(msg, "header.frame_id", "elsewhere")}
