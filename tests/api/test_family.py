"""Families of poses: matrices of moved models, closed forms, the worst pose, functions of the pose, their bounds."""

import pickle

import numpy as np
import pytest
from scipy.io import loadmat

import mbsvib as mv
from mbsvib import studies
from mbsvib.api import lpv as lpv_module
from mbsvib.equations.matrices import MATRICES
from mbsvib.linalg import sparse_interpolation
from tests.api.test_plant_poses import gantry, hanging_crank, loaded_arm, swinging
from tests.kinematics.test_dead_centre import STRETCHED, rocker

LEGS = [f"leg{i}.slide.z" for i in range(1, 7)]


def crank_stiffness(angle):
    """Stiffness at the crank [N m/rad] of a torsion spring of 10 N m/rad at the rocker."""
    return 10.0 * ((rocker(0.8 + angle + 1e-6) - rocker(0.8 + angle - 1e-6)) / 2e-6) ** 2


@pytest.mark.slow
def test_matrices_are_those_of_moved_models_in_the_given_coordinates():
    model = mv.library.stewart()
    poses = np.random.default_rng(2).uniform(-5e-3, 5e-3, (3, 6))
    family = model.family(dict(zip(LEGS, poses.T, strict=True)))
    assert family.coordinates == tuple(LEGS)
    assert family.frequencies.shape == family.B.shape[:2] == (3, 6)
    for i, (row, there) in enumerate(zip(poses, family.models, strict=True)):
        moved = model.moved(dict(zip(LEGS, row.tolist(), strict=True)), relaxed=True)
        system = moved.linearize(independent=LEGS)
        for key in MATRICES:
            wanted = getattr(system, key)
            np.testing.assert_allclose(getattr(family, key)[i], wanted, rtol=0, atol=1e-12 * abs(wanted).max() + 1e-300)
        np.testing.assert_allclose(family[i].modes().frequencies, family.frequencies[i], rtol=1e-10)
        np.testing.assert_allclose(there.bodies["platform"].position, moved.bodies["platform"].position, atol=1e-14)
    assert repr(family) == "Family('stewart': 3 poses, 6 DOF)"
    assert "3 variants of 6 parameters: leg1.slide.z" in family.explain()


def test_poses_are_all_combinations_on_a_grid():
    family = mv.library.stewart().family({"leg2.slide.z": [0.0, 1e-3], "leg1.slide.z": [0.0, 1e-3, 2e-3]}, grid=True)
    assert family.shape == (2, 3)
    assert family.pose(4) == {"leg2.slide.z": 1e-3, "leg1.slide.z": 1e-3}
    heave = mv.library.stewart().family({"leg*.slide.z": [0.0, 2e-3]})
    assert heave.coordinates == tuple(LEGS)
    assert set(heave.pose(1).values()) == {2e-3}


@pytest.mark.slow
def test_stiffness_at_a_crank_over_its_angle_and_its_function_of_the_angle():
    model, angles = hanging_crank(), np.linspace(-0.5, 0.5, 5)
    family = model.family({"A.rz": angles})
    assert family.coordinates == ("A.rz",)
    np.testing.assert_allclose(family.K[:, 0, 0], [crank_stiffness(a) for a in angles.tolist()], rtol=1e-8)
    worst = family.worst(lambda system: system.K[0, 0], largest=False)
    assert worst.index == int(np.argmin(family.K[:, 0, 0]))
    assert worst.pose == {"A.rz": angles[worst.index]}
    assert worst.value == family.K[worst.index, 0, 0]
    lpv = family.interpolated(1e-7)
    assert (lpv.names, lpv.units, lpv.coordinates) == (("A.rz",), ("rad",), ("A.rz",))
    assert 1e-12 < lpv.error_bound <= 1e-7
    for angle in np.linspace(-0.5, 0.5, 29).tolist():
        exact = crank_stiffness(angle)
        size = max(exact, 0.01 * family.K.max())  # at -0.5 the rocker nearly stands still
        assert abs(lpv.at({"A.rz": angle}).K[0, 0] - exact) <= 1e-7 * size + 1e-8 * exact  # that of differences


