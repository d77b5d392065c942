"""The command `qpmpc`: its subcommands; errors as one line and an exit code."""

import os
import sys
from collections.abc import Sequence
from typing import Annotated, NoReturn

import typer

from qpmpc._version import __version__
from qpmpc.cli.a2l import a2l
from qpmpc.cli.benchmark import benchmark
from qpmpc.cli.codegen import codegen
from qpmpc.cli.compare import compare
from qpmpc.cli.completion import complete_log_level
from qpmpc.cli.convert import convert
from qpmpc.cli.cycles import cycles
from qpmpc.cli.doctor import doctor
from qpmpc.cli.first_run import FIRST_RUN
from qpmpc.cli.fmu import fmu
from qpmpc.cli.logs import QUIET, set_log_level
from qpmpc.cli.pil import pil
from qpmpc.cli.reproduce import reproduce
from qpmpc.cli.simulate import simulate
from qpmpc.cli.simulink import simulink
from qpmpc.cli.studies import report, studies
from qpmpc.cli.sweep import sweep
from qpmpc.cli.trips import trips
from qpmpc.cli.vehicle_from_map import vehicle_from_map
from qpmpc.cli.vehicles import vehicles
from qpmpc.cli.verify import verify
from qpmpc.errors import InputError, QpmpcError
from qpmpc.shown import shown

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
DEBUG_VARIABLE = "QPMPC_DEBUG"
_OF_QPMPC = ("--log-level", "--version")
_LONGEST_WORD = 80  # of another package's message, which repeats what was typed

app = typer.Typer(
    pretty_exceptions_enable=False,
    invoke_without_command=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Multi-horizon MPC, posed as a QP, for the power and heat of hybrid cars.",
    epilog="Exit codes: 0 done, 2 bad input or usage, 1 anything else, 130 interrupted. "
    f"With {DEBUG_VARIABLE}=1 in the environment an error shows its traceback.",
)
app.command()(simulate)
app.command()(compare)
app.command()(benchmark)
app.command()(codegen)
app.command()(pil)
app.command()(fmu)
app.command()(simulink)
app.command()(a2l)
app.command()(reproduce)
app.command()(verify)
app.command()(sweep)
app.command()(studies)
app.command()(report)
app.command()(convert)
app.command()(cycles)
app.command()(trips)
app.command()(vehicles)
app.command()(vehicle_from_map)
app.command()(doctor)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"qpmpc-iptm {__version__}")
        raise typer.Exit()


@app.callback()
def _common(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version.", callback=_version, is_eager=True),
    ] = False,
    log_level: Annotated[
        str,
        typer.Option(
            "--log-level",
            metavar="LEVEL",
            help="Say on stderr what happens: info names files, caches and solvers, debug more; "
            "error leaves out remarks too. Stands before the command.",
            autocompletion=complete_log_level,
        ),
    ] = QUIET,
) -> None:
    """Options of `qpmpc` itself."""
    set_log_level(log_level)
    if context.invoked_subcommand is None:
        typer.echo(FIRST_RUN, nl=False)


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit: 0 done, 2 bad input, 1 anything else, 130 interrupted.

    Parameters
    ----------
    args : without the program's name; those of the process if None
    """
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")
    try:
        code = typer.main.get_command(app).main(
            args=None if args is None else list(args), prog_name="qpmpc", standalone_mode=False
        )
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader, `head` for example, has closed the pipe: no error, but no more output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(DONE)
    except (KeyboardInterrupt, typer.Abort):
        _say("interrupted")
        sys.exit(INTERRUPTED)
    except Exception as error:
        if os.environ.get(DEBUG_VARIABLE):
            raise
        _say(_one_line(error))
        sys.exit(_exit_code(error))
    if code == INTERRUPTED:  # newer versions of typer return it
        _say("interrupted")
    sys.exit(code or DONE)


def _exit_code(error: Exception) -> int:
    # Errors of usage are typer's own or click's, depending on the version: both have exit_code.
    return BAD_INPUT if isinstance(error, InputError) else getattr(error, "exit_code", FAILED)


def _one_line(error: Exception) -> str:
    if isinstance(error, QpmpcError):
        return str(error)
    if hasattr(error, "format_message"):
        command = getattr(getattr(error, "ctx", None), "command_path", "qpmpc")
        text = _folded(error.format_message().strip().rstrip("."))
        if getattr(error, "option_name", "") in _OF_QPMPC:
            text += ": it stands before the command"
        return f"{text} (see {command} --help)"
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return f"{type(error).__name__}: {_folded(str(error))} ({DEBUG_VARIABLE}=1 shows where)"


def _folded(text: str) -> str:
    """Return the message of another package on one line, long words cut."""
    words = text.split()
    return " ".join(w if len(w) <= _LONGEST_WORD else f"{w[: _LONGEST_WORD - 3]}..." for w in words)


def _say(text: str) -> None:
    print(f"qpmpc: {shown(text)}", file=sys.stderr)
