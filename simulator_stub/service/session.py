"""A simulation among its clients: registrations, messages in, messages out. No socket, no clock.

`Session.cycle` does what the real simulator does in a cycle, in its order:

1. read the robots' actions, in order of their ids;
2. record, for those who keep a record;
3. read registrations;
4. read the views' commands, in order of their registration;
5. simulate;
6. send Measures to the robots, in order of their ids;
7. send the status of each robot to each view;
8. change states.

A message that cannot be understood ends the reading from that client for the cycle; what is queued behind it
waits for the next one. What is no registration is dropped when it arrives (`service.reception`).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from ciberrato.errors import ProtocolError
from ciberrato.plaintext import plain
from ciberrato.protocol import (
    GridRequest,
    LabRequest,
    PanelRegistration,
    Refusal,
    Registration,
    RemoveRobot,
    Reset,
    Restart,
    RobotBeaconRegistration,
    Start,
    Stop,
    ViewCommand,
    ViewRegistration,
    encode,
    fit_reply,
)
from simulator_stub.recording.observer import Observer, overriding
from simulator_stub.service.allowance import DROPPED
from simulator_stub.service.attendance import Attendance
from simulator_stub.service.audience import Admission, Audience
from simulator_stub.service.clients import ANSWERS, RobotClient, ViewClient
from simulator_stub.service.complaints import Complaints
from simulator_stub.service.kidnapping import Kidnapper
from simulator_stub.service.reception import Reception
from simulator_stub.service.transports import NO_ROOM, Newcomer, Peer
from simulator_stub.simulation import Simulation
from simulator_stub.world.robot_state import OUT
from simulator_stub.world.simulator_state import SimulatorState

NAME_LIMIT = 600
"""Characters of a robot's name. The real simulator survives 600 and dies of 850; we refuse what is longer."""

TRIES = 1000
"""Cycles in which a registration is tried, where there is no descriptor for its channel."""


