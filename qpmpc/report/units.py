"""Units of parameters, from the ends of their names."""

_UNITS = {
    "n_per_mps2": "N/(m/s)²",
    "n_per_mps": "N/(m/s)",
    "w_per_k_per_mps": "W/(K m/s)",
    "w_per_k": "W/K",
    "w_per_s": "W/s",
    "g_per_s": "g/s",
    "j_per_kg": "J/kg",
    "j_per_k": "J/K",
    "kg_per_l": "kg/L",
    "kj_per_rev_l": "kJ/(rev L)",
    "per_k": "1/K",
    "mps": "m/s",
    "rpm": "1/min",
    "nm": "N m",
    "ohm": "Ω",
    "degc": "°C",
    "ah": "A h",
    "kg": "kg",
    "g": "g",
    "j": "J",
    "k": "K",
    "l": "L",
    "n": "N",
    "s": "s",
    "v": "V",
    "w": "W",
}


def unit_of(name: str) -> str:
    """Return the unit at the end of a parameter's name; empty if there is none."""
    for suffix, unit in _UNITS.items():
        if name.endswith(f"_{suffix}"):
            return unit
    return ""
