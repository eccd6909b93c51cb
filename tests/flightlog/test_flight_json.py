import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.errors import UserError
from flightlog.flight_json import dumps, plain, read_flight_json, write_flight

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=10,
)


def without_infinities(value):
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list):
        return [without_infinities(item) for item in value]
    return {k: without_infinities(v) for k, v in value.items()} if isinstance(value, dict) else value


@given(values)
def test_every_document_comes_back_with_null_for_what_json_lacks(value):
    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    assert json.loads(dumps(value), parse_constant=refuse) == without_infinities(value)


def test_takes_what_the_project_handles():
    @dataclass(frozen=True)
    class Point:
        x: float
        file: Path

    document = {
        "a": np.float32(1.5),
        "b": np.array([1.0, np.nan]),
        "c": Point(np.inf, Path("x/y")),
        "d": np.bool_(True),
    }
    assert plain(document) == {"a": 1.5, "b": [1.0, None], "c": {"x": None, "file": "x/y"}, "d": True}


def test_a_second_writing_replaces_the_first_whole(tmp_path):
    write_flight(tmp_path, {"seed": 1, "long": "x" * 1000})
    write_flight(tmp_path, {"seed": 2})
    assert read_flight_json(tmp_path) == {"seed": 2}
    assert [p.name for p in tmp_path.iterdir()] == ["flight.json"]


def test_a_failed_writing_leaves_the_first(tmp_path):
    write_flight(tmp_path, {"seed": 1})
    (tmp_path / "flight.json.part").mkdir()
    with pytest.raises(UserError, match=r"flight\.json: cannot be written"):
        write_flight(tmp_path, {"seed": 2})
    assert read_flight_json(tmp_path) == {"seed": 1}


@pytest.mark.parametrize(
    ("content", "says"), [("{", "not valid JSON"), ("[1]", "holds list"), ("\xff\xfe", "not valid JSON")]
)
def test_a_broken_document_is_named(tmp_path, content, says):
    (tmp_path / "flight.json").write_bytes(content.encode("latin-1"))
    with pytest.raises(UserError, match=says) as caught:
        read_flight_json(tmp_path)
    assert str(tmp_path / "flight.json") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_that_is_no_flight_is_named(tmp_path):
    with pytest.raises(UserError, match=r"flight\.json is missing"):
        read_flight_json(tmp_path)
    with pytest.raises(UserError, match="no such folder"):
        read_flight_json(tmp_path / "nowhere")
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match=r"a file; a flight is a folder"):
        read_flight_json(tmp_path / "file")
