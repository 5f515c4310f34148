"""Notes that are added to a run afterwards: stored beside the run, shown in its report and exports."""

import csv
import getpass
from pathlib import Path

import pytest
import synthetic
import yaml

from hric_bags import run_notes
from hric_bags.run_folder import RunFolder
from hric_core.command import main


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    return synthetic.write_run(tmp_path, 1000)


def note(run: RunFolder, *words: str) -> int:
    return main(["note", str(run.path), *words])


def test_a_note_is_signed_dated_and_changes_no_other_file(run: RunFolder) -> None:
    before = {path: path.read_bytes() for path in run.path.iterdir()}
    assert note(run, "tape came off: left elbow", "--at", "0.5", "--by", "A. Mustermann") == 0
    assert note(run, "all good") == 0
    first, second = run_notes.read(run.path)
    assert (first.text, first.by, first.at) == ("tape came off: left elbow", "A. Mustermann", 0.5)
    assert (second.text, second.by, second.at) == ("all good", getpass.getuser(), None)
    assert first.written <= second.written and first.written.endswith("Z")
    assert {path: path.read_bytes() for path in before} == before
    assert {path.name for path in run.path.iterdir()} - {path.name for path in before} == {"notes.yaml"}


def test_a_later_note_leaves_the_earlier_ones_byte_for_byte(run: RunFolder) -> None:
    note(run, "first")
    before = (run.path / "notes.yaml").read_bytes()
    note(run, "second: with a colon, 'quotes' and é")
    assert (run.path / "notes.yaml").read_bytes().startswith(before)
    assert [item.text for item in run_notes.read(run.path)] == ["first", "second: with a colon, 'quotes' and é"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["x", "--at", "1.5"], "--at 1.5: valid: robot times of the run, 0.000 to 0.999 s"),
        (["x", "--at", "nan"], "--at nan: valid: "),
        (["  "], "text of a note is '  '; valid: one line of text"),
        (["two\nlines"], "valid: one line of text"),
        (["two\u2028lines"], "valid: one line of text"),
        (["\x1b[31mred"], "valid: one line of text"),
        (["a byte of Latin-1: \udcfc"], "valid: one line of text"),
        (["x", "--by", ""], "--by of a note is ''"),
    ],
)
def test_a_note_that_cannot_be_is_refused(
    run: RunFolder, words: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert note(run, *words) == 2
    message = capsys.readouterr().err
    assert reason in message and message.count("\n") == 1
    assert not (run.path / "notes.yaml").exists()


@pytest.mark.parametrize(
    "content", ["text: x", "- {text: x}", "- 3", "- {text: 1, by: a, at: null, written: b}", "- ["]
)
def test_a_damaged_file_of_notes_is_refused_and_not_extended(
    run: RunFolder, content: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (run.path / "notes.yaml").write_text(content)
    assert note(run, "x") == 2
    assert "notes.yaml" in capsys.readouterr().err
    assert (run.path / "notes.yaml").read_text() == content


def test_a_note_is_added_after_a_last_line_without_end(run: RunFolder) -> None:
    (run.path / "notes.yaml").write_text("- {written: b, by: a, at: 1, text: by hand}")
    assert note(run, "x") == 0
    assert [item.text for item in run_notes.read(run.path)] == ["by hand", "x"]


@pytest.mark.parametrize(
    "content", ["[{written: b, by: a, at: null, text: t}]", "- {written: b, by: a, at: 1, text: t}\n..."]
)
def test_a_file_of_notes_that_cannot_be_extended_is_left_as_it_is(run: RunFolder, content: str) -> None:
    (run.path / "notes.yaml").write_text(content)
    assert note(run, "x") == 2
    assert (run.path / "notes.yaml").read_text() == content and len(run_notes.read(run.path)) == 1


def test_exports_have_the_notes_and_are_written_again_for_a_new_one(run: RunFolder) -> None:
    for words in (("first", "--at", "0.25"), ("second",)):
        note(run, *words)
        assert main(["export", str(run.path), "--format", "csv"]) == 0
    lines = [line for line in (run.path / "export/csv/added_notes.csv").read_text().splitlines() if line[0] != "#"]
    rows = list(csv.DictReader(lines))
    assert [(row["text"], row["time"], row["by"]) for row in rows] == [
        ("first", "0.25", getpass.getuser()),
        ("second", "nan", getpass.getuser()),
    ]


def test_an_anonymised_export_has_no_note(run: RunFolder) -> None:
    note(run, "Mr Mustermann was tired")
    assert main(["export", str(run.path), "--format", "csv", "--anonymise"]) == 0
    exported = [path for path in (run.path / "anonymised").rglob("*") if path.is_file()]
    assert exported and not any(b"Mustermann" in path.read_bytes() for path in exported)


def test_the_file_is_plain_yaml(run: RunFolder) -> None:
    note(run, "x", "--at", "0.1", "--by", "b")
    (entry,) = yaml.safe_load((run.path / "notes.yaml").read_text())
    assert list(entry) == ["written", "by", "at", "text"]
