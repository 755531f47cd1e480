#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draw the tracks that objects_bag wrote over the scans of a bag of a scanner that stands still.

    rosrun situation_awareness objects_bag IN.bag --static-sensor --out OUT.jsonl
    examples/plot_objects_bag.py IN.bag OUT.jsonl OUT.png [--scan-topic /scan] [--min-length 1.0]

Needs python3-matplotlib and python3-rosbag. Grey: every hit of every tenth scan. Lines: centres over time, thick where
an element moved by more than --min-length metres. Outlines: each element as it was last seen.
"""
import argparse
import collections
import json
import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import rosbag
from matplotlib.patches import Polygon


def hits(bag, topic):
    x, y = [], []
    with rosbag.Bag(bag) as recorded:
        for number, (_, scan, _) in enumerate(recorded.read_messages(topics=[topic])):
            if number % 10:
                continue
            for i, r in enumerate(scan.ranges):
                if scan.range_min <= r <= scan.range_max and r > 0.1:
                    angle = scan.angle_min + i * scan.angle_increment
                    x.append(r * math.cos(angle))
                    y.append(r * math.sin(angle))
    return x, y


def tracks(path):
    """Element id -> its states over time, where it was seen."""
    result = collections.defaultdict(list)
    with open(path, encoding="utf-8") as file:
        for line in file:
            for state in json.loads(line)["objects"]:
                if state["beams"]:
                    result[state["id"]].append(state)
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag")
    parser.add_argument("map")
    parser.add_argument("picture")
    parser.add_argument("--scan-topic", default="/scan")
    parser.add_argument("--min-length", type=float, default=1.0)
    args = parser.parse_args()

    figure, axes = plt.subplots(figsize=(10, 10))
    axes.plot(*hits(args.bag, args.scan_topic), ",", color="0.6")
    moved = 0
    for number, states in sorted(tracks(args.map).items()):
        x = [state["x"] for state in states]
        y = [state["y"] for state in states]
        far = max(math.hypot(a - x[0], b - y[0]) for a, b in zip(x, y)) > args.min_length
        color = f"C{number % 10}"
        axes.plot(x, y, "-", color=color, linewidth=1.6 if far else 0.6, alpha=0.9)
        last = states[-1]
        axes.add_patch(Polygon(last["outline"], fill=False, edgecolor=color, linewidth=0.6))
        if far:
            moved += 1
            axes.annotate(str(number), (x[0], y[0]), fontsize=7, color=color)
    axes.plot(0, 0, "k^")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"{args.map}: {moved} elements moved by more than {args.min_length} m")
    axes.set_aspect("equal")
    figure.tight_layout()
    figure.savefig(args.picture, dpi=110)


if __name__ == "__main__":
    main()
