"""What a scenario file may say. Units stand in the key names; a key that is not here is an error."""

import math
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model, model_validator

from estimators.navigators import NAVIGATORS, Variant
from flightlog.toml_file import nearest
from flightlog.topics import MEASURED
from sim.light import Light
from sim.sensors import CATALOGUE as SENSORS
from sim.weather import Turbulence, Weather


class Strict(BaseModel):
    """No unknown keys, no silent conversions but int to float, no numbers that are none."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def _in_the_air(point: list[float]) -> list[float]:
    east, north, height = point
    if not LEAST_HEIGHT <= height <= 3000.0 or max(abs(east), abs(north)) > 3000.0:
        raise ValueError(
            f"must lie within 3000 m east and north, {LEAST_HEIGHT:g} .. 3000 m above the pad (got {point})"
        )
    return point


def _known_navigator(name: str) -> str:
    if name not in NAVIGATORS:
        raise ValueError(f"there is no {name!r}; {nearest(name, NAVIGATORS)}")
    return name


LEAST_CARRYING = 1.0  # [m/s]
LEAST_HEIGHT = 0.3  # [m] of the body origin: the skids are free of the ground
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Point = Annotated[Vector3, AfterValidator(_in_the_air)]
Vector2 = Annotated[list[float], Field(min_length=2, max_length=2)]
Degrees = Annotated[float, Field(ge=-360, le=360)]


class Start(Strict):
    """Where the flight begins, trimmed in the air. Without a position it is drawn around the plan's point."""

    position_m: Point | None = None
    spread_m: float = Field(default=3.0, ge=0, le=100)  # radius of the ball that the position is drawn from
    heading_deg: Degrees = 0.0


class Plan(Strict):
    """What the pilot is told to do."""

    goal: Literal["land", "hover"] = "land"
    point_m: Point = [0.0, 0.0, 10.0]  # P1 of Lei 2012
    heading_deg: Degrees | None = None  # None: the heading at the start is kept
    steps_m: list[Annotated[float, Field(gt=LEAST_HEIGHT, le=3000)]] = []  # heights at which a landing pauses
    step_s: float = Field(default=4.0, ge=0, le=600)


class WeatherTable(Strict):
    """Mean wind at 10 m with its turbulence, and the air at the pad."""

    wind_m_s: float = Field(default=1.5, ge=0, le=25)
    wind_from_deg: Degrees = 250.0
    wind_shear: float = Field(default=1.0, ge=-2, le=5)  # of the usual profile over the height; 0: none
    # dryden: as strong as belongs to the mean wind; the classes of MIL-F-8785C: as in 15, 30 and 45 knots of it
    turbulence: Turbulence = "dryden"
    temperature_degC: float = Field(default=15.0, ge=-40, le=55)
    pressure_hPa: float = Field(default=1013.25, ge=500, le=1100)

    @model_validator(mode="after")
    def _carried(self) -> "WeatherTable":
        if self.turbulence not in ("none", "dryden") and self.wind_m_s < LEAST_CARRYING:
            raise ValueError(
                f'turbulence = "{self.turbulence}" needs a mean wind that carries it past: wind_m_s at least '
                f"{LEAST_CARRYING:g} (got {self.wind_m_s:g})"
            )
        return self

    def weather(self) -> Weather:
        """In SI."""
        return Weather(
            wind=self.wind_m_s,
            wind_from=math.radians(self.wind_from_deg),
            turbulence=self.turbulence,
            temperature=self.temperature_degC + 273.15,
            pressure=self.pressure_hPa * 100.0,
            shear=self.wind_shear,
        )


class LightTable(Strict):
    """The sun."""

    sun_elevation_deg: float = Field(default=45.0, gt=0, le=90)
    sun_azimuth_deg: Degrees = 150.0
    strength: float = Field(default=1.0, gt=0, le=5)

    def light(self) -> Light:
        """In SI."""
        return Light(
            sun_elevation=math.radians(self.sun_elevation_deg),
            sun_azimuth=math.radians(self.sun_azimuth_deg),
            strength=self.strength,
        )


class CameraTable(Strict):
    """What a scenario changes of a camera and its optics; None leaves what the vehicle file says."""

    rate_hz: float | None = Field(default=None, gt=0, le=100)
    latency_s: float | None = Field(default=None, ge=0, le=1)
    distortion: Annotated[list[float], Field(min_length=5, max_length=5)] | None = None  # k1, k2, p1, p2, k3
    gain: float = Field(default=1.0, gt=0, le=64)  # 1: a white wall in the sun comes to about 200
    mean_level: float | None = Field(default=None, gt=0, lt=255)  # auto exposure steers the picture's mean to it
    exposure_ms: float = Field(default=2.0, ge=0, le=40)
    defocus_px: float = Field(default=0.4, ge=0, le=10)
    read_noise: float = Field(default=1.2, ge=0, le=60)  # [grey levels] in the dark
    shot_noise: float = Field(default=2.2, ge=0, le=60)  # [grey levels] at white


class Cameras(Strict):
    """The three cameras."""

    down: CameraTable = CameraTable()
    forward_a: CameraTable = CameraTable()
    forward_b: CameraTable = CameraTable()


