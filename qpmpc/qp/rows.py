"""The only table of the QP: variables, quantities, rows and cost.

Everything else is made from it: the values in numpy (`StageQp`), the sparsity pattern, the C code
and OSQP's order of columns (`qpmpc.codegen.rows.stage_c`), and the table in the docs. A row is an
equation in the variables of a stage; `soc_before` is `soc` of the stage before, for the first
stage the state now. Its coefficients are made from numbers of `qp_parameters`, the stage
(`Stages`), the point it is expanded about (`Linearisation`), the pieces of the PWA curves, the
constants below and QUANTITIES.

`start`, its rows and its terms are there only for a vehicle whose engine starts cost something
(`table_of`): where they cost nothing the QP is that without them, entry by entry.

States count from an origin. In numpy that is 0; in C it is the state at the start of the horizon,
because small numbers leave the digits of single precision to the changes within the plan.
"""

import ast
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

from qpmpc.qp.expressions import FormulaError, expression, terms_of
from qpmpc.vehicle.engine_parameters import Engine

SHORTEST_SCALE_S = 1.0  # a masked stage is scaled as one of 1 s
LEAST_FORCED = 1e-6  # share of the seconds without a choice: of a stage that has none
COOL_SHARE = 0.5  # of the SOC reserve, where the thermostat is closed
SOC_KEPT = 1e-3  # from the lower limit: at the limit itself the safety layer starts the engine
MOOT_G_PER_S = 5.0  # a bound on fuel that is never met
SIGMA_FORCED = 0.99  # "engine must be on" as a lower bound on sigma, kept apart from the upper one


class Var(IntEnum):
    """Variables of a stage, in their order in x, in Python and in C."""

    SOC = 0  # at the end of the stage
    T_CL = 1  # degC, at the end of the stage
    P_ENG = 2  # E, mean engine power, W
    ON = 3  # sigma, share of the stage with the engine on
    FUEL = 4  # F, mean fuel rate of a hot engine, g/s
    INTERNAL = 5  # G, mean internal battery power, W
    T_SLACK = 6  # K beyond the coolant limits
    START = 7  # u, starts of the engine in the stage


class Variable(NamedTuple):
    """Scaling of a variable: SI units per solver unit; that of a rate shrinks with duration."""

    unit: str
    is_rate: bool = False


VARIABLES = {
    Var.SOC: Variable("unit_soc"),
    Var.T_CL: Variable("unit_t_k"),
    Var.P_ENG: Variable("unit_power_w", is_rate=True),
    Var.ON: Variable("1.0", is_rate=True),
    Var.FUEL: Variable("unit_fuel_g_per_s", is_rate=True),
    Var.INTERNAL: Variable("unit_power_w", is_rate=True),
    Var.T_SLACK: Variable("unit_t_k"),
    Var.START: Variable("unit_start"),
}

