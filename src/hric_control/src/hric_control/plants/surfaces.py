"""Contact surfaces of links: rigid contact or penalty contact (spring and damper), and friction."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from hric_control.plant import Surface
from hric_core.errors import ParameterError, UnknownNameError, check_known
from hric_core.parameters import Settings, choice, number, text


@dataclass(frozen=True)
class SurfaceSettings(Settings):
    """Settings of a contact surface in world files and parameters; settings that are left out do not change."""

    contact: str | None = choice("rigid", "penalty", default=None, text="contact law")
    stiffness: float | None = number(None, above=0.0, unit="N/m", text="stiffness of penalty contact")
    damping: float = number(0.0, minimum=0.0, unit="N s/m", text="damping of penalty contact")
    friction: float | None = number(
        None, minimum=0.0, maximum=10.0, text="friction coefficient; two bodies in contact have the product of both"
    )

    def check(self, where: str) -> None:
        """Refuse stiffness or damping without `contact: penalty`."""
        if self.contact != "penalty" and (self.stiffness is not None or self.damping):
            raise ParameterError(f"{where}stiffness and {where}damping need {where}contact: penalty")

    def over(self, base: Surface, default_stiffness: float) -> Surface:
        """Return the surface `base` with these settings applied; `default_stiffness`: used if none is set [N/m]."""
        friction = base.friction if self.friction is None else self.friction
        if self.contact is None:
            return replace(base, friction=friction)
        if self.contact == "rigid":
            return Surface(None, 0.0, friction)
        return Surface(self.stiffness or default_stiffness, self.damping, friction)


def _split(link: str) -> str:
    model, separator, name = link.partition("::")
    if not (model and separator and name):
        raise ValueError
    return link


@dataclass(frozen=True)
class SurfaceRule(SurfaceSettings):
    """Rule that sets the contact surface of links whose names match a pattern."""

    link: str = text(
        valid="model::link, each a name or a pattern such as *",
        made=_split,
        text="links to which the rule applies, model::link",
    )


class Surfaces:
    """Contact surfaces of links, determined by rules; a later rule overrides an earlier one.

    Args:
        rules: rules of the world file and of the plant's parameters.
        default_stiffness: stiffness of penalty contact if a rule sets none [N/m].
    """

    def __init__(self, rules: Sequence[SurfaceRule], default_stiffness: float) -> None:
        self._rules, self._default_stiffness = tuple(rules), default_stiffness

    def of_model(
        self, model: str, links: Iterable[str], base: Surface, by_link: Mapping[str, Surface] = {}
    ) -> dict[str, Surface]:
        """Return the surface of each link of a model: by the rules, else from `by_link`, else `base`.

        Raises:
            UnknownNameError: a rule names the model, but matches none of its links, or `by_link` has an unknown link.
        """
        surfaces = dict.fromkeys(links, base)
        check_known("link", by_link, surfaces, f"surfaces of model {model}")
        surfaces.update(by_link)
        for rule in self._rules:
            model_pattern, _, link_pattern = rule.link.partition("::")
            if not fnmatchcase(model, model_pattern):
                continue
            meant = [link for link in surfaces if fnmatchcase(link, link_pattern)]
            if not meant and model_pattern == model:
                raise UnknownNameError("link", link_pattern, surfaces, f"surfaces, of {rule.link}")
            surfaces.update({link: rule.over(surfaces[link], self._default_stiffness) for link in meant})
        return surfaces


def combine(first: Surface, second: Surface) -> tuple[float, float, float] | None:
    """Return (stiffness [N/m], damping [N s/m], friction coefficient) of two surfaces; None if both are rigid.

    The stiffness is that of both springs in series, or of the only spring if one surface is rigid."""
    stiffnesses = [s.stiffness for s in (first, second) if s.stiffness is not None]
    if not stiffnesses:
        return None
    return 1.0 / sum(1.0 / k for k in stiffnesses), max(first.damping, second.damping), first.friction * second.friction
