"""Scenario files: those that come with the project fly, and what is wrong with a user's own is said in one line."""

import math
import string
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import assets
from flightlog.errors import UserError
from scenarios.flight import fly
from scenarios.load import available, build, find, load, split_overrides
from scenarios.schema import SENSOR_TABLES, Scenario
from sim import vehicle as vehicles
from sim.sensors import CATALOGUE

SHIPPED = ("gps_denied_hover", "hover", "landing", "landing_gusty", "sea_horizon")
RAPTOR = assets.path("vehicles", "raptor90.toml").read_text()


def test_what_is_promised_is_there():
    assert set(SHIPPED) <= set(available())
    for name in available():
        assert load(name).description, name


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_scenario_flies_to_its_goal(name):
    scenario = load(name)
    if scenario.plan.goal == "hover":
        scenario = load(name, {"duration_s": 15.0})
    summary = fly(scenario, seed=1, cameras=False).summary
    assert summary.success, summary
    assert summary.fused_height_mean_error_m < 0.10
    assert summary.fused_height_max_error_m < 0.30
    if scenario.plan.goal == "land":
        assert summary.landed and summary.reason == "landed"
        assert summary.touchdown_offset_m <= 0.30
        assert summary.touchdown_sink_m_s <= 0.5 and summary.touchdown_drift_m_s <= 0.4
        assert math.hypot(summary.touchdown_east_m, summary.touchdown_north_m) == summary.touchdown_offset_m
    else:
        assert summary.duration_s == pytest.approx(15.0)
        assert summary.touchdown_offset_m is None and not summary.landed


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SHIPPED if load(name).plan.goal == "hover"])
def test_every_shipped_hover_is_held_for_its_whole_time(name):
    summary = fly(load(name), seed=2, cameras=False).summary
    assert summary.success, summary
    assert summary.fused_height_mean_error_m < 0.10 and summary.fused_height_max_error_m < 0.30


# --- faults of scenario files -----------------------------------------------------------------------------------------

HEAD = 'vehicle = "raptor90"\nduration_s = 1\n'


