"""``python -m ciberrato.grading``."""

import sys

from ciberrato.processes import leave_working_folder
from ciberrato.system.signals import end_at_once

if __name__ == "__main__":
    end_at_once()
    leave_working_folder()
    from ciberrato.grading.cli import main

    sys.exit(main())
