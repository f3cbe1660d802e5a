"""Keys that the parts with an external controller share."""

from typing import Annotated

from pydantic import Field

Timeout = Annotated[float, Field(gt=0.0, le=60.0)]
"""How long an answer may take [s]."""
StartTimeout = Annotated[float, Field(gt=0.0, le=600.0)]
"""How long a declaration may take [s]."""
