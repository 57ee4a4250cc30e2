"""Claims on the section, its regions, the sockets and the mesh."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calfsocket.meshes.curves import ClosedCurve
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.report.claims.evidence import SOCKETS, Evidence, NotChecked
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import ABOUT_COUNT, SAME, THREE_FIGURES, about
from calfsocket.report.damage import gauss_areas
from calfsocket.report.results import free_edges
from calfsocket.report.table import number

PRINTED_AREA_LOSS = 0.05
CLINICAL_AREA_LOSS = (0.03, 0.06)
WALL_MM = 4.5
LIMB_ELEMENTS, SOCKET_ELEMENTS = 26330, 3000
NOT_MODELLED = ("nerve", "lymph")


def _limb(fields: SectionFields) -> np.ndarray:
    return fields.tissue != TISSUES.index("socket")


def _area_loss(e: Evidence) -> dict[str, float]:
    return {name: 1 - face.area / e.skin.area for name, face in e.inner_faces.items()}


def _percents(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {100 * value:.2f} %" for name, value in values.items())


@claim("C009")
def follows_an_illustration(e: Evidence) -> Finding:
    """Check that the section follows Netter's figure just above mid-calf."""
    title = e.limb.title
    return Finding(
        "just above mid-calf" in title and "not traced" not in title,
        title,
        "after Netter, page 98, just above mid-calf",
        "the height is the same, the drawing is our own: anatomical relations, no figure",
    )


@claim("C010")
def segmented_tissues(e: Evidence) -> Finding:
    """Check for six tissues with separate muscles; no nerves, no lymphatics."""
    tissues = sorted({region.tissue for region in e.limb.regions})
    muscles = sum(region.tissue == "muscle" for region in e.limb.regions)
    ignored = not any(word in region.name for region in e.limb.regions for word in NOT_MODELLED)
    return Finding(
        tissues == sorted(("skin", "fat", "fascia", "muscle", "vessel", "bone"))
        and muscles > 1
        and ignored,
        f"{', '.join(tissues)}; {muscles} separate muscles; no nerve, no lymphatic vessel",
        "skin, fat, fasciae, separate muscles, vessels, bones",
    )


@claim("C011")
def three_sockets(e: Evidence) -> Finding:
    """Check for the sockets TC, TSB and HS."""
    shapes = {repr(socket) for socket in e.sockets.values()}
    return Finding(
        tuple(e.sockets) == SOCKETS and len(shapes) == len(SOCKETS),
        f"{', '.join(e.sockets)}; outlines of our own",
        "TC, TSB, HS",
    )


@claim("C012")
def hydrostatic_area(e: Evidence) -> Finding:
    """Check that HS encloses 5 % less than the limb."""
    loss = _area_loss(e)["HS"]
    return Finding(
        abs(loss / PRINTED_AREA_LOSS - 1) <= THREE_FIGURES,
        f"{100 * loss:.3f} %",
        f"{100 * PRINTED_AREA_LOSS:g} %",
    )


@claim("C013")
def clinical_area(e: Evidence) -> Finding:
    """Check that HS takes 3 to 6 % of the volume."""
    low, high = CLINICAL_AREA_LOSS
    loss = _area_loss(e)["HS"]
    return Finding(low <= loss <= high, f"{100 * loss:.2f} %", "3 to 6 %")


@claim("C014")
def wall(e: Evidence) -> Finding:
    """Check that the wall is 4.5 mm thick."""
    ours = {socket.wall_thickness for socket in e.sockets.values()}
    return Finding(
        all(abs(wall - WALL_MM) < SAME for wall in ours),
        " and ".join(f"{wall:g} mm" for wall in sorted(ours)),
        f"{WALL_MM:g} mm",
    )


@claim("C015")
def limb_elements(e: Evidence) -> Finding:
    """Check that the limb has 26 330 elements."""
    counts = [int(_limb(e.results.fields(*key)).sum()) for key in e.results.cases]
    return _count(e, counts, LIMB_ELEMENTS)


@claim("C016")
def socket_elements(e: Evidence) -> Finding:
    """Check that each socket has around 3000 elements."""
    counts = [int((~_limb(e.results.fields(*key))).sum()) for key in e.results.cases]
    return _count(e, counts, SOCKET_ELEMENTS)


def _count(e: Evidence, counts: list[int], paper: int) -> Finding:
    low, high = min(counts), max(counts)
    off = max(abs(count / paper - 1) for count in (low, high))
    return Finding(
        all(about(count, paper, ABOUT_COUNT) for count in (low, high)),
        f"{low}" if low == high else f"{low} to {high}",
        f"{paper}",
        f"{100 * off:.1f} % off with the mesh size '{e.settings['size']}'",
    )


def radial_overlap(skin: ClosedCurve, inner: ClosedCurve) -> np.ndarray:
    """Skin radius less that of the socket's inner face at all polar angles, mm, (720,)."""
    angle = np.radians(np.arange(0, 360, 0.5))

    def radius(curve: ClosedCurve) -> np.ndarray:
        points = curve.evaluate(curve.sample(0.1))
        at = np.arctan2(points[:, 1], points[:, 0])
        order = np.argsort(at)
        return np.interp(angle, at[order], np.linalg.norm(points[order], axis=1), period=2 * np.pi)

    return radius(skin) - radius(inner)


