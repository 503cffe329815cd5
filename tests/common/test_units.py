"""How units are written on axes."""

import pytest

from mbsvib.common import units


@pytest.mark.parametrize(
    ("output", "source", "expected"),
    [
        ("m", "N", "m/N"),
        ("rad", "N m", "rad/(N m)"),
        ("m/s^2", "m/s^2", "1"),
        ("rad/s^2", "m/s^2", "rad/m"),
        ("m/s", "N", "(m/s)/N"),
        ("m", "m/s^2", "s^2"),
        ("N", "m/s^2", "N/(m/s^2)"),
        ("m + rad", "N + N m", "(m + rad)/(N + N m)"),
        ("m/s^2 + rad/s^2", "m/s^2", "(m/s^2 + rad/s^2)/(m/s^2)"),
    ],
)
def test_ratio(output, source, expected):
    assert units.ratio(output, source) == expected


def test_pretty():
    assert units.pretty("m/s^2") == "m/s²"
    assert units.pretty("N/(m/s^2)") == "N/(m/s²)"
    assert units.pretty("s^-1") == "s⁻¹"
    assert units.pretty("N m") == "N m"


@pytest.mark.parametrize(
    ("unit", "largest", "shown", "name"),
    [
        ("m", 2.8e-8, 28.0, "nm"),
        ("m", 1e-3, 1.0, "mm"),
        ("m", 0.9999, 999.9, "mm"),
        ("N", 4.2e5, 420.0, "kN"),
        ("rad", 4.2e5, 4.2e5, "rad"),
        ("m", 3e-17, 3e-5, "pm"),
        ("s", 20.0, 20.0, "s"),
        ("m + rad", 1e-6, 1e-6, "m + rad"),
        ("m", 0.0, 0.0, "m"),
        ("s^2", 4e-6, 4e-6, "s^2"),  # 4 µs² would be 4e-12 s²
        ("1", 4e-6, 4e-6, "1"),
        ("(m/s)/N", 4e-6, 4.0, "(µm/s)/N"),
        ("(rad/s)/N", 4e6, 4e6, "(rad/s)/N"),
        ("m/s^2", 4e-3, 4.0, "mm/s^2"),
    ],
)
def test_prefix(unit, largest, shown, name):
    factor, prefixed = units.prefix(unit, largest)
    assert prefixed == name
    assert factor * largest == pytest.approx(shown, rel=1e-12)


def test_no_unit_has_no_prefix():
    """Systems of python-control have none."""
    assert units.prefix("", 2.8e-8) == (1.0, "")


def test_times_of_any_size():
    expected = {0.0: "ms", 1.25e-9: "ns", 2e-6: "ms", 0.3: "ms", 12.0: "s", 1e4: "ks"}
    assert {time: units.time_unit(time)[1] for time in expected} == expected
