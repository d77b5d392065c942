"""Refuse to run beside the other distribution that installs a package named qpmpc."""

from importlib.metadata import PackageNotFoundError, distribution


def refuse_other_qpmpc() -> None:
    """Raise if the unrelated PyPI distribution ``qpmpc`` is installed too.

    Both distributions write into the same folder ``qpmpc``, so the one installed second has
    overwritten files of the first and neither can be trusted.

    Raises
    ------
    ImportError
        One line that says what to uninstall.
    """
    try:
        version = distribution("qpmpc").version
    except PackageNotFoundError:
        return
    raise ImportError(
        f"the unrelated distribution qpmpc {version} is installed beside qpmpc-iptm and both use "
        "the import name qpmpc: run 'pip uninstall qpmpc qpmpc-iptm', then install qpmpc-iptm again"
    )