QUANTITIES = """
# power limits of the engine while on; what the battery alone cannot give. Too fast for an engine
# that is off: it must run, at its least power where the battery takes less
room_w = net_w + battery_charge_max_w
fast_room_w = where(must_share > 0.0, max(room_w, engine_min_w), room_w)
most_w = min(engine_max_w, fast_room_w)
missing_w = net_w - battery_discharge_max_w

# fuel above its curve would be heat without power: none where heat has to be had in good time
waste_g_per_s = where(highest_floor_degc > t_min_degc, 0.0, MOOT_G_PER_S)

# SOC limits tightened by the swing inside a block, with a reserve at the end of forecast ones, the
# whole of it where the coolant may limit the engine, less what the road beyond refills; and the
# terminal band, no higher than charging all the way leads to: a limit above that is moot; inside a
# block there is none, or -1 and 2
strongest_w = max(net_w - engine_max_w, -battery_charge_max_w)
spent_soc = running(duration_s * pwa_battery(strongest_w) / battery_energy_j)
reach_soc = start_soc - spent_soc - reach_margin_soc
wanted_soc = soc_reserve * where(about_t_cl_degc > thermostat_open_degc, 1.0, COOL_SHARE)
reserve_soc = where(fall_j > 0.0, max(wanted_soc - refill_j / battery_energy_j, 0.0), 0.0)
limit_soc = max(soc_min + SOC_KEPT + fall_j / battery_energy_j, -1.0) + reserve_soc
top_soc = min(soc_max - rise_j / battery_energy_j, 2.0)
last_low_soc = where(soc_penalty_g > 0.0, limit_soc, terminal_soc_low)
last_high_soc = where(soc_penalty_g > 0.0, top_soc, terminal_soc_high)
soc_low = min(where(is_last > 0.0, last_low_soc, limit_soc) - origin_soc, reach_soc)
soc_high = max(where(is_last > 0.0, last_high_soc, top_soc) - origin_soc, soc_low)

# heat into the coolant, expanded about (T^, F^, E^), T_mean the mean of the stage's ends:
# q = (1 - x) [LHV (alpha F + growth (T_mean - T^)) - E] - UA (T_mean - T_amb) - Q_cabin
share = 1.0 - exhaust_share
alpha = pwa_alpha(about_t_cl_degc)
growth = pwa_alpha_slope(about_t_cl_degc) * about_fuel_g_per_s
ua = ua_w_per_k(speed_mps)
w_per_k = ua - share * lhv_j_per_g * growth
fixed_w = ua * (t_amb_degc - origin_t_cl_degc) - share * lhv_j_per_g * growth * (about_t_cl_degc - origin_t_cl_degc) - cabin_w(about_t_cl_degc)
start_k = about_t_cl_start_degc - origin_t_cl_degc
end_k = about_t_cl_end_degc - origin_t_cl_degc
heat_w = share * (lhv_j_per_g * alpha * about_fuel_g_per_s - about_p_eng_w) + (fixed_w - w_per_k * 0.5 * (start_k + end_k))

# what it makes of the coolant: T = T_end(q^, T^_start) + per_heat (q - q^)
#                                   + per_start (T_before - T^_start)
open_k = thermostat_open_degc - origin_t_cl_degc
over_k, per_heat, per_start = thermostat_step(duration_s, start_k - open_k, heat_w)
per_power = per_heat * share
per_fuel = per_power * lhv_j_per_g * alpha
per_end = 0.5 * per_heat * w_per_k
settled_k = over_k + open_k + per_heat * (fixed_w - heat_w) - per_start * start_k

growing = 0.5 * duration_s * growth
"""  # noqa: E501 - a line of it is a formula


class Entry(NamedTuple):
    """A variable in a row, of the stage itself or of the one before."""

    var: Var
    before: bool

    @property
    def name(self) -> str:
        """Its name in the table and in C."""
        return self.var.name.lower() + ("_before" if self.before else "")


ENTRIES = {entry.name: entry for var in Var for entry in (Entry(var, False), Entry(var, True))}


def _terms(node: ast.expr) -> dict[Entry, ast.expr]:
    return {ENTRIES[name]: factor for name, factor in terms_of(node, ENTRIES).items()}


@dataclass(frozen=True)
class Row:
    """A row of a stage: sum of coefficient * variable, and its bounds.

    Attributes
    ----------
    name : in Python, C and the docs
    text : `terms == bound`, `terms >= bound`, `terms <= bound` or `bound <= terms <= bound`
    pieces : the PWA curve (`fuel`, `battery`) with one row per piece; empty for a single row
    left_out : variables whose terms this vehicle does not have
    """

    name: str
    text: str
    pieces: str = ""
    left_out: frozenset[Var] = frozenset()

    @cached_property
    def _compared(self) -> tuple[ast.expr, ast.expr | None, ast.expr | None]:
        """Terms, lower and upper bound."""
        match expression(self.text):
            case ast.Compare(left, [ast.Eq()], [bound]):
                return left, bound, bound
            case ast.Compare(left, [ast.GtE()], [bound]):
                return left, bound, None
            case ast.Compare(left, [ast.LtE()], [bound]):
                return left, None, bound
            case ast.Compare(low, [ast.LtE(), ast.LtE()], [terms, high]):
                return terms, low, high
        raise FormulaError(f"row {self.name}: no bounds in {self.text!r}")

    @cached_property
    def terms(self) -> dict[Entry, ast.expr]:
        """Coefficient of each variable, in the order written."""
        terms = _terms(self._compared[0])
        return {entry: factor for entry, factor in terms.items() if entry.var not in self.left_out}

    @property
    def low(self) -> ast.expr | None:
        """Lower bound; None without."""
        return self._compared[1]

    @property
    def high(self) -> ast.expr | None:
        """Upper bound; None without."""
        return self._compared[2]

    @property
    def is_equality(self) -> bool:
        """Whether both bounds are the same."""
        return self.low is self.high

    @property
    def before(self) -> Entry | None:
        """The state of the previous stage that it contains."""
        return next((entry for entry in self.terms if entry.before), None)


