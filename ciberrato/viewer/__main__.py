"""Run the viewer: ``python -m ciberrato.viewer``."""

import sys

from ciberrato.system.signals import end_at_once

if __name__ == "__main__":
    end_at_once()
    from ciberrato.viewer.cli import main

    sys.exit(main())
