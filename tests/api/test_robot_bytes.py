"""Robot files as bytes: encodings, sizes, and paths that are no regular files."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import armlet as al

BODY = """<robot name="r"><!-- %s -->
<link name="b"/><link name="l"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
<joint name="%s" type="revolute"><parent link="b"/><child link="l"/><axis xyz="0 1 0"/>%s</joint></robot>"""


def text(encoding: str | None, name: str = "j", more: str = "", comment: str = "") -> str:
    declaration = '<?xml version="1.0"?>' if encoding is None else f"<?xml version='1.0' encoding = '{encoding}' standalone=\"yes\"?>"
    return f"{declaration}\r\n{BODY % (comment, name, more)}"


#: The bytes of a file, and the name of its joint.
READ: dict[str, tuple[bytes, str]] = {
    "UTF-8 with mark": (b"\xef\xbb\xbf" + text("UTF-8", "träger").encode(), "träger"),
    "latin-1": (text("ISO-8859-1", "träger").encode("latin-1"), "träger"),
    "windows-1252": (text("windows-1252", "träger €").encode("cp1252"), "träger €"),
    "GB2312": (text("gb2312", "机械臂").encode("gb2312"), "机械臂"),
    "GBK": (text("GBK", "機械臂").encode("gbk"), "機械臂"),
    "Shift_JIS": (text("Shift_JIS", "ロボット").encode("shift_jis"), "ロボット"),
    "UTF-16 with mark": (text("UTF-16", "機械").encode("utf-16"), "機械"),
    "UTF-16 of PowerShell": (("\ufeff" + text(None, "機械")).encode("utf-16-le"), "機械"),
    "UTF-16, big end first": (("\ufeff" + text("utf-16", "機械")).encode("utf-16-be"), "機械"),
    "UTF-16 without mark": (text("UTF-16LE", "機械").encode("utf-16-le"), "機械"),
    "UTF-16 without mark, big end first": (text(None, "機械").encode("utf-16-be"), "機械"),
    "UTF-32 with mark": (text("UTF-32", "機械").encode("utf-32"), "機械"),
    # Programs that convert files may keep a wrong declaration.
    "UTF-16 in the declaration alone": (text("UTF-16", "träger").encode(), "träger"),
    "GB2312 in the declaration alone": (text("ascii", "träger").encode(), "träger"),
    "unknown encoding": (text("x-own", "träger").encode(), "träger"),
    "codec of Python that is no encoding": (text("punycode", "träger").encode(), "träger"),
    "transformation of Python": (text("rot13", "j").encode(), "j"),
}


@pytest.mark.parametrize("name", READ)
def test_encodings(name: str, tmp_path: Path) -> None:
    content, joint = READ[name]
    path = tmp_path / "robot.urdf"
    path.write_bytes(content)
    for given in (path, str(path)):
        assert al.load_urdf(given).joint_names == (joint,)
    law = {"kind": "PDGravity", "target": [0.1], "kp": 10.0, "kd": 5.0}
    run = {"q0": [0.0], "t_end": 0.1, "dt": 0.01}
    scenario = al.Scenario({"arm": {"kind": "urdf", "path": str(path)}, "law": law, "run": run}).standalone()
    assert al.load_urdf(scenario.data["arm"]["xml"]).joint_names == (joint,)
    # The robot file with a group is also an SRDF.
    codec = ENCODED.get(name, "utf-8")
    grouped = content.decode(codec).replace("<link name", f'<group name="g"><joint name="{joint}"/></group><link name', 1)
    path.with_suffix(".srdf").write_bytes(grouped.encode(codec))
    assert al.load_srdf(path.with_suffix(".srdf")).arm(path, "g").joint_names == (joint,)


#: The codec of the bytes of `READ`, where it is not UTF-8.
ENCODED = {
    "latin-1": "latin-1",
    "windows-1252": "cp1252",
    "GB2312": "gb2312",
    "GBK": "gbk",
    "Shift_JIS": "shift_jis",
    "UTF-16 with mark": "utf-16",
    "UTF-16 of PowerShell": "utf-16",
    "UTF-16, big end first": "utf-16-be",
    "UTF-16 without mark": "utf-16-le",
    "UTF-16 without mark, big end first": "utf-16-be",
    "UTF-32 with mark": "utf-32",
}


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16", "gb2312", "utf-8"])
def test_errors_name_the_line_of_the_file(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(text(encoding, "j", "\n\n<limit lower='x'/>").encode(encoding))
    with pytest.raises(al.ModelError, match=r"lower of limit is not a number") as caught:
        al.load_urdf(path)
    # The declaration is line 1, and the joint is in line 4.
    assert (caught.value.line, caught.value.file) == (6, str(path))


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        (text(None, "träger").encode("latin-1"), 4, "is not UTF-8 text"),
        (text("gb2312", "机械臂").encode("gb2312")[:-190] + b"\xff" + b"</robot>", 3, "is not UTF-8 text"),
        (text("UTF-16", "j").encode("utf-16") + b"\x00", 4, "is not UTF-16 text"),
        (text(None).encode() + b"\0", 4, "is not well-formed"),
        (b"\xff\xfe", 1, "is not well-formed"),
        (b"", 1, "is not well-formed"),
        (b"<robot><!--" + b" " * (16 << 20), 1, "is too large: expected at most 16777216 bytes"),
    ],
)
def test_bytes_that_are_no_text_are_refused(content: bytes, line: int, words: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(content)
    with pytest.raises(al.ModelError, match=words) as caught:
        al.load_urdf(path)
    assert (caught.value.line, caught.value.file) == (line, str(path))


NESTED = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="r"><group name="&b;"><joint name="j"/></group></robot>'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-7", "cp037"])
@pytest.mark.parametrize("before", ["", "\n", "<?xml version='1.0' encoding='%s'?>"])
def test_no_encoding_hides_the_document_type_of_an_srdf(encoding: str, before: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.srdf"
    path.write_bytes(((before % encoding if "%" in before else before) + NESTED).encode(encoding))
    with pytest.raises(al.InputError, match=r"declares a document type|is not well formed|cannot be read"):
        al.load_srdf(path)


@pytest.mark.parametrize("first", ["", "\n"])
def test_zero_characters_do_not_hide_the_document_type_of_an_srdf(first: str, tmp_path: Path) -> None:
    """The parser of Python's library takes a text with zero characters for UTF-16."""
    path = tmp_path / "robot.srdf"
    path.write_bytes("".join(c + "\0" for c in first + NESTED).encode("utf-16"))
    with pytest.raises(al.InputError, match=r"is not well formed: expected no zero character"):
        al.load_srdf(path)


