"""Sensors that others wrote, beside those of every robot."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.plugins import guarded, load_part
from ciberrato.protocol import OtherReading
from ciberrato.protocol.text import general
from simulator_stub.sensors.base import Sensor

GROUP = "ciberrato.sensors"
_CALLED = ("__init__", "is_present", "request_names", "update", "report", "record")


def own_sensors(wanted: Iterable[type[Sensor] | str], taken: Iterable[str]) -> tuple[type[Sensor], ...]:
    """Find sensors by class, by the name of an entry point, or by ``module:Class``.

    Parameters
    ----------
    wanted : iterable of type or str
    taken : iterable of str
        Names of the sensors that are there: each names a stream of random numbers.

    Returns
    -------
    tuple of type
        Of those that are named, what their methods raise is a `UsageError` of one line.

    Raises
    ------
    UsageError
        If one of those that are named cannot be loaded; see `ciberrato.plugins.load_part`.
    ValueError
        If one is no sensor, or has no name of its own.
    """
    if isinstance(wanted, str | bytes) or not isinstance(wanted, Iterable):
        raise ValueError(f"sensors: {wanted!r:.60} is not a list of sensors (classes or names)")
    names = set(taken)
    found = []
    for item in wanted:
        kind: Any = item
        label = "sensors"
        if isinstance(item, str):
            label, kind = load_part(
                GROUP, item, fits=_is_sensor, wanted="a class derived from simulator_stub.sensors.Sensor"
            )
        elif not _is_sensor(item):
            raise ValueError(
                f"sensors: {item!r:.60} is not a class derived from simulator_stub.sensors.Sensor"
            )
        name = getattr(kind, "name", None)
        if not isinstance(name, str) or not name:
            raise ValueError(f"{label}: {kind.__name__} has no `name`, which names its random numbers")
        if name in names:
            raise ValueError(f"{label}: the name {name!r} is already used by another sensor")
        names.add(name)
        found.append(guarded(kind, label, _CALLED) if isinstance(item, str) else kind)
    return tuple(found)


def report_other(fields: dict[str, Any], element: str, **values: float | str) -> None:
    """Add an element of its own to what a sensor reports; it is sent within Sensors, and in the log.

    Parameters
    ----------
    fields : dict
        Fields of `Sensor.report` or `Sensor.record`.
    element : str
        Name of the element.
    **values : float or str
        Its attributes; numbers are sent with six digits, as all are.
    """
    texts = tuple((key, value if isinstance(value, str) else general(value)) for key, value in values.items())
    fields["others"] = (*fields.get("others", ()), OtherReading(name=element, values=texts))


def fill_in(draft: object, fields: Mapping[str, Any]) -> None:
    """Set the fields of a message to what the sensors reported; UsageError if there is none of a name."""
    name = ""
    try:
        for name, reading in fields.items():
            setattr(draft, name, reading)
    except AttributeError:
        raise UsageError(
            f"a sensor reports {name!r:.60}, which is no field of Measures: "
            "simulator_stub.sensors.report_other adds elements of its own"
        ) from None


def _is_sensor(value: Any) -> bool:
    return isinstance(value, type) and issubclass(value, Sensor) and not inspect.isabstract(value)
