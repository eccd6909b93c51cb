"""Sums up blind results: the gate table, and detection against signature strength with the theoretical curve."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.stats import binomtest, ncx2

from benchmarks.blind_judge import Record
from identification.helicopter import HelicopterBench
from identification.multirotor import MultirotorBench
from identification.null import THRESHOLD
from identification.rig import RigBench

LIMITS: Mapping[str, float] = {  # [nats] that a cause must gain, by kind of vehicle
    kind: getattr(bench, "threshold", THRESHOLD)
    for kind, bench in (("raptor90", HelicopterBench), ("quadrotor", MultirotorBench), ("rig", RigBench))
}
NOTHING = "null", "threshold"  # parts
FEWEST = 20  # sets from which a tail is read
HIGHEST = 0.2  # of them
FARTHEST = 1e-5  # of a tail that some tens of sets tell
STRONG, MIDDLE, HOPELESS = 10.0, 6.0, 3.0  # d'
OCCAM = 3.0  # [nats] that a parameter's wide prior costs, about log(spread over standard deviation)
SURE = 0.9
SPOILT = frozenset({"baro_glitch"})  # stress has 2 % of jumps of 5 m in the barometer: just this cause
WORTH = 5.0  # [nats] on held-out flights that the oracle must gain for a share of it to mean anything
ALIKE: Sequence[tuple[str, str]] = (
    ("ground_effect", "baro_downwash"), ("sonar_scale", "camera_focal"), ("fuel_burn", "thrust_scale"),
    ("clock_offset", "actuator_delay"), ("wind", "cg_offset"), ("battery_sag", "mass"),
)  # fmt: skip


@dataclass(frozen=True)
class Line:
    """One figure against its gate."""

    figure: str
    of: int
    value: float | None
    gate: str
    met: bool | None
    interval: tuple[float, float] | None = None
    hits: int | None = None

    def markdown(self) -> str:
        """A row of the table."""
        value = "-" if self.value is None else f"{self.value:.3g}"
        span = "" if self.interval is None else f" ({self.interval[0]:.2f}-{self.interval[1]:.2f})"
        met = {None: "", True: "yes", False: "no"}[self.met]
        count = f"{self.of}" if self.hits is None else f"{self.hits} of {self.of}"
        return f"| {self.figure} | {count} | {value}{span} | {self.gate} | {met} |"


def strongest(record: Record) -> float:
    """d' of the weakest effect of a set; NaN where unknown."""
    return min(record.strength.values(), default=math.nan)


def named(record: Record) -> set[str]:
    """Names asserted."""
    return {item["name"] for item in record.asserted}


def classes(record: Record) -> set[str]:
    """Names asserted, and those declared confusable with them."""
    return named(record) | {name for item in record.asserted for name in item["confusable_with"]}


def true(record: Record) -> set[str]:
    """What is wrong."""
    return {item["name"] for item in record.truth}


def right_place(record: Record) -> bool:
    """All that is asserted lies where the truth does: plant, sensor or timing."""
    return {item["where"] for item in record.asserted} == {item["where"] for item in record.truth}


def share(
    figure: str, records: Sequence[Record], good: Callable[[Record], bool], gate: float, *, least: bool = True
) -> Line:
    """The share of records for which `good` holds, with its 95 % interval (Clopper and Pearson)."""
    if not records:
        return Line(figure, 0, None, f"{'>=' if least else '<='} {gate:g}", None)
    hits = sum(good(record) for record in records)
    found = binomtest(hits, len(records)).proportion_ci(method="exact")
    value = hits / len(records)
    met = value >= gate if least else value <= gate
    return Line(figure, len(records), value, f"{'>=' if least else '<='} {gate:g}", met, (found.low, found.high), hits)


