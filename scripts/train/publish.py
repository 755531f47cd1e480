# SPDX-License-Identifier: BSD-3-Clause
"""Write the files for the C++ side: an ONNX file and the manifest that it is checked against.

Besides what trainer.py asks for, a task that is to be published has

    input_name, output_name, shape, outputs, fill    names, the input's shape without the batch, numbers in the
                                                     answer, and the input where nothing returned
    parameters                                       trainable numbers that the ONNX file must hold
    published()                                      the nn.Module to write, with the weights as they are now
    golden_input()                                   one input of that shape, float32

A network of another kind than one row in, one row out has, instead of outputs, fill and golden_input(),

    dynamic_axes                                     the sizes that are free, as torch.onnx.export takes them
    contract(network)                                the lines of the manifest on input, output and golden vector
"""

import hashlib
import io
import pathlib

import numpy as np
import onnx
import torch

OPSET = 12


def export(task, network, path):
    """One ONNX file with a free batch size; its initialisers keep PyTorch's names."""
    network = network.cpu().eval()
    free = getattr(task, "dynamic_axes", {task.input_name: {0: "batch"}, task.output_name: {0: "batch"}})
    buffer = io.BytesIO()
    torch.onnx.export(
        network, (torch.zeros(2, *task.shape),), buffer, opset_version=OPSET, input_names=[task.input_name],
        output_names=[task.output_name], dynamic_axes=free, dynamo=False,
    )
    model = onnx.load_from_string(buffer.getvalue())
    onnx.checker.check_model(model, full_check=True)
    stored = sum(int(np.prod(tensor.dims)) for tensor in model.graph.initializer)
    if stored != task.parameters:
        raise ValueError(f"{stored} parameters in the ONNX file, {task.parameters} expected")
    path.write_bytes(model.SerializeToString())


def golden(task, network):
    """One input as (index of its first number that is not `fill`, its numbers with 6 decimals, the answer to these)."""
    row = task.golden_input().reshape(-1).copy()
    filled = np.flatnonzero(row != np.float32(task.fill))
    part = slice(filled[0], filled[-1] + 1)
    row[part] = np.round(row[part].astype(float), 6)
    with torch.no_grad():
        answer = network(torch.from_numpy(row).reshape(1, *task.shape))[0].numpy()
    return int(filled[0]), row[part], answer


def load(network, path):
    """Put the weights of a file written by `export` into `network`, a module of the same class."""
    tensors = {t.name: onnx.numpy_helper.to_array(t).copy() for t in onnx.load(path).graph.initializer}
    state = network.state_dict()
    # The exporter writes a layer without a bias as a product with the transposed matrix, under a name of its own.
    unnamed = [tensor.T for name, tensor in tensors.items() if name not in state]
    network.load_state_dict({
        name: torch.from_numpy(np.ascontiguousarray(tensors[name] if name in tensors else unnamed.pop(0)))
        for name in state
    })
    return network


def _numbers(values):
    return "[" + ", ".join(f"{value:.6f}" for value in values) + "]"


def _yaml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {_yaml(part)}" for name, part in value.items()) + "}"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _row_contract(task, network):
    first, values, answer = golden(task, network)
    shape = ", ".join(str(size) for size in task.shape)
    return f"""\
input: {{name: {task.input_name}, shape: [batch, {shape}]}}
output: {{name: {task.output_name}, shape: [batch, {task.outputs}]}}
# One input, from index `first` on; all its other numbers are `fill`. The network must give `output`.
golden:
  first: {first}
  fill: {task.fill:g}
  input: {_numbers(values)}
  output: {_numbers(answer)}
"""


def publish(task, folder, training):
    """Write <task.name>.onnx and its manifest; `training` is told in the manifest, name by name."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{task.name}.onnx"
    network = task.published()
    export(task, network, path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    contract = task.contract(network) if hasattr(task, "contract") else _row_contract(task, network)
    told = "\n".join(f"  {name}: {_yaml(value)}" for name, value in training.items())
    (folder / f"{task.name}.manifest.yaml").write_text(f"""\
# Checked before {task.name}.onnx is parsed; written by scripts/train/train.py.
version: 1
file: {task.name}.onnx
sha256: {digest}
parameters: {task.parameters}
{contract}training:
{told}
""")
    print(f"wrote {path} and its manifest, sha256 {digest}")
