import sys
import textwrap
import threading
from pathlib import Path

import pytest

from hric_core import plugins
from hric_core.errors import HricError, UnknownNameError

CLASS = (
    '<class name="{name}" type="{type}" base_class_type="{base}"><description> Does\n things. </description></class>'
)


class Workspace:
    """Folder with packages, the only one in ROS_PACKAGE_PATH."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def package(
        self,
        name: str,
        *classes: str,
        module: str = "",
        export: str = "plugins.xml",
        library: str = "lib",
        folder: str = "",
    ) -> Path:
        place = self.root / (folder or name)
        (place / "lib").mkdir(parents=True)
        (place / "package.xml").write_text(
            f'<package format="3"><name>{name}</name><export><hric_control '
            f'plugin="${{prefix}}/{export}"/></export></package>'
        )
        (place / "plugins.xml").write_text(f'<library path="{library}">{"".join(classes)}</library>')
        (place / "lib" / f"{name}_module.py").write_text(textwrap.dedent(module))
        plugins.clear_cache()
        return place


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)
    plugins.clear_cache()
    yield Workspace(tmp_path)
    plugins.clear_cache()
    for name in set(sys.modules) - before:
        if name.endswith("_module"):
            del sys.modules[name]


def controller(name: str, kind: str, base: str = plugins.CONTROLLER) -> str:
    return CLASS.format(name=name, type=kind, base=base)


MODULE = """
    from hric_control.controller import Controller
    class Law(Controller):
        version = 1
    class Stranger:
        pass
