"""What is installed on this machine, and what each missing piece disables."""

from qpmpc.cli.health.folders import folders_found
from qpmpc.cli.health.packages import packages_found
from qpmpc.cli.health.piece import Piece
from qpmpc.cli.health.tools import tools_found

__all__ = ["Piece", "folders_found", "packages_found", "tools_found"]
