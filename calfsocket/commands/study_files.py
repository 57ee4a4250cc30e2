"""Commands on study files that solve nothing: ``new``, ``check``, ``show`` and ``schema``."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import command, first_rank, option
from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from calfsocket.study.cases import Plan

FILE = option("file", type=Path, metavar="FILE", help="study file, or a run.json")


@command(
    option(
        "file",
        type=Path,
        nargs="?",
        default=Path("study.toml"),
        metavar="FILE",
        help="default: %(default)s",
    ),
    description="Write an example study file with a remark on every key.",
    solves=False,
)
@first_rank
def new(arguments: Namespace) -> None:
    """Write an example study file to start from."""
    from calfsocket.study.study import example

    path = arguments.file
    if path.suffix != ".toml":
        raise InputError(f"new: {path}: use a name that ends in .toml")
    try:
        with path.open("x", encoding="utf-8") as file:  # never over a file that is there
            file.write(example())
    except FileExistsError:
        raise InputError(f"new: {path} already exists; choose another name") from None
    except OSError as error:
        raise InputError(f"new: {path}: {error.strerror}; choose another name") from None
    print(path)


@command(
    FILE,
    description="""\
Check a study file without solving it: keys, units, ranges, the files it names, whether each socket
can be put on the limb, and whether laws stay stable at the stretches of a limb in a socket. Also
list the cases.
""",
    epilog="Exit code: 0 if the file can be run, 2 if it cannot; one line says why.\n",
    solves=False,
)
@first_rank
def check(arguments: Namespace) -> None:
    """Check a study file in seconds, without solving."""
    from calfsocket.study.study import Study

    plan = Study.read(arguments.file).plan
    print(listing(arguments.file, plan), end="")
    for text in plan.warnings:
        print(f"warning: {text}")


def listing(path: Path, plan: "Plan") -> str:
    """List the cases, and how their sockets sit on the limb."""
    n = len(plan.cases)
    listed = [case for case in plan.cases if case.row is None]
    width = max(len(case.name) for case in listed)
    size = plan.document.model.size
    lines = [f"{path}: {n} case{'s' if n > 1 else ''}, mesh {size}"]
    lines.append(f"  {'case':{width}}  area lost  touching  deepest overlap  where")
    for case in listed:
        on = case.placement
        lines.append(
            f"  {case.name:{width}}  {100 * on.area_reduction:7.2f} %  {100 * on.touching:6.0f} %  "
            f"{on.largest_overlap:12.2f} mm  {on.largest_angle:3.0f} deg"
        )
    if uncertain := plan.document.uncertainty:
        check = f", {uncertain.check} of them to check it" if uncertain.check else ""
        lines.append(f"  and {n - len(listed)} of a design in uncertain inputs{check}:")
        lines += [f"    {name}: {of.words}" for name, of in uncertain.inputs.items()]
    lines += [f"  {notice}" for notice in plan.notices]
    if plan.unused:
        lines.append(f"  not used: {', '.join(plan.unused)}")
    return "\n".join(lines) + "\n"


@command(
    FILE,
    option(
        "--out",
        type=Path,
        metavar="FILE.png",
        help="or .svg, .pdf; default: FILE's name with .png, here",
    ),
    description="""\
Draw the limb with its regions, the sockets of a study file on it, and the cases.
""",
    solves=False,
)
@first_rank
def show(arguments: Namespace) -> None:
    """Draw the limb and the sockets of a study file."""
    from calfsocket.plotting.names import FORMATS
    from calfsocket.study.preview import draw
    from calfsocket.study.study import Study

    path = arguments.out or Path(arguments.file.with_suffix(".png").name)
    if path.suffix[1:] not in FORMATS:
        endings = ", ".join(f".{form}" for form in FORMATS)
        raise InputError(f"--out {path}: a picture's name ends in one of {endings}")
    plan = Study.read(arguments.file).plan
    try:
        draw(plan, path)
    except OSError as error:
        raise InputError(f"--out {path}: {error.strerror}; choose another name") from None
    print(path)


@command(
    description="""\
Print the JSON schema of study files. Editors that know TOML complete and check a file by it when
its first line is `#:schema study.schema.json`.
""",
    epilog="""\
example:
  python3 -m calfsocket schema > study.schema.json
""",
    solves=False,
)
@first_rank
def schema(_: Namespace) -> None:
    """Print the JSON schema of study files, for editors."""
    from calfsocket.study.document import schema_text

    print(schema_text(), end="")
