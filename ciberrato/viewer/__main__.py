"""Run the viewer: ``python -m ciberrato.viewer``."""

import sys

from ciberrato.viewer.cli import main

if __name__ == "__main__":
    sys.exit(main())
