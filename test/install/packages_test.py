#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""debian/control asks for every library of the groups [use] and [use, ...] in scripts/packages.txt."""
import pathlib
import re
import sys

SOURCE = pathlib.Path(__file__).resolve().parents[2]

group, wanted = None, set()
for line in (SOURCE / "scripts/packages.txt").read_text(encoding="utf-8").splitlines():
    package = line.partition("#")[0].strip()
    if package.startswith("["):
        group = package
    elif group and group.startswith("[use") and package.endswith("-dev"):
        wanted.add(package)
control = (SOURCE / "debian/control").read_text(encoding="utf-8")
build_depends = re.search(r"^Build-Depends:(.*?)^\S", control, re.MULTILINE | re.DOTALL).group(1)
if not wanted:
    sys.exit("scripts/packages.txt has no library in its group [use]")
missing = wanted - {entry.split()[0] for entry in re.split("[,|]", build_depends) if entry.strip()}
if missing:
    sys.exit("debian/control, Build-Depends, lacks " + ", ".join(sorted(missing)))
