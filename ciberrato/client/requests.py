"""Asking for the sensors that a simulator sends on request only."""

from __future__ import annotations

from ciberrato.world.parameters import Parameters


class RequestRota:
    """The sensors that come on request only; in turn, if not all may be asked for at once.

    Parameters
    ----------
    parameters : Parameters
        As the simulator announced them.
    n_beacons : int
        Beacon sensors to ask for, where they are there and requestable.
    ground : bool
        Whether to ask for the ground sensor where it is requestable.
    """

    def __init__(self, parameters: Parameters, *, n_beacons: int = 0, ground: bool = False) -> None:
        names = [f"IRSensor{sensor}" for sensor in range(4)] if parameters.obstacle_requestable else []
        names += ["Compass"] if parameters.compass_requestable and parameters.compass_sensor else []
        names += ["Collision"] if parameters.collision_requestable else []
        names += ["Ground"] if ground and parameters.ground_requestable else []
        if parameters.beacon_requestable and parameters.beacon_sensor:
            names += [f"Beacon{beacon}" for beacon in range(n_beacons)]
        self._names = names
        self._at_once = min(parameters.requests_per_cycle, len(names))

    def next(self) -> tuple[str, ...]:
        """Return the names of the sensors to request now."""
        now = tuple(self._names[: self._at_once])
        self._names = [*self._names[self._at_once :], *now]
        return now
