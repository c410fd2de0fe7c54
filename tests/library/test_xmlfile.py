from __future__ import annotations

import errno
import os
import tracemalloc

import pytest

from ciberrato.errors import CiberratoError, LabError, UsageError
from ciberrato.files import xml as xmlfile
from ciberrato.files.lab import read_lab


def test_a_missing_file(tmp_path):
    with pytest.raises(UsageError, match=r"x\.xml: no such file"):
        read_lab(tmp_path / "x.xml")


def test_a_directory(tmp_path):
    with pytest.raises(UsageError, match="is a directory"):
        read_lab(tmp_path)


def test_a_file_that_may_not_be_read(monkeypatch):
    def refuse(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("builtins.open", refuse)
    with pytest.raises(UsageError) as caught:
        read_lab("secret.xml")
    assert str(caught.value).startswith("secret.xml: cannot be read (Permission denied)")


@pytest.mark.parametrize("name", ["a\0b", "x" * 5000, "", "file.xml/inside"])
def test_names_that_no_file_can_have(tmp_path, name):
    (tmp_path / "file.xml").write_text("<Lab/>")
    with pytest.raises(UsageError) as caught:
        read_lab(f"{tmp_path}/{name}" if name else "")
    assert "\n" not in str(caught.value)


def test_a_file_without_end():
    if not os.path.exists("/dev/zero"):
        pytest.skip("no /dev/zero")
    with pytest.raises(LabError, match="/dev/zero: is larger than 16 MiB"):
        read_lab("/dev/zero")


def test_a_small_file_takes_little_memory(tmp_path):
    path = tmp_path / "lab.xml"
    path.write_bytes(b"<Lab/>")
    tracemalloc.start()
    try:
        assert xmlfile.read_file(path) == b"<Lab/>"
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_the_longest_file_that_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(xmlfile, "MAX_FILE_SIZE", 20)
    path = tmp_path / "lab.xml"
    path.write_text("<Lab></Lab>".ljust(20))
    assert read_lab(path).width == 16.0
    path.write_text("<Lab></Lab>".ljust(21))
    with pytest.raises(LabError):
        read_lab(path)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (" 1.5 ", 1.5),
        ("+2", 2.0),
        ("-.5e1", -5.0),
        ("3.", 3.0),
        ("1_0", 0.0),
        ("0x10", 0.0),
        ("", 0.0),
        ("٣", 0.0),
    ],
)
def test_numbers_are_read_as_the_real_simulator_reads_them(text, value):
    reader = xmlfile.Reader("f")
    element = xmlfile.Element("E", {"a": text}, 1, None)
    assert reader.real(element, "a", 7.0) == value
    assert reader.real(element, "b", 7.0) == 7.0


@pytest.mark.parametrize(
    ("text", "value", "unsigned"),
    [
        ("12", 12, 12),
        (" +3 ", 3, 3),
        ("-3", -3, 0),
        ("2147483648", 0, 2147483648),
        ("4294967296", 0, 0),
        ("1.0", 0, 0),
        ("9" * 5000, 0, 0),
    ],
)
def test_integers_have_32_bits(text, value, unsigned):
    reader = xmlfile.Reader("f")
    element = xmlfile.Element("E", {"a": text}, 1, None)
    assert reader.integer(element, "a", 7) == value
    assert reader.natural(element, "a", 7) == unsigned


def test_errors_are_of_one_family():
    assert issubclass(LabError, CiberratoError)
    assert issubclass(UsageError, CiberratoError)
