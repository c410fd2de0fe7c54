"""The installed programs that import `agent` or `simulator_stub`, whatever lies in folders of PYTHONPATH."""

from __future__ import annotations

from ciberrato.processes import come_first


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
    come_first()
    from ciberrato.evaluation.cli import main

    return main()
