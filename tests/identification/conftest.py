"""One flown flight for all tests of the diagnosis that need one."""

import pytest

from tests.identification.short_flight import Columns, short_flight


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Columns:
    """Columns by topic; copy before changing anything (`short_flight.copied`)."""
    return short_flight(tmp_path_factory.mktemp("short") / "flight")
