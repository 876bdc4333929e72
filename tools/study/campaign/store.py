"""A campaign's folder: a manifest, one file for each finished chunk. Files appear whole or not at all."""

import contextlib
import json
import zipfile
from pathlib import Path

import msgspec
import numpy as np

from glider.firmware.core.jit import kernels_digest
from glider.tools.data.errors import InputError
from glider.tools.data.files import UNFINISHED, write_bytes
from glider.tools.data.version import release
from glider.tools.study.campaign.flights import COLUMNS, Chunk
from glider.tools.study.campaign.plan import CampaignPlan

MANIFEST = "campaign.json"


class Manifest(msgspec.Struct):
    """What a folder says of the campaign in it."""

    format: int
    fingerprint: str
    software: str
    kernels: str
    chunk: int  # flights a chunk
    columns: list[str]
    campaign: dict


class Store:
    """The folder of one campaign; `chunk` is the size (flights) it was begun with, which it keeps."""

    def __init__(self, folder: Path, plan: CampaignPlan, fingerprint: str, chunk: int):
        """Begin the folder, or go on with it; InputError where it holds anything else."""
        self.folder, self.chunk, self.fingerprint = folder, chunk, fingerprint
        path = folder / MANIFEST
        if path.is_file():
            self.chunk = self._same(path)
            for part in folder.glob(f"*{UNFINISHED}"):
                part.unlink(missing_ok=True)
            return
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError("is there already and holds no campaign: name another with --out", source=folder)
        folder.mkdir(parents=True, exist_ok=True)
        manifest = Manifest(
            1, fingerprint, release(), kernels_digest(), chunk, list(COLUMNS), msgspec.to_builtins(plan.campaign)
        )
        write_bytes(path, json.dumps(msgspec.to_builtins(manifest), indent=1).encode(), kept=True)

    def _same(self, path: Path) -> int:
        """The chunk size of a folder begun by the same campaign and software."""
        try:
            found = msgspec.json.decode(path.read_bytes(), type=Manifest)
        except msgspec.DecodeError as error:
            raise InputError(f"not a campaign's manifest: {error}", source=path) from None
        if found.fingerprint != self.fingerprint:
            own = release(), kernels_digest()
            other = (found.software, found.kernels) != own
            what = f"other software ({found.software}, kernels {found.kernels})" if other else "another campaign"
            raise InputError(f"holds flights of {what}: name another folder with --out", source=self.folder)
        return found.chunk

    def _path(self, chunk: Chunk) -> Path:
        return self.folder / f"chunk-{chunk.number:06d}.npy"

    def keep(self, chunk: Chunk, rows: np.ndarray) -> None:
        """Write a finished chunk."""
        import io

        buffer = io.BytesIO()
        np.save(buffer, rows)
        write_bytes(self._path(chunk), buffer.getvalue(), kept=True)

    def read(self, chunk: Chunk, controllers: int) -> np.ndarray | None:
        """A finished chunk's rows; None if it has not been flown, or its file is damaged."""
        with contextlib.suppress(OSError, ValueError, EOFError, zipfile.BadZipFile):
            rows = np.load(self._path(chunk), allow_pickle=False)
            if rows.shape == (chunk.seeds * controllers, len(COLUMNS)):
                return rows
        return None
