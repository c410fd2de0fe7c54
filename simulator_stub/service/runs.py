"""End of a run, and its successor: the next run, or the end of the program."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.world.robot_state import OUT
from simulator_stub.world.simulator_state import SimulatorState

if TYPE_CHECKING:
    from simulator_stub.recording.results import Results
    from simulator_stub.service.session import Session

FAREWELL = 1
"""Cycles after the end of a run, so that its robots see that both buttons are off."""


class Runs:
    """Looks after each cycle whether the run is over.

    A run is over when its time is, or when every robot has finished, was removed, has closed its connection,
    or is silent for too long.

    Parameters
    ----------
    session : Session
    results : Results
    seed : int
        Seed of the first run; the next ones count up.
    most_silent : int or None
        Cycles in a row that a robot may leave unanswered before it counts as gone; None = any number.
    count : int
        Number of runs; 0: no limit, whatever happens to the robots.
    """

    def __init__(
        self, session: Session, results: Results, *, seed: int, count: int, most_silent: int | None = None
    ) -> None:
        self._session = session
        self._results = results
        self._seed = seed
        self._left = count
        self._most_silent = most_silent
        self._farewell = FAREWELL

    def go_on(self) -> bool:
        """Start the next run if it is time; return False if the last one is over."""
        if self._left == 0 or not self._over():
            self._farewell = FAREWELL
            return True
        if self._farewell > 0:
            self._farewell -= 1
            return True
        self._left -= 1
        if self._left == 0:
            return False
        self._farewell = FAREWELL
        self._seed += 1
        self._session.reset(self._seed)
        self._results.seed = self._seed
        return True

    def _over(self) -> bool:
        simulation = self._session.simulation
        if simulation.state is SimulatorState.FINISHED:
            return True
        if simulation.state is not SimulatorState.RUNNING or not simulation.robots:
            return False
        clients, most = self._session.robots, self._most_silent
        # A plain loop: this is asked after every cycle.
        for robot in simulation.robots:
            if robot.state not in OUT:
                client = clients[robot.robot_id]
                gone = most is not None and client.attendance.missed_in_a_row >= most
                if not (gone or client.peer.closed):
                    return False
        return True
