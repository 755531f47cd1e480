# SPDX-License-Identifier: BSD-3-Clause
# The Debian package, built and installed: docker build -t situation_awareness . ; docs/install.md has how to run it.
FROM debian:bookworm-slim AS build
WORKDIR /source
COPY . .
RUN scripts/build_deb

FROM debian:bookworm-slim
COPY --from=build /source/build/deb/situation-awareness_*.deb /tmp/
RUN apt-get update -q \
 && apt-get install -q -y --no-install-recommends /tmp/situation-awareness_*.deb python3-diagnostic-msgs \
      python3-dynamic-reconfigure python3-rosnode python3-rosservice python3-rostopic python3-std-srvs rosbash \
 && rm -rf /tmp/*.deb /var/lib/apt/lists/*
RUN useradd --create-home robot
USER robot
ENTRYPOINT ["roslaunch", "situation_awareness"]
CMD ["sim.launch", "rviz:=false"]
