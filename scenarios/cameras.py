"""The cameras that fly: the vehicle's own, as a scenario changes them."""

from collections.abc import Mapping
from dataclasses import replace

from flightlog.equipment import CameraSpec
from scenarios.schema import Cameras, CameraTable
from sim.cameras.blur import Blur
from sim.cameras.exposure import Exposure
from sim.cameras.imaging import Imaging
from sim.cameras.noise import Noise


def fitted(cameras: Mapping[str, CameraSpec], tables: Cameras) -> dict[str, CameraSpec]:
    """The cameras with what the scenario changes of rate, latency and lens."""
    changed = {}
    for name, spec in cameras.items():
        table = getattr(tables, name, CameraTable())
        if table.rate_hz is not None:
            spec = replace(spec, rate=table.rate_hz)
        if table.latency_s is not None:
            spec = replace(spec, latency=table.latency_s)
        if table.distortion is not None:
            spec = replace(spec, model=replace(spec.model, distortion=tuple(table.distortion)))
        changed[name] = spec
    return changed


def imaging(cameras: Mapping[str, CameraSpec], tables: Cameras) -> dict[str, Imaging]:
    """How each camera makes its pictures."""
    made = {}
    for name, spec in cameras.items():
        table = getattr(tables, name, CameraTable())
        made[name] = Imaging(
            colour=spec.colour,
            exposure=Exposure(gain=table.gain, target=table.mean_level),
            blur=Blur(defocus=table.defocus_px, exposure_time=table.exposure_ms * 1e-3),
            noise=Noise(read=table.read_noise, shot=table.shot_noise),
        )
    return made
