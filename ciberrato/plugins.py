"""Parts that others wrote: sensors, scoring modes, drives, filters, models; by name or ``module:object``.

A distribution names its parts in entry points of the groups below; what is not installed goes by where it is,
``module:object``, and then the working folder is looked in last, so that nothing in it takes the place of a
module that is installed. Whatever is wrong with a part is one line that says which part it is, and whose.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import os
import re
import sys
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from ciberrato.errors import CiberratoError, UsageError, did_you_mean
from ciberrato.reprs import short_repr

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUPS = {
    "ciberrato.sensors": "sensor",
    "ciberrato.scoring": "scoring mode",
    "ciberrato.drives": "drive",
    "ciberrato.filters": "filter",
    "ciberrato.motion_models": "motion model",
    "ciberrato.sensor_models": "sensor model",
}
"""Kind of part of each group of entry points."""

REFERENCE = re.compile(r"([^\W\d]\w*(?:\.[^\W\d]\w*)*):([^\W\d]\w*(?:\.[^\W\d]\w*)*)")
"""``module:object``, both dotted."""

_MODELS = {
    "ciberrato.motion_models": ("ciberrato.bayes.motion", "predict"),
    "ciberrato.sensor_models": ("ciberrato.bayes.sensors", "log_likelihood"),
}


class Part(NamedTuple):
    """A part that was loaded.

    Attributes
    ----------
    label : str
        Description for messages: ``sensor 'odometer' (own_parts:Odometer, own-parts 1.0)``.
    value : object
    """

    label: str
    value: Any

    def __repr__(self) -> str:
        return short_repr(self)


def installed(group: str) -> dict[str, list[EntryPoint]]:
    """List the entry points of a group, without loading any.

    Parameters
    ----------
    group : str
        One of `GROUPS`.

    Returns
    -------
    dict of str to list of EntryPoint
        By name; more than one where distributions have taken the same name.
    """
    from importlib.metadata import entry_points

    found: dict[str, list[EntryPoint]] = {}
    for point in sorted(entry_points(group=group), key=lambda point: (point.name, point.value)):
        same = found.setdefault(point.name, [])
        if all(_described(point) != _described(other) for other in same):
            same.append(point)  # an installed distribution may be found twice, by two entries of sys.path
    return found


def refuse_taken(group: str, names: Iterable[str]) -> None:
    """Refuse distributions that name a part like one that is built in.

    Raises
    ------
    UsageError
    """
    known = set(names)
    for name, points in installed(group).items():
        if name in known:
            raise UsageError(
                f"{GROUPS[group]} {name!r} ({_described(points[0])}): the name is used by one that is built "
                "in; name the entry point otherwise, or uninstall that distribution"
            )


def load_part(
    group: str, text: str, *, fits: Callable[[Any], bool], wanted: str, built_in: Iterable[str] = ()
) -> Part:
    """Load a part by the name of its entry point, or by ``module:object``.

    Parameters
    ----------
    group : str
        One of `GROUPS`.
    text : str
    fits : callable
        Whether an object is a part of this kind.
    wanted : str
        Description of such a part, for the message.
    built_in : iterable of str
        Names that no entry point may have.

    Returns
    -------
    Part

    Raises
    ------
    UsageError
        If there is no such part, its name is taken, importing it fails, or it is something else.
    """
    kind = GROUPS[group]
    points = installed(group)
    refuse_taken(group, built_in)
    if text in points:
        if len(points[text]) > 1:
            both = " and ".join(_described(point) for point in points[text])
            raise UsageError(f"{kind} {text!r}: two distributions have taken the name, {both}; uninstall one")
        label = f"{kind} {text!r} ({_described(points[text][0])})"
        value = _loaded(points[text][0].value, label)
    elif REFERENCE.fullmatch(text):
        label = f"{kind} {text}"
        value = _loaded(text, label)
    else:
        names = sorted({*built_in, *points})
        there = f"there are {', '.join(names)}, and any" if names else "none is installed; write"
        raise UsageError(f"no {kind} {text!r}; {there} module:object{did_you_mean(text, names)}")
    if not fits(value):
        shown = repr(value)
        raise UsageError(f"{label}: {shown[:60] + '...' * (len(shown) > 60)} is not {wanted}")
    return Part(label, value)


def load_model(group: str, text: str) -> type:
    """Return the class of a motion model or a sensor model of `ciberrato.bayes`, or of one that others wrote.

    Parameters
    ----------
    group : {"ciberrato.motion_models", "ciberrato.sensor_models"}
    text : str
        Name of a class of `ciberrato.bayes.motion` or `ciberrato.bayes.sensors`, of an entry point, or
        ``module:object``.

    Returns
    -------
    type
        With a method ``predict`` (motion) or ``log_likelihood`` (sensor).

    Raises
    ------
    UsageError
        As in `load_part`.
    """
    own = models(group)
    if text in own:
        refuse_taken(group, own)
        return own[text]
    method = _MODELS[group][1]
    part = load_part(
        group,
        text,
        fits=lambda value: isinstance(value, type) and callable(getattr(value, method, None)),
        wanted=f"a class with a method {method}",
        built_in=own,
    )
    model: type = part.value
    return model


def models(group: str) -> dict[str, type]:
    """List the models that `ciberrato.bayes` has, by the names of their classes."""
    home, method = _MODELS[group]
    package = importlib.import_module(home)
    modules = [importlib.import_module(f"{home}.{name}") for name in package.__all__]
    return {
        name: value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == module.__name__ and not name.startswith("_")
        if callable(getattr(value, method, None))
    }


def failure(label: str, error: BaseException) -> UsageError:
    """Return in a line what a part raised, and where: in which line that is neither Python's nor ours."""
    import traceback

    frames = [one for one in traceback.extract_tb(error.__traceback__) if _is_foreign(one.filename)]
    place = f" ({os.path.basename(frames[-1].filename)}:{frames[-1].lineno})" if frames else ""
    words = " ".join(str(error).split())
    return UsageError(f"{label}: {type(error).__name__}{': ' * bool(words)}{words}{place}")


