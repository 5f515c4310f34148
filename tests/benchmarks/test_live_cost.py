"""Check of the command that measures the control loop with a master: it runs, and all logged cycles arrive."""

import pytest
from live_cost import measure_loop, table


@pytest.mark.slow
def test_figures_of_the_loop_are_told_and_no_message_of_its_log_is_lost() -> None:
    (figures,) = measure_loop(2.0, 1)
    print(table([figures]))
    assert figures["/control_log, not heard [1]"] == 0.0
    assert figures["/control_log, latency, median [ms]"] > 19.0  # a message is stamped with the first of its 20 cycles
    assert figures["loop thread, CPU per cycle [us]"] > 0.0 and figures["real-time factor, unpaced [1]"] > 0.0
