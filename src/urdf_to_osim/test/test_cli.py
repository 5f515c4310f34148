"""The command as a user meets it: exit codes, what it prints, what it leaves behind."""

import subprocess
import sys
from pathlib import Path

import pytest
from small_robots import LIMIT, joint, link, one_joint, robot

import panda_description
from hric_core.command import main

ROOT = Path(__file__).resolve().parents[3]
COMMAND = ROOT / "src" / "urdf_to_osim" / "nodes" / "urdf_to_osim"
XACRO = ROOT / "src" / "panda_description" / "urdf" / "panda.urdf.xacro"


def run(folder: Path, *words: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(COMMAND), *words],
        cwd=folder,
        input=stdin,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_it_prints_the_proof_and_the_times_and_leaves_model_and_meshes_only(tmp_path: Path) -> None:
    (tmp_path / "panda.urdf").write_text(panda_description.load())
    done = run(tmp_path, "panda.urdf", "-o", "panda.osim", "--states", "3")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for text in (
        "frames",
        "mass matrix",
        "gravity",
        "inverse dynamics",
        "stops",
        "mesh files",
        "proof over 3 random states",
        "wrote panda.osim",
    ):
        assert text in done.stdout
    assert names(tmp_path) == ["Geometry", "panda.osim", "panda.urdf"]
    assert all(path.suffix == ".obj" for path in (tmp_path / "Geometry").iterdir())


def test_a_refusal_is_one_line_and_exit_code_2_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_text(one_joint(child=""))
    done = run(tmp_path, "bad.urdf")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("hric convert: link arm: joint swing moves it") and done.stderr.count("\n") == 1
    assert names(tmp_path) == ["bad.urdf"]


def test_a_robot_that_cannot_move_is_refused_after_it_was_built_without_a_crash_at_exit(tmp_path: Path) -> None:
    urdf_xml = robot(
        link("a"), link("b", ""), link("c"), joint("first", "revolute", "a", "b"), joint("second", "revolute", "b", "c")
    )
    done = run(tmp_path, "-", "-o", "a.osim", stdin=urdf_xml)
    assert done.returncode == 2 and done.stderr.startswith("hric convert: joints first, second can move together")
    assert names(tmp_path) == []


def test_xacro_is_expanded_with_its_arguments(tmp_path: Path) -> None:
    words = [
        str(XACRO),
        "--xacro-arg",
        "hand:=false",
        "--xacro-arg",
        "arm_id:=left",
        "-o",
        str(tmp_path / "left.osim"),
        "--states",
        "2",
        "--no-meshes",
    ]
    assert main(["convert", *words]) == 0
    text = (tmp_path / "left.osim").read_text()
    assert "left_joint7" in text and "left_hand" not in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.urdf"], "no file none.urdf"),
        (["robot.urdf", "-o", "robot.xml"], "output robot.xml must be the name of a file that ends in .osim"),
        (["robot.urdf", "--xacro-arg", "a:=b"], "--xacro-arg needs an input that ends in .xacro"),
        ([str(XACRO), "--xacro-arg", "a=b"], "--xacro-arg 'a=b' is not of the form NAME:=VALUE"),
        (["robot.urdf", "--friction", "sigmoid"], "friction_parameters"),
        (["robot.urdf", "--friction-parameters", "none.yaml"], "none.yaml cannot be read: No such file"),
        (["robot.urdf", "--stop-stiffness", "0"], "stop_stiffness is 0.0"),
    ],
)
def test_a_mistake_on_the_command_line_is_one_clear_error(
    words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.urdf").write_text(one_joint())
    assert main(["convert", *words]) == 2
    assert message in capsys.readouterr().err
    assert names(tmp_path) == ["robot.urdf"]


def test_bytes_that_are_no_text_are_one_clear_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.urdf").write_bytes(b"\xff\xfe\x00robot")
    assert main(["convert", str(tmp_path / "a.urdf"), "-o", str(tmp_path / "a.osim")]) == 2
    assert "not XML" in capsys.readouterr().err


def test_a_description_in_another_encoding_is_read(tmp_path: Path) -> None:
    text = '<?xml version="1.0" encoding="iso-8859-1"?>' + robot(link("bätch"), name="gerät")
    (tmp_path / "a.urdf").write_bytes(text.encode("iso-8859-1"))
    assert main(["convert", str(tmp_path / "a.urdf"), "-o", str(tmp_path / "a.osim"), "--states", "2"]) == 0


def test_notes_on_repairs_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.urdf").write_text(one_joint(inside=LIMIT, child=""))
    assert (
        main(
            [
                "convert",
                str(tmp_path / "a.urdf"),
                "-o",
                str(tmp_path / "a.osim"),
                "--inertia",
                "invent",
                "--states",
                "2",
            ]
        )
        == 0
    )
    assert (
        "note: link arm: joint swing moves it, but it and what is fixed to it have no mass; it got 1e-05 kg"
        in capsys.readouterr().out
    )