@pytest.fixture
def refused(tmp_path):
    """What is said of a scenario's text (and of the vehicle's), flying included; without the folder's name."""

    def complain(text: str, vehicle: str | None = None, cameras: bool = False) -> str:
        path = tmp_path / "mine.toml"
        path.write_text(text if vehicle is None else text.replace("raptor90", "craft.toml"))
        if vehicle is not None:
            (tmp_path / "craft.toml").write_text(vehicle)
        with pytest.raises(UserError) as error:
            fly(load(path), cameras=cameras)
        text = str(error.value).replace(str(tmp_path) + "/", "")
        assert "\n" not in text
        return text

    return complain


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[weather]\nwind_ms = 3", "mine.toml:4: weather.wind_ms: unknown key; did you mean 'wind_m_s'?"),
        ("[sensors.gps]\nlatncy_s = 3", "mine.toml:4: sensors.gps.latncy_s: unknown key; did you mean 'latency_s'?"),
        ("[cameras.dwn]\nrate_hz = 25", "mine.toml:3: cameras.dwn: unknown key; did you mean 'down'?"),
        ('[weather]\nwind_m_s = "three"', "mine.toml:4: weather.wind_m_s: must be a number (got 'three')"),
        ("[weather]\nwind_m_s = -3", "mine.toml:4: weather.wind_m_s: must be at least 0 (got -3)"),
        ("[weather]\nwind_m_s = 300", "mine.toml:4: weather.wind_m_s: must be at most 25 (got 300)"),
        ("[light]\nsun_elevation_deg = -5", "mine.toml:4: light.sun_elevation_deg: must be more than 0 (got -5)"),
        ("[sensors.gps]\nrate_hz = 7", "sensors.gps.rate_hz: 7 Hz does not divide the rate of the physics, 500 Hz"),
        ("[cameras.down]\nrate_hz = 24", "cameras.down.rate_hz: 24 Hz does not divide the rate of the physics"),
        ("[sensors.pad]\nlatency_s = 0.1", "sensors.pad: rate and latency are the down camera's: set cameras.down"),
        ("[cameras.down]\ndistortion = [-5, 0, 0, 0, 0]", "cameras.down.distortion: lens distortion (-5"),
        ("[cameras.down]\ndistortion = [0, 0]", "mine.toml:4: cameras.down.distortion: must be a list of at least 5"),
        ('scene = "see"', "mine.toml:3: scene: there is no 'see'; did you mean 'sea'?"),
        ('pad = "none"', 'mine.toml: pad = "none" leaves nothing to land on'),
        ('navigator = "heli"', "mine.toml:3: navigator: there is no 'heli'; did you mean 'helideck'?"),
        ("[start]\nposition_m = [0, 0, -1]", "mine.toml:4: start.position_m: must lie within"),
        ("[start]\nposition_m = [0, 0]", "mine.toml:4: start.position_m: must be a list of at least 3"),
        ("[start]\nspread_m = 30", "mine.toml: start.spread_m = 30 reaches into the ground"),
        ("[plan]\npoint_m = [0, 0, inf]", "mine.toml:4: plan.point_m.2: must be a finite number (got inf)"),
        ("[weather]\nwind_m_s = 25", "raptor90.toml: cannot hold its place at "),
        ('[[events]]\nat_s = 1\nkind = "gost"', "mine.toml:5: events.0.kind: there is no 'gost'; did you mean 'gust'?"),
        ('[[events]]\nat_s = 1\nkind = "wind"', "mine.toml:3: events.0.wind_m_s: is missing"),
        (
            '[[events]]\nat_s = 0\nkind = "dropout"\nsensor = "gsp"\nfor_s = 1',
            "mine.toml:6: events.0.sensor: there is no 'gsp'; did you mean 'gps'?",
        ),
        (
            '[[events]]\nat_s = 0\nkind = "fault"\nsensor = "gps"',
            "mine.toml:3: events.0: says neither numbers nor column and fault",
        ),
        (
            '[[events]]\nat_s = 0\nkind = "fault"\nsensor = "gps"\ncolumn = "east"\nfault = "offset"',
            "mine.toml:3: events.0: gps has no column 'east'",
        ),
        (
            '[[events]]\nat_s = 0\nkind = "fault"\nsensor = "gps"\nnumbers = {latncy_s = 1}',
            "mine.toml:3: events.0: gps has no number 'latncy_s' that could change in flight; did you mean 'latency_s",
        ),
        (
            '[[events]]\nat_s = 0\nkind = "fault"\nsensor = "gps"\nnumbers = {latency_s = 100}',
            "mine.toml:3: events.0: numbers.latency_s must lie in 0 .. 2 (got 100)",
        ),
        (
            '[[events]]\nat_s = 0\nkind = "fault"\nsensor = "gps"\nnumbers = {rate_hz = 10}',
            "mine.toml:3: events.0: gps has no number 'rate_hz' that could change in flight",
        ),
        (
            '[[events]]\nat_s = 0\nkind = "fault"\nsensor = "down"\ncolumn = "x"\nfault = "stuck"',
            "mine.toml:3: events.0: down is a camera",
        ),
    ],
)
def test_a_fault_of_a_scenario_is_one_line(refused, text, message):
    assert refused(f"{HEAD}{text}\n").removeprefix(str(assets.path("vehicles")) + "/").startswith(message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[cameras.down]\nlatency_s = 1", "cameras: 30 pictures would be under way"),
        (
            '[[events]]\nat_s = 0\nkind = "fault"\nsensor = "pad"\ncolumn = "x"\nfault = "stuck"',
            "events.0: faults of the pad's sightings need flights without cameras",
        ),
    ],
)
def test_what_pictures_cannot_do_is_refused_before_any_is_made(refused, text, message):
    assert refused(f"{HEAD}{text}\n", cameras=True).startswith(message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "kg/s"', 'unit = "m/s"', "craft.toml:43: terms.fuel.rate: unit 'm/s' does not fit; expected kg/s"),
        ('unit = "ms"', 'unit = "rad"', "unit 'rad' does not fit; expected one of s, ms, min"),
        ("mass = {value = 5.0", "mass = {value = 0.0", "craft.toml:6: mass: must be more than 0 kg (got 0)"),
        ("mass = {value = 5.0", 'mass = {value = "5"', "craft.toml:6: mass.value: must be a number (got '5')"),
        ("mass = {value = 5.0", "mass = {value = [5.0]", "craft.toml:6: mass: must be one number in kg (got [5.0])"),
        ("[0.097, 0.184, 0.151]", "[0.097, 0.184]", "inertia: must be 3 numbers in kg m^2 (got [0.097, 0.184])"),
        ("[0.097, 0.184, 0.151]", "[0.097, 0.9, 0.151]", "inertia: no body has one moment of inertia larger than"),
        ('"helicopter"', '"multirotor"', "kind: found 'multirotor'; `land` flies helicopters"),
        ("mass = {value = 5.0", "mass = {value = nan", "craft.toml:6: mass: must be a finite number (got nan)"),
        ("gain = {value = 1.0, unit", "gain = {value = nan, unit", "terms.ground_effect.gain: must lie in 0 .. 3"),
        ("[0.097, 0.184, 0.151]", "[0.097, inf, 0.151]", "inertia.value.1: must be a finite number (got inf)"),
        ("[terms.fuel]", "[terms.feul]", "terms.feul: unknown term; did you mean 'fuel'?"),
        ("[sensors.gps]", "[sensors.gsp]", "sensors.gsp: unknown sensor; did you mean 'gps'?"),
        ("nominal_speed", "nominl_speed", "rotor.nominl_speed: unknown key; did you mean 'nominal_speed'? (and 1"),
        ('"raptor90.xml"', '"raptor91.xml"', "craft.toml:5: model: no file 'raptor91.xml' beside it or among"),
        ("gain = {value = 1.0, unit", "gain = {value = 99.0, unit", "terms.ground_effect.gain: must lie in 0 .. 3"),
        ("torque_max", "torqe_max", "terms.engine.torqe_max: unknown key; did you mean 'torque_max'?"),
        ("fx = {value = 952.4", "fx = {value = 0", "cameras.down.fx: must be more than 0 px (got 0)"),
        ("width = 768", "width = 7", "cameras.down.width: must be at least 16 (got 7)"),
        ("width = 768\n", "width = 768\ndistortion = {value = [9, 9, 9, 9, 9], unit = '1'}\n", "cameras.down.dist"),
    ],
)
def test_a_fault_of_a_vehicle_is_one_line(refused, old, new, message):
    assert old in RAPTOR
    assert message in refused(HEAD.replace("\n", "\n", 1), RAPTOR.replace(old, new, 1))


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("[sensors.gps", "sensors.gps: this vehicle has no such sensor"),
        ("[sensors.imu", "sensors.imu: is missing: the navigator 'helideck' cannot do without"),
        ("[terms.servo", "terms.servo: is missing: the pilot is designed with its numbers"),
        ("[terms.main_rotor", "craft.toml: cannot hold its place"),
        ("[cameras.down", "cameras.down: is missing: the pad is seen by it"),
    ],
)
def test_what_a_vehicle_lacks_and_the_flight_needs_is_named(refused, head, message):
    before, _, rest = RAPTOR.partition(head)
    craft = before + rest[rest.index("\n[") + 1 :]
    text = HEAD + ("[sensors.gps]\nlatency_s = 0.1\n" if "gps" in head else "")
    assert message in refused(text, craft)


