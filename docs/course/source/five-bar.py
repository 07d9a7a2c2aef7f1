# %% [markdown]
# # The five-bar at two rates
#
# *45 minutes. Chapter 6 of the report.* A hand pulls a five-bar linkage that exists only in the
# computer. The device is controlled at 512 Hz, and what the linkage resists is computed at the
# graphics rate, 30 Hz. Here you find out what the hand feels, how old it is, and what that costs.
#
# You need what mobility and a Jacobian are; the worksheet on the virtual wall comes before. Each
# figure comes after a question that begins with **Predict**: sketch your answer on paper before
# you read the next cell and run it. The blanks `...` are for you. Run all cells from the top once;
# the checks of a blank are silent until you fill it.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hapticlink as hl

BLUE, ORANGE, GREY = "tab:blue", "tab:orange", "0.5"

# %% [markdown]
# ## 1. What the hand feels
#
# Four links and the ground, joined by five hinges in a loop. The hand pulls a device; the device's
# handle shall go where the *operational point* goes, the centre of link 2. A pose is x, y and an
# angle: three degrees of freedom.

# %%
hl.run("closed-loop", {"duration": 0.1}).figures()["mechanism"]

# %% [markdown]
# **Exercise 1.** How many degrees of freedom does the linkage have (three for each moving link,
# less two for each hinge)? So in how many directions can the operational point not be moved?

# %% blank
freedom = ...
constrained = ...  # directions in which the operational point cannot move

# %%
felt = hl.run("closed-loop")
counts = felt["virtual_environment.n_constraints"]  # counted in each frame

# %% blank
if constrained is not ...:
    assert constrained == np.median(counts), "the frames count another number"
    print("right")

# %% [markdown] answer
# Three times four less two times five: two. A point with three degrees of freedom on a linkage
# with two cannot move in one direction. In some poses it is two: 9 of the 91 frames, in which the
# linkage is close to a pose where it locks a second direction.

# %% answer
freedom = 3 * 4 - 2 * 5
constrained = 3 - freedom
assert (freedom, constrained) == (2, 1)
assert np.sum(counts == 1) == 82
assert np.sum(counts == 2) == 9
assert len(counts) == 91

# %% [markdown]
# The controller renders two things. The mobility of the linkage at the hand, $\Lambda^{-1}$, says
# how fast a force accelerates it. The *topology controller* pushes the handle back along the
# constrained directions, as the joints of a real linkage would.
#
# **Predict.** The hand pulls to the left with 0.5 N. Sketch the paths of operational point and
# handle for 3 s, with the topology controller and without it. Without it the handle still gets the
# mobility, and a coupling $F_\mathrm{drift}$ of spring and damper pulls it after the operational
# point; but the mobility multiplies that force, too. In which direction does the coupling do
# nothing?

# %%
unfelt = hl.run("closed-loop", {"controller.topology": False})
figure, panels = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for axes, run, name in [(panels[0], felt, "with"), (panels[1], unfelt, "without")]:
    for signal, colour, label in [
        ("virtual_mechanism.x", ORANGE, "operational point"),
        ("haptic_device.x_true", BLUE, "handle"),
    ]:
        path = 1e3 * run[signal]  # mm
        axes.plot(path[:, 0], path[:, 1], color=colour, label=label)
        axes.plot(*path[0, :2], "o", color=colour)
    apart = run.tracking().distance_mm.max()
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title=f"{name}: at most {apart:.0f} mm apart")
    axes.axis("equal")
panels[0].legend()
figure.suptitle("Only a handle that is pushed back stays with the linkage (dots: start)")
plt.show()

# %% [markdown] answer
# In a constrained direction the mobility is zero, and zero times $F_\mathrm{drift}$ is zero: the
# coupling cannot pull the handle back in the very direction in which the linkage does not go. What
# is a little wrong with an acceleration is integrated twice, into a drift that grows, until the
# device leaves its workspace and the run ends.

# %% answer
assert np.isclose(felt.tracking().distance_mm.max(), 5.1, atol=0.05)
assert np.isclose(unfelt.tracking().distance_mm.max(), 216, atol=0.5)
assert unfelt.run["end"]["reason"] == "stop_when"
assert unfelt.run["end"]["time"] < 3

