"""Check whether this computer is fit for a 1 kHz control loop: kernel, governor, account limits, network.

The checks change nothing; with `--fix` the command changes settings that need no restart of the computer.
"""

import argparse
import os
import re
import resource
import statistics
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hric_core.command import Argument, Command
from hric_core.errors import NOT_GOOD

REQUIRED_PRIORITY = 80
"""Real-time priority that the robot node of a real arm uses by default."""
REQUIRED_MEMLOCK = 512 * 2**20
"""Required limit of locked memory [bytes]; project default, unconfirmed.

The robot process with all its libraries locks about a third of it.
"""
PINGS, INTERVAL = 200, 0.01
"""Number of pings, and the time between them [s]."""
ROUND_TRIP_LIMIT = 0.3
"""Maximum round-trip time of a ping to the arm [ms].

Franka requires network round trip, computation and the arm's own processing within 1 ms; about this is left for the
network.
"""
LIMITS_FILE = Path("/etc/security/limits.d/90-franka-real.conf")
LIMITS_TEXT = f"@realtime - rtprio 98\n@realtime - memlock {REQUIRED_MEMLOCK // 1024}\n"


@dataclass(frozen=True)
class WorkstationFinding:
    """Result of one check.

    Attributes:
        what: name of the check.
        good: True if the result is fit for a 1 kHz loop; None: unknown.
        result: text for the report.
        advice: how to correct the setting; empty if it is good.
        fix: function that corrects the setting and returns a text about it; None: cannot be corrected while running.
    """

    what: str
    good: bool | None
    result: str
    advice: str = ""
    fix: Callable[[], str] | None = None


def kernel(root: Path = Path("/")) -> WorkstationFinding:
    """Check if the kernel is fully preemptible."""
    release = os.uname().release
    if _read(root / "sys/kernel/realtime") == "1" or "PREEMPT_RT" in os.uname().version:
        return WorkstationFinding("kernel", True, f"{release}, PREEMPT_RT")
    model = re.search(r"\bPREEMPT(?:_DYNAMIC)?\b", os.uname().version)
    result = f"{release}, {model.group() if model else 'preemption not known'}"
    return WorkstationFinding(
        "kernel",
        False,
        result,
        "install a PREEMPT_RT kernel (Debian: linux-image-rt-amd64); without it, some cycles are up to 10 ms late",
    )


def governor(root: Path = Path("/")) -> WorkstationFinding:
    """Check if the processors run at a constant frequency."""
    files = sorted(root.glob("sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor"))
    if not files:
        return WorkstationFinding(
            "governor", None, "this system does not control the frequency of its processors (a virtual machine?)"
        )
    others = {_read(file) for file in files} - {"performance"}
    if not others:
        return WorkstationFinding("governor", True, f"performance on {len(files)} processors")

    def fix() -> str:
        for file in files:
            file.write_text("performance")
        return f"performance on {len(files)} processors, until the next start"

    return WorkstationFinding(
        "governor",
        False,
        f"{', '.join(sorted(others))}",
        "set the governor performance: cpupower frequency-set -g performance",
        fix,
    )


def priority() -> WorkstationFinding:
    """Check if this account may take a real-time priority."""
    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    if os.geteuid() == 0 or soft == resource.RLIM_INFINITY or soft >= REQUIRED_PRIORITY:
        return WorkstationFinding("rtprio", True, "root" if os.geteuid() == 0 else f"up to {soft}")
    advice = f"allow {REQUIRED_PRIORITY} or more to the group realtime and join it: {_limits_advice()}"
    return WorkstationFinding("rtprio", False, f"up to {soft}", advice, _fix_limits)


def memlock() -> WorkstationFinding:
    """Check if this account may lock its memory."""
    soft, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if os.geteuid() == 0 or soft == resource.RLIM_INFINITY or soft >= REQUIRED_MEMLOCK:
        return WorkstationFinding("memlock", True, "root" if os.geteuid() == 0 else f"{soft // 2**20} MiB")
    return WorkstationFinding(
        "memlock",
        False,
        f"{soft // 1024} KiB",
        f"allow {REQUIRED_MEMLOCK // 2**20} MiB: {_limits_advice()}",
        _fix_limits,
    )


