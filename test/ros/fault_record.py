# SPDX-License-Identifier: BSD-3-Clause
"""What tests say of the faults that they inject, for docs/reliability.md. Where SITUATION_AWARENESS_FAULTS names a file,
each adds a line of JSON to it with the outcome. In C++: support/fault_cell.hpp."""
import contextlib
import functools
import inspect
import json
import os
import pathlib


@contextlib.contextmanager
def recorded(**line):
    """Adds the line, with whether what stands in the scope passes."""
    passed = False
    try:
        yield
        passed = True
    finally:
        path = os.environ.get("SITUATION_AWARENESS_FAULTS")
        if path:
            with open(path, "a", encoding="utf-8") as file:
                file.write(json.dumps({**line, "passed": passed}) + "\n")


def fault(name, how, must, times=1):
    """Decorates the test of a fault that is injected `times` times: a row of the table of faults with separate tests."""
    def decorate(test):
        @functools.wraps(test)
        def run(self):
            with recorded(fault=name, how=how, must=must, times=times,
                          test=pathlib.Path(test.__code__.co_filename).stem):
                test(self)
        return run
    return decorate


def cell(stage, input_, fault_, does):
    """A cell of a table: what the stage does where the fault is in this input. A context whose body shows it:

        with cell("path_following", "verdict", "stopped", "stands after .3 s"):
    """
    return recorded(stage=stage, input=input_, fault=fault_, does=does,
                    test=pathlib.Path(inspect.stack()[1].filename).stem)
