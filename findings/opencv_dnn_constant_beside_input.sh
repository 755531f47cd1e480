#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: planes of constants beside the image, such as the coordinates of its pixels, are an ordinary Concat for OpenCV.
#
# Seen with OpenCV 4.6.0 (Debian 12) and 4.10.0 (Debian 13): where the first layer of a network concatenates its input
# with a constant, the input does not arrive: its channels have whatever was in memory. Behind any layer, if only an
# Identity, it is right, and so it is without fusion of layers. OpenCV 5.0.0 is right. Remedy: an Identity before the
# Concat.
#
# Output, whether the image arrives behind the Concat:
#     4.6.0 first layer False, behind an Identity True, without fusion True
#     4.10.0 first layer False, behind an Identity True, without fusion True
#     5.0.0 first layer True, behind an Identity True
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/concat.py" <<'P'
import cv2
import numpy as np
from onnx import TensorProto, helper, numpy_helper

random = np.random.default_rng(0)
image = random.normal(size=(1, 4, 7, 9)).astype(np.float32)
places = random.normal(size=(1, 2, 7, 9)).astype(np.float32)

def arrives(is_first=True, fusion=True):
    before = [] if is_first else [helper.make_node("Identity", ["x"], ["same"])]
    concat = helper.make_node("Concat", ["x" if is_first else "same", "places"], ["y"], axis=1)
    graph = helper.make_graph([*before, concat], "graph",
                              [helper.make_tensor_value_info("x", TensorProto.FLOAT, image.shape)],
                              [helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 6, 7, 9])],
                              [numpy_helper.from_array(places, "places")])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8).SerializeToString()
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model, np.uint8))
    if not fusion:
        net.enableFusion(False)
    net.setInput(image)
    return np.array_equal(net.forward(), np.concatenate([image, places], axis=1))

major = int(cv2.__version__.split(".")[0])
seen = {"first layer": arrives(), "behind an Identity": arrives(is_first=False)}
if major < 5:
    seen["without fusion"] = arrives(fusion=False)
print(cv2.__version__, ", ".join(f"{how} {whether}" for how, whether in seen.items()))
assert seen.pop("first layer") == (major == 5) and all(seen.values())
P
for version in 4.6.0.66 4.10.0.84 5.0.0.93; do
  python3 -m venv --clear "$folder/venv"
  "$folder/venv/bin/pip" install -q "opencv-python-headless==$version" onnx==1.17.0 \
    "numpy==$([ $version = 5.0.0.93 ] && echo 2.4.6 || echo 1.26.4)"
  "$folder/venv/bin/python" "$folder/concat.py"
done
