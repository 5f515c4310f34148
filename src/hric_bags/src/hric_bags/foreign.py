"""Recognition of bags: those that can be read, and files that may be mistaken for one, with advice for each."""

from pathlib import Path

_MCAP = b"\x89MCAP0\r\n"
_SQLITE = b"SQLite format 3"
_FIRST: tuple[tuple[bytes, str], ...] = (
    (b"#ROSBAG V1", "a bag of an old version; `rosbag fix` of ROS 1 converts it to version 2.0"),
    (b"version https://git-lfs", "a pointer of Git LFS and not the file; `git lfs pull` fetches it"),
    (b"\x1f\x8b", "compressed by gzip; `gunzip` it first"),
    (b"\xfd7zXZ\0", "compressed by xz; `unxz` it first"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd; `unzstd` it first"),
    (b"BZh", "compressed by bzip2; `bunzip2` it first"),
    (b"PK\x03\x04", "a zip archive; `unzip` it first"),
)
"""First bytes of a file -> its format and advice."""
_PAGE = (b"<!doctype", b"<html", b"<?xml")
_HEAD = 4096
"""Number of bytes that are read from the beginning of a file."""


def is_ros2(path: Path) -> bool:
    """Return True for a bag of ROS 2: a folder with metadata.yaml, a file of SQLite, or a file of MCAP of ROS 2."""
    try:
        if path.is_dir():
            return (path / "metadata.yaml").is_file() and not (path / "run.yaml").is_file()
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:  # the reader of the file reports it
        return False
    return path.suffix in (".db3", ".mcap") and (head.startswith(_SQLITE) or _profile(head) == "ros2")


def is_bag(path: Path) -> bool:
    """Return True if a path is that of a bag of ROS 1 by its extension, or a bag of ROS 2, and not a run folder."""
    return (path.suffix == ".bag" and not (path / "run.yaml").is_file()) or is_ros2(path)


def describe(path: Path) -> str:
    """Return what a file or folder is that is not a ROS 1 bag, with advice, as one line; "": it is not known."""
    try:
        if path.is_dir():
            if not is_ros2(path):
                return ""
            return _of_ros2(path)
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except (FileNotFoundError, NotADirectoryError, PermissionError):  # the reader of the file reports it
        return ""
    for begin, kind in _FIRST:
        if head.startswith(begin):
            return f"{path} is {kind}"
    if head.startswith(_SQLITE) or _profile(head) == "ros2":
        return _of_ros2(path)
    if head.startswith(_MCAP):
        return f"{path} is {_mcap(head)}"
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(_PAGE):
        return f"{path} is a web page and not the file, perhaps the error of a download; download it again"
    return ""


def _of_ros2(path: Path) -> str:
    """Return a text on a bag of ROS 2 that was passed as one of ROS 1."""
    if is_ros2(path):
        how = f"rosbags-convert --src {path} --dst NAME.bag"
        return f"{path} is a bag of ROS 2; valid: a bag of ROS 1, which `{how}` makes of it"
    return f"{path} is a bag of ROS 2; rename it to .db3 (SQLite) or .mcap, or `rosbags-convert` it to ROS 1"


def _profile(head: bytes) -> str:
    """Return the profile of an MCAP file, which follows kind and length of its first record; "": none, or not MCAP."""
    if not head.startswith(_MCAP):
        return ""
    size = int.from_bytes(head[len(_MCAP) + 9 : len(_MCAP) + 13], "little")
    return head[len(_MCAP) + 13 :][: min(size, 16)].decode("utf-8", "replace")


def _mcap(head: bytes) -> str:
    """Return a text on an MCAP file that is not of ROS 2."""
    profile = _profile(head)
    kind = "of ROS 1" if profile == "ros1" else f"of the profile {profile or 'none'}"
    return f"an MCAP file {kind}; valid: ROS 2; record or fetch it as .bag"