@claim("C018")
def outlines_overlap(e: Evidence) -> Finding:
    """Check that limb and socket overlap before contact, in all sockets."""
    overlap = {name: radial_overlap(e.skin, face) for name, face in e.inner_faces.items()}
    return Finding(
        all(depth.max() > 0 for depth in overlap.values()),
        ", ".join(f"{name} {o.min():.2f} to {o.max():.2f} mm" for name, o in overlap.items()),
        "overlap in all three",
    )


@claim("C042")
def socket_is_smaller(e: Evidence) -> Finding:
    """Check that each socket is smaller than the limb."""
    loss = _area_loss(e)
    return Finding(
        all(value > 0 for value in loss.values()), f"area lost: {_percents(loss)}", "smaller"
    )


@claim("C032")
def muscle_is_largest(e: Evidence) -> Finding:
    """Check that muscle has the largest area."""
    fields = e.any_case().fields
    area = gauss_areas(fields).sum(axis=1)
    total = {
        tissue: area[fields.tissue == TISSUES.index(tissue)].sum()
        for tissue in TISSUES
        if tissue != "socket"
    }
    order = sorted(total, key=lambda tissue: -total[tissue])
    return Finding(
        order[0] == "muscle",
        ", ".join(f"{tissue} {number(total[tissue])} mm²" for tissue in order),
        "muscle largest",
    )


@claim("C045")
def tissues_share_nodes(e: Evidence) -> Finding:
    """Check that soft tissues share nodes: one connected mesh, no two nodes in one place."""
    fields = e.any_case().fields
    cells = fields.cells[_limb(fields)]
    nodes, local = np.unique(cells, return_inverse=True)
    local = local.reshape(cells.shape)
    links = coo_array(
        (np.ones(5 * len(cells)), (np.repeat(local[:, 0], 5), local[:, 1:].ravel())),
        shape=(len(nodes), len(nodes)),
    )
    pieces, _ = connected_components(links, directed=False)
    places = len(np.unique(fields.points[nodes].round(9), axis=0))
    return Finding(
        pieces == 1 and places == len(nodes),
        f"{len(nodes)} nodes in {places} places, {pieces} connected piece",
        "shared nodes",
    )


@claim("C098")
@claim("C104")
def regions_and_tissues(e: Evidence) -> Finding:
    """Check for 27 regions of six tissues, five of them soft."""
    tissues = {region.tissue for region in e.limb.regions}
    soft = tissues - {"bone"}
    n = len(e.limb.regions)
    return Finding(
        (n, len(tissues), len(soft)) == (27, 6, 5),
        f"{n} regions, {len(tissues)} tissues, {len(soft)} soft",
        "27 regions, 6 tissues, 5 soft",
    )


@claim("C101")
def refined_at_thin_fascia(e: Evidence) -> Finding:
    """Check that elements are smaller where the fascia is thin, as at the bones."""
    fields = e.any_case().fields
    size = np.sqrt(gauss_areas(fields).sum(axis=1) * 4 / np.sqrt(3))  # side of an equal triangle
    at_bone = np.isin(fields.cells, fields.cells[fields.tissue == TISSUES.index("bone")]).any(
        axis=1
    )
    fascia = fields.tissue == TISSUES.index("fascia")
    if not (fascia & at_bone).any():
        raise NotChecked("no element of fascia lies at a bone")
    fine = float(np.median(size[fascia & at_bone]))
    coarse = float(np.median(size[fields.tissue == TISSUES.index("muscle")]))
    return Finding(
        fine < coarse,
        f"median side {number(fine)} mm in fascia at the bones, {number(coarse)} mm in muscle",
        "refined at thin fascia",
    )


@claim("C102")
def same_mesh(e: Evidence) -> Finding:
    """Check that geometry and mesh of the limb are the same in all runs."""
    if len(e.results.cases) < 2:
        raise NotChecked("needs two runs to compare")
    meshes = []
    for key in e.results.cases:
        fields = e.results.fields(*key)
        nodes, local = np.unique(fields.cells[_limb(fields)], return_inverse=True)
        meshes.append((fields.points[nodes], local.ravel()))
    first = meshes[0]
    differ = [
        "_".join(key)
        for key, mesh in zip(e.results.cases, meshes, strict=True)
        if not all(np.array_equal(a, b) for a, b in zip(first, mesh, strict=True))
    ]
    n = len(meshes)
    return Finding(
        not differ,
        f"one limb mesh in {n} runs" if not differ else f"{len(differ)} of {n} runs differ",
        "identical",
        f"differs from {'_'.join(e.results.cases[0])}: {', '.join(differ)}",
    )


@claim("C046")
def supports(e: Evidence) -> Finding:
    """Check that the tibia's inner boundary is fixed, the fibula free."""
    case = e.any_case().fields
    ids = {name: region for region, name in case.region_names.items()}
    moved = np.linalg.norm(case.displacement, axis=1)
    held = moved[free_edges(case, case.region == ids["tibia"])].max()
    fibula = moved[case.cells[case.region == ids["fibula"]]].mean()
    return Finding(
        held == 0 and fibula > 0,
        f"tibia's inner boundary moves {held:g} mm, the fibula {number(fibula)} mm",
        "fixed; free",
    )
