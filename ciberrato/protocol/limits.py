"""Limits of messages' lengths: the most that the real programs read, in bytes (and characters, for Say)."""

from __future__ import annotations

REGISTRATION_LIMIT = 1023
"""Bytes of a datagram that the simulator reads on its main port; the rest is lost."""

ACTIONS_LIMIT = 1023
"""Bytes of a datagram that the simulator reads on a robot's port; the rest is lost."""

VIEW_COMMAND_LIMIT = 63
"""Bytes of a datagram that the simulator reads on a viewer's port; the rest is lost."""

REPLY_LIMIT = 1024
"""Bytes of a Reply, terminator included, that the Python and Java clients read."""

MEASURES_LIMIT = 4096
"""Bytes of a Measures that the Python, Java and C++ clients read."""

MESSAGE_LIMIT = 65507
"""The longest UDP datagram, and the longest message that our links take from a stream."""

SAY_LIMIT = 100
"""Characters of a Say; a longer one is ignored altogether."""

NESTING_LIMIT = 16
"""Elements inside elements; the protocol needs three."""

TOLERANCE_LIMIT = 1023
"""Greatest length of a client's message that is parsed a second time, by tolerant rules, in bytes."""
