# %% [markdown]
# # The virtual wall
#
# *45 minutes. Section 1.3.2 of the report.* A virtual wall is a spring that a computer reads and
# holds. A spring gives back what it gets; a computed one gives back more. Here you measure how
# much more, and find out how stiff a wall may be.
#
# You need Newton's law, energy, and the poles of a discrete system. Each figure comes after a
# question that begins with **Predict**: sketch your answer on paper before you read the next cell
# and run it. The blanks `...` are for you. Run all cells from the top once; the checks of a blank
# are silent until you fill it.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hapticlink as hl

BLUE, ORANGE, GREY = "tab:blue", "tab:orange", "0.5"
m, T = 0.3, 1 / 512  # mass of the handle (kg), period of the wall's samples (s)

# %% [markdown]
# ## 1. One impact
#
# A handle of 0.3 kg without friction is thrown at 0.1 m/s at a wall of K = 3000 N/m, which fills x
# > 0. Every T the wall reads the position $x_k$, and its force $-K x_k$ is held until the next
# sample. Outside there is no force.

# %%
K = 3000.0  # N/m
impact = hl.run("virtual-wall", {
    "hand.wrench": [0, 0, 0], "linkage.joint.0.damping": 0, "duration": 0.1,
    "linkage.start": {"rail": -0.001}, "linkage.start_velocity": {"rail": 0.1},
    "fmu.wall.start.stiffness": K,
})  # fmt: skip
x = impact["virtual_mechanism.x"][:, 0]  # m, at t = 0, T, 2T, ...
v = impact["virtual_mechanism.v"][:, 0]  # m/s
F = np.ravel(impact["wall.F"])  # N, from this sample to the next

# %% [markdown]
# **Predict.** Draw the push of the wall, $-F$, over the position x: first the straight line of an
# ideal spring, then the steps of the held force, on the way in and on the way out. On which side
# of the line is each? Which area is energy, and who gets it?

# %%
steps = 1e3 * np.repeat(x, 2)[1:], -np.repeat(F, 2)[:-1]  # to x of the next sample, then its force
turn = 2 * np.argmax(x)
gain = 0.5 * m * (v[-1] ** 2 - v[0] ** 2)  # J
plt.fill(*steps, color=GREY, alpha=0.2)
plt.plot(steps[0][: turn + 1], steps[1][: turn + 1], color=BLUE, label="in")
plt.plot(steps[0][turn:], steps[1][turn:], color=ORANGE, label="out")
plt.plot([0, 1e3 * x.max()], [0, K * x.max()], "--", color=GREY, label="ideal spring")
plt.xlim(-0.3, 1.2)
plt.xlabel("position of the handle (mm)")
plt.ylabel("push of the wall (N)")
plt.title(f"In below the line, out above it: the handle gains {1e3 * gain:.2f} mJ")
plt.legend()
plt.show()

# %% [markdown]
# **Exercise 1.** A force that is held while the handle moves from $x_k$ to $x_{k+1}$ does the work
# $-K x_k (x_{k+1} - x_k)$. Write it as a difference of $\tfrac12 K x^2$ plus something that is
# never negative. Then sum up over the impact: the differences cancel, the rest is what the hold
# has generated.

# %% blank
p = np.maximum(x, 0)  # penetration at the samples (m)
generated = ...  # J, of K and p

if generated is not ...:
    print(f"{1e3 * generated:.3f} mJ by your formula, {1e3 * gain:.3f} mJ in the run")
    assert abs(generated / gain - 1) < 0.1, "it should be within 10 %: look at the signs again"

# %% [markdown] answer
# With $\Delta_k = x_{k+1} - x_k$,
#
# $$-K x_k \Delta_k = -\tfrac12 K (x_{k+1}^2 - x_k^2) + \tfrac12 K \Delta_k^2$$
#
# The first term is that of a spring. The second is never negative: whatever the motion, the hold
# generates $\tfrac12 K \sum \Delta_k^2$.

