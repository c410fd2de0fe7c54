"""The program ciberrato: the others as its subcommands, and a demonstration of the whole."""

from __future__ import annotations

__all__ = ["cli", "demo"]
