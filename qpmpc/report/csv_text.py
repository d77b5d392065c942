"""CSV of results, safe to open in a spreadsheet."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO

# Spreadsheets take a cell that begins so for a formula, even in quotes; some also full-width signs.
_BEGINS = ("=", "+", "-", "@", "\N{FULLWIDTH EQUALS SIGN}", "\N{FULLWIDTH PLUS SIGN}")
BEGINS_FORMULA = (*_BEGINS, "\N{FULLWIDTH HYPHEN-MINUS}", "\N{FULLWIDTH COMMERCIAL AT}")


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table as CSV: None is an empty cell, no text becomes a formula.

    Text that a spreadsheet would compute gets an apostrophe before it, as spreadsheets write text
    themselves; numbers stay as they are.

    References
    ----------
    OWASP, "CSV Injection".
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([_inert(cell) for cell in header])
    writer.writerows([_inert(cell) for cell in row] for row in rows)
    return text.getvalue()


def _inert(cell: object) -> object:
    if cell is None:
        return ""
    if not isinstance(cell, str) or not cell.lstrip().startswith(BEGINS_FORMULA):
        return cell
    return cell if _is_number(cell) or cell == "-" else f"'{cell}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
