"""MS5837: the data sheets' own figures, a part imitated byte by byte, and what goes wrong on a wet connector."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.sensors import DepthSensor
from wakewise_ardusub.sensors.ms5837 import (
    CONVERSION_S,
    CONVERT_PRESSURE,
    CONVERT_TEMPERATURE,
    READ_PROM,
    RESET,
    Model,
    compensated,
    crc4,
    depth_m,
)

SHEET_30BA = (0, 34982, 36352, 20328, 22354, 26646, 26146)
"""C1 to C6 of the example in the sheet of the 30BA (Rev C2 12/2019, page 11): D1 4958179, D2 6815414."""
SHEET_02BA = (0, 46372, 43981, 29059, 27842, 31553, 28165)
"""The same in the sheet of the 02BA (09/2017, page 7): D1 6465444, D2 8077636."""


def _with_sum(words: tuple[int, ...], product: int = 0) -> tuple[int, ...]:
    """Calibration as a part holds it: product number and check sum in the first word."""
    first = (product << 5, *words[1:])
    return (first[0] | crc4(first) << 12, *words[1:])


class Part:
    """An MS5837 as a bus sees it: it answers what was last commanded, and has converted once it was waited for."""

    def __init__(self, words: tuple[int, ...], d1: int, d2: int) -> None:
        self.words, self.values = words, {CONVERT_PRESSURE: d1, CONVERT_TEMPERATURE: d2}
        self.commands: list[int] = []
        self.slept_s = 0.0
        self.now: Callable[[], float] = lambda: self.slept_s
        self.pending: tuple[int, float] | None = None
        self.result = 0

    def write(self, address: int, data: bytes) -> None:
        assert (address, len(data)) == (0x76, 1)
        self.commands.append(data[0])
        if data[0] & 0xF0 in self.values:
            step = (data[0] & 0x0F) // 2
            self.pending = (self.values[data[0] & 0xF0], self.now() + CONVERSION_S[step])

    def read(self, address: int, count: int) -> bytes:
        command = self.commands[-1]
        if command >= READ_PROM:
            return self.words[(command - READ_PROM) // 2].to_bytes(2, "big")[:count]
        done = self.pending is not None and self.now() >= self.pending[1]
        return (self.pending[0] if done and self.pending else 0).to_bytes(3, "big")

    def sleep(self, seconds: float) -> None:
        self.slept_s += seconds


@pytest.mark.parametrize(
    ("model", "words", "d1", "d2", "temperature_C", "pressure_Pa"),
    [
        ("30BA", SHEET_30BA, 4958179, 6815414, 19.81, 399_980.0),
        ("02BA", SHEET_02BA, 6465444, 8077636, 20.00, 110_002.0),
    ],
)
def test_first_order_is_the_sheets_own_example(
    model: Model, words: tuple[int, ...], d1: int, d2: int, temperature_C: float, pressure_Pa: float
) -> None:
    """3999.8 mbar at 19.81 deg C and 1100.02 mbar at 20.00 deg C, to the last digit."""
    reading = compensated(model, words, d1, d2, second_order=False)
    assert (reading.temperature_C, reading.pressure_Pa) == (temperature_C, pressure_Pa)


@pytest.mark.parametrize(
    ("model", "words", "d1", "d2s"),
    [
        ("30BA", SHEET_30BA, 4958179, (4_000_000, 5_500_000, 6_815_414, 6_900_000, 8_000_000)),
        ("02BA", SHEET_02BA, 6465444, (6_000_000, 7_500_000, 8_077_636, 8_200_000, 9_000_000)),
    ],
)
def test_second_order_is_the_sheets_formula_in_real_numbers(
    model: Model, words: tuple[int, ...], d1: int, d2s: tuple[int, ...]
) -> None:
    """Written out anew with real numbers, from below -15 to above 20 deg C: within the rounding of whole ones."""
    _, c1, c2, c3, c4, c5, c6 = words
    small = model == "02BA"
    for d2 in d2s:
        dt = d2 - c5 * 2**8
        temp = 2000 + dt * c6 / 2**23
        off = c2 * 2**17 + c4 * dt / 2**6 if small else c2 * 2**16 + c4 * dt / 2**7
        sens = c1 * 2**16 + c3 * dt / 2**7 if small else c1 * 2**15 + c3 * dt / 2**8
        off_i = sens_i = t_i = 0.0
        if small and temp < 2000:
            t_i, off_i, sens_i = 11 * dt**2 / 2**35, 31 * (temp - 2000) ** 2 / 2**3, 63 * (temp - 2000) ** 2 / 2**5
        elif not small and temp < 2000:
            t_i, off_i, sens_i = 3 * dt**2 / 2**33, 3 * (temp - 2000) ** 2 / 2, 5 * (temp - 2000) ** 2 / 2**3
            if temp < -1500:
                off_i, sens_i = off_i + 7 * (temp + 1500) ** 2, sens_i + 4 * (temp + 1500) ** 2
        elif not small:
            t_i, off_i = 2 * dt**2 / 2**37, (temp - 2000) ** 2 / 2**4
        pressure = (d1 * (sens - sens_i) / 2**21 - (off - off_i)) / (2**15 / 1.0 if small else 2**13 / 10.0)
        reading = compensated(model, words, d1, d2)
        assert reading.temperature_C == pytest.approx((temp - t_i) / 100.0, abs=0.021)
        assert reading.pressure_Pa == pytest.approx(pressure, abs=25.0)


def test_a_part_is_reset_read_and_asked_in_order() -> None:
    """Reset, seven words, pressure, its value, temperature, its value; 10 m of water over a surface are 10 m."""
    part = Part(_with_sum(SHEET_30BA, 0x1A), 4958179, 6815414)
    sensor = DepthSensor(part, "MS5837-30ba", surface_Pa=300_000.0, sleep=part.sleep)
    reading = sensor.read()
    measured = sensor.measured(reading, 12.5)
    assert part.commands == [RESET, *range(0xA0, 0xAE, 2), 0x4A, 0x00, 0x5A, 0x00]
    assert measured.time_s == 12.5
    assert measured.depth_m == pytest.approx((reading.pressure_Pa - 300_000.0) / 9806.65)
    assert sensor.zero(3) == reading.pressure_Pa
    assert sensor.measured(sensor.read(), 13.0).depth_m == 0.0
    assert depth_m(101_325.0 + 98_066.5) == pytest.approx(10.0)


@given(st.lists(st.integers(0, 0xFFFF), min_size=7, max_size=7), st.integers(0, 111))
def test_one_wrong_bit_of_the_calibration_is_noticed(words: list[int], bit: int) -> None:
    """Whatever the words; a part whose calibration was read wrong would be metres off."""
    right = list(_with_sum(tuple(words)))
    right[bit // 16] ^= 1 << bit % 16
    assert crc4(right) != right[0] >> 12


def test_what_goes_wrong_is_one_line() -> None:
    """No answer, a wrong check sum, all zeros, the other model by its own word or by what it reads, no conversion."""

    class Broken(Part):
        def read(self, address: int, count: int) -> bytes:
            raise OSError(121, "Remote I/O error")

    good = _with_sum(SHEET_30BA, 0x1A)
    for part, model, said in (
        (Broken(good, 1, 1), "30BA", "does not answer, Remote I/O error"),
        (Part((good[0] ^ 0x1000, *good[1:]), 1, 1), "30BA", "check sum"),
        (Part((0,) * 7, 1, 1), "30BA", "check sum"),
        (Part(good, 1, 1), "02BA", "says that it is a 30BA"),
        (Part(good, 1, 1), "31BA", "30BA, 02BA"),
    ):
        with pytest.raises((EnvironmentFailure, InputError), match=said):
            DepthSensor(part, model, sleep=part.sleep)
    part = Part(_with_sum(SHEET_30BA), 4958179, 6815414)
    with pytest.raises(EnvironmentFailure, match="other model"):
        DepthSensor(part, "02BA", sleep=part.sleep).read()
    with pytest.raises(EnvironmentFailure, match="before it had converted"):
        DepthSensor(part, "30BA", sleep=lambda _: None).read()
    with pytest.raises(InputError, match="8192"):
        DepthSensor(part, oversampling=100, sleep=part.sleep)
