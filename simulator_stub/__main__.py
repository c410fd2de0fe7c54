"""Run the simulator: ``python -m simulator_stub``."""

import sys

from simulator_stub.cli import main

if __name__ == "__main__":
    sys.exit(main())
