# SPDX-License-Identifier: BSD-3-Clause
"""The map's tables and pictures (docs/benchmarks/map.md): flies the worlds of worlds.py and compares map and truth.
Run by scripts/evaluate."""

import json
import math
import os
import pathlib
import subprocess
import tempfile
import time

import numpy as np
from matplotlib import patches
from scipy import stats

import printed
import worlds
from pictures import clean, images_folder, pyplot, save
from report import (ROOT, arguments_parser, facts, introduction, output_folder, prose, run_pieces, section, table,
                    targets_section, write)

SEEDS_OF_PIECE = 2
VISIBLE_BEAMS = 5  # of map_flights
PARAMETERS = ("rx", "ry", "tx", "ty", "psi")
CIRCLE_PARAMETERS = ("r", "tx", "ty")
PRINTED, PRINTED_CIRCLE = printed.map_tables("ellipse"), printed.map_tables("circle")
TITLES = {
    "table_6": ("Table VI, the angle", "psi", "°"), "table_7": ("Table VII, the major radius", "rx", " m"),
    "table_8": ("Table VIII, the radii's ratio", "rx/ry", ""),
    "table_9": ("Table IX, the trajectory", "trajectory", ""),
    "table_4": ("Table IV of the circle paper, the radius", "r", " m"),
    "table_5": ("Table V of the circle paper, the trajectory", "trajectory", ""),
}
CIRCLE_ROW = ("table_8", "1")  # has no psi

# Targets of the room: (key, what, unit, target, whether more is better).
ROOM_TARGETS = (
    ("recall", "recall", "", 0.98, True), ("false_per_scan", "false per scan", "", 0.02, False),
    ("center_standing", "centre RMSE, standing", "m", 0.02, False),
    ("center_moving", "centre RMSE, moving", "m", 0.03, False),
    ("velocity_standing", "velocity RMSE, standing", "m/s", 0.03, False),
    ("velocity_moving", "velocity RMSE, moving", "m/s", 0.20, False),
    ("semi_axes", "semi-axes MAE", "m", 0.02, False), ("id_switches", "id switches", "", 2, False),
)
TRACED = ("crowd_1", "room_1_cruising", "room_1_cruising_and_turning", "people_1")  # drawn
COLORS = {"rx": "#0b6e4f", "r": "#0b6e4f", "ry": "#5fb49c", "tx": "#3d5a80", "ty": "#7f95b2", "psi": "#c8553d"}
SYMBOLS = {"psi": "ψ", "tx": "$t_x$", "ty": "$t_y$", "rx": "$r_x$", "ry": "$r_y$"}
MODE_COLORS = ("#0b6e4f", "#3d5a80", "#c8553d", "#8a5a83")
TRUTH, STANDING, MAPPED = "#f4b6a6", "#c8553d", "#0b6e4f"
MOVING_TRUTH, MOVING = "#b9cbe3", "#3d5a80"


# --- flying


def files_of(directory, flight):
    """Its world, and its settings if any."""
    return directory / f"{flight.name}.xml", directory / f"{flight.experiment}.yaml"


def fly(tool, directory, flight, seeds, options=(), environment=None):
    """A line of map_flights per seed. `environment`: variables of it besides those of this process."""
    world, settings = files_of(directory, flight)
    command = [tool, "--world", world, "--config", ROOT / "cfg/objects.yaml", "--models", ROOT / "models",
               "--seeds", f"{seeds[0]}-{seeds[-1]}", "--duration", f"{flight.duration_s:g}", *flight.options, *options]
    if flight.settings:
        command += ["--set", settings]
    output = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True,
                            env={**os.environ, **(environment or {})}).stdout
    return [json.loads(text) for text in output.splitlines()]


def trace_options(directory, flight, seeds):
    if flight.name in TRACED and seeds[0] == flight.seeds[0] and flight.experiment in ("crowd", "room", "people"):
        return "--trace", directory / f"{flight.name}.jsonl", "--trace-points"
    return ()


def wanted_flights(arguments):
    """At least one run of every row of every experiment, else the fraction --seeds-scale of them."""
    total, taken = {}, {}
    flights = list(worlds.flights(arguments.only))
    for flight in flights:
        key = flight.experiment, flight.row
        total[key] = total.get(key, 0) + len(flight.seeds)
    for flight in flights:
        key = flight.experiment, flight.row
        most = math.ceil(total[key] * arguments.seeds_scale) - taken.get(key, 0)
        seeds = flight.seeds[:max(most, 0)]
        taken[key] = taken.get(key, 0) + len(seeds)
        if seeds:
            yield flight, seeds


def fly_all(arguments, directory):
    """{(experiment, row): lines of map_flights}"""
    print("building the worlds", end="", flush=True)
    pieces, wanted = {}, {}
    for flight, seeds in wanted_flights(arguments):
        for path, text in zip(files_of(directory, flight), (flight.xml, flight.settings)):
            path.write_text(text)  # now, since concurrent pieces share them
        for start in range(0, len(seeds), SEEDS_OF_PIECE):
            piece = seeds[start:start + SEEDS_OF_PIECE]
            key = (flight.name, flight.options, piece)  # some rows stand in several tables
            pieces.setdefault(key, (flight, piece))
            wanted.setdefault((flight.experiment, flight.row), []).append(key)
    flown = run_pieces(
        lambda flight, seeds: fly(arguments.tool, directory, flight, seeds, trace_options(directory, flight, seeds)),
        pieces, "pieces flown")
    return {row: [run for key in keys for run in flown[key]] for row, keys in wanted.items()}


