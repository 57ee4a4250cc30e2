"""Progress of a running study: one line a case on a terminal, log lines elsewhere."""

import logging
import time
from dataclasses import dataclass
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Event:
    """What happened to a case, in a few words, at a load where that matters.

    A milestone gets a line in a log.
    """

    case: str
    text: str
    load: float | None
    milestone: bool = False


class Reporter:
    """Shows events of cases in the study's order; a context manager, on rank 0.

    A terminal gets bars that move.
    """

    def __init__(self, names: list[str], console: Console) -> None:
        self._console = console
        self._started: dict[str, float] = {}
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("load {task.completed:.3f}"),
            TextColumn("{task.fields[text]}"),
            TextColumn("{task.fields[left]}"),
            console=console,
        )
        self._tasks: dict[str, TaskID] = {}
        if console.is_terminal:
            for name in names:
                self._tasks[name] = self._progress.add_task(
                    name, total=1.0, text="waiting", left=""
                )

    def __enter__(self) -> Self:
        if self._tasks:
            self._progress.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._tasks:
            self._progress.stop()

    def show(self, event: Event) -> None:
        """Show an event."""
        now = time.monotonic()
        start = self._started.setdefault(event.case, now)
        if self._tasks:
            left = ""
            if event.load and event.load < 1:
                left = f"{(now - start) * (1 - event.load) / event.load:.0f} s left"
            # None leaves the bar where it is.
            self._progress.update(
                self._tasks[event.case], completed=event.load, text=event.text, left=left
            )
        elif event.milestone:
            load = "" if event.load is None else f"load {event.load:.3f}, "
            logger.info("%s: %s%s, %.0f s", event.case, load, event.text, now - start)
