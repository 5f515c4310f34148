"""Search for the bones of a model's right arm, by their names and by the tree of bodies."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from hric_core.errors import HricError
from hric_human.muscles.fitting.model import ArmModel

_LEFT = re.compile(r"(^|_)(l|left)(_|$)|left", re.IGNORECASE)
_THORAX = ("thorax", "torso", "chest", "trunk", "base")
_HAND = ("hand", "palm", "capitate", "metacarp", "thirdmc")
"""Parts of names by which the hand is found; the first match is used."""


@dataclass(frozen=True)
class Bones:
    """Names of the bodies of a model's right arm.

    Attributes:
        thorax: body of the thorax; "" if it is the ground.
        shoulder: first body distal to the shoulder that counts as upper arm; models may have massless bodies before the
            bone.
        humerus: upper arm bone.
        forearm: first body distal to the elbow.
        ulna: forearm bone at the elbow.
        radius: second forearm bone; the ulna in a model with one body for both.
        wrist: first body distal to the radius on the way to the hand; "" without a hand.
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
    """Return the bodies on the way from `proximal` (excluded) to `distal` (included)."""
    bodies, body = list[str](), distal
    while body and body != proximal:
        bodies.insert(0, body)
        body = model.parents[body]
    return bodies


def find_bones(model: ArmModel) -> Bones:
    """Find the bones of a model's right arm.

    Raises:
        HricError: the model has no humerus on the right side with an ulna distal to it.
    """
    right = [body for body in model.parents if not _LEFT.search(body)]
    ulnae = [body for body in right if "ulna" in body.lower() and _above(model, body, "humer")]
    if not ulnae:
        raise HricError(
            f"{model.name} has no right arm: it needs a body named ulna, distal to one named humerus; its bodies: "
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
    """Return the bodies proximal to a body whose names contain a word, the nearest first."""
    return [above for above in reversed(chain(model, "", body)[:-1]) if word in above.lower()]


def _has(body: str, words: Iterable[str]) -> bool:
    return any(word in body.lower() for word in words)
