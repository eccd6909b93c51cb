"""What can be wrong with a helicopter, by the name of its cause, with sizes and signs drawn.

Each entry draws one effect; where it can, half of the draws are in equations that are not the model's (`form`).
`values` holds the catalogue's parameters as they then truly are, so far as the foreign form has any.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sim.sensors.faults import ClockOffset, Fault, Spike
from sim.terms.contract import Term
from sim.vehicle import Vehicle
from sim.world import World
from tests.blind import foreign
from tests.blind.flights import Tampering

Rng = np.random.Generator


@dataclass(frozen=True)
class Effect:
    """One thing that is wrong."""

    name: str
    where: str
    form: str
    settings: Mapping[str, tuple[float, str]] = field(default_factory=dict)  # vehicle file's key: value, unit
    values: Mapping[str, float] = field(default_factory=dict)  # by the catalogue's parameter; some may be missing
    terms: tuple[tuple[Term, Mapping[str, float]], ...] = ()
    tampering: tuple[Tampering, ...] = ()
    needs: tuple[str, ...] = ()  # topics without which it cannot be seen
    which: str = ""  # rotor, joint or input that it sits on
    numbers: Mapping[str, float] = field(default_factory=dict)  # of a multirotor or rig, by the file's key, SI
    otherwise: Mapping[str, float] = field(default_factory=dict)  # of their flights' own numbers, OTHERWISE


Draw = Callable[[Vehicle, Rng, float], Effect]  # the vehicle as it is, randomness, share of the usual size


def signed(rng: Rng, low: float, high: float) -> float:
    """A size of either sign."""
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))


def _set(
    name: str, where: str, key: str, value: float, unit: str, parameter: str, needs: tuple[str, ...] = ()
) -> Effect:
    return Effect(name, where, "catalogue", {key: (value, unit)}, {parameter: value}, needs=needs)


def _ground_effect(v: Vehicle, rng: Rng, share: float) -> Effect:
    form = str(rng.choice(["catalogue", "hayden", "exponential"]))
    key, unit = "terms.ground_effect.gain", "1"
    if form == "hayden":
        gain = 1.0 + share * float(rng.uniform(0.3, 0.8))
        return Effect("ground_effect", "plant", form, {key: (0.0, unit)}, terms=((foreign.HAYDEN, {"gain": gain}),))
    if form == "exponential":
        size = 0.16 + share * float(rng.uniform(0.12, 0.25))
        numbers = {"size": size, "decay": 1.0}
        return Effect("ground_effect", "plant", form, {key: (0.0, unit)}, terms=((foreign.EXPONENTIAL, numbers),))
    gain = v.parameters["ground_effect"]["gain"] + share * signed(rng, 0.5, 0.9)
    return _set("ground_effect", "plant", key, gain, unit, "gain")


def _thrust_scale(v: Vehicle, rng: Rng, share: float) -> Effect:
    rotor, change = v.parameters["main_rotor"], 1.0 + share * signed(rng, 0.15, 0.3)
    value = rotor["thrust_scale"] * change
    if rng.random() < 0.5:  # the same, written as blades of another section
        slope = rotor["lift_slope"] * change
        return Effect("thrust_scale", "plant", "lift slope", {"terms.main_rotor.lift_slope": (slope, "1")})
    return _set("thrust_scale", "plant", "terms.main_rotor.thrust_scale", value, "1", "scale")


def _mass(v: Vehicle, rng: Rng, share: float) -> Effect:
    mass = float(v.geometry["mass"])
    value = mass + share * signed(rng, 0.4, 1.0)
    if rng.random() < 0.5:  # a load with an extent of its own, hung under the mast
        inertia = [float(i) + (value - mass) * 0.08**2 for i in v.inertia]
        settings = {"mass": (value, "kg"), **{f"inertia.{i}": (inertia[i], "kg m^2") for i in range(3)}}
        return Effect("mass", "plant", "load", settings, {"mass": value})
    return _set("mass", "plant", "mass", value, "kg", "mass")


def _fuel_burn(v: Vehicle, rng: Rng, share: float) -> Effect:
    more, rate = share * float(rng.uniform(2e-3, 5e-3)), v.parameters["fuel"]["rate"]
    if rng.random() < 0.5:
        numbers = {"rate": more, "every": float(rng.uniform(2.0, 6.0))}
        return Effect("fuel_burn", "plant", "stepwise", values={"rate": rate + more},
                      terms=((foreign.STEP_BURN, numbers),))  # fmt: skip
    settings = {"terms.fuel.rate": (rate + more, "kg/s"), "terms.fuel.capacity": (2.0, "kg")}
    return Effect("fuel_burn", "plant", "catalogue", settings, {"rate": rate + more})


def _cg_offset(v: Vehicle, rng: Rng, share: float) -> Effect:
    angle, far = rng.uniform(0.0, 2.0 * math.pi), share * float(rng.uniform(0.008, 0.016))
    x, y = far * math.cos(angle), far * math.sin(angle)
    hub, tail = v.geometry["hub"], v.geometry["tail_hub"]
    if rng.random() < 0.5:  # both rotors moved the other way, fuselage and fins left where they are
        settings = {f"rotor.hub.{i}": (float(hub[i]) - (x, y, 0.0)[i], "m") for i in range(3)}
        settings |= {f"tail_rotor.hub.{i}": (float(tail[i]) - (x, y, 0.0)[i], "m") for i in range(3)}
        return Effect("cg_offset", "plant", "rotors moved", settings, {"x": x, "y": y})
    settings = {f"terms.cg_offset.{a}": (value, "m") for a, value in (("x", x), ("y", y), ("z", 0.0))}
    return Effect("cg_offset", "plant", "catalogue", settings, {"x": x, "y": y})


def _drag(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    form = str(rng.choice(["plate", "linear", "power"]))
    area, linear = (
        (share * float(rng.uniform(0.12, 0.3)), 0.0) if form == "plate" else (0.0, share * rng.uniform(0.4, 1.0))
    )
    if form == "power":
        numbers = {"factor": share * float(rng.uniform(0.2, 0.4)), "power": float(rng.uniform(1.3, 1.7))}
        return Effect("drag", "plant", form, terms=((foreign.POWER_DRAG, numbers),))
    settings = {"terms.drag.area": (area, "m^2"), "terms.drag.linear": (float(linear), "N s/m")}
    return Effect("drag", "plant", form, settings, {"area": area, "linear": float(linear)})


def _actuator_lag(v: Vehicle, rng: Rng, share: float) -> Effect:
    more, tau = share * float(rng.uniform(0.03, 0.06)), v.parameters["servo"]["tau"]
    if rng.random() < 0.5:
        return Effect("actuator_lag", "plant", "second order", values={"tau": tau + more},
                      terms=((foreign.TWO_LAGS, {"tau": more}),))  # fmt: skip
    return _set("actuator_lag", "plant", "terms.servo.tau", tau + more, "s", "tau")


def _actuator_delay(v: Vehicle, rng: Rng, share: float) -> Effect:
    more, delay = share * float(rng.uniform(0.02, 0.045)), v.parameters["servo"]["delay"]
    if rng.random() < 0.5 and more >= 0.008:  # whole frames of a slow link: held, then handed on
        period = 0.008
        frames = max(0, round(more / period - 0.5))
        return Effect("actuator_delay", "timing", "frames", values={"delay": delay + (frames + 0.5) * period - 0.001},
                      terms=((foreign.FRAME_DELAY, {"period": period, "frames": float(frames)}),))  # fmt: skip
    return _set("actuator_delay", "timing", "terms.servo.delay", delay + more, "s", "delay")


def _actuator_deadband(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    width = share * float(rng.uniform(0.008, 0.016))
    if rng.random() < 0.5:
        return Effect("actuator_deadband", "plant", "stick", terms=((foreign.STICKY, {"width": width}),))
    return _set("actuator_deadband", "plant", "terms.deadband.width", width, "rad", "width")


def _vortex_ring(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    depth = share * float(rng.uniform(0.12, 0.3))
    if rng.random() < 0.5:
        return Effect("vortex_ring", "plant", "triangle", terms=((foreign.WAKE_LOSS, {"depth": depth}),))
    return _set("vortex_ring", "plant", "terms.vortex_ring.depth", depth, "1", "depth")


def _tail_rotor_force(v: Vehicle, rng: Rng, share: float) -> Effect:
    value = v.parameters["tail_rotor"]["force_scale"] * (1.0 + share * signed(rng, 0.2, 0.35))
    return _set("tail_rotor_force", "plant", "terms.tail_rotor.force_scale", value, "1", "scale")


def _flapping_lag(v: Vehicle, rng: Rng, share: float) -> Effect:
    value = v.parameters["flapping"]["tau"] * (1.0 + share * float(rng.uniform(0.4, 0.9) * rng.choice([-0.6, 1.0])))
    return _set("flapping_lag", "plant", "terms.flapping.tau", value, "s", "tau")


def _baro_drift(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    rate = share * signed(rng, 0.05, 0.15)
    if rng.random() < 0.5:
        stairs = foreign.StairDrift("baro", ("altitude",), (rate,))
        return Effect("baro_drift", "sensor", "stairs", values={"rate": rate}, tampering=(lambda _: [stairs],),
                      needs=("baro",))  # fmt: skip
    return _set("baro_drift", "sensor", "sensors.baro.drift_rate", rate, "m/s", "rate", ("baro",))


def _baro_downwash(v: Vehicle, rng: Rng, share: float) -> Effect:
    more = share * signed(rng, 0.8, 1.6)
    if rng.random() < 0.5:
        return Effect("baro_downwash", "sensor", "bell", needs=("baro",),
                      tampering=(lambda world: [foreign.BellWash(world, more)],))  # fmt: skip
    gain = v.sensors["baro"].numbers["downwash_gain"] + more
    return _set("baro_downwash", "sensor", "sensors.baro.downwash_gain", gain, "1", "gain", ("baro",))


def _baro_lag(v: Vehicle, rng: Rng, share: float) -> Effect:
    more, lag = share * float(rng.uniform(0.4, 0.9)), v.sensors["baro"].numbers["lag"]
    if rng.random() < 0.5:
        samples = max(2, round(2.0 * more * v.sensors["baro"].numbers["rate"]))
        return Effect("baro_lag", "sensor", "running mean", values={"tau": lag + more}, needs=("baro",),
                      tampering=(lambda _: [foreign.Boxcar(samples)],))  # fmt: skip
    return _set("baro_lag", "sensor", "sensors.baro.lag", lag + more, "s", "tau", ("baro",))


def _baro_port(v: Vehicle, rng: Rng, share: float) -> Effect:
    more = share * signed(rng, 0.5, 1.0)
    if rng.random() < 0.5:
        return Effect("baro_port", "sensor", "sided", needs=("baro",),
                      tampering=(lambda world: [foreign.SidedPort(world, more)],))  # fmt: skip
    value = v.sensors["baro"].numbers["port_coefficient"] + more
    return _set("baro_port", "sensor", "sensors.baro.port_coefficient", value, "1", "coefficient", ("baro",))


def _axes(
    name: str, topic: str, stem: str, axes: Mapping[str, tuple[float, float, str]], nominal: float = 0.0,
    needs: tuple[str, ...] = (),
) -> Draw:  # fmt: skip
    """One axis of several is off."""

    def draw(v: Vehicle, rng: Rng, share: float) -> Effect:
        del v
        axis = str(rng.choice(list(axes)))
        low, high, unit = axes[axis]
        value = nominal + share * signed(rng, low, high)
        return _set(name, "sensor", f"sensors.{topic}.{stem}_{axis}", value, unit, axis, needs)

    return draw


def _gps_latency(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    delay = share * float(rng.uniform(0.1, 0.3))
    if rng.random() < 0.5:
        late = ClockOffset(topic="gps", delay=delay)
        return Effect("gps_latency", "timing", "stamps", values={"delay": delay}, needs=("gps",),
                      tampering=(lambda _: [late],))  # fmt: skip
    return _set("gps_latency", "timing", "sensors.gps.delay", delay, "s", "delay", ("gps",))


def _camera(
    name: str, where: str, keys: Mapping[str, tuple[float, float, str]], nominal: float = 0.0, one_sign: bool = False
) -> Draw:
    """One number of the down camera is off."""

    def draw(v: Vehicle, rng: Rng, share: float) -> Effect:
        del v
        key = str(rng.choice(list(keys)))
        low, high, unit = keys[key]
        size = float(rng.uniform(low, high)) if one_sign else signed(rng, low, high)
        parameter = {"focal_scale": "scale", "stamp_delay": "delay"}.get(key, key)
        return _set(name, where, f"cameras.down.{key}", nominal + share * size, unit, parameter, ("pad",))

    return draw


def _sonar_scale(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    return _set("sonar_scale", "sensor", "sensors.sonar.scale", 1.0 + share * signed(rng, 0.03, 0.08), "1", "scale",
                ("sonar",))  # fmt: skip


def _clock_offset(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    topic = str(rng.choice(["imu", "sonar", "baro", "mag"]))  # a receiver's clock is its latency
    delay = share * float(rng.uniform(0.03, 0.06)) * (1.0 if topic == "imu" else 6.0)
    shifted = ClockOffset(topic=topic, delay=delay)
    return Effect("clock_offset", "timing", topic, values={"delay": delay}, needs=(topic,),
                  tampering=(lambda _: [shifted],))  # fmt: skip


def _wind(v: Vehicle, rng: Rng, share: float) -> Effect:
    """The same strong wind in all flights, three of the file's standard deviations and more."""
    usual = float(v.document["environment"]["wind_std"]["value"])
    speed, to = share * usual * float(rng.uniform(3.1, 3.6)), float(rng.uniform(0.0, 2.0 * math.pi))

    def blow(world: World) -> list[Fault]:
        world.set_wind(speed, (to + math.pi) % (2.0 * math.pi))
        return []

    values = {"e": speed * math.sin(to), "n": speed * math.cos(to)}
    return Effect("wind", "plant", "steady", values=values, tampering=(blow,))


