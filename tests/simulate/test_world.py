import numpy as np

from vgps.simulate.world import UP, Builder

TEXTURE = np.zeros((4, 4, 4), np.uint8)


def corners(world, row):
    """(4, 3) of a parallelogram, from the texture's upper left, clockwise."""
    origin, u, v = world.origin[row], world.edge_u[row], world.edge_v[row]
    return np.array([origin, origin + u, origin + u + v, origin + v])


def test_an_upright_rectangle_faces_its_viewer_with_the_texture_upright() -> None:
    builder = Builder()
    builder.upright(np.zeros(3), np.array([0.0, -1.0, 0.0]), 4.0, 2.0, builder.image(TEXTURE))
    # seen from the south, the texture's right is east
    expected = [[-2, 0, 2], [2, 0, 2], [2, 0, 0], [-2, 0, 0]]
    np.testing.assert_allclose(corners(builder.world(), 0), expected, atol=1e-12)


def test_a_box_has_four_sides_and_a_top_facing_outwards() -> None:
    builder = Builder()
    image = builder.image(TEXTURE)
    builder.box(np.array([5.0, 0.0, 0.0]), 0.3, (4.0, 2.0, 3.0), image, image, image)
    world = builder.world()
    assert len(world.origin) == 5
    centre = np.array([5.0, 0.0, 1.5])
    for row in range(4):
        outwards = corners(world, row).mean(axis=0) - centre
        # u is right and v is down for the viewer, so that u x v points away from the viewer
        assert np.cross(world.edge_u[row], world.edge_v[row]) @ outwards < 0
        assert outwards @ UP == 0.0
    np.testing.assert_allclose(corners(world, 4)[:, 2], 3.0)


def test_moving_things_are_at_their_origin_at_their_epoch() -> None:
    builder = Builder(velocity=np.array([2.0, 0.0, 0.0]), epoch_s=3.0)
    builder.flat(np.zeros(3), 0.0, 2.0, 1.0, builder.image(TEXTURE))
    world = builder.world()
    np.testing.assert_allclose(world.origins(3.0), world.origin)
    np.testing.assert_allclose(world.origins(4.5) - world.origin, [[3.0, 0.0, 0.0]])
