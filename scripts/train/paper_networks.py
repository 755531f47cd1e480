# SPDX-License-Identifier: BSD-3-Clause
"""The networks of both papers as printed: input is the whole scan, output in the sensor frame
(docs/math/paper_networks.md)."""

from typing import NamedTuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from dataset import BEAMS, FIRST_AZIMUTH_RAD, MAX_RANGE_M, RESOLUTION_RAD

ROW_MULTIPLE = 16  # empty rows are added up to it: PyTorch prepares bfloat16 products anew for every new shape
WIDE = 128  # beams of a window; of wider ones there are few, and empty rows are dear
MIN_GROUP = 5  # fewer samples of one width than this join the next wider ones


DIFFERENCE_GAIN = 10.0  # of differences against ranges, when training starts
CLIP = 2.0
EXACT_LAYERS = 2  # products with whole ranges in single precision: others would lose centimetres


class Layer(NamedTuple):
    channels: int  # 0: max pooling
    kernel: int
    stride: int
    padding: int


class Design(NamedTuple):
    name: str
    layers: tuple
    dense: tuple  # neurons of the hidden dense layers
    outputs: tuple  # of the parallel output layers; the third, the radii, has a ReLU
    output_bias: bool
    fill: float  # input where nothing returned
    parameters: int  # as printed
    widths: tuple  # of the windows that training computes, in beams
    harmonics: int  # of the azimuth in what trains the first dense layer


_POOL = Layer(0, 2, 2, 0)

# Ellipse paper, Table II. The printed number of parameters needs one zero on either side of every layer's input.
VGG = Design(
    "paper_vgg",
    tuple(Layer(c, 3, s, 1) for c, s in zip((25, 25, 50, 50, 100, 100, 150, 150, 200, 200, 250, 250), (1, 2) * 6)),
    (250, 250), (2, 1, 2), True, 0.0, 1_846_505, (72, 104, 176, 400), 4,
)
# Ellipse paper, Table I. Needs that nothing is padded.
ALEX = Design(
    "paper_alex",
    (Layer(50, 7, 1, 0), Layer(50, 7, 1, 0), _POOL, *(Layer(100, 7, 1, 0), Layer(100, 7, 1, 0), _POOL) * 2),
    (125,), (2, 1, 2), True, 0.0, 1_814_105, (16, 28, 44, 80, 200), 6,
)
# Circle paper, Table I. Needs that nothing is padded and that the output layer has no bias.
CIRCLE = Design(
    "paper_circle",
    tuple(Layer(c, 7, s, 0) for c, s in zip((50, 50, 100, 100, 100, 100), (1, 2) * 3)),
    (125,), (3,), False, -1.0, 1_826_350, (16, 28, 44, 80, 200), 6,
)


class PaperNetwork(nn.Module):
    """Its convolutions are Conv2d of height 1, which OpenCV dnn runs 2.5 times faster than Conv1d."""

    def __init__(self, design):
        super().__init__()
        self.design = design
        channels, length = 1, BEAMS
        self.convolutions = nn.ModuleList()
        self.lengths = []  # of each layer's output
        for layer in design.layers:
            if layer.channels:
                self.convolutions.append(
                    nn.Conv2d(channels, layer.channels, (1, layer.kernel), (1, layer.stride), (0, layer.padding))
                )
                channels = layer.channels
            length = (length + 2 * layer.padding - layer.kernel) // layer.stride + 1
            self.lengths.append(length)
        sizes = (channels * length,) + design.dense
        self.dense = nn.ModuleList(nn.Linear(i, o) for i, o in zip(sizes[:-1], sizes[1:]))
        self.outputs = nn.ModuleList(nn.Linear(sizes[-1], o, design.output_bias) for o in design.outputs)
        for layer in (*self.convolutions, *self.dense):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            nn.init.zeros_(layer.bias)
        with torch.no_grad():
            self._start_with_differences()
            for layer in self.outputs:
                nn.init.normal_(layer.weight, 0.0, 0.02)
                if layer.bias is not None:
                    nn.init.zeros_(layer.bias)
            if len(self.outputs) == 3:
                self.outputs[2].bias.copy_(torch.tensor([0.3, 0.15]))  # not dead from the start
        count = sum(parameter.numel() for parameter in self.parameters())
        assert count == design.parameters, f"{design.name} has {count} parameters, {design.parameters} are printed"

    def _start_with_differences(self):
        """Shapes are centimetres in ranges of metres, so most of the first filters start as differences of
        neighbouring ranges, amplified, in pairs which the second layer subtracts: min(difference, CLIP), since at the
        ends of an object the difference is the whole range. The others start with the range itself.
        """
        first, second = self.convolutions[:2]
        whole = first.out_channels // 5
        first.weight[:whole] *= MAX_RANGE_M
        first.bias[:whole] = -self.design.fill * first.weight[:whole].sum((1, 2, 3))  # silent where nothing returned
        differences = first.weight[whole::2]
        differences -= differences.mean(3, keepdim=True)
        differences *= MAX_RANGE_M * DIFFERENCE_GAIN
        first.weight[whole + 1 :: 2] = differences
        first.bias[whole + 1 :: 2] = -CLIP
        second.weight[:, whole + 1 :: 2] = -second.weight[:, whole::2]

    def forward(self, x):
        """x: n x 1 x 1 x 1081, ranges / 10 m or `fill` -> (t_x, t_y, psi, rx, ry) or (t_x, t_y, r)."""
        convolutions = iter(self.convolutions)
        for layer in self.design.layers:
            if layer.channels:
                x = functional.relu(next(convolutions)(x))
            else:
                x = functional.max_pool2d(x, (1, layer.kernel))
        return self.answer(self.hidden(self.dense[0](x.flatten(1))))

    def hidden(self, x):
        x = functional.relu(x)
        for layer in self.dense[1:]:
            x = functional.relu(layer(x))
        return x

    def answer(self, hidden, slope=0.0):
        """`slope`, only in training: of the radii's ReLU below zero, so that they cannot die."""
        parts = [layer(hidden) for layer in self.outputs]
        if len(parts) == 1:
            return parts[0]
        radii = functional.leaky_relu(parts[2], slope) if slope else functional.relu(parts[2])
        return torch.cat((*parts[:2], radii), dim=1)


