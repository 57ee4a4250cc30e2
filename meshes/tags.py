"""Integer tags of the mesh, the one place that knows them; everywhere else regions have names."""

SOCKET = "socket"
LINER = "liner"
#: The limb as one region, in simple bodies.
LIMB = "limb"
SKIN_SURFACE = "skin_surface"
#: Face of a liner that meets the socket, or the skin.
LINER_SURFACE = "liner_surface"
SOCKET_INNER = "socket_inner"
SOCKET_OUTER = "socket_outer"
TIBIA_MEDULLARY = "tibia_medullary"
SIDES = "sides"

#: Tag of the socket ring. The limb's regions carry the ids of their data file, all below it.
SOCKET_ID = 100
#: Tag of a liner.
LINER_ID = 101

#: Boundary name -> facet tag; disjoint from the region ids, so that no number means two things.
BOUNDARIES = {
    SKIN_SURFACE: 201,
    SOCKET_INNER: 202,
    SOCKET_OUTER: 203,
    TIBIA_MEDULLARY: 204,
}

#: The same with the sides of a piece of tissue, that slide along y: its layers continue beyond,
#: mirrored; and with the free face of a liner.
FACETS = BOUNDARIES | {SIDES: 205, LINER_SURFACE: 206}
