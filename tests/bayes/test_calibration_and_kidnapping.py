"""Many simulated runs: is a probability of p right in p of the cases, and is a kidnapping noticed?"""

from __future__ import annotations

import numpy as np
import pytest

from ciberrato.bayes import MarkovFilter, update
from ciberrato.bayes.kidnapping import EvidenceMonitor, inject
from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings
from ciberrato.bayes.sensors.quantized_gaussian import QuantizedGaussian

ROWS, COLUMNS = 7, 14
ARRIVAL = {-1: 0.1, 0: 0.8, 1: 0.1}
DIRECTIONS = ("east", "north", "west", "south")


def world(seed):
    """Rooms with random walls; a reading is the inverse distance to the wall on each side."""
    rng = np.random.default_rng(seed)
    openings = Openings(
        east=rng.random((ROWS, COLUMNS - 1)) < 0.7, north=rng.random((ROWS - 1, COLUMNS)) < 0.7
    )
    ahead = [openings.ahead(d) for d in DIRECTIONS]
    means = np.empty((ROWS, COLUMNS, 4))
    steps = {"east": (0, 1), "north": (1, 0), "west": (0, -1), "south": (-1, 0)}
    for r, c, k in np.ndindex(*means.shape):
        y, x, way = r, c, 0.5
        while ahead[k][y, x]:
            y, x, way = y + steps[DIRECTIONS[k]][0], x + steps[DIRECTIONS[k]][1], way + 2.0
        means[r, c, k] = 1.0 / way
    return openings, ahead, means, steps


def simulate_runs(count, length, rng):
    """Beliefs and true cells of runs on one map, started anywhere and driven at random."""
    openings, ahead, means, steps = world(1)
    motion = BlockedShift(openings=openings, arrival=ARRIVAL)
    sensor = QuantizedGaussian(sigma=0.2, step=0.1, signed=True)
    table = {}
    for run in range(count):
        y, x = int(rng.integers(ROWS)), int(rng.integers(COLUMNS))
        belief = np.full((ROWS, COLUMNS), 1 / (ROWS * COLUMNS))
        for _ in range(length):
            direction = DIRECTIONS[rng.integers(4)]
            made = 2 + int(rng.choice(list(ARRIVAL), p=list(ARRIVAL.values())))
            for _ in range(made):
                if ahead[DIRECTIONS.index(direction)][y, x]:
                    y, x = y + steps[direction][0], x + steps[direction][1]
            reading = np.floor((means[y, x] + 0.2 * rng.standard_normal(4)) / 0.1 + 0.5)
            key = tuple(reading)
            if key not in table:
                table[key] = sensor.log_likelihood(reading * 0.1, means)
            belief, _ = update(motion.predict(belief, (direction, 2)), table[key])
            yield run, belief, (y, x)


def reliability(pairs, edges):
    """Per bin of probability: cells, mean probability, fraction true."""
    cells, mass, true = np.zeros((3, len(edges) - 1))
    for _, belief, (y, x) in pairs:
        which = np.digitize(belief, edges) - 1
        which = np.clip(which, 0, len(edges) - 2)
        cells += np.bincount(which.ravel(), minlength=len(cells))
        mass += np.bincount(which.ravel(), weights=belief.ravel(), minlength=len(cells))
        true[which[y, x]] += 1
    return cells, mass / np.maximum(cells, 1), true / np.maximum(cells, 1)


def test_of_the_cells_given_probability_p_the_fraction_p_is_true_over_2000_runs():
    edges = np.array([0.0, 1e-3, 1e-2, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97, 1.0])
    cells, said, happened = reliability(simulate_runs(2000, 5, np.random.default_rng(11)), edges)
    for k in range(len(cells)):
        # Cells of one run are dependent; the runs are not, and a run has 5 beliefs: inflate the binomial
        # error by sqrt(5).
        error = np.sqrt(said[k] * (1 - said[k]) / cells[k]) * np.sqrt(5)
        span = f"{edges[k]:.3f} to {edges[k + 1]:.3f}"
        print(f"p {span}: {int(cells[k]):7d} cells, said {said[k]:.4f}, true {happened[k]:.4f}")
        assert happened[k] == pytest.approx(said[k], abs=4 * error + 1e-6)
    assert cells[8:].min() > 150  # the table has something to say in every bin