# %% answer
p = np.maximum(x, 0)  # penetration at the samples (m)
generated = 0.5 * K * np.sum(np.diff(p) ** 2)
print(f"{1e3 * generated:.3f} mJ by the formula, {1e3 * gain:.3f} mJ in the run")
assert np.isclose(1e3 * generated, 0.512, atol=5e-4)
assert np.isclose(1e3 * gain, 0.543, atol=5e-4)

# %% [markdown]
# **Question.** Your formula gives 6 % less than the run. Look at the orange line at the left end
# of the figure: what does the formula leave out?

# %% [markdown] answer
# The last sample inside the wall is held until the next sample, which is outside. There the force
# still pushes, where a wall has none. With this work, the push times the way outside, the account
# is exact.

# %% answer
last = np.flatnonzero(p)[-1]
outside = K * p[last] * -x[last + 1]  # J
assert np.isclose(generated + outside, gain, rtol=1e-9)

# %% [markdown]
# ## 2. How much friction makes up for it?
#
# At a steady speed v the handle moves by $vT$ in a period, so that the hold generates $\tfrac12 K
# (vT)^2$ every T: a power of $(K T/2) v^2$. A damper b takes $b v^2$. A held spring is therefore a
# spring with a damper of $-KT/2$.
#
# The device now has its friction, b = 5 N.s/m, and the wall is a spring on both sides of x = 0, so
# that the handle stays in contact and oscillates. How fast does the oscillation grow, $e^{\sigma
# t}$? Held and sampled, the handle is a linear system: $x_{k+2} = a_1 x_{k+1} + a_0 x_k$, with two
# poles z, and $\sigma = \ln|z|/T$.


# %%
def oscillate(K, b=5.0, B=0.0, **options):
    """The positions (m) of the handle, released 1 mm from the middle of a spring K (N/m) that is
    sampled, with a sampled damper B (N.s/m), on a device with damping b (N.s/m)."""
    run = hl.run("virtual-wall", {
        "hand.wrench": [0, 0, 0], "linkage.joint.0.damping": b, "duration": 0.5,
        "linkage.start": {"rail": 0.001},
        "fmu.wall.settings": {"stiffness": 0, "damping": 0, "unilateral": False},
        "fmu.wall.start": {"stiffness": K, "damping": B},
    } | options)  # fmt: skip
    return run["virtual_mechanism.x"][:, 0]


def growth(x, order=2):
    """sigma (1/s) of the slowest pole of the recurrence that the samples x follow; a delay or a
    sampled damper remembers one more sample, which makes its order 3."""
    past = np.column_stack([x[order - 1 - i : len(x) - 1 - i] for i in range(order)])
    a = np.linalg.lstsq(past, x[order:], rcond=None)[0]
    return np.log(np.abs(np.roots([1, *-a])).max()) / T


# %% [markdown]
# **Predict.** Plot $\sigma$ over K, from 500 to 9500 N/m. Where does the curve start for small K,
# and at which K does it cross zero? (For weak damping, $\sigma = -\text{damping}/(2m)$.)

# %%
stiffness = np.linspace(500, 9500, 7)
measured = [growth(oscillate(K)) for K in stiffness]
plt.plot(stiffness, -(5 - stiffness * T / 2) / (2 * m), color=GREY, label="-(b - K T/2) / 2m")
plt.plot(stiffness, measured, "o", color=BLUE, label="runs")
plt.axhline(0, color="k", lw=0.8)
plt.xlabel("stiffness K (N/m)")
plt.ylabel("growth rate (1/s)")
plt.title("The held spring is a spring with a damper of -K T/2")
plt.legend()
plt.show()

# %% [markdown]
# Colgate and Schenkel (1997) proved what the energy suggests: the handle with its wall is
# *passive*, so that no hand gets more energy out of it than it has put in, if and only if
#
# $$b > \frac{K T}{2} + |B|$$
#
# with B the damping of the wall itself, which is zero so far.
#
# **Exercise 2.** How stiff may the wall be with b = 5 N.s/m at 512 Hz?

# %% blank
K_passive = ...  # N/m

