# %% [markdown]
# # Discrete equivalents
#
# *45 minutes. Section 1.3.1 of the report.* A computer has no derivatives, only samples. There are
# several ways to turn a differential equation into a recurrence of samples, and some turn a stable
# system into an unstable one. Here you find out which, and from which sample rate on.
#
# You need complex numbers and the poles of a linear system. Each figure comes after a question
# that begins with **Predict**: sketch your answer on paper before you read the next cell and run
# it. The blanks `...` are for you. Run all cells from the top once; the checks of a blank are
# silent until you fill it.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import cont2discrete

import hapticlink as hl

BLUE, ORANGE, GREY = "tab:blue", "tab:orange", "0.5"

# %% [markdown]
# ## 1. Three rules
#
# The report has three rules for $\dot x(t)$ and samples $x(k)$ with the period T:
#
# | rule | as printed | |
# |---|---|---|
# | forward | $\dot x(k) = (x(k+1) - x(k))/T$ | (1.1) |
# | backward | $\dot x(k+1) = (x(k+1) - x(k))/T$ | (1.2) |
# | trapezoidal | $(\dot x(k+1) - \dot x(k))/2 = (x(k+1) - x(k))/T$ | (1.3) |
#
# **Question.** One of them is misprinted. Which? Try them on $x(t) = t$, a straight line, which
# every sensible rule gets right.

# %% [markdown] answer
# For x = t all derivatives are 1 and all differences T: (1.1) and (1.2) say 1 = 1, (1.3) says 0 =
# 1. It has to be a plus, $(\dot x(k+1) + \dot x(k))/2$: the mean of both ends.

# %% [markdown]
# **Exercise 1.** A pole s is the system $\dot x = s x$. Put it into each rule (with (1.3) mended)
# and solve for $z = x(k+1)/x(k)$: the discrete pole. The forward rule is done.


# %% blank
def forward(s, T):
    return 1 + s * T


def backward(s, T):
    return ...


def trapezoidal(s, T):
    return ...


# %% [markdown] answer
# $x(k+1) - x(k) = T s x(k+1)$ gives the backward rule, $x(k+1) - x(k) = \tfrac12 T s (x(k+1) +
# x(k))$ the trapezoidal one.


# %% answer
def forward(s, T):
    return 1 + s * T


def backward(s, T):
    return 1 / (1 - s * T)


def trapezoidal(s, T):
    return (1 + s * T / 2) / (1 - s * T / 2)


# %% [markdown]
# hapticlink has a block for each rule, `discrete_equivalent`. The next cell lets it run for half a
# second from x = 1, at 512 Hz. The pole is that of a handle on a spring, $m \ddot x + b \dot x + K
# x = 0$ with m = 0.3 kg, b = 5 N.s/m, K = 3000 N/m: about 16 Hz, lightly damped.

# %%
m, b, K = 0.3, 5.0, 3000.0
s = -b / (2 * m) + 1j * np.sqrt(K / m - (b / (2 * m)) ** 2)  # 1/s


