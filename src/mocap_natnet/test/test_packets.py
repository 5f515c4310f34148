"""Header, connection, server information and echo."""

import struct

import pytest

from mocap_natnet.codec import CodecError, packets
from mocap_natnet.codec.packets import Connect, NatNetMessage, ServerInfo

INFO = ServerInfo("Motive", (3, 1, 0, 0), (4, 1), 10_000_000, 1511, True, "239.255.42.99")


def test_server_information_has_the_lengths_of_real_packets() -> None:
    assert len(packets.encode_server_info(INFO)) == 279
    assert len(packets.encode_server_info(INFO._replace(version=(2, 9)))) == 264


def test_server_information_is_read_again_whatever_follows_the_name() -> None:
    payload = packets.encode_server_info(INFO, rubbish=bytes(range(128, 256)) * 2)
    assert payload[:7] == b"Motive\0" and payload[7] == 128
    assert packets.decode_server_info(payload) == INFO
    old = INFO._replace(version=(2, 9), clock_frequency=0, data_port=0, multicast=None, group="")
    assert packets.decode_server_info(packets.encode_server_info(INFO._replace(version=(2, 9)))) == old


@pytest.mark.parametrize("length", [0, 263, 264, 278])
def test_server_information_that_is_too_short_is_refused(length: int) -> None:
    with pytest.raises(CodecError) as error:
        packets.decode_server_info(packets.encode_server_info(INFO)[:length])
    assert error.value.reason == "short"


@pytest.mark.parametrize("payload", [b"", b"Ping\0", b"anything"])
def test_a_short_connect_requests_the_newest_bitstream(payload: bytes) -> None:
    assert packets.decode_connect(payload) == Connect()


@pytest.mark.parametrize("extra", [0, 1, 4])
def test_a_connect_with_options_has_the_requested_bitstream(extra: int) -> None:
    payload = packets.encode_connect(Connect("client", (4, 0), True))
    assert len(payload) == 269
    assert packets.decode_connect(payload + bytes(extra)) == Connect("client", (4, 0), True)


def test_a_connect_that_is_a_sender_alone_is_taken() -> None:
    assert packets.decode_connect(b"NatNetLib".ljust(264, b"\0")) == Connect("NatNetLib")


def test_echoes_carry_the_stamps() -> None:
    assert packets.decode_echo_request(packets.encode_echo_request(2**64 - 1)) == 2**64 - 1
    assert packets.decode_echo_response(packets.encode_echo_response(5, 6)) == (5, 6)
    for decode in (packets.decode_echo_request, packets.decode_echo_response):
        with pytest.raises(CodecError):
            decode(b"1234567")


def test_a_datagram_may_be_longer_than_its_header_says_but_not_shorter() -> None:
    assert packets.split(struct.pack("<HH", 10, 0) + b"\0") == (NatNetMessage.KEEPALIVE, 4)
    with pytest.raises(CodecError) as error:
        packets.split(struct.pack("<HH", 7, 5) + b"abcd")
    assert error.value.reason == "length"


def test_an_unrecognized_request_may_have_any_length() -> None:
    assert packets.split(struct.pack("<HH", 100, 9999) + b"stale") == (NatNetMessage.UNRECOGNIZED_REQUEST, 9)


@pytest.mark.parametrize(
    ("datagram", "reason"), [(b"", "short"), (b"\1\0\0", "short"), (struct.pack("<HH", 15, 0), "unknown message")]
)
def test_what_is_no_message_is_refused(datagram: bytes, reason: str) -> None:
    with pytest.raises(CodecError) as error:
        packets.split(datagram)
    assert error.value.reason == reason


def test_a_payload_that_no_datagram_holds_is_refused() -> None:
    with pytest.raises(CodecError):
        packets.packet(NatNetMessage.FRAMEOFDATA, bytes(65504))