def read_trace(directory, name):
    path = directory / f"{name}.jsonl"
    return [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []


# --- numbers


def object_of(run, name):
    return next(found for found in run["objects"] if found["name"] == name)


def parameter_errors(runs, name="ellipse"):
    """MSE over all scans of all runs and the largest error of all, of each parameter."""
    objects = [object_of(run, name) for run in runs]
    scans = np.array([found["mapped_scans"] for found in objects], float)
    if not scans.sum():
        return None
    mse = {p: np.dot(scans, [o["mse"][p + "_deg2" if p == "psi" else p] for o in objects]) / scans.sum()
           for p in PARAMETERS}
    maae = {p: max(o["maae"][p + "_deg" if p == "psi" else p] for o in objects) for p in PARAMETERS}
    mse["r"], maae["r"] = mse["rx"], maae["rx"]
    return mse, maae, math.sqrt(np.dot(scans, [o["psi_sigma_deg"] ** 2 for o in objects]) / scans.sum())


class Cell:
    """One parameter of one row: printed and ours."""

    def __init__(self, experiment, row, parameter, printed, ours, sigma_deg):
        self.experiment, self.row, self.parameter = experiment, row, parameter
        (self.printed_mse, self.printed_maae), (self.mse, self.maae) = printed, ours
        self.sigma_deg = sigma_deg
        self.ratio = self.mse / self.printed_mse if self.mse is not None else None
        self.compared = not ((experiment, row) == CIRCLE_ROW and parameter == "psi")


def cells_of(results):
    cells = []
    for tables, parameters in ((PRINTED, PARAMETERS), (PRINTED_CIRCLE, CIRCLE_PARAMETERS)):
        for experiment, rows in tables.items():
            for row, printed in rows.items():
                if (experiment, row) not in results:
                    continue
                errors = parameter_errors(results[experiment, row])
                for i, parameter in enumerate(parameters):
                    ours = (errors[0][parameter], errors[1][parameter]) if errors else (None, None)
                    cells.append(Cell(experiment, row, parameter, printed[2 * i:2 * i + 2], ours,
                                      errors[2] if errors else None))
    return cells


def geometric_mean(values):
    return math.exp(np.mean(np.log(values))) if len(values) else float("nan")


def pooled(runs, kind, key):
    """Of a class of objects: RMSE over the scans of all runs, or the mean of means."""
    scans = np.array([run[kind]["scans"] for run in runs], float)
    values = np.array([run[kind][key] for run in runs])
    if not scans.sum():
        return float("nan")
    if "rmse" in key:
        return math.sqrt(np.dot(scans, values**2) / scans.sum())
    return np.dot(scans, values) / scans.sum()


def room_numbers(runs):
    standing, moving = (sum(run[kind]["scans"] for run in runs) for kind in ("standing", "moving"))
    axes = (standing * np.nan_to_num(pooled(runs, "standing", "semi_axis_mae_m"))
            + moving * np.nan_to_num(pooled(runs, "moving", "semi_axis_mae_m"))) / max(standing + moving, 1)
    mean = lambda values: float(np.mean(list(values)))
    return {
        "recall": mean(run["recall"] for run in runs), "false_per_scan": mean(run["false_per_scan"] for run in runs),
        "on_fixtures_per_scan": mean(run["on_fixtures_per_scan"] for run in runs),
        "center_standing": pooled(runs, "standing", "center_rmse_m"),
        "center_moving": pooled(runs, "moving", "center_rmse_m"),
        "velocity_standing": pooled(runs, "standing", "velocity_rmse_m_s"),
        "velocity_moving": pooled(runs, "moving", "velocity_rmse_m_s"),
        "semi_axes": axes, "id_switches": mean(run["id_switches"] for run in runs),
        "id_switches_most": max(run["id_switches"] for run in runs),
        "latency": tuple(mean(run["latency_ms"][q] for run in runs) for q in ("p50", "p95")),
        "cpu_ms": mean(run["cpu_ms_per_scan"] for run in runs), "gospa_m": mean(run["gospa_m"] for run in runs),
        "longest_false_s": max(run["longest_false_s"] for run in runs),
    }


HIDDEN = {  # the object's name, the least time to count, what it does
    "hidden_mover": ("mover", 2.5, "moves at constant velocity, hidden for 3 s"),
    "hidden_standing": ("target", 9.0, "stands, hidden for 10 s"),
}


def long_hidden(run, name, least_s):
    """The intended hidden time of the world, or none if the object was not on the map before."""
    found = [hidden for hidden in object_of(run, name)["hidden"] if hidden["to_s"] - hidden["from_s"] >= least_s]
    return found[0] if found else None


def hidden_numbers(runs, name, least_s):
    times = [long_hidden(run, name, least_s) for run in runs]
    return {"runs": len(runs), "never_mapped": sum(hidden is None for hidden in times),
            "same_id": np.mean([hidden is not None and hidden["same_id"] is True for hidden in times]),
            "deleted": sum(hidden is not None and hidden["deleted"] for hidden in times)}


def person_numbers(runs):
    bodies = [body for run in runs for body in run["bodies"]]
    apart = sum(body["scans_apart"] for body in bodies)
    return apart, sum(body["scans_one"] for body in bodies) / apart if apart else float("nan")


HELD = (("position", "position"), ("position_velocity", "position and velocity"), ("radii", "radii"))


def held_numbers(runs):
    return {key: float(np.mean([run["held_99"][key] for run in runs])) for key, _ in HELD}


# --- verdicts


def targets(results, cells):
    """The targets and what was measured: (sentence, figure, met)."""
    compared = [cell for cell in cells if cell.compared]
    if compared:
        within = [cell for cell in compared if cell.ratio is not None and cell.ratio <= 0.5]
        worst = max(compared, key=lambda cell: cell.ratio if cell.ratio is not None else math.inf)
        title, _, unit = TITLES[worst.experiment]
        figure = "not mapped" if worst.ratio is None else f"{worst.ratio:.2f} times"
        yield ("every MSE of the papers' tables at most half the printed one",
               f"{len(within)} of {len(compared)}; the worst is {figure}, {worst.parameter} at {worst.row}{unit} in "
               f"{title}", len(within) == len(compared))
        mean = geometric_mean([cell.ratio for cell in compared if cell.ratio is not None])
        yield ("geometric mean of the ratios ours/printed at most 0.1", f"{mean:.3f}",
               mean <= 0.1 and all(cell.ratio is not None for cell in compared))
    for cell in cells:
        if (cell.experiment, cell.row, cell.parameter) == ("table_6", "90", "psi") and cell.mse is not None:
            yield ("psi at ±90°: MSE under 8 deg² (printed 987)", f"{cell.mse:.2f} deg²", cell.mse < 8.0)
        if (cell.experiment, cell.row) == CIRCLE_ROW and cell.parameter == "psi" and cell.sigma_deg is not None:
            yield ("a circle's psi: its deviation says \"unknown\" (any axis: 52°), at least 45°",
                   f"{cell.sigma_deg:.1f}°, error {math.sqrt(cell.mse):.1f}° rms", cell.sigma_deg >= 45.0)
    rooms = {mode: room_numbers(results["room", mode]) for mode in worlds.ROOM_MODES if ("room", mode) in results}
    for key, what, unit, target, more in ROOM_TARGETS if rooms else ():
        values = [numbers[key] for numbers in rooms.values()]
        figure = ", ".join(f"{value:.3f} {mode}" for value, mode in zip(values, rooms))
        if key == "id_switches":
            runs = [run["id_switches"] for mode in rooms for run in results["room", mode]]
            figure = (f"{', '.join(f'{value:.2f} {mode}' for value, mode in zip(values, rooms))}; more than 2 in "
                      f"{sum(n > 2 for n in runs)} of {len(runs)} runs, at most {max(runs)}")
        met = all(value >= target if more else value <= target for value in values)
        yield (f"the room: {what} at {'least' if more else 'most'} {target:g} {unit}".strip(), figure, met)
    if ("hidden_mover", "hidden_mover") in results:
        n = hidden_numbers(results["hidden_mover", "hidden_mover"], *HIDDEN["hidden_mover"][:2])
        yield ("hidden for 3 s at constant velocity: back under its id in 95 %",
               f"{100 * n['same_id']:.1f} % of {n['runs']} runs", n["same_id"] >= 0.95)
    if ("hidden_standing", "hidden_standing") in results:
        n = hidden_numbers(results["hidden_standing", "hidden_standing"], *HIDDEN["hidden_standing"][:2])
        yield ("standing and hidden for 10 s: none deleted", f"{n['deleted']} of {n['runs']} deleted, "
               f"{n['never_mapped']} never mapped, {100 * n['same_id']:.1f} % back under their id",
               n["deleted"] == 0 and n["never_mapped"] == 0)
    if ("people", "people") in results:
        apart, one = person_numbers(results["people", "people"])
        yield ("a person in separate segments is one element in 95 % of the frames", f"{100 * one:.1f} % of {apart}",
               one >= 0.95)
    for experiment, what in (("noise", "ranges twice as noisy"), ("manoeuvres", "manoeuvring objects")):
        if (experiment, "crowd") in results:
            held = held_numbers(results[experiment, "crowd"])
            yield (f"{what}: the 99 % region holds 97 % of truths",
                   ", ".join(f"{name} {100 * held[key]:.1f} %" for key, name in HELD), min(held.values()) >= 0.97)


# --- tables


def pair(numbers, kind):
    """Of standing and moving objects, a dash where there are none."""
    values = (numbers[f"{kind}_standing"], numbers[f"{kind}_moving"])
    return " / ".join("-" if math.isnan(value) else f"{value:.3f}" for value in values)


def number(value):
    if value is None:
        return "not mapped"
    return f"{value:.2g}" if 0.001 <= abs(value) < 1 else f"{value:.1f}" if abs(value) >= 1 else f"{value:.1e}"


def table_of_paper(cells, experiment):
    own = [cell for cell in cells if cell.experiment == experiment]
    if not own:
        return ""
    title, what, unit = TITLES[experiment]
    parameters = PARAMETERS if experiment in PRINTED else CIRCLE_PARAMETERS
    rows = []
    for row in dict.fromkeys(cell.row for cell in own):
        found = {cell.parameter: cell for cell in own if cell.row == row}
        label = ("±90" if (experiment, row) == ("table_6", "90") else row) + unit
        for kind in ("MSE", "MaAE"):
            texts = []
            for parameter in parameters:
                cell = found[parameter]
                printed, ours = ((cell.printed_mse, cell.mse) if kind == "MSE" else (cell.printed_maae, cell.maae))
                if ours is None:
                    texts.append(f"{number(printed)} / not mapped")
                elif not cell.compared:
                    texts.append(f"{number(printed)} / {number(ours)}, said to be ± {cell.sigma_deg:.0f}°")
                else:
                    ratio = ours / printed
                    over = kind == "MSE" and ratio > 0.5
                    text = f"{ratio:.2f}" if ratio >= 0.1 else f"{ratio:.3f}"
                    text = f"**{text}**" if over else text
                    texts.append(f"{number(printed)} / {number(ours)} / {text}")
            rows.append([label if kind == "MSE" else "", kind, *texts])
    header = [what, ""] + [p + (", deg² and deg" if p == "psi" else "") for p in parameters]
    return f"**{title}**\n\n" + table(header, rows)


def room_table(results):
    rows = []
    for mode in worlds.ROOM_MODES:
        if ("room", mode) not in results:
            continue
        runs = results["room", mode]
        n = room_numbers(runs)
        rows.append((
            f"**ours, {mode}** ({len(runs)} rooms)", f"{n['recall']:.3f}", f"{n['false_per_scan']:.3f}",
            f"{n['on_fixtures_per_scan']:.3f}", pair(n, "center"), pair(n, "velocity"), f"{n['semi_axes']:.3f}",
            f"{n['id_switches']:.2f} (most {n['id_switches_most']})",
            f"{n['latency'][0]:.2f} / {n['latency'][1]:.2f}", f"{n['cpu_ms']:.2f}",
        ))
    header = ("", "recall", "false per scan", "on fixtures", "centre RMSE standing / moving, m",
              "velocity RMSE standing / moving, m/s", "semi-axes MAE, m", "id switches", "latency p50 / p95, ms",
              "CPU, ms per scan")
    target = ("target", "≥ .98", "≤ .02", "", "≤ .02 / .03", "≤ .03 / .20", "≤ .02", "≤ 2", "", "")
    peers = [(row["name"], row["recall"], row["false_per_scan"], "",
              f"{row['center_standing_m']} / {row['center_moving_m']}",
              f"{row['velocity_standing_m_s']} / {row['velocity_moving_m_s']}", row["semi_axes_m"], row["id_switches"],
              row["latency_ms"], row["cpu_ms_per_scan"]) for row in printed.peers()]
    return table(header, [*rows, target, *peers])


def crowd_table(results):
    rows = []
    for experiment, what in (("crowd", "as Fig. 8"), ("noise", "ranges twice as noisy as the map believes"),
                             ("manoeuvres", "manoeuvring objects")):
        if (experiment, "crowd") not in results:
            continue
        runs = results[experiment, "crowd"]
        n, held = room_numbers(runs), held_numbers(runs)
        rows.append((what, str(len(runs)), f"{n['gospa_m']:.3f}", f"{n['recall']:.3f}", f"{n['false_per_scan']:.3f}",
                     f"{n['id_switches']:.2f}", pair(n, "center"), pair(n, "velocity"),
                     " / ".join(f"{100 * held[key]:.1f}" for key, _ in HELD)))
    return table(("", "runs", "GOSPA, m", "recall", "false per scan", "id switches per run",
                  "centre RMSE standing / moving, m", "velocity RMSE standing / moving, m/s",
                  "in the 99 % region: " + " / ".join(name for _, name in HELD) + ", %"), rows)


def held_of_rooms(results):
    rows = [(mode, *(f"{100 * held_numbers(results['room', mode])[key]:.1f}" for key, _ in HELD))
            for mode in worlds.ROOM_MODES if ("room", mode) in results]
    return table(("room", *(f"{name}, %" for _, name in HELD)), rows)


def hidden_table(results):
    rows = []
    for experiment, (name, least_s, what) in HIDDEN.items():
        if (experiment, experiment) in results:
            n = hidden_numbers(results[experiment, experiment], name, least_s)
            rows.append((what, str(n["runs"]), f"{100 * n['same_id']:.1f} %", str(n["deleted"]),
                         str(n["never_mapped"])))
    return table(("the object", "runs", "back under its id", "deleted while hidden", "not on the map before"), rows)


def people_table(results):
    runs = results["people", "people"]
    apart, one = person_numbers(runs)
    n = room_numbers(runs)
    walking = [o for run in runs for o in run["objects"] if o["moves"]]
    return table(("runs", "frames apart", "one element", "recall", "false per scan", "id switches of a person"),
                 [(str(len(runs)), f"{apart:,}", f"{100 * one:.1f} %", f"{n['recall']:.3f}",
                   f"{n['false_per_scan']:.3f}", f"{np.mean([o['id_switches'] for o in walking]):.2f}")])


def tilt_table(results):
    rows, base = [], None
    for row in ("hovering", "tilted and turning"):
        if ("tilt", row) not in results:
            continue
        n = room_numbers(results["tilt", row])
        base = base or n
        rows.append((row, f"{n['recall']:.3f}", f"{n['false_per_scan']:.3f}", f"{n['center_standing']:.4f}",
                     f"{n['center_standing'] / base['center_standing']:.2f}", f"{n['velocity_standing']:.3f}",
                     f"{n['semi_axes']:.3f}", f"{n['id_switches']:.2f}"))
    return table(("robot", "recall", "false per scan", "centre RMSE, m", "against hovering", "velocity RMSE, m/s",
                  "semi-axes MAE, m", "id switches per run"), rows)


# --- pictures


def draw_ratios(cells, path):
    """A dot for each parameter of each row: the farther to the left, the better."""
    figure, axes = pyplot.subplots(1, 2, figsize=(13, 8), layout="constrained", sharey=True)
    rows_of_paper, lines = {}, {}
    for ax, tables, parameters, paper in ((axes[0], PRINTED, PARAMETERS, "ellipse paper"),
                                          (axes[1], PRINTED_CIRCLE, CIRCLE_PARAMETERS, "circle paper")):
        place, rows = 0.0, rows_of_paper.setdefault(ax, [])
        for experiment in tables:
            own = [cell for cell in cells if cell.experiment == experiment]
            if not own:
                continue
            title, _, unit = TITLES[experiment]
            ax.text(0.01, place, title.replace(" of the circle paper", ""), transform=ax.get_yaxis_transform(),
                    fontsize=10, weight="bold", va="center")
            for row in dict.fromkeys(cell.row for cell in own):
                place -= 1.0
                rows.append((place, ("±90" if (experiment, row) == ("table_6", "90") else row) + unit))
                found = [cell for cell in own if cell.row == row and cell.compared and cell.ratio is not None]
                if found:
                    ratios = [cell.ratio for cell in found]
                    ax.plot((min(ratios), max(ratios)), (place, place), color="0.85", lw=2, zorder=1)
                for cell in found:
                    ax.plot(cell.ratio, place, "o", ms=7, color=COLORS[cell.parameter], mec="white", mew=0.6, zorder=3)
            place -= 1.7
        ax.set_xscale("log")
        low, high = ax.get_xlim()
        ax.set_xlim(min(low, 0.005), max(high, 2.0))
        down_to = place + 1.2
        ax.fill_betweenx((down_to, 0.8), ax.get_xlim()[0], 0.5, color=COLORS["rx"], alpha=0.05, lw=0)
        own = [cell.ratio for cell in cells if cell.experiment in tables and cell.compared and cell.ratio is not None]
        for x, style, label in (
            (1.0, {"color": "0.4", "lw": 1}, "as printed"),
            (0.5, {"color": "0.4", "lw": 1, "ls": "--"}, "half of it: the target for each"),
            (geometric_mean(own), {"color": "black", "lw": 1.4, "ls": ":"}, None),
        ):
            label = label or f"geometric mean of the {paper}'s: {x:.3f}"
            lines[label], = ax.plot((x, x), (down_to, 0.8), zorder=0, **style)
        ax.set_xlabel("mean square error, ours / printed")
        ax.spines[["top", "right", "left"]].set_visible(False)
        ax.grid(axis="x", alpha=0.25, lw=0.6)
        ax.tick_params(axis="y", length=0, labelleft=False)
        for place, label in rows:
            ax.text(-0.01, place, label, transform=ax.get_yaxis_transform(), ha="right", va="center", fontsize=9.5)
        handles = [pyplot.Line2D([], [], marker="o", ls="", ms=7, color=COLORS[p], mec="white", label=SYMBOLS.get(p, p))
                   for p in parameters]
        ax.legend(handles=handles, ncol=len(parameters), loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False,
                  title=paper, handletextpad=0.1, columnspacing=1.2)
    places = [place for rows in rows_of_paper.values() for place, _ in rows]
    axes[0].set_ylim(min(places, default=0.0) - 0.8, 0.8)
    figure.legend(lines.values(), lines.keys(), loc="lower left", bbox_to_anchor=(0.56, 0.12), frameon=False)
    save(figure, path)


def ellipse_patch(o, **style):
    return patches.Ellipse((o["x"], o["y"]), 2 * o["rx"], 2 * o["ry"], angle=math.degrees(o["psi"]), **style)


def covariance_patch(element, **style):
    """The 99 % region of the centre."""
    xx, xy, yy = element["covariance_xy"]
    values, vectors = np.linalg.eigh(np.array(((xx, xy), (xy, yy))))
    size = 2.0 * np.sqrt(stats.chi2.ppf(0.99, 2) * np.maximum(values, 0.0))
    return patches.Ellipse((element["x"], element["y"]), size[0], size[1],
                           angle=math.degrees(math.atan2(vectors[1, 0], vectors[0, 0])), **style)


def draw_arrow(ax, o, ahead_s, color):
    """To where it will be after some seconds."""
    ax.annotate("", (o["x"] + ahead_s * o["vx"], o["y"] + ahead_s * o["vy"]), (o["x"], o["y"]),
                arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.2}, zorder=5)


