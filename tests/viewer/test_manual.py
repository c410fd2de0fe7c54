"""The manual says what the programs do."""

import ast
import json
import re
import socket
from pathlib import Path

from ciberrato.overlay import KINDS, OVERLAY_PORT, decode_overlay
from ciberrato.viewer.cli import _parser

DOCS = Path(__file__).parents[2] / "docs"
VIEWER, OVERLAY = ((DOCS / name).read_text() for name in ("viewer.md", "overlay.md"))


def test_every_option_is_described_and_every_described_option_exists():
    options = {
        name for action in _parser()._actions for name in action.option_strings if name.startswith("--")
    } - {"--help"}
    table = VIEWER.split("## Options")[1].split("## What")[0]
    described = {name for line in table.splitlines() if line.startswith("| `") for name in
                 re.findall(r"--[a-z-]+", line.split("|")[1])}  # fmt: skip
    assert described == options


def test_every_picture_is_there():
    pictures = re.findall(r"\]\((figures/[^)]+)\)", VIEWER)
    assert len(pictures) == 10
    assert all((DOCS / picture).stat().st_size > 20_000 for picture in pictures)


def test_the_programs_in_the_manual_send_what_it_says(monkeypatch):
    sent = []

    class Recorder:
        def __init__(self, *_):
            pass

        def sendto(self, data, address):
            sent.append((decode_overlay(data), address))

        def setblocking(self, flag):
            pass

        def setsockopt(self, *_):
            pass

        def close(self):
            pass

    monkeypatch.setattr(socket, "socket", Recorder)
    for program in re.findall(r"```python\n(.*?)```", OVERLAY, re.DOTALL):
        exec(compile(ast.parse(program), "overlay.md", "exec"), {})
    assert [address for _, address in sent] == [("127.0.0.1", OVERLAY_PORT)] * 2
    assert sent[0][0].shapes[0].id == "goal"
    assert sent[1][0].belief.cells.shape == (7, 14)
    [shell] = re.findall(r"echo '(\{.*?\})' >", OVERLAY)
    assert decode_overlay(shell.encode()).shapes[0].text == "here"


def test_every_kind_of_shape_is_described():
    table = OVERLAY.split("### Shapes")[1].split("All have")[0]
    assert set(re.findall(r"^\| `([a-z]+)` \|", table, re.MULTILINE)) - {"kind"} == set(KINDS)


def test_the_messages_of_the_page_are_described():
    from ciberrato.viewer.page_messages import read_page_message

    for text in re.findall(r"\| `(\{.*?\})`", VIEWER):
        read_page_message(json.dumps(json.loads(text)))
