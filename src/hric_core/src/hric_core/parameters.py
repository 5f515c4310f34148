"""Reader of parameters: each is declared once, with unit, range, default and text, and read from any source.

    @dataclass(frozen=True)
    class LoopSettings(Settings):
        \"\"\"Parameters of the loop.\"\"\"

        rate: float = number(100.0, unit="Hz", above=0.0, text="of the loop")
        mode: str = choice("fast", "exact", text="how it is paced")
        limits: tuple[float, ...] = numbers(3, (1.0, 1.0, 1.0), unit="m", minimum=0.0)
        joints: tuple[str, ...] = names(text="in the order of all lists")
        kp: tuple[float, ...] = per_joint(number(unit="N m/rad", minimum=0.0))

        def check(self, where: str) -> None:
            if self.mode == "exact" and self.rate > 1000.0:
                raise refused(f"{where}rate", self.rate, "up to 1000 Hz in mode exact")

    LoopSettings.read(node)                         # of a Node: the declared names; see ScopedNode for others
    LoopSettings.read(node, joints=names)           # where the joints are no parameter themselves
    LoopSettings.of(content, "run.yaml: loop")      # of a mapping: unknown keys are refused
    LoopSettings(rate=50.0, joints=["a"], kp=3.0)   # in Python: checked likewise; dataclasses.replace, too
    number(0.0, minimum=0.0, unit="s").read(node, "timeout")         # one parameter alone
    number(minimum=0.0, unit="s").checked(value, "q.yaml: delay")    # one value

Kinds: `number`, `whole`, `flag`, `text`, `choice`, `numbers` (a list of them), `names`, `listing` (of any kind),
`mapping` (to anything, or to a kind), `section` (nested Settings), `variant` (of several Settings, by a word in them),
`per_joint` (one value, a list, or a mapping by joint), `either` (the first kind that fits), `anything`. Each has a
default; without one the parameter is required, with None it may be left out. The other arguments of all kinds are those
of `ParameterOptions`. `Settings.defaults` may give defaults of a file.

Text such as 1e-3, which YAML 1.1 does not take for a number, is one; a bool is none; NaN and infinity are refused, and
without a maximum of its own what is larger than any value of the unit can be (`magnitudes`).
A refusal is a ParameterError in the same words: full name, value, what is valid with its unit; all mistakes of a
mapping come at once.
`rows` gives the rows of a table of INTERFACE.md; tests/interface_tables.py prints them into the pages. `json_schema` is
for editors.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import KW_ONLY, InitVar, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, ClassVar, Self, TypedDict, Unpack

from hric_core.errors import HricError, ParameterError, ParameterErrors, UnknownParameterError
from hric_core.json_values import JsonSchema
from hric_core.magnitudes import first_beyond, largest, likely_unit
from hric_core.node import REQUIRED, Node

_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+")
LONGEST_SHOWN = 120
"""Number of characters up to which an error quotes a value in full."""
Convert = Callable[[Any, str, Sequence[str]], Any]
"""Converter (value, its full name, the joints) -> checked value; a ValueError refuses the value."""


class ParameterOptions(TypedDict, total=False):
    """Options of parameters of all kinds.

    Attributes:
        unit: unit of its numbers.
        text: description for users.
        name: name, if it is not the attribute's; "profile/velocity" reaches into a group of a node.
        made: converts the checked value to what the program uses, and leaves a converted one alone. Its ValueError or
            HricError refuses the value.
        default_text: for tables, if the default alone would mislead.
        minimum, above, maximum: range of its numbers.
        live: True if it can be changed while the program runs (`hric_core.live.live_parameters`).
    """

    unit: str
    text: str
    name: str
    made: Callable[[Any], Any]
    default_text: str
    minimum: float
    above: float
    maximum: float
    live: bool


class Mistakes:
    """Collector of refusals, so that all are reported at once."""

    def __init__(self) -> None:
        self._errors: list[ParameterError] = []

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Record a refusal within the block, and go on."""
        try:
            yield
        except ParameterError as error:
            self._errors.append(error)

    def raise_all(self) -> None:
        """Raise ParameterError after one refusal, ParameterErrors after several."""
        if self._errors:
            raise self._errors[0] if len(self._errors) == 1 else ParameterErrors(self._errors)


