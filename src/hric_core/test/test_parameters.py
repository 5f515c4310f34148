"""Parameters: valid and refused values of each kind, from each source, and the error messages."""

from dataclasses import dataclass, replace

import jsonschema
import pytest
import yaml

from hric_core.errors import CommandError, ParameterError, ParameterErrors, message_about
from hric_core.local.node import LocalNode
from hric_core.parameters import (
    Settings,
    anything,
    choice,
    either,
    flag,
    json_schema,
    listing,
    mapping,
    names,
    number,
    numbers,
    per_joint,
    refused,
    rows,
    section,
    text,
    whole,
)

JOINTS = ("a", "b")


@dataclass(frozen=True)
class Profile(Settings):
    velocity: float = number(1.0, unit="rad/s", above=0.0, text="largest speed")
    steps: int = whole(5, minimum=1, maximum=10)


@dataclass(frozen=True)
class Arm(Settings):
    joints: tuple[str, ...] = names(text="in the order of all lists")
    kp: tuple[float, ...] = per_joint(number(unit="N m/rad", minimum=0.0), text="stiffness")
    mode: str = choice("fast", "exact")
    offset: tuple[float, ...] = numbers(3, (0.0, 0.0, 0.0), unit="m")
    profile: Profile = section(Profile)
    stages: tuple[Profile, ...] = listing(section(Profile), default=())
    inner: float = number(0.5, name="grasp/inner", maximum=1.0)
    file: str = text("", text="where it is kept")
    old: object = anything(None)
    setpoint: tuple[float, ...] | None = per_joint(number(), None, default_text="where it is")

    def check(self, where):
        if self.mode == "exact" and self.inner > 0.7:
            raise refused(f"{where}grasp/inner", self.inner, "up to 0.7 in mode exact")


@dataclass(frozen=True)
class Named(Settings):
    name: str = text()
    mass: float = number(0.0, minimum=0.0, unit="kg")


GIVEN = {"joints": ["a", "b"], "kp": 3}


def test_a_node_gives_the_declared_names_and_may_have_others():
    node = LocalNode({"arm": {**GIVEN, "type": "x/Y", "profile": {"steps": 2}, "grasp": {"inner": 0.25}}}).child("arm")
    arm = Arm.read(node)
    assert (arm.joints, arm.kp, arm.mode, arm.offset) == (JOINTS, (3.0, 3.0), "fast", (0.0, 0.0, 0.0))
    assert arm.profile == Profile(steps=2) and arm.inner == 0.25 and arm.setpoint is None
    assert number(1.0, minimum=0.0).read(node, "delay") == 1.0


def test_a_mapping_and_python_give_the_same():
    arm = Arm.of({**GIVEN, "stages": [{"steps": 1}, {}]}, "arm")
    assert arm == Arm(joints=JOINTS, kp=[3.0, 3.0], stages=(Profile(steps=1), Profile()))
    assert replace(arm, kp=(1, 2)).kp == (1.0, 2.0)
    assert Profile.of(None, "arm") == Profile()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"kp": -1}, "arm.kp is -1; valid: a finite number of 0 or more [N m/rad]"),
        ({"kp": [1, -2]}, "arm.kp.b is -2; valid: a finite number of 0 or more [N m/rad]"),
        ({"kp": [1]}, "arm.kp is [1]; valid: 2 values, for a, b"),
        ({"kp": {"a": 1}}, "arm.kp has no value for b; valid: a value for each of a, b"),
        ({"kp": {"a": 1, "bb": 1}}, "no joint 'bb' in arm.kp; valid: a, b (did you mean b?)"),
        ({"mode": "slow"}, "arm.mode is 'slow'; valid: fast, exact"),
        ({"mode": ["fast"]}, "arm.mode is ['fast']; valid: fast, exact"),
        ({"offset": [1, 2]}, "arm.offset is [1, 2]; valid: a list of 3 finite numbers [m]"),
        ({"offset": [1, 2, float("nan")]}, "arm.offset is [1, 2, nan]; valid: a list of 3 finite numbers [m]"),
        ({"profile": {"velocity": 0}}, "arm.profile.velocity is 0; valid: a finite number above 0 [rad/s]"),
        (
            {"profile": {"velocty": 1}},
            "no parameter 'velocty' in arm.profile; valid: steps, velocity (did you mean velocity?)",
        ),
        ({"profile": 3}, "arm.profile is 3; valid: a mapping with velocity, steps"),
        ({"stages": [{}, {"steps": 11}]}, "arm.stages[1].steps is 11; valid: a whole number from 1 to 10"),
        ({"stages": {}}, "arm.stages is {}; valid: a list of values, each a mapping with velocity, steps"),
        ({"grasp/inner": 2}, "arm.grasp/inner is 2; valid: a finite number up to 1"),
        ({"grasp/inner": 0.8, "mode": "exact"}, "arm.grasp/inner is 0.8; valid: up to 0.7 in mode exact"),
        ({"joints": []}, "arm.joints is []; valid: a list of names, all different"),
        ({"joints": ["a", "a"]}, "arm.joints is ['a', 'a']"),
        ({"file": True}, "arm.file is True; valid: a text"),
        (
            {"colour": 1},
            "no parameter 'colour' in arm; valid: file, grasp/inner, joints, kp, mode, offset, old, profile, "
            "setpoint, stages",
        ),
    ],
)
def test_a_refusal_names_the_parameter_the_value_and_what_is_valid(changes, said):
    with pytest.raises(ParameterError) as caught:
        Arm.of({**GIVEN, **changes}, "arm")
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize("wrong", ["fast", True, None, [1.0], float("nan"), float("inf"), 10**400, "1e999", "0.1", ""])
def test_what_is_no_finite_number_is_refused(wrong):
    with pytest.raises(ParameterError, match=r"/delay is .*; valid: a finite number \[s\]"):
        number(unit="s").checked(wrong, "/delay")


