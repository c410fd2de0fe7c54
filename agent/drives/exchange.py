"""Messages and answers of a run: what was in effect when, what was lost, and what to ask for."""

from __future__ import annotations

from ciberrato.client.requests import RequestRota
from ciberrato.physics.kinematics import Command
from ciberrato.protocol.messages import Actions, Measures
from ciberrato.world.parameters import Parameters

_COMMANDS_KEPT = 20  # the newest; an older one cannot be the last before a message
_LONGEST_STEP_BACK = 50  # cycles; a time farther back than a late message can be is that of a new simulation


class Exchange:
    """Keeps account of the messages that came and of the answers that left.

    Parameters
    ----------
    parameters : Parameters
        As announced.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.time: int | None = None
        """Of the newest message, in simulated cycles."""
        self.command: Command | None = None
        """In effect from now on; None before the first answer."""
        self.lost = 0
        """Simulated cycles whose Measures never came."""
        self.unanswered = 0
        """Measures that were overtaken by a newer one before they were answered."""
        self._parameters = parameters
        self._requests = RequestRota(parameters)
        self._sent: list[tuple[float, Command]] = []

    def sent(self, time: float) -> None:
        """Note when the last answer left.

        Parameters
        ----------
        time : float
            Seconds, by the clock that stamps the arrivals.
        """
        if self.command is not None:
            self._sent = [*self._sent[-_COMMANDS_KEPT:], (time, self.command)]

    def command_in_effect(self, arrived: float | None) -> Command | None:
        """Return the command that moved the robot in the cycle that a message is about.

        Parameters
        ----------
        arrived : float or None
            When the message arrived; None = not known, taken to be after the last answer.

        Returns
        -------
        (float, float) or None
            The last one that had left before the message was there. An answer that leaves later, because this
            process had no time, acts in a later cycle.
        """
        if arrived is None or not self._sent:
            return self.command
        earlier = [command for time, command in self._sent if time < arrived]
        return earlier[-1] if earlier else None

    def under_way(self, arrived: float | None) -> int:
        """Count the newest answers that had not left when a message arrived: they act after its next cycle.

        Parameters
        ----------
        arrived : float or None
            See `command_in_effect`.
        """
        return 0 if arrived is None else sum(time >= arrived for time, _ in self._sent)

    def is_late(self, measures: Measures) -> bool:
        """Return whether a newer message has come before this one."""
        return self.time is not None and measures.time < self.time

    def is_of_another_run(self, measures: Measures) -> bool:
        """Return whether a message that is late cannot be of this simulation: it has begun again."""
        assert self.time is not None
        return self.time - measures.time > _LONGEST_STEP_BACK or measures.time == 0

    def take(self, measures: Measures) -> None:
        """Note a message that is not late."""
        if self.time is not None:
            self.lost += max(measures.time - self.time - 1, 0)
        self.time = measures.time

    def answer(self, command: Command) -> Actions:
        """Return the answer with a command, and with the sensors whose turn it is to be asked for."""
        self.command = command
        return Actions(left_motor=command[0], right_motor=command[1], requests=self._requests.next())

    def end_of_time(self, measures: Measures) -> str | None:
        """Return why the simulator goes on no longer, if that is so."""
        if measures.time > 0 and not measures.start and not measures.stop:
            return "the simulation is over"
        if 0 < self._parameters.sim_time <= measures.time:
            return "the run's time is up"
        return None
