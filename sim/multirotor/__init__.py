"""Multirotors: their vehicle file, their model along commands, and a plain flight simulation."""

from sim.multirotor.file import Multirotor as Multirotor
from sim.multirotor.file import load_multirotor as load_multirotor
from sim.multirotor.file import multirotor_from as multirotor_from
