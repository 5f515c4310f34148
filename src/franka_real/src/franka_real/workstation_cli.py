"""Command line of the workstation check."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from franka_real import workstation
from franka_real.workstation import Finding

_MARK = {True: "ok  ", False: "BAD ", None: "?   "}


def line(finding: Finding) -> str:
    """One finding as text."""
    return f"{_MARK[finding.good]} {finding.what}: {finding.found}" + (f"\n       {finding.advice}" if finding.advice else "")


def main(arguments: Sequence[str]) -> int:
    """Look, tell, and with --fix change what can be changed; answers 0 when all is well."""
    parser = argparse.ArgumentParser(
        "rosrun franka_real check_workstation",
        description="Look whether this machine serves a 1 kHz loop: kernel, processor frequency, limits of this account, network. Changes nothing.",
    )
    parser.add_argument("robot_ip", nargs="?", default="", help="address of the arm, for the network check; the arm is only pinged")
    parser.add_argument("--fix", action="store_true", help="change what can be changed at run time (governor, limits file); needs root")
    given = parser.parse_args(list(arguments))
    findings = []
    for finding in workstation.look(given.robot_ip):
        print(line(finding), flush=True)
        findings.append(finding)
    if given.fix:
        _fix(findings)
    return 0 if all(finding.good is not False for finding in findings) else 1


def _fix(findings: Sequence[Finding]) -> None:
    for fix in dict.fromkeys(finding.fix for finding in findings if finding.good is False and finding.fix is not None):
        try:
            print(f"fixed: {fix()}")
        except OSError as error:
            print(f"not fixed: {error}")
