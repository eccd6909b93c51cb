"""Runs experiments: their jobs spread over all cores, the longest first."""

import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import joblib
from threadpoolctl import threadpool_limits

from scenarios.experiments.contract import Effort, Experiment, Job, Outcome

Progress = Callable[[float, float, str], None]  # share done, of, what was finished last


@dataclass(frozen=True)
class Result:
    """An experiment that was run. `outcome` is None where it failed; `error` says why, with its traceback."""

    experiment: Experiment
    outcome: Outcome | None
    error: str | None
    seconds: float  # of all its jobs, on one core each


@dataclass(frozen=True)
class _Answer:
    index: int
    value: Any
    error: str | None
    seconds: float


def _work(index: int, job: Job) -> _Answer:
    """One job; with one thread, so that its figures are the same wherever it runs."""
    cv2.setNumThreads(1)
    begin = time.perf_counter()
    try:
        with threadpool_limits(limits=1):
            value = job.work(*job.arguments)
    except Exception:
        return _Answer(index, None, f"{job.label}\n{traceback.format_exc()}", time.perf_counter() - begin)
    return _Answer(index, value, None, time.perf_counter() - begin)


def run(
    experiments: Sequence[Experiment], effort: Effort, *, workers: int, progress: Progress | None = None
) -> list[Result]:
    """Run them all, in the order given; one that fails does not stop the others."""
    jobs = [(i, job) for i, item in enumerate(experiments) for job in item.jobs(effort)]
    order = sorted(range(len(jobs)), key=lambda k: -jobs[k][1].cost)
    total = sum(job.cost for _, job in jobs)
    done = 0.0
    answers: dict[int, _Answer] = {}
    parallel = joblib.Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")
    for answer in parallel(joblib.delayed(_work)(k, jobs[k][1]) for k in order):
        answers[answer.index] = answer
        job = jobs[answer.index][1]
        done += job.cost
        if progress is not None:
            progress(done, total, job.label)
    return [
        _conclude(item, effort, [answers[k] for k, (j, _) in enumerate(jobs) if j == i])
        for i, item in enumerate(experiments)
    ]


def _conclude(experiment: Experiment, effort: Effort, answers: Sequence[_Answer]) -> Result:
    seconds = sum(answer.seconds for answer in answers)
    errors = [answer.error for answer in answers if answer.error is not None]
    if errors:
        return Result(experiment, None, "\n".join(errors), seconds)
    try:
        outcome = experiment.conclude(effort, [answer.value for answer in answers])
    except Exception:
        return Result(experiment, None, traceback.format_exc(), seconds)
    return Result(experiment, outcome, None, seconds)
