"""YAML that people write: what is refused has its line, and the rest is as YAML says."""

from pathlib import Path

import pytest

from hric_core import yaml_text
from hric_core.errors import ParameterError
from hric_core.parameters import read_yaml

BOMB = "a: &a [1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"{name}: &{name} [{','.join([f'*{before}'] * 9)}]\n" for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)
MERGE_BOMB = "a: &a {k0: 1}\n" + "".join(
    f"m{k}: &m{k} {{<<: [{','.join([f'*{before}'] * 9)}], k{k}: 1}}\n"
    for k, before in ((k, "a" if k == 1 else f"m{k - 1}") for k in range(1, 12))
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kp: 1\nkd: 2\nkp: 3\n", r"line 3: the key 'kp' is given twice, first on line 1"),
        ("a: {b: 1, c: 2, b: 3}\n", r"line 1: the key 'b' is given twice"),
        ("'a': 1\na: 2\n", r"line 2: the key 'a' is given twice"),
        ("1: a\n0x1: b\n", r"line 2: the key 1 is given twice"),
        ("yes: a\ntrue: b\n", r"line 2: the key True is given twice"),
        ("- {x: 1}\n- {x: {y: 1, y: 2}}\n", r"line 2: the key 'y'"),
        ("a: &a\n  b: *a\n", r"line 2: the anchor contains itself|line 1: the anchor contains itself"),
        ("a: &a [1, *a]\n", r"line 1: the anchor contains itself"),
        ("&a {x: &b {y: *a}}", r"the anchor contains itself"),
        (BOMB, r"line \d+: aliases of the anchor expand to more than 10000 values"),
        (MERGE_BOMB, r"line \d+: aliases of the anchor expand to more than 10000 values"),
        ("[" * 65 + "]" * 65, r"line 1: nested deeper than 64 levels"),
        ("[" * 300_000, r"line 1: nested deeper than 64 levels"),
        ("- " * 300_000 + "1", r"line 1: nested deeper than 64 levels"),
        ("? [1, 2]\n: 3\n", r"line 1: a key is a list or a mapping"),
        ("a: 1\nb: 2026-13-45\n", r"line 2: '2026-13-45' is not a valid timestamp \(.*\); write it in quotes"),
        ("mass: 070\n", r"line 1: 070 is 56, as YAML reads it; write it without a leading 0"),
        ("a: [1, -010]\n", r"line 1: -010 is -8, as YAML reads it"),
        ("a: !!float x\n", r"line 1: 'x' is not a valid float"),
        ("a: !!bool x\n", r"line 1: 'x' is not a valid bool"),
        ("a: !!timestamp x\n", r"line 1: 'x' is not a valid timestamp"),
        ("a: [1\nb: 2\n", r"t\.yaml is not YAML: .*line 2"),
        ("a: 1\n---\nb: 2\n", r"t\.yaml is not YAML: .*line 2"),
        ("!!python/object/apply:os.system [x]", r"t\.yaml is not YAML: .*could not determine a constructor"),
        ("a: *b\n", r"t\.yaml is not YAML: .*undefined alias.*line 1"),
        ("a: \0\n", r"t\.yaml is not YAML: "),
    ],
    ids=lambda text: text[:20],
)
def test_what_nobody_means_is_one_error_with_its_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "t.yaml").write_text(text)
    with pytest.raises(ParameterError, match=message) as caught:
        read_yaml(tmp_path / "t.yaml")
    assert str(caught.value).startswith(str(tmp_path / "t.yaml")) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("a: &x {b: 1}\nc: *x\n", {"a": {"b": 1}, "c": {"b": 1}}),
        ("a: &x {b: 1, d: 2}\nc: {<<: *x, b: 3}\n", {"a": {"b": 1, "d": 2}, "c": {"b": 3, "d": 2}}),
        ("1: a\n'1': b\n", {1: "a", "1": "b"}),
        ("[" * 64 + "]" * 64, None),
        ("a: ~\n", {"a": None}),
    ],
    ids=lambda text: str(text)[:20],
)
def test_what_is_meant_is_read(text: str, value: object) -> None:
    content = yaml_text.parse(text, "t.yaml")
    assert content == value if value is not None or not text else isinstance(content, list)