def is_moving(truth):
    return math.hypot(truth["vx"], truth["vy"]) > 1e-9


def draw_robot(ax, robot, size=0.35):
    x, y, yaw = robot
    corners = np.array(((1.0, 0.0), (-0.7, 0.6), (-0.4, 0.0), (-0.7, -0.6))) * size
    turn = np.array(((math.cos(yaw), -math.sin(yaw)), (math.sin(yaw), math.cos(yaw))))
    ax.add_patch(patches.Polygon(corners @ turn.T + (x, y), color="black", zorder=6))


def draw_scene(ax, trace, at_s, walls=(), past_s=6.0):
    k = min(range(len(trace)), key=lambda i: abs(trace[i]["t"] - at_s))
    frame, past = trace[k], [f for f in trace[:k + 1] if f["t"] >= at_s - past_s]
    for x, y, half_x, half_y in walls:
        ax.add_patch(patches.Rectangle((x - half_x, y - half_y), 2 * half_x, 2 * half_y, color="0.82", lw=0))
    points = np.array(frame.get("points") or np.zeros((0, 2)))
    ax.plot(*points.T, ".", color="0.25", ms=2, zorder=4)
    for i, truth in enumerate(frame["truth"]):
        moving = any(is_moving(f["truth"][i]) for f in past)
        fill, edge = (MOVING_TRUTH, MOVING) if moving else (TRUTH, STANDING)
        ax.add_patch(ellipse_patch(truth, fc=fill, ec=edge, lw=0.8, zorder=2))
        if moving:
            ax.plot([f["truth"][i]["x"] for f in past], [f["truth"][i]["y"] for f in past], color=MOVING, lw=0.9,
                    alpha=0.6, zorder=1)
    tracks = {}
    for f in past:
        for element in f["map"]:
            tracks.setdefault(element["id"], []).append((element["x"], element["y"]))
    for element in frame["map"]:
        ax.plot(*np.array(tracks[element["id"]]).T, color=MAPPED, lw=1.2, ls=(0, (2, 1.5)), zorder=3)
        ax.add_patch(ellipse_patch(element, fill=False, ec=MAPPED, lw=1.8, zorder=5))
        ax.add_patch(covariance_patch(element, fc=MAPPED, alpha=0.25, lw=0, zorder=3))
        if math.hypot(element["vx"], element["vy"]) > 0.1:
            draw_arrow(ax, element, 1.0, MAPPED)
        ax.annotate(str(element["id"]), (element["x"], element["y"]), xytext=(7, 7), textcoords="offset points",
                    fontsize=8, color=MAPPED)
    ax.plot([f["robot"][0] for f in past], [f["robot"][1] for f in past], color="black", lw=1)
    draw_robot(ax, frame["robot"])
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    ax.spines[:].set_visible(False)
    return frame


