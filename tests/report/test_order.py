"""The order of signals in a report."""

import mbsvib as mv
from mbsvib.report.data import inputs_in_order, outputs_in_order


def test_the_floor_and_the_payload_come_first():
    model = mv.Model("stack")
    for i, name in enumerate(("base", "table", "payload")):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), (0, 0, float(i)))
        below = ("ground", "base", "table")[i]
        model.add_joint(f"j{i}", "prismatic", below, name, (0, 0, float(i)), axis=(0, 0, 1))
        model.add_spring(f"k{i}", below, name, (0, 0, i - 1.0), (0, 0, float(i)), 100.0)
    model.add_input("push", "base", "z")
    model.add_base_motion("floor", "z")
    model.add_output("base", "base", "z")
    model.add_output("payload", "payload", "z")
    model.add_output("payload acceleration", "payload", "z", quantity="acceleration")
    model.add_output("table acceleration", "table", "z", quantity="acceleration")
    system = model.linearize()
    assert inputs_in_order(system, system.inputs) == ["floor", "push"]
    # the floor's motion is an acceleration: what is of its unit comes first, the payload's before the table's
    assert outputs_in_order(system, system.outputs) == ["payload acceleration", "table acceleration", "payload", "base"]
    space = system.state_space()
    assert outputs_in_order(space, space.outputs) == ["payload acceleration", "table acceleration", "base", "payload"]
