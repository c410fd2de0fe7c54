"""Everything the viewer knows and says, without sockets or clocks.

Bytes of the simulator, datagrams of agents and messages of browsers go in; what is to be sent to each comes
out. `ciberrato.viewer.server` is the shell around it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from ciberrato.errors import ProtocolError
from ciberrato.overlay import decode_overlay
from ciberrato.protocol import (
    Acceptance,
    RemoveRobot,
    Reset,
    Restart,
    SimulatorMessage,
    Start,
    Stop,
    ViewCommand,
    encode,
)
from ciberrato.viewer.connection import ConnectionState, Outgoing, SimulatorConnection
from ciberrato.viewer.overlay_store import OverlayStore
from ciberrato.viewer.page_messages import (
    AskBelief,
    AskFrames,
    AskMarks,
    AskSeries,
    Control,
    Question,
    frame_text,
    frames_answer,
    live_frame,
    marks_answer,
    to_json,
    world_text,
)
from ciberrato.viewer.timeline import Timeline
from ciberrato.viewer.world import World

News = list[tuple[str, str]]
"""(topic, text) pairs; see `ciberrato.viewer.outbox.Outbox`."""


class Session:
    """The viewer between a simulator, agents and browsers.

    Times (`now`) are seconds of any clock that does not go back.

    Parameters
    ----------
    address : str
        Address of the simulator, as people would write it.
    control : bool
        Whether browsers may start, stop, reset and remove.
    notify : callable
        Told, in one line each, what people may want to know.

    Attributes
    ----------
    recording : bool
        There is no simulator: what is shown was recorded.
    """

    def __init__(
        self,
        address: str = "",
        *,
        control: bool = True,
        recording: bool = False,
        notify: Callable[[str], None] = lambda line: None,
        view_token: str | None = None,
    ) -> None:
        self.world = World()
        self.timeline = Timeline()
        self.overlays = OverlayStore()
        self.connection = SimulatorConnection(notify, token=view_token)
        self.recording = recording
        self.refused_overlays = 0
        self._address = address
        self._control = control and not recording
        self._notify = notify
        self._now = 0.0
        # What has been published already; what differs from it is news.
        self._published: dict[str, object] = {}
        self._frame = ""
        self._frames_received = 0

    # --- from outside ---------------------------------------------------------------------------

    def start(self, now: float) -> list[Outgoing]:
        """Start to look for the simulator; return what is to be sent to it."""
        return [] if self.recording else self.connection.start(now)

    def receive(self, data: bytes, now: float) -> list[Outgoing]:
        """Process a datagram of the simulator; return what is to be sent to it."""
        self._now = now
        message, outgoing = self.connection.receive(data, now)
        match message:
            case None:
                return outgoing
            case Restart() | Acceptance():
                # A simulator that answers a registration may be another one than before.
                self.timeline.clear()
                self.overlays.clear()
                self.world.forget_robots()
        self.show(message)
        return outgoing

    def show(self, message: SimulatorMessage) -> None:
        """Process a message of a simulator, live or recorded."""
        for frame in self.world.receive(message, self._now):
            self._frame = frame_text(frame)
            self._frames_received += 1
            self.timeline.add(frame, self._frame)
            self.overlays.settle(frame.time, self.world.lab, self._place_of)

    def lost(self, reason: str, now: float) -> None:
        """Handle a broken link to the simulator."""
        self.connection.lost(reason, now)

    def receive_overlay(self, data: bytes, now: float) -> None:
        """Process a datagram of an agent; a bad one is counted, the first one reported."""
        try:
            message = decode_overlay(data)
        except ProtocolError as error:
            self.refused_overlays += 1
            if self.refused_overlays == 1:
                self._notify(f"ignored a datagram on the overlay port: {error}")
            return
        self.overlays.receive(
            message, now=now, time=self.world.frame.time, lab=self.world.lab, place_of=self._place_of
        )

    def _place_of(self, robot_id: int, time: int) -> tuple[float, float] | None:
        """Return where a robot was, from the time line: an agent may report its belief late."""
        for frame in self.timeline.window(time, time, 2):
            for row in json.loads(frame)[2]:
                if row[0] == robot_id and row[1] is not None and row[2] is not None:
                    return row[1], row[2]
        return None

    def tick(self, now: float) -> list[Outgoing]:
        """Run the tasks that are due, a few times a second; return what is to be sent to the simulator."""
        self._now = now
        self.overlays.expire(now)
        return [] if self.recording else self.connection.tick(now)

    def command(self, control: Control) -> list[Outgoing]:
        """Execute a browser's command; return what is to be sent to the simulator."""
        if not self._control or self.connection.state is not ConnectionState.WATCHING:
            return []
        commands: dict[str, ViewCommand] = {"start": Start(), "stop": Stop(), "reset": Reset()}
        command = commands.get(control.do) or RemoveRobot(robot_id=control.robot)
        return [Outgoing(encode(command))]

    # --- to browsers ----------------------------------------------------------------------------

    def answer(self, question: Question) -> str:
        """Answer a browser's question."""
        epoch = self.timeline.epoch
        match question:
            case AskFrames():
                frames = self.timeline.window(question.first, question.last, question.most)
                return frames_answer(frames, epoch, question)
            case AskMarks():
                return marks_answer(self.timeline.marks, epoch, question.skip)
            case AskSeries():
                source = self.overlays.sources.get(question.source)
                series = source.series() if source is not None else []
                version = source.version if source is not None else 0
                return to_json(
                    {
                        "type": "series",
                        "epoch": epoch,
                        "source": question.source,
                        "version": version,
                        "series": series,
                    }
                )
            case AskBelief():
                source = self.overlays.sources.get(question.source)
                belief = source.belief_at(question.time) if source is not None else None
                document = belief.document() if belief is not None else None
                return to_json(
                    {
                        "type": "past",
                        "epoch": epoch,
                        "source": question.source,
                        "at": question.time,
                        "belief": document,
                    }
                )

    def news(self, now: float) -> News:
        """Return what has changed since the last call."""
        self._now = now
        return self._changes(self._published)

    def snapshot(self) -> News:
        """Return everything that a newly connected browser needs."""
        return self._changes({})

    @property
    def revision(self) -> int:
        """Counts the frames; it changes when there is something new to show of the robots."""
        return self._frames_received

    def _world_key(self) -> object:
        world = self.world
        return (self.timeline.epoch, world.lab, world.grid, world.parameters)

    def _changes(self, published: dict[str, object]) -> News:
        news: News = []

        def changed(topic: str, key: object) -> bool:
            if published.get(topic) == key:
                return False
            published[topic] = key
            return True

        if changed("world", self._world_key()):
            news.append(("world", self._world()))
        state = "recording" if self.recording else self.connection.state.value
        if changed("status", state):
            document = {"type": "status", "connection": state, "simulator": self._address}
            news.append(("status", to_json(document)))
        if changed("roster", self._roster_key()):
            news.append(("roster", to_json({"type": "roster", "robots": self._roster()})))
        if changed("frame", (self.timeline.epoch, self._frames_received)):
            frame = self._frame if len(self.timeline) else frame_text(self.world.frame)
            text = live_frame(
                frame,
                epoch=self.timeline.epoch,
                rate=self.world.rate(self._now),
                marks=len(self.timeline.marks),
            )
            news.append(("frame", text))
        for source in self.overlays.sources.values():
            topic = f"belief:{source.name}"
            if source.beliefs and changed(topic, (self.timeline.epoch, source.version)):
                news.append((topic, self._belief(source.name)))
        if changed("shapes", self.overlays.shapes_version):
            shapes = self.overlays.shape_documents()
            news.append(("shapes", to_json({"type": "shapes", "shapes": shapes})))
        return news

    def _world(self) -> str:
        world = self.world
        return world_text(
            epoch=self.timeline.epoch,
            lab=world.lab,
            grid=world.grid,
            parameters=world.parameters,
            span=self.timeline.span,
            facts={"control": self._control, "recording": self.recording},
        )

    def _roster_key(self) -> object:
        names = tuple((robot.robot_id, robot.name) for robot in self.world.frame.robots)
        angles = tuple((source.robot, source.angles) for source in self.overlays.sources.values())
        return names, angles

    def _roster(self) -> list[dict[str, Any]]:
        angles = {source.robot: source.angles for source in self.overlays.sources.values() if source.angles}
        return [
            {"id": robot.robot_id, "name": robot.name, "angles": angles.get(robot.robot_id)}
            for robot in self.world.frame.robots
        ]

    def _belief(self, name: str) -> str:
        source = self.overlays.sources[name]
        return to_json(
            {
                "type": "belief",
                "epoch": self.timeline.epoch,
                "source": name,
                "robot": source.robot,
                "version": source.version,
                "series": source.series()[-1],
                "belief": source.beliefs[-1].document(),
            }
        )
