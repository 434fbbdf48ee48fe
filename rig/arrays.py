"""Names for the types of numpy arrays that all rooms compute with."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Floats32: TypeAlias = NDArray[np.float32]
#: 32 or 64 bits wide, as values of pixels, which are noisier than rounding.
Reals: TypeAlias = NDArray[np.floating]
Integers: TypeAlias = NDArray[np.intp]
Flags: TypeAlias = NDArray[np.bool_]
#: Real or complex: functions that take these pass complex numbers through, for checks of derivatives by complex steps.
Numbers: TypeAlias = NDArray[Any]
