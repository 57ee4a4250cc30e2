"""Uncertain inputs that cannot be used: one line each, nothing drawn and nothing solved."""

from pathlib import Path

import pytest
from test_bad_input import GOOD, refused, shortened, written

import reliability
from reliability import Trial

TITLE = "Uncertain inputs"
INTRO = "What `check` and `run` say of a table `[uncertainty]` that cannot be used."

TWO = (
    'model.friction = { distribution = "uniform", low = 0.2, high = 0.6 }\n'
    'sockets.mine.wall_thickness = { distribution = "normal", mean = "4 mm", sd = "0.3 mm" }\n'
)
FACTOR = 'stiffness = { distribution = "uniform", low = 0.5, high = 2, scales = ["%s"] }\n'


def study(inputs: str, table: str = "cases = 20") -> str:
    """Return a study with uncertain inputs."""
    return f"{GOOD}[uncertainty]\n{table}\n[uncertainty.inputs]\n{inputs}"


def friction(words: str) -> str:
    """Return a study whose friction has a distribution."""
    return study(f"model.friction = {{ {words} }}\n")


def correlated(*lines: str) -> str:
    """Return a study with three inputs and correlations."""
    third = 'model.gamma = { distribution = "uniform", low = 1, high = 2 }\n'
    tables = "".join(f"[[uncertainty.correlations]]\n{line}\n" for line in lines)
    return study(TWO + third) + tables


FRICTION, WALL, GAMMA = "model.friction", "sockets.mine.wall_thickness", "model.gamma"

