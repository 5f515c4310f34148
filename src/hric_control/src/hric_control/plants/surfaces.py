"""How surfaces respond to contact: rigid, or by a spring with damping and friction (penalty contact)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from hric_control.plant import Surface
from hric_core.errors import ParameterError, UnknownNameError, check_known
from hric_core.parameters import Settings, choice, number, text


@dataclass(frozen=True)
class SurfaceSettings(Settings):
    """What files and parameters say of a surface; what they leave out stays as it was."""

    contact: str | None = choice("rigid", "penalty", default=None, text="contact law")
    stiffness: float | None = number(None, above=0.0, unit="N/m", text="of penalty contact")
    damping: float = number(0.0, minimum=0.0, unit="N s/m", text="of penalty contact")
    friction: float | None = number(None, minimum=0.0, maximum=10.0, text="coefficient; a pair has the product of both")

    def check(self, where: str) -> None:
        """Refuse a spring without its kind of contact."""
        if self.contact != "penalty" and (self.stiffness is not None or self.damping):
            raise ParameterError(f"{where}stiffness and {where}damping need {where}contact: penalty")

    def over(self, base: Surface, default_stiffness: float) -> Surface:
        """That surface, where it was `base`; default_stiffness: of penalty contact where none is given [N/m]."""
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
    """The surface of some links."""

    link: str = text(valid="model::link, each a name or a pattern such as *", made=_split, text="which links")


class Surfaces:
    """Surfaces of all links by rules; a later rule goes over an earlier one.

    Args:
        rules: of the world file and of the plant's parameters.
        default_stiffness: of penalty contact where a rule gives none [N/m].
    """

    def __init__(self, rules: Sequence[SurfaceRule], default_stiffness: float) -> None:
        self._rules, self._default_stiffness = tuple(rules), default_stiffness

    def of_model(
        self, model: str, links: Iterable[str], base: Surface, own: Mapping[str, Surface] = {}
    ) -> dict[str, Surface]:
        """Surface of each link of a model whose links have `own`, else `base`, where no rule says otherwise.

        Raises:
            UnknownNameError: a rule fits the model, but none of its links; `own` names a link that it does not have.
        """
        found = dict.fromkeys(links, base)
        check_known("link", own, found, f"surfaces of model {model}")
        found.update(own)
        for rule in self._rules:
            model_pattern, _, link_pattern = rule.link.partition("::")
            if not fnmatchcase(model, model_pattern):
                continue
            meant = [link for link in found if fnmatchcase(link, link_pattern)]
            if not meant and model_pattern == model:
                raise UnknownNameError("link", link_pattern, found, f"surfaces, of {rule.link}")
            found.update({link: rule.over(found[link], self._default_stiffness) for link in meant})
        return found


def combine(first: Surface, second: Surface) -> tuple[float, float, float] | None:
    """(stiffness [N/m], damping [N s/m], friction) of a pair, None when both are rigid: two springs act in series, a
    rigid partner adds nothing."""
    stiffnesses = [s.stiffness for s in (first, second) if s.stiffness is not None]
    if not stiffnesses:
        return None
    return 1.0 / sum(1.0 / k for k in stiffnesses), max(first.damping, second.damping), first.friction * second.friction
