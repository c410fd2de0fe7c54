"""Many environments: one `BatchSimulation`, world by world the same as single environments."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.errors import UsageError
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
from ciberrato.gym.signals import Signals, of_batch
from simulator_stub.batch import BatchSimulation
from simulator_stub.batch.arguments import threads_of

Observations = NDArray[np.float32]
Step = tuple[Observations, Floats, Booleans, Booleans, dict[str, Any]]


class CiberRatoVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """Robots in labs, each alone, with a task.

    Parameters
    ----------
    task : str
        "navigate", "localize" or "circuit".
    num_envs : int
    autoreset_mode : AutoresetMode or str
        Whether an environment that is done begins anew with the next call of `step` ("NextStep"), with the
        same ("SameStep"; then ``final_obs`` and ``final_info`` are in the infos), or by `reset` with a mask
        only ("Disabled").
    render_mode : str, optional
        "rgb_array".
    compiled : bool, optional
        Use machine code made by numba; the results are the same. Default: if numba is installed.
    threads : int, optional
        At most so many work at a time, with `compiled`; default: one for each core.
    **choices
        As for `ciberrato.gym.single.CiberRatoEnv`.

    Raises
    ------
    UsageError
        There is no such task, or an option cannot be used.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # as Gymnasium declares it
        "render_modes": ["rgb_array"],
        "render_fps": FRAMES_PER_SECOND,
    }

    def __init__(
        self,
        task: str = "navigate",
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        compiled: bool | None = None,
        threads: int | None = None,
        **choices: Unpack[Choices],
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode {render_mode!r} is none of {self.metadata['render_modes']}")
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.scenario, self.task = make_task(task, num_envs, choices)
        self.single_observation_space = observation_space(self.task)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        has_numba = importlib.util.find_spec("numba") is not None
        self._compiled = has_numba if compiled is None else compiled
        if self._compiled and not has_numba:
            raise UsageError("compiled=True needs numba: pip install 'ciberrato[fast]'")
        self._threads = threads_of(threads)
        self._generators: list[np.random.Generator] | None = None
        self._seeds: list[int] = []
        self._batch: BatchSimulation | None = None
        self._signals: Signals
        self._episodes: list[Episode] = []
        self._done = np.zeros(num_envs, np.bool_)
        self._all = np.ones(num_envs, np.bool_)
        self._pictures: dict[int, Picture] = {}

    # --- random numbers: one generator for each environment ------------------------------------------------

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Return the generators of the environments."""
        self._seed([None] * self.num_envs, self._all)
        assert self._generators is not None
        return tuple(self._generators)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Return the seeds of the generators."""
        self._seed([None] * self.num_envs, self._all)
        return tuple(self._seeds)

    def _seed(self, seeds: Sequence[int | None], which: Booleans) -> None:
        if self._generators is None:
            made = [seeding.np_random(seed) for seed in seeds]
            self._generators, self._seeds = [one for one, _ in made], [int(seed) for _, seed in made]
            return
        for world, seed in enumerate(seeds):
            if seed is not None and which[world]:
                self._generators[world], self._seeds[world] = seeding.np_random(seed)

    # --- episodes -----------------------------------------------------------------------------------------

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Let environments begin an episode.

        Parameters
        ----------
        seed : int, or sequence of int or None; optional
            One for each environment, or that of the first: the others count on from it.
        options : dict, optional
            ``reset_mask``: array of bool, shape (num_envs,), says which; default all. ``lab``, ``start``: as
            for one environment.

        Returns
        -------
        observations : array, shape (num_envs, columns)
            Of all, those that go on included.
        infos : dict
            Of those that begin.
        """
        seeds: Sequence[int | None]
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + world for world in range(self.num_envs)]
        else:
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise ValueError(f"there must be {self.num_envs} seeds, one for each: {len(seeds)}")
        asked = dict(options or {})
        mask = self._mask(asked.pop("reset_mask", None))
        self._seed(seeds, mask)
        which = np.flatnonzero(mask)
        self._begin(which, asked)
        signals = self._signals
        return self.task.observe(signals), _infos(
            {"score": signals.score, "success": np.zeros(self.num_envs, np.bool_)}, mask
        )

    def _mask(self, mask: Any) -> Booleans:
        if mask is None:
            return self._all
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"options['reset_mask'] must be a numpy array of bool: {mask!r}")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"options['reset_mask'] must have the shape ({self.num_envs},): {mask.shape}")
        if not mask.any():
            raise ValueError("options['reset_mask'] must name one environment at least")
        if self._batch is None and not mask.all():
            raise gymnasium.error.ResetNeeded("the first reset must be of all environments")
        return mask

    def _begin(self, which: Integers, options: dict[str, Any] | None = None) -> None:
        """Draw episodes for some environments, and put them at their starts."""
        assert self._generators is not None
        generators = [self._generators[world] for world in which.tolist()]
        episodes = [self.scenario.draw(generator, options) for generator in generators]
        parts: dict[str, Any] = {
            "starts": np.array([episode.start for episode in episodes]).reshape(-1, 3),
            "parameters": [episode.parameters for episode in episodes],
            "seeds": generators,
        }
        if self._batch is None:
            self._batch = BatchSimulation(
                [episode.lab for episode in episodes],
                **parts,
                labs_to_come=self.scenario.labs,
                line_sensor=False,
                scoring=self.task.mode,
                compiled=self._compiled,
                threads=self._threads,
            )
            self._episodes = episodes
        else:
            if len(self.scenario.labs) > 1:
                parts["labs"] = [episode.lab for episode in episodes]
            if self.scenario.noise[0] == self.scenario.noise[1]:
                del parts["parameters"]
            self._batch.reset(which, **parts)
            for world, episode in zip(which.tolist(), episodes, strict=True):
                self._episodes[world] = episode
        self._done[which] = False
        self._signals = of_batch(self._batch)
        self.task.begin(which, self._signals, episodes)

    def step(self, actions: ArrayLike) -> Step:
        """Do one cycle in all environments.

        Parameters
        ----------
        actions : array_like, shape (num_envs, 2)
            Powers of the left and right motors, in shares of the greatest.

        Returns
        -------
        observations : array, shape (num_envs, columns)
        rewards : array, shape (num_envs,)
        terminations, truncations : array of bool, shape (num_envs,)
        infos : dict
            ``score`` and ``success``, as in one environment.
        """
        batch = self._batch
        if batch is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._done.any():
            done = np.flatnonzero(self._done).tolist()
            raise gymnasium.error.ResetNeeded(
                f"environments {done} are done: reset(options={{'reset_mask': ...}}) before step()"
            )
        commands = powers(actions, (self.num_envs, 2))
        beginning = self._done.copy()
        some_begin = bool(beginning.any())
        active = ~beginning if some_begin else self._all
        batch.step(commands, self.task.leds(self._signals))
        signals = self._signals = of_batch(batch)
        rewards, terminations, success = self.task.advance(signals, commands, active)
        truncations = (signals.time >= self.scenario.parameters.sim_time) & ~terminations
        terminations, success = terminations.copy(), success.copy()
        if some_begin:
            self._begin(np.flatnonzero(beginning))
            signals = self._signals
            for array in (rewards, terminations, truncations, success):
                array[beginning] = 0
        observations = self.task.observe(signals)
        infos = _infos({"score": signals.score, "success": success}, self._all)
        self._done = terminations | truncations
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any():
            observations, infos = self._begin_at_once(observations, infos)
        return observations, rewards, terminations, truncations, infos

    def _begin_at_once(
        self, observations: Observations, infos: dict[str, Any]
    ) -> tuple[Observations, dict[str, Any]]:
        """Let environments that are done begin, and keep what they ended with."""
        ended = self._done.copy()
        final = np.full(self.num_envs, None, object)
        for world in np.flatnonzero(ended).tolist():
            final[world] = observations[world].copy()
        last = {name: infos[name] for name in ("score", "success")}
        self._begin(np.flatnonzero(ended))
        signals = self._signals
        now = {"score": signals.score, "success": last["success"] & ~ended}
        return self.task.observe(signals), {
            "final_obs": final,
            "_final_obs": ended,
            "final_info": _infos(last, ended),
            "_final_info": ended.copy(),
            **_infos(now, self._all),
        }

    def poses(self) -> Floats:
        """Return the true poses: x, y in units and heading in radians, shape (num_envs, 3)."""
        if self._batch is None:
            raise gymnasium.error.ResetNeeded("call reset() before poses()")
        return self._batch.poses()

    # --- pictures -----------------------------------------------------------------------------------------

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Show all worlds: a picture of each, shape (height, width, 3), in the mode "rgb_array"."""
        if self._batch is None:
            raise gymnasium.error.ResetNeeded("call reset() before render()")
        if self.render_mode is None:
            gymnasium.logger.warn("render() shows nothing without a render_mode: make(..., render_mode=...)")
            return None
        for episode in self._episodes:
            if episode.number not in self._pictures:
                self._pictures[episode.number] = Picture(episode.lab)
        return tuple(
            self._pictures[episode.number].draw(pose)
            for episode, pose in zip(self._episodes, self._batch.poses(), strict=True)
        )

    def close_extras(self, **kwargs: Any) -> None:
        """Let go of the worlds."""
        self._batch = None
        # Older versions of Gymnasium close what was refused before it was made, too.
        task = getattr(self, "task", None)
        if task is not None:
            task.close()


def _infos(values: dict[str, NDArray[Any]], mask: Booleans) -> dict[str, Any]:
    """Put infos together: arrays, 0 where the mask is not set, and the mask of each beside it."""
    infos: dict[str, Any] = {}
    for name, array in values.items():
        infos[name] = array.copy() if mask.all() else np.where(mask, array, np.zeros((), array.dtype))
        infos[f"_{name}"] = mask.copy()
    return infos
