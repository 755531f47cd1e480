# SPDX-License-Identifier: BSD-3-Clause
"""What map_bag and check_bag make of a bag, and whether that is right or named: for the sections of
scripts/evaluate inputs."""
import dataclasses
import json
import pathlib
import re
import subprocess
import textwrap

import genpy
from geometry_msgs.msg import TransformStamped

T0_S = 1_700_000_000.0
MOST_RATIO = 1.2  # of the error with the ideal messages


def stamp(t_s):
    return genpy.Time.from_sec(T0_S + t_s)


def transform(t_s, parent, child, xyz, quaternion):
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp(t_s), parent, child
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = map(float, xyz)
    rotation.x, rotation.y, rotation.z, rotation.w = map(float, quaternion)
    return message


@dataclasses.dataclass
class Outcome:
    """What the tools make of a bag."""
    score: object  # of what was mapped: str(score), is_right(ideal score)
    warned: dict = dataclasses.field(default_factory=dict)  # by map_bag, and why its exit code is not 0: as of by_kind
    findings: dict = dataclasses.field(default_factory=dict)  # of check_bag


def run_tool(programs, name, *arguments):
    return subprocess.run([programs / name, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, check=False)


def by_kind(sentences, folder):
    """{the sentence without its numbers: sentence}, without who says it."""
    plain = [re.sub(r"^(map_bag: )?(\S+\.bag: )?", "", sentence.replace(f"{folder}/", "").strip())
             for sentence in sentences]
    return {re.sub(r"-?\d+(\.\d+)?", "#", sentence): sentence for sentence in plain}


def map_bag(programs, bag, out, *arguments):
    """(features of the map at the end, warnings and the reason of an exit code that is not 0)"""
    out.unlink(missing_ok=True)
    done = run_tool(programs, "map_bag", bag, *arguments, "--out", out)
    lines = [line for line in done.stderr.splitlines() if " % of " not in line]
    told = [line.partition(": warning: ")[2] for line in lines if ": warning: " in line]
    told += lines[-1:] if done.returncode else []
    features = features_of(out) if done.returncode == 0 else []
    return features, by_kind(told, bag.parent)


def check_bag(programs, bag, *arguments):
    """Its findings."""
    page = run_tool(programs, "check_bag", bag, *arguments).stdout.partition("To look at")[2]
    return by_kind(re.findall(r"(?m)^ *\d+\. (.*)$", page), bag.parent)


def features_of(path):
    """The map after the last line of map_bag."""
    features = {}
    for line in pathlib.Path(path).read_text().splitlines():
        update = json.loads(line)
        if update["full"]:
            features.clear()
        for gone in update["gone"]:
            features.pop(gone["id"], None)
        for feature in update["changed"]:
            features[feature["id"]] = feature
    return list(features.values())


def new_in(told, told_of_ideal):
    return [sentence for kind, sentence in told.items() if kind not in told_of_ideal]


def shortened(sentence):
    """For a table."""
    return textwrap.shorten(sentence, 200, placeholder=" ...").replace("|", "/")


def verdict_of(outcome, retry, ideal, needs_retry=False):
    """(text, whether the case is right at once, or named by both tools and right with `retry`'s options). `retry`:
    (options, outcome with them), or None, which is not enough where it is needed."""
    if outcome.score.is_right(ideal.score):
        return f"right: {outcome.score}", True
    if needs_retry and not retry:
        return f"**silent**: {outcome.score}", False
    told = {"map_bag": new_in(outcome.warned, ideal.warned), "check_bag": new_in(outcome.findings, ideal.findings)}
    named = [tool for tool, sentences in told.items() if sentences]
    if not named:
        return f"**silent**: {outcome.score}", False
    text = f"{outcome.score}; {shortened('; '.join(told[named[0]]))}"
    if retry:
        text += f"; `{retry[0]}`: {retry[1].score}"
    if retry and not retry[1].score.is_right(ideal.score):
        return f"**named, not right**: {text}", False
    return (f"named: {text}", True) if len(named) == 2 else (f"**named by {named[0]} alone**: {text}", False)
