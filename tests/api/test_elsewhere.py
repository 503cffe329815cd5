"""Names that users of other programs expect: the error tells which function or object answers them."""

import re

import pytest

import mbsvib as mv
import mbsvib_export
from mbsvib.api.elsewhere import FUNCTIONS, OF_MODELS

MODEL = mv.library.quarter_car()
SPACE = MODEL.linearize().state_space()
LOOP = MODEL.linearize().feedback([[-1.0]], "travel", "actuator")
CASES = [*((MODEL.linearize(), name, hint) for name, hint in FUNCTIONS.items()),
         *((MODEL, name, hint) for name, hint in OF_MODELS.items())]  # fmt: skip


@pytest.mark.parametrize(("owner", "name", "hint"), CASES, ids=lambda value: value if isinstance(value, str) else "")
def test_the_error_tells_what_answers_a_name(owner, name, hint):
    with pytest.raises(AttributeError, match=re.escape(hint)):
        getattr(owner, name)
    assert not hasattr(owner, name)
    assert name not in dir(owner)


def test_state_spaces_and_loops_tell_it_too():
    assert SPACE.A.shape == (4, 4)
    for owner, called in ((SPACE, "space"), (LOOP, "loop")):
        with pytest.raises(AttributeError, match=rf"mbsvib\.plots\.bode\({called}\)"):
            owner.bode  # noqa: B018
        assert "bode" not in dir(owner)
    with pytest.raises(AttributeError, match=r"loop\.state_space\(\)\.A"):
        LOOP.A  # noqa: B018


def test_what_is_told_exists():
    scope = {"model": MODEL, "system": MODEL.linearize(), "mbsvib": mv, "mbsvib_export": mbsvib_export}
    told = [re.findall(r"(?:system|model|mbsvib|mbsvib_export)\.[\w.()]*[\w)]", hint) for *_, hint in CASES]
    for words in told:
        assert words
        for word in words:
            eval(re.sub(r"\((system|model|path|t)\b.*", "", word), scope)
