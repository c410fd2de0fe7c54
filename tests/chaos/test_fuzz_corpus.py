"""What fuzzing found and kept is read again: nothing but what is documented comes out, in bounded time."""

from pathlib import Path

import pytest

from tests.chaos.fuzz import CORPUS, READERS, reader, seeds


@pytest.mark.parametrize("name", READERS)
def test_the_corpus_is_read_or_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
    inputs = seeds(name)
    assert inputs
    take = reader(name, tmp_path)
    for data in inputs:
        take(data)


def test_the_corpus_is_small_and_all_of_it_is_used() -> None:
    files = [path for path in CORPUS.rglob("*") if path.is_file()]
    assert {path.parent.name for path in files} <= set(READERS)
    assert sum(path.stat().st_size for path in files) < 300_000


def test_what_a_reader_must_not_do_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ciberrato.overlay.decode_overlay", lambda data: data[10])
    with pytest.raises(IndexError):
        reader("overlay", tmp_path)(b"short")
