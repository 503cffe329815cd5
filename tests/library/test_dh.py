"""Arms from Denavit-Hartenberg rows: forward kinematics and mass matrices against other roads to them."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.library import from_dh

mp = mpmath.MPContext()
mp.dps = 40
# lengths and twists of a PUMA 560, masses and inertia about the links' centres of mass as commonly measured
PUMA = [
    {"alpha": np.pi / 2, "theta": 0.3, "mass": 13.0, "cm": (0, 0.01, -0.05), "inertia": (0.30, 0.35, 0.25)},
    {"a": 0.4318, "theta": -0.7, "mass": 17.4, "cm": (-0.3638, 0.006, 0.2275), "inertia": (0.13, 0.524, 0.539)},
    {"a": 0.0203, "b": 0.15005, "alpha": -np.pi / 2, "theta": 1.1, "mass": 4.8, "cm": (-0.0203, -0.0141, 0.070),
     "inertia": (0.066, 0.086, 0.0525)},
    {"b": 0.4318, "alpha": np.pi / 2, "theta": 0.4, "mass": 0.82, "cm": (0, 0.019, 0),
     "inertia": (1.8e-3, 1.3e-3, 1.8e-3)},
    {"alpha": -np.pi / 2, "theta": -0.9, "mass": 0.34, "inertia": (3e-4, 4e-4, 3e-4)},
    {"theta": 2.0, "mass": 0.09, "cm": (0, 0, 0.032), "inertia": (1.5e-4, 1.5e-4, 4e-5)},
]  # fmt: skip


def transform(row):
    """The 4x4 matrix from frame i + 1 to frame i, as a product of four elementary ones, in 40 digits."""
    def turn(angle, axis):
        c, s = mp.cos(mp.mpf(angle)), mp.sin(mp.mpf(angle))
        rows = [[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0]] if axis == 2 else [[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0]]
        return mp.matrix([*rows, [0, 0, 0, 1]])

    def shift(x, z):
        result = mp.eye(4)
        result[0, 3], result[2, 3] = mp.mpf(x), mp.mpf(z)
        return result

    return turn(row.get("theta", 0.0), 2) * shift(0, row.get("b", 0.0)) * shift(row.get("a", 0.0), 0) * \
        turn(row.get("alpha", 0.0), 0)  # fmt: skip


def placed(row):
    """The 4x4 matrix of the offset and turn of a row."""
    result = mp.eye(4)
    turn = np.array(mv.common.arguments.orientation(row.get("turn"), "row"))
    for a in range(3):
        result[a, 3] = mp.mpf(row.get("offset", (0, 0, 0))[a])
        for b in range(3):
            result[a, b] = mp.mpf(turn[a, b])
    return result


def parents(rows):
    """Number of the row before each row, -1 for ground."""
    names = [row.get("name", f"link{i}") for i, row in enumerate(rows, 1)]
    return [i - 1 if "parent" not in row else ["ground", *names].index(row["parent"]) - 1
            for i, row in enumerate(rows)]  # fmt: skip


def bases(rows):
    """The frame of every joint."""
    own, result = [], []
    for row, parent in zip(rows, parents(rows), strict=True):
        result.append((mp.eye(4) if parent < 0 else own[parent]) * placed(row))
        own.append(result[-1] * transform(row))
    return result


def frames(rows):
    return [mp.eye(4), *(base * transform(row) for base, row in zip(bases(rows), rows, strict=True))]


def mass_matrix(rows):
    """Sum of m Jv^T Jv + Jw^T Q I Q^T Jw, the Jacobians from axes and origins of the frames, in 40 digits."""
    at, base, n = frames(rows), bases(rows), len(rows)
    total = mp.zeros(n, n)
    for k, row in enumerate(rows):
        own = at[k + 1]
        c = mp.matrix([mp.mpf(v) for v in row.get("cm", (0, 0, 0))])
        centre = own[:3, :3] * c + own[:3, 3]
        jv, jw = mp.zeros(3, n), mp.zeros(3, n)
        i = k
        while i >= 0:
            z, arm = base[i][:3, 2], centre - base[i][:3, 3]
            if rows[i].get("joint", "R") in ("P", "prismatic"):
                jv[:, i] = z
            else:
                jv[:, i] = mp.matrix([z[1] * arm[2] - z[2] * arm[1], z[2] * arm[0] - z[0] * arm[2],
                                      z[0] * arm[1] - z[1] * arm[0]])  # fmt: skip
                jw[:, i] = z
            i = parents(rows)[i]
        given = np.array(row["inertia"], dtype=float)
        tensor = mp.matrix((np.diag(given) if given.ndim == 1 else given).tolist())
        inertia = own[:3, :3] * tensor * own[:3, :3].T
        total += mp.mpf(row["mass"]) * jv.T * jv + jw.T * inertia * jw
    return np.array(total.tolist(), dtype=float)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 2**31), st.integers(1, 7))
def test_kinematics_and_mass_matrix_of_any_arm(seed, n):
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(n):
        sizes = rng.uniform(0.1, 0.6, size=3) ** 2
        rows.append({
            "a": rng.uniform(-1, 1), "b": rng.uniform(-1, 1), "alpha": rng.uniform(-4, 4), "theta": rng.uniform(-4, 4),
            "joint": rng.choice(["revolute", "prismatic", "R", "P"]), "mass": rng.uniform(0.5, 5),
            "cm": rng.uniform(-0.5, 0.5, size=3), "inertia": sizes.sum() - sizes,
        })  # fmt: skip
    model = from_dh(rows)
    for row, frame, body in zip(rows, frames(rows)[1:], model.bodies.values(), strict=True):
        pose = np.array(frame.tolist(), dtype=float)
        assert_allclose(body.orientation, pose[:3, :3], atol=1e-14)
        assert_allclose(body.position, pose[:3, :3] @ row["cm"] + pose[:3, 3], atol=1e-14)
    system = model.linearize()
    exact = mass_matrix(rows)
    assert_allclose(system.M, exact, rtol=0, atol=1e-13 * np.abs(exact).max())


@pytest.mark.slow
@settings(max_examples=20)
@given(st.integers(0, 2**31), st.integers(2, 7))
def test_mass_matrix_of_any_tree(seed, n):
    rng = np.random.default_rng(seed)
    rows = []
    for i in range(n):
        sizes = rng.uniform(0.1, 0.6, size=3) ** 2
        rows.append({
            "a": rng.uniform(-1, 1), "b": rng.uniform(-1, 1), "alpha": rng.uniform(-4, 4), "theta": rng.uniform(-4, 4),
            "joint": rng.choice(["R", "P"]), "mass": rng.uniform(0.5, 5), "inertia": sizes.sum() - sizes,
            "cm": rng.uniform(-0.5, 0.5, size=3), "offset": rng.uniform(-1, 1, size=3),
            "turn": rng.uniform(-2, 2, size=3),
            "parent": str(rng.choice(["ground", *(f"link{k + 1}" for k in range(i))])),
        })  # fmt: skip
    system, exact = from_dh(rows).linearize(), mass_matrix(rows)
    order = [system.coordinates.index(f"joint{i + 1}.{'rz' if row['joint'] == 'R' else 'z'}")
             for i, row in enumerate(rows)]  # fmt: skip
    assert_allclose(system.M[np.ix_(order, order)], exact, rtol=0, atol=1e-13 * np.abs(exact).max())


def test_closing_joints_make_the_linkage_that_is_drawn():
    """Hoeken's linkage from rows against that of the library, which is drawn by its pins."""
    hoeken = mv.library.hoeken(angle=0.9)
    pins = {name: np.array(joint.position) for name, joint in hoeken.joints.items()}
    bend = lambda start, end: np.arctan2(*(pins[end] - pins[start])[1::-1])  # noqa: E731
    first, second, third = bend("crank", "pin12"), bend("pin12", "pin23"), bend("rocker", "pin23")
    bar = lambda length, theta: {"a": length, "theta": theta, "mass": 2 * length, "cm": (-length / 2, 0, 0),  # noqa: E731
                                 "inertia": (1e-9, length**3 / 6, length**3 / 6)}  # fmt: skip
    rows = [bar(0.1, first), bar(0.25, second - first), bar(0.25, third) | {"parent": "ground", "offset": (0.2, 0, 0)}]
    for closing in ([{"first": "link2", "second": "link3"}],
                    [{"first": "link3", "second": "link2", "joint": "spherical", "name": "pin"}]):  # fmt: skip
        system = from_dh(rows, closing=closing).linearize(independent=["joint1.rz"])
        assert_allclose(system.M, hoeken.linearize(independent=["crank.rz"]).M, rtol=1e-12)


