"""The Lab and Grid documents that viewers get; the log document holds them too."""

from __future__ import annotations

from ciberrato.errors import ProtocolError
from ciberrato.protocol.text import attribute, general, strict_real
from ciberrato.protocol.xmltree import Element
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.start_grid import GridPosition, StartGrid

_LAB_DEFAULTS = Lab()
_WALL_DEFAULT_HEIGHT = Wall().height
_TARGET_DEFAULT_RADIUS = Target().radius


def lab_to_xml(lab: Lab) -> str:
    """Write a lab as the real simulator sends it: walls as polygons, without the border.

    Returns
    -------
    str
        From ``<Lab`` to the newline after ``</Lab>``; numbers with six significant digits.

    Raises
    ------
    UsageError
        If the name cannot be written in XML.
    """
    pieces = [
        f'<Lab Name="{attribute(lab.name, "Lab Name")}"'
        f' Height="{general(lab.height)}" Width="{general(lab.width)}">\n'
    ]
    pieces += (
        f'\t<Beacon X="{general(beacon.x)}" Y="{general(beacon.y)}" Height="{general(beacon.height)}"/>\n'
        for beacon in lab.beacons
    )
    pieces += (
        f'\t<Target X="{general(target.x)}" Y="{general(target.y)}" Radius="{general(target.radius)}"/>\n'
        for target in lab.targets
    )
    for wall in lab.walls:
        pieces.append(f'\t<Wall Height="{general(wall.height)}">\n')
        pieces += (f'\t\t<Corner X="{general(x)}" Y="{general(y)}"/>\n' for x, y in wall.corners)
        pieces.append("\t</Wall>\n")
    pieces.append("</Lab>\n")
    return "".join(pieces)


def grid_to_xml(grid: StartGrid) -> str:
    """Write a start grid as the real simulator sends it.

    Returns
    -------
    str
        From ``<Grid>`` to the newline after ``</Grid>``; numbers with six significant digits.
    """
    positions = "".join(
        f'\t<Position X="{general(p.x)}" Y="{general(p.y)}" Dir="{general(p.direction_deg)}"/>\n'
        for p in grid.positions
    )
    return f"<Grid>\n{positions}</Grid>\n"


def lab_from_element(root: Element) -> Lab:
    """Read the Lab document of a simulator or a log player; what is missing takes the lab file's defaults.

    Raises
    ------
    ProtocolError
        If a number is none, or the lab is given as Row patterns, which only lab files have.
    """
    beacons, targets, walls = [], [], []
    for child in root.children:
        if child.name == "Beacon":
            beacons.append(
                Beacon(x=_real(child, "X", 0.0), y=_real(child, "Y", 0.0), height=_real(child, "Height", 0.0))
            )
        elif child.name == "Target":
            radius = _real(child, "Radius", _TARGET_DEFAULT_RADIUS)
            targets.append(Target(x=_real(child, "X", 0.0), y=_real(child, "Y", 0.0), radius=radius))
        elif child.name == "Wall":
            corners = tuple(
                (_real(corner, "X", 0.0), _real(corner, "Y", 0.0))
                for corner in child.children
                if corner.name == "Corner"
            )
            walls.append(Wall(height=_real(child, "Height", _WALL_DEFAULT_HEIGHT), corners=corners))
        elif child.name == "Row":
            raise ProtocolError("Lab: child element Row belongs to lab files; on the wire walls have corners")
    return Lab(
        name=root.attributes.get("Name", _LAB_DEFAULTS.name),
        width=_real(root, "Width", _LAB_DEFAULTS.width),
        height=_real(root, "Height", _LAB_DEFAULTS.height),
        beacons=tuple(beacons),
        targets=tuple(targets),
        walls=tuple(walls),
    )


def grid_from_element(root: Element) -> StartGrid:
    """Read the Grid document of a simulator or a log player; what is missing is 0.

    Raises
    ------
    ProtocolError
        If a number is none.
    """
    return StartGrid(
        positions=tuple(
            GridPosition(
                x=_real(child, "X", 0.0), y=_real(child, "Y", 0.0), direction_deg=_real(child, "Dir", 0.0)
            )
            for child in root.children
            if child.name == "Position"
        )
    )


def _real(element: Element, name: str, default: float) -> float:
    text = element.attributes.get(name)
    return default if text is None else strict_real(text, f"{element.name} {name}")
