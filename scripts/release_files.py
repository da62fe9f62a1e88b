"""Archives whose bytes depend on the files alone: on their names, contents and rights to execute."""

import gzip
import io
import pathlib
import tarfile
import time
import zipfile

# Rights of programs, and of all other files.
PROGRAM, FILE = 0o755, 0o644


def archive(folder: pathlib.Path, out: pathlib.Path, kind: str, seconds: int) -> pathlib.Path:
    """Packs `folder` into `out`, as "tar.gz" or "zip", with all times `seconds` after 1970. The path of the archive."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    entries = [(file.relative_to(folder.parent).as_posix(), file) for file in files]
    packed = tarred(entries, seconds) if kind == "tar.gz" else zipped(entries, seconds)
    path = out / f"{folder.name}.{kind}"
    path.write_bytes(packed)
    return path


def rights(file):
    # Windows marks no file as a program.
    return PROGRAM if file.stem == "lexisplat" and file.suffix in ("", ".exe") else FILE


def tarred(entries, seconds):
    made = io.BytesIO()
    with gzip.GzipFile(filename="", mode="wb", fileobj=made, mtime=seconds) as packed:
        with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as tar:
            for name, file in entries:
                entry = tarfile.TarInfo(name)
                entry.size, entry.mtime, entry.mode = file.stat().st_size, seconds, rights(file)
                with file.open("rb") as contents:
                    tar.addfile(entry, contents)
    return made.getvalue()


def zipped(entries, seconds):
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as packed:
        for name, file in entries:
            entry = zipfile.ZipInfo(name, time.gmtime(seconds)[:6])
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, rights(file) << 16
            # As on Unix, so that the rights above are read.
            entry.create_system = 3
            packed.writestr(entry, file.read_bytes())
    return made.getvalue()
