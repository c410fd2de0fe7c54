"""Run `python -m examples`."""

from __future__ import annotations

import os
import sys

# Two threads on a matrix product of this size wait for one another; set before numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from examples.cli import main

sys.exit(main())
