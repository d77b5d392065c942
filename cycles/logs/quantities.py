"""Names and units that time, speed, grade and elevation have in logs.

Names are English, German, French and Spanish, without accents, as `qpmpc.delimited` leaves them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from qpmpc.delimited import plain_unit
from qpmpc.errors import InputError
from qpmpc.names import hint
from qpmpc.problems import shown_value


@dataclass(frozen=True)
class Quantity:
    """What may be in a column.

    Attributes
    ----------
    name : of the quantity
    names : of its columns, as `qpmpc.delimited.Column.name`; the first that is there is read
    units : the SI value of one
    implied : that of columns whose name alone says the unit
    """

    name: str
    names: tuple[str, ...]
    units: Mapping[str, float]
    implied: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def option(self) -> str:
        """The option of ``qpmpc convert`` that states its unit."""
        return f"--{self.name}-unit"


TIME = Quantity(
    "time",
    (
        "time", "t", "test_time", "elapsed_time", "timestamp", "cycsecs", "device_time",
        "gps_time", "datetime", "date_time", "unix_time", "epoch",
        "zeit", "messzeit", "zeitstempel", "uhrzeit",
        "temps", "temps_ecoule", "horodatage", "heure",
        "tiempo", "tiempo_transcurrido", "fecha_hora", "fecha_y_hora", "hora",
    ),
    {
        "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "ms": 1e-3, "min": 60.0,
        "sek": 1.0, "sekunden": 1.0, "secondes": 1.0, "seg": 1.0, "segundos": 1.0,
    },
    {"cycsecs": 1.0},
)  # fmt: skip
SPEED = Quantity(
    "speed",
    (
        "speed", "v", "velocity", "vehicle_speed", "target_speed", "speed_obd", "gps_speed",
        "speed_gps", "cycmps", "vehiclespeed", "vehspd", "vehspeed", "veh_spd", "v_veh",
        "geschwindigkeit", "fahrzeuggeschwindigkeit", "fahrgeschwindigkeit", "geschwindigkeit_obd",
        "gps_geschwindigkeit", "geschwindigkeit_gps", "v_fzg", "vfzg",
        "vitesse", "vitesse_vehicule", "vitesse_du_vehicule", "vitesse_obd", "vitesse_gps",
        "velocidad", "velocidad_vehiculo", "velocidad_del_vehiculo", "velocidad_obd",
        "velocidad_gps", "gps_velocidad",
    ),
    {
        "m/s": 1.0, "mps": 1.0, "m/sec": 1.0, "meters/second": 1.0, "meters_per_second": 1.0,
        "km/h": 1 / 3.6, "kmh": 1 / 3.6, "kph": 1 / 3.6, "kmph": 1 / 3.6, "km/hr": 1 / 3.6,
        "mph": 0.44704, "mi/h": 0.44704, "kn": 0.514444, "knots": 0.514444, "kts": 0.514444,
    },
    {"cycmps": 1.0},
)  # fmt: skip
GRADE = Quantity(
    "grade",
    ("grade", "road_grade", "gradient", "slope", "cycgrade", "steigung",
     "fahrbahnsteigung", "strassensteigung", "pente", "pendiente"),
    {"m/m": 1.0, "-": 1.0, "1": 1.0, "%": 1e-2, "percent": 1e-2, "pct": 1e-2},
    {"grade": 1.0, "cycgrade": 1.0},  # ours, and FASTSim's
)  # fmt: skip
ELEVATION = Quantity(
    "elevation",
    (
        "elevation", "altitude", "ele", "alt", "gps_altitude", "altitude_gps", "gps_alt", "alt_gps",
        "gps_elevation", "elevation_gps", "gps_ele", "ele_gps",
        "elevation_smoothed", "elevation_raw", "height", "gps_height",
        "hohe", "hoehe", "meereshohe", "gps_hohe", "gps_hoehe", "hohe_gps", "hoehe_gps",
        "hohe_uber_nn", "hoehe_ueber_nn",
        "altitud", "altitud_gps", "gps_altitud", "elevacion",
    ),
    {"m": 1.0, "meters": 1.0, "ft": 0.3048, "feet": 0.3048},
)  # fmt: skip
QUANTITIES = (TIME, SPEED, GRADE, ELEVATION)


@dataclass(frozen=True)
class LogOptions:
    """What a user states about a log because the file does not.

    Attributes
    ----------
    units : by name of the quantity; those of `Quantity.units`
    speed_column : title of the column or channel of speed
    trip : which of the trips of a file to read
    """

    units: Mapping[str, str] = field(default_factory=dict)
    speed_column: str | None = None
    trip: str | None = None

    def __post_init__(self) -> None:
        plain = {name: plain_unit(unit) for name, unit in self.units.items()}
        for quantity in QUANTITIES:
            unit = plain.get(quantity.name)
            if unit is not None and unit not in quantity.units:
                given = self.units[quantity.name]
                raise InputError(
                    f"{quantity.option} {shown_value(given)}{hint(given, quantity.units)} must be "
                    f"one of {', '.join(quantity.units)}"
                )
        object.__setattr__(self, "units", plain)

    def stated(self) -> bool:
        """Whether anything is stated."""
        return bool(self.units) or self.speed_column is not None or self.trip is not None


NOTHING_STATED = LogOptions()
