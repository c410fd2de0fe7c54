from __future__ import annotations

import pytest

from ciberrato.errors import LabError
from ciberrato.files.parameters import parse_parameters, parse_parameters_with_warnings, read_parameters
from ciberrato.labs import find_parameters
from ciberrato.world.parameters import Parameters


def test_an_empty_element_keeps_the_defaults():
    assert parse_parameters(b"<Parameters/>") == Parameters()
    other = Parameters(sim_time=7, gps=True)
    assert parse_parameters(b'<Parameters KeyTime="3"/>', defaults=other) == Parameters(
        sim_time=7, gps=True, key_time=3
    )


def test_parameters_that_ship():
    assert read_parameters(find_parameters("default")) == Parameters(
        sim_time=3000, key_time=2250, beacon_aperture=3.141593, requests_per_cycle=4
    )
    harsh = read_parameters(find_parameters("harsh"))
    assert (harsh.compass_noise, harsh.obstacle_noise, harsh.motors_noise, harsh.gps) == (8.0, 0.4, 5.0, True)
    requests = read_parameters(find_parameters("requests"))
    assert requests.obstacle_requestable
    assert not requests.collision_requestable


def test_every_attribute_sets_its_field():
    attributes = {
        **{
            f"{name}Noise": "0.25" for name in ("Compass", "Beacon", "Obstacle", "Motors", "GPSLin", "GPSDir")
        },
        **dict.fromkeys(("SimTime", "CycleTime", "KeyTime", "NRequestsPerCycle", "collisionLatency"), "31"),
        **{f"{name}Latency": "31" for name in ("Obstacle", "Beacon", "Ground", "Compass")},
        **{
            f"{name}Penalty": "31"
            for name in ("ReturnTime", "ArrivalTime", "CollisionWall", "CollisionRobot")
        },
        **dict.fromkeys(("TargetReward", "HomeReward"), "31"),
        **dict.fromkeys(("GPS", "BeaconSensor", "ScoreSensor"), "On"),
        **{f"{name}Requestable": "On" for name in ("Obstacle", "Beacon", "Ground", "Compass", "Collision")},
        "CompassSensor": "Off",
        "LineSensorTrueProb": "0.25",
        "BeaconAperture": "0.25",
        "Lab": "a b.xml",
        "Grid": "c.xml",
    }
    data = "<Parameters {}/>".format(" ".join(f'{key}="{value}"' for key, value in attributes.items()))
    parameters, warnings = parse_parameters_with_warnings(data.encode())
    assert warnings == ()
    unchanged = {
        name
        for name in Parameters.__dataclass_fields__
        if getattr(parameters, name) == getattr(Parameters(), name)
    }
    assert unchanged == {"show_actions"}


def test_warnings_have_a_line_and_say_what_to_do():
    data = b'<P>\n<Parameters\nGPS="on" CollisionLatency="3" RequestsPerCycle="2" Foo="1" SimTime="-1"/></P>'
    _, warnings = parse_parameters_with_warnings(data, "p.xml")
    assert all(warning.startswith("p.xml:3: ") for warning in warnings)
    assert ['"on" is not "On"' in warnings[0], "collisionLatency" in warnings[1]] == [True, True]
    assert ["NRequestsPerCycle" in warnings[2], 'Foo="1" means nothing' in warnings[3]] == [True, True]
    assert "counts as 0" in warnings[4]


def test_a_file_without_parameters_is_reported():
    parameters, (warning,) = parse_parameters_with_warnings(b"<Lab/>", "p.xml")
    assert parameters == Parameters()
    assert "no Parameters element" in warning


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ('MotorsNoise="-1"', 'p.xml:1: MotorsNoise="-1" is below 0'),
        ('ObstacleNoise="nan"', 'p.xml:1: Parameters ObstacleNoise="nan" is not finite'),
        ('LineSensorTrueProb="1.5"', 'p.xml:1: LineSensorTrueProb="1.5" is not a probability'),
    ],
)
def test_impossible_values_are_refused_in_one_line(attributes, message):
    with pytest.raises(LabError) as caught:
        parse_parameters(f"<Parameters {attributes}/>".encode(), "p.xml")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