SCENE_LEGEND = [
    patches.Patch(fc=TRUTH, ec=STANDING, label="truth, standing"),
    patches.Patch(fc=MOVING_TRUTH, ec=MOVING, label="truth, moving"),
    patches.Patch(fill=False, ec=MAPPED, lw=1.8, label="map: ellipse, id, velocity, track"),
    patches.Patch(fc=MAPPED, alpha=0.25, label="99 % region of its centre"),
    pyplot.Line2D([], [], marker=".", ls="", color="0.25", label="hits"),
]


def draw_room(directory, path):
    walls = worlds.room(1).walls
    half_x, half_y = walls[0][0] + 0.15, walls[2][1] + 0.15
    figure, axes = pyplot.subplots(1, 2, figsize=(14, 6.6), layout="constrained")
    for ax, name, title in ((axes[0], "room_1_cruising", "cruising at 1 m/s"),
                            (axes[1], "room_1_cruising_and_turning", "cruising and turning at 60 deg/s")):
        trace = read_trace(directory, name)
        if trace:
            frame = draw_scene(ax, trace, 22.0, walls)
            ax.set_title(f"{title}, t = {frame['t']:.0f} s")
            ax.set(xlim=(-half_x, half_x), ylim=(-half_y, half_y))
    save(figure, path, SCENE_LEGEND)


