"""Generator: the C project of one controller, from templates and the runtime's own files."""

from collections.abc import Callable
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined
from numpy.typing import NDArray

from qpmpc._version import __version__
from qpmpc.codegen.calibration import OF_SAFETY
from qpmpc.codegen.examples import example_files
from qpmpc.codegen.osqp_source import CONSTANT_ARRAYS, PREFIX, osqp_files, osqp_version
from qpmpc.codegen.prefix import checked_prefix, with_prefix
from qpmpc.codegen.rows.costate_c import costate_files
from qpmpc.codegen.rows.solver_c import rows_files
from qpmpc.codegen.rows.stage_c import places_of
from qpmpc.codegen.values import Values
from qpmpc.errors import InputError
from qpmpc.files import check_folder, write_texts
from qpmpc.names import unknown

Precision = Literal["f32", "f64"]
Target = Literal["host", "cortex-m7"]
Algorithm = Literal["admm", "osqp", "costate"]
PRECISIONS: tuple[Precision, ...] = ("f32", "f64")
TARGETS: tuple[Target, ...] = ("host", "cortex-m7")
ALGORITHMS: tuple[Algorithm, ...] = ("admm", "osqp")  # of a QP; without one there is no choice
# Flash and RAM of the firmware: larger firmware does not link. For the algorithm written for this
# problem the project's budget; OSQP takes more, see docs/embedded.md.
MEMORY_KB: dict[tuple[Algorithm, Precision], tuple[int, int]] = {
    ("admm", "f32"): (128, 96),
    ("admm", "f64"): (128, 160),
    ("osqp", "f32"): (512, 384),
    ("osqp", "f64"): (512, 768),
    ("costate", "f32"): (64, 64),
    ("costate", "f64"): (64, 112),
}
OF_BUDGET = "The sizes are the controller's budget: a build that\n * does not fit fails to link."

# Files of the runtime that one method alone has; those of costates by their beginnings.
OF_ADMM = {"mpc_admm.c", "mpc_admm.h"}
OF_COSTATE = ("mpc_costate", "mpc_elementary")
OF_STARTS = {"mpc_battery_run.c", "mpc_last_run.c", "mpc_short_run.c"}  # if one costs anything
OF_QP = {"mpc_qp.c", "mpc_qp_method.c", "mpc_polish.c"}

Name = TypeVar("Name", bound=str)

VALUES_A_LINE = 6
_STRETCH = {
    0.0: "REAL(1.0)",
    0.5: "(REAL(1.0) / REAL_SQRT(duration_s))",
    1.0: "(REAL(1.0) / (duration_s))",
}


def generate(
    values: Values,
    folder: Path,
    target: Target = "host",
    precision: Precision = "f32",
    algorithm: Algorithm = "admm",
    prefix: str = "",
) -> list[Path]:
    """Write the C project of a controller; same input, same bytes.

    Parameters
    ----------
    values : numbers of the controller, see `values_of`
    folder : of the project; files of the same names are replaced, others left alone
    target : `host` (shared library) or `cortex-m7` (bare metal, for QEMU's mps2-an500)
    precision : of all arithmetic
    algorithm : `admm`, written for this problem, or `osqp`, OSQP's own embedded code; of no
        effect without a QP
    prefix : before every name that begins with mpc_, see `with_prefix`

    Returns
    -------
    the files written

    Raises
    ------
    InputError
        If target, precision or algorithm is unknown, the prefix cannot begin a name in C or the
        folder cannot be written to.
    """
    check_folder(folder, "output folder")
    return write_texts(folder, project_files(values, target, precision, algorithm, prefix))


def project_files(
    values: Values,
    target: Target = "host",
    precision: Precision = "f32",
    algorithm: Algorithm = "admm",
    prefix: str = "",
) -> dict[str, str]:
    """Return the text of every file of the project, by name.

    Raises
    ------
    InputError
        If target, precision or algorithm is unknown or the prefix cannot begin a name in C.
    """
    one_of(target, TARGETS, "target")
    one_of(precision, PRECISIONS, "precision")
    algorithm = algorithm_of(values, algorithm)
    checked_prefix(prefix)
    files = _runtime(values, algorithm)
    of_osqp = osqp_files(values, precision) if algorithm == "osqp" else {}
    if target == "cortex-m7":
        files |= texts_of("cortex_m7")
    context = _context(values, target, precision, algorithm)
    templates = {
        "mpc_calibration.h": "mpc_calibration.h.j2",
        "mpc_calibration_orders.h": "mpc_calibration_orders.h.j2",
        "mpc_config.h": "mpc_config.h.j2",
        "mpc_constants.h": "mpc_constants.h.j2",
        "mpc_data.c": "mpc_data.c.j2",
        "mpc_model.h": "mpc_model.h.j2",
        "Makefile": f"Makefile.{target}.j2",
        "README.md": "README.md.j2",
        "NOTICE": "NOTICE.j2",
    }
    if target == "cortex-m7":
        files["cortex_m7.ld"] = linker_script(algorithm, MEMORY_KB[algorithm, precision])
    context["sources"] = sorted(n for n in [*files, "mpc_data.c"] if n.endswith(".c"))
    context["osqp_sources"] = [name for name in of_osqp if name.endswith(".c")]
    for output, template in templates.items():
        files[output] = template_text(template, **context)
    files |= example_files(target)
    return with_prefix(dict(sorted((files | of_osqp).items())), prefix)


