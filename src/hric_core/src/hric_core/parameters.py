"""Declaration, reading and checking of parameters. Each is declared once, with unit, range, default and description.

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

    LoopSettings.read(node)                         # from a Node: the declared names (ScopedNode refuses others)
    LoopSettings.read(node, joints=names)           # if the joints are not a parameter themselves
    LoopSettings.of(content, "run.yaml: loop")      # from a mapping: unknown keys are refused
    LoopSettings(rate=50.0, joints=["a"], kp=3.0)   # in Python: with the same checks, also by dataclasses.replace
    number(0.0, minimum=0.0, unit="s").read(node, "timeout")         # a single parameter
    number(minimum=0.0, unit="s").checked(value, "q.yaml: delay")    # a single value

Kinds of parameters: `number`, `whole` (integer), `flag` (bool), `text`, `choice` (one of several words), `numbers` (a
list of numbers), `names`, `listing` (a list of any kind), `mapping` (of names to anything, or to values of one kind),
`section` (nested Settings), `variant` (one of several Settings, selected by a key), `per_joint` (one value, a list, or
a mapping by joint), `either` (the first kind that fits), `anything`. A parameter without default is required; with
default None it may be left out. The other arguments of all kinds are those of `ParameterOptions`. A class may read
defaults from a file, in `Settings.defaults`.

Text such as 1e-3, which YAML 1.1 does not read as a number, counts as a number; a bool does not. NaN and infinity are
refused. A parameter without a maximum is refused above the largest realistic value of its unit (`magnitudes`).
Every refusal is a ParameterError with the full name, the value, and the valid values with their unit; all mistakes of a
mapping are reported at once.
`rows` returns the rows of a parameter table in INTERFACE.md, which tests/interface_tables.py writes into the pages.
`json_schema` returns a schema for editors.
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

from hric_core.errors import HricError, ParameterError, ParameterErrors, UnknownParameterError, listed
from hric_core.json_values import JsonSchema
from hric_core.magnitudes import first_beyond, largest, likely_unit
from hric_core.node import REQUIRED, Node

_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+")
LONGEST_SHOWN = 120
"""Largest number of characters of a value that an error message quotes in full."""
Convert = Callable[[Any, str, Sequence[str]], Any]
"""Function (value, full name, joint names) that returns the checked value; it refuses one by a ValueError."""


class ParameterOptions(TypedDict, total=False):
    """Options of parameters of all kinds.

    Attributes:
        unit: unit of the parameter's numbers.
        text: description for users.
        name: name of the parameter, if it differs from the attribute's name; "profile/velocity" is the parameter
            `velocity` in the group `profile`.
        made: function that converts the checked value to the type that the program uses, and returns a converted one
            unchanged. It refuses a value by a ValueError or HricError.
        default_text: text for the default in tables, if the value itself would mislead.
        minimum, above, maximum: range of the parameter's numbers; `above` is an exclusive lower bound.
        live: True if the parameter can be changed while the program runs (`hric_core.live.live_parameters`).
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
    """Collector of parameter errors, so that all are reported at once."""

    def __init__(self) -> None:
        self._errors: list[ParameterError] = []

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Record a ParameterError that is raised within the block, and continue after the block."""
        try:
            yield
        except ParameterError as error:
            self._errors.append(error)

    def raise_all(self) -> None:
        """Raise the recorded errors: one as it is, several as ParameterErrors; do nothing if there are none."""
        if self._errors:
            raise self._errors[0] if len(self._errors) == 1 else ParameterErrors(self._errors)


@dataclass(eq=False)
class Parameter:
    """Declared parameter, as created by `number`, `choice`, `section` and the other kinds in this module.

    Attributes:
        kind: type of the values, for tables, e.g. "float".
        accepts: description of the valid values, for error messages, e.g. "a finite number".
        convert: function that converts a raw value and refuses an invalid one.
        default: default value; REQUIRED if there is none.
        shape: function that returns the JSON schema of the values, without range and text; by default anything.
        nested: settings class of a section. For the other attributes see `ParameterOptions`.
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
        """Check a value and return it as the program uses it.

        Args:
            value: raw value; this Parameter itself if the value is not set.
            where: full name of the parameter, for error messages.
            joints: names of the joints, if there is one value per joint.

        Raises:
            ParameterError: the value is not valid.
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
        """Return the checked value of a node's parameter `name`. Raises ParameterError if it is not valid."""
        return self.checked(node.param(name, self), node.resolve(name), joints)

    def converted(self, value: Any, where: str, joints: Sequence[str]) -> Any:
        """Return the value, converted and checked for its range, before `made` is applied.

        Args:
            value: value as given.
            where: name of the parameter, for error messages.
            joints: names of the joints, for a value by joint.

        Raises:
            ValueError: the value is not valid; the caller names the parameter.
            ParameterError: an element of a list or mapping is not valid.
        """
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
        """Description of the valid values with their range, without unit, for error messages."""
        high = f" to {self.maximum:g}" if self.maximum < math.inf else ""
        low = f" above {self.above:g}" if self.above > -math.inf else ""
        if not low and self.minimum > -math.inf:
            low = f" from {self.minimum:g}" if high else f" of {self.minimum:g} or more"
        return self.accepts + (low or " up" * bool(high)) + high

    @property
    def valid(self) -> str:
        """Description of the valid values with range and unit, for error messages."""
        return self.bounded + (f" [{self.unit}]" if self.unit else "")

    @property
    def type(self) -> str:
        """Type of the values with their range, for tables, e.g. "float >= 0"."""
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
    """Return the error for an invalid value; `where`: full name; `valid`: description of the valid values."""
    return ParameterError(f"{where} is {_short(value)}; valid: {valid}")


