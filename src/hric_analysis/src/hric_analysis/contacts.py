"""Contacts of a run as the verdict judges them, for sweeps, benchmark and approaches. No ROS."""

import math
from pathlib import Path

from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.contacts import contact_findings
from hric_assessment.verdict.inputs import AssessmentInput
from hric_bags.parts import Bag
from hric_bags.records import recording
from hric_bags.run_file import RunFile

CONTACT_AREA = 1e-4
"""Contact area if neither the recording nor the user gives it: a square centimetre [m^2] (project default, unconfirmed;
pressures of ISO/TS 15066 were measured with 1.96 cm^2, so it is on the strict side)."""


def given_of(run: RunFile, bag: Bag, description: str) -> AssessmentInput:
    """Read a run for the verdict.

    Args:
        run: contents of run.yaml.
        bag: bag of the run, on disk or in memory.
        description: URDF of the robot.
    """
    return AssessmentInput("a run", "run", Path(), recording.read(bag), run, description)


def findings(source: AssessmentInput) -> list[Finding]:
    """Return the verdict's findings of all contacts; CONTACT_AREA replaces an unknown area."""
    return contact_findings(source, AssessmentChoices(contact_area=CONTACT_AREA))


def counted_share(finding: Finding) -> float:
    """Return the share of the limit by which runs are counted and compared [1].

    It is at most 1 only for a finding within limits or a warning. It is infinite if the excess is unknown: the contact
    is not permitted at all, or not assessable.
    """
    share = math.inf if finding.share is None else finding.share
    proven = finding.outcome in (Outcome.WITHIN, Outcome.WARNING)
    above = finding.outcome == Outcome.ABOVE and share > 1.0
    return share if proven or above else math.inf
