"""User's settings of a run of the agent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from ciberrato.files.run_records import DistanceModel, Preset
    from ciberrato.world.lab import Lab


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """User's settings of a run.

    Attributes
    ----------
    host : str
    port : int
    transport : {"udp", "tcp"}
    position : int
        Position in the start grid; 0 = any free one.
    name : str
        The robot's.
    lab : Lab
    lab_file : Path
    lab_data : bytes
        Contents of the file.
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    cruise : float
        Units per cycle.
    exit_at_wall : bool
    preset : {"seed", "calibrated"}
    distance_model : {"sensor", "cone"}
    precision : int
        Decimals in the belief file.
    seed : int or None
        The simulation's, for the log only.
    log : Path
    output : Path
    silence : float
        Seconds without Measures after which the simulator is taken to be gone.
    give_up_after : float or None
        Seconds without an answer to the registration.
    reconnect : bool
        Whether another run follows one whose simulator has gone: then refusals are waited out, too.
    lockstep : bool
        Whether the simulator is known to wait for every answer: then no clock has a say.
    quiet : bool
        Whether to print nothing but errors.
    """

    host: str
    port: int
    transport: Literal["udp", "tcp"]
    position: int
    name: str
    lab: Lab
    lab_file: Path
    lab_data: bytes
    angles: tuple[float, float, float, float]
    cruise: float
    exit_at_wall: bool
    preset: Preset
    distance_model: DistanceModel
    precision: int
    seed: int | None
    log: Path
    output: Path
    silence: float
    give_up_after: float | None
    quiet: bool
    reconnect: bool = False
    lockstep: bool = False
