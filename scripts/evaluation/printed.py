# SPDX-License-Identifier: BSD-3-Clause
"""Figures printed or measured by others, and the floors: the tables of data/ and docs/benchmarks/, each with its source in its
first lines."""

import csv
import pathlib

DATA = pathlib.Path(__file__).resolve().parent / "data"


def read_rows(path):
    """A dictionary of texts for each line; lines that begin with # are comments."""
    with open(path, newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def map_tables(name):
    """{table: {row: (MSE and MaAE of each parameter)}} of a paper."""
    tables = {}
    for row in read_rows(DATA / f"{name}_paper_map.csv"):
        table, name, *errors = row.values()
        tables.setdefault(table, {})[name] = tuple(float(error) for error in errors)
    return tables


def detector_errors(paper):
    """{detector: {loss, mse, mae}} on a paper's test data, without those that it does not print."""
    return {row["detector"]: {name: float(row[name]) for name in ("loss", "mse", "mae") if row[name]}
            for row in read_rows(DATA / "papers_detectors.csv") if row["paper"] == paper}


def peers():
    """Texts of other packages in a walled room, and of what bounds them."""
    return read_rows(DATA / "peers_room.csv")


def best_of_peers():
    """{column: value} of the packages, each column by the best of them."""
    packages = [row for row in peers() if row["kind"] == "package"]
    more_is_better = ("recall",)
    columns = ("recall", "false_per_scan", "center_standing_m", "center_moving_m", "velocity_standing_m_s",
               "velocity_moving_m_s", "semi_axes_m")
    return {column: (max if column in more_is_better else min)(float(row[column]) for row in packages)
            for column in columns}
