"""Flow since a key frame as the down camera and its eye would report it, without a picture: for Monte Carlo flights.

The ground point that was straight ahead of the camera at the key frame is projected into the camera now. A new key
frame is taken where too little of the old one is in sight. On top come the matching's errors, fitted to what the eye
finds in rendered pictures of the courtyard: white, of one picture and the next alike for some tenths of a second (the
sampling of one and the same texture), and what the key frame's own noise leaves, the same as long as it is used.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flightlog.camera import CameraModel, CameraMount
from flightlog.signals import FlowSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import LATENCY, RATE, Device
from sim.sensors.noise import gauss_markov


class FlowCamera(Device):
    """Image motion since a key frame; its constructor also wants the camera and its mount."""

    topic: ClassVar[str] = "flow"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        Parameter("rate", RATE.unit, RATE.low, RATE.high, "samples a second: the down camera's own", 25.0),
        Parameter("latency", LATENCY.unit, LATENCY.low, LATENCY.high, "the down camera's own", 0.06),
        Parameter("noise", "px", 0.0, 10.0, "white, of the whole picture's motion"),
        Parameter("slow_noise", "px", 0.0, 10.0, "the same, Gauss-Markov"),
        Parameter("slow_tau", "s", 0.01, 1e4, "its time constant"),
        Parameter("key_noise", "px", 0.0, 10.0, "the same for all flow since one key frame"),
        Parameter("least_overlap", "1", 0.0, 1.0, "of the key frame in sight: less, and a new one is taken"),
        Parameter("least_height", "m", 0.0, 10.0, "camera above the ground: nearer everything is a blur"),
        Parameter("greatest_height", "m", 0.1, 1000.0, "farther the ground shows nothing to match"),
        Parameter("detection_share", "1", 0.0, 1.0, "of the pictures in which there is flow"),
        Parameter("scale", "1", 0.5, 2.0, "fixed scale, measured motion over true", 1.0),
        Parameter("bias_u", "rad", -1.0, 1.0, "fixed error of the motion along camera x", 0.0),
        Parameter("bias_v", "rad", -1.0, 1.0, "the same along camera y", 0.0),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = (("u", "rad"), ("v", "rad"))

    def __init__(
        self,
        numbers: Mapping[str, float],
        position: Floats,
        site: Site,
        rng: np.random.Generator,
        *,
        camera: CameraModel,
        mount: CameraMount,
    ) -> None:
        """`mount` holds what `position` says, and the axes."""
        super().__init__(numbers, position, site, rng)
        self._camera, self._mount = camera, mount
        self._key = math.nan  # [s]
        self._ground = np.zeros(3)  # [m] what was straight ahead then
        self._of_key: Floats = np.zeros(2)  # in standard deviations, as the next
        self._slow: list[float] = rng.standard_normal(2).tolist()
        self._error = (math.nan, math.nan)

    def sample(self, truth: Truth) -> FlowSample | None:
        """What the eye reports of a picture exposed at `truth`; None for the first, or where nothing is to see."""
        n, camera, rotation = self.numbers, self._camera, truth.rotation
        normal = self.rng.standard_normal(6)
        found = self.rng.random() < n["detection_share"]
        dt = self.elapsed(truth.t)
        self._slow = [gauss_markov(x, 1.0, n["slow_tau"], dt, w) for x, w in zip(self._slow, normal[:2], strict=True)]
        self._error = (math.nan, math.nan)
        place = truth.position + rotation @ self._mount.position
        axes = rotation @ self._mount.axes
        ahead = axes[:, 2]
        if not n["least_height"] <= place[2] <= n["greatest_height"] or ahead[2] > -0.5:
            self._key = math.nan
            return None
        key, ground, of_key = self._key, self._ground, self._of_key
        share, u, v = 0.0, math.nan, math.nan
        if not math.isnan(key):
            x, y, z = (axes.T @ (ground - place)).tolist()
            if z > 0.0:
                u, v = x / z, y / z
                across, down = abs(u) * camera.fx / camera.width, abs(v) * camera.fy / camera.height
                share = max(0.0, 1.0 - across) * max(0.0, 1.0 - down)
        if share < n["least_overlap"]:
            self._key, self._of_key = truth.t, normal[4:]
            self._ground = place - ahead * (place[2] / ahead[2])
        if share == 0.0 or not found:
            return None
        pixels = n["noise"] * normal[2:4] + n["slow_noise"] * np.array(self._slow) + n["key_noise"] * of_key
        bias = np.array([n["bias_u"], n["bias_v"]])
        seen_u, seen_v = (n["scale"] * np.array([u, v]) + bias + pixels / [camera.fx, camera.fy]).tolist()
        self._error = (seen_u - u, seen_v - v)
        return FlowSample(truth.t, truth.t + n["latency"], truth.t - key, seen_u, seen_v, share)

    def errors(self) -> tuple[float, ...]:
        """Error of the last report; NaN where nothing was reported."""
        return self._error
