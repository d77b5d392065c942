"""The settings that are varied, each about the default."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Variant:
    """One change of the default `mh-qp`.

    Attributes
    ----------
    group : what is varied
    label : the value
    overrides : dotted settings below `mh_qp.`
    """

    group: str
    label: str
    overrides: dict[str, object] = field(default_factory=dict)


def _one(group: str, key: str, *values: object) -> list[Variant]:
    return [Variant(group, f"{value:g}", {key: value}) for value in values]


def variants() -> tuple[Variant, ...]:
    """Return the default and all its variants."""
    found = [Variant("default", "default")]
    found += _one("iterations K", "admm.iterations", 10, 15, 25, 35, 100, 200, 400)
    found += _one("rho", "admm.rho", 0.01, 0.03, 0.3, 1.0)
    found += _one("over-relaxation", "admm.relaxation", 1.0, 1.4, 1.8)
    found += _one("regularisation", "qp.regularisation", 1e-3, 1e-4, 1e-6)
    found += _one("energy unit, J", "scaling.energy_j", 5e3, 12.5e3, 25e3, 80e3)
    found += _one("coolant unit, K", "scaling.t_cl_k", 0.5, 1.0, 4.0)
    found += _one("power unit, W", "scaling.power_w", 5e3, 20e3)
    found += _one("duration exponent", "scaling.duration_exponent", 0.0, 1.0)
    found += _one("short stages N", "horizon.short_stages", 5, 10, 15, 30)
    found += _one("blocks", "horizon.blocks", 5, 6, 8, 10, 15)
    found += _one("hard demand above, W", "horizon.class_hard_w", 4e3, 6e3, 12e3)
    found.append(Variant("demand classes", "1 (mean)", {"horizon.classes": 1}))
    found += [
        Variant("battery PWA, W + share", f"{w:g} + {s:g}", _battery(w, s))
        for w, s in ((2.0, 0.002), (20.0, 0.005), (40.0, 0.02))
    ]
    found += _one("fuel PWA, g/s", "pwa.fuel_g_per_s", 0.0005, 0.005, 0.02)
    found += _one("alpha PWA", "pwa.alpha", 0.0002, 0.005)
    found.append(Variant("departure", "under way", {"prepared": False}))
    return tuple(found)


def _battery(watts: float, share: float) -> dict[str, object]:
    return {"pwa.battery_w": watts, "pwa.battery_share": share}