@pytest.mark.parametrize("wrong", [1.5, "x", True, "1e-3", float("inf")])
def test_what_is_no_whole_number_is_refused(wrong):
    with pytest.raises(ParameterError, match=r"/seed is .*; valid: a whole number of 0 or more"):
        whole(minimum=0).checked(wrong, "/seed")


def test_numbers_that_yaml_reads_as_text_are_numbers_everywhere():
    content = yaml.safe_load("{a: 1e-3, b: -2E+2, c: .5e1, d: [1e-3, 0], e: {a: 1e-3, b: 1}, f: 1e3}")
    assert isinstance(content["a"], str)
    assert [number().checked(content[key], key) for key in "abc"] == [1e-3, -200.0, 5.0]
    assert numbers(2).checked(content["d"], "d") == (1e-3, 0.0)
    assert per_joint(number()).checked(content["e"], "e", JOINTS) == (1e-3, 1.0)
    assert whole().checked(content["f"], "f") == 1000
    assert whole().checked(2**62 + 1, "f") == 2**62 + 1


def test_what_is_required_says_so():
    with pytest.raises(ParameterError, match=r"/arm/joints is not set; valid: a list of"):
        Arm.read(LocalNode({"arm": {}}).child("arm"))
    with pytest.raises(ParameterError, match=r"/delay is not set; valid: a finite number of 0 or more \[s\]"):
        number(unit="s", minimum=0.0).read(LocalNode(), "delay")


def test_the_place_is_told_as_its_source_writes_it():
    for where, name in (
        ("/ns/arm", "/ns/arm/steps"),
        ("plant/", "plant/steps"),
        ("a/b.yaml:", "a/b.yaml: steps"),
        ("a/b.yaml: x", "a/b.yaml: x.steps"),
    ):
        with pytest.raises(ParameterError) as caught:
            Profile.of({"steps": 0}, where)
        assert str(caught.value).startswith(f"{name} is 0; ")
    listing(section(Named)).checked([{"name": "ball"}], "w.yaml: objects")
    with pytest.raises(ParameterError, match=r"^w.yaml: objects\[ball\]\.mass is -1"):
        listing(section(Named)).checked([{"name": "ball", "mass": -1}], "w.yaml: objects")
    with pytest.raises(ParameterError, match=r"^w.yaml: objects\[1\]\.mass is -1"):
        listing(mapping(number(minimum=0.0))).checked([{"mass": 1}, {"mass": -1}], "w.yaml: objects")


def test_joints_that_a_mapping_leaves_out_get_what_is_said_for_others():
    assert per_joint(number(), others=0.0).checked({"b": 2}, "q", JOINTS) == (0.0, 2.0)
    assert per_joint(number(), others=(7.0, 8.0)).checked({"b": 2}, "q", JOINTS) == (7.0, 2.0)
    assert Profile.read(LocalNode()) == Profile()


def test_the_first_kind_that_fits_is_taken_and_a_mistake_within_it_is_told():
    kinds = either(flag(), listing(choice("soft", "hard")), section(Profile))
    assert [kinds.checked(given, "x") for given in (False, ["soft"], {"steps": 3})] == [
        False,
        ("soft",),
        Profile(steps=3),
    ]
    with pytest.raises(
        ParameterError, match=r"x is 5; valid: true or false, or a list of values, each soft, hard, or a mapping with"
    ):
        kinds.checked(5, "x")
    with pytest.raises(ParameterError, match=r"x\.steps is 0"):
        kinds.checked({"steps": 0}, "x")


