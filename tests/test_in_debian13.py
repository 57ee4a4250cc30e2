"""``./in-debian13`` and ``debian13-environment``: what they decide, set, and leave behind.

Nothing is built here. The programs that would build (apt-get, mmdebstrap, docker) are replaced by
scripts that write down how they were called.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
DEBIAN_13 = 'ID=debian\nVERSION_ID="13"\n'
UBUNTU = 'ID=ubuntu\nVERSION_ID="24.04"\nID_LIKE=debian\n'
FEDORA = "ID=fedora\nVERSION_ID=42\n"

# Runs in a mount namespace: puts a file over /etc/os-release, then becomes the command.
WITH_OS_RELEASE = """
import ctypes, os, sys
MS_BIND = 4096
if ctypes.CDLL(None).mount(sys.argv[1].encode(), b"/etc/os-release", None, MS_BIND, None):
    sys.exit("cannot mount")
os.execvp(sys.argv[2], sys.argv[2:])
"""


def may_mount() -> bool:
    return subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode == 0


#: Installed by pip, it runs without these scripts and Debian's packages.
pytestmark = pytest.mark.skipif(
    bool(find_spec("dolfinx_solver")), reason="calfsocket's packages are those of pip"
)
needs_mount = pytest.mark.skipif(not may_mount(), reason="pretends another system by a mount")


class Machine:
    """A machine with a checkout of its own, on which programs can be replaced."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.checkout = folder / "checkout"
        self.programs = folder / "programs"
        self.calls = folder / "calls"
        self.home = folder / "home"
        for new in (self.checkout, self.programs, self.home):
            new.mkdir()
        for name in ("in-debian13", "debian13-environment", "debian-packages.txt"):
            shutil.copy(REPOSITORY / name, self.checkout)
        self.calls.touch()
        # The account's own home: not that of who runs the tests, where a root may be.
        self.replace("getent", f"echo user:x:0:0::{self.home}:/bin/sh")

    def replace(self, program: str, body: str) -> None:
        """Put a script before the real program; it writes down its arguments, then runs body."""
        path = self.programs / program
        path.write_text(f'#!/bin/sh\necho "{program} $*" >> {self.calls}\n{body}\n')
        path.chmod(0o755)

    def called(self, program: str) -> list[str]:
        lines = self.calls.read_text().splitlines()
        return [line for line in lines if line.startswith(program)]

    def start(
        self,
        *command: str,
        system: str | None = None,
        cwd: Path | None = None,
        before: tuple[str, ...] = (),
        **variables: str | None,
    ) -> subprocess.Popen[str]:
        arguments = [*before, str(self.checkout / "in-debian13"), *command]
        if system is not None:
            release = self.folder / "os-release"
            release.write_text(system)
            pretend = [sys.executable, "-c", WITH_OS_RELEASE, str(release)]
            arguments = ["unshare", "--mount", *pretend, *arguments]
        path = f"{self.programs}:{os.environ['PATH']}"
        variables = {"HOME": str(self.home), "PATH": path, "TERM": "dumb"} | variables
        return subprocess.Popen(
            arguments,
            cwd=cwd or self.checkout,
            env={name: value for name, value in variables.items() if value is not None},
            # A shell that runs pytest in the background has it ignore this one.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *command: str, **options: object) -> subprocess.CompletedProcess[str]:
        process = self.start(*command, **options)  # type: ignore[arg-type]
        output, errors = process.communicate(timeout=60)
        return subprocess.CompletedProcess(command, process.returncode, output, errors)


@pytest.fixture
def machine() -> Iterator[Machine]:
    # Not tmp_path: that one is closed to other users, as one of whom a test runs.
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Machine(Path(folder))


def eventually(true: Callable[[], bool], seconds: float = 10) -> bool:
    end = time.monotonic() + seconds
    while not (done := true()) and time.monotonic() < end:
        time.sleep(0.02)
    return done


# ----- how it is called


@pytest.mark.parametrize("arguments", [[], [""], ["--unknown", "pytest"]])
def test_without_a_command_says_how_to_use_it(machine: Machine, arguments: list[str]) -> None:
    done = machine.run(*arguments)
    assert done.returncode == 2
    assert "usage: ./in-debian13 COMMAND" in done.stderr


def test_help_is_the_head_of_the_script(machine: Machine) -> None:
    done = machine.run("--help")
    assert done.returncode == 0
    assert done.stdout.startswith("Runs a command in Debian 13")
    assert "set -euo" not in done.stdout


@pytest.mark.parametrize("script", ["in-debian13", "debian13-environment", ".ci/run"])
def test_scripts_are_executable_and_parse(script: str) -> None:
    path = REPOSITORY / script
    assert os.access(path, os.X_OK)
    subprocess.run(["bash", "-n", path], check=True)


def test_the_list_is_sorted_and_without_doubles() -> None:
    lines = (REPOSITORY / "debian-packages.txt").read_text().splitlines()
    packages = [words[0] for line in lines if (words := line.partition("#")[0].split())]
    assert packages == sorted(set(packages))


def test_inside_already_it_only_runs_the_command(machine: Machine) -> None:
    done = machine.run(
        "sh", "-c", 'echo "$1|$PATH"; exit 7', "sh", "a  b", CALFSOCKET_IN_DEBIAN13="1"
    )
    assert done.returncode == 7
    assert done.stdout.startswith(f"a  b|{machine.programs}:")


# ----- on Debian 13: the machine that the tests run on


def test_output_exit_code_and_arguments_pass(machine: Machine) -> None:
    done = machine.run("sh", "-c", 'echo "$1"; echo "$2" >&2; exit 9', "sh", "a  b", "*")
    assert (done.stdout, done.stderr, done.returncode) == ("a  b\n", "*\n", 9)


def test_an_unknown_command_is_named(machine: Machine) -> None:
    done = machine.run("no-such-command")
    assert done.returncode == 127
    assert "no-such-command" in done.stderr


def test_the_environment_is_that_of_debian(machine: Machine) -> None:
    variables = {
        "LD_LIBRARY_PATH": "/opt/conda/lib",
        "PYTHONPATH": "/opt/conda/site-packages",
        "TMPDIR": "/no/such/folder",
        "PIP_INDEX_URL": "https://example.org/simple",
    }
    elsewhere = machine.folder / "elsewhere"
    elsewhere.mkdir()
    done = machine.run("sh", "-c", "pwd; env", cwd=elsewhere, **variables)
    cwd, *lines = done.stdout.splitlines()
    inside = dict(line.split("=", 1) for line in lines)
    assert cwd == str(elsewhere)
    assert str(machine.programs) not in inside["PATH"]
    assert inside["PYTHONPATH"] == str(machine.checkout)
    assert not {"LD_LIBRARY_PATH", "TMPDIR"} & set(inside)
    assert inside["PIP_INDEX_URL"] == "https://example.org/simple"
    assert inside["HOME"] == str(machine.home)
    assert inside["OMP_NUM_THREADS"] == "1"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_signals_reach_the_command(machine: Machine, number: int) -> None:
    process = machine.start("sh", "-c", "echo started; exec sleep 300")
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    process.send_signal(number)
    process.communicate(timeout=10)
    assert process.returncode == -number


@pytest.fixture
def without_gmsh(machine: Machine) -> Machine:
    """Return a machine whose dpkg knows all packages of the list but python3-gmsh."""
    text = (machine.checkout / "debian-packages.txt").read_text()
    packages = [words[0] for line in text.splitlines() if (words := line.split())]
    known = [f"installed {name}" for name in packages if name not in {"#", "python3-gmsh"}]
    known.append("config-files python3-gmsh")  # removed, but not purged
    machine.replace("dpkg-query", "\n".join(f"echo '{line}'" for line in known))
    machine.replace("apt-get", "echo progress")
    return machine


@pytest.mark.skipif(os.geteuid() != 0, reason="only root installs")
def test_root_installs_what_is_missing(without_gmsh: Machine) -> None:
    done = without_gmsh.run("echo", "result")
    assert without_gmsh.called("apt-get") == [
        "apt-get update",
        "apt-get -o DPkg::Lock::Timeout=300 install --yes --no-install-recommends python3-gmsh",
    ]
    assert done.stdout == "result\n"  # apt-get's own output is kept out of it


def test_others_read_what_to_ask_for(without_gmsh: Machine) -> None:
    nobody = ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups")
    done = without_gmsh.run("echo", "result", before=nobody if os.geteuid() == 0 else ())
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.endswith("apt-get install --no-install-recommends python3-gmsh\n")
    assert not without_gmsh.called("apt-get")


# ----- homes and places of all kinds


def test_without_a_home_that_of_the_account_is_taken(machine: Machine) -> None:
    for home in (None, "", "/no/such/folder"):
        done = machine.run("sh", "-c", "echo $HOME", HOME=home)
        assert done.stdout == f"{machine.home}\n"
        said = f"in-debian13: HOME is {home}, which is not a folder: using {machine.home}\n"
        assert done.stderr == (said if home else "")


def test_an_account_without_a_home_works_too(machine: Machine) -> None:
    machine.replace("getent", "exit 2")
    done = machine.run("sh", "-c", "echo $HOME", HOME=None)
    assert (done.returncode, done.stdout) == (0, "/tmp\n")


@pytest.mark.skipif(os.geteuid() != 0, reason="becomes another user")
def test_what_is_compiled_has_a_place_where_the_home_is_read_only(machine: Machine) -> None:
    user = 65534
    place = Path(f"/tmp/calfsocket-{user}")
    nobody = ("setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups")
    machine.calls.chmod(0o666)
    try:
        done = machine.run("sh", "-c", "echo $XDG_CACHE_HOME", before=nobody)
        assert done.stdout == f"{place}\n"
        assert done.stderr.count("\n") == 1 and "cannot be written to" in done.stderr
        assert place.stat().st_mode & 0o777 == 0o700
    finally:
        shutil.rmtree(place)


def test_a_working_directory_that_was_removed_is_said(machine: Machine) -> None:
    program = machine.checkout / "in-debian13"
    done = subprocess.run(
        ["sh", "-c", f"mkdir gone; cd gone; rmdir ../gone; {program} true"],
        cwd=machine.home, capture_output=True, text=True,
        env={"HOME": str(machine.home), "PATH": f"{machine.programs}:{os.environ['PATH']}"},
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.endswith("working directory does not exist any more; go to another one\n")


# ----- in a container


@pytest.fixture
def with_docker(machine: Machine) -> Machine:
    machine.replace("docker", '[ "$1" != image ] || exit 1')  # has no image yet
    return machine


@needs_mount
def test_elsewhere_a_container_sees_the_hosts_places(with_docker: Machine) -> None:
    work = Path("/var/tmp")
    variables = {"PIP_INDEX_URL": "https://example.org/simple"}
    done = with_docker.run("pytest", "-k", "a b", system=FEDORA, cwd=work, **variables)
    assert done.returncode == 0, done.stderr
    (build,) = with_docker.called("docker build")
    (run,) = with_docker.called("docker run")
    assert build.startswith("docker build --target debian13 --tag calfsocket-debian13:")
    assert build.endswith(str(with_docker.checkout))
    assert run.endswith(f" {with_docker.checkout}/debian13-environment pytest -k a b")
    assert f"--workdir {work} " in run
    assert f"--user {os.getuid()}:{os.getgid()} " in run
    assert "--env PIP_INDEX_URL " in run
    assert " --tty" not in run  # no terminal here
    mounted = [part.split(" ")[0] for part in run.split("type=bind,source=")[1:]]
    # The checkout is not among them: it lies in /tmp here.
    places = [str(with_docker.home), "/tmp", str(work)]
    assert mounted == [f"{place},target={place}" for place in places]


@pytest.fixture
def data() -> Iterator[Path]:
    """Return a folder that is below none of the usual places."""
    with tempfile.TemporaryDirectory(dir=Path.home()) as folder:  # not the machine's
        yield Path(folder).resolve()


@needs_mount
def test_a_container_sees_what_the_command_names(with_docker: Machine, data: Path) -> None:
    for name in ("studies", "disk/limbs", "out"):
        (data / name).mkdir(parents=True)
    study, limb = data / "studies" / "a b.toml", data / "disk" / "limbs" / "limb.json"
    study.touch()
    limb.touch()
    (with_docker.checkout / "limb.json").symlink_to(limb)
    words = [str(study), "limb.json", f"--out={data}/out/new/one", "-k", "x=/etc/passwd", "/"]
    done = with_docker.run("run", *words, system=FEDORA)
    assert done.returncode == 0, done.stderr
    (run,) = with_docker.called("docker run")
    mounted = [part.split(",")[0] for part in run.split("type=bind,source=")[1:]]
    places = [str(with_docker.home), "/tmp"]
    assert mounted == [*places, *(str(data / name) for name in ("studies", "disk/limbs", "out"))]


@needs_mount
def test_a_system_directory_is_not_brought_in(with_docker: Machine) -> None:
    with_docker.run("true", system=FEDORA, cwd=Path("/usr/share"))
    (run,) = with_docker.called("docker run")
    assert "--workdir /usr/share " in run
    assert "source=/usr" not in run


@needs_mount
def test_the_image_is_built_once(with_docker: Machine) -> None:
    with_docker.replace("docker", "")  # has the image
    with_docker.run("true", system=FEDORA)
    assert with_docker.called("docker run")
    assert not with_docker.called("docker build")


@needs_mount
def test_without_any_engine_says_what_is_needed(machine: Machine) -> None:
    for engine in ("docker", "podman"):
        machine.replace(engine, "exit 125")
    done = machine.run("true", system=FEDORA)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "docker or podman" in done.stderr


@needs_mount
def test_only_another_list_of_packages_makes_another_image(with_docker: Machine) -> None:
    def tag(text: str) -> str:
        (with_docker.checkout / "debian-packages.txt").write_text(text)
        with_docker.run("true", system=FEDORA)
        return with_docker.called("docker build")[-1].split()[5]

    first = tag("gmsh\nxvfb\n")
    assert tag("# why\nxvfb   # pictures\n\n  gmsh\n") == first
    assert tag("gmsh\nxvfb\nzlib1g\n") != first
    assert tag("gmsh\n") != first


# ----- in a root of its own: the building, with an mmdebstrap that only makes a folder


# Its last argument must not exist yet.
MAKE_FOLDER = 'for root; do :; done; mkdir "$root" && mkdir -p "$root/etc/ssl/certs" || exit; '


@pytest.fixture
def ubuntu(machine: Machine) -> Machine:
    machine.replace("mmdebstrap", MAKE_FOLDER + "sleep ${SECONDS_TO_BUILD-0}")
    machine.replace("mount", "")
    machine.replace("chroot", 'echo "entered $1"')
    return machine


def roots(machine: Machine) -> list[str]:
    cache = machine.home / ".cache" / "calfsocket"
    return sorted(path.name for path in cache.iterdir() if path.is_dir())


@needs_mount
def test_the_root_is_built_once(ubuntu: Machine) -> None:
    first = ubuntu.run("true", system=UBUNTU)
    assert first.returncode == 0, first.stderr
    (root,) = roots(ubuntu)
    assert not root.endswith(".partial")
    assert first.stdout == f"entered {ubuntu.home}/.cache/calfsocket/{root}\n"
    assert ubuntu.run("true", system=UBUNTU).stdout == first.stdout
    assert len(ubuntu.called("mmdebstrap")) == 1


@needs_mount
def test_the_root_is_found_where_home_differs(ubuntu: Machine) -> None:
    other = ubuntu.folder / "other"
    other.mkdir()
    first = ubuntu.run("true", system=UBUNTU)
    for home in (str(other), None, "/no/such/folder"):
        assert ubuntu.run("true", system=UBUNTU, HOME=home).stdout == first.stdout
    assert len(ubuntu.called("mmdebstrap")) == 1
    assert not list(other.iterdir())


@needs_mount
def test_where_no_root_can_be_written_it_says_so(ubuntu: Machine) -> None:
    (ubuntu.home / ".cache").write_text("a file")
    done = ubuntu.run("true", system=UBUNTU)
    assert done.returncode == 1
    assert not ubuntu.called("mmdebstrap")
    (line,) = done.stderr.splitlines()
    assert f"{ubuntu.home}/.cache" in line and "set XDG_CACHE_HOME to a folder that can" in line


@needs_mount
def test_a_failed_build_is_no_root(ubuntu: Machine) -> None:
    ubuntu.replace("mmdebstrap", MAKE_FOLDER + "exit 1")
    done = ubuntu.run("true", system=UBUNTU)
    assert done.returncode == 1
    assert not ubuntu.called("chroot")
    assert all(name.endswith(".partial") for name in roots(ubuntu))


@needs_mount
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_killed_build_ends_and_is_built_again(ubuntu: Machine, number: int) -> None:
    ubuntu.replace("mmdebstrap", MAKE_FOLDER + "exec sleep 300")
    process = ubuntu.start("true", system=UBUNTU)
    cache = ubuntu.home / ".cache" / "calfsocket"
    assert eventually(lambda: any(cache.glob("*.partial")))
    process.send_signal(number)
    process.communicate(timeout=10)  # returns when nothing holds the output any more
    assert process.returncode == -number

    ubuntu.replace("mmdebstrap", MAKE_FOLDER)
    assert ubuntu.run("true", system=UBUNTU).returncode == 0
    assert len(roots(ubuntu)) == 1
    assert not roots(ubuntu)[0].endswith(".partial")


@needs_mount
def test_of_two_builds_at_once_one_waits(ubuntu: Machine) -> None:
    first = ubuntu.start("true", system=UBUNTU, SECONDS_TO_BUILD="2")
    assert eventually(lambda: bool(ubuntu.called("mmdebstrap")))
    second = ubuntu.run("true", system=UBUNTU)
    output, errors = first.communicate(timeout=30)
    assert first.returncode == 0, errors
    assert second.stdout == output
    assert "waiting" in second.stderr
    assert len(ubuntu.called("mmdebstrap")) == 1


# ----- MPI


def test_more_ranks_than_cores(mpirun: Callable[..., str]) -> None:
    gather = "sums = c.gather(c.allreduce(c.rank)); c.rank or print(sums)"
    program = f"from mpi4py import MPI; c = MPI.COMM_WORLD; {gather}"
    ranks = (os.cpu_count() or 1) + 1
    assert mpirun(ranks, ["-c", program], timeout=120) == f"{[sum(range(ranks))] * ranks}\n"


def test_a_rank_that_hangs_fails_the_test(mpirun: Callable[..., str]) -> None:
    hang = "from mpi4py import MPI; c = MPI.COMM_WORLD; c.rank or c.barrier()"
    with pytest.raises(pytest.fail.Exception, match="no end within 5 s on 2 ranks"):
        mpirun(2, ["-c", hang], timeout=5)


def test_an_exit_code_of_a_rank_fails_the_test(mpirun: Callable[..., str]) -> None:
    with pytest.raises(pytest.fail.Exception, match="exit code 3 on 2 ranks"):
        mpirun(2, ["-c", "raise SystemExit(3)"])
