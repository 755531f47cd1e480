#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: OpenCV 5 runs recurrent layers of ONNX, which OpenCV 4 refused, and so in all their directions.
#
# Seen with OpenCV 5.0.0: of an LSTM or GRU that reads a sequence backwards, the last state (Y_h) is not that of the
# whole sequence. Of an LSTM it is the state after the sequence's last element, the one that is read first. Forwards,
# and in both directions at once, it is right. Nothing is said. Remedy: reverse the sequence before a forward layer.
#
# Output, greatest difference from onnxruntime for states between -1 and 1:
#     LSTM forward 0.0, reverse 0.1, bidirectional 0.0
#     GRU forward 0.0, reverse 0.6, bidirectional 0.0
#     LSTM reverse is that of the last element alone: True
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q opencv-python-headless==5.0.0.93 numpy==2.4.6 onnx==1.17.0 onnxruntime==1.20.1
"$folder/bin/python" - <<'P'
import cv2
import numpy as np
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

length, inputs, states = 5, 3, 2
random = np.random.default_rng(0)
x = random.normal(size=(length, 1, inputs)).astype(np.float32)

def last_state(kind, gates, direction, sequence=x):
    """By onnxruntime and by OpenCV."""
    random = np.random.default_rng(1)
    ways = 2 if direction == "bidirectional" else 1
    weights = {name: random.normal(size=(ways, gates * states, *rest)).astype(np.float32)
               for name, rest in (("W", [inputs]), ("R", [states]))}
    weights["B"] = random.normal(size=(ways, 2 * gates * states)).astype(np.float32)
    layer = helper.make_node(kind, ["x", "W", "R", "B"], ["", "y"], hidden_size=states, direction=direction)
    graph = helper.make_graph([layer], "graph", [helper.make_tensor_value_info("x", TensorProto.FLOAT, sequence.shape)],
                              [helper.make_tensor_value_info("y", TensorProto.FLOAT, [ways, 1, states])],
                              [numpy_helper.from_array(value, name) for name, value in weights.items()])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8).SerializeToString()
    right = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"]).run(None, {"x": sequence})[0]
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model, np.uint8))
    net.setInput(sequence)
    return right.ravel(), net.forward().ravel()

for kind, gates in (("LSTM", 4), ("GRU", 3)):
    off = {way: np.abs(np.subtract(*last_state(kind, gates, way))).max()
           for way in ("forward", "reverse", "bidirectional")}
    print(kind, ", ".join(f"{way} {difference:.1f}" for way, difference in off.items()))
    assert off["forward"] < 1e-5 and off["bidirectional"] < 1e-5 and off["reverse"] > 0.1, off
of_last_alone = np.allclose(last_state("LSTM", 4, "reverse")[1], last_state("LSTM", 4, "reverse", x[-1:])[0], atol=1e-5)
print("LSTM reverse is that of the last element alone:", of_last_alone)
assert of_last_alone
P
