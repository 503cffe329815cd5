"""Mechanisms of any number of bodies, beyond the library's: grids, rings, braced chains, floating chains."""

import numpy as np

import mbsvib as mv

INERTIA = (0.1, 0.12, 0.15)


def grid(nx, ny, joint="revolute", flat=True, seed=0):
    """Bodies in a grid, not quite even, each joined to its neighbours: (nx - 1) (ny - 1) loops."""
    rng = np.random.default_rng(seed)
    model = mv.Model(f"grid{nx}x{ny}")
    positions = {}
    for i in range(nx):
        for j in range(ny):
            x, y, z = rng.uniform(-0.1, 0.1, size=3)
            positions[i, j] = np.array((i + x, j + y, 0.0 if flat else 2 * z))
            model.add_body(f"b{i}.{j}", 1.0 + rng.uniform(), INERTIA, positions[i, j])
    damping = 1e-3 * np.array((100.0, 110.0, 120.0, 100.0, 100.0, 100.0))
    for (i, j), here in positions.items():
        for other in ((i + 1, j), (i, j + 1)):
            if other in positions:
                a, b, point = f"b{i}.{j}", "b{}.{}".format(*other), (here + positions[other]) / 2
                name = f"{a}-{b}"
                model.add_joint(name, joint, a, b, point)
                model.add_bushing(f"{name}.spring", a, b, point, 1e3 * damping, damping)
    root = (-0.5, 0.0, 0.0)
    model.add_joint("root", joint, "ground", "b0.0", root)
    model.add_bushing("root.spring", "ground", "b0.0", root, 1e3 * damping, damping)
    last = f"b{nx - 1}.{ny - 1}"
    model.add_input("F", last, "x")
    model.add_output("y", last, "y")
    return model


def ring(n, joint="spherical"):
    """A closed ring that floats on six springs at one body."""
    angle = 2 * np.pi * np.arange(n) / n
    position = np.stack((np.cos(angle), np.sin(angle), 0.1 * np.sin(2 * angle)), axis=1) * n / 6
    model = mv.Model(f"ring{n}")
    for i, point in enumerate(position):
        model.add_body(f"b{i}", 1.0, INERTIA, point)
    for i in range(n):
        a, b, point = f"b{i}", f"b{(i + 1) % n}", (position[i] + position[(i + 1) % n]) / 2
        model.add_joint(f"j{i}", joint, a, b, point)
        model.add_bushing(f"s{i}", a, b, point, (100.0,) * 6, (0.1,) * 6)
    model.add_bushing("base", "ground", "b0", position[0], (50.0,) * 6, (0.2,) * 6)
    model.add_input("F", f"b{n // 3}", "x")
    model.add_output("y", f"b{n // 2}", "y")
    return model


def braced(n, every=4):
    """A spherical chain with a brace, a body more, across every fourth pair of joints: one spatial loop each."""
    model = mv.Model(f"braced{n}")
    bodies, before, stiffness = 0, "ground", (0.0, 0.0, 0.0, 900.0, 1000.0, 1100.0)
    damping = tuple(1e-3 * k for k in stiffness)
    link = 0
    while bodies < n:
        name, x = f"link{link}", float(link)
        model.add_body(name, 1.0, INERTIA, (x + 0.5, 0.1 * (link % 2), 0.05 * (link % 3)))
        model.add_joint(f"{name}.joint", "spherical", before, name, (x, 0.0, 0.0))
        model.add_bushing(f"{name}.spring", before, name, (x, 0.0, 0.0), stiffness, damping)
        bodies += 1
        if link % (every - 1) == every - 2 and bodies < n:
            brace, first = f"brace{link}", f"link{link - 1}"
            model.add_body(brace, 0.3, (0.01, 0.02, 0.02), (x, 0.6, 0.1))
            for side, (body, offset) in {"a": (first, -0.5), "b": (name, 0.5)}.items():
                point = (x + offset, 0.5, 0.1)
                model.add_joint(f"{brace}.{side}", "spherical", body, brace, point)
                model.add_bushing(f"{brace}.{side}.spring", body, brace, point, (0, 0, 0, 3.0, 4.0, 5.0))
            bodies += 1
        before, link = name, link + 1
    model.add_input("F", before, "z")
    model.add_output("z", before, "z")
    return model


def floating(n, tie=""):
    """A spherical chain in free space; ``tie`` holds its end to "ground" or to its own "start" by one line spring."""
    model = mv.Model(f"floating{n}")
    for i in range(n):
        model.add_body(f"b{i}", 1.0 + i % 3, INERTIA, (0.5 * i, 0.1 * (i % 2), 0.05 * (i % 3)))
    for i in range(n - 1):
        a, b, point = f"b{i}", f"b{i + 1}", (0.5 * i + 0.25, 0.0, 0.0)
        model.add_joint(f"j{i}", "spherical", a, b, point)
        rotating = 0.12 if i % 2 else 0.3
        model.add_bushing(f"s{i}", a, b, point, (0, 0, 0, 100, 110, 120), (0, 0, 0, 0.1, 0.11, rotating))
    end = (0.5 * n - 0.5, 0.0, 0.0)
    if tie == "ground":
        model.add_spring("tie", "ground", f"b{n - 1}", (0.5 * n, 0.0, 3.0), end, 50.0, 2.0)
    elif tie:
        model.add_spring("tie", "b0", f"b{n - 1}", (0.0, 0.0, 0.0), end, 50.0, 2.0)
    return model