def guarded(kind: type, label: str, methods: Iterable[str]) -> type:
    """Derive a class whose methods turn what they raise into a line.

    Parameters
    ----------
    kind : type
    label : str
        Name of the part and of its distribution; see `ciberrato.plugins.Part`.
    methods : iterable of str
        Methods that a simulation calls, and properties that it reads.

    Returns
    -------
    type
        Of the same name. Its methods raise `UsageError`, with the file and the line where it happened.
    """
    members: dict[str, Any] = {"__module__": kind.__module__, "__qualname__": kind.__qualname__}
    for name in methods:
        member = getattr(kind, name)
        if isinstance(member, property):
            if member.fget is not None:
                members[name] = property(_telling(member.fget, label))
        else:
            members[name] = _telling(member, label)
    return type(kind.__name__, (kind,), members)


def _telling(method: Callable[..., Any], label: str) -> Callable[..., Any]:
    @functools.wraps(method)
    def told(*args: Any, **kwargs: Any) -> Any:
        try:
            return method(*args, **kwargs)
        except CiberratoError:
            raise
        except Exception as error:
            raise failure(label, error) from None

    return told


def _is_foreign(path: str) -> bool:
    import sysconfig

    home = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    ours = tuple(os.path.join(home, name, "") for name in ("ciberrato", "agent", "simulator_stub"))
    library = path.startswith(os.path.join(sysconfig.get_path("stdlib"), ""))
    installed_there = "site-packages" in path or "dist-packages" in path
    return not path.startswith(("<", *ours)) and (installed_there or not library)


def _loaded(reference: str, label: str) -> Any:
    match = REFERENCE.fullmatch(re.sub(r"\s*\[.*\]\s*$", "", reference).replace(" ", ""))
    if match is None:
        raise UsageError(f"{label}: {reference!r} is not module:object")
    name, attributes = match.groups()
    try:
        value = _import(name)
    except Exception as error:
        raise failure(f"{label} cannot be loaded", error) from None
    for attribute in attributes.split("."):
        if not hasattr(value, attribute):
            meant = did_you_mean(attribute, [one for one in dir(value) if not one.startswith("_")])
            raise UsageError(f"{label}: {name} has no {attributes!r}{meant}")
        value = getattr(value, attribute)
    return value


def _import(name: str) -> Any:
    """Import a module: from what is installed, and only if it is not there from the working folder."""
    top = name.partition(".")[0]
    here = os.getcwd()
    if importlib.util.find_spec(top) is None and here not in sys.path:
        sys.path.append(here)  # it stays: the module may import others there, later
        importlib.invalidate_caches()
    return importlib.import_module(name)


def _described(point: EntryPoint) -> str:
    owner = "" if point.dist is None else f", {point.dist.name} {point.dist.version}"
    return f"{point.value}{owner}"