def draw_crowd(directory, path):
    trace = read_trace(directory, "crowd_1")
    if not trace:
        return
    t = np.array([frame["t"] for frame in trace])
    visible = np.array([sum(o["beams"] >= VISIBLE_BEAMS for o in frame["truth"]) for frame in trace])
    missed = np.array([frame["missed"] for frame in trace])
    hidden = np.array([sum(o["beams"] == 0 for o in frame["truth"]) for frame in trace])
    figure = pyplot.figure(figsize=(14, 7.4), layout="constrained")
    grid = figure.add_gridspec(5, 2, width_ratios=(1, 1.25))
    scene = figure.add_subplot(grid[:, 0])
    most = int(np.argmax(np.where(t > 10, hidden, -1)))
    draw_scene(scene, trace, t[most])
    scene.set_title(f"t = {t[most]:.1f} s, {hidden[most]} of {len(trace[most]['truth'])} hidden")
    rows = (
        ([frame["gospa_m"] for frame in trace], "GOSPA, m", "#0b6e4f"),
        (np.where(visible > 0, 1.0 - missed / np.maximum(visible, 1), 1.0), "recall", "#3d5a80"),
        ([frame["false"] for frame in trace], "false", "#c8553d"),
        ([frame["id_switches"] for frame in trace], "id switches\nso far", "#8a5a83"),
        (hidden, "hidden", "0.5"),
    )
    shared = None
    for i, (values, label, color) in enumerate(rows):
        ax = shared = figure.add_subplot(grid[i, 1], sharex=shared)
        ax.plot(t, values, color=color, lw=1.3)
        ax.fill_between(t, values, color=color, alpha=0.15, lw=0)
        ax.set_ylabel(label)
        ax.set_ylim(0, max(1.05, 1.1 * max(values)))
        clean(ax)
        ax.tick_params(labelbottom=i == len(rows) - 1)
    ax.set_xlabel("t, s")
    ax.set_xlim(0, t[-1])
    save(figure, path, SCENE_LEGEND)


