"""The files of a reproduction: pictures, tables, one HTML page, plain data."""

import json
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from typing import Any

from qpmpc.files import json_text, write_text
from qpmpc.report.html import html_page, preformatted
from qpmpc.report.parameter_rows import parameter_rows
from qpmpc.report.provenance import provenance
from qpmpc.verification.reproduction.checks import checks_of
from qpmpc.verification.reproduction.exhibits import Picture
from qpmpc.verification.reproduction.figure_pictures import (
    alpha_picture,
    cycles_picture,
    fuel_picture,
    horizon_fuel_picture,
    robustness_picture,
)
from qpmpc.verification.reproduction.findings import findings
from qpmpc.verification.reproduction.study import Study
from qpmpc.verification.reproduction.tables import all_tables
from qpmpc.verification.reproduction.trajectory_pictures import (
    all_picture,
    baseline_picture,
    concept_picture,
    horizon_picture,
    thermal_picture,
)

PAGE = "reproduction.html"
DATA = "reproduction.json"


def drawers(study: Study) -> list[Callable[[], Picture]]:
    """Every picture of the report, in its order, still to be drawn."""
    cycles = [cycle.name for cycle in study.extent.cycles]
    return [
        lambda: alpha_picture(study),
        *(lambda name=name: baseline_picture(study, name) for name in cycles),
        lambda: horizon_picture(study),
        lambda: horizon_fuel_picture(study),
        lambda: concept_picture(study),
        lambda: fuel_picture(study),
        *(lambda name=name: all_picture(study, name) for name in cycles),
        *(lambda name=name: thermal_picture(study, name) for name in cycles),
        lambda: robustness_picture(study),
        lambda: cycles_picture(study),
    ]


def study_data(study: Study) -> dict[str, Any]:
    """Figures of a study as plain data, ready for JSON."""
    checks = checks_of(study)
    return {
        "vehicle": study.vehicle.name,
        "t_amb_degc": study.vehicle.thermal.t_amb_degc,
        "runs": list(study.rows.values()),
        "experiments": list(study.experiments.values()),
        "tables": {name: table.records() for name, table in all_tables(study).items()},
        "checks": [vars(check) for check in checks],
        "findings": dict(findings(study, checks)),
    }


def write_report(study: Study, folder: Path) -> Path:
    """Write everything into a folder; returns the page."""
    shown = []
    for draw in drawers(study):
        picture = draw()
        image = picture.write(folder)
        shown.append((picture, b64encode(image).decode()))
    tables = all_tables(study)
    for table in tables.values():
        table.write(folder)
    write_text(folder / DATA, json_text(study_data(study)))
    vehicle = study.vehicle
    found = findings(study, checks_of(study))
    answer = found[0][1]  # in short
    page = html_page(
        "qpmpc.verification.reproduction",
        "reproduction.html.j2",
        title="The paper, reproduced",
        answer=answer,
        study=study,
        vehicle=vehicle,
        findings=[each for each in found if each[1] is not answer],
        tables=tables,
        pictures=shown,
        parameters=[row for section in parameter_rows(vehicle) for row in section],
        settings=preformatted(json.dumps(study.settings.model_dump(), indent=2)),
        provenance=provenance(),
    )
    write_text(folder / PAGE, page)
    return folder / PAGE
