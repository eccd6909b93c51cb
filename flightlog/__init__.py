"""The ground floor: what a measurement, a control and a state are, and how a flight is written down."""
