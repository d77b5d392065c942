"""Make the API reference from the docstrings: ``make docs`` calls this with the output folder."""

import re
import sys
from pathlib import Path

import pdoc
import pdoc.docstrings
import pdoc.render

MODULES = (
    "qpmpc",
    "qpmpc.closed_loop",
    "qpmpc.results",
    "qpmpc.preview",
    "qpmpc.solvers",
    "qpmpc.qp.cvxpy_twin",
)
# "name : meaning", our one-line form of numpy's entries, which pdoc would take for a type
ENTRY = re.compile(r"^([\w*`., ]+?) : (.+)$", re.MULTILINE)
_numpydoc = pdoc.docstrings.numpy


def numpydoc(text: str) -> str:
    """Convert a docstring, its one-line entries written as numpy's own two."""
    return _numpydoc(ENTRY.sub(r"\1\n    \2", text))


if __name__ == "__main__":
    pdoc.docstrings.numpy = numpydoc
    pdoc.render.configure(docformat="numpy", show_source=False)
    pdoc.pdoc(*MODULES, output_directory=Path(sys.argv[1]))
