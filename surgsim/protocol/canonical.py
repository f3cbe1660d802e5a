"""One text for equal content: what is hashed."""

import hashlib
import json
from typing import Any


def canonical(content: Any) -> str:
    """`content` as JSON: keys sorted, no spaces, ASCII, numbers as the shortest text that reads back.

    Raises:
        ValueError: If it holds a number that is not finite.

    Example:
        >>> canonical({"b": 1.5, "a": None})
        '{"a":null,"b":1.5}'
    """
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def sha256_of(content: Any) -> str:
    """SHA-256 of the canonical text of `content`."""
    return hashlib.sha256(canonical(content).encode()).hexdigest()
