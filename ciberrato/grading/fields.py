"""The entries of a TOML table, each with its type; what is wrong is noted, and reading goes on."""

from __future__ import annotations

import math
import shlex
from typing import Any

MOST_NAME = 100
MOST_SEEDS = 10_000
LARGEST_SEED = 2**63 - 1


class Fields:
    """A table that is being read.

    Parameters
    ----------
    table : dict
    place : str
        Name of the place in faults.
    faults : list of str
        List to which each fault is added, a line each.
    """

    def __init__(self, table: dict[str, Any], place: str, faults: list[str]) -> None:
        self._table = table
        self._place = place
        self._faults = faults
        self._seen: set[str] = set()

    @property
    def count(self) -> int:
        """Number of faults noted so far, in all entries."""
        return len(self._faults)

    def fault(self, what: str) -> None:
        """Record a fault."""
        self._faults.append(f"{self._place}: {what}".replace("\n", " "))

    def _take(self, key: str) -> Any:
        self._seen.add(key)
        return self._table.get(key)

    def has(self, key: str) -> bool:
        """Return whether an entry is present."""
        self._seen.add(key)
        return key in self._table

    def end(self) -> None:
        """Record faults for entries that were never read."""
        for key in self._table:
            if key not in self._seen:
                known = ", ".join(sorted(self._seen))
                self.fault(f"unknown entry {key!r}; the entries are: {known}")

    def text(self, key: str, default: Any) -> Any:
        """Read a text."""
        value = self._take(key)
        if value is None:
            return default
        if not isinstance(value, str) or not value or "\0" in value:
            self.fault(f"{key}: a text was expected, not {value!r}")
            return default
        return value

    def texts(self, key: str) -> list[str]:
        """Read a list of texts; empty if it is not there."""
        value = self._take(key)
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
            self.fault(f"{key}: a list of texts was expected, not {value!r}")
            return []
        return value

    def name(self) -> str:
        """Read the name that a table must have; faults name the table by it from then on."""
        value = self.text("name", "")
        if not value:
            if "name" not in self._table:
                self.fault("name: is missing")
            return ""
        if len(value) > MOST_NAME:
            self.fault(f"name: at most {MOST_NAME} characters, not {len(value)}")
        self._place += f" ({value[:MOST_NAME]})"
        return str(value)

    def number(
        self,
        key: str,
        default: float | None,
        *,
        least: float = -math.inf,
        most: float = math.inf,
        whole: bool = False,
    ) -> float | None:
        """Read a number in a range."""
        value = self._take(key)
        if value is None:
            return default
        right = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
        if not right or not math.isfinite(value) or not least <= value <= most:
            kind = "a whole number" if whole else "a number"
            span = f" from {least:g}" * (least > -math.inf) + f" to {most:g}" * (most < math.inf)
            self.fault(f"{key}: {kind}{span} was expected, not {value!r}")
            return default
        return int(value) if whole else float(value)

    def truth(self, key: str) -> bool:
        """Read true or false; false if it is not there."""
        value = self._take(key)
        if value is not None and not isinstance(value, bool):
            self.fault(f"{key}: true or false was expected, not {value!r}")
        return value is True

    def numbers(self, key: str) -> tuple[float, ...] | None:
        """Read a list of numbers; None if it is not there."""
        value = self._take(key)
        if value is None:
            return None
        if (
            not isinstance(value, list)
            or not value
            or not all(
                isinstance(one, int | float) and not isinstance(one, bool) and math.isfinite(one)
                for one in value
            )
        ):
            self.fault(f"{key}: a list of numbers was expected, not {value!r}")
            return None
        return tuple(float(one) for one in value)

    def choice(self, key: str, choices: tuple[str, ...], default: str) -> str:
        """Read one of several words."""
        value = self._take(key)
        if value is None:
            return default
        if value not in choices:
            self.fault(f"{key}: one of {', '.join(choices)} was expected, not {value!r}")
            return default
        return str(value)

    def seeds(self, key: str) -> tuple[int, ...]:
        """Read seeds: a list of whole numbers, or how many, counted from 1."""
        value = self._take(key)
        if value is None:
            return (1,)
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MOST_SEEDS:
            return tuple(range(1, value + 1))
        if (
            not isinstance(value, list)
            or not value
            or not all(
                isinstance(seed, int) and not isinstance(seed, bool) and 0 <= seed <= LARGEST_SEED
                for seed in value
            )
        ):
            self.fault(
                f"{key}: a list of whole numbers from 0 to {LARGEST_SEED}, or how many seeds, "
                f"1 to {MOST_SEEDS}, was expected, not {value!r}"
            )
            return (1,)
        if len(set(value)) < len(value):
            self.fault(f"{key}: a seed occurs more than once")
        return tuple(value)

    def words(self, key: str, *, needed: bool = False) -> tuple[str, ...] | None:
        """Read a command line: a text, split into words as a shell does, or a list of words."""
        value = self._take(key)
        if value is None:
            if needed:
                self.fault(f"{key}: is missing")
            return None
        words: list[str] = []
        if isinstance(value, str):
            try:
                words = shlex.split(value)
            except ValueError as error:
                self.fault(f"{key}: {value!r}: {error}")
                return None
        elif isinstance(value, list) and all(isinstance(word, str) for word in value):
            words = value
        if not words or any("\0" in word for word in words):
            self.fault(f"{key}: a command line was expected, not {value!r}")
            return None
        return tuple(words)

    def settings(self, key: str) -> tuple[tuple[str, str], ...]:
        """Read a table of texts and numbers, as texts, in order of their names."""
        value = self._take(key)
        if value is None:
            return ()
        if not isinstance(value, dict) or not all(
            isinstance(one, str | int | float) and not isinstance(one, bool) for one in value.values()
        ):
            self.fault(f"{key}: a table of texts and numbers was expected, not {value!r}")
            return ()
        return tuple((name, str(one)) for name, one in sorted(value.items()))

    def table(self, key: str) -> Fields:
        """Read a table; an empty one if it is not there."""
        value = self._take(key)
        if value is not None and not isinstance(value, dict):
            self.fault(f"{key}: a table was expected: [{key}]")
        return Fields(value if isinstance(value, dict) else {}, f"{self._place}: {key}", self._faults)

    def tables(self, key: str) -> list[Fields]:
        """Read a list of tables that must not be empty."""
        value = self._take(key)
        if not isinstance(value, list) or not value or not all(isinstance(one, dict) for one in value):
            self.fault(f"{key}: at least one is needed: [[{key}]]")
            return []
        return [
            Fields(one, f"{self._place}: {key} {number}", self._faults) for number, one in enumerate(value, 1)
        ]