def lines(records: Sequence[Record]) -> list[Line]:
    """The whole gate table."""
    sound = [r for r in records if r.error is None]

    def of(*parts: str) -> list[Record]:
        return [r for r in sound if r.job["part"] in parts]

    singles = [r for r in of("single", "hard")]
    strong = [r for r in singles if strongest(r) >= STRONG]
    middle = [r for r in singles if MIDDLE <= strongest(r) < STRONG]
    detected = [r for r in strong if r.asserted]
    named_at_all = [r for r in of("single", "hard", "weak", "null") if r.asserted]
    hopeless = [r for r in of("weak", "single") if strongest(r) < HOPELESS]
    pairs = [r for r in of("pair") if len(r.strength) == 2 and strongest(r) >= STRONG]
    unknown = of("unknown")
    found = [
        share("false alarms", of("null"), lambda r: bool(r.asserted), 0.01, least=False),
        share("detected, d' >= 10", strong, lambda r: bool(r.asserted), 0.95),
        share("detected, d' 6 to 10", middle, lambda r: bool(r.asserted), 0.70),
        share("named exactly, d' >= 10", strong, lambda r: named(r) == true(r), 0.95),
        share("named among others, d' >= 10", strong, lambda r: true(r) <= named(r), 0.95),
        share("class holds it, d' >= 10", strong, lambda r: true(r) <= classes(r), 0.98),
        share("plant, sensor or timing, of detected", detected, right_place, 0.98),
        share("a wrong name at p > 0.9", named_at_all, wrongly_sure, 0.01, least=False),
        share("nothing named, d' < 3", hopeless, lambda r: not r.asserted, 0.95),
        *_intervals(singles),
        share("two effects exactly", pairs, lambda r: named(r) == true(r), 0.80),
        share("two effects, classes", pairs, lambda r: true(r) <= classes(r), 0.90),
        share("unknown flagged", unknown, lambda r: bool(r.unexplained), 0.90),
        share("unknown, right channel", unknown, _channel, 0.95),
        share("unknown, right driver", unknown, _driver, 0.85),
        share("stress: false alarms", of("stress null"), lambda r: bool(named(r) - SPOILT), 0.02, least=False),
        share("stress: named exactly, d' >= 10", [r for r in of("stress single") if strongest(r) >= STRONG],
              lambda r: named(r) - SPOILT == true(r) - SPOILT, 0.90),
        share("thin logs: false alarms", [r for r in of("thin") if not r.truth], lambda r: bool(r.asserted), 0.02,
              least=False),
        share("thin logs: class holds it, d' >= 10", [r for r in of("thin") if r.truth and strongest(r) >= STRONG],
              lambda r: true(r) <= classes(r), 0.90),
        *_gains([r for r in [*strong, *pairs] if r.oracle is not None and r.oracle > WORTH]),
        share("hard pairs, name or class with a manoeuvre", of("hard"), _resolved, 0.90),
        *(share(f"- {name}", [r for r in of("hard") if r.job["names"][0].partition("#")[0] in name.split("/")],
                _resolved, 0.90) for name in _hard_pairs(of("hard"))),
    ]  # fmt: skip
    if sound:
        walls = np.array([r.wall_s for r in sound])
        memory = max(r.memory_mb for r in sound)
        median, worst = float(np.median(walls)), float(walls.max())
        found += [
            Line("a verdict, median [s]", len(sound), median, "<= 10", median <= 10.0),
            Line("a verdict, worst [s]", len(sound), worst, "<= 30", worst <= 30.0),
            Line("memory, most [MiB]", len(sound), memory, "<= 2048", memory <= 2048.0),
        ]
    return found


def wrongly_sure(record: Record) -> bool:
    """A cause asserted at p > 0.9 that neither is at work nor shares a class with one that is."""
    return any(
        item["probability"] > SURE and not ({item["name"], *item["confusable_with"]} & true(record))
        for item in record.asserted
    )


def _channel(record: Record) -> bool:
    return record.shows is not None and any(item["channel"] == record.shows[0] for item in record.unexplained)


def _driver(record: Record) -> bool:
    return record.shows is not None and any(record.shows[1] in item["depends_on"] for item in record.unexplained)


def _resolved(record: Record) -> bool:
    """The name itself, or a class that holds it and says which manoeuvre would tell."""
    return any(
        item["name"] in true(record) or (set(item["confusable_with"]) & true(record) and item["split_by"])
        for item in record.asserted
    )