@pytest.mark.slow
def test_the_bound_holds_and_systems_are_those_of_models():
    model = mv.library.stewart(ports=["platform", "base"])
    family = model.family({LEGS[0]: [-4e-3, 3e-3], LEGS[3]: [-2e-3, 4e-3], LEGS[1]: 1e-3}, grid=True)
    lpv = family.interpolated(1e-5)
    assert lpv.names == (LEGS[0], LEGS[3])
    assert lpv.error_bound <= 1e-5
    for poses in np.random.default_rng(9).uniform(lpv.low, lpv.high, (20, 2)).tolist():
        exact = family.plant([poses[0], poses[1], 1e-3])
        system = lpv.at(dict(zip(lpv.names, poses, strict=True)))
        for key in MATRICES:
            wanted = getattr(exact, key)
            assert np.abs(getattr(system, key) - wanted).max() <= lpv.error_bound * np.abs(wanted).max()
    assert (system.inputs, system.output_units) == (family.inputs, family.output_units)
    assert system.coordinate_units == family.coordinate_units
    wanted = family.plant.system([*poses, 1e-3]).modes().frequencies
    np.testing.assert_allclose(system.modes().frequencies, wanted, rtol=1e-4)
    other = pickle.loads(pickle.dumps(lpv))
    assert repr(other) == repr(lpv) == f"LPVSystem('stewart': 2 coordinates, 6 DOF, error below {lpv.error_bound:.1e})"
    np.testing.assert_array_equal(other.at(dict(zip(lpv.names, poses, strict=True))).K, system.K)
    assert repr(pickle.loads(pickle.dumps(family))) == repr(family)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "reach", "error"), [(1, 0.01, 1e-9), (2, 0.01, 1e-6), (6, 5e-3, 1e-6)])
def test_the_bound_holds_in_ten_thousand_poses(count, reach, error):
    family = mv.library.stewart().family(box(LEGS[:count], reach), grid=True)
    lpv = family.interpolated(error)
    assert lpv.error_bound <= error
    poses = np.random.default_rng(77).uniform(-reach, reach, (10_000, count))
    exact, found = family.plant(poses), lpv.matrices(poses)
    root = np.sqrt(np.einsum("nii->ni", family.M).max(axis=0))
    for key in "MCKB":
        scale = 1.0 / (root[:, None] * (1.0 if key == "B" else root))
        wanted = getattr(exact, key) * scale
        size = np.abs(wanted).max(axis=(1, 2))
        assert (np.abs(found[key] * scale - wanted).max(axis=(1, 2)) <= lpv.error_bound * size).all()


