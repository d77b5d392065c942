"""``qpmpc benchmark``: accuracy against speed, rivals included."""

from typing import Annotated

import typer

from qpmpc.cli.completion import complete_controllers, complete_cycle
from qpmpc.cli.options import JsonOption, OutOption, SetOption, VehicleOption

CYCLES = ["nycc", "nedc-truncated"]
QUICK = ("generated K=25", "generated K=50", "osqp K=50", "piqp", "hpipm")
QUICK_SAMPLES = 6


def benchmark(
    cycles: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CYCLE...]",
            autocompletion=complete_cycle,
            help="Shipped cycles, trips or files; nycc and nedc-truncated if none is named.",
            show_default=False,
        ),
    ] = None,
    vehicle: VehicleOption = "prius-nimh",
    controllers: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...",
            autocompletion=complete_controllers,
            help="Candidates by their labels, such as hpipm or 'osqp K=50', and controllers; "
            "a wrong name lists all.",
            show_default="all candidates",
        ),
    ] = None,
    set_: SetOption = None,
    json_file: JsonOption = None,
    out: OutOption = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="First cycle only, few candidates and few QPs.")
    ] = False,
) -> None:
    """Drive whole cycles with several solvers and settings: fuel above DP against time per step.

    Then solve QPs sampled from the first cycle with each rival, cold, warm and stopped early, and
    QPs of growing length.

    With --out: pictures, figures and an HTML report; the recorded QPs (npz), and
    qpmpc_recorded.py, which makes them a test set for qpbenchmark.

    For example:

      qpmpc benchmark --quick

      qpmpc benchmark --out results/benchmark

      qpmpc benchmark udds hwfet --controllers "generated K=50,hpipm,daqp,ecms" --json -
    """
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs, load_vehicle_and_settings
    from qpmpc.trip import Trip
    from qpmpc.verification.benchmark.benchmark import SAMPLES, jobs
    from qpmpc.verification.benchmark.benchmark import benchmark as run
    from qpmpc.verification.benchmark.candidates import candidates, chosen_candidates
    from qpmpc.verification.benchmark.table import benchmark_table, solvers_table

    car, settings = load_vehicle_and_settings(vehicle, set_)
    if controllers is not None:
        chosen = chosen_candidates([name.strip() for name in controllers.split(",")])
    else:
        chosen = tuple(c for c in candidates() if not quick or c.label in QUICK)
    check_outputs(json_file, out)
    trips = [Trip(name, car) for name in (cycles or CYCLES)[: 1 if quick else None]]
    with progress_bar(jobs(trips)) as bar:
        sampled = QUICK_SAMPLES if quick else SAMPLES
        result = run(trips, chosen, bar.next_job, settings, sampled)
    write_json(result.as_data(), json_file)
    console = result_console(json_file)
    console.print(benchmark_table(result.rows))
    if result.solvers:
        console.print(solvers_table(result.solvers))
    if result.missing:
        console.print(
            f"missing here: {', '.join(result.missing)}; pip install 'qpmpc-iptm[verification]'"
        )
    if out is not None:
        from qpmpc.verification.benchmark.export import write_qps
        from qpmpc.verification.benchmark.report import write_benchmark
        from qpmpc.verification.problems.problem_set import problem_set
        from qpmpc.verification.problems.recorder import record

        write_benchmark(result, car, out)
        write_qps([record(trip, settings) for trip in trips], problem_set(car, settings), out)
        console.print(f"{out / 'benchmark.html'} written, with pictures, JSON and QPs")
