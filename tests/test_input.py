"""Files of users are regular, whole and of bounded size."""

import os

import pytest

from quakedesign.errors import CertificateError, OutputError, ScenarioError
from quakedesign.files import discard_all, parse_toml, read_text, require_writable


def read(path):
    return read_text(path, "it", largest=2048, refusal=ScenarioError)


def test_a_file_of_the_largest_size_is_read(tmp_path):
    (tmp_path / "a").write_text("ä" * 1024, encoding="utf-8")
    assert read(tmp_path / "a") == read(str(tmp_path / "a")) == "ä" * 1024


def test_what_is_no_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "large").write_bytes(b"a" * 2049)
    (tmp_path / "latin").write_bytes(b"\xe9")
    said = {
        "pipe": "regular file",
        "zero": "regular file",
        "loop": "Too many levels",
        "large": "at most 2 KiB",
        "latin": "must be UTF-8 text",
        ".": "Is a directory|regular file",
        "none": "No such file",
        "x" * 5000: "File name too long",
        "nul\0": "no file can have this name",
    }
    for name, reason in said.items():
        with pytest.raises(ScenarioError, match=f"^it .*({reason})") as raised:
            read(tmp_path / name)
        assert len(str(raised.value)) < 500


def test_certificates_are_read_alike(tmp_path):
    from quakedesign.lyapunov import load_certificate

    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(CertificateError, match="must be a regular file"):
        load_certificate(tmp_path / "pipe.json")


@pytest.mark.parametrize("name", ["a" * 300, chr(0x1D49C) * 60, "nul\0", "x/" * 3000 + "y"])
def test_a_place_that_cannot_be_is_refused_before_the_work(name, tmp_path):
    with pytest.raises(OutputError, match=r"must have a name of at most 200 bytes|folder that can be written"):
        require_writable(tmp_path / name)
    assert list(tmp_path.iterdir()) == []
    discard_all()  # nothing is kept of a place that cannot be


def test_the_longest_name_has_room_for_its_neighbours(tmp_path):
    from quakedesign.files import whole_folder

    target = tmp_path / ("a" * 200)
    for _ in range(2):
        require_writable(target)
        with whole_folder(target) as partial:
            (partial / "file").write_text("x")
    assert [p.name for p in tmp_path.iterdir()] == [target.name]


@pytest.mark.parametrize(
    "text", ["a." * 32_000 + "a = 1", "[" + "a." * 32_000 + "a]", "x = {" + "a." * 32_000 + "a = 1}"]
)
def test_a_key_of_many_parts_is_refused_before_it_is_read(text):
    """Memory grows as the square of the parts: 4.1 GB."""
    with pytest.raises(ValueError, match=r"a line may have at most 400 dots, line 1 has 32000"):
        parse_toml(text)


def test_toml_is_read_as_the_standard_library_reads_it():
    assert parse_toml("a.b = 1\n[c]\nd = '...'") == {"a": {"b": 1}, "c": {"d": "..."}}
    for wrong in ("a =", "x = " + "[" * 5000):
        with pytest.raises(ValueError, match=r".+"):
            parse_toml(wrong)


@pytest.mark.parametrize(("largest", "said"), [(2**20, "1 MiB"), (3 * 2**20, "3 MiB"), (2**19, "512 KiB")])
def test_the_largest_size_is_told_in_its_unit(tmp_path, largest, said):
    (tmp_path / "large").touch()
    os.truncate(tmp_path / "large", largest + 1)
    with pytest.raises(ScenarioError, match=f"^it must be at most {said}. Received"):
        read_text(tmp_path / "large", "it", largest=largest, refusal=ScenarioError)


def test_a_byte_order_mark_is_no_text_where_one_may_stand(tmp_path):
    (tmp_path / "marked").write_bytes(b"\xef\xbb\xbfa")
    more = {"largest": 9, "refusal": ScenarioError}
    assert read_text(tmp_path / "marked", "it", **more) == "a"
    assert read_text(tmp_path / "marked", "it", **more, marked=False) == "\ufeffa"


def test_a_line_with_as_many_dots_as_it_may_have_is_read():
    assert parse_toml(f'a = "{"." * 400}"') == {"a": "." * 400}
    with pytest.raises(ValueError, match=r"at most 400 dots, line 2 has 401"):
        parse_toml(f'\na = "{"." * 401}"')
