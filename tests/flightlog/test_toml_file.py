"""Files of the user's: every fault is one line with file, line, key, what was found and what would be right."""

import tomllib
from pathlib import Path
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field

from flightlog.errors import UserError
from flightlog.toml_file import assign, nearest, parse_value, place, read, validate


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class Rain(Strict):
    kind: Literal["rain"]
    amount: float = Field(ge=0)
    rain: int = 0  # a key of the same name as the kind


class Snow(Strict):
    kind: Literal["snow"]
    flakes: int = Field(gt=0, le=9)


class Engine(Strict):
    power: float | list[float]
    fuel: Literal["petrol", "diesel"] = "petrol"


class Car(Strict):
    name: str
    wheels: int = 4
    seats: Annotated[list[float], Field(min_length=2, max_length=2)] = [0.0, 0.0]
    engine: Engine | None = None
    parts: dict[str, Engine] = {}
    weather: list[Annotated[Rain | Snow, Field(discriminator="kind")]] = []


@pytest.fixture
def fault(tmp_path):
    """The message for a text, without the folder."""

    def complain(text: str) -> str:
        path = tmp_path / "car.toml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(UserError) as error:
            validate(read(path), Car, path)
        return str(error.value).replace(str(tmp_path) + "/", "")

    return complain


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "a"\nweels = 3', "car.toml:2: weels: unknown key; did you mean 'wheels'?"),
        ('nam = "a"', "car.toml:1: nam: unknown key; did you mean 'name'? (and 1 more fault)"),
        ("", "car.toml: name: is missing"),
        ('name = "a"\nwheels = "four"', "car.toml:2: wheels: must be a whole number (got 'four')"),
        ("name = 3", "car.toml:1: name: must be text in quotes (got 3)"),
        ('name = "a"\nseats = [1]', "car.toml:2: seats: must be a list of at least 2 (got [1])"),
        ('name = "a"\nseats = [1, nan]', "car.toml:2: seats.1: must be a finite number (got nan)"),
        ('name = "a"\nseats = 3', "car.toml:2: seats: must be a list [...] (got 3)"),
        ('name = "a"\nengine = 3', "car.toml:2: engine: must be a table {...} (got 3)"),
        ('name = "a"\n[engine]\npower = "x"', "car.toml:3: engine.power: must be a number (got 'x')"),
        ('name = "a"\n[engine]\npower = [1, "x"]', "car.toml:3: engine.power.1: must be a number (got 'x')"),
        (
            'name = "a"\n[engine]\npower = 1\nfuel = "deisel"',
            "car.toml:4: engine.fuel: there is no 'deisel'; did you mean 'diesel'?",
        ),
        ('name = "a"\n\n[parts.left]\npowr = 1', "car.toml:4: parts.left.powr: unknown key; did you mean 'power'? "
                                                 "(and 1 more fault)"),
        (
            'name = "a"\n[[weather]]\nkind = "ran"',
            "car.toml:3: weather.0.kind: there is no 'ran'; did you mean 'rain'?",
        ),
        ('name = "a"\n[[weather]]\namount = 1', "car.toml:2: weather.0: kind is missing"),
        (
            'name = "a"\n[[weather]]\nkind = "rain"\namount = 1\n[[weather]]\nkind = "snow"\nflakes = 0',
            "car.toml:7: weather.1.flakes: must be more than 0 (got 0)",
        ),
        (
            'name = "a"\n[[weather]]\nkind = "snow"\nflakes = 10',
            "car.toml:4: weather.0.flakes: must be at most 9 (got 10)",
        ),
        (
            'name = "a"\n[[weather]]\nkind = "rain"\namount = 1\nrain = "x"',
            "car.toml:5: weather.0.rain: must be a whole number (got 'x')",
        ),
        (
            'name = "a"\n[[weather]]\nkind = "rain"\namont = 1\namount = -1',
            "car.toml:4: weather.0.amont: unknown key; did you mean 'amount'? (and 1 more fault)",
        ),
        ('name = "a"\n"two\\nlines" = 1', 'car.toml: "two\\nlines": unknown key; known: engine, name, parts, seats, '
                                          "weather, wheels"),
    ],
)  # fmt: skip
def test_a_fault_is_told_with_its_line_and_what_would_be_right(fault, text, message):
    assert fault(text) == message


