"""Example data: Table 1's laws with noise. The paper does not print the data that it fitted.

``python3 -m calfsocket.fit.synthetic FOLDER`` writes the files of ``examples/`` again.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calfsocket.io.files import replacing
from calfsocket.materials.laws import Law
from calfsocket.materials.modes import Mode, engineering_stress
from calfsocket.materials.tissues import FASCIA, KPA, MUSCLE

POINTS = 26

NOISE = 0.02
"""Standard deviation of the noise, as a share of the largest stress."""


@dataclass(frozen=True)
class Example:
    """A test of a tissue's law of Table 1, taken as incompressible."""

    tissue: str
    law: Law
    mode: Mode
    first: float  #: stretch
    last: float
    seed: int  #: of the noise
    with_sd: bool = True  #: whether the file has the column stress_sd

    def csv(self) -> str:
        """Text of the file."""
        stretch = np.linspace(self.first, self.last, POINTS)
        exact = engineering_stress(self.law, self.mode, stretch) / KPA
        sd = NOISE * float(np.max(np.abs(exact)))
        noise = sd * np.random.default_rng(self.seed).standard_normal(POINTS)
        lines = [
            f"# SYNTHETIC, not measured: {self.tissue}'s law of Table 1 with {NOISE:.0%} noise",
            f"# Incompressible, {self.mode}; normal noise of standard deviation {sd:.4g} kPa,",
            f"# seed {self.seed}. Made by `python3 -m calfsocket.fit.synthetic`.",
            "mode, stretch, engineering_stress [kPa]" + self.with_sd * ", stress_sd [kPa]",
        ]
        lines += [
            f"{self.mode}, {point:.4f}, {stress:.6g}" + self.with_sd * f", {sd:.4g}"
            for point, stress in zip(stretch, exact + noise, strict=True)
        ]
        return "\n".join(lines) + "\n"


EXAMPLES: dict[str, Example] = {
    "fascia_uniaxial_synthetic.csv": Example(
        "fascia", FASCIA, "uniaxial", 1.0, 1.25, 1, with_sd=False
    ),
    "muscle_uniaxial_synthetic.csv": Example("muscle", MUSCLE, "uniaxial", 0.7, 1.3, 2),
    "muscle_planar_synthetic.csv": Example("muscle", MUSCLE, "planar", 1.0, 0.7, 3),
}


if __name__ == "__main__":
    for name, example in EXAMPLES.items():
        with replacing(Path(sys.argv[1]) / name) as temporary:
            temporary.write_text(example.csv(), encoding="utf-8")
