"""How much a call computes."""

import time
from collections.abc import Callable


def cpu_seconds(call: Callable[[], object]) -> float:
    """Return the CPU time that a call takes of this process, once.

    Where a machine lends its processors to others, time that they have is counted, too: ask again.
    """
    before = time.process_time()
    call()
    return time.process_time() - before
