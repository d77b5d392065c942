"""``qpmpc verify``: every approximation bounded, every rendering compared."""

from importlib.util import find_spec
from typing import Annotated

import typer

from qpmpc.cli.completion import complete_check
from qpmpc.cli.options import JsonOption, OutOption

NEEDED = ("casadi", "clarabel", "daqp", "numba", "piqp", "qoco")


def verify(
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer cycles and samples: under two minutes.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="GROUP",
            autocompletion=complete_check,
            help="This group of checks alone; repeatable. A wrong name lists all.",
            show_default=False,
        ),
    ] = None,
    json_file: JsonOption = None,
    out: OutOption = None,
) -> None:
    """Check the controller against its equations, and its fuel against a lower bound.

    Each check states its claim, tolerance, measured value and verdict. The exit code is 1 if one
    fails. With --out: an HTML report and the figures as JSON.

    For example:

      qpmpc verify --quick

      qpmpc verify --only qp --only bounds --out results
    """
    from time import perf_counter

    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.errors import InputError
    from qpmpc.files import json_text, write_text
    from qpmpc.registry import CHECKS
    from qpmpc.report.table import ShownTable

    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise InputError(
            f"qpmpc verify needs {', '.join(missing)}: pip install 'qpmpc-iptm[plot,verification]'"
        )
    from qpmpc.verification.checks import (
        Context,
        Results,
        run_checks,
        verification_html,
    )

    check_outputs(json_file, out)
    names = CHECKS.names() if only is None else tuple(dict.fromkeys(only))
    groups = [CHECKS.find(name) for name in names]
    groups = [group for group in groups if group.quick or not quick or only is not None]
    context, results = Context(quick), Results(quick)
    with progress_bar(len(groups)) as bar:
        for group in groups:
            report, found, start = bar.next_job(group.title), [], perf_counter()
            for check in run_checks(group, context):
                found.append(check)
                report(len(found), len(found) + 1)
            results.groups.append((group.title, found))
            results.seconds.append(perf_counter() - start)
    write_json(results.summary(), json_file)
    if out is not None:
        write_text(out / "verify.json", json_text(results.summary()))
        write_text(out / "verify.html", verification_html(results))
    console = result_console(json_file)
    table = ShownTable(box=None)
    for column in ("check", "measured", "tolerance", "unit", "verdict"):
        table.add_column(column, justify="right" if column in ("measured", "tolerance") else "left")
    for check in results.checks:
        sign = ">=" if check.at_least else "<="
        table.add_row(
            check.name,
            f"{check.measured:.3g}",
            f"{sign} {check.tolerance:.3g}",
            check.unit,
            check.verdict,
            style="" if check.passed else "bold red",
        )
    console.print(table)
    for check in results.checks:
        if not check.passed:
            console.print(f"{check.name}: {check.claim} {check.detail}")
    passed = sum(check.passed for check in results.checks)
    console.print(f"{passed} of {len(results.checks)} checks passed")
    if out is not None:
        console.print(f"{out / 'verify.html'}, .json written")
    if not results.passed:
        raise typer.Exit(1)
