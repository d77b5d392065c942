"""Controller and plant as parts that simulation tools run: variables and C, apart from the tool."""

from qpmpc.codegen.parts.part import Part, controller_part, plant_part

__all__ = ["Part", "controller_part", "plant_part"]
