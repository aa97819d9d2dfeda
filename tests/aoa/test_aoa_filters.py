"""Low pass, notch, spectrum and running median against SciPy's, which take too long to load for a command."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import median_filter
from scipy.signal import butter, iirnotch, sosfilt, sosfilt_zi, welch

from inercal.systems.aoa.band import Band
from inercal.systems.aoa.diagnosis.spectrum import _running_median, powers
from inercal.systems.aoa.fusion.band import filter_of
from inercal.systems.aoa.limits import LIMITS


@settings(max_examples=30, deadline=None)
@given(st.floats(1e-3, 0.99), st.floats(1e-3, 0.99), st.floats(20.0, 5000.0))
def test_a_band_is_a_butterworth_low_pass_and_a_notch(low, notch, rate):
    band = Band(low * LIMITS.widest_corner * rate, (notch * LIMITS.widest_corner * rate,), rate)
    wanted = np.vstack(
        [
            butter(LIMITS.low_pass_order, band.corner, output="sos", fs=rate),
            np.hstack(iirnotch(band.notch[0], LIMITS.notch_quality, fs=rate))[None],
        ]
    )
    x = np.random.default_rng(1).standard_normal(500)
    np.testing.assert_allclose(sosfilt(band.sections, x), sosfilt(wanted, x), rtol=0, atol=1e-8)
    still = filter_of(band).still
    at_rest, _ = sosfilt(band.sections, np.ones(50), zi=still)
    np.testing.assert_allclose(at_rest, 1.0, rtol=0, atol=1e-8)
    np.testing.assert_allclose(still, sosfilt_zi(band.sections), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("n", [999, 5000, 20_001])
def test_a_spectrum_is_that_of_welch(n):
    values = np.random.default_rng(2).standard_normal((n, 3)) + 5.0
    frequency, density = powers(np.arange(n) / 500.0, values)
    wanted = welch(values, 500.0, nperseg=min(n, round(500.0 * LIMITS.line_segment)), axis=0)
    np.testing.assert_allclose(frequency, wanted[0], rtol=1e-12, atol=0)
    np.testing.assert_allclose(density, wanted[1], rtol=1e-10, atol=0)
    width = 2 * round(0.5 * LIMITS.line_surroundings / frequency[1]) + 1
    np.testing.assert_array_equal(
        _running_median(density, frequency), median_filter(density, size=(width, 1), mode="nearest")
    )
