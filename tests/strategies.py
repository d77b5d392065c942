"""What differs between vehicles, drawn at random: shared by the tests of their files."""

from hypothesis import strategies as st

NUMBERS = {
    "chassis.mass_kg": st.floats(500.0, 10_000.0) | st.integers(500, 10_000),
    "chassis.road_load_b_n_per_mps": st.floats(0.0, 500.0),
    "chassis.eta_regen": st.floats(0.0, 1.0),
    "engine.density_kg_per_l": st.floats(1e-5, 2.0),
    "engine.start_fuel_g": st.floats(0.0, 5.0),
    "engine.start_energy_j": st.floats(0.0, 4_000.0),
    "engine.min_on_s": st.integers(0, 600),
    "engine.min_off_s": st.integers(0, 600),
    "engine.ramp_w_per_s": st.floats(1.0, 1e6),
    "engine.electric_max_mps": st.floats(0.0, 70.0),
    "cold_engine.k": st.floats(0.0, 1.0),
    "thermal.t_amb_degc": st.floats(-50.0, 50.0) | st.integers(-50, 50),
    "thermal.cabin_heat_w": st.floats(0.0, 1e4),
    "battery.aux_power_w": st.floats(0.0, 1e4),
    "trip.soc_init": st.floats(0.4, 0.8),
    "trip.soc_end": st.floats(0.4, 0.8),
    "trip.soc_end_at_least": st.booleans(),
    "trip.t_cl_init_degc": st.floats(-50.0, 150.0),
}
NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", fullmatch=True)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)


@st.composite
def batteries(draw: st.DrawFn) -> dict[str, object]:
    """The arrays of a battery, which change together."""
    between = draw(st.lists(st.integers(100, 9900), max_size=40, unique=True))
    grid = [0.0, *(k / 10_000 for k in sorted(between)), 1.0]
    voltage = st.lists(st.floats(200.0, 400.0), min_size=len(grid), max_size=len(grid))
    resistance = st.lists(st.floats(0.01, 0.15), min_size=len(grid), max_size=len(grid))
    return {
        "battery.soc_grid": tuple(grid),
        "battery.open_circuit_v": tuple(draw(voltage)),
        "battery.resistance_discharge_ohm": tuple(draw(resistance)),
        "battery.resistance_charge_ohm": tuple(draw(resistance)),
    }


@st.composite
def differences(draw: st.DrawFn) -> dict[str, object]:
    """Dotted settings that make another vehicle of a shipped one, with a name of its own."""
    changes: dict[str, object] = {"name": draw(NAMES)}
    if draw(st.booleans()):
        changes["description"] = draw(TEXTS)
    changes |= draw(st.fixed_dictionaries({}, optional=NUMBERS))
    if draw(st.booleans()):
        changes |= draw(batteries())
    return changes


def toml_of(changes: dict[str, object]) -> str:
    """A file of these settings, written without the code under test."""
    lines = []
    for key, value in changes.items():
        text = str(list(value)) if isinstance(value, tuple) else repr(value)
        text = text.lower() if isinstance(value, bool) else text
        if isinstance(value, str):
            escaped = (c if c.isalnum() else f"\\U{ord(c):08X}" for c in value)
            text = f'"{"".join(escaped)}"'
        lines.append(f"{key} = {text}")
    return "\n".join(lines) + "\n"
