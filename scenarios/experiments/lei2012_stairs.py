"""Lei 2012, figure 6: heights on four landings of the stairs, each sensor alone and fused."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.altitude import AltitudeFilter, AltitudeNoise
from estimators.lei_akf import AkfReading, LeiFilter
from estimators.lei_sensors import BARO, GPS, VISION, LeiSensors
from scenarios.experiments.contract import Effort, Figure, Job, Outcome, Picture, Plot, Series
from scenarios.experiments.lei_readings import PUBLISHED, READINGS, table
from scenarios.experiments.stairs_bench import GPS_RATE, HEIGHTS, INERTIAL_RATE, RATE, Minute, minute

NAME = "stairs"
SYSTEM = "lei2012"
TITLE = "Stairs: four heights, one minute each"
ABOUT = (
    "The paper stood on four landings beside a light well, 5.12, 9.32, 13.52 and 17.72 m above a 1 m H, for a minute "
    "each, with camera, differential GPS and barometer. Here: a paved yard between walls, the camera held out over the "
    "H and swaying a little, roll and pitch with an error of 0.3 deg (and, for comparison, known), GPS and barometer "
    "with the errors that the paper reports of them."
)

Floats = NDArray[np.float64]

FIRST = 1.0  # [s] from which on errors count: the first samples have come
ACCELEROMETER = (0.02, 0.05)  # [m/s^2] bias and white noise of one sample
# What the published filter is told. The paper's model has no GPS bias, and with the deviation of 0.165 m that it
# reports the filter would follow a GPS that is 0.76 m off; so the GPS has its RMS error there. The barometer was zeroed
# at the foot of the stairs: eps_b starts at nothing, with the paper's mean error.
WHITE = AkfReading(prediction="still")  # standing still, equation 14 has no climb rate to offer
TOLD = replace(WHITE, sensors=LeiSensors(gps=math.hypot(0.760, 0.165)))
ZEROED = 0.175  # [m]
BARS = dict(zip(HEIGHTS, (0.5, 2.0, 5.0, 10.0), strict=True))  # [mm] RMS of our vision on each landing, attitude known


def jobs(effort: Effort) -> Sequence[Job]:
    """One a landing."""
    seconds = 60.0 if effort == "full" else 12.0
    return [
        Job(minute, (k, seconds), f"stairs, {height} m", 3.0 + 0.1 * seconds) for k, height in enumerate(HEIGHTS)
    ]


def published_fusion(
    m: Minute, vision: Floats | None, reading: AkfReading = TOLD, zeroed: float = ZEROED
) -> tuple[Floats, Floats]:
    """Times and heights of the adaptive Kalman filter, a cycle a fix; `vision` (N,) [m], None: it has none.

    zeroed [m]: standard deviation of eps_b at the start.
    """
    akf = LeiFilter(reading)
    akf.p[akf.bias, akf.bias] = zeroed**2
    heights = []
    for t, fix in zip(m.t_gps, m.gps, strict=True):
        akf.hear(GPS, float(fix))
        akf.hear(BARO, float(m.baro[np.searchsorted(m.t_baro, t, side="right") - 1]))
        if vision is not None:
            now = np.flatnonzero((m.t > t - 1.0 / GPS_RATE + 1e-9) & (m.t <= t + 1e-9) & np.isfinite(vision))
            if len(now):
                akf.hear(VISION, float(vision[now[-1]]))
        akf.cycle(1.0 / GPS_RATE, math.nan, math.nan, math.nan)
        heights.append(akf.height)
    return m.t_gps, np.array(heights)


def our_fusion(m: Minute, vision: Floats, variance: Floats) -> tuple[Floats, Floats, Floats]:
    """Times, heights and their standard deviations of Helideck's altitude filter, accelerometer included."""
    rng = np.random.default_rng([7, round(100 * m.height)])
    bias, white = ACCELEROMETER[0] * rng.standard_normal(), ACCELEROMETER[1]
    # no rotor turns, so there is no vibration to allow for
    filter_ = AltitudeFilter(AltitudeNoise(acceleration=0.01), -0.1)
    times = np.arange(0.0, m.t[-1] + 1.0 / RATE, 1.0 / INERTIAL_RATE)
    due = sorted(
        [(t, 0, k) for k, t in enumerate(m.t_baro)]
        + [(t, 1, k) for k, t in enumerate(m.t_gps)]
        + [(t, 2, k) for k, t in enumerate(m.t) if np.isfinite(vision[k])],
        reverse=True,
    )
    heights, stds = [], []
    for t in times:
        filter_.kalman.advance(t, np.array([0.0, 0.0, bias + white * rng.standard_normal(), 0.0, 0.0]))
        while due and due[-1][0] <= t + 1e-9:
            at, kind, k = due.pop()
            if kind == 0:
                filter_.baro(at, float(m.baro[k]))
            elif kind == 1:
                filter_.gps(at, float(m.gps[k]), 0.05 * float(rng.standard_normal()), 1.0)
            else:
                filter_.vision(at, float(vision[k]), float(variance[k]))
        filter_.kalman.refresh()
        last = filter_.kalman.last
        filter_.height, filter_.deviation = float(last["x"][0]), float(np.sqrt(last["p"][0, 0]))
        filter_.height_time = t
        heights.append(filter_.height)
        stds.append(filter_.deviation)
    return times, np.array(heights), np.array(stds)


