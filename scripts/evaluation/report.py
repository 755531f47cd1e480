# SPDX-License-Identifier: BSD-3-Clause
"""What the reports of scripts/evaluate have in common: where they were measured, and how they are written."""

import os
import pathlib
import subprocess
import textwrap

ROOT = pathlib.Path(__file__).resolve().parents[2]


def machine():
    model = [line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")]
    return f"{os.cpu_count()} cores of {model[0] if model else 'an unknown processor'}"


def commit():
    """Of the working tree, with a word if what was measured is not what it has."""
    def git(*words):
        return subprocess.run(["git", "-C", ROOT, *words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              text=True).stdout.strip()

    measured = ("CMakeLists.txt", "benchmark", "cfg", "include", "models", "src")
    name = git("rev-parse", "--short=10", "HEAD") or "unknown"
    return name + (" with changes" if git("status", "--porcelain", "--", *measured) else "")


def section(title, *parts):
    return f"## {title}\n\n" + "\n".join(part for part in parts if part)


def prose(text):
    """A paragraph of the report."""
    return textwrap.fill(" ".join(text.split()), 120, break_long_words=False, break_on_hyphens=False) + "\n"
