import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from ciberrato.errors import UsageError
from ciberrato.grading.comparison import compare
from ciberrato.grading.course import QUANTITIES, Agent, Course, GradedLab, Limits, Points
from ciberrato.grading.expressions import Formula
from ciberrato.grading.outcome import Outcome, judge_maps
from ciberrato.grading.report import tables
from ciberrato.grading.runner import Graded
from ciberrato.grading.standing import standings, values_of
from ciberrato.grading.task import Task

LABS = (GradedLab("a", Path("a"), weight=1.0), GradedLab("b", Path("b"), weight=3.0))


def course(names, formula="score", maximum=None):
    agents = tuple(Agent(name, ("x",)) for name in names)
    points = Points(Formula(formula, QUANTITIES), maximum)
    return Course("t", agents, LABS, (1, 2, 3), True, 1.0, None, Limits(), points)


def runs(course, scores):
    """Runs of each agent: scores by lab, in order of the seeds."""
    return [
        Graded(
            Task(agent, lab, seed, f"{agent.name}{lab.name}{seed}", f"{agent.name}-{lab.name}-{seed}"),
            Outcome(status="finished", registered=score is not None, score=score or 0),
            {},
        )
        for agent in course.agents
        for lab, own in zip(LABS, scores[agent.name], strict=True)
        for seed, score in enumerate(own, 1)
    ]


def test_totals_are_the_weighted_means_of_labs_as_fractions_say():
    scores = {"x": [[1, 2, 2], [7, 0, 4]], "y": [[9, 9, 9], [0, 1, 0]]}
    graded = course("xy")
    ranked = standings(graded, runs(graded, scores))
    for standing in ranked:
        means = [Fraction(sum(own), len(own)) for own in scores[standing.agent]]
        assert standing.total == pytest.approx(float((means[0] + 3 * means[1]) / 4), abs=1e-12)
    assert [(standing.place, standing.agent) for standing in ranked] == [(1, "x"), (2, "y")]


def test_equal_agents_share_a_place_and_the_next_counts_them_all():
    scores = {name: [[value] * 3] * 2 for name, value in (("p", 5), ("q", 7), ("r", 5), ("s", 1))}
    graded = course("pqrs")
    ranked = standings(graded, runs(graded, scores))
    assert [(one.place, one.agent) for one in ranked] == [(1, "q"), (2, "p"), (2, "r"), (4, "s")]


def test_points_are_cut_and_those_that_never_registered_have_none():
    graded = course("x", "200 - score", maximum=100.0)
    (standing,) = standings(graded, runs(graded, {"x": [[150, 50, 250], [None, None, 140]]}))
    assert [points for _, points in standing.runs] == [50.0, 100.0, 0.0, 0.0, 0.0, 60.0]


def test_a_formula_without_a_value_is_an_error_that_names_the_run():
    graded = course("x", "1 / score")
    with pytest.raises(UsageError, match="points of x, a, seed 2: "):
        standings(graded, runs(graded, {"x": [[1, 0, 1], [1, 1, 1]]}))


def test_pairs_of_runs_are_compared_with_students_interval():
    from scipy import stats

    scores = {"x": [[5, 9, 4], [8, 7, 7]], "y": [[4, 9, 6], [5, 5, 2]]}
    graded = course("xy")
    found = compare(standings(graded, runs(graded, scores)), "x", "y")
    differences = np.subtract(np.ravel(scores["x"]), np.ravel(scores["y"]))
    test = stats.ttest_1samp(differences, 0.0).confidence_interval(0.95)
    assert found.mean == pytest.approx(differences.mean())
    assert found.interval == pytest.approx((test.low, test.high))
    assert (found.pairs, found.better, found.worse) == (6, 4, 1)
    with pytest.raises(UsageError, match="no runs of an agent 'z'"):
        compare(standings(graded, runs(graded, scores)), "x", "z")


@pytest.mark.parametrize("mode", range(8))
def test_merit_is_the_score_turned_so_that_more_is_better(mode):
    lab = GradedLab("a", Path("a"), scoring=mode)
    best = {0: [0, 150, 300], 1: [70, 20, 0], 4: [70, 20, -10], 7: [70, 20, 0]}.get(mode, [0, 40, 90])
    merits = []
    for score in best:
        task = Task(Agent("x", ("x",)), lab, 1, "k", "f")
        run = Graded(task, Outcome(status="finished", registered=True, score=score, targets=2), {})
        merits.append(values_of(run)["merit"])
    assert merits == sorted(merits, reverse=True)
    assert len(set(merits)) == 3
    if mode == 0:
        assert (merits[0], merits[2]) == (300.0, 0.0)  # all done, and nothing done


def test_cells_that_a_spreadsheet_would_compute_are_text():
    graded = course(["=1+1"])
    ranked = standings(graded, runs(graded, {"=1+1": [[1, 1, 1], [1, 1, -1]]}))
    lines = tables.results_csv(ranked).splitlines()
    assert all(line.startswith("'=1+1,") for line in lines[1:])
    assert ",-1," in lines[-1]
    assert not math.isnan(ranked[0].total)


def test_maps_that_are_not_plain_files_count_as_missing(tmp_path):
    reference, work = tmp_path / "reference", tmp_path / "work"
    reference.mkdir()
    work.mkdir()
    line = "X" * 55 + "\n"
    (reference / "mapping.out").write_text(line * 27)
    assert judge_maps(work, reference, 2) == (0.0, None)
    assert judge_maps(work, reference, 0) == (None, None)
    (work / "mapping.out").symlink_to(reference / "mapping.out")
    assert judge_maps(work, reference, 2) == (0.0, None)
    (work / "mapping.out").unlink()
    (work / "mapping.out").write_text(line * 27)
    assert judge_maps(work, reference, 2) == (10.0 * 55 * 27, None)
