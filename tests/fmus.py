"""FMUs opened by FMPy: values by name, steps of one second, what was logged."""

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import fmpy
from fmpy import fmi2, fmi3

GETTERS = {"Real": "Real", "Float64": "Float64", "Integer": "Integer", "Int32": "Int32"}


class Unit:
    """An instance of an FMU.

    Attributes
    ----------
    logged : messages, newest last
    """

    def __init__(self, file: Path, unpacked: str | None = None, **arguments: Any) -> None:
        self.file, self.description = file, fmpy.read_model_description(file)
        self._own = None if unpacked else fmpy.extract(file)
        self._unpacked = unpacked or self._own
        self._variables = {v.name: v for v in self.description.modelVariables}
        self.logged: list[str] = []
        self.is_fmi3 = self.description.fmiVersion == "3.0"
        arguments = {
            "guid": self.description.guid,
            "modelIdentifier": self.description.coSimulation.modelIdentifier,
            "unzipDirectory": self._unpacked,
            "instanceName": "one",
        } | arguments
        if self.is_fmi3:
            self.fmu: Any = fmi3.FMU3Slave(**arguments)
            self._log3 = fmi3.fmi3LogMessageCallback(
                lambda _, status, category, message: self.logged.append(message.decode())
            )
            self.fmu.instantiate(logMessage=self._log3)
        else:
            self.fmu = fmi2.FMU2Slave(**arguments)
            self._log2 = fmi2.fmi2CallbackLoggerTYPE(
                lambda _, instance, status, category, message: self.logged.append(message.decode())
            )
            callbacks = fmi2.fmi2CallbackFunctions()
            callbacks.logger = self._log2
            callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
            callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
            self.fmu.instantiate(callbacks=callbacks)
            self._callbacks = callbacks
        self.logged.clear()

    def __enter__(self) -> "Unit":
        return self

    def __exit__(self, *_: object) -> None:
        self.fmu.freeInstance()
        if self._own:
            shutil.rmtree(self._own, ignore_errors=True)

    def beside(self) -> "Unit":
        """Return another instance, of the same loaded library."""
        return Unit(self.file, self._unpacked, instanceName="another")

    def state(self) -> Any:
        """Return a copy of all that changes."""
        return self.fmu.getFMUState() if self.is_fmi3 else self.fmu.getFMUstate()

    def restore(self, state: Any) -> None:
        """Go back to a copy, which is then freed."""
        if self.is_fmi3:
            self.fmu.setFMUState(state)
            self.fmu.freeFMUState(state)
        else:
            self.fmu.setFMUstate(state)
            self.fmu.freeFMUstate(state)

    def start(self, start_s: float = 0.0, **values: float) -> "Unit":
        """Initialise, with these inputs and parameters."""
        if self.is_fmi3:
            self.set(**values)
            self.fmu.enterInitializationMode(startTime=start_s)
        else:
            self.fmu.setupExperiment(startTime=start_s)
            self.fmu.enterInitializationMode()
            self.set(**values)
        self.fmu.exitInitializationMode()
        return self

    def get(self, *names: str) -> list[float]:
        """Return values by name."""
        return [self._call("get", name)[0] for name in names]

    def set(self, **values: float) -> None:
        """Set values by name."""
        for name, value in values.items():
            self._call("set", name, [value])

    def reference(self, name: str) -> int:
        """Return a value reference."""
        return int(self._variables[name].valueReference)

    def _call(self, what: str, name: str, *values: Any) -> Any:
        variable = self._variables[name]
        method = getattr(self.fmu, f"{what}{GETTERS.get(variable.type, variable.type)}")
        return method([variable.valueReference], *values)

    def outside(self) -> list[str]:
        """Return the variables whose values are not in the ranges that the FMU declares."""
        return [
            name
            for name, variable in self._variables.items()
            if (variable.min is not None and self.get(name)[0] < float(variable.min))
            or (variable.max is not None and self.get(name)[0] > float(variable.max))
        ]

    def step(self, at_s: float, step_s: float = 1.0) -> Any:
        """Advance."""
        return self.fmu.doStep(currentCommunicationPoint=at_s, communicationStepSize=step_s)


def connect(source: Unit, target: Unit, names: Iterable[str]) -> None:
    """Carry values from the outputs of one unit to the inputs of another, of the same names."""
    target.set(**dict(zip(names, source.get(*names), strict=True)))


CONTROLLERS = {"2": "mh-qp", "3": "mh-costate"}  # that the tests export, by version of FMI
TO_CONTROLLER = ("soc", "t_cl_degc", "demand_w", "speed_mps", "engine_on")
TO_PLANT = ("engine_on_command", "p_eng_command_w")
SHOWN = ("soc", "t_cl_degc", "fuel_g", "p_eng_w", "p_bat_w")  # of the plant, in a loop


class Loop:
    """A controller and a plant, initialised.

    Parameters
    ----------
    controller, plant : instances that are new or reset
    asks : whether the master reads outputs before it steps anything
    tuned : parameters of the controller
    initial : parameters of the plant
    """

    def __init__(
        self,
        controller: Unit,
        plant: Unit,
        asks: bool = False,
        tuned: Mapping[str, float] | None = None,
        **initial: float,
    ) -> None:
        self.controller, self.plant, self.asks = controller, plant, asks
        plant.start(**initial)
        measured = dict(zip(TO_CONTROLLER, plant.get(*TO_CONTROLLER), strict=True))
        controller.start(**measured, **(tuned or {}))

    def second(self, at: int) -> list[float]:
        """Drive one second; what the plant shows then, and the controller's command."""
        connect(self.plant, self.controller, TO_CONTROLLER)
        if self.asks:
            connect(self.controller, self.plant, TO_PLANT)
            self.plant.step(at)
            self.controller.step(at)
        else:
            self.controller.step(at)
            connect(self.controller, self.plant, TO_PLANT)
            self.plant.step(at)
        return [*self.plant.get(*SHOWN), *self.controller.get("p_eng_command_w", "flags", "rung")]

    def drive(self, seconds: Iterable[int]) -> list[list[float]]:
        """Drive these seconds; what `second` returns of each."""
        return [self.second(t) for t in seconds]

    def reset(self) -> None:
        """Make both as new, for another loop."""
        for unit in (self.controller, self.plant):
            unit.fmu.reset()
