"""The candidates: generated C and OSQP at fixed iteration counts, rivals, whole controllers."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec

from qpmpc.codegen.c_compiler import compiler
from qpmpc.errors import InputError
from qpmpc.names import unknown
from qpmpc.problems import shown_value
from qpmpc.registry import check_controllers, controller_names
from qpmpc.solvers.names import make_solver, solver_names

ITERATIONS = (10, 15, 25, 30, 50, 100, 200, 400)
RHOS = (0.01, 0.03, 0.3, 1.0)
RIVAL_TOLERANCE = 1e-5
GENERATED = "generated C, fixed K"
CONTROLLERS = "controllers"  # the family of those that drive as they are


@dataclass(frozen=True)
class Candidate:
    """One way to solve the controller's QPs.

    Attributes
    ----------
    label : its name in tables
    family : its group, for colours and legends
    overrides : dotted settings of the controller
    solver : name of the backend, run to `RIVAL_TOLERANCE`; OSQP with the settings' own values if
        None
    controller : name of the controller whose settings are used
    generated : whether it is the generated C controller, the default of `mh-qp`
    whole : whether `controller` drives as it is, whatever it is
    """

    label: str
    family: str
    overrides: dict[str, object] = field(default_factory=dict)
    solver: str | None = None
    controller: str = "mh-qp"
    generated: bool = False
    whole: bool = False


def candidates() -> tuple[Candidate, ...]:
    """Return all candidates that can run with the packages installed here."""
    found = [_generated(k) for k in ITERATIONS] if compiler() is not None else []
    found += [
        Candidate(f"osqp K={k}", "osqp, fixed K", {"mh_qp.admm.iterations": k}) for k in ITERATIONS
    ]
    found += [
        Candidate(f"osqp rho={rho:g}", "osqp, other rho", {"mh_qp.admm.rho": rho}) for rho in RHOS
    ]
    found += [
        Candidate(label, "osqp, other scaling", {"mh_qp.scaling.duration_exponent": exponent})
        for label, exponent in (("osqp plain rates", 0.0), ("osqp energies", 1.0))
    ]
    found.append(Candidate("osqp paper's grid", "paper's grid", controller="mh-qp-paper"))
    found += [_rival(name) for name in solver_names() if name != "osqp" and _installed(name)]
    return tuple(found)


def _generated(k: int) -> Candidate:
    overrides: dict[str, object] = {"mh_qp.admm.iterations": k}
    return Candidate(f"generated K={k}", GENERATED, overrides, generated=True)


def _rival(name: str) -> Candidate:
    return Candidate(name, "rivals", solver=name)


_MODULES = {
    "proxqp": "proxsuite",
    "highs": "highspy",
    "hpipm": "casadi",
    "qpoases": "casadi",
    "piqp-multistage": "piqp",
}


def _installed(name: str) -> bool:
    module = _MODULES.get(name, name)
    if find_spec(module) is None:
        return False
    return module != "casadi" or bool(import_module(module).has_conic(name))


def missing() -> list[str]:
    """Rivals that cannot run here, for lack of their package or of CasADi's plugin."""
    return [name for name in solver_names() if not _installed(name)]


def chosen_candidates(names: Sequence[str]) -> tuple[Candidate, ...]:
    """Return candidates by their labels, and controllers by their names.

    Raises
    ------
    InputError
        If a name is neither, is given twice, or needs a package that is not installed.
    """
    of_label = {candidate.label: candidate for candidate in candidates()}
    found: list[Candidate] = []
    for name in names:
        if name in [each.label for each in found]:
            raise InputError(f"candidate {shown_value(name)} is named twice")
        if name in of_label:
            found.append(of_label[name])
        elif name in controller_names():
            check_controllers([name])
            found.append(Candidate(name, CONTROLLERS, controller=name, whole=True))
        elif name in solver_names():
            make_solver(name)  # says which package it needs
        else:
            raise InputError(unknown("candidate", name, (*of_label, *controller_names())))
    return tuple(found)
