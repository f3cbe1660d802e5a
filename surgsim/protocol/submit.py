"""The bundle of a score: what `surgsim submit` writes."""

from dataclasses import dataclass
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.protocol.archive import pack
from surgsim.protocol.bundle import Bundle, bundle_of, files_of
from surgsim.protocol.definition import Protocol, load_protocol, protocol_names
from surgsim.protocol.findings import Finding
from surgsim.protocol.verify import check
from surgsim.recording.files import replacing, write_file


@dataclass(frozen=True, kw_only=True)
class Submission:
    """A bundle before it is written.

    Attributes:
        bundle: The bundle.
        archive: Its bytes: the same for the same score, code and machine.
        findings: What `surgsim verify` would find without a run; it is not written with any.
    """

    bundle: Bundle
    archive: bytes
    findings: tuple[Finding, ...]


def submission(folder: Path, protocol: Protocol | None = None) -> Submission:
    """The bundle of the score in `folder`.

    Args:
        folder: A folder that `surgsim score` wrote.
        protocol: Its protocol; None for a shipped one, by the name in the score.

    Raises:
        SurgsimError: If there is no score, or its protocol is not at hand.
    """
    files = files_of(folder)
    bundle = bundle_of(files, str(folder))
    found, _ = check(bundle, protocol or protocol_for(bundle))
    return Submission(bundle=bundle, archive=pack(files), findings=tuple(found))


def protocol_for(bundle: Bundle) -> Protocol:
    """The shipped protocol that a bundle names; a path in its place is not followed.

    Raises:
        SurgsimError: If none has that name.
    """
    name = bundle.score.protocol
    if name not in protocol_names():
        raise SurgsimError(f"'{name[:60]}' is no shipped protocol; give its file with --protocol FILE")
    return load_protocol(name)


def write_archive(path: Path, archive: bytes) -> None:
    """Write a bundle whole, or not at all.

    Raises:
        SurgsimError: If the disk refuses.
    """
    with replacing(path) as draft:
        write_file(draft, archive)