def numbers(errors: Floats) -> tuple[float, float, float]:
    """(mean, largest, deviation) of errors [m]; NaN are left out."""
    return float(np.nanmean(np.abs(errors))), float(np.nanmax(np.abs(errors))), float(np.nanstd(errors))


def rms(errors: Floats) -> float:
    """Root mean square of errors; NaN are left out."""
    return float(np.sqrt(np.nanmean(errors**2)))


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Errors of all four landings together, as the paper's."""
    minutes: list[Minute] = list(answers)

    def pooled(name: str) -> Floats:
        return np.concatenate([(getattr(m, name).T - m.height).T for m in minutes])

    def settled(fused: Sequence[tuple[Floats, ...]]) -> Floats:
        return np.concatenate([f[1][f[0] >= FIRST] - m.height for f, m in zip(fused, minutes, strict=True)])

    seen = pooled("published")
    by_reading = [settled([published_fusion(m, m.published[:, k]) for m in minutes]) for k in range(len(READINGS))]
    akf = [published_fusion(m, m.published[:, PUBLISHED]) for m in minutes]
    white = settled([published_fusion(m, m.published[:, PUBLISHED], WHITE) for m in minutes])
    blind = settled([published_fusion(m, None) for m in minutes])
    real = [our_fusion(m, m.ours, m.ours_variance) for m in minutes]
    known = [our_fusion(m, m.exact, m.exact_variance) for m in minutes]
    gps, baro, vision = numbers(pooled("gps")), numbers(pooled("baro")), numbers(seen[:, PUBLISHED])
    faithful, ours, exact = numbers(settled(akf)), numbers(settled(real)), numbers(settled(known))
    alone = numbers(pooled("ours"))
    modelled = "the sensor's model, set to the paper"
    figures = [
        Figure("GPS alone: mean |error|", "m", 0.760, gps[0], None, note=modelled),
        Figure("GPS alone: largest", "m", 1.49, gps[1], None, note=modelled),
        Figure("GPS alone: deviation", "m", 0.165, gps[2], None, note=modelled),
        Figure("barometer alone: mean |error|", "m", 0.175, baro[0], None, note=modelled),
        Figure("barometer alone: deviation", "m", 0.092, baro[2], None, note=modelled),
        Figure("vision alone: largest", "m", 0.99, vision[1], alone[1], expected=(0.5, 1.4), note="tilt error 0.3 deg"),
        Figure("vision alone: deviation", "m", 0.351, vision[2], alone[2], expected=(0.1, 0.4),
               note="tilt error 0.3 deg"),
        Figure("vision alone: RMS", "m", None, rms(seen[:, PUBLISHED]), rms(pooled("ours")), bar=0.04,
               note="tilt error 0.3 deg"),
        Figure("fused: mean |error|", "m", 0.133, faithful[0], ours[0], bar=0.04, expected=(0.10, 0.17),
               note="tilt error 0.3 deg"),
        Figure("fused: largest", "m", 0.30, faithful[1], ours[1], expected=(0.0, 0.35), note="tilt error 0.3 deg"),
        Figure("fused: deviation", "m", 0.072, faithful[2], ours[2], note="tilt error 0.3 deg"),
        Figure("fused, GPS taken for unbiased: mean |error|", "m", None, numbers(white)[0], None,
               note="R of the GPS from its deviation"),
        Figure("fused without vision: mean |error|", "m", None, numbers(blind)[0], None),
        Figure("fused, attitude known: mean |error|", "m", None, None, exact[0], bar=0.01),
        Figure("fused, attitude known: largest", "m", None, None, exact[1], bar=0.03),
        *(
            Figure(f"vision at {m.height} m, attitude known: RMS", "mm", None, None,
                   1e3 * rms(m.exact - m.height), bar=BARS[m.height], bound=1e3 * m.bound)
            for m in minutes
        ),
    ]  # fmt: skip
    rows = table(seen, 1.0, "m", [_fused_row(errors) for errors in by_reading])
    return Outcome(
        figures=figures,
        plots=[_plot_published(minutes, akf), _plot_ours(minutes, known, real)],
        pictures=[
            Picture(f"From {minutes[-1].height} m", "What the camera sees on the highest.", minutes[-1].picture)
        ],
        notes=[
            "Camera: read noise 2.0, shot noise 3.5 grey levels at 255; defocus 0.4 px; 8 bits. GPS 5 Hz, barometer "
            f"10 Hz, pictures {RATE} Hz.",
            "Bounds: Cramer-Rao of one picture with this noise, an edge point a pixel of outline. Edges known to "
            "0.1 px, what a cautious designer would count on, give 0.25, 1.1, 2.8 and 5.6 mm.",
            f"Pictures in which the H was found: published {100 * float(np.mean(np.isfinite(seen[:, PUBLISHED]))):.1f} "
            f"%, ours {100 * float(np.mean(np.isfinite(pooled('ours')))):.1f} %.",
        ],
        tables=[("Every reading of 'length': vision alone, and fused by the published filter", rows)],
    )


