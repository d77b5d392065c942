"""Vehicle: parameters, nonlinear maps, power demand and the plant."""

from qpmpc.vehicle.demand import demand_w
from qpmpc.vehicle.load import DEFAULT_VEHICLE, load_vehicle, vehicle_names
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Command, Plant, PlantState, StepFlows

__all__ = [
    "DEFAULT_VEHICLE",
    "Command",
    "Plant",
    "PlantState",
    "StepFlows",
    "Vehicle",
    "demand_w",
    "load_vehicle",
    "vehicle_names",
]
