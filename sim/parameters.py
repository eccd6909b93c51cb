"""A number that a vehicle file gives to a term or a sensor: its name, unit, range and meaning."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """Declared beside the code that uses it; vehicle files, scenarios and identification all read it from there."""

    name: str
    unit: str  # SI, as in the vehicle file: "1", "s", "m", "rad", "m/s^2", ...
    low: float  # smallest value that makes sense
    high: float
    meaning: str
    default: float | None = None  # None: a vehicle file must give it

    @property
    def scenario_key(self) -> str:
        """The name with its unit, as scenarios write it: `latency_s`, `rate_hz`, `noise_m_s2`."""
        suffix = self.unit.replace("sqrt(Hz)", "rthz").replace("Hz", "hz")
        suffix = suffix.replace("^", "").replace("/", "_").replace(" ", "_")
        return self.name if self.unit == "1" else f"{self.name}_{suffix}"
