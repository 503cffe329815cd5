"""Files that the tests read."""

import numpy as np

HEAD = '<compiler angle="radian"/><option gravity="0 0 -9.81"><flag contact="disable"/></option>'

# Two hinges and a slide in one body, a welded part, a ball with a spring; servo, motor, jet, tendons, armature.
ARM = """
<worldbody><site name="wall" pos="1 0 1"/>
  <body name="arm" pos="0.1 0.2 0.3" euler=".1 .2 .3">
    <joint name="yaw" axis="0 1 0.2" armature=".1" stiffness="2000" springref=".1" damping="2"/>
    <joint name="roll" axis="1 0 0" pos="0 .1 0" stiffness="3000"/>
    <joint name="reach" type="slide" axis="1 0 1" stiffness="4000" armature=".7"/>
    <geom type="capsule" size=".05" fromto="0 0 0 0.3 .1 .5"/>
    <body name="plate" pos=".3 .1 .5"><geom type="box" size=".05 .1 .1" euler=".3 0 0"/><site name="tip" pos="0 0 .1"/>
      <body name="hand" pos="0 0 .1">
        <joint name="wrist" type="ball" pos="0 0 .05" stiffness="500" damping="3" armature=".02"/>
        <geom type="capsule" size=".04" fromto="0 0 0 .1 .2 .3"/><site name="finger" pos=".1 .2 .3"/>
      </body></body></body>
</worldbody>
<actuator>
  <position name="servo" joint="roll" kp="1000" kv="3" gear="2"/><motor name="drive" joint="yaw" gear="3"/>
  <motor name="jet" site="finger" gear="1 0 0 0 0 2"/>
</actuator>
<tendon>
  <fixed name="belt" stiffness="300" damping="4" armature=".5"><joint joint="yaw" coef="2"/><joint joint="roll"
    coef="-.5"/></fixed>
  <spatial name="string" stiffness="500" springlength=".2" damping="7"><site site="finger"/>
    <site site="wall"/></spatial>
</tendon>"""

# Slides and a hinge in one body, a pendulum below with weight partly lifted, a servo on a belt of two slides.
GANTRY = """
<worldbody>
  <body name="car" pos="0 0 2">
    <joint name="x" type="slide" axis="1 0 0" armature="3" stiffness="900" damping="5"/>
    <joint name="y" type="slide" axis="0 1 0" stiffness="700"/>
    <joint name="turn" axis="0 0 1" stiffness="30" ref=".2" springref=".3"/>
    <inertial pos=".05 0 .02" mass="4" diaginertia=".02 .03 .04" euler=".1 .2 .3"/>
    <body name="rod" gravcomp=".3" pos=".1 0 0"><joint name="swing" axis="0 1 0" springref=".2" stiffness="2"/>
      <inertial pos=".02 0 -.4" mass="1.5" fullinertia=".09 .08 .03 .001 .002 .003"/></body></body>
</worldbody>
<tendon><fixed name="belt"><joint joint="x" coef=".6"/><joint joint="y" coef="-.8"/></fixed></tendon>
<actuator>
  <general name="belt" tendon="belt" gainprm="200" biastype="affine" biasprm="3 -200 -8" gear="1.5"/></actuator>"""

# Two fingers whose ends a string with a slack band pulls together; dampers by control, gains that vary with length.
HAND = """
<worldbody>
  <body name="thumb" pos="-.1 0 0"><joint name="t" axis="0 1 0" stiffness="5" damping=".1"/>
    <geom type="capsule" size=".01" fromto="0 0 0 0 0 .2"/><site name="a" pos="0 0 .2"/></body>
  <body name="index" pos=".1 0 0"><joint name="i" axis="0 -1 0" stiffness="4"/>
    <geom type="capsule" size=".01" fromto="0 0 0 0 0 .25"/><site name="b" pos="0 0 .2"/></body>
</worldbody>
<tendon><spatial name="string" springlength="0 .15" stiffness="100" damping=".3"><site site="a"/>
  <site site="b"/></spatial></tendon>
<actuator><general name="odd" joint="t" gaintype="affine" gainprm="2 1 -.3" biastype="affine" biasprm=".1 -2 -.2"/>
  <position name="hold" tendon="string" kp="20" kv=".5"/></actuator>"""

FLOATING = """
<worldbody><body name="ship"><joint name="float" type="free" stiffness="50" damping="2" armature=".3"/>
  <inertial pos=".05 .1 .02" mass="4" fullinertia=".06 .05 .04 .001 .002 .003"/>
  <body name="mast" pos="0 0 .4"><joint name="bend" axis="1 0 0" stiffness="80"/><geom type="capsule" size=".01"
    fromto="0 0 0 0 0 .5"/></body></body></worldbody>"""

