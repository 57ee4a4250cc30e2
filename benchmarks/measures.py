"""What is measured: each function returns numbers by name, whatever checkout it is of.

Names that end in `_s` are processor times, in `_wall_s` wall times, in `_MB` memory; others are
ratios.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.process import MONITOR, Ended, run
from calfsocket.io.system import cache_folder

FIRST, FOURTH = 2, 5
"""Lines of the monitor when as many iterations are done: the first line is that of the start."""


@dataclass(frozen=True)
class Problems:
    """Which problems are solved; the defaults take ten minutes.

    Attributes
    ----------
    repeats : int
        Of what takes seconds; the fastest counts.
    meshes, cases : tuple of str
        Sizes of meshes that are made, and of cases that are solved alone.
    frictions : int
        Cases of a sweep.
    size, sockets : str
        Of the paper's runs.
    growth : tuple of int
        Numbers of triangles.
    side_by_side, large : int
        On two ranks: cases of a sweep, and triangles of one case.
    """

    repeats: int = 3
    meshes: tuple[str, ...] = ("coarse", "paper", "120000")
    cases: tuple[str, ...] = ("coarse", "paper")
    frictions: int = 12
    size: str = "paper"
    sockets: str = "TC,TSB,HS"
    growth: tuple[int, ...] = (7000, 30_000, 120_000)
    side_by_side: int = 20
    large: int = 120_000


USUAL = Problems()
QUICK = Problems(
    repeats=1,
    meshes=("coarse",),
    cases=("coarse",),
    frictions=3,
    size="coarse",
    sockets="HS",
    growth=(7000, 15_000),
    side_by_side=4,
    large=15_000,
)
"""A minute."""
THOROUGH = replace(
    USUAL, growth=(7000, 30_000, 120_000, 400_000, 1_000_000), side_by_side=100, large=200_000
)
"""An hour or two, and 20 GB."""

ONE = '[study]\nsockets = ["HS"]\nmaterials = ["combined"]\n[model]\nsize = "{size}"\n'
FOUR = '[study]\nsockets = ["HS", "TC"]\nmaterials = ["combined", "separate"]\n'
Numbers = dict[str, float]


@dataclass(frozen=True)
class Subject:
    """The checkout that is measured, and how large the problems are."""

    checkout: Path
    problems: Problems = USUAL

    @contextmanager
    def study(self, text: str, *words: str) -> Iterator[tuple[list[str], Path]]:
        """Give the words that run a study file, and where its results go."""
        with tempfile.TemporaryDirectory() as folder:
            path, out = Path(folder) / "study.toml", Path(folder) / "results"
            path.write_text(text, encoding="utf-8")
            yield ["run", str(path), "--out", str(out), *words], out

    def ended(
        self, words: list[str], ranks: int = 1, iterations: int | None = None, **environment: str
    ) -> Ended:
        """Run a command of the checkout."""
        return run(words, self.checkout, ranks, iterations, **environment)


def start(subject: Subject) -> Numbers:
    """Time until something happens, with everything compiled, and its mesh made before or not."""
    times = range(subject.problems.repeats)
    with subject.study(FOUR) as (words, _):
        check = min(subject.ended(["check", words[1]]).processor for _ in times)
    with subject.study(ONE.format(size="coarse"), "--no-pictures", "--no-report", *MONITOR) as (
        words,
        _,
    ):
        again = [subject.ended(words, iterations=FIRST).iterations[-1] for _ in times]
        with _new_cache() as cache:
            new = subject.ended(words, iterations=FIRST, XDG_CACHE_HOME=cache).iterations[-1]
    return {
        "help_s": min(subject.ended(["--help"]).processor for _ in times),
        "check_of_four_cases_s": check,
        "first_iteration_coarse_s": min(processor for _, processor in again),
        "first_iteration_coarse_of_a_new_mesh_s": new[1],
    }


def compiled(subject: Subject) -> Numbers:
    """With nothing compiled: one case alone, and the paper's runs with all that is made of them.

    They are coarse, so that compiling counts.
    """
    words = ("--no-pictures", "--no-report")
    with subject.study(ONE.format(size="coarse"), *words) as (command, _), _nothing() as cache:
        one = subject.ended(command, XDG_CACHE_HOME=cache)
    sockets = subject.problems.sockets
    with _nothing() as out, _nothing() as cache:
        options = ["--size", "coarse", "--sockets", sockets, "--out", f"{out}/all"]
        whole = subject.ended(options, ranks=2, XDG_CACHE_HOME=cache)
    runs = 2 * len(sockets.split(","))
    return {
        "case_coarse_with_nothing_compiled_s": one.processor,
        f"{runs}_runs_coarse_two_ranks_with_nothing_compiled_wall_s": whole.wall,
    }


_nothing = tempfile.TemporaryDirectory
"""An empty folder, for a cache or for results."""


@contextmanager
def _new_cache() -> Iterator[str]:
    """Give a user's cache that has all that is compiled, and no meshes."""
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) / "calfsocket"
        cache.mkdir()
        for compiled in ("fenics", "python"):
            (cache / compiled).symlink_to(cache_folder() / compiled)
        yield folder


