#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: after a step of MuJoCo the data are those of `data.time`; a sensor's `noise` makes it noisy; and the six
# velocities of a free joint are in one frame.
#
# Seen with mujoco 2.3.7 and 4.0.0:
# - after mj_step time, qpos and qvel are new, sensors and poses of bodies and sites (xpos) those before the step: a
#   rangefinder that is stamped with `data.time` is late by a step, without noise, at each rate. mj_forward after the
#   step makes them new.
# - `noise` does nothing. 2.3.7 adds it with <flag sensornoise="enable"/>; 4.0.0 refuses that flag.
# - of a free joint qvel has the linear velocity in the world's frame, and the rates in the body's.
#
# Output of each version:
#     5 m/s, steps of 0.02 s: at 0.10 s qpos 0.50 m, but xpos 0.40 m and range to a wall at 2.5 m 2.10 m, noise 0.000 m
#     body with its x axis along the world's -z: qvel 1 0 0 1 0 0, linear 1 0 0 and rates 0 0 -1 in the world
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/step.py" <<'P'
import mujoco
import numpy as np

def made(flag=""):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep=".02" gravity="0 0 0">{flag}</option>
        <worldbody><geom type="box" pos="3 0 0" size=".5 1 1"/>
        <body><freejoint/><geom size=".1" mass="1"/><site name="s" zaxis="1 0 0"/></body></worldbody>
        <sensor><rangefinder site="s" noise=".1"/></sensor></mujoco>""")
    return model, mujoco.MjData(model)

model, data = made()
data.qvel[0] = 5.0
off_m = []
for _ in range(5):
    mujoco.mj_step(model, data)
    off_m.append(data.sensordata[0] - (2.5 - data.xpos[1, 0]))
noise_m = max(map(abs, off_m))
print(f"5 m/s, steps of 0.02 s: at {data.time:.2f} s qpos {data.qpos[0]:.2f} m, but xpos {data.xpos[1, 0]:.2f} m "
      f"and range to a wall at 2.5 m {data.sensordata[0]:.2f} m, noise {noise_m:.3f} m")
assert np.allclose([data.time, data.qpos[0], data.xpos[1, 0], data.sensordata[0]], [0.1, 0.5, 0.4, 2.1])
assert noise_m < 1e-9
mujoco.mj_forward(model, data)
assert np.allclose([data.xpos[1, 0], data.sensordata[0]], [0.5, 2.0])
try:
    noisy_model, noisy = made('<flag sensornoise="enable"/>')
    ranges_m = []
    for _ in range(100):
        mujoco.mj_step(noisy_model, noisy)
        ranges_m.append(noisy.sensordata[0])
    assert mujoco.__version__ == "2.3.7" and 0.05 < np.std(ranges_m) < 0.2, np.std(ranges_m)
except ValueError:
    assert mujoco.__version__ == "4.0.0"

model, data = made()
data.qpos[3:7] = np.sqrt(0.5), 0, np.sqrt(0.5), 0
data.qvel[:] = 1, 0, 0, 1, 0, 0
mujoco.mj_forward(model, data)
along_x = data.xmat[1].reshape(3, 3)[:, 0].copy()
velocity = data.qvel.copy()
moved = mujoco.MjData(model)
moved.qpos[:], moved.qvel[:] = data.qpos, velocity
model.opt.timestep = 1e-4
mujoco.mj_step(model, moved)
mujoco.mj_forward(model, moved)
turn = moved.xmat[1].reshape(3, 3) @ data.xmat[1].reshape(3, 3).T
rates = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2 / 1e-4
linear = (moved.qpos[:3] - data.qpos[:3]) / 1e-4
text = [" ".join(f"{round(float(x), 3) + 0.0:g}" for x in vector) for vector in (velocity, linear, rates)]
print("body with its x axis along the world's -z: qvel {}, linear {} and rates {} in the world".format(*text))
assert np.allclose(along_x, [0, 0, -1]) and np.allclose(linear, [1, 0, 0]) and np.allclose(rates, [0, 0, -1], atol=1e-3)
P
for version in 2.3.7 4.0.0; do
  python3 -m venv --clear "$folder/$version"
  "$folder/$version/bin/pip" install -q "mujoco==$version" "numpy==$([ $version = 4.0.0 ] && echo 2.4.6 || echo 1.26.4)"
  echo "mujoco $version"
  "$folder/$version/bin/python" "$folder/step.py"
done
