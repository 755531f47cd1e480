# SPDX-License-Identifier: BSD-3-Clause
"""What the package's networks of one segment have in common: input, estimate with covariance, samples, training.

Input and output are written out in docs/math/detections.md; the C++ side of both is detections/segment_encoding.hpp and
detections/segment_posterior.hpp. Samples come encoded from build/detection_samples, so that there is one encoder.
"""

import concurrent.futures
import pathlib
import subprocess

import numpy as np
import torch
from torch import nn
from torch.nn import functional
from tqdm import tqdm

import publish
from paper_tasks import TINY, ellipse_losses

SLOTS, SCALARS = 32, 12
INPUTS = SLOTS + SCALARS
POINT, FACTOR = 5, 15  # outputs: correction of (t_x, t_y, m, p, q), lower triangle of the precision's factor,
QUANTILE = POINT + FACTOR  # logarithm of the 90 % quantile over chi-square's; then a network's own
SHARED_OUTPUTS = QUANTILE + 1
WIDTH, LAYERS = 256, 4
TOOL = pathlib.Path(__file__).resolve().parents[2] / "build/detection_samples"
MAX_RADIUS_M = 0.5
FIRST_GUESS = (0.5, 0.0, 1.0, 0.0, 0.0)  # of (t_x, t_y, m, p, q), in half widths
FACTOR_LOG_DIAGONAL, FACTOR_SCALE = 3.0, 10.0  # where the factor starts, and the unit of what is beside its diagonal
CHI_SQUARE_90 = 9.2364  # of 5 degrees of freedom

TRUTH = slice(INPUTS, INPUTS + 5)  # columns of a row of detection_samples: of one ellipse,
IS_ELLIPSE, MEAN_RANGE, HALF_WIDTH, HITS = range(INPUTS + 5, INPUTS + 9)
BOX_TRUTH = slice(INPUTS + 10, INPUTS + 15)  # of one box
IS_BOX = INPUTS + 15
ORIENTATION = slice(INPUTS + 16, INPUTS + 18)  # (cos 4 psi, sin 4 psi) of the box
COLUMNS = INPUTS + 18
CASE = COLUMNS  # in training, one column more: the place of the sample's case in the mixture

BATCHES_DRAWN = 100  # at once
TRAINING_SEEDS = 1 << 63  # all samples seen in training have seeds from here on; evaluation uses small ones
LOSS_SCALE_M = 0.04
WEIGHTS = {"likelihood": 0.1, "quantile": 0.05}
LAST_CHUNK = 2**32 - 1  # no training is that long: the samples of `finish`
FINISHING_SAMPLES, FINISHING_STEPS, FINISHING_RATE = 1_000_000, 300, 0.003
EXACT_FROM = 0.8  # of the run: before, the wide layers multiply in bfloat16


class SegmentNetwork(nn.Module):
    """A plain perceptron. `mean` and `deviation` standardise its input and are folded into it by `folded`."""

    def __init__(self, outputs, mean=None, deviation=None):
        super().__init__()
        self.register_buffer("mean", torch.zeros(INPUTS) if mean is None else mean)
        self.register_buffer("deviation", torch.ones(INPUTS) if deviation is None else deviation)
        self.first = nn.Linear(INPUTS, WIDTH)
        self.hidden = nn.ModuleList(nn.Linear(WIDTH, WIDTH) for _ in range(LAYERS - 1))
        self.output = nn.Linear(WIDTH, outputs)
        for layer in (self.first, *self.hidden):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            nn.init.zeros_(layer.bias)
        nn.init.normal_(self.output.weight, std=0.01)
        nn.init.zeros_(self.output.bias)

    def forward(self, x, narrow=False):
        """x: n x INPUTS; narrow: the products between wide layers in bfloat16."""
        x = functional.relu(self.first((x - self.mean) / self.deviation))
        with torch.autocast(x.device.type, torch.bfloat16, enabled=narrow):
            for layer in self.hidden:
                x = functional.relu(layer(x))
            return self.output(x).float()

    def folded(self):
        """The same function as plain layers, without the standardisation, as published."""
        weight = self.first.weight.double() / self.deviation.double()
        first = nn.Linear(INPUTS, WIDTH)
        with torch.no_grad():
            first.weight.copy_(weight)
            first.bias.copy_(self.first.bias.double() - weight @ self.mean.double())
        layers = [first]
        for layer in (*self.hidden, self.output):
            layers += [nn.ReLU(), layer]
        return nn.Sequential(*layers)


