"""Numbers near the ends of what doubles hold: no warning, no nan, and the right logarithm."""

import itertools
import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from ciberrato.bayes.motion.omnidirectional import (
    OmnidirectionalNoise,
    OmnidirectionalOdometry,
    OmnidirectionalReading,
)
from ciberrato.bayes.motion.velocity import VelocityCommand, VelocityMotion, VelocityNoise
from ciberrato.bayes.sensors.gaussian import GaussianSensor
from ciberrato.bayes.sensors.quantized_gaussian import QuantizedGaussian
from ciberrato.bayes.spaces import Axis, StateSpace

SIZES = (1e-320, 1e-300, 1e-160, 1e-10, 1.0, 1e160, 1e300, 1e307)
SIGNED = (0.0, *SIZES, *(-size for size in SIZES))


def log_density(reading, mean, sigma):
    """Log density of a normal in decimals of 60 digits, whose exponents do not end."""
    with localcontext() as context:
        context.prec, context.Emax, context.Emin = 60, 10**9, -(10**9)
        off = (Decimal(reading) - Decimal(mean)) / Decimal(sigma)
        exact = -off * off / 2 - Decimal(sigma).ln() - (2 * Decimal(math.pi)).ln() / 2
        return float(exact) if exact > Decimal("-1e308") else -math.inf


@pytest.mark.parametrize("sigma", SIZES)
def test_a_gaussian_is_right_as_far_as_doubles_go(sigma):
    sensor = GaussianSensor(sigma=sigma, signed=True)
    for reading, mean in itertools.product(SIGNED, SIGNED):
        found = float(sensor.log_likelihood([reading], np.array([[mean]]))[0])
        expected = log_density(reading, mean, sigma)
        # From squares near 1e308 on, which the sum leaves too, there is -inf.
        if expected < -1e307:
            assert found < -1e306
        else:
            assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("sigma", SIZES)
def test_a_prepared_gaussian_is_right_or_says_that_it_cannot(sigma):
    sensor, answered = GaussianSensor(sigma=sigma, signed=True), 0
    for reading, mean in itertools.product(SIGNED, SIGNED):
        try:
            found = float(sensor.prepare(np.array([[mean]])).log_likelihood([reading])[0])
        except ValueError as error:
            assert "use GaussianSensor.log_likelihood" in str(error)  # noqa: PT017
            continue
        answered += 1
        expected = float(sensor.log_likelihood([reading], np.array([[mean]]))[0])
        if math.isinf(found):
            assert expected < -1e307
        else:
            large = (abs(reading) + abs(mean)) / sigma
            assert found == pytest.approx(expected, rel=1e-9, abs=1e-15 * large * large)
    assert answered > 0 or not 1e-150 < sigma < 1e150


@pytest.mark.parametrize("sigma", SIZES)
def test_a_quantized_gaussian_far_off_is_the_density_times_the_step(sigma):
    for step, reading, mean in itertools.product((1e-300, 0.1, 1e300), SIGNED, SIGNED):
        for outlier in (0.0, 0.1):
            sensor = QuantizedGaussian(sigma=sigma, step=step, signed=True, outlier=outlier)
            found = float(sensor.log_likelihood([reading], np.array([[mean]]))[0])
            assert found <= 1e-12
            if outlier:
                assert found >= math.log(0.1) - 1e-9
            elif (
                1e-15 * abs(reading) < 1e-9 * sigma
                and step < 1e-3 * sigma
                and step * abs(reading - mean) < 1e-3 * sigma * sigma
            ):
                multiple = round(reading / step) * step if abs(reading / step) < 1e15 else reading
                expected = log_density(multiple, mean, sigma) + math.log(step)
                assert found == pytest.approx(expected, rel=1e-6)
            elif abs(reading - mean) > 100.0 * (sigma + step):
                assert found < -1000.0


def test_a_range_beyond_the_longest_is_told_without_a_warning():
    for sigma, mean in itertools.product(SIZES, (0.0, *SIZES)):
        found = QuantizedGaussian(sigma=sigma, step=0.1, max_range=5.0).log_likelihood(
            [1e300], np.array([[mean]])
        )
        assert found[0] <= 0.0


@pytest.fixture
def space():
    lengths = [Axis(name=name, size=4) for name in "xy"]
    turns = Axis(name="heading", size=8, cell=math.pi / 4.0, periodic=True)
    return StateSpace(axes=(*lengths, turns))


@pytest.mark.parametrize("value", [1e160, 1e300, np.float64(1e301), -1e300, 1.7e308])
def test_motions_far_too_long_are_refused_by_a_named_error(space, value):
    belief = np.full(space.shape, 1.0 / np.prod(space.shape))
    noise = OmnidirectionalNoise(alpha1=0.1, alpha2=0.1, alpha3=0.1)
    for name in ("forward", "left", "turn"):
        reading = OmnidirectionalReading(**{name: value})
        with pytest.raises(ValueError, match=r"too large|longer than|more than ten turns|must be finite"):
            OmnidirectionalOdometry(space=space, noise=noise).predict(belief, reading)
    with pytest.raises(ValueError, match=r"too large|standard deviation"):
        OmnidirectionalOdometry(space=space, noise=OmnidirectionalNoise(translation=abs(value))).predict(
            belief, OmnidirectionalReading(forward=0.1)
        )
    for command in (
        VelocityCommand(speed=value, turning=0.0),
        VelocityCommand(speed=0.0, turning=value),
        VelocityCommand(speed=1e200, turning=0.1, duration=abs(value)),
    ):
        with pytest.raises(ValueError, match=r"too large|longer than|more than ten turns|must be finite"):
            VelocityMotion(space=space, noise=VelocityNoise(alpha1=0.1)).predict(belief, command)
