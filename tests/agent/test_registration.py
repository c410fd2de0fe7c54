"""Registration: asks again, takes the first good answer, and says why not."""

import itertools
import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from agent.run import registration
from agent.run.registration import register
from agent.run.reporter import Reporter
from agent.run.signals import Interrupts
from ciberrato.errors import UsageError
from ciberrato.net import LinkClosedError, LinkError, TcpLink, UdpLink
from ciberrato.net.link import Arrival
from ciberrato.protocol import Acceptance, Measures, Refusal, RobotRegistration, decode_registration, encode
from ciberrato.world.parameters import Parameters

ROBOT = RobotRegistration(name="santos", robot_id=3, sensor_angles=((0, 0.0),))
YES = encode(Acceptance(parameters=Parameters(), n_beacons=1))
NO = encode(Refusal())
MEASURES = encode(Measures(time=0))


class Answers:
    """A link whose simulator answers the n-th registration with the n-th list of messages."""

    refused = False

    def __init__(self, *answers: list[bytes] | LinkError) -> None:
        self.asked: list[bytes] = []
        self.times: list[float] = []
        self._answers = list(answers)
        self._waiting: list[bytes] = []
        self._sockets = UdpLink("127.0.0.1", 9)  # only for its descriptor, on which nothing arrives

    def register(self, data: bytes) -> None:
        self.asked.append(data)
        self.times.append(time.monotonic())
        answer = self._answers.pop(0) if self._answers else []
        if isinstance(answer, LinkError):
            raise answer
        self._waiting += answer

    def receive_waiting(self) -> list[bytes]:
        waiting, self._waiting = self._waiting, []
        return waiting

    def receive_arrivals(self) -> list[Arrival]:
        return [Arrival(data, None) for data in self.receive_waiting()]

    def fileno(self) -> int:
        return self._sockets.fileno()

    def send(self, data: bytes) -> None: ...

    def receive(self, timeout: float | None) -> bytes | None: ...

    def close(self) -> None:
        self._sockets.close()


@pytest.fixture
def interrupts() -> Iterator[Interrupts]:
    interrupts = Interrupts()
    interrupts.arm()
    yield interrupts
    interrupts.close()


@pytest.fixture(autouse=True)
def _hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registration, "FIRST_WAIT", 0.02)
    monkeypatch.setattr(registration, "LONGEST_WAIT", 0.04)


def ask(link: Answers, interrupts: Interrupts, **options: float) -> object:
    try:
        return register(link, ROBOT, "somewhere:6000", interrupts, Reporter(), **options)
    finally:
        link.close()


def test_what_comes_behind_the_answer_is_kept(interrupts: Interrupts) -> None:
    link = Answers([YES, MEASURES, MEASURES])
    answer = ask(link, interrupts)
    assert isinstance(answer, registration.Answer)
    assert answer.acceptance.n_beacons == 1
    assert [one.data for one in answer.following] == [MEASURES, MEASURES]
    assert [decode_registration(data) for data in link.asked] == [ROBOT]


def test_it_asks_again_and_waits_longer_each_time(
    interrupts: Interrupts, capsys: pytest.CaptureFixture[str]
) -> None:
    link = Answers([], [], [], [YES])
    assert ask(link, interrupts) is not None
    gaps = [later - sooner for sooner, later in zip(link.times, link.times[1:], strict=False)]
    assert len(gaps) == 3
    for gap, least in zip(gaps, (0.02, 0.03, 0.04), strict=True):
        assert gap >= least
    assert capsys.readouterr().err.count("waiting for a simulator at somewhere:6000") == 1


def test_a_late_refusal_of_a_second_attempt_does_not_matter(interrupts: Interrupts) -> None:
    assert ask(Answers([], [YES, NO]), interrupts) is not None


def test_a_refusal_says_why_it_can_be(interrupts: Interrupts) -> None:
    with pytest.raises(UsageError) as caught:
        ask(Answers([NO]), interrupts)
    for text in ("'santos' at position 3", "somewhere:6000", "taken", "start grid", "already running"):
        assert text in str(caught.value)


def test_what_is_no_answer_is_reported_once_and_passed_over(
    interrupts: Interrupts, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ask(Answers([b"hello", b"hello"], [MEASURES, YES]), interrupts) is not None
    assert capsys.readouterr().err.count("not like a CiberRato simulator") == 1


def test_link_trouble_is_reported_once_and_tried_again(
    interrupts: Interrupts, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ask(Answers(LinkError("no route"), LinkError("no route"), [YES]), interrupts) is not None
    assert capsys.readouterr().err.count("no route; trying again") == 1


def test_it_can_give_up(interrupts: Interrupts, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.count(step=0.02)  # on which every look takes so long
    monkeypatch.setattr(registration, "time", SimpleNamespace(monotonic=lambda: next(clock), time=time.time))
    link = Answers()
    with pytest.raises(UsageError, match=r"no simulator has answered at somewhere:6000 in 0\.4 s"):
        ask(link, interrupts, give_up_after=0.4)
    assert len(link.asked) >= 2


def test_a_signal_ends_the_wait(interrupts: Interrupts) -> None:
    class Interrupted(Answers):
        def register(self, data: bytes) -> None:
            super().register(data)
            if len(self.asked) == 2:
                interrupts.received.append(2)

    assert ask(Interrupted(), interrupts) is None


@pytest.mark.parametrize("quiet", [False, True])
def test_nobody_listens_on_tcp(
    quiet: bool,
    interrupts: Interrupts,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A real TCP link to a port without a listener is asked again, and it is said why in vain."""
    clock = itertools.count(step=0.02)
    monkeypatch.setattr(registration, "time", SimpleNamespace(monotonic=lambda: next(clock), time=time.time))
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))  # taken, but not listened at
        link = TcpLink(*nobody.getsockname())
        with pytest.raises(UsageError, match=r"no simulator has answered .*: the connection is refused"):
            register(link, ROBOT, "here:9", interrupts, Reporter(quiet=quiet), give_up_after=0.6)
        assert link.refused
        link.close()
    told = capsys.readouterr().err
    assert told.count("here:9: the connection is refused, no simulator listens on TCP there") == 1
    assert "the real simulator speaks UDP only" in told


def test_one_refused_connection_is_no_news(
    interrupts: Interrupts, capsys: pytest.CaptureFixture[str]
) -> None:
    """A simulator that is just starting."""

    class Starting(Answers):
        def register(self, data: bytes) -> None:
            super().register(data)
            self.refused = len(self.asked) == 1

    assert ask(Starting([], [YES]), interrupts) is not None
    assert "refused" not in capsys.readouterr().err


def test_a_connection_that_breaks_while_waiting_is_waited_out(interrupts: Interrupts) -> None:
    class Broken(Answers):
        def receive_waiting(self) -> list[bytes]:
            if len(self.asked) < 2:
                raise LinkClosedError("gone")
            return super().receive_waiting()

    assert ask(Broken([], [YES]), interrupts) is not None
