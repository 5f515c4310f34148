"""Safe YAML loader for files and command lines; it refuses valid YAML that is certainly a mistake.

It refuses duplicate keys, octal numbers, an anchor that contains itself, aliases that expand to a huge number of
values, and nesting so deep that the stack of the C library would overflow.
"""

from typing import Any

import yaml

from hric_core.errors import ParameterError

MAX_DEPTH = 64
"""Largest number of nesting levels (project default, unconfirmed). The deepest file of the workspace has 12."""
MAX_ALIASED = 10_000
"""Largest number of values to which the aliases of one text may expand (project default, unconfirmed)."""


def parse(text: str, where: str) -> Any:
    """Return the content of a YAML text.

    Args:
        text: text of one YAML document.
        where: file or other source, for error messages.

    Raises:
        ParameterError: the text is not YAML, or is refused as a mistake; the message gives the line.
    """
    try:
        return _load(text)
    except _Refusal as refusal:
        raise ParameterError(f"{where}: {refusal}") from None
    except yaml.YAMLError as error:
        message = " ".join(str(error).replace('in "<unicode string>", ', "").split())
        raise ParameterError(f"{where} is not YAML: {message}") from None


class _Refusal(Exception):
    """Refusal of valid YAML that is a mistake; the message begins with the line number."""

    def __init__(self, node: Any, text: str) -> None:
        super().__init__(f"line {node.start_mark.line + 1}: {text}")


def _load(text: str) -> Any:
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):  # before the C library builds the nodes by recursion
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                raise _Refusal(event, f"nested deeper than {MAX_DEPTH} levels")
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
    loader = yaml.CSafeLoader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _Check(loader).walk(node)
        return loader.construct_document(node)
    finally:
        loader.dispose()


class _Check:
    """Check of a document's nodes for mistakes, in the order of the text."""

    def __init__(self, loader: yaml.CSafeLoader) -> None:
        self._loader = loader
        self._visited: set[int] = set()
        self._above: list[Any] = []
        self._aliased = 0

    def walk(self, node: yaml.Node) -> None:
        """Check a node and all nodes below it; raise _Refusal at the first mistake."""
        if id(node) in self._visited:
            self._count(node)
        self._visited.add(id(node))
        if isinstance(node, yaml.ScalarNode):
            self._value(node)
            return
        self._above.append(node)
        if isinstance(node, yaml.MappingNode):
            self._check_keys(node)
        for item in node.value:
            for part in item if isinstance(item, tuple) else (item,):
                self.walk(part)
        self._above.pop()

    def _count(self, node: yaml.Node) -> None:
        if any(above is node for above in self._above):
            raise _Refusal(node, "the anchor contains itself")
        self._aliased += 1
        if self._aliased > MAX_ALIASED or len(self._above) > MAX_DEPTH:
            limits = f"{MAX_ALIASED} values or {MAX_DEPTH} levels"
            raise _Refusal(node, f"aliases of the anchor expand to more than {limits}")

    def _value(self, node: yaml.ScalarNode) -> Any:
        if node.tag == "tag:yaml.org,2002:merge":
            return node.value
        if node.tag.endswith(":int") and node.value.lstrip("+-")[:1] == "0" and node.value.lstrip("+-0_").isdigit():
            raise _Refusal(
                node, f"{node.value} is {int(node.value, 8)}, as YAML reads it; write it without a leading 0"
            )
        try:
            return self._loader.construct_object(node)
        except yaml.YAMLError:
            raise
        except Exception as error:  # constructors raise different errors on a text that does not fit the tag
            kind = node.tag.rpartition(":")[2]
            raise _Refusal(node, f"{node.value!r} is not a valid {kind} ({error}); write it in quotes") from None

    def _check_keys(self, node: yaml.MappingNode) -> None:
        lines: dict[Any, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _Refusal(key, "a key is a list or a mapping; valid: a text or a number")
            name = self._value(key)
            if name in lines:
                raise _Refusal(key, f"the key {name!r} is given twice, first on line {lines[name]}")
            lines[name] = key.start_mark.line + 1
