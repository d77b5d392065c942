"""The page that an FMU carries, for tools that show it."""

from html import escape

from qpmpc.codegen.fmu.description import TOOL, About
from qpmpc.codegen.parts.variables import Variable

ROLES = {"tunable": "parameter, tunable"}
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title></head><body>
<h1>{name}</h1>
<p>{description}. Written by {tool}.</p>
<p>Steps are one second long, from the start time on{trip}. Measurements are those at the start of a
second, the command is that of this second: set the controller's inputs, get its outputs (or step
it first), set the plant's inputs, step the plant. Read a second late, it meets another demand.</p>
<table>
<tr><th>variable</th><th>causality</th><th>unit</th><th>least</th><th>greatest</th><th></th></tr>
{rows}
</table>
</body></html>
"""


def documentation(about: About, variables: list[Variable]) -> str:
    """Return documentation/index.html."""
    rows = [
        (
            *(
                variable.name,
                ROLES.get(variable.role, variable.role),
                variable.unit or variable.kind,
            ),
            *("" if limit is None else f"{limit:.6g}" for limit in (variable.low, variable.high)),
            variable.description,
        )
        for variable in variables
    ]
    cells = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    return PAGE.format(
        name=escape(about.name),
        description=escape(about.description),
        tool=escape(TOOL),
        trip="" if about.trip_s is None else f"; the trip ends after {about.trip_s} s",
        rows="\n".join(f"<tr>{row}</tr>" for row in cells),
    )
