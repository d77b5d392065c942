"""First steps of commands, before any long work: load, apply overrides, check output paths."""

from pathlib import Path

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.files import check_file, check_folder
from qpmpc.registry import split_settings
from qpmpc.settings import parse_settings
from qpmpc.vehicle import Vehicle, load_vehicle

STDOUT = Path("-")


def load_vehicle_and_settings(
    name_or_file: str, overrides: list[str] | None
) -> tuple[Vehicle, ControllerSettings]:
    """Load a vehicle and apply ``--set KEY=VALUE`` to it and to the controllers' settings.

    Raises
    ------
    InputError
        If the vehicle cannot be loaded, or a key or value is not allowed.
    """
    of_vehicle, settings = split_settings(parse_settings(overrides or []))
    return load_vehicle(name_or_file).with_settings(of_vehicle), settings


def check_outputs(json_file: Path | None, out: Path | None) -> None:
    """Check that results can be written.

    Raises
    ------
    InputError
        See `qpmpc.files`.
    """
    if json_file is not None and json_file != STDOUT:
        check_file(json_file, "--json")
    if out is not None:
        check_folder(out, "--out")