# Crank, coupler and rocker; the loop is closed by connect.
FOUR_BAR = """
<worldbody>
  <body name="crank"><joint name="a" axis="0 1 0" stiffness="20" damping=".1"/>
    <geom type="capsule" size=".02" fromto="0 0 0 .1 0 .3"/>
    <body name="coupler" pos=".1 0 .3"><joint name="b" axis="0 1 0" stiffness="3" armature=".01"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .5 0 .1"/></body></body>
  <body name="rocker" pos=".7 0 0"><joint name="d" axis="0 1 0" stiffness="5"/>
    <geom type="capsule" size=".02" fromto="0 0 0 -.1 0 .4"/></body>
</worldbody>
<equality><connect name="c" body1="coupler" body2="rocker" anchor=".5 0 .1"/></equality>"""

# Two links that hang side by side, with a bar between their ends: it swings without turning.
SWING = """
<worldbody>
  <body name="left"><joint name="a" axis="0 1 0"/><inertial pos="0 0 -.3" mass="2" diaginertia=".02 .03 .01"/>
    <body name="bar" pos="0 0 -.5"><joint name="b" axis="0 1 0"/>
      <inertial pos=".2 0 0" mass="3" diaginertia=".02 .04 .03"/><site name="end" pos=".4 0 0"/></body></body>
  <body name="right" pos=".4 0 0"><joint name="d" axis="0 1 0"/>
    <inertial pos="0 0 -.3" mass="2" diaginertia=".02 .03 .01"/><site name="tip" pos="0 0 -.5"/></body>
</worldbody>
<equality><connect name="c" site1="end" site2="tip"/></equality>"""

ROD = '<inertial pos="0 0 -.4" mass="2" diaginertia=".03 .03 .001"/>'
PENDULUM = f'<worldbody><body name="rod"><joint name="hinge" axis="0 1 0"/>{ROD}</body></worldbody>'


def body(inner, name="b", at="0 0 0"):
    return f'<body name="{name}" pos="{at}">{inner}</body>'


def world(*inner, more=""):
    return f"<worldbody>{''.join(inner)}</worldbody>{more}"


def write(folder, words, name="scene.xml", head=HEAD):
    path = folder / name
    path.write_text(f"<mujoco>{head}{words}</mujoco>", encoding="utf-8")
    return path


def random_tree(seed):
    """Bodies with one to three joints of any kind, wound springs, armature, weights lifted in part."""
    rng = np.random.default_rng(seed)
    hinges = []

    def numbers(*values):
        return " ".join(f"{value:.6g}" for value in values)

    def joints(name):
        rotates, words = False, ""
        for i in range(rng.integers(1, 4)):
            kind = rng.choice(["hinge", "slide", "ball"] if not rotates else ["hinge", "slide"])
            if kind == "ball" and i:  # MuJoCo has no ball beside hinges
                kind = "slide"
            rotates |= kind == "hinge" or kind == "ball"
            label, soft = f"{name}{i}", 1.0 if kind != "slide" else 10.0
            if kind != "ball":
                hinges.append(label)
            words += (f'<joint name="{label}" type="{kind}" pos="{numbers(*rng.normal(0, 0.1, 3))}" axis="'
                      f'{numbers(*rng.normal(size=3))}" stiffness="{numbers(soft * rng.uniform(60, 200))}" damping="'
                      f'{numbers(rng.uniform(0, 3))}" armature="{numbers(rng.choice([0.0, rng.uniform(0, 0.1)]))}"'
                      + (f' springref="{numbers(rng.normal(0, 0.05))}"/>' if kind != "ball" else "/>"))  # fmt: skip
            if kind == "ball":
                break
        return words

    def tree(depth, name):
        inner = "".join(tree(depth - 1, f"{name}{letter}") for letter in "ab"[: rng.integers(1, 3)]) if depth else ""
        return (f'<body name="{name}" pos="{numbers(*rng.normal(0, 0.3, 3))}" euler="{numbers(*rng.normal(0, 1, 3))}" '
                f'gravcomp="{numbers(rng.choice([0.0, 0.4]))}">{joints(name)}<geom type="ellipsoid" size="'
                f'{numbers(*rng.uniform(0.03, 0.1, 3))}" pos="{numbers(*rng.normal(0, 0.1, 3))}" euler="1 2 3"/>'
                f'<site name="{name}" pos="{numbers(*rng.normal(0, 0.1, 3))}"/>{inner}</body>')  # fmt: skip

    bodies = tree(2, "t")
    ends = '<site site="t"/><site site="taa"/>'
    # along one branch only: MuJoCo drops what armature of a tendon does between branches
    chain = [name for name in hinges if name[:-1] in ("t", "ta", "taa")]
    terms = "".join(f'<joint joint="{name}" coef="{numbers(rng.normal())}"/>' for name in chain)
    fixed = f'<fixed name="sum" stiffness="50" springlength=".01" damping="2" armature=".2">{terms}</fixed>'
    return (f"<worldbody>{bodies}</worldbody><tendon>{fixed if terms else ''}<spatial name='line' stiffness='80' "
            f"springlength='.2' damping='1'>{ends}</spatial></tendon>")  # fmt: skip