def _fused_row(errors: Floats) -> dict[str, Any]:
    mean, largest, _ = numbers(errors)
    return {"fused mean |error| [m]": round(mean, 3), "fused largest [m]": round(largest, 3)}


def _plot_published(minutes: Sequence[Minute], akf: Sequence[tuple[Floats, Floats]]) -> Plot:
    """The paper's figure 6 as errors, the landings one after the other."""
    series = [
        _series("GPS", minutes, [(m.t_gps, m.gps) for m in minutes]),
        _series("barometer", minutes, [(m.t_baro, m.baro) for m in minutes]),
        _series("vision, published", minutes, [(m.t, m.published[:, PUBLISHED]) for m in minutes]),
        _series("fused, published", minutes, akf),
    ]
    return Plot(
        "Errors on the stairs, as published", "One landing after the other; vision errs with the heading of the "
        "camera, because one f stands for pixels that are not square.", "time [s]", "height error [m]", series,
        bands=[("the paper's largest fused error", -0.30, 0.30)],
    )  # fmt: skip


def _plot_ours(
    minutes: Sequence[Minute], known: Sequence[tuple[Floats, ...]], real: Sequence[tuple[Floats, ...]]
) -> Plot:
    series = [
        _series("fused, tilt error 0.3 deg", minutes, real, 1e3),
        _series("fused, attitude known", minutes, known, 1e3),
        _series("vision, attitude known", minutes, [(m.t, m.exact) for m in minutes], 1e3),
    ]
    return Plot("Errors on the stairs, ours", "The same minutes.", "time [s]", "height error [mm]", series)


def _series(name: str, minutes: Sequence[Minute], runs: Sequence[tuple[Floats, ...]], scale: float = 1.0) -> Series:
    """Errors of all landings, one after the other, from FIRST on."""
    length = minutes[0].t[-1] + 1.0 / RATE
    late = [run[0] >= FIRST for run in runs]
    t = np.concatenate([k * length + run[0][keep] for k, (run, keep) in enumerate(zip(runs, late, strict=True))])
    errors = [run[1][keep] - m.height for run, keep, m in zip(runs, late, minutes, strict=True)]
    return Series(name, t, scale * np.concatenate(errors))
