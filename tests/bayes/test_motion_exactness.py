"""All motion models, ten steps each, for ways and noise finer and wider than the cells: against samples."""

from __future__ import annotations

import pytest

from benchmarks.motion_cases import LINES, MODELS, selection
from benchmarks.motion_exactness import deviation, limits, main

ALL = selection()
# The quick part: each model and motion with ways of 3/100 of a cell.
QUICK = [case for case in ALL if case.way == (1.0 if case.model in LINES else 0.03) or case.motion == "still"]
SLOW = [case for case in ALL if case not in QUICK]


def check(case):
    found, allowed = deviation(case), limits(case)
    for name, value, limit in zip(found._fields, found, allowed, strict=True):
        assert value <= limit, f"{case}: {name} {value:.3g}, at most {limit:.3g}"


@pytest.mark.parametrize("case", QUICK, ids=str)
def test_ten_small_steps_are_those_of_samples(case):
    check(case)


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize("case", SLOW, ids=str)
def test_ten_steps_of_any_size_are_those_of_samples(case):
    check(case)


def test_all_models_motions_ways_and_noises_are_among_the_cases():
    for field, least in (("model", len(MODELS)), ("motion", 4), ("way", 6), ("noise", 5)):
        assert len({getattr(case, field) for case in ALL}) == least
    assert len({(case.way, case.noise) for case in ALL}) >= 24


def test_the_table_names_the_models(capsys):
    assert main(["KernelMotion", "--ways", "0.3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].split()[:2] == ["KernelMotion", "0.3"]
    assert main(["Teleport"]) == 2
    assert "no model 'Teleport'" in capsys.readouterr().err
