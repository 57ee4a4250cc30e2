"""What the solution of one case is: its fields and contact, its record, its files."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import calfsocket
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing, write_json
from calfsocket.io.schema import read_json
from calfsocket.plotting.names import CURVE_PICTURE, FORMATS, PICTURE
from calfsocket.postprocess import mesh_error
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.levels import levels
from calfsocket.postprocess.quantities import Maximum, Quantities, contact_quantities, summary
from calfsocket.postprocess.series import SERIES_FILE, write_series
from calfsocket.postprocess.vtu import FIELDS_FILE, read_fields, write_fields
from calfsocket.simulation.record import CaseRecord, Checks

if TYPE_CHECKING:
    import pandas as pd
    import xarray
    from matplotlib.figure import Figure

RESULT_FILE = "result.json"
CONTACT_FILE = "contact.csv"
LINER_FILE = "liner_contact.csv"
STEPS_FILE = "steps.csv"
CURVE_FILE = "loading.csv"

STATE = "state"
"""Column of tables, where a case has stages of loading."""

SECOND_MESH = "second_mesh"
"""Folder, in that of a case, of its result on a second mesh."""


@dataclass(frozen=True, eq=False)
class Result:
    """The last equilibrium of a case; its result, where that is `solved`.

    Attributes
    ----------
    record : CaseRecord
        Names of the case, how it was solved, and the checks of the solution.
    fields : SectionFields
        Displacement, stress and strain of the section.
    line : ContactLine
        Contact along the skin; the traction of the liner where one is bonded to it.
    steps : DataFrame
        Load steps: step, load, converged, reason, newton_iterations, residual_N_per_mm, seconds,
        negative_modes (of the last one).
    lining : ContactLine, optional
        Contact of the socket along a liner that is bonded to the limb.
    states : mapping of str to Result
        State at the end of each stage of loading, by its name; this one is the donned socket.
    curve : DataFrame, optional
        Every equilibrium of the stages: stage, force, moment, displacement and rotation of the
        socket, changes of volume, share of the contact that slips, work of friction and of the
        loads (N mm for each mm of limb length, since the socket was donned).
    second : Result, optional
        The case on a second mesh, by which numbers have a mesh error.

    Examples
    --------
    ``Result.load("results/HS_separate").summary()`` has the largest stresses and strains of every
    tissue and where they are; ``.plot()`` draws the section and the contact pressure around it.
    """

    record: CaseRecord
    fields: SectionFields
    line: ContactLine
    steps: "pd.DataFrame"
    lining: ContactLine | None = None
    states: Mapping[str, "Result"] = field(default_factory=dict)
    curve: "pd.DataFrame | None" = None
    second: "Result | None" = None

    @property
    def solved(self) -> bool:
        """Whether this is the state at full load, and not where a case has stopped."""
        return self.record.solved

    @property
    def checks(self) -> Checks:
        """Numbers by which the solution is judged.

        Raises
        ------
        ValueError
            When the record has none.
        """
        if self.record.checks is None:
            raise ValueError(f"{self.record.name}: the record contains no checks")
        return self.record.checks

    @property
    def contact(self) -> "pd.DataFrame":
        """Contact along the skin, one row a point: the arrays of `ContactLine` as columns."""
        return self.line.table

    @cached_property
    def quantities(self) -> Quantities:
        """Stresses and strains at Gauss points and nodes, with levels and maxima by tissue."""
        return Quantities.of(self.fields)

    @cached_property
    def contact_levels(self) -> dict[str, Maximum]:
        """Largest and mean contact pressure, and the share of the skin in contact."""
        return contact_quantities(self.fields, self.line)

    @cached_property
    def _summary(self) -> "pd.DataFrame":
        return self.with_mesh_error(
            lambda of: summary(of.quantities, of.line, of.contact_levels, of.lining)
        )

    def summary(self) -> "pd.DataFrame":
        """Return the largest level of every quantity in every tissue, and the contact's numbers.

        Returns
        -------
        DataFrame
            tissue, quantity, value, unit, x_mm, y_mm (site in the reference section, mm) and
            region; mesh_error where there is a `second` mesh, in the unit of the value. See
            `calfsocket.postprocess.quantities` for what a level is.
        """
        return self._summary.copy()

    @cached_property
    def _levels(self) -> "pd.DataFrame":
        return self.levels_with_error(lambda of: levels(of.quantities, of.line, of.lining))

    def levels(self) -> "pd.DataFrame":
        """Return mean, rms and the levels that 50, 95, 99 and 99.9 % of the area stay below.

        Of every quantity of the summary in every tissue and region, by undeformed area, and of
        pressure and shear along the skin in contact, by undeformed length. These numbers settle
        when the mesh is refined, which largest values need not.

        Returns
        -------
        DataFrame
            tissue, region (empty for the whole tissue), quantity, unit (kPa or %), area_mm2 or
            length_mm; mean, rms; below_50 to below_99.9, in magnitude where a sign is a direction;
            upper_50 to upper_99.9 and lower_50 to lower_99.9, the levels with their sign that
            a share of the area stays below and above. `calfsocket.postprocess.levels` defines
            a level. Where there is a `second` mesh each of these has a column with its error,
            rms_mesh_error and so on, by `calfsocket.postprocess.mesh_error`.

        Examples
        --------
        ``result.levels().query("tissue == 'skin' and region == ''")["below_99.9"]``
        """
        return self._levels.copy()

    def on_second_mesh(self, second: "Result") -> "Result":
        """Return this result with that of a second mesh, and its states with theirs.

        Raises
        ------
        InputError
            Where the two meshes have nearly as many triangles.
        """
        mesh_error.times_change(self.checks.cells, second.checks.cells)
        states = {
            name: replace(state, second=second.states.get(name))
            for name, state in self.states.items()
        }
        return replace(self, second=second, states=states)

    @property
    def times_change(self) -> float:
        """By what the change of a number to the second mesh is multiplied; NaN without one."""
        if self.second is None:
            return float("nan")
        return mesh_error.times_change(self.checks.cells, self.second.checks.cells)

    def with_mesh_error(self, table: "Callable[[Result], pd.DataFrame]") -> "pd.DataFrame":
        """Return a table with rows as of the summary; with mesh_error where a second mesh is."""
        if self.second is None:
            return table(self)
        return mesh_error.of_maxima(table(self), table(self.second), self.times_change)

    def levels_with_error(self, table: "Callable[[Result], pd.DataFrame]") -> "pd.DataFrame":
        """Return a table with rows as of the levels; with their errors where a second mesh is."""
        if self.second is None:
            return table(self)
        return mesh_error.of_levels(table(self), table(self.second), self.times_change)

    def of_states(self, table: "Callable[[Result], pd.DataFrame]") -> "pd.DataFrame":
        """Return a table of the case; with a column `state` where it has stages of loading."""
        import pandas as pd

        if not self.states:
            return table(self)
        parts = []
        for each in (self, *self.states.values()):
            rows = table(each).copy()
            rows.insert(0, STATE, each.record.state_name)
            parts.append(rows)
        return pd.concat(parts, ignore_index=True)

    def plot(self) -> "Figure":
        """Draw the deformed section with its effective stress and the contact pressure around."""
        from calfsocket.plotting import case  # half a second, which solving may do without

        title = case.case_title(*self.record.key)
        if self.record.state:
            title += f", {self.record.state.stage}"
        if not self.solved:
            title += f", stopped at load {self.checks.load:.3f}"
        return case.draw(self.quantities, self.line, title, self.record.frame)

    def draw(self, folder: Path | str, form: str = "png") -> Path:
        """Write the picture of `plot` as picture.png into a folder; return its path.

        Those of states are in their folders; loading.png has the curves of the stages. `form` is
        png, svg or pdf.
        """
        from calfsocket.plotting import case, loading

        if form not in FORMATS:
            raise InputError(f"pictures: form is {form!r}; allowed: {', '.join(FORMATS)}")
        for name, state in self.states.items():
            state.draw(Path(folder) / name, form)
        if self.curve is not None:
            loading.save(loading.draw(self.curve), Path(folder), form)
        return case.save(self.plot(), Path(folder), form)

    def to_xarray(self) -> "xarray.Dataset":
        """Return fields and contact as labelled arrays with units, `.to_netcdf(path)` writes them.

        Returns
        -------
        xarray.Dataset
            As of `calfsocket.postprocess.dataset`. Where the case has stages of loading, those
            arrays that differ have a dimension `state`: "donned", and the names of the stages. Its
            attributes name the case, and the load, 0 to 1, of this equilibrium.

        Examples
        --------
        ``result.to_xarray().stress_kPa.sel(component="33").mean("gauss_point")``
        """
        import pandas as pd
        import xarray

        from calfsocket.postprocess.dataset import dataset

        every = [dataset(each.quantities, each.line) for each in (self, *self.states.values())]
        made = every[0]
        if self.states:
            names = [each.record.state_name for each in (self, *self.states.values())]
            made = xarray.concat(
                every,
                pd.Index(names, name=STATE),
                data_vars="all",
                # The undeformed section is the same in all states.
                coords="minimal",
                compat="override",
                join="override",
            )
            made[STATE].attrs["long_name"] = "donned, and stages of loading"
        socket, material_set = self.record.key
        return made.assign_attrs(
            title=self.record.name,
            socket=socket,
            material_set=material_set,
            load_reached=self.checks.load,
            source=f"calfsocket {calfsocket.__version__}",
        )

    def save(self, folder: Path | str) -> Path:
        """Write fields.vtu, contact.csv, steps.csv and result.json; return the folder.

        fields.pvd, too, where there are fields of load steps or stages, and liner_contact.csv where
        a liner is bonded to the limb; each state of a stage has them in a folder of its own below,
        and so has the result on a second mesh, in second_mesh/,
        and loading.csv has the curve. All of them say at which load this is an equilibrium.
        result.json is written last: a folder that has one is whole.
        """
        folder = Path(folder)
        load = self.checks.load
        (folder / SERIES_FILE).unlink(missing_ok=True)
        write_fields(folder, self.quantities, load)
        tables = {CONTACT_FILE: self.contact.assign(load=load), STEPS_FILE: self.steps}
        if self.lining is not None:
            tables[LINER_FILE] = self.lining.table.assign(load=load)
        for name, table in tables.items():
            with replacing(folder / name) as temporary:
                table.to_csv(temporary, index=False)  # all digits
        for name, state in self.states.items():
            (folder / name).mkdir(exist_ok=True)
            replace(state, second=None).save(folder / name)
        if self.second is not None:
            (folder / SECOND_MESH).mkdir(exist_ok=True)
            self.second.save(folder / SECOND_MESH)
        if self.curve is not None:
            with replacing(folder / CURVE_FILE) as temporary:
                self.curve.to_csv(temporary, index=False)
        write_series(folder, load, tuple(self.states))
        write_json(folder / RESULT_FILE, self.record.model_dump(mode="json"))
        return folder

    @classmethod
    def load(cls, folder: Path | str, stopped: bool = False) -> "Result":
        """Read what `save` wrote, without loss.

        Parameters
        ----------
        folder : Path
            Folder of the case.
        stopped : bool
            Whether to read a case that has stopped below its full load, too: its last equilibrium.

        Raises
        ------
        InputError
            When a file is missing or cannot be read, or the case did not reach its full load.
        """
        folder = Path(folder)
        record = read_json(folder / RESULT_FILE, CaseRecord)
        if not (record.solved or stopped):
            raise InputError(
                f"{folder}: the case stopped at load {record.load or 0:.4f} of 1, so that it has "
                "no results; Result.load(folder, stopped=True) reads its last equilibrium"
            )
        return cls.read(folder, record)

    @staticmethod
    def remove(folder: Path | str) -> None:
        """Remove what `save` and `draw` wrote; other files stay."""
        for path in Path(folder).glob(f"*/{RESULT_FILE}"):
            Result.remove(path.parent)
            with suppress(OSError):  # it holds something else
                path.parent.rmdir()

        # result.json first: without it the rest is no result.
        tables = (RESULT_FILE, FIELDS_FILE, CONTACT_FILE, STEPS_FILE, CURVE_FILE, LINER_FILE)
        pictures = [f"{name}.{form}" for name in (PICTURE, CURVE_PICTURE) for form in FORMATS]
        for name in (*tables, SERIES_FILE, *pictures):
            (Path(folder) / name).unlink(missing_ok=True)

    @classmethod
    def read(cls, folder: Path, record: CaseRecord) -> "Result":
        """Read the files of a case whose record is known."""
        import pandas as pd

        try:
            path = folder / FIELDS_FILE
            fields = read_fields(folder)
            path = folder / CONTACT_FILE
            line = ContactLine.from_table(pd.read_csv(path, float_precision="round_trip"))
            lining = None
            if (path := folder / LINER_FILE).is_file():
                lining = ContactLine.from_table(pd.read_csv(path, float_precision="round_trip"))
            path = folder / STEPS_FILE
            steps = pd.read_csv(path, float_precision="round_trip", dtype={"reason": str})
            steps = steps.fillna({"reason": ""})
            curve = None
            if record.states:
                path = folder / CURVE_FILE
                curve = pd.read_csv(path, float_precision="round_trip")
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{path}: cannot be read ({error}); solve the case again") from None
        states = {
            name: cls.read(folder / name, read_json(folder / name / RESULT_FILE, CaseRecord))
            for name in record.states
        }
        result = cls(record, fields, line, steps, lining, states, curve)
        if record.has_second_mesh:
            own = folder / SECOND_MESH
            second = cls.read(own, read_json(own / RESULT_FILE, CaseRecord))
            result = result.on_second_mesh(second)
        return result