def mesh(subject: Subject) -> Numbers:
    """Time of the command that makes a mesh."""
    found = {}
    for size in subject.problems.meshes:
        with tempfile.TemporaryDirectory() as folder:
            out = str(Path(folder) / "hs.msh")
            ended = subject.ended(["mesh", "--socket", "HS", "--size", size, "--out", out])
            found[f"mesh_{size}_s"] = ended.processor
    return found


def sweep(subject: Subject) -> Numbers:
    """Cases of one geometry: a sweep over friction, coarse, without report."""
    n = subject.problems.frictions
    found = {}
    for what, words in (("", ["--no-pictures"]), ("_with_pictures", [])):
        with subject.study(_frictions(n), "--no-report", *words) as (command, _):
            found[f"sweep_of_{n}{what}_s"] = subject.ended(command).processor
    return found


def solution(subject: Subject) -> Numbers:
    """One case: the solution over its own factorisations and triangular solves, and memory."""
    found = {}
    for size in subject.problems.cases:
        with subject.study(ONE.format(size=size), "--profile", "--no-pictures", "--no-report") as (
            words,
            out,
        ):
            ended = subject.ended(words)
            profile = pd.read_csv(out / "profile.csv").set_index(["level", "what"])
        seconds, factorised = profile["seconds"], ("solve", "factorisation, numeric")
        algebra = seconds[factorised] + seconds["solve", "triangular solves"]
        found[f"case_{size}_s"] = ended.processor
        found[f"case_{size}_MB"] = ended.memory
        found[f"solution_over_algebra_{size}"] = float(seconds["phase", "solve"] / algebra)
        found[f"factorisations_{size}"] = float(profile["calls"][factorised])
    return found


def study(subject: Subject) -> Numbers:
    """Time runs of the paper with all that is made of them, and report and a picture alone."""
    size, sockets = subject.problems.size, subject.problems.sockets
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "results")
        whole = subject.ended(["--size", size, "--sockets", sockets, "--out", out], ranks=2)
        report, both = (subject.ended(["report", out], n) for n in (1, 2))
        picture = subject.ended(["picture", f"{out}/HS_separate"])
    runs = 2 * len(sockets.split(","))
    return {
        f"{runs}_runs_{size}_two_ranks_wall_s": whole.wall,
        f"report_{size}_s": report.processor,
        f"report_{size}_two_ranks_wall_s": both.wall,
        f"picture_{size}_s": picture.processor,
    }


def growth(subject: Subject) -> Numbers:
    """One Newton iteration and the memory so far, from coarse to far beyond the paper's mesh."""
    sizes = subject.problems.growth
    found: Numbers = {}
    for size in sizes:
        ended = _iterations(subject, size, 1)
        found[f"iteration_{size}_s"] = _one(ended, column=1)
        found[f"memory_{size}_MB"] = ended.memory
    for what in ("iteration_{}_s", "memory_{}_MB"):
        costs = [found[what.format(size)] for size in sizes]
        slope, _ = np.polyfit(np.log(sizes), np.log(costs), 1)
        found[f"exponent_of_{what.split('_')[0]}"] = float(slope)
    return found


def ranks(subject: Subject) -> Numbers:
    """Two ranks against one: cases side by side, and one large case on both; wall times."""
    n_cases, size = subject.problems.side_by_side, subject.problems.large
    walls = []
    for n in (1, 2):
        with subject.study(_frictions(n_cases), "--no-pictures", "--no-report") as (words, _):
            walls.append(subject.ended(words, n).wall)
    one, both = (_one(_iterations(subject, size, n), column=0) for n in (1, 2))
    return {
        f"throughput_of_{n_cases}_cases_on_two_ranks_over_twice_one": walls[0] / walls[1] / 2,
        f"iteration_{size}_on_two_ranks_over_one": both / one,
    }


def _frictions(n: int) -> str:
    """Return a study of so many frictions, from 0.1 to 1.2."""
    frictions = [round(float(each), 3) for each in np.linspace(0.1, 1.2, n)]
    return ONE.format(size="coarse") + f"[sweep.list]\nmodel.friction = {frictions}\n"


@cache
def _iterations(subject: Subject, size: int, n: int) -> Ended:
    words = ["--no-pictures", "--no-report", "--ranks-per-case", str(n), *MONITOR]
    with subject.study(ONE.format(size=size), *words) as (command, _):
        return subject.ended(command, n, iterations=FOURTH)


def _one(ended: Ended, column: int) -> float:
    """Time of an iteration, the mean of those after the first, which analyses the matrix, too."""
    times = [each[column] for each in ended.iterations]
    return (times[-1] - times[1]) / (len(times) - 2)


SUBJECTS = {
    each.__name__: each for each in (start, compiled, mesh, sweep, solution, study, growth, ranks)
}
