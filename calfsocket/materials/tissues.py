"""Table 1 of the paper: the law of every tissue.

Every number stands here as printed, with its unit. Checks on the table: D1 = 3 (1 - 2 nu) /
(mu1 (1 + nu)) with nu = 0.495 (note under Table 1, after Silber and Then, equation 3.273) gives all
four printed D1 to three figures when mu1 is the initial shear modulus, which it is in Abaqus's form
2 mu/alpha^2 and not in equation (1) as printed, mu/alpha. Tables 2 and 4 say the same.
"""

from typing import Literal

from calfsocket.materials.laws import Hencky, Ogden, Yeoh

IN_SETS = ("skin", "fat", "fascia", "muscle", "bone", "vessel", "socket")
"""Tissues that a material set has a law of; the socket is called one, too."""

TISSUES = (*IN_SETS, "liner")
"""What a region of a section may be; a liner brings its own law (`materials.liner`)."""

FasciaC10 = Literal["printed", "tables"]

# Inside, stresses are MPa = N/mm^2.
PA, KPA, MPA, GPA = 1e-6, 1e-3, 1.0, 1e3

# The paper names its sources by author; DOIs are those of the works that fit name and subject.
# Payne et al.; compression tests of Shergold et al. 2006, doi:10.1016/j.ijimpeng.2004.11.010.
SKIN = Ogden(mu=(220.0 * KPA,), alpha=(12.0,), d1=9.12e-8 / PA)
# Payne et al.; compression tests of Comley and Fleck 2012, doi:10.1016/j.ijimpeng.2011.12.009.
FAT = Ogden(mu=(1.700 * KPA,), alpha=(26.0,), d1=1.18e-5 / PA)
# Al-Dirini et al. 2016, doi:10.1007/s10439-016-1560-3.
MUSCLE = Ogden(mu=(1.907 * KPA,), alpha=(4.6,), d1=1.05e-5 / PA)
# Fitted by the authors to Pavan et al., figure 3, mediolateral direction; incompressible.
FASCIA = Yeoh(c10=4.91 * MPA, c20=13.59 * MPA, c30=18.97 * MPA)
# The paper's shear stresses and strains of fascia (Tables 2 and 4) need a tenth of the printed C10.
FASCIA_C10: dict[FasciaC10, float] = {"printed": 4.91 * MPA, "tables": 0.491 * MPA}
# Calibrated in section 2.2.1 of the paper against muscle and fascia together.
MUSCLE_AND_FASCIA = Ogden(mu=(12.0 * KPA,), alpha=(14.0,), d1=1.67e-6 / PA)
# Wall and blood together.
VESSEL = Hencky(e=10.00 * KPA, nu=0.49)
# Hoffmeister et al., tibia loaded transversely.
BONE = Hencky(e=11.80 * GPA, nu=0.394)
# PETG of test sockets.
SOCKET = Hencky(e=459.0 * MPA, nu=0.4)
