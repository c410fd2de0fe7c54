"""Run the benchmarks, print a table of ratios, and write build/bench.json."""

from __future__ import annotations

import os
import sys

# One thread: two wait for one another on products this small. Set before numpy is first imported.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

if __name__ == "__main__":
    from benchmarks.table import main

    sys.exit(main())
