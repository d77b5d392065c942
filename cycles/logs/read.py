"""A file of any format as one `LogColumns`."""

from pathlib import Path

from qpmpc.cycles.logs.columns import ASSUMED, LogColumns, Said
from qpmpc.cycles.logs.gpx import read_gpx
from qpmpc.cycles.logs.mdf import read_mdf
from qpmpc.cycles.logs.plain import is_plain, parse_plain
from qpmpc.cycles.logs.quantities import LogOptions
from qpmpc.cycles.logs.table import is_log, parse_log
from qpmpc.input_text import read_table_text

MEGABYTES_MAX = 64
"""24 h at 25 samples a second."""

GPX, MDF = (".gpx",), (".mf4", ".mdf")
"""Suffixes; all other files are tables."""


def read_log(path: Path, options: LogOptions) -> LogColumns:
    """Read a log or schedule, by its suffix.

    Raises
    ------
    InputError
        One line that names the file, the place and what is allowed.
    """
    if path.suffix.lower() in GPX:
        return read_gpx(path, MEGABYTES_MAX, options)
    if path.suffix.lower() in MDF:
        return read_mdf(path, options)
    text, assumed = read_table_text(path, MEGABYTES_MAX)
    if options.stated() or (is_log(text) and not is_plain(text)):
        log = parse_log(path, text, options)
    else:
        log = parse_plain(path, text)
    return log.also(Said(ASSUMED, assumed)) if assumed else log
