"""Names of the simulation parameters in XML, by kind: attribute to field of `Parameters`.

The names follow from those of the fields (``compass_noise``: ``CompassNoise``), but for a few. They are those
that the simulator announces. Parameter files differ in two of them; see `ciberrato.files.parameters`.
"""

from __future__ import annotations

from dataclasses import fields

from ciberrato.world.parameters import Parameters

_CALLED_OTHERWISE = {
    "requests_per_cycle": "NRequestsPerCycle",
    "gps": "GPS",
    "gps_linear_noise": "GPSLinNoise",
    "gps_direction_noise": "GPSDirNoise",
    "lab_file": "Lab",
    "grid_file": "Grid",
}
_APART = {"line_sensor_true_probability", "show_actions"}
"""Never announced; written True and False instead of On and Off."""


def _names(kind: str) -> dict[str, str]:
    return {
        _CALLED_OTHERWISE.get(field.name) or field.name.title().replace("_", ""): field.name
        for field in fields(Parameters)
        if field.type == kind and field.name not in _APART
    }


INTEGERS = _names("int")
REALS = _names("float")
SWITCHES = _names("bool")
FILE_NAMES = _names("str | None")
