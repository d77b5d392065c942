"""Own vehicle: a file with what differs from a shipped one. Run it in this folder."""

from pathlib import Path

import qpmpc

van = qpmpc.load_vehicle(Path(__file__).with_name("my_van.toml"))
for vehicle in ("prius-nimh", van):
    run = qpmpc.simulate("hwfet", vehicle=vehicle)
    print(f"{run.vehicle.name}: {run.fuel_soc_balanced_g / run.distance_km:.1f} g/km")
