# SPDX-License-Identifier: BSD-3-Clause
"""The sensitivity of the map to its constants (docs/benchmarks/constants.md): flies worlds of worlds.py with each
constant halved and doubled. Run by scripts/evaluate, first with --write-sources: a copy of the sources in which the
environment overrides the constants, so that one program flies all variants."""

import collections
import dataclasses
import itertools
import math
import pathlib
import re
import tempfile
import time

import numpy as np
from scipy import stats

import worlds
from map import HELD, HIDDEN, files_of, fly, held_numbers, hidden_numbers, person_numbers, room_numbers
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    write)

FOLDERS = ("src/map/objects", "include/situation_awareness/map/objects")
DEFINITION = re.compile(r"^ *(?:static )?const(?:expr)? (double|int) (k[A-Z]\w*) = ([^;]+);", re.MULTILINE)
LEFT_OUT = {  # constant: the reason
    **dict.fromkeys(("kAxis", "kRates", "kPosition", "kVelocity", "kOrientation", "kAngularVelocity", "kRadii",
                     "kShape", "kMeasurementSize"), "index or size of a vector"),
    "kChiSquare99": "a quantile: follows from the 99 % of the interface",
    "kChiSquare999": "a quantile: that of a view that contradicts the known sizes of a box",
    "kLongestPrediction_s": "acts after an hour without a scan, longer than any flight",
    "kMaxMapAge_s": "acts in the pipeline, on a map older than 0.5 s; in a flight each scan updates the map",
}
COMPLEMENTS = ("kSurelyMoving",)  # probabilities near 1: 1 - p is halved and doubled
UNITS = ("m", "s", "rad", "Per scan", "Per detection", "Probability")  # with which a comment may begin
OVERRIDE = "SITUATION_AWARENESS_"  # and the name of the constant

WORLDS = {  # (experiment, row): (worlds, duration in s; none: its own)
    ("room", "still"): (1, 20.0), ("room", "cruising and turning"): (1, 20.0), ("crowd", "crowd"): (2, 15.0),
    ("noise", "crowd"): (1, 15.0), ("manoeuvres", "crowd"): (2, 15.0), ("people", "people"): (2, 15.0),
    ("alike", "alike"): (1, 25.0), ("hidden_mover", "hidden_mover"): (2, None),
    ("hidden_standing", "hidden_standing"): (2, None),
}
REPETITIONS = 4  # with other noise, of the shipped values
CHANCE_SIGMAS = 3.0
TIMES = ("cpu_ms_per_scan", "latency_ms")  # all others are the same in every run of a flight


# --- constants


@dataclasses.dataclass(frozen=True)
class Constant:
    name: str
    type: str
    value: str  # as written
    path: str
    comment: str  # in full

    @property
    def sentences(self):
        return [text for text in re.split(r"\.(?: (?=[A-Z])|$)", self.comment) if text]

    @property
    def unit(self):
        """By the comment's first word, else by the name's last."""
        first, last = self.sentences[0], self.name.rsplit("_", 1)[-1]
        return first.lower() if first in UNITS else last if last in UNITS else ""

    @property
    def meaning(self):
        return next(text for text in self.sentences if text not in UNITS)

    @property
    def number(self):
        found = re.fullmatch(r"std::log\((.*)\)", self.value)
        return math.log(float(found[1])) if found else float(self.value)

    def varied(self):
        """{what is done: its value}"""
        if self.name in COMPLEMENTS:
            return {"half of 1 - p": round(0.5 + 0.5 * self.number, 9),
                    "twice 1 - p": round(2.0 * self.number - 1.0, 9)}
        if self.type == "int":
            return {"half": math.ceil(0.5 * self.number), "twice": int(2 * self.number)}
        return {"half": 0.5 * self.number, "twice": 2.0 * self.number}


def sources():
    """The files of the map, in the order of the report."""
    return [path for folder in FOLDERS for path in sorted((ROOT / folder).iterdir())]


def comment_above(text):
    """Of the definition that follows the text."""
    lines = list(itertools.takewhile(lambda line: line.strip().startswith("//"), reversed(text.splitlines())))
    return " ".join(line.strip().lstrip("/").strip() for line in reversed(lines))


def constants():
    for path in sources():
        text = path.read_text()
        for found in DEFINITION.finditer(text):
            kind, name, value = found.groups()
            if name not in LEFT_OUT:
                yield Constant(name, kind, value, path.relative_to(ROOT).as_posix(),
                               comment_above(text[:found.start()]))


