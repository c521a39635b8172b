"""The runs of a study as one table in a file, and its hash."""

from __future__ import annotations

from hashlib import sha256
from io import RawIOBase
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv


def results_digest(table: pa.Table) -> str:
    """Return the SHA-256 of the exported CSV file without computing times."""
    content = _Digest()
    write_csv(table, content)
    return content.digest.hexdigest()


class _Digest(RawIOBase):
    """File that keeps the SHA-256 of what is written."""

    def __init__(self) -> None:
        self.digest = sha256()

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, content: Any) -> int:
        """Add bytes."""
        self.digest.update(content)
        return len(content)


def write_csv(table: pa.Table, file: Any) -> None:
    """Write CSV with the shortest decimal numbers that are exact; no value is an empty cell."""
    columns = {
        name: pc.if_else(pc.is_finite(column), column, None)
        if pa.types.is_floating(column.type) else column
        for name, column in zip(table.column_names, table.columns, strict=True)
    }  # fmt: skip
    pa_csv.write_csv(pa.table(columns), file)
