"""Who meets whom in a tournament, from which places, and what the places are worth."""

import math
from fractions import Fraction
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest

from ciberrato.errors import UsageError
from ciberrato.grading.course import CourseError, read_course
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.report.meetings import duels
from ciberrato.grading.tournament import table as tournament_table
from ciberrato.grading.tournament.matches import matches_of
from ciberrato.grading.tournament.schedule import schedule
from ciberrato.grading.tournament.settings import TournamentSettings
from ciberrato.grading.tournament.table import played, tournament_standings
from tests.grading import program


def drawn(agents, robots, *, rounds=None, rotate=False, seed=1):
    return schedule(agents, robots, rounds=rounds, rotate=rotate, generator=np.random.default_rng(seed))


def met(meetings, agents):
    counts = np.zeros((agents, agents), dtype=int)
    for meeting in meetings:
        for one, other in combinations(meeting.agents, 2):
            counts[one, other] += 1
            counts[other, one] += 1
    return counts[~np.eye(agents, dtype=bool)]


@pytest.mark.parametrize("agents", range(2, 10))
def test_of_pairs_every_two_meet_exactly_once(agents):
    meetings = drawn(agents, 2)
    assert set(met(meetings, agents)) == {1}
    assert meetings[-1].round == agents - 1 + agents % 2
    for number in range(1, meetings[-1].round + 1):
        there = [one for meeting in meetings if meeting.round == number for one in meeting.agents]
        assert len(there) == len(set(there)) == agents - agents % 2  # with an odd number one rests


@pytest.mark.parametrize(
    ("agents", "robots"), [(8, 4), (7, 4), (9, 3), (5, 4), (4, 3), (30, 4), (3, 3), (4, 9)]
)
def test_of_larger_groups_every_two_meet_and_each_drives_once_a_round(agents, robots):
    meetings = drawn(agents, robots)
    assert min(met(meetings, agents)) >= 1
    rounds = meetings[-1].round
    for number in range(1, rounds + 1):
        groups = [meeting.agents for meeting in meetings if meeting.round == number]
        assert sorted(one for group in groups for one in group) == list(range(agents))
        sizes = {len(group) for group in groups}
        assert 2 <= min(sizes) <= max(sizes) <= min(min(sizes) + 1, robots)
    # No fewer rounds can do: in a round an agent meets robots - 1 others at most. Draws come near to that.
    least = math.ceil((agents - 1) / (robots - 1))
    assert least <= rounds <= 2 * least
    assert max(met(meetings, agents)) <= 3


def test_nine_in_groups_of_three_meet_as_in_an_affine_plane():
    # Twelve lines of three points of nine, every two points on exactly one: swaps find it.
    meetings = drawn(9, 3)
    assert len(meetings) == 12
    assert set(met(meetings, 9)) == {1}


@pytest.mark.parametrize(("agents", "robots"), [(5, 2), (8, 4), (7, 4), (6, 3)])
def test_with_turns_every_agent_starts_from_every_place_equally_often(agents, robots):
    counts = {}
    for meeting in drawn(agents, robots, rotate=True):
        for place, one in enumerate(meeting.agents):
            counts.setdefault((one, len(meeting.agents)), [0] * len(meeting.agents))[place] += 1
    assert all(len(set(places)) == 1 for places in counts.values())


@pytest.mark.parametrize(("agents", "robots"), [(5, 2), (8, 4), (30, 5)])
def test_without_turns_places_are_evened_out(agents, robots):
    counts = np.zeros((agents, robots), dtype=int)
    for meeting in drawn(agents, robots):
        counts[list(meeting.agents), range(len(meeting.agents))] += 1
    assert np.ptp(counts, axis=1).max() <= 2


def test_a_draw_follows_from_its_seed_and_rounds_go_on_as_asked():
    assert drawn(8, 3, seed=5) == drawn(8, 3, seed=5)
    assert drawn(8, 3, seed=5) != drawn(8, 3, seed=6)
    assert drawn(8, 3, rounds=2) == [one for one in drawn(8, 3) if one.round <= 2]
    assert drawn(4, 2, rounds=7)[-1].round == 7


HEAD = "[points]\nformula = 'score'\n[[lab]]\nname = 'maze'\ngrid = 'maze'\n"
AGENTS = "".join(f"[[agent]]\nname = '{name}'\ncommand = 'x'\n" for name in "abcd")