def _rotor_droop(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    value = share * float(rng.uniform(0.08, 0.15))
    return _set("rotor_droop", "plant", "terms.rotor_droop.droop", value, "1", "droop")


def _lens_distortion(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    value = share * signed(rng, 0.08, 0.2)
    return _set("lens_distortion", "sensor", "cameras.down.k1", value, "1", "k1", ("pad",))


def _baro_glitch(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    spikes = Spike(topic="baro", column="altitude", size=share * float(rng.uniform(5.0, 20.0)), share=0.01)
    return Effect("baro_glitch", "sensor", "spikes", tampering=(lambda _: [spikes],), needs=("baro",))


def _sonar_false_echo(v: Vehicle, rng: Rng, share: float) -> Effect:
    value = min(1.0, v.sensors["sonar"].numbers["false_echo_share"] + share * float(rng.uniform(0.3, 0.6)))
    return _set("sonar_false_echo", "sensor", "sensors.sonar.false_echo_share", value, "1", "share", ("sonar",))


def _unknown(name: str, term: Term, **numbers: tuple[float, float]) -> Draw:
    """A force that no catalogue holds; the first number is its size."""

    def draw(v: Vehicle, rng: Rng, share: float) -> Effect:
        del v
        drawn = {key: float(rng.uniform(low, high)) for key, (low, high) in numbers.items()}
        first = next(iter(drawn))
        drawn[first] *= share * float(rng.choice([-1.0, 1.0]))
        return Effect(name, "plant", "unknown", terms=((term, drawn),))

    return draw


def _soft_ground(v: Vehicle, rng: Rng, share: float) -> Effect:
    del v
    depth = share * float(rng.uniform(0.06, 0.15))
    return Effect("soft_ground", "sensor", "unknown", needs=("sonar",),
                  tampering=(lambda _: [foreign.SoftGround(depth)],))  # fmt: skip


_F, _W = (0.15, 0.5, "m/s^2"), (0.008, 0.03, "rad/s")
_SIX = ("fx", "fy", "fz", "wx", "wy", "wz")

EFFECTS: Mapping[str, Draw] = {
    "ground_effect": _ground_effect, "thrust_scale": _thrust_scale, "mass": _mass, "fuel_burn": _fuel_burn,
    "cg_offset": _cg_offset, "drag": _drag, "actuator_lag": _actuator_lag, "actuator_delay": _actuator_delay,
    "actuator_deadband": _actuator_deadband, "vortex_ring": _vortex_ring, "tail_rotor_force": _tail_rotor_force,
    "flapping_lag": _flapping_lag, "baro_drift": _baro_drift, "baro_downwash": _baro_downwash, "baro_lag": _baro_lag,
    "gps_bias": _axes("gps_bias", "gps", "bias", {a: (3.0, 8.0, "m") for a in "enu"}, needs=("gps", "pad")),
    "gps_drift": _axes("gps_drift", "gps", "drift_rate", {a: (0.05, 0.15, "m/s") for a in "enu"}, needs=("gps",)),
    "gps_latency": _gps_latency,
    "camera_latency": _camera("camera_latency", "timing", {"stamp_delay": (0.03, 0.1, "s")}, one_sign=True),
    "sonar_scale": _sonar_scale,
    "imu_bias": _axes("imu_bias", "imu", "bias", {a: _F if a[0] == "f" else _W for a in _SIX}),
    "imu_scale": _axes("imu_scale", "imu", "scale", {a: (0.03, 0.08, "1") for a in _SIX}, nominal=1.0),
    "imu_misalignment": _axes("imu_misalignment", "imu", "misalignment", {a: (0.025, 0.06, "rad") for a in "xyz"}),
    "mag_bias": _axes("mag_bias", "mag", "bias", {a: (1.5, 5.0, "uT") for a in "xyz"}, needs=("mag",)),
    "camera_focal": _camera("camera_focal", "sensor", {"focal_scale": (0.02, 0.06, "1")}, nominal=1.0),
    "camera_tilt": _camera("camera_tilt", "sensor", {"roll": (0.025, 0.06, "rad"), "pitch": (0.025, 0.06, "rad")}),
    "clock_offset": _clock_offset, "baro_glitch": _baro_glitch, "sonar_false_echo": _sonar_false_echo,
    "wind": _wind, "rotor_droop": _rotor_droop, "lens_distortion": _lens_distortion,
    "baro_port": _baro_port,
}  # fmt: skip

# what no catalogue holds: (effect, channel that shows it, what it depends on)
UNKNOWN: Mapping[str, tuple[Draw, str, str]] = {
    "low_push": (_unknown("low_push", foreign.LOW_PUSH, force=(1.5, 4.0), height=(0.8, 1.5)), "force_x", "height"),
    "speed_lift": (_unknown("speed_lift", foreign.SPEED_LIFT, factor=(0.25, 0.5)), "force_z", "speed"),
    "soft_ground": (_soft_ground, "sonar.range", "height"),
}