# %% [markdown]
# ## 2. How old it is
#
# $\Lambda^{-1}$ and the constrained directions come from a *graphics copy* of the linkage. It
# reads the pose of the linkage at the start of a frame, computes until the frame ends, and its
# result is held until the next one comes.
#
# **Predict.** Sketch the angle of the linkage over 0.3 s as a smooth curve, and the one to which
# the controller's matrices belong as steps. By how much do the steps lag, at 30 Hz?

# %%
time, angle = felt.time("virtual_mechanism.x"), felt["virtual_mechanism.x"][:, 2]
frames, known = felt.time("virtual_environment.x"), felt["virtual_environment.x"][:, 2]
plt.plot(time, angle, color=ORANGE, label="linkage")
plt.step(frames, known, where="post", color=BLUE, label="copy, as the controller has it")
plt.xlim(0.6, 0.9)
shown = (time > 0.6) & (time < 0.9)
plt.ylim(angle[shown].min() - 0.3, angle[shown].max() + 0.3)
plt.xlabel("time (s)")
plt.ylabel("angle of the operational point (rad)")
plt.title("What the controller renders is a frame or two old")
plt.legend()
plt.show()

# %% [markdown]
# **Exercise 2.** How old are the matrices when the controller uses them, at least, at most and on
# average?

# %% blank
youngest = ...  # s
oldest = ...  # s
average = ...  # s

if average is not ...:
    ages = felt.run["delays"]["virtual_environment.Lambda_inv -> controller.Lambda_inv"]
    print({key: f"{1e3 * age:.1f} ms" for key, age in ages.items()})
    expected = [ages["min"], ages["max"], ages["mean"]]
    assert np.allclose([youngest, oldest, average], expected, atol=1e-3), "not as in the run"

# %% [markdown] answer
# One frame old when they come, two when the next ones replace them, one and a half on average: 33,
# 67 and 50 ms. That is 17 to 34 periods of the controller.

# %% answer
youngest, oldest, average = 1 / 30, 2 / 30, 1.5 / 30
ages = felt.run["delays"]["virtual_environment.Lambda_inv -> controller.Lambda_inv"]
assert np.allclose([youngest, oldest, average], [ages["min"], ages["max"], ages["mean"]], atol=1e-3)
assert [round(512 * age) for age in (youngest, oldest)] == [17, 34]

# %% [markdown]
# ## 3. What the rate costs
#
# To see the rate alone, the device now knows its pose without encoders (`closed-loop-ideal`). The
# report leaves out the accelerations that a moving linkage has by itself (Coriolis and centrifugal
# terms), because they are small: `controller.bias = "none"`. With "full" the controller renders
# them, too.
#
# **Predict.** Sketch the largest distance of handle and operational point over the graphics rate,
# from 10 to 60 Hz, without these terms and with them. Does a faster rate help in both cases?

# %%
rates = [10, 20, 30, 60]
distance = {
    bias: [
        hl.run("closed-loop-ideal", {"graphics.rate": rate, "controller.bias": bias})
        .tracking().distance_mm.max()
        for rate in rates
    ]
    for bias in ("none", "full")
}  # fmt: skip
plt.plot(rates, distance["none"], "o-", color=ORANGE, label="without velocity terms")
plt.plot(rates, distance["full"], "o-", color=BLUE, label="with them")
plt.ylim(0, None)
plt.xlabel("graphics rate (Hz)")
plt.ylabel("largest distance (mm)")
plt.title("Here a faster rate helps only if velocity terms are rendered")
plt.legend()
plt.show()

# %% [markdown]
# **Exercise 3.** If the distance were in proportion to the age of the matrices, by which factor
# would it fall from 10 to 60 Hz? By which factor does it fall in the two curves?

# %% blank
factor = ...  # in proportion to the age

if factor is not ...:
    for bias, found in distance.items():
        print(f"{bias}: {found[0] / found[-1]:.1f}, in proportion to the age {factor:.1f}")

# %% [markdown] answer
# The age is 1.5 frames: a factor of six. With velocity terms it is 5.35. Without them the distance
# is larger at every rate, and at 60 Hz larger than at 10 Hz: the error of the law is so much
# larger than the error of the rate that it hides it. If you measure only that law, you will say
# that the rate does not matter.

