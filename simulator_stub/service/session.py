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

A message that cannot be understood ends the reading from that client (or of registrations) for the cycle;
what is queued behind it waits for the next one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    GridRequest,
    LabRequest,
    PanelRegistration,
    PassedOverError,
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
    decode_registration,
    encode,
    fit_reply,
)
from simulator_stub.recording.observer import Observer
from simulator_stub.service.attendance import Attendance
from simulator_stub.service.clients import QUEUE_LIMIT, RobotClient, ViewClient
from simulator_stub.service.kidnapping import Kidnapper
from simulator_stub.service.transports import Newcomer, Peer
from simulator_stub.simulation import Simulation
from simulator_stub.world.robot_state import RobotState
from simulator_stub.world.simulator_state import SimulatorState

NAME_LIMIT = 600
"""Characters of a robot's name. The real simulator survives 600 and dies of 850; we refuse what is longer."""

VIEW_LIMIT = 64
"""Views and panels at a time. The real simulator takes any number, until it has no sockets left."""

COMPLAINT_LIMIT = 20
"""Broken messages that people are told of, until the next Reset."""


class Session:
    """Who takes part, what they sent, and what they get.

    Parameters
    ----------
    simulation : Simulation
    autostart : int
        Start, once, as soon as that many robots are registered; 0 = wait for a view's command.
    observers : sequence of Observer
    kidnapper : Kidnapper or None
        Moves a robot by hand, before the observers see that the actions are read.
    notify : callable
        Told, in one line each, what people may want to know.

    Attributes
    ----------
    robots : dict of int to RobotClient
        By id, in order.
    views : list of ViewClient
        In order of their registration.
    before_measures : callable
        Called when a cycle is computed, and its Measures are about to go out: what has arrived by then
        does not answer them.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        autostart: int = 0,
        observers: Sequence[Observer] = (),
        kidnapper: Kidnapper | None = None,
        notify: Callable[[str], None] = lambda line: None,
    ) -> None:
        self.simulation = simulation
        self.observers = observers
        self._kidnapper = kidnapper
        self.robots: dict[int, RobotClient] = {}
        self.views: list[ViewClient] = []
        self.before_measures: Callable[[], None] = _nothing
        self._panels: list[Peer] = []
        self._complaints = 0
        self._autostart = autostart
        self._autostarted = False
        self._told_of_start = False
        self._closed = False
        self._notify = notify
        self._registrations: deque[tuple[Newcomer, bytes]] = deque()
        self._reply = encode(fit_reply(simulation.acceptance()))
        self._lab = encode(simulation.lab_shown())
        self._grid = encode(simulation.world.grid)

    def welcome(self, newcomer: Newcomer, data: bytes) -> None:
        """Take a message from an address that has not registered; it is looked at in the next cycle."""
        if len(self._registrations) < QUEUE_LIMIT:
            self._registrations.append((newcomer, data))

    @property
    def registrations_waiting(self) -> bool:
        """Return whether a client waits to be registered."""
        return bool(self._registrations)

    @property
    def start_is_due(self) -> bool:
        """Return whether enough robots are there for the automatic start, and it has not happened yet."""
        return 0 < self._autostart <= len(self.robots) and not self._autostarted

    def cycle(self) -> None:
        """Do one cycle."""
        simulation = self.simulation
        before = simulation.state
        # Judged before anybody registers in this cycle: so every robot sees a stopped cycle first, however
        # registrations and cycles fall together.
        start = self.start_is_due and before is SimulatorState.STOPPED
        if before is SimulatorState.RUNNING:
            self._count_answers()
        simulation.begin_cycle()
        self._read_actions()
        if simulation.restart_requested:
            self._restart()
        if self._kidnapper is not None:
            self._kidnapper.before_move(simulation)
        for observer in self.observers:
            observer.actions_read(simulation)
        self._check_in()
        if start:
            self._autostarted = True
            simulation.start()
        self._read_commands()
        measured = simulation.advance()
        for observer in self.observers:
            observer.cycle_done(simulation)
        self.before_measures()
        for robot_id, measures in measured.items():
            client = self.robots[robot_id]
            client.answered = False
            client.peer.send(encode(measures))
        if self.views:
            statuses = [encode(status) for status in simulation.statuses()]
            for view in self.views:
                for status in statuses:
                    view.peer.send(status)
        simulation.end_cycle()
        if simulation.state is not before:
            self._state_changed()
        if self.robots and not self._told_of_start:
            self._tell_of_start()
        while simulation.scoring.notes:
            self._notify(simulation.scoring.notes.pop(0))

    def answers(self, robot_id: int) -> dict[str, int | None]:
        """Return what the result file says of which Measures a robot answered (`Attendance.document`)."""
        return self.robots[robot_id].attendance.document()

    def _count_answers(self) -> None:
        for robot in self.simulation.robots:
            if robot.state not in (RobotState.FINISHED, RobotState.REMOVED):
                client = self.robots[robot.robot_id]
                client.attendance.count(self.simulation.time, len(client.messages))

    def _read_actions(self) -> None:
        for robot_id, client in self.robots.items():
            while client.messages:
                message = client.messages.popleft()
                if isinstance(message, ProtocolError):
                    self._complain(f"robot {robot_id}: {message}")
                    break
                self.simulation.act(robot_id, message)

    def _check_in(self) -> None:
        while self._registrations:
            newcomer, data = self._registrations.popleft()
            if newcomer.registered is not None:
                newcomer.registered.deliver(data)
                continue
            try:
                registration = decode_registration(data)
            except ProtocolError as error:
                self._complain(f"registration from {newcomer.label}: {error}")
                if isinstance(error, PassedOverError):
                    continue
                break
            try:
                peer = newcomer.accept()
            except OSError as error:  # no socket to be had
                self._complain(f"registration from {newcomer.label}: {error.strerror}")
                break
            self._register(peer, registration)

    def _register(self, peer: Peer, registration: Registration) -> None:
        if isinstance(registration, ViewRegistration | PanelRegistration):
            self._panels = [panel for panel in self._panels if not panel.closed]
            if len(self.views) + len(self._panels) >= VIEW_LIMIT:
                self._refuse(peer, "a view: there are too many")
                return
            if isinstance(registration, ViewRegistration):
                self.simulation.note_client()
                self.views.append(ViewClient(peer))
            else:
                self._panels.append(peer)
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
        self._notify(f"robot {robot_id}, {registration.name!r}, registered from {peer.label}")

    def _tell_of_start(self) -> None:
        """Say once what a robot that is there waits for."""
        if self.simulation.state is not SimulatorState.STOPPED or self.start_is_due:
            return
        self._told_of_start = True
        missing = 0 if self._autostarted else self._autostart - len(self.robots)
        more = f"{missing} more robot{'s' * (missing > 1)}, or for " if missing > 0 else ""
        self._notify(f"waiting for {more}Start (a viewer has the button; --autostart N starts with N robots)")

    def _refuse(self, peer: Peer, who: str) -> None:
        peer.send(encode(Refusal()))
        peer.close()
        self._complain(f"refused {who}, from {peer.label}")

    def _complain(self, line: str) -> None:
        """Report what a client did wrong, but not without end."""
        self._complaints += 1
        if self._complaints <= COMPLAINT_LIMIT:
            self._notify(line)
        if self._complaints == COMPLAINT_LIMIT:
            self._notify("from here on, what is broken or refused is not reported")

    def _read_commands(self) -> None:
        for view in tuple(self.views):
            while view.messages:
                message = view.messages.popleft()
                if isinstance(message, ProtocolError):
                    self._complain(f"view at {view.peer.label}: {message}")
                    break
                self._obey(view, message)
                if not self.views:  # a Reset has forgotten them all, this one too
                    return
        if any(view.peer.closed for view in self.views):
            self.views = [view for view in self.views if not view.peer.closed]

    def _obey(self, view: ViewClient, command: ViewCommand) -> None:
        match command:
            case Start():
                self.simulation.start()
            case Stop():
                self.simulation.stop()
            case LabRequest():
                view.peer.send(self._lab)
            case GridRequest():
                view.peer.send(self._grid)
            case RemoveRobot(robot_id=robot_id):
                self.simulation.remove(robot_id)
            case Reset():
                self.reset()

    def _restart(self) -> None:
        """Begin again with everybody still registered: what ``Reset="On"`` of a robot asks for."""
        self._end_world()
        for client in self.robots.values():
            client.attendance = Attendance()
        self.simulation.restart()
        for view in self.views:
            view.peer.send(encode(Restart()))
        self._notify("restart, as a robot asked for")

    def _end_world(self) -> None:
        if self._kidnapper is not None:
            self._kidnapper.world_ended(self.simulation)
        for observer in self.observers:
            observer.world_ended(self.simulation)

    def reset(self, seed: int | None = None) -> None:
        """Forget all clients and begin again.

        Parameters
        ----------
        seed : int, optional
            Of the new world; by default it follows from the old one.
        """
        self._end_world()
        for view in self.views:
            view.peer.send(encode(Restart()))
            view.peer.close()
        for peer in (*self._panels, *(client.peer for client in self.robots.values())):
            peer.close()
        self.views = []
        self._panels = []
        self._complaints = 0
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


def _nothing() -> None:
    """Have nothing to do before Measures go out."""
