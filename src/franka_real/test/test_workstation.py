"""The check of this machine reads and reports its settings; only with --fix it changes them."""

import resource
from pathlib import Path

import pytest

from franka_real import workstation
from franka_real.workstation import WorkstationFinding
from hric_core.command import perform


def processors(root: Path, *governors: str) -> list[Path]:
    files = []
    for i, governor in enumerate(governors):
        folder = root / f"sys/devices/system/cpu/cpu{i}/cpufreq"
        folder.mkdir(parents=True)
        files.append(folder / "scaling_governor")
        files[-1].write_text(governor + "\n")
    return files


def test_a_governor_that_saves_power_is_found_and_only_the_fix_changes_it(tmp_path) -> None:
    files = processors(tmp_path, "performance", "powersave")
    finding = workstation.governor(tmp_path)
    assert finding.good is False and "powersave" in finding.result and "performance" in finding.advice
    assert [file.read_text().strip() for file in files] == ["performance", "powersave"]
    assert finding.fix is not None
    finding.fix()
    assert workstation.governor(tmp_path).good is True


def test_a_machine_that_does_not_report_is_no_fault(tmp_path) -> None:
    assert workstation.governor(tmp_path).good is None
    assert workstation.throttling(tmp_path).good is None


def test_a_real_time_kernel_is_known_by_its_file(tmp_path) -> None:
    (tmp_path / "sys/kernel").mkdir(parents=True)
    (tmp_path / "sys/kernel/realtime").write_text("1\n")
    assert workstation.kernel(tmp_path).good is True


def test_limits_that_are_too_low_are_found(monkeypatch) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    monkeypatch.setattr(
        resource, "getrlimit", lambda kind: (0, 0) if kind == resource.RLIMIT_RTPRIO else (8 * 2**20, 8 * 2**20)
    )
    for finding in (workstation.priority(), workstation.memlock()):
        assert finding.good is False and "limits.d" in finding.advice


def test_it_prints_each_finding_and_returns_whether_all_is_well(monkeypatch, capsys) -> None:
    called = []
    bad = WorkstationFinding("governor", False, "powersave", "set performance", lambda: called.append(1) or "done")
    monkeypatch.setattr(workstation, "look", lambda address: iter([WorkstationFinding("kernel", True, "rt"), bad]))
    assert perform(["check_workstation"]) == 3
    assert called == []
    assert capsys.readouterr().out.splitlines() == [
        "ok   kernel: rt",
        "BAD  governor: powersave",
        "       set performance",
    ]
    assert perform(["check_workstation", "--fix"]) == 3
    assert called == [1] and "fixed: done" in capsys.readouterr().out


@pytest.mark.parametrize("answered", [True, False])
def test_the_network_is_judged_by_its_slowest_ping(monkeypatch, answered) -> None:
    times = [0.9] + [0.1] * (workstation.PINGS - 1) if answered else []
    lines = "".join(f"64 bytes from 10.0.0.1: icmp_seq={i} ttl=64 time={time} ms\n" for i, time in enumerate(times))
    monkeypatch.setattr(workstation.subprocess, "run", lambda *args, **kwargs: type("Done", (), {"stdout": lines})())
    finding = workstation.network("10.0.0.1")
    assert finding.good is False
    assert ("maximum 0.900 ms" if answered else "no response") in finding.result
