#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: the messages from 2 to 4 s of a recording are the same whoever reads them, and their order in the file, which
# need not be that of time, makes no difference to a reader.
#
# Seen with rosbag 1.15.15 (Debian 12), rosbags 0.11.9 and mcap 1.6.0: rosbag has the last one, rosbags and mcap (by
# `end_time`) do not. From a bag that rosbags wrote out of the order of time, rosbag gives the order of the file, and of
# a window one less: it searches the index as if it were sorted. rosbags and mcap sort. Nothing is said. Remedy: sort
# before writing, and compare the counts before windows are compared.
#
# Output, of messages at 1, 2, 3, 4 and 5 s, written so and as 1, 2, 3, 5, 4:
#     rosbags [1, 2, 3, 4, 5], from 2 to 4: [2, 3]
#     mcap [1, 2, 3, 4, 5], from 2 to 4: [2, 3]
#     rosbag [1, 2, 3, 4, 5], from 2 to 4: [2, 3, 4]
#     rosbags [1, 2, 3, 4, 5], from 2 to 4: [2, 3]
#     mcap [1, 2, 3, 4, 5], from 2 to 4: [2, 3]
#     rosbag [1, 2, 3, 5, 4], from 2 to 4: [2, 3]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q rosbags==0.11.9 mcap==1.6.0
cd "$folder"
packages=(python3-rosbag=1.15.15+ds-2 python3-roslz4=1.15.15+ds-2 python3-genpy=0.6.16-2 python3-genmsg=0.6.0-1
  python3-roslib=1.15.8-3 python3-rospy=1.15.15+ds-2 python3-rosgraph=1.15.15+ds-2 python3-rospkg=1.4.0-2
  python3-std-msgs=0.5.13-2 python3-rosgraph-msgs=1.11.3-2 python3-pycryptodome=3.11.0+dfsg1-4
  python3-gnupg=0.4.9-1 python3-yaml=6.0-3+b2 python3-catkin-pkg=0.5.2-5 python3-distro=1.8.0-1
  python3-pyparsing=3.0.9-1 python3-six=1.16.0-4)
apt-get download -q "${packages[@]}" > log 2>&1 || { cat log >&2; exit 1; }
for deb in *.deb; do dpkg -x "$deb" root; done
cat > others.py <<'P'
import json
import sys
import warnings

from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_typestore

warnings.simplefilter("ignore")
stamps_s, store, kind, ns = json.loads(sys.argv[1]), get_typestore(Stores.ROS1_NOETIC), "std_msgs/msg/String", 10**9
with Writer("out.bag") as bag:
    connection = bag.add_connection("/topic", kind, typestore=store)
    for stamp_s in stamps_s:
        bag.write(connection, stamp_s * ns, store.serialize_ros1(store.types[kind](data=""), kind))
with Reader("out.bag") as bag:
    seen = [[stamp_ns // ns for _, stamp_ns, _ in bag.messages(start=first, stop=last)]
            for first, last in ((None, None), (2 * ns, 4 * ns))]
print(f"rosbags {seen[0]}, from 2 to 4: {seen[1]}")
assert seen == [[1, 2, 3, 4, 5], [2, 3]]
with open("out.mcap", "wb") as file:
    writer = McapWriter(file)
    writer.start()
    channel = writer.register_channel("/topic", "json", writer.register_schema("schema", "jsonschema", b"{}"))
    for stamp_s in stamps_s:
        writer.add_message(channel, log_time=stamp_s * ns, publish_time=stamp_s * ns, data=b"{}")
    writer.finish()
with open("out.mcap", "rb") as file:
    reader = make_reader(file)
    seen = [[message.log_time // ns for _, _, message in reader.iter_messages(start_time=first, end_time=last)]
            for first, last in ((None, None), (2 * ns, 4 * ns))]
print(f"mcap {seen[0]}, from 2 to 4: {seen[1]}")
assert seen == [[1, 2, 3, 4, 5], [2, 3]]
P
cat > own.py <<'P'
import json
import sys

import genpy
import rosbag

bag = rosbag.Bag("out.bag")
seen = [[stamp.secs for _, _, stamp in bag.read_messages(start_time=first, end_time=last)]
        for first, last in ((None, None), (genpy.Time(2), genpy.Time(4)))]
print(f"rosbag {seen[0]}, from 2 to 4: {seen[1]}")
assert seen == [json.loads(sys.argv[1]), [2, 3, 4] if seen[0] == sorted(seen[0]) else [2, 3]]
P
for stamps in "[1, 2, 3, 4, 5]" "[1, 2, 3, 5, 4]"; do
  rm -f out.bag
  venv/bin/python others.py "$stamps"
  PYTHONPATH=root/usr/lib/python3/dist-packages /usr/bin/python3 own.py "$stamps"
done