def mirror_on_slide(metre=1.0):
    """A mirror of 1e-6 kg m^2 on a slide of 100 kg, in any unit of length; the spring at it turns with the pose."""
    model = mv.Model("slide")
    model.add_body("slide", mass=100.0, inertia=(metre**2,) * 3, position=(0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "slide", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_body("mirror", mass=0.01, inertia=(1e-6 * metre**2,) * 3, position=(0, 0, 0.01 * metre))
    model.add_joint("hinge", "revolute", "slide", "mirror", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_spring("drive", "ground", "slide", start=(-0.5 * metre, 0, 0), end=(0, 0, 0), stiffness=1e7)
    model.add_spring("wire", "ground", "mirror", start=(-0.2 * metre, 0, 0.1 * metre), end=(0, 0, 0.01 * metre),
                     stiffness=1e3)  # fmt: skip
    model.add_input("force", "slide", "x")
    model.add_input("torque", "mirror", "ry")
    model.add_output("place", "slide", "x")
    model.add_output("tilt", "mirror", "ry")
    return model


@pytest.mark.slow
def test_light_parts_count_as_much_as_heavy_ones_in_any_unit():
    lpvs = [mirror_on_slide(metre).family({"rail.z": np.linspace(-0.1, 0.1, 3) * metre}).interpolated(1e-4)
            for metre in (1.0, 1024.0)]  # fmt: skip
    assert lpvs[0].poses == lpvs[1].poses
    assert lpvs[1].error_bound == pytest.approx(lpvs[0].error_bound, rel=1e-6)
    for place in (-0.083, 0.031, 0.097):
        exact = mirror_on_slide().moved({"rail.z": place}, relaxed=True).linearize(independent=lpvs[0].coordinates)
        found = lpvs[0].at({"rail.z": place}).modes().frequencies
        np.testing.assert_allclose(found, exact.modes().frequencies, rtol=1e-4)


def box(names, reach):
    return {name: [-reach, reach] for name in names}


@pytest.mark.slow
def test_the_bound_holds_for_an_open_chain():
    model = mv.library.puma()
    family = model.family(box(model.linearize().coordinates[1:4], 0.3), grid=True)
    lpv = family.interpolated(1e-4)
    poses = np.random.default_rng(3).uniform(-0.3, 0.3, (200, 3))
    exact, found = family.plant(poses), lpv.matrices(poses)
    for key in "MCKB":
        size = np.maximum(abs(getattr(exact, key)).max(axis=(1, 2)), 0.01 * abs(getattr(family, key)).max())
        assert (abs(found[key] - getattr(exact, key)).max(axis=(1, 2)) <= lpv.error_bound * size).all()


@pytest.mark.slow
def test_the_largest_of_several_numbers_counts_and_quantities_of_studies_will_do():
    family = mv.library.stewart().family({"leg*.slide.z": np.linspace(-3e-3, 3e-3, 4)})
    highest, lowest = family.worst(studies.frequency()), family.worst(studies.frequency(), largest=False)
    assert highest.value == pytest.approx(family.frequencies.max(), rel=1e-12)
    assert lowest.value == pytest.approx(family.frequencies.min(), rel=1e-12)
    assert highest.index == family.frequencies.max(axis=1).argmax()
    assert repr(pickle.loads(pickle.dumps(highest))) == repr(highest)
    peak = family.worst(studies.peak("z", "Fz"))
    assert peak.value == pytest.approx(max(studies.peak("z", "Fz")(system) for system in family), rel=1e-9)
    with pytest.raises(mv.ModelError, match=r"quantity is not a number in pose 2 \(leg1\.slide\.z = 0\.001"):
        family.worst(lambda system: np.nan if system.M[0, 0] == family.M[2, 0, 0] else 1.0)
    with pytest.raises(mv.ModelError, match="quantity = 'peak'; expected a quantity"):
        family.worst("peak")


@pytest.mark.slow
def test_singular_and_unreachable_poses_are_named():
    model = hanging_crank()
    at = STRETCHED - 0.8
    with pytest.raises(mv.SingularPoseError, match=r"^family: pose 1 \(D\.rz = 1\.5\): the loops closed by .* up to"):
        model.family({"D.rz": [-0.1, 1.5]})
    with pytest.raises(mv.SingularPoseError, match=r"^family: pose 2 \(A\.rz = -\d\.\d+\): "):
        model.family({"A.rz": [0.0, 0.1, at]}, independent=["D.rz"])
    heave = mv.library.stewart().family({"leg*.slide.z": [-0.019, 0.019]})  # corners of its box are out of reach
    with pytest.raises(mv.SingularPoseError, match=r"^interpolated: pose \d+ \(leg1\.slide\.z = .*\): the loops"):
        heave.interpolated(1e-2)


@pytest.mark.slow
def test_loads_must_balance_in_each_pose():
    with pytest.raises(mv.EquilibriumError, match=r"^family: pose 1 \(pin\.rz = 0\.1\): .* is not in balance"):
        swinging().family({"pin.rz": [0.0, 0.1]}, relaxed=False)
    family = gantry().family({"rail.z": [0.0, 0.05], "slide.z": [-0.02, 0.02]}, grid=True, relaxed=False)
    wanted = gantry().moved({"rail.z": 0.05, "slide.z": -0.02}).linearize(independent=family.coordinates)
    np.testing.assert_allclose(family.K[2], wanted.K, rtol=0, atol=1e-12 * abs(wanted.K).max())
    lpv = family.interpolated(1e-6)
    np.testing.assert_allclose(lpv.at(family.pose(2)).K, wanted.K, rtol=0, atol=1e-6 * abs(wanted.K).max())


def test_families_of_models_that_are_linearized_one_by_one():
    family = loaded_arm().family({"hinge.rz": [0.0, 0.3]})
    assert family.provenances is not None
    assert [round(there.beams["beam"].end[1], 6) for there in family.models] == [0.0, 0.14776]


@pytest.mark.slow
def test_state_spaces_over_a_grid_for_matlab(tmp_path):
    model = mv.library.stewart(ports=["platform", "base"])
    lpv = model.family({LEGS[0]: [-2e-3, 3e-3], LEGS[3]: [-2e-3, 4e-3]}, grid=True).interpolated(1e-4)
    data = loadmat(lpv.to_mat(tmp_path / "lpv.mat", points=3), simplify_cells=True)
    grid = data["SamplingGrid"]
    assert list(grid) == ["leg1_slide_z", "leg4_slide_z"]
    assert data["A"].shape == (12, 12, 3, 3)
    i, j = 2, 1
    pose = {LEGS[0]: float(grid["leg1_slide_z"][i, j]), LEGS[3]: float(grid["leg4_slide_z"][i, j])}
    assert pose == {LEGS[0]: 3e-3, LEGS[3]: 1e-3}
    space = lpv.at(pose).state_space()
    for key in "ABCD":
        wanted = getattr(space, key)
        np.testing.assert_allclose(data[key][:, :, i, j], wanted, rtol=0, atol=1e-9 * abs(wanted).max() + 1e-300)
    assert data["StateName"].tolist() == list(space.states)
    assert data["InputName"].tolist() == list(lpv.inputs)
    single = model.family({LEGS[0]: [0.0, 1e-3]}).interpolated(1e-3)
    data = loadmat(single.to_mat(tmp_path / "one.mat", points=2))
    assert data["A"].shape == (12, 12, 2)
    assert data["SamplingGrid"]["leg1_slide_z"][0, 0].shape == (2, 1)
    with pytest.raises(mv.ModelError, match="points = 1; expected a whole number"):
        lpv.to_mat(tmp_path / "lpv.mat", points=1)
    most = lpv_module.LARGEST_FILE // sum(getattr(space, key).size for key in "ABCD")
    with pytest.raises(mv.ModelError, match=f"expected no more than {most}"):
        lpv.to_mat(tmp_path / "lpv.mat", points=1000)


@pytest.mark.slow
def test_what_is_refused():
    model = mv.library.stewart()
    for values, text in (
        ({}, "values = {}; expected joint coordinates"),
        ({LEGS[0]: [0.0, 1.0, 2.0], LEGS[1]: [0.0, 1.0]}, "different lengths: 'leg1.slide.z' 3, 'leg2.slide.z' 2"),
        ({LEGS[0]: [0.0, np.nan]}, "expected finite displacements"),
        ({"leg1.slide.x": [0.0]}, "matches no joint coordinate"),
        ({"leg*.slide.z": [0.0], LEGS[0]: [0.0]}, "'leg1.slide.z' has values twice"),
    ):  # fmt: skip
        with pytest.raises(mv.ModelError, match=text):
            model.family(values)
    family = model.family({LEGS[0]: [-1e-3, 1e-3], LEGS[1]: 0.0})
    for error in (0.0, 1e-13, 1.0):
        with pytest.raises(mv.ModelError, match=r"error = .*; expected a number from 1e-11 to 1"):
            family.interpolated(error)
    with pytest.raises(mv.ModelError, match="all poses of the family are the same"):
        model.family({LEGS[0]: [1e-3, 1e-3]}).interpolated()
    lpv = family.interpolated(1e-3)
    for pose, text in (
        ({LEGS[0]: 2e-3}, r"leg1\.slide\.z = 0\.002 is outside the box"),
        ({LEGS[1]: 0.0}, r"there is no value of 'leg1\.slide\.z'"),
        ({LEGS[0]: 0.0, LEGS[1]: 1e-3}, r"leg2\.slide\.z = 0\.001 is outside"),
        ({LEGS[0]: 0.0, "leg1.slide": 0.0}, r"'leg1\.slide' is not a coordinate of the family\. Did you mean"),
    ):
        with pytest.raises(mv.ModelError, match=text):
            lpv.at(pose)


def test_the_number_of_poses_is_limited(monkeypatch):
    family = mv.library.stewart().family(box(LEGS[:2], 5e-3), grid=True)
    monkeypatch.setattr(lpv_module, "MOST", 20)
    with pytest.raises(mv.ModelError, match=r"\d+ poses do not reach error = 1e-06 in the box of leg1\.slide\.z"):
        family.interpolated()


def test_the_degree_of_polynomials_is_limited(monkeypatch):
    """As near a dead centre, where no degree is enough; it went on for ever."""
    family = hanging_crank().family({"A.rz": [-0.2, 0.2]})
    monkeypatch.setattr(sparse_interpolation, "HIGHEST", 3)
    with pytest.raises(mv.ModelError, match=r"4 poses do not reach error = 1e-10 .* a bound of \d.* smaller range"):
        family.interpolated(1e-10)


def test_poses_are_added_where_no_change_is_followed(monkeypatch):
    """As where changes at all points happen to be zero: then the whole set grows by one index each time."""
    checks = []
    monkeypatch.setattr(lpv_module, "FOLLOWED", 1e30)
    monkeypatch.setattr(lpv_module, "_checks", lambda *args: checks.append(args) or np.linspace(-1, 1, 50)[:, None])
    lpv = hanging_crank().family({"A.rz": [-0.2, 0.2]}).interpolated(1e-3)
    assert lpv.error_bound <= 1e-3
    assert len(checks) == lpv.poses


def test_checks_have_all_corners_of_few_coordinates():
    checks = lpv_module._checks(3, 0)
    assert len({tuple(x) for x in checks[-8:].tolist() if set(map(abs, x)) == {1.0}}) == 8
    assert (abs(checks) < 1.0).all(axis=1).sum() >= 1000
    assert not np.array_equal(checks, lpv_module._checks(3, 1))


def test_motions_without_mass_are_refused():
    model = mv.Model("massless")
    model.add_body("a", 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.0))
    model.add_body("b", 0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    model.add_joint("p", "prismatic", "ground", "a", axis=(1, 0, 0))
    model.add_joint("q", "prismatic", "a", "b", axis=(1, 0, 0))
    model.add_spring("k", "a", "b", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 10.0, 1.0)
    model.add_spring("c", "ground", "b", (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, 1.0)
    family = model.family({"p.z": [0.0, 0.1]})
    with pytest.raises(mv.ModelError, match="1 motion of 'massless' moves no mass"):
        family.interpolated()


@pytest.mark.parametrize(("values", "kind"), [({LEGS[0]: 4}, "lines"), ({LEGS[0]: 3, LEGS[1]: 2}, "map"),
                                              ({"leg*.slide.z": 4}, "poses")])  # fmt: skip
def test_figures(values, kind):
    family = mv.library.stewart().family({name: np.linspace(0.0, 2e-3, n) for name, n in values.items()},
                                         grid=kind == "map")  # fmt: skip
    figure = family.plot()
    axes = figure.axes[0]
    if kind == "map":
        assert axes.collections[0].get_array().shape == (3, 2)
        assert axes.get_ylabel() == "leg1.slide.z [m]"
    else:
        assert len(axes.lines) == 6
        assert axes.get_xlabel() == ("leg1.slide.z [m]" if kind == "lines" else "pose")
        np.testing.assert_allclose(axes.lines[0].get_ydata(), family.frequencies[:, 0])
        assert axes.get_ylabel() == "natural frequency [Hz]"


def test_a_map_leaves_rigid_body_modes_out_unless_one_is_asked_for():
    """Two links on hinges; a spring in the second hinge alone, so that the whole arm turns freely."""
    model = mv.Model("arm")
    for name, x, before in (("upper", 0.5, "ground"), ("lower", 1.5, "upper")):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), position=(x, 0, 0))
        model.add_joint(f"{name}.hinge", "revolute", before, name, position=(x - 0.5, 0, 0), axis=(0, 0, 1))
    model.add_torsion_spring("k", "upper", "lower", (0, 0, 1), stiffness=100.0)
    family = model.family({"upper.hinge.rz": [0.0, 0.3], "lower.hinge.rz": [-0.5, 0.0, 0.5]}, grid=True)
    assert (family.frequencies[:, 0] == 0.0).all()
    for figure in (family.plot(), family.plot(mode=2)):
        values = figure.axes[0].collections[0].get_array()
        np.testing.assert_allclose(np.ravel(values), family.frequencies[:, 1])
        assert figure.axes[1].get_ylabel() == "natural frequency of mode 2 [Hz]"
    np.testing.assert_array_equal(family.plot(1).axes[0].collections[0].get_array(), np.zeros((2, 3)))
    for wrong in (0, 3):
        with pytest.raises(mv.ModelError, match=r"Family\.plot: mode"):
            family.plot(wrong)