def refuse_void(settings: "Settings", name: str, where: str, needed: str) -> None:
    """Refuse a value other than the default for a parameter that has no effect with the present settings.

    Args:
        settings: settings with the parameter.
        name: name of the parameter's attribute.
        where: prefix of the parameter's full name.
        needed: setting with which the parameter would have an effect, e.g. "friction: identified".

    Raises:
        ParameterError: the parameter differs from its default.
    """
    parameter, value = declared(type(settings))[name], getattr(settings, name)
    if value != parameter.checked(parameter.default, name):
        raise ParameterError(f"{where}{parameter.name} has no effect; valid: with {needed}")


def _short(value: Any) -> str:
    """Return the repr of a value on one line; of a long value its beginning and its length."""
    shown = repr(value)
    if len(shown) <= LONGEST_SHOWN:
        return shown
    of = "characters" if isinstance(value, str) else "values"
    length = f" ({len(value)} {of})" if hasattr(value, "__len__") else ""
    return f"{shown[: LONGEST_SHOWN // 2].rsplit(' ', 1)[0]} ...{length}"


def unknown(kind: str, name: object, valid: Iterable[str], where: str) -> ParameterError:
    """Return the ParameterError for a name that does not exist; for the arguments see `UnknownNameError`."""
    return UnknownParameterError(kind, name, valid, where)


@dataclass(frozen=True)
class Settings:
    """Base class of a group of parameters. A subclass is a frozen dataclass whose fields declare parameters.

    Args:
        where: prefix of the parameters' names in error messages.
        for_joints: names of the joints, for parameters with one value per joint; by default the field `joints`.
    """

    prefix: ClassVar[str] = ""
    """Prefix of the parameters' names in error messages, for later checks that involve several settings."""
    separator: ClassVar[str] = "/"
    """Separator between the name of a section and those of its parameters, in tables."""
    _: KW_ONLY
    where: InitVar[str] = ""
    for_joints: InitVar[Sequence[str]] = ()

    def __post_init__(self, where: str, for_joints: Sequence[str]) -> None:
        base = self.defaults()
        parameters = declared(type(self))
        mistakes = Mistakes()
        for attribute in sorted(parameters, key="joints".__ne__):  # joints first: values per joint need them
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
        """Return defaults by parameter name that replace the declared ones, e.g. those of a file."""
        return {}

    def check(self, where: str) -> None:
        """Raise `refused(...)` if values do not fit together; to be overridden. `where`: prefix of each full name."""

    @classmethod
    def read(cls, node: Node, joints: Sequence[str] = ()) -> Self:
        """Read the parameters from a node; `joints`: joint names. Raises ParameterError if a value is not valid."""
        values = {key: node.param(parameter.name, parameter) for key, parameter in declared(cls).items()}
        return cls(**values, where=f"{node.namespace.rstrip('/')}/", for_joints=joints)

    @classmethod
    def of(cls, content: Any, where: str, joints: Sequence[str] = ()) -> Self:
        """Read the parameters from a mapping.

        Args:
            content: content of a file or of the parameter server; None counts as empty, except for a whole file.
            where: name of the mapping, for error messages: "/arm/profile", "mocap.human", "world.yaml: objects[0]", or
                "world.yaml:" for a whole file.
            joints: names of the joints, for parameters with one value per joint.

        Raises:
            ParameterError: the content is not a mapping, has an unknown key, or a value that is not valid.
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
    """Return the declared parameters of a settings class by attribute name."""
    items = settings.__dataclass_fields__  # `fields` costs five times as much, sixty times a run
    return {name: item.default for name, item in items.items() if isinstance(item.default, Parameter)}


Known = Iterable[type[Settings] | str]
"""Parameters that a node reads: settings classes, and names of single ones ("profile/velocity" within a group)."""


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
        known: names that are read; "profile/velocity" within a group, or the group's name if it is read as a whole.
        where: namespace of the node.

    Raises:
        ParameterError: a parameter is never read; the message lists each one with the names that are read instead.
    """
    mistakes, read = Mistakes(), set(known)
    for group, name in _unknown(content, read, ""):
        with mistakes.noted():
            valid = {full[len(group) :].split("/")[0] for full in read if full.startswith(group)}
            raise unknown("parameter", name, valid, f"{where.rstrip('/')}/{group}".rstrip("/") or "/")
    mistakes.raise_all()


