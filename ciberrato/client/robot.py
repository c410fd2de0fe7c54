"""`Robot`: a robot's program in a few lines, over UDP, TCP, or in the same process as the simulation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ciberrato.client.channel import (
    Channel,
    LinkChannel,
    SimulationChannel,
    SteppedSimulation,
    check_seconds,
)
from ciberrato.client.controls import Controls
from ciberrato.client.core import RobotCore
from ciberrato.client.run_recorder import RunRecorder

if TYPE_CHECKING:
    from ciberrato.protocol.messages import Measures
    from ciberrato.world.lab import Lab


class Robot(Controls):
    """A robot in a CiberRato simulation; the loop over it is the robot's life.

    The loop ends when the run ends (`ended` says why). In every cycle the newest Measures are shown and
    exactly one message goes back. While the simulator does not run, before Start and in a pause, the program
    is not asked and the motors are held at 0.

    Parameters
    ----------
    name : str
        As viewers show it.
    host : str
        HOST[:PORT] of the simulator, the real one or ours; port 6000 if it is not named.
    position : int
        Position in the start grid, from 1; 0 = the first free one.
    angles : sequence of four float, optional
        Mounting angles of the IR sensors in degrees, counter-clockwise from the front; default: 0, 60, -60,
        180.
    transport : {"udp", "tcp"}
        The real simulator has UDP only.
    log : str or Path, optional
        File for the run's log (JSON Lines), which `ciberrato-viewer --run` shows.
    localize : Lab or str or Path, optional
        Localize live in this lab, named as it ships, by its file, or read already; see `pose`.
    every_cycle : bool
        Show the Measures of cycles in which the simulator does not run, too.
    timeout : float
        Seconds without Measures after which the simulator is taken to be gone.
    give_up_after : float
        Seconds without an answer to the registration, which is repeated meanwhile.
    simulation : Simulation, optional
        Drive in this one, in the same process; `host` and `transport` do not count.

    Raises
    ------
    UsageError
        If an argument cannot be used.
    SilenceError
        If no simulator answers in time.
    RefusedError
        If the simulator refuses the robot.

    Examples
    --------
    >>> from ciberrato import Robot, find_grid, find_lab, read_grid, read_lab
    >>> from simulator_stub.simulation import Simulation
    >>> simulation = Simulation(read_lab(find_lab("maze")), read_grid(find_grid("maze")), seed=7)
    >>> with Robot("r2", simulation=simulation) as robot:
    ...     for measures in robot:
    ...         robot.drive(0.1, 0.1 if measures.infrared[0] < 2 else -0.1)
    ...         if measures.time == 100:
    ...             robot.finish()
    >>> robot.ended.value
    'EndLed is on: the robot has finished'
    """

    def __init__(
        self,
        name: str = "robot",
        host: str = "localhost:6000",
        *,
        position: int = 0,
        angles: Iterable[float] | None = None,
        transport: Literal["udp", "tcp"] = "udp",
        log: str | Path | None = None,
        localize: Lab | str | Path | None = None,
        every_cycle: bool = False,
        timeout: float = 2.0,
        give_up_after: float = 10.0,
        simulation: SteppedSimulation | None = None,
    ) -> None:
        check_seconds("timeout", timeout)
        check_seconds("give_up_after", give_up_after)
        core = RobotCore(name, position=position, angles=angles, every_cycle=every_cycle)
        recorder = RunRecorder(log, localize, wait=simulation is not None)
        channel: Channel = (
            LinkChannel(host, transport) if simulation is None else SimulationChannel(simulation)
        )
        super().__init__(core, channel, recorder, timeout)
        try:
            self._begin(channel.register(core.registration, give_up_after))
        except BaseException:
            self._abandon()
            raise

    def __iter__(self) -> Iterator[Measures]:
        return self

    def __next__(self) -> Measures:
        """Answer the last Measures and wait for the next ones.

        Raises
        ------
        StopIteration
            If the run is over.
        SilenceError
            If no Measures come.
        """
        self._answer()
        while self._goes_on:
            shown = self._take(self._channel.receive(self._patience))
            if shown is not None:
                return shown
        raise StopIteration

    def __enter__(self) -> Robot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
