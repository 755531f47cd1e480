# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of ROS 2 for tests, without ROS 2: messages of ROS 1 in CDR (OMG formal/2021-02-01), in a database as
rosbag2_storage_sqlite3 of ROS 2 Humble has it, without definitions of types."""
import json
import sqlite3
import struct

import genmsg.msgs
import small_bags

FORMATS = {"bool": "?", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
           "int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}
FOREVER = "{sec: 2147483647, nsec: 4294967295}"
LATCHED = f"""- history: 3
  depth: 0
  reliability: 1
  durability: 1
  deadline: {FOREVER}
  lifespan: {FOREVER}
  liveliness: 1
  liveliness_lease_duration: {FOREVER}
  avoid_ros_namespace_conventions: false
"""


class Cdr:
    """Little-endian; a number is aligned to its size, from the end of the header of four bytes on."""

    def __init__(self, msg):
        self.data = bytearray()
        self.add(msg._type, msg)

    def message(self):
        return b"\0\1\0\0" + bytes(self.data)

    def number(self, code, value):
        self.data += bytes(-len(self.data) % struct.calcsize(code)) + struct.pack("<" + code, value)

    def add(self, kind, value):
        base, is_array, length = genmsg.msgs.parse_type(kind)
        if is_array:
            if length is None:
                self.number("I", len(value))
            for one in value:
                self.add(base, one)
        elif kind in FORMATS:
            self.number(FORMATS[kind], value)
        elif kind == "string":
            self.number("I", len(value.encode()) + 1)
            self.data += value.encode() + b"\0"
        elif kind == "time":
            self.number("i", value.secs)
            self.number("I", value.nsecs)
        else:
            for name, of in zip(value.__slots__, value._slot_types):
                if (kind, name) != ("std_msgs/Header", "seq"):  # ROS 2 has none
                    self.add(of, getattr(value, name))


def type_of(msg):
    return msg._type.replace("/", "/msg/")


def qos_of(topic):
    return LATCHED if topic.endswith("tf_static") else ""


def write_database(path, messages, serialization="cdr"):
    """`messages` as small_bags.write has them."""
    topics = {}
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
                     "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
                     "timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
    for t, topic, msg in small_bags.in_order(messages):
        if topic not in topics:
            topics[topic] = len(topics) + 1
            database.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?)",
                             (topics[topic], topic, type_of(msg), serialization, qos_of(topic)))
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                         (topics[topic], small_bags.at(t).to_nsec(), Cdr(msg).message()))
    database.commit()
    database.close()
    return path


def write_folder(folder, messages):
    """The same with its metadata, as ros2 bag record leaves it."""
    folder.mkdir()
    write_database(folder / "run_0.db3", messages)
    times = [small_bags.at(t).to_nsec() for t, _, _ in messages]
    topics = {topic: (type_of(msg), sum(other == topic for _, other, _ in messages)) for _, topic, msg in messages}
    start = f"{{nanoseconds_since_epoch: {min(times)}}}"
    lines = ["rosbag2_bagfile_information:", "  version: 5", "  storage_identifier: sqlite3",
             f"  duration: {{nanoseconds: {max(times) - min(times)}}}", f"  starting_time: {start}",
             f"  message_count: {len(messages)}", "  compression_format: ''", "  compression_mode: ''",
             "  relative_file_paths: [run_0.db3]", "  topics_with_message_count:"]
    for topic, (kind, count) in topics.items():
        lines += [f"  - message_count: {count}", "    topic_metadata:", f"      name: {topic}", f"      type: {kind}",
                  "      serialization_format: cdr", "      offered_qos_profiles: " + json.dumps(qos_of(topic))]
    (folder / "metadata.yaml").write_text("\n".join(lines) + "\n")
    return folder
