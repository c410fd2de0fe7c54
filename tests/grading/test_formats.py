"""The report's files for other programs, held against the rules that those publish."""

import csv
import io
import json
from pathlib import Path

import pytest
from lxml import etree

from ciberrato.grading.course import QUANTITIES, Agent, Course, GradedLab, Limits, Points
from ciberrato.grading.expressions import Formula
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.report import gradescope, junit, parquet, tables, write_report
from ciberrato.grading.runner import Graded
from ciberrato.grading.standing import standings
from ciberrato.grading.task import Task

ENDS = [
    ("finished", "", True),
    ("time over", "", True),
    ("crashed at 12", "signal SIGSEGV", True),
    ("silent since 3", "", True),
    ("stopped at 9", "memory limit", True),
    ("never registered", "exit status 1", False),
    ("not built", "see the output", False),
]
TAIL = 'last <words> & "more" \x00\x1b[31m \ud800 \ufffe'


@pytest.fixture(params=[None, 100.0], ids=["open", "cut"])
def graded(request):
    """A course in which all comes to pass that can, with names and outputs of all kinds."""
    labs = (
        GradedLab("maze", Path("a")),
        GradedLab("<open> & \x01wide", Path("b"), weight=2.0),
        GradedLab("hidden", Path("c"), secret=True),
    )
    agents = tuple(
        Agent(name, ("x",), commit=commit) for name, commit in (("ana", "0" * 40), ('"=b<o>b\x02', None))
    )
    points = Points(Formula("score - collisions", QUANTITIES), request.param, 50.0)
    seeds = tuple(range(len(ENDS)))
    course = Course("t", agents, labs, seeds, True, 1.0, None, Limits(), points)
    runs = [
        Graded(
            Task(agent, lab, seed, f"{agent.name}{lab.name}{seed}", f"{place}-{seed}"),
            Outcome(
                status=status, detail=detail, registered=registered, score=30 * seed, collisions=7,
                time=100 + seed, cycle_time=50, late=seed, mapping=None if seed % 2 else 0.5,
            ),
            {"tail": TAIL if seed % 2 else "", "wall": 0.5},
        )
        for agent in agents
        for place, lab in enumerate(labs)
        for seed, (status, detail, registered) in enumerate(ENDS)
    ]  # fmt: skip
    return course, standings(course, runs)


def test_junit_keeps_to_its_schema_and_its_counts_are_right(graded):
    schema = etree.XMLSchema(etree.parse(Path(__file__).parents[1] / "data" / "junit.xsd"))
    text = junit.junit_document(*graded)
    root = etree.fromstring(text.encode())
    schema.assertValid(root)
    for element in (root, *root.iter("testsuite")):
        cases = list(element.iter("testcase"))
        assert int(element.get("tests")) == len(cases)
        for name, count in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
            assert int(element.get(count)) == len(list(element.iter(name)))
        assert float(element.get("time")) == pytest.approx(sum(float(case.get("time")) for case in cases))
    kinds = {fault.get("type") for fault in root.iter("failure", "error")}
    assert kinds == {"points", "crashed", "silent", "stopped", "never registered", "not built"}
    # The schema does find faults: a count that is none, a case without a name, a fault after the output.
    for wrong in (
        text.replace('skipped="0"', 'skipped="none"'),
        text.replace('name="maze, seed 0" ', ""),
        text.replace("<testcase", "<system-out>x</system-out><testcase", 1),
    ):
        assert wrong != text
        assert not schema.validate(etree.fromstring(wrong.encode()))


VISIBILITY = {"enum": ["hidden", "after_due_date", "after_published", "visible"]}
FORMAT = {"enum": ["text", "html", "simple_format", "md", "ansi"]}
# From the specification of autograders that Gradescope publishes: what there may be, and of which kind.
GRADESCOPE = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "score": {"type": "number"},
        "execution_time": {"type": "number"},
        "output": {"type": "string"},
        "output_format": FORMAT,
        "test_output_format": FORMAT,
        "test_name_format": FORMAT,
        "visibility": VISIBILITY,
        "stdout_visibility": VISIBILITY,
        "extra_data": {"type": "object"},
        "tests": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "properties": {
                    "score": {"type": "number"},
                    "max_score": {"type": "number"},
                    "status": {"enum": ["passed", "failed"]},
                    "name": {"type": "string"},
                    "name_format": FORMAT,
                    "number": {"type": "string"},
                    "output": {"type": "string"},
                    "output_format": FORMAT,
                    "tags": {"type": "array", "items": {"type": "string"}},
                    "visibility": VISIBILITY,
                    "extra_data": {"type": "object"},
                },
            },
        },
        "leaderboard": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["name", "value"],
                "properties": {
                    "name": {"type": "string", "minLength": 1},
                    "value": {"type": ["number", "string"]},
                    "order": {"enum": ["asc", "desc"]},
                },
            },
        },
    },
    # A score for all, or one for each test.
    "anyOf": [
        {"required": ["score"]},
        {"required": ["tests"], "properties": {"tests": {"minItems": 1, "items": {"required": ["score"]}}}},
    ],
}


def test_gradescopes_results_keep_to_its_specification(graded):
    jsonschema = pytest.importorskip("jsonschema")
    course, ranked = graded
    validator = jsonschema.Draft202012Validator(GRADESCOPE)
    for standing in ranked:
        text = gradescope.results(course, standing)
        document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
        validator.validate(document)
        assert document["score"] == pytest.approx(standing.total)
        names = [column["name"] for column in document["leaderboard"]]
        assert len(names) == len(set(names))
        assert "hidden" not in names
        for test in document["tests"]:
            assert test["visibility"] == ("hidden" if test["name"].startswith("hidden") else "visible")
            assert 0.0 <= test["score"] <= test.get("max_score", float("inf")) or "max_score" not in test
        for wrong in ({**document, "points": 1}, {**document, "visibility": "public"}, {"tests": [{}]}):
            assert not validator.is_valid(wrong)


@pytest.mark.skipif(not parquet.available(), reason="pyarrow is not installed")
def test_the_parquet_table_holds_the_rows_of_the_csv(graded, tmp_path):
    import pyarrow.parquet as pq

    _, ranked = graded
    parquet.write_table(ranked, tmp_path / "one.parquet")
    parquet.write_table(ranked, tmp_path / "two.parquet")
    assert (tmp_path / "one.parquet").read_bytes() == (tmp_path / "two.parquet").read_bytes()
    table = pq.read_table(tmp_path / "one.parquet")
    rows = list(csv.reader(io.StringIO(tables.results_csv(ranked))))
    assert table.column_names == rows[0]
    for row, record in zip(rows[1:], table.to_pylist(), strict=True):
        for text, value in zip(row, record.values(), strict=True):
            assert text.removeprefix("'") == ("" if value is None else str(value))
    assert str(table.schema.field("points").type) == "double"
    assert str(table.schema.field("registered").type) == "bool"


def test_without_pyarrow_the_report_is_written_and_has_no_table(graded, tmp_path, monkeypatch):
    course, ranked = graded
    (tmp_path / "recordings").mkdir()
    monkeypatch.setattr(parquet, "available", lambda: False)
    write_report(course, ranked, tmp_path, missing=0)
    assert (tmp_path / "results.csv").exists()
    assert not (tmp_path / "results.parquet").exists()
