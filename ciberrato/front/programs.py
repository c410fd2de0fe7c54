"""The installed programs.

They import `agent` and `simulator_stub` from where `ciberrato` is, whatever lies in folders of PYTHONPATH;
a signal that comes while they import ends them without a word.
"""

from __future__ import annotations

from ciberrato.processes import come_first
from ciberrato.system.signals import end_at_once


def ciberrato() -> int:
    """Run ``ciberrato``; returns its exit status."""
    end_at_once()
    come_first()
    from ciberrato.front.cli import main

    return main()


def agent() -> int:
    """Run ``ciberrato-agent``; returns its exit status."""
    come_first()
    from agent.cli import main

    return main()


def simulator() -> int:
    """Run ``ciberrato-simulator``; returns its exit status."""
    come_first()
    from simulator_stub.cli import main

    return main()


def evaluate() -> int:
    """Run ``ciberrato-evaluate``; returns its exit status."""
    end_at_once()
    come_first()
    from ciberrato.evaluation.cli import main

    return main()


def viewer() -> int:
    """Run ``ciberrato-viewer``; returns its exit status."""
    end_at_once()
    come_first()
    from ciberrato.viewer.cli import main

    return main()


def lab() -> int:
    """Run ``ciberrato-lab``; returns its exit status."""
    end_at_once()
    come_first()
    from ciberrato.labtool.cli import main

    return main()


def grade() -> int:
    """Run ``ciberrato-grade``; returns its exit status."""
    end_at_once()
    come_first()
    from ciberrato.grading.cli import main

    return main()
