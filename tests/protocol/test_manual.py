"""What the manual shows is what the code does."""

import doctest
import re
from pathlib import Path

import pytest

from ciberrato.protocol import (
    Acceptance,
    Actions,
    decode_actions,
    decode_simulator_message,
    encode,
)
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid

MANUAL = Path(__file__).parents[2] / "docs" / "protocol.md"


def test_the_examples_run():
    assert doctest.testfile(str(MANUAL), module_relative=False) == (0, 5)


@pytest.fixture(scope="module")
def layouts():
    """The documents shown, by their root."""
    shown = re.findall(r"^```\n(.*?)^```", MANUAL.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    documents = {}
    for block in shown:
        for document in re.findall(r"^<(\w+).*?^</\1>\n", block, re.MULTILINE | re.DOTALL):
            text = re.search(rf"^<{document}\b.*?^</{document}>\n", block, re.MULTILINE | re.DOTALL)
            documents[document] = text.group().replace("␠", " ").encode() + b"\0"
    return documents


@pytest.mark.parametrize("root", ["Reply", "Measures", "Lab", "Grid", "Robot"])
def test_the_layouts_are_those_that_are_sent(layouts, root):
    assert encode(decode_simulator_message(layouts[root])) == layouts[root]


def test_the_reply_is_the_one_with_the_defaults(layouts):
    files = Parameters(lab_file="path", grid_file="path")
    assert layouts["Reply"] == encode(Acceptance(parameters=files, n_beacons=1))
    assert len(encode(Acceptance(parameters=Parameters(), n_beacons=1))) == 742


def test_the_lab_and_grid_are_what_they_say(layouts):
    assert decode_simulator_message(layouts["Lab"]) == Lab(
        name="text",
        width=28.0,
        height=14.0,
        beacons=(Beacon(x=25.0, y=7.0, height=4.0),),
        targets=(Target(x=25.0, y=7.0, radius=1.0),),
        walls=(Wall(height=4.0, corners=((1.9, 12.0), (2.1, 12.0), (2.1, 14.0))),),
    )
    assert decode_simulator_message(layouts["Grid"]) == StartGrid(positions=(GridPosition(x=9.0, y=3.0),))


def test_the_actions_are_read(layouts):
    assert decode_actions(layouts["Actions"]) == Actions(
        left_motor=0.1,
        right_motor=0.1,
        end_led=True,
        returning_led=True,
        visiting_led=True,
        reset=True,
        requests=("Compass", "IRSensor0", "Beacon0", "Ground", "Collision"),
        say="text\n",  # the newline behind </Say> belongs to it
    )
