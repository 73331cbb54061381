# SPDX-License-Identifier: Apache-2.0
"""No spike is lost between the samples and the screen."""

import numpy as np
import pytest
from driveid.views.decimate import Pyramid, trace


@pytest.mark.parametrize("rows", [10, 999, 4097, 300_000, 1_000_003])
@pytest.mark.parametrize("part", [(0.0, 1.0), (0.2, 0.7), (0.4999, 0.5001)])
def test_extremes_of_what_is_shown_are_the_extremes_of_the_samples(rows, part):
    rng = np.random.default_rng(rows)
    t, y = np.arange(rows) * 1e-3, rng.standard_normal(rows)
    y[int(0.5 * rows)] = 50.0
    begin, end = part[0] * t[-1], part[1] * t[-1] + 1e-3
    times, rows_shown = trace(t, [Pyramid(y)], begin, end, 800)
    inside = y[(t >= begin) & (t <= end)]
    assert len(times) <= max(1600, 4)
    assert rows_shown[0].max() == 50.0 == inside.max()
    assert rows_shown[0].min() <= inside.min()
    assert np.all(np.diff(times) >= 0.0)


def test_few_samples_are_given_as_they_are():
    t, y = np.arange(500) * 0.01, np.random.default_rng(1).standard_normal(500)
    times, shown = trace(t, [Pyramid(y)], 1.0, 2.0, 400)
    assert np.array_equal(shown[0], y[(times[0] <= t) & (t <= times[-1])])


def test_gaps_stay_gaps_and_spikes_beside_them_stay():
    t, y = np.arange(100_000) * 1e-3, np.zeros(100_000)
    y[40_000:60_000] = np.nan
    y[39_990] = -3.0
    _, shown = trace(t, [Pyramid(y)], 0.0, 100.0, 500)
    assert np.isnan(shown[0]).sum() > 150
    assert np.nanmin(shown[0]) == -3.0
