"""MuJoCo's own matrices in the same coordinates: mass, and damping and stiffness by differences of its forces."""

import numpy as np
import pytest
from scipy.linalg import eigh

import mbsvib as mv
from mbsvib.mjcf.compiled import compiled
from tests.mjcf.peer import closed, matrices, projected, settled
from tests.mjcf.scenes import ARM, FLOATING, FOUR_BAR, GANTRY, HAND, SWING, random_tree, write

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'mbsvib[mjcf]'")


def assert_same(system, file, rtol=1e-9):
    M, C, K = matrices(file)
    np.testing.assert_allclose(system.M, M, atol=1e-13 * np.abs(M).max())
    np.testing.assert_allclose(system.C, C, atol=rtol * np.abs(C).max(initial=1e-9))
    np.testing.assert_allclose(system.K, K, atol=rtol * np.abs(K).max())


def in_order(system, file):
    """MuJoCo's coordinates are the joints' in their order, which the toolbox's need not be."""
    order = []
    for i in range(file.m.njnt):
        name = file.name("joint", i)
        own = ("x", "y", "z", "rx", "ry", "rz") if file.m.jnt_type[i] == 0 else ("rx", "ry", "rz")
        order += [c for c in (f"{name}.{d}" for d in own) if c in system.coordinates] if file.m.jnt_type[i] != 2 else \
            [f"{name}.z"]  # fmt: skip
    return order


@pytest.mark.few(1)
@pytest.mark.filterwarnings("ignore:.*turned spring in 'wrist'")
@pytest.mark.parametrize(("scene", "control"), [(ARM, {}), (GANTRY, {"belt": 0.1}), (HAND, {"hold": 0.2, "odd": 0.7})])
def test_matrices_under_load(tmp_path, scene, control):
    """Springs, servos, tendons and armature of bodies with several joints, settled under gravity."""
    path = write(tmp_path, scene)
    file, pose = settled(path, control)
    model = mv.load_mjcf(path, pose=pose, control=control)
    system = model.linearize()
    assert list(system.coordinates) == in_order(system, file)
    assert_same(system, file)
    result = mv.load_mjcf(path, control=control).equilibrium().linearize()  # from the pose of the file
    squares = [eigh(item.K, item.M, eigvals_only=True) for item in (result, system)]
    np.testing.assert_allclose(*squares, rtol=1e-8)


def test_a_floating_body(tmp_path):
    path = write(tmp_path, FLOATING)
    pose = {"float": (0.1, -0.2, 0.3, 0.9, 0.1, -0.3, 0.2)}
    file = compiled(path, pose, None, {}, ())
    with pytest.warns(mv.LeftOutWarning, match="turned spring in 'float'"):
        model = mv.load_mjcf(path, pose=pose, gravity=(0, 0, 0))
    system = model.replace("float.k", preload=None).linearize()
    turn = np.eye(7)
    turn[3:6, 3:6] = np.array(file.d.xmat[1]).reshape(3, 3).T  # MuJoCo turns it in its own axes
    M, _, _ = matrices(file)
    np.testing.assert_allclose(system.M, turn.T @ M @ turn, atol=1e-13 * np.abs(M).max())


def test_a_closed_four_bar(tmp_path):
    """On the null space of MuJoCo's own constraint Jacobian."""
    path = write(tmp_path, FOUR_BAR)
    system = mv.load_mjcf(path, gravity=(0, 0, 0)).linearize()
    assert system.dof == 1
    path.write_text(path.read_text(encoding="utf-8").replace("0 0 -9.81", "0 0 0"), encoding="utf-8")
    expected = projected(compiled(path, {}, None, {}, ()))
    np.testing.assert_allclose(2 * np.pi * system.modes().frequencies, expected, rtol=1e-8)


def test_a_loaded_loop(tmp_path):
    """A parallelogram that hangs is a pendulum."""
    system = mv.load_mjcf(write(tmp_path, SWING)).linearize()
    inertia = 2 * (0.03 + 2 * 0.3**2) + 3 * 0.5**2
    moment = 9.81 * (2 * 2 * 0.3 + 3 * 0.5)
    np.testing.assert_allclose(system.modes().frequencies, [np.sqrt(moment / inertia) / (2 * np.pi)], rtol=1e-12)


