import math

import pytest

from ciberrato.errors import UsageError
from ciberrato.grading.expressions import MOST_CHARACTERS, Formula

VALUES = {"score": 150.0, "collisions": 3.0, "finished": 1.0}
NAMES = frozenset(VALUES)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("score", 150.0),
        ("max(0, score - 10 * collisions) / 2", 60.0),
        ("20 if finished and collisions < 5 else 0", 20.0),
        ("not finished or 1 < collisions <= 3", 1.0),
        ("-score // 4 + score % 4 + 2 ** 3", -28.0),
        ("round(2.5) + round(-0.5) + floor(-1.5) + ceil(1.2)", 3.0),
        ("sqrt(16) + abs(-1) + log(exp(2))", 7.0),
        ("True + 1", 2.0),
    ],
)
def test_formulas_have_the_values_that_arithmetic_gives(text, value):
    assert Formula(text, NAMES)(VALUES) == pytest.approx(value)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "score.__class__",
        "[1][0]",
        "(lambda: 1)()",
        "'text'",
        "score if finished else nonesuch",
        "min(score)",
        "min(score, key=abs)",
        "open('/etc/passwd')",
        "(score := 1)",
        "[s for s in (1, 2)]",
        "score @ 2",
        "1j",
        "",
        "score +",
        "a b",
        "(" * 300 + "1" + ")" * 300,
        "1" * (MOST_CHARACTERS + 1),
    ],
)
def test_anything_else_is_refused_before_it_is_computed(text):
    with pytest.raises(UsageError) as caught:
        Formula(text, NAMES)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["1 / (score - 150)", "10.0 ** 400", "exp(1000)", "log(-1)", "(-8) ** 0.5", "1e999"]
)
def test_what_has_no_finite_value_is_an_error(text):
    with pytest.raises(UsageError, match="has no"):
        Formula(text, NAMES)(VALUES)


def test_it_says_which_names_it_uses():
    assert Formula("score - collisions", NAMES).names == {"score", "collisions"}
    assert math.isclose(Formula("0.1 + 0.2", NAMES)({}), 0.3)
