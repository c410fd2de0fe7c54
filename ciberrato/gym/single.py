"""One environment: a `Simulation` with one robot."""

from __future__ import annotations

from typing import Any, SupportsFloat, Unpack

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ciberrato.gym.human import Window
from ciberrato.gym.making import (
    FRAMES_PER_SECOND,
    Choices,
    action_space,
    make_task,
    observation_space,
    powers,
)
from ciberrato.gym.picture import Picture
from ciberrato.gym.scenario import Episode
from ciberrato.gym.signals import Signals, of_simulation
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

Observation = NDArray[np.float32]
_ROBOT = 1
_FIRST = np.zeros(1, np.int64)
_ACTIVE = np.ones(1, np.bool_)


class CiberRatoEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A robot in a lab, alone, with a task.

    Parameters
    ----------
    task : str
        "navigate", "localize" or "circuit": see `ciberrato.gym.tasks` and `ciberrato.gym.localize`.
    render_mode : str, optional
        "rgb_array", or "human": the viewer's page in a browser, whose address is printed.
    compiled : bool
        Compute IR distances in machine code made by numba; the results are the same.
    **choices
        ``labs``, ``starts``, ``noise``, ``parameters``, ``time_limit``: what episodes are drawn from, as
        `ciberrato.gym.scenario.Scenario` takes them.

    Raises
    ------
    UsageError
        There is no such task, or an option cannot be used.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # as Gymnasium declares it
        "render_modes": ["rgb_array", "human"],
        "render_fps": FRAMES_PER_SECOND,
    }

    def __init__(
        self,
        task: str = "navigate",
        *,
        render_mode: str | None = None,
        compiled: bool = False,
        **choices: Unpack[Choices],
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode {render_mode!r} is not one of {self.metadata['render_modes']}")
        self.render_mode = render_mode
        self.scenario, self.task = make_task(task, 1, choices)
        self.observation_space = observation_space(self.task)
        self.action_space = action_space()
        self._compiled = compiled
        self._episode: Episode | None = None
        self._simulation: Simulation | None = None
        self._signals: Signals | None = None
        self._pictures: dict[int, Picture] = {}
        self._window: Window | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed : int, optional
        options : dict, optional
            ``lab``: name of one of the labs; ``start``: x, y in units and direction in degrees.

        Returns
        -------
        observation : array, shape (columns,)
        info : dict
        """
        super().reset(seed=seed)
        episode = self._episode = self.scenario.draw(self.np_random, options)
        x, y, direction = episode.start
        grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=direction),))
        # All of the simulation's noise follows from four numbers that are drawn here.
        simulation = self._simulation = Simulation(
            episode.lab,
            grid,
            episode.parameters,
            seed=self.np_random,
            scoring=self.task.mode,
            compiled=self._compiled,
        )
        simulation.register(RobotRegistration(name="learner"))
        measures = simulation.launch()[_ROBOT]
        signals = self._signals = of_simulation(simulation, measures, self.task.targets)
        self.task.begin(_FIRST, signals, [episode])
        if self._window is not None:
            self._window.begin(simulation)
        if self.render_mode == "human":
            self.render()
        return self.task.observe(signals)[0], {"score": int(signals.score[0]), "success": False}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Run one cycle.

        Parameters
        ----------
        action : array_like, shape (2,)
            Powers of the left and right motors, in shares of the greatest.

        Returns
        -------
        observation : array, shape (columns,)
        reward : float
        terminated : bool
        truncated : bool
            The time is over.
        info : dict
            ``score``: the simulator's; ``success``: whether the task is done.
        """
        if self._simulation is None or self._signals is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        command = powers(action, (2,))
        lit = self.task.leds(self._signals)
        end, returning, visiting = (None,) * 3 if lit is None else (bool(led) for led in lit[0])
        left, right = command.tolist()
        actions = Actions(
            left_motor=left,
            right_motor=right,
            end_led=end,
            returning_led=returning,
            visiting_led=visiting,
        )
        measures = self._simulation.step({_ROBOT: actions})[_ROBOT]
        signals = self._signals = of_simulation(self._simulation, measures, self.task.targets)
        outcome = self.task.advance(signals, command[np.newaxis], _ACTIVE)
        terminated = bool(outcome.terminated[0])
        truncated = not terminated and measures.time >= self.scenario.parameters.sim_time
        if self.render_mode == "human":
            self.render()
        info = {"score": int(signals.score[0]), "success": bool(outcome.success[0])}
        return self.task.observe(signals)[0], float(outcome.reward[0]), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Show the world.

        Returns
        -------
        array of uint8, shape (height, width, 3), or None
            A picture in the mode "rgb_array".
        """
        if self._simulation is None or self._episode is None:
            raise gymnasium.error.ResetNeeded("call reset() before render()")
        if self.render_mode == "human":
            if self._window is None:
                self._window = Window(self._simulation, FRAMES_PER_SECOND)
            self._window.show(self._simulation)
            return None
        if self.render_mode is None:
            gymnasium.logger.warn("render() shows nothing without a render_mode: make(..., render_mode=...)")
            return None
        number = self._episode.number
        if number not in self._pictures:
            self._pictures[number] = Picture(self._episode.lab)
        return self._pictures[number].draw(self._simulation.poses()[0])

    def close(self) -> None:
        """Stop the viewer, if there is one; more calls do no harm."""
        window, self._window = self._window, None
        if window is not None:
            window.close()
        self.task.close()