@pytest.mark.few(2)
@pytest.mark.filterwarnings("ignore:.*turned spring in")
@pytest.mark.parametrize("seed", range(6))
def test_random_trees_under_load(tmp_path, seed):
    path = write(tmp_path, random_tree(seed))
    file, pose = settled(path, {})
    system = mv.load_mjcf(path, pose=pose).linearize()
    assert list(system.coordinates) == in_order(system, file)
    assert_same(system, file, 1e-8)


def test_a_four_bar_under_its_weight(tmp_path):
    """Stiffness with the reactions in the loop: the curvature of MuJoCo's energy along the loop's only motion."""
    path = write(tmp_path, FOUR_BAR)
    file, at, h = compiled(path, {}, None, {}, ()), 0.0, 1e-2
    weights = np.array([[1, -8, 0, 8, -1], [-1, 16, -30, 16, -1]]) / 12  # of first and second derivatives
    for _ in range(8):
        slope, curvature = weights @ [closed(file, 0, at + i * h) for i in range(-2, 3)] / (h, h * h)
        at -= slope / curvature
    closed(file, 0, at)
    pose = {name: file.position(i)[0] for i, name in enumerate("abd")}
    model = mv.load_mjcf(path, pose=pose)
    held = model.equilibrium()  # what the differences leave over
    system = held.linearize(independent=["a.rz"])
    np.testing.assert_allclose(system.K, [[curvature]], rtol=1e-6)
    np.testing.assert_allclose(held.bodies["crank"].position, model.bodies["crank"].position, atol=1e-6)
    by_itself = mv.load_mjcf(path).equilibrium().linearize(independent=["a.rz"])
    np.testing.assert_allclose(by_itself.K, system.K, rtol=1e-9)


TIED = """<mujoco><option gravity="0 0 0"/><worldbody>
<body><joint name="a" axis="0 1 0" stiffness="30"/><geom size=".1" mass="2" pos=".3 0 0"/></body>
<body pos="0 2 0"><joint name="b" type="slide" axis="1 0 0" ref=".2"/><geom size=".1" mass="3"/>
<body pos=".4 0 0"><joint name="d" axis="0 0 1" stiffness="7"/><geom size=".1" mass="1" pos=".2 .1 0"/></body></body>
</worldbody><tendon><fixed name="one"><joint joint="a" coef="2"/></fixed>
<fixed name="two"><joint joint="b" coef="3"/><joint joint="d" coef="-.5"/></fixed></tendon>
<equality>{}</equality></mujoco>"""
POLYNOMIAL = (0.1, 0.5, 2.0, -1.0, 3.0)


@pytest.mark.parametrize("kind", ["joint", "tendon"])
def test_couplings_by_polynomials_have_their_slope(tmp_path, kind):
    """Modes on the null space of MuJoCo's own constraint Jacobian, in a pose that meets the polynomial."""
    first, second = {"joint": ("a", "b"), "tendon": ("one", "two")}[kind]
    words = " ".join(map(str, POLYNOMIAL))
    path = tmp_path / "tied.xml"
    path.write_text(TIED.format(f'<{kind} name="c" {kind}1="{first}" {kind}2="{second}" polycoef="{words}"/>'))
    b, d = 0.5, 0.3
    x = b - 0.2 if kind == "joint" else 3.0 * (b - 0.2) - 0.5 * d
    met = float(np.polynomial.Polynomial(POLYNOMIAL)(x)) / (1.0 if kind == "joint" else 2.0)
    pose = {"a": met, "b": b, "d": d}
    # springs at rest in this pose; those of the file are wound
    path.write_text(path.read_text().replace('stiffness="30"', f'stiffness="30" springref="{np.rad2deg(met)}"')
                    .replace('stiffness="7"', f'stiffness="7" springref="{np.rad2deg(d)}"'))  # fmt: skip
    expected = projected(compiled(path, pose, None, {}, ()))
    model = mv.load_mjcf(path, pose=pose, stiffness={"a": 30.0, "d": 7.0})
    np.testing.assert_allclose(2 * np.pi * model.linearize().modes().frequencies, expected, rtol=1e-8, atol=1e-6)
    assert model.couplers["c"].curvature is not None
    mv.save(model, tmp_path / "tied.yaml")
    assert mv.load(tmp_path / "tied.yaml").couplers == model.couplers


