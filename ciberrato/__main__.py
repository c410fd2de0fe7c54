"""``python -m ciberrato``."""

import sys

from ciberrato.processes import leave_working_folder

if __name__ == "__main__":
    leave_working_folder()
    from ciberrato.front.cli import main

    sys.exit(main())
