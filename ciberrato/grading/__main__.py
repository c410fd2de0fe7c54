"""``python -m ciberrato.grading``."""

import sys

from ciberrato.processes import leave_working_folder

if __name__ == "__main__":
    leave_working_folder()
    from ciberrato.grading.cli import main

    sys.exit(main())
