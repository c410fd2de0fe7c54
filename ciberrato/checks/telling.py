"""Report what was found in the files that a program reads, and refuse them if that was asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ciberrato.errors import UsageError
from ciberrato.files.findings import Finding


def tell(findings: Iterable[Finding], say: Callable[[str], None], *, strict: bool) -> None:
    """Report the warnings among findings.

    Parameters
    ----------
    findings : iterable of Finding
        Notes are left out.
    say : callable
        Gets a line for each.
    strict : bool
        Refuse files with warnings, after all are said.

    Raises
    ------
    UsageError
        If `strict` and there is a warning.
    """
    count = 0
    for finding in findings:
        if finding.severity != "note":
            say(str(finding))
            count += 1
    if strict and count:
        raise UsageError(
            f"--strict: {count} warning{'s' * (count > 1)} about the files; correct them, or leave it out"
        )
