"""Multirotors: balances of force and moment along the commands."""

from identification.multirotor.bench import MultirotorBench as MultirotorBench
from identification.multirotor.bench import open_bench as open_bench
