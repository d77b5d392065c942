"""A generated controller, or the plant, as an S-function of Simulink."""

from qpmpc.codegen.parts.part import Part, controller_part, plant_part
from qpmpc.codegen.simulink.export import export_s_function

__all__ = ["Part", "controller_part", "export_s_function", "plant_part"]