def _unknown(content: Mapping[str, object], read: set[str], group: str) -> Iterator[tuple[str, str]]:
    """Yield (group prefix, name) of each parameter that is not read."""
    for name, value in content.items():
        full = f"{group}{name}"
        if full in read:
            continue
        if isinstance(value, Mapping) and any(other.startswith(f"{full}/") for other in read):
            yield from _unknown(value, read, f"{full}/")
        else:
            yield group, name


def below(where: str) -> str:
    """Return the prefix of a mapping's keys: the mapping's name, then a slash if it is a ROS name, else a dot."""
    if where.endswith(":"):
        return f"{where} "
    if not where or where[-1] in "/.":
        return where
    return where + ("/" if "/" in where.rpartition(": ")[2] else ".")


def read_yaml(path: Path) -> Any:
    """Return the content of a YAML file, see `yaml_text`. Raises ParameterError if it is not readable or not valid."""
    from hric_core import yaml_text  # imported here: most modules that declare parameters read no file

    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    return yaml_text.parse(text, str(path))


@cache
def package_yaml(module: str, name: str) -> dict[str, Any]:
    """Return the content of a package's config/<name>.yaml, from its source or its installation.

    All callers get the same object: do not change it.

    Args:
        module: `__file__` of one of the package's modules.
        name: file name without the extension.

    Raises:
        ParameterError: the file does not exist, or is not valid YAML.
    """
    content: dict[str, Any] = read_yaml(package_path(module, name))
    return content


def package_path(module: str, name: str) -> Path:
    """Return the path of a package's config/<name>.yaml, in its source or its installation.

    Args:
        module: `__file__` of one of the package's modules.
        name: file name without the extension.

    Raises:
        ParameterError: the file does not exist.
    """
    folders = Path(module).resolve().parents
    package = [folder for folder in folders if (folder / "__init__.py").is_file()][-1].name
    for folder in (candidate for above in folders for candidate in (above, above / "share" / package)):
        if (path := folder / "config" / f"{name}.yaml").is_file():
            return path
    raise ParameterError(f"package {package} has no file config/{name}.yaml, neither in its source nor installed")


def as_number(value: Any) -> float:
    """Return a finite number as float; also of a text such as "1e-3". Raises ValueError for anything else."""
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
    """Declare a parameter whose value is a finite number, read as float."""
    shape = _shape(type="number")
    return Parameter(
        "float", "a finite number", lambda value, where, joints: as_number(value), default, shape=shape, **about
    )


