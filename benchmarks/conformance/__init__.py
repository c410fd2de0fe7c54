"""Comparison with recordings of the real simulator: ``python -m benchmarks.conformance --golden DIR --labs
DIR``.

Each check is one module with a function ``rows(golden, labs)`` that yields `Finding`s; `__main__` lists
the modules and prints the table. A check works on any folder of the golden layout, whatever labs, scenarios
and sessions are in it, and says so in a row where there is nothing to compare.
"""

from benchmarks.conformance.finding import Finding

__all__ = ["Finding"]