def test_an_event_for_a_device_that_is_not_aboard_is_refused(refused):
    before, _, rest = RAPTOR.partition("[sensors.gps]")
    event = '[[events]]\nat_s = 0\nkind = "dropout"\nsensor = "gps"\nfor_s = 1\n'
    said = refused(HEAD + event, before + rest[rest.index("\n[") + 1 :])
    assert said.startswith("events.0.sensor: this vehicle has no 'gps'; known: baro, ")


@pytest.mark.parametrize("sensor", [name for name in CATALOGUE if name not in ("imu", "rotor")])
def test_a_vehicle_may_lack_any_other_sensor(tmp_path, sensor):
    before, _, rest = RAPTOR.partition(f"[sensors.{sensor}]")
    (tmp_path / "craft.toml").write_text(before + rest[rest.index("\n[") + 1 :])
    (tmp_path / "mine.toml").write_text('vehicle = "craft.toml"\nduration_s = 2\n')
    flight = fly(load(tmp_path / "mine.toml"), cameras=False, folder=tmp_path / "flight")
    assert flight.summary.duration_s == pytest.approx(2.0)
    assert flight.summary.reason == "time is up"
    assert not (tmp_path / "flight" / "measured" / f"{sensor}.parquet").exists()


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda text: text.replace('file="window.obj"', 'file="nowhere.obj"'), "nowhere.obj"),
        (lambda text: text.replace("<geom", "<gem", 1), "not usable as MJCF"),
        (lambda text: text.replace("</mujoco>", ""), "craft.toml: "),
        (lambda text: text.replace('name="main_rotor"', 'name="mast"'), "main_rotor"),
        (lambda text: text.replace('<body name="vehicle"', '<body name="craft"'), "vehicle"),
        (
            lambda text: text.replace("<asset>", '<asset><texture name="t" type="2d" file="paint.png"/>', 1),
            "paint.png",
        ),
        (lambda text: "", "craft.toml: "),
        (lambda text: "\0binary", "craft.toml: "),
    ],
    ids=["mesh", "tag", "cut off", "no rotor", "no body", "texture", "empty", "binary"],
)
def test_a_users_mjcf_that_does_not_do_is_one_line(refused, tmp_path, edit, message):
    original = assets.path("vehicles", "raptor90.xml")
    text = original.read_text().replace('meshdir="raptor90"', f'meshdir="{original.parent / "raptor90"}"')
    changed = edit(text)
    assert changed != text
    (tmp_path / "mine.xml").write_text(changed)
    said = refused(HEAD, RAPTOR.replace('"raptor90.xml"', '"mine.xml"'))
    assert message in said and "mine.xml" in said + "mine.xml" * said.startswith("craft.toml"), said


