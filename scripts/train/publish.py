# SPDX-License-Identifier: BSD-3-Clause
"""Write what the C++ side loads: the ONNX file and the manifest that it is checked against."""

import hashlib
import io

import numpy as np
import onnx
import torch

import dataset
from network import PARAMETERS

OPSET = 12
NAME = "ellipse_vgg"
INPUT, OUTPUT = "segment", "ellipse"


def export(network, path):
    """One ONNX file with a free batch size; its initialisers keep PyTorch's names."""
    network.eval()
    buffer = io.BytesIO()
    torch.onnx.export(
        network, (torch.zeros(2, 1, 1, dataset.BEAMS),), buffer, opset_version=OPSET, input_names=[INPUT],
        output_names=[OUTPUT], dynamic_axes={INPUT: {0: "batch"}, OUTPUT: {0: "batch"}}, dynamo=False,
    )
    model = onnx.load_from_string(buffer.getvalue())
    onnx.checker.check_model(model)
    stored = sum(int(np.prod(tensor.dims)) for tensor in model.graph.initializer)
    assert stored == PARAMETERS, f"{stored} parameters in the ONNX file, {PARAMETERS} expected"
    path.write_bytes(model.SerializeToString())


def golden(network):
    """One synthetic segment as (index of its first input that is not 0, its inputs, the answer)."""
    samples = dataset.sample(np.random.default_rng(2020), 1, near_fraction=1.0)
    row = samples.inputs(np.array([0]), dataset.MIDDLE)
    filled = np.flatnonzero(row[0])
    values = np.array([float(f"{v:.6f}") for v in row[0, filled[0] : filled[-1] + 1]], np.float32)
    row[0, filled[0] : filled[-1] + 1] = values
    with torch.no_grad():
        answer = network(torch.from_numpy(row)[:, None, None]).numpy()[0]
    return int(filled[0]), values, answer


def numbers(values):
    return "[" + ", ".join(f"{value:.6f}" for value in values) + "]"


def publish(network, folder, command, seed, samples, losses):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{NAME}.onnx"
    export(network, path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    first, values, answer = golden(network)
    figures = "\n".join(
        f"    {name}: {{samples: {n}, ordered_m: {ordered:.4f}, symmetric_m: {symmetric:.4f}, error_m: {error:.4f}}}"
        for name, n, ordered, symmetric, error in losses
    )
    text = f"""\
# Checked by situation_awareness::EllipseNetwork before {NAME}.onnx is parsed; written by scripts/train/train.py.
version: 1
file: {NAME}.onnx
sha256: {digest}
parameters: {PARAMETERS}
input: {{name: {INPUT}, shape: [batch, 1, 1, {dataset.BEAMS}]}}
output: {{name: {OUTPUT}, shape: [batch, 5]}}
# One segment of one ellipse: the inputs from `first` on (all others are 0) and the answer in metres.
golden:
  first: {first}
  input: {numbers(values)}
  output: {numbers(answer)}
training:
  command: {command}
  seed: {seed}
  samples: {samples}
  # Mean losses on fresh samples of the ellipse paper's distribution; the standard error is the symmetric one's.
  losses:
{figures}
"""
    (folder / f"{NAME}.manifest.yaml").write_text(text)
    print(f"wrote {path} and its manifest, sha256 {digest}")
