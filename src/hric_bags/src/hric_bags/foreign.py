"""Recognition of files that may be mistaken for a ROS 1 bag, with advice for each."""

from pathlib import Path

_MCAP = b"\x89MCAP0\r\n"
_FIRST: tuple[tuple[bytes, str], ...] = (
    (b"#ROSBAG V1", "a bag of an old version; `rosbag fix` of ROS 1 converts it to version 2.0"),
    (b"version https://git-lfs", "a pointer of Git LFS and not the bag; `git lfs pull` fetches the bag"),
    (b"SQLite format 3", "a bag of ROS 2 (SQLite); `rosbags-convert --src FOLDER --dst NAME.bag` converts it to ROS 1"),
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


def describe(path: Path) -> str:
    """Return what a file or folder is that is not a ROS 1 bag, with advice, as one line; "": it is not known."""
    try:
        if path.is_dir():
            folder = (path / "metadata.yaml").is_file() or any(path.glob("*.db3"))
            name = f"{path.name.removesuffix('.bag')}.bag"
            hint = f"a bag of ROS 2; `rosbags-convert --src {path} --dst {name}` converts it to ROS 1"
            return f"{path} is {hint}" if folder else ""
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except (FileNotFoundError, NotADirectoryError, PermissionError):  # the reader of the file reports it
        return ""
    for begin, kind in _FIRST:
        if head.startswith(begin):
            return f"{path} is {kind}"
    if head.startswith(_MCAP):
        return f"{path} is {_mcap(head)}"
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(_PAGE):
        return f"{path} is a web page and not a bag, perhaps the error of a download; download it again"
    return ""


def _mcap(head: bytes) -> str:
    """Return a text on an MCAP file, by the profile in its header, which follows the record's kind and length."""
    size = int.from_bytes(head[len(_MCAP) + 9 : len(_MCAP) + 13], "little")
    profile = head[len(_MCAP) + 13 :][: min(size, 16)].decode("utf-8", "replace")
    if profile == "ros1":
        return "an MCAP file of ROS 1, which `rosbags-convert` does not read; record or fetch it as .bag"
    kind = "of ROS 2" if profile == "ros2" else f"(profile {profile or 'none'})"
    return f"an MCAP file {kind}; `rosbags-convert --src FOLDER --dst NAME.bag` converts its folder with metadata.yaml"