"""


def test_a_class_is_found_under_each_of_its_names(workspace: Workspace) -> None:
    workspace.package(
        "aa", controller("aa/Law", "aa_module:Law"), controller("other/Alias", "aa_module:Law"), module=MODULE
    )
    assert plugins.find(plugins.CONTROLLER, "aa/Law").__name__ == "Law"
    assert plugins.find(plugins.CONTROLLER, "other/Alias") is plugins.find(plugins.CONTROLLER, "aa/Law")
    info = plugins.names(plugins.CONTROLLER)["aa/Law"]
    assert (info.package, info.type, info.description) == ("aa", "aa_module:Law", "Does things.")


def test_an_unknown_name_is_refused_with_the_names_that_exist(workspace: Workspace) -> None:
    workspace.package("ab", controller("ab/Law", "ab_module:Law"), module=MODULE)
    with pytest.raises(UnknownNameError, match=r"no hric_control::Controller 'ab/Low'.*valid: ab/Law"):
        plugins.find(plugins.CONTROLLER, "ab/Low")


def test_a_package_that_comes_while_the_program_runs_is_found(workspace: Workspace, tmp_path: Path) -> None:
    workspace.package("ac", controller("ac/Law", "ac_module:Law"), module=MODULE)
    plugins.find(plugins.CONTROLLER, "ac/Law")
    (tmp_path / "ac").rename(tmp_path / "later")
    text = (tmp_path / "later/package.xml").read_text().replace(">ac<", ">later<")
    (tmp_path / "later/package.xml").write_text(text)
    (tmp_path / "later/plugins.xml").write_text(
        f'<library path="lib">{controller("later/Law", "ac_module:Law")}</library>'
    )
    assert plugins.find(plugins.CONTROLLER, "later/Law").__name__ == "Law"


def test_an_unknown_base_is_refused_with_the_bases_that_exist() -> None:
    with pytest.raises(UnknownNameError, match="hric_control::Plant"):
        plugins.names("hric_control::Nothing")


def test_a_broken_plugin_file_hides_no_other_package_and_is_told_when_a_name_is_missing(workspace: Workspace) -> None:
    broken = workspace.package("ac", module=MODULE)
    (broken / "plugins.xml").write_text("<library><class")
    workspace.package("ad", controller("ad/Law", "ad_module:Law"), module=MODULE)
    assert plugins.find(plugins.CONTROLLER, "ad/Law")
    with pytest.raises(UnknownNameError, match=r"could not be read: .*ac/plugins\.xml"):
        plugins.find(plugins.CONTROLLER, "ac/Law")


def test_an_export_without_its_file_is_told_when_a_name_is_missing(workspace: Workspace) -> None:
    workspace.package("ae", module=MODULE, export="gone.xml")
    with pytest.raises(UnknownNameError, match=r"ae/gone\.xml"):
        plugins.find(plugins.CONTROLLER, "ae/Law")


def test_a_class_without_a_base_is_told_with_the_bases_that_exist(workspace: Workspace) -> None:
    workspace.package(
        "af", controller("af/Law", "af_module:Law", base="controller_interface::ControllerBase"), module=MODULE
    )
    with pytest.raises(UnknownNameError, match=r"'af/Law' needs type.*hric_control::Controller"):
        plugins.find(plugins.CONTROLLER, "af/Law")


def test_an_error_while_importing_is_told_with_module_and_package(workspace: Workspace) -> None:
    workspace.package("ag", controller("ag/Law", "ag_module:Law"), module="import no_such_thing")
    with pytest.raises(HricError, match=r"cannot import module ag_module of package ag: .*no_such_thing"):
        plugins.find(plugins.CONTROLLER, "ag/Law")


def test_a_module_without_the_class_is_told(workspace: Workspace) -> None:
    workspace.package("ah", controller("ah/Law", "ah_module:Low"), module=MODULE)
    with pytest.raises(HricError, match=r"ah_module has no class 'Low'"):
        plugins.find(plugins.CONTROLLER, "ah/Law")


def test_a_class_with_another_base_is_refused(workspace: Workspace) -> None:
    workspace.package("ai", controller("ai/Stranger", "ai_module:Stranger"), module=MODULE)
    with pytest.raises(HricError, match=r"ai_module:Stranger is not a hric_control::Controller"):
        plugins.find(plugins.CONTROLLER, "ai/Stranger")


def test_a_name_exported_twice_belongs_to_the_first_package_and_the_second_is_told(workspace: Workspace) -> None:
    workspace.package("aj", controller("same/Law", "aj_module:Law"), module=MODULE)
    workspace.package("ak", controller("same/Law", "ak_module:Law"), module=MODULE)
    assert plugins.names(plugins.CONTROLLER)["same/Law"].package == "aj"
    with pytest.raises(UnknownNameError, match=r"same/Law is exported by .*aj/plugins\.xml already"):
        plugins.find(plugins.CONTROLLER, "none/Law")


def test_an_earlier_path_overlays_a_package_of_the_same_name(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace.package("al", controller("al/Law", "al_module:Law"), module=MODULE, folder="over/al")
    workspace.package("al", controller("al/Old", "al_module:Law"), module=MODULE, folder="under/al")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{workspace.root}/over:{workspace.root}/under:{workspace.root}/absent")
    assert set(plugins.names(plugins.CONTROLLER)) == {"al/Law"}


def test_a_folder_with_catkin_ignore_is_not_searched(workspace: Workspace) -> None:
    place = workspace.package("am", controller("am/Law", "am_module:Law"), module=MODULE)
    (place / "CATKIN_IGNORE").touch()
    assert plugins.names(plugins.CONTROLLER) == {}


def test_reloading_picks_up_changed_code_and_new_names(workspace: Workspace) -> None:
    place = workspace.package("an", controller("an/Law", "an_module:Law"), module=MODULE)
    assert plugins.find(plugins.CONTROLLER, "an/Law").version == 1  # type: ignore[attr-defined]
    (place / "lib" / "an_module.py").write_text(textwrap.dedent(MODULE).replace("version = 1", "version = 22"))
    (place / "plugins.xml").write_text(f'<library path="lib">{controller("an/New", "an_module:Law")}</library>')
    assert plugins.reload() == ["an_module"]
    assert plugins.find(plugins.CONTROLLER, "an/New").version == 22  # type: ignore[attr-defined]


def test_an_error_while_reloading_is_told_with_the_module(workspace: Workspace) -> None:
    place = workspace.package("ao", controller("ao/Law", "ao_module:Law"), module=MODULE)
    plugins.find(plugins.CONTROLLER, "ao/Law")
    (place / "lib" / "ao_module.py").write_text("this is no Python")
    with pytest.raises(HricError, match=r"cannot reload module ao_module of package ao: SyntaxError"):
        plugins.reload()


def test_without_a_package_path_the_workspace_of_this_file_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    plugins.clear_cache()
    assert "hric_controllers/JointPDController" in plugins.names(plugins.CONTROLLER)


def test_each_file_of_this_workspace_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[str] = []
    parse = plugins.ET.parse
    monkeypatch.setattr(plugins.ET, "parse", lambda path: parsed.append(str(path)) or parse(path))
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    plugins.clear_cache()
    for base in (plugins.CONTROLLER, plugins.PLANT, plugins.CONTROLLER):
        assert plugins.names(base)
    assert parsed and len(parsed) == len(set(parsed))


def test_threads_that_look_for_plugins_at_the_same_time_import_one_module_after_the_other(workspace: Workspace) -> None:
    slow = (
        MODULE
        + """
    import time
    begin = time.monotonic()
    time.sleep(0.1)
    end = time.monotonic()
"""
    )
    for name in ("aa", "bb"):
        workspace.package(name, controller(f"{name}/Law", f"{name}_module:Law"), module=slow)
    threads = [threading.Thread(target=plugins.find, args=(plugins.CONTROLLER, f"{name}/Law")) for name in ("aa", "bb")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    first, second = sorted((sys.modules["aa_module"], sys.modules["bb_module"]), key=lambda module: module.begin)
    assert first.end <= second.begin
