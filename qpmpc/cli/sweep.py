"""``qpmpc sweep``: all runs of a study."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.completion import complete_study
from qpmpc.cli.options import JsonOption

OUT_HELP = "Keep the results in this folder. [dim]Default: results/NAME[/dim]"


def sweep(
    study: Annotated[
        str,
        typer.Argument(
            metavar="STUDY",
            autocompletion=complete_study,
            help="A shipped study (see [b]qpmpc studies[/b]) or a TOML file.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help=OUT_HELP, show_default=False),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what the folder has; repeat nothing.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Processes of this machine. [dim]Default: one for each processor[/dim]",
            show_default=False,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Use the workers of this Dask scheduler instead, such as tcp://192.0.2.7:8786.",
            show_default=False,
        ),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Make all runs of a study, in many processes, and report on them.

    The results are Parquet files, one row per run; what is finished survives Ctrl-C, kill and a
    power cut, and --resume goes on from there. With the extra [b]plot[/b] a report is written too.

    For example:

      qpmpc sweep weather

      qpmpc sweep my_study.toml --out results/mine --workers 8

      qpmpc sweep my_study.toml --out results/mine --resume
    """
    from qpmpc.cli.console import result_console, study_progress, write_json
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.errors import QpmpcError
    from qpmpc.report.study.table import print_study
    from qpmpc.study.sweep import sweep as run

    check_outputs(json_file, None)
    with study_progress() as progress:
        results = run(
            study, out, resume=resume, workers=workers, scheduler=scheduler, progress=progress
        )
    summary = results.summary()
    write_json(summary, json_file)
    remarks = results.write_report(summary=summary)  # before the table, whose reader may leave
    console = result_console(json_file)
    print_study(console, summary)
    for remark in remarks:
        console.print(remark)
    if summary["counts"]["failed"] and not summary["counts"]["done"]:
        raise QpmpcError(f"every run failed, see error in {results.folder / 'report.html'}")
