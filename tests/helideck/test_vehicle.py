"""`helideck vehicle` writes files that load."""

import pytest

from helideck.cli import main
from sim.kinds import load


@pytest.mark.parametrize("kind", ["helicopter", "multirotor", "rig"])
def test_a_template_of_each_kind_loads_and_is_not_overwritten(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["vehicle", "mine", "--kind", kind]) == 0
    assert load(tmp_path / "mine.toml").document["kind"] == kind
    assert main(["vehicle", "mine", "--kind", kind]) == 2
    assert "is there already" in capsys.readouterr().err
