"""scripts/setup refuses unsupported systems, reports what is missing, and is fast if nothing is missing."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def setup(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(ROOT / "scripts/setup"), *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_a_complete_setup_is_quick_and_silent() -> None:
    before = os.times()
    result = setup()
    after = os.times()
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert after.children_user + after.children_system - before.children_user - before.children_system < 2.0


def test_check_says_that_nothing_is_missing() -> None:
    result = setup("--check")
    assert (result.returncode, result.stdout) == (0, "nothing is missing\n")


def test_a_short_wait_for_another_call_is_silent() -> None:
    holder = subprocess.Popen(["flock", "scripts", "sh", "-c", "echo; sleep 1"], cwd=ROOT, stdout=subprocess.PIPE)
    assert holder.stdout is not None and holder.stdout.readline() == b"\n"
    assert setup("--check").stdout == "nothing is missing\n"
    assert holder.wait() == 0


@pytest.mark.parametrize(
    "system",
    [
        'PRETTY_NAME="Ubuntu 20.04.6 LTS"\nVERSION_CODENAME=focal\n',
        'PRETTY_NAME="Debian 11"\nVERSION_CODENAME=bullseye\n',
        "ID=arch\n",
    ],
)
def test_another_system_is_sent_to_docker(tmp_path: Path, system: str) -> None:
    release = tmp_path / "os-release"
    release.write_text(system)
    result = setup(HRIC_OS_RELEASE=str(release))
    assert result.returncode == 1
    assert "Debian 12 (bookworm) or 13 (trixie)" in result.stderr
    assert "docker compose -f docker/compose.yaml up" in result.stderr


def test_a_derivative_of_debian_12_is_accepted(tmp_path: Path) -> None:
    release = tmp_path / "os-release"
    release.write_text('PRETTY_NAME="LMDE 6 (faye)"\nID=linuxmint\nVERSION_CODENAME=faye\nDEBIAN_CODENAME=bookworm\n')
    assert setup("--check", HRIC_OS_RELEASE=str(release)).returncode == 0


def test_debian_13_is_accepted(tmp_path: Path) -> None:
    release = tmp_path / "os-release"
    release.write_text('PRETTY_NAME="Debian GNU/Linux 13 (trixie)"\nID=debian\nVERSION_CODENAME=trixie\n')
    assert setup("--check", HRIC_OS_RELEASE=str(release)).returncode == 0


def test_an_unknown_option_is_refused() -> None:
    result = setup("--fast")
    assert result.returncode == 2
    assert "--fast" in result.stderr and "--no-gui" in result.stderr


def test_ctrl_c_ends_a_step(tmp_path: Path) -> None:
    lines = (
        f"ws={tmp_path}; cd $ws; . {ROOT}/scripts/lib/setup_steps.bash",
        "begun() { bash -c 'echo $$ > worker; exec sleep 60'; }",
        "step Waiting waiting none 60 begun",
    )
    process = subprocess.Popen(["bash", "-c", "\n".join(lines)], stderr=subprocess.PIPE, text=True)
    worker = tmp_path / "worker"
    deadline = time.monotonic() + 30.0
    while not (worker.is_file() and worker.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    told = process.communicate(timeout=30)[1]
    assert process.returncode == 130 and "stopped by Ctrl-C; call it again to continue" in told
    assert not Path(f"/proc/{worker.read_text().strip()}").exists()


def test_an_exceeded_estimate_is_no_longer_printed(tmp_path: Path) -> None:
    lines = (
        f"ws={tmp_path}; cd $ws; . {ROOT}/scripts/lib/setup_steps.bash",
        "sleep() { :; }; kill() { [ $((SECONDS += 1)) -lt 300 ]; }",  # only checks count
        "unset SECONDS; SECONDS=0; show_progress 1 log none 0 150",
    )
    done = subprocess.run(["bash", "-c", "\n".join(lines)], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines() == ["      0 %  100 s of about 150 s on an idle machine", "      0 %  200 s"]


def test_a_new_environment_has_no_old_packages(tmp_path: Path) -> None:
    lines = (
        f"ws={tmp_path}; cd $ws; . {ROOT}/scripts/lib/setup_steps.bash",
        "stamp python-run 1; stamp python-checks 2; stamp build 3",
        "step() { kill -9 $$; }",
        "install_python",
    )
    done = subprocess.run(["bash", "-c", "\n".join(lines)], timeout=60, check=False)
    assert done.returncode == -signal.SIGKILL
    assert (tmp_path / ".setup-stamp").read_text().split() == ["build", "3"]


def test_a_python_package_needs_no_build(tmp_path: Path) -> None:
    own = ROOT / "src" / "test_setup_own_package"
    shutil.copytree(ROOT / "src/hric_controllers/templates/my_controller", own)
    try:
        (own / "setup.py").write_text("")
        assert setup("--check").stdout == "nothing is missing\n"
    finally:
        shutil.rmtree(own)
    assert setup("--check").stdout == "nothing is missing\n"


def test_an_interrupted_installation_is_repeated(tmp_path: Path) -> None:
    sys.path.insert(0, str(ROOT / "scripts/lib"))
    import mend_venv

    for name, content in (("whole", "1234"), ("cut", "12"), ("lost", None)):
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        if content is not None:
            (tmp_path / f"{name}.py").write_text(content)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "RECORD").write_text(f"{name}.py,,4\n{name}.pyc,,9\n")
    (tmp_path / "begun-1.0.dist-info").mkdir()
    mend_venv.mend(tmp_path)
    assert sorted(path.name for path in tmp_path.glob("*.dist-info")) == ["whole-1.0.dist-info"]


def test_another_python_and_home_change_nothing(tmp_path: Path) -> None:
    (tmp_path / "python3").write_text("#!/bin/sh\nexit 99\n")
    (tmp_path / "python3").chmod(0o755)
    result = setup("--check", PATH=f"{tmp_path}:{os.environ['PATH']}", HOME="/nonexistent")
    assert (result.returncode, result.stdout) == (0, "nothing is missing\n")


def test_the_environment_has_pinned_packages() -> None:
    pins = dict(line.split("==") for line in (ROOT / "scripts/requirements.txt").read_text().split() if "==" in line)
    code = "import sys, numpy, em; print(numpy.__version__, em.__version__, sys.base_prefix)"
    found = subprocess.run(
        [str(ROOT / ".venv/bin/python3"), "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert found[0] == pins["numpy"]
    assert found[1].startswith("3.")
    assert found[2] == "/usr"


def test_every_requirement_is_pinned_exactly() -> None:
    files = sorted((ROOT / "scripts").glob("requirements*.txt"))
    lines = [
        line.strip()
        for path in files
        for line in path.read_text().splitlines()
        if line.strip() and not line.startswith("#")
    ]
    assert len(files) > 2 and all(line.count("==") == 1 for line in lines)


def test_packages_without_a_wheel_for_debian_13_are_pinned_for_debian_12_alone() -> None:
    files = (ROOT / "scripts/locked").glob("*.txt")
    marked = [line.partition(" ;") for path in files for line in path.read_text().splitlines() if " ;" in line]
    assert {(name.partition("==")[0], marker.strip(" \\")) for name, _, marker in marked} == {
        ("pybullet", "python_full_version < '3.13'"),
        ("pylibfranka", "python_full_version < '3.13'"),
        ("torch", "python_full_version < '3.13'"),
    }


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("type -t roscd; COMP_LINE='scripts/bringup env:=r' COMP_POINT=22; _hric_complete", "function\nreal\n"),
        (
            "command -v hric; COMP_LINE='hric spe' COMP_POINT=8 COMP_TYPE=9; _python_argcomplete hric",
            f"{ROOT}/devel/bin/hric\nspeed_map\n",
        ),
    ],
    ids=["scripts/bringup", "hric"],
)
def test_shell_has_commands_and_completion(typed: str, offered: str) -> None:
    done = subprocess.run(
        ["bash", "--norc", "-ic", f"source scripts/env; {typed}; echo ${{COMPREPLY[@]}}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        start_new_session=True,
    )
    assert done.stdout.endswith(offered), done.stderr