TRIALS = (
    Trial("no uncertain input", GOOD + "[uncertainty]\n", ("uncertainty.inputs: is missing",)),
    Trial("an empty table of inputs", study(""), ("uncertainty.inputs: is empty",)),
    Trial("a value in the place of a distribution", study("model.friction = 0.4\n"),
          ("uncertainty.inputs: model.friction: is 0.4; it must be a table with distribution",)),
    Trial("a liner's thickness without a liner",
          study('liner.thickness = { distribution = "uniform", low = "3 mm", high = "6 mm" }\n'),
          (": the study has no [liner] to vary; add a table",)),
    Trial("an unknown distribution", friction('distribution = "gauss", mean = 0.4, sd = 0.1'),
          ("model.friction: distribution is 'gauss'; it must be one of 'normal'",)),
    Trial("an unknown key of a distribution", friction('distribution = "uniform", low = 0, hi = 1'),
          ("model.friction: unknown key 'hi'", "'high'")),
    Trial("a mean without a spread", friction('distribution = "normal", mean = 0.4'),
          ("model.friction: give mean and one of sd and cv",)),
    Trial("two spreads", friction('distribution = "normal", mean = 0.4, sd = 0.1, cv = "9 %"'),
          ("model.friction: give mean and one of sd and cv",)),
    Trial("a spread of 0", friction('distribution = "normal", mean = 0.4, sd = 0'),
          ("model.friction: sd is 0.0; it must be above 0",)),
    Trial("a negative spread", friction('distribution = "normal", mean = 0.4, cv = "-9 %"'),
          ("model.friction: cv is '-9 %'; it must be above 0",)),
    Trial("a coefficient of variation of a mean of 0",
          friction('distribution = "normal", mean = 0, cv = "9 %"'),
          ("model.friction: a mean of 0 has no cv; give sd in its place",)),
    Trial("a lognormal mean of 0", friction('distribution = "lognormal", mean = 0, sd = 0.1'),
          ("model.friction: a lognormal distribution has values above 0 only; use normal",)),
    Trial("bounds in the wrong order", friction('distribution = "uniform", low = 0.6, high = 0.2'),
          ("model.friction: low is 0.6; it must be below high, 0.2",)),
    Trial("bounds that leave nothing of a distribution",
          friction('distribution = "normal", mean = 0.4, sd = 0.01, low = 0.6'),
          ("model.friction: low and high leave less than 1 % of the distribution",)),
    Trial("a mode outside its bounds",
          friction('distribution = "triangular", low = 0.2, mode = 0.7, high = 0.6'),
          ("model.friction: mode is 0.7; it must be from low to high",)),
    Trial("a mean of a beta distribution outside its bounds",
          friction('distribution = "beta", low = 0, high = 1, mean = 2, sd = 0.1'),
          ("model.friction: mean is 2.0; it must be between low and high",)),
    Trial("too wide a spread of a beta distribution",
          friction('distribution = "beta", low = 0, high = 1, mean = 0.5, sd = 0.6'),
          ("model.friction: the standard deviation is too large for these bounds",)),
    Trial("one quantile", friction('distribution = "normal", quantiles = { "5 %" = 0.2 }'),
          ("model.friction: quantiles: give two",)),
    Trial("quantiles that fall",
          friction('distribution = "normal", quantiles = { "5 %" = 0.4, "95 %" = 0.2 }'),
          ("model.friction: quantiles: shares must be", "values grow")),
    Trial("quantiles without %",
          friction('distribution = "normal", quantiles = { "5" = 0.2, "95" = 0.4 }'),
          ("model.friction: quantiles: unit '' is unknown; use %",)),
    Trial("one choice", friction('distribution = "choice", values = [0.4]'),
          ("model.friction: values: give two or more that differ",)),
    Trial("weights of other choices",
          friction('distribution = "choice", values = [0.4, 0.5], weights = [1]'),
          ("model.friction: weights: give 2, one for each value",)),
    Trial("values in two dimensions",
          study(f'{WALL} = {{ distribution = "normal", mean = "4 mm", sd = "1 kPa" }}\n'),
          (f"{WALL}: '1 kPa' has another dimension than the input, which is in mm",)),
    Trial("a spread without the unit of its mean",
          study(f'{WALL} = {{ distribution = "normal", mean = "4 mm", sd = 0.3 }}\n'),
          (f"{WALL}: 0.3 has no unit, and another value of the input is in mm",)),
    Trial("an unknown unit",
          study(f'{WALL} = {{ distribution = "normal", mean = "4 furlong", cv = "9 %" }}\n'),
          (f"{WALL}: unit 'furlong' is unknown",)),
    Trial("a parameter that does not exist",
          study('model.fricton = { distribution = "uniform", low = 0.2, high = 0.6 }\n'),
          ("uncertainty.inputs: model.fricton: low: with model.fricton = 0.2: ", "'friction'")),
    Trial("a parameter that is none of the cases'",
          study('study.title = { distribution = "choice", values = ["a", "b"] }\n'),
          ("uncertainty.inputs: study.title: ", "unknown parameter")),
    Trial("an unknown socket of an input",
          study("sockets.min.base = { distribution = 'uniform', low = '1 mm', high = '2 mm' }"),
          ("sockets.min.base: the file does not define 'min'", "'mine'")),
    Trial("a bound that the parameter's own check refuses",
          friction('distribution = "uniform", low = -0.1, high = 0.6'),
          ("uncertainty.inputs: model.friction: low: with model.friction = -0.1: ",
           "greater than or equal to 0")),
    Trial("a drawn value that the parameter's own check refuses",
          friction('distribution = "normal", mean = 0.1, sd = 0.2'),
          ("uncertainty.inputs: model.friction: smallest value drawn: with model.friction = -",
           "greater than or equal to 0")),
    Trial("a choice that the parameter's own check refuses",
          study('model.donning = { distribution = "choice", values = ["gap", "pushed"] }\n'),
          ("uncertainty.inputs: model.donning: values.1: with model.donning = 'pushed'",)),
    Trial("layers that are too thick at a bound",
          study('layers.fat_thickness = { distribution = "normal", mean = "100 %", sd = "9 %",'
                ' high = "500 %" }\n'),
          ("uncertainty.inputs: layers.fat_thickness: high: with layers.fat_thickness = '500.0 %': "
           "layers: fat_thickness: is 500.0 %; it must be 50 % to 200 % of the limb's own",)),
    Trial("a drawn shape that a socket cannot have",
          study('sockets.bumpy.bumps.0.amplitude = { distribution = "normal", mean = "9 mm",'
                ' sd = "5 mm" }\n').replace('sockets = ["TC", "mine"]', 'sockets = ["bumpy"]')
          + '[sockets.bumpy]\nlaw = "normal_offset"\nbase = "0.5 mm"\n'
            'bumps = [{ center = "268 deg", width = "7 deg", amplitude = "1 mm" }]\n',
          ("uncertainty: with sockets.bumpy.bumps.0.amplitude = '", "mm': sockets.bumpy: ")),
    Trial("two inputs with one title",
          study(TWO.replace("}", ', title = "stiff" }')),
          (f"inputs: {WALL}: title: 'stiff' is that of '{FRICTION}', too; give each input its own",
          )),
    Trial("a factor of nothing",
          study('s = { distribution = "uniform", low = 0.5, high = 2, scales = [] }\n'),
          ("uncertainty.inputs: s: scales: is []; it must have at least 1 item",)),
    Trial("too few cases", study(TWO, "cases = 5"),
          ("uncertainty: cases: is 5; a linear chaos in these inputs has 3 terms, which need 6",)),
    Trial("too many cases", study(TWO, "cases = 5000"), ("uncertainty.cases: is 5000", "900")),
    Trial("too few cases to check with", study(TWO, "cases = 20\ncheck = 5"),
          ("check: is 5; give 10 cases or more, or 0 for none",)),
    Trial("an unknown design", study(TWO, 'design = "grid"'),
          ("uncertainty.design: is 'grid'", "'sobol'")),
    Trial("a sweep and uncertain inputs", study(TWO) + "[sweep.grid]\nmodel.gamma = [1.0]\n",
          ("sweep: cannot be combined with uncertainty; remove one of the two",)),
    Trial("a scaled value that the file does not have",
          study(FACTOR % "materials.soft.fat.d1"),
          ("materials.soft.fat.d1: the file has no such value; write it there",)),
    Trial("a scaled value that is no number", study(FACTOR % "model.size"),
          ("scales: model.size: ", "'coarse'")),
    Trial("a factor with a unit",
          study('s = { distribution = "uniform", low = "1 kPa", high = "2 kPa",'
                ' scales = ["materials.soft.fat.mu.0"] }\n'),
          ("s: scales: a factor has no unit, and values are in kPa",)),
    Trial("an input whose name is a formula",
          study((FACTOR % FRICTION).replace("stiffness", '"=1+1"')),
          ("inputs: '=1+1' is no name; use up to 80 letters",)),
    Trial("a parameter of two inputs", study(TWO + FACTOR % FRICTION),
          ("model.friction is changed by 'model.friction' and by 'stiffness'",)),
    Trial("a correlation of an unknown input",
          correlated(f'between = ["{FRICTION}", "model.gama"]\nrank = 0.5'),
          ("correlations.0: no input 'model.gama'; did you mean 'model.gamma'?",)),
    Trial("a correlation of 1", correlated(f'between = ["{FRICTION}", "{WALL}"]\nrank = 1'),
          ("uncertainty.correlations.0.rank: is 1", "less than 1")),
    Trial("an input that is correlated with itself",
          correlated(f'between = ["{FRICTION}", "{FRICTION}"]\nrank = 0.5'),
          ("correlations.0: an input with itself",)),
    Trial("a pair that is correlated twice",
          correlated(*[f'between = ["{FRICTION}", "{WALL}"]\nrank = 0.5'] * 2),
          ("correlations.1: a pair that is listed twice",)),
    Trial("correlations that cannot occur together",
          correlated(f'between = ["{FRICTION}", "{WALL}"]\nrank = 0.9',
                     f'between = ["{WALL}", "{GAMMA}"]\nrank = 0.9',
                     f'between = ["{FRICTION}", "{GAMMA}"]\nrank = -0.9'),
          ("correlations: the matrix is not positive definite", "make one smaller")),
    Trial("a correlated choice",
          study('model.donning = { distribution = "choice", values = ["gap", "expanded"] }\n' + TWO)
          + f'[[uncertainty.correlations]]\nbetween = ["model.donning", "{WALL}"]\nrank = 0.5\n',
          ("correlations.0: 'model.donning' is a choice, which cannot be correlated",)),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    """Return the line that a trial gives."""
    return shortened(refused(written(folder, trial.given)), folder)


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_uncertain_inputs_that_cannot_be_used_are_refused_in_one_line(trial, tmp_path):
    line = said(trial, tmp_path)
    for part in trial.says:
        assert part in line
    assert len(line) < 600
    assert reliability.row(trial, line) in reliability.rows()


def test_the_good_table_is_good(tmp_path, capsys):
    """Or else the trials would show nothing."""
    from calfsocket import cli

    assert cli.main(written(tmp_path, correlated(
        f'between = ["{FRICTION}", "{WALL}"]\nrank = 0.5'))) == 0  # fmt: skip
    listed = capsys.readouterr().out
    assert "a design in uncertain inputs" in listed
    assert "sockets.mine.wall_thickness: normal, mean 4 mm, sd 0.3 mm" in listed