def _sensor_table(topic: str) -> type[BaseModel]:
    """Keys of a sensor's table: each of its parameters, with its unit in the name."""
    fields: dict[str, Any] = {
        parameter.scenario_key: (
            float | None,
            Field(default=None, ge=parameter.low, le=parameter.high, allow_inf_nan=math.isinf(parameter.high)),
        )
        for parameter in SENSORS[topic].PARAMETERS
    }
    return create_model(f"Sensor_{topic}", __base__=Strict, **fields)


SENSOR_TABLES = {topic: _sensor_table(topic) for topic in SENSORS}
_sensor_fields: dict[str, Any] = {topic: (table, table()) for topic, table in SENSOR_TABLES.items()}
Sensors: type[BaseModel] = create_model("Sensors", __base__=Strict, **_sensor_fields)

Device = Literal["imu", "mag", "baro", "gps", "sonar", "rotor", "pad", "flow", "down", "forward_a", "forward_b"]


class Event(Strict):
    """Something that happens at a time."""

    at_s: float = Field(ge=0, le=1e9)


class Gust(Event):
    """A 1-cosine gust on top of the wind."""

    kind: Literal["gust"]
    speed_m_s: float = Field(ge=-25, le=25)
    from_deg: Degrees = 250.0
    up_m_s: float = Field(default=0.0, ge=-10, le=10)
    for_s: float = Field(default=4.0, gt=0, le=120)


class Dropout(Event):
    """A sensor or camera says nothing for a span."""

    kind: Literal["dropout"]
    sensor: Device
    for_s: float = Field(gt=0)


class FaultEvent(Event):
    """A sensor goes wrong: one of its own numbers changes, or one column of what it sends does."""

    kind: Literal["fault"]
    sensor: Device
    for_s: float = Field(default=1e9, gt=0)
    numbers: dict[str, float] = {}  # scenario keys of the sensor's own table: `latency_s = 0.4`
    column: str | None = None  # of the topic
    fault: Literal["stuck", "offset", "ramp", "spike"] | None = None
    size: float = 0.0  # in the column's unit; a ramp: per second
    share: float = Field(default=0.05, ge=0, le=1)  # of the samples, for spikes

    @model_validator(mode="after")
    def _complete(self) -> "FaultEvent":
        if (self.column is None) != (self.fault is None):
            raise ValueError("column and fault go together")
        if not self.numbers and self.fault is None:
            raise ValueError("says neither numbers nor column and fault")
        table = SENSOR_TABLES.get(self.sensor)
        if table is None:
            raise ValueError(f"{self.sensor} is a camera: it has no numbers or columns; pad and flow are what it sees")
        if self.column is not None:
            columns = [column.name for column in MEASURED[self.sensor].columns if column.kind != "text"]
            if self.column not in columns:
                raise ValueError(f"{self.sensor} has no column {self.column!r}; {nearest(self.column, columns)}")
        parameters = {item.scenario_key: item for item in SENSORS[self.sensor].PARAMETERS if item.name != "rate"}
        for key, value in self.numbers.items():
            if key not in parameters:
                known = nearest(key, parameters)
                raise ValueError(f"{self.sensor} has no number {key!r} that could change in flight; {known}")
            low, high = parameters[key].low, parameters[key].high
            if not low <= value <= high:
                raise ValueError(f"numbers.{key} must lie in {low:g} .. {high:g} (got {value:g})")
        return self


class WindChange(Event):
    """The mean wind changes."""

    kind: Literal["wind"]
    wind_m_s: float = Field(ge=0, le=25)
    wind_from_deg: Degrees = 250.0


class LightChange(Event):
    """The sun changes: a cloud, the evening."""

    kind: Literal["light"]
    sun_elevation_deg: float | None = Field(default=None, gt=0, le=90)
    strength: float | None = Field(default=None, gt=0, le=5)


class Target(Event):
    """The pilot is sent to another spot over the pad's plane."""

    kind: Literal["target"]
    position_m: Vector2  # east, north


AnyEvent = Annotated[Gust | Dropout | FaultEvent | WindChange | LightChange | Target, Field(discriminator="kind")]


class Scenario(Strict):
    """One scripted flight."""

    vehicle: str
    description: str = ""
    pad: Literal["h", "ring", "none"] = "h"
    scene: Literal["field", "sea", "deck", "courtyard"] = "field"
    horizon_dip: bool = False
    navigator: Annotated[str, AfterValidator(_known_navigator)] = "helideck"
    variant: Variant = "helideck"
    duration_s: float = Field(default=120.0, gt=0, le=3600)
    start: Start = Start()
    plan: Plan = Plan()
    weather: WeatherTable = WeatherTable()
    light: LightTable = LightTable()
    sensors: Sensors = Sensors()  # type: ignore[valid-type]
    cameras: Cameras = Cameras()
    events: list[AnyEvent] = []

    @model_validator(mode="after")
    def _has_something_to_land_on(self) -> "Scenario":
        if self.pad == "none" and self.plan.goal == "land":
            raise ValueError('pad = "none" leaves nothing to land on; a pad or plan.goal = "hover" would do')
        return self

    @model_validator(mode="after")
    def _starts_in_the_air(self) -> "Scenario":
        room = self.plan.point_m[2] - LEAST_HEIGHT
        if self.start.position_m is None and self.start.spread_m > room:
            raise ValueError(
                f"start.spread_m = {self.start.spread_m:g} reaches into the ground below plan.point_m; "
                f"at most {room:g} would be right, or a start.position_m"
            )
        return self
