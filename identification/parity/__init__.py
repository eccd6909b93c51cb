"""Sensors judged against each other, where no vehicle says what they should have seen."""

from identification.parity.judge import judge as judge
