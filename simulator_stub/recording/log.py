"""The log, in the real simulator's XML format: for its log player, and to look at a run afterwards."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ciberrato.protocol import encode_parameters, grid_to_xml, lab_to_xml, measures_to_xml
from ciberrato.protocol.text import attribute, general
from simulator_stub.recording.observer import Lost, WorldFile, lose_nothing
from simulator_stub.world.simulator_state import SimulatorState

if TYPE_CHECKING:
    from pathlib import Path

    from simulator_stub.simulation import Simulation
    from simulator_stub.world.robot import Robot

WORD = 0xFFFFFFFF
"""Scores are written as 32 bits without sign, as the real simulator does."""

_ROBOT = """\
\t<Robot Name="%s" Id="%d" State="%s">
\t\t<Pos X="%s" Y="%s" Dir="%s"/>
\t\t<Scores Score="%d" ArrivalTime="%d" ReturningTime="%d" Collisions="%d" Collision="%s" VisitedMask="%s"/>
"""


class LogFile(WorldFile):
    """Writes a record for each running cycle, and one more when the time is over.

    A record holds the state before the cycle, and the actions that were read for it.

    Parameters
    ----------
    path : Path
        Overwritten if it exists. Worlds after the first go into files of their own, with -2, -3, ... before
        the suffix.
    date : str
        Date in the log, as C's ``ctime`` writes it; the only thing in it that the seed does not
        fix.
    lost : callable
        Told when the record ends early; there is no ``</Log>`` in it then.
    """

    def __init__(self, path: Path, date: str, lost: Lost = lose_nothing) -> None:
        self._date = date
        self._begun = False
        self._ended = False
        super().__init__(path, lost)

    def actions_read(self, simulation: Simulation) -> None:
        """Write the state that a running cycle begins with."""
        if simulation.state is SimulatorState.RUNNING:
            self._begin(simulation)
            self.write(log_record(simulation, over=False))

    def cycle_done(self, simulation: Simulation) -> None:
        """Write the last state, if the time is over."""
        limit = simulation.world.parameters.sim_time
        if simulation.state is SimulatorState.RUNNING and 0 < limit <= simulation.time:
            self.write(log_record(simulation, over=True))
            self._end()

    def world_ended(self, simulation: Simulation) -> None:
        """Finish the document; nothing was written if time never passed."""
        if self._begun and not self._ended:
            self._end()
        self._begun = self._ended = False
        super().world_ended(simulation)

    def _begin(self, simulation: Simulation) -> None:
        if not self._begun:
            self._begun = True
            self.write(log_header(simulation, self._date))

    def _end(self) -> None:
        self._ended = True
        self.write("</Log>\n")
        self.flush()


def log_header(simulation: Simulation, date: str) -> str:
    """Write what a log begins with.

    Returns
    -------
    str
        From ``<Log`` to the newline after ``</Grid>``.
    """
    world = simulation.world
    return (
        f'<Log Date="{attribute(date, "Log Date")}" >\n'
        + encode_parameters(world.parameters, len(world.lab.beacons))
        + lab_to_xml(simulation.lab_shown())
        + grid_to_xml(world.grid)
    )


def log_record(simulation: Simulation, *, over: bool) -> str:
    """Write one record: after the actions are read, or when the time is over.

    Parameters
    ----------
    simulation : Simulation
    over : bool
        Whether it is the last record: without actions, and with both buttons off.

    Returns
    -------
    str
        From ``<LogInfo`` to the newline after ``</LogInfo>``.
    """
    robots = "".join(_robot(simulation, robot, over=over) for robot in simulation.robots)
    return f'<LogInfo Time="{simulation.time}">\n{robots}</LogInfo>\n'


def _robot(simulation: Simulation, robot: Robot, *, over: bool) -> str:
    measures = simulation.readings(robot, over=over)
    head = _ROBOT % (
        attribute(robot.name, "Robot Name"),
        robot.robot_id,
        robot.state.value,
        general(robot.x),
        general(robot.y),
        general(robot.heading_degrees),
        robot.score & WORD,
        robot.arrival_time & WORD,
        robot.returning_time & WORD,
        robot.collisions & WORD,
        "True" if robot.collides else "False",
        robot.visited_mask(len(simulation.world.lab.targets)),
    )
    action = "" if over else _action(robot)
    return f"{head}{action}{measures_to_xml(measures, log=True)}\t</Robot>\n"


def _action(robot: Robot) -> str:
    """Write what arrived for the coming cycle; a lone VisitingLed leaves nothing."""
    received = robot.received
    if not received - {"visiting_led"}:
        return ""
    parts = []
    for field, name, power in (
        ("left_motor", "LeftMotor", robot.left_command),
        ("right_motor", "RightMotor", robot.right_command),
    ):
        if field in received:
            parts.append(f'{name}="{general(power)}" ')
    for field, name, led in (
        ("end_led", "EndLed", robot.end_led),
        ("returning_led", "ReturningLed", robot.returning_led),
        ("visiting_led", "VisitingLed", robot.visiting_led),
    ):
        if field in received:
            parts.append(f'{name}="{"On" if led else "Off"}" ')
    return f"\t\t<Action {''.join(parts)}/>\n"
