"""A tournament: several agents in each run, from the same course file.

`settings` and `schedule` say who meets whom, and from which places; `matches` makes runs of that, `keeper` is
the process that does one, `launch` and `runner` do all; `table` ranks.
"""

__all__ = ["command", "keeper", "launch", "matches", "runner", "schedule", "settings", "table"]