def dashed(n, damping=30.0, every=7):
    """A revolute chain with a damper at every seventh joint, which no mode is free of: damping that couples modes."""
    model = mv.Model(f"dashed{n}")
    for i in range(n):
        a, b, point = f"b{i - 1}" if i else "ground", f"b{i}", (0.0, 0.25 * i, 0.0)
        model.add_body(b, 1.0, (1.0, 1.0, 1.0), (0.0, 0.25 * i + 0.125, 0.0))
        model.add_joint(f"j{i}", "revolute", a, b, point)
        c = 0.0 if i % every else damping
        model.add_bushing(f"s{i}", a, b, point, (0, 0, 0, 0, 0, 1e4), (0, 0, 0, 0, 0, c))
    model.add_input("M", f"b{n - 1}", "rz")
    model.add_output("rz", f"b{n - 1}", "rz")
    return model


def leapfrog(n):
    """Springs join every other body of a revolute chain, none the neighbours: one motion meets none of them."""
    model = mv.Model(f"leapfrog{n}")
    for i in range(n):
        model.add_body(f"b{i}", 1.0, INERTIA, (float(i), 0.0, 0.0))
        model.add_joint(f"j{i}", "revolute", f"b{i - 1}" if i else "ground", f"b{i}", (i - 0.5, 0.0, 0.0))
        if i:
            other = f"b{i - 2}" if i > 1 else "ground"
            model.add_bushing(f"s{i}", other, f"b{i}", (i - 0.5, 0.0, 0.0), (0, 0, 0, 0, 0, 100.0))
    return model


def pendulums(n):
    """Equal pendulums side by side: one frequency n times."""
    model = mv.Model(f"pendulums{n}")
    for i in range(n):
        model.add_body(f"b{i}", 1.0, INERTIA, (float(i), 0.0, 0.0))
        model.add_joint(f"j{i}", "revolute", "ground", f"b{i}", (float(i), 1.0, 0.0))
        model.add_bushing(f"s{i}", "ground", f"b{i}", (float(i), 1.0, 0.0), (0, 0, 0, 0, 0, 100.0))
    return model


def shaft(disks, damping=0.0, rotating=0.0, free=False, speed=500.0):
    """Disks on elastic joints in a row, that spin; on two bearings unless it is free."""
    model, last, length = mv.Model("shaft"), None, 1.0 / disks
    for k in range(disks):
        model.add_body(f"d{k}", 1.0 + 0.1 * (k % 3), (2e-3, 2e-3, 4e-3), (0, 0, k * length))
        model.add_rotor(f"spin{k}", f"d{k}", speed, (0, 0, 1))
        stiffness = (1e7, 1e7, 1e8, 1e5 * disks, 1e5 * disks, 1e4 * disks)
        if last:
            model.add_bushing(f"s{k}", last, f"d{k}", (0, 0, (k - 0.5) * length), stiffness,
                              tuple(rotating * value for value in stiffness))  # fmt: skip
        last = f"d{k}"
    for k in () if free else (0, disks - 1):
        stiffness = (1e6, 1.2e6, 1e6, 0, 0, 0)
        model.add_bushing(f"bearing{k}", "ground", f"d{k}", (0, 0, k * length), stiffness,
                          tuple(damping * value for value in stiffness))  # fmt: skip
    model.add_input("push", "d0", "x")
    model.add_output("moves", last, "y")
    return model


def follower_chain(bodies, force, free=False, drag=True):
    """A flexible column of ball joints under a thrust that turns with its end; free, with a drag that may turn too."""
    model, last, length = mv.Model("column"), None if free else "ground", 1.0 / bodies
    for k in range(bodies):
        model.add_body(f"b{k}", 1.0 + 0.1 * (k % 3), (2e-3, 2.2e-3, 4e-3), (0, 0, k * length))
        if last:
            at, stiffness = (0, 0, (k - 0.5) * length), (0, 0, 0, 1e3 * bodies, 1.2e3 * bodies, 1e3 * bodies)
            model.add_joint(f"j{k}", "spherical", last, f"b{k}", at)
            model.add_bushing(f"s{k}", last, f"b{k}", at, stiffness, tuple(1e-5 * value for value in stiffness))
        last = f"b{k}"
    model.add_load("thrust", last, (0, 0, -force), position=(0, 0, (bodies - 1) * length), follower=True)
    if free:
        model.add_load("drag", "b0", (0, 0, force), position=(0, 0, 0), follower=drag)
    model.add_input("push", "b0", "x")
    model.add_output("moves", last, (1.0, 0.5, 0.0, 0.0, 0.0, 0.0))
    return model
