"""The joint of the simulated camera: it turns towards what is wished at its own rate, and says where it stands."""

from __future__ import annotations

import numpy as np

from wakewise.core.interfaces import Measurement
from wakewise.robot.vehicles.tilt import TiltJoint
from wakewise.simulation.tank.settings import SensorSettings


class CameraJoint:
    """A tilt joint with its encoder; a camera without a joint stays at zero and measures nothing.

    Parameters
    ----------
    joint : TiltJoint or None
    tilt_rad : float
        Where it stands at the start; its stops hold it.
    settings : SensorSettings
        Bias and noise of what it measures.
    rng : numpy Generator
        Draws both.
    """

    def __init__(
        self, joint: TiltJoint | None, tilt_rad: float, settings: SensorSettings, rng: np.random.Generator
    ) -> None:
        self._joint, self._rng, self._noise_rad = joint, rng, settings.tilt_noise_rad
        self._bias_rad = float(rng.normal(0.0, settings.tilt_bias_rad))
        self.tilt_rad = 0.0 if joint is None else joint.within(tilt_rad)
        """Where it truly stands."""
        self._wished_rad = self.tilt_rad

    def aim(self, tilt_rad: float) -> None:
        """Wish an angle; one that is not finite leaves the wish as it was."""
        if np.isfinite(tilt_rad):
            self._wished_rad = tilt_rad

    def turn(self, time_s: float, dt_s: float) -> tuple[Measurement, ...]:
        """Turn for `dt_s` until `time_s`; what the encoder then says, nothing where there is no joint."""
        if self._joint is None:
            return ()
        self.tilt_rad = self._joint.towards(self.tilt_rad, self._wished_rad, dt_s)
        read = self.tilt_rad + self._bias_rad + float(self._rng.normal(0.0, self._noise_rad))
        return (Measurement(time_s=time_s, tilt_rad=read),)
