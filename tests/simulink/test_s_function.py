"""S-functions of controller and plant, in Simulink's order of calls, are `qpmpc simulate`."""

import shutil
from math import nan
from pathlib import Path

import numpy as np
import pytest
from s_functions import Block, MxArray, loaded, number

from qpmpc import simulate
from qpmpc.codegen.costate_controller import GeneratedCostate

TO_CONTROLLER = ("soc", "t_cl_degc", "demand_w", "speed_mps", "engine_on")
TO_PLANT = ("engine_on_command", "p_eng_command_w")
SHOWN = ("soc", "t_cl_degc", "fuel_g", "p_eng_w", "p_bat_w")


class Model:
    """A controller and a plant, connected; Simulink's order follows from their feedthrough."""

    def __init__(self, controller, plant):
        self.controller, self.plant = controller.start(), plant.start()

    def second(self, at_s):
        """One step: outputs, the plant's first, then updates. What was shown and commanded."""
        self.plant.outputs(at_s)
        self.controller.set(**dict(zip(TO_CONTROLLER, self.plant.get(*TO_CONTROLLER), strict=True)))
        self.controller.outputs(at_s)
        self.plant.set(**dict(zip(TO_PLANT, self.controller.get(*TO_PLANT), strict=True)))
        shown = [*self.plant.get(*SHOWN), *self.controller.get("p_eng_command_w", "flags", "rung")]
        for block in (self.plant, self.controller):
            block.update(at_s)
            assert block.error is None
        return shown


# f64: to rounding. f32: the preview's sums round in another order than Python's, and the optimum is
# flat: 37 W of 10 kW here
@pytest.mark.parametrize(("name", "within"), [("qp", 1e-8), ("costate", 0.005)])
def test_two_blocks_are_simulate(blocks, trip, name, within):
    host = "mh-qp" if name == "qp" else GeneratedCostate(trip, precision="f32")
    run = simulate(trip, host).trajectory
    with blocks.make(name) as controller, blocks.plant() as plant:
        model = Model(controller, plant)
        found = np.array([model.second(float(t)) for t in range(trip.steps)])
        assert not controller.stops
        model.second(float(trip.steps))  # arrived: nothing more is commanded or driven
        assert controller.stops
        assert plant.stops
        end = plant.get(*SHOWN)
        assert plant.get("fuel_total_g")[0] == pytest.approx(run.fuel_g.sum(), rel=within)
        assert controller.warning is plant.warning is None
    assert run.fuel_g.sum() > 50.0
    assert not found[:, 6:].any()  # flags, rungs
    found = np.vstack([found[:, :5], end])
    expected = np.column_stack(
        [
            run.soc,
            run.t_cl_degc,
            *(np.concatenate([[0.0], of]) for of in (run.fuel_g, run.p_eng_w, run.p_bat_w)),
        ]
    )
    unit = np.array([1.0, 100.0, 1.0, 1e4, 1e4])  # what `within` is meant of
    assert np.abs((found - expected) / unit).max() < within


@pytest.mark.parametrize("name", ["qp", "costate"])
def test_blocks_side_by_side_are_as_alone(blocks, name):
    """Bit by bit, and the two trips differ; the second departs at another time."""
    initial, seconds = ((0.6, 50.0), (0.52, 30.0)), range(60)
    alone = []
    for i, values in enumerate(initial):
        with blocks.make(name) as controller, blocks.plant(*values) as plant:
            model = Model(controller, plant)
            alone.append([model.second(t + 7.0 * i) for t in seconds])
    assert alone[0] != alone[1]
    with (
        blocks.make(name) as one,
        blocks.plant(*initial[0]) as its_plant,
        blocks.make(name) as other,
        blocks.plant(*initial[1]) as others_plant,
    ):
        models = Model(one, its_plant), Model(other, others_plant)
        both = [[model.second(t + 7.0 * i) for i, model in enumerate(models)] for t in seconds]
        again = [block.start() for block in (one, its_plant)]  # as an enabled subsystem resets
        model = Model(*again)
        assert [model.second(float(t)) for t in seconds] == alone[0]
    assert [list(each) for each in zip(*both, strict=True)] == alone


