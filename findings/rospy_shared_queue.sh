#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: each rospy.Subscriber has the queue that it asks for, so that one with queue_size=1 and a slow callback is
# called with the newest message each time, whoever else in the process listens to the topic.
#
# Seen with rospy 1.15.15 (Debian 12): the subscribers of a topic in one process share one connection and one list of
# messages. Its length is what queue_size was when the connection was made: of the subscriber that came first, if there
# was time to connect before the next one. A slow callback with queue_size=1 that comes after one with 1000 gets every
# message in its order, ever later; alone it gets the newest. A controller that stops on stale poses stands for good.
# Remedy: keep the latest message in the callback and act in a thread of one's own.
#
# Output, 200 messages in 4 s, a callback of 0.15 s:
#     alone calls 29 first age 0.00 s, last age 0.08 s
#     after calls 42 first age 0.00 s, last age 5.33 s
set -euo pipefail
folder=$(mktemp -d)
trap 'kill $(jobs -p) 2> /dev/null || true; rm -rf "$folder"' EXIT
cd "$folder"
packages=(python3-rospy=1.15.15+ds-2 python3-rosgraph=1.15.15+ds-2 python3-rosmaster=1.15.15+ds-2
  python3-roslib=1.15.8-3 python3-genpy=0.6.16-2 python3-genmsg=0.6.0-1 python3-rospkg=1.4.0-2
  python3-std-msgs=0.5.13-2 python3-rosgraph-msgs=1.11.3-2 python3-roscpp-msg=1.15.15+ds-2 python3-yaml=6.0-3+b2
  python3-catkin-pkg=0.5.2-5 python3-distro=1.8.0-1 python3-defusedxml=0.7.1-2 python3-pyparsing=3.0.9-1
  python3-dateutil=2.8.2-2 python3-six=1.16.0-4)
apt-get download -q "${packages[@]}" > log 2>&1 || { cat log >&2; exit 1; }
for deb in *.deb; do dpkg -x "$deb" root; done
export PYTHONPATH="$folder/root/usr/lib/python3/dist-packages" ROS_MASTER_URI=http://127.0.0.1:23971 ROS_IP=127.0.0.1
export ROS_HOME="$folder/home" ROS_LOG_DIR="$folder/home"
PATH=/usr/bin:/bin
python3 -c 'import rosmaster; rosmaster.rosmaster_main(["rosmaster", "--core", "-p", "23971"])' > master.log 2>&1 &
cat > sender.py <<'P'
import time, rospy
from std_msgs.msg import Header
rospy.init_node("sender")
publisher = rospy.Publisher("topic", Header, queue_size=1000)
while publisher.get_num_connections() == 0:
    time.sleep(0.05)
time.sleep(1.0)
for _ in range(200):
    publisher.publish(Header(stamp=rospy.Time.now()))
    time.sleep(0.02)
time.sleep(0.5)
P
cat > receiver.py <<'P'
import sys, time, rospy
from std_msgs.msg import Header
rospy.init_node("receiver")
others = [rospy.Subscriber("topic", Header, lambda message: None, queue_size=1000)] if sys.argv[1] == "after" else []
time.sleep(1.0)
ages = []
def slow(message):
    ages.append((rospy.Time.now() - message.stamp).to_sec())
    time.sleep(0.15)
subscriber = rospy.Subscriber("topic", Header, slow, queue_size=1)
begin = time.monotonic()
while time.monotonic() < begin + 6.5:
    time.sleep(0.1)
print(sys.argv[1], "calls", len(ages), "first age %.2f s, last age %.2f s" % (ages[0], ages[-1]))
grows = ages[-1] - ages[0] > 1.0
assert grows == (sys.argv[1] == "after"), ages
assert grows or (len(ages) < 40 and ages[-1] < 0.2), ages
P
for _ in $(seq 50); do python3 -c 'import rosgraph, sys; sys.exit(not rosgraph.is_master_online())' && break; sleep 0.2; done
for how in alone after; do
  python3 sender.py & sender=$!
  python3 receiver.py $how
  wait $sender
done
