"""Each dependency in a package.xml resolves by rosdep without the network, to packages that scripts/setup installs."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def rosdep(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[str]]:
    home = tmp_path_factory.mktemp("rosdep")
    # Remove proxies, so that any network access fails.
    environment = {
        **os.environ,
        "HRIC_ROSDEP_HOME": str(home),
        "http_proxy": "http://127.0.0.1:9",
        "https_proxy": "http://127.0.0.1:9",
    }

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(ROOT / "rosdep/offline"), *arguments],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
        )

    update = run("update")
    assert update.returncode == 0, update.stderr
    return run


def wanted_packages() -> set[str]:
    return {
        line.strip()
        for line in (ROOT / "scripts/apt-packages.txt").read_text().splitlines()
        if line.strip() and not line.startswith("#")
    }


def test_rosdep_finds_a_rule_for_every_key(rosdep) -> None:
    result = rosdep("install", "--from-paths", "src", "--ignore-src", "-y", "--simulate", "--reinstall")
    assert result.returncode == 0, result.stdout + result.stderr


def test_rosdep_asks_for_nothing_that_the_setup_does_not_install(rosdep) -> None:
    keys = rosdep("keys", "--from-paths", "src", "--ignore-src").stdout.split()
    assert "rospy" in keys
    resolved = rosdep("resolve", *keys)
    assert resolved.returncode == 0, resolved.stderr
    needed = {name for line in resolved.stdout.splitlines() if not line.startswith("#") for name in line.split()}
    implied = needed - wanted_packages()
    # A key may name a package that is installed as a dependency of one in the list.
    installed = (
        subprocess.run(
            ["dpkg-query", "-W", "-f", "${Package} ${db:Status-Status}\n", *implied], capture_output=True, text=True
        ).stdout
        if implied
        else ""
    )
    assert {line.split()[0] for line in installed.splitlines() if line.endswith(" installed")} == implied


def test_a_key_that_only_pypi_has_resolves_to_nothing_to_install(rosdep) -> None:
    result = rosdep("resolve", "python3-xacro")
    assert result.returncode == 0
    assert result.stdout.replace("#apt", "").strip() == ""


def test_an_unknown_key_is_refused(rosdep) -> None:
    assert rosdep("resolve", "no_such_key").returncode != 0
