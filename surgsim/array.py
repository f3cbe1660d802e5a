"""The type of the package's arrays of numbers."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Double precision of any shape; docstrings say shape and unit."""
