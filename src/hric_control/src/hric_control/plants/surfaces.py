"""How surfaces answer when they meet: rigid, or by a spring with damping and friction (penalty contact)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

from hric_control.errors import ParameterError, UnknownNameError
from hric_control.plant import FloatArray

SLIP_VELOCITY = 1e-3
"""Friction of a penalty contact grows linearly up to this sliding speed [m/s] (our choice); a spring has no memory to stick with."""


@dataclass(frozen=True)
class Surface:
    """How a body's surface answers.

    Attributes:
        stiffness: of penalty contact [N/m]; None for the engine's rigid contact.
        damping: of penalty contact [N s/m].
        friction: coefficient; a pair has the product of both.
    """

    stiffness: float | None = None
    damping: float = 0.0
    friction: float = 0.5


SURFACE_KEYS = ("contact", "stiffness", "damping", "friction")
"""What is said of a surface in files and parameters."""
CONTACTS = ("rigid", "penalty")


def read_surface(data: Mapping[str, Any], base: Surface, default_stiffness: float, where: str) -> Surface:
    """A surface from the keys of SURFACE_KEYS; what is not given is that of `base`.

    Args:
        data: any of the keys.
        base: the surface before.
        default_stiffness: of penalty contact where none is given [N/m].
        where: for error texts.

    Raises:
        ParameterError: a value that cannot be; an unknown word with the valid ones.
    """
    contact = data.get("contact")
    if contact is not None and contact not in CONTACTS:
        raise ParameterError(f"{where}: contact: unknown {contact!r}; valid: {', '.join(CONTACTS)}")
    if contact != "penalty" and (data.get("stiffness") is not None or data.get("damping")):
        raise ParameterError(f"{where}: stiffness and damping need contact: penalty")
    friction = _number(data.get("friction", base.friction), f"{where}: friction")
    if contact is None:
        return replace(base, friction=friction)
    if contact == "rigid":
        return Surface(None, 0.0, friction)
    stiffness = data.get("stiffness")
    stiffness = default_stiffness if stiffness is None else _number(stiffness, f"{where}: stiffness", 1e-9)
    return Surface(stiffness, _number(data.get("damping", 0.0), f"{where}: damping"), friction)


def _number(value: Any, where: str, least: float = 0.0) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value < least:
        raise ParameterError(f"{where}: must be a number of at least {least}; got {value!r}")
    return float(value)


@dataclass(frozen=True)
class SurfaceRule:
    """The surface of some links.

    Attributes:
        model, link: patterns of names, with * and ?.
        values: keys of SURFACE_KEYS.
        default_stiffness: of penalty contact where none is given [N/m].
        where: for error texts.
    """

    model: str
    link: str
    values: Mapping[str, Any]
    default_stiffness: float
    where: str

    def of(self, base: Surface) -> Surface:
        """That surface, on a link that had `base`."""
        return read_surface(self.values, base, self.default_stiffness, self.where)


def read_rules(items: Any, default_stiffness: float, where: str) -> tuple[SurfaceRule, ...]:
    """Rules from a list of mappings with `link`, "model::link", and the keys of SURFACE_KEYS.

    Raises:
        ParameterError: not that; unknown keys and words with the valid ones.
    """
    form = f"a list of mappings with link and any of {', '.join(SURFACE_KEYS)}"
    if not isinstance(items, (list, tuple)):
        raise ParameterError(f"{where}: must be {form}; got {items!r}")
    rules = []
    for item in items:
        if not isinstance(item, Mapping) or not isinstance(item.get("link"), str):
            raise ParameterError(f"{where}: must be {form}; got {item!r}")
        unknown = sorted(str(key) for key in set(item) - {"link", *SURFACE_KEYS})
        if unknown:
            raise ParameterError(f"{where}: {item['link']}: unknown key {', '.join(unknown)}; valid: link, {', '.join(SURFACE_KEYS)}")
        model, separator, link = item["link"].partition("::")
        if not (model and separator and link):
            raise ParameterError(f"{where}: link: must be model::link, each a name or a pattern such as *; got {item['link']!r}")
        rule = SurfaceRule(model, link, {key: item[key] for key in SURFACE_KEYS if key in item}, default_stiffness, f"{where}: {item['link']}")
        rule.of(Surface())
        rules.append(rule)
    return tuple(rules)


class Surfaces:
    """Surfaces of all links by rules; a later rule goes over an earlier one.

    Args:
        rules: of the world file and of the plant's parameters.
    """

    def __init__(self, rules: Sequence[SurfaceRule]) -> None:
        self._rules = tuple(rules)

    def of_model(self, model: str, links: Iterable[str], base: Surface) -> dict[str, Surface]:
        """Surface of each link of a model whose links have `base` where no rule says otherwise.

        Raises:
            UnknownNameError: a rule fits the model, but none of its links.
        """
        found = dict.fromkeys(links, base)
        for rule in self._rules:
            if not fnmatchcase(model, rule.model):
                continue
            meant = [link for link in found if fnmatchcase(link, rule.link)]
            if not meant and rule.model == model:
                raise UnknownNameError("link", rule.link, found, rule.where)
            found.update({link: rule.of(found[link]) for link in meant})
        return found


def combine(first: Surface, second: Surface) -> tuple[float, float, float] | None:
    """(stiffness [N/m], damping [N s/m], friction) of a pair, None when both are rigid: two springs act in series, a rigid partner adds nothing."""
    stiffnesses = [s.stiffness for s in (first, second) if s.stiffness is not None]
    if not stiffnesses:
        return None
    return 1.0 / sum(1.0 / k for k in stiffnesses), max(first.damping, second.damping), first.friction * second.friction


def friction_force(load: float, friction: float, normal: FloatArray, relative: FloatArray) -> FloatArray:
    """What friction takes from the force on a, shape (3,) [N].

    Args:
        load: normal force [N].
        friction: coefficient.
        normal: from b to a, unit vector, shape (3,).
        relative: velocity of a seen from b at the contact, shape (3,) [m/s].
    """
    sliding = relative - (relative @ normal) * normal
    speed = math.sqrt(float(sliding @ sliding))
    across: FloatArray = friction * load / max(speed, SLIP_VELOCITY) * sliding
    return across