def draw_person(directory, path):
    """Frames in which all three parts are hit, evenly over the flight."""
    trace = read_trace(directory, "people_1")
    parts = lambda frame: [o for o in frame["truth"] if o["name"].startswith("person/")]
    seen = [frame for frame in trace if frame["t"] > 2.0 and min(o["beams"] for o in parts(frame)) >= 4]
    if not seen:
        return
    chosen = [seen[int(part * (len(seen) - 1))] for part in (0.05, 0.25, 0.45, 0.6, 0.8, 0.95)]
    figure, axes = pyplot.subplots(1, len(chosen), figsize=(15, 2.9), layout="constrained")
    for ax, frame in zip(axes, chosen):
        torso = parts(frame)[0]
        for o in parts(frame):
            ax.add_patch(ellipse_patch(o, fc=MOVING_TRUTH, ec=MOVING, lw=0.8, zorder=2))
        ax.plot(*np.array(frame["points"]).T, ".", color="0.15", ms=4, zorder=4)
        for element in frame["map"]:
            ax.add_patch(ellipse_patch(element, fill=False, ec=MAPPED, lw=2, zorder=3))
            if max(abs(element["x"] - torso["x"]), abs(element["y"] - torso["y"])) < 0.65:
                ax.annotate(str(element["id"]), (element["x"], element["y"]), xytext=(9, 9),
                            textcoords="offset points", color=MAPPED, fontsize=9, zorder=6)
        draw_arrow(ax, torso, 0.6, MOVING)
        ax.set(xlim=(torso["x"] - 0.75, torso["x"] + 0.75), ylim=(torso["y"] - 0.75, torso["y"] + 0.75))
        ax.set_aspect("equal")
        ax.set_xticks([])
        ax.set_yticks([])
        ax.set_title(f"t = {frame['t']:.1f} s", fontsize=10)
        for spine in ax.spines.values():
            spine.set_color("0.8")
    save(figure, path, [
        patches.Patch(fc=MOVING_TRUTH, ec=MOVING, label="torso and arms, and where they go"),
        pyplot.Line2D([], [], marker=".", ls="", color="0.15", label="hits"),
        patches.Patch(fill=False, ec=MAPPED, lw=2, label="elements of the map with their ids"),
    ])


