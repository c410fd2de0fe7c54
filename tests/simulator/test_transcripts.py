"""Recorded sessions of the real simulator: the same datagrams in the same cycles get the same answers."""

from __future__ import annotations

import base64
import gzip
import json
from pathlib import Path

import pytest

from benchmarks.conformance import transcripts
from benchmarks.conformance.timeline import read_timeline
from tests.recordings import FOLDERS, OWN, by_name


def sessions() -> dict[str, Path]:
    found: dict[str, Path] = {}
    for folder in FOLDERS:
        for path in sorted((folder / "transcripts").glob("*.jsonl.gz")):
            found.setdefault(path.name.removesuffix(".jsonl.gz"), path)
    return found


def read_lines(path: Path) -> list[str]:
    with gzip.open(path, "rt") as file:
        return file.readlines()


@pytest.mark.parametrize("name", by_name(sessions()))
def test_a_recorded_session_gets_the_recorded_answers(name: str) -> None:
    path = sessions()[name]
    result = transcripts.replay(path, path.parent / "files")
    assert result.wrong == []
    recorded = sum(len(answers) for answers in read_timeline(path, path.parent / "files").answers.values())
    assert result.equal + result.deliberate.total() == recorded, "every answer is accounted for"


def test_what_differs_on_purpose_is_what_the_manual_says() -> None:
    counts = {
        row.note.partition(" (")[0]: row.cases
        for row in transcripts.rows(OWN, None)
        if "purpose" in row.check
    }
    assert counts == {transcripts.NAMES: 43, transcripts.NAN: 21, transcripts.LONG_NAME: 3} | {
        transcripts.FOREIGN.partition(" (")[0]: 1
    }


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'Score="400"', b'Score="401"'),
        (b'Start="On"', b'Start="Off"'),
        (b'<GPS X="', b'<GPS X="1'),
    ],
)
def test_the_comparison_notices_a_wrong_answer(tmp_path: Path, old: bytes, new: bytes) -> None:
    path = OWN / "transcripts/09_score_gps_beacons.jsonl.gz"
    events = [json.loads(line) for line in read_lines(path)]
    for event in reversed(events):
        data = base64.b64decode(event["payload_b64"] or "")
        if event["direction"] == "sim->client" and old in data:
            event["payload_b64"] = base64.b64encode(data.replace(old, new, 1)).decode()
            break
    else:
        pytest.fail("the recording has nothing of the kind")
    changed = tmp_path / path.name
    with gzip.open(changed, "wt") as file:
        file.writelines(json.dumps(event) + "\n" for event in events)
    assert len(transcripts.replay(changed, path.parent / "files").wrong) == 1


def test_the_comparison_notices_an_answer_too_much(tmp_path: Path) -> None:
    path = OWN / "transcripts/10_removed.jsonl.gz"
    lines = read_lines(path)
    robots = [json.loads(line)["from_port"] for line in lines if "<Measures" in line]
    dropped = [
        line for line in lines if "<Measures" not in line or json.loads(line)["from_port"] == robots[0]
    ]
    changed = tmp_path / path.name
    with gzip.open(changed, "wt") as file:
        file.writelines(dropped)
    wrong = transcripts.replay(changed, path.parent / "files").wrong
    assert wrong
    assert all("too much" in problem for problem in wrong)


def test_without_transcripts_the_check_says_so(tmp_path: Path) -> None:
    (row,) = transcripts.rows(tmp_path, None)
    assert (row.cases, row.passed) == (0, True)
    assert "skipped" in row.note


def test_a_session_whose_files_are_absent_fails_alone(tmp_path: Path) -> None:
    folder = tmp_path / "transcripts"
    folder.mkdir()
    for name in ("09_score_gps_beacons", "09d_all_defaults"):
        (folder / f"{name}.jsonl.gz").write_bytes((OWN / f"transcripts/{name}.jsonl.gz").read_bytes())
    first, second = transcripts.rows(tmp_path, None)
    assert (first.passed, second.passed) == (False, True)
    assert "no such file" in first.note
