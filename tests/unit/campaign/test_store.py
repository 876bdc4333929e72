"""The folder of a campaign: whole files only, resumed by its own campaign only."""

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.study.campaign.conduct import fly_campaign
from glider.tools.study.campaign.fingerprint import fingerprint
from glider.tools.study.campaign.flights import COLUMNS, cut
from glider.tools.study.campaign.store import MANIFEST, Store


def rows(n):
    return np.arange(float(n * len(COLUMNS))).reshape(n, len(COLUMNS))


def test_a_chunk_comes_back_bit_for_bit(plan_of, tmp_path):
    plan = plan_of()
    store, chunk = Store(tmp_path, plan, fingerprint(plan), 60), cut(plan)[0]
    assert store.read(chunk, 3) is None
    table = rows(6)
    table[0, 3] = np.nan
    store.keep(chunk, table)
    assert np.array_equal(Store(tmp_path, plan, fingerprint(plan), 60).read(chunk, 3), table, equal_nan=True)


@pytest.mark.parametrize("damage", [b"", b"\x93NUMPY", b"nonsense"])
def test_a_damaged_chunk_counts_as_not_flown(plan_of, tmp_path, damage):
    plan = plan_of()
    store, chunk = Store(tmp_path, plan, fingerprint(plan), 60), cut(plan)[0]
    store.keep(chunk, rows(6))
    path = next(tmp_path.glob("chunk-*.npy"))
    whole = path.read_bytes()
    path.write_bytes(damage)
    assert store.read(chunk, 3) is None
    path.write_bytes(whole[:-8])
    assert store.read(chunk, 3) is None


def test_a_folder_keeps_its_chunks_and_loses_what_was_half_written(plan_of, tmp_path):
    plan = plan_of()
    Store(tmp_path, plan, fingerprint(plan), 6)
    (tmp_path / ".chunk-000000.npy.7.tmp").write_bytes(b"half")
    assert Store(tmp_path, plan, fingerprint(plan), 60).chunk == 6
    assert [path.name for path in tmp_path.iterdir()] == [MANIFEST]


def test_another_campaign_or_other_software_is_refused(plan_of, tmp_path, monkeypatch):
    plan = plan_of()
    Store(tmp_path, plan, fingerprint(plan), 60)
    with pytest.raises(InputError, match="another campaign"):
        Store(tmp_path, plan, "0" * 16, 60)
    monkeypatch.setattr("glider.tools.study.campaign.store.kernels_digest", lambda: "new")
    with pytest.raises(InputError, match="other software"):
        Store(tmp_path, plan, "0" * 16, 60)


def test_a_folder_of_anything_else_is_left_alone(plan_of, tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="no campaign"):
        fly_campaign(plan_of(), tmp_path, jobs=1)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
    (tmp_path / MANIFEST).write_text("{}")
    with pytest.raises(InputError, match="manifest"):
        fly_campaign(plan_of(), tmp_path, jobs=1)
