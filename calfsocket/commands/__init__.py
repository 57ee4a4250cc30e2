"""What a person can ask for: functions that `command` makes commands of.

The modules are imported for their help alone, which should not wait for MPI and dolfinx: heavy
imports stand in the functions that need them.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeAlias

from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

OK, CASE_FAILED, BAD_INPUT = 0, 1, 2
"""Exit codes."""

Comm: TypeAlias = "MPI.Intracomm"
Work: TypeAlias = Callable[[Comm, argparse.Namespace], int | None]
Task: TypeAlias = Callable[[argparse.Namespace], object]
Option: TypeAlias = "Callable[[argparse._ActionsContainer], object]"


@dataclass(frozen=True)
class Command:
    """A command.

    Attributes
    ----------
    run : callable
        Does the work (collective); returns the exit code, or None for `OK`. It raises `InputError`
        on all ranks when the input cannot be used.
    name, help : str
        Its name, and its line in the list of commands.
    description, epilog : str
        What its help says before and after the options.
    options : tuple of callable
        Each adds an option, or a group of them, to a parser.
    solves : bool
        Whether it needs PETSc.
    task : callable, optional
        The work where it is that of one process: it needs no MPI then.
    """

    run: Work
    name: str
    help: str
    description: str
    epilog: str
    options: tuple[Option, ...]
    solves: bool
    task: Task | None = None


def command(
    *options: Option, description: str = "", epilog: str = "", solves: bool = True
) -> Callable[[Work], Command]:
    """Make a function a command of its name, whose docstring is its line in the list."""

    def made(work: Work) -> Command:
        line = work.__doc__ or ""
        listed = line[:1].lower() + line[1:].removesuffix(".")
        task = None if solves else getattr(work, "task", None)
        about = description or line
        return Command(work, work.__name__, listed, about, epilog, options, solves, task)

    return made


def first_rank(task: Task) -> Work:
    """Make the work of a command of a task for rank 0 alone."""

    @wraps(task)
    def work(comm: Comm, arguments: argparse.Namespace) -> None:
        on_first_rank(comm, lambda: task(arguments))

    work.task = task  # type: ignore[attr-defined]
    return work


def option(*names: str, **settings: Any) -> Option:
    """Return an option; names and settings are those of `argparse`."""
    return lambda parser: parser.add_argument(*names, **settings)


def group(title: str, *options: Option) -> Option:
    """Return options under a title of their own."""

    def add(parser: "argparse._ActionsContainer") -> None:
        titled = parser.add_argument_group(title)
        for each in options:
            each(titled)

    return add
