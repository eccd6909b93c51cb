"""Whatever a user gets wrong on the command line is one line on stderr, exit code 2, and leaves nothing behind."""

import pytest

from helideck.cli import main

GOOD = 'vehicle = "raptor90"\nduration_s = 1\n'


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "good.toml").write_text(GOOD)
    (tmp_path / "binary.toml").write_bytes(bytes(range(256)))
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "file").write_text("")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["landin"], ["unknown scenario 'landin'", "did you mean 'landing'?"]),
        (["xyz"], ["unknown scenario 'xyz'", "known: gps_denied_hover, horizon_hold, hover"]),
        (["nowhere.toml"], ["nowhere.toml: no such file"]),
        (["folder.toml"], ["folder.toml: cannot be read: Is a directory"]),
        (["."], ["unknown scenario '.'"]),
        (["binary.toml"], ["binary.toml: not valid TOML"]),
        (["empty.toml"], ["empty.toml: vehicle: is missing"]),
        (["--seed", "-1"], ["--seed -1", "from 0 on"]),
        (["--seed", "x"], ["--seed x"]),
        (["--seed", "1:2:3"], ["CAMPAIGN:RUN"]),
        (["--seed", "1.5"], ["--seed 1.5"]),
        (["--vehicle", "nowhere.toml"], ["nowhere.toml: no such vehicle file"]),
        (["--vehicle", "raptor9"], ["did you mean 'raptor90'?"]),
        (["--vehicle", "folder.toml"], ["folder.toml: no such vehicle file"]),
        (["--vehicle", "good.toml"], ["good.toml:1: vehicle: unknown key", "more fault"]),
        (["--vehicle", "empty.toml"], ["empty.toml: ", "is missing", "more fault"]),
        (["--aboard", "binary.toml"], ["binary.toml: not valid TOML"]),
        (["--set", "weather"], ["--set weather", "a.b=value"]),
        (["--set", "=3"], ["--set =3"]),
        (["--set", "weather.wind=3"], ["--set weather.wind: unknown key; did you mean 'wind_m_s'?"]),
        (["--set", "weather.wind_m_s=strong"], ["--set weather.wind_m_s: must be a number (got 'strong')"]),
        (["--set", "weather.wind_m_s=nan"], ["--set weather.wind_m_s: must be a finite number"]),
        (["--set", "light.sun_elevation_deg=-3"], ["--set light.sun_elevation_deg: must be more than 0"]),
        (["--set", "vehicle=raptor91"], ["unknown vehicle 'raptor91'"]),
        (["--set", "vehicle.mass=-1"], ["--set vehicle.mass: must be more than 0 kg"]),
        (["--set", "vehicle.mass=40"], ["raptor90.toml: cannot hold its place", "less mass"]),
        (["--set", "vehicle.terms.servo.dealy=1"], ["--set vehicle.terms.servo.dealy: unknown key", "'delay'"]),
        (["--set", "a..b=1"], ["--set a..b"]),
        (["--set", "pad=none"], ["leaves nothing to land on"]),
        (["--set", "sensors.gps.rate_hz=7"], ["sensors.gps.rate_hz: 7 Hz does not divide"]),
        (["--set", "cameras.down.distortion=[-9,0,0,0,0]"], ["cameras.down.distortion", "cannot be inverted"]),
        (["-o", "file"], ["file: exists already"]),
        (["-o", "file/below"], ["file/below: cannot be made: Not a directory"]),
        (["-o", "folder.toml"], ["folder.toml: exists already"]),
        (["--frames"], ["--frames keeps rendered pictures"]),
        (["--sed", "3"], ["--seed"]),
        (["landing", "hover"], ["hover"]),
    ],
    ids=lambda item: " ".join(item) if isinstance(item, list) and item and item[0] in item else None,
)
def test_land_refuses_it_in_one_line(here, capsys, words, parts):
    before = sorted(path.name for path in here.rglob("*"))
    assert main(["land", "--no-cameras", *words]) == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert out.err.startswith("helideck: ") and out.err.count("\n") == 1 and len(out.err) < 500
    for part in parts:
        assert part in out.err, out.err
    assert sorted(path.name for path in here.rglob("*")) == before


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["landin", "--runs", "2"], ["did you mean 'landing'?"]),
        (["landing", "--runs", "0"], ["--runs 0", "at least one run"]),
        (["landing", "--runs", "2", "--seed", "-1"], ["none below zero"]),
        (["landing", "--runs", "2", "--workers", "-1"], ["none below zero"]),
        (["landing", "--runs", "two"], ["two"]),
        (["landing"], ["--runs"]),
        (["landing", "--runs", "2", "-o", "file"], ["file: "]),
        (["landing", "--runs", "2", "-o", "."], ["not empty and no campaign"]),
        (["landing", "--runs", "2", "--set", "weather.wind_m_s=25"], ["cannot hold its place"]),
        (["landing", "--runs", "2", "--set", "vehicle.mas=3"], ["--set vehicle.mas"]),
        (["folder.toml", "--runs", "2"], ["Is a directory"]),
    ],
    ids=lambda item: " ".join(item) if isinstance(item, list) and item and item[0] in item else None,
)
def test_a_campaign_refuses_it_in_one_line(here, capsys, words, parts):
    assert main(["campaign", *words, "--workers", "1"] if "--workers" not in words else ["campaign", *words]) == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert out.err.startswith("helideck: ") and out.err.count("\n") == 1
    for part in parts:
        assert part in out.err, out.err


@pytest.mark.parametrize("verb", ["replay", "land"])
def test_a_wrong_folder_is_one_line(here, capsys, verb):
    assert main([verb, "file"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
