"""Programs that show how to call a generated controller, written beside it."""

from importlib import resources

HOST_EXAMPLE, BOARD_EXAMPLE = "example_main.c", "board_example.c"
_OF_TARGET = {"host": HOST_EXAMPLE, "cortex-m7": BOARD_EXAMPLE}


def example_files(target: str) -> dict[str, str]:
    """Return the example program of a target, by name; `make example` builds it."""
    name = _OF_TARGET[target]
    folder = resources.files("qpmpc.codegen") / "example_programs"
    return {name: (folder / name).read_text("utf-8")}


def is_example(name: str) -> bool:
    """Whether a file of a project is such a program, not part of the controller."""
    return name in _OF_TARGET.values()
