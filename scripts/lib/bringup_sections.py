"""Which sensors an experiment file describes."""

from __future__ import annotations

from pathlib import Path

import yaml


def described(name: str, experiment: str, having: tuple[str, ...]) -> bool:
    """Whether an experiment has a section.

    Args:
        name: of the section, such as mocap.
        experiment: its name, or the path of its file.
        having: names of the experiments of the workspace that have it.
    """
    return experiment in having or (experiment.endswith((".yaml", ".yml")) and has_section(Path(experiment), name))


def has_section(path: Path, name: str) -> bool:
    """Whether an experiment file has a section; what is wrong with the file is told elsewhere."""
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        return False
    return isinstance(content, dict) and bool(content.get(name))