def test_mass_matrix_of_a_puma():
    system = from_dh(PUMA).linearize()
    exact = mass_matrix(PUMA)
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert_allclose(system.M / scale, exact / scale, rtol=0, atol=1e-14)
    assert_allclose(system.B, np.eye(6), atol=1e-15)
    assert_allclose(system.Cq[:6], np.eye(6), atol=1e-15)


def test_two_links_by_hand():
    """M11 = I1 + I2 + m1 c1^2 + m2 (l1^2 + c2^2 + 2 l1 c2 cos q), M12 = I2 + m2 (c2^2 + l1 c2 cos q)."""
    m1, m2, l1, l2, c1, c2, j1, j2, q2 = 2.0, 1.5, 0.4, 0.3, 0.25, 0.1, 0.03, 0.02, 0.8
    rows = [
        {"a": l1, "theta": 0.5, "mass": m1, "cm": (c1 - l1, 0, 0), "inertia": (0.02, 0.02, j1)},
        {"a": l2, "theta": q2, "mass": m2, "cm": (c2 - l2, 0, 0), "inertia": (0.02, 0.02, j2)},
    ]
    coupling = j2 + m2 * (c2**2 + l1 * c2 * np.cos(q2))
    first = j1 + j2 + m1 * c1**2 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * np.cos(q2))
    expected = [[first, coupling], [coupling, j2 + m2 * c2**2]]
    assert_allclose(from_dh(rows).linearize().M, expected, rtol=1e-14)


