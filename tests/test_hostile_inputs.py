"""Whatever a loader is given, it loads, or says in one line why not.

``make fuzz`` gives them 100,000 inputs in all.
"""

import os

import pytest
from hostile_inputs import LOADERS
from hypothesis import HealthCheck, given, settings

from qpmpc.errors import InputError

EXAMPLES = int(os.environ.get("QPMPC_FUZZ", "600")) // len(LOADERS)
LONGEST = 4000  # characters of a message: eight problems of three sorts, each of bounded length


@pytest.mark.parametrize("name", LOADERS)
def test_a_loader_loads_or_refuses_in_one_line(name, tmp_path):
    loader, outcomes = LOADERS[name], {True: 0, False: 0}

    @settings(
        max_examples=EXAMPLES, deadline=None, database=None, suppress_health_check=list(HealthCheck)
    )
    @given(inputs=loader.inputs)
    def load(inputs):
        line = ""
        try:
            loader.load(tmp_path, inputs)
        except InputError as error:
            line = str(error)  # the command line adds exit code 2, see tests/cli/test_errors.py
            assert line
        assert len(line) < LONGEST
        assert "\n" not in line
        outcomes[not line] += 1

    load()
    print(name, outcomes)
    assert min(outcomes.values()) > EXAMPLES // 100  # neither all good nor all hopeless
