"""What moves on the terminal while the machine works. All of it on stderr."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@contextmanager
def flight_progress(name: str, duration: float) -> Iterator[Callable[[float, str, float], None]]:
    """A bar with phase and height; yields what to call with (time [s], phase, height [m])."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:5.1f} s  {task.fields[phase]:<10} {task.fields[height]:>6.2f} m"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(name, total=duration, phase="starting", height=float("nan"))

        def show(t: float, phase: str, height: float) -> None:
            bar.update(task, completed=t, phase=phase, height=height)

        yield show


@contextmanager
def campaign_progress(name: str) -> Iterator[Callable[[int, int], None]]:
    """A bar with runs and the time left; yields what to call with (runs done, runs in all)."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(name, total=None)
        yield lambda done, runs: bar.update(task, completed=done, total=runs)


@contextmanager
def share_progress(name: str) -> Iterator[Callable[[float, float, str], None]]:
    """A bar with what was finished last; yields what to call with (done, of, text)."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %  {task.fields[last]}"),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(name, total=None, last="starting")
        yield lambda done, total, last: bar.update(task, completed=done, total=total, last=last)