def test_a_saved_state_does_not_lead_back_to_where_it_was_saved(blocks, tmp_path):
    """As of an operating point that another session restores, where the code lies elsewhere."""
    here = blocks.library("costate")
    there = loaded(Path(shutil.copy(here._name, tmp_path / "elsewhere.so")))
    part, measured = blocks.part("costate"), {"soc": 0.6, "t_cl_degc": 50.0}
    with Block(here, part) as one, Block(there, part) as other:
        for block in (one.start(), other.start()):
            block.set(**measured)
            block.outputs(0.0)
            block.update(0.0)
        (pointers,) = np.nonzero(one.memory() != other.memory())
        own = other.memory()[pointers]
        assert len(pointers) == 2  # to the trip's demand and speed
        other.memory()[:] = one.memory()
        for block in (one, other):
            block.outputs(1.0)
            block.update(1.0)
        assert (other.memory()[pointers] == own).all()
        assert (np.delete(other.memory(), pointers) == np.delete(one.memory(), pointers)).all()


def test_outputs_asked_for_again_follow_the_last_inputs(blocks):
    """As in an algebraic loop, which Simulink solves by trying inputs."""
    with blocks.make("costate") as controller, blocks.plant() as plant:
        model = Model(controller, plant)
        once = [model.second(float(t)) for t in range(40)]
    with blocks.make("costate") as controller, blocks.plant() as plant:
        model, twice = Model(controller, plant), []
        for t in range(40):
            if t:
                controller.set(soc=0.45, demand_w=20e3)
                controller.outputs(float(t))
            twice.append(model.second(float(t)))
    assert once == twice


def test_ports_are_as_declared(blocks):
    """One number each, of the arithmetic's width; only the controller feeds through."""
    for name, real, feedthrough in (("qp", "double", 1), ("costate", "single", 1)):
        with blocks.make(name) as block:
            inputs, outputs = block.about("input"), block.about("output")
            assert block.error is None
            assert block.sample_time_s == 1.0
        assert [of["type"] for of in inputs] == [real] * 4 + ["boolean"]
        assert [of["type"] for of in outputs] == ["boolean", *[real] * 3, "int32", "int32"]
        assert {of["width"] for of in (*inputs, *outputs)} == {1}
        assert {of["feedthrough"] for of in inputs} == {feedthrough}
    with blocks.plant() as block:
        assert {of["feedthrough"] for of in block.about("input")} == {0}
        assert len(block.about("output")) == 12


@pytest.mark.parametrize(
    "parameters",
    [
        (),
        (number(0.6),),
        (number(0.6), number(50.0), number(1.0)),
        (number(1.5), number(50.0)),
        (number(-0.1), number(50.0)),
        (number(nan), number(50.0)),
        (number(0.6), number(500.0)),
        (MxArray(0, 0, 1, 0.6), number(50.0)),
        (MxArray(1, 1, 1, 0.6), number(50.0)),
        (number(0.6), MxArray(1, 0, 2, 50.0)),
        (MxArray(1, 0, 0, 0.0), number(50.0)),
    ],
    ids=["none", "one", "three", "much", "little", "nan", "hot", "single", "complex", "two", "[]"],
)
def test_wrong_parameters_are_refused(blocks, parameters):
    with blocks.make("plant", *parameters) as block:
        assert block.error == (
            "parameters are soc_init of 0 to 1, t_cl_init_degc of -60 to 130 degC: one real number "
            "each, of class double"
        )


def test_a_controller_has_no_parameters(blocks):
    with blocks.make("costate", number(1.0)) as block:
        assert block.error == "this block has no parameters: leave the field empty"


def test_a_block_that_was_not_driven_for_a_while_says_so(blocks):
    """As in a subsystem that is disabled and keeps its states: the trip went on meanwhile."""
    with blocks.make("costate") as controller, blocks.plant() as plant:
        model = Model(controller, plant)
        model.second(3.0)
        plant.outputs(6.0)
        plant.update(6.0)
        assert plant.error == "step at 6 s: this instance is at 4 s"


def test_a_plant_refuses_what_is_no_number(blocks):
    with blocks.plant().start() as plant:
        plant.outputs(0.0)
        plant.set(p_eng_command_w=nan)
        plant.update(0.0)
        assert plant.error == "an input is not a finite number"


def test_a_controller_without_a_measurement_warns(blocks):
    with blocks.make("costate").start() as controller:
        controller.set(soc=nan, t_cl_degc=50.0)
        controller.outputs(0.0)
        assert controller.error is None
        assert controller.warning == (
            "no plan before the trip, because of an input out of range at the start: the rules "
            "drive first"
        )
        assert int(controller.get("flags")[0]) & 1  # a bad measurement
