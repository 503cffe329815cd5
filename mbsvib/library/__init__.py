"""Ready-made mechanisms: the chapter's families and applications, and cases with closed-form answers.

Every function returns a ``Model`` with named inputs and outputs; the parts can be replaced one by one. ``models()``
lists them, ``build("stewart")`` builds one by its name, ``build("C50RF1")`` a member of a family by the chapter's.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.library._arms import gripper, puma, quadruped, six_link, stanford, two_link
    from mbsvib.library._beams import cantilever, cross_hinge, parallel_guide, singular_beam
    from mbsvib.library._bicycle import bicycle
    from mbsvib.library._dh import from_dh
    from mbsvib.library._families import chain, ladder, tree
    from mbsvib.library._linkages import carpet_scraper, four_bar, hoeken, slider_crank, toggle
    from mbsvib.library._masses import engine_on_mounts, inclined_chain, quarter_car
    from mbsvib.library._pendulums import hinged_rod, pendulum_chain, trifilar_pendulum
    from mbsvib.library._rotors import rotor_stator, sleeping_top
    from mbsvib.library._spatial_linkages import rssr, seven_r
    from mbsvib.library._stewart import cubic_hexapod, stewart, stewart_isolator, wafer_stage

__all__ = [
    "bicycle", "build", "cantilever", "carpet_scraper", "chain", "cross_hinge", "cubic_hexapod", "engine_on_mounts",
    "four_bar", "from_dh", "gripper", "hinged_rod", "hoeken", "inclined_chain", "ladder", "models", "parallel_guide",
    "pendulum_chain", "puma", "quadruped", "quarter_car", "rotor_stator", "rssr", "seven_r", "singular_beam",
    "six_link", "sleeping_top", "slider_crank", "stanford", "stewart", "stewart_isolator", "toggle", "tree",
    "trifilar_pendulum", "two_link", "wafer_stage",
]  # fmt: skip
__dir__ = __all__.copy

# where each function is; a file is imported when one of its functions is asked for
_HOMES = {
    "bicycle": "_bicycle", "cantilever": "_beams", "carpet_scraper": "_linkages", "chain": "_families",
    "cross_hinge": "_beams", "cubic_hexapod": "_stewart", "engine_on_mounts": "_masses",
    "parallel_guide": "_beams", "four_bar": "_linkages", "from_dh": "_dh", "gripper": "_arms",
    "hinged_rod": "_pendulums", "hoeken": "_linkages", "inclined_chain": "_masses", "ladder": "_families",
    "pendulum_chain": "_pendulums", "puma": "_arms", "quadruped": "_arms", "quarter_car": "_masses",
    "rotor_stator": "_rotors", "rssr": "_spatial_linkages", "seven_r": "_spatial_linkages",
    "singular_beam": "_beams", "six_link": "_arms", "sleeping_top": "_rotors", "slider_crank": "_linkages",
    "stanford": "_arms", "stewart": "_stewart", "stewart_isolator": "_stewart", "toggle": "_linkages",
    "tree": "_families", "trifilar_pendulum": "_pendulums", "two_link": "_arms", "wafer_stage": "_stewart",
}  # fmt: skip
_FAMILIES = {"C": "chain", "T": "tree", "L": "ladder"}
# the chapter's rule: family, number of bodies or layers, joint, F, number of spring-dampers at every joint
_CHAPTER_NAME = re.compile(r"([CTL])([1-9][0-9]{0,8})([RPCS])F([0-9]{1,8})")

_DESCRIPTIONS = {
    "chain": "10 bodies in line on revolute joints (C10RF1), 10 DOF",
    "tree": "binary tree of 5 layers, 31 bodies on revolute joints (T5RF1), 31 DOF",
    "ladder": "5 closed loops, one upon the other, 15 bodies on revolute joints (L5RF1), 5 DOF",
    "stewart": "Stewart platform on universal and spherical joints, 13 bodies, 6 DOF",
    "stewart_isolator": "Stewart isolator on flexures at both ends of its legs, 12 DOF",
    "cubic_hexapod": "payload on six springs along edges of a cube, decoupled, 6 DOF",
    "quadruped": "quadruped robot, floating trunk and four legs of three parts, 18 DOF",
    "quarter_car": "body, wheel, suspension with an actuator, and a road that moves, 2 DOF",
    "inclined_chain": "8 masses and 9 springs on an inclined rail, 8 DOF",
    "hinged_rod": "rod that hangs from a hinge, 1 DOF",
    "pendulum_chain": "3 point masses, each hung from the one above, 3 DOF",
    "trifilar_pendulum": "plate on three wires, 3 DOF",
    "four_bar": "four-bar linkage under gravity, held by a spring, 1 DOF",
    "slider_crank": "slider-crank under gravity, held by a spring, 1 DOF",
    "toggle": "toggle near its stretched pose, whose slider leans on a spring, 1 DOF",
    "hoeken": "Hoeken's linkage, a four-bar whose crank turns fully, 1 DOF",
    "carpet_scraper": "Hoeken's linkage with a pantograph, 7 bodies in 3 closed loops, 1 DOF",
    "rssr": "crank and rocker on crossed axes, joined by a coupler between balls, 2 DOF",
    "seven_r": "the same linkage of seven revolute joints, 1 DOF",
    "two_link": "arm of two slender links, 2 DOF",
    "gripper": "palm with two fingers of one and two links, a tree, 4 DOF",
    "six_link": "arm of six equal links on axes at right angles, 6 DOF",
    "puma": "PUMA 560 robot arm, 6 DOF",
    "stanford": "Stanford robot arm with a slide, 6 DOF",
    "rotor_stator": "rotor that spins in a stator on soft mounts, 7 DOF",
    "singular_beam": "clamped beam with two arms that swing through their stretched pose, 42 DOF",
    "sleeping_top": "top that spins upright on its tip, 3 DOF",
    "cantilever": "steel tube of 20 beam elements with a mass at its tip, 120 DOF",
    "parallel_guide": "stage on two parallel leaf springs, 6 DOF",
    "cross_hinge": "disk that turns on two crossed leaf springs, 6 DOF",
    "wafer_stage": "long and short stroke, and a metrology frame on isolators, 21 DOF",
    "engine_on_mounts": "engine whose weight four rubber mounts carry, 6 DOF",
}
# Built by name, and not listed: their equations are of first order, which is not what all that takes a model expects.
_ROLLING = ("bicycle",)


def models() -> dict[str, tuple[Callable[[], Model], str]]:
    """Return the models of the library.

    Returns
    -------
    dict of str to (function, str)
        By name: a function that builds the model with its default values, and one line that describes it. ``bicycle``
        is built by name as well, but not among them: on rolling wheels its equations are of first order, without M, C
        and K, which not all that takes a model can have.
    """
    return {name: (_function(name), words) for name, words in _DESCRIPTIONS.items()}


def build(name: str) -> Model:
    """Build a model of the library by its name.

    Parameters
    ----------
    name : str
        One of ``models()``, or the chapter's name of a member of a family: C (chain), T (tree) or L (ladder), its
        size, the joint R, P, C or S, F, and the number of spring-dampers at a joint, as in ``"C50RF1"``.

    Returns
    -------
    Model
        The model with its default values.

    Raises
    ------
    ModelError
        If there is no such model.
    """
    if name in _DESCRIPTIONS or name in _ROLLING:
        return _function(name)()
    match = _CHAPTER_NAME.fullmatch(str(name))
    if match:
        letter, size, joint, springs = match.groups()
        return _function(_FAMILIES[letter])(int(size), joint, springs=int(springs))
    hint = nearest(str(name), _DESCRIPTIONS)
    raise ModelError(
        f"library: there is no model {name!r}.{hint} Known: "
        f"{', '.join(_DESCRIPTIONS)}, and the families' members such as C50RF1.", element=str(name), field="name",
    )  # fmt: skip


def _function(name: str) -> Callable[..., Model]:
    function: Callable[..., Model] = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    return function


def __getattr__(name: str) -> Any:
    """Import a model's function on first use."""
    if name not in _HOMES:
        from mbsvib.common.misplaced import absent

        raise absent(__name__, name)
    globals()[name] = value = _function(name)
    return value