@dataclass(eq=False)
class Parameter:
    """Declared parameter; the functions below create it.

    Attributes:
        shape: JSON schema of its values, without range and text; by default anything.
        nested: settings of a section. The others: see `ParameterOptions`.
    """

    kind: str
    accepts: str
    convert: Convert
    default: Any = REQUIRED
    unit: str = ""
    text: str = ""
    name: str = ""
    made: Callable[[Any], Any] | None = None
    default_text: str = ""
    minimum: float = -math.inf
    above: float = -math.inf
    maximum: float = math.inf
    live: bool = False
    nested: "type[Settings] | None" = None
    shape: Callable[[], JsonSchema] = dict

    def __set_name__(self, owner: object, name: str) -> None:
        self.name = self.name or name

    def checked(self, value: Any, where: str, joints: Sequence[str] = ()) -> Any:
        """Return the value as the program uses it.

        Args:
            value: raw value; the parameter itself if it is not set.
            where: full name.
            joints: joints for values per joint.

        Raises:
            ParameterError: it is not valid.
        """
        value = self.default if value is self else value
        if value is REQUIRED:
            raise ParameterError(f"{where} is not set; valid: {self.valid}")
        if value is None and self.default is None:
            return None
        try:
            result = self.converted(value, where, joints)
        except (ValueError, OverflowError):
            likely = likely_unit(value, self.unit, max(self.minimum, self.above), self.maximum)
            raise refused(where, value, self.valid + likely) from None
        if self.maximum == math.inf and self.unit and (beyond := first_beyond(result, self.unit)) is not None:
            number, unit = beyond
            likely = likely_unit(number, unit, max(self.minimum, self.above), self.maximum)
            raise refused(where, value, f"{self.bounded}, at most {largest(unit):g} in size [{unit}]{likely}")
        return result if self.made is None else self._make(self.made, result, where)

    def read(self, node: Node, name: str, joints: Sequence[str] = ()) -> Any:
        """Return the value of one parameter of a node. Raises ParameterError."""
        return self.checked(node.param(name, self), node.resolve(name), joints)

    def converted(self, value: Any, where: str, joints: Sequence[str]) -> Any:
        """Return the value by kind and range, before `made`. Raises ValueError; ParameterError for a part of it."""
        result = self.convert(value, where, joints)
        if self.above > -math.inf or self.minimum > -math.inf or self.maximum < math.inf:
            for item in result if isinstance(result, tuple) else (result,):
                if item <= self.above or not self.minimum <= item <= self.maximum:
                    raise ValueError
        return result

    def _make(self, make: Callable[[Any], Any], value: Any, where: str) -> Any:
        try:
            return make(value)
        except ValueError:
            raise refused(where, value, self.valid) from None
        except HricError as error:
            raise ParameterError(f"{where} is {_short(value)}: {error}") from None

    @property
    def bounded(self) -> str:
        """Accepted values with their range, for errors."""
        high = f" to {self.maximum:g}" if self.maximum < math.inf else ""
        low = f" above {self.above:g}" if self.above > -math.inf else ""
        if not low and self.minimum > -math.inf:
            low = f" from {self.minimum:g}" if high else f" of {self.minimum:g} or more"
        return self.accepts + (low or " up" * bool(high)) + high

    @property
    def valid(self) -> str:
        """Accepted values with range and unit."""
        return self.bounded + (f" [{self.unit}]" if self.unit else "")

    @property
    def type(self) -> str:
        """Kind and range, for tables."""
        low = (
            f"> {self.above:g}"
            if self.above > -math.inf
            else f">= {self.minimum:g}"
            if self.minimum > -math.inf
            else ""
        )
        high = f"<= {self.maximum:g}" if self.maximum < math.inf else ""
        return f"{self.kind} {', '.join(filter(None, (low, high)))}".strip() + ", live" * self.live

    @property
    def text_with_unit(self) -> str:
        """Description with unit, for tools that have no column for the unit."""
        return self.text + (f" [{self.unit}]" if self.unit else "")


