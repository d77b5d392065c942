"""A prefix for all names of a generated project, so that several link into one program.

Everything with external linkage and everything that a public header declares or defines begins with
`mpc_` or `MPC_`, and so do the files. A prefix goes before that: one rule, without a list of names.
"""

import re
from collections.abc import Mapping

from qpmpc.errors import InputError

FORM = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")
# OSQP's own sources are used unmodified: their names do not begin with mpc_.
AS_THEY_COME = ("osqp/src/", "osqp/inc/", "osqp/LICENSE")
# where a name begins: mpc_step, mpc.h, libmpc.so, MPC_SHORT, -DMPC_NATIVE_MINMAX
_NAME = re.compile(r"\b(?=mpc_|mpc\.h\b)|(?<=\blib)(?=mpc\.so\b)")
_MACRO = re.compile(r"(?:\b|(?<=-D))(?=MPC_)")


def checked_prefix(prefix: str) -> str:
    """Return the prefix if it can begin a name in C; an empty one means no prefix.

    Raises
    ------
    InputError
        If it cannot.
    """
    if prefix and not FORM.fullmatch(prefix):
        raise InputError(
            f"prefix {prefix!r} cannot begin a name in C: use a letter, then at most 30 letters, "
            "digits or underscores"
        )
    return prefix


def with_prefix(files: Mapping[str, str], prefix: str) -> dict[str, str]:
    """Return the files of a project, by name, with a prefix before all their names.

    Macros get it in capitals: two prefixes in one program must differ in more than their case.

    Raises
    ------
    InputError
        If the prefix cannot begin a name in C.
    """
    if not checked_prefix(prefix):
        return dict(files)

    def renamed(text: str) -> str:
        return _MACRO.sub(prefix.upper(), _NAME.sub(prefix, text))

    return {
        **{name: text for name, text in files.items() if name.startswith(AS_THEY_COME)},
        **{
            renamed(name): renamed(text)
            for name, text in files.items()
            if not name.startswith(AS_THEY_COME)
        },
    }