def _hard_pairs(records: Sequence[Record]) -> list[str]:
    """Pairs that were tried, as `a/b`."""
    tried = {r.job["names"][0] for r in records}
    return [f"{a}/{b}" for a, b in ALIKE if tried & {a, b}]


def _gains(records: Sequence[Record]) -> list[Line]:
    """What the verdict's causes gain on held-out flights, over what the true ones gain there."""
    shares = np.array([r.gain / r.oracle for r in records if r.gain is not None and r.oracle])
    if not len(shares):
        return [Line("held-out gain over the oracle's, median", 0, None, ">= 0.95", None)]
    median, low = float(np.median(shares)), float(np.percentile(shares, 10))
    return [
        Line("held-out gain over the oracle's, median", len(shares), median, ">= 0.95", median >= 0.95),
        Line("held-out gain over the oracle's, 10th percentile", len(shares), low, ">= 0.85", low >= 0.85),
    ]


def _intervals(records: Sequence[Record]) -> list[Line]:
    """Coverage of the 95 % intervals, and the spread of the errors over their stated standard deviation."""
    cases = [case for r in records for case in r.intervals if case["std"] and case["std"] > 0.0]
    if not cases:
        return [Line("95 % intervals that hold the truth", 0, None, "0.93-0.97", None)]
    hits = sum(case["ci95"][0] <= case["true"] <= case["ci95"][1] for case in cases)
    inside, found = hits / len(cases), binomtest(hits, len(cases)).proportion_ci(method="exact")
    z = np.array([(case["value"] - case["true"]) / case["std"] for case in cases])
    spread = 1.4826 * float(np.median(np.abs(z)))
    return [
        Line("95 % intervals that hold the truth", len(cases), inside, "0.93-0.97", 0.93 <= inside <= 0.97,
             (found.low, found.high), hits),
        Line("errors over stated std, robust", len(cases), spread, "0.9-1.1", 0.9 <= spread <= 1.1),
    ]  # fmt: skip


