"""Verdict on a run, bag or c3d file: safety and ergonomics for the person in it, and signals that are missing.

verdict = assess(opened("latest"), AssessmentChoices(contact_area=2e-5))
verdict.outcome, verdict.findings[0], verdict.to_dict()
"""

from hric_assessment.findings import UnjudgedValue
from hric_assessment.verdict.assess import assess
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.inputs import opened
from hric_assessment.verdict.result import Verdict

__all__ = ["AssessmentChoices", "UnjudgedValue", "Verdict", "assess", "opened"]
