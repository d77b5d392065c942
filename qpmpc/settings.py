"""Reading and checking parameters: TOML text, dotted overrides, one-line errors."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from qpmpc.errors import InputError
from qpmpc.names import hint
from qpmpc.nearest import nearest
from qpmpc.problems import leaf_keys, problems_line, shown_value

DEPTH_MAX = 32
"""Tables in tables, and parts of a key: a vehicle has two. The parser takes quadratic time."""

_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
_TOO_MANY_PARTS = re.compile(rf"(?<![\w-])(?:{_PART}\.[ \t]*+){{{DEPTH_MAX}}}")

Model = TypeVar("Model", bound=BaseModel)


def load_toml(text: str, owner: str) -> dict[str, Any]:
    """Parse TOML text; `owner` names it in the error.

    Raises
    ------
    InputError
        If the text is not valid TOML.
    """
    try:
        return _parsed(text)
    # Besides its own error the parser passes on that of numbers with thousands of digits.
    except ValueError as error:
        raise InputError(f"{owner}: not valid TOML: {error}") from error


def _parsed(text: str) -> dict[str, Any]:
    """Parse TOML; a ValueError if it cannot be, or is nested deeper than any parameters are."""
    deep = f"nested deeper than {DEPTH_MAX} tables or arrays"
    if _TOO_MANY_PARTS.search(text):
        raise ValueError(deep)
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ValueError(deep) from None
    inside: list[Any] = [data]
    for _ in range(DEPTH_MAX):
        inside = [
            inner
            for each in inside
            for inner in (each.values() if isinstance(each, dict) else each)
            if isinstance(inner, dict | list)
        ]
    if inside:
        raise ValueError(deep)
    return data


def validated(
    model: type[Model],
    data: dict[str, Any],
    owner: str,
    origins: Mapping[str, str] = MappingProxyType({}),
) -> Model:
    """Build `model` from `data`.

    Parameters
    ----------
    owner : names the data in the error
    origins : dotted key -> its file, for keys that are not the owner's own

    Raises
    ------
    InputError
        One line naming every missing key, unknown key and wrong value.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(problems_line(error, model, owner, origins)) from error


def parse_setting(text: str) -> tuple[str, object]:
    """Split ``key=value``; the value is read as TOML, else kept as a string.

    Raises
    ------
    InputError
        If there is no ``=`` or no key.
    """
    key, separator, value = text.partition("=")
    key, value = key.strip(), value.strip()
    if not separator or not key or not value:
        given = shown_value(text)
        raise InputError(f"--set {given}: expected KEY=VALUE, e.g. thermal.t_amb_degc=-15")
    try:
        data = _parsed(f"value = {value}")
    except ValueError:
        return key, value
    return key, data["value"] if len(data) == 1 else value  # more than one: a value with newlines


def parse_settings(texts: list[str]) -> dict[str, object]:
    """Parse several ``key=value`` texts; a later one overrides an earlier one.

    Raises
    ------
    InputError
        See `parse_setting`.
    """
    return dict(parse_setting(text) for text in texts)


def apply_settings(data: dict[str, Any], settings: dict[str, object], owner: str) -> dict[str, Any]:
    """Return a copy of nested `data` with the dotted keys of `settings` replaced.

    Raises
    ------
    InputError
        If a dotted key does not exist in `data`; the allowed keys at that place are listed.
    """
    result = _copy(data)
    for dotted, value in settings.items():
        *parents, last = dotted.split(".")
        place = result
        for part in parents:
            inner = place.get(part)
            if not isinstance(inner, dict):
                raise _unknown(dotted, part, place, owner)
            place = inner
        if last not in place or isinstance(place[last], dict):
            raise _unknown(dotted, last, place, owner)
        # numpy's numbers and arrays become Python's, which strict models require
        place[last] = value.tolist() if isinstance(value, np.generic | np.ndarray) else value
    return result


def hint_in(key: str, models: Iterable[type[BaseModel]]) -> str:
    """Return ``, did you mean 'thermal.t_amb_degc'?`` for a key of another section, or of none."""
    last = key.rpartition(".")[2]
    known = [name for model in models for name in leaf_keys(model) if "." in name]
    ends = {name.rpartition(".")[2]: name for name in reversed(known)}  # the first of a name wins
    near = nearest(last, ends, cutoff=0.8)
    return f", did you mean {ends[near]!r}?" if near else ":"


def _copy(data: dict[str, Any]) -> dict[str, Any]:
    return {k: _copy(v) if isinstance(v, dict) else v for k, v in data.items()}


def _unknown(dotted: str, part: str, place: dict[str, Any], owner: str) -> InputError:
    key, unknown = shown_value(dotted), shown_value(part)
    return InputError(
        f"{owner}: no parameter {key}{hint(part, place)} {unknown} is not one of "
        f"{', '.join(sorted(place))}"
    )