def test_a_users_vehicle_and_mjcf_beside_the_scenario_fly(tmp_path):
    original = assets.path("vehicles", "raptor90.xml")
    text = original.read_text().replace('meshdir="raptor90"', f'meshdir="{original.parent / "raptor90"}"')
    (tmp_path / "mine.xml").write_text(text)
    (tmp_path / "craft.toml").write_text(RAPTOR.replace('"raptor90.xml"', '"mine.xml"'))
    (tmp_path / "mine.toml").write_text('vehicle = "craft.toml"\nduration_s = 1\n')
    flight = fly(load(tmp_path / "mine.toml"), cameras=False)
    same = fly(load("landing", {"duration_s": 1}), cameras=False)
    assert flight.vehicle == "craft"
    assert flight.summary == same.summary


def test_unknown_names_are_answered_with_the_nearest():
    with pytest.raises(UserError, match="unknown scenario 'landin'; did you mean 'landing'"):
        find("landin")
    with pytest.raises(UserError, match="unknown vehicle 'raptor9'; did you mean 'raptor90'"):
        vehicles.find("raptor9")
    with pytest.raises(UserError, match="no such vehicle file"):
        vehicles.find("nowhere.toml")
    for name in ("x" * 5000, "", "..", "/"):
        with pytest.raises(UserError):
            load(name)
        with pytest.raises(UserError):
            vehicles.load(name)


# --- settings ---------------------------------------------------------------------------------------------------------


def test_settings_reach_the_scenario_and_the_vehicle():
    own, changed = split_overrides({"weather.wind_m_s": 4.0, "vehicle.terms.ground_effect.gain": 0.5, "pad": "none"})
    assert own == {"weather.wind_m_s": 4.0, "pad": "none"}
    assert changed == {"terms.ground_effect.gain": 0.5}
    assert load("landing", {"weather.wind_m_s": 4.0}).weather.wind_m_s == 4.0
    assert load("landing_gusty", {"events.0.speed_m_s": 7.0}).events[0].speed_m_s == 7.0
    craft = vehicles.load("raptor90", {"terms.ground_effect.gain": 0.5, "sensors.gps.bias_e": 2.0})
    assert craft.parameters["ground_effect"]["gain"] == 0.5
    assert craft.sensors["gps"].numbers["bias_e"] == 2.0
    assert craft.document["terms"]["ground_effect"]["gain"]["unit"] == "1"
    assert vehicles.load("raptor90").parameters["ground_effect"]["gain"] == 1.0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("terms.ground_effect.gian", 1.0, "--set vehicle.terms.ground_effect.gian: unknown key; did you mean 'gain'?"),
        ("terms.ground_effect.gain", 99.0, "--set vehicle.terms.ground_effect.gain: must lie in 0 .. 3 (got 99)"),
        ("terms.ground_effect.gain", "x", "--set vehicle.terms.ground_effect.gain: must be a number (got 'x')"),
        ("terms.grund_effect.gain", 1.0, "--set vehicle.terms.grund_effect.gain: unknown term; did you mean"),
        ("sensors.gsp.latency", 1.0, "--set vehicle.sensors.gsp.latency: unknown sensor; did you mean 'gps'?"),
        ("mas", 1.0, "--set vehicle.mas: unknown key; did you mean 'mass'?"),
        ("mass.value.x", 1.0, "--set mass.value.x: 'value' is no table"),
    ],
)
def test_a_setting_that_does_not_fit_names_itself(key, value, message):
    with pytest.raises(UserError) as error:
        vehicles.load("raptor90", {key: value})
    assert str(error.value).startswith(message)


