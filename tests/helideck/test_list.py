"""`helideck list` names what there is, each with a line."""

import json

import pytest

from estimators.navigators import NAVIGATORS
from helideck.cli import main
from helideck.listing import LISTS
from identification.causes import TOLD
from scenarios.load import available
from sim.sensors import CATALOGUE as SENSORS
from sim.terms import CATALOGUE as TERMS
from sim.vehicle import available as vehicles

EXPECTED = {
    "scenarios": available(), "vehicles": vehicles(), "terms": list(TERMS), "sensors": list(SENSORS),
    "navigators": list(NAVIGATORS), "causes": list(TOLD),
}  # fmt: skip


@pytest.mark.parametrize("what", list(LISTS))
def test_each_list_names_everything_with_a_description(what, capsys):
    assert main(["list", what]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == EXPECTED[what]
    assert all(len(line.split()) > 1 for line in lines)
    assert main(["list", what, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == EXPECTED[what]
    assert all(row["description"] for row in rows)


def test_what_is_no_list_is_told_in_one_line(capsys):
    assert main(["list", "things"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "scenarios" in err
