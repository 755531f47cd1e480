#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Run a test whose nodelets are built with sanitizers: any of their reports fails it, also if the test passes.

    sanitized.py REPORT_FOLDER COMMAND...

A manager that was ended by a report may be back by respawn before the test notices: hence the reports' files.
"""
import os
import pathlib
import subprocess
import sys


def main():
    folder, command = pathlib.Path(sys.argv[1]), sys.argv[2:]
    folder.mkdir(parents=True, exist_ok=True)
    for report in folder.iterdir():
        report.unlink()
    # Memory left allocated by ROS and its plugins at the end is ignored.
    options = f"log_path={folder}/report:detect_leaks=0:print_stacktrace=1"
    environment = dict(os.environ, ASAN_OPTIONS=options, UBSAN_OPTIONS=options)
    code = subprocess.run(command, env=environment, check=False).returncode
    reports = sorted(folder.iterdir())
    for report in reports:
        print(f"--- {report.name}\n{report.read_text(errors='replace')[:8000]}")
    if reports:
        print(f"{len(reports)} reports of sanitizers: {folder}")
    return 1 if reports else code


if __name__ == "__main__":
    sys.exit(main())
