"""Runs the agent as its console script does, but pauses at one place until a line comes on standard input.

    python pausing_agent.py PLACE ARGUMENT...

PLACE is ``import:MODULE`` (before that module is imported) or ``call:MODULE:NAME`` (the first call of it).
"""

import importlib.machinery
import importlib.util
import os
import sys
from pathlib import Path
from typing import Any

sys.path[0] = str(Path(__file__).parents[2])


def pause() -> None:
    os.write(1, b"paused\n")
    os.read(0, 1)


def pause_at_first_call(owner: Any, name: str) -> None:
    original = getattr(owner, name)

    def pausing(*arguments: Any, **options: Any) -> Any:
        setattr(owner, name, original)
        pause()
        return original(*arguments, **options)

    setattr(owner, name, pausing)


def patch(module: Any, path: str) -> None:
    *owners, name = path.split(".")
    for owner in owners:
        module = getattr(module, owner)
    pause_at_first_call(module, name)


class Place:
    """Finds modules like everybody else, but notices the one in question."""

    def __init__(self, kind: str, module: str, name: str = "") -> None:
        self.kind, self.module, self.name = kind, module, name
        if module in sys.modules:
            patch(sys.modules[module], name)
        else:
            sys.meta_path.insert(0, self)  # type: ignore[arg-type]

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        if fullname != self.module:
            return None
        sys.meta_path.remove(self)  # type: ignore[arg-type]
        if self.kind == "import":
            pause()
            return None
        spec = importlib.util.find_spec(fullname)
        assert spec is not None
        assert isinstance(spec.loader, importlib.machinery.SourceFileLoader)
        execute = spec.loader.exec_module

        def execute_and_patch(module: Any) -> None:
            execute(module)
            patch(module, self.name)

        spec.loader.exec_module = execute_and_patch  # type: ignore[method-assign]
        return spec


Place(*sys.argv.pop(1).split(":"))

from agent.cli import main  # noqa: E402

sys.exit(main())