@pytest.mark.parametrize("kind", ["joint", "tendon"])
def test_couplings_by_polynomials_under_load(tmp_path, kind):
    """Curvature of MuJoCo's energy along the only motion, its slope balanced by a constant force of an actuator."""
    first, second = {"joint": ("a", "b"), "tendon": ("one", "two")}[kind]
    tie = f'<{kind} name="c" {kind}1="{first}" {kind}2="{second}" polycoef="0.1 0.5 2 -1 3"/>'
    lock = '<joint joint1="d"/>'
    path = tmp_path / "tied.xml"
    path.write_text(TIED.format(tie + lock).replace('gravity="0 0 0"', 'gravity="1 0 -9.81"')
                    .replace("</mujoco>", '<actuator><motor name="f" joint="b"/></actuator></mujoco>'))  # fmt: skip
    file, at, h = compiled(path, {}, None, {}, ()), 0.55, 1e-2
    weights = np.array([[1, -8, 0, 8, -1], [-1, 16, -30, 16, -1]]) / 12  # of first and second derivatives
    slope, curvature = weights @ [closed(file, 1, at + i * h) for i in range(-2, 3)] / (h, h * h)
    closed(file, 1, at)
    pose = {name: file.position(i)[0] for i, name in enumerate("abd")}
    model = mv.load_mjcf(path, pose=pose, control={"f": slope})
    system = model.equilibrium(preload="a.k").linearize(independent=["b.z"])  # what the differences leave over
    np.testing.assert_allclose(system.K, [[curvature]], rtol=1e-5)
    straight = model.replace("c", curvature={next(iter(model.couplers["c"].curvature))[0]: 0.0})
    assert abs(straight.equilibrium(preload="a.k").linearize(independent=["b.z"]).K / curvature - 1.0) > 0.1


TURNING = """<worldbody>
<body><joint name="a" axis="0 0 1" damping=".05"/><geom type="capsule" fromto="0 0 0 .4 0 .1" size=".03"/>
<body pos=".4 0 .1"><joint name="b" axis="0 1 0" stiffness="3"/><geom type="capsule" fromto="0 0 0 .3 .1 0" size=".03"/>
<body pos=".3 .1 0"><joint name="d" type="slide" axis="1 0 1" stiffness="200" damping="1"/>
<geom type="box" size=".05 .04 .06"/></body></body></body></worldbody>"""


@pytest.mark.slow
def test_runs_by_torques_in_joints_that_turn_far(tmp_path):
    path = write(tmp_path, TURNING)
    api, t = pytest.importorskip("mujoco"), np.linspace(0.0, 0.8, 81)
    drives = [lambda t: 3 * np.cos(2 * t), lambda t: 2 * np.sin(4 * t), lambda t: 10 * np.cos(7 * t)]
    names = dict(zip(("a.torque", "b.torque", "d.force"), drives, strict=True))
    run = mv.load_mjcf(path, gravity=(0, 0, 0)).simulate(t, names, tolerance=1e-9)
    m = api.MjModel.from_xml_path(str(path))
    m.opt.timestep, m.opt.integrator, m.opt.gravity[:] = 1e-3, api.mjtIntegrator.mjINT_RK4, 0.0
    d = api.MjData(m)
    api.set_mjcb_control(lambda _, data: np.copyto(data.qfrc_applied, [drive(data.time) for drive in drives]))
    try:
        for i in range(1, len(t)):
            api.mj_step(m, d, 10)
            np.testing.assert_allclose([run[name][i] for name in ("a.angle", "b.angle", "d.travel")], d.qpos, atol=1e-7)
    finally:
        api.set_mjcb_control(None)
    assert d.qpos[0] > 0.5