def throttling(root: Path = Path("/")) -> WorkstationFinding:
    """Check which share of each second real-time threads may use the processor."""
    value = _read(root / "proc/sys/kernel/sched_rt_runtime_us")
    return WorkstationFinding(
        "real-time share", None if not value else True, f"{value or 'unknown'} us of each second (-1: all)"
    )


def network(address: str) -> WorkstationFinding:
    """Check the round-trip time to the arm with many pings; the slowest one decides."""
    command = ["ping", "-n", "-c", str(PINGS), "-i", str(INTERVAL), "-W", "1", address]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=30.0)
    except FileNotFoundError:
        return WorkstationFinding("network", None, "ping is not installed", "install iputils-ping")
    except subprocess.TimeoutExpired:
        return WorkstationFinding(
            "network", False, f"no response from {address}", "check address, cable, and the control box"
        )
    times = sorted(float(value) for value in re.findall(r"time=([\d.]+) ms", done.stdout))
    if not times:
        return WorkstationFinding(
            "network", False, f"no response from {address}", "check address, cable, and the control box"
        )
    spread = statistics.pstdev(times)
    result = (
        f"{address}: {len(times)} of {PINGS} pings answered, median {statistics.median(times):.3f} ms, maximum "
        f"{times[-1]:.3f} ms, standard deviation {spread:.3f} ms"
    )
    good = len(times) == PINGS and times[-1] <= ROUND_TRIP_LIMIT
    advice = (
        ""
        if good
        else f"all pings must be answered within {ROUND_TRIP_LIMIT} ms: connect the arm directly by a cable without "
        "a switch, and turn off power saving"
    )
    return WorkstationFinding("network", good, result, advice)


def look(address: str = "") -> Iterator[WorkstationFinding]:
    """Run all checks and yield their results one by one; address: that of the arm, empty: no network check."""
    yield kernel()
    yield governor()
    yield priority()
    yield memlock()
    yield throttling()
    if address:
        yield network(address)


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="ascii").strip()
    except OSError:
        return ""


def _limits_advice() -> str:
    return f"{LIMITS_FILE} with {' and '.join(LIMITS_TEXT.strip().splitlines())!r}, then log in again"


def _fix_limits() -> str:
    LIMITS_FILE.write_text(LIMITS_TEXT, encoding="ascii")
    return f"wrote {LIMITS_FILE}; add your account to the group realtime and log in again"


_MARK = {True: "ok  ", False: "BAD ", None: "?   "}


def line(finding: WorkstationFinding) -> str:
    """Return the result of one check as a text of one or two lines."""
    return f"{_MARK[finding.good]} {finding.what}: {finding.result}" + (
        f"\n       {finding.advice}" if finding.advice else ""
    )


class CheckWorkstationCommand(Command):
    """Check whether this computer is fit for a 1 kHz control loop: kernel, processor frequency, limits, network.

    Changes nothing unless --fix is given.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument(
                "robot_ip",
                nargs="?",
                default="",
                help="address of the arm, for the network check; the arm is only pinged",
            ),
            Argument(
                "--fix",
                action="store_true",
                help="correct the settings that need no restart of the computer (governor, limits file); needs root",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Run and print all checks, and with --fix correct settings; return 0 if no check fails."""
        findings = []
        for finding in look(arguments.robot_ip):
            print(line(finding), flush=True)
            findings.append(finding)
        if arguments.fix:
            _fix(findings)
        return 0 if all(finding.good is not False for finding in findings) else NOT_GOOD


def _fix(findings: Sequence[WorkstationFinding]) -> None:
    for fix in dict.fromkeys(finding.fix for finding in findings if finding.good is False and finding.fix is not None):
        try:
            print(f"fixed: {fix()}")
        except OSError as error:
            print(f"could not correct this setting: {error}; --fix needs root")
