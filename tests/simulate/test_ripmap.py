import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.simulate.ripmap import Ripmap


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(
    st.integers(16, 200),
    st.integers(16, 200),
    st.floats(0.01, 500.0),
    st.floats(0.01, 500.0),
    st.booleans(),
)
def test_filtered_textures_keep_their_mean_and_their_frame(
    width: int, height: int, du: float, dv: float, repeats: bool
) -> None:
    image = np.random.default_rng(0).integers(0, 256, (height, width, 4)).astype(np.uint8)
    image[..., 3] = 255
    level, to_texel, laid = Ripmap(image, repeats).level(du, dv)
    core = level if repeats else level[1:-1, 1:-1]
    assert core.shape[:2] == (to_texel[1, 1] * laid[1], to_texel[0, 0] * laid[0])
    assert core[..., :3].mean() == pytest.approx(image[..., :3].mean(), abs=3)
    edge = -0.5 if repeats else 0.5  # the texture's corner lies on the corner of its first texel
    np.testing.assert_allclose(to_texel @ [0, 0, 1], [edge, edge, 1])
    assert repeats or not level[0, :, 3].any()
