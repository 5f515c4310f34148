"""Assessment of a run's contacts as in its verdict, for sweeps and the benchmark. No ROS."""

import math
from dataclasses import replace
from pathlib import Path

from hric_assessment.findings import ENERGY, Finding, Outcome
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.conclusions import CONTACT, decisive
from hric_assessment.verdict.contacts import contact_findings
from hric_assessment.verdict.inputs import AssessmentInput
from hric_bags.parts import Bag
from hric_bags.records import recording
from hric_bags.run_file import RunFile

CONTACT_AREA = 1e-4
"""Contact area if neither the recording nor the user gives one [m^2]: 1 cm^2 (project default, unconfirmed; strict, as
the pressure limits of ISO/TS 15066 were measured with 1.96 cm^2)."""


def given_of(run: RunFile, bag: Bag, description: str) -> AssessmentInput:
    """Return the data of a run as input for its assessment.

    Args:
        run: contents of run.yaml.
        bag: bag of the run, on disk or in memory.
        description: URDF of the robot.
    """
    return AssessmentInput("a run", "run", Path(), recording.read(bag), run, description)


def findings(source: AssessmentInput) -> list[Finding]:
    """Return one finding (assessment result) on each contact; CONTACT_AREA replaces an unknown area.

    Force and energy of a contact are assessed separately; the finding is the worse of the two, with the values of both.
    """
    contacts = list[Finding]()
    for finding in contact_findings(source, AssessmentChoices(contact_area=CONTACT_AREA)):
        if finding.group == ENERGY:  # that of the contact before it
            finding = _worse(contacts.pop(), finding)
        contacts.append(finding)
    return contacts


def _worse(contact: Finding, energy: Finding) -> Finding:
    worst = decisive(CONTACT, [contact, energy])
    assert worst is not None
    return replace(worst, values={**contact.values, **energy.values})


def counted_share(finding: Finding) -> float:
    """Return the ratio to the limit by which runs are counted and compared [1].

    It is at most 1 only if the finding is within limits or a warning. It is infinite if the excess is not known:
    the contact is not permitted at all, or not assessable.
    """
    share = math.inf if finding.share is None else finding.share
    proven = finding.outcome in (Outcome.WITHIN, Outcome.WARNING)
    above = finding.outcome == Outcome.ABOVE and share > 1.0
    return share if proven or above else math.inf
