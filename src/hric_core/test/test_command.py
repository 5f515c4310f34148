"""The program hric: commands of packages by their names, lazily, with one help and one set of exit codes."""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path
from statistics import median

import pytest

from hric_core import plugins
from hric_core.command import EXIT_CODES, main, perform
from hric_core.errors import UnknownNameError
from hric_core.processes import INTERRUPTED_CODE

PROGRAM = Path(__file__).parents[1] / "nodes/hric"
SOURCE = Path(__file__).parents[3]
RATIO = 4.0
"""Processor time of `hric --help` over that of an empty program of Python, at most; measured: 1.6."""
TOY = """
import os, signal
from tempfile import NamedTemporaryFile
from hric_core.command import Argument, Command
from hric_core.errors import FailureError

class Toy(Command):
    '''Play with numbers.'''
    is_node = True

    def arguments(self):
        return [Argument("numbers", nargs="*", type=float), Argument("--fail", action="store_true", group="faults"),
                Argument("--wait", action="store_true")]

    def run(self, given):
        if given.fail:
            raise FailureError("broken")
        if given.wait:
            with NamedTemporaryFile(dir=".", prefix=".half_"):
                os.kill(os.getpid(), signal.SIGTERM)
        print(sum(given.numbers), given.command)

class ToyBox(Command):
    '''Put the toy into its box.'''
    def run(self, given):
        return 3
"""


@pytest.fixture
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Package outside the workspace that exports commands."""
    package = tmp_path / "toys"
    package.mkdir()
    (package / "toys_module.py").write_text(TOY)
    (package / "package.xml").write_text(
        '<package><name>toys</name><export><hric_core plugin="${prefix}/plugins.xml"/></export></package>'
    )
    classes = "".join(
        f'<class name="{name}" type="toys_module:{kind}" base_class_type="hric_core::Command"/>'
        for name, kind in (("toy", "Toy"), ("toy box", "ToyBox"))
    )
    (package / "plugins.xml").write_text(f"<library>{classes}</library>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}:{SOURCE}")
    monkeypatch.syspath_prepend(str(package))
    plugins.clear_cache()
    yield package
    sys.modules.pop("toys_module", None)
    plugins.clear_cache()


def test_a_package_outside_the_workspace_adds_a_command(toys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["toy", "1", "--", "-1e-3"]) == 0 and main(["--help"]) == 0
    first, _, *others = capsys.readouterr().out.splitlines()
    assert first == "0.999 hric toy 1 -- -1e-3" and any(line.split()[:1] == ["toy"] for line in others)


def test_the_version_is_that_of_the_packages(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    version = (PROGRAM.parents[1] / "package.xml").read_text().split("<version>")[1].split("<")[0]
    assert capsys.readouterr().out == f"hric {version}\n"


def test_a_command_of_two_words_goes_before_one_of_its_first(toys: Path) -> None:
    assert perform(["toy", "box"]) == 3


def test_a_node_leaves_remappings_to_ros(toys: Path) -> None:
    assert perform(["toy", "__name:=a", "/tf:=/tf2", "2"]) == 0


def test_an_error_is_one_line_with_its_exit_code(toys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["toy", "--fail"]) == 1
    assert capsys.readouterr().err == "hric toy: broken\n"


def test_sigterm_ends_a_command_like_ctrl_c_without_temporary_files(
    toys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGTERM)
    try:
        assert main(["toy", "--wait"]) == INTERRUPTED_CODE and not list(tmp_path.glob(".half_*"))
    finally:
        signal.signal(signal.SIGTERM, before)


def test_the_help_of_a_command_has_its_full_name(toys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["toy", "--help"])
    printed = capsys.readouterr().out
    assert printed.startswith("usage: hric toy [-h]") and "Play with numbers." in printed and "faults:" in printed


def test_an_unknown_command_is_refused_with_the_valid_names() -> None:
    with pytest.raises(UnknownNameError, match=r"no command 'healt'; valid: .*did you mean health\?"):
        perform(["healt"])


def test_the_help_lists_every_command_and_the_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    infos = plugins.names(plugins.COMMAND).values()
    assert EXIT_CODES in printed and all(info.description and info.description in printed for info in infos)


def processor_time(*words: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True, timeout=60.0)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_the_help_costs_little_more_than_starting_python() -> None:
    pairs = [(processor_time("-c", "pass"), processor_time(str(PROGRAM), "--help")) for _ in range(5)]
    bare, shown = (median(times) for times in zip(*pairs, strict=True))
    assert shown < RATIO * bare


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("hric spe", "speed_map"),
        ("hric run pd", "pd_step"),
        ("hric run pd_step --no", "--no-figures"),
        ("hric sweep rerun x --ru", "--runs"),
    ],
)
def test_the_shell_completes(line: str, offered: str, tmp_path: Path) -> None:
    """Call the completion as argcomplete's shell function does; the words come on file descriptor 8."""
    with (tmp_path / "offered").open("wb") as output:
        subprocess.run(
            ["bash", "-c", f"exec {sys.executable} {PROGRAM} 8>&{output.fileno()} 9>/dev/null"],
            env={
                **os.environ,
                **{"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9"},
                **{"_ARGCOMPLETE_COMP_WORDBREAKS": " \n", "_ARGCOMPLETE_IFS": "\013"},
            },
            pass_fds=[output.fileno()],
            stdout=subprocess.DEVNULL,
            timeout=60.0,
        )
    assert (tmp_path / "offered").read_text().strip() == offered
