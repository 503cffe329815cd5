"""The bicycle by the closed formulas of the source, in 40 digits: M q'' + v C1 q' + (g K0 + v^2 K2) q = f.

Source: Meijaard, Papadopoulos, Ruina & Schwab, Proc. R. Soc. A 463 (2007) 1955-1982, appendix A. z points down.
"""

import mpmath as mp

mp.mp.dps = 40
# Table 1; the values are decimal, and doubles of the model are these to 1e-16.
BENCHMARK = {
    "w": "1.02", "c": "0.08", "g": "9.81", "rR": "0.3", "mR": "2", "Rxx": "0.0603", "Ryy": "0.12",
    "xB": "0.3", "zB": "-0.9", "mB": "85", "Bxx": "9.2", "Bxz": "2.4", "Bzz": "2.8",
    "xH": "0.9", "zH": "-0.7", "mH": "4", "Hxx": "0.05892", "Hxz": "-0.00756", "Hzz": "0.00708",
    "rF": "0.35", "mF": "3", "Fxx": "0.1405", "Fyy": "0.28",
}  # fmt: skip


def coefficients(**changes):
    """M, C1, K0, K2 as 2 x 2 matrices, lean then steer; ``lam``: tilt of the steering axis."""
    p = {name: mp.mpf(value) for name, value in BENCHMARK.items()} | {"lam": mp.pi / 10} | changes
    w, c, r, f, lam = p["w"], p["c"], p["rR"], p["rF"], p["lam"]
    masses = p["mR"], p["mB"], p["mH"], p["mF"]
    total = sum(masses)
    xt = (p["xB"] * p["mB"] + p["xH"] * p["mH"] + w * p["mF"]) / total
    zt = (-r * p["mR"] + p["zB"] * p["mB"] + p["zH"] * p["mH"] - f * p["mF"]) / total
    txx = (p["Rxx"] + p["Bxx"] + p["Hxx"] + p["Fxx"] + p["mR"] * r**2 + p["mB"] * p["zB"] ** 2
           + p["mH"] * p["zH"] ** 2 + p["mF"] * f**2)  # fmt: skip
    txz = p["Bxz"] + p["Hxz"] - p["mB"] * p["xB"] * p["zB"] - p["mH"] * p["xH"] * p["zH"] + p["mF"] * w * f
    tzz = (p["Rxx"] + p["Bzz"] + p["Hzz"] + p["Fxx"] + p["mB"] * p["xB"] ** 2 + p["mH"] * p["xH"] ** 2
           + p["mF"] * w**2)  # fmt: skip
    ma = p["mH"] + p["mF"]
    xa, za = (p["xH"] * p["mH"] + w * p["mF"]) / ma, (p["zH"] * p["mH"] - f * p["mF"]) / ma
    axx = p["Hxx"] + p["Fxx"] + p["mH"] * (p["zH"] - za) ** 2 + p["mF"] * (f + za) ** 2
    axz = p["Hxz"] - p["mH"] * (p["xH"] - xa) * (p["zH"] - za) + p["mF"] * (w - xa) * (f + za)
    azz = p["Hzz"] + p["Fxx"] + p["mH"] * (p["xH"] - xa) ** 2 + p["mF"] * (w - xa) ** 2
    sin, cos = mp.sin(lam), mp.cos(lam)
    ua = (xa - w - c) * cos - za * sin
    all_ = ma * ua**2 + axx * sin**2 + 2 * axz * sin * cos + azz * cos**2
    alx = -ma * ua * za + axx * sin + axz * cos
    alz = ma * ua * xa + axz * sin + azz * cos
    mu = c / w * cos
    sf = p["Fyy"] / f
    st = p["Ryy"] / r + sf
    sa = ma * ua + mu * total * xt
    m12 = alx + mu * txz
    mass = mp.matrix([[txx, m12], [m12, all_ + 2 * mu * alz + mu**2 * tzz]])
    k0 = mp.matrix([[total * zt, -sa], [-sa, -sa * sin]])
    k2 = mp.matrix([[0, (st - total * zt) / w * cos], [0, (sa + sf * sin) / w * cos]])
    c1 = mp.matrix([[0, mu * st + sf * cos + txz / w * cos - mu * total * zt],
                    [-(mu * st + sf * cos), alz / w * cos + mu * (sa + tzz / w * cos)]])  # fmt: skip
    return mass, c1, k0, k2


def state_matrix(speed, **changes):
    """A (4, 4) of x' = A x, x = (lean, steer, their rates)."""
    mass, c1, k0, k2 = coefficients(**changes)
    v, g = mp.mpf(speed), changes.get("g", mp.mpf(BENCHMARK["g"]))
    inverse = mass**-1
    a = mp.zeros(4)
    a[0, 2] = a[1, 3] = 1
    a[2:, :2], a[2:, 2:] = -inverse * (g * k0 + v**2 * k2), -inverse * v * c1
    return a


def eigenvalues(speed, **changes):
    """The four eigenvalues, by real and then imaginary part."""
    values = mp.eig(state_matrix(speed, **changes), left=False, right=False)
    return sorted((complex(value) for value in values), key=lambda z: (round(z.real, 9), z.imag))