def refused(where: str, value: object, valid: str) -> ParameterError:
    """Return the error for a value; `valid`: description of valid values."""
    return ParameterError(f"{where} is {_short(value)}; valid: {valid}")


def refuse_void(settings: "Settings", name: str, where: str, needed: str) -> None:
    """Refuse a parameter that has no effect, unless it has its default.

    Args:
        settings: settings that hold the parameter.
        name: name of the attribute.
        where: prefix of the parameter's name.
        needed: setting with which it has an effect.

    Raises:
        ParameterError: the parameter differs from its default.
    """
    parameter, value = declared(type(settings))[name], getattr(settings, name)
    if value != parameter.checked(parameter.default, name):
        raise ParameterError(f"{where}{parameter.name} has no effect; valid: with {needed}")


def _short(value: Any) -> str:
    """Return a value as one line; of a long value the beginning and the length."""
    shown = repr(value)
    if len(shown) <= LONGEST_SHOWN:
        return shown
    of = "characters" if isinstance(value, str) else "values"
    length = f" ({len(value)} {of})" if hasattr(value, "__len__") else ""
    return f"{shown[: LONGEST_SHOWN // 2].rsplit(' ', 1)[0]} ...{length}"


def unknown(kind: str, name: object, valid: Iterable[str], where: str) -> ParameterError:
    """Return the error for a name that does not exist."""
    return UnknownParameterError(kind, name, valid, where)


@dataclass(frozen=True)
class Settings:
    """Base of declared parameters; a subclass is a frozen dataclass, too.

    Args:
        where: prefix of the names of the parameters in errors.
        for_joints: joints of values per joint; the field `joints` by default.
    """

    prefix: ClassVar[str] = ""
    """Prefix of the names in errors, for checks across several settings later."""
    separator: ClassVar[str] = "/"
    """Separator between the names of a section and of its parameters, in tables."""
    _: KW_ONLY
    where: InitVar[str] = ""
    for_joints: InitVar[Sequence[str]] = ()

    def __post_init__(self, where: str, for_joints: Sequence[str]) -> None:
        base = self.defaults()
        parameters = declared(type(self))
        mistakes = Mistakes()
        for attribute in sorted(parameters, key="joints".__ne__):  # what is per joint needs to know them
            parameter, value = parameters[attribute], getattr(self, attribute)
            value = base.get(parameter.name, value) if value is parameter else value
            with mistakes.noted():
                value = parameter.checked(value, f"{where}{parameter.name}", for_joints or getattr(self, "joints", ()))
            object.__setattr__(self, attribute, value)
            if attribute == "joints":
                mistakes.raise_all()
        mistakes.raise_all()
        object.__setattr__(self, "prefix", where)
        self.check(where)

    @classmethod
    def defaults(cls) -> Mapping[str, object]:
        """Return defaults by name, which replace the declared ones."""
        return {}

    def check(self, where: str) -> None:
        """Refuse combinations that are not valid, by `refused`; `where` is the prefix of each name."""

    @classmethod
    def read(cls, node: Node, joints: Sequence[str] = ()) -> Self:
        """Return the parameters of a node. Raises ParameterError."""
        values = {key: node.param(parameter.name, parameter) for key, parameter in declared(cls).items()}
        return cls(**values, where=f"{node.namespace.rstrip('/')}/", for_joints=joints)

    @classmethod
    def of(cls, content: Any, where: str, joints: Sequence[str] = ()) -> Self:
        """Return the parameters of a mapping.

        Args:
            content: content of a file or of the parameter server; None counts as empty, except for a whole file.
            where: its name: "/arm/profile", "mocap.human", "world.yaml: objects[0]", "world.yaml:" for a whole file.
            joints: joints for values per joint.

        Raises:
            ParameterError: no mapping, an unknown key, or a value that is not valid.
        """
        by_name = {parameter.name: key for key, parameter in declared(cls).items()}
        if content is None and where.endswith(":"):
            raise ParameterError(f"{where[:-1]} is empty; valid: a mapping with {', '.join(by_name)}")
        content = {} if content is None else content
        if not isinstance(content, Mapping):
            raise refused(where.rstrip(":/."), content, f"a mapping with {', '.join(by_name)}")
        mistakes = Mistakes()
        for name in content:
            with mistakes.noted():
                if name not in by_name:
                    raise unknown("parameter", name, by_name, where.rstrip(":/."))
        values = {by_name[name]: value for name, value in content.items() if name in by_name}
        with mistakes.noted():
            made = cls(**values, where=below(where), for_joints=joints)
        mistakes.raise_all()
        return made


