"""Pressure and temperature of TE's MS5837-30BA (Bar30) and MS5837-02BA (Bar02), over I2C.

Commands, times, compensation of first and second order and the checksum are those of TE's data sheets: MS5837-30BA
Rev C2 12/2019 and MS5837-02BA 09/2017, sections "Pressure and temperature calculation", "Second-order temperature
compensation" and "Cyclic redundancy check". The arithmetic is in integers, as there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.interfaces import Measurement

ADDRESS = 0x76
RESET, READ_ADC, READ_PROM, CONVERT_PRESSURE, CONVERT_TEMPERATURE = 0x1E, 0x00, 0xA0, 0x40, 0x50
WORDS = 7
OVERSAMPLING = (256, 512, 1024, 2048, 4096, 8192)
CONVERSION_S = (0.60e-3, 1.17e-3, 2.28e-3, 4.54e-3, 9.04e-3, 18.08e-3)
"""Longest time of a conversion at each oversampling ratio (data sheet, "Analogue digital converter")."""
RESET_S = 10e-3
STANDARD_PRESSURE_PA = 101_325.0

Model = Literal["30BA", "02BA"]
MODELS: tuple[Model, ...] = ("30BA", "02BA")
RANGE_PA: dict[Model, tuple[float, float]] = {"30BA": (0.0, 30e5), "02BA": (0.3e5, 2.0e5)}
"""What the sheets state accuracy for is 0 to 30 bar, and 300 mbar to 1.2 bar; the small one reads on to 2 bar."""
_PRODUCTS: dict[int, Model] = {0x15: "02BA", 0x1A: "30BA"}
"""Bits 11 to 5 of word 0 of the newer parts 02BA21 and 30BA26; older ones have zeros, whichever they are."""


class I2C(Protocol):
    """An I2C bus, such as `wakewise_ardusub.sensors.devices.I2CBus`."""

    def write(self, address: int, data: bytes) -> None:
        """Send bytes to a device."""
        ...

    def read(self, address: int, count: int) -> bytes:
        """Take `count` bytes from a device."""
        ...


@dataclass(frozen=True)
class PressureReading:
    """Pressure and temperature of one instant."""

    pressure_Pa: float
    temperature_C: float


def crc4(words: Sequence[int]) -> int:
    """Check sum of the seven words of the calibration; it stands in the upper four bits of the first."""
    remainder = 0
    for word in (words[0] & 0x0FFF, *words[1:WORDS], 0):
        for byte in (word >> 8, word & 0xFF):
            remainder ^= byte
            for _ in range(8):
                remainder = (remainder << 1) ^ (0x3000 if remainder & 0x8000 else 0)
    return (remainder >> 12) & 0xF


def compensated(model: Model, words: Sequence[int], d1: int, d2: int, second_order: bool = True) -> PressureReading:
    """Pressure and temperature of the raw values D1 and D2, by the calibration words W0 to W6."""
    temp, off, sens, dt = _first_order(model, words, d2)
    off_less, sens_less, temp_less = _second_order(model, temp, dt) if second_order else (0, 0, 0)
    pressure = _pressure(model, d1, off - off_less, sens - sens_less)
    return PressureReading(pressure, (temp - temp_less) / 100.0)


def _first_order(model: Model, words: Sequence[int], d2: int) -> tuple[int, int, int, int]:
    """TEMP (0.01 deg C), OFF, SENS and dT of the sheet."""
    c1, c2, c3, c4, c5, c6 = words[1:WORDS]
    dt = d2 - (c5 << 8)
    temp = 2000 + ((dt * c6) >> 23)
    if model == "02BA":
        return temp, (c2 << 17) + ((c4 * dt) >> 6), (c1 << 16) + ((c3 * dt) >> 7), dt
    return temp, (c2 << 16) + ((c4 * dt) >> 7), (c1 << 15) + ((c3 * dt) >> 8), dt


def _second_order(model: Model, temp: int, dt: int) -> tuple[int, int, int]:
    """OFFi, SENSi and Ti of the sheet."""
    cold = (temp - 2000) ** 2
    if model == "02BA":
        if temp < 2000:
            return (31 * cold) >> 3, (63 * cold) >> 5, (11 * dt * dt) >> 35
        return 0, 0, 0
    if temp >= 2000:
        return cold >> 4, 0, (2 * dt * dt) >> 37
    off, sens = (3 * cold) >> 1, (5 * cold) >> 3
    if temp < -1500:
        colder = (temp + 1500) ** 2
        off, sens = off + 7 * colder, sens + 4 * colder
    return off, sens, (3 * dt * dt) >> 33


def _pressure(model: Model, d1: int, off: int, sens: int) -> float:
    """Pressure in Pa: counts are 0.01 mbar of the 02BA, 0.1 mbar of the 30BA."""
    scaled = ((d1 * sens) >> 21) - off
    return float(scaled >> 15) if model == "02BA" else 10.0 * float(scaled >> 13)


def depth_m(pressure_Pa: float, surface_Pa: float = STANDARD_PRESSURE_PA, density: float = TRIM_WATER_KG_M3) -> float:
    """Depth of a pressure below a surface, m, positive down."""
    return (pressure_Pa - surface_Pa) / (density * GRAVITY_M_S2)


class DepthSensor:
    """An MS5837 on a bus.

    Parameters
    ----------
    bus : I2C
    model : str
        "30BA" or "02BA"; newer parts say which they are and must agree.
    oversampling : int
        One of `OVERSAMPLING`.
    surface_Pa, density : float
        Pressure at the surface, and kg/m3 of the water.
    address : int
    sleep : callable
        Waits while the sensor converts.

    Raises
    ------
    InputError
        If model or oversampling are not known, or the part says that it is the other model.
    EnvironmentFailure
        If nothing answers, or the calibration's check sum is wrong.
    """

    def __init__(
        self,
        bus: I2C,
        model: str = "30BA",
        *,
        oversampling: int = 8192,
        surface_Pa: float = STANDARD_PRESSURE_PA,
        density: float = TRIM_WATER_KG_M3,
        address: int = ADDRESS,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._bus, self._address, self._sleep = bus, address, sleep
        self.model = _known_model(model)
        if oversampling not in OVERSAMPLING:
            raise InputError(f"oversampling {oversampling}: allowed are {', '.join(map(str, OVERSAMPLING))}")
        if not 500.0 <= density <= 2000.0:
            raise InputError(f"density {density:g}: 500 to 2000 kg/m3 are allowed")
        self._step = OVERSAMPLING.index(oversampling)
        self.conversion_s = CONVERSION_S[self._step]
        self.surface_Pa, self.density = surface_Pa, density
        self._write(RESET)
        sleep(RESET_S)
        self.words = tuple(int.from_bytes(self._ask(READ_PROM + 2 * k, 2), "big") for k in range(WORDS))
        if crc4(self.words) != self.words[0] >> 12 or not any(self.words):
            raise EnvironmentFailure(
                f"MS5837 at 0x{address:02x}: the calibration's check sum is {self.words[0] >> 12:x}, must be "
                f"{crc4(self.words):x}; check wires and pull-ups, or another device answers there"
            )
        product = _PRODUCTS.get((self.words[0] >> 5) & 0x7F)
        if product is not None and product != self.model:
            raise InputError(f"MS5837 at 0x{address:02x}: says that it is a {product}, was told to be a {self.model}")

    def read(self) -> PressureReading:
        """Convert and read once, waiting; takes two conversions, 36 ms at the finest.

        Raises
        ------
        EnvironmentFailure
            If the sensor does not answer, or what it says lies outside its range.
        """
        steps = self.reading()
        while True:
            try:
                self._sleep(next(steps))
            except StopIteration as done:
                reading: PressureReading = done.value
                return reading

    def reading(self) -> Generator[float, None, PressureReading]:
        """The same for who has other things to do meanwhile: yields how long to wait, s, before it goes on."""
        raw = []
        for command in (CONVERT_PRESSURE, CONVERT_TEMPERATURE):
            self._write(command + 2 * self._step)
            yield self.conversion_s
            raw.append(int.from_bytes(self._ask(READ_ADC, 3), "big"))
        if not all(raw):
            raise EnvironmentFailure(f"MS5837 at 0x{self._address:02x}: read before it had converted")
        reading = compensated(self.model, self.words, raw[0], raw[1])
        low, high = RANGE_PA[self.model]
        if not low <= reading.pressure_Pa <= high or not -40.0 <= reading.temperature_C <= 85.0:
            raise EnvironmentFailure(
                f"MS5837 at 0x{self._address:02x}: {reading.pressure_Pa / 100.0:.0f} mbar at "
                f"{reading.temperature_C:.1f} deg C lie outside what a {self.model} measures; is it the other model?"
            )
        return reading

    def measured(self, reading: PressureReading, time_s: float) -> Measurement:
        """A reading as depth, stamped `time_s`."""
        return Measurement(time_s=time_s, depth_m=depth_m(reading.pressure_Pa, self.surface_Pa, self.density))

    def zero(self, readings: int = 20) -> float:
        """Take the pressure of now, the mean of some readings, for the surface's; returns it in Pa."""
        self.surface_Pa = sum(self.read().pressure_Pa for _ in range(readings)) / readings
        return self.surface_Pa

    def _ask(self, command: int, count: int) -> bytes:
        self._write(command)
        try:
            data = self._bus.read(self._address, count)
        except OSError as fault:
            raise self._silent(fault) from None
        if len(data) != count:
            raise EnvironmentFailure(f"MS5837 at 0x{self._address:02x}: {len(data)} bytes came, {count} were asked for")
        return data

    def _write(self, command: int) -> None:
        try:
            self._bus.write(self._address, bytes([command]))
        except OSError as fault:
            raise self._silent(fault) from None

    def _silent(self, fault: OSError) -> EnvironmentFailure:
        why = fault.strerror or str(fault)
        return EnvironmentFailure(f"MS5837 at 0x{self._address:02x}: does not answer, {why}")


def _known_model(word: str) -> Model:
    for model in MODELS:
        if word.upper().removeprefix("MS5837-") == model:
            return model
    raise InputError(f"model '{word}': allowed are {', '.join(MODELS)}")