def course(tmp_path, text=HEAD + AGENTS):
    path = tmp_path / "course.toml"
    path.write_text(text)
    return read_course(path)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[tournament]\nrobots = 1\n", "robots: a whole number from 2"),
        ("[tournament]\nrounds = 0\n", "rounds: a whole number from 1"),
        ("[tournament]\nplaces = 'any'\n", "places: one of rotate, draw"),
        ("[tournament]\npoints = [1, 'x']\n", "points: a list of numbers"),
        ("[tournament]\npoints = [1, 3]\n", "a place must not be worth less than one behind it"),
        ("[tournament]\nround = 1\n", "unknown entry 'round'"),
    ],
)
def test_what_is_wrong_in_the_table_is_told(tmp_path, text, what):
    with pytest.raises(CourseError) as caught:
        course(tmp_path, text + HEAD + AGENTS)
    assert what in caught.value.faults[0]


def test_it_needs_two_agents_and_two_places(tmp_path):
    with pytest.raises(UsageError, match="two agents"):
        matches_of(course(tmp_path, HEAD + "[[agent]]\nname = 'a'\ncommand = 'x'\n"))
    with pytest.raises(UsageError, match=r"two start places or more.*: bare"):
        matches_of(course(tmp_path, HEAD + "[[lab]]\nname = 'bare'\nlab = 'maze'\n" + AGENTS))


@pytest.mark.parametrize(
    ("words", "what"),
    [(("--compare", "a", "b"), "--compare: of gradings only"), (("--report",), "holds no runs")],
)
def test_the_program_says_what_does_not_go_with_a_tournament(tmp_path, words, what):
    course(tmp_path)
    done = program.run(tmp_path / "course.toml", "--tournament", *words, expect=2)
    assert what in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "course-tournament").exists()


def test_groups_are_no_larger_than_a_lab_has_places(tmp_path):
    text = HEAD.replace("'score'", "'score'\n[tournament]\nplaces = 'draw'")
    wide = "[[lab]]\nname = 'wide'\ngrid = 'wide'\n"  # two places
    matches = matches_of(course(tmp_path, text + wide + AGENTS))
    sizes = {(match.lab.name, len(match.agents)) for match in matches}
    assert sizes == {("maze", 4), ("wide", 2)}
    assert len({match.key for match in matches}) == len({match.file for match in matches}) == len(matches)


def outcome(score):
    return Outcome(status="finished", registered=score is not None, score=score or 0)


def test_places_are_worth_the_share_of_opponents_that_are_beaten(tmp_path):
    graded = course(tmp_path, HEAD + AGENTS[: AGENTS.index("[[agent]]\nname = 'd'")])
    match = matches_of(graded)[0]
    for scores in product([0, 1, 2, None], repeat=3):
        runs = played(graded, [match], {match.key: [(outcome(score), {}) for score in scores]})
        for run, own in zip(runs, scores, strict=True):
            others = [scores[k] for k in range(3) if k != run.start - 1]
            before = sum(other is not None and (own is None or other > own) for other in others)
            beaten = Fraction(0)
            for other in others if own is not None else ():
                beaten += 1 if other is None or own > other else Fraction(own == other, 2)
            assert run.place == 1 + before
            assert run.worth == pytest.approx(float(50 * beaten), abs=1e-9)


def test_points_by_place_are_shared_by_equal_ones():
    worth = tournament_table._worth
    assert worth((10.0, 6.0, 3.0), 0, 1, 4) == 10.0
    assert worth((10.0, 6.0, 3.0), 1, 2, 4) == 4.5
    assert worth((10.0, 6.0, 3.0), 2, 2, 4) == 1.5
    assert worth((10.0, 6.0, 3.0), 3, 1, 4) == 0.0


def test_equal_totals_are_decided_by_the_points_of_the_formula(tmp_path):
    text = HEAD.replace("'score'", "'score'\n[tournament]\nrobots = 2\nrounds = 2\nplaces = 'draw'")
    graded = course(tmp_path, text + AGENTS)
    assert graded.tournament == TournamentSettings(robots=2, rounds=2, rotate=False)
    matches = matches_of(graded)
    value = {"a": 5, "b": 5, "c": 1, "d": 9}
    done = {match.key: [(outcome(value[agent.name]), {}) for agent in match.agents] for match in matches}
    runs = played(graded, matches, done)
    ranked = tournament_standings(graded, runs)
    total = {one.agent: one.total for one in ranked}
    mean = {name: np.mean([run.worth for run in runs if run.task.agent.name == name]) for name in "abcd"}
    assert total == pytest.approx(mean)
    assert [(one.total, value[one.agent]) for one in ranked] == sorted(
        [(one.total, value[one.agent]) for one in ranked], reverse=True
    )
    counts = duels(
        [[(run, run.worth, run.extra()) for run in runs if run.match is match] for match in matches]
    )
    for (one, other), (won, level, lost) in counts.items():
        assert counts[other, one] == (lost, level, won)
        assert (won > 0, level > 0, lost > 0) == (
            value[one] > value[other],
            value[one] == value[other],
            value[one] < value[other],
        )
    assert Path(matches[0].file).name == matches[0].file