def overridable(text):
    """The text of a source in which the environment overrides the constants."""

    def replace(found):
        kind, name, value = found.groups()
        if name in LEFT_OUT:
            return found[0]
        return (f'static const {kind} {name} = [] {{ const char* text = std::getenv("{OVERRIDE}{name}"); '
                f"return text == nullptr ? {value} : static_cast<{kind}>(std::atof(text)); }}();")

    changed = DEFINITION.sub(replace, text)
    return changed if changed == text else "#include <cstdlib>\n" + changed


def write_sources(folder):
    """A copy of the working tree with overridable constants; what is not compiled is linked to. Files that are already
    right keep their times, and so their objects."""
    for path in ROOT.iterdir():
        if path.name not in ("build", "devel", "src", "include") and not path.name.startswith("."):
            link = folder / path.name
            folder.mkdir(parents=True, exist_ok=True)
            if not link.is_symlink():
                link.symlink_to(path)
    of_the_map = set(sources())
    for path in itertools.chain((ROOT / "src").rglob("*"), (ROOT / "include").rglob("*")):
        if path.is_file():
            text, copy = path.read_text(), folder / path.relative_to(ROOT)
            wanted = overridable(text) if path in of_the_map else text
            if not copy.exists() or copy.read_text() != wanted:
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_text(wanted)


# --- flying


def alike_flights():
    """The crowds with twelve equal objects, which no shape distinguishes."""
    for seed in itertools.count(1):
        things = [dataclasses.replace(thing, rx=0.1, ry=0.1) for thing in worlds.crowd(seed)]
        name = f"alike_{seed}"
        yield worlds.Flight("alike", "alike", name, worlds.world(name, things), (seed,), 60.0)


def wanted_flights():
    for (experiment, row), (count, duration_s) in WORLDS.items():
        flights = alike_flights() if experiment == "alike" else worlds.flights([experiment])
        for flight in itertools.islice((flight for flight in flights if flight.row == row), count):
            without_sweep = () if experiment == "room" else flight.options  # whose simulation takes most of the time
            yield dataclasses.replace(flight, duration_s=duration_s or flight.duration_s, options=without_sweep)


@dataclasses.dataclass(frozen=True)
class Variant:
    """A constant with another value, or the shipped values, perhaps with other noise."""

    constant: str = ""
    what: str = ""
    value: float = 0.0
    noise: int = 0


SHIPPED = Variant()


def variants_of(found):
    yield SHIPPED
    for k in range(1, REPETITIONS + 1):
        yield Variant(noise=k)
    for constant in found:
        for what, value in constant.varied().items():
            yield Variant(constant.name, what, value)


def fly_variant(tool, directory, flights, variant):
    """{experiment: lines of map_flights}"""
    environment = {OVERRIDE + variant.constant: repr(variant.value)} if variant.constant else {}
    runs = collections.defaultdict(list)
    for flight in flights:
        seeds = [seed + 1000 * variant.noise for seed in flight.seeds]
        runs[flight.experiment] += fly(tool, directory, flight, seeds, environment=environment)
    for run in itertools.chain.from_iterable(runs.values()):
        for key in TIMES:
            run[key] = {"p50": 0.0, "p95": 0.0} if key == "latency_ms" else 0.0
    return dict(runs)


def fly_all(tool, directory, found):
    print("building the worlds", flush=True)
    flights = list(wanted_flights())
    for flight in flights:
        for path, text in zip(files_of(directory, flight), (flight.xml, flight.settings)):
            path.write_text(text)
    pieces = {variant: (tool, directory, flights, variant) for variant in variants_of(found)}
    return flights, run_pieces(fly_variant, pieces, "variants flown")


# --- numbers


FIGURES = (  # key, header, factor, whether more is better
    ("recall", "recall, %", 100.0, True), ("false_per_scan", "false per 1,000 scans", 1000.0, False),
    ("center_standing", "centre standing, mm", 1000.0, False), ("center_moving", "centre moving, mm", 1000.0, False),
    ("velocity_standing", "velocity standing, mm/s", 1000.0, False),
    ("velocity_moving", "velocity moving, mm/s", 1000.0, False), ("semi_axes", "semi-axes, mm", 1000.0, False),
    ("gospa_m", "GOSPA, mm", 1000.0, False), ("id_switches", "id switches per flight", 1.0, False),
    ("held", "in the 99 % region, %", 100.0, True), ("one_element", "persons one element, %", 100.0, True),
    ("same_id", "hidden, same id, %", 100.0, True),
)
HIDDEN_EXPERIMENTS = tuple(HIDDEN)