if K_passive is not ...:
    sigma = growth(oscillate(K_passive))
    print(f"growth rate {sigma:.3f} 1/s")
    assert abs(sigma) < 0.1, "the oscillation should neither grow nor decay noticeably"

# %% answer
K_passive = 2 * 5.0 / T
assert K_passive == 5120.0  # N/m
assert abs(growth(oscillate(K_passive))) < 0.1  # 1/s; the runs turn unstable at 5148 N/m
assert growth(oscillate(5130.0)) < 0 < growth(oscillate(5170.0))

# %% [markdown]
# **Exercise 3.** The force arrives one period late, as from a loop that computes for a whole
# period (the option `delays.wall.F`). A held force is T/2 old on average. How old is it now, and
# how stiff may the wall be? Predict it with the same argument before you run it.

# %% blank
K_late = ...  # N/m

if K_late is not ...:
    sigma = growth(oscillate(K_late, **{"delays.wall.F": T}), order=3)
    print(f"growth rate {sigma:.3f} 1/s")
    assert abs(sigma) < 0.1, "the oscillation should neither grow nor decay noticeably"

# %% [markdown] answer
# The force is T/2 + T old: a damper of $-K(T/2 + T)$, and $K < b/(3T/2)$: a third.

# %% answer
K_late = 5.0 / (3 * T / 2)
assert np.isclose(K_late, 1706.7, atol=0.05)  # N/m
assert abs(growth(oscillate(K_late, **{"delays.wall.F": T}), order=3)) < 0.1
assert np.isclose(K_late, K_passive / 3)

# %% [markdown]
# ## 3. K against B
#
# The wall gets a damper of its own: $F_k = -K x_k - B (x_k - x_{k-1})/T$. The state of handle and
# wall is $(x_k, v_k, x_{k-1})$, and over a period it is multiplied by a matrix A, exactly.


# %%
def radius(K, B, b=5.0):
    """The largest |z| of the handle in contact: it is stable below 1."""
    e = np.exp(-b * T / m)
    x_of_F = (T - m / b * (1 - e)) / b  # m/N: the way of a force that is held for T
    v_of_F = (1 - e) / b
    A = np.array([[1, m / b * (1 - e), 0], [0, e, 0], [1, 0, 0]])
    A += np.outer([x_of_F, v_of_F, 0], [-K - B / T, 0, B / T])
    return np.abs(np.linalg.eigvals(A)).max()


# %% [markdown]
# **Predict.** In the plane of B (to the right, to 320 N.s/m) and K (upwards, to 80,000 N/m),
# sketch the region where the handle is stable. Does a larger B always allow a larger K? Then
# sketch the region where the wall is passive, $K < 2(b - |B|)/T$.

# %%
Bs, Ks = np.linspace(0, 320, 65), np.linspace(0, 80e3, 65)
radii = np.array([[radius(K, B) for B in Bs] for K in Ks])
plt.contourf(Bs, Ks / 1e3, radii, [0, 1], colors=[BLUE], alpha=0.3)
plt.fill([0, 5, 0], [0, 0, 2 * 5 / T / 1e3], color=ORANGE, label="passive (in the corner)")
for B, K in [(20, 10e3), (20, 40e3), (120, 40e3), (120, 70e3), (230, 20e3), (280, 60e3)]:
    x = np.abs(oscillate(float(K), B=float(B)))
    decays = x[-20:].max() < x[:20].max()
    plt.plot(B, K / 1e3, "o", color="k", fillstyle="full" if decays else "none")
plt.plot([], [], "ko", label="run decays")
plt.plot([], [], "ko", fillstyle="none", label="run grows")
plt.xlabel("damping of the wall B (N.s/m)")
plt.ylabel("stiffness of the wall K (kN/m)")
plt.title("B helps up to a point; stable (blue) is far more than passive")
plt.legend(loc="upper right")
plt.show()

# %% [markdown]
# **Exercise 4.** Which B allows the stiffest wall, and how stiff is it? For b = 0, Jury's
# criterion gives the boundary $\alpha = 2 \beta (2 - \beta)/(2 + \beta)$, with $\alpha = K T^2/m$
# and $\beta = B T/m$. Find its maximum, and compare it with the figure.