def test_the_size_of_an_srdf_is_limited() -> None:
    for filling in ("x" * (16 << 20), "\u6a5f" * (6 << 20)):
        with pytest.raises(al.InputError, match=r"^load_srdf: path_or_xml is too large: expected at most 16777216 bytes"):
            al.load_srdf(f"<robot name='r'><!--{filling}--></robot>")


READERS = ["al.load_urdf(p)", "al.load_srdf(p)", "al.Scenario.load(p)", "al.load(p)", "al.load_srdf(S).arm(p, 'g')"]


@pytest.mark.parametrize("call", READERS)
def test_a_pipe_is_refused_at_once(call: str, tmp_path: Path) -> None:
    pipe = tmp_path / "robot.urdf"
    os.mkfifo(pipe)
    code = f"""
import sys, armlet as al
p, S = sys.argv[1], "<robot><group name='g'><joint name='j'/></group></robot>"
try:
    {call}
except (al.InputError, OSError) as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-P", "-c", code, str(pipe)], capture_output=True, text=True, timeout=60.0)
    assert "is not a regular file" in done.stdout, done.stdout + done.stderr


def test_a_pipe_in_a_folder_of_a_sweep_or_of_c_code_is_refused(tmp_path: Path) -> None:
    from armlet.files import open_regular

    pipe = tmp_path / "x"
    os.mkfifo(pipe)
    for path in (pipe, "/dev/zero"):
        with pytest.raises(OSError, match=r"is not a regular file"):
            open_regular(path)
    with pytest.raises(IsADirectoryError):
        open_regular(tmp_path)


def test_what_else_a_path_may_be(tmp_path: Path) -> None:
    with pytest.raises(al.InputError, match=r"got six_axis .*; al.example_urdf.'six_axis'. is the text of an example"):
        al.load_urdf("six_axis")
    with pytest.raises(al.ModelError, match=r"is a model of MuJoCo .MJCF.: expected URDF; load it with mujoco, then from_mujoco"):
        al.load_urdf("<mujoco model='m'><worldbody/></mujoco>")
    cases: list[Any] = [tmp_path, "a\0b.urdf", tmp_path / "none.urdf"]
    for path in cases:
        with pytest.raises(al.InputError, match=r"^load_urdf: path_or_xml cannot be read: expected a URDF file or its text"):
            al.load_urdf(path)
