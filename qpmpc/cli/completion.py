"""Names that a shell completes; where none begins so, the shell completes files."""

from collections.abc import Callable, Iterable


def _beginning(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return the function that typer calls with what is typed so far."""

    def complete(incomplete: str) -> list[str]:
        try:
            return [name for name in names() if name.startswith(incomplete)]
        except Exception:  # a prompt is no place for an error, and the command will say it
            return []

    return complete


def _cycles() -> Iterable[str]:
    from qpmpc.cycles.load import CYCLES

    return CYCLES.names()


def _vehicles() -> Iterable[str]:
    from qpmpc.vehicle.names import VEHICLES

    return VEHICLES.names()


def _controllers() -> Iterable[str]:
    from qpmpc.registry import controller_names

    return controller_names()


def _generated() -> Iterable[str]:
    from qpmpc.codegen.method import GENERATED

    return GENERATED


def _studies() -> Iterable[str]:
    from qpmpc.study.load import shipped_studies

    return shipped_studies()


def _checks() -> Iterable[str]:
    from qpmpc.registry import CHECKS

    return CHECKS.names()


def _plants() -> Iterable[str]:
    from qpmpc.registry import PLANTS

    return PLANTS.names()


def _sets() -> Iterable[str]:
    from qpmpc.cycles.trips import SETS

    return SETS


def _settings() -> Iterable[str]:
    from qpmpc.controllers.settings import ControllerSettings
    from qpmpc.problems import leaf_keys
    from qpmpc.vehicle.parameters import Vehicle

    keys = (*leaf_keys(Vehicle), *leaf_keys(ControllerSettings))
    return [f"{key}=" for key in keys if "." in key]


def _log_levels() -> Iterable[str]:
    from qpmpc.cli.logs import LEVELS

    return LEVELS


complete_cycle = _beginning(_cycles)
complete_vehicle = _beginning(_vehicles)
complete_controller = _beginning(_controllers)
complete_generated = _beginning(_generated)
complete_study = _beginning(_studies)
complete_check = _beginning(_checks)
complete_plant = _beginning(_plants)
complete_set = _beginning(_sets)
complete_log_level = _beginning(_log_levels)
complete_setting = _beginning(_settings)


def complete_controllers(incomplete: str) -> list[str]:
    """Complete the last of several names with commas between them."""
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in complete_controller(last)]
