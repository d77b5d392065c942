"""Functional Mock-up Units: the generated controller, and the plant, for co-simulation."""

from qpmpc.codegen.fmu.export import export_fmu
from qpmpc.codegen.parts.part import Part, controller_part, plant_part

__all__ = ["Part", "controller_part", "export_fmu", "plant_part"]
