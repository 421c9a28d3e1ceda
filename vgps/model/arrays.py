"""The NumPy arrays of the project, by what they hold."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
GrayImage = npt.NDArray[np.uint8]
RgbImage = npt.NDArray[np.uint8]
