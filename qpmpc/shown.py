"""Text of files and arguments, as terminals and pages show it."""

from unicodedata import category


def two_digits(value: float) -> str:
    """Return a number of which two digits matter: 670, 0.042."""
    return f"{float(f'{value:.2g}'):g}"


def shown(text: str) -> str:
    r"""Return a text on one line and without effect on a terminal or a page.

    Control characters, line ends, marks that turn the direction of writing and everything else
    that is not printed are escaped as in Python's string literals, for example ``\x1b``.
    """
    if is_plain(text):
        return text
    return "".join(c if is_plain(c) else c.encode("unicode_escape").decode() for c in text)


def is_plain(text: str) -> bool:
    """Whether a text has nothing that `shown` escapes."""
    # Python prints no space but the usual one; the others, of all widths, do no harm
    return text.isprintable() or all(c.isprintable() or category(c) == "Zs" for c in text)
