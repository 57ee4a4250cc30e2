"""The command ``fit``: a law from stress-stretch data, and the files that it is written to."""

from argparse import ArgumentTypeError, Namespace
from pathlib import Path

from calfsocket.commands import command, first_rank, option
from calfsocket.io.errors import InputError


def cycle_number(word: str) -> int | str:
    """Read the number of a cycle."""
    if word == "last" or (word.isdecimal() and int(word)):
        return word if word == "last" else int(word)
    raise ArgumentTypeError(f"'{word}' is not a number from 1, or last")


@command(
    option("data", type=Path, nargs="+", metavar="DATA.csv", help="a file for each test"),
    option("--law", required=True, metavar="LAW", help="yeoh, ogden or neo-hookean"),
    option(
        "--terms",
        type=int,
        metavar="N",
        help="terms of the law, 1 to 3 (default: yeoh 3, ogden 1)",
    ),
    option(
        "--mode",
        choices=("uniaxial", "equibiaxial", "planar", "shear"),
        help="kind of test, unless the file has a column `mode`; shear is simple shear (default: "
        "uniaxial)",
    ),
    option(
        "--stress",
        choices=("engineering", "cauchy"),
        help="meaning of a column `stress` (default: engineering)",
    ),
    option(
        "--branch",
        choices=("loading", "unloading"),
        help="which curve of a file with both; loading leads away from a stretch of 1",
    ),
    option(
        "--cycle",
        type=cycle_number,
        metavar="N",
        help="which cycle of a file with several, from 1, or last",
    ),
    option(
        "--nu",
        type=float,
        metavar="NU",
        help="Poisson's ratio from which Ogden's D1 follows; 0.5: incompressible (default: 0.495)",
    ),
    option(
        "--free-signs",
        action="store_true",
        help="allow negative coefficients; the law may then be unstable, which is checked",
    ),
    option("--out", type=Path, default=Path("fit"), metavar="DIR", help="default: %(default)s"),
    description="""\
Fit a law to stress-stretch data (section 2.2 of the paper).

DATA is a CSV file of one test with names and units of its columns in the first line:

  # Strips of crural fascia, mediolateral
  stretch, engineering_stress [kPa]
  1.00, 0.0
  1.02, 310.5

Columns: one of stretch, strain [-] or [%], true_strain, and of simple shear shear_strain or
shear_angle [deg]; one of engineering_stress, cauchy_stress and stress, with a unit: Pa, kPa, MPa,
N/mm^2, psi, ...; stress_sd, the standard deviation, and mode if wanted. Others are not used. They
are separated by semicolons, tabs, commas or blanks; numbers may have decimal commas. Compression is
negative. Several files are fitted together. The material is taken as incompressible.

Where a file has loading and unloading (the stretch goes back by more than 5 % of its range), one of
the two is chosen by --branch, and of several cycles one by --cycle.

Coefficients stay at 0 or above, where the law is stable at every strain. Searches start from many
exponents; the fit reports what the data do not determine.
""",
    epilog="""\
examples:
  python3 -m calfsocket fit examples/fascia_uniaxial_synthetic.csv --law yeoh
  python3 -m calfsocket fit examples/muscle_*_synthetic.csv --law ogden --out muscle
  python3 -m calfsocket fit loop.csv --law ogden --branch loading --cycle last
  python3 -m calfsocket --material muscle=muscle/material.toml

results:
  material.toml  the law, for `--material TISSUE=FILE` of the study
  fit.json       parameters, covariance, other minima, stability, data and versions
  curve.csv      data, fit and residual of every point
  fit.png, .pdf  the figure
""",
)
@first_rank
def fit(arguments: Namespace) -> None:
    """Fit a law to stress-stretch data."""
    from calfsocket.fit import figure, tables
    from calfsocket.fit.data import read_test
    from calfsocket.fit.diagnostics import diagnostics
    from calfsocket.fit.families import family
    from calfsocket.fit.regression import fit
    from calfsocket.io.files import replacing, write_json
    from calfsocket.io.tables import FLOAT_FORMAT
    from calfsocket.materials.file import write_material
    from calfsocket.materials.stability import stable_ranges

    law = arguments.law
    terms = arguments.terms if arguments.terms is not None else 3 if law == "yeoh" else 1
    if law == "yeoh" and arguments.nu is not None:
        raise InputError("--nu: Yeoh's law is incompressible; omit it")
    nu = 0.495 if arguments.nu is None else arguments.nu
    chosen = family(law, terms)
    options = arguments.mode, arguments.stress, arguments.branch, arguments.cycle
    tests = [read_test(path, *options) for path in arguments.data]
    fitted = fit(chosen, tests, nu, arguments.free_signs)
    stable = stable_ranges(fitted.law)
    notes = diagnostics(fitted, stable)

    settings = {"law": law, "terms": terms, "free_signs": arguments.free_signs}
    if law != "yeoh":
        settings["nu"] = nu
    out = arguments.out
    try:
        record = tables.fit_record(fitted, stable, notes, settings)
        write_json(out / "fit.json", record)
        with replacing(out / "curve.csv") as temporary:
            rows = tables.curve_rows(fitted)
            rows.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
        provenance = {
            "made_by": f"calfsocket fit, {chosen.title}",
            "data": [test.path.name for test in tests],
            "data_title": [test.title for test in tests],
            "data_sha256": [test.sha256 for test in tests],
            "data_branch": [test.branch for test in tests],
            "r_squared": fitted.r_squared,
            "diagnostics": notes,
            **settings,
        }
        write_material(out / "material.toml", fitted.law, provenance)
        figure.draw(fitted, notes, out / "fit.png", out / "fit.pdf")
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written ({error.strerror})") from error
    print(tables.summary(fitted, stable, notes))
    print(f"written to {out}: material.toml, fit.json, curve.csv, fit.png, fit.pdf")
