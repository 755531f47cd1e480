# SPDX-License-Identifier: BSD-3-Clause
"""Faults with a separate test: the source of their rows in docs/reliability.md."""
import functools
import json
import os
import pathlib


def fault(name, how, must, times=1):
    """Decorates the test of a fault that is injected `times` times; where SITUATION_AWARENESS_FAULTS names a file, a line
    of JSON is added to it with the outcome."""
    def decorate(test):
        @functools.wraps(test)
        def recorded(self):
            passed = False
            try:
                test(self)
                passed = True
            finally:
                path = os.environ.get("SITUATION_AWARENESS_FAULTS")
                if path:
                    with open(path, "a", encoding="utf-8") as file:
                        file.write(json.dumps({"fault": name, "how": how, "must": must, "times": times,
                                               "test": pathlib.Path(test.__code__.co_filename).stem,
                                               "passed": passed}) + "\n")
        return recorded
    return decorate
