"""What follows from the records: a draft's defaults, the elements of sensors, the names of parameters."""

import pytest

from ciberrato.protocol.client_decoding import decode_actions
from ciberrato.protocol.drafts import MeasuresDraft
from ciberrato.protocol.measures_text import _ELEMENTS, measures_to_xml
from ciberrato.protocol.messages import Actions, Measures
from ciberrato.world.parameter_names import FILE_NAMES, INTEGERS, REALS, SWITCHES
from ciberrato.world.parameters import Parameters


def test_a_draft_has_the_records_defaults():
    draft = MeasuresDraft()
    draft.time = 7
    draft.start = draft.stop = draft.end_led = draft.returning_led = draft.visiting_led = False
    assert draft.finish() == Measures(time=7)


def test_a_draft_of_actions_has_the_records_defaults():
    usual, unusual = (
        decode_actions(b'<Actions LeftMotor="0.5"%s RightMotor="0.5"/>' % blank) for blank in (b"", b" ")
    )
    assert usual == unusual == Actions(left_motor=0.5, right_motor=0.5)
    assert type(usual) is Actions


def test_the_elements_of_sensors_and_their_order():
    assert list(_ELEMENTS) == ["gps", "line"]
    text = measures_to_xml(Measures(time=0, gps=(1.5, -2.25), line='0"1'))
    assert '\t\t<GPS X="1.5" Y="-2.25" />\n\t\t<LineSensor Value="0&quot;1" />\n' in text


@pytest.mark.parametrize(
    ("names", "some"),
    [
        (
            INTEGERS,
            {"NRequestsPerCycle": "requests_per_cycle", "CollisionWallPenalty": "collision_wall_penalty"},
        ),
        (REALS, {"GPSLinNoise": "gps_linear_noise", "GPSDirNoise": "gps_direction_noise"}),
        (SWITCHES, {"GPS": "gps", "ObstacleRequestable": "obstacle_requestable"}),
        (FILE_NAMES, {"Lab": "lab_file", "Grid": "grid_file"}),
    ],
)
def test_the_names_of_parameters(names, some):
    assert some.items() <= names.items()
    assert set(names.values()) <= set(Parameters.__slots__)


def test_every_parameter_has_a_name_but_two():
    named = {field for names in (INTEGERS, REALS, SWITCHES, FILE_NAMES) for field in names.values()}
    assert set(Parameters.__slots__) - named == {"line_sensor_true_probability", "show_actions"}