def run_rule(rule, rate=512, duration=0.5):
    """Times (s) and the complex state of xdot = s x from x(0) = 1, by a rule at a rate (Hz)."""
    scene = f"""
        title = "A pole under the {rule} rule"
        duration = {duration}
        haptics.rate = {rate}
        [[fmu]]
        name = "pole"
        block = "discrete_equivalent"
        settings = {{ rule = "{rule}" }}
        start = {{ re = {s.real}, im = {s.imag} }}
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pole.toml"
        path.write_text(scene)
        run = hl.run(path)
    return run.time("pole.x"), run["pole.x"] @ [1, 1j]


runs = {rule: run_rule(rule) for rule in ("forward", "backward", "trapezoidal")}

# %%
for rule, function in [("backward", backward), ("trapezoidal", trapezoidal)]:
    if function(s, 1 / 512) is not ...:
        found = runs[rule][1][1]  # x(1), where x(0) = 1
        assert np.isclose(function(s, 1 / 512), found), f"{rule}: the block says z = {found:.4f}"
        print(f"{rule}: right")

# %% [markdown]
# **Predict.** The exact solution decays in about 0.3 s. Sketch it, and over it the samples of the
# three rules. One of them grows. Which? Which is hardest to tell from the exact solution?

# %%
for rule, colour in [("forward", ORANGE), ("trapezoidal", BLUE), ("backward", GREY)]:
    time, x = runs[rule]
    plt.plot(time, x.real, color=colour, label=rule)
plt.plot(time, np.exp(s * time).real, "k:", label="exact")
plt.xlabel("time (s)")
plt.ylabel("x, from 1 (no unit)")
plt.title("At 512 Hz the forward rule makes a damped oscillation grow")
plt.legend()
plt.show()

# %% [markdown]
# ## 2. Where the poles go
#
# A discrete system is stable if $|z| < 1$: inside of the unit circle.
#
# **Predict.** As T grows from 0, all z start at 1. Sketch the paths of the three z, to T = 20 ms,
# and that of the exact one, $e^{sT}$. Which leaves the unit circle?

# %%
periods = np.linspace(0, 0.02, 400)
gamma = {"forward": 0.0, "trapezoidal": 0.5, "backward": 1.0}
for rule, colour in [("forward", ORANGE), ("trapezoidal", BLUE), ("backward", GREY)]:
    # All three are one rule, with the weight gamma on the end of the period.
    z = (1 + (1 - gamma[rule]) * s * periods) / (1 - gamma[rule] * s * periods)
    plt.plot(z.real, z.imag, color=colour, label=rule)
exact = np.exp(s * periods)
plt.plot(exact.real, exact.imag, "k:", label="exact")
circle = np.exp(1j * np.linspace(0, 2 * np.pi, 200))
plt.plot(circle.real, circle.imag, "--", color=GREY, lw=0.8)
plt.gca().set(xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), aspect="equal")
plt.xlabel("Re z")
plt.ylabel("Im z")
plt.title("T from 0 to 20 ms: only the forward rule leaves the circle")
plt.legend(loc="lower left")
plt.show()

# %% [markdown]
# **Exercise 2.** From which T on is the forward rule unstable? Solve $|1 + sT| = 1$. The answer
# has only b and K in it. And where do the other two end, for very large T?

# %% blank
T_forward = ...  # s, of b and K

if T_forward is not ...:
    assert np.isclose(abs(1 + s * T_forward), 1), "not on the unit circle"
    print(f"stable above {1 / T_forward:.0f} Hz")

# %% [markdown] answer
# $|1 + sT|^2 = 1 + 2\,\mathrm{Re}(s)\,T + |s|^2 T^2 = 1$ gives $T = -2\,\mathrm{Re}(s)/|s|^2 =
# (b/m)/(K/m) = b/K$: 1.67 ms. The rule needs 600 Hz. The mass does not matter. For large T the
# backward z goes to 0, the trapezoidal one to -1.

# %% answer
T_forward = b / K
assert np.isclose(abs(1 + s * T_forward), 1)
assert np.isclose(1 / T_forward, 600)  # Hz
assert np.allclose([backward(s, 1e6), trapezoidal(s, 1e6)], [0, -1], atol=1e-6)
assert np.abs(run_rule("forward", 580)[1][-1]) > 1 > np.abs(run_rule("forward", 620)[1][-1])

# %% [markdown]
# **Exercise 3.** The trapezoidal rule is stable at any rate. It pays with the frequency: without
# damping, which angle does z have for $s = i\omega$? At 60 Hz, a graphics rate, how fast does a
# handle with $\omega = 100$ rad/s oscillate?

# %% blank
omega_60 = ...  # rad/s

if omega_60 is not ...:
    z = trapezoidal(100j, 1 / 60)
    assert z is not ..., "exercise 1 comes first"
    assert np.isclose(omega_60, np.angle(z) * 60), f"z says {np.angle(z) * 60:.1f} rad/s"
    print("right")

# %% [markdown] answer
# Numerator and denominator are conjugate, so that $|z| = 1$ and the angle is $2 \arctan(\omega
# T/2)$: $(2/T) \arctan(\omega T/2) = 83.4$ rad/s, 17 % too slow.

# %% answer
omega_60 = 2 * 60 * np.arctan(100 / 60 / 2)
assert np.isclose(omega_60, np.angle(trapezoidal(100j, 1 / 60)) * 60)
assert np.isclose(omega_60, 83.4, atol=0.05)
assert np.isclose(1 - omega_60 / 100, 0.17, atol=5e-3)

# %% [markdown]
# **Exercise 4.** In the report a spring and damper of $K_g = B_g = 10000$ (N.m/rad, N.m.s/rad)
# turn the graphics copy of a linkage with an inertia of about 0.002 kg.m2. Find both poles. Which
# sample rate does the forward rule need? Which rule would you take at 30 Hz, and what does it do
# to the fast pole?

# %% blank
rate_needed = ...  # Hz

if rate_needed is not ...:
    fast = np.roots([1, 1e4 / 0.002, 1e4 / 0.002]).min()  # 1/s
    assert abs(1 + fast / (1.01 * rate_needed)) < 1, "not stable at a slightly faster rate"
    assert abs(1 + fast / (0.99 * rate_needed)) > 1, "still stable at a slightly slower rate"
    print("right")

# %% [markdown] answer
# $s^2 + (B_g/I) s + K_g/I = 0$ has the poles $-1.0$ and $-5 \cdot 10^6$ 1/s. A real pole is stable
# by the forward rule for $T < 2/|s|$: 2.5 MHz. The backward rule maps the fast one to $z = 1/(1 +
# 5 \cdot 10^6/30) = 6 \cdot 10^{-6}$: gone in one frame, as it should be. The trapezoidal rule
# makes it almost -1: an error that alternates for many frames.

# %% answer
slow, fast = sorted(np.roots([1, 1e4 / 0.002, 1e4 / 0.002]).real, reverse=True)
rate_needed = -fast / 2
assert np.isclose(rate_needed, 2.5e6, rtol=1e-5)  # Hz
assert np.isclose(slow, -1, rtol=1e-5)
assert np.isclose(backward(fast, 1 / 30), 6e-6, rtol=0.01)
assert -1 < trapezoidal(fast, 1 / 30) < -0.9999

# %% [markdown]
# ## 3. The equivalent of a held force
#
# Which rule is a virtual wall? None of the three. The handle is a real, continuous mass; only the
# force $-K x_k$ is sampled, and held by a *zero-order hold*. The exact recurrence for an input
# that is held is the zero-order-hold equivalent, by `scipy.signal.cont2discrete`.


# %%
def held_wall(rate):
    """The growth rate (1/s) of the handle on a spring that is sampled and held at a rate (Hz)."""
    A, B = np.array([[0, 1], [0, -b / m]]), np.array([[0], [1 / m]])
    Ad, Bd, *_ = cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), 1 / rate, method="zoh")
    z = np.linalg.eigvals(Ad - Bd @ [[K, 0]])  # F = -K x
    return np.log(np.abs(z).max()) * rate


def run_wall(rate):
    """The same, measured in a run of hapticlink: two samples say what the third will be."""
    run = hl.run("virtual-wall", {
        "haptics.rate": rate, "linkage.start": {"rail": 0.001}, "hand.wrench": [0, 0, 0],
        "fmu.wall.settings": {"stiffness": K, "unilateral": False}, "duration": 0.5,
    })  # fmt: skip
    x = run["virtual_mechanism.x"][:, 0]
    a = np.linalg.lstsq(np.column_stack([x[1:-1], x[:-2]]), x[2:], rcond=None)[0]
    return np.log(np.abs(np.roots([1, *-a])).max()) * rate


# %% [markdown]
# **Predict.** The growth rate is $\ln|z|/T$; the exact one is $-b/2m = -8.3$ 1/s at any sample
# rate. Sketch it over the rate, from 150 to 2000 Hz, for the forward rule, the backward rule, the
# trapezoidal rule, and the held force. Which come to zero, and at which rate?

# %%
rates = np.geomspace(150, 2000, 60)
measured_at = np.array([200, 300, 512, 1024, 2000])
for rule, colour in [("forward", ORANGE), ("trapezoidal", "k"), ("backward", GREY)]:
    z = (1 + (1 - gamma[rule]) * s / rates) / (1 - gamma[rule] * s / rates)
    plt.semilogx(rates, np.log(np.abs(z)) * rates, color=colour, label=rule)
plt.semilogx(rates, [held_wall(rate) for rate in rates], color=BLUE, label="held force")
measured = [run_wall(rate) for rate in measured_at]
plt.semilogx(measured_at, measured, "o", color=BLUE, label="held force, runs")
plt.axhline(0, color="k", lw=0.8)
plt.xticks([150, 300, 600, 1000, 2000], ["150", "300", "600", "1000", "2000"])
plt.minorticks_off()
plt.xlabel("sample rate (Hz)")
plt.ylabel("growth rate (1/s)")
plt.title("A held force halves the error of the forward rule, and has its sign")
plt.legend()
plt.show()

# %% [markdown]
# **Exercise 5.** A held force is T/2 old on average, which acts like a damper of $-KT/2$. From
# which T on is the held wall unstable by this argument? Check it with the exact equivalent.

# %% blank
T_held = ...  # s, of b and K

if T_held is not ...:
    sigma = held_wall(1 / T_held)
    print(f"{1 / T_held:.0f} Hz; growth rate there {sigma:.2f} 1/s")
    assert abs(sigma) < 0.1, "the oscillation should neither grow nor decay noticeably"

# %% [markdown] answer
# $b = KT/2$ gives $T = 2b/K$: twice that of the forward rule, 300 Hz in place of 600. The exact
# equivalent loses its damping within 1 % of that rate. Backward and trapezoidal rule would never
# lose it, but nobody can hold a force that depends on the next position: the real handle has not
# been there yet.

# %% answer
T_held = 2 * b / K
assert np.isclose(1 / T_held, 300)  # Hz
assert abs(held_wall(300)) < 0.1
assert held_wall(303) < 0 < held_wall(297)
assert np.allclose(measured, [held_wall(rate) for rate in measured_at], atol=1e-3)

# %% [markdown]
# **To take home.** The forward rule needs T < b/K, a held spring T < 2b/K, and neither asks for
# the mass. Implicit rules are stable, for what is simulated; for a real device there is no next
# sample. More: `docs/theory.md`, and the worksheet on the virtual wall.
