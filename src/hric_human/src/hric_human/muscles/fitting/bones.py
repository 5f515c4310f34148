"""Search for the bones of a model's right arm, by name and by the tree."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from hric_core.errors import HricError
from hric_human.muscles.fitting.model import ArmModel

_LEFT = re.compile(r"(^|_)(l|left)(_|$)|left", re.IGNORECASE)
_THORAX = ("thorax", "torso", "chest", "trunk", "base")
_HAND = ("hand", "palm", "capitate", "metacarp", "thirdmc")
"""Parts of names; the first match is used."""


@dataclass(frozen=True)
class Bones:
    """Bodies of a right arm.

    Attributes:
        thorax: "" if it is the ground.
        shoulder: first body behind the shoulder that counts as upper arm; models have massless ones before the bone.
        humerus: upper arm bone.
        forearm: first body behind the elbow.
        ulna: forearm bone at the elbow.
        radius: the ulna in a model with one body for both.
        wrist: the first body behind the radius on the way to the hand; "" without a hand.
        hand: body of the hand; "" without one.
    """

    thorax: str
    shoulder: str
    humerus: str
    forearm: str
    ulna: str
    radius: str
    wrist: str
    hand: str


def chain(model: ArmModel, proximal: str, distal: str) -> list[str]:
    """Return the bodies from the one behind `proximal` to `distal`."""
    bodies, body = list[str](), distal
    while body and body != proximal:
        bodies.insert(0, body)
        body = model.parents[body]
    return bodies


def find_bones(model: ArmModel) -> Bones:
    """Return the bones of a model.

    Raises:
        HricError: it has no humerus with an ulna behind it on the right side.
    """
    right = [body for body in model.parents if not _LEFT.search(body)]
    ulnae = [body for body in right if "ulna" in body.lower() and _above(model, body, "humer")]
    if not ulnae:
        raise HricError(
            f"{model.name} has no right arm: no body named ulna behind one named humerus; its bodies: "
            + ", ".join(model.parents)
        )
    ulna = ulnae[0]
    humerus = _above(model, ulna, "humer")[0]
    above = chain(model, "", humerus)
    upper = [body for body in above if "hum" in body.lower()]
    thorax = next((body for body in reversed(above) if _has(body, _THORAX)), "")
    behind = [body for body in right if humerus in chain(model, "", body) and body not in (humerus, ulna)]
    radius = next((body for body in behind if "radius" in body.lower()), ulna)
    hands = [body for body in behind if radius in chain(model, "", body) and body != radius]
    hand = next((body for word in _HAND for body in hands if word in body.lower()), "")
    wrist = chain(model, radius, hand)[0] if hand else ""
    return Bones(thorax, upper[0], humerus, chain(model, humerus, ulna)[0], ulna, radius, wrist, hand)


def _above(model: ArmModel, body: str, word: str) -> list[str]:
    """Return the bodies with a word in their name between the ground and a body, the nearest first."""
    return [above for above in reversed(chain(model, "", body)[:-1]) if word in above.lower()]


def _has(body: str, words: Iterable[str]) -> bool:
    return any(word in body.lower() for word in words)
