# %% [markdown]
# # First steps in Python
#
# A script of cells (`# %%`), which Jupyter, VS Code and Spyder run one by one, and Python whole:
# `python docs/first_steps.py`. [api.md](api.md) lists every name.

# %%
import hapticlink as hl

print(hl.__version__)
hl.shipped()

# %% [markdown]
# A scene runs by its name or path. Options are its keys; here the graphics rate (Hz) and the
# duration (s). `print` gives the lines of the command; as the value of a cell a run shows itself.

# %%
r = hl.run("closed-loop-direct", {"graphics.rate": 30, "duration": 1.0})
if r.fault:
    raise SystemExit(r.fault)
print(r)
r

# %% [markdown]
# Signals are NumPy arrays by name. Rates differ, so that each signal has its own times.

# %%
handle = r["haptic_device.x_true"]  # (k, 3): m, m, rad, at the haptic rate
P_c = r["virtual_mechanism.P_c"]  # (n, 3, 3), at the graphics rate
print(handle.shape, r.time("haptic_device.x_true").shape)
print(P_c.shape, r.time("virtual_mechanism.P_c").shape)

# %% [markdown]
# How far the handle is from the operational point, and figures of the run.

# %%
time, distance, angle = r.tracking()
print(f"at 30 Hz at most {distance.max():.3g} mm apart, at {time[distance.argmax()]:.3g} s")
r.figures()["distance"]

# %% [markdown]
# A scene can be read once and run with further options. It stays as it is.

# %%
scene = hl.scene("closed-loop-direct", {"duration": 1.0})
slow = hl.run(scene, {"graphics.rate": 10})
print(f"at 10 Hz at most {slow.tracking().distance_mm.max():.3g} mm apart")

# %% [markdown]
# Four holds, compared and drawn.

# %%
runs = {hold: hl.run(scene, {"hold": hold}) for hold in ("zoh", "lead", "foh", "passive")}
hl.compare(runs)

# %% [markdown]
# A replay, with a time slider.

# %%
hl.view(runs["zoh"], runs["passive"])

# %% [markdown]
# Invalid keys and values are refused before anything runs, all of them at once.

# %%
try:
    hl.run(scene, {"graphics.rte": 10, "hold": "zho"})
except hl.InputFault as fault:
    print(fault)

# %% [markdown]
# Many variants at once, in parallel: one row a run.

# %%
s = hl.sweep(scene, {"graphics.rate": [20, 40], "hold": ["zoh", "foh"]}, {"duration": 0.25})
for rate, hold, largest in zip(s["graphics.rate"], s["hold"], s["tracking_max_mm"], strict=True):
    print(f"{hold} at {rate:g} Hz: at most {largest:.3g} mm apart")
s.figure()

# %% [markdown]
# With `out`, results stay in a folder, as those of the command `hapticlink run` do, and are read
# back from there. FMUs, for any FMI 2.0 tool, are built into one.

# %%
hl.run(scene, {"duration": 0.25}, out="runs/first-steps")
again = hl.load("runs/first-steps")
print(again)
fmus = hl.build("five-bar", out="fmus/five-bar")
print(*fmus.values(), sep="\n")