# %% answer
factor = 60 / 10
fall = {bias: found[0] / found[-1] for bias, found in distance.items()}
print(fall)
assert np.isclose(fall["full"], 5.35, atol=0.05)
assert fall["none"] < 1
assert all(n > 5 * f for n, f in zip(distance["none"], distance["full"], strict=True))

# %% [markdown]
# ## 4. When power crosses the rates
#
# So far matrices cross the rates, and no force. In `closed-loop-direct` the linkage itself is
# simulated at the graphics rate. The force of the coupling between handle and linkage, $F$, is
# then held for a whole frame, while the linkage moves by $\Delta x$. As with the wall, the hold
# can generate energy:
#
# $$E_\mathrm{held} = \sum_\mathrm{frames} F_\mathrm{held} \cdot \Delta x, \qquad
# E_\mathrm{ideal} = \sum_\mathrm{512\,Hz} \tfrac12 (F_n + F_{n+1}) \cdot (x_{n+1} - x_n)$$
#
# with x at 512 Hz on the straight line between two frames. Generated is their difference.

# %%
direct = {hold: hl.run("closed-loop-direct", {"hold": hold}) for hold in ("zoh", "passive")}
coupling = "controller.F_drift -> virtual_mechanism.F_drift"
run = direct["zoh"]
frames, x = run.time("virtual_mechanism.x"), run["virtual_mechanism.x"]
time, F = run.time("controller.F_drift"), -run["controller.F_drift"]  # as it acts on the linkage
F_held = F[np.searchsorted(time, frames + 1e-9) - 1]  # the newest one at the start of each frame
x_fast = np.column_stack([np.interp(time, frames, x[:, i]) for i in range(3)])

# %% [markdown]
# **Exercise 4.** Compute both, and compare with the account in `run.json`.

# %% blank
held = ...  # J
ideal = ...  # J

if held is not ... and ideal is not ...:
    account = run.run["energies"][coupling]
    assert np.isclose(held, account["held"]), f"held: the run says {account['held']:.4f} J"
    assert np.isclose(ideal, account["ideal"]), f"ideal: the run says {account['ideal']:.4f} J"
    print("right")

# %% answer
held = np.sum(F_held[:-1] * np.diff(x, axis=0))
ideal = np.sum(0.5 * (F[:-1] + F[1:]) * np.diff(x_fast, axis=0))
account = run.run["energies"][coupling]
assert np.allclose([held, ideal], [account["held"], account["ideal"]])
print(f"generated {1e3 * (held - ideal):.0f} mJ")
assert np.isclose(1e3 * (held - ideal), 152, atol=0.5)  # mJ

# %% [markdown]
# **Predict.** A passive hold does not hold the newest force where that would generate energy. How
# far will handle and linkage be apart over the 3 s, with the plain zero-order hold and with the
# passive one?

# %%
for hold, colour in [("zoh", ORANGE), ("passive", BLUE)]:
    error = direct[hold].tracking()
    most = 1e3 * direct[hold].run["energies"][coupling]["peak"]
    plt.plot(error.time_s, error.distance_mm, color=colour, label=f"{hold}: up to {most:.3g} mJ")
plt.xlabel("time (s)")
plt.ylabel("distance of handle and operational point (mm)")
far, near = (direct[hold].tracking().distance_mm.max() for hold in ("zoh", "passive"))
plt.title(f"The passive hold: at most {near:.1f} mm apart in place of {far:.1f} mm")
plt.legend(title="generated by the hold")
plt.show()

# %% [markdown] answer
# The zero-order hold generates up to 162 mJ, the passive one 0.44 mJ; the largest distance falls
# from 13.4 to 8.7 mm.

# %% answer
peak = {hold: 1e3 * r.run["energies"][coupling]["peak"] for hold, r in direct.items()}
assert np.isclose(peak["zoh"], 162, atol=0.5)
assert np.isclose(peak["passive"], 0.44, atol=5e-3)
assert np.isclose(far, 13.4, atol=0.05)
assert np.isclose(near, 8.7, atol=0.05)

