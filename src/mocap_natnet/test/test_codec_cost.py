"""Time to decode a frame, compared with a decoder of another author in the same test run."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from cost_ratio import cost_ratio

from mocap_natnet.codec import Codec
from mocap_natnet.codec.packets import split

sys.path.insert(0, str(Path(__file__).parent))
from natnet_samples import one_body_frame

natnet_frame = pytest.importorskip("natnet.data_frame")


@pytest.mark.slow
@pytest.mark.parametrize("version", [(3, 0), (4, 1), (4, 2)])
@pytest.mark.parametrize("bare", [True, False], ids=["the body alone", "with its markers"])
def test_a_frame_of_one_body_costs_at_most_0_7_of_the_other_decoder(
    version: tuple[int, int], bare: bool, figure: Callable[..., None]
) -> None:
    from natnet.packet_buffer import PacketBuffer
    from natnet.version import Version

    codec, their_version = Codec(version), Version(*version)
    frame = one_body_frame()._replace(marker_sets=(), unlabelled=(), markers=()) if bare else one_body_frame()
    datagram = codec.encode_frame(frame)

    def ours() -> None:
        _, end = split(datagram)
        codec.decode_frame(datagram, end)

    def theirs() -> None:
        buffer = PacketBuffer(datagram)
        buffer.read_uint16(), buffer.read_uint16()
        natnet_frame.DataFrame.read_from_buffer(buffer, their_version)

    ratio = cost_ratio(ours, theirs)
    figure(
        f"a frame, bitstream {version[0]}.{version[1]}, {'bare' if bare else 'with markers'}, beside another decoder",
        ratio,
        "1",
    )
    assert ratio <= 0.7
