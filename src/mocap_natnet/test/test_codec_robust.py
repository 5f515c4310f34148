"""Mutated and random datagrams: each is either decoded or refused with a reason."""

import resource
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from mocap_natnet.codec import REASONS, Codec, CodecError
from mocap_natnet.codec.packets import (
    NatNetMessage,
    decode_connect,
    decode_echo_request,
    decode_echo_response,
    decode_server_info,
    split,
)

sys.path.insert(0, str(Path(__file__).parent))
from natnet_samples import VERSIONS, Sample, one_body_frame

Datagrams = list[bytes]


def read(codec: Codec, datagram: bytes) -> str:
    """Decode a datagram as client and as server; return "read" or the reason of the refusal."""
    try:
        message, end = split(datagram)
        if message == NatNetMessage.FRAMEOFDATA:
            codec.decode_frame(datagram, end)
        elif message == NatNetMessage.MODELDEF:
            codec.decode_model(datagram, end)
        elif message == NatNetMessage.SERVERINFO:
            decode_server_info(datagram[4:end])
        elif message == NatNetMessage.ECHO_REQUEST:
            decode_echo_request(datagram[4:end])
        elif message == NatNetMessage.ECHO_RESPONSE:
            decode_echo_response(datagram[4:end])
        elif message == NatNetMessage.CONNECT:
            decode_connect(datagram[4:end])
    except CodecError as error:
        return error.reason
    return "read"


def mutate(datagram: bytes, random: np.random.Generator) -> bytes:
    """Return data with one to four changes: a byte, a run of 0xFF, a cut, a repeated piece."""
    changed = bytearray(datagram)
    for _ in range(int(random.integers(1, 5))):
        where, kind = int(random.integers(0, max(1, len(changed)))), int(random.integers(0, 8))
        if kind < 5 and changed:
            changed[min(where, len(changed) - 1)] = int(random.integers(0, 256))
        elif kind == 5:
            changed[where : where + 4] = b"\xff\xff\xff\x7f"
        elif kind == 6:
            del changed[where:]
        else:
            changed[where:where] = changed[where : where + 16]
    return bytes(changed)


def fuzz(rounds: int, seed: int) -> Counter[str]:
    random = np.random.default_rng(seed)
    codecs = [Codec(version) for version in VERSIONS]
    seeds: list[Datagrams] = [
        [
            codec.encode_frame(one_body_frame()),
            codec.encode_frame(Sample(1).frame()),
            codec.encode_model(Sample(2).model()),
        ]
        for codec in codecs
    ]
    seen: Counter[str] = Counter()
    for index in range(rounds):
        which = index % len(codecs)
        datagram = (
            random.bytes(int(random.integers(0, 300))) if index % 10 == 0 else mutate(seeds[which][index % 3], random)
        )
        seen[read(codecs[which], datagram)] += 1
    return seen


def test_mutated_and_random_datagrams_are_read_or_refused_with_a_reason() -> None:
    seen = fuzz(30_000, seed=1)
    assert sum(seen.values()) == 30_000
    assert set(seen) <= {"read", *REASONS}
    assert {"read", "short", "count", "size", "length", "unknown message"} <= set(seen)


def test_a_datagram_of_the_other_bitstream_does_no_harm() -> None:
    for sent in VERSIONS:
        datagram = Codec(sent).encode_frame(Sample(3).frame())
        for version in VERSIONS:
            assert read(Codec(version), datagram) in {"read", *REASONS}


@pytest.mark.slow
def test_a_million_datagrams_leave_no_memory_behind() -> None:
    fuzz(10_000, seed=2)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in range(10):
        assert set(fuzz(100_000, seed)) <= {"read", *REASONS}
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 5_000  # [kB]
