"""``qpmpc studies``: the shipped studies; ``qpmpc report``: of one study's results, or of two."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.completion import complete_study
from qpmpc.cli.options import JsonOption, OutOption


def studies(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            autocompletion=complete_study,
            help="Print the file of this one.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """List the shipped studies, or print the file of one: to read, or to start your own from.

    For example:

      qpmpc studies

      qpmpc studies weather
    """
    from qpmpc.cli.console import result_console
    from qpmpc.errors import InputError
    from qpmpc.names import unknown
    from qpmpc.report.table import print_texts
    from qpmpc.study.load import load_study, shipped_studies, shipped_text

    if name is not None:
        if name not in shipped_studies():
            raise InputError(unknown("study", name, shipped_studies()))
        typer.echo(shipped_text(name), nl=False)
        return
    found = [load_study(each) for each in shipped_studies()]
    rows = [(each.name, f"{each.count:,}", " ".join(each.description.split())) for each in found]
    print_texts(result_console(), ("study", "runs", "what it asks"), rows)


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Results of a study.", show_default=False)
    ],
    other: Annotated[
        Path | None,
        typer.Argument(
            metavar="[DIR2]", help="Results of another, to compare with.", show_default=False
        ),
    ] = None,
    json_file: JsonOption = None,
    out: OutOption = None,
) -> None:
    """Report on the results of a study, finished or not, or compare those of two.

    Runs of two studies are compared pair by pair: the same trip, weather, controller and forecast.

    For example:

      qpmpc report results/weather

      qpmpc report results/before results/after --out results/compared
    """
    from qpmpc.cli.console import result_console, write_json
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.errors import InputError
    from qpmpc.report.study.pairs import compare_studies
    from qpmpc.report.study.table import print_comparison, print_study
    from qpmpc.report.study.write import write_study_comparison
    from qpmpc.study.results import StudyResults

    check_outputs(json_file, out)
    first = StudyResults(folder)
    console = result_console(json_file)
    if other is None:
        summary = first.summary()
        write_json(summary, json_file)
        remarks = first.write_report(out, summary)  # before the table, whose reader may leave
        print_study(console, summary)
    else:
        if out is None:
            raise InputError("--out is needed for the comparison: name a folder")
        second = StudyResults(other)
        sides = (first.frame(), first, second.frame(), second)
        comparison = compare_studies(*sides)
        write_json(comparison, json_file)
        remarks = write_study_comparison(*sides, out)
        print_comparison(console, comparison)
    for remark in remarks:
        console.print(remark)
