"""Exit statuses of the agent beyond 0 and 2."""

WRONG_MAP = 3
"""The belief file is written, but the readings do not fit the lab."""
