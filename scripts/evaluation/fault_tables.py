# SPDX-License-Identifier: BSD-3-Clause
"""The tables of docs/reliability.md in which each cell is a test: each input of each stage that moves a vehicle, or lets
it move, against each fault; and each stage with a state against one wrong stamp. Tests say what a cell has
(test/support/fault_cell.hpp, test/ros/fault_record.py)."""

from report import section, table

# --- what can fail, and how

MESSAGE_FAULTS = ("never came", "stopped", "frozen", "late by 1 s", "2 s ahead", "back by 1 h", "NaN", "inf", "-1",
                  "empty", "wrong frame", "contradicts another input", "killed", "restarted")
FAULTS = {
    "message": MESSAGE_FAULTS,
    # Fields that the kind of message does not have.
    "bare message": tuple(fault for fault in MESSAGE_FAULTS if fault != "empty"),
    "parameters": ("never came", "NaN", "inf", "-1", "empty", "wrong frame", "contradicts another input"),
    "process": ("never came", "stopped", "killed", "restarted"),
}
STAGES = {
    "safety_areas": {"scan": "message", "map": "message", "pose covariance": "bare message", "odometry": "bare message",
                     "TF": "bare message", "parameters": "parameters", "manager": "process", "master": "process"},
    "path_following": {"verdict": "bare message", "TF": "bare message", "parameters": "parameters",
                       "manager": "process", "master": "process"},
    "circumnavigate": {"scan": "message", "map": "message", "odometry": "bare message", "TF": "bare message",
                       "parameters": "parameters", "manager": "process", "master": "process"},
    "scout": {"targets": "message", "grid": "message", "map": "message", "odometry": "bare message",
              "parameters": "parameters", "manager": "process", "master": "process"},
}
SHIFTS_S = (-3600.0, -5.0, -0.2, 0.2, 2.0, 5.0, 3600.0)
STAMPED = {
    "objects": ("scan",),
    "polygons": ("scan",),
    "one map": ("scan",),
    "grid": ("image",),
    "reflector localisation": ("scan", "odometry"),
    "GPS/INS": ("imu", "fix"),
    "objects_bag": ("scan",),
    "polygons_bag": ("scan", "odometry"),
    "splinegons_bag": ("scan", "imu", "fix"),
    "grid_bag": ("image",),
    "record_reflectors": ("scan", "odometry"),
}


def stamp_fault(shift_s):
    """The name of a fault by which the stamp of one message is wrong."""
    return f"stamp {shift_s:+g} s"


def expected_cells():
    """(stage, input, fault) of each cell that there has to be."""
    for stage, inputs in STAGES.items():
        for name, kind in inputs.items():
            yield from ((stage, name, fault) for fault in FAULTS[kind])
    for stage, streams in STAMPED.items():
        for stream in streams:
            yield from ((stage, stream, stamp_fault(shift_s)) for shift_s in SHIFTS_S)


# --- tables


def by_place(cells):
    """{(stage, input, fault): what its tests say}; a cell of several tests passes where all do."""
    places = {}
    for cell in cells:
        places.setdefault((cell["stage"], cell["input"], cell["fault"]), []).append(cell)
    return places


def text_of(tests, is_expected):
    """Of a cell."""
    if not tests:
        return "**no test**" if is_expected else "–"
    does = "; ".join(dict.fromkeys(test["does"] for test in tests))
    return does if all(test["passed"] for test in tests) else f"**not so:** {does}"


def targets(cells):
    """(sentence, figure, met)"""
    places, expected = by_place(cells), list(expected_cells())
    have = sum(place in places for place in expected)
    yield "every cell of the tables of inputs and of stamps has a test", f"{have} of {len(expected)}", \
        have == len(expected)
    passed = sum(all(test["passed"] for test in tests) for tests in places.values())
    yield "every cell's tests pass", f"{passed} of {len(places)}", bool(places) and passed == len(places)


def input_tables(cells):
    """A table a stage: a row a fault, a column an input."""
    places, expected = by_place(cells), set(expected_cells())
    for stage, inputs in STAGES.items():
        faults = [fault for fault in MESSAGE_FAULTS if any(fault in FAULTS[kind] for kind in inputs.values())]
        rows = [(fault, *(text_of(places.get((stage, name, fault)), (stage, name, fault) in expected)
                          for name in inputs)) for fault in faults]
        yield section(f"Inputs of `{stage}`", table(("fault", *inputs), rows))


def stamp_table(cells):
    """A row a stage and its stream, a column a shift of one message's stamp."""
    places = by_place(cells)
    return table(("stage", "stream", *(f"{shift_s:+g} s" for shift_s in SHIFTS_S)),
                 [(stage, stream, *(text_of(places.get((stage, stream, stamp_fault(shift_s))), True)
                                    for shift_s in SHIFTS_S)) for stage, streams in STAMPED.items()
                  for stream in streams])
