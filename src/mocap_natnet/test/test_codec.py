"""Codec of frames and descriptions: round trips, sizes of real streams, and refusal of wrong data with a reason."""

import struct
import sys
from pathlib import Path

import pytest

from mocap_natnet.codec import Codec, CodecError, parse
from mocap_natnet.codec import descriptions as d
from mocap_natnet.codec.layout import layout
from mocap_natnet.codec.packets import HEADER
from mocap_natnet.codec.types import TRACKED, Frame, RigidBody, Suffix

sys.path.insert(0, str(Path(__file__).parent))
from natnet_samples import VERSIONS, Sample, one_body_frame

BODY = RigidBody(7, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), 0.5, TRACKED)


@pytest.fixture(params=VERSIONS, ids=lambda version: f"{version[0]}.{version[1]}")
def codec(request: pytest.FixtureRequest) -> Codec:
    return Codec(request.param)


def as_sent(frame: Frame, codec: Codec) -> Frame:
    """Return a frame reduced to the fields that a bitstream has."""
    has = codec.layout.has

    def body(given: RigidBody) -> RigidBody:
        return given._replace(
            flags=given.flags if has["body_flags"] else TRACKED, markers=given.markers if has["body_markers"] else ()
        )

    blank = Suffix()._asdict()
    carried = frame.suffix._asdict()
    return frame._replace(
        bodies=tuple(map(body, frame.bodies)),
        skeletons=tuple(s._replace(bodies=tuple(map(body, s.bodies))) for s in frame.skeletons),
        assets=frame.assets if has["assets"] else (),
        markers=tuple(
            m._replace(flags=m.flags if has["marker_flags"] else 0, residual=m.residual if has["residual"] else 0.0)
            for m in frame.markers
        ),
        force_plates=frame.force_plates if has["force_plates"] else (),
        devices=frame.devices if has["devices"] else (),
        suffix=Suffix(**{name: carried[name] if name in codec.layout.suffix_fields else blank[name] for name in blank}),
    )


def test_what_is_written_is_read_again(codec: Codec) -> None:
    for seed in range(40):
        frame = Sample(seed).frame()
        assert codec.decode_frame(codec.encode_frame(frame)) == as_sent(frame, codec)


def test_a_description_is_read_again(codec: Codec) -> None:
    for seed in range(20):
        model = Sample(seed).model()
        read = codec.decode_model(codec.encode_model(model))
        assert read.skipped == 0
        assert [type(one) for one in read.descriptions] == [
            type(one)
            for one in model.descriptions
            if (codec.layout.has["force_plates"] or not isinstance(one, d.ForcePlateDescription))
            and (codec.layout.has["devices"] or not isinstance(one, d.DeviceDescription))
            and (codec.layout.has["assets"] or not isinstance(one, d.AssetDescription))
        ]
        if codec.layout.has["rotation_offset"]:
            assert read == model


def test_a_body_description_loses_only_what_the_bitstream_lacks(codec: Codec) -> None:
    body = Sample(3).described_body()._replace(markers=(d.DescribedMarker((1.0, 2.0, 3.0), 4, "tip"),))
    (read,) = codec.decode_model(codec.encode_model(d.ServerModel((body,)))).descriptions
    assert isinstance(read, d.RigidBodyDescription)
    assert read[:4] == body[:4]
    assert read.rotation == (body.rotation if codec.layout.version >= (4, 2) else d.IDENTITY)
    names = "tip" if codec.layout.version >= (4, 0) else ""
    assert read.markers == ((d.DescribedMarker((1.0, 2.0, 3.0), 4, names),) if codec.layout.version >= (3, 0) else ())


@pytest.mark.parametrize(
    ("version", "size"), [((3, 0), 116), ((3, 1), 116), ((4, 0), 116), ((4, 1), 160), ((4, 2), 160)]
)
def test_a_frame_of_one_body_has_the_size_of_real_streams(version: tuple[int, int], size: int) -> None:
    datagram = Codec(version).encode_frame(Frame(1, bodies=(BODY,)))
    assert len(datagram) == HEADER.size + size
    assert HEADER.unpack_from(datagram) == (7, size)


def test_the_fields_are_where_the_protocol_puts_them() -> None:
    datagram = Codec((3, 0)).encode_frame(
        Frame(9, bodies=(BODY,), suffix=Suffix(time_stamp=0.25, mid_exposure=11, received=12, transmitted=13, flags=2))
    )
    assert struct.unpack_from("<iiii", datagram, 4) == (9, 0, 0, 1)
    assert struct.unpack_from("<i3f4ffh", datagram, 20) == (7, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.5, 1)
    assert struct.unpack_from("<IIdQQQhi", datagram, len(datagram) - 46) == (0, 0, 0.25, 11, 12, 13, 2, 0)


