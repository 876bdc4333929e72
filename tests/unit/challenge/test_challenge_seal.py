"""Answers sealed: equal bytes for equal answers, and nothing opened that is not what was promised."""

import json
import shutil
import zipfile

import pytest

from glider.tools.data.errors import InputError
from glider.tools.verify.challenge.judge import open_sealed
from glider.tools.verify.challenge.seal import MANIFEST, open_answers, seal, write_manifest

ANSWER = {"labels": ["drag"], "places": [[["hydrodynamics", "surge"]]], "before": [], "oracle": [], "runs": 6}


@pytest.fixture
def sealed(tmp_path):
    """A folder with one case and its held flights, sealed answers and a manifest."""
    for kind in ("cases", "held"):
        folder = tmp_path / kind / "case000"
        folder.mkdir(parents=True)
        (folder / "case.toml").write_text("format = 1\n")
    archive = tmp_path / "answers.zip"
    sha256 = seal(archive, {"seed": 3}, {"case000": ANSWER})
    write_manifest(tmp_path / MANIFEST, archive, sha256, tmp_path / "cases", tmp_path / "held")
    return tmp_path


def opened(folder, **how):
    return open_sealed(folder / "answers.zip", folder / MANIFEST, folder / "cases", folder / "held", **how)


def test_sealed_opens_and_gives_the_answers_back(sealed):
    found = opened(sealed)
    assert found.cases == {"case000": ANSWER}
    assert found.plan == {"seed": 3}
    assert "drag" not in (sealed / MANIFEST).read_text()


def test_equal_answers_are_equal_archives(tmp_path):
    hashes = [seal(tmp_path / name, {"seed": 3}, {"b": ANSWER, "a": ANSWER}) for name in ("x.zip", "y.zip")]
    assert hashes[0] == hashes[1]
    assert (tmp_path / "x.zip").read_bytes() == (tmp_path / "y.zip").read_bytes()
    assert seal(tmp_path / "z.zip", {"seed": 4}, {"b": ANSWER, "a": ANSWER}) != hashes[0]


def test_other_answers_are_not_opened(sealed):
    seal(sealed / "answers.zip", {"seed": 3}, {"case000": ANSWER | {"labels": ["lift"]}})
    with pytest.raises(InputError, match="declares"):
        opened(sealed)


@pytest.mark.parametrize("kind", ["cases", "held"])
def test_a_case_that_has_changed_is_noticed(sealed, kind):
    (sealed / kind / "case000" / "case.toml").write_text("format = 2\n")
    with pytest.raises(InputError, match="changed"):
        opened(sealed)


def test_held_flights_need_not_be_there_where_none_is_flown_on(sealed):
    shutil.rmtree(sealed / "held")
    assert opened(sealed, wanted=False).cases == {"case000": ANSWER}
    with pytest.raises(InputError, match="not there"):
        opened(sealed)
    (sealed / "cases" / "case000" / "case.toml").write_text("format = 2\n")
    with pytest.raises(InputError, match="changed"):
        opened(sealed, wanted=False)


def test_an_archive_needs_its_manifest(sealed):
    (sealed / MANIFEST).unlink()
    with pytest.raises(InputError, match="no manifest"):
        opened(sealed)


def test_a_folder_of_answers_is_read_as_it_is(tmp_path):
    (tmp_path / "case007.json").write_text(json.dumps(ANSWER))
    found = open_answers(tmp_path)
    assert list(found.cases) == ["case007"]
    assert found.sha256 is None


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("answers.zip", b"no archive", "not an archive"),
        ("case000.json", b"{", "not JSON"),
        ("case000.json", b"[]", "not a JSON object"),
        ("case000.json", b'{"labels": []}', "places"),
    ],
)
def test_what_is_no_answer_says_so(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        open_answers(tmp_path / name if name.endswith(".zip") else tmp_path)


def test_nothing_there_says_so(tmp_path):
    with pytest.raises(InputError, match="no answers"):
        open_answers(tmp_path)
    with pytest.raises(InputError, match="no such"):
        open_answers(tmp_path / "answers.zip")
    with zipfile.ZipFile(tmp_path / "empty.zip", "w"):
        pass
    with pytest.raises(InputError, match="no answers"):
        open_answers(tmp_path / "empty.zip")
