"""Types of arrays of numbers, by what they are; NumPy's types tell no shape."""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Complex = NDArray[np.complex128]