def test_a_filter_with_half_the_noise_is_overconfident_and_the_table_shows_it():
    # The check above must be able to fail: judge beliefs sharpened to their square.
    edges = np.array([0.0, 0.1, 0.5, 0.9, 1.0])

    def sharpened():
        for run, belief, true in simulate_runs(150, 5, np.random.default_rng(12)):
            yield run, belief**2 / (belief**2).sum(), true

    _, said, happened = reliability(sharpened(), edges)
    assert said[2] - happened[2] > 0.05


class Corridor:
    """A circular corridor of 60 cells, four binary features, and a robot that goes on by one cell."""

    def __init__(self):
        self.means = np.random.default_rng(3).integers(0, 2, (60, 4)).astype(float)

    def run(self, rng, kidnapped_at, length, threshold):
        """Give the times of alarms and the error at the end."""
        place = int(rng.integers(60))
        motion = BlockedShift(
            openings=Openings.free(1, 60, periodic=True), arrival={-1: 0.05, 0: 0.9, 1: 0.05}
        )
        belief_filter = MarkovFilter(np.full((1, 60), 1 / 60), motion.predict)
        monitor, alarms, seen_before = EvidenceMonitor(threshold=threshold), [], 0.0
        for time in range(length):
            place = (place + 1 + int(rng.choice([-1, 0, 1], p=[0.05, 0.9, 0.05]))) % 60
            if time == kidnapped_at:
                place = (place + 30) % 60
            reading = self.means[place] + 0.4 * rng.standard_normal(4)
            scores = -0.5 * (((reading - self.means) / 0.4) ** 2).sum(axis=1)
            belief_filter.predict("east")
            belief_filter.update(scores[np.newaxis])
            monitor = monitor.seen(belief_filter.log_evidence - seen_before)
            seen_before = belief_filter.log_evidence
            if monitor.alarm:
                alarms.append(time)
                belief_filter.belief = inject(belief_filter.belief, 1.0)
                monitor = monitor.restarted()
        return alarms, belief_filter.belief[0, place]


def test_kidnapping_is_noticed_soon_and_the_filter_recovers():
    corridor, rng = Corridor(), np.random.default_rng(4)
    delays, recovered, false_alarms, never = [], 0, 0, 0
    for _ in range(60):
        alarms, at_truth = corridor.run(rng, 60, 120, 2.5)
        false_alarms += any(a < 60 for a in alarms)
        after = [a - 60 for a in alarms if a >= 60]
        delays.append(after[0] if after else 99)
        recovered += at_truth > 0.5
        _, stuck = corridor.run(rng, 60, 64, 1e9)
        never += stuck < 0.1
    assert np.median(delays) <= 4
    assert recovered >= 54
    assert false_alarms <= 5
    assert never >= 50  # without a reset the belief is still wrong then


def test_a_monitor_ignores_a_single_bad_reading_and_an_impossible_one_counts_as_the_floor():
    monitor = EvidenceMonitor(floor=5.0)
    for _ in range(100):
        monitor = monitor.seen(-1.0)
    assert monitor.deficit == pytest.approx(0.0)
    once = monitor.seen(-np.inf)
    assert not once.alarm
    assert once.fast_mean == pytest.approx(-1.0 - 0.3 * 5.0)
    assert once.slow_mean == pytest.approx(-1.0 - 0.02 * 5.0)
    assert once.fraction == pytest.approx(1 - np.exp(-1.4))
    twice = once.seen(-np.inf).seen(-np.inf)
    assert twice.alarm
    assert not twice.restarted().alarm
    assert twice.restarted().slow_mean == twice.slow_mean


def test_injection_mixes():
    np.testing.assert_allclose(inject([1.0, 0.0], 0.5), [0.75, 0.25])
    np.testing.assert_allclose(inject([1.0, 0.0], 0.5, [0.0, 1.0]), [0.5, 0.5])
    with pytest.raises(ValueError, match="fraction"):
        inject([1.0], 1.5)


@pytest.mark.parametrize("wrong", [{"fast": 0.01}, {"slow": 0.0}, {"threshold": 0.0}, {"warm_up": -1}])
def test_impossible_monitors_are_refused(wrong):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        EvidenceMonitor(**wrong)
