"""The Parameters element: in the Reply, and in the log document."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from ciberrato.errors import ProtocolError
from ciberrato.protocol.text import attribute, general, strict_integer, strict_real
from ciberrato.world.parameter_names import FILE_NAMES, INTEGERS, REALS, SWITCHES
from ciberrato.world.parameters import Parameters

_LAYOUT = """\
<Parameters SimTime="%d" CycleTime="%d"
\t\tCompassNoise="%s" BeaconNoise="%s" ObstacleNoise="%s"
\t\tMotorsNoise="%s" KeyTime="%d"
\t\tGPS="%s" GPSLinNoise="%s" GPSDirNoise="%s"\x20
\t\tBeaconSensor="%s"\x20
\t\tCompassSensor="%s"\x20
\t\tScoreSensor="%s" ShowActions="%s" NBeacons="%d"\x20
\t\tNRequestsPerCycle="%d"\x20
\t\tObstacleRequestable="%s" BeaconRequestable="%s"\x20
\t\tGroundRequestable="%s" CompassRequestable="%s"
\t\tCollisionRequestable="%s"
\t\tObstacleLatency="%d" BeaconLatency="%d"\x20
\t\tGroundLatency="%d" CompassLatency="%d"
\t\tCollisionLatency="%d"
\t\tBeaconAperture="%f"
\t\tReturnTimePenalty="%d" ArrivalTimePenalty="%d"\x20
\t\tCollisionWallPenalty="%d" CollisionRobotPenalty="%d"\x20
\t\tTargetReward="%d" HomeReward="%d"
%s/>
"""
_REAL_SIMULATORS = set(re.findall(r"(\w+)=", _LAYOUT))
_ADDED: dict[str, tuple[str, Callable[[Any], str]]] = {
    name: (field, write)
    for names, write in ((INTEGERS, str), (REALS, general), (SWITCHES, lambda value: _on(value)))
    for name, field in names.items()
    if name not in _REAL_SIMULATORS
}
"""Parameters that only our simulator has: announced behind the others."""


def encode_parameters(parameters: Parameters, n_beacons: int) -> str:
    """Write the Parameters element as the real simulator does.

    Parameters
    ----------
    parameters : Parameters
    n_beacons : int
        Number of beacons in the lab.

    Returns
    -------
    str
        From ``<Parameters`` to the newline after ``/>``. `line_sensor_true_probability` is never announced.

    Raises
    ------
    UsageError
        If a file name cannot be written in XML.
    """
    p = parameters
    files = "".join(
        f'\t\t{name}="{attribute(value, f"Parameters {name}")}"\n'
        for name, value in (("Lab", p.lab_file), ("Grid", p.grid_file))
        if value is not None
    )
    added = "".join(f'\t\t{name}="{write(getattr(p, field))}"\n' for name, (field, write) in _ADDED.items())
    return _LAYOUT % (
        p.sim_time,
        p.cycle_time,
        general(p.compass_noise),
        general(p.beacon_noise),
        general(p.obstacle_noise),
        general(p.motors_noise),
        p.key_time,
        _on(p.gps),
        general(p.gps_linear_noise),
        general(p.gps_direction_noise),
        _on(p.beacon_sensor),
        _on(p.compass_sensor),
        _on(p.score_sensor),
        "True" if p.show_actions else "False",
        n_beacons,
        p.requests_per_cycle,
        _on(p.obstacle_requestable),
        _on(p.beacon_requestable),
        _on(p.ground_requestable),
        _on(p.compass_requestable),
        _on(p.collision_requestable),
        p.obstacle_latency,
        p.beacon_latency,
        p.ground_latency,
        p.compass_latency,
        p.collision_latency,
        p.beacon_aperture,
        p.return_time_penalty,
        p.arrival_time_penalty,
        p.collision_wall_penalty,
        p.collision_robot_penalty,
        p.target_reward,
        p.home_reward,
        added + files,
    )


def decode_parameters(attributes: Mapping[str, str]) -> tuple[Parameters, int]:
    """Read the attributes of a Parameters element that a simulator or a log player sent.

    Parameters
    ----------
    attributes : mapping of str to str
        Those of the element; what is missing keeps its built-in default, unknown ones do not matter.

    Returns
    -------
    parameters : Parameters
    n_beacons : int
        0 where it is not announced.

    Raises
    ------
    ProtocolError
        If a number is none; names the attribute.
    """
    values: dict[str, object] = {}
    n_beacons = 0
    for name, text in attributes.items():
        place = f"Parameters {name}"
        if name in INTEGERS:
            values[INTEGERS[name]] = strict_integer(text, place)
        elif name in REALS:
            values[REALS[name]] = strict_real(text, place)
        elif name in SWITCHES:
            values[SWITCHES[name]] = text == "On"
        elif name in FILE_NAMES:
            values[FILE_NAMES[name]] = text
        elif name == "ShowActions":
            values["show_actions"] = text == "True"
        elif name == "NBeacons":
            n_beacons = strict_integer(text, place)
    try:
        # The tables above give each field its type.
        return Parameters(**values), n_beacons  # type: ignore[arg-type]
    except ValueError as error:
        raise ProtocolError(f"Parameters {error}") from None


def _on(switch: bool) -> str:
    return "On" if switch else "Off"