def declared(settings: type[Settings]) -> dict[str, Parameter]:
    """Return the parameters by attribute."""
    items = settings.__dataclass_fields__  # `fields` costs five times as much, sixty times a run
    return {name: item.default for name, item in items.items() if isinstance(item.default, Parameter)}


Known = Iterable[type[Settings] | str]
"""Parameters that a node reads: settings, and single names, "profile/velocity" within a group."""


def known_names(known: Known) -> set[str]:
    """Return the names of the parameters that a node reads."""
    return {
        name
        for item in known
        for name in ((item,) if isinstance(item, str) else (parameter.name for parameter in declared(item).values()))
    }


def refuse_unknown(content: Mapping[str, object], known: Iterable[str], where: str) -> None:
    """Refuse parameters of a node that are never read.

    Args:
        content: the node's parameters; groups are mappings.
        known: names that are read, "profile/velocity" within a group; the group's name if it is read as a whole.
        where: namespace of the node.

    Raises:
        ParameterError: lists each, with the names of the same group that are read.
    """
    mistakes, read = Mistakes(), set(known)
    for group, name in _unknown(content, read, ""):
        with mistakes.noted():
            valid = {full[len(group) :].split("/")[0] for full in read if full.startswith(group)}
            raise unknown("parameter", name, valid, f"{where.rstrip('/')}/{group}".rstrip("/") or "/")
    mistakes.raise_all()


def _unknown(content: Mapping[str, object], read: set[str], group: str) -> Iterator[tuple[str, str]]:
    """Return prefix and name of each parameter that is not read."""
    for name, value in content.items():
        full = f"{group}{name}"
        if full in read:
            continue
        if isinstance(value, Mapping) and any(other.startswith(f"{full}/") for other in read):
            yield from _unknown(value, read, f"{full}/")
        else:
            yield group, name


def below(where: str) -> str:
    """Return the prefix of a mapping's keys: its name and a slash if that is a ROS name, else a dot."""
    if where.endswith(":"):
        return f"{where} "
    if not where or where[-1] in "/.":
        return where
    return where + ("/" if "/" in where.rpartition(": ")[2] else ".")


def read_yaml(path: Path) -> Any:
    """Return the content of a YAML file, see `yaml_text`. Raises ParameterError: it cannot be read, or is refused."""
    from hric_core import yaml_text  # here: most of those who declare parameters read no file

    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    return yaml_text.parse(text, str(path))


@cache
def package_yaml(module: str, name: str) -> dict[str, Any]:
    """Return the content of a package's config/<name>.yaml, source or installed; shared, so do not change it.

    Args:
        module: `__file__` of one of the package's modules.
        name: file name without the extension.

    Raises:
        ParameterError: there is none, or it is not YAML.
    """
    folders = Path(module).resolve().parents
    package = [folder for folder in folders if (folder / "__init__.py").is_file()][-1].name
    for folder in (candidate for above in folders for candidate in (above, above / "share" / package)):
        if (path := folder / "config" / f"{name}.yaml").is_file():
            content: dict[str, Any] = read_yaml(path)
            return content
    raise ParameterError(f"{package}: config/{name}.yaml is not found")


def as_number(value: Any) -> float:
    """Return a finite number, also from the text 1e-3. Raises ValueError."""
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError
    return float(value)


def _integer(value: Any, where: str, joints: Sequence[str]) -> int:
    exact = value if isinstance(value, int) and not isinstance(value, bool) else as_number(value)
    if exact != int(exact):
        raise ValueError
    return int(exact)


def _flag(value: Any, where: str, joints: Sequence[str]) -> bool:
    if not isinstance(value, bool):
        raise ValueError
    return value


def _shape(**schema: Any) -> Callable[[], JsonSchema]:
    return lambda: dict(schema)


