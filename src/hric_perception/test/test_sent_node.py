"""Emulated devices publish how many samples they have sent, and the driver publishes exactly these."""

import numpy as np
import pytest
from real_master import ros, roscore
from sensor_nodes import Nodes, TellsTime, nodes, run, wait
from sync_sources import listen

from hric_msgs.msg import SampleChunk, SourceCount
from hric_perception.chunk import read_chunk

__all__ = ["nodes", "ros", "roscore", "run"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
RATE = 500.0


def test_what_an_emulated_device_says_it_sent_is_what_the_driver_publishes(run: TellsTime, nodes: Nodes) -> None:
    counts, chunks = listen("/hric/perception/sent", SourceCount), listen("/hric/perception/emg/raw", SampleChunk)
    nodes.start("emg", "_lsl:={name: counted, session: sent}", "_chunk:=0.05", "__name:=emg_counted")
    device = (
        "_muscles:=2",
        f"_rate:={RATE}",
        "_name:=counted",
        "_session:=sent",
        "_faults:={time_code: true}",
        "__name:=emulated_counted",
    )
    nodes.start("emulated_emg", *device)
    wait(lambda: chunks)
    begin = len(counts)
    wait(lambda: len(counts) > begin + 15)
    first, last = counts[begin + 2], counts[begin + 14]
    wait(lambda: read_chunk(chunks[-1]).times[-1] > last.header.stamp.to_sec() + 0.1)
    assert first.source == chunks[0].source and (first.counts, first.rate) == ("samples", RATE)
    codes = np.concatenate([read_chunk(message).data[:, -1] for message in chunks])
    numbers = np.rint(codes * RATE).astype(int)
    came = numbers[(numbers >= first.next) & (numbers < last.next)]
    assert came.tolist() == list(range(first.next, last.next)) and len(came) == last.sent - first.sent
    assert first.header.stamp.to_sec() == pytest.approx((first.next - 1) / RATE, abs=1e-6)