def by_cause(records: Sequence[Record]) -> str:
    """A table: each vehicle's catalogue entries, how often each was seen, named, and what was named in its place."""
    rows = [
        "| vehicle | cause | sets | d' median | detected | named | alone | class | named instead |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    singles = [r for r in records if r.error is None and r.job["part"] in ("single", "hard")]
    for vehicle, name in sorted({(r.job["vehicle"], plain(next(iter(true(r))))) for r in singles}):
        own = [r for r in singles if r.job["vehicle"] == vehicle and {plain(n) for n in true(r)} == {name}]
        instead = sorted({plain(n) for r in own for n in named(r) - true(r)})
        values = [strongest(r) for r in own if not math.isnan(strongest(r))]
        counts = (bool(r.asserted) for r in own), (true(r) <= named(r) for r in own), \
            (true(r) == named(r) for r in own), (true(r) <= classes(r) for r in own)  # fmt: skip
        rows.append(
            f"| {vehicle} | {name} | {len(own)} | {np.median(values) if values else math.nan:.1f} | "
            + " | ".join(str(sum(count)) for count in counts) + f" | {', '.join(instead)} |"
        )
    return "\n".join(rows)


def plain(name: str) -> str:
    """A cause's name without its rotor, joint or input."""
    return name.partition("#")[0]


def expected(strength: np.ndarray, parameters: int = 1, threshold: float = THRESHOLD) -> np.ndarray:
    """Probability that an effect of this d' is seen: twice the likelihood ratio is noncentral chi-square."""
    needed = 2.0 * (threshold + OCCAM * parameters)
    return np.asarray(ncx2.sf(needed, parameters, np.maximum(strength, 1e-9) ** 2))


def tail(records: Sequence[Record], threshold: float) -> str:
    """What nulls say of the threshold: an exponential fitted to the highest of what their best causes gained."""
    best = np.sort([r.best for r in records if r.error is None and r.certified and r.job["part"] in NOTHING])
    if len(best) < FEWEST:
        return ""
    begins = float(np.quantile(best, 1.0 - HIGHEST))
    above = best[best > begins] - begins
    beyond = HIGHEST * math.exp(-max(threshold - begins, 0.0) / float(above.mean()))
    told = "one alarm" if beyond > FARTHEST else "less than one alarm"
    return (
        f"Best cause of {len(best)} sets with nothing wrong: median {np.median(best):.1f}, most {best[-1]:.1f} nats; a "
        f"cause must gain {threshold:g}. The highest fifth, as an exponential of {above.mean():.2f} nats from "
        f"{begins:.1f} on, leaves {told} in {1.0 / max(beyond, FARTHEST):,.0f}.\n\n"
    )


def write(records: Sequence[Record], folder: Path, kinds: Mapping[str, str]) -> str:
    """summary.md and detection.png; returns the summary. kinds: of vehicle, by its name."""
    text, places = "", sorted({kinds[r.job["vehicle"]] for r in records})
    for place in places if len(places) == 1 else ["all", *places]:
        some = [r for r in records if place in ("all", kinds[r.job["vehicle"]])]
        rows = [line.markdown() for line in lines(some) if line.of]
        nulls = "" if place == "all" else tail(some, LIMITS[place])
        refused = sum(not r.certified for r in some if r.error is None)
        text += f"## {place}\n\n| figure | sets | measured (95 %) | gate | met |\n|---|---|---|---|---|\n"
        text += "\n".join(rows) + f"\n\nNot judged, the baseline not being certified: {refused} of {len(some)}.\n\n"
        text += nulls
    text += f"{by_cause(records)}\n"
    failed = [r for r in records if r.error is not None]
    if failed:
        text += "\nFailed:\n\n" + "\n".join(
            f"- {r.job['part']} {r.job['vehicle']} {r.job['seed']}: {r.error}" for r in failed
        ) + "\n"  # fmt: skip
    (folder / "summary.md").write_text(text)
    draw(records, folder / "detection.png", min(LIMITS[place] for place in places) if places else THRESHOLD)
    return text


def draw(records: Sequence[Record], path: Path, threshold: float) -> None:
    """Detected share by d', in bins with their intervals, against the curve of this threshold."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    known = [r for r in records if r.error is None and r.job["part"] in ("single", "weak", "hard") and r.strength]
    figure, axes = plt.subplots(figsize=(7.0, 4.2))
    at = np.geomspace(0.3, 300.0, 300)
    for parameters, style in ((1, "-"), (3, "--")):
        axes.plot(at, expected(at, parameters, threshold), style, color="0.4",
                  label=f"noncentral chi-square, {parameters} parameter(s), {threshold:g} nats")  # fmt: skip
    d = np.array([strongest(r) for r in known])
    seen = {
        "anything asserted": (9, "none", np.array([bool(r.asserted) for r in known])),
        "the true cause or its class": (5, "C0", np.array([true(r) <= classes(r) for r in known])),
    }
    for name, (size, face, hit) in seen.items():
        label = name
        for low, high in pairwise(np.geomspace(0.3, 300.0, 13)):
            chosen = (d >= low) & (d < high)
            n = int(chosen.sum())
            if n == 0:
                continue
            rate, middle = float(hit[chosen].mean()), math.sqrt(low * high)
            span = binomtest(int(hit[chosen].sum()), n).proportion_ci(method="exact")
            axes.errorbar(middle, rate, [[max(rate - span.low, 0.0)], [max(span.high - rate, 0.0)]], color="C0", lw=0.7)
            axes.plot(middle, rate, "o", ms=size, mfc=face, mec="C0", label=label)
            axes.annotate(str(n), (middle, rate), textcoords="offset points", xytext=(5, 4), fontsize=7)
            label = "_"
    axes.axvline(STRONG, color="C3", lw=0.7)
    axes.set(xscale="log", ylim=(-0.02, 1.04), xlabel="d' [standard deviations]", ylabel="share detected",
             title="Detection against strength of the signature")  # fmt: skip
    axes.legend(fontsize=8, loc="lower right")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