def number(default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a finite number."""
    shape = _shape(type="number")
    return Parameter(
        "float", "a finite number", lambda value, where, joints: as_number(value), default, shape=shape, **about
    )


def whole(default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a whole number."""
    return Parameter("int", "a whole number", _integer, default, shape=_shape(type="integer"), **about)


def flag(default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a boolean."""
    return Parameter("bool", "true or false", _flag, default, shape=_shape(type="boolean"), **about)


def text(
    default: Any = REQUIRED,
    *,
    valid: str = "a text",
    empty: bool = True,
    figures: bool = False,
    **about: Unpack[ParameterOptions],
) -> Any:
    """Declare a text or path; `empty`: may be empty; `figures`: also 4.1, a YAML number; `valid`: text for errors."""
    types = (Path, int, float) if figures else Path

    def convert(value: Any, where: str, joints: Sequence[str]) -> str:
        value = str(value) if isinstance(value, types) and not isinstance(value, bool) else value
        if not isinstance(value, str) or not (value or empty) or "\0" in value:
            raise ValueError
        return value

    shape = _shape(type=["string", "number"] if figures else "string", minLength=0 if empty else 1)
    return Parameter("string", valid if empty else f"{valid} that is not empty", convert, default, shape=shape, **about)


def choice(*valid: str, default: Any = ..., **about: Unpack[ParameterOptions]) -> Any:
    """Declare one of several words, by default the first."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> str:
        if not isinstance(value, str) or value not in valid:
            raise ValueError
        return value

    default = valid[0] if default is ... else default
    kind, shape = ", ".join(f"`{word}`" for word in valid), _shape(enum=list(valid))
    return Parameter(kind, ", ".join(valid), convert, default, shape=shape, **about)


def listing(
    of: Parameter,
    count: int | Iterable[int] = (),
    default: Any = REQUIRED,
    *,
    different: bool = False,
    single: bool = False,
    **about: Unpack[ParameterOptions],
) -> Any:
    """Declare a list of values of a kind, as a tuple; None counts as empty.

    `count`: number of values, any by default; `different`: no duplicates; `single`: a single value counts as a list.
    """
    counts = (count,) if isinstance(count, int) else tuple(count)

    def convert(value: Any, where: str, joints: Sequence[str]) -> tuple[Any, ...]:
        mistakes, result = Mistakes(), []
        for index, item in enumerate(_items(() if value is None else value, counts, single)):
            with mistakes.noted():
                result.append(of.checked(item, f"{where}[{_label(item, index)}]", joints))
        mistakes.raise_all()
        if different and len(set(result)) != len(result):
            raise ValueError
        return tuple(result)

    def shape() -> JsonSchema:
        return _one_or_list(schema_of(of), counts, single) | ({"uniqueItems": True} if different else {})

    kind = of.kind if of.kind.startswith("`") else f"{of.kind.split()[0]}s"
    accepts = f"a list of {_many(counts)}values, each {of.valid}{', all different' * different}"
    made = f"list of {_many(counts)}{kind}"
    return Parameter(made, accepts, convert, default, nested=of.nested, shape=shape, **about)


def _one_or_list(item: JsonSchema, counts: Sequence[int], single: bool) -> JsonSchema:
    length = {"minItems": min(counts), "maxItems": max(counts)} if counts else {}
    listed = {"type": ["array"] if counts else ["array", "null"], "items": item, **length}
    return {"anyOf": [item, listed]} if single else listed


def _items(value: Any, counts: Sequence[int], single: bool) -> Sequence[Any]:
    value = [value] if single and not isinstance(value, list | tuple) else value
    if not isinstance(value, list | tuple) or (counts and len(value) not in counts):
        raise ValueError
    return value


def _many(counts: Sequence[int]) -> str:
    few = " or ".join(map(str, counts)) if len(counts) < 4 else f"{counts[0]} to {counts[-1]}"
    return f"{few} " * bool(counts)


def _label(item: Any, index: int) -> Any:
    return item["name"] if isinstance(item, Mapping) and isinstance(item.get("name"), str) else index


def numbers(
    count: int | Iterable[int] = (), default: Any = REQUIRED, *, single: bool = False, **about: Unpack[ParameterOptions]
) -> Any:
    """Declare a list of finite numbers, as a tuple; `single`: a single number counts as a list."""
    counts = (count,) if isinstance(count, int) else tuple(count)

    def convert(value: Any, where: str, joints: Sequence[str]) -> tuple[float, ...]:
        return tuple(map(as_number, _items(value, counts, single)))

    many, shape = _many(counts), partial(_one_or_list, {"type": "number"}, counts, single)
    return Parameter(f"list of {many}floats", f"a list of {many}finite numbers", convert, default, shape=shape, **about)


def names(count: int | Iterable[int] | None = None, default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a list of different, non-empty texts, at least one, as a tuple; a single text counts as a list."""
    counts = () if count is None else (count,) if isinstance(count, int) else tuple(count)
    many, item = _many(counts), text(empty=False)
    made: Parameter = listing(item, counts or range(1, 1000), default, different=True, single=True, **about)
    made.kind, made.accepts = f"list of {many}strings", f"a list of {many}names, all different"
    return made


def anything(default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a parameter of any value."""
    return Parameter("any", "anything", lambda value, where, joints: value, default, **about)


def mapping(of: Parameter | None = None, default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a mapping of names to anything, or to values of a kind, as a shallow copy; None counts as empty."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> dict[str, object]:
        value = {} if value is None else value
        if not isinstance(value, Mapping) or any(not isinstance(key, str) for key in value):
            raise ValueError
        if of is None:
            return dict(value)
        mistakes, result = Mistakes(), {}
        for key, item in value.items():
            with mistakes.noted():
                result[key] = of.checked(item, f"{below(where)}{key}", joints)
        mistakes.raise_all()
        return result

    def shape() -> JsonSchema:
        return {"type": ["object", "null"], "additionalProperties": True if of is None else schema_of(of)}

    accepts = "a mapping of names to values" + (f", each {of.valid}" if of else "")
    return Parameter("mapping", accepts, convert, default, shape=shape, **about)


def section(of: type[Settings], default: Any = (), **about: Unpack[ParameterOptions]) -> Any:
    """Declare nested settings, by default with their own defaults."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> Settings:
        if isinstance(value, of):
            return value
        if value and not isinstance(value, Mapping):
            raise ValueError
        return of.of(value or None, where, joints)

    accepts = f"a mapping with {', '.join(parameter.name for parameter in declared(of).values())}"
    return Parameter("mapping", accepts, convert, default, nested=of, shape=partial(json_schema, of), **about)


def variant(
    key: str,
    kinds: Mapping[str, type[Settings]],
    usual: str = "",
    default: Any = REQUIRED,
    **about: Unpack[ParameterOptions],
) -> Any:
    """Declare nested settings of one of several kinds.

    Args:
        key: key of the mapping whose value selects the kind.
        kinds: settings class by value of that key.
        usual: kind that applies if the key is missing; empty: the key is required.
        default: value if the settings are missing.
        about: further options, see ParameterOptions.
    """

    def convert(value: Any, where: str, joints: Sequence[str]) -> Settings:
        if isinstance(value, Settings):
            return value
        if not isinstance(value or {}, Mapping):
            raise ValueError
        content = dict(value or {})
        word = content.pop(key, usual)
        if not isinstance(word, str) or word not in kinds:
            raise unknown(key, word, kinds, where)
        return kinds[word].of(content, where, joints)

    def shape() -> JsonSchema:
        forms = []
        for word, kind in kinds.items():
            form = json_schema(kind)
            form["properties"] = {key: {"const": word}, **form["properties"]}
            form["required"] = [key] * (word != usual) + form["required"]
            forms.append(form)
        return {"anyOf": forms}

    accepts = f"a mapping with {key}, one of {', '.join(kinds)}"
    return Parameter("mapping", accepts, convert, default, shape=shape, **about)


def per_joint(
    of: Parameter, default: Any = REQUIRED, *, others: Any = REQUIRED, **about: Unpack[ParameterOptions]
) -> Any:
    """Declare a value for each joint, as a tuple, from one for all, a list in the joints' order, or a mapping by joint.

    `others` is for joints that a mapping does not name, one value or a tuple of all; without it all must be named.
    """

    def convert(value: Any, where: str, joints: Sequence[str]) -> tuple[Any, ...]:
        if isinstance(value, Mapping):
            value = _by_joint(value, where, joints, others)
        elif not isinstance(value, list | tuple):
            return (of.checked(value, where),) * len(joints)
        if joints and len(value) != len(joints):
            raise refused(where, value, f"{len(joints)} values, for {', '.join(joints)}")
        labels = joints or range(len(value))
        return tuple(of.checked(item, f"{below(where)}{label}") for label, item in zip(labels, value, strict=True))

    def shape() -> JsonSchema:
        item = schema_of(of)
        lists = {"type": "array", "items": item}, {"type": "object", "additionalProperties": item}
        return {"anyOf": [item, *lists]}

    about.setdefault("unit", of.unit)
    accepts = f"{of.bounded}, or a list or mapping by joint"
    return Parameter(f"{of.type}, or list or mapping by joint", accepts, convert, default, shape=shape, **about)


def _by_joint(value: Mapping[str, object], where: str, joints: Sequence[str], others: Any) -> list[Any]:
    for name in value:
        if name not in joints:
            raise unknown("joint", name, joints, where)
    if others is REQUIRED and (missing := [joint for joint in joints if joint not in value]):
        raise ParameterError(
            f"{where} has nothing for {', '.join(missing)}; valid: a value for each of {', '.join(joints)}"
        )
    rest = others if isinstance(others, tuple) else [others] * len(joints)
    return [value.get(joint, other) for joint, other in zip(joints, rest, strict=True)]


def either(*kinds: Parameter, default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a value of the first matching kind."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> Any:
        for kind in kinds:
            with suppress(ValueError):
                return kind.converted(value, where, joints)
        raise ValueError

    def shape() -> JsonSchema:
        return {"anyOf": [schema_of(kind) for kind in kinds]}

    kind, accepts = " or ".join(k.type for k in kinds), ", or ".join(k.valid for k in kinds)
    return Parameter(kind, accepts, convert, default, shape=shape, **about)


def json_schema(settings: type[Settings]) -> JsonSchema:
    """Return the JSON schema of a mapping with these parameters; editors complete and check by it."""
    parameters = declared(settings).values()
    base = settings.defaults()
    required = [item.name for item in parameters if item.default is REQUIRED and item.name not in base]
    properties = {item.name: schema_of(item) for item in parameters}
    kind = "object" if required else ["object", "null"]
    return {"type": kind, "properties": properties, "required": required, "additionalProperties": False}


def schema_of(parameter: Parameter) -> JsonSchema:
    """Return the JSON schema of one parameter."""
    shape = parameter.shape()
    bounds = {
        name: bound
        for name, bound in (
            ("minimum", parameter.minimum),
            ("exclusiveMinimum", parameter.above),
            ("maximum", parameter.maximum),
        )
        if math.isfinite(bound)
    }
    inner = shape | {"items": shape["items"] | bounds} if "items" in shape else shape | bounds
    shown = {"description": parameter.text_with_unit.strip()} if parameter.text_with_unit else {}
    if parameter.default is None:
        inner = {"anyOf": [inner, {"type": "null"}]}
    elif parameter.default not in (REQUIRED, ()):
        with suppress(TypeError):
            shown["default"] = json.loads(json.dumps(parameter.default))
    return shown | inner


def rows(settings: type[Settings], prefix: str = "") -> list[tuple[str, str, str, str, str]]:
    """Return table cells: parameter, type with range, default, unit, description; sections by their members."""
    cells: list[tuple[str, str, str, str, str]] = []
    base = settings.defaults()
    for parameter in declared(settings).values():
        name = f"{prefix}{parameter.name}"
        if parameter.nested is not None and parameter.kind == "mapping":
            cells += rows(parameter.nested, f"{name}{settings.separator}")
            continue
        default = parameter.default_text or _shown(base.get(parameter.name, parameter.default))
        cells.append((f"`{name}`", parameter.type, default, parameter.unit, parameter.text))
    return cells


def _shown(value: Any) -> str:
    if value is REQUIRED or value is None or value == "":
        return "required" if value is REQUIRED else "none" if value is None else "empty"
    return f"`{value if isinstance(value, str) else json.dumps(value)}`"
