"""``python -m qpmpc`` is the command ``qpmpc``."""

from qpmpc.cli import main

main()
