"""Terminals for the test of the manual: they behave like a reader's, and differences from a page are reported."""

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from manual_page import steps
from manual_run import PageRun, StepError
from manual_terminals import MARK, Terminal, TerminalError, end_marked, has_words, marked

PATIENCE = 10.0


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    shell = Terminal(tmp_path / "blocks", tmp_path, {"PATH": os.environ["PATH"], MARK: str(tmp_path)})
    yield shell
    shell.close()
    end_marked(str(tmp_path))


def run(terminal: Terminal, commands: str) -> tuple[int, str]:
    terminal.start(commands)
    return terminal.wait(PATIENCE), terminal.output.strip()


def test_a_shell_lasts_with_its_variables_functions_and_folder(terminal: Terminal) -> None:
    run(terminal, "cd /usr; name=arm; hello() { echo hello $1; }")
    assert run(terminal, "pwd; hello $name") == (0, "/usr\nhello arm")


def test_commands_end_at_the_first_that_fails_and_it_is_named(terminal: Terminal) -> None:
    assert run(terminal, "(exit 3)\necho never") == (3, "manual: exit code 3: ( exit 3 )")


def test_a_failure_that_the_page_expects_does_not_end_the_commands(terminal: Terminal) -> None:
    assert run(terminal, '(exit 4) || echo "exit code $?"\necho on') == (0, "exit code 4\non")


def test_a_sourced_file_may_have_commands_that_fail(terminal: Terminal, tmp_path: Path) -> None:
    (tmp_path / "env").write_text("false\nhere=yes\n")
    assert run(terminal, "source ./env\necho $here") == (0, "yes")


def test_ctrl_c_reaches_what_runs_and_not_the_shell(terminal: Terminal) -> None:
    terminal.start('python3 -c \'import time; print("u" + "p", flush=True); time.sleep(60)\'')
    terminal.wait_until(lambda output: "up" in output, PATIENCE, "up")
    terminal.interrupt()
    assert terminal.wait(PATIENCE) != 0
    assert run(terminal, "echo alive") == (0, "alive")


def test_commands_that_take_too_long_are_an_error_with_their_output(terminal: Terminal) -> None:
    terminal.start("echo began; sleep 60")
    with pytest.raises(TerminalError, match=r"still running after 0.5 s\nbegan"):
        terminal.wait(0.5)


def test_processes_of_a_page_are_found_and_ended_by_their_pids(terminal: Terminal, tmp_path: Path) -> None:
    run(terminal, "setsid sleep 61 &")
    deadline = time.monotonic() + PATIENCE
    while "sleep 61" not in marked(str(tmp_path)).values():  # the shell does not wait for what it starts
        assert time.monotonic() < deadline
    end_marked(str(tmp_path), patience=0.5)
    assert "sleep 61" not in marked(str(tmp_path)).values()


def test_expected_lines_are_found_whatever_the_spaces_and_three_dots_stand_for_anything() -> None:
    output = "run   folder:\n /tmp/runs/a_1\n"
    assert has_words(output, ["run folder: ...runs/a_...", "folder: /tmp"]) == []
    assert has_words(output, ["run folder", "exit code 1"]) == ["exit code 1"]


PAGE = """
```bash
mkdir -p here
```

```yaml title="here/a.yaml"
a: 1
```

<!-- terminal 2, stays -->
```bash
trap 'echo ending' INT; echo it runs; cat
```

```text
it runs
```

```bash
cat here/a.yaml
```

```text
a: 1
```

<!-- Ctrl-C in terminal 2 -->

```python
from pathlib import Path

for line in Path("here/a.yaml").read_text().splitlines():

    print("read", line)
```

```text
read a: 1
```

```python
print(line.upper())
```

```text
A: 1
```
"""


def page_run(folder: Path) -> PageRun:
    return PageRun(folder, folder, {"PATH": os.environ["PATH"]}, set_up="true")


def test_a_page_is_taken_step_by_step(tmp_path: Path) -> None:
    page_run(tmp_path).run(steps(PAGE))


STARTED = """
<!-- stays -->
```bash
scripts/bringup env:=sim
```

<!-- terminal 2 -->
```bash
ls up
```
"""


def bringup(folder: Path, script: str) -> None:
    """Replacement for the real program."""
    (folder / "scripts").mkdir()
    (folder / "scripts/bringup").write_text(f"#!/bin/bash\necho starting\n{script}\n")
    (folder / "scripts/bringup").chmod(0o755)


def test_a_bring_up_is_waited_for_until_it_says_that_it_is_ready(tmp_path: Path) -> None:
    bringup(tmp_path, "sleep 1; touch up; printf '  ready     arm\\n'; exec sleep 60")
    page_run(tmp_path).run(steps(STARTED))


def test_a_bring_up_that_ends_before_it_is_ready_is_an_error_with_what_it_said(tmp_path: Path) -> None:
    bringup(tmp_path, "echo no arm at this address; exit 1")
    with pytest.raises(StepError, match=r"(?s)line 3: the commands ended before: the block.*no arm at this address"):
        page_run(tmp_path).run(steps(STARTED))


def test_another_program_that_stays_is_waited_for_until_it_is_quiet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("manual_run.QUIET", 1.0)
    program = "for i in 1 2 3; do echo $i; sleep 0.3; done; touch up; exec sleep 60"
    page_run(tmp_path).run(steps(STARTED.replace("scripts/bringup env:=sim", f"bash -c '{program}'")))


def test_a_page_has_its_time_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("manual_run.PAGE", 0.5)
    with pytest.raises(StepError, match="still running after"):
        page_run(tmp_path).run(steps("```bash\nsleep 60\n```\n"))


@pytest.mark.parametrize(
    ("changed", "into", "reason"),
    [
        ("cat here/a.yaml", "cat here/b.yaml", r"(?s)line 19: exit code 1.*--- terminal 1.*No such file"),
        ("```text\na: 1", "```text\nb: 2", "line 19: the output lacks: b: 2"),
        ("read a: 1", "read b: 2", "line 29: the output lacks: read b: 2"),
        ("line.upper()", "nobody.upper()", r"(?s)line 41: the statements failed.*NameError"),
        ("echo it runs; cat", "echo it runs", "line 27: what should stay in terminal 2 has ended by itself"),
        ('title="here/a.yaml"', 'title="../../a.yaml"', "a page writes below the workspace only"),
        ("mkdir -p here", "mkdir -p here; setsid sleep 62 &", "these did not end by themselves: sleep 62"),
    ],
)
def test_a_step_that_does_not_do_what_the_page_says_is_named_with_the_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str, into: str, reason: str
) -> None:
    monkeypatch.setattr("manual_run.PRINTED", 0.5)
    assert changed in PAGE
    with pytest.raises(StepError, match=reason):
        page_run(tmp_path).run(steps(PAGE.replace(changed, into)))
