"""First run: one winter trip, by rules and by predictive control."""

import qpmpc

winter = {"thermal.t_amb_degc": -15}
for controller in ("rule-based", "mh-qp"):
    run = qpmpc.simulate("nycc", controller, settings=winter)
    coldest = run.trajectory.t_cl_degc.min()
    print(f"{controller}: {run.fuel_soc_balanced_g:.1f} g, coolant never below {coldest:.1f} °C")
