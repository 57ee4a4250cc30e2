"""Claims on damage thresholds, and those that wait for the calibration test."""

from calfsocket.report import names
from calfsocket.report.claims.evidence import SOCKETS, SOFT_TISSUES, Evidence
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import about
from calfsocket.report.damage import Thresholds
from calfsocket.report.table import number

PAPER = Thresholds()
FASCIA_MEASURES = ("amp_log_strain", "shear_log_strain")


def _muscle(e: Evidence, socket: str, material_set: str) -> float:
    return abs(e.value(socket, material_set, "muscle", "shear_log_strain"))


def _fascia(e: Evidence, socket: str, material_set: str) -> dict[str, float]:
    """AMP and shear of fascia: the paper mixes the two."""
    return {
        names.OUTCOMES[outcome]: abs(e.value(socket, material_set, "fascia", outcome))
        for outcome in FASCIA_MEASURES
    }


def _words(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {number(value)}" for name, value in values.items())


@claim("C007")
def damage_risk_volume(e: Evidence) -> Finding:
    """Check that the damage risk volume is that of muscle above 50 % shear strain."""
    rows = e.damage[e.damage.tissue == "muscle"]
    limit = e.thresholds.muscle_shear_pct
    return Finding(
        limit == PAPER.muscle_shear_pct,
        f"muscle with |LE12| > {limit:g} %: "
        + ", ".join(
            f"{row.socket} {names.SETS[row.material_set]} {number(row.area_mm2)} mm²"
            for row in rows.itertuples()
        ),
        f"shear strain above {PAPER.muscle_shear_pct:g} %",
        "another threshold was asked for",
    )


@claim("C093")
def fascia_threshold(e: Evidence) -> Finding:
    """Check that fascia is damaged at 27 % strain in tension."""
    limit = e.thresholds.fascia_strain_pct
    tensile = e.damage[e.damage.outcome == "tensile_log_strain"]
    return Finding(
        limit == PAPER.fascia_strain_pct,
        f"{limit:g} %; largest tensile strain of fascia {number(tensile.level_pct.max())} %",
        f"{PAPER.fascia_strain_pct:g} % in tensile tests",
        "another threshold was asked for",
    )


@claim("C090")
def combined_below_half(e: Evidence) -> Finding:
    """Check that with Combined every shear strain stays below 50 %."""
    largest = {
        f"{socket} {tissue}": abs(e.value(socket, "combined", tissue, "shear_log_strain"))
        for socket in SOCKETS
        for tissue in SOFT_TISSUES
    }
    where = max(largest, key=lambda name: largest[name])
    return Finding(
        largest[where] < PAPER.muscle_shear_pct,
        f"largest {number(largest[where])} % ({where})",
        "below 50 % (largest 49.85 %, TC fat)",
        "above 50 %",
    )


@claim("C091")
def separate_above_half_in_hs(e: Evidence) -> Finding:
    """Check that with Separate muscle passes 50 % shear strain in HS, and only there."""
    ours = {socket: _muscle(e, socket, "separate") for socket in SOCKETS}
    above = [socket for socket, value in ours.items() if value > PAPER.muscle_shear_pct]
    return Finding(
        above == ["HS"],
        f"{_words(ours)} %",
        "TC 46, TSB 45.6, HS 84.1 %",
        f"above 50 %: {', '.join(above) or 'none'}",
    )


@claim("C094")
def fascia_combined_above(e: Evidence) -> Finding:
    """Check that with Combined fascia passes 27 % in TC and HS, reaching 29 %."""
    ours = {socket: _fascia(e, socket, "combined") for socket in ("TC", "HS")}
    largest = {socket: max(values.values()) for socket, values in ours.items()}
    return Finding(
        all(value > PAPER.fascia_strain_pct for value in largest.values())
        and about(max(largest.values()), 29),
        "; ".join(f"{socket}: {_words(values)} %" for socket, values in ours.items()),
        "29 % (TC by shear, HS by AMP)",
        "smaller strains of fascia" if max(largest.values()) < 29 else "larger strains of fascia",
    )


@claim("C095")
def fascia_combined_below(e: Evidence) -> Finding:
    """Check that with Combined fascia stays below 27 % in TSB."""
    ours = _fascia(e, "TSB", "combined")
    return Finding(
        max(ours.values()) < PAPER.fascia_strain_pct,
        f"{_words(ours)} %",
        "AMP 17.94, shear 20.74 %",
        "above 27 %",
    )


@claim("C096")
def fascia_separate_below(e: Evidence) -> Finding:
    """Check that with Separate fascia stays below 27 %; its largest strain, 18 %, is in HS."""
    ours = {socket: max(_fascia(e, socket, "separate").values()) for socket in SOCKETS}
    where = max(ours, key=lambda socket: ours[socket])
    below, near = ours[where] < PAPER.fascia_strain_pct, about(ours[where], 18)
    why = [] if below else ["above 27 %"]
    why += [] if where == "HS" else [f"largest in {where}"]
    c10 = e.laws["separate"]["fascia"]["c10"]
    why += [] if near else [f"C10 is {c10:g} MPa; the paper's stresses and strains need about 0.5"]
    return Finding(
        below and near and where == "HS",
        f"{_words(ours)} %",
        "below 27 %; 18.5 % in HS (shear)",
        "; ".join(why),
    )


@claim("C097")
def verdicts_differ(e: Evidence) -> Finding:
    """Check that a damage verdict would differ between the two sets."""
    flags: dict[str, list[str]] = {}
    for name in names.SETS:
        flags[name] = [
            *(
                f"muscle {socket}"
                for socket in SOCKETS
                if _muscle(e, socket, name) > e.thresholds.muscle_shear_pct
            ),
            *(
                f"fascia {socket}"
                for socket in SOCKETS
                if max(_fascia(e, socket, name).values()) > e.thresholds.fascia_strain_pct
            ),
        ]
    return Finding(
        flags["separate"] != flags["combined"],
        "; ".join(f"{names.SETS[n]}: {', '.join(f) or 'none'}" for n, f in flags.items()),
        "Separate: muscle HS; Combined: fascia TC, fascia HS",
        "no strain passes a threshold in either set"
        if not any(flags.values())
        else "the same tissues pass in both sets",
    )
