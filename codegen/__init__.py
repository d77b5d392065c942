"""The whole controller as C: generator, host library, firmware, processor in the loop."""

from qpmpc.codegen.controller import GeneratedController, generated_controller
from qpmpc.codegen.generate import generate
from qpmpc.codegen.host_library import CodegenError, compiler
from qpmpc.codegen.values import Values, values_of

__all__ = [
    "CodegenError",
    "GeneratedController",
    "Values",
    "compiler",
    "generate",
    "generated_controller",
    "values_of",
]
