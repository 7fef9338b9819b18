"""What depends on the version of OpenCV."""

import cv2
import pytest

same_jpegs = pytest.mark.skipif(
    int(cv2.__version__.split(".")[0]) < 5,
    reason="what is kept was made of JPEGs as OpenCV 5 writes and reads them: grey levels of others differ by one",
)
