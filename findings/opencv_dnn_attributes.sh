#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: a network that OpenCV dnn reads from ONNX and runs without an error gives what onnxruntime gives; what it does
# not know it refuses.
#
# Seen with OpenCV 4.6.0 (Debian 12), 4.10.0 (Debian 13) and 5.0.0: attributes and types that it does not know are taken
# as the usual ones, and the answer is another one of the right, or even of another shape. Remedy: keep the answer of
# the training framework for one input beside the network, and compare it when the network is loaded.
# - AveragePool count_include_pad=1, PyTorch's default: the padding does not count.
# - auto_pad=SAME_LOWER pads as SAME_UPPER, where the number of pixels to add is odd.
# - MaxPool dilations: none, and so larger images than asked for.
# - Cast to an integer keeps the fraction, so integers of a division are not whole: labels 1 / 2 = 0.5.
# - Resize by `scales` where the new size is not whole: the ratio of the sizes counts, not the scale that is written.
# - Resize nearest with `ceil`: rounded to the nearest.
# - Softmax up to opset 12: of the axis alone, while ONNX meant all axes from that one on. (Most networks mean what
#   OpenCV does; onnxruntime does what is written.)
# - PRelu by a slope for each column: by channel.
#
# Output, = where OpenCV gives what onnxruntime gives, # where not:
#                           4.6.0 4.10.0 5.0.0
#     average with padding    #     #     =
#     SAME_LOWER              #     #     #
#     dilated maximum         #     #     =
#     cast to integer         #     #     =
#     scale 1.5 of 7 x 9      #     #     #
#     nearest, ceil           #     #     =
#     Softmax, opset 11       #     #     #
#     PRelu by column         #     #     #
#     Softmax, opset 13       =     =     =
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/compare.py" <<'P'
import json
import sys

import cv2
import numpy as np
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

random = np.random.default_rng(0)
x = random.normal(size=(1, 4, 7, 9)).astype(np.float32)

def agrees(*nodes, opset=13, **constants):
    """Whether both give the same of x by these nodes (operator, inputs, attributes); the last one's output is y."""
    made = [helper.make_node(kind, inputs, ["y" if i + 1 == len(nodes) else f"n{i}"], **attributes)
            for i, (kind, inputs, attributes) in enumerate(nodes)]
    given = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    def model(shape):
        graph = helper.make_graph(made, "graph", [helper.make_tensor_value_info("x", TensorProto.FLOAT, x.shape)],
                                  [helper.make_tensor_value_info("y", TensorProto.FLOAT, shape)], given)
        opsets = [helper.make_opsetid("", opset)]
        return helper.make_model(graph, opset_imports=opsets, ir_version=8).SerializeToString()
    right = onnxruntime.InferenceSession(model(None), providers=["CPUExecutionProvider"]).run(None, {"x": x})[0]
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model(right.shape), np.uint8))
    net.setInput(x)
    answer = net.forward()
    return answer.shape == right.shape and bool(np.allclose(answer, right, atol=1e-4))

def resized(scale, **how):
    return agrees(("Resize", ["x", "", "scales"], how), scales=np.array([1, 1, scale, scale], np.float32))

json.dump({
    "average with padding":
        agrees(("AveragePool", ["x"], dict(kernel_shape=[3, 3], pads=[1] * 4, count_include_pad=1))),
    "SAME_LOWER": agrees(("MaxPool", ["x"], dict(kernel_shape=[2, 2], strides=[2, 2], auto_pad="SAME_LOWER"))),
    "dilated maximum": agrees(("MaxPool", ["x"], dict(kernel_shape=[3, 3], dilations=[2, 2]))),
    "cast to integer":
        agrees(("Cast", ["x"], dict(to=TensorProto.INT64)), ("Cast", ["n0"], dict(to=TensorProto.FLOAT))),
    "scale 1.5 of 7 x 9":
        resized(1.5, mode="linear", coordinate_transformation_mode="pytorch_half_pixel"),
    "nearest, ceil": resized(2.0, mode="nearest", nearest_mode="ceil"),
    "Softmax, opset 11": agrees(("Softmax", ["x"], dict(axis=1)), opset=11),
    "PRelu by column": agrees(("PRelu", ["x", "slope"], {}), slope=random.normal(size=9).astype(np.float32)),
    "Softmax, opset 13": agrees(("Softmax", ["x"], dict(axis=1))),
}, open(sys.argv[1], "w"))
P
for version in 4.6.0.66 4.10.0.84 5.0.0.93; do
  numpy=1.26.4
  [ $version != 5.0.0.93 ] || numpy=2.4.6
  python3 -m venv --clear "$folder/venv"
  "$folder/venv/bin/pip" install -q "opencv-python-headless==$version" "numpy==$numpy" onnx==1.17.0 \
    onnxruntime==1.20.1
  "$folder/venv/bin/python" "$folder/compare.py" "$folder/$version.json" 2> "$folder/log" ||
    { cat "$folder/log" >&2; exit 1; }
done
python3 - "$folder" <<'P'
import json
import sys

versions = {version: json.load(open(f"{sys.argv[1]}/{version}.json"))
            for version in ("4.6.0.66", "4.10.0.84", "5.0.0.93")}
expected = {"average with padding": "##=", "SAME_LOWER": "###", "dilated maximum": "##=", "cast to integer": "##=",
            "scale 1.5 of 7 x 9": "###", "nearest, ceil": "##=", "Softmax, opset 11": "###", "PRelu by column": "###",
            "Softmax, opset 13": "==="}
print(f"{'':22}4.6.0 4.10.0 5.0.0")
for case, marks in expected.items():
    seen = "".join("=" if agrees[case] else "#" for agrees in versions.values())
    print(f"{case:22}" + "".join(f"{mark:^6}" for mark in seen))
    assert seen == marks, case
P
