#!/usr/bin/env python3
"""Check that includes follow the data path.

    scripts/check_layers.py [ROOT] [PKG]      (exit 1 and one line per breach)

Rule 1  A folder includes only folders to its left in ORDER.
Rule 2  A stage (and sim/) sees another stage only through its value header,
        the one that bears its folder's name: segments/segments.hpp.
        The map kinds (map/objects, map/polygons, ...) see one another the same way.
Rule 3  sim/ and evaluation/ are libraries of their own, of which each needs the core alone: sim/ does not see
        registration/ and pipeline/, evaluation/ not sim/.
Rule 4  A foreign header stays in the folders that own it (FOREIGN).
"""
import pathlib
import re
import sys

STAGES = ["cloud", "scan", "image", "points", "segments", "polylines", "detections", "map", "pose", "path"]
ORDER = ["common", "geometry", "estimation"] + STAGES + ["registration", "pipeline", "sim", "evaluation", "ros"]
VALUES_ONLY = STAGES + ["sim"]
APART = {("sim", "registration"), ("sim", "pipeline"), ("evaluation", "sim")}  # the first may not include the second

FOREIGN = {  # header prefix -> folders that may include it
    r"(ros|rosbag|nodelet|pluginlib|tf2?(_\w+)?|\w+_msgs|std_srvs|dynamic_reconfigure"
    r"|diagnostic_updater|message_filters|image_transport|cv_bridge|xmlrpcpp)/": {"ros"},
    r"pcl(_conversions)?/": {"ros"},
    r"mujoco/": {"sim"},
    r"GeographicLib/": {"map", "pose", "ros"},
    r"(gdal|cpl_|ogr_)": {"map"},
    r"opencv2/": {"image", "detections", "map"},
}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def breaches(root: pathlib.Path, pkg: str):
    """Yield (file, line number, reason) for every include that breaks a rule."""
    for top in (root / "include" / pkg, root / "src"):
        for file in sorted(top.rglob("*.[ch]pp")):
            here = file.relative_to(top).parts[:-1]
            if not here or here[0] not in ORDER:
                yield file, 0, f"'{'/'.join(here)}' is no place on the data path"
                continue
            for number, line in enumerate(file.read_text().splitlines(), 1):
                match = INCLUDE.match(line)
                reason = judge(here, match.group(1), pkg) if match else None
                if reason:
                    yield file, number, reason


def judge(here, header: str, pkg: str):
    """Return why a file in folder `here` may not include `header`, or None."""
    if not header.startswith(pkg + "/"):
        for prefix, owners in FOREIGN.items():
            if re.match(prefix, header) and here[0] not in owners:
                return f"{here[0]}/ may not include <{header}>"
        return None
    *there, name = header.split("/")[1:]
    if not there and re.match(r"[A-Z]\w*\.h$", name):  # generated from msg/ and srv/
        return None if here[0] == "ros" else f"{here[0]}/ may not include <{header}>"
    if not there or there[0] not in ORDER:
        return f"{header} is no place on the data path"
    if ORDER.index(there[0]) > ORDER.index(here[0]) or (here[0], there[0]) in APART:
        return f"{here[0]}/ may not include {there[0]}/"
    is_value = pathlib.Path(name).stem == there[-1]
    if there[0] == here[0]:
        other_kind = here[0] == "map" and there[:2] != list(here[:2]) and len(there) > 1
        return f"{'/'.join(here)} may see {'/'.join(there)} only through its value header" \
            if other_kind and not is_value else None
    if here[0] in VALUES_ONLY and there[0] in STAGES and not is_value:
        return f"{here[0]}/ may see {there[0]}/ only through its value header, not {name}"
    return None


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    pkg = sys.argv[2] if len(sys.argv) > 2 else root.resolve().name
    found = list(breaches(root, pkg))
    for file, number, reason in found:
        print(f"{file}:{number}: {reason}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
