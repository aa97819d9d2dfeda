"""The one name for arrays of numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in SI and radians; batch axes lead, vector axes trail."""
