"""Child processes that run modules of ours, whatever lies in the working folder.

``python -m NAME`` looks into the working folder first, and every Python into the folders of PYTHONPATH: a
user's own ``agent.py`` there would run in place of ours.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""The folder that `ciberrato` and the two processes are imported from: a checkout, or site-packages."""

_RUN = (
    "import os, runpy, sys; root, module = sys.argv[1:3]; del sys.argv[1:3]; "
    "users = {os.path.abspath(one) for one in os.environ.get('PYTHONPATH', '').split(os.pathsep)} - {root}; "
    "sys.path.sort(key=lambda one: one in users); "  # a stable sort: theirs after ours
    "root in sys.path or sys.path.insert(0, root); "
    "runpy.run_module(module, run_name='__main__', alter_sys=True)"
)


def module_command(module: str, *arguments: str) -> list[str]:
    """Return the command line that runs a module of ours in a process of its own.

    Parameters
    ----------
    module : str
        Dotted name, as after ``python -m``.
    *arguments : str

    Returns
    -------
    list of str
        For `subprocess.Popen`. The module comes from where this one does, never from the working folder.
    """
    return [sys.executable, "-P", "-c", _RUN, str(ROOT), module, *arguments]


def leave_working_folder() -> None:
    """Remove the working folder from the import path, unless the program is run from its own checkout.

    For the ``__main__`` of a package that imports `agent` or `simulator_stub`: ``python -m`` has put the
    folder there, and the user may have an ``agent.py`` of their own in it.
    """
    here = Path.cwd()
    if not sys.flags.safe_path and sys.path and sys.path[0] in ("", str(here)) and here.resolve() != ROOT:
        del sys.path[0]


def come_first() -> None:
    """Sort folders of PYTHONPATH behind ours: a user's ``agent.py`` there would be imported as `agent`."""
    users = {os.path.abspath(one) for one in os.environ.get("PYTHONPATH", "").split(os.pathsep)}
    users.discard(str(ROOT))
    sys.path.sort(key=lambda one: os.path.abspath(one) in users)  # a stable sort
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