def test_the_tool_moves_as_the_frames_do():
    """Outputs x ... rz per joint displacement against differences of the frames in 40 digits."""
    rows = [*PUMA[:2], {"joint": "P", "b": 0.2, "alpha": 0.3, "mass": 1.0, "inertia": (0.1, 0.1, 0.1)}]
    system, step = from_dh(rows).linearize(), mp.mpf("1e-15")
    before = frames(rows)[-1]
    for i, row in enumerate(rows):
        key = "b" if row.get("joint") == "P" else "theta"
        moved = frames([*rows[:i], row | {key: mp.mpf(row.get(key, 0.0)) + step}, *rows[i + 1 :]])[-1]
        rate = (moved - before) / step
        spin = rate[:3, :3] * before[:3, :3].T
        expected = [*rate[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]]
        assert_allclose(system.Cq[3:, i], [float(v) for v in expected], atol=1e-13)


def test_inertia_about_the_frame_is_transported():
    """A.9 and the parallel axis theorem: the same arm, told in the frames' origins, gives the same matrix."""
    stated = []
    for row in PUMA:
        c = np.array(row.get("cm", (0.0, 0.0, 0.0)))
        tensor = np.diag(row["inertia"]) + row["mass"] * (c @ c * np.eye(3) - np.outer(c, c))
        stated.append(row | {"inertia": tensor, "about": "origin"})
    assert_allclose(from_dh(stated).linearize().M, from_dh(PUMA).linearize().M, rtol=1e-12, atol=1e-13)
    six = [stated[1] | {"inertia": stated[1]["inertia"][[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]}]
    assert_allclose(from_dh(six).linearize().M, from_dh([PUMA[1]]).linearize().M, rtol=1e-13)
    model, turn = from_dh(PUMA), np.eye(3)
    for row, body in zip(PUMA, model.bodies.values(), strict=True):
        turn = turn @ np.array(transform(row)[:3, :3].tolist(), dtype=float)
        axes = np.array(body.orientation)
        assert_allclose(axes @ np.diag(row["inertia"]) @ axes.T, turn @ np.diag(row["inertia"]) @ turn.T, atol=1e-15)


def test_right_angles_are_right():
    axes = np.array(from_dh([PUMA[0] | {"theta": -np.pi}]).bodies["link1"].orientation)
    assert np.array_equal(axes, [[-1, 0, 0], [0, 0, 1], [0, 1, 0]])


def test_a_base_elsewhere_moves_the_arm_as_a_whole():
    turn = mv.common.arguments.exponential((0.3, -0.4, 0.5))
    moved = from_dh(PUMA, position=(1, 2, 3), orientation=turn, name="puma")
    here = from_dh(PUMA)
    assert moved.name == "puma"
    for name, body in here.bodies.items():
        assert_allclose(moved.bodies[name].position, np.array(turn) @ body.position + (1, 2, 3), atol=1e-14)
    assert_allclose(moved.linearize().M, here.linearize().M, rtol=1e-12, atol=1e-13)


def test_top_level_name():
    assert mv.from_dh is from_dh


ROW = {"a": 0.4, "mass": 1.0, "inertia": (1, 1, 1)}
MISTAKES = [
    ([], r"from_dh: rows = \[\]; expected a mapping for each link"),
    (ROW, "from_dh: rows = .*expected a mapping for each link"),
    ([ROW, (0.4, 0, 0, 0)], r"link 2: row = \(0.4, 0, 0, 0\); expected a mapping with the words a, b"),
    ([ROW | {"tetha": 1.0}], r"link 1: there is no word 'tetha'. Did you mean 'theta'\?"),
    ([{"a": 1.0, "inertia": (1, 1, 1)}], "link 1: mass = None; expected a mass"),
    ([{"a": 1.0, "mass": 1.0}], "link 1: inertia = None; expected 3, 6 or 3x3"),
    ([ROW | {"alpha": "90 deg"}], r"link 1: alpha = '90 deg'; expected a finite number \[rad\]"),
    ([ROW | {"b": np.inf}], "link 1: b = inf"),
    ([ROW | {"joint": "spherical"}], "link 1: joint = 'spherical'; expected revolute or prismatic.*several rows"),
    ([ROW | {"joint": "prismatc"}], "Did you mean 'prismatic'"),
    ([ROW | {"about": "com"}], "link 1: about = 'com'; expected 'cm' or 'origin'"),
    ([ROW | {"cm": (1, 2)}], r"link 1: cm = \(1, 2\)"),
    ([ROW | {"about": "origin", "inertia": (1, 2)}], r"body 'link1': inertia = \(1, 2\); expected 3, 6 or 3x3"),
    ([ROW, ROW | {"parent": "link3"}], "link 2: parent = 'link3'; expected the name of a link before it"),
    ([ROW | {"offset": (1, 2)}], r"link 1: offset = \(1, 2\)"),
    ([ROW, ROW | {"mass": -1.0}], "body 'link2': mass = -1.0"),
    ([ROW | {"name": "hand"}, ROW | {"name": "hand"}], "body 'hand': the name is taken"),
]


@pytest.mark.parametrize(("rows", "message"), MISTAKES)
def test_mistakes_are_named(rows, message):
    with pytest.raises(mv.ModelError, match=message):
        from_dh(rows)


@pytest.mark.parametrize(
    ("closing", "said"),
    [({"first": "link1"}, "from_dh: closing = .*a mapping for each joint that closes"),
     ([{"second": "link1"}], "closing joint 1: first = None; expected the link"),
     ([{"first": "lnk1"}], "closing joint 1: first = 'lnk1'.*Did you mean 'link1'"),
     ([{"first": "link1", "joint": "screw"}], "closing joint 1: joint = 'screw'.*add_joint"),
     ([{"frist": "link1"}], "there is no word 'frist'. Did you mean 'first'")],
)  # fmt: skip
def test_mistakes_in_closing_joints_are_named(closing, said):
    with pytest.raises(mv.ModelError, match=said):
        from_dh([ROW, ROW], closing=closing)
