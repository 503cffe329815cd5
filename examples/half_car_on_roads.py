"""Half a car over a bump and on a road of class C, its comfort weighted by ISO 2631.

Both tyres stand on ends that the road moves; the rear one meets the road a wheelbase later, in time as a delay, over
frequency as a correlation. Soft dampers give less acceleration on both, yet let the body swing at its first resonance.
"""

import numpy as np

import mbsvib as mv
from mbsvib import isolation

SPEED, FRONT, REAR = 20.0, 1.2, 1.4  # m/s, m
WHEELBASE = FRONT + REAR


def half_car(damping):
    model = mv.Model("half car")
    model.add_body("car", 600.0, (900.0, 900.0, 900.0), (0, 0, 0.6))
    model.add_body("carrier", 0.0, (0, 0, 0), (0, 0, 0.6))
    model.add_joint("heave", "prismatic", "ground", "carrier", (0, 0, 0.6), axis=(0, 0, 1))
    model.add_joint("pitch", "revolute", "carrier", "car", (0, 0, 0.6), axis=(0, 1, 0))
    for axle, x in (("front", FRONT), ("rear", -REAR)):
        wheel = f"{axle}.wheel"
        model.add_body(wheel, 40.0, (1.0, 1.0, 1.0), (x, 0, 0.3))
        model.add_joint(f"{axle}.guide", "prismatic", "ground", wheel, (x, 0, 0.3), axis=(0, 0, 1))
        model.add_spring(f"{axle}.strut", wheel, "car", (x, 0, 0.3), (x, 0, 0.6), stiffness=18e3, damping=damping)
        model.add_spring(f"{axle}.tyre", "ground", wheel, (x, 0, 0), (x, 0, 0.3), stiffness=180e3, damping=100.0)
        model.add_motion_input(f"{axle}.road", f"{axle}.tyre", quantity="velocity")
        model.add_force_output(f"{axle}.tyre force", f"{axle}.tyre")
    model.add_output("driver", "car", "z", position=(0.2, 0, 0.6), quantity="acceleration")
    return model


def later(f):
    """The rear axle repeats the front one later."""
    shift = np.exp(2j * np.pi * f * WHEELBASE / SPEED)
    return np.array([[1.0, shift], [np.conj(shift), 1.0]])


soft, firm = (half_car(damping).linearize() for damping in (800.0, 2500.0))
height = isolation.road_spectrum("C", SPEED, "velocity")
noise = {"front.road": height, "rear.road": height}
comfort = {name: system.rms("driver", noise, correlation=later, weighting="Wk")["driver"]
           for name, system in (("soft", soft), ("firm", firm))}  # fmt: skip

# the same road in time: one realisation, long enough for its root mean square
t = np.arange(0.0, 75.0, 0.005)
profile = isolation.road_profile("C", length=SPEED * 25.0, seed=2)
road = [profile.under(t, SPEED, behind, "velocity") for behind in (0.0, WHEELBASE)]
ride = soft.time_response(t, road, outputs="driver")[0]
plain = soft.rms("driver", noise, correlation=later)["driver"]
lasting = t >= 50.0  # the last period, after the start has decayed
assert abs(np.sqrt(np.mean(ride[lasting] ** 2)) / plain - 1.0) < 0.05

bump = isolation.road_bump(0.08, 1.0, start=5.0)
over = np.arange(0.0, 2.5, 0.001)
kick = [bump.under(over, SPEED / 4.0, behind, "velocity") for behind in (0.0, WHEELBASE)]
peaks = {name: system.time_response(over, kick, outputs=["driver", "front.tyre force"])
         for name, system in (("soft", soft), ("firm", firm))}  # fmt: skip
assert comfort["soft"] < comfort["firm"]

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    fig, (first, second) = plt.subplots(2, 1, figsize=(8, 6.5), layout="constrained")
    for name, response in peaks.items():
        first.plot(over, response[0], label=f"{name} dampers, peak {np.abs(response[0]).max():.1f} m/s²")
    first.set(xlabel="time [s]", ylabel="driver [m/s²]", title="Bump of 80 mm at 5 m/s, front then rear axle")
    f = np.geomspace(0.3, 40.0, 600)
    for name, system in (("soft", soft), ("firm", firm)):
        density = system.psd("driver", noise, f, correlation=later, weighting="Wk")[0]
        second.loglog(f, density, label=f"{name} dampers, weighted rms {comfort[name]:.2f} m/s²")
    second.set(xlabel="frequency [Hz]", ylabel="density, Wk [(m/s²)²/Hz]", title="Road of class C at 20 m/s")
    for axes in (first, second):
        axes.legend(frameon=False)
        axes.grid(alpha=0.3)
    plt.show()
