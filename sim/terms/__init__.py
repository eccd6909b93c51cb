"""The catalogue of terms: every effect of the model by name, one a file."""

from collections.abc import Mapping

from sim.terms import (
    cg_offset,
    deadband,
    drag,
    engine,
    fins,
    flapping,
    fuel,
    fuselage,
    ground_effect,
    hub,
    main_rotor,
    rotor_droop,
    servo,
    table,
    tail_rotor,
    vortex_ring,
)
from sim.terms.contract import Term

CATALOGUE: Mapping[str, Term] = {
    module.TERM.name: module.TERM
    for module in (
        servo,
        fuel,
        engine,
        ground_effect,
        main_rotor,
        flapping,
        hub,
        tail_rotor,
        fuselage,
        fins,
        drag,
        deadband,
        vortex_ring,
        cg_offset,
        rotor_droop,
    )
}

# what a vehicle file may name: the same, and tables
KNOWN: Mapping[str, Term] = {**CATALOGUE, **table.TABLES}
