"""Embedded: the controller as a C project, its example program built and run on a recorded trip."""

import subprocess
import sys
from pathlib import Path

import qpmpc

project = Path("controller_c")
command = [sys.executable, "-m", "qpmpc", "codegen", project, "--precision", "f64"]
subprocess.run(command, check=True)
subprocess.run(["make", "-s", "-C", project, "example"], check=True)

# what the car's sensors and its navigation system would say, here from a run in Python
run = qpmpc.simulate("nycc", settings={"mh_qp.implementation": "python"})
drove = run.trajectory
seconds = zip(drove.demand_w, drove.speed_mps, drove.soc[:-1], drove.t_cl_degc[:-1], strict=True)
rows = ["demand_w,speed_mps,soc,t_cl_degc", *(",".join(map(repr, map(float, s))) for s in seconds)]
(project / "trip.csv").write_text("\n".join(rows) + "\n")

made = subprocess.run(["./example", "trip.csv"], cwd=project, check=True, capture_output=True)
commands = [line.split(",") for line in made.stdout.decode().splitlines()[1:]]
worst_w = max(abs(float(c[2]) - p) for c, p in zip(commands, drove.p_eng_w, strict=True))
print(f"{len(commands)} s decided in C; engine power differs by at most {1e3 * worst_w:.1f} mW")
