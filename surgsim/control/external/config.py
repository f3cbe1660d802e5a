"""What the parts with an external controller share: keys, and the controller that they start."""

from typing import Annotated

from pydantic import Field

from surgsim.catalog import Name, PartConfig
from surgsim.control.external.outside import Outside
from surgsim.models.arm import ArmModel

Timeout = Annotated[float, Field(gt=0.0, le=60.0)]
"""How long an answer may take [s]."""
StartTimeout = Annotated[float, Field(gt=0.0, le=600.0)]
"""How long a declaration may take [s]."""


class ExternalPartConfig(PartConfig):
    """Asks a controller outside surgsim, a process or a C function.

    Attributes:
        name: The controller: its command is given by `--external NAME=COMMAND`, or by the user's own file.
        timeout_s: How long a process may take for an answer [s].
        start_timeout_s: How long it may take to start [s].
    """

    name: Name = "mine"
    timeout_s: Timeout = 0.5
    start_timeout_s: StartTimeout = 30.0

    def outside(self, arm: ArmModel, gives: int) -> Outside:
        """The controller, started, for the nominal arm `arm`; what it gives as in `layout`.

        Raises:
            SurgsimError: If no command is given for it, or it does not start.
        """
        return Outside(self.name, arm, gives, timeout_s=self.timeout_s, start_timeout_s=self.start_timeout_s)
