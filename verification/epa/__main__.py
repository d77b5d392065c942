"""``python -m qpmpc.verification.epa``."""

import sys

from qpmpc.verification.epa.figures import main

if __name__ == "__main__":
    sys.exit(main())