def point_of(answer, rows):
    """(t_x, t_y, m, p, q) in m in the segment's frame."""
    guess = torch.tensor(FIRST_GUESS, device=rows.device)
    return rows[:, HALF_WIDTH, None] * guess + MAX_RADIUS_M * answer[:, :POINT]


def whitened(factor, error_m):
    """A e for the lower triangular factor A of the precision, and the logarithm of A's determinant."""
    error = error_m / MAX_RADIUS_M
    whitened_rows, log_determinant, k = [], 0.0, 0
    for i in range(POINT):
        row = 0.0
        for j in range(i):
            row = row + FACTOR_SCALE * factor[:, k] * error[:, j]
            k += 1
        log_diagonal = FACTOR_LOG_DIAGONAL + factor[:, k]
        k += 1
        whitened_rows.append(row + torch.exp(log_diagonal) * error[:, i])
        log_determinant = log_determinant + log_diagonal
    return torch.stack(whitened_rows, dim=1), log_determinant


def axes_of_smooth(smooth):
    """rx and ry times the unit vectors of the axes, for rows (t_x, t_y, m, p, q)."""
    m, p, q = smooth[:, 2:3], smooth[:, 3], smooth[:, 4]
    half_difference = torch.sqrt(p * p + q * q + TINY)
    cos_doubled = p / half_difference
    cos = torch.sqrt((1 + cos_doubled).clamp(min=1e-6) / 2)
    sin = torch.sqrt((1 - cos_doubled).clamp(min=1e-6) / 2) * torch.where(q < 0, -1.0, 1.0)
    half_difference = half_difference[:, None]
    return (m + half_difference) * torch.stack((cos, sin), 1), (m - half_difference) * torch.stack((-sin, cos), 1)


def symmetric_loss(answer, truth):
    """Eq. 1 of the ellipse paper for rows (t_x, t_y, m, p, q), over the better of the pairings that a rotation by pi
    leaves open."""
    return ellipse_losses(answer[:, :2], axes_of_smooth(answer), truth[:, :2], axes_of_smooth(truth))[1]


def draw(case, seed, count):
    """`count` rows of samples, whose seeds are seed, seed + 1, ..."""
    output = subprocess.run([TOOL, case, str(seed), "0", str(count)], check=True, stdout=subprocess.PIPE).stdout
    return np.frombuffer(output, np.float32).reshape(count, COLUMNS)


