"""The plant in C is the plant in Python, whatever it is asked."""

from math import inf, nan

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from fmus import Unit

from qpmpc.codegen.fmu.export import export_fmu
from qpmpc.codegen.parts.part import plant_part
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle

SECONDS = 1000
STARTS = ((0.5, 50.0), (0.02, -30.0), (0.99, 128.0))  # SOC and coolant: ordinary, and at all ends
FLOWS = ("fuel_g", "p_eng_w", "p_bat_w", "p_friction_w", "p_missing_w", "power_excess_w")


def asked(vehicle, seed):
    """Commands and roads: mostly ordinary, some beyond engine and battery; held for some time."""
    random = np.random.default_rng(seed)
    most = vehicle.engine.power_max_w
    for _ in range(SECONDS // 5):
        on = bool(random.random() < 0.5)
        power = float(random.uniform(-0.1, 1.2) * most) if random.random() < 0.9 else 0.0
        demand = float(random.normal(2e3, 20e3) * (4.0 if random.random() < 0.05 else 1.0))
        speed = float(random.uniform(0.0, 40.0))
        for _ in range(5):
            yield Command(on, power if on else 0.0), demand, speed


NO_RADIATOR = {"thermal.radiator_w_per_k": 0.0}  # then it boils


@pytest.mark.parametrize(
    ("name", "settings"),
    [("prius-nimh", NO_RADIATOR), ("sonata-hybrid", NO_RADIATOR), ("paper-liion", {})],
)
def test_step_by_step(tmp_path, name, settings):
    """To rounding, which grows where the battery's current is a difference of equal numbers."""
    vehicle = load_vehicle(name).with_settings(settings)
    file = tmp_path / "plant.fmu"
    export_fmu(plant_part(vehicle), file, "2")
    assert validate_fmu(str(file)) == []
    plant, seen = Plant(vehicle), set()
    with Unit(file) as unit:
        for seed, (soc, t_cl_degc) in enumerate(STARTS):
            state = PlantState(soc, t_cl_degc)
            unit.start(soc_init=soc, t_cl_init_degc=t_cl_degc)
            assert unit.get("soc", "t_cl_degc", "engine_on") == [soc, t_cl_degc, False]
            for second, (command, demand_w, speed_mps) in enumerate(asked(vehicle, seed)):
                state, flows = plant.step(state, command, demand_w, speed_mps)
                unit.set(
                    engine_on_command=command.engine_on,
                    p_eng_command_w=command.p_eng_w,
                    demand_w=demand_w,
                    speed_mps=speed_mps,
                )
                unit.step(second)
                found = unit.get("soc", "t_cl_degc", "engine_on", *FLOWS)
                expected = [*map(float, state[:3]), *(getattr(flows, flow) for flow in FLOWS)]
                assert found == pytest.approx(expected, rel=1e-9, abs=1e-9), second
                seen |= {flow for flow in FLOWS if getattr(flows, flow)}
                seen |= {"boiling"} if flows.boiling_w else set()
            unit.fmu.reset()
    assert seen == {*FLOWS, "boiling"}  # every branch had its turn


@pytest.mark.parametrize("value", [nan, inf])
@pytest.mark.parametrize("name", ["demand_w", "speed_mps", "p_eng_command_w"])
def test_a_number_that_is_none_is_refused(tmp_path_factory, name, value):
    file = tmp_path_factory.getbasetemp() / "refuses.fmu"
    if not file.exists():
        export_fmu(plant_part(load_vehicle("prius-nimh")), file, "2")
    with Unit(file) as unit:
        unit.start()
        unit.set(**{name: value})
        with pytest.raises(FMICallException):
            unit.step(0)
        assert unit.logged == ["an input is not a finite number"]
        unit.set(**{name: 0.0})
        unit.step(0)  # nothing of it is left
        assert 0.5 < unit.get("soc")[0] < 0.6
