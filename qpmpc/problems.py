"""All errors in a set of parameters, in one line of bounded length."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from qpmpc.nearest import nearest

SHOWN = 8  # problems of one sort; a file with more is probably the wrong one
NAMES_SHOWN = 5  # of the columns of a file
LONGEST = 60  # characters of a key or value that are shown

# pydantic's messages about Python's types, in the words of a TOML file
_WORDS = {
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be an array",
    "too_short": "must have at least {min_length} entries",
    "too_long": "must have at most {max_length} entries",
    "string_too_long": "must have at most {max_length} characters",
}

_NUMBERS = {"float_type", "int_type"}


def problems_line(
    error: ValidationError, model: type[BaseModel], owner: str, origins: Mapping[str, str]
) -> str:
    """Return which keys are missing, which unknown and which values wrong.

    For example ``my.toml: missing battery.soc_min; unknown chassis.mas_kg (did you mean
    chassis.mass_kg?); trip.eta_eq: must be less than 1 (given: 2)``.

    Parameters
    ----------
    error : of `model`
    owner : the file or thing that the line begins with
    origins : dotted key -> its file; named where that is not the owner
    """
    found = error.errors()
    places = [each["loc"] for each in found]
    missing, unknown, wrong = [], [], []
    for each in found:
        key = _dotted(each["loc"])
        if each["type"] == "missing":
            missing.append(f"[{key}]" if _model_at(model, each["loc"]) else key)
        elif each["type"] == "extra_forbidden":
            unknown.append(key + _origin(key, owner, origins) + _suggestion(model, each["loc"]))
        elif each["type"] != "too_short" or not _has_wrong_entries(each["loc"], places):
            wrong.append(_wrong(each, key, owner, origins))
    parts = []
    if missing:
        parts.append(f"missing {_bounded(missing, ', ')}")
    if unknown:
        parts.append(f"unknown {_bounded(unknown, ', ')}")
    if wrong:
        parts.append(_bounded(wrong, "; "))
    return f"{owner}: {'; '.join(parts)}"


def shown_value(value: object) -> str:
    """Return a value as a TOML file has it, cut where it is long."""
    try:
        return _cut(str(value).lower() if isinstance(value, bool) else repr(value))
    except ValueError:  # Python prints no integer of more than some thousand digits
        return "a number too long to show"
    except RecursionError:
        return "a value nested too deeply to show"


def names_shown(titles: Sequence[str]) -> str:
    """Return the first titles for a message."""
    more = len(titles) - NAMES_SHOWN
    return ", ".join(shown_value(title) for title in titles[:NAMES_SHOWN]) + (
        f" and {more} more" if more > 0 else ""
    )


def _wrong(each: ErrorDetails, key: str, owner: str, origins: Mapping[str, str]) -> str:
    text = each["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    if each["type"] in _WORDS:
        text = _WORDS[each["type"]].format(**each.get("ctx", {}))
    given = each["input"]
    if isinstance(given, str | float | int):
        allowed = re.findall(r"'([^']*)'", each.get("ctx", {}).get("expected", ""))
        near = nearest(given, allowed) if isinstance(given, str) else ""
        if each["type"] in _NUMBERS and isinstance(given, str) and _is_number(given):
            text += " without quotes"
        text += f" (given: {shown_value(given)}{f', did you mean {near!r}?' if near else ''})"
    # A check of several keys together names them in its message: each may be in another file.
    prefix = f"{key}." if key else ""
    named = dict.fromkeys(prefix + word for word in re.findall(r"\w+(?:\.\w+)*", text))
    elsewhere = [f"{n}{_origin(n, owner, origins)}" for n in named if _origin(n, owner, origins)]
    if elsewhere:
        text += f" ({', '.join(elsewhere)})"
    return f"{key}{_origin(key, owner, origins)}: {text}" if key else text


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _has_wrong_entries(loc: tuple[int | str, ...], places: list[tuple[int | str, ...]]) -> bool:
    """Whether an array is short only because pydantic does not count its wrong entries."""
    return any(place[:-1] == loc for place in places)


def _dotted(loc: tuple[int | str, ...]) -> str:
    text = ""
    for part in loc:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += ("." if text else "") + (part if re.fullmatch(r"[\w-]+", part) else repr(part))
    return _cut(text)


def _origin(key: str, owner: str, origins: Mapping[str, str]) -> str:
    file = origins.get(key.partition("[")[0], owner)
    return "" if file == owner else f" in {file}"


def _suggestion(model: type[BaseModel], loc: tuple[int | str, ...]) -> str:
    """Suggest a key: in the same table if one is near, else in another."""
    *parents, last = (str(part) for part in loc)
    here = _model_at(model, tuple(parents)) if parents else model
    if name := nearest(last, here.model_fields if here else ()):
        return f" (did you mean {'.'.join([*parents, name])}?)"
    everywhere = {key.rpartition(".")[2]: key for key in leaf_keys(model)}
    if name := nearest(last, everywhere, cutoff=0.8):
        return f" (did you mean {everywhere[name]}?)"
    return ""


def _model_at(model: type[BaseModel], loc: tuple[int | str, ...]) -> type[BaseModel] | None:
    """Return the table at a place, or None where there is a value or nothing."""
    here: type[BaseModel] | None = model
    for part in loc:
        field = here.model_fields.get(str(part)) if here else None
        kind = field.annotation if field else None
        here = kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None
    return here


def leaf_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Yield the dotted names of all values of a model."""
    for name in model.model_fields:
        inner = _model_at(model, (name,))
        if inner:
            yield from leaf_keys(inner, f"{prefix}{name}.")
        else:
            yield prefix + name


def _bounded(items: list[str], separator: str) -> str:
    more = len(items) - SHOWN
    return separator.join(items[:SHOWN]) + (f" and {more} more" if more > 0 else "")


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
