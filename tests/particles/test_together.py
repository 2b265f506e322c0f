"""Several measurements of one moment weigh a cloud; a bad one is named and spoils no other."""

import numpy as np
import pytest

from coursekit import particles
from coursekit.models import RangeOnly

RNG = np.random.default_rng(1)
CLOUD = particles.Particles(RNG.normal(0, 1, (500, 3)), angles=(2,))
BEACONS = [RangeOnly(p, position=(0, 1)) for p in ([3.0, 0.0], [0.0, 2.0], [-2.0, -2.0])]
Z = [[2.9], [2.1], [2.7]]


def test_together_is_one_after_the_other():
    one = CLOUD
    for beacon, z in zip(BEACONS, Z, strict=True):
        one = particles.weigh(one, particles.log_likelihood(beacon, z))
    got = particles.weigh_together(CLOUD, BEACONS, Z)
    np.testing.assert_allclose(got.cloud.weights, one.weights, rtol=1e-9)
    assert got.used == (0, 1, 2) and got.rejected == {}


@pytest.mark.parametrize(("bad", "reason"), [([-1.0], "a range of -1 m"), ([np.nan], "not finite: [nan]")])
def test_a_bad_measurement_is_named_and_the_others_weigh(bad, reason):
    got = particles.weigh_together(CLOUD, BEACONS, [Z[0], bad, Z[2]])
    others = particles.weigh_together(CLOUD, [BEACONS[0], BEACONS[2]], [Z[0], Z[2]])
    np.testing.assert_array_equal(got.cloud.weights, others.cloud.weights)
    assert got.used == (0, 2) and got.rejected[1].reason == reason


def test_where_nothing_can_be_used_the_cloud_stays_as_it_was():
    got = particles.weigh_together(CLOUD, BEACONS[:1], [[np.inf]])
    assert got.cloud is CLOUD and got.used == () and 0 in got.rejected


def test_numbers_of_sensors_and_measurements_that_differ_raise():
    with pytest.raises(ValueError, match="one z and one R for each of 3 sensors, got 2 and 3"):
        particles.weigh_together(CLOUD, BEACONS, Z[:2])
