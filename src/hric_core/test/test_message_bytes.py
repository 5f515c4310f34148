"""Bytes of messages, compared with those of genpy."""

import importlib
import pkgutil
import random
from io import BytesIO
from typing import Any

import genpy
import numpy as np
import pytest
from genpy.message import get_message_class
from geometry_msgs.msg import PoseWithCovariance
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header, String

from hric_core.message_bytes import _fields, _is_generated, message_bytes

PACKAGES = ("std_msgs", "geometry_msgs", "sensor_msgs", "tf2_msgs", "control_msgs", "franka_msgs", "hric_msgs")
RANGES = {"b": (-128, 127), "B": (0, 255), "h": (-(2**15), 2**15 - 1), "H": (0, 2**16 - 1)}
RANGES |= {"i": (-(2**31), 2**31 - 1), "I": (0, 2**32 - 1), "q": (-(2**63), 2**63 - 1), "Q": (0, 2**64 - 1)}


def classes() -> list[Any]:
    found = []
    for package in PACKAGES:
        module = importlib.import_module(f"{package}.msg")
        for item in pkgutil.iter_modules(module.__path__):
            found.append(getattr(module, item.name.removeprefix("_")))
    return found


def by_genpy(message: Any) -> bytes:
    data = BytesIO()
    message.serialize(data)
    return data.getvalue()


def value(kind: str, code: str, draw: random.Random) -> Any:
    if code == "s":
        return draw.choice(["", "joint", "Gelenk äöü", "\N{WRENCH}"])
    if code == "m":
        return filled(get_message_class(kind.partition("[")[0]), draw)
    if code == "T":
        return genpy.Time(draw.randrange(2**32), draw.randrange(10**9))
    if code == "D":
        return genpy.Duration(draw.randrange(-(2**31), 2**31), draw.randrange(10**9))
    if code in "df":
        return draw.choice([0.0, -0.0, 1.5, -3.25e-7, 1e30, float("inf"), 7])
    return draw.choice([*RANGES[code], draw.randint(*RANGES[code])])


def filled(cls: Any, draw: random.Random) -> Any:
    """Return a message of a class with random values in all fields."""
    message = cls()
    for (name, code, length, _), kind in zip(_fields(cls), cls._slot_types, strict=True):
        count = draw.randrange(4) if length == -2 else length
        made = [value(kind, code, draw) for _ in range(abs(count))]
        setattr(message, name, made[0] if length == -1 else made)
    return message


@pytest.mark.parametrize("cls", classes(), ids=lambda cls: cls._type)
def test_the_bytes_are_those_of_genpy(cls: Any) -> None:
    draw = random.Random(cls._type)
    assert _is_generated(cls)
    for message in [cls(), *(filled(cls, draw) for _ in range(5))]:
        assert message_bytes(message) == by_genpy(message)


def test_arrays_and_bytes_are_as_good_as_lists() -> None:
    for message in (
        Image(data=b"\x00\x01\xff", width=3),
        JointState(name=("a", "b"), position=np.array([0.1, 0.2]), velocity=(1.0, 2.0)),
    ):
        assert message_bytes(message) == by_genpy(message)


@pytest.mark.parametrize("wrong", [{"seq": -1}, {"seq": 2**32}, {"frame_id": 3}, {"frame_id": b"base"}])
def test_a_wrong_value_is_the_error_of_genpy(wrong: dict[str, Any]) -> None:
    message = Header(**{"seq": 0, "stamp": genpy.Time(), "frame_id": "", **wrong})
    errors = []
    for serialise in (by_genpy, message_bytes):
        with pytest.raises((genpy.SerializationError, AttributeError)) as error:
            serialise(message)
        errors.append(str(error.value))
    assert errors[0] == errors[1]


def test_a_fixed_array_of_the_wrong_length_is_the_error_of_genpy() -> None:
    with pytest.raises(genpy.SerializationError):
        message_bytes(PoseWithCovariance(covariance=[0.0] * 35))


def test_a_class_with_its_own_serialisation_keeps_it() -> None:
    class Framed(String):
        def serialize(self, buff: Any) -> None:
            buff.write(b"framed")

    assert message_bytes(Framed("a")) == b"framed"
