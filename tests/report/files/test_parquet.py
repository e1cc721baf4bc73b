"""records.parquet: the numbers of records.csv, with types, and the same bytes for the same records."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd
import pytest

from holobench_eval.report import csv_text
from holobench_eval.report.files import parquet, write_files
from holobench_eval.report.files.dictionary import column
from tests.report.files.test_csv import results

FILE = "records.parquet"


def test_parquet_and_csv_hold_the_same_numbers_and_texts(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    found = results()
    write_files(found, tmp_path)
    binary, text = pd.read_parquet(tmp_path / FILE), pd.read_csv(tmp_path / "records.csv", dtype=str, na_filter=False)
    assert list(binary) == list(text)
    for name in text:
        entry = column("records.csv", name)
        if entry is None or entry.kind != "text":
            expected = pd.Series([float(value or "nan") for value in text[name]], name=name)
            pd.testing.assert_series_equal(binary[name].astype(float), expected)
        else:
            assert binary[name].tolist() == text[name].tolist()
    assert binary["seed"].iloc[0] == 20_261_123
    assert binary["psnr_linear_db"].notna().all()


def test_whole_numbers_are_integers_and_unknown_ones_are_null(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    from pyarrow import parquet as reader

    write_files(results(), tmp_path)
    schema = reader.read_schema(tmp_path / FILE)
    kinds = {name: str(schema.field(name).type) for name in ("seed", "captures", "solving_s", "label")}
    assert kinds == {"seed": "int64", "captures": "int64", "solving_s": "double", "label": "string"}
    assert schema.metadata is None
    limits = reader.read_table(tmp_path / FILE)["capture_limit"].to_pylist()
    assert set(limits) == {25, None}


def test_text_that_looks_like_a_formula_needs_no_apostrophe_in_parquet(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    found = results(clusters={f"t{number}": "=1" for number in range(8)})
    parquet.write_parquet(tmp_path / FILE, found.frame)
    assert "'=1" in csv_text(found.frame)
    assert "=1" in set(pd.read_parquet(tmp_path / FILE)["cluster"])


def test_the_same_records_give_the_same_bytes(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        write_files(results(), tmp_path / name)
    first, second = (sorted((tmp_path / name).iterdir()) for name in ("first", "second"))
    assert [path.name for path in first] == [path.name for path in second]
    assert FILE in {path.name for path in first}
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_without_pyarrow_no_file_of_other_records_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / FILE).write_bytes(b"of other records")
    monkeypatch.setattr("holobench_eval.report.files.is_available", lambda: False)
    write_files(results(), tmp_path)
    assert not (tmp_path / FILE).exists()
    assert len(pd.read_csv(io.StringIO((tmp_path / "records.csv").read_text()))) == 17
