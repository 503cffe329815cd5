"""The page for those who come from MATLAB has the words of ss, mechss, systune and uss."""

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[1] / "docs" / "pages" / "coming_from_matlab.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in PAGE.splitlines()
        if line.startswith("| `")]  # fmt: skip
WORDS = {
    "ss": """
        A B C D E Offsets Scaled StateName StatePath StateUnit InternalDelay InputDelay OutputDelay InputName
        InputUnit InputGroup OutputName OutputUnit OutputGroup Name Notes UserData Ts TimeUnit SamplingGrid
        ssdata dssdata ss2ss canon gram ctrb obsv balreal hsvd prescale augstate xperm stabsep freqsep c2d d2c
        d2d estim reg place acker lqr lqry lqi lqg kalman kalmd isct isproper isstable hasdelay totaldelay pade
        minreal sminreal series parallel append feedback connect sumblk tfdata zpkdata get set reshape order
        size pole zero tzero pzmap damp dcgain bandwidth bode nyquist nichols sigma step impulse lsim initial
        stepinfo covar freqresp evalfr margin allmargin diskmargin rlocus norm getPeakGain hinfnorm isPassive
        balred reducespec getrom lpvss ltvss""",
    "mechss": """
        M C K B F G D StateInfo SolverOptions mechssOptions mechssdata sparss sparssdata showStateInfo getx0
        xsort spy full interface addInterface assemble""",
    "systune": """
        systune systuneOptions looptune hinfstruct slTuner addPoint addOpening addBlock getTunedValue
        writeBlockValue getIOTransfer getLoopTransfer getSensitivity getCompSensitivity viewGoal evalGoal
        tunableGain tunablePID tunablePID2 tunableSS tunableTF tunableSurface realp genss getBlockValue
        setBlockValue showTunable sampleBlock AnalysisPoint RandomStart MaxIter SoftTol MinDecay MaxRadius
        UseParallel SkipModels Tracking StepTracking StepRejection Transient Gain WeightedGain Variance
        WeightedVariance Overshoot Sensitivity Rejection LoopShape MinLoopGain MaxLoopGain Margins Passivity
        WeightedPassivity ConicSector Poles ControllerPoles Focus Openings""",
    "uss": """
        uss ureal ucomplex ucomplexm ultidyn umargin umat ufrd udyn usample usubs uscale gridureal ucover
        getNominal getLimits actual2normalized normalized2actual lftdata ssbal simplify robstab robgain
        robOptions wcgain wcOptions wcsigma wcdiskmargin mussv musyn dksyn isuncertain NominalValue Uncertainty
        Range PlusMinus Percentage Mode AutoSimplify Bound""",
}


@pytest.mark.parametrize("object_", WORDS)
def test_all_words_of_matlab_have_a_row(object_):
    known = {word for row in ROWS for word in re.findall(r"\w+", " ".join(re.findall(r"`[^`]*`", row[0])))}
    assert [word for word in WORDS[object_].split() if word not in known] == []
