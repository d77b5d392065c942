"""``qpmpc benchmark``: accuracy against speed, rivals included."""

from typing import Annotated

import typer

from qpmpc.cli.options import JsonOption, OutOption, VehicleOption

CYCLES = ("nycc", "nedc-truncated")
QUICK = {"generated K=25", "generated K=50", "osqp K=50", "piqp"}


def benchmark(
    vehicle: VehicleOption = "prius-nimh",
    json_file: JsonOption = None,
    out: OutOption = None,
    quick: Annotated[bool, typer.Option("--quick", help="NYCC only, and few candidates.")] = False,
) -> None:
    """Drive whole cycles with several solvers and settings: fuel above DP against time per step.

    With --out: pictures, figures and an HTML report; the recorded QPs (npz), and
    qpmpc_recorded.py, which makes them a test set for qpbenchmark.

    For example:

      qpmpc benchmark --quick

      qpmpc benchmark --out results/benchmark
    """
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs, load_vehicle_and_settings
    from qpmpc.trip import Trip
    from qpmpc.verification.benchmark.benchmark import benchmark as run
    from qpmpc.verification.benchmark.candidates import candidates
    from qpmpc.verification.benchmark.table import benchmark_table

    car, _ = load_vehicle_and_settings(vehicle, None)
    check_outputs(json_file, out)
    trips = [Trip(name, car) for name in (CYCLES[:1] if quick else CYCLES)]
    chosen = candidates()
    if quick:
        chosen = tuple(c for c in chosen if c.label in QUICK)
    with progress_bar(2 * len(trips) + 1) as bar:
        result = run(trips, chosen, bar.next_job)
    write_json(result.as_data(), json_file)
    console = result_console(json_file)
    console.print(benchmark_table(result.rows))
    if out is not None:
        from qpmpc.verification.benchmark.export import write_qps
        from qpmpc.verification.benchmark.problem_set import problem_set
        from qpmpc.verification.benchmark.recorder import record
        from qpmpc.verification.benchmark.report import write_benchmark

        write_benchmark(result, car, out)
        write_qps([record(trip) for trip in trips], problem_set(car), out)
        console.print(f"{out / 'benchmark.html'} written, with pictures, JSON and QPs")
