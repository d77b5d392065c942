"""Vehicle: parameters, nonlinear maps, power demand and the plant."""

from qpmpc.vehicle.demand import demand_w
from qpmpc.vehicle.load import load_vehicle, vehicle_names
from qpmpc.vehicle.names import DEFAULT_VEHICLE
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Command, Plant, PlantState, StepFlows
from qpmpc.vehicle.toml_text import vehicle_file_text, vehicle_toml

__all__ = [
    "DEFAULT_VEHICLE",
    "Command",
    "Plant",
    "PlantState",
    "StepFlows",
    "Vehicle",
    "demand_w",
    "load_vehicle",
    "vehicle_file_text",
    "vehicle_names",
    "vehicle_toml",
]
