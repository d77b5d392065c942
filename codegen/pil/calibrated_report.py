"""Table and files of a trip in which numbers were changed while it ran."""

from pathlib import Path

from qpmpc.codegen.a2l.quantities import UNITS
from qpmpc.codegen.calibration import DESCRIBED
from qpmpc.codegen.pil.calibrated import A2L, CalibratedRun, Changed
from qpmpc.controllers.monitor import Flag
from qpmpc.files import write_text
from qpmpc.report.trajectory_csv import trajectory_csv

HEADER = ("second", "number", "address", "before", "written", "became", "another command from")


def calibrated_rows(found: CalibratedRun) -> list[list[str]]:
    """Return a row for each change, as of `HEADER`."""
    return [_row(change) for change in found.changes]


def calibrated_line(found: CalibratedRun) -> str:
    """Return the fuel of both trips, and for how long numbers were refused."""
    flagged = sum(bool(flags & Flag.BAD_CALIBRATION) for flags in found.flags)
    fuel = [run.fuel_soc_balanced_g for run in (found.plain, found.run)]
    return (
        f"{found.run.cycle}: {flagged} s flagged bad calibration; fuel, SOC-balanced: "
        f"{fuel[0]:.3f} g as it is, {fuel[1]:.3f} g calibrated"
    )


def _row(changed: Changed) -> list[str]:
    change = changed.change
    unit = UNITS[DESCRIBED[change.name][0]]

    def shown(number: float) -> str:
        return f"{number * unit.factor:g} {unit.shown}"

    became = f"refused, {changed.wrong_entry} wrong" if changed.refused else "in use"
    since = "never" if changed.differs_from is None else f"{changed.differs_from} s"
    return [
        f"{change.second} s",
        change.name,
        f"0x{changed.address:08X}",
        shown(changed.before),
        shown(change.number),
        became,
        since,
    ]


def write_calibrated(found: CalibratedRun, folder: Path) -> None:
    """Write the A2L file, and both trips second by second, as CSV."""
    write_text(folder / A2L, found.a2l)
    for name, run in (("as_it_is", found.plain), ("calibrated", found.run)):
        write_text(folder / f"{name}.csv", trajectory_csv(run))
