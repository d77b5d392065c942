"""Timing study: the same controller by several solvers, its whole step timed in closed loop."""

import qpmpc

SOLVERS = {
    "C, 50 iterations": {"mh_qp.implementation": "c"},
    "C, 25 iterations": {"mh_qp.implementation": "c", "mh_qp.admm.iterations": 25},
    "OSQP, 50 iterations": {"mh_qp.implementation": "python", "mh_qp.solver": "osqp"},
    "PIQP to 1e-8": {"mh_qp.implementation": "python", "mh_qp.solver": "piqp"},
}
print(f"{'':20} fuel g   step ms: median    p99    max")
for label, settings in SOLVERS.items():
    run = qpmpc.simulate("nycc", settings=settings)
    times = run.summary()["step_time_ms"]
    print(
        f"{label:20} {run.fuel_soc_balanced_g:6.2f} {times['median']:16.3f} "
        f"{times['p99']:6.3f} {times['max']:6.3f}"
    )