ROWS = (
    Row(
        "soc",
        "soc - soc_before + duration_s / battery_energy_j * internal"
        " + cranking_j / battery_energy_j * start == 0.0",
    ),
    Row(
        "t_cl",
        "(1.0 + per_end) * t_cl + (per_end - per_start) * t_cl_before"
        " + per_power * p_eng - per_fuel * fuel"
        " - per_power * lhv_j_per_g * start_fuel_g / max(duration_s, SHORTEST_SCALE_S) * start"
        " == settled_k",
    ),
    Row("fuel", "fuel - fuel_slope * p_eng - fuel_intercept * on >= 0.0", "fuel"),
    Row("fuel_most", "fuel - fuel_chord_g_per_j * p_eng - fuel_idle_g_per_s * on <= waste_g_per_s"),
    Row(
        "battery",
        "internal + battery_slope * p_eng"
        " - (free_net_w * battery_slope + battery_intercept - free_internal_off_w) * on"
        " >= free_internal_off_w + (net_w - free_net_w) * battery_slope",
        "battery",
    ),
    Row("p_eng_max", "p_eng - most_w * on <= 0.0"),
    Row("p_eng_min", "p_eng - engine_min_w * on >= max(missing_w - engine_min_w, 0.0)"),
    Row("box_soc", "soc_low <= soc <= soc_high"),
    Row("box_on", "SIGMA_FORCED * must_share <= on <= 1.0"),
    Row("t_cl_min", "t_cl + t_slack >= floor_degc - origin_t_cl_degc"),
    Row("t_cl_max", "t_cl - t_slack <= t_max_degc - origin_t_cl_degc"),
    Row("box_slack", "t_slack >= 0.0"),
    Row("start", "start - rises * on + rises * on_before >= -rises * on_now"),
    Row("box_start", "start >= 0.0"),
)
OF_START = ("start", "box_start")

# Cost of a stage in g: fuel as expanded, at the mean of the stage's ends, slack and starts.
COST = (
    "duration_s * alpha * fuel + growing * t_cl + growing * t_cl_before + slack_g_per_k * t_slack"
    " + start_fuel_g * start"
)


@dataclass(frozen=True)
class Table:
    """The part of the table that a vehicle has.

    Parameters
    ----------
    start_fuel, start_energy : whether a start takes fuel, and energy from the battery

    Attributes
    ----------
    has_start : whether a start costs anything, so that there is a variable for it
    variables : of a stage, in their order in x
    rows : of a stage, in their order in A
    """

    start_fuel: bool = False
    start_energy: bool = False

    @property
    def has_start(self) -> bool:
        """Whether a start costs anything."""
        return self.start_fuel or self.start_energy

    @cached_property
    def variables(self) -> tuple[Var, ...]:
        """Variables of a stage."""
        return tuple(var for var in Var if self.has_start or var is not Var.START)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Rows of a stage."""
        free = frozenset({Var.START})
        out = {"soc": not self.start_energy, "t_cl": not self.start_fuel}
        kept = (row for row in ROWS if self.has_start or row.name not in OF_START)
        return tuple(replace(row, left_out=free) if out.get(row.name) else row for row in kept)

    @property
    def cost(self) -> dict[Entry, ast.expr]:
        """Weight of each variable in the cost of a stage."""
        terms = _terms(expression(COST))
        return {e: w for e, w in terms.items() if self.start_fuel or e.var is not Var.START}

    @property
    def coupling(self) -> list[Var]:
        """Variables that a row of the next stage contains."""
        return [
            var for var in self.variables if any(Entry(var, True) in r.terms for r in self.rows)
        ]

    @property
    def states(self) -> list[Var]:
        """Those that are states: known now, and counted from an origin."""
        return [var for var in self.coupling if not VARIABLES[var].is_rate]


def table_of(engine: Engine) -> Table:
    """Return the table of a vehicle with this engine."""
    return Table(engine.start_fuel_g > 0.0, engine.start_energy_j > 0.0)


class Rows:
    """Positions of a stage's rows in A; counts depend on the PWA curves.

    Parameters
    ----------
    table : of the vehicle
    fuel, battery : pieces of the PWA curves

    Attributes
    ----------
    count : rows of a stage
    """

    def __init__(self, table: Table, fuel: int, battery: int) -> None:
        self.table = table
        self._pieces = {"": 1, "fuel": fuel, "battery": battery}
        self._place: dict[str, slice] = {}
        self.count = 0
        for row in table.rows:
            first, self.count = self.count, self.count + self._pieces[row.pieces]
            self._place[row.name] = slice(first, self.count)

    def __getitem__(self, name: str) -> slice:
        """Rows of that name, within a stage."""
        return self._place[name]

    def first(self, name: str) -> int:
        """Row of that name, or the first of them, within a stage."""
        return int(self._place[name].start)