def test_a_scenario_is_made_in_python_as_in_a_file():
    made = build(duration_s=3.0, weather={"wind_m_s": 2.0}, events=[{"at_s": 1.0, "kind": "light", "strength": 0.5}])
    assert made.vehicle == "raptor90" and made.weather.wind_m_s == 2.0 and made.events[0].kind == "light"
    with pytest.raises(UserError, match=r"scenario: weather\.wind: unknown key; did you mean 'wind_m_s'"):
        build(weather={"wind": 2.0})


# --- properties -------------------------------------------------------------------------------------------------------

WORDS = st.sampled_from(
    ["vehicle", "raptor90", "pad", "h", "none", "scene", "sea", "plan", "goal", "hover", "land", "point_m", "start",
     "weather", "wind_m_s", "light", "sensors", "gps", "baro", "latency_s", "cameras", "down", "rate_hz", "events",
     "at_s", "kind", "gust", "fault", "dropout", "sensor", "for_s", "numbers", "column", "duration_s"]
)  # fmt: skip
NAMES = st.one_of(WORDS, st.text(string.printable, max_size=6))
LEAVES = st.one_of(
    st.booleans(), st.integers(-(10**6), 10**6), st.floats(), NAMES, st.datetimes(), st.just(10**400),
)  # fmt: skip
TREES = st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(NAMES, inner, max_size=5))


@given(st.dictionaries(NAMES, TREES, max_size=8), st.booleans())
def test_any_document_is_a_scenario_or_one_line(document, with_vehicle):
    if with_vehicle:
        document = {**document, "vehicle": "raptor90"}
    try:
        assert isinstance(build(**{str(key): value for key, value in document.items()}), Scenario)
    except UserError as error:
        assert str(error).startswith("scenario") and len(str(error).splitlines()) == 1


@given(st.binary(max_size=200) | st.text(string.printable, max_size=200).map(str.encode))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
def test_any_file_is_a_scenario_or_one_line(tmp_path: Path, content: bytes):
    path = tmp_path / "any.toml"
    path.write_bytes(content)
    with pytest.raises(UserError) as error:  # by chance alone nobody writes a vehicle's name
        load(path)
    assert len(str(error.value).splitlines()) == 1


@given(st.sampled_from(RAPTOR.splitlines()), st.sampled_from(string.printable), st.integers(0, 60))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_a_vehicle_file_with_one_wrong_character_is_a_vehicle_or_one_line(tmp_path: Path, line, character, place):
    broken = line[:place] + character + line[place + 1 :]
    path = tmp_path / "any.toml"
    path.write_text(RAPTOR.replace(line, broken, 1) if line else RAPTOR + character, newline="\n")
    try:
        vehicles.load(path, {"skids.height": 0.23})
    except UserError as error:
        assert len(str(error).splitlines()) == 1


@pytest.mark.parametrize("topic", list(SENSOR_TABLES))
def test_every_key_of_a_sensor_names_its_unit_and_keeps_its_range(topic):
    for parameter in CATALOGUE[topic].PARAMETERS:
        key = parameter.scenario_key
        assert key == parameter.name or key.startswith(parameter.name + "_")
        for value in (parameter.low, parameter.high):
            assert getattr(getattr(build(sensors={topic: {key: value}}).sensors, topic), key) == value
        for value in (math.nextafter(parameter.low, -math.inf), math.nextafter(parameter.high, math.inf)):
            if math.isfinite(value):
                with pytest.raises(UserError, match="must be at"):
                    build(sensors={topic: {key: value}})


def test_a_landing_off_the_pad_is_refused_before_the_flight() -> None:
    from scenarios.flight import fly
    from scenarios.load import build

    with pytest.raises(UserError, match=r"plan\.point_m: .*over the pad.*got 3, 2"):
        fly(build(plan={"goal": "land", "point_m": [3.0, 2.0, 10.0]}), cameras=False)
