"""Whether the pose filter's loops run in machine code (the extra `fast`); the results are the same.

Nothing is loaded by itself: importing numba takes half a second, and what it has to compile the first time
many. `load` is called where that delays no answer: before a robot registers if the machine code is `at_hand`,
else in a thread after another process has compiled; and before an evaluation.
As a program this module leaves the machine code in numba's cache: compiling takes many seconds, reading it a
tenth of one. ``CIBERRATO_COMPILED`` is ``auto`` (the default: if numba is there), ``on`` or ``off``.
"""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from types import ModuleType

from ciberrato.errors import UsageError
from ciberrato.machine_code import VARIABLE, available, choice

__all__ = ["VARIABLE", "at_hand", "available", "choice", "kernels", "load", "use"]
LOOPS = 13
"""Number of compiled functions."""

_active: ModuleType | None = None


def at_hand() -> bool:
    """Return whether `load` takes at most half a second: all is in numba's cache beside the source."""
    if choice() == "off" or not available():
        return False
    source = Path(__file__).with_name("kernels.py")
    made = source.stat().st_mtime
    indexes = (source.parent / "__pycache__").glob("kernels.*.nbi")
    return sum(index.stat().st_mtime >= made for index in indexes) >= LOOPS  # others are of older sources


def kernels() -> ModuleType | None:
    """Return the compiled loops if they are loaded and in use."""
    return _active


def use(module: ModuleType | None) -> None:
    """Use these loops from now on, or, with None, those of numpy."""
    global _active
    _active = module


def load() -> bool:
    """Load the compiled loops, unless they are not wanted or not there.

    Returns
    -------
    bool
        Whether they are in use now.
    """
    if choice() == "off":
        return False
    if _active is None:
        if not available():
            return False
        from ciberrato.localization.belief import warm_up as warming

        try:
            from ciberrato.localization.belief import kernels

            try:
                warming.call_all(kernels)
            except Exception:  # a file of numba's cache is not what numba wrote there
                _forget_cache(kernels)
                warming.call_all(kernels)
        except Exception as error:  # a numba that does not fit, no place for its cache, no memory
            if choice() == "on":
                raise UsageError(f"{VARIABLE}=on: {error}") from None
            return False
        use(kernels)
    return True


def _forget_cache(module: ModuleType) -> None:
    """Remove what numba keeps of a module and of those that it calls: it is compiled again."""
    from ciberrato.infrared import cone_compiled

    for one in (module, cone_compiled):
        for loop in vars(one).values():
            folder = getattr(getattr(loop, "stats", None), "cache_path", None)
            if folder is not None:
                for path in Path(folder).glob(f"{Path(str(one.__file__)).stem}.*.nb[ic]"):
                    with contextlib.suppress(OSError):
                        path.unlink()


if __name__ == "__main__":
    from ciberrato.system.process import lower_priority

    lower_priority()  # the loop that waits for this comes first
    sys.exit(0 if load() else 1)
