"""Trips driven by the generated controller, recorded byte by byte, to be replayed from C."""

from qpmpc.closed_loop import drive
from qpmpc.codegen.controller import GeneratedController
from qpmpc.codegen.costate_controller import GeneratedCostate
from qpmpc.codegen.generate import Precision
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.trip import Trip

# replay PREPARED: inputs from standard input, outputs to standard output
REPLAY_C = """
#include <stdio.h>
#include <stdlib.h>
#include "mpc.h"
static mpc_state state;
int main(int argc, char **argv)
{
    int departing = atoi(argv[argc - 1]);
    mpc_in in;
    mpc_out out;
    mpc_init(&state);
    while (fread(&in, sizeof in, 1, stdin) == 1) {
        while (departing) {
            departing = (mpc_depart(&state, &in) > 0);
        }
        mpc_step(&state, &in, &out);
        fwrite(&out, sizeof out, 1, stdout);
    }
    return 0;
}
"""


class Recorder:
    """The generated controller drives a trip; what goes in and comes out is kept as bytes."""

    def __init__(
        self, trip: Trip, settings: ControllerSettings, precision: Precision, name: str = "mh-qp"
    ) -> None:
        made = GeneratedCostate if name == "mh-costate" else GeneratedController
        self.controller = made(trip, settings, precision=precision)
        self.inputs, self.outputs = bytearray(), bytearray()
        self.run = drive(trip, self.controller, on_step=self._keep)

    def _keep(self, *_: object) -> None:
        self.inputs += bytes(self.controller._in)
        self.outputs += bytes(self.controller._out)