def figures_of(runs):
    """One number for each of FIGURES, in its unit."""
    objects = [run for experiment, own in runs.items() for run in own
               if experiment not in (*HIDDEN_EXPERIMENTS, "people")]
    hidden = [(len(runs[name]), hidden_numbers(runs[name], *HIDDEN[name][:2])["same_id"])
              for name in HIDDEN_EXPERIMENTS]
    numbers = {
        **room_numbers(objects), "held": np.mean([held_numbers(objects)[key] for key, _ in HELD]),
        "one_element": person_numbers(runs["people"])[1],
        "same_id": sum(n * same for n, same in hidden) / sum(n for n, _ in hidden),
    }
    return np.array([factor * numbers[key] for key, _, factor, _ in FIGURES])


class Sensitivity:
    """Figures of all variants, and what chance alone changes."""

    def __init__(self, flown):
        figures = {variant: figures_of(runs) for variant, runs in flown.items()}
        self.shipped = figures[SHIPPED]
        noisy = [found for variant, found in figures.items() if not variant.constant]
        self.chance = CHANCE_SIGMAS * math.sqrt(2.0) * np.std(noisy, axis=0, ddof=1)
        self.changes = {variant: found - self.shipped for variant, found in figures.items() if variant.constant}
        self.same = {variant for variant in self.changes if flown[variant] == flown[SHIPPED]}
        self.sign = np.array([1 if more else -1 for *_, more in FIGURES])

    def beyond_chance(self, variant):
        return np.abs(self.changes[variant]) > np.maximum(self.chance, 1e-9)

    def better_and_worse(self, variant):
        better = self.changes[variant] * self.sign > 0
        return int((self.beyond_chance(variant) & better).sum()), int((self.beyond_chance(variant) & ~better).sum())

    def effect(self, variants):
        """Of a constant."""
        if all(variant in self.same for variant in variants):
            return "none"
        return "beyond chance" if any(self.beyond_chance(variant).any() for variant in variants) else "within chance"


# --- report


INTRODUCTION = """
Constants of the map: {constants}, each halved and doubled, in the same {worlds} simulated worlds with the same noise:
{scans:,} scans per variant, {minutes:.0f} minutes. The worlds are those of [the map's report](map.md)
([worlds.py](../../scripts/evaluation/worlds.py)).
"""
METHOD = """
{scenes}. In rooms all beams of a scan are of one time. Alike: crowds in which all twelve objects are circles of 0.1 m
radius. Figures are those of the map's report, over all flights but those of persons and hidden objects, which have the
last two columns. In the 99 % region: mean over position, position and velocity, and radii.
"""
CHANCE = """
Chance: the shipped values were flown {repetitions} more times with other noise of the scanner. A change is beyond
chance, and **bold**, if it exceeds three standard deviations of the difference of two such flights. Of changes by other
noise alone {percent:.0f} % would do so, as the standard deviation is that of few flights; but variants have the same
noise, so that most of their changes are far smaller.
"""
LEGEND = """
Changes are those from the first row; a point: exactly the same figure. Effect: *none* if every line of `map_flights` is
the same, to the last bit; else the number of figures that are better / worse beyond chance.
"""
LIMITATIONS = """
One constant at a time, so what two do together is not seen; in simulated worlds, for half a minute and less, with an
exact pose. Figures are over all worlds, and may hide that what helps manoeuvring objects harms others.
A constant without effect here may act elsewhere: bounds act on data that these worlds do not have. Halving is not the
smallest change that matters, and a figure beyond chance may still be one of chance.
"""


def text_of(value, digits):
    return f"{value:.{digits}f}"


def change_text(value, digits):
    text = f"{value:+.{digits}f}"
    return "·" if value == 0.0 else text if float(text) else "0"


def digits_of(sensitivity):
    """Of each figure: so that chance has two."""
    return [int(np.clip(1 - math.floor(math.log10(chance)), 0, 3)) if chance > 0 else 1
            for chance in sensitivity.chance]


