"""The container image of docker/ can be built from Debian 12 and run, by buildah, which needs no daemon."""

import os
import resource
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
pytestmark = [
    pytest.mark.alone,
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0, reason="a bare Debian is made by root alone"),
]
BUILD_MINUTES = 40
COMPOSED = yaml.safe_load((ROOT / "docker/compose.yaml").read_text())["services"]["hric"]
HOST = (
    "/etc/apt/apt.conf.d",
    "/etc/apt/auth.conf.d",
    "/etc/apt/sources.list.d",
    "/etc/pip.conf",
    "/usr/local/share/ca-certificates",
    "/etc/ssl/certs/ca-certificates.crt",
)
"""Configuration of package sources of this machine, such as a mirror, which the image build uses, too."""
ENTRYPOINT = ("/hric/docker/entrypoint",)
"""Entry point of the image, which `buildah run` does not execute."""
OWNER = 4711
"""User id other than root."""


class Store:
    """Images and containers of this test.

    Args:
        folder: folder for images, containers and the output of buildah.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._options = ("--root", str(folder / "store"), "--runroot", str(folder / "run"), "--storage-driver", "vfs")

    def __call__(self, *words: str, minutes: float = 5) -> str:
        """Run `buildah WORDS`, which must succeed, and return its output."""
        done = subprocess.run(
            ["buildah", *self._options, *words],
            cwd=self.folder,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=60 * minutes,
        )
        assert done.returncode == 0, f"buildah {' '.join(words)}:\n{done.stdout[-5000:]}"
        return done.stdout


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    folder = tmp_path_factory.mktemp("image")
    try:
        yield Store(folder)
    finally:
        shutil.rmtree(folder)


def bare_debian(store: Store) -> None:
    """Make an image like debian:bookworm of Docker's registry."""
    root = store.folder / "bare"
    words = ["debootstrap", "--variant=minbase", "bookworm", str(root)]
    subprocess.run(words, check=True, capture_output=True, timeout=900)
    for path in map(Path, HOST):
        if path.is_dir():
            shutil.copytree(path, root / path.relative_to("/"), dirs_exist_ok=True)
        elif path.exists():
            (root / path.relative_to("/")).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, root / path.relative_to("/"))
    container = store("from", "scratch").split()[-1]
    store("copy", container, str(root), "/")
    store("commit", "--rm", container, "bare")
    shutil.rmtree(root)


def clone(store: Store) -> Path:
    """Copy of the committed files, as a user would clone them."""
    folder = store.folder / "clone"
    subprocess.run(["git", "clone", "-q", str(ROOT), str(folder)], check=True)
    return folder


def limits_in_reach() -> dict[str, int]:
    """Return the resource limits of compose.yaml that this machine permits; the host of a container may permit less."""
    found = {}
    for name, value in COMPOSED["ulimits"].items():
        hard = resource.getrlimit(getattr(resource, f"RLIMIT_{name.upper()}"))[1]
        if hard == resource.RLIM_INFINITY or 0 <= value <= hard:
            found[name] = value
    return found


def started(store: Store, runs: Path) -> str:
    """Start a container with the rights given in compose.yaml, and return its name."""
    ulimits = [f"--ulimit={name}={value}:{value}" for name, value in limits_in_reach().items()]
    capabilities = [f"--cap-add={name}" for name in COMPOSED["cap_add"]]
    return store("from", *ulimits, *capabilities, f"--volume={runs}:/hric/runs", "hric").split()[-1]


def test_the_image_is_built_from_a_bare_debian_and_runs_an_experiment_as_the_owner_of_its_runs(
    store: Store, figure: Callable[[str, float, str], None]
) -> None:
    bare_debian(store)
    begin = time.monotonic()
    words = ("bud", "--isolation=chroot", "--layers=false", "--build-arg=BASE=localhost/bare")
    store(*words, "--file=docker/Dockerfile", "--tag=hric", str(clone(store)), minutes=BUILD_MINUTES)
    figure("image: time to build from a bare Debian", time.monotonic() - begin, "s")

    runs = store.folder / "runs"
    runs.mkdir()
    os.chown(runs, OWNER, OWNER)
    container = started(store, runs)
    mounted = store("mount", container).split()[-1]
    size = subprocess.run(["du", "-sm", mounted], check=True, capture_output=True, text=True).stdout.split()[0]
    figure("image: size", float(size), "MB")
    inside = ("run", "--isolation=chroot", container, "--", *ENTRYPOINT)
    if "rtprio" in limits_in_reach():
        store(*inside, "chrt", "-f", "20", "true")
    store(*inside, "scripts/bringup", "env:=sim", "rviz:=false", "experiment:=pd_step")
    run = (runs / "latest").resolve()
    assert yaml.safe_load((run / "run.yaml").read_text())["status"] == "completed"
    assert {path.stat().st_uid for path in [run, *run.rglob("*")]} == {OWNER}