def draw_room_errors(results, path):
    """A dot for each room and mode, a bar at the pooled value, and the targets."""
    modes = [mode for mode in worlds.ROOM_MODES if ("room", mode) in results]
    best_of_peers = printed.best_of_peers()
    figure, axes = pyplot.subplots(2, 4, figsize=(14, 6.5), layout="constrained")
    for ax, (key, what, unit, target, more) in zip(axes.flat, ROOM_TARGETS):
        for i, mode in enumerate(modes):
            runs = results["room", mode]
            values = np.array([room_numbers([run])[key] for run in runs])
            spread = np.linspace(-0.3, 0.3, len(values)) if len(values) > 1 else np.zeros(1)
            ax.plot(i + spread, values, "o", ms=3.2, color=MODE_COLORS[i], alpha=0.6, mew=0)
            ax.plot((i - 0.36, i + 0.36), 2 * (room_numbers(runs)[key],), color=MODE_COLORS[i], lw=2.2)
        ax.axhline(target, color="black", lw=1, ls="--")
        best = best_of_peers.get(f"{key}_{unit.replace('/', '_')}".rstrip("_"), 0.0)
        if best > 0.0 and not more:
            ax.axhline(best, color="0.6", lw=1, ls=":")
        low, high = ax.get_ylim()
        if more:
            ax.set_ylim(min(low, 0.94), 1.003)
            ax.spines["bottom"].set_visible(True)
        else:
            ax.set_ylim(-0.02 * high, high * 1.05)
        ax.set_xticks(range(len(modes)), [mode.replace(" and ", "\nand ") for mode in modes], fontsize=8)
        ax.set_title(f"{what}{', ' + unit if unit else ''}", fontsize=10)
        clean(ax)
    save(figure, path, [
        pyplot.Line2D([], [], marker="o", ls="", color="0.4", ms=4, label="one room"),
        pyplot.Line2D([], [], color="0.4", lw=2.2, label="all rooms"),
        pyplot.Line2D([], [], color="black", lw=1, ls="--", label="target"),
        pyplot.Line2D([], [], color="0.6", lw=1, ls=":", label="best of obstacle_detector and datmo, in one room"),
    ])


# --- report


def picture(images, name, text):
    return f"![{text}](images/{name})\n" if (images / name).exists() else ""


