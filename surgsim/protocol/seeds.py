"""Seeds of a protocol: public ones for development, and those of a round, unknown before it is opened.

A round's key is scrypt(phrase, salt = protocol and round). Before a round the SHA-256 of the key is
published; when it is opened, the key itself. So anybody can check the key and derive the seeds, while the
phrase stays unknown and may serve for further rounds. A seed is the beginning of HMAC-SHA-256(key, generator
and index), as in the Expand step of HKDF (RFC 5869); scrypt (RFC 7914) as its Extract step makes guessing the
phrase slow.
"""

import hashlib
import hmac
import json
import re
from dataclasses import dataclass
from typing import Any

from surgsim.errors import SurgsimError
from surgsim.protocol.definition import Protocol
from surgsim.recording.files import replacing, write_file

DEVELOPMENT = "development"
SHORTEST_PHRASE = 16
_ROUND = re.compile(r"[a-z0-9][a-z0-9_-]{0,31}")
_SEED_BITS = 48


@dataclass(frozen=True, kw_only=True)
class Seeds:
    """Where the seeds of a score come from.

    Attributes:
        kind: `development` or `round`.
        round: Name of the round; empty for development.
        key: The round's key, in hexadecimal digits; empty for development.
    """

    kind: str = DEVELOPMENT
    round: str = ""
    key: str = ""

    def of(self, generator: str, count: int) -> tuple[int, ...]:
        """The first `count` seeds of a generator: 0, 1, ... for development.

        Example:
            >>> Seeds().of("random", 3)
            (0, 1, 2)
        """
        if self.kind == DEVELOPMENT:
            return tuple(range(count))
        return tuple(_seed(bytes.fromhex(self.key), generator, index) for index in range(count))

    def told(self) -> dict[str, str]:
        """Plain data, from which the seeds can be made again."""
        return {"kind": self.kind, "round": self.round, "key": self.key}


def _seed(key: bytes, generator: str, index: int) -> int:
    digest = hmac.digest(key, f"surgsim seed {generator} {index}".encode(), "sha256")
    return int.from_bytes(digest, "big") >> (256 - _SEED_BITS)


def round_key(phrase: str, protocol: str, name: str) -> bytes:
    """The key (32 bytes) of a round.

    Raises:
        SurgsimError: If the phrase is too short to keep anybody from guessing it.
    """
    words = " ".join(phrase.split())
    if len(words) < SHORTEST_PHRASE:
        raise SurgsimError(
            f"the phrase has {len(words)} letters: give at least {SHORTEST_PHRASE}, which nobody guesses"
        )
    salt = f"surgsim round {protocol} {name}".encode()
    return hashlib.scrypt(words.encode(), salt=salt, n=2**14, r=8, p=1, dklen=32)


def commitment(key: bytes) -> str:
    """What is published of a round's key before the round is opened."""
    return hashlib.sha256(b"surgsim round key " + key).hexdigest()


def commit_round(protocol: Protocol, name: str, phrase: str) -> str:
    """Write the hash of the round's key into the protocol's file of rounds; the phrase is written nowhere.

    Returns:
        The hash.

    Raises:
        SurgsimError: If the round is there already, or its name is not allowed.
    """
    if not _ROUND.fullmatch(name) or name == DEVELOPMENT:
        raise SurgsimError(f"--round: '{name[:60]}' is not allowed: small letters, digits, '_' and '-'")
    rounds = read_rounds(protocol)
    if name in rounds:
        raise SurgsimError(f"--round: '{name}' is there already, in {protocol.rounds}")
    found = commitment(round_key(phrase, protocol.name, name))
    _write(protocol, {**rounds, name: {"key_sha256": found, "key": None}})
    return found


def open_round(protocol: Protocol, name: str, phrase: str) -> Seeds:
    """Check the phrase against what was published, and write the round's key: now its seeds are known.

    Raises:
        SurgsimError: If there is no such round, or the phrase is not its.
    """
    rounds = read_rounds(protocol)
    entry = _entry(protocol, rounds, name)
    key = round_key(phrase, protocol.name, name)
    if not hmac.compare_digest(commitment(key), entry["key_sha256"]):
        raise SurgsimError(f"--round {name}: this is not the phrase of the hash {entry['key_sha256']}")
    _write(protocol, {**rounds, name: {**entry, "key": key.hex()}})
    return Seeds(kind="round", round=name, key=key.hex())


def seeds_of(protocol: Protocol, name: str) -> Seeds:
    """Seeds by `development` or the name of a round that is open.

    Raises:
        SurgsimError: If there is no such round, it is not open yet, or its key is not the published one.
    """
    if name == DEVELOPMENT:
        return Seeds()
    entry = _entry(protocol, read_rounds(protocol), name)
    if not entry["key"]:
        raise SurgsimError(f"--seeds: round '{name}' is not open yet; --seeds development is public")
    if commitment(bytes.fromhex(entry["key"])) != entry["key_sha256"]:
        raise SurgsimError(f"{protocol.rounds}: the key of round '{name}' is not the one that was published")
    return Seeds(kind="round", round=name, key=entry["key"])


def any_open(protocol: Protocol) -> str:
    """Name of a round that has been opened; empty if none has."""
    return next((name for name, entry in read_rounds(protocol).items() if entry["key"]), "")


def read_rounds(protocol: Protocol) -> dict[str, dict[str, Any]]:
    """The protocol's rounds by name; none if it has no file of them.

    Raises:
        SurgsimError: If the file is damaged.
    """
    path = protocol.rounds
    if not path.is_file():
        return {}
    try:
        rounds = json.loads(path.read_text(encoding="utf-8"))["rounds"]
        for entry in rounds.values():
            bytes.fromhex(entry["key_sha256"]), bytes.fromhex(entry["key"] or "")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SurgsimError(f"{path} is damaged: {error}") from error
    return dict(rounds)


def _entry(protocol: Protocol, rounds: dict[str, dict[str, Any]], name: str) -> dict[str, Any]:
    if name not in rounds:
        known = ", ".join([DEVELOPMENT, *rounds])
        raise SurgsimError(f"'{name[:60]}' is no round of {protocol.name}. Known: {known}.")
    return rounds[name]


def _write(protocol: Protocol, rounds: dict[str, dict[str, Any]]) -> None:
    try:
        with replacing(protocol.rounds) as draft:
            write_file(draft, json.dumps({"protocol": protocol.name, "rounds": rounds}, indent=2) + "\n")
    except OSError as error:
        raise SurgsimError(f"cannot write {protocol.rounds}: {error.strerror or error}") from error