class Session:
    """Participants of a run, with the messages from and for them.

    Parameters
    ----------
    simulation : Simulation
    autostart : int
        Start, once, as soon as that many robots are registered; 0 = wait for a view's command.
    observers : sequence of Observer
    kidnapper : Kidnapper or None
        Moves a robot by hand, before the observers see that the actions are read.
    restarts : bool
        Whether a robot's ``Reset="On"`` is obeyed.
    admission : Admission
        Admission of views.
    notify : callable
        Told, in one line each, what people may want to know.
    clock : callable
        Seconds, monotonic: for how long views have been silent.

    Attributes
    ----------
    robots : dict of int to RobotClient
        By id, in order.
    audience : Audience
        Views and panels.
    dropped : Counter
        Number of dropped messages in this world, by `DROPPED`.
    before_measures : callable
        Called when a cycle is computed, and its Measures are about to go out: what has arrived by then
        does not answer them.
    make_room : callable
        Called where no descriptor is left, to free one.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        autostart: int = 0,
        observers: Sequence[Observer] = (),
        kidnapper: Kidnapper | None = None,
        restarts: bool = True,
        admission: Admission | None = None,
        notify: Callable[[str], None] = lambda line: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.simulation = simulation
        self._restarts = restarts
        self.observers = observers
        self._actions_read = overriding(observers, "actions_read")
        self._cycle_done = overriding(observers, "cycle_done")
        self._kidnapper = kidnapper
        self.robots: dict[int, RobotClient] = {}
        self.before_measures: Callable[[], None] = lambda: None
        self.make_room: Callable[[], None] = lambda: None
        self.dropped: Counter[str] = Counter()
        self._dropped_before: Counter[str] = Counter()
        self._clock = clock
        self._autostart = autostart
        self._autostarted = False
        self._told_of_start = False
        self._closed = False
        self._notify = notify
        self._complain = Complaints(notify)
        self.audience = Audience(admission or Admission(), self.dropped, notify)
        self._reception = Reception(self.dropped, self._complain)
        self._reply = encode(fit_reply(simulation.acceptance()))
        self._lab = encode(simulation.lab_shown())
        self._grid = encode(simulation.world.grid)

    def announce_lockstep(self) -> None:
        """Announce to clients, in the answer to their registration, that their answers are waited for."""
        self._reply = encode(fit_reply(replace(self.simulation.acceptance(), lockstep=True)))

    def welcome(self, newcomer: Newcomer, data: bytes) -> bool:
        """Process a message of a client that has not registered; a registration is answered in a cycle.

        Returns
        -------
        bool
            False if it was evidently none, and has cost next to nothing.
        """
        return self._reception.welcome(newcomer, data)

    @property
    def views(self) -> list[ViewClient]:
        """The views, in order of their registration."""
        return self.audience.views

    @property
    def registrations_waiting(self) -> bool:
        """Return whether a client waits to be registered."""
        return bool(self._reception)

    @property
    def start_is_due(self) -> bool:
        """Return whether enough robots are there for the automatic start, and it has not happened yet."""
        return 0 < self._autostart <= len(self.robots) and not self._autostarted

    def cycle(self) -> None:
        """Run one cycle."""
        simulation = self.simulation
        before = simulation.state
        # Judged before anybody registers in this cycle: so every robot sees a stopped cycle first, however
        # registrations and cycles fall together.
        start = before is SimulatorState.STOPPED and self.start_is_due
        simulation.begin_cycle()
        self._read_actions(running=before is SimulatorState.RUNNING)
        if simulation.restart_requested and self._restarts:
            self._restart()
        elif simulation.restart_requested:
            self._complain("a robot requested a restart, which --no-restart disables")
        if self._kidnapper is not None:
            self._kidnapper.before_move(simulation)
        for actions_read in self._actions_read:
            actions_read(simulation)
        if self._reception:
            self._check_in()
        if start:
            self._autostarted = True
            simulation.start()
        if self.audience.views:
            self._read_commands()
        messages = simulation.advance_encoded()
        for cycle_done in self._cycle_done:
            cycle_done(simulation)
        self.before_measures()
        for robot_id, data in messages.items():
            client = self.robots[robot_id]
            client.answered = False
            client.peer.send(data)
        views = self.audience.views
        if views:
            statuses = [encode(status) for status in simulation.statuses()]
            for view in views:
                for status in statuses:
                    view.peer.send(status)
        simulation.end_cycle()
        state = simulation.state
        if state is not before:
            self._state_changed()
        if state is SimulatorState.STOPPED and self.robots and not self._told_of_start:
            self._tell_of_start()
        while simulation.scoring.notes:
            self._notify(simulation.scoring.notes.pop(0))

    def answers(self, robot_id: int) -> dict[str, int | None]:
        """Return what the result file says of which Measures a robot answered (`Attendance.document`)."""
        return self.robots[robot_id].attendance.document()

    def tick(self, now: float) -> None:
        """Remove views that have gone; called about once per CycleTime.

        Parameters
        ----------
        now : float
            Seconds by the session's clock.
        """
        self.audience.tick(now)

    def take_stock(self) -> dict[str, int]:
        """Return what was dropped in this world, by `DROPPED`, all of it."""
        for client in self.robots.values():
            client.dropped += client.peer.overflow()
        self.audience.count()
        self.dropped["robot_messages"] = sum(client.dropped for client in self.robots.values())
        return {name: self.dropped[name] for name in DROPPED}

    def dropped_in_all(self) -> dict[str, int]:
        """Return what was dropped in all worlds so far, without what is 0."""
        now = self.take_stock()
        total = {name: now[name] + self._dropped_before[name] for name in DROPPED}
        return {name: number for name, number in total.items() if number}

    def _read_actions(self, *, running: bool) -> None:
        """Apply what has come from the robots; in a running cycle, count who has answered."""
        simulation = self.simulation
        for robot in simulation.robots:
            client = self.robots[robot.robot_id]
            client.taken = 0
            messages = client.messages
            if running and robot.state not in OUT:
                attendance = client.attendance
                if len(messages) == 1 and not attendance.missed_in_a_row:  # as nearly always
                    attendance.answered += 1
                    attendance.last_answer = simulation.time
                else:
                    attendance.count(simulation.time, len(messages))
            while messages:
                message = messages.popleft()
                if isinstance(message, ProtocolError):
                    self._complain(f"robot {robot.robot_id}: {message}")
                    break
                robot.apply(message)
                if message.reset:
                    simulation.restart_requested = True

    def _check_in(self) -> None:
        for newcomer, registration in self._reception.admit():
            peer = self._open(newcomer, registration)
            if peer is None:
                continue
            self._register(peer, registration)
            for data in newcomer.followers or ():
                peer.deliver(data)

    def _open(self, newcomer: Newcomer, registration: Registration) -> Peer | None:
        """Open a client's channel; None where that cannot be, now or ever."""
        for room_made in (False, True):
            try:
                return newcomer.accept()
            except OSError as error:
                if error.errno not in NO_ROOM or newcomer.faults >= TRIES:
                    self._complain(f"registration from {newcomer.label}: {error.strerror}")
                    self.dropped["registrations"] += 1
                    return None
                if not room_made:
                    self.make_room()
        if newcomer.faults == 0:
            why = "no file descriptor is left; raise the limit (ulimit -n)"
            self._complain(f"registration from {newcomer.label} waits: {why}")
        newcomer.faults += 1
        self._reception.put_back(newcomer, registration)
        return None

    def _register(self, peer: Peer, registration: Registration) -> None:
        if isinstance(registration, ViewRegistration | PanelRegistration):
            refusal = self.audience.admit(peer, registration, self._clock())
            if refusal is not None:
                self._refuse(peer, f"a view: {refusal}")
                return
            if isinstance(registration, ViewRegistration):
                self.simulation.note_client()
            peer.send(self._reply)
            return
        robot_id = None
        if len(registration.name or "") <= NAME_LIMIT:
            robot_id = self.simulation.register(registration)
        if robot_id is None:
            self._refuse(peer, f"a robot at position {registration.robot_id}")
            return
        if isinstance(registration, RobotBeaconRegistration):
            self._lab = encode(self.simulation.lab_shown())
        self.robots[robot_id] = RobotClient(robot_id, peer)
        self.robots = dict(sorted(self.robots.items()))
        peer.send(self._reply)
        name = registration.name and plain(registration.name, 40)
        self._notify(f"robot {robot_id}, {name!r}, registered from {peer.label}")

    def _tell_of_start(self) -> None:
        """Report once what a registered robot waits for."""
        if self.start_is_due:
            return
        self._told_of_start = True
        missing = 0 if self._autostarted else self._autostart - len(self.robots)
        more = f"{missing} more robot{'s' * (missing > 1)}, or for " if missing > 0 else ""
        self._notify(f"waiting for {more}Start (a viewer has the button; --autostart N starts with N robots)")

    def _refuse(self, peer: Peer, who: str) -> None:
        peer.send(encode(Refusal()))
        peer.close()
        self._complain(f"refused {who}, from {peer.label}")

    def _read_commands(self) -> None:
        for view in tuple(self.audience.views):
            view.taken = view.answers = 0
            while view.messages:
                message = view.messages.popleft()
                if isinstance(message, ProtocolError):
                    self._complain(f"view at {view.peer.label}: {message}")
                    break
                self._obey(view, message)
                if not self.views:  # a Reset has forgotten them all, this one too
                    return
        self.audience.forget_closed()

    def _obey(self, view: ViewClient, command: ViewCommand) -> None:
        match command:
            case Start():
                self.simulation.start()
            case Stop():
                self.simulation.stop()
            case LabRequest() | GridRequest():
                if view.answers >= ANSWERS:
                    self.dropped["requests"] += 1
                    return
                view.answers += 1
                view.peer.send(self._lab if isinstance(command, LabRequest) else self._grid)
            case RemoveRobot(robot_id=robot_id):
                self.simulation.remove(robot_id)
            case Reset():
                self.reset()

    def _restart(self) -> None:
        """Restart with all clients still registered: the effect of a robot's ``Reset="On"``."""
        self._end_world()
        for client in self.robots.values():
            client.attendance = Attendance()
        self.simulation.restart()
        for view in self.views:
            view.peer.send(encode(Restart()))
        self._notify("restart, as requested by a robot")

    def _end_world(self) -> None:
        if self._kidnapper is not None:
            self._kidnapper.world_ended(self.simulation)
        for observer in self.observers:
            observer.world_ended(self.simulation)
        self._dropped_before.update(self.take_stock())
        self.dropped.clear()
        for client in self.robots.values():
            client.dropped = 0

    def reset(self, seed: int | None = None) -> None:
        """Reset: forget all clients and begin again.

        Parameters
        ----------
        seed : int, optional
            Seed of the new world; by default it follows from the old one.
        """
        self._end_world()
        for view in self.views:
            view.peer.send(encode(Restart()))
        for peer in (
            *(view.peer for view in (*self.views, *self.audience.panels)),
            *(client.peer for client in self.robots.values()),
        ):
            peer.close()
        self.audience.forget_closed()
        self._complain.forget()
        self.robots = {}
        self._autostarted = self._told_of_start = False
        self.simulation.reset(seed)
        self._lab = encode(self.simulation.lab_shown())
        self._notify("reset")

    def _state_changed(self) -> None:
        state = self.simulation.state
        # Before the first Start nothing has stopped: what is waited for is told when a robot is there.
        if state is not SimulatorState.STOPPED or self.simulation.time:
            self._notify(f"{state.value.lower()} at time {self.simulation.time}")
        if state is SimulatorState.RUNNING:
            for client in self.robots.values():
                client.silent = False

    def close(self) -> None:
        """Finish all records; closing twice does no harm."""
        if self._closed:
            return
        self._closed = True
        self._end_world()
        for observer in self.observers:
            observer.close()
