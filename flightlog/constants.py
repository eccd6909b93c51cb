"""Physical constants that both sides of the loop must agree on. SI units."""

GRAVITY = 9.80665  # [m/s^2] standard gravity, ISO 2533 table 1
GAS_CONSTANT = 287.053  # [J/(kg K)] of dry air, ISO 2533
LAPSE_RATE = -0.0065  # [K/m] beta of Lei 2012 equation 8, troposphere of ISO 2533
EARTH_RADIUS = 6_371_000.0  # [m] mean radius; used for the horizon's dip alone