def whole(default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a parameter whose value is a whole number."""
    return Parameter("int", "a whole number", _integer, default, shape=_shape(type="integer"), **about)


def flag(default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a parameter that is true or false."""
    return Parameter("bool", "true or false", _flag, default, shape=_shape(type="boolean"), **about)


def text(
    default: Any = REQUIRED,
    *,
    valid: str = "a text",
    empty: bool = True,
    figures: bool = False,
    **about: Unpack[ParameterOptions],
) -> Any:
    """Declare a parameter whose value is a text or path.

    `empty`: True if it may be empty; `figures`: True if an unquoted number such as 4.1 counts as text; `valid`:
    description of the valid values, for error messages."""
    types = (Path, int, float) if figures else Path

    def convert(value: Any, where: str, joints: Sequence[str]) -> str:
        value = str(value) if isinstance(value, types) and not isinstance(value, bool) else value
        if not isinstance(value, str) or not (value or empty) or "\0" in value:
            raise ValueError
        return value

    shape = _shape(type=["string", "number"] if figures else "string", minLength=0 if empty else 1)
    return Parameter("string", valid if empty else f"{valid} that is not empty", convert, default, shape=shape, **about)


def choice(*valid: str, default: Any = ..., **about: Unpack[ParameterOptions]) -> Any:
    """Declare a parameter whose value is one of several words, by default the first."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> str:
        if not isinstance(value, str) or value not in valid:
            raise ValueError
        return value

    default = valid[0] if default is ... else default
    kind, shape = ", ".join(f"`{word}`" for word in valid), _shape(enum=list(valid))
    return Parameter(kind, listed(valid), convert, default, shape=shape, **about)


def listing(
    of: Parameter,
    count: int | Iterable[int] = (),
    default: Any = REQUIRED,
    *,
    different: bool = False,
    single: bool = False,
    **about: Unpack[ParameterOptions],
) -> Any:
    """Declare a parameter whose value is a list of values of one kind, read as a tuple; None counts as empty.

    `of`: kind of the values; `count`: valid numbers of values, any by default; `different`: True if duplicates are
    refused; `single`: True if a single value counts as a list.
    """
    counts = (count,) if isinstance(count, int) else tuple(count)

    def convert(value: Any, where: str, joints: Sequence[str]) -> tuple[Any, ...]:
        mistakes, result = Mistakes(), []
        one = single and value is not None and not isinstance(value, list | tuple)
        for index, item in enumerate(_items(() if value is None else value, counts, single)):
            with mistakes.noted():
                result.append(of.checked(item, where if one else f"{where}[{_label(item, index)}]", joints))
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
    """Declare a list of finite numbers, read as a tuple; `single`: True if a single number counts as a list."""
    counts = (count,) if isinstance(count, int) else tuple(count)

    def convert(value: Any, where: str, joints: Sequence[str]) -> tuple[float, ...]:
        return tuple(map(as_number, _items(value, counts, single)))

    many, shape = _many(counts), partial(_one_or_list, {"type": "number"}, counts, single)
    return Parameter(f"list of {many}floats", f"a list of {many}finite numbers", convert, default, shape=shape, **about)


def names(count: int | Iterable[int] | None = None, default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a list of one or more different, non-empty texts, read as a tuple; a single text counts as a list."""
    counts = () if count is None else (count,) if isinstance(count, int) else tuple(count)
    many, item = _many(counts), text(empty=False)
    made: Parameter = listing(item, counts or range(1, 1000), default, different=True, single=True, **about)
    made.kind, made.accepts = f"list of {many}strings", f"a list of {many}names, all different"
    return made


def anything(default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a parameter with any value."""
    return Parameter("any", "anything", lambda value, where, joints: value, default, **about)


def mapping(of: Parameter | None = None, default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a mapping of names to anything, or to values of the kind `of`; it is copied (shallow); None: empty."""

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
    """Declare a parameter whose value is a group of settings, of class `of`; by default with their own defaults."""

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
    """Declare a parameter whose value is a group of settings, of one of several classes.

    Args:
        key: key of the mapping whose value selects the settings class.
        kinds: settings class by value of that key.
        usual: value of the key if it is missing; empty: the key is required.
        default: value of the parameter if it is not set.
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
    """Declare one value per joint: a value for all joints, a list in the joints' order, or a mapping by joint name.

    It is read as a tuple. `others`: value for joints that a mapping does not name, or a tuple of such values for all
    joints; without it a mapping must name all joints.
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
            f"{where} has no value for {', '.join(missing)}; valid: a value for each of {', '.join(joints)}"
        )
    rest = others if isinstance(others, tuple) else [others] * len(joints)
    return [value.get(joint, other) for joint, other in zip(joints, rest, strict=True)]


def either(*kinds: Parameter, default: Any = REQUIRED, **about: Unpack[ParameterOptions]) -> Any:
    """Declare a parameter with values of several kinds; the first kind that accepts a value converts it."""

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
    """Return the JSON schema of a mapping with these parameters, with which editors complete and check files."""
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
    shown |= {"unit": parameter.unit} if parameter.unit else {}
    if parameter.default is None:
        inner = {"anyOf": [inner, {"type": "null"}]}
    elif parameter.default not in (REQUIRED, ()):
        with suppress(TypeError):
            shown["default"] = json.loads(json.dumps(parameter.default))
    return shown | inner


def rows(settings: type[Settings], prefix: str = "") -> list[tuple[str, str, str, str, str]]:
    """Return table rows (name, type with range, default, unit, description) of the parameters, also in sections."""
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
