import gtsam
import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from factors import WALL_LIMIT, Cylinder, Ellipsoid, Gaussian, exponent_schedule, gps_factor

EXPONENTS = [1, 2, 3, 4, 8, 16, 32]
metres = st.floats(-200, 200)
offsets = arrays(np.float64, 3, elements=metres)
walls = st.one_of(
    st.builds(
        Cylinder, st.floats(0.05, 5), st.floats(0.05, 5), st.integers(1, 32), st.sampled_from([1e-8, 0.5])
    ),
    st.builds(
        Ellipsoid, st.floats(0.05, 5), st.floats(0.05, 5), st.integers(1, 32), st.sampled_from([1e-8, 0.5])
    ),
)


def whitened(penalty, offset):
    return penalty.noise_model().whiten(penalty.residual(offset)[0])


def error_of_factor(penalty, offset):
    values = gtsam.Values()
    values.insert(0, gtsam.Pose3(gtsam.Rot3(), offset))
    return gps_factor(0, np.zeros(3), np.zeros(3), penalty).error(values)


def test_cylinder_by_hand():
    # rho = 5, r = 2.5: a = 2; z = -6, h = 4: b = 1.5; n = 3
    cylinder = Cylinder(r_m=2.5, h_m=4.0, n=3, omega=0.5)
    residual, _ = cylinder.residual(np.array([3.0, 4.0, -6.0]))
    np.testing.assert_allclose(residual, [8 * 0.6, 8 * 0.8, -3.375], rtol=1e-14)
    assert cylinder.cost(np.array([[3.0, 4.0, -6.0]]))[0] == pytest.approx(0.5 * (2**6 + 1.5**6))


def test_ellipsoid_by_hand_scales_the_vertical_axis_by_beta():
    # (3/5)^2 + (4/5)^2 + (6/2)^2 = 10
    ellipsoid = Ellipsoid(alpha_m=5.0, beta_m=2.0, n=2, omega=0.25)
    assert ellipsoid.cost(np.array([[3.0, 4.0, 6.0]]))[0] == pytest.approx(0.25 * 100)
    residual, _ = ellipsoid.residual(np.array([3.0, 4.0, 6.0]))
    np.testing.assert_allclose(residual, np.sqrt(10) * np.array([0.6, 0.8, 3.0]), rtol=1e-14)


@pytest.mark.slow
@given(offsets, st.integers(1, 32), st.sampled_from([1e-8, 1e-3, 0.5]))
def test_walls_are_equations_16_and_22_below_the_limit(offset, n, omega):
    x, y, z = offset
    cylinder, ellipsoid = Cylinder(3.0, 7.0, n, omega), Ellipsoid(3.0, 7.0, n, omega)
    eq_16 = omega * ((np.hypot(x, y) / 3) ** (2 * n) + (abs(z) / 7) ** (2 * n))
    eq_22 = omega * ((x**2 + y**2) / 9 + z**2 / 49) ** n
    assume(eq_22 < 0.5 * WALL_LIMIT**2)
    assert cylinder.cost(offset[None])[0] == pytest.approx(eq_16, rel=1e-9, abs=1e-300)
    assert ellipsoid.cost(offset[None])[0] == pytest.approx(eq_22, rel=1e-9, abs=1e-300)


@pytest.mark.slow
@given(walls, offsets)
def test_the_walls_jacobian(wall, offset):
    # a difference across the kink of the slope at zero shows half the step; zero itself is tested below
    assume(wall.n == 1 or (np.hypot(*offset[:2]) > 1e-4 and abs(offset[2]) > 1e-4))
    residual, jacobian = wall.residual(offset)
    step = 1e-6
    numerical = np.column_stack(
        [(wall.residual(offset + d)[0] - wall.residual(offset - d)[0]) / (2 * step) for d in step * np.eye(3)]
    )
    # curvature times step bounds the error of the difference where the slope has a kink (at the limit)
    kink = np.abs(jacobian).max() * 32 * step / 0.05
    scale = np.abs(jacobian).max() + np.abs(residual).max() * 1e-3
    np.testing.assert_allclose(jacobian, numerical, rtol=0, atol=1e-5 * scale + kink + 1e-7)


@pytest.mark.parametrize("n", EXPONENTS)
@pytest.mark.parametrize("region", [Cylinder, Ellipsoid])
def test_jacobian_at_the_fix_and_on_the_axes(region, n):
    wall = region(2.0, 4.0, n, 0.5)
    at_fix = np.diag([0.5, 0.5, 0.25]) if n == 1 else np.zeros((3, 3))
    np.testing.assert_array_equal(wall.residual(np.zeros(3))[1], at_fix)
    # on an axis, at a = 1.1: along it n a^(n-1), across it a^(n-1)
    _, jacobian = wall.residual(np.array([0.0, -2.2, 0.0]))
    assert jacobian[1, 1] == pytest.approx(n * 1.1 ** (n - 1) / 2)
    assert jacobian[0, 0] == pytest.approx(1.1 ** (n - 1) / 2)
    _, jacobian = wall.residual(np.array([0.0, 0.0, 4.4]))
    assert jacobian[2, 2] == pytest.approx(n * 1.1 ** (n - 1) / 4)