class Window(NamedTuple):
    """The inputs `first` ... `first` + width - 1 of some samples; all other inputs are `fill`."""

    inputs: torch.Tensor  # n x width
    first: torch.Tensor  # n, multiples of the network's total stride


class Trainee(nn.Module):
    """A paper's network with what is needed only while it is trained.

    The first dense layer is trained as W + sum_k B_k(azimuth) V_k with harmonics B_k of the azimuth at which a feature
    lies: what is learned at one azimuth holds at all others, as it should, since answers turn with the scene. `fold`
    leaves one matrix, as printed. `smooth`, of ellipses, is a second output (t_x, t_y, m, p, q) beside the printed
    one, whose loss has no jumps.
    """

    def __init__(self, design):
        super().__init__()
        self.published = PaperNetwork(design)
        self.total_stride = int(np.prod([layer.stride for layer in design.layers]))
        length, neurons = self.published.lengths[-1], design.dense[0]
        channels = self.published.dense[0].in_features // length
        stride, offset = 1, 0.0  # beam in the middle of what an output sees: stride * index + offset
        for layer in design.layers:
            offset += stride * ((layer.kernel - 1) / 2 - layer.padding)
            stride *= layer.stride
        azimuth = FIRST_AZIMUTH_RAD + RESOLUTION_RAD * (offset + stride * torch.arange(length, dtype=torch.float64))
        waves = [torch.ones_like(azimuth)]
        for k in range(1, design.harmonics + 1):
            waves += [torch.cos(k * azimuth), torch.sin(k * azimuth)]
        self.register_buffer("waves", torch.stack(waves, 1).float(), persistent=False)
        active = min(length, 4 if design is VGG else 10)  # outputs that one object reaches
        self.shared = nn.Parameter(torch.randn(len(waves), channels * neurons) / np.sqrt(channels * active * 3))
        weight = self.published.dense[0].weight.requires_grad_(False)  # `own` is trained instead, in a faster order
        self.own = nn.Parameter(0.3 * weight.view(neurons, channels, length).permute(2, 1, 0).reshape(length, -1))
        with torch.no_grad():
            self.shared[5:] *= 0.3
        self.smooth = nn.Linear(design.dense[-1], 5) if len(design.outputs) == 3 else None
        if self.smooth is not None:
            nn.init.normal_(self.smooth.weight, 0.0, 0.02)
            with torch.no_grad():
                self.smooth.bias.copy_(torch.tensor([0.0, 0.0, 0.2, 0.0, 0.0]))

    def _dense(self):
        """The first dense layer's weight, length * channels x neurons."""
        return torch.addmm(self.own, self.waves, self.shared).view(-1, self.published.dense[0].out_features)

    def fold(self):
        """The printed network, with the weights as they are now."""
        with torch.no_grad():
            weight = self.published.dense[0].weight
            folded = self._dense().view(self.published.lengths[-1], -1, len(weight)).permute(2, 1, 0)
            weight.copy_(folded.reshape(weight.shape))
        return self.published

    def _backgrounds(self):
        """Each layer's output where no hit reaches it, length x channels or, without padding, 1 x channels."""
        design = self.published.design
        padded = any(layer.padding for layer in design.layers)
        x = self.own.new_full((1, 1, 1, BEAMS if padded else 1), design.fill)
        backgrounds = [x[0, :, 0].t()]
        convolutions = iter(self.published.convolutions)
        for layer in design.layers:
            if layer.channels:
                convolution = next(convolutions)
                if padded:
                    x = functional.relu(convolution(x))
                else:
                    x = functional.relu(convolution(x.expand(-1, -1, -1, layer.kernel)))[..., :1]
            elif padded:
                x = functional.max_pool2d(x, (1, layer.kernel))
            backgrounds.append(x[0, :, 0].t())
        return backgrounds

    def prepare(self, dtype=torch.float32):
        """The common values of all windows of one step, for products of that type (EXACT_LAYERS keep their own)."""
        backgrounds = self._backgrounds()
        filters = []
        for i, c in enumerate(self.published.convolutions):
            kind = c.weight.dtype if i < EXACT_LAYERS else dtype
            filters.append((c.weight[:, :, 0].permute(2, 1, 0).reshape(-1, c.out_channels).to(kind), c.bias.to(kind)))
        return Prepared(backgrounds, filters, self._dense().to(dtype), dtype)

    def hidden(self, windows, prepared):
        """The last hidden layer of `published`, for the samples of (rows wanted, Window) one after the other."""
        empty = prepared.backgrounds[-1].expand(self.published.lengths[-1], -1).reshape(1, -1).to(prepared.dtype)
        whole = torch.cat([empty] + [self._difference(window, prepared)[:rows] for rows, window in windows])
        product = (whole @ prepared.dense).to(self.own.dtype)
        return self.published.hidden(product[1:] + product[:1] + self.published.dense[0].bias)

    def _difference(self, window, prepared):
        """The windows' changes of the first dense layer's input, computed only where the input is not `fill`.

        In every layer the samples differ from the background in an interval that is the same for all of them, counted
        from `first`: only that is computed, with the background put in on either side. Whatever lies beyond the ends
        of the vector is set to the padding's zeros.
        """
        design, n = self.published.design, len(window.first)
        lengths = (BEAMS, *self.published.lengths)
        filters = iter(prepared.filters)
        first, last = 0, window.inputs.shape[1] - 1
        offset = window.first
        padded = any(layer.padding for layer in design.layers)
        x = window.inputs[:, :, None]
        for i, layer in enumerate(design.layers):
            background, length = prepared.backgrounds[i], lengths[i]
            first_out = -((layer.kernel - 1 - layer.padding - first) // layer.stride)
            last_out = (last + layer.padding) // layer.stride
            low = layer.stride * first_out - layer.padding
            high = layer.stride * last_out - layer.padding + layer.kernel - 1
            before = _rows(background, offset, low, first, length).to(x.dtype)
            behind = _rows(background, offset, last + 1, high + 1, length).to(x.dtype)
            x = torch.cat((before, x, behind), dim=1)
            offset = offset // layer.stride
            first, last = first_out, last_out
            if layer.channels:
                weight, bias = next(filters)
                outside = _outside(offset, first, last, lengths[i + 1]) if padded else None
                x = _Convolve.apply(x, weight, bias, layer.kernel, layer.stride, outside)
                if i == EXACT_LAYERS - 1:
                    x = x.to(prepared.dtype)
            else:
                x = torch.maximum(x[:, ::2], x[:, 1::2])
        length = lengths[-1]
        background = prepared.backgrounds[-1]
        index = offset[:, None] + torch.arange(first, last + 1, device=offset.device)
        inside = (index >= 0) & (index < length)
        difference = x - background[index.clamp(0, length - 1) if len(background) > 1 else index * 0].to(x.dtype)
        flat = torch.where(inside, index + length * torch.arange(n, device=offset.device)[:, None], n * length)
        whole = x.new_zeros(n * length + 1, x.shape[2]).index_copy(0, flat.flatten(), difference.flatten(0, 1))
        return whole[:-1].view(n, -1)


class Prepared(NamedTuple):
    backgrounds: list  # of each layer's input and of the last one's output
    filters: list  # (weight, bias) of each convolution as matrices: kernel * channels_in x channels_out
    dense: torch.Tensor  # length * channels x neurons
    dtype: torch.dtype


def _rows(background, offset, low, high, length):
    """The background at offset + low ... offset + high - 1, zeros beyond its ends: n x (high - low) x channels."""
    if len(background) == 1:
        return background.expand(len(offset), high - low, -1)
    index = offset[:, None] + torch.arange(low, high, device=offset.device)
    index = torch.where((index >= 0) & (index < length), index, length)
    return functional.pad(background, (0, 0, 0, 1))[index]


def _outside(offset, first, last, length):
    """Rows of the flattened n x (last - first + 1) outputs that lie beyond the vector's ends."""
    index = offset[:, None] + torch.arange(first, last + 1, device=offset.device)
    return torch.nonzero(((index < 0) | (index >= length)).flatten())[:, 0]


class _Convolve(torch.autograd.Function):
    """ReLU of a convolution without padding, as one matrix product; the rows `outside` are set to 0.

    x is n x length x channels, so that the beams under the kernel lie one after the other in memory. On a CPU with
    AVX-512 and AMX this trains 2.5 times as fast as conv2d in bfloat16, 1.3 times in float32.
    """

    @staticmethod
    def _columns(x, kernel, stride):
        n, length, channels = x.shape
        length_out = (length - kernel) // stride + 1
        strides = (length * channels, stride * channels, 1)
        return x.as_strided((n, length_out, kernel * channels), strides).reshape(n * length_out, kernel * channels)

    @staticmethod
    def forward(ctx, x, weight, bias, kernel, stride, outside):
        columns = _Convolve._columns(x.contiguous(), kernel, stride)
        y = torch.addmm(bias, columns, weight).relu_()
        if outside is not None and len(outside) > 0:
            y[outside] = 0  # which also stops their gradient
        ctx.save_for_backward(columns, weight, y)
        ctx.shape, ctx.kernel, ctx.stride = x.shape, kernel, stride
        return y.view(len(x), -1, y.shape[1])

    @staticmethod
    def backward(ctx, gradient):
        columns, weight, y = ctx.saved_tensors
        gradient = torch.ops.aten.threshold_backward(gradient.reshape(y.shape), y, 0)
        by_weight, by_bias = columns.t() @ gradient, gradient.sum(0)
        if not ctx.needs_input_grad[0]:
            return None, by_weight, by_bias, None, None, None
        # The inputs of each phase of the stride take part through every stride-th tap of the kernel: again a product
        # of neighbours, of the gradient, with these taps in reverse.
        n, length, channels = ctx.shape
        gradient = gradient.view(n, -1, weight.shape[1])
        weight = weight.view(ctx.kernel, channels, -1)
        by_x = gradient.new_zeros(ctx.shape)
        for phase in range(ctx.stride):
            taps = weight[phase :: ctx.stride].flip(0).transpose(1, 2)
            beside = len(taps) - 1
            neighbours = _Convolve._columns(functional.pad(gradient, (0, 0, beside, beside)), len(taps), 1)
            part = (neighbours @ taps.reshape(-1, channels)).view(n, -1, channels)
            by_x[:, phase :: ctx.stride][:, : part.shape[1]] = part
        return by_x, by_weight, by_bias, None, None, None


def windows(design, total_stride, samples, which):
    """Split the samples `which` of a batch: (their places in `which`, Window), every sample in the narrowest window
    that holds it, but no window for a few samples alone."""
    first = samples.first_beam[which] // total_stride * total_stride
    needed = samples.first_beam[which] + samples.counts[which] - first
    waiting = np.empty(0, int)
    for low, high in zip((0, *design.widths), (*design.widths, BEAMS)):
        waiting = np.concatenate((waiting, np.flatnonzero((needed > low) & (needed <= high))))
        if len(waiting) >= MIN_GROUP or (len(waiting) > 0 and needed.max() <= high):
            multiple = ROW_MULTIPLE if high <= WIDE else ROW_MULTIPLE // 4
            rows = -(-len(waiting) // multiple) * multiple
            starts = np.zeros(rows, int)
            starts[: len(waiting)] = first[waiting]
            yield waiting, Window(
                torch.from_numpy(inputs(design, samples, which[waiting], rows, starts, high)), torch.from_numpy(starts)
            )
            waiting = np.empty(0, int)


def inputs(design, samples, which, rows=None, starts=None, width=BEAMS):
    """Normalised ranges of the samples' beams starts ... starts + width - 1, `fill` where nothing returned."""
    counts = samples.counts[which]
    starts = np.zeros(len(which), int) if starts is None else starts
    row = np.repeat(np.arange(len(which)), counts)
    beam = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    hit = np.repeat(samples.first_hit[which], counts) + beam
    result = np.full((rows or len(which), width), design.fill, np.float32)
    result[row, beam + np.repeat(samples.first_beam[which] - starts[: len(which)], counts)] = (
        samples.ranges_m[hit] / MAX_RANGE_M
    )
    return result