# %% [markdown]
# ## 5. One sample too late
#
# The coupling has a damper between handle and linkage, in rotation $B = 0.375$ N.m.s/rad (the
# report's). Both have the mobility $\lambda$, so that in a period T it changes their relative
# angular velocity w by a held torque: $w_{k+1} = w_k - 2 \lambda B T\, w_k$.
#
# **Exercise 5.** Up to which B is this stable? Take the largest $\lambda$ of the run. What if the
# torque comes one sample late, $w_{k+1} = w_k - 2 \lambda B T\, w_{k-1}$? Where on the unit circle
# are its poles then, and which frequency is that at 512 Hz?

# %% blank
mobility = felt["virtual_environment.Lambda_inv"][:, 2, 2].max()  # 1/(kg.m2)
B_now = ...  # N.m.s/rad
B_late = ...  # N.m.s/rad

if B_now is not ... and B_late is not ...:
    for name, B, late in [("now", B_now, False), ("late", B_late, True)]:
        gain = 2 * mobility * B / 512
        z = np.roots([1, -1, gain] if late else [1, -1 + gain])
        assert np.isclose(np.abs(z).max(), 1), f"{name}: |z| = {np.abs(z).max():.3f}, not 1"
    print(f"now below {B_now:.3f}, late below {B_late:.3f} N.m.s/rad; the report has 0.375")

# %% [markdown] answer
# In time $z = 1 - 2\lambda B T > -1$: $B < 1/(\lambda T) = 0.57$. Late, $z^2 - z + 2\lambda B T =
# 0$ has complex roots with $|z|^2 = 2\lambda B T < 1$: $B < 1/(2\lambda T) = 0.29$. The report's
# 0.375 lies between the two. On the circle $z^2 - z + 1 = 0$, an angle of 60 degrees: a sixth of
# 512 Hz, 85 Hz.

# %% answer
mobility = felt["virtual_environment.Lambda_inv"][:, 2, 2].max()  # 1/(kg.m2)
B_now, B_late = 512 / mobility, 512 / mobility / 2
assert np.isclose(B_now, 0.57, atol=5e-3)
assert np.isclose(B_late, 0.29, atol=5e-3)
assert np.isclose(np.abs(np.roots([1, -1, 2 * mobility * B_late / 512])).max(), 1)
assert B_late < 0.375 < B_now
assert np.isclose(np.angle(np.roots([1, -1, 1])[0]) / (2 * np.pi) * 512, 85.3, atol=0.05)  # Hz

# %% [markdown]
# Masters that first read all outputs, then set all inputs and then step ("Jacobi") make a
# controller's force one sample late. hapticlink orders the calls so that it is not (`coupling =
# "gauss-seidel"`), and can do the other.
#
# **Predict.** What does the torque of the coupling look like by each order?

# %%
torques = {}
for order, colour in [("jacobi", ORANGE), ("gauss-seidel", BLUE)]:
    run = hl.run("closed-loop-ideal", {"coupling": order})
    torques[order] = run["controller.F_drift"][:, 2]  # N.m, at 512 Hz
    plt.plot(run.time("controller.F_drift"), torques[order], color=colour, lw=0.8, label=order)
plt.xlabel("time (s)")
plt.ylabel("torque of the coupling (N.m)")
plt.title("One sample late, the report's damping makes the handle buzz")
plt.legend()
plt.show()

# %% answer
jumps = {order: np.abs(np.diff(torque)).max() for order, torque in torques.items()}
print({order: f"{jump:.2g} N.m in one period" for order, jump in jumps.items()})
assert np.isclose(jumps["jacobi"], 2.4, atol=0.05)
assert np.isclose(jumps["gauss-seidel"], 0.03, atol=5e-3)
buzz = torques["jacobi"][round(0.65 * 512) : round(1.25 * 512)]  # where it is largest
spectrum = np.abs(np.fft.rfft(buzz - buzz.mean()))
assert np.isclose(np.fft.rfftfreq(len(buzz), 1 / 512)[spectrum.argmax()], 85.3, atol=1.7)  # Hz

# %% [markdown]
# **To take home.** Mobility alone lets the handle drift; constraints keep it. What crosses from a
# slower rate is a frame or two old. What it costs shows only once larger errors are gone, and once
# a force crosses the rates, its hold has an energy account. More: `docs/choose-hold.md`,
# `docs/is-it-passive.md`, and `results/report/README.md`.
