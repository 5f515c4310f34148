"""Verdict on a run, bag or c3d file for the person in it: findings, figures, and missing signals.

verdict = assess(opened("latest"), Choices())
verdict.outcome, verdict.findings[0], verdict.to_dict()
"""

from hric_assessment.verdict.assess import assess
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.given import opened
from hric_assessment.verdict.result import Figure, Verdict

__all__ = ["Choices", "Figure", "Verdict", "assess", "opened"]