def algorithm_of(values: Values, algorithm: Algorithm) -> Algorithm:
    """Return the algorithm of a project: that of the QP, or of costates, which have no choice.

    Raises
    ------
    InputError
        If the QP has no such algorithm.
    """
    return one_of(algorithm, ALGORITHMS, "algorithm") if values.costate is None else "costate"


def _runtime(values: Values, algorithm: Algorithm) -> dict[str, str]:
    """Return the runtime's files of a method, and the headers made for it."""
    left_out = set() if values.learning else {"mpc_learned.c"}
    if not values.has_start:
        left_out |= OF_STARTS
    if algorithm != "admm":
        left_out |= OF_ADMM
    if algorithm == "costate":
        left_out |= OF_QP
    texts = texts_of("runtime") | (texts_of("osqp_adapter") if algorithm == "osqp" else {})
    is_costate = algorithm == "costate"
    files = {
        name: text
        for name, text in texts.items()
        if name not in left_out and (is_costate or not name.startswith(OF_COSTATE))
    }
    places = places_of(values.scalars, values.calibration.names)
    if is_costate:
        return files | costate_files(values.table, places)
    return files | rows_files(values.table, places, algorithm, values.learning)


def one_of(name: str, names: tuple[Name, ...], what: str) -> Name:
    """Return the name if it is one of the names.

    Raises
    ------
    InputError
        If it is not.
    """
    for known in names:
        if name == known:
            return known
    raise InputError(unknown(what, name, names))


@cache
def texts_of(folder: str) -> dict[str, str]:
    """Return the files of a folder of this package, by name; not to be changed."""
    inner = (resources.files("qpmpc.codegen") / folder).iterdir()
    paths = sorted((path for path in inner if path.is_file()), key=lambda path: path.name)
    return {path.name: path.read_text("utf-8") for path in paths}


@cache
def _environment() -> Environment:
    """Return what compiles the templates, each once."""
    return Environment(
        loader=FunctionLoader(lambda name: texts_of("templates")[name]),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=False,
        autoescape=False,
    )


def literal_of(number: float, precision: Precision) -> str:
    """Return a number as a constant in C."""
    return f"{np.float32(number)!s}f" if precision == "f32" else repr(float(number))


def literals(array: NDArray[np.float64], precision: Precision) -> list[str]:
    """Return the numbers of an array as constants in C, some to a line."""
    texts = [literal_of(x, precision) for x in array.tolist()]
    cuts = range(0, len(texts), VALUES_A_LINE)
    return [", ".join(texts[i : i + VALUES_A_LINE]) for i in cuts]


def template_text(name: str, /, **context: Any) -> str:
    """Return a template of this package, filled in."""
    return _environment().get_template(name).render(context)


def linker_script(algorithm: Algorithm, memory_kb: tuple[int, int], remark: str = OF_BUDGET) -> str:
    """Return the memory map of a Cortex-M7: flash and RAM in KB, and what to say of them."""
    arrays = [f"{PREFIX}{name}" for name in CONSTANT_ARRAYS]
    return template_text(
        "cortex_m7.ld.j2",
        algorithm=algorithm,
        memory_kb=memory_kb,
        constant_arrays=arrays,
        remark=remark,
    )


def _count_or(literal: Callable[[float], str], value: float) -> str:
    return str(value) if isinstance(value, int) else literal(value)


def _context(
    values: Values, target: Target, precision: Precision, algorithm: Algorithm
) -> dict[str, Any]:
    def literal(number: float) -> str:
        return literal_of(number, precision)

    scalars = {name: literal(value) for name, value in values.scalars.items()}
    counts = {name: str(count) for name, count in values.counts.items()}
    exponent = values.duration_exponent
    power = f"REAL_POW((duration_s), REAL({-exponent!r}))"
    return {
        "version": __version__,
        "target": target,
        "precision": precision,
        "algorithm": algorithm,
        "osqp_version": osqp_version(),
        "values": values,
        "sizes": values.sizes,
        "constants": [
            (module, [(name, _count_or(literal, value)) for name, value in names.items()])
            for module, names in values.constants.items()
        ],
        "scalars": scalars | counts,
        "counts": counts,
        "calibration": values.calibration,
        "of_safety": OF_SAFETY,
        "literal": literal,
        "arrays": {name: literals(array, precision) for name, array in values.arrays.items()},
        "fuel_stride": 1 << ((values.sizes.fuel_points - 1).bit_length() - 1),
        "stretch": _STRETCH.get(exponent, power),
    }
