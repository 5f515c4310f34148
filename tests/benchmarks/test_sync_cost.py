"""Check of the command that measures synchronisers: it runs, and skew and processor time are within limits."""

import pytest
import rospy
from real_master import ros, roscore
from sync_cost import measure, variants

__all__ = ["ros", "roscore"]
pytestmark = pytest.mark.alone
SHARE = 0.3
"""Largest share of a processor core per instance, with the data rates of a data collection."""
STAMPED = 2e-4
"""Largest skew of resampled values [s]."""
HALF_A_PERIOD = 0.5 / 240.0
"""Half of the period of the slowest source [s]."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(
    "variant", [one for one in variants() if one.form == "as recorded" and one.plan], ids=lambda one: one.name
)
def test_a_synchroniser_keeps_its_share_of_a_core_and_its_skew(ros: str, variant: object) -> None:
    result = measure(variant, 10.0)  # type: ignore[arg-type]
    print(result)
    assert rospy.get_name() and result.rate > 90
    assert result.skew <= (STAMPED if "resample" in result.name else HALF_A_PERIOD)
    assert result.cpu < SHARE
