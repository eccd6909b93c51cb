"""What there is to choose from, each with a line of description."""

from collections.abc import Callable, Mapping


def scenarios() -> dict[str, str]:
    """Scenarios that come with the project."""
    from scenarios.load import available, load

    return {name: load(name).description for name in available()}


def vehicles() -> dict[str, str]:
    """Vehicles that come with the project."""
    from flightlog import toml_file
    from sim.vehicle import available, find

    documents = {name: toml_file.read(find(name)) for name in available()}
    return {
        name: f"{document['kind']}, {document['mass']['value']:g} {document['mass']['unit']}" if "mass" in document
        else str(document["kind"])
        for name, document in documents.items()
    }  # fmt: skip


def terms() -> dict[str, str]:
    """Terms that a vehicle file may name."""
    from sim.terms import CATALOGUE

    return {
        name: f"{term.stage.name.lower()}: " + ", ".join(f"{p.name} [{p.unit}]" for p in term.parameters)
        for name, term in CATALOGUE.items()
    }


def sensors() -> dict[str, str]:
    """Sensors that a vehicle file may name, by topic, with the keys that a scenario may set."""
    from sim.sensors import CATALOGUE

    return {topic: ", ".join(p.scenario_key for p in sensor.PARAMETERS) for topic, sensor in CATALOGUE.items()}


def navigators() -> dict[str, str]:
    """Navigators that a scenario or `helideck estimate` may name."""
    from estimators.navigators import NAVIGATORS, describe

    return {name: describe(name) for name in NAVIGATORS}


def causes() -> dict[str, str]:
    """Causes that `helideck diagnose` may name."""
    from identification.causes import TOLD

    return {
        name: f"{cause.where}: {cause.about}; " + ", ".join(f"{p.name} [{p.unit}]" for p in cause.parameters)
        for name, cause in TOLD.items()
    }


LISTS: Mapping[str, Callable[[], dict[str, str]]] = {
    "scenarios": scenarios,
    "vehicles": vehicles,
    "terms": terms,
    "sensors": sensors,
    "navigators": navigators,
    "causes": causes,
}
