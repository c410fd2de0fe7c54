"""The states of the simulator, and everything that leads from one to another.

Nothing but `SimulatorStateMachine` changes the simulator's state. Events are judged by the *current*
state, and what they choose becomes the current one only when the cycle closes: a Start and a Stop that are
read in the same cycle do not cancel one another (while stopped the Start counts, while running the Stop).
"""

from __future__ import annotations

from enum import Enum


class SimulatorState(Enum):
    """States of the simulator as a whole; the value is the word for logs."""

    READY = "Ready"
    """No robot has registered since the beginning, or since a Reset."""
    STOPPED = "Stopped"
    """Robots stand still; sensors, LEDs and messages work."""
    RUNNING = "Running"
    """Time passes."""
    FINISHED = "Finished"
    """The run's time is over; only a Reset leads on."""


class SimulatorEvent(Enum):
    """Events that can change the simulator's state at the end of a cycle."""

    CLIENT_ACCEPTED = "a robot or a view was accepted"
    START = "Start"
    STOP = "Stop"
    TIME_UP = "the time of the run is over"


# What is not listed leaves the state as it is. A Reset begins a new machine.
TRANSITIONS: dict[tuple[SimulatorState, SimulatorEvent], SimulatorState] = {
    (SimulatorState.READY, SimulatorEvent.CLIENT_ACCEPTED): SimulatorState.STOPPED,
    (SimulatorState.STOPPED, SimulatorEvent.START): SimulatorState.RUNNING,
    (SimulatorState.RUNNING, SimulatorEvent.STOP): SimulatorState.STOPPED,
    (SimulatorState.RUNNING, SimulatorEvent.TIME_UP): SimulatorState.FINISHED,
}


class SimulatorStateMachine:
    """The current state and the one to come.

    Attributes
    ----------
    current : SimulatorState
        State in this cycle.
    coming : SimulatorState
        State in the next cycle, as far as this cycle has read; the buttons in Measures show it.
    """

    __slots__ = ("coming", "current")

    def __init__(self, state: SimulatorState = SimulatorState.READY) -> None:
        self.current = state
        self.coming = state

    @property
    def registrations_open(self) -> bool:
        """Return whether robots may register: always but while running."""
        return self.current is not SimulatorState.RUNNING

    @property
    def buttons(self) -> tuple[bool, bool]:
        """Buttons that Measures show: Start and Stop."""
        coming = self.coming
        return coming is SimulatorState.RUNNING, coming is SimulatorState.STOPPED

    def handle(self, event: SimulatorEvent) -> None:
        """Handle an event: set the coming state, if the event counts in the current one."""
        chosen = TRANSITIONS.get((self.current, event))
        if chosen is not None:
            self.coming = chosen

    def close_cycle(self) -> None:
        """Set the current state to the coming one."""
        self.current = self.coming