INTRODUCTION = """
{scans:,} scans in {minutes:.1f} minutes. Every number of ours is from this run, with the shipped `cfg/objects.yaml`.
The worlds are simulated ([worlds.py](../../scripts/evaluation/worlds.py) defines their objects and paths): a scanner
like the UTM-30LX, 1081 beams over 270°, 20 Hz, 1 cm of noise, within 10 m, and an exact pose of the robot. An object is
visible if at least {beams} beams hit it; errors are those of visible objects that are on the map.
"""
PAPERS_TABLES = """
Printed / ours / ratio; MSE in m² and deg², MaAE in m and deg; ψ modulo 180°. Ours are over all scans of five flights of
60 s from the first with the object on the map, convergence included, in the world frame; MaAE is the largest
error of all five. **Bold**: more than half of the printed MSE. Geometric mean of all MSE ratios: **{mean:.3f}**. The
papers do not specify the trajectories. Ours are circles of 0.8 m radius at 0.5 rad/s about a point 2.5 m in
front of the hovering robot (trajectory 1), to its right (2) and to its left (3), at constant orientation. In the circle
paper's tables 1 is the same; 2 is a circle of 1.2 m about a point 3 m ahead, at -0.4 rad/s; 3 a line of 3 m across the
view, 2.5 m ahead; 4 is to the right and 5 to the left. A circle has no ψ: for it the map's standard deviation is given,
which should be that of an unknown axis (52°).
"""
ROOM = """
Six standing and five moving objects (larger radius 0.1 to 0.45 m, ratio up to 2.5, 0.3 to 1.2 m/s), four walls, a
cabinet, sometimes a closet, 40 s. These two are boxes that the truth does not have: elements on them (on fixtures, per
scan) are neither correct nor false. The scans of a moving robot take 19 ms. The lower rows were measured
elsewhere, on one bag of one such room: not by this command, on this machine or in these rooms. Compare orders of
magnitude only.
"""
CROWD = """
Six standing and six moving objects within 8 m of a hovering robot, no walls, 60 s. GOSPA with a cut-off of 0.5 m.
The manoeuvring objects, eight without standing ones, move at 0.8 to 1.2 m/s with accelerations of up to 3 m/s².
"""
HIDDEN_TEXT = """
Each run has its own world with random sizes, ranges and directions; that no beam hits the hidden object is checked beam
by beam.
"""
PERSONS = """
Two persons walk at 0.8 m/s in an arena of 5 m x 6 m, which the range limiter cuts out of a larger room, and swing their
arms, 60 s. Where torso and arms are separate segments, exactly one element of the map should be on the person; a second
one counts as false.
"""
TILT = """
Standing objects only. The robot flies a circle of 2 m radius at 2.3 m/s, tilted by 15°, and also turns at 60°/s.
"""
NOT_SAID = """
The pose is exact, all objects but the persons are ellipses, and the scenery is static. Times are of the whole
pipeline with one flight per core at once. NEES and NIS on matched runs are tested in `test/map/objects/`, and the
time for 1,000 elements is measured in `benchmark/`.
"""


def report_of(arguments, measured, results, cells, images, spent_s):
    def has(*experiments):
        return any(experiment in experiments for experiment, _ in results)

    scans = sum(run["scans"] for runs in results.values() for run in runs)
    parts = ["# The map, measured\n", introduction(measured, INTRODUCTION.format(
        beams=VISIBLE_BEAMS, scans=scans, minutes=spent_s / 60))]
    if not arguments.whole:
        what = ", ".join(arguments.only) or "everything"
        parts.append(f"**A part only**: {arguments.seeds_scale:g} of the runs of {what}.\n")
    parts.append(targets_section(list(targets(results, cells))))
    if cells:
        mean = geometric_mean([cell.ratio for cell in cells if cell.compared and cell.ratio is not None])
        parts.append(section("The papers' tables", prose(PAPERS_TABLES.format(mean=mean)),
                             picture(images, "map_ratios.png", "Ratios of our errors to the printed ones"),
                             *(table_of_paper(cells, experiment) for experiment in (*PRINTED, *PRINTED_CIRCLE))))
    if has("room"):
        parts.append(section("A walled room", prose(ROOM), room_table(results),
                             picture(images, "map_room.png", "The room from above"),
                             picture(images, "map_room_errors.png", "Errors of each room and mode, and the targets"),
                             "Truths inside the map's own 99 % region:\n", held_of_rooms(results)))
    if has("crowd", "noise", "manoeuvres"):
        parts.append(section("Many objects that occlude each other: Fig. 8", prose(CROWD), crowd_table(results),
                             picture(images, "map_crowd.png", "One flight over time")))
    if has(*HIDDEN):
        parts.append(section("Occlusion", prose(HIDDEN_TEXT), hidden_table(results)))
    if has("people"):
        parts.append(section("Persons and a barrel: Fig. 9 and 10", prose(PERSONS), people_table(results),
                             picture(images, "map_person.png", "A person in a few frames")))
    if has("tilt"):
        parts.append(section("Tilted and turning", prose(TILT), tilt_table(results)))
    parts.append(section("Limitations", prose(NOT_SAID)))
    return "\n".join(parts)


def main():
    parser = arguments_parser(__doc__, "docs/benchmarks", "a part of the runs")
    parser.add_argument("--tool", required=True)
    parser.add_argument("--only", action="append", default=[], choices=list(worlds.EXPERIMENTS), metavar="EXPERIMENT",
                        help=f"may be repeated: {' '.join(worlds.EXPERIMENTS)}")
    parser.add_argument("--seeds-scale", type=float, default=1.0, help="part of the runs, such as 0.1 for a quick look")
    arguments = parser.parse_args()
    if not 0.0 < arguments.seeds_scale <= 1.0:
        parser.error("--seeds-scale must be above 0 and at most 1")
    arguments.whole = arguments.seeds_scale == 1.0 and not arguments.only
    output, measured = output_folder(arguments, arguments.whole), facts(arguments)
    images = images_folder(output)

    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        directory = pathlib.Path(folder)
        results = fly_all(arguments, directory)
        spent_s = time.monotonic() - begin
        cells = cells_of(results)
        if cells:
            draw_ratios(cells, images / "map_ratios.png")
        if any(experiment == "room" for experiment, _ in results):
            draw_room(directory, images / "map_room.png")
            draw_room_errors(results, images / "map_room_errors.png")
        draw_crowd(directory, images / "map_crowd.png")
        draw_person(directory, images / "map_person.png")
    write(output, "map.md", report_of(arguments, measured, results, cells, images, spent_s))


if __name__ == "__main__":
    main()
