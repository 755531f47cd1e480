# SPDX-License-Identifier: BSD-3-Clause
"""Common code of the reports of scripts/evaluate: command line, progress, place of the measurement, and output."""

import argparse
import concurrent.futures
import datetime
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import textwrap
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]


# --- command line


def arguments_parser(doc, folder, part=None):
    """`folder` is where the report goes without --output; with `part` named, a part of the runs goes elsewhere."""
    parser = argparse.ArgumentParser(description=doc)
    name = pathlib.Path(sys.argv[0]).stem
    parser.add_argument("--output", type=pathlib.Path,
                        help=f"default: {folder}" + (f", or build/evaluation/{name} for {part}" if part else ""))
    parser.set_defaults(name=name, folder=folder)
    return parser


def output_folder(arguments, whole=True):
    """Output of the report: a part of the runs never replaces the published one."""
    output = arguments.output or ROOT / (arguments.folder if whole else f"build/evaluation/{arguments.name}")
    output.mkdir(parents=True, exist_ok=True)
    return output


def facts(arguments, values=None):
    """How, when and where this is measured. `values`: {option: what the report has as its value}."""
    words = sys.argv[1:]
    for option in ("--tool", "--programs"):  # which scripts/evaluate gives
        if option in words:
            at = words.index(option)
            del words[at:at + 2]
    for option, value in (values or {}).items():
        if option in words:
            words[words.index(option) + 1] = value
    return {"command": shlex.join(["scripts/evaluate", arguments.name, *words]), "date": str(datetime.date.today()),
            "commit": commit(), "machine": machine(), "load": os.getloadavg()[0]}


# --- progress


def print_progress(part, begin_s, what):
    """A bar on the line of the last one; `begin_s` is of time.monotonic()."""
    spent_s = time.monotonic() - begin_s
    left_s = spent_s * (1.0 / part - 1.0)
    print(f"\r[{'#' * int(30 * part):30}] {what}, {duration(spent_s)}, about {duration(left_s)} to go   ", end="",
          flush=True)


def duration(time_s):
    return f"{time_s:.0f} s" if time_s < 120.0 else f"{time_s / 60.0:.0f} min"


def run_pieces(run, pieces, what, pool_type=concurrent.futures.ThreadPoolExecutor):
    """{key: run(*piece)} for {key: piece}, over the cores, with a bar; `what` names the pieces. Where `run` works
    itself and does not wait for programs, the pool is one of processes."""
    results, begin_s = {}, time.monotonic()
    with pool_type(os.cpu_count()) as pool:
        waiting = {pool.submit(run, *piece): key for key, piece in pieces.items()}
        try:
            for done, future in enumerate(concurrent.futures.as_completed(waiting), 1):
                results[waiting[future]] = future.result()
                print_progress(done / len(pieces), begin_s, f"{done} of {len(pieces)} {what}")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    print()
    return results


# --- where it was measured


def machine():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    model = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return f"{os.cpu_count()} cores of {model[0] if model else 'an unknown processor'}"


def commit():
    """Of the working tree, with a note if the measured commit differs."""
    if not shutil.which("git"):
        return "unknown"

    def git(*words):
        return subprocess.run(["git", "-C", ROOT, *words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              text=True).stdout.strip()

    measured = ("CMakeLists.txt", "benchmark", "cfg", "include", "models", "src")
    name = git("rev-parse", "--short=10", "HEAD") or "unknown"
    return name + (" with changes" if git("status", "--porcelain", "--", *measured) else "")


# --- text


def section(title, *parts):
    return f"## {title}\n\n" + "\n".join(part for part in parts if part)


def prose(text):
    """A paragraph of the report."""
    return textwrap.fill(" ".join(text.split()), 120, break_long_words=False, break_on_hyphens=False) + "\n"


def introduction(measured, text):
    """The first paragraph: command, date, machine and description."""
    return prose(f"`{measured['command']}`, {measured['date']}, commit {measured['commit']}, {measured['machine']}, "
                 f"load average {measured['load']:.1f} at the start. {text}")


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def targets_section(verdicts):
    """Of (sentence, figure, met)."""
    met = sum(kept for _, _, kept in verdicts)
    return section(f"Targets: {met} of {len(verdicts)} met",
                   table(("target", "measured", "met"),
                         [(what, figure, "yes" if kept else "**no**") for what, figure, kept in verdicts]))


def write(output, name, report):
    (output / name).write_text(report)
    print(report)
    print(f"wrote {output / name}")
