"""What a scene needs of its parts, and why the others are left out."""

from hapticlink.analysis.findings import requirements
from hapticlink.orchestrator import open_scene


def test_what_is_left_out_is_told_with_its_reason() -> None:
    told = {n.part: (n.needed, n.why) for n in requirements.needs(open_scene.load("obstacles"))}
    assert told["loop closures"] == (False, "no loop: no multiplier, no projection")
    assert told["link2 on post"] == (False, "out of reach: no narrow phase")
    assert told["contacts"] == (True, "2 pairs, 7 places, detected by graphics")
    assert told["virtual_environment"] == (True, "for Lambda_inv, P_c, contact geometry")
    fewer = requirements.needs(open_scene.load("obstacles", ["contacts.polygon=[]"]))
    (contacts,) = (n.why for n in fewer if n.part == "contacts")
    assert contacts.startswith("1 pair, ")
    alone = {n.part: n.needed for n in requirements.needs(open_scene.load("five-bar"))}
    assert not alone["virtual_environment"]
    assert alone["loop closures"]
    one_spring = open_scene.load("five-bar", ["linkage.joint.elbow1.stiffness=1"])
    assert {n.part: n.needed for n in requirements.needs(one_spring)}["springs and dampers"]
    assert not alone["springs and dampers"]
