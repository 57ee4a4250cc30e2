"""The command line: what a person types, and what they get to read."""

import argparse
import contextlib
import difflib
import gc
import io
import os
import sys
import traceback
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NoReturn

import calfsocket
from calfsocket.commands import BAD_INPUT, CASE_FAILED, OK, Command, Task, study_files, tools
from calfsocket.commands.calibrate import calibrate
from calfsocket.commands.export import export
from calfsocket.commands.fit import fit
from calfsocket.commands.limb import limb
from calfsocket.commands.report import picture, report
from calfsocket.commands.socket import socket
from calfsocket.commands.study import run, study
from calfsocket.io.errors import CalfsocketError, InputError
from calfsocket.parallel.abort import abort_all, all_arrive, exit_code, handle_termination

if TYPE_CHECKING:
    from mpi4py import MPI

PROGRAM = "python3 -m calfsocket"

GARBAGE = 1_000_000
"""New objects between Python's searches for cycles. The start makes 0.7 million, hardly any of them
garbage; a study looks for cycles after each case by itself."""

COMMANDS = {
    command.name: command
    for command in (
        limb,
        socket,
        study_files.new,
        study_files.check,
        study_files.show,
        run,
        study_files.schema,
        calibrate,
        fit,
        tools.mesh,
        export,
        picture,
        report,
        tools.verify,
        tools.precompile,
    )
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    # Looking for plugins in all packages that are installed takes longer than any model.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    before = gc.get_threshold()
    gc.set_threshold(GARBAGE)
    try:
        return _run(argv)
    finally:
        gc.set_threshold(*before)


def _run(argv: Sequence[str] | None) -> int:
    words, petsc = _split_petsc(list(sys.argv[1:] if argv is None else argv))
    command = COMMANDS[words.pop(0)] if words and words[0] in COMMANDS else study
    first = _launched_rank() == 0
    try:
        with contextlib.redirect_stdout(sys.stdout if first else io.StringIO()):
            arguments = _parser(command).parse_all(words)
    except InputError as error:
        return _refuse(error, first)
    if command.task is not None and not _is_launched():
        return _alone(command.task, arguments)
    return _with_mpi(command, arguments, petsc)


class _Parser(argparse.ArgumentParser):
    def __init__(self, **settings: Any) -> None:
        super().__init__(
            formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, **settings
        )

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see `{self.prog} --help`")

    def parse_all(self, words: list[str]) -> argparse.Namespace:
        """Parse, and suggest the nearest option for an unknown one."""
        arguments, unknown = self.parse_known_args(words)
        if unknown:
            known = [option for action in self._actions for option in action.option_strings]
            near = difflib.get_close_matches(unknown[0].split("=")[0], known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            self.error(f"{unknown[0]}: no such option or command{hint}")
        return arguments


def _parser(command: Command) -> _Parser:
    """Return the parser of a command; that of the study, which has no name, lists the others."""
    if command is study:
        listed = "\n".join(f"  {each.name:10s} {each.help}" for each in COMMANDS.values())
        parser = _Parser(
            prog=PROGRAM,
            usage=f"{PROGRAM} [options]   or   {PROGRAM} COMMAND [options]",
            description=f"{command.description}\ncommands:\n{listed}",
            epilog=command.epilog,
        )
        parser.add_argument(
            "--version", action="version", version=f"calfsocket {calfsocket.__version__}"
        )
    else:
        parser = _Parser(
            prog=f"{PROGRAM} {command.name}", description=command.description, epilog=command.epilog
        )
    for add in command.options:
        add(parser)
    return parser


def _alone(task: Task, arguments: argparse.Namespace) -> int:
    """Do the work of one process; MPI, which takes a tenth of a second to start, is not."""
    handle_termination()
    try:
        task(arguments)
    except InputError as error:
        return _refuse(error, first=True)
    except (CalfsocketError, KeyboardInterrupt) as error:
        message, code = _said(error)
        print(message, file=sys.stderr)
        return code
    return OK


def _said(error: CalfsocketError | KeyboardInterrupt) -> tuple[str, int]:
    """Return the message and the exit code of what ended a command."""
    if isinstance(error, KeyboardInterrupt):
        return f"calfsocket: {str(error) or 'interrupted'}", exit_code(error)
    return f"calfsocket: {error}", CASE_FAILED


def _with_mpi(command: Command, arguments: argparse.Namespace, petsc: list[str]) -> int:
    if command.solves:
        import petsc4py

        petsc4py.init(["calfsocket", *petsc])
    from mpi4py import MPI

    comm, abort_comm = MPI.COMM_WORLD, _abort_comm()
    handle_termination()
    try:
        return command.run(comm, arguments) or OK
    except InputError as error:
        if all_arrive(abort_comm):
            return _refuse(error, first=comm.rank == 0)
        message, code = f"calfsocket: {error}", BAD_INPUT
    except (CalfsocketError, KeyboardInterrupt) as error:
        message, code = _said(error)
    except BaseException:
        if comm.size == 1:
            raise
        message, code = traceback.format_exc(), CASE_FAILED
    if comm.size > 1:
        abort_all(comm, message, code)
    print(message, file=sys.stderr)
    return code


@cache
def _abort_comm() -> "MPI.Intracomm":
    """Return the communicator on which ranks wait for each other at the end of a command.

    One for all commands of this process: MPI has few.
    """
    from mpi4py import MPI

    return MPI.Intracomm(MPI.COMM_WORLD.Dup())


def _refuse(error: InputError, first: bool) -> int:
    if first:
        print(f"calfsocket: {error}", file=sys.stderr)
    return BAD_INPUT


def _split_petsc(argv: list[str]) -> tuple[list[str], list[str]]:
    """Separate PETSc's options (-calfsocket_NAME [VALUE]) from ours."""
    ours: list[str] = []
    petsc: list[str] = []
    named = False
    for word in argv:
        is_value = named and not word.startswith("--")
        named = word.startswith("-calfsocket_")
        (petsc if named or is_value else ours).append(word)
    return ours, petsc


_RANK = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK")
"""What launchers of MPI set in the environment."""


def _is_launched() -> bool:
    """Whether a launcher of MPI has started this process, and perhaps others."""
    return any(name in os.environ for name in _RANK)


def _launched_rank() -> int:
    """Rank in the MPI job by the launcher's environment, without initialising MPI."""
    return next((int(os.environ[name]) for name in _RANK if name in os.environ), 0)