def test_a_long_value_is_cut(fault):
    assert len(fault(f'name = "a"\nwheels = "{"x" * 500}"')) < 160


def test_a_fault_in_a_setting_is_put_down_to_it(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text('name = "a"\n[engine]\npower = 1\nfuel = "petrol"\n')
    for key, value, message in (
        ("engine.fuel", "x", "--set engine.fuel: there is no 'x'; known: diesel, petrol"),
        ("engine.powr", 1, "--set engine.powr: unknown key; did you mean 'power'?"),
        ("wheels", "x", "--set wheels: must be a whole number (got 'x')"),
        ("weather.0.kind", "rain", "--set weather.0.kind: must be a list [...] (got {'0': {'kind': 'rain'}})"),
    ):
        document = read(path)
        assign(document, key, value)
        with pytest.raises(UserError) as error:
            validate(document, Car, path, [key])
        assert str(error.value) == message


def test_a_fault_of_the_file_stays_the_files_whatever_was_set(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text("name = 1\n")
    document = read(path)
    assign(document, "wheels", 3)
    with pytest.raises(UserError, match=r"car\.toml:1: name: "):
        validate(document, Car, path, ["wheels"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xff\xfe\x00", "not valid TOML: byte 0"),
        (b"a = ", "not valid TOML"),
        (b"a = 1\na = 2\n", "line 2"),
        (b"a = " + b"[" * 5000 + b"]" * 5000, "nested too deeply"),
        (b"a = " + b"9" * 5000, "not valid TOML"),
        (bytes(range(256)), "not valid TOML"),
    ],
)
def test_what_is_no_toml_is_refused_in_one_line(tmp_path, content, words):
    path = tmp_path / "x.toml"
    path.write_bytes(content)
    with pytest.raises(UserError) as error:
        read(path)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)
    assert words in str(error.value)


def test_a_folder_and_a_missing_file_are_refused(tmp_path):
    for path, words in ((tmp_path, "Is a directory"), (tmp_path / "no.toml", "no such file")):
        with pytest.raises(UserError, match=words):
            read(path)


def test_a_setting_makes_tables_reaches_into_lists_and_keeps_units():
    document = {"list": [{"a": 1}], "mass": {"value": 5, "unit": "kg"}}
    assign(document, "x.y.z", 3)
    assign(document, "list.0.a", 2)
    assign(document, "mass", 6)
    assert document == {"list": [{"a": 2}], "mass": {"value": 6, "unit": "kg"}, "x": {"y": {"z": 3}}}
    for key in ("list.1.a", "list.b.a", "x.y.z.w", "a..b", ".", ""):
        with pytest.raises(UserError, match="--set"):
            assign(document, key, 1)


def test_places_and_neighbours(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("[a]\n# b\nb = 1\n")
    assert place(path, "a.b") == f"{path}:3: a.b"
    assert place(path, "a.c") == f"{path}:1: a.c"
    assert place(path, "d") == f"{path}: d"
    assert place(path, "a.b", ["vehicle.a.b"]) == "--set vehicle.a.b"
    assert nearest("wnd", ["wind", "rain"]) == "did you mean 'wind'?"
    assert nearest("q", ["wind", "rain"]) == "known: rain, wind"


@given(st.one_of(st.integers(), st.booleans(), st.floats(allow_nan=False), st.text(st.characters(codec="ascii"))))
def test_values_are_read_as_toml_writes_them_or_are_words(value):
    if isinstance(value, str):
        word = "w" + "".join(c for c in value if c.isalnum())
        try:
            tomllib.loads(f"v = {word}")
        except ValueError:
            assert parse_value(word) == word
    else:
        assert parse_value(str(value).lower() if isinstance(value, bool) else repr(value)) == value


KEYS = st.one_of(
    st.sampled_from(["name", "wheels", "seats", "engine", "parts", "weather", "kind", "amount", "flakes", "power"]),
    st.text(max_size=4),
)
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.dates()),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=4)),
    max_leaves=12,
)
@given(st.dictionaries(KEYS, VALUES, max_size=6), st.lists(KEYS, max_size=2))
def test_whatever_a_document_holds_it_is_valid_or_told_in_one_line(document, settings):
    try:
        validate(document, Car, Path("no.toml"), [key for key in settings if key])
    except UserError as error:
        text = str(error)
        assert text.startswith(("no.toml", "--set")) and len(text.splitlines()) == 1
