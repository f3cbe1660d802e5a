"""Instruments with a name: where their files are.

An instrument is an MJCF file `<name>.xml` whose first body is fixed to the flange, with the sites
`shaft_entry` and `tip`, and `shaft_end` where the tip is not the shaft's end (`surgsim.models.adopted.tool`).
There are those that are shipped, in `FOLDERS` of `assets/`; those in folders of their names in the
folders that the variable `SURGSIM_INSTRUMENTS` lists, as `PATH` lists programs; and those that installed
packages offer in the entry-point group `surgsim.instruments`: the name, and a package whose folder
holds the file. A shipped name counts before one on the search path, and that before one of a package.
"""

import re
from pathlib import Path

from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.folders import file_of_package, lost_of, on_path
from surgsim.plugins import Offer, offers
from surgsim.resources import resource_dir

FOLDERS = ("instruments", "tools")
"""Folders of `assets/`; a frozen protocol hashes all of the first."""
TEMPLATES = ("laparoscopic_straight",)
"""Files that are no instrument as they stand: their lengths are the scenario's."""
SEARCH_PATH = "SURGSIM_INSTRUMENTS"
GROUP = "surgsim.instruments"
_COMMENT, _STOP = re.compile(r"<!--(.*?)-->", re.S), re.compile(r"[.:](?:\s|$)")


def instrument_names() -> list[str]:
    """Names of all instruments, sorted: those that are shipped, on the search path, and of other packages."""
    return sorted({*shipped_instruments(), *on_path(SEARCH_PATH), *offers(GROUP)})


def shipped_instruments() -> dict[str, Path]:
    """Name to the file of every instrument that is shipped."""
    files = (path for folder in FOLDERS for path in (resource_dir("assets") / folder).glob("*.xml"))
    return {path.stem: path for path in files if path.stem not in TEMPLATES}


def known_instrument(name: str) -> str:
    """`name`, if there is such an instrument.

    Raises:
        ValueError: If there is not.
    """
    if name not in (known := instrument_names()):
        hint = " A file is given as mjcf." if Path(name).suffix in (".xml", ".mjcf") else ""
        raise ValueError(unknown_name(name, "instrument", known) + hint + lost_of(SEARCH_PATH))
    return name


def instrument_file(name: str) -> Path:
    """The MJCF of an instrument.

    Raises:
        SurgsimError: If there is no such instrument, or its package has no such file.
    """
    for found in (shipped_instruments(), on_path(SEARCH_PATH)):
        if name in found:
            return found[name]
    if (offer := brought_instrument(name)) is not None:
        return file_of_package("instrument", offer)
    raise SurgsimError(unknown_name(name, "instrument", instrument_names()))


def brought_instrument(name: str) -> Offer | None:
    """What package brings the instrument of that name; None where it is shipped or on the search path."""
    hidden = name in shipped_instruments() or name in on_path(SEARCH_PATH)
    return None if hidden else offers(GROUP).get(name)


def instrument_origin(name: str) -> str:
    """Which package brings it, for messages; empty where none does."""
    offer = brought_instrument(name)
    return offer.origin if offer is not None else ""


def instrument_description(name: str) -> str:
    """One line about an instrument: the first comment of its file, to the first stop or colon.

    Raises:
        SurgsimError: If there is no such instrument, or its file cannot be read.
    """
    file = instrument_file(name)
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SurgsimError(f"instrument '{name}': {file} cannot be read: {error}") from error
    about = _COMMENT.search(text)
    words = " ".join(about[1].split()) if about else ""
    return _STOP.split(words, maxsplit=1)[0] or "no description"
