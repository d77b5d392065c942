"""Names of vehicles; other packages add theirs by entry points of ``qpmpc.vehicles``."""

from importlib import resources

from qpmpc.names import Names, Shipped

DEFAULT_VEHICLE = "prius-nimh"
_FOLDER = resources.files("qpmpc.vehicle") / "data"


def _shipped() -> dict[str, Shipped]:
    names = sorted(file.name.removesuffix(".toml") for file in _FOLDER.iterdir())
    names.sort(key=lambda name: (name != DEFAULT_VEHICLE, name.startswith("paper-")))
    return {name: Shipped(f"data/{name}.toml") for name in names}


# the target of an added name is the path of a TOML file
VEHICLES = Names("vehicle", _shipped(), also=", or a .toml file")