# %% blank
B_best = ...  # N.s/m
K_best = ...  # N/m

if B_best is not ... and K_best is not ...:
    assert radius(0.99 * K_best, B_best, b=0.01) < 1, "not stable below"
    assert radius(1.01 * K_best, B_best, b=0.01) > 1, "still stable above"
    assert radius(0.999 * K_best, 0.95 * B_best, b=0.01) > 1, "a smaller B should allow less"
    assert radius(0.999 * K_best, 1.05 * B_best, b=0.01) > 1, "a larger B should allow less"
    print("right")

# %% [markdown] answer
# $d\alpha/d\beta = 0$ at $\beta^2 + 4\beta - 4 = 0$, so $\beta = 2\sqrt2 - 2 = 0.83$: B = 127
# N.s/m and K = 54,000 N/m. The friction of the device, left out here, shifts the boundary in the
# figure up a little.

# %% answer
beta = 2 * np.sqrt(2) - 2
B_best = beta * m / T
K_best = 2 * beta * (2 - beta) / (2 + beta) * m / T**2
print(f"B = {B_best:.0f} N.s/m, K = {K_best:.0f} N/m")
assert np.isclose(B_best, 127, atol=0.5)
assert np.isclose(K_best, 54e3, atol=500)
assert radius(0.99 * K_best, B_best, b=0.01) < 1 < radius(1.01 * K_best, B_best, b=0.01)
assert radius(0.999 * K_best, 0.95 * B_best, b=0.01) > 1
assert radius(0.999 * K_best, 1.05 * B_best, b=0.01) > 1

# %% [markdown]
# **Exercise 5.** K = 5000 N/m with B = 20 N.s/m is stable by a wide margin, and not passive. The
# report says of such a wall that it rumbles, "usually under high frequency excitation". The
# fastest oscillation that samples can show is $x_k = a, -a, a, \dots$ Write $F_k$ of the wall for
# it. What damping b takes the energy out? Compare with Colgate's condition.

# %% blank
b_needed = ...  # N.s/m

# %% [markdown]
# Somebody clamps the handle: a spring of 500,000 N/m, passive, on a device with b = 5 N.s/m, then
# on one with your b. **Predict**: what does each do?

# %% blank
clamp = {"linkage.joint.0.stiffness": 5e5, "mechanism.substeps": 16}
if b_needed is not ...:
    for b in (5.0, float(b_needed)):
        sigma = growth(oscillate(5000.0, b=b, B=20.0, **clamp), order=3)
        print(f"b = {b:.1f} N.s/m: growth rate {sigma:.1f} 1/s")

# %% [markdown] answer
# $F_k = -(K + 2B/T) x_k$: at half the sampling rate the damper is a spring of 2B/T, which is held
# like any other and needs $b > (K + 2B/T)\,T/2 = KT/2 + B$: Colgate's condition. The clamped
# handle vibrates near half the sampling rate and shakes itself up with b = 5 N.s/m, although each
# of its parts is passive but the wall.

# %% answer
b_needed = 5000 * T / 2 + 20
clamp = {"linkage.joint.0.stiffness": 5e5, "mechanism.substeps": 16}
loose, hard, enough = (
    growth(oscillate(5000.0, b=b, B=20.0, **options), order=3)
    for b, options in ((5.0, {}), (5.0, clamp), (b_needed, clamp))
)
print(f"b = {b_needed:.1f} N.s/m; growth rates {loose:.1f}, {hard:.1f}, {enough:.1f} 1/s")
assert np.isclose(b_needed, 24.88, atol=5e-3)
assert loose < 0
assert enough < 0 < hard

# %% [markdown]
# **To take home.** A held spring generates $\tfrac12 K \Delta^2$ a period, like a damper of
# $-KT/2$. Friction of the device pays for it; sampled damping of the wall helps a handle that is
# let go, and costs friction at high frequencies. More: `docs/walls.md`, and `hapticlink stability
# virtual-wall`.
