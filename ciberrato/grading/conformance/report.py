"""Result of a check: for people, as JSON, and as JUnit XML."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from xml.etree import ElementTree

from ciberrato.grading.conformance.check import Judged
from ciberrato.plaintext import plain, plain_lines, xml_text

FORMAT = 1
LAST_LINES = 8
"""Of an agent's output that are shown."""


def text_report(judged: Sequence[Judged], *, failed_only: bool = False) -> str:
    """Write the report for people.

    Parameters
    ----------
    judged : sequence of Judged
    failed_only : bool
        Leave out the rows that passed.

    Returns
    -------
    str
        Without a last newline.
    """
    blocks = []
    for one in judged:
        if one.passed and failed_only:
            continue
        lines = [f"{'passed' if one.passed else 'FAILED'}  {one.row.name}"]
        lines += [
            f"    done      {one.row.done}",
            f"    expected  {one.row.expected}",
            f"    happened  {plain(one.happened)}",
        ]
        if not one.passed:
            lines.append(f"    look at   {one.row.hint}")
            lines += [f"    output  | {plain(line)}" for line in _last_lines(one.output)]
        blocks.append("\n".join(lines))
    good = sum(one.passed for one in judged)
    bad = len(judged) - good
    hint = "; begin with the first that failed: others may follow from it" if bad > 1 else ""
    blocks.append(f"{good} of {len(judged)} rows passed{hint}")
    return "\n\n".join(blocks)


def _last_lines(output: str) -> list[str]:
    return output.strip().splitlines()[-LAST_LINES:]


def json_report(judged: Sequence[Judged], command: Sequence[str]) -> str:
    """Write the report for programs.

    Parameters
    ----------
    judged : sequence of Judged
    command : sequence of str
        The agent's.

    Returns
    -------
    str
        An object with ``format``, ``command``, ``passed``, and ``rows``, a list of objects with ``name``,
        ``passed``, ``done``, ``expected``, ``happened``, ``hint``, ``output``. The agent's texts are without
        control and unseen characters (U+FFFD in their place) but their line ends.
    """
    rows = [
        {
            "name": one.row.name,
            "passed": one.passed,
            "done": one.row.done,
            "expected": one.row.expected,
            "happened": plain_lines(one.happened),
            "hint": one.row.hint,
            "output": plain_lines(one.output),
        }
        for one in judged
    ]
    passed = all(one.passed for one in judged)
    document = {"format": FORMAT, "command": list(command), "passed": passed, "rows": rows}
    return json.dumps(document, indent=2) + "\n"


def junit_report(judged: Sequence[Judged], command: Sequence[str]) -> str:
    """Write the report for continuous integration.

    Parameters
    ----------
    judged : sequence of Judged
    command : sequence of str
        The agent's.

    Returns
    -------
    str
        JUnit XML, a case a row.
    """
    counts = {
        "tests": str(len(judged)),
        "failures": str(sum(not one.passed for one in judged)),
        "errors": "0",
    }
    root = ElementTree.Element("testsuites", counts, name="ciberrato conformance")
    suite = ElementTree.SubElement(root, "testsuite", counts, name=xml_text(shlex.join(command)))
    for one in judged:
        case = ElementTree.SubElement(suite, "testcase", classname="conformance", name=one.row.name)
        if not one.passed:
            happened = xml_text(one.happened)
            failure = ElementTree.SubElement(case, "failure", message=happened, type="conformance")
            failure.text = xml_text(text_report([one]).rpartition("\n\n")[0])
        if one.output:
            ElementTree.SubElement(case, "system-out").text = xml_text(one.output)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