def test_a_value_is_made_into_what_the_program_wants_or_refused_with_its_name():
    def parsed(value):
        if value == "bad":
            raise ValueError
        if value == "worse":
            raise CommandError("no such version")
        return value.upper()

    kind = text("x", made=parsed, valid="a version")
    assert kind.checked("y", "v") == "Y"
    with pytest.raises(ParameterError, match="v is 'bad'; valid: a version"):
        kind.checked("bad", "v")
    with pytest.raises(ParameterError, match="v is 'worse': no such version"):
        kind.checked("worse", "v")


def test_a_number_is_a_text_only_where_figures_may_be():
    assert text(figures=True).checked(4.1, "version") == "4.1"
    with pytest.raises(ParameterError, match=r"topic is 4.1; valid: a text"):
        text().checked(4.1, "topic")
    with pytest.raises(ParameterError, match="name is ''; valid: a text that is not empty"):
        text(empty=False).checked("", "name")


def test_the_defaults_of_a_file_go_before_the_declared_ones():
    class Filed(Profile):
        @classmethod
        def defaults(cls):
            return {"velocity": 3}

    assert (Filed().velocity, Filed.of({"velocity": 2}, "x").velocity, Filed().steps) == (3.0, 2.0, 5)
    assert rows(Filed)[0] == ("`velocity`", "float > 0", "`3`", "rad/s", "largest speed")


def test_a_table_has_a_row_for_each_parameter_and_those_of_its_sections():
    found = {name: cells for name, *cells in rows(Arm, "arm/")}
    assert found["`arm/joints`"] == ["list of strings", "required", "", "in the order of all lists"]
    assert found["`arm/kp`"] == ["float >= 0, or list or mapping by joint", "required", "N m/rad", "stiffness"]
    assert found["`arm/mode`"][:2] == ["`fast`, `exact`", "`fast`"]
    assert found["`arm/offset`"][:3] == ["list of 3 floats", "`[0.0, 0.0, 0.0]`", "m"]
    assert found["`arm/profile/steps`"][:2] == ["int >= 1, <= 10", "`5`"]
    assert found["`arm/grasp/inner`"][:2] == ["float <= 1", "`0.5`"]
    assert found["`arm/file`"][:2] == ["string", "empty"]
    assert found["`arm/setpoint`"][1] == "where it is"
    assert found["`arm/stages`"][:2] == ["list of mappings", "`[]`"]


def test_all_mistakes_of_a_mapping_are_told_at_once_and_one_alone_as_ever():
    parts = {"profile": {"steps": 0, "speed": 1}, "stages": [{"steps": 11}, 3]}
    given = {"joints": ["a"], "kp": -1, "mode": "slow", **parts}
    with pytest.raises(ParameterErrors) as caught:
        Arm.of(given, "arm")
    told = str(caught.value).splitlines()
    assert [line.split(" is ")[0].split(";")[0] for line in told] == [
        "arm.kp",
        "arm.mode",
        "no parameter 'speed' in arm.profile",
        "arm.profile.steps",
        "arm.stages[0].steps",
        "arm.stages[1]",
    ]
    with pytest.raises(ParameterError) as caught:
        Arm.of({**GIVEN, "mode": "slow"}, "arm")
    assert type(caught.value) is ParameterError and message_about("robot", caught.value) == f"robot: {caught.value}"
    with pytest.raises(ParameterError, match=r"^arm\.joints is 5; valid: a text that is not empty$"):
        Arm.of({"joints": 5, "kp": [1, 2]}, "arm")  # what is per joint cannot be judged


def test_the_schema_for_editors_says_what_the_reader_takes():
    schema = json_schema(Arm)
    assert schema["required"] == ["joints", "kp"] and schema["additionalProperties"] is False
    check = jsonschema.Draft202012Validator(schema)
    for given in (GIVEN, {**GIVEN, "kp": {"a": 1.0, "b": 2}, "profile": None, "stages": [{"steps": 1}, {}]}):
        assert check.is_valid(given) and Arm.of(given, "arm")
    for wrong in (
        {"kp": 3},
        {**GIVEN, "kp": -1},
        {**GIVEN, "mode": "slow"},
        {**GIVEN, "offset": [1, 2]},
        {**GIVEN, "profile": {"velocity": 0}},
        {**GIVEN, "stages": [{"steps": 1.5}]},
        {**GIVEN, "colour": "red"},
    ):
        assert not check.is_valid(wrong)
        with pytest.raises(ParameterError):
            Arm.of(wrong, "arm")


def test_an_error_shows_the_beginning_and_the_length_of_a_long_value():
    with pytest.raises(
        ParameterError, match=r"^x is \[0, 1, .* 16, \.\.\. \(50 values\); valid: a list of 3 finite numbers$"
    ):
        numbers(3).checked(list(range(50)), "x")
    with pytest.raises(ParameterError, match=r"^x is 'a{59} \.\.\. \(121 characters\); valid: b$"):
        choice("b").checked("a" * 121, "x")
