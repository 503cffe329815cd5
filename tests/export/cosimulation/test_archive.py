"""Archives of plant and controller, run by fmpy and by Ecos."""

import zipfile
from xml.etree import ElementTree

import control
import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd

import mbsvib as mv
import mbsvib_export as mx
from tests.export.cosimulation.loops import controller, plant, speed_feedback
from tests.export.fmu.test_importers import ecos

H, COUNT = 1e-3, 100


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_the_description_is_valid_and_whole(version, tmp_path):
    path = mx.to_ssp(plant(), speed_feedback(), tmp_path / "loop.ssp", version=version)
    system = read_ssd(str(path)).system  # fmpy holds it against the schema of the standard
    assert [item.name for item in system.elements] == ["plant", "controller"]
    assert {(item.name, item.kind) for item in system.connectors} == {
        ("d", "input"), ("y", "output"), ("z", "output"), ("F", "output"),
    }  # fmt: skip
    assert len(system.connections) == 6
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist() == ["SystemStructure.ssd", "resources/plant.fmu", "resources/controller.fmu"]
        (tmp_path / "plant.fmu").write_bytes(archive.read("resources/plant.fmu"))
    assert mx.check_export(tmp_path / "plant.fmu", plant()).passed


def described(path):
    """Connectors of the whole and of its parts, connections and units, straight from the text of an archive."""
    with zipfile.ZipFile(path) as archive:
        top = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    names = {"ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
             "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon"}  # fmt: skip
    system = top.find("ssd:System", names)

    def ports(element):
        return [(item.get("name"), item.get("kind"), item.find("ssc:Real", names).get("unit"))
                for item in element.findall("ssd:Connectors/ssd:Connector", names)]  # fmt: skip

    parts = {item.get("name"): ports(item) for item in system.findall("ssd:Elements/ssd:Component", names)}
    links = [tuple(item.get(key) for key in ("startElement", "startConnector", "endElement", "endConnector"))
             for item in system.findall("ssd:Connections/ssd:Connection", names)]  # fmt: skip
    units = {item.get("name"): item.find("ssc:BaseUnit", names).attrib
             for item in top.findall("ssd:Units/ssc:Unit", names)}  # fmt: skip
    if not ports(system):  # an empty list of connectors is none of the standard's
        assert system.find("ssd:Connectors", names) is None
    return ports(system), parts, links, units, float(top.find("ssd:DefaultExperiment", names).get("stopTime"))


@pytest.mark.parametrize("outer", [True, False])
def test_connectors_connections_and_units(outer, tmp_path):
    """All that is there, in its order: an output of both sides has one name in each, and two names outside."""
    law = control.ss([[-900.0]], [[1.0, 0.5]], [[-400.0], [2.0]], np.zeros((2, 2)), inputs=["y", "r"],
                     outputs=["F", "z"], name="law")  # fmt: skip
    files = [mx.to_fmu(system, tmp_path / f"{side}.fmu").path for side, system in (("plant", plant()), ("law", law))]
    result = described(mx.to_ssp(*files, tmp_path / "loop.ssp", outer=outer))
    ports, parts, links, units, stop = result
    inside = {"plant": [("F", "input", "N"), ("d", "input", "N"), ("y", "output", "m/s"), ("z", "output", "m")],
              "controller": [("y", "input", None), ("r", "input", None), ("F", "output", None), ("z", "output", None)]}
    assert parts == inside
    assert links[:2] == [("controller", "F", "plant", "F"), ("plant", "y", "controller", "y")]
    assert ports == ([("d", "input", "N"), ("y", "output", "m/s"), ("z", "output", "m"), ("r", "input", None),
                      ("F", "output", None), ("z (signal)", "output", None)] if outer else [])  # fmt: skip
    assert links[2:] == ([(None, "d", "plant", "d"), ("plant", "y", None, "y"), ("plant", "z", None, "z"),
                          (None, "r", "controller", "r"), ("controller", "F", None, "F"),
                          ("controller", "z", None, "z (signal)")] if outer else [])  # fmt: skip
    of_one = {"factor": "1.0", "offset": "0.0"}
    assert units == {"N": {"kg": "1", "m": "1", "s": "-2"} | of_one, "m/s": {"m": "1", "s": "-1"} | of_one,
                     "m": {"m": "1"} | of_one}  # fmt: skip
    stops = [float(read_model_description(str(file)).defaultExperiment.stopTime) for file in files]
    assert stops[0] != stops[1]
    assert stop == max(stops)


def truth():
    """The loop with a unit disturbance, by the check of co-simulation's own numpy master."""
    from mbsvib_export.cosimulation.masters import loop_of

    space, law = plant().state_space(), speed_feedback()
    units = [tuple(np.asarray(getattr(item, label)) for label in "ABCD") for item in (space, law)]
    coupling = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])  # (F, d, y) take (y, z, F)
    loop = loop_of(units, coupling, np.eye(3)[:, 1:2], H)
    z, rows = loop.start(np.zeros(3), np.ones(1), False), []
    for _ in range(COUNT):
        z = loop.step("jacobi", z, np.ones(1))
        rows.append(z[3:5])
    return np.array(rows)


@pytest.mark.slow
def test_ecos_runs_it(tmp_path):
    package = ecos()
    path = mx.to_ssp(plant(), speed_feedback(), tmp_path / "loop.ssp", outer=False)
    result = []
    with package.EcosSimulation(ssp_path=str(path), step_size=H) as simulation:
        simulation.init()
        simulation.set_real("plant::d", 1.0)
        for _ in range(COUNT):
            simulation.step()
            result.append([simulation.get_real("plant::y"), simulation.get_real("plant::z")])
    assert np.abs(result - truth()).max(axis=0) == pytest.approx(0, abs=1e-12)


def test_fmpy_runs_it(tmp_path):
    """Its master sets an input only where somebody asks for one, so this one is a function of time."""
    path = mx.to_ssp(plant(), speed_feedback(), tmp_path / "loop.ssp")
    result = simulate_ssp(str(path), stop_time=COUNT * H, step_size=H, input={"d": lambda t: 1.0})
    exact = truth()
    size = np.abs(exact).max(axis=0)
    last = np.array([result[name][-1] for name in ("y", "z")])
    assert (np.abs(last - exact[-1]) < 0.05 * size).all()  # another order of calls, the same loop


def test_units_have_one_name_each(tmp_path):
    """Both have an output z: the whole calls the second one something else."""
    law = controller(-1.0, outputs=("z",))
    path = mx.to_ssp(plant(), law, tmp_path / "loop.ssp", connections={"F": "z"}, name="a & b")
    system = read_ssd(str(path)).system
    assert system.name == "a & b"
    assert {"z", "z (signal)"} < {item.name for item in system.connectors}


def test_refusals_leave_nothing(tmp_path):
    for path, words in ((tmp_path / "loop.zip", "ends in .ssp"), (tmp_path / "none" / "loop.ssp", "cannot be written")):
        with pytest.raises(mv.ExportError, match=words):
            mx.to_ssp(plant(), speed_feedback(), path)
    with pytest.raises(mv.ExportError, match="no connection"):
        mx.to_ssp(plant(), controller(-1.0, outputs=("u",)), tmp_path / "loop.ssp")
    assert list(tmp_path.iterdir()) == []