class SegmentTask:
    """For trainer.train() and publish.publish(). A task also has

    name, output_name, outputs       of its network
    truth, described                 columns: (t_x, t_y, m, p, q), and 1 where there is such a truth
    mix, second_mix                  shares of the cases, of a second run that starts from published weights, too
    typical                          case that the input is standardised by
    of_own(answer, rows)             loss of the network's own outputs
    measured                         cases for `measure`
    """

    unit = "1"
    batch = 4096
    ema = 0.999
    peak_learning_rate = 1e-3
    input_name = "segment"
    shape, fill = (INPUTS,), 0.0

    def __init__(self, seed=1, precision="float32"):
        if not TOOL.exists():
            raise SystemExit(f"{TOOL} draws the samples and is not there: scripts/build makes it")
        self.narrow = precision == "bfloat16"
        torch.manual_seed(seed)
        inputs = draw(self.typical, TRAINING_SEEDS, 200_000)[:, :INPUTS]
        self.network = SegmentNetwork(
            self.outputs, torch.from_numpy(inputs.mean(axis=0)), torch.from_numpy(inputs.std(axis=0) + np.float32(1e-3))
        )

    @property
    def parameters(self):
        return INPUTS * WIDTH + (LAYERS - 1) * WIDTH * WIDTH + WIDTH * self.outputs + LAYERS * WIDTH + self.outputs

    def _chunk(self, seed, chunk, samples=None):
        samples = samples or BATCHES_DRAWN * self.batch
        rows = []
        for i, (case, share) in enumerate(self.mix.items()):
            state = np.random.SeedSequence((*np.atleast_1d(seed), chunk, i)).generate_state(1, np.uint64)[0]
            drawn = draw(case, int(state) | TRAINING_SEEDS, round(share * samples))
            rows.append(np.column_stack((drawn, np.full(len(drawn), i, np.float32))))
        rows = np.concatenate(rows)
        return rows[np.random.default_rng((*np.atleast_1d(seed), chunk)).permutation(len(rows))]

    def batches(self, seed, first_step, steps):
        with concurrent.futures.ThreadPoolExecutor(1) as ahead:
            waiting = None
            for step in range(first_step, steps):
                chunk, place = divmod(step, BATCHES_DRAWN)
                if waiting is None or place == 0:
                    rows = torch.from_numpy(waiting.result() if waiting else self._chunk(seed, chunk))
                    waiting = ahead.submit(self._chunk, seed, chunk + 1)
                yield rows[place * self.batch : (place + 1) * self.batch]

    def loss(self, rows, progress):
        rows = rows.to(self.network.first.weight.device)
        answer = self.network(rows[:, :INPUTS], narrow=self.narrow and progress < EXACT_FROM)
        truth, described = rows[:, self.truth], rows[:, self.described]
        point = point_of(answer, rows)
        distance = symmetric_loss(point, truth)

        # Covariance and quantile are of the detached error, so that they do not change the estimate.
        white, log_determinant = whitened(answer[:, POINT:QUANTILE], (truth - point).detach())
        square = white.square().sum(1)
        likelihood = square / 2 - log_determinant
        over = torch.log(square.detach() / CHI_SQUARE_90) - answer[:, QUANTILE]
        quantile = torch.maximum(0.9 * over, -0.1 * over)

        of_described = distance / LOSS_SCALE_M + WEIGHTS["likelihood"] * likelihood + WEIGHTS["quantile"] * quantile
        return (of_described * described).sum() / described.sum() + self.of_own(answer, rows)

    def start_from(self, path):
        """Continue from a published network."""
        layers = publish.load(nn.Sequential(*self.network.folded()), path)[::2]
        for layer, stored in zip((self.network.first, *self.network.hidden, self.network.output), layers):
            layer.load_state_dict(stored.state_dict())
        self.network.mean.zero_()
        self.network.deviation.fill_(1.0)
        self.mix = self.second_mix

    def finish(self, seed):
        """Fit only the row of the 90 % quantile, with all other weights frozen, on fresh samples.

        At the optimum of a pinball loss that is linear in the last features, every feature, and so every range, sees
        90 % inside on average. Near objects count for more: they are few and their share is judged, too.
        """
        rows = torch.from_numpy(self._chunk(seed, LAST_CHUNK, FINISHING_SAMPLES))
        rows = rows[rows[:, self.described] > 0.5]
        network = self.network.cpu().folded()
        with torch.no_grad():
            features = network[:-1](rows[:, :INPUTS])
            answer = network[-1](features)
            white, _ = whitened(answer[:, POINT:QUANTILE], rows[:, self.truth] - point_of(answer, rows))
            wanted = torch.log(white.square().sum(1) / CHI_SQUARE_90)
        weight = (5.0 / rows[:, MEAN_RANGE]).clamp(1.0, 5.0)
        weight = weight / weight.sum()
        deviation = features.std(0) + 1e-3
        change = torch.zeros(WIDTH + 1, requires_grad=True)
        optimizer = torch.optim.Adam([change], lr=FINISHING_RATE)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, FINISHING_STEPS)
        for _ in tqdm(range(FINISHING_STEPS), desc="quantile", mininterval=5):
            over = wanted - answer[:, QUANTILE] - features @ (change[:-1] / deviation) - change[-1]
            loss = (weight * torch.maximum(0.9 * over, -0.1 * over)).sum()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
        with torch.no_grad():
            self.network.output.weight[QUANTILE] += change[:-1] / deviation
            self.network.output.bias[QUANTILE] += change[-1]

    def published(self):
        return self.network.cpu().folded()

    def golden_input(self):
        return draw(self.typical, 1, 1)[:, :INPUTS]

    def measure(self, network, random, n=20_000):
        """Loss and share of truths in the 90 % region on n samples of a case."""
        figures = {"samples": n}
        for case in self.measured:
            rows = torch.from_numpy(draw(case, int(random.integers(1 << 62)), n).copy())
            with torch.no_grad():
                answer = network(rows[:, :INPUTS])
                rows, described = rows[rows[:, self.described] > 0.5], answer[rows[:, self.described] > 0.5]
                point = point_of(described, rows)
                loss = symmetric_loss(point, rows[:, self.truth]).double()
                white, _ = whitened(described[:, POINT:QUANTILE], rows[:, self.truth] - point)
                inside = white.square().sum(1) < CHI_SQUARE_90 * torch.exp(described[:, QUANTILE])
            figures |= {
                f"{case}_symmetric_m": loss.mean().item(), f"{case}_error_m": loss.std().item() / len(rows) ** 0.5,
                f"{case}_inside_90": inside.double().mean().item(),
            }
        return figures
