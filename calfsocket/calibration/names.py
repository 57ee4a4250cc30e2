"""Names of a calibration's files and curves."""

FOLDER = "calibration"
"""Folder of a calibration beside a study's results."""

RESULT_FILE, CURVES_FILE, FIGURE = "calibration.json", "curves.csv", "figure3"

SEPARATE, FITTED, TABLE1, IGNORED = (
    "separate",
    "combined_fitted",
    "combined_table1",
    "fascia_ignored",
)
"""Curves: the Separate set; one law for muscle and fascia, fitted or the paper's; muscle's law."""

LABELS = {
    SEPARATE: "Separate",
    FITTED: "Combined, fitted",
    TABLE1: "Combined, Table 1",
    IGNORED: "fascia ignored",
}