def table_of(found, sensitivity):
    digits = digits_of(sensitivity)
    shipped = [text_of(value, n) for value, n in zip(sensitivity.shipped, digits)]
    rows = [("**shipped**", "", "", "", "", *(f"**{text}**" for text in shipped), ""),
            ("chance", "", "", "", "", *(f"± {text_of(value, n)}" for value, n in zip(sensitivity.chance, digits)), "")]
    for constant in found:
        first = True
        for variant in (variant for variant in sensitivity.changes if variant.constant == constant.name):
            cells = []
            beyond = sensitivity.beyond_chance(variant)
            for value, outside, n in zip(sensitivity.changes[variant], beyond, digits):
                text = change_text(value, n)
                cells.append(f"**{text}**" if outside else text)
            effect = "none" if variant in sensitivity.same else "{} / {}".format(*sensitivity.better_and_worse(variant))
            value = f"{constant.value} {constant.unit}".strip()
            of_constant = (f"`{constant.name}`", value, pathlib.Path(constant.path).name,
                           constant.meaning.replace("|", "\\|"))
            rows.append((*(of_constant if first else ("",) * 4), f"{variant.what}: {variant.value:.4g}", *cells,
                         effect))
            first = False
    header = ("constant", "value", "file", "what it is", "varied", *(header for _, header, _, _ in FIGURES),
              "effect")
    return table(header, rows)


def summary_of(found, sensitivity):
    effects = collections.defaultdict(list)
    for constant in found:
        own = [variant for variant in sensitivity.changes if variant.constant == constant.name]
        effects[sensitivity.effect(own)].append(constant.name)
    what = {"none": "no effect: with both values every line of `map_flights` is the same",
            "within chance": "insensitive: all changes within chance",
            "beyond chance": "sensitive: a figure changes beyond chance"}
    return table(("", "constants", ""),
                 [(text, str(len(effects[effect])), ", ".join(f"`{name}`" for name in effects[effect]))
                  for effect, text in what.items()])


def better_of(sensitivity):
    """Variants of which some figures are better beyond chance, and none is worse."""
    found = [variant for variant in sensitivity.changes
             if sensitivity.better_and_worse(variant)[0] and not sensitivity.better_and_worse(variant)[1]]
    names = ", ".join(f"`{variant.constant}` at {variant.value:.4g}" for variant in found)
    return prose(f"Better in a figure and worse in none, beyond chance: {names or 'no variant'}.")


def report_of(measured, found, flights, flown, spent_s):
    sensitivity = Sensitivity(flown)
    scans = sum(run["scans"] for runs in flown[SHIPPED].values() for run in runs)
    counts = collections.Counter(flight.experiment for flight in flights)
    scenes = ", ".join(f"{count} {experiment.replace('_', ' ')}" for experiment, count in counts.items())
    percent = 200.0 * stats.t.sf(CHANCE_SIGMAS, REPETITIONS)  # one degree of freedom fewer than flights
    left_out = collections.defaultdict(list)
    for name, reason in LEFT_OUT.items():
        left_out[reason].append(f"`{name}`")
    return "\n".join((
        "# The map's constants, varied\n",
        introduction(measured, INTRODUCTION.format(constants=len(found), worlds=len(flights), scans=scans,
                                                   minutes=spent_s / 60)),
        section("Result", summary_of(found, sensitivity), better_of(sensitivity)),
        section("Every constant", prose(METHOD.format(scenes=f"Worlds: {scenes}")),
                prose(CHANCE.format(repetitions=REPETITIONS, percent=percent)), prose(LEGEND),
                table_of(found, sensitivity)),
        section("Left out", table(("constants", "reason"),
                                  [(", ".join(names), reason) for reason, names in left_out.items()])),
        section("Limitations", prose(LIMITATIONS))))


def main():
    found = list(constants())
    parser = arguments_parser(__doc__, "docs/benchmarks", "some constants")
    parser.add_argument("--tool")
    parser.add_argument("--write-sources", type=pathlib.Path, metavar="DIR", help="of scripts/evaluate")
    parser.add_argument("--only", action="append", default=[], choices=[constant.name for constant in found],
                        metavar="CONSTANT", help="may be repeated: " + " ".join(constant.name for constant in found))
    arguments = parser.parse_args()
    if arguments.write_sources:
        return write_sources(arguments.write_sources)
    output, measured = output_folder(arguments, not arguments.only), facts(arguments)
    found = [constant for constant in found if not arguments.only or constant.name in arguments.only]
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        flights, flown = fly_all(arguments.tool, pathlib.Path(folder), found)
    write(output, "constants.md", report_of(measured, found, flights, flown, time.monotonic() - begin))


if __name__ == "__main__":
    main()
