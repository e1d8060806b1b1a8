"""Writing results whole or not at all: into a temporary sibling first, then renamed."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import HandModelError


def refuse_file(folder: str | Path) -> None:
    """Raise HandModelError where a file stands where a folder is to be written, or nothing can be written there."""
    for place in (Path(folder), *Path(folder).parents):
        if place.exists() and not place.is_dir():
            raise HandModelError(f"{place}: is a file; name a folder to write into")
    place = next(p for p in (Path(folder), *Path(folder).absolute().parents) if p.exists())
    try:
        os.rmdir(tempfile.mkdtemp(prefix=".", dir=place))
    except OSError as error:
        raise HandModelError(
            f"{folder}: nothing can be written into {place} ({error.strerror}); name a folder that can be written to"
        ) from None


@contextmanager
def replacing(folder: str | Path, folders: Collection[str], files: Collection[str]) -> Iterator[None]:
    """What an earlier run wrote into `folder`, which the first of its `files` shows, makes room for what the block
    writes: its folders of these names go. Where the block fails or is stopped nothing of either is left."""
    target, mark = Path(folder), next(iter(files))
    ours = (target / mark).is_file()
    theirs = {n for n in (*folders, *files) if (target / n).exists()} if not ours else set()

    def clear(names: Collection[str]) -> None:
        for name in (n for n in names if n not in theirs):
            shutil.rmtree(target / name, ignore_errors=True)
            if (target / name).is_file():
                (target / name).unlink()

    if ours:
        clear(folders)
    try:
        yield
    except BaseException:
        clear((*files, *folders))
        raise


def refuse_foreign(folder: str | Path, ours: Collection[str]) -> None:
    """Raise HandModelError where `folder` is a file, or holds anything that is not named in `ours`."""
    target = Path(folder)
    refuse_file(target)
    if not target.exists():
        return
    foreign = sorted(entry.name for entry in target.iterdir() if entry.name not in ours)
    if foreign:
        raise HandModelError(
            f'{target}: holds "{foreign[0]}", which this command did not write; name a new or an empty folder'
        )


@contextmanager
def new_folder(folder: str | Path, ours: Collection[str]) -> Iterator[Path]:
    """A folder to fill, which takes the place of `folder` when the block ends well; else nothing is left of it.

    ours: names that an earlier run of the same command wrote; a folder with anything else is refused (HandModelError).
    """
    target = Path(folder)
    refuse_foreign(target, ours)
    target.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        yield staging
        staging.chmod(0o755)
        if target.exists():
            retired = Path(tempfile.mkdtemp(prefix=f".{target.name}.old.", dir=target.parent))
            os.rename(target, retired / "old")
            os.rename(staging, target)
            shutil.rmtree(retired)
        else:
            os.rename(staging, target)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def refuse_folder(file: str | Path) -> None:
    """Raise HandModelError where a folder stands where a file is to be written, or a file where its folder is to be."""
    target = Path(file)
    if target.is_dir():
        raise HandModelError(f"{target}: is a folder; name a file")
    refuse_file(target.parent)


@contextmanager
def new_file(file: str | Path) -> Iterator[Path]:
    """A file to write, which takes the place of `file` when the block ends well; raises HandModelError as
    `refuse_folder` does."""
    target = Path(file)
    refuse_folder(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    os.close(handle)
    staging = Path(name)
    try:
        yield staging
        staging.chmod(0o644)
        os.replace(staging, target)
    finally:
        staging.unlink(missing_ok=True)
