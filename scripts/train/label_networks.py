# SPDX-License-Identifier: BSD-3-Clause
"""Networks that label images at a 16th of their size (grid paper, Sect. IV; docs/math/labels.md), and their training.

The input is a batch of RGB images, normalised, whose sides are multiples of 32; the output has a score per class and
label pixel. Widths are those of Darknet-19 and VGG16 times a factor, since the paper's are lost with its Fig. 2.
"""

import copy
import json
import pathlib

import numpy as np
import torch
from torch import nn
from torch.nn import functional

STRIDE, MULTIPLE = 16, 32
CLASSES = ("background", "car")
MEAN, DEVIATION = 0.45, 0.25  # of the numbers of 8 bits / 255, for all three colours
GOLDEN_PX = 64


# --- networks -------------------------------------------------------------------------------------------------------
def convolution(inputs, outputs, size, slope):
    """Convolution, batch normalisation, which `fused` takes into the convolution, and (leaky) ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, padding=size // 2, bias=False), nn.BatchNorm2d(outputs),
        nn.LeakyReLU(slope, inplace=True) if slope else nn.ReLU(inplace=True),
    )


def chain(inputs, layers, slope):
    """Layers are outputs of 3x3 convolutions, negative numbers those of 1x1 ones, and "pool"."""
    modules = []
    for layer in layers:
        if layer == "pool":
            modules.append(nn.MaxPool2d(2))
        else:
            modules.append(convolution(inputs, abs(layer), 3 if layer > 0 else 1, slope))
            inputs = abs(layer)
    return nn.Sequential(*modules), inputs


class LabelNetwork(nn.Module):
    """Layers to a 16th of the size, more to a 32nd, scores of both, those of the latter at twice the size, added."""

    def __init__(self, to_16th, to_32nd, slope, dropout=0.0):
        super().__init__()
        self.to_16th, skipped = chain(3, to_16th, slope)
        self.to_32nd, deepest = chain(skipped, to_32nd, slope)
        self.dropout = nn.Dropout2d(dropout)
        self.score_16th = nn.Conv2d(skipped, len(CLASSES), 1)
        self.score_32nd = nn.Conv2d(deepest, len(CLASSES), 1)
        self.twice = nn.ConvTranspose2d(len(CLASSES), len(CLASSES), 2, stride=2, bias=False)
        nn.init.zeros_(self.score_16th.weight)  # as FCN: what is skipped has no say at first
        with torch.no_grad():
            self.twice.weight.copy_(torch.eye(len(CLASSES))[..., None, None].expand_as(self.twice.weight))

    def forward(self, images):
        middle = self.to_16th(images)
        return self.twice(self.score_32nd(self.dropout(self.to_32nd(middle)))) + self.score_16th(middle)


def scoutnet(width):
    """With width 1 the layers of Darknet-19 up to its classifier."""
    def w(filters):
        return max(4, round(filters * width))

    return LabelNetwork(
        (w(32), "pool", w(64), "pool", w(128), -w(64), w(128), "pool", w(256), -w(128), w(256), "pool",
         w(512), -w(256), w(512), -w(256), w(512)),
        ("pool", w(1024), -w(512), w(1024), -w(512), w(1024)), slope=0.1,
    )


def fcn_vgg16(width):
    """FCN on VGG16 with its output at a 16th. fc6 is 3x3 instead of 7x7, both fc have 1024 filters times the width."""
    def w(filters):
        return max(4, round(filters * width))

    return LabelNetwork(
        (w(64), w(64), "pool", w(128), w(128), "pool", w(256), w(256), w(256), "pool", w(512), w(512), w(512), "pool"),
        (w(512), w(512), w(512), "pool", w(1024), -w(1024)), slope=0.0, dropout=0.2,
    )


NETWORKS = {  # name: (function of the width, width that is shipped)
    "scoutnet": (scoutnet, 0.25), "scoutnet_v0": (scoutnet, 0.125), "fcn_vgg16": (fcn_vgg16, 0.125),
}


class Published(nn.Module):
    """Probabilities instead of scores, without batch normalisation."""

    def __init__(self, network):
        super().__init__()
        self.network = copy.deepcopy(network).eval()
        for module in self.network.modules():
            if isinstance(module, nn.Sequential):
                for i in range(len(module) - 1):
                    if isinstance(module[i], nn.Conv2d) and isinstance(module[i + 1], nn.BatchNorm2d):
                        module[i] = nn.utils.fusion.fuse_conv_bn_eval(module[i], module[i + 1])
                        module[i + 1] = nn.Identity()

    def forward(self, images):
        return torch.softmax(self.network(images), dim=1)


def normalised(rgb):
    """Images of numbers of 8 bits, n x height x width x 3, as the networks take them."""
    return (torch.as_tensor(rgb).permute(0, 3, 1, 2).float() / 255 - MEAN) / DEVIATION


def golden_image():
    """As in src/image/label_network.cpp."""
    y, x, color = np.meshgrid(*(np.arange(n) for n in (GOLDEN_PX, GOLDEN_PX, 3)), indexing="ij")
    return ((7 * x + 13 * y + 61 * color + x * y // 3) % 256).astype(np.uint8)


# --- images ---------------------------------------------------------------------------------------------------------
def read_netpbm(path):
    """A file of image_samples: height x width x 3, or height x width."""
    content = np.fromfile(path, np.uint8)
    kind, width, height, _ = content[:32].tobytes().split(maxsplit=4)[:4]
    size = int(height), int(width), *((3,) if kind == b"P6" else ())
    return content[-int(np.prod(size)):].reshape(size)


class Rendered:
    """Images of scripts/train/image_scenes.py."""

    def __init__(self, folders):
        self.paths = sorted(path for folder in folders for path in pathlib.Path(folder).glob("*.ppm"))
        if not self.paths:
            raise SystemExit(f"no images in {', '.join(map(str, folders))}: scripts/train/image_scenes.py draws them")

    def __len__(self):
        return len(self.paths)

    def read(self, number):
        """Image, and how much of each pixel is a car; NaN: not known."""
        return read_netpbm(self.paths[number]), read_netpbm(self.paths[number].with_suffix(".pgm")) / np.float32(255)

    turns = False


class Boxed:
    """Photos with boxes of cars. Upright boxes hold more than the cars, so that only their middles are labelled."""

    turns = True  # they look straight down

    def __init__(self, labels, scenes):
        self.folder = pathlib.Path(labels).parent
        self.images = [(name, image) for name, image in sorted(json.loads(pathlib.Path(labels).read_text()).items())
                       if image["scene"] in scenes]
        self.kept = {}

    def __len__(self):
        return len(self.images)

    def read(self, number):
        if number not in self.kept:
            from matplotlib import image as reader

            name, image = self.images[number]
            cover = np.zeros((image["height"], image["width"]), np.float32)
            for box in image["boxes"]:
                x0, y0, x1, y1 = (max(0, round(box[edge])) for edge in ("x0", "y0", "x1", "y1"))
                cover[y0:y1, x0:x1] = np.nan
            for box in image["boxes"]:
                if box["class"] in ("car", "minibus"):
                    dx, dy = 0.15 * (box["x1"] - box["x0"]), 0.15 * (box["y1"] - box["y0"])
                    rows = slice(round(box["y0"] + dy), round(box["y1"] - dy))
                    cover[rows, round(box["x0"] + dx) : round(box["x1"] - dx)] = 1
            self.kept[number] = reader.imread(self.folder / name)[..., :3], cover
        return self.kept[number]


def labels_of(cover):
    """How much of each label pixel is a car, n x height / 16 x width / 16; NaN where a part is not known."""
    return functional.avg_pool2d(cover[:, None], STRIDE)[:, 0]


def hue_turn(random):
    """A rotation of colours about grey, by any angle."""
    angle = random.uniform(-np.pi, np.pi)
    axis = np.full(3, 1 / np.sqrt(3))
    across = np.cross(np.eye(3), axis)
    turn = np.cos(angle) * np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * np.outer(axis, axis)
    return torch.from_numpy(turn).float()


def augmented(random, image, cover, size, turns, hues=False):
    """A part of an image at another scale, with other colours, sharpness and noise: size x size x 3, size x size. With
    `hues` most have other hues, too."""
    height, width = cover.shape
    side = int(min(height, width, size * np.exp(random.uniform(np.log(0.6), np.log(1.6)))))
    top, left = random.integers(height - side + 1), random.integers(width - side + 1)
    image, cover = image[top : top + side, left : left + side], cover[top : top + side, left : left + side]
    if random.random() < 0.5:
        image, cover = image[:, ::-1], cover[:, ::-1]
    if turns:
        quarter = random.integers(4)
        image, cover = np.rot90(image, quarter), np.rot90(cover, quarter)
    image = torch.from_numpy(image.copy()).permute(2, 0, 1)[None].float() / 255
    cover = torch.from_numpy(cover.copy())[None, None]
    image = functional.interpolate(image, (size, size), mode="bilinear", antialias=side > size)
    cover = functional.interpolate(cover, (size, size), mode="nearest")[0, 0]
    if random.random() < 0.5:  # out of focus
        small = int(size / random.uniform(1.0, 2.2))
        image = functional.interpolate(image, (small, small), mode="bilinear", antialias=True)
        image = functional.interpolate(image, (size, size), mode="bilinear")
    image = image[0].clamp(1e-3, 1) ** random.uniform(0.6, 1.6)
    if hues and random.random() < 0.8:
        image = torch.einsum("ij,jkl->ikl", hue_turn(random), image)
    gain = torch.from_numpy(random.uniform(0.75, 1.3) * random.uniform(0.88, 1.12, 3)).float()
    gray = image.mean(0, keepdim=True)
    saturation = random.uniform(0.2, 1.3)
    image = (gray + saturation * (image - gray)) * gain[:, None, None] + random.uniform(-0.08, 0.12)
    sigma = random.uniform(0.0, 0.05)
    coarse = random.normal(0, sigma, (3, size // 2, size // 2)).astype(np.float32).repeat(2, 1).repeat(2, 2)
    fine = random.normal(0, sigma, (3, size, size)).astype(np.float32)
    return (image + torch.from_numpy(coarse + fine)).clamp(0, 1), cover


# --- training -------------------------------------------------------------------------------------------------------
class LabelTask:
    """See trainer.py and publish.py."""

    unit, batch, ema = "nat", 8, 0.0
    peak_learning_rate = 3e-3
    size = 320  # of the parts of images that it is trained on
    input_name, output_name = "image", "probability"
    shape = (3, GOLDEN_PX, GOLDEN_PX)
    dynamic_axes = {"image": {0: "batch", 2: "height", 3: "width"},
                    "probability": {0: "batch", 2: "label_height", 3: "label_width"}}

    def __init__(self, name, seed, precision, folders, width=None, boxes=None, box_scenes=(), hues=False):
        torch.manual_seed(seed)
        make, usual_width = NETWORKS[name]
        self.name = name
        self.network = make(width or usual_width).to(memory_format=torch.channels_last)
        self.hues = hues
        self.bfloat16 = precision == "bfloat16"
        self.sources = [Rendered(folders)] + ([Boxed(boxes, box_scenes)] if boxes else [])
        self.parameters = sum(p.numel() for p in self.published().parameters())

    def batches(self, seed, first_step, steps):
        for step in range(first_step, steps):
            random = np.random.default_rng((*np.atleast_1d(seed), step))
            samples = []
            for i in range(self.batch):
                source = self.sources[i % 2 % len(self.sources)]
                samples.append(augmented(random, *source.read(random.integers(len(source))), self.size, source.turns,
                                         self.hues))
            images, covers = (torch.stack(parts) for parts in zip(*samples))
            images = ((images - MEAN) / DEVIATION).contiguous(memory_format=torch.channels_last)
            yield images, labels_of(covers)

    def loss(self, batch, progress):
        images, cover = batch
        with torch.autocast("cpu", torch.bfloat16, enabled=self.bfloat16):
            scores = self.network(images)
        logit = scores[:, 1].float() - scores[:, 0].float()
        known = torch.isfinite(cover)
        return functional.binary_cross_entropy_with_logits(logit[known], cover[known])

    def published(self):
        return Published(self.network)

    def measure(self, network, random):
        """Cross-entropy on what it was trained on, without augmentation."""
        losses = []
        with torch.no_grad():
            for number in random.choice(len(self.sources[0]), 64):
                image, cover = self.sources[0].read(number)
                car = network(normalised(image[None]))[0, 1].clamp(1e-6, 1 - 1e-6)
                losses.append(functional.binary_cross_entropy(car, labels_of(torch.from_numpy(cover)[None])[0]).item())
        return {"cross_entropy_nat": float(np.mean(losses))}

    def contract(self, network):
        """What the manifest says of input, output and a golden vector: that of golden_image()."""
        with torch.no_grad():
            answer = network(normalised(golden_image()[None]))[0].numpy().reshape(-1)
        return f"""\
input: {{name: {self.input_name}, shape: [batch, 3, height, width], multiple: {MULTIPLE}}}
output: {{name: {self.output_name}, shape: [batch, {len(CLASSES)}, height / {STRIDE}, width / {STRIDE}]}}
stride: {STRIDE}
classes: [{", ".join(CLASSES)}]
# Of red, green and blue / 255.
normalisation: {{mean: [{MEAN}, {MEAN}, {MEAN}], deviation: [{DEVIATION}, {DEVIATION}, {DEVIATION}]}}
# The answer for an image of `size` by `size` that src/image/label_network.cpp makes.
golden:
  size: {GOLDEN_PX}
  output: [{", ".join(f"{value:.6f}" for value in answer)}]
"""
