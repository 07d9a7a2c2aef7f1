"""Two runs under one mouse, on any page that has them."""

from __future__ import annotations

from tests.visualization.browser_code.chromium import Page


def differ_without_topology(page: Page) -> None:
    """Without its topology controller B follows the mouse further, and has energies of its own. The
    mouse stays down."""
    page.page.click("#acts")
    page.page.uncheck("[data-control=topology]")
    page.until("location.hash === '#b.controller.topology=false'")
    page.pull(0.03, 0.03)
    page.run_for(1.0)
    error = "Math.hypot(f.x[0] - f.handle[0], f.x[1] - f.handle[1])"
    a, b = page.get(f"[view.frame, view.frame.b].map((f) => {error})")
    assert b > 3 * a
    energies = page.get("[view.frame.energy, view.frame.b.energy].map((e) => Object.values(e))")
    assert len(energies[0]) > 3
    assert energies[0] != energies[1]
    said = page.page.locator(
        "[data-chart='energy generated since the start'] figcaption b"
    ).first.inner_text()
    assert " | " in said