@pytest.mark.parametrize("n", EXPONENTS)
def test_beyond_the_limit_the_residual_is_the_tangent(n):
    wall = Ellipsoid(1.0, 1.0, n, 0.5)
    a_max = WALL_LIMIT ** (1 / n)
    at_limit, slope = (array.flat[0] for array in wall.residual(np.array([a_max, 0.0, 0.0])))
    assert at_limit == pytest.approx(WALL_LIMIT)
    for excess in (1e-6, 1.0, 1e4, 1e12):
        residual, jacobian = wall.residual(np.array([a_max + excess, 0.0, 0.0]))
        assert residual[0] == pytest.approx(WALL_LIMIT + n * WALL_LIMIT / a_max * excess)
        assert jacobian[0, 0] == pytest.approx(slope)


@pytest.mark.slow
@given(walls, offsets, offsets)
def test_the_cost_of_a_wall_is_convex(wall, p, q):
    cost_p, cost_q, cost_between = wall.cost(np.array([p, q, (p + q) / 2]))
    assert cost_between <= (cost_p + cost_q) / 2 * (1 + 1e-12)


@pytest.mark.parametrize("omega", [1e-8, 0.5])
@pytest.mark.parametrize("n", EXPONENTS)
@pytest.mark.parametrize("start_m", [5.0, 50.0, 5e6])
def test_gauss_newton_reaches_the_wall_in_a_few_steps_from_anywhere(start_m, n, omega):
    wall = Cylinder(0.07, 0.05, n, omega)
    offset = start_m * np.array([0.6, -0.8, 1.0])
    steps = 0
    while np.linalg.norm(whitened(wall, offset)) > 1:
        residual, jacobian = wall.residual(offset)
        offset = offset - np.linalg.solve(jacobian, residual)
        steps += 1
    assert steps <= 9


@pytest.mark.slow
@given(
    st.one_of(
        walls,
        st.builds(
            Gaussian,
            st.tuples(*[st.floats(0.01, 10)] * 3),
            st.none() | st.floats(0.5, 5),
            st.tuples(*[st.floats(-0.45, 0.45)] * 3),
        ),
    ),
    offsets,
)
@example(Gaussian((1.0, 0.125, 0.0625), None, (0.0, 0.0, 1.2e-7)), np.ones(3))
def test_cost_is_what_the_factor_adds_to_the_graph(penalty, offset):
    assert penalty.cost(offset[None])[0] == pytest.approx(
        error_of_factor(penalty, offset), rel=1e-9, abs=1e-300
    )


def test_cost_takes_many_offsets():
    wall = Cylinder(2.4, 6.5, 4, 0.5)
    many = np.random.default_rng(0).normal(scale=5, size=(20, 3))
    np.testing.assert_allclose(
        wall.cost(many), [error_of_factor(wall, offset) for offset in many], rtol=1e-12
    )


def test_cauchy_by_hand():
    # offset / sigma = (2, 1, 2): square 9; k = 3: 4.5 log(1 + 9/9)
    cauchy = Gaussian((1.0, 2.0, 3.0), cauchy_k=3.0)
    assert cauchy.cost(np.array([[2.0, 2.0, 6.0]]))[0] == pytest.approx(4.5 * np.log(2))


def test_correlated_errors_by_hand():
    # sigmas 1 and 2, correlation 0.5: the inverse of [[1, 1], [1, 4]] is [[4, -1], [-1, 1]] / 3
    correlated = Gaussian((1.0, 2.0, 1.0), correlation=(0.5, 0.0, 0.0))
    assert correlated.cost(np.array([[1.0, 1.0, 0.0]]))[0] == pytest.approx(0.5 * (4 - 2 + 1) / 3)
    with pytest.raises(ValueError, match="expected those of a covariance"):
        Gaussian((1.0, 2.0, 1.0), correlation=(0.9, 0.9, -0.9))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Cylinder(0.0, 1.0, 2, 0.5),
        lambda: Cylinder(1.0, np.nan, 2, 0.5),
        lambda: Cylinder(1.0, 1.0, 0, 0.5),
        lambda: Ellipsoid(1.0, -1.0, 2, 0.5),
        lambda: Ellipsoid(1.0, 1.0, 2, np.inf),
        lambda: Gaussian((1.0, 0.0, 1.0)),
        lambda: Gaussian((1.0, 1.0, 1.0), cauchy_k=0.0),
        lambda: exponent_schedule(0),
    ],
)
def test_impossible_numbers_raise(make):
    with pytest.raises(ValueError, match="expected a positive number"):
        make()


@pytest.mark.parametrize(
    ("n", "expected"),
    [(1, [1]), (2, [1, 2]), (3, [1, 2, 3]), (16, [1, 2, 4, 8, 16]), (20, [1, 2, 4, 8, 16, 20])],
)
def test_exponent_schedule(n, expected):
    assert exponent_schedule(n) == expected
