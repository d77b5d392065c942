"""The other renderings of the controller, fed with what the closed loops saw."""

from collections.abc import Iterator
from math import nan

from qpmpc.codegen import generated_controller
from qpmpc.codegen.host_library import compiler
from qpmpc.controllers.base import Observation
from qpmpc.preview import Trace
from qpmpc.vehicle import Plant
from qpmpc.verification.verify.check import Check
from qpmpc.verification.verify.context import Context, Loop

F64_W = 1e-3  # after hundreds of steps of warm starts, each from the last
CLAIM = "Fed with the same measurements, generated C commands the same power as Python."


def generated_c(context: Context) -> Iterator[Check]:
    """The generated C of this machine, in double precision, along the closed loops."""
    for loop in context.loops:
        title = f"Generated C, {loop.cycle.name}"
        if compiler() is None:
            yield Check(title, CLAIM, F64_W, nan, "W", "no C compiler here", skipped=True)
            continue
        worst, flips = _compare(loop, context)
        yield Check(
            title, CLAIM, F64_W, worst, "W", f"engine state differs in {flips} of "
            f"{loop.cycle.steps} steps"
        )  # fmt: skip


def _compare(loop: Loop, context: Context) -> tuple[float, int]:
    """Largest difference of the engine power applied, W, and steps with another engine state."""
    tr, vehicle = loop.run.trajectory, loop.run.vehicle
    plant, truth = Plant(vehicle), Trace.of(loop.cycle, vehicle)
    controller = generated_controller(plant, truth, settings=context.settings, precision="f64")
    worst, flips, was_on = 0.0, 0, False
    for k in range(loop.cycle.steps):
        soc, t_cl_degc = float(tr.soc[k]), float(tr.t_cl_degc[k])
        demand, speed = float(tr.demand_w[k]), float(tr.speed_mps[k])
        command = controller.decide(Observation(k, soc, t_cl_degc, was_on, demand, speed)).command
        flips += command.engine_on != bool(tr.engine_on[k])
        worst = max(worst, abs(command.p_eng_w - float(tr.p_eng_w[k])))
        was_on = bool(tr.engine_on[k])
    return worst, flips
