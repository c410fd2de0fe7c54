"""Which Measures are news, by every order that a network makes of them."""

import itertools
import random

import pytest

from ciberrato.protocol import Measures
from ciberrato.protocol.order import LEAP, MessageOrder, News


def judge(order, *times, start=True):
    return [order.judge(Measures(time=time, start=start)) for time in times]


F, S, H, B = News.FRESH, News.STALE, News.HELD, News.BEGUN_AGAIN


@pytest.mark.parametrize(
    ("times", "news", "stale"),
    [
        ((0, 1, 2, 2, 1, 3), [F, F, F, S, S, F], 2),
        ((5, 0, 6), [F, S, F], 1),  # late, of time 0
        ((57, 5, 58), [F, S, F], 1),  # a digit lost
        ((57, 157, 58), [F, H, F], 1),  # a digit too many
        ((57, 157, 158), [F, H, F], 0),  # a gap, and two that agree
        ((57, 157, 258, 58), [F, H, H, F], 2),
        ((90, 0, 1, 2), [F, S, S, B], 2),
        ((90, 0, 91, 1, 2), [F, S, F, S, S], 3),
        ((90, 30, 2, 17), [F, S, S, S], 3),  # spoilt in different manners
        ((8, *[0] * 10), [F, *[S] * 9, B], 9),
    ],
)
def test_what_is_news(times, news, stale):
    order = MessageOrder()
    assert judge(order, *times) == news
    assert order.stale == stale


def test_before_the_start_time_stands_still():
    order = MessageOrder()
    assert judge(order, 0, 0, 0, start=False) == [F, F, F]
    assert judge(order, 0, 0) == [F, S]
    assert judge(order, 1, 1, start=False) == [F, F]


def test_no_time_is_far_beyond_the_end():
    order = MessageOrder(100)
    assert judge(order, 100, 151, 152, 2**31 - 1) == [F, S, S, S]


@pytest.mark.parametrize("seed", range(20))
def test_jitter_and_spoilt_digits_end_no_run(seed):
    """Held against what is known of a thousand messages: who sent what when."""
    generator = random.Random(seed)
    late = generator.choice([0, 3, 8])
    arrivals = sorted((time + generator.uniform(0, late), time) for time in range(1000))
    order, spoilt, fresh = MessageOrder(1800), 0, []
    for _, time in arrivals:
        said = time
        if generator.random() < 0.05:
            digits = list(str(time))
            digits[generator.randrange(len(digits))] = str(generator.randrange(10))
            said = int("".join(digits))
            spoilt += said != time
        news = order.judge(Measures(time=said, start=True))
        assert news is not News.BEGUN_AGAIN
        if news is News.FRESH:
            fresh.append(said)
    assert fresh == sorted(set(fresh))
    assert all(after - before <= 3 * LEAP for before, after in itertools.pairwise(fresh))
    assert len(fresh) >= 1000 / (1 + late) - 12 * spoilt