def test_every_cut_of_a_frame_is_refused(codec: Codec) -> None:
    datagram = codec.encode_frame(Sample(1).frame())
    for end in range(HEADER.size, len(datagram)):
        with pytest.raises(CodecError):
            codec.decode_frame(datagram[:end])


def test_every_cut_of_a_description_is_refused(codec: Codec) -> None:
    datagram = codec.encode_model(Sample(1).model())
    for end in range(HEADER.size, len(datagram), 7):
        with pytest.raises(CodecError):
            codec.decode_model(datagram[:end])


@pytest.mark.parametrize("number", [-1, 2**31 - 1, 10000])
def test_a_count_that_the_datagram_cannot_hold_is_refused(codec: Codec, number: int) -> None:
    datagram = bytearray(codec.encode_frame(one_body_frame()))
    struct.pack_into("<i", datagram, HEADER.size + 4, number)
    with pytest.raises(CodecError) as error:
        codec.decode_frame(bytes(datagram))
    assert error.value.reason == "count"


@pytest.mark.parametrize("size", [-1, 2**31 - 1, 10000, 1])
def test_a_section_size_that_does_not_fit_is_refused(size: int) -> None:
    codec = Codec((4, 1))
    datagram = bytearray(codec.encode_frame(one_body_frame()))
    struct.pack_into("<i", datagram, HEADER.size + 8, size)
    with pytest.raises(CodecError) as error:
        codec.decode_frame(bytes(datagram))
    assert error.value.reason in ("size", "count", "short")


def test_a_section_that_is_longer_than_what_is_known_of_it_is_passed_over() -> None:
    codec = Codec((4, 4))
    datagram = codec.encode_frame(Frame(1, bodies=(BODY,)))
    begin = HEADER.size + 4 + 8 + 8 + 8
    longer = (
        datagram[: begin - 4]
        + struct.pack("<i", 38 + 5)
        + datagram[begin : begin + 38]
        + b"extra"
        + datagram[begin + 38 :]
    )
    frame = codec.decode_frame(longer)
    assert frame.bodies == (BODY,)
    assert frame.skipped == 5


def test_a_description_of_an_unknown_type_is_skipped_by_its_size() -> None:
    codec = Codec((4, 1))
    datagram = codec.encode_model(d.ServerModel((d.MarkerSetDescription("all"),)))
    unknown = struct.pack("<ii", 99, 3) + b"abc"
    model = codec.decode_model(HEADER.pack(5, 0) + struct.pack("<i", 2) + unknown + datagram[8:])
    assert model == d.ServerModel((d.MarkerSetDescription("all"),), skipped=3)


def test_a_description_of_an_unknown_type_without_size_is_refused() -> None:
    with pytest.raises(CodecError) as error:
        Codec((4, 0)).decode_model(HEADER.pack(5, 0) + struct.pack("<iiii", 1, 99, 0, 0))
    assert error.value.reason == "unknown type"


def test_a_frame_without_end_tag_is_refused() -> None:
    codec = Codec((3, 0))
    with pytest.raises(CodecError) as error:
        codec.decode_frame(codec.encode_frame(one_body_frame())[:-4] + b"\1\0\0\0")
    assert error.value.reason == "end tag"


def test_a_name_that_is_not_utf_8_is_refused() -> None:
    codec = Codec((3, 0))
    with pytest.raises(CodecError) as error:
        codec.decode_frame(codec.encode_frame(one_body_frame()).replace(b"hand", b"h\xffnd"))
    assert error.value.reason == "name"


@pytest.mark.parametrize("version", [(0, 0), (1, 0), (2, 4), (4, 6), (5, 0), (255, 255)])
def test_an_unknown_bitstream_is_refused_with_the_known_ones(version: tuple[int, int]) -> None:
    with pytest.raises(CodecError, match=r"2\.5 to 4\.5") as error:
        Codec(version)
    assert error.value.reason == "version"


def test_bitstream_2_10_is_later_than_2_9() -> None:
    assert parse("2.10") == (2, 10)
    assert parse("4.1.0.0") == (4, 1)
    assert layout(parse("2.10")).has["force_plates"] and not layout((2, 10)).has["devices"]


@pytest.mark.parametrize("words", ["", "4", "4.x", "4.1.0.0.0", "-4.1"])
def test_a_bitstream_that_is_no_version_is_refused(words: str) -> None:
    with pytest.raises(CodecError, match=r"major\.minor"):
        parse(words)
